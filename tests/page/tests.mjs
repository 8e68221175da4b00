// SPDX-License-Identifier: GPL-2.0-or-later
// Tests of the page for page_test.mjs, each a name and a function of a tab.
import { spawnSync } from "node:child_process";
import { readFileSync, readdirSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";
import { FOLDER, HOME, MACHINES, ROUNDED, SAME, asText, box, check, compare, complaints, file, given, ini, near, open, opened, pkm, rested, tab, view } from "./browser.mjs";
import { carrying, ownMachines } from "./machines.mjs";
import { TESTS as CONSTRAINTS } from "./constraints.mjs";
import { TESTS as PANEL } from "./panel.mjs";
import { TESTS as PICTURE } from "./picture.mjs";
import { TESTS as PROGRAM } from "./program.mjs";

const POSES = 300;
// Poses of each machine whose axes carry something.
const CARRIED = 60;
// Maximum bytes of the page of a program with 5,000 lines.
const MOST_BYTES = 2_000_000;

/** Moves the page to random poses within the axes and beyond, as dragging does; returns its states. */
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

/** Checks by a screenshot that the legs are drawn. */
async function isDrawn(page, name) {
  if (given.code) return page.evaluate(() => window.pkm.seen());
  await page.evaluate(() => {
    window.seen.isDrawn = true;
    window.pkm.seen();
    window.seen.isDrawn = false;
  });
  const shot = await page.screenshot();
  if (given.out) writeFileSync(join(given.out, `${name}.png`), shot);
  const seen = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes]));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    pen.drawImage(bitmap, 0, 0);
    const color = ([x, y]) => Array.from(pen.getImageData(Math.round(x), Math.round(y), 1, 1).data.slice(0, 3));
    return window.pkm.seen().map((part) => ({ ...part, color: color(part.at) }));
  }, shot.toString("base64"));
  const background = [244, 246, 248];
  const isOther = ({ color }) => Math.hypot(...color.map((c, k) => c - background[k])) > 40;
  const missing = seen.filter((part) => !isOther(part));
  check(seen.length > 2 && missing.length === 0, `${name}: not drawn: ${JSON.stringify(missing)}`);
  return seen;
}

async function machineTest(page, { machine, program }) {
  const html = file(`${machine}.html`);
  const made = view(html, ini(machine), program);
  check(made.status === 0, `${machine}: ${made.stderr}`);
  await open(page, html);
  check((await page.locator(".verdict").textContent()) === "fits", `${machine}: the verdict is not shown`);
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

/** Checks that a pose beyond a limit and a refused pose have a reason, and no travel; of both mechanisms. */
async function reasons(page) {
  await opened(page, "reasons", ini("hexapod"));
  const reason = page.locator(".reason");
  const take = async (...place) => {
    const before = await page.evaluate(() => window.seen.pictures);
    await page.evaluate((place) => window.pkm.take(...place), place);
    await page.waitForFunction((before) => window.seen.pictures > before, before);
    await rested(page);
    return reason.textContent();
  };
  const travel = () => page.locator("table.travel tr").evaluateAll((rows) => rows.map((row) => Array.from(row.children, (cell) => cell.textContent)));
  check(await page.locator(".reason[role=status]").isHidden(), "a reason is shown at home");
  const beyond = await take([5000, 0, 250, 0, 0, 0]);
  check(/axis X is at 5000.000 mm, above its limit of 150.000/.test(beyond), `beyond a limit without a reason: ${beyond}`);
  check(await reason.isVisible(), "the reason is hidden");
  const rows = await travel();
  check(rows.length === 12 && rows.every(([, left]) => left === "0.00"), `travel beyond a limit: ${JSON.stringify(rows)}`);
  check(rows.slice(2).every(([, , , end]) => end === "axis X: axis range"), `ends beyond the limit of X: ${JSON.stringify(rows)}`);
  const refused = await take([NaN, 0, 250, 0, 0, 0]);
  check(refused.includes("[code -"), `refused without a reason: ${refused}`);
  check((await travel()).length === 0, "a refused pose has travel");
  await take([10, 0, 250, 0, 0, 0]);
  check(await reason.isHidden() && (await travel()).length === 12, "a reason stays at a pose within all limits");
  const mechanisms = await opened(page, "reasons-pair", ini("lathe-mirrored"));
  const work = () => page.evaluate(() => String(window.pkm.state().ground.work));
  const [{ pose }, before] = [mechanisms[1].scene.home, await work()];
  const second = await take(pose.with(2, pose[2] + 9999), null, 1);
  check(second.includes("above its limit of") || second.includes("[code -"), `the second mechanism beyond its limits: "${second}"`);
  check(second.includes("axis W") || second.includes("[code -"), `the second mechanism: ${second}`);
  check((await work()) === before, "the second mechanism moves the work of the first");
  check(complaints(page).length === 0, complaints(page).join("; "));
}

async function unread(page) {
  writeFileSync(file("unread.ngc"), "G1 X10 F100\nG1 X[1+\nM2\n");
  const made = view(file("unread.html"), ini("hexapod"), file("unread.ngc"));
  check(made.status === 2, `status ${made.status}`);
  await open(page, file("unread.html"));
  const reply = await page.locator("header .error").textContent();
  check(reply.includes("unread.ngc"), `not reply: ${reply}`);
  const shown = await page.evaluate(() => {
    const pressed = new KeyboardEvent("keydown", { key: " " });
    document.querySelector("canvas.picture").dispatchEvent(pressed);
    return [document.querySelectorAll(".bar, .curves").length, document.querySelectorAll("label.box").length, document.querySelectorAll(".space > div").length];
  });
  near(shown, [0, 3, 0], 0, "players and curves, options of display, and rows without a program");
  await isDrawn(page, "unread");
}

/** Moves the page to random poses, tools and values of the extra axes; returns its states. */
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

/** Compares the page's positions of leg ends, tip and work with those of the viewer for LinuxCNC. */
function compareGround(name, sceneFile, states) {
  const questions = states.map(({ joints, pose, tool, extra }) => JSON.stringify({ joints, pose, tool, values: extra, of_work: OF_WORK }));
  const reply = spawnSync("python3", [join(HOME, "tests/viewer/placed.py"), sceneFile], { input: `${questions.join("\n")}\n`, encoding: "utf8" });
  const lines = reply.stdout.trim().split("\n").map((line) => JSON.parse(line));
  check(lines.length === states.length, `${name}: ${reply.stderr}`);
  states.forEach(({ ground, pose, extra }, i) => {
    const { work: m, tip, lower, upper } = ground;
    const ofWork = [0, 1, 2].map((k) => m[k] * OF_WORK[0] + m[4 + k] * OF_WORK[1] + m[8 + k] * OF_WORK[2] + m[12 + k]);
    const pairs = [[tip, lines[i][0]], [ofWork, lines[i][1]], ...lower.map((end, n) => [end, lines[i][2][n]]), ...upper.map((end, n) => [end, lines[i][3][n]])];
    const apart = Math.max(...pairs.map(([a, b]) => Math.hypot(...a.map((value, k) => value - b[k]))));
    check(apart <= ROUNDED, `${name}: drawn ${apart} apart at ${pose}, ${JSON.stringify(extra)}`);
  });
}

/** Checks that axes move the parts that they carry as in the scene, and that their sliders move only the axes; returns the
 * number of poses compared. */
async function carry(page, name, machine, { scene }) {
  const sceneFile = file(`${name}.json`);
  const reply = pkm(["scene", machine, "-o", sceneFile]);
  check(reply.status === 0, `${name}: ${reply.stderr}`);
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
  await checkTables(page, name, scene, extra);
  check(pose.every((value, k) => value === scene.home.pose[k]), `${name}: the mechanism has moved to ${pose}`);
  return states.length;
}

/** Checks that a disc about each rotary axis that carries work turns with the axis, unless the platform carries the work, and
 * that the workspace is drawn in the frame of the base, which axes may carry. */
async function checkTables(page, name, { chain, holder }, extra) {
  const { discs, space, base } = await asText(page, () => {
    const found = { discs: [], base: window.pkm.state().ground.base };
    window.seen.scene.updateMatrixWorld(true);
    window.seen.scene.traverse((object) => {
      if (object.material?.opacity === 0.38) found.space = object.matrixWorld.toArray();
      if (object.geometry?.parameters?.radialSegments !== 48) return;
      const at = (x, y) => object.localToWorld(object.position.clone().set(x, y, 0)).toArray();
      const { radiusTop: radius, height } = object.geometry.parameters;
      found.discs.push({ at: at(0, 0), up: at(0, height / 2), side: at(radius, 0), radius, height, notch: object.parent.children[1].getWorldPosition(object.position.clone()).toArray() });
    });
    return found;
  });
  // Pages with a program do not show it at first.
  if (await box(page, "workspace at these angles").isChecked()) near(space, base, SAME, `${name}: frame of the workspace`);
  const rotary = chain.filter((link) => link.carries === "work" && link.is_rotary);
  check(discs.length === (holder ? 0 : rotary.length), `${name}: ${discs.length} discs for ${rotary.length} tables`);
  const unit = (from, to) => from.map((value, k) => (to[k] - value) / Math.hypot(...from.map((value, k) => to[k] - value)));
  discs.forEach((disc, n) => {
    const side = unit(disc.at, disc.side);
    near(unit(disc.at, disc.notch), side, ROUNDED, `${name}: direction of notch ${n}`);
    const share = Math.hypot(...disc.notch.map((value, k) => value - disc.at[k])) / disc.radius;
    check(share > 0.5 && share < 1, `${name}: notch ${n} is at ${share} of the radius`);
    if (n > 0) return;
    // No axis carries the first table's point.
    const { axis, point, letter } = rotary[n];
    near(disc.at, point.map((value, k) => value - disc.height * axis[k]), ROUNDED, `${name}: disc of ${letter}`);
    near(unit(disc.at, disc.up), axis, ROUNDED, `${name}: axis of the disc of ${letter}`);
    // At 0 the disc is turned from Y to the axis by the shortest way; Rodrigues' formula gives the direction of its X.
    const [x, y, z] = axis;
    const start = [1 - (x * x) / (1 + y), -x, (-x * z) / (1 + y)];
    const across = [y * start[2] - z * start[1], z * start[0] - x * start[2], x * start[1] - y * start[0]];
    const angle = (extra[letter] * Math.PI) / 180;
    near(side, start.map((value, k) => Math.cos(angle) * value + Math.sin(angle) * across[k]), ROUNDED, `${name}: turn of the disc of ${letter}`);
  });
}

async function carriers(page) {
  let count = 0;
  for (const [name, text] of Object.entries(carrying())) {
    writeFileSync(file(`${name}.ini`), text);
    const made = view(file(`${name}.html`), file(`${name}.ini`));
    check(made.status === 0, `${name}: ${made.stderr}`);
    await open(page, file(`${name}.html`));
    const [own] = await page.evaluate(() => window.pkm.mechanisms());
    count += await carry(page, name, file(`${name}.ini`), own);
    check(complaints(page).length === 0, complaints(page).join("; "));
  }
  return `${count} poses equal to the model beside AXIS`;
}

/** Checks the path for a table that turns under a tip fixed in base: the path is drawn on the work. */
async function workPath(page) {
  writeFileSync(file("turn.ngc"), "G21 G90\nG0 X40 Y0 Z200 A0 B0 C0\nG1 C90 F1000\nM2\n");
  const made = view(file("turn.html"), ini("hexapod-rotary-table"), file("turn.ngc"));
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
  // X Y Z of a program are the tip on the work, so the turn of the table is no motion on the work.
  const path = await page.evaluate(() => window.pkm.path());
  const apart = Math.max(...path.filter(({ time }) => time > ends[0].time).map(({ at }) => Math.hypot(at[0] - 40, at[1], at[2] - 200)));
  check(apart < 1e-5, `the path is drawn ${apart} beside the point of the work`);
  await isDrawn(page, "turn");
}

/** Returns the smallest and largest coordinates of each shape from a file, in the world. */
const corners = (page) => asText(page, () => {
  const found = [];
  window.seen.scene.updateMatrixWorld(true);
  window.seen.scene.traverse((object) => {
    // Only shapes from files are drawn without an index of their points, and with normals; the platform is convex.
    if (!object.isMesh || object.geometry.index || object.geometry.parameters || object.material.side !== 2) return;
    const { position } = object.geometry.attributes;
    const points = Array.from({ length: position.count }, (_, n) => object.localToWorld(object.position.clone().fromBufferAttribute(position, n)).toArray());
    found.push([Math.min, Math.max].flatMap((end) => [0, 1, 2].map((k) => end(...points.map((point) => point[k])))));
  });
  return found;
});

/** Checks that the machine is drawn despite errors in the shapes of its parts, and that the page shows the errors. */
async function shapes(page) {
  const triangles = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 300 0 0\nvertex 0 300 0\nendloop\nendfacet\nendsolid\n";
  writeFileSync(file("good.stl"), triangles);
  writeFileSync(file("broken.stl"), "not a shape");
  // A binary file with one triangle: 80 bytes, the count, and NaN as each of 12 numbers.
  writeFileSync(file("nowhere.stl"), Buffer.concat([Buffer.alloc(80), Buffer.from([1, 0, 0, 0]), Buffer.from(new Float32Array(12).fill(NaN).buffer), Buffer.alloc(2)]));
  // One of two triangles is not a number.
  const bad = triangles.replace("solid\n", "").replace("vertex 300 0 0", "vertex nan nan nan");
  writeFileSync(file("partly.stl"), triangles.replace("endsolid\n", bad));
  const text = readFileSync(ini("hexapod"), "utf8").replace("[PKM]\n", "[PKM]\nTABLE_MODEL = good.stl mm -100 -100 0\nPLATFORM_MODEL = broken.stl mm\nSPINDLE_MODEL = nowhere.stl mm\nBASE_MODEL = missing.obj inch\n");
  writeFileSync(file("shapes.ini"), text);
  const made = view(file("shapes.html"), file("shapes.ini"));
  check(made.status === 0 && made.stderr.includes("missing.obj"), `status ${made.status}: ${made.stderr}`);
  await open(page, file("shapes.html"));
  const reply = (await page.locator("header .error").allTextContents()).join("; ");
  check(reply.includes("missing.obj") && reply.includes("broken.stl") && reply.includes("nowhere.stl") && !reply.includes("good.stl"), `shown: ${reply}`);
  // The picture has 32-bit numbers of lengths of 1e3.
  near((await corners(page)).flat(), [-100, -100, 0, 200, 200, 0], 1e-3, "ends of the table's shape");
  await isDrawn(page, "shapes");
  writeFileSync(file("partly.ini"), readFileSync(ini("hexapod"), "utf8").replace("[PKM]\n", "[PKM]\nTABLE_MODEL = partly.stl mm\n"));
  const madePartly = view(file("partly.html"), file("partly.ini"));
  check(madePartly.status === 0, madePartly.stderr);
  await open(page, file("partly.html"));
  const partly = (await page.locator("header .error").allTextContents()).join("; ");
  check(partly.includes("partly.stl") && partly.includes("not a number"), `shown: ${partly}`);
}

/** Checks that shapes are drawn in machine units, at their places, and move with the part that they belong to. */
async function placedShapes(page) {
  writeFileSync(file("part.obj"), "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 3\nf 1 2 3 4\n");
  // One inch is 25.4 mm; turned by 90 degrees about Z, X becomes Y, and Y becomes -X.
  const size = [-50.8, 0, 0, 0, 25.4, 76.2];
  const parts = [["BASE", 5, false], ["TABLE", 105, false], ["PLATFORM", 205, true], ["SPINDLE", 305, true]];
  const keys = parts.map(([part, x]) => `${part}_MODEL = part.obj inch ${x} 6 7 0 0 90\n`).join("");
  writeFileSync(file("placed.ini"), readFileSync(ini("hexapod"), "utf8").replace("[PKM]\n", `[PKM]\n${keys}`));
  const [{ scene: { home } }] = await opened(page, "placed", file("placed.ini"));
  for (const by of [0, 10]) {
    const pose = home.pose.map((value, k) => value + (k < 3 ? by : 0));
    await page.evaluate((pose) => window.pkm.take(pose), pose);
    const found = await corners(page);
    check(found.length === parts.length, `${found.length} shapes`);
    for (const [part, x, isMoved] of parts) {
      const expected = size.map((value, k) => value + [x, 6, 7][k % 3] + (isMoved ? pose[k % 3] : 0));
      // The picture has 32-bit numbers of lengths of 1e3.
      check(found.some((ends) => ends.every((value, k) => Math.abs(value - expected[k]) < 1e-3)), `the shape of ${part} is not at ${expected}: ${JSON.stringify(found)}`);
    }
  }
  check(complaints(page).length === 0, complaints(page).join("; "));
}

/** Checks that the text of a long program follows the time, and that scrolling shows other lines at their heights. */
async function rows(page) {
  const lines = Array.from({ length: 300 }, (_, i) => `G1 X${i % 2} Y${(i / 100).toFixed(2)}`);
  writeFileSync(file("rows.ngc"), ["G21 G90 G1 F3000", ...lines, "M2"].join("\n"));
  await opened(page, "rows", ini("tripod"), file("rows.ngc"));
  const shown = () => page.evaluate(() => {
    const { top, bottom, height } = document.querySelector(".rows").getBoundingClientRect();
    return Array.from(document.querySelectorAll(".space > div"), (row) => {
      const own = row.getBoundingClientRect();
      return { text: row.textContent, isNow: row.className.trim() === "now", from: own.top - top, isSeen: own.top >= top - 1 && own.bottom <= bottom + 1, height };
    });
  });
  for (const share of [0, 0.5, 0.505, 1, 0.3]) {
    await page.evaluate((share) => window.pkm.go(share * window.pkm.end()), share);
    await page.waitForTimeout(50);
    const [{ line }, all] = [await page.evaluate(() => window.pkm.state()), await shown()];
    const now = all.filter(({ isNow }) => isNow);
    check(now.length === (line > 0 ? 1 : 0) && now.every(({ text, isSeen }) => isSeen && text.startsWith(String(line))), `line ${line} is not in view: ${JSON.stringify(now)}`);
  }
  await page.evaluate(() => (document.querySelector(".rows").scrollTop = 200 * 18));
  await page.waitForTimeout(50);
  const all = await shown();
  const top = all.find(({ from }) => Math.abs(from) < 1);
  check(top?.text.startsWith("201"), `${JSON.stringify(top)} after scrolling by 200 lines`);
  check(all.length < 60 && all.at(-1).from >= all.at(-1).height - 18, `${all.length} rows are elements, the last one at ${all.at(-1).from}`);
  check((await page.evaluate(() => document.querySelector(".space").offsetHeight)) === 302 * 18, "height of all rows");
}

/** Checks the page of a program that LinuxCNC does not run to its end: machine, lines, findings and the reason are shown. */
async function unjudged(page) {
  // An excessive tilt, which LinuxCNC does not limit, and then a dwell longer than pkm waits.
  writeFileSync(file("unjudged.ngc"), "G21 G90 M52 P0\nG1 X10 F1000\nG1 A24 B24\nG4 P700\nM2\n");
  const made = view(file("unjudged.html"), ini("hexapod"), file("unjudged.ngc"));
  check(made.status === 1 && made.stderr.includes("nothing moves for 600 s"), `status ${made.status}: ${made.stderr}`);
  await open(page, file("unjudged.html"));
  check((await page.locator(".warning").first().textContent()).includes("nothing moves for 600 s"), "the reason is not shown");
  const mark = page.locator(".finding").first();
  check((await mark.textContent()).includes("line 3"), "the finding is not shown");
  await mark.click();
  check((await page.locator(".space .now b").textContent()) === "3", "the mark does not lead to its line");
  await isDrawn(page, "unjudged");
  check(complaints(page).length === 0, complaints(page).join("; "));
}

/** Checks that axes without limits can be set, within two machine sizes or a turn of home. */
async function unlimited(page) {
  const text = Object.values(ownMachines())[0].replace(/(\[AXIS_[XA]\]\n)MIN_LIMIT = .*\nMAX_LIMIT = .*\n/g, "$1").replace(/(\[AXIS_Y\]\n)MIN_LIMIT = .*\n/, "$1");
  writeFileSync(file("unlimited.ini"), text);
  const [{ scene }] = await opened(page, "unlimited", file("unlimited.ini"));
  const range = (letter) => {
    const { min, max } = scene.axes.find((axis) => axis.letter === letter);
    return [min, max];
  };
  // The farthest foot is 320 mm from the origin.
  near([...range("X"), ...range("Y"), ...range("A")], [-640, 640, -640, 50, -360, 360], 1e-9, "ranges");
  const listed = await page.locator(".limits span").allTextContents();
  check(listed.includes("axis B") && !listed.includes("axis X") && !listed.includes("axis A"), `${listed} are the nearest limits`);
  await page.evaluate(() => window.pkm.take([30, 0, -300, 0, 0, 0]));
  const { refusal, joints } = await page.evaluate(() => window.pkm.state());
  check(refusal === undefined && joints.every((value) => Number.isFinite(value)), `refused: ${refusal}`);
  // The handle has the letters of the machine: X Y Z A B.
  for (const [name, isOn, shown] of [["nothing", false], ["move", true, [true, true, true]], ["turn", true, [true, true, false]], ["nothing", false]]) {
    await page.locator("select[aria-label=drag]").selectOption(`drag: ${name}`);
    const found = await page.evaluate(() => {
      let root;
      window.seen.scene.traverse((object) => object.isTransformControlsRoot && (root = object));
      const { enabled, showX, showY, showZ } = root.controls;
      return { is: [root.visible, enabled], shown: [showX, showY, showZ] };
    });
    check(found.is.every((is) => is === isOn) && (!shown || String(found.shown) === String(shown)), `drag: ${name}: ${JSON.stringify(found)}`);
  }
  await isDrawn(page, "unlimited");
  check(complaints(page).length === 0, complaints(page).join("; "));
}

/** Checks that a page that was not transferred completely reports it. */
async function damaged(page) {
  view(file("damaged.html"), ini("tripod"));
  writeFileSync(file("damaged.html"), readFileSync(file("damaged.html"), "utf8").replace(/(id="data"[^>]*>[^<]{100})[^<]*/, "$1"));
  await page.goto(`file://${file("damaged.html")}`);
  check((await page.locator("#page > .error").textContent()).startsWith("This page cannot be shown: "), "the error is not shown");
}

/** Serves a page and a stream of events as pkm-live does. */
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
    watched: async () => {
      for (let n = 0; streams.size === 0; n++) {
        check(n < 200, "the page does not request events");
        await new Promise((resolve) => setTimeout(resolve, 50));
      }
    },
    close: () => server.close(),
  };
}

/** Checks that the page of pkm-live shows the events; tests/live checks that these are LinuxCNC's. */
async function live(offline) {
  const machine = "hexapod-rotary-table";
  const made = view(file("live.html"), ini(machine), "--live");
  check(made.status === 0, made.stderr);
  const stream = await streaming(file("live.html"));
  const page = await tab(offline.context().browser(), {});
  await open(page, file("live.html"), stream.address);
  const { geometry_hash: hash, home } = await page.evaluate(() => window.pkm.mechanisms()[0].scene);
  const running = { state: "running", pose: home.pose, joints: null, extra: { c: 30 }, tool: null, geometry_hash: hash, line: 7, fault: null };
  const shows = (words, isBad) => page.waitForFunction(([words, isBad]) => {
    const state = document.querySelector(".state");
    return state.textContent === words && state.classList.contains("bad") === isBad;
  }, [words, isBad]);
  const says = (state, words, isBad = false) => {
    stream.send(state);
    return shows(words, isBad);
  };
  check(!(await box(page, "workspace at these angles").isChecked()), "the workspace of a running machine is computed");
  await stream.watched();
  const pose = [10, -20, home.pose[2] + 5, 2, -1, 0];
  await says({ ...running, pose }, "running, line 7");
  const shown = await page.evaluate(() => window.pkm.state());
  check(shown.pose.every((value, k) => value === pose[k]), `the pose shown is ${shown.pose}`);
  const { work } = shown.ground;
  check(Math.abs(Math.atan2(work[1], work[0]) - Math.PI / 6) < 1e-12, `the table stands at ${work}`);
  compare(machine, 0, { scene: { sees_tool: true }, tool: shown.tool }, [shown], SAME);
  await says({ ...running, tool: [1, 2, 30], extra: { c: 40 }, line: 8 }, "running, line 8");
  // Values of missing pins stay.
  await says({ ...running, extra: { c: null }, line: 0 }, "running");
  const { tool, extra } = await page.evaluate(() => window.pkm.state());
  near([...tool, extra.C], [1, 2, 30, 40], 0, "values of missing pins");
  await says({ ...running, fault: "leg 2: too far; go back [code -34]" }, "leg 2: too far; go back [code -34]", true);
  const other = (hash ^ 1) >>> 0;
  await says({ ...running, geometry_hash: other }, `the module has another geometry: 0x${other.toString(16).padStart(8, "0")}`, true);
  await says({ ...running, geometry_hash: null }, "running, line 7, geometry not compared");
  await says({ ...running, pose: null }, "running, but its pose is unknown: pins are missing", true);
  await says({ state: "not running", pose: null }, "LinuxCNC is not running", true);
  stream.cut();
  await shows("no connection to pkm-live", true);
  await stream.watched();
  await says(running, "running, line 7");
  await isDrawn(page, "live");
  await opened(page, "live-pair", ini("lathe-mirrored"), "--live");
  const rods = await page.evaluate(() => {
    let count = 0;
    window.seen.scene.traverseVisible((object) => object.geometry?.parameters?.height === 1 && object.material.color.getHexString() === "c3ccd6" && (count += 1));
    return [count, window.pkm.mechanisms().map(({ scene }) => scene.legs.length)];
  });
  check(rods[0] === rods[1][0] && rods[1].length === 2, `${rods[0]} rods are shown; events describe the first of the mechanisms of ${rods[1]} legs`);
  await given.left(page);
  await page.context().close();
  stream.close();
}

async function long(page) {
  const lines = Array.from({ length: 5000 }, (_, i) => `G1 X${(40 * Math.cos(i / 30)).toFixed(4)} Y${(40 * Math.sin(i / 30)).toFixed(4)} Z${(200 + i / 200).toFixed(4)}`);
  writeFileSync(file("long.ngc"), `G21 G90 G64 P0.01\nG1 F3000\n${lines.join("\n")}\nM2\n`);
  view(file("long.html"), ini("hexapod"), file("long.ngc"));
  const { size } = statSync(file("long.html"));
  check(size < MOST_BYTES, `${size} bytes`);
  await open(page, file("long.html"));
  await isDrawn(page, "long");
  return `${size} bytes for 5,000 lines`;
}

/** Checks that a browser that hangs is ended, and that no file is written. */
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
  const reply = spawnSync("ffprobe", ["-v", "error", "-count_frames", "-select_streams", "v:0", "-show_entries", "stream=nb_read_frames,width,height", "-of", "csv=p=0", file("v.mp4")], { encoding: "utf8" });
  check(reply.stdout.trim() === "320,180,10", `frames: ${reply.stdout}`);
}

export const TESTS = [
  ...MACHINES.map((one) => [`the page of ${one.machine} moves like pkm joints`, (page) => machineTest(page, one)]),
  ...PANEL,
  ...CONSTRAINTS,
  ...PROGRAM,
  ...PICTURE,
  ["a pose beyond a limit and a refused pose have a reason", reasons],
  ["a program that cannot be read is reported beside the machine", unread],
  ["parts that axes carry are drawn at their positions", carriers],
  ["the path is drawn on the work that an axis turns", workPath],
  ["an unreadable shape is reported, and the machine is drawn", shapes],
  ["shapes are drawn at the places of their parts", placedShapes],
  ["the text of a long program follows the time", rows],
  ["a program that LinuxCNC does not run to its end is shown as far as it ran", unjudged],
  ["axes without limits can be set", unlimited],
  ["a damaged page reports that it cannot be shown", damaged],
  ["the live page shows the events of pkm-live, and reconnects", live],
  ["the page of 5,000 lines is below 2 MB", long],
  ["a browser that hangs is ended, without a video", endless],
  ["a video has the requested frames", video],
];
