// SPDX-License-Identifier: GPL-2.0-or-later
// Solids, labels and lines for the drawing of a machine.
import * as THREE from "three";
import { ConvexGeometry } from "three/addons/geometries/ConvexGeometry.js";

const ROUND = 24;
const UP = new THREE.Vector3(0, 1, 0);

export const vector = (v) => new THREE.Vector3(v[0], v[1], v[2]);

export function material(color, options = {}) {
  return new THREE.MeshStandardMaterial({ color, roughness: 0.55, metalness: 0.15, ...options });
}

/** Creates a cylinder of length 1, which `stretch` lays between two points. */
export function bar(radius, look) {
  const mesh = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 1, ROUND), look);
  mesh.geometry.translate(0, 0.5, 0);
  return mesh;
}

export function stretch(mesh, from, to) {
  const way = new THREE.Vector3().subVectors(to, from);
  const length = way.length();
  mesh.visible = length > 1e-12;
  mesh.position.copy(from);
  mesh.scale.set(1, Math.max(length, 1e-12), 1);
  if (mesh.visible) mesh.quaternion.setFromUnitVectors(UP, way.divideScalar(length));
}

export function ball(radius, look) {
  return new THREE.Mesh(new THREE.SphereGeometry(radius, ROUND, ROUND / 2), look);
}

/** Creates the convex body about points; `thickness` along Z gives points in a plane or on a line a volume. */
export function body(points, thickness, look) {
  const all = points.flatMap((p) => [-1, 1].flatMap((side) => ring(p, thickness, side)));
  return new THREE.Mesh(new ConvexGeometry(all), look);
}

/** Returns points on a circle above or below a point, which round the corners of bodies. */
function ring(point, thickness, side) {
  const count = 10;
  return Array.from({ length: count }, (_, i) => {
    const angle = (2 * Math.PI * i) / count;
    return new THREE.Vector3(
      point.x + thickness * Math.cos(angle),
      point.y + thickness * Math.sin(angle),
      point.z + (side * thickness) / 2,
    );
  });
}

/** Creates a label that always faces the camera; `height` is in units of length. */
export function label(text, height, color = "#16202a") {
  const size = 64;
  const canvas = document.createElement("canvas");
  const pen = canvas.getContext("2d");
  pen.font = `600 ${size}px sans-serif`;
  canvas.width = Math.ceil(pen.measureText(text).width) + size / 2;
  canvas.height = size * 1.4;
  pen.font = `600 ${size}px sans-serif`;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.lineWidth = size / 6;
  pen.strokeStyle = "rgba(255,255,255,0.9)";
  pen.strokeText(text, canvas.width / 2, canvas.height / 2);
  pen.fillStyle = color;
  pen.fillText(text, canvas.width / 2, canvas.height / 2);
  const map = new THREE.CanvasTexture(canvas);
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map, depthTest: false, transparent: true }));
  sprite.scale.set((height * canvas.width) / canvas.height, height, 1);
  sprite.renderOrder = 10;
  return sprite;
}

/** Creates separate lines, each between a pair of points. */
export function pieces(points, color, options = {}) {
  const geometry = new THREE.BufferGeometry().setFromPoints(points);
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color, ...options }));
}

/** Frees the resources of a group's objects, and empties the group. */
export function clear(group) {
  group.traverse((object) => {
    object.geometry?.dispose();
    object.material?.map?.dispose();
    object.material?.dispose?.();
  });
  group.clear();
}
