// SPDX-License-Identifier: GPL-2.0-or-later
// Compares the page's panel with the answers of pkm: pose, joints, nearest limits, travel, reasons.
import { readFileSync, writeFileSync } from "node:fs";
import { answer, asText, check, complaints, file, ini, near, opened, ownTool, pkm, rested, table } from "./browser.mjs";
import { carrying } from "./machines.mjs";

/** Returns the rows of a table or list as texts. */
export const texts = (page, rows, cells) => page.evaluate(([rows, cells]) => Array.from(document.querySelectorAll(rows),
  (row) => Array.from(row.querySelectorAll(cells), (cell) => cell.textContent)), [rows, cells]);

/** Formats a number as the page does: fixed decimals, and no minus sign before zero. */
const shown = (value, places) => (Math.round(value * 10 ** places) / 10 ** places + 0).toFixed(places);

/** Returns half a unit of the last decimal shown. */
const half = (places) => 0.5 * 10 ** -places + 1e-9;

/** LinuxCNC's letters of the second mechanism of lathe-mirrored. */
const SECOND = { X: "U", Y: "V", Z: "W", B: "C" };

/** Returns the extra axes of a mechanism from pkm. */
const extraOf = (machine, which) => JSON.parse(pkm(["scene", machine, "--mechanism", String(which + 1)]).stdout).extra_axes;

/** Returns red, green and blue for a share of range left: linear light between the colors of these shares. */
export function colorOf(share) {
  const stops = [[0, 0xe69f00], [0.1, 0xf0e442], [0.3, 0x56b4e9], [0.5, 0x0072b2], [Infinity, 0x0072b2]];
  const parts = (color) => [color >> 16, (color >> 8) & 255, color & 255];
  if (share < 0) return parts(0xd55e00);
  const light = (part) => (part / 255 < 0.04045 ? part / 255 / 12.92 : ((part / 255 + 0.055) / 1.055) ** 2.4);
  const shade = (value) => 255 * (value < 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
  const n = stops.findIndex(([at]) => share < at);
  const [[from, a], [to, b]] = [stops[n - 1], stops[n]];
  const [low, high] = [parts(a), parts(b)];
  return low.map((part, k) => shade(light(part) + ((share - from) / (to - from)) * (light(high[k]) - light(part))));
}

/** Returns the limits of a mechanism from pkm: name of the part, share of range left, and value, minimum and maximum. */
function limitsOf(machine, which, { scene, tool: spindle }, { pose, tool, extra }) {
  const own = ownTool({ scene, tool: spindle }, tool);
  const [row] = table("joints", machine, which, [pose], own).values;
  const [rods] = table("rods", machine, which, [pose], own).rows;
  const all = new Map();
  const add = (words, value, low, high, scale) => {
    const [min, max] = [low ?? -Infinity, high ?? Infinity];
    const share = Math.min(value - min, max - value) / (scale ?? (Number.isFinite(max - min) ? max - min : Math.abs(Number.isFinite(min) ? min : max)));
    if (Number.isFinite(min) || Number.isFinite(max)) all.set(words, { share, numbers: [value, min, max] });
  };
  for (const { letter, min, max, hasMin, hasMax } of scene.axes) add(`axis ${which ? SECOND[letter] : letter}`, pose["XYZABC".indexOf(letter)], hasMin ? min : null, hasMax ? max : null);
  const { joints } = JSON.parse(pkm(["scene", machine, "--mechanism", String(which + 1)]).stdout);
  joints.forEach(({ name, min, max }, i) => add(name, row[i], min, max));
  for (const { letter, min, max } of extraOf(machine, which)) add(`axis ${letter}`, extra[letter], min, max);
  scene.legs.forEach((leg, i) => {
    const { number } = joints[i];
    if (leg.base_cone) add(`the base joint of leg ${number}, base cone`, rods[`base_cone_${i}`], null, leg.base_cone);
    if (leg.platform_cone) add(`the platform joint of leg ${number}, platform cone`, rods[`platform_cone_${i}`], null, leg.platform_cone);
  });
  return all;
}

/** Compares the list of nearest limits, nearest first, each with the share of its range left. */
async function compareLimits(page, reply, limits, count) {
  const listed = await page.evaluate(() => Array.from(document.querySelectorAll(".limits > div"), (row) => {
    const bar = row.querySelector("meter-bar");
    return { words: row.querySelector("span").textContent, share: row.querySelector("em").textContent, is: row.className, title: bar.title, width: bar.style.getPropertyValue("--share"), color: bar.style.getPropertyValue("--color") };
  }));
  const shares = listed.map(({ share, width }) => (share === "beyond" ? -1 : parseFloat(width) / 100));
  check(listed.length === count, `${reply}: ${listed.length} limits are listed`);
  check(shares.every((share, k) => k === 0 || shares[k - 1] <= share + 1e-12), `${reply}: the nearest is not the first: ${shares}`);
  let compared = 0;
  for (const [words, { share, numbers }] of limits) {
    const row = listed.find((one) => one.words === words.replace(/^the /, ""));
    check(row || share >= shares.at(-1) - 1e-9, `${reply}: ${words} with ${share} is not listed: ${listed.map((one) => one.words)}`);
    if (!row) continue;
    compared += 1;
    check(share < 0 === (row.share === "beyond") && share < 0 === (row.is === "limit broken"), `${reply}: ${words} has ${share} and is ${row.share}`);
    // Shades are rounded to whole numbers.
    near(row.color.match(/\d+/g).map(Number), colorOf(share), 1, `${reply}: color of ${words} with ${share}`);
    const [, value, low, high] = /^[a-z ]+: (\S+) (?:mm|inch|degrees), allowed (\S*) … (\S*)$/.exec(row.title) ?? [];
    [value, low, high].forEach((text, k) => (Number.isFinite(numbers[k]) ? near(Number(text), numbers[k], half(3), `${reply}: ${row.title}`) : check(text === "", `${reply}: ${row.title}`)));
    if (share < 0) continue;
    near(parseFloat(row.width), 100 * Math.min(share, 1), 1e-6, `${reply}: bar of ${words}`);
    check(row.share === `${shown(100 * Math.min(share, 1), 0)} %`, `${reply}: ${words} has ${share} and is ${row.share}`);
  }
  return compared;
}

/** Compares sliders and fields with the pose and the extra axes, and checks their units. */
async function compareSliders(page, reply, scene, { pose, extra }) {
  const sliders = await page.evaluate(() => Array.from(document.querySelectorAll(".pose label"), (label) => {
    const [range, field] = label.querySelectorAll("input");
    return { isFixed: range.disabled && field.disabled && label.title !== "", letter: label.querySelector("b").textContent, unit: label.querySelector("i").textContent, value: Number(range.value), min: Number(range.min), max: Number(range.max), text: field.value };
  }));
  check(sliders.map(({ letter }) => letter).join("") === [...scene.axes, ...scene.extra_axes].map(({ letter }) => letter).join(""), `${reply}: ${sliders.map(({ letter }) => letter)}`);
  for (const { letter, unit, value, min, max, text, isFixed } of sliders) {
    const axis = [...scene.axes, ...scene.extra_axes].find((one) => one.letter === letter);
    const isExtra = scene.extra_axes.includes(axis);
    const wanted = isExtra ? extra[letter] : pose["XYZABC".indexOf(letter)];
    const isAngle = "ABC".includes(letter);
    check(isFixed === (isExtra && scene.chain.every((link) => link.letter !== letter)), `${reply}: ${letter} can be set: ${!isFixed}`);
    check(unit === (isAngle ? "°" : scene.length_unit), `${reply}: ${letter} is in ${unit}`);
    const [low, high] = isExtra && isAngle ? [Math.max(axis.min, -360), Math.min(axis.max, 360)] : [axis.min, axis.max];
    const beyond = isExtra ? 0 : 0.1 * (high - low);
    near([min, max], [low - beyond, high + beyond], 1e-9 * (high - low), `${reply}: range of ${letter}`);
    near(value, Math.min(Math.max(wanted, min), max), 1e-9, `${reply}: slider of ${letter}`);
    near(Number(text), wanted, half(4), `${reply}: field of ${letter}`);
  }
}

/** Compares travel with `pkm travel`, which proves the whole path; the page samples a hundred points. */
async function compareTravel(page, reply, machine, which, own, { pose, tool, extra }, ends) {
  const all = [...own.scene.axes, ...own.scene.extra_axes];
  const words = all.map(({ letter }) => `${which ? SECOND[letter] : letter}${(extra[letter] ?? pose["XYZABC".indexOf(letter)]).toFixed(12)}`);
  const { travel } = answer("travel", machine, "--mechanism", which + 1, "--tool", ...ownTool(own, tool), "--pose", ...words);
  const rows = await texts(page, "table.travel tr", "td");
  const expected = all.flatMap(({ letter }) => {
    const axis = which ? SECOND[letter] : letter;
    const way = travel.find((one) => one.letter === axis);
    return [["−", way.minus], ["+", way.plus]].map(([sign, side]) => ({ axis, letter, sign, unit: way.unit, ...side }));
  });
  check(rows.length === expected.length, `${reply}: ${rows.length} directions, ${expected.length} of pkm travel`);
  expected.forEach(({ axis, letter, unit, sign, left, stop }, k) => {
    const [name, value, shownUnit, end] = rows[k];
    check(name === `${sign}${letter}` && shownUnit === (unit === "degrees" ? "°" : unit), `${reply}: ${rows[k]} where ${sign}${letter} in ${unit} is expected`);
    near(Number(value), left, half(2) + 2e-5 * Math.abs(left), `${reply}: travel ${name}`);
    check(stop.replace(`axis ${axis}: `, "") === end, `${reply}: ${name} ends at "${end}", by pkm travel at "${stop}"`);
    ends.add(end);
  });
  return rows.length;
}

/** Checks the travel of extra axes of a machine on which they carry something: that of each alone, without the pose. */
async function checkCarrying(page, reply, machine, which, { scene }, { extra }) {
  const rows = (await texts(page, "table.travel tr", "td")).slice(2 * scene.axes.length);
  const expected = extraOf(machine, which).flatMap(({ letter, min, max }) => [[`−${letter}`, extra[letter] - min], [`+${letter}`, max - extra[letter]]]);
  check(expected.length > 0 && rows.length === expected.length, `${reply}: ${rows.length} directions of extra axes, not ${expected.length}`);
  expected.forEach(([name, left], k) => {
    check(rows[k][0] === name && rows[k][3] === "axis range", `${reply}: ${rows[k]} where ${name} is expected`);
    near(Number(rows[k][1]), left, half(2), `${reply}: travel ${name}`);
  });
}

/** Returns a pose at a share of the distance from home to the ends of the axes, alternately to either end. */
function part({ home, axes }, share) {
  const pose = [...home.pose];
  axes.forEach(({ letter, min, max }, n) => {
    const k = "XYZABC".indexOf(letter);
    pose[k] += share * ((n + (share < 0)) % 2 ? max - pose[k] : min - pose[k]);
  });
  return pose;
}

const POSES = [0, 0.3, -0.45];

/** Returns the INI file of a machine with three times the range of X, Y and Z, so that joints end the travel. */
function wide(machine) {
  return readFileSync(ini(machine), "utf8").replace(/(\[AXIS_[XYZ]\][^[]*?)(M.._LIMIT = )(\S+)([^[]*?)(M.._LIMIT = )(\S+)/g, (_, section, first, a, between, second, b) =>
    `${section}${first}${2 * a - b}${between}${second}${2 * b - a}`).replace(/^\[BOX_\d+\][^[]*/gm, "").replace(" boxes=1", "");
}

async function panel(page) {
  writeFileSync(file("letters.ini"), carrying()["carried-legs"]);
  for (const machine of ["tripod", "hexapod"]) writeFileSync(file(`${machine}-wide.ini`), wide(machine));
  const machines = [...["tripod", "hexapod", "lathe-mirrored", "lathe-counter-spindle", "pyramid", "rotary-delta"].map((name) => [name, ini(name)]), ...["letters", "tripod-wide", "hexapod-wide"].map((name) => [name, file(`${name}.ini`)])];
  let [limits, ways, ends] = [0, 0, new Set()];
  for (const [name, machine] of machines) {
    const mechanisms = await opened(page, `${name}-panel`, machine);
    check(await page.locator("select[aria-label=mechanism]").count() === (mechanisms.length > 1 ? 1 : 0), `${name}: wrong selection of the mechanism`);
    for (const [which, own] of mechanisms.entries()) {
      if (mechanisms.length > 1) await page.locator("select[aria-label=mechanism]").selectOption(`mechanism ${which + 1}`);
      for (const share of POSES) {
        const reply = `${name}, mechanism ${which + 1}, ${share}`;
        const { scene } = own;
        const extra = Object.fromEntries(scene.extra_axes.map(({ letter, home }, k) => [letter, home + share * (20 + k)]));
        await page.evaluate(([pose, tool, which, extra]) => window.pkm.take(pose, tool, which, extra), [part(scene, share), own.tool.map((value) => value + share), which, extra]);
        await rested(page);
        const state = await asText(page, (which) => window.pkm.state(which), which);
        const [values] = table("joints", machine, which, [state.pose], ownTool(own, state.tool)).values;
        const rows = await texts(page, "table.joints tr", "td");
        const others = extraOf(machine, which).map(({ letter }) => (
          { name: `axis ${letter}`, unit: "ABC".includes(letter) ? "degrees" : scene.length_unit, value: state.extra[letter] }));
        const expected = [...scene.joints.map(({ name, unit }, k) => ({ name, unit, value: values[k] })), ...others];
        check(rows.length === expected.length, `${reply}: ${rows.length} joints`);
        rows.forEach(([joint, value, unit], k) => {
          check(joint === expected[k].name && unit === expected[k].unit, `${reply}: joint ${k} is ${joint} in ${unit}`);
          near(Number(value), expected[k].value, half(4), `${reply}: ${joint}`);
        });
        await compareSliders(page, reply, scene, state);
        limits += await compareLimits(page, reply, limitsOf(machine, which, own, state), 9);
        if (scene.chain.length === 0) ways += await compareTravel(page, reply, machine, which, own, state, ends);
        else await checkCarrying(page, reply, machine, which, own, state);
      }
    }
    check(complaints(page).length === 0, complaints(page).join("; "));
  }
  check(ends.size > 1, `travel ends only at ${[...ends]}`);
  return `${limits} limits and ${ways} directions equal to those of pkm`;
}

export const TESTS = [["the panel shows the answers of pkm joints, rods and travel", panel]];
