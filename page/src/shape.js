// SPDX-License-Identifier: GPL-2.0-or-later
// Shapes of parts from STL and OBJ files.
import * as THREE from "three";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import { COLORS } from "./colors.js";
import { material } from "./parts.js";
import { bytes } from "./unpack.js";

/** Reads an STL file. Of a text file the loader leaves out vertices whose coordinates are not numbers. */
function stl(data) {
  const geometry = new STLLoader().parse(data.buffer);
  const isBinary = data.length === 84 + 50 * new DataView(data.buffer).getUint32(80, true);
  const vertices = isBinary ? [] : (new TextDecoder().decode(data).match(/^\s*vertex\s/gm) ?? []);
  if (vertices.length > geometry.attributes.position.count) throw new Error("a vertex has a coordinate that is not a number");
  return geometry;
}

function read({ name, bytes: text }, look) {
  const data = bytes(text);
  if (!name.toLowerCase().endsWith(".obj")) return new THREE.Mesh(stl(data), look);
  const group = new OBJLoader().parse(new TextDecoder().decode(data));
  group.traverse((part) => {
    if (part.isMesh) part.material = look;
  });
  return group;
}

/** Creates a shape from the file that pkm packed, at its place and in machine units. */
export function shape(given) {
  const look = material(given.part === "platform" ? COLORS.platform : COLORS.table, { side: THREE.DoubleSide });
  const made = read(given, look);
  const box = new THREE.Box3().setFromObject(made);
  if (box.isEmpty() || ![...box.min, ...box.max].every(Number.isFinite)) throw new Error("the file has no triangles");
  const [x, y, z, ...angles] = given.place;
  made.position.set(x, y, z);
  made.rotation.set(...angles.map(THREE.MathUtils.degToRad), "ZYX");
  made.scale.setScalar(given.scale);
  const group = new THREE.Group();
  group.add(made);
  return group;
}
