// SPDX-License-Identifier: GPL-2.0-or-later
// A mechanism in 3D: its parts, placed by the answers of its kinematics.
import * as THREE from "three";
import { isHeld, placed, turning } from "./carried.js";
import { COLORS, ofPart } from "./colors.js";
import { ball, bar, body, label, material, pieces, stretch, vector } from "./parts.js";

/** Kinds of parts that a margin belongs to, as the kinematics number them. */
export const PART = { whole: 0, axis: 1, joint: 2, leg: 3, legs: 4 };

const CONE = "cone";

export class Mechanism {
  constructor(scene, size) {
    this.scene = scene;
    this.size = size;
    this.thick = size / 90;
    this.group = new THREE.Group();
    // Parts on the base, which an axis may carry.
    this.onBase = new THREE.Group();
    this.onBase.matrixAutoUpdate = false;
    this.base = new THREE.Group();
    this.platform = new THREE.Group();
    this.labels = new THREE.Group();
    this.cones = new THREE.Group();
    this.onBase.add(this.base, this.platform, this.labels, this.cones);
    this.group.add(this.onBase);
    this.platform.matrixAutoUpdate = false;
    this.legs = scene.legs.map((leg, i) => this.leg(leg, i));
    this.passive = scene.passive.map((part) => this.passivePart(part));
    this.buildBase();
    this.buildPlatform();
    this.tables = turning(scene, "work").map((link) => this.table(link));
    this.labels.visible = true;
    this.cones.visible = false;
  }

  leg(leg, i) {
    const { thick } = this;
    const own = { rod: material(COLORS.rod), barrel: material(COLORS.barrel), arm: material(COLORS.arm) };
    const parts = { leg, own, joint: this.scene.joints[i], rod: bar(thick * 0.55, own.rod) };
    parts.lower = ball(thick * 0.95, material(COLORS.joint));
    parts.upper = ball(thick * 0.95, material(COLORS.joint));
    this.onBase.add(parts.rod, parts.lower, parts.upper);
    if (leg.kind === "strut" || leg.kind === "ring") {
      parts.barrel = bar(thick, own.barrel);
      this.onBase.add(parts.barrel);
    } else if (leg.kind === "crank") {
      parts.arm = bar(thick * 1.2, own.arm);
      parts.hip = vector(leg.base);
      this.onBase.add(parts.arm);
    } else {
      parts.carriage = new THREE.Mesh(new THREE.BoxGeometry(thick * 4, thick * 4, thick * 4), own.barrel);
      this.onBase.add(parts.carriage);
    }
    parts.label = label(String(this.scene.joints[i].number), this.size / 22);
    this.labels.add(parts.label);
    return parts;
  }

  /** Creates a part of a constraint: the axis of a passive joint, or a passive leg. */
  passivePart({ shape, ends }) {
    const { thick } = this;
    const [radius, color] = { axis: [0.8, COLORS.joint], rod: [0.9, COLORS.passive], tube: [2.6, COLORS.passive] }[shape];
    const part = { ends, bar: bar(thick * radius, material(color)) };
    this.onBase.add(part.bar);
    return part;
  }

  /** Places the parts of constraints: docs/reference/view.md. */
  placePassive(drawn) {
    const turn = new THREE.Matrix4().extractRotation(this.platform.matrix);
    const origins = { base: () => [0, 0, 0], platform: () => drawn.nose, leg: (leg) => drawn.legs[leg].lower };
    for (const part of this.passive) {
      [part.from, part.to] = part.ends.map(({ origin, leg, base, platform }) =>
        vector(platform).applyMatrix4(turn).add(vector(base)).add(vector(origins[origin](leg))));
      stretch(part.bar, part.from, part.to);
    }
  }

  buildBase() {
    const look = material(COLORS.base);
    const anchors = [];
    for (const { leg, joint } of this.legs) {
      if (leg.kind === "slider") this.guide(leg, joint);
      else {
        const foot = ball(this.thick * 1.5, look);
        foot.position.copy(vector(leg.base));
        this.base.add(foot);
        anchors.push(vector(leg.base));
      }
      if (leg.kind === "crank") this.hip(leg, look);
    }
    if (anchors.length > 2) this.frame(anchors, look);
  }

  /** Creates a ring of bars through the anchors, in their order about the middle. */
  frame(anchors, look) {
    const middle = anchors.reduce((sum, p) => sum.add(p), new THREE.Vector3()).divideScalar(anchors.length);
    const angle = (p) => Math.atan2(p.y - middle.y, p.x - middle.x);
    const around = [...anchors].sort((a, b) => angle(a) - angle(b));
    around.forEach((from, i) => {
      const rail = bar(this.thick * 1.1, look);
      stretch(rail, from, around[(i + 1) % around.length]);
      this.base.add(rail);
    });
  }

  guide(leg, joint) {
    const at = (value) => vector(leg.base).addScaledVector(vector(leg.guide), value + leg.offset);
    const beyond = 3 * this.thick;
    const rail = bar(this.thick * 0.9, material(COLORS.guide));
    stretch(rail, at(joint.min - beyond), at(joint.max + beyond));
    this.base.add(rail);
  }

  hip(leg, look) {
    const axis = vector(leg.axis).multiplyScalar(this.thick * 4);
    const shaft = bar(this.thick * 1.6, look);
    stretch(shaft, vector(leg.base).sub(axis), vector(leg.base).add(axis));
    this.base.add(shaft);
  }

  buildPlatform() {
    const { scene, thick } = this;
    const look = material(COLORS.platform);
    const anchors = scene.legs.flatMap((leg) => (leg.kind === "ring" ? circle(leg) : [vector(leg.platform)]));
    this.platform.add(body(anchors, thick * 1.4, look));
    this.tool = bar(thick * 0.7, material(COLORS.tool));
    this.spindle = bar(thick * 1.8, material(COLORS.spindle));
    if (isHeld(scene)) this.buildHolder();
    this.tip = new THREE.Mesh(new THREE.ConeGeometry(thick * 0.7, thick * 2, 24), material(COLORS.tool));
    this.anchors = anchors;
    this.group.add(this.tool, this.spindle, this.tip);
  }

  /** Creates a disc for a rotary axis, with a notch that shows its angle. */
  table(link) {
    const { thick, size } = this;
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    const disc = new THREE.Mesh(new THREE.CylinderGeometry(size / 8, size / 8, thick, 48), material(COLORS.table));
    const notch = new THREE.Mesh(new THREE.BoxGeometry(size / 24, thick * 1.1, thick), material(COLORS.joint));
    notch.position.x = size / 8 - size / 48;
    const axis = vector(link.axis);
    const laid = new THREE.Group();
    laid.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), axis);
    laid.position.copy(vector(link.point)).addScaledVector(axis, -thick);
    laid.add(disc, notch);
    group.add(laid);
    // Work on the platform has no table: the platform itself is drawn.
    if (!this.scene.holder) this.group.add(group);
    return group;
  }

  /** Computes positions in the world for an answer of the kinematics, the tool vector and values of the extra axes. */
  placed(drawn, { tool, extra }) {
    return placed(this.scene, drawn, tool, extra);
  }

  /** Moves all parts to an answer of the kinematics. */
  place(drawn, place) {
    const at = this.placed(drawn, place);
    this.onBase.matrix.copy(at.base);
    this.platform.matrix.copy(at.own);
    if (isHeld(this.scene)) this.placeHolder(at);
    else this.placeTool(at);
    this.tables.forEach((table, i) => table.matrix.copy(at.tables[i]));
    this.placePassive(drawn);
    this.at = at;
    const shares = this.shares(drawn.margins);
    this.legs.forEach((parts, i) => this.placeLeg(parts, drawn.legs[i], shares[i]));
  }

  /** Returns for each leg the least share left of the limits of this leg. */
  shares(margins) {
    const shares = this.legs.map(() => 1);
    for (const margin of margins) {
      const legs = margin.kind === PART.legs ? [margin.first, margin.second] : [margin.first];
      const isOfLeg = margin.kind === PART.joint || margin.kind === PART.leg || (margin.kind === PART.legs && margin.share < 0);
      for (const i of isOfLeg ? legs : []) shares[i] = Math.min(shares[i], margin.share);
    }
    return shares;
  }

  /** Creates the bars between the tool's holder and the axes that turn the tool. */
  buildHolder() {
    const look = material(COLORS.spindle);
    this.holder = turning(this.scene, "tool").map(() => ({ bar: bar(this.thick * 1.2, look), pivot: ball(this.thick * 1.8, material(COLORS.joint)) }));
    for (const { bar: arm, pivot } of this.holder) this.group.add(arm, pivot);
    if (!this.scene.holder) return;
    const side = this.thick * 3;
    const post = new THREE.Mesh(new THREE.BoxGeometry(side, side, side), look);
    post.position.copy(vector(this.scene.holder));
    this.group.add(post);
  }

  /** Returns the point of the platform's axis at the height of the anchors' middle. */
  hub(platform) {
    const middle = this.anchors.reduce((sum, p) => sum.add(p), new THREE.Vector3()).divideScalar(this.anchors.length);
    return new THREE.Vector3(0, 0, middle.z).applyMatrix4(platform);
  }

  /** Places a tool that axes turn, or that stands in base. */
  placeHolder({ platform, tool }) {
    stretch(this.spindle, this.hub(platform), new THREE.Vector3().setFromMatrixPosition(platform));
    this.holder.forEach(({ bar: arm, pivot }, i) => {
      stretch(arm, tool[i], tool[i + 1]);
      pivot.position.copy(tool[i + 1]);
    });
    const [from, tip] = tool.slice(-2);
    const point = tip.clone().sub(from).normalize();
    const neck = tip.clone().addScaledVector(point, -Math.min(this.thick * 2, tip.distanceTo(from)));
    stretch(this.tool, from, neck);
    this.placeTip(tip, point);
  }

  /** Places a tool that is fixed to the platform, along the platform's axis. */
  placeTool({ platform, tool: [nose, tip] }) {
    const axis = new THREE.Vector3().setFromMatrixColumn(platform, 2);
    const hub = this.hub(platform);
    const length = tip.distanceTo(nose);
    const hangs = tip.clone().sub(hub).dot(axis) <= 0 ? -1 : 1;
    const point = axis.clone().multiplyScalar(hangs);
    const cone = this.thick * 2;
    const neck = tip.clone().addScaledVector(point, -cone);
    const reach = Math.max(hub.distanceTo(tip) - cone, 0);
    const shaft = Math.min(reach, Math.max(length - cone, reach * 0.3));
    const chuck = neck.clone().addScaledVector(point, -shaft);
    stretch(this.spindle, hub, chuck);
    stretch(this.tool, chuck, neck);
    this.placeTip(tip, point);
  }

  /** Places the tip of the tool, or a dot if the tool has no length. */
  placeTip(tip, point) {
    this.tip.position.copy(tip).addScaledVector(point, -this.thick);
    if (point.lengthSq() > 0) this.tip.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), point);
  }

  placeLeg(parts, ends, share) {
    const [lower, upper] = [vector(ends.lower), vector(ends.upper)];
    parts.lower.position.copy(lower);
    parts.upper.position.copy(upper);
    parts.own.rod.color.set(ofPart(share, COLORS.rod));
    parts.own.barrel.color.set(ofPart(share, COLORS.barrel));
    if (parts.barrel) {
      const way = new THREE.Vector3().subVectors(upper, lower);
      const shortest = Math.max(parts.joint.min + parts.leg.offset, 0);
      const barrel = Math.min(0.92 * shortest || 0.5 * way.length(), way.length());
      stretch(parts.barrel, lower, lower.clone().addScaledVector(way.normalize(), barrel));
    }
    if (parts.arm) stretch(parts.arm, parts.hip, lower);
    parts.carriage?.position.copy(lower);
    stretch(parts.rod, lower, upper);
    parts.label.position.lerpVectors(lower, upper, 0.3).addScaledVector(new THREE.Vector3(0, 0, 1), this.thick * 3);
  }

  /** Creates the cones of the joints, about the directions of the legs at home. */
  buildCones(home) {
    const turn = new THREE.Matrix3().setFromMatrix4(this.platform.matrix);
    const back = turn.clone().invert();
    this.legs.forEach(({ leg }, i) => {
      const [lower, upper] = [vector(home.legs[i].lower), vector(home.legs[i].upper)];
      const way = upper.clone().sub(lower).normalize();
      if (leg.base_cone) this.cone(this.cones, lower, way, leg.base_cone);
      if (leg.platform_cone) {
        const own = way.clone().negate().applyMatrix3(back);
        this.cone(this.platform, vector(leg.platform), own, leg.platform_cone);
      }
    });
  }

  cone(group, at, way, halfAngle) {
    const length = this.size / 6;
    const radius = length * Math.tan((Math.min(halfAngle, 80) * Math.PI) / 180);
    const geometry = new THREE.ConeGeometry(radius, length, 40, 1, true);
    geometry.translate(0, -length / 2, 0);
    const look = material(COLORS.near, { transparent: true, opacity: 0.25, side: THREE.DoubleSide, depthWrite: false });
    const cone = new THREE.Mesh(geometry, look);
    cone.position.copy(at);
    cone.quaternion.setFromUnitVectors(new THREE.Vector3(0, -1, 0), way);
    cone.name = CONE;
    cone.visible = false;
    group.add(cone);
  }

  showCones(isShown) {
    this.cones.visible = isShown;
    this.group.traverse((object) => {
      if (object.name === CONE) object.visible = isShown;
    });
  }

  /** Returns the rods and the platform's edges as lines in the world, for the swept volume. */
  outline(drawn, { base }) {
    const onGround = (point) => vector(point).applyMatrix4(base);
    const ends = this.legs.flatMap((_, i) => [onGround(drawn.legs[i].lower), onGround(drawn.legs[i].upper)]);
    const upper = this.legs.map((_, i) => onGround(drawn.legs[i].upper));
    return [...ends, ...upper.flatMap((p, i) => [p, upper[(i + 1) % upper.length]])];
  }
}

function circle(leg) {
  return Array.from({ length: 16 }, (_, i) => {
    const angle = (Math.PI * i) / 8;
    return new THREE.Vector3(
      leg.platform[0] + leg.radius * Math.cos(angle),
      leg.platform[1] + leg.radius * Math.sin(angle),
      leg.platform[2],
    );
  });
}

/** Returns pose, tool and extra axes of a mechanism at home. */
export function homeOf({ scene, tool }) {
  const extra = Object.fromEntries(scene.extra_axes.map(({ letter, home }) => [letter, home]));
  return { pose: [...scene.home.pose], tool: [...tool], extra };
}

/** Creates lines along X, Y and Z with their letters. */
export function cross(size) {
  const group = new THREE.Group();
  const ways = { X: [size, 0, 0], Y: [0, size, 0], Z: [0, 0, size] };
  Object.entries(ways).forEach(([letter, way], i) => {
    const color = [0xd55e00, 0x009e73, 0x0072b2][i];
    group.add(pieces([new THREE.Vector3(), vector(way)], color));
    const name = label(letter, size / 3, `#${color.toString(16).padStart(6, "0")}`);
    name.position.copy(vector(way).multiplyScalar(1.15));
    group.add(name);
  });
  return group;
}
