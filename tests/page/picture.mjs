// SPDX-License-Identifier: GPL-2.0-or-later
// Compares the page's picture with the answers of pkm: cones, colors, tool, workspace, cuts, views, and dragging.
import { readFileSync, writeFileSync } from "node:fs";
import { answer, asText, box, check, complaints, file, ini, near, opened, ownTool, rested, table } from "./browser.mjs";
import { carrying } from "./machines.mjs";

/** Rounding of positions in the picture: 32-bit numbers of lengths of 1e3. */
const SINGLE = 2e-4;

const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
const less = (a, b) => a.map((value, k) => value - b[k]);
const scaled = (a, by) => a.map((value) => value * by);
const unit = (a) => scaled(a, 1 / Math.hypot(...a));
const degrees = (a, b) => (Math.acos(Math.min(Math.max(dot(unit(a), unit(b)), -1), 1)) * 180) / Math.PI;

/** Returns the base and platform end of a leg from a row of `pkm rods`. */
const ends = (row, n) => ["base", "platform"].map((which) => ["x", "y", "z"].map((axis) => row[`${which}_${n}_${axis}`]));

/** Returns the cones in the picture: tip, direction and half angle. */
const cones = (page) => asText(page, () => {
  const found = [];
  window.seen.scene.updateMatrixWorld(true);
  window.seen.scene.traverse((object) => {
    if (object.geometry?.type !== "ConeGeometry" || !object.geometry.parameters.openEnded) return;
    let isShown = true;
    object.traverseAncestors((above) => (isShown &&= above.visible));
    const { height, radius } = object.geometry.parameters;
    const places = object.geometry.attributes.position;
    const point = (k) => object.position.clone().fromBufferAttribute(places, k).applyMatrix4(object.matrixWorld).toArray();
    const tip = object.getWorldPosition(object.position.clone()).toArray();
    const rim = Array.from({ length: places.count }, (_, k) => point(k)).filter((p) => Math.hypot(p[0] - tip[0], p[1] - tip[1], p[2] - tip[2]) > 0.5 * height).slice(1);
    const middle = [0, 1, 2].map((k) => rim.reduce((sum, p) => sum + p[k], 0) / rim.length);
    found.push({ tip, middle, rim: rim.slice(0, 12), isShown: isShown && object.visible, half: (Math.atan(radius / height) * 180) / Math.PI });
  });
  return found;
});

const NEAR = "e69f00";
const BEYOND = "d55e00";
const ROD = "c3ccd6";

/** Smallest distance of legs, mm: little below that at home. */
const CLEARANCE = 102;

/** Returns the distance of two legs, from 400 parts of the first. */
function distance(a, { lower, upper }) {
  const along = less(upper, lower);
  return Math.min(...Array.from({ length: 401 }, (_, n) => {
    const from = less(a.lower.map((value, k) => value + (n / 400) * (a.upper[k] - value)), lower);
    const share = Math.min(Math.max(dot(from, along) / dot(along, along), 0), 1);
    return Math.hypot(...less(from, scaled(along, share)));
  }));
}

/** Checks that legs beyond a cone or closer to each other than allowed are red, and that those near a cone are orange. */
async function coloredByLegs(page, machine, { scene, tool }) {
  const seen = new Set();
  // Tilted and turned, one pair of legs is closer to each other; tilted to the other side, one leg is beyond its cone.
  const poses = [[0, 0], [20, 20], [-20, 20]].map(([a, c]) => scene.home.pose.map((value, k) => value + [0, 0, 0, a, 0, c][k]));
  const { rows } = table("rods", machine, 0, poses, ownTool({ scene, tool }, tool));
  for (const [place, row] of rows.entries()) {
    const pose = poses[place];
    await page.evaluate((pose) => window.pkm.take(pose), pose);
    const { code, legs, joints } = await asText(page, () => window.pkm.state());
    check(code === 0, `${machine}: refused at ${pose}`);
    const colors = {};
    for (const color of [ROD, NEAR, BEYOND]) colors[color] = await bars(page, color);
    scene.legs.forEach(({ base_cone: base, platform_cone: platform }, n) => {
      const { min, max } = scene.joints[n];
      const close = legs.some((leg, k) => k !== n && distance(legs[n], leg) < CLEARANCE);
      const share = Math.min((base - row[`base_cone_${n}`]) / base, (platform - row[`platform_cone_${n}`]) / platform, Math.min(joints[n] - min, max - joints[n]) / (max - min));
      const wanted = share < 0 || close ? BEYOND : share < 0.1 ? NEAR : ROD;
      const found = Object.keys(colors).filter((color) => colors[color].some(([from, to]) => Math.hypot(...less(from, legs[n].lower)) < SINGLE * 5 && Math.hypot(...less(to, legs[n].upper)) < SINGLE * 5));
      check(String(found) === wanted, `${machine}: leg ${n} with ${share} left at ${pose} is ${found}, expected ${wanted}`);
      seen.add(share >= 0 && close ? "close" : wanted);
    });
  }
  check(seen.size === 4, `${machine}: colors only for ${[...seen]}`);
}

/** Checks that each cone is at its joint, about the leg at home, with the angle of the INI file, and that the platform's cones
 * move with it. */
async function conesTest(page) {
  let count = 0;
  for (const machine of ["hexapod", "lab-hexapod", "tripod", "rotary-delta", "lathe-mirrored"]) {
    // No shipped machine has cones at its platform.
    const own = file(`${machine}-cones.ini`);
    writeFileSync(own, readFileSync(ini(machine), "utf8").replaceAll(/^BASE_CONE = .*$/gm, `$&\nPLATFORM_CONE = ${machine === "hexapod" ? 33 : 35}`).replace(/ROD_CLEARANCE = .*/, `ROD_CLEARANCE = ${CLEARANCE}`));
    const mechanisms = await opened(page, `${machine}-cones`, own);
    check((await cones(page)).every(({ isShown }) => !isShown), `${machine}: cones are shown before they are asked for`);
    await box(page, "cones of the joints").check();
    const found = await cones(page);
    let wanted = 0;
    for (const [which, own] of mechanisms.entries()) {
      const { rows: [row] } = table("rods", file(`${machine}-cones.ini`), which, [own.scene.home.pose], [0, 0, 0]);
      own.scene.legs.forEach((leg, n) => {
        const [low, high] = ends(row, n);
        for (const [at, way, angle] of [[low, less(high, low), leg.base_cone], [high, less(low, high), leg.platform_cone]]) {
          if (!angle) continue;
          wanted += 1;
          const cone = found.find(({ tip, middle }) => Math.hypot(...less(tip, at)) < SINGLE && degrees(less(middle, tip), way) < 1e-2);
          check(cone?.isShown, `${machine}: no cone at ${at} along ${way}`);
          near(cone.half, Math.min(angle, 80), 1e-6, `${machine}: half angle at leg ${n}`);
          for (const point of cone.rim) near(degrees(less(point, cone.tip), way), Math.min(angle, 80), 0.01, `${machine}: rim of the cone of leg ${n}`);
        }
      });
    }
    check(found.length === wanted && wanted > 0, `${machine}: ${found.length} cones, ${wanted} in the INI file`);
    count += wanted;
    const before = found.map(({ tip }) => tip);
    const home = mechanisms[0].scene.home.pose;
    await page.evaluate((pose) => window.pkm.take(pose), home.map((value, k) => value + (k === 2 ? 0.01 * Math.abs(value) : 0)));
    const after = (await cones(page)).map(({ tip }) => tip);
    const gone = before.map((tip, n) => Math.hypot(...less(after[n], tip))).filter((way) => way > SINGLE).length;
    check(gone === mechanisms[0].scene.legs.filter(({ platform_cone: angle }) => angle).length, `${machine}: ${gone} cones go with the platform`);
    if (machine === "hexapod") await coloredByLegs(page, own, mechanisms[0]);
    await box(page, "cones of the joints").uncheck();
    check((await cones(page)).every(({ isShown }) => !isShown), `${machine}: cones stay`);
  }
  return `${count} cones`;
}


/** Checks that a leg is orange within a tenth of its range from a limit and red beyond it, and that the text beside the picture
 * names the violated limit. */
async function colors(page) {
  for (const machine of ["tripod", "hexapod", "linear-delta"]) {
    const text = readFileSync(ini(machine), "utf8").replace(/(\[AXIS_Z\][^[]*?MIN_LIMIT = )\S+/, "$1-9999").replace(/(\[AXIS_Z\][^[]*?MAX_LIMIT = )\S+/, "$19999").replaceAll(/_CONE = \S+/g, "_CONE = 179").replace(/^\[BOX_\d+\][^[]*/gm, "").replace(" boxes=1", "");
    const narrow = file(`${machine}-long.ini`);
    writeFileSync(narrow, text);
    const [own] = await opened(page, `${machine}-colors`, narrow);
    const seen = new Set();
    const size = Math.max(...own.scene.legs.map(({ base }) => Math.hypot(...base)));
    for (let n = -16; n <= 16; n++) {
      const pose = own.scene.home.pose.map((value, k) => value + (k === 2 ? (n / 16) * size : 0));
      const state = await asText(page, (pose) => (window.pkm.take(pose), window.pkm.state()), pose);
      if (state.code !== 0) continue;
      const [values] = table("joints", narrow, 0, [pose], ownTool(own, own.tool)).values;
      const found = await asText(page, () => {
        const rods = [];
        window.seen.scene.updateMatrixWorld(true);
        window.seen.scene.traverse((object) => object.geometry?.type === "CylinderGeometry" && object.geometry.parameters.height === 1 && rods.push({ color: object.material.color.getHexString(), at: object.getWorldPosition(object.position.clone()).toArray(), end: object.localToWorld(object.position.clone().set(0, 1, 0)).toArray() }));
        return rods;
      });
      const { legs } = state;
      const shares = values.map((value, k) => Math.min(value - own.scene.joints[k].min, own.scene.joints[k].max - value) / (own.scene.joints[k].max - own.scene.joints[k].min));
      legs.forEach(({ lower, upper }, k) => {
        const rod = found.find(({ at, end }) => Math.hypot(...less(at, lower)) < SINGLE * size && Math.hypot(...less(end, upper)) < SINGLE * size);
        check(rod, `${machine}: no rod of leg ${k} at ${pose}`);
        // Dead points count too: struts have none, and near home the rods of a delta on rails are far from theirs.
        if (own.scene.legs[k].kind !== "strut" && shares[k] > 0.1) return;
        const wanted = shares[k] < 0 ? BEYOND : shares[k] < 0.1 ? NEAR : ROD;
        check(rod.color === wanted, `${machine}: rod of leg ${k} with ${shares[k]} is ${rod.color}`);
        seen.add(wanted);
      });
      const reason = await page.locator(".reason").textContent();
      const worst = Math.min(...shares);
      if (worst < 0) {
        const k = shares.indexOf(worst);
        const { name, min, max } = own.scene.joints[k];
        const isBelow = values[k] < min;
        check(!reason.includes(name) || reason.startsWith(`${name} is at ${values[k].toFixed(3)} ${own.scene.joints[k].unit}, ${isBelow ? "below" : "above"} its limit of ${(isBelow ? min : max).toFixed(3)} (`), `${machine}: ${reason}, joint at ${values[k]}`);
        check(reason !== "", `${machine}: no reason at ${pose}`);
      }
    }
    check(seen.size === (own.scene.legs[0].kind === "strut" ? 3 : 2), `${machine}: rods are ${[...seen]}`);
  }
}

/** Returns the surface of the workspace as points and triangles, and the lines of the axis limits. */
const space = (page) => asText(page, () => {
  const found = {};
  window.seen.scene.traverse((object) => {
    const { position, normal } = object.geometry?.attributes ?? {};
    if (object.material?.opacity === 0.38) found.body = { points: Array.from(position.array), faces: Array.from(object.geometry.index.array), normals: normal.count };
    if (object.type === "LineSegments" && object.material.color.getHexString() === "3d4650") found.lines = Array.from(position.array);
  });
  return found;
});

const triples = (list) => Array.from({ length: list.length / 3 }, (_, n) => list.slice(3 * n, 3 * n + 3));

/** Returns the distances at which a ray from a point meets a surface, nearest first. */
function meeting({ points, faces }, from, way) {
  const all = triples(points);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  return triples(faces).flatMap(([i, j, k]) => {
    const [p, q, r] = [all[i], all[j], all[k]];
    const [e, f] = [less(q, p), less(r, p)];
    const h = cross(way, f);
    const det = dot(e, h);
    if (Math.abs(det) < 1e-12) return [];
    const s = less(from, p);
    const u = dot(s, h) / det;
    const v = dot(way, cross(s, e)) / det;
    const t = dot(f, cross(s, e)) / det;
    return u >= -1e-9 && v >= -1e-9 && u + v <= 1 + 1e-9 && t > 0 ? [t] : [];
  }).sort((a, b) => a - b);
}

/** Checks that the distances to the surface, from home and from a tilted pose, equal the travel of pkm on the same machine
 * without axis limits. */
async function workspaceTest(page) {
  let ways = 0;
  for (const [machine, turn, length] of [["hexapod", [0, 0, 0], 80], ["hexapod", [18, -14, 9], 0], ["tripod", [0, 0, 0], 0], ["linear-delta", [0, 0, 0], 0]]) {
    const [own] = await opened(page, `${machine}-space`, ini(machine));
    const wide = file(`${machine}-free.ini`);
    const letter = (text, name) => text.replace(new RegExp(`(\\[AXIS_${name}\\][^[]*?MIN_LIMIT = )\\S+`), "$1-99999").replace(new RegExp(`(\\[AXIS_${name}\\][^[]*?MAX_LIMIT = )\\S+`), "$199999");
    writeFileSync(wide, [..."XYZ"].reduce(letter, readFileSync(ini(machine), "utf8")).replace(/^\[BOX_\d+\][^[]*/gm, "").replace(" boxes=1", ""));
    const pose = own.scene.home.pose.map((value, k) => value + (k < 3 ? 0 : turn[k - 3]));
    const tool = [0, 0, length];
    await page.evaluate(([pose, tool]) => window.pkm.take(pose, tool), [pose, tool]);
    await rested(page);
    const { body, lines } = await space(page);
    check(body.normals * 3 === body.points.length, `${machine}: normals`);
    const { travel } = answer("travel", wide, "--pose", ...pose, "--tool", ...tool);
    const all = triples(body.points);
    const cell = Math.max(...[0, 1, 2].map((k) => Math.max(...all.map((p) => p[k])) - Math.min(...all.map((p) => p[k])))) / 24;
    for (const [k, name] of [..."XYZ"].entries()) {
      const way = travel.find((one) => one.letter === name);
      for (const [sign, { left }] of [[-1, way.minus], [1, way.plus]]) {
        const [at] = meeting(body, pose.slice(0, 3), [0, 1, 2].map((n) => (n === k ? sign : 0)));
        check(at !== undefined, `${machine}: ${sign}${name} meets no surface`);
        // A surface from cells cuts off the sharp corners of a delta's workspace.
        near(at, left, (machine === "linear-delta" ? 2 : 1) * cell, `${machine}: way ${sign}${name} to the surface`);
        ways += 1;
      }
    }
    // Faces are oriented outward: their volume is positive.
    const volume = triples(body.faces).reduce((sum, [i, j, k]) => {
      const [p, q, r] = [all[i], all[j], all[k]];
      return sum + (p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) + p[2] * (q[0] * r[1] - q[1] * r[0])) / 6;
    }, 0);
    check(Math.abs(volume) > 0, `${machine}: volume ${volume}`);
    const inside = answer("workspace", wide, "--bands", 12, "--grid", 20, "--tool", ...tool).volume_by_boundary;
    if (turn.every((angle) => angle === 0)) near(Math.abs(volume), inside, 0.12 * inside, `${machine}: volume of the workspace`);
    const range = own.scene.axes.slice(0, 3).map(({ min, max }) => [min, max]);
    const edges = triples(lines).reduce((pairs, point, n) => (n % 2 ? [...pairs.slice(0, -1), [pairs.at(-1), point]] : [...pairs, point]), []);
    check(edges.length === 12 && new Set(edges.map((edge) => String(edge.map(String).sort()))).size === 12, `${machine}: ${edges.length} edges of the axis limits`);
    for (const [a, b] of edges) {
      check([a, b].every((point) => point.every((value, k) => range[k].some((end) => Math.abs(value - end) < SINGLE))), `${machine}: an edge from ${a} to ${b}`);
      check(a.filter((value, k) => value !== b[k]).length === 1, `${machine}: an edge across, from ${a} to ${b}`);
    }
    await box(page, "workspace at these angles").uncheck();
    check((await space(page)).body === undefined, `${machine}: the workspace stays`);
    await box(page, "workspace at these angles").check();
    check((await space(page)).body.points.length === body.points.length, `${machine}: the workspace does not come back`);
  }
  return `${ways} ways to the surface`;
}

const RIGHT = { X: [1, 0, 0], Y: [0, 1, 0], Z: [0, 0, 1] };

/** Checks that views look along the axes, and that a cut hides the parts on the viewer's side. */
async function viewsTest(page) {
  for (const [machine, standing] of [["hexapod", true], ["four-rod-lathe", false], ["hexapod-rotary-table", true]]) {
    await opened(page, `${machine}-views`, ini(machine));
    const looks = {};
    for (const name of ["front", "side", "top", "3D"]) {
      await page.getByRole("button", { name, exact: true }).click();
      await page.waitForTimeout(50);
      looks[name] = await asText(page, () => {
        const { camera, scene } = window.seen;
        camera.updateMatrixWorld();
        const box = [];
        scene.traverse((object) => object.geometry?.type === "CylinderGeometry" && box.push(object.getWorldPosition(object.position.clone()).project(camera).toArray()));
        const way = camera.getWorldDirection(camera.position.clone()).toArray();
        const up = camera.up.clone().set(0, 1, 0).applyQuaternion(camera.quaternion).toArray();
        return { way, up, box };
      });
    }
    const wanted = standing ? { front: [[0, 1, 0], [0, 0, 1]], side: [[-1, 0, 0], [0, 0, 1]], top: [[0, 0, -1], [0, 1, 0]] } : { front: [[1, 0, 0], [0, 1, 0]], side: [[0, 0, -1], [0, 1, 0]], top: [[0, -1, 0], [1, 0, 0]] };
    for (const [name, [way, up]] of Object.entries(wanted)) {
      near(looks[name].way, way, 1e-3, `${machine}: ${name} looks`);
      near(looks[name].up, up, 1e-3, `${machine}: up of ${name}`);
    }
    for (const [name, { box: all }] of Object.entries(looks)) {
      check(all.every(([x, y]) => Math.abs(x) <= 1.01 && Math.abs(y) <= 1.01), `${machine}: from ${name} something is out of sight`);
      check(all.some(([x, y]) => Math.max(Math.abs(x), Math.abs(y)) > 0.5), `${machine}: from ${name} all is small`);
    }
    const top = await asText(page, () => {
      window.pkm.look("top");
      const { camera } = window.seen;
      return camera.getWorldDirection(camera.position.clone()).toArray();
    });
    near(top, looks.top.way, 1e-9, `${machine}: another program looks from the top`);
    for (const letter of "XYZ") {
      await page.locator("select[aria-label=cut]").selectOption(`cut: ${letter}`);
      const planes = await asText(page, () => {
        const slider = document.querySelector("input[aria-label='position of the cut']");
        return [0.25, 0.75].map((value) => {
          slider.value = value;
          slider.dispatchEvent(new Event("input"));
          const [{ normal, constant }] = window.seen.renderer.clippingPlanes;
          return { normal: normal.toArray(), at: -constant / (normal.x + normal.y + normal.z) };
        });
      });
      const sign = letter === "Y" ? 1 : -1;
      planes.forEach(({ normal }) => near(normal, scaled(RIGHT[letter], sign), 0, `${machine}: cut ${letter}`));
      const { min, max } = await asText(page, (k) => {
        const places = [];
        window.seen.scene.traverse((object) => object.geometry?.parameters?.widthSegments === 24 && places.push(object.getWorldPosition(object.position.clone()).toArray()[k]));
        return { min: Math.min(...places), max: Math.max(...places) };
      }, "XYZ".indexOf(letter));
      const step = planes[1].at - planes[0].at;
      check(step > 0.45 * (max - min) && planes[0].at > min - 0.3 * (max - min) && planes[1].at < max + 0.3 * (max - min), `${machine}: cut ${letter} at ${planes.map(({ at }) => at)} of ${min} to ${max}`);
    }
    await page.locator("select[aria-label=cut]").selectOption("cut: nothing");
    check((await page.evaluate(() => window.seen.renderer.clippingPlanes.length)) === 0, `${machine}: the cut stays`);
    await crossTest(page, machine);
  }
  await page.setViewportSize({ width: 900, height: 700 });
  await rested(page);
  const { aspect, canvas, stage } = await asText(page, () => {
    const size = (words) => [document.querySelector(words).clientWidth, document.querySelector(words).clientHeight];
    return { aspect: window.seen.camera.aspect, canvas: size("canvas.picture"), stage: size(".stage") };
  });
  near(canvas, stage, 0, "size of the picture after another size of the window");
  // Widths are rounded to pixels.
  near(aspect, stage[0] / stage[1], 0.01, "shape of the picture");
  await page.setViewportSize({ width: 1280, height: 800 });
}

/** Checks that lines along X, Y and Z begin at the origin of the work, each with its letter behind its end. */
async function crossTest(page, machine) {
  const found = await asText(page, () => {
    let cross;
    window.seen.scene.traverse((object) => {
      const count = (type) => object.children.filter((part) => part.type === type).length;
      if (count("LineSegments") === 3 && count("Sprite") === 3) cross = object;
    });
    const parts = (type) => cross.children.filter((part) => part.type === type);
    return {
      lines: parts("LineSegments").map(({ geometry }) => Array.from(geometry.attributes.position.array)), colors: parts("LineSegments").map(({ material }) => material.color.getHexString()),
      letters: parts("Sprite").map(({ position }) => position.toArray()),
    };
  });
  const size = found.lines[0][3];
  check(size > 0, `${machine}: X is ${size} long`);
  [RIGHT.X, RIGHT.Y, RIGHT.Z].forEach((way, k) => {
    near(found.lines[k], [0, 0, 0, ...scaled(way, size)], 0, `${machine}: line along ${"XYZ"[k]}`);
    const along = dot(found.letters[k], way);
    check(along > size && along < 1.5 * size, `${machine}: letter of ${"XYZ"[k]} at ${along} of ${size}`);
    near(found.letters[k], scaled(way, along), 0, `${machine}: letter of ${"XYZ"[k]}`);
  });
  check(String(found.colors) === "d55e00,009e73,0072b2", `${machine}: colors ${found.colors}`);
}

/** Returns the ends of all bars of a color. */
const bars = (page, color) => asText(page, (color) => {
  const found = [];
  window.seen.scene.updateMatrixWorld(true);
  window.seen.scene.traverse((object) => {
    if (object.geometry?.type !== "CylinderGeometry" || object.geometry.parameters.height !== 1 || object.material.color.getHexString() !== color) return;
    found.push([object.getWorldPosition(object.position.clone()).toArray(), object.localToWorld(object.position.clone().set(0, 1, 0)).toArray()]);
  });
  return found;
}, color);

/** Checks that the base is a ring through its anchors, each guide is as long as its carriage's range, each shaft is along its
 * axis, and each arm joins its shaft and rod. */
async function baseTest(page) {
  const at = (a, b) => Math.hypot(...less(a, b)) < 1e-2;
  // The middle of the pentapod's anchors is not the origin.
  for (const machine of ["pentapod", "tripod", "rotary-delta", "linear-delta"]) {
    const [{ scene }] = await opened(page, `${machine}-base`, ini(machine));
    const size = Math.max(...scene.legs.flatMap(({ base, rod = 0 }) => [Math.hypot(...base), rod]));
    const state = await asText(page, () => window.pkm.state());
    const base = await bars(page, "6b7785");
    if (scene.legs[0].kind !== "slider") {
      const feet = scene.legs.map((leg) => leg.base);
      const ring = base.filter((ends) => ends.every((end) => feet.some((foot) => at(end, foot))));
      check(ring.length === feet.length && feet.every((foot) => ring.flat().filter((end) => at(end, foot)).length === 2), `${machine}: ${ring.length} bars between ${feet.length} feet`);
      // A self-crossing ring is longer than the one ordered about the middle.
      const middle = [0, 1].map((k) => feet.reduce((sum, foot) => sum + foot[k], 0) / feet.length);
      const around = [...feet].sort((a, b) => Math.atan2(a[1] - middle[1], a[0] - middle[0]) - Math.atan2(b[1] - middle[1], b[0] - middle[0]));
      const length = (pairs) => pairs.reduce((sum, [a, b]) => sum + Math.hypot(...less(a, b)), 0);
      near(length(ring), length(around.map((foot, n) => [foot, around[(n + 1) % feet.length]])), 1e-2, `${machine}: length of the ring`);
    }
    const [guides, arms] = [await bars(page, "9aa5b1"), await bars(page, "8a6d9e")];
    scene.legs.forEach((leg, n) => {
      if (leg.kind === "slider") {
        const along = guides.map((ends) => ends.map((end) => dot(less(end, leg.base), leg.guide)).sort((a, b) => a - b));
        const own = guides.findIndex((ends) => ends.every((end) => Math.hypot(...less(less(end, leg.base), scaled(leg.guide, dot(less(end, leg.base), leg.guide)))) < 1e-2));
        check(own >= 0, `${machine}: no guide of leg ${n}`);
        const beyond = [scene.joints[n].min + leg.offset - along[own][0], along[own][1] - scene.joints[n].max - leg.offset];
        check(beyond.every((more) => more > 0 && more < 0.1 * size), `${machine}: the guide of leg ${n} ends ${beyond} behind the joint's range`);
      } else if (leg.kind === "crank") {
        check(arms.some(([from, to]) => at(from, leg.base) && at(to, state.ground.lower[n])), `${machine}: no arm of leg ${n}`);
        check(base.some(([from, to]) => degrees(less(to, from), leg.axis) < 0.01 && at(scaled([0, 1, 2].map((k) => from[k] + to[k]), 0.5), leg.base)), `${machine}: no shaft of leg ${n}`);
      }
    });
    const [rods, barrels] = [await bars(page, ROD), await bars(page, "56789a")];
    scene.legs.forEach(({ kind, offset }, n) => {
      const [lower, upper] = [state.ground.lower[n], state.ground.upper[n]];
      check(rods.some(([from, to]) => at(from, lower) && at(to, upper)), `${machine}: no rod of leg ${n}`);
      if (kind !== "strut") return;
      const barrel = barrels.find(([from, to]) => at(from, lower) && degrees(less(to, from), less(upper, lower)) < 0.01);
      check(barrel, `${machine}: no barrel of leg ${n}`);
      near(Math.hypot(...less(barrel[1], barrel[0])), 0.92 * (scene.joints[n].min + offset), 1e-3 * size, `${machine}: barrel of leg ${n}`);
    });
  }
}

/** Checks that the body of the platform reaches all anchors, and encloses the rings on which anchors slide. */
async function platformTest(page) {
  for (const machine of ["pentapod", "hexapod"]) {
    const [{ scene }] = await opened(page, `${machine}-platform`, ini(machine));
    const points = triples(await asText(page, () => {
      const found = [];
      window.seen.scene.traverse((object) => object.isMesh && object.geometry.type === "BufferGeometry" && object.material.color.getHexString() === "0072b2" && found.push(...object.geometry.attributes.position.array));
      return found;
    }));
    const size = Math.max(...scene.legs.map(({ platform }) => Math.hypot(...platform)));
    for (const { kind, platform, radius } of scene.legs) {
      const away = points.map((point) => Math.hypot(...less(point, platform)));
      const across = points.map(([x, y]) => Math.hypot(x - platform[0], y - platform[1]));
      if (kind === "ring") check(Math.max(...across) >= radius, `${machine}: the body reaches ${Math.max(...across)} of a ring of ${radius}`);
      else check(Math.min(...away) < 0.1 * size, `${machine}: the body ends ${Math.min(...away)} before ${platform}`);
    }
  }
}

/** Checks that the tool tip is at the position of pkm, its shaft between platform and tip, and labels at their legs. */
async function toolTest(page) {
  writeFileSync(file("held.ini"), carrying()["carried-tool"]);
  for (const [machine, path] of [["hexapod", ini("hexapod")], ["tripod", ini("tripod")], ["pyramid", ini("pyramid")], ["carried-tool", file("held.ini")]]) {
    const [own] = await opened(page, `${machine}-tool`, path);
    const { home } = own.scene;
    const scale = Math.max(...own.scene.legs.map(({ base }) => Math.hypot(...base)));
    for (const length of [0, 0.05 * scale, -0.1 * scale]) {
      const tool = [0, 0, length];
      const state = await asText(page, ([pose, tool]) => (window.pkm.take(pose, tool), window.pkm.state()), [home.pose, tool]);
      const parts = await asText(page, () => {
        const found = { cone: [], bars: [], labels: [] };
        window.seen.scene.updateMatrixWorld(true);
        window.seen.scene.traverse((object) => {
          const place = () => object.getWorldPosition(object.position.clone()).toArray();
          if (object.geometry?.type === "ConeGeometry" && !object.geometry.parameters.openEnded && object.geometry.parameters.radialSegments === 24) found.cone.push({ tip: object.localToWorld(object.position.clone().set(0, object.geometry.parameters.height / 2, 0)).toArray(), at: place(), height: object.geometry.parameters.height });
          if (object.geometry?.type === "CylinderGeometry" && object.geometry.parameters.height === 1 && object.visible && object.material.color.getHexString() === "009e73") found.bars.push([place(), object.localToWorld(object.position.clone().set(0, 1, 0)).toArray()]);
          if (object.type === "Sprite" && object.renderOrder === 10) found.labels.push(place());
        });
        return found;
      });
      const { tip } = state.ground;
      const [cone] = parts.cone;
      check(parts.cone.length === 1, `${machine}: ${parts.cone.length} tips`);
      if (own.scene.chain.length === 0 || length) {
        near(cone.tip, tip, SINGLE * 10, `${machine}: point of the tool of ${length}`);
        near(Math.hypot(...less(cone.at, tip)), cone.height / 2, SINGLE * 10, `${machine}: middle of the point`);
      }
      if (parts.bars.length && own.scene.chain.length === 0) {
        const [from, to] = parts.bars[0];
        near(Math.hypot(...less(to, tip)), cone.height, 1e-3 * scale, `${machine}: neck of the tool of ${length}`);
        check(Math.abs(degrees(less(to, from), less(tip, to))) < 0.1, `${machine}: the shaft of ${length} is bent`);
      }
      own.scene.legs.forEach((_, n) => {
        const [lower, upper] = [state.ground.lower[n], state.ground.upper[n]];
        const at = lower.map((value, k) => value + 0.3 * (upper[k] - value));
        check(parts.labels.some((place) => Math.hypot(place[0] - at[0], place[1] - at[1]) < SINGLE * scale && place[2] > at[2] && place[2] - at[2] < 0.3 * scale), `${machine}: no number at leg ${n}`);
      });
    }
    await box(page, "joint numbers").uncheck();
    const isShown = await page.evaluate(() => {
      let shown = 0;
      window.seen.scene.traverse((object) => {
        const { parent } = object;
        if (object.type === "Sprite" && parent.visible && parent.children.every(({ type }) => type === "Sprite")) shown += 1;
      });
      return shown;
    });
    check(isShown === 0, `${machine}: numbers stay`);
    await page.getByRole("button", { name: "home", exact: true }).click();
    const { pose, tool } = await asText(page, () => window.pkm.state());
    near([...pose, ...tool], [...home.pose, ...own.tool], 0, `${machine}: home`);
  }
}

/** Checks that the mouse drags the tool along X and turns it about Z, and that nothing else moves. */
async function dragTest(page) {
  const [own] = await opened(page, "dragged", ini("hexapod"));
  await page.evaluate(() => window.pkm.take([10, -20, 240, 2, 3, 4]));
  await page.getByRole("button", { name: "front", exact: true }).click();
  const before = await asText(page, () => window.pkm.state());
  await page.locator("select[aria-label=drag]").selectOption("drag: move");
  await page.waitForTimeout(100);
  const place = await asText(page, () => {
    const { camera, scene } = window.seen;
    const canvas = document.querySelector("canvas.picture").getBoundingClientRect();
    const onPage = (v) => {
      const { x, y } = v.project(camera);
      return [canvas.left + ((x + 1) / 2) * canvas.width, canvas.top + ((1 - y) / 2) * canvas.height];
    };
    let proxy;
    scene.traverse((object) => object.type === "Object3D" && object.rotation.order === "ZYX" && object.children.length === 0 && (proxy = object));
    const at = proxy.getWorldPosition(proxy.position.clone());
    const scale = at.distanceTo(camera.position) * Math.min((1.9 * Math.tan((Math.PI * camera.fov) / 360)) / camera.zoom, 7) * 0.7 / 4;
    const off = at.clone().set(1, 0, 0);
    return { at: at.toArray(), from: onPage(at.clone().addScaledVector(off, 0.3 * scale)), to: onPage(at.clone().addScaledVector(off, 0.3 * scale + 25)), rotation: proxy.rotation.toArray().slice(0, 3), middle: onPage(at.clone()) };
  });
  near(place.at, before.tip, 1e-9, "the handle stands at the tip");
  near(scaled(place.rotation, 180 / Math.PI), before.pose.slice(3), 1e-9, "turn of the handle");
  await page.mouse.move(...place.from);
  await page.waitForTimeout(50);
  await page.mouse.down();
  await page.mouse.move((place.from[0] + place.to[0]) / 2, place.to[1], { steps: 3 });
  await page.mouse.move(...place.to, { steps: 3 });
  await page.mouse.up();
  const after = await asText(page, () => window.pkm.state());
  near(after.pose[0], before.pose[0] + 25, 3, "X dragged by 25");
  after.pose.forEach((value, k) => k > 0 && near(value, before.pose[k], 1e-9, `${"XYZABC"[k]} dragged along X`));
  near(after.tool, before.tool, 0, "the tool of what is dragged");
  check((await page.locator("input[aria-label='X as a number']").inputValue()) === after.pose[0].toFixed(4), "the field follows what is dragged");
  for (const [letter, value] of [["Y", "12.5"], ["C", "-3"]]) {
    await page.locator(`input[aria-label='${letter} as a number']`).fill(value);
    await page.locator(`input[aria-label='${letter} as a number']`).press("Enter");
    const { pose } = await asText(page, () => window.pkm.state());
    near(pose["XYZABC".indexOf(letter)], Number(value), 0, `${letter} typed`);
  }
  const { pose } = await asText(page, () => window.pkm.state());
  for (const k of [0, 2, 3, 4]) near(pose[k], after.pose[k], 0, `${"XYZABC"[k]} while others are typed`);
  const field = page.locator("input[aria-label='Z as a number']");
  await field.fill("");
  await field.press("Enter");
  near((await asText(page, () => window.pkm.state())).pose, pose, 0, "the pose after an empty field");
  await page.locator("select[aria-label=drag]").selectOption("drag: nothing");
  const [x, y] = place.to;
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 40, y, { steps: 3 });
  await page.mouse.up();
  near((await asText(page, () => window.pkm.state())).pose, pose, 0, "dragged with nothing to drag");
  await turnTest(page);
  check(own.scene.coordinates === "XYZABC" && complaints(page).length === 0, complaints(page).join("; "));
}

/** Checks that the handle turns the tool about Z, and about the axes alone that the machine has. */
async function turnTest(page) {
  await page.evaluate(() => window.pkm.take([0, 0, 240, 2, 3, 4]));
  await page.locator("select[aria-label=drag]").selectOption("drag: turn");
  await page.waitForTimeout(100);
  const before = await asText(page, () => window.pkm.state());
  const { from, to, away } = await asText(page, () => {
    const { camera, scene } = window.seen;
    const canvas = document.querySelector("canvas.picture").getBoundingClientRect();
    let proxy;
    scene.traverse((object) => object.type === "Object3D" && object.rotation.order === "ZYX" && object.children.length === 0 && (proxy = object));
    const at = proxy.getWorldPosition(proxy.position.clone());
    const away = at.distanceTo(camera.position);
    const radius = (away * Math.min((1.9 * Math.tan((Math.PI * camera.fov) / 360)) / camera.zoom, 7) * 0.7) / 8;
    // From the front, the circle about Z is a line along X.
    const onPage = (x) => {
      const { x: right, y: up } = at.clone().add(at.clone().set(x, -Math.sqrt(radius * radius - 0.25 * radius * radius), 0)).project(camera);
      return [canvas.left + ((right + 1) / 2) * canvas.width, canvas.top + ((1 - up) / 2) * canvas.height];
    };
    return { from: onPage(0.5 * radius), to: onPage(0.5 * radius + 15), away };
  });
  await page.mouse.move(...from);
  await page.waitForTimeout(50);
  await page.mouse.down();
  await page.mouse.move((from[0] + to[0]) / 2, to[1], { steps: 3 });
  await page.mouse.move(...to, { steps: 3 });
  await page.mouse.up();
  const { pose } = await asText(page, () => window.pkm.state());
  // Three.js turns by 20 radians per distance of the camera. The mouse moves by whole pixels, each about a degree.
  near(pose[5] - before.pose[5], (15 / away) * 20 * (180 / Math.PI), 5, "C turned by the handle");
  pose.forEach((value, k) => k < 5 && near(value, before.pose[k], 1e-9, `${"XYZABC"[k]} turned about Z`));
}

export const TESTS = [
  ["cones are at their joints", conesTest],
  ["legs near and beyond limits have their colors, and the reason is shown", colors],
  ["the workspace ends where travel does", workspaceTest],
  ["views and cuts look along the axes", viewsTest],
  ["base, guides, arms and barrels have the machine's positions", baseTest],
  ["the platform reaches to its anchors", platformTest],
  ["tool and labels are at their positions", toolTest],
  ["the tool is dragged, and poses are typed", dragTest],
];
