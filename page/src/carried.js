// SPDX-License-Identifier: GPL-2.0-or-later
// Positions of the work, tool and legs that axes carry: the formulas of docs/reference/view.md.
import * as THREE from "three";
import { vector } from "./parts.js";

const moved = (by) => new THREE.Matrix4().makeTranslation(by);

/** Returns the frame of the part that an axis carries, at a value of the axis. */
function frameOf({ axis, point, is_rotary: isRotary }, value) {
  const way = vector(axis);
  if (!isRotary) return moved(way.multiplyScalar(value));
  const turn = new THREE.Matrix4().makeRotationAxis(way, THREE.MathUtils.degToRad(value));
  return moved(vector(point)).multiply(turn).multiply(moved(vector(point).negate()));
}

/** Returns the rotary axes of a scene that carry `carries`. */
export function turning(scene, carries) {
  return scene.chain.filter((link) => link.carries === carries && link.is_rotary);
}

/** Returns the frame of the part that several axes carry, and the point and frame of each rotary axis among them. */
function carried(scene, carries, values) {
  const frame = new THREE.Matrix4();
  const turned = [];
  for (const link of scene.chain.filter((one) => one.carries === carries)) {
    frame.multiply(frameOf(link, values[link.letter]));
    if (link.is_rotary) turned.push({ point: vector(link.point), frame: frame.clone() });
  }
  return { frame, turned };
}

/** Returns whether axes turn the tool on the platform, or the tool stands in base. */
export function isHeld(scene) {
  return scene.holder !== null || scene.chain.some(({ carries }) => carries === "tool");
}

/** Computes positions in the world for an answer of the kinematics, the tool vector and values of the extra axes: the
 * frames of base, platform (relative to base too), work and its tables, and the points from the tool's holder to its tip. */
export function placed(scene, drawn, tool, values) {
  const [{ frame: base }, working, holding] = ["legs", "work", "tool"].map((what) => carried(scene, what, values));
  const [x, y, z] = drawn.rotation.map(vector);
  const own = new THREE.Matrix4().makeBasis(x, y, z).setPosition(vector(drawn.nose));
  const platform = base.clone().multiply(own);
  // A point on a rotary axis does not move when the axis turns.
  const pivots = holding.turned.map(({ point, frame }) => point.applyMatrix4(frame));
  const held = [new THREE.Vector3(), ...pivots, vector(tool).negate().applyMatrix4(holding.frame)];
  const onWhat = scene.holder ? platform : moved(vector(drawn.table).applyMatrix3(new THREE.Matrix3().setFromMatrix4(base)));
  const onWork = (frame) => onWhat.clone().multiply(frame);
  const holder = scene.holder ? moved(vector(scene.holder)) : platform;
  return {
    base, own, platform, work: onWork(working.frame), tables: working.turned.map(({ frame }) => onWork(frame)),
    tool: held.map((point) => point.applyMatrix4(holder)),
  };
}
