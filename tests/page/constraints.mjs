// SPDX-License-Identifier: GPL-2.0-or-later
// Tests of the page for machines with constraints of the platform.
import { spawnSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { HOME, MACHINES as SHIPPED, ROUNDED, asText, check, complaints, file, given, ini, near, opened, ownTool, pkm, rested, table } from "./browser.mjs";

const MACHINES = ["tricept", "exechon", "z3-head"];
const POSES = 60;

/** Moves the page to poses within the axes, with tools; returns its states. */
function states(page, scene) {
  return asText(page, ({ axes, home, count }) => {
    let seed = 60;
    const within = (low, high) => low + ((seed = (seed * 48271) % 2147483647) / 2147483647) * (high - low);
    return Array.from({ length: count }, (_, n) => {
      const pose = [...home];
      for (const { letter, min, max } of axes) pose["XYZABC".indexOf(letter)] = within(min, max);
      window.pkm.take(pose, n % 2 ? [30, -20, 100] : [0, 0, 0], 0);
      return window.pkm.state();
    });
  }, { axes: scene.axes, home: scene.home.pose, count: POSES });
}

/** Compares drawn positions with those of the viewer for LinuxCNC, which gets the dependent coordinates. */
function compareGround(name, sceneFile, all, dependent) {
  const values = ({ full }) => [...dependent].map((letter) => full["XYZABC".indexOf(letter)]);
  const questions = all.map((state) => JSON.stringify({ joints: state.joints, pose: state.pose, tool: state.tool, values: {}, of_work: [12, -34, 56], dependent: values(state) }));
  const reply = spawnSync("python3", [join(HOME, "tests/viewer/placed.py"), sceneFile], { input: `${questions.join("\n")}\n`, encoding: "utf8" });
  const lines = reply.stdout.trim().split("\n").map((line) => JSON.parse(line));
  check(lines.length === all.length, `${name}: ${reply.stderr}`);
  all.forEach(({ ground, pose }, i) => {
    const { work: m } = ground;
    const ofWork = [0, 1, 2].map((k) => m[k] * 12 + m[4 + k] * -34 + m[8 + k] * 56 + m[12 + k]);
    const [tip, work, lower, upper, passive] = lines[i];
    near([ground.tip, ofWork, ground.lower, ground.upper, ground.passive].flat(3), [tip, work, lower, upper, passive].flat(3), ROUNDED, `${name}: positions at ${pose}`);
  });
}

async function constrained(page, name) {
  const machine = ini(name);
  const [{ scene }] = await opened(page, name, machine);
  const all = (await states(page, scene)).filter(({ code }) => code === 0);
  check(all.length > POSES / 2, `${name}: ${all.length} of ${POSES} poses are reached`);
  for (const tool of [[0, 0, 0], [30, -20, 100]]) {
    const own = all.filter((state) => state.tool.join() === tool.join());
    const { rows } = table("joints", machine, 0, own.map(({ pose }) => pose), tool);
    own.forEach((state, i) => {
      state.joints.forEach((value, n) => near([value], [rows[i][`joint_${n}`]], 0, `${name}: joint ${n} at ${state.pose}`));
      for (const letter of scene.dependent) near([state.full["XYZABC".indexOf(letter)]], [rows[i][letter.toLowerCase()]], 1e-9, `${name}: ${letter} at ${state.pose}`);
    });
  }
  const sceneFile = file(`${name}.json`);
  check(pkm(["scene", machine, "-o", sceneFile]).status === 0, `${name}: no scene`);
  compareGround(name, sceneFile, all, scene.dependent);
  await page.evaluate((pose) => window.pkm.take(pose, [0, 0, 0], 0), all[0].pose);
  await rested(page);
  const shown = await page.locator(".joints tr").allTextContents();
  for (const letter of scene.dependent) check(shown.some((text) => text.startsWith(`dependent ${letter}`)), `${name}: ${letter} is not listed: ${shown}`);
  const sliders = await page.locator(".pose input[type=range]").count();
  check(sliders === scene.axes.length, `${name}: ${sliders} sliders`);
  if (given.out) writeFileSync(join(given.out, `${name}.png`), await page.screenshot());
  check(complaints(page).length === 0, complaints(page).join("; "));
  return `${all.length} poses equal to pkm joints and the model beside AXIS`;
}

/** Checks the curves of dependent coordinates over a program, and that their key is shown in a narrow window. */
async function dependentCurves(page, name) {
  const { program } = SHIPPED.find(({ machine }) => machine === name);
  const [own] = await opened(page, `${name}-curves`, ini(name), program);
  const groups = (await asText(page, () => window.pkm.curves())).filter((group) => group.name.startsWith("dependent "));
  const letters = groups.flatMap(({ curves }) => curves.map((curve) => curve.name));
  check(letters.join("") === own.scene.dependent, `${name}: curves of ${letters}`);
  for (const { times, curves } of groups) {
    const places = [0.2, 0.5, 0.8].map((share) => Math.floor(share * times.length));
    const there = await asText(page, (moments) => moments.map((time) => (window.pkm.go(time), window.pkm.state())), places.map((place) => times[place]));
    places.forEach((place, k) => {
      const { rows: [row] } = table("joints", ini(name), 0, [there[k].pose], ownTool(own, there[k].tool));
      // The table is as exact as its digits: angles in degrees, lengths of 1e3.
      for (const curve of curves) near([curve.values[place]], [row[curve.name.toLowerCase()]], 1e-9, `${name}: ${curve.name} at ${times[place]} s`);
    });
  }
  const size = page.viewportSize();
  await page.setViewportSize({ width: 390, height: 844 });
  for (const { name: group } of [...groups, { name: "joints" }]) {
    await page.locator("select[aria-label=curves]").selectOption(group);
    await rested(page);
    const [key, room, over] = await page.evaluate(() => [".u-legend", ".plot", ".u-over"].map((words) => {
      const { bottom, height } = document.querySelector(words).getBoundingClientRect();
      return words === ".u-over" ? height : bottom;
    }));
    check(key <= room + 1 && over > 50, `${name}: the key of ${group} ends at ${key}, its place at ${room}; the curves are ${over} high`);
  }
  await page.setViewportSize(size);
  check(complaints(page).length === 0, complaints(page).join("; "));
  return `${letters.length} curves`;
}

export const TESTS = MACHINES.flatMap((name) => [
  [`constraints of the ${name}`, (page) => constrained(page, name)],
  [`curves of dependent coordinates of the ${name}`, (page) => dependentCurves(page, name)],
]);
