// SPDX-License-Identifier: GPL-2.0-or-later
// Compares a program on the page with the answers of pkm: marks, time, curves, path, traces, frames.
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { HOME, answer, asText, box, check, file, given, ini, near, opened, ownTool, rested, table, view } from "./browser.mjs";

// Limits that LinuxCNC does not have, so that it runs the programs to their ends: narrow cones of one leg of each mechanism,
// and a tilt limit of the hexapod.
const PROGRAMS = {
  "lathe-mirrored": { legs: [1, 5], cone: 0.4, text: "G21 G90 M52 P1\nG1 X20 F2000\nG1 B10\nG1 X0 U10\nG4 P0.5\nG1 C10 W2650\nG1 B-5\nG1 U0 C0 B0\nM2\n" },
  tripod: { legs: [0], cone: 8, text: "G20 G90 M52 P1\nG0 X5 Y2 Z3\nG1 X6 F60\nG1 Y2.8 Z3.5\nG1 X4 F20\nG1 X5 Y2\nM2\n" },
  hexapod: { legs: [], cone: 0, text: "G21 G90\nG1 X10 F1000\nG1 X20\nG1 A24 B24\nG1 A0 B0\nT2 M6 G43\nG1 X30 Y-7 Z245 C5\nM2\n" },
};

const reply = (machine) => file(join(machine, `${machine}.ini`));

/** Opens the page of a machine with narrow cones and its program. */
async function withProgram(page, machine) {
  const { legs, cone, text } = PROGRAMS[machine];
  mkdirSync(file(machine), { recursive: true });
  copyFileSync(ini(machine).replace(/ini$/, "tbl"), reply(machine).replace(/ini$/, "tbl"));
  writeFileSync(reply(machine), legs.reduce((all, n) => all.replace(new RegExp(`(\\[LEG_${n}\\][^[]*?BASE_CONE = )\\S+`), `$1${cone}`), readFileSync(ini(machine), "utf8")));
  writeFileSync(file(`${machine}-reply.ngc`), text);
  return opened(page, `${machine}-reply`, reply(machine), file(`${machine}-reply.ngc`));
}

const state = (page, which = 0) => asText(page, (which) => window.pkm.state(which), which);

/** Classes of page.css that only other pages have. */
const OTHER_CLASSES = ["bad", "error", "fits", "recording", "warning"];

/** Checks the header, that each control has a name, and that the workspace, which takes long, is not computed; returns the
 * classes of all elements. */
async function layout(page, machine, mechanisms) {
  const { header, unnamed, classes, hasReason } = await page.evaluate(() => ({
    header: [document.title, ...["h1", ".about", ".hash"].map((words) => document.querySelector(`header ${words}`).textContent)],
    unnamed: Array.from(document.querySelectorAll("input, select, button, canvas.picture")).filter((control) => !control.ariaLabel && (control.tagName === "SELECT" || !(control.closest("label") ?? control).textContent)).length,
    classes: Array.from(document.querySelectorAll("[class]"), (one) => Array.from(one.classList)).flat(),
    hasReason: document.querySelector(".reason[role=status]") !== null,
  }));
  const hashes = mechanisms.map(({ scene }) => `0x${scene.geometry_hash.toString(16).padStart(8, "0")}`);
  check(String(header) === String([machine, machine, `${machine}-reply.ngc`, `geometry ${hashes.join(", ")}`]), `${machine}: header ${header}`);
  const boxes = await page.locator("label.box").allTextContents();
  check(boxes.length === 5, `${machine}: ${boxes}`);
  check(unnamed === 0 && hasReason, `${machine}: ${unnamed} controls have no name`);
  check(!(await box(page, "workspace at these angles").isChecked()) && (await page.evaluate(() => window.pkm.workspace())).length === 0, `${machine}: the workspace is computed`);
  return classes;
}

/** Checks that each finding of preflight has a mark at its time, on its line, of its mechanism. */
async function marks(page) {
  let count = 0;
  const styles = readFileSync(join(HOME, "page/src/page.css"), "utf8").replaceAll(/"[^"]*"/g, "").match(/(?<=\.)[a-z][a-z-]*(?=[ .:,{>])/g);
  const classes = new Set(OTHER_CLASSES);
  for (const machine of Object.keys(PROGRAMS)) {
    const mechanisms = await withProgram(page, machine);
    const { breaks, warnings } = answer("preflight", reply(machine), file(`${machine}-reply.ngc`));
    check(breaks.length > 0, `${machine}: nothing is found`);
    check((await page.locator(".verdict").textContent()) === "does not fit", `${machine}: the verdict is not shown`);
    const found = await page.locator(".finding").allTextContents();
    const expected = breaks.map(({ line, text }) => [line, text]);
    check(found.length === breaks.length && expected.every(([line, text], k) => found[k].startsWith(`line ${line}: `) && found[k].endsWith(text)), `${machine}: ${found} where ${JSON.stringify(expected)} is expected`);
    const warned = await page.locator(".found .warning").allTextContents();
    check(warned.length === warnings.length && warnings.every(({ line, text }, k) => warned[k] === (line ? `line ${line}: ${text}` : text)), `${machine}: ${warned} where ${JSON.stringify(warnings)} is expected`);
    const broken = await page.evaluate(() => Array.from(document.querySelectorAll(".space .broken b"), (b) => Number(b.textContent)));
    check(String(broken) === String([...new Set(breaks.map(({ line }) => line))].sort((a, b) => a - b)), `${machine}: lines ${broken} are marked`);
    const end = await page.evaluate(() => window.pkm.end());
    const flags = await page.evaluate(() => Array.from(document.querySelectorAll(".mark"), (flag) => [flag.title, parseFloat(flag.style.left)]));
    for (const [k, one] of breaks.entries()) {
      await page.locator(".finding").nth(k).click();
      const which = Number(one.of_second ?? 0);
      const now = await state(page, which);
      check(now.line === one.line, `${machine}: finding ${k} leads to line ${now.line}`);
      const flag = flags.find(([title]) => title === found[k]);
      check(flag, `${machine}: finding ${k} has no flag`);
      near(flag[1], (100 * now.time) / end, 1e-4, `${machine}: flag of finding ${k}`);
      if (one.seconds !== null && one.seconds !== undefined) near(now.time, one.seconds, 1e-9, `${machine}: time of finding ${k}`);
      else {
        // The page samples the line at thousands of moments, and pkm may omit points of it.
        const size = Math.max(...mechanisms[which].scene.legs.flatMap(({ base }) => base.map(Math.abs)));
        const { coordinates, table: letters } = mechanisms[which].scene;
        now.pose.forEach((value, n) => (coordinates + letters).includes("XYZABC"[n]) && near(value, one.pose[n], n < 3 ? 2e-3 * size : 0.05, `${machine}: pose of finding ${k}`));
      }
      count += 1;
    }
    (await layout(page, machine, mechanisms)).forEach((name) => classes.add(name));
    const lines = await page.evaluate(() => Array.from(document.querySelectorAll(".space > div"), (row) => row.textContent));
    PROGRAMS[machine].text.split("\n").forEach((text, k) => check(lines[k] === `${k + 1}${text}`, `${machine}: line ${k + 1} is shown as ${lines[k]}`));
  }
  const unused = styles.filter((name) => !classes.has(name));
  check(styles.length > 40 && unused.length === 0, `no element has the style ${unused}`);
  return `${count} findings`;
}

/** Checks that pose, tool and extra axes at the end are those of the program's last lines, for the second mechanism, too. */
async function ends(page) {
  await withProgram(page, "hexapod");
  const end = () => asText(page, () => (window.pkm.go(window.pkm.end()), [0, 1].slice(0, window.pkm.mechanisms().length).map((which) => window.pkm.state(which))));
  const [{ pose, tool, tip }] = await end();
  // Tool 2 of the tool table is 65 mm long. The tolerance covers the points that the page omits.
  near([...pose, ...tool], [30, -7, 310, 0, 0, 5, 0, 0, 65], 0.05, "the end of the hexapod's program");
  near(tip, [30, -7, 245], 0.05, "the tip at the end");
  writeFileSync(file("letters.ngc"), "G21 G90\nG1 F2000 X10 Y440 Z1010 B3 U-20 V460 W2590 C-4\nM2\n");
  await opened(page, "letters-end", ini("lathe-mirrored"), file("letters.ngc"));
  const [first, second] = await end();
  near(first.pose, [10, 440, 1010, 0, 3, 0], 0.1, "the first mechanism at the end");
  near(second.pose, [-20, 460, 2590, 0, -4, 0], 0.1, "the second mechanism at the end");
  writeFileSync(file("extra.ngc"), "G21 G90\nG1 F2000 C30 W790 X5\nM2\n");
  await opened(page, "extra-end", ini("lathe-counter-spindle"), file("extra.ngc"));
  const [{ extra }] = await end();
  near([extra.C, extra.W], [30, 790], 0.05, "the extra axes at the end");
  const groups = await asText(page, () => window.pkm.curves());
  const curve = (group, axis) => groups.find(({ name }) => name === group)?.curves.find(({ name }) => name === axis);
  for (const [axis, group, unit, value] of [["axis C", "joints in degrees", "degrees", 30], ["axis W", "joints", "mm", 790]]) {
    check(curve(group, axis)?.unit === unit, `${axis} is no curve of ${group}`);
    near(curve(group, axis).values.at(-1), value, 0.05, `${axis} at the end`);
    check(Math.max(...curve("speeds", axis).values) > 1, `${axis} has no speed`);
  }
}

/** Returns the seconds that a page may be late under load. */
const late = () => (given.code ? 60 : 1.5);

async function play(page) {
  await withProgram(page, "tripod");
  const end = await page.evaluate(() => window.pkm.end());
  const time = async () => (await state(page)).time;
  const button = page.locator("button.play");
  const texts = PROGRAMS.tripod.text.split("\n");
  for (const share of [0, 0.2, 0.5, 0.9, 1]) {
    await page.evaluate((time) => window.pkm.go(time), share * end);
    const [now, reply] = [await state(page), await page.locator(".bar output").textContent()];
    const [, at, all, line, speed] = /^([\d.]+) of ([\d.]+) s · line (\d+) · ([\d.]+) inch\/s$/.exec(reply) ?? [];
    near([Number(at), Number(all)], [share * end, end], 0.051, `what is reply: ${reply}`);
    check(Number(line) === now.line && (await page.locator(".space .now").allTextContents()).join() === (now.line ? `${line}${texts[line - 1]}` : ""), `line ${now.line}: ${reply}`);
    const [a, b] = await asText(page, ([from, to]) => [from, to].map((time) => (window.pkm.go(time), window.pkm.state().pose)), [Math.max(share * end - 0.005, 0), Math.min(share * end + 0.005, end)]);
    const step = Math.min(share * end + 0.005, end) - Math.max(share * end - 0.005, 0);
    near(Number(speed), Math.hypot(...[0, 1, 2].map((k) => a[k] - b[k])) / step, 0.051, `speed at ${share}`);
  }
  for (const rate of ["0.1 ×", "1 ×", "5 ×"]) {
    await page.evaluate(() => window.pkm.go(0));
    await page.locator("select[aria-label=speed]").selectOption(rate);
    const began = Date.now();
    check((await button.evaluate((button) => (button.click(), button.textContent))) === "pause", "the button says play while it plays");
    await page.waitForTimeout(700);
    const shown = await time();
    const seconds = (Date.now() - began) / 1000;
    const most = Math.min(seconds * parseFloat(rate), end);
    check(shown > 0 && shown <= most + 1e-9 && shown >= Math.min(Math.max(seconds - late(), 0.02), end / parseFloat(rate)) * parseFloat(rate), `${rate}: ${shown} s after ${seconds} s`);
    // On a busy computer the program may have ended since: then the button would start it again.
    await button.evaluate((button) => button.textContent === "pause" && button.click());
    const rest = await time();
    await page.waitForTimeout(100);
    check((await button.textContent()) === "play" && (await time()) === rest, `${rate}: it plays on`);
  }
  await page.locator("select[aria-label=speed]").selectOption("100 ×");
  await page.evaluate(() => document.querySelector("canvas.picture").dispatchEvent(new KeyboardEvent("keydown", { key: " " })));
  await page.waitForFunction((end) => window.pkm.state().time === end, end, { timeout: 10000 });
  check((await button.textContent()) === "play", "it plays on behind the end");
  await page.locator("select[aria-label=speed]").selectOption("0.1 ×");
  await button.click();
  await page.waitForTimeout(100);
  check((await time()) < end / 2, "at the end it does not begin again");
  // A click is lost if its row is replaced meanwhile.
  const isSame = await page.evaluate(() => {
    const [row, { time, line }] = [document.querySelector(".space > div"), window.pkm.state()];
    for (let n = 1; n < 4; n++) window.pkm.go(time + 1e-4 * n);
    return line === window.pkm.state().line && row === document.querySelector(".space > div");
  });
  check(isSame, "the elements of rows are replaced while the line stays");
  for (const [name, act] of [["home", () => page.getByRole("button", { name: "home", exact: true }).click()], ["a slider", () => page.locator("input[type=range][aria-label=X]").fill("5.5")], ["the slider of the time", () => page.locator("input[aria-label=time]").fill("1")]]) {
    if ((await button.textContent()) === "play") await button.click();
    await act();
    const { time, pose } = await state(page);
    await page.waitForTimeout(50);
    check((await button.textContent()) === "play" && (await state(page)).time === time, `${name} does not stop the program`);
    if (name === "a slider") near(pose[0], 5.5, 0, "X set by its slider");
    if (name === "the slider of the time") near(time, 1, 0, "time set by its slider");
  }
  await page.locator(".space > div").nth(3).click();
  const now = await state(page);
  check(now.line === 4 && (await button.textContent()) === "play" && Number(await page.locator("input[aria-label=time]").inputValue()) === now.time, `line 4 leads to line ${now.line}`);
  check(now.pose.every((value, k) => Math.abs(value - [6, 2, 3, 0, 0, 0][k]) < 0.02), `line 4 begins at ${now.pose}`);
  return `${end.toFixed(1)} s of program`;
}

/** Checks findings in a called file and on lines that LinuxCNC does not reach, in a program with ends of lines of Windows. */
async function calls(page) {
  const folder = file("calls");
  mkdirSync(folder, { recursive: true });
  copyFileSync(ini("hexapod").replace(/ini$/, "tbl"), join(folder, "hexapod.tbl"));
  writeFileSync(join(folder, "hexapod.ini"), readFileSync(ini("hexapod"), "utf8").replace("[RS274NGC]\n", `[RS274NGC]\nSUBROUTINE_PATH = ${folder}\n`));
  const lines = ["G21 G90 M52 P1", "G1 X10 F1000", "o<called> call", "G1 X500", "G1 X0 Y500", "M2"];
  writeFileSync(file("calls.ngc"), lines.join("\r\n"));
  writeFileSync(join(folder, "called.ngc"), "o<called> sub\nG1 X12 F1000\nG1 A24 B24\nG1 A0 B0\no<called> endsub\nM2\n");
  await opened(page, "calls", join(folder, "hexapod.ini"), file("calls.ngc"));
  const { breaks, files } = answer("preflight", join(folder, "hexapod.ini"), file("calls.ngc"));
  check(breaks.some(({ file }) => file === 1) && breaks.filter(({ file, seconds }) => file === 0 && seconds === null).length > 1, `findings: ${JSON.stringify(breaks)}`);
  const seen = await asText(page, () => {
    const lines = (words) => Array.from(document.querySelectorAll(words), (b) => Number(b.textContent));
    const found = { marks: window.pkm.marks().map(({ text }) => text), flags: Array.from(document.querySelectorAll(".mark"), ({ title }) => title), broken: lines(".space .broken b"), text: Array.from(document.querySelectorAll(".space > div"), (row) => row.textContent) };
    window.pkm.go(0.5 * window.pkm.end());
    found.start = window.pkm.state();
    found.led = Array.from(document.querySelectorAll(".finding"), (finding) => {
      finding.click();
      const { time, line } = window.pkm.state();
      return { text: finding.textContent, time, line, now: lines(".space .now b") };
    });
    return found;
  });
  const words = breaks.map(({ file, line, limit, text }) => `${file ? `${files[file].split("/").pop()}, ` : ""}line ${line}: ${limit}: ${text}`);
  check(String(seen.led.map(({ text }) => text)) === String(words), `${JSON.stringify(seen.led)} where ${words} is expected`);
  check(String(seen.marks) === String(words), `marks: ${seen.marks}`);
  check(String(seen.flags) === String(words.filter((_, k) => breaks[k].seconds !== null)), `flags: ${seen.flags}`);
  check(String(seen.broken) === String([...new Set(breaks.filter(({ file }) => file === 0).map(({ line }) => line))].sort((a, b) => a - b)), `lines ${seen.broken} are marked`);
  check(String(seen.text) === String(lines.map((text, k) => `${k + 1}${text}`)), `lines: ${seen.text}`);
  let { time, line } = seen.start;
  breaks.forEach((one, k) => {
    const led = seen.led[k];
    // A finding in the program leads to its line even if the machine has not reached it; one in a called file does not.
    if (one.seconds !== null) [time, line] = [one.seconds, led.line];
    if (one.file === 0) line = one.line;
    near([led.time, led.line], [time, line], 1e-9, `finding ${k}`);
    check(String(led.now) === (line ? String(line) : ""), `finding ${k}: line ${led.now} is marked as the current one`);
  });
}

/** Returns the largest joint motion per unit of tool motion over all directions, from differences of `pkm joints`. */
function ratios(machine, own, { pose, tool }) {
  const step = 1e-4;
  const letters = [0, 1, 2].filter((k) => (own.scene.coordinates + own.scene.table).includes("XYZ"[k]));
  const poses = letters.flatMap((k) => [step, -step].map((by) => pose.map((value, n) => (n === k ? value + by : value))));
  const { values } = table("joints", machine, 0, poses, ownTool(own, tool));
  return own.scene.joints.map((_, i) => Math.hypot(...letters.map((_, k) => (values[2 * k][i] - values[2 * k + 1][i]) / (2 * step))));
}

async function curves(page) {
  let count = 0;
  for (const machine of ["tripod", "hexapod"]) {
    const [own] = await withProgram(page, machine);
    const groups = await asText(page, () => window.pkm.curves());
    const names = await page.locator("select[aria-label=curves] option").allTextContents();
    check(String(names) === String(groups.map(({ name }) => name)), `${machine}: ${names} to choose from, ${groups.map(({ name }) => name)}`);
    const end = await page.evaluate(() => window.pkm.end());
    const of = (name) => groups.find((group) => group.name === name);
    for (const { name, times, curves } of groups) {
      check(curves.length > 0 && times.every((time, k) => k === 0 || time > times[k - 1]), `${machine}: times of ${name}`);
      near([times[0], times.at(-1)], [0, end], 0.02 * end, `${machine}: ends of ${name}`);
      check(curves.every(({ values }) => values.length === times.length), `${machine}: values of ${name}`);
    }
    const joints = of("joints");
    check(String(joints.curves.map(({ name, unit }) => name + unit)) === String(own.scene.joints.map(({ name, unit }) => name + unit)), `${machine}: ${joints.curves.map(({ name }) => name)}`);
    joints.curves.forEach(({ range }, i) => near(range, [own.scene.joints[i].min, own.scene.joints[i].max], 0, `${machine}: limits of joint ${i}`));
    const motion = of("joint motion for tool motion");
    check(motion.curves.length === own.scene.joints.length && motion.curves.every(({ name, unit }, i) => name === own.scene.joints[i].name && unit === `per ${own.scene.length_unit} of the tool`), `${machine}: curves of joint motion`);
    check(of("conditioning").curves[0].range[0] === own.scene.conditioning_limit, `${machine}: limit of the conditioning`);
    const places = [3, Math.floor(motion.times.length / 2), motion.times.length - 2];
    const states = await asText(page, (times) => times.map((time) => (window.pkm.go(time), window.pkm.state())), places.map((k) => motion.times[k]));
    places.forEach((place, k) => {
      const expected = ratios(reply(machine), own, states[k]);
      near(motion.curves.map(({ values }) => values[place]), expected, 1e-4 * Math.max(...expected), `${machine}: joint motion at ${motion.times[place]} s`);
      near(of("conditioning").curves[0].values[place], states[k].conditioning, 1e-12, `${machine}: conditioning at ${motion.times[place]} s`);
    });
    // A sample is the extreme of its cycles; between two samples the joint's speed limits its motion.
    const samples = Array.from({ length: 12 }, (_, k) => Math.floor(((k + 0.5) * joints.times.length) / 12));
    const at = await asText(page, (times) => times.map((time) => (window.pkm.go(time), window.pkm.state().joints)), samples.map((k) => joints.times[k]));
    const step = joints.times[1] - joints.times[0];
    samples.forEach((place, k) => joints.curves.forEach(({ values }, i) =>
      near(values[place], at[k][i], 2e-4 * Math.abs(at[k][i]) + 2 * step * own.scene.joints[i].max_velocity, `${machine}: joint ${i} at ${joints.times[place]} s`)));
    count += groups.reduce((sum, { curves }) => sum + curves.length, 0);
    await plot(page, machine, end);
  }
  return `${count} curves`;
}

/** Checks that the plot marks the time by a dark line and common limits by orange ones, and that a click sets the time. */
async function plot(page, machine, end) {
  await page.locator("select[aria-label=curves]").selectOption("joints");
  const area = () => page.evaluate(() => {
    const { left, top, width, height } = document.querySelector(".u-over").getBoundingClientRect();
    return { left, top, width, height };
  });
  const fits = async () => {
    await rested(page);
    const { own, room, over } = await page.evaluate(() => {
      const size = (words) => { const { width, height } = document.querySelector(words).getBoundingClientRect(); return [width, height]; };
      return { own: size(".uplot"), room: size(".plot"), over: size(".u-over") };
    });
    near(own[0], room[0], 1, `${machine}: width of the plot`);
    // The height of the legend's text depends on the font.
    check(own[1] <= room[1] + 4 && over[1] > 0.3 * room[1], `${machine}: the plot is ${own} with ${over} for curves, its place ${room}`);
  };
  await fits();
  const { left, top, width, height } = await area();
  const column = () => page.evaluate(() => {
    const [over, canvas] = [document.querySelector(".u-over").getBoundingClientRect(), document.querySelector(".u-wrap canvas")];
    const own = canvas.getBoundingClientRect();
    const scale = canvas.width / own.width;
    const { data, width } = canvas.getContext("2d").getImageData((over.left - own.left) * scale, (over.top - own.top) * scale, over.width * scale, over.height * scale);
    const rows = data.length / 4 / width;
    const share = (n) => Array.from({ length: rows }, (_, row) => 4 * (row * width + n)).filter((at) => data[at] < 60 && data[at + 1] < 70 && data[at + 2] < 80 && data[at + 3] > 100).length / rows;
    const dark = Array.from({ length: width }, (_, n) => [share(n), n]).reduce((most, one) => (one[0] > most[0] ? one : most));
    return { share: dark[0], at: dark[1] / width };
  });
  for (const share of [0.25, 0.7]) {
    await page.evaluate((time) => window.pkm.go(time), share * end);
    await rested(page);
    const line = await column();
    check(line.share > 0.6, `${machine}: no line of the time in the plot`);
    near(line.at, share, 0.02, `${machine}: the line of the time`);
  }
  // The cone of a strut is violated, so that the limit lies within the range of the margins.
  if (machine === "tripod") {
    for (const [name, isLimited] of [["margins", true], ["joint motion for tool motion", false]]) {
      await page.locator("select[aria-label=curves]").selectOption(name);
      await rested(page);
      const share = await page.evaluate(() => {
        const canvas = document.querySelector(".u-wrap canvas");
        const { data, width, height } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        const isOrange = (at) => data[at] > 190 && Math.abs(data[at + 1] - 94) < 40 && data[at + 2] < 60;
        return Math.max(...Array.from({ length: height }, (_, row) => Array.from({ length: width }, (_, n) => 4 * (row * width + n)).filter(isOrange).length / width));
      });
      check(share > 0.3 === isLimited, `${machine}: ${name} has a limit over ${share} of its width`);
    }
  }
  await page.locator("button.play").click();
  await page.mouse.move(left + 0.4 * width, top + height / 2);
  await page.mouse.click(left + 0.4 * width, top + height / 2);
  near((await state(page)).time, 0.4 * end, 0.02 * end, `${machine}: a click into the plot`);
  check((await page.locator("button.play").textContent()) === "play", `${machine}: a click leaves it playing`);
  // The mouse stays there: the legend shows time and values of the nearest sample.
  await rested(page);
  const [at, ...values] = await page.locator(".u-legend .u-value").allTextContents();
  const { times, curves } = await asText(page, () => window.pkm.curves().find(({ name }) => name === document.querySelector("select[aria-label=curves]").value));
  near(Number(at), 0.4 * end, 0.02 * end, `${machine}: the time in the legend`);
  const nearest = times.reduce((best, time, k) => (Math.abs(time - Number(at)) < Math.abs(times[best] - Number(at)) ? k : best), 0);
  check(String(values) === String(curves.map((curve) => curve.values[nearest].toPrecision(5))), `${machine}: ${values} in the legend at ${at} s`);
  const legend = await page.locator(".u-legend .u-label").allTextContents();
  check(legend[0] === "s" && legend.length > 1, `${machine}: ${legend}`);
  await page.setViewportSize({ width: 1400, height: 900 });
  await fits();
  await page.setViewportSize({ width: 1280, height: 800 });
}

/** Returns points of lines in the picture: the path with its colors, a trace, and the swept volume. */
async function traces(page) {
  for (const machine of ["tripod", "hexapod-rotary-table"]) {
    const program = machine === "tripod" ? PROGRAMS.tripod.text : "G21 G90\nG0 X40 Y0 Z200 A0 B0 C0\nG1 C90 X-20 F1000\nG1 A10 Z230\nM2\n";
    writeFileSync(file(`${machine}-traced.ngc`), program);
    const [own] = await opened(page, `${machine}-traced`, ini(machine), file(`${machine}-traced.ngc`));
    const seen = await asText(page, () => {
      const list = document.querySelector("select[aria-label=trace]");
      const points = () => {
        const lines = [];
        window.seen.scene.traverse((object) => object.type === "Line" && object.material.color.getHexString() === "cc79a7" && lines.push(Array.from(object.geometry.attributes.position.array)));
        return lines;
      };
      const choose = (n) => {
        list.value = list.options[n].value;
        list.dispatchEvent(new Event("change"));
        return points();
      };
      const end = window.pkm.end();
      const count = 1920;
      const found = { options: Array.from(list.options, ({ value }) => value), tip: choose(1), leg: choose(3), none: choose(0), at: [], path: window.pkm.path(), end };
      for (const n of [0, 500, 1919]) {
        window.pkm.go((n / (count - 1)) * end);
        const { ground } = window.pkm.state();
        found.at.push({ n, tip: ground.tip, upper: ground.upper[1] });
      }
      const boxes = Array.from(document.querySelectorAll(".box"), (label) => [label.textContent, label.querySelector("input")]);
      const sweep = boxes.find(([text]) => text.startsWith("space swept"))[1];
      const swept = () => {
        let all;
        window.seen.scene.traverse((object) => object.type === "LineSegments" && object.material.opacity === 0.18 && (all = Array.from(object.geometry.attributes.position.array)));
        return all;
      };
      found.before = swept();
      sweep.click();
      found.swept = swept();
      sweep.click();
      found.after = swept();
      found.ends = [0, 239].map((n) => {
        window.pkm.go((n / 239) * end);
        const { ground } = window.pkm.state();
        return [ground.lower, ground.upper];
      });
      const path = boxes.find(([text]) => text.startsWith("tool path"))[1];
      let line;
      window.seen.scene.traverse((object) => object.type === "Line2" && (line = object));
      found.line = Array.from(line.geometry.attributes.instanceStart.data.array);
      found.colors = Array.from(line.geometry.attributes.instanceColorStart.data.array);
      path.click();
      found.hidden = !line.parent.visible;
      found.nearest = [0.1, 0.4, 0.8].map((share) => {
        const n = Math.floor(share * (found.path.length - 1));
        window.pkm.go(found.path[n].time);
        const bar = document.querySelector(".limits meter-bar").style;
        return [n, bar.getPropertyValue("--color").match(/\d+/g).map(Number)];
      });
      return found;
    });
    check(String(seen.options) === String(["trace: nothing", "trace: tool tip", ...own.scene.legs.map((_, i) => `trace: upper end ${i}`)]), `${machine}: ${seen.options}`);
    check(seen.none.length === 0 && seen.tip.length === 1 && seen.leg.length === 1, `${machine}: traces`);
    for (const { n, tip, upper } of seen.at) {
      // Positions are kept as 32-bit numbers.
      near(seen.tip[0].slice(3 * n, 3 * n + 3), tip, 1e-4, `${machine}: trace of the tip at ${n}`);
      near(seen.leg[0].slice(3 * n, 3 * n + 3), upper, 1e-4, `${machine}: trace of an upper end at ${n}`);
    }
    check(seen.before === undefined && seen.after === undefined && seen.swept.length % 3 === 0, `${machine}: swept before it is asked for`);
    const each = 3 * 4 * own.scene.legs.length;
    check(seen.swept.length === 240 * each, `${machine}: ${seen.swept.length} numbers of what is swept`);
    seen.ends.forEach(([lower, upper], k) => {
      const lines = seen.swept.slice(k * 239 * each, k * 239 * each + each);
      const expected = [...lower.flatMap((end, i) => [...end, ...upper[i]]), ...upper.flatMap((end, i) => [...end, ...upper[(i + 1) % upper.length]])];
      near(lines, expected, 1e-4, `${machine}: swept at ${k}`);
    });
    check(seen.hidden, `${machine}: the path cannot be hidden`);
    near(seen.line.slice(0, 6), [...seen.path[0].at, ...seen.path[1].at], 1e-4, `${machine}: the path in the picture`);
    check(seen.line.length === 6 * (seen.path.length - 1) && seen.colors.length === seen.line.length, `${machine}: ${seen.line.length} numbers of ${seen.path.length} points`);
    // The picture has linear light, the panel its 256 shades.
    const shade = (value) => 255 * (value < 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
    for (const [n, color] of seen.nearest) near(seen.colors.slice(6 * n, 6 * n + 3).map(shade), color, 1, `${machine}: color of point ${n} of the path`);
    check(seen.path[0].time < 0.02 * seen.end && Math.abs(seen.path.at(-1).time - seen.end) < 0.02 * seen.end, `${machine}: ends of the path`);
  }
}

/** Checks the frames of a video: number, times, title, line and block. */
async function frames(page) {
  await withProgram(page, "tripod");
  const end = await page.evaluate(() => window.pkm.end());
  await page.addInitScript(() => {
    window.written = [];
    const { fillText } = CanvasRenderingContext2D.prototype;
    CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
      window.written.push([text, ...rest]);
      fillText.call(this, text, ...rest);
    };
  });
  const asked = async (words, html = file("tripod-reply.html")) => {
    await page.goto("about:blank");
    await page.goto(`file://${html}#frames=${words}`);
    await page.waitForSelector("#frames", { state: "attached" });
    return page.evaluate(async () => {
      const images = document.getElementById("frames").textContent.split("\n");
      const sizes = await Promise.all(images.map(async (image) => {
        const bitmap = await createImageBitmap(await (await fetch(image)).blob());
        return [bitmap.width, bitmap.height];
      }));
      return { images, sizes, written: window.written.filter(([text]) => text.length > 2) };
    });
  };
  const all = await asked("0,4,4,320,180,top");
  check(all.sizes.length === 4 && all.sizes.every(([width, height]) => width === 320 && height === 180), `sizes: ${all.sizes}`);
  check(new Set(all.images).size === 4, "frames are alike");
  const reply = all.written.filter(([text]) => text.includes(" s · line "));
  const texts = PROGRAMS.tripod.text.split("\n");
  reply.forEach(([text, left, below], k) => {
    const [, time, line, block] = /^([\d.]+) s · line (\d+): (.*)$/.exec(text);
    near(Number(time), (end * k) / 3, 0.0051, `time of frame ${k}`);
    check(block === (texts[line - 1] ?? ""), `frame ${k}: ${text}`);
    near([left, below], [5, 175], 0, `place of the words of frame ${k}`);
  });
  const [title] = all.written.filter(([text]) => text === "tripod");
  near(title.slice(1, 3), [5, 9], 0, "place of the title");
  check(reply.length === 4 && all.written.filter(([text]) => text === "tripod").length === 4, `written: ${JSON.stringify(all.written)}`);
  const third = await asked("2,1,4,320,180,top");
  check(third.images.length === 1 && third.images[0] === all.images[2], "the third frame is another one alone");
  const side = await asked("2,1,4,320,180,side");
  check(side.images[0] !== third.images[0], "from the side it looks as from above");
  const first = await asked("0,1,1,320,180,top");
  check(first.images[0] === all.images[0], "a picture of a program is not its first frame");
  view(file("alone.html"), ini("tripod"));
  const alone = await asked("0,1,1,320,180,top", file("alone.html"));
  check(alone.images.length === 1 && String(alone.written.map(([text]) => text)) === "tripod", `written on the picture of a machine alone: ${JSON.stringify(alone.written)}`);
}

export const TESTS = [
  ["findings of preflight are marks at their times", marks],
  ["a program ends at its last pose, with its tool", ends],
  ["findings in called files and on lines that are not reached have no time", calls],
  ["a program is played, and stops", play],
  ["curves equal the answers of pkm joints, and the plot shows the time", curves],
  ["the path, traces and the swept volume follow the machine", traces],
  ["frames of a video have their times", frames],
];
