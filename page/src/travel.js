// SPDX-License-Identifier: GPL-2.0-or-later
// Travel left from a pose along each coordinate of a mechanism.
import { Refusal, key } from "./kinematics.js";
import { PART } from "./mechanism.js";

/** Steps to the end of an axis, and halvings of the step in which a limit is violated. */
const STEPS = 100;
const HALVINGS = 20;

/** Returns the limit that a pose violates, other than the range of axis `k`, or the reason of a refusal. */
function broken(kinematics, limits, pose, tool, k) {
  try {
    const found = kinematics.at(pose, tool).margins.find(({ share, kind, first }) => share < 0 && !(kind === PART.axis && first === k));
    return found ? `${limits[key(found)].part}: ${limits[key(found)].limit}` : "";
  } catch (error) {
    if (error instanceof Refusal) return error.message.split(";")[0];
    throw error;
  }
}

/** Returns the unit of a letter. */
const unitOf = (scene, letter) => ("ABC".includes(letter) ? "°" : scene.length_unit);

/** Returns for every moving letter and every extra axis, in both directions, the travel left, its unit, and the limit that
 * ends it. An extra axis ends only at its own range: it does not move the mechanism in its own coordinates. */
export function travel(kinematics, { scene, limits }, { pose, tool, extra }) {
  const own = scene.axes.flatMap((axis) => [-1, 1].map((sign) => {
    const k = "XYZABC".indexOf(axis.letter);
    const most = Math.max(sign > 0 ? axis.max - pose[k] : pose[k] - axis.min, 0);
    const place = [...pose];
    const isKept = (way) => {
      place[k] = pose[k] + sign * way;
      return kinematics.least(place, tool, (kind, first) => kind === PART.axis && first === k) >= 0;
    };
    let [kept, end] = [0, axis[sign > 0 ? "hasMax" : "hasMin"] ? "axis range" : "no limit so far"];
    for (let n = 0; n <= STEPS; n++) {
      let way = (most * n) / STEPS;
      if (isKept(way)) {
        kept = way;
        continue;
      }
      for (let i = 0; i < HALVINGS && way > kept; i++) {
        const middle = (kept + way) / 2;
        if (isKept(middle)) kept = middle;
        else way = middle;
      }
      place[k] = pose[k] + sign * way;
      end = broken(kinematics, limits, place, tool, k);
      break;
    }
    return { letter: axis.letter, sign, left: kept, unit: unitOf(scene, axis.letter), end };
  }));
  const others = scene.extra_axes.flatMap(({ letter, min, max }) => [-1, 1].map((sign) => ({
    letter, sign, left: Math.max(sign > 0 ? max - extra[letter] : extra[letter] - min, 0), unit: unitOf(scene, letter),
    end: "axis range",
  })));
  return [...own, ...others];
}
