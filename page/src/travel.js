// SPDX-License-Identifier: GPL-2.0-or-later
// How far a mechanism gets from a pose along each of its coordinates.
import { Refusal, key } from "./kinematics.js";

/** Steps of the way to the end of an axis, and halvings of the step in which a limit breaks. */
const STEPS = 100;
const HALVINGS = 20;

/** Why a pose cannot be, or nothing. */
export function refusal(kinematics, limits, pose, tool) {
  try {
    const broken = kinematics.at(pose, tool).margins.find(({ share }) => share < 0);
    return broken && limits[key(broken)]?.part;
  } catch (error) {
    if (error instanceof Refusal) return error.message;
    throw error;
  }
}

/** Of every letter that moves, both ways: the way that is left, its unit, and what ends it. */
export function travel(kinematics, { scene, limits }, pose, tool) {
  return scene.axes.flatMap((axis) => [-1, 1].map((sign) => {
    const k = "XYZABC".indexOf(axis.letter);
    const most = Math.max(sign > 0 ? axis.max - pose[k] : pose[k] - axis.min, 0);
    const at = (way) => pose.map((value, i) => (i === k ? value + sign * way : value));
    const why = (way) => refusal(kinematics, limits, at(way), tool);
    let kept = 0;
    let end = "axis limit";
    for (let n = 0; n <= STEPS; n++) {
      const way = (most * n) / STEPS;
      const reason = why(way);
      if (reason === undefined) {
        kept = way;
        continue;
      }
      end = reason;
      let broken = way;
      for (let i = 0; i < HALVINGS; i++) {
        const middle = (kept + broken) / 2;
        if (why(middle) === undefined) kept = middle;
        else broken = middle;
      }
      break;
    }
    return { letter: axis.letter, sign, left: kept, unit: k < 3 ? scene.length_unit : "°", end };
  }));
}
