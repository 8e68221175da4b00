#!/usr/bin/env node
// SPDX-License-Identifier: GPL-2.0-or-later
// The page of pkm view in a headless browser that has no network, for every shipped machine.
//
//     tests/page/page_test.mjs PKM [--only TEXT] [--out FOLDER]
//
// First, whether page/built is what page/src gives. Needs chromium and npm ci in the folder page. With --out it leaves a picture of every page.
import { spawnSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const HOME = resolve(dirname(fileURLToPath(import.meta.url)), "../..");
const { chromium } = createRequire(join(HOME, "page/package.json"))("playwright-core");

const option = (name) => {
  const place = process.argv.indexOf(name);
  return place < 0 ? undefined : process.argv[place + 1];
};
const PKM = resolve(process.argv[2]);
const ONLY = option("--only") ?? "";
const OUT = option("--out");
if (spawnSync(process.execPath, [join(HOME, "page/build.mjs"), "--check"], { stdio: "inherit" }).status !== 0) process.exit(1);
const FOLDER = mkdtempSync(join(tmpdir(), "pkmkins-page-test-"));

// The page and pkm compute with the same code, so that the bits are the same.
const SAME = 0;
// Where pkm is given a tool without the spindle's offset and adds it again, some roundings of lengths of 1e3.
const ROUNDED = 1e-9;
const POSES = 300;
// Of each machine whose axes carry something, beside these.
const CARRIED = 60;
// Bytes of the page of a program with 5,000 lines.
const MOST_BYTES = 2_000_000;

function check(is, text) {
  if (!is) throw new Error(text);
}

function pkm(args, input = "") {
  const done = spawnSync(PKM, args, { input, encoding: "utf8", maxBuffer: 1 << 28 });
  if (done.error) throw done.error;
  return done;
}

const ini = (machine) => join(HOME, "configs", machine, `${machine}.ini`);
const file = (name) => join(FOLDER, name);

/** Machines by their folders, each with its first program. */
const MACHINES = readdirSync(join(HOME, "configs")).map((machine) => {
  const programs = join(HOME, "configs", machine, "programs");
  return { machine, program: join(programs, readdirSync(programs).filter((name) => name.endsWith(".ngc")).sort()[0]) };
});

/** A tab of a browser without a network; what its pages complain about is collected. */
async function tab(browser) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, offline: true });
  const page = await context.newPage();
  page.complaints = [];
  page.on("console", (told) => ["error", "warning"].includes(told.type()) && page.complaints.push(told.text()));
  page.on("pageerror", (error) => page.complaints.push(error.message));
  page.on("request", (request) => request.url().match(/^(file|data|blob):/) || page.complaints.push(`asked for ${request.url()}`));
  return page;
}

/** Another page in the same tab: a tab of its own takes more than half of the time of a page. */
async function open(page, html) {
  page.complaints.length = 0;
  await page.goto(`file://${html}`);
  await page.waitForFunction(() => window.pkm);
}

/** Nothing but what a browser without a graphics card says of itself. */
function complaints(page) {
  return page.complaints.filter((text) => !/GPU stall|GL Driver Message|swiftshader|software WebGL/i.test(text));
}

function csv(text) {
  const [, ...rows] = text.trim().split("\n");
  return rows.map((row) => row.split(",").map((cell) => (cell === "" ? undefined : Number(cell))));
}

/** Joint values by the command, of poses with one tool. */
function joints(machine, mechanism, poses, tool) {
  const rows = ["x,y,z,a,b,c", ...poses.map((pose) => pose.join(","))].join("\n");
  return pkm(["joints", ini(machine), "--mechanism", String(mechanism + 1), "--tool", ...tool.map(String)], `${rows}\n`);
}

/** What the page has at each pose is what the command says, refusals included. */
function compare(machine, mechanism, { scene, tool: spindle }, states, tolerance) {
  const byTool = new Map();
  for (const state of states) {
    // The platform's own pose knows no tool.
    const tool = state.tool.map((value, k) => (scene.sees_tool ? value - spindle[k] : 0));
    const key = tool.join(",");
    byTool.set(key, [...(byTool.get(key) ?? []), state]);
  }
  let refused = 0;
  for (const [key, group] of byTool) {
    const told = joints(machine, mechanism, group.map(({ pose }) => pose), key.split(",").map(Number));
    const rows = csv(told.stdout);
    check(rows.length === group.length, `${machine}: ${rows.length} answers for ${group.length} poses: ${told.stderr}`);
    group.forEach((state, i) => {
      if (rows[i][0] === undefined) {
        refused += 1;
        check(state.code !== 0, `${machine}: the page takes ${state.pose}, pkm joints refuses it`);
        check(told.stderr.includes(state.refusal), `${machine}: "${state.refusal}" is not what pkm joints says: ${told.stderr}`);
      } else {
        check(state.code === 0, `${machine}: the page refuses ${state.pose}: ${state.refusal}`);
        const apart = Math.max(...state.joints.map((value, n) => Math.abs(value - rows[i][n])));
        check(apart <= tolerance, `${machine}: joints ${apart} apart at ${state.pose}`);
      }
    });
  }
  return refused;
}

const NO_NUMBERS = ["NaN", "Infinity", "-Infinity"];

/** What a function gives in the page, as one text: value by value the browser's protocol takes longer than the page. What
 * is no finite number stays that. */
async function asText(page, ask, given) {
  const named = (_, value) => (typeof value === "number" && !Number.isFinite(value) ? String(value) : value);
  const text = await page.evaluate(`JSON.stringify((${ask})(${JSON.stringify(given)}), ${named})`);
  return JSON.parse(text, (_, value) => (NO_NUMBERS.includes(value) ? Number(value) : value));
}

/** Random poses within the axes and beyond, taken as a drag would. */
async function dragged(page, scene, tool, which) {
  return asText(page, ({ axes, home, tool, which, count }) => {
    let seed = 12345;
    const chance = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
    return Array.from({ length: count }, (_, n) => {
      const beyond = n % 4 === 0 ? 3 : 0;
      const pose = [...home];
      for (const { letter, min, max } of axes) {
        const wide = (max - min) * (1 + beyond);
        pose["XYZABC".indexOf(letter)] = (min + max) / 2 + (chance() - 0.5) * wide;
      }
      window.pkm.take(pose, tool, which);
      return window.pkm.state(which);
    });
  }, { axes: scene.axes, home: scene.home.pose, tool, which, count: POSES });
}

/** The picture has the colours of the machine where they should be. */
async function isDrawn(page, name) {
  const shot = await page.screenshot();
  if (OUT) writeFileSync(join(OUT, `${name}.png`), shot);
  const seen = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes]));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    pen.drawImage(bitmap, 0, 0);
    const colour = ([x, y]) => Array.from(pen.getImageData(Math.round(x), Math.round(y), 1, 1).data.slice(0, 3));
    return window.pkm.seen().map((part) => ({ ...part, colour: colour(part.at) }));
  }, shot.toString("base64"));
  const background = [244, 246, 248];
  const isOther = ({ colour }) => Math.hypot(...colour.map((c, k) => c - background[k])) > 40;
  const missing = seen.filter((part) => !isOther(part));
  check(seen.length > 2 && missing.length === 0, `${name}: not drawn: ${JSON.stringify(missing)}`);
  return seen;
}

async function machineTest(page, { machine, program }) {
  const html = file(`${machine}.html`);
  const made = pkm(["view", ini(machine), program, "--html", html]);
  check(made.status === 0, `${machine}: ${made.stderr}`);
  await open(page, html);
  const scenes = await page.evaluate(() => window.pkm.mechanisms());
  const before = await isDrawn(page, machine);
  for (const [which, own] of scenes.entries()) {
    const along = await asText(page, (which) => Array.from({ length: 60 }, (_, n) => {
      window.pkm.go((n / 59) * window.pkm.end());
      return window.pkm.state(which);
    }), which);
    compare(machine, which, own, along, ROUNDED);
    for (const { platform, nose } of along) {
      check(Math.hypot(...nose.map((value, k) => value - platform[12 + k])) < 1e-6, `${machine}: the platform is drawn elsewhere`);
    }
    compare(machine, which, own, await dragged(page, own.scene, own.tool, which), SAME);
  }
  await page.locator("input[aria-label=time]").evaluate((slider) => {
    slider.value = slider.max / 3;
    slider.dispatchEvent(new Event("input"));
  });
  const { time } = await page.evaluate(() => window.pkm.state());
  const end = await page.evaluate(() => window.pkm.end());
  check(Math.abs(time - end / 3) < 1e-6 * end, `${machine}: the slider shows ${time} of ${end}`);
  const after = await page.evaluate(() => window.pkm.seen());
  check(after.some(({ at }, i) => Math.hypot(at[0] - before[i].at[0], at[1] - before[i].at[1]) > 1), `${machine}: nothing has moved`);
  const placed = scenes[0].scene.is_carried && (await carry(page, machine, ini(machine), scenes[0]));
  check(complaints(page).length === 0, `${machine}: ${complaints(page).join("; ")}`);
  return `${scenes.length * (POSES + 60)} poses as pkm joints${placed ? `, ${placed} as the model beside AXIS` : ""}`;
}

async function alone(page) {
  for (const machine of ["linear-delta", "lathe-mirrored"]) {
    const html = file(`${machine}-alone.html`);
    pkm(["view", ini(machine), "--html", html]);
    await open(page, html);
    const [body, limits] = await page.evaluate(() => window.pkm.workspace());
    check(body > 100 && limits === 24, `${machine}: workspace of ${body} points, box of ${limits}`);
    await isDrawn(page, `${machine}-workspace`);
    check(complaints(page).length === 0, complaints(page).join("; "));
  }
}

async function marks(page) {
  writeFileSync(file("marks.ngc"), "G21 G90\nG1 X10 F1000\nG1 X20\nG1 A24 B24\nG1 A0 B0\nM2\n");
  const made = pkm(["view", ini("hexapod"), file("marks.ngc"), "--html", file("marks.html")]);
  check(made.status === 1, `status ${made.status}: ${made.stderr}`);
  await open(page, file("marks.html"));
  await page.locator(".finding").first().click();
  const { line, time } = await page.evaluate(() => window.pkm.state());
  check(line === 4 && time > 0, `the mark leads to line ${line} at ${time} s`);
  check((await page.locator(".space .now b").textContent()) === "4", "the line is not shown");
  check((await page.locator(".verdict").textContent()) === "does not fit", "the verdict is not shown");
  await page.evaluate(() => window.pkm.take([5000, 0, 250, 0, 0, 0]));
  const reason = await page.locator(".reason").textContent();
  check(/axis X is at 5000.000 mm, above its limit of 150.000/.test(reason), `beyond a limit without a reason: ${reason}`);
  await page.evaluate(() => window.pkm.take([NaN, 0, 250, 0, 0, 0]));
  const refused = await page.locator(".reason").textContent();
  check(refused.includes("[code -"), `refused without a reason: ${refused}`);
  await isDrawn(page, "marks");
}

async function unread(page) {
  writeFileSync(file("unread.ngc"), "G1 X10 F100\nG1 X[1+\nM2\n");
  const made = pkm(["view", ini("hexapod"), file("unread.ngc"), "--html", file("unread.html")]);
  check(made.status === 2, `status ${made.status}`);
  await open(page, file("unread.html"));
  const told = await page.locator("header .error").textContent();
  check(told.includes("unread.ngc"), `not told: ${told}`);
  await isDrawn(page, "unread");
}

/** An INI file of legs, with limits about their values at home. */
function iniOf(kinematics, letters, home, legs) {
  const section = (name, keys) => `[${name}]\n${Object.entries(keys).map(([key, value]) => `${key} = ${value}`).join("\n")}\n`;
  const motion = { MAX_VELOCITY: 100, MAX_ACCELERATION: 1000, FERROR: 5, MIN_FERROR: 1 };
  return [
    section("EMC", { MACHINE: "own" }), section("PKM", { SCREW_LEAD: 0 }), section("EMCMOT", { SERVO_PERIOD: 1000000 }),
    section("KINS", { KINEMATICS: kinematics, JOINTS: legs.length }),
    section("TRAJ", { COORDINATES: letters, HOME: home.join(" "), LINEAR_UNITS: "mm", ANGULAR_UNITS: "degree", MAX_LINEAR_VELOCITY: 100, MAX_LINEAR_ACCELERATION: 1000, MAX_ANGULAR_VELOCITY: 20, MAX_ANGULAR_ACCELERATION: 100 }),
    ...legs.map(({ keys }, i) => section(`LEG_${i}`, keys)),
    ...legs.map(({ keys, home }, i) => section(`JOINT_${i}`, { TYPE: keys.ARM ? "ANGULAR" : "LINEAR", HOME: home, MIN_LIMIT: home - 150, MAX_LIMIT: home + 150, ...motion })),
    ...[...letters].map((letter) => {
      const k = "XYZABC".indexOf(letter);
      const reach = k < 3 ? 50 : 10;
      return section(`AXIS_${letter}`, { MIN_LIMIT: home[k] - reach, MAX_LIMIT: home[k] + reach, ...motion });
    }),
  ].join("\n");
}

const strut = (base, platform, [x, y, z]) => ({
  keys: { BASE: base.join(" "), PLATFORM: platform.join(" ") },
  home: Math.hypot(base[0] - platform[0] - x, base[1] - platform[1] - y, base[2] - platform[2] - z),
});

/** Machines that nobody has drawn before. */
function ownMachines() {
  const place = [0, 0, -300];
  const around = (radius, degrees, z = 0) => [radius * Math.cos((degrees * Math.PI) / 180), radius * Math.sin((degrees * Math.PI) / 180), z];
  const five = [0, 65, 140, 220, 300].map((angle, i) => strut(around(320, angle), around(90, angle + (i % 2 ? 35 : -25), i % 2 ? 60 : 0), place));
  const slider = { keys: { BASE: "260 -150 0", PLATFORM: "35 -20 0", GUIDE: "0 0 1", ROD: 420, SIDE: 1 }, home: 30 };
  const crank = { keys: { BASE: "-200 -115.47 0", PLATFORM: "-35 -20 0", AXIS: "0.5 -0.8660254 0", ARM: "-103.92 -60 0", ROD: 380, SIDE: -1 }, home: 20 };
  return {
    "five-struts": iniOf("pkmkins legs=strut:5 coordinates=XYZAB", "XYZAB", [...place, 0, 0, 0], five),
    "mixed-legs": iniOf("pkmkins legs=strut:1,slider:1,crank:1 coordinates=XYZ", "XYZ", [...place, 0, 0, 0], [strut([0, 300, 0], [0, 40, 0], place), slider, crank]),
  };
}

async function own(page) {
  for (const [name, text] of Object.entries(ownMachines())) {
    writeFileSync(file(`${name}.ini`), text);
    const made = pkm(["view", file(`${name}.ini`), "--html", file(`${name}.html`)]);
    check(made.status === 0, `${name}: ${made.stderr}`);
    await open(page, file(`${name}.html`));
    await isDrawn(page, name);
    const { refusal, joints } = await page.evaluate(() => window.pkm.state());
    check(refusal === undefined && joints.every((value) => Number.isFinite(value)), `${name}: ${refusal}`);
    check(complaints(page).length === 0, complaints(page).join("; "));
  }
}

/** Machines whose axes carry work, tool and legs in all ways: each an INI file. */
function carrying() {
  const { "five-struts": five, "mixed-legs": mixed } = ownMachines();
  const axis = (letter, place, carries, direction, point) => [
    `[JOINT_${place}]\nTYPE = ${"ABC".includes(letter) ? "ANGULAR" : "LINEAR"}\nHOME = 0\nMIN_LIMIT = -180\nMAX_LIMIT = 180\nMAX_VELOCITY = 100\nMAX_ACCELERATION = 1000`,
    `[AXIS_${letter}]\nMIN_LIMIT = -180\nMAX_LIMIT = 180\nMAX_VELOCITY = 100\nMAX_ACCELERATION = 1000`,
    `[CHAIN_${letter}]\nCARRIES = ${carries}\nAXIS = ${direction}${point ? `\nPOINT = ${point}` : ""}`,
  ].join("\n");
  const withAxes = (text, letters, axes) => {
    const count = Number(text.match(/JOINTS = (\d+)/)[1]);
    const world = text.match(/^COORDINATES = (.*)$/m)[1];
    return [
      text.replace(/JOINTS = \d+/, `JOINTS = ${count + letters.length}`)
        .replace(/(KINEMATICS = .*)/, `$1 axes=${letters}`).replace(/^COORDINATES = .*$/m, `COORDINATES = ${world}${letters}`)
        .replace(/^HOME = (\S+ \S+ \S+ \S+ \S+ \S+)$/m, "HOME = $1 0 0 0"),
      ...[...letters].map((letter, n) => axis(letter, count + n, ...axes[n])),
    ].join("\n");
  };
  const track = withAxes(five, "CUVW", [["WORK", "0.6 0 0.8", "10 -20 30"], ["LEGS", "1 2 0"], ["TOOL", "0 0 -1"], ["WORK", "0 1 0"]]);
  const held = withAxes(mixed, "ABCW", [["LEGS", "1 0 0", "0 50 -100"], ["TOOL", "0 1 0", "30 0 5"], ["WORK", "0 0 1", "5 6 7"], ["TOOL", "1 1 0"]]);
  return { "carried-legs": track, "carried-tool": held, "carried-work": held.replace("[PKM]\n", "[PKM]\nWORK_ON_PLATFORM = 20 30 -450\n") };
}

/** Random poses, tools and values of the extra axes, and where the page draws everything. */
async function carried(page, scene) {
  return asText(page, ({ axes, home, extra, count }) => {
    let seed = 54321;
    const within = (low, high) => low + ((seed = (seed * 48271) % 2147483647) / 2147483647) * (high - low);
    return Array.from({ length: count }, () => {
      const pose = [...home];
      for (const { letter, min, max } of axes) pose["XYZABC".indexOf(letter)] = within(0.75 * min + 0.25 * max, 0.25 * min + 0.75 * max);
      const values = Object.fromEntries(extra.map(({ letter }) => [letter, within(-180, 180)]));
      window.pkm.take(pose, [within(-50, 50), within(-50, 50), within(-50, 50)], 0, values);
      return window.pkm.state();
    });
  }, { axes: scene.axes, home: scene.home.pose, extra: scene.extra_axes, count: CARRIED });
}

const OF_WORK = [12, -34, 56];

/** Where the page draws ends of legs, tip and work is where the viewer of LinuxCNC has them. */
function compareGround(name, sceneFile, states) {
  const questions = states.map(({ joints, pose, tool, extra }) => JSON.stringify({ joints, pose, tool, values: extra, of_work: OF_WORK }));
  const told = spawnSync("python3", [join(HOME, "tests/viewer/placed.py"), sceneFile], { input: `${questions.join("\n")}\n`, encoding: "utf8" });
  const lines = told.stdout.trim().split("\n").map((line) => JSON.parse(line));
  check(lines.length === states.length, `${name}: ${told.stderr}`);
  states.forEach(({ ground, pose, extra }, i) => {
    const { work: m, tip, lower, upper } = ground;
    const ofWork = [0, 1, 2].map((k) => m[k] * OF_WORK[0] + m[4 + k] * OF_WORK[1] + m[8 + k] * OF_WORK[2] + m[12 + k]);
    const pairs = [[tip, lines[i][0]], [ofWork, lines[i][1]], ...lower.map((end, n) => [end, lines[i][2][n]]), ...upper.map((end, n) => [end, lines[i][3][n]])];
    const apart = Math.max(...pairs.map(([a, b]) => Math.hypot(...a.map((value, k) => value - b[k]))));
    check(apart <= ROUNDED, `${name}: drawn ${apart} apart at ${pose}, ${JSON.stringify(extra)}`);
  });
}

/** Axes that carry something move what they carry as the scene says, and their sliders move the axes alone; the number of
 * poses compared. */
async function carry(page, name, machine, { scene }) {
  const sceneFile = file(`${name}.json`);
  const told = pkm(["scene", machine, "-o", sceneFile]);
  check(told.status === 0, `${name}: ${told.stderr}`);
  const states = (await carried(page, scene)).filter(({ code }) => code === 0);
  check(states.length > CARRIED / 3, `${name}: ${states.length} of ${CARRIED} poses are reached`);
  compareGround(name, sceneFile, states);
  await page.getByRole("button", { name: "home" }).click();
  for (const { letter } of scene.chain) {
    await page.locator(`input[type=range][aria-label=${letter}]`).evaluate((slider) => {
      slider.value = 0.6 * slider.max;
      slider.dispatchEvent(new Event("input"));
    });
  }
  await isDrawn(page, `${name}-carried`);
  const { extra, pose } = await page.evaluate(() => window.pkm.state());
  for (const { letter } of scene.chain) check(extra[letter] > 0, `${name}: ${letter} is at ${extra[letter]}`);
  check(pose.every((value, k) => value === scene.home.pose[k]), `${name}: the mechanism has moved to ${pose}`);
  return states.length;
}

async function carriers(page) {
  let count = 0;
  for (const [name, text] of Object.entries(carrying())) {
    writeFileSync(file(`${name}.ini`), text);
    const made = pkm(["view", file(`${name}.ini`), "--html", file(`${name}.html`)]);
    check(made.status === 0, `${name}: ${made.stderr}`);
    await open(page, file(`${name}.html`));
    const [own] = await page.evaluate(() => window.pkm.mechanisms());
    count += await carry(page, name, file(`${name}.ini`), own);
    check(complaints(page).length === 0, complaints(page).join("; "));
  }
  return `${count} poses as the model beside AXIS`;
}

/** A table turns under the tip, which stays in base: on the work it goes round, and the path is drawn on the work. */
async function workPath(page) {
  writeFileSync(file("turn.ngc"), "G21 G90\nG0 X40 Y0 Z200 A0 B0 C0\nG1 C90 F1000\nM2\n");
  const made = pkm(["view", ini("hexapod-rotary-table"), file("turn.ngc"), "--html", file("turn.html")]);
  check(made.status === 0, made.stderr);
  await open(page, file("turn.html"));
  const ends = await page.evaluate(() => [0.5, 1].map((part) => {
    window.pkm.go(part * window.pkm.end());
    return window.pkm.state();
  }));
  const turned = ends.map(({ extra }) => extra.C);
  check(turned[0] > 10 && turned[0] < 80 && Math.abs(turned[1] - 90) < 1e-3, `C is at ${turned}`);
  const [x, y, z] = ends[1].ground.tip;
  check(Math.hypot(x, y - 40, z - 200) < 1e-3, `the tip is at ${ends[1].ground.tip} in base`);
  // X Y Z of a program are the tip on the work: the table's turn is no way on it.
  const path = await page.evaluate(() => window.pkm.path());
  const apart = Math.max(...path.filter(({ time }) => time > ends[0].time).map(({ at }) => Math.hypot(at[0] - 40, at[1], at[2] - 200)));
  check(apart < 1e-5, `the path is drawn ${apart} beside the point of the work`);
  await isDrawn(page, "turn");
}

/** The machine is drawn whatever is wrong with the shapes of its parts, and what is wrong is told. */
async function shapes(page) {
  const triangles = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 300 0 0\nvertex 0 300 0\nendloop\nendfacet\nendsolid\n";
  writeFileSync(file("good.stl"), triangles);
  writeFileSync(file("broken.stl"), "not a shape");
  const text = readFileSync(ini("hexapod"), "utf8").replace("[PKM]\n", "[PKM]\nTABLE_MODEL = good.stl mm -100 -100 0\nPLATFORM_MODEL = broken.stl mm\nBASE_MODEL = missing.obj inch\n");
  writeFileSync(file("shapes.ini"), text);
  const made = pkm(["view", file("shapes.ini"), "--html", file("shapes.html")]);
  check(made.status === 0 && made.stderr.includes("missing.obj"), `status ${made.status}: ${made.stderr}`);
  await open(page, file("shapes.html"));
  const told = (await page.locator("header .error").allTextContents()).join("; ");
  check(told.includes("missing.obj") && told.includes("broken.stl") && !told.includes("good.stl"), `told: ${told}`);
  await isDrawn(page, "shapes");
}

/** Of a program that LinuxCNC does not run there is no motion: machine, lines and findings are shown, and why. */
async function unjudged(page) {
  // Too far a tilt, which LinuxCNC does not know, and then a dwell that is longer than anybody waits.
  writeFileSync(file("unjudged.ngc"), "G21 G90 M52 P0\nG1 X10 F1000\nG1 A24 B24\nG4 P700\nM2\n");
  const made = pkm(["view", ini("hexapod"), file("unjudged.ngc"), "--html", file("unjudged.html")]);
  check(made.status === 1 && made.stderr.includes("nothing moves for 600 s"), `status ${made.status}: ${made.stderr}`);
  await open(page, file("unjudged.html"));
  check((await page.locator(".warning").first().textContent()).includes("nothing moves for 600 s"), "why is not told");
  const mark = page.locator(".finding").first();
  check((await mark.textContent()).includes("line 3"), "the finding is not shown");
  await mark.click();
  check((await page.locator(".space .now b").textContent()) === "3", "the mark does not lead to its line");
  await isDrawn(page, "unjudged");
  check(complaints(page).length === 0, complaints(page).join("; "));
}

/** An axis without limits can be set, and its travel is told as without an end. */
async function unlimited(page) {
  const text = Object.values(ownMachines())[0].replace(/(\[AXIS_X\]\n)MIN_LIMIT = .*\nMAX_LIMIT = .*\n/, "$1");
  writeFileSync(file("unlimited.ini"), text);
  const made = pkm(["view", file("unlimited.ini"), "--html", file("unlimited.html")]);
  check(made.status === 0, made.stderr);
  await open(page, file("unlimited.html"));
  await page.evaluate(() => window.pkm.take([30, 0, -300, 0, 0, 0]));
  const { refusal, joints } = await page.evaluate(() => window.pkm.state());
  check(refusal === undefined && joints.every((value) => Number.isFinite(value)), `refused: ${refusal}`);
  await isDrawn(page, "unlimited");
  check(complaints(page).length === 0, complaints(page).join("; "));
}

/** A stream of events as pkm-live sends them, beside the page that it serves. */
async function streaming(html) {
  const streams = new Set();
  const server = createServer((request, answer) => {
    if (request.url !== "/events") {
      answer.writeHead(request.url === "/" ? 200 : 404, { "Content-Type": "text/html; charset=utf-8" }).end(request.url === "/" ? readFileSync(html) : "");
      return;
    }
    answer.writeHead(200, { "Content-Type": "text/event-stream" }).write("retry: 100\n\n");
    streams.add(answer);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return {
    address: `http://127.0.0.1:${server.address().port}/`,
    send: (state) => streams.forEach((stream) => stream.write(`data: ${JSON.stringify(state)}\n\n`)),
    cut: () => { streams.forEach((stream) => stream.destroy()); streams.clear(); },
    isWatched: () => streams.size > 0,
    close: () => server.close(),
  };
}

/** The page of pkm-live says what the stream says; that the stream is LinuxCNC's is seen in tests/live. */
async function live(offline) {
  const machine = "hexapod-rotary-table";
  const made = pkm(["view", ini(machine), "--live", "--html", file("live.html")]);
  check(made.status === 0, made.stderr);
  const stream = await streaming(file("live.html"));
  const context = await offline.context().browser().newContext({ viewport: offline.viewportSize() });
  const page = await context.newPage();
  await page.goto(stream.address);
  await page.waitForFunction(() => window.pkm);
  const { geometry_hash: hash, home } = await page.evaluate(() => window.pkm.mechanisms()[0].scene);
  const running = { state: "running", pose: home.pose, joints: null, extra: { c: 30 }, tool: null, geometry_hash: hash, line: 7, fault: null };
  const says = async (state, words) => {
    stream.send(state);
    await page.waitForFunction((words) => document.querySelector(".state").textContent.includes(words), words, { timeout: 5000 });
  };
  while (!stream.isWatched()) await page.waitForTimeout(50);
  const pose = [10, -20, home.pose[2] + 5, 2, -1, 0];
  await says({ ...running, pose }, "running, line 7");
  const shown = await page.evaluate(() => window.pkm.state());
  check(shown.pose.every((value, k) => value === pose[k]), `the pose shown is ${shown.pose}`);
  const { work } = shown.ground;
  check(Math.abs(Math.atan2(work[1], work[0]) - Math.PI / 6) < 1e-12, `the table stands at ${work}`);
  compare(machine, 0, { scene: { sees_tool: true }, tool: shown.tool }, [shown], SAME);
  await says({ ...running, fault: "leg 2: too far; go back [code -34]" }, "leg 2: too far");
  await says({ ...running, geometry_hash: hash ^ 1 }, "another geometry: 0x");
  await says({ ...running, pose: null }, "pins are missing");
  await says({ state: "not running", pose: null }, "LinuxCNC is not running");
  stream.cut();
  await page.waitForFunction(() => document.querySelector(".state").textContent.includes("no connection"), undefined, { timeout: 10000 });
  while (!stream.isWatched()) await page.waitForTimeout(50);
  await says(running, "running, line 7");
  await isDrawn(page, "live");
  await context.close();
  stream.close();
}

async function long(page) {
  const lines = Array.from({ length: 5000 }, (_, i) => `G1 X${(40 * Math.cos(i / 30)).toFixed(4)} Y${(40 * Math.sin(i / 30)).toFixed(4)} Z${(200 + i / 200).toFixed(4)}`);
  writeFileSync(file("long.ngc"), `G21 G90 G64 P0.01\nG1 F3000\n${lines.join("\n")}\nM2\n`);
  pkm(["view", ini("hexapod"), file("long.ngc"), "--html", file("long.html")]);
  const { size } = statSync(file("long.html"));
  check(size < MOST_BYTES, `${size} bytes`);
  await open(page, file("long.html"));
  await isDrawn(page, "long");
  return `${size} bytes for 5,000 lines`;
}

/** A browser that does not end is ended, and nothing is written. */
async function endless() {
  writeFileSync(file("endless"), "#!/bin/sh\nsleep 600 &\nsleep 600\n", { mode: 0o755 });
  const { program } = MACHINES.find(({ machine }) => machine === "rotary-delta");
  const made = pkm(["view", ini("rotary-delta"), program, "--video", file("endless.mp4"), "--browser", file("endless"), "--browser-seconds", "1"]);
  check(made.status === 2 && made.stderr.includes("--browser-seconds"), `status ${made.status}: ${made.stderr}`);
  check(!readdirSync(FOLDER).some((name) => name.includes("endless.mp4")), "a part of the video is left");
}

async function video() {
  if (spawnSync("ffprobe", ["-version"]).error) return "skipped: no ffmpeg";
  const made = pkm(["view", ini("rotary-delta"), MACHINES.find(({ machine }) => machine === "rotary-delta").program,
    "--video", file("v.mp4"), "--video-seconds", "0.4", "--size", "320", "180"]);
  check(made.status === 0, made.stderr);
  const told = spawnSync("ffprobe", ["-v", "error", "-count_frames", "-select_streams", "v:0", "-show_entries", "stream=nb_read_frames,width,height", "-of", "csv=p=0", file("v.mp4")], { encoding: "utf8" });
  check(told.stdout.trim() === "320,180,10", `frames: ${told.stdout}`);
}

const TESTS = [
  ...MACHINES.map((one) => [`the page of ${one.machine} moves as pkm joints says`, (page) => machineTest(page, one)]),
  ["a machine without a program shows its workspace and the axis limits", alone],
  ["a mark leads to its line, and a refused pose has a reason", marks],
  ["a program that cannot be read is told beside the machine", unread],
  ["a machine of one's own appears without a line of code", own],
  ["what axes carry is drawn where they put it", carriers],
  ["the path stands on the work that an axis turns", workPath],
  ["a shape that cannot be read is told, and the machine is drawn", shapes],
  ["a program that LinuxCNC does not run to its end is shown as far as it ran", unjudged],
  ["an axis without limits can be set", unlimited],
  ["the live page says what pkm-live sends, and finds it again", live],
  ["the page of 5,000 lines is below 2 MB", long],
  ["a browser that does not end is ended, without a video", endless],
  ["a video has the frames that were asked for", video],
];

async function main() {
  if (OUT) mkdirSync(OUT, { recursive: true });
  const browser = await chromium.launch({
    executablePath: "/usr/bin/chromium",
    args: ["--use-angle=swiftshader", "--disable-gpu-compositing", "--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic", "--no-first-run", ...(process.getuid() === 0 ? ["--no-sandbox"] : [])],
  });
  let page = await tab(browser);
  let failed = 0;
  const chosen = TESTS.filter(([name]) => name.includes(ONLY));
  for (const [name, test] of chosen) {
    try {
      const told = await test(page);
      console.log(`PASS ${name}${told ? `: ${told}` : ""}`);
    } catch (error) {
      failed += 1;
      console.log(`FAIL ${name}: ${error.message}`);
      page = await tab(browser);
    }
  }
  await browser.close();
  rmSync(FOLDER, { recursive: true });
  console.log(`page: ${chosen.length - failed} passed, ${failed} failed`);
  process.exitCode = failed > 0 ? 1 : 0;
}

await main();
