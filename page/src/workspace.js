// SPDX-License-Identifier: GPL-2.0-or-later
// Where the tool gets to with its angles as they are: the surface of the poses that keep all limits.
import * as THREE from "three";
import { PART } from "./mechanism.js";

/** Cells along each side, of the picture and of the search for its frame. */
const CELLS = 32;
const COARSE = 14;

/** How far the search goes beyond the axis limits, as shares of their ranges. */
const FIRST_SHARE = 0.25;
const LAST_SHARE = 60;

/** Room where nothing is reached: near 0, so that the surface stands near the last pose that is reached. */
const OUTSIDE = -0.05;

/** Least share of room at a pose; negative where a limit is broken or nothing is reached. */
function room(kinematics, pose, tool) {
  const least = kinematics.least(pose, tool, (kind) => kind === PART.axis);
  return Number.isNaN(least) ? OUTSIDE : Math.max(Math.min(least, 1), -1);
}

/** Axis limits with a share of their range about them; nothing where a letter does not move. */
function box(scene, share) {
  return ["X", "Y", "Z"].map((letter) => {
    const axis = scene.axes.find((axis) => axis.letter === letter);
    const beyond = axis && share * (axis.max - axis.min);
    return axis && { from: axis.min - beyond, to: axis.max + beyond };
  });
}

/** Values on a grid with so many cells along each side. A letter that does not move has a thin slab. */
function scanned(at, sides, pose, cells) {
  const thin = Math.max(...sides.map((side) => (side ? side.to - side.from : 0))) / cells;
  const grid = sides.map((side, k) =>
    side ? { from: side.from, step: (side.to - side.from) / cells, count: cells + 1 } : { from: pose[k] - thin, step: thin, count: 3, isHeld: true });
  const sizes = grid.map(({ count }) => count);
  const [nx, ny, nz] = sizes;
  const values = new Float32Array(nx * ny * nz);
  const place = [0, 0, 0];
  let touchesEdge = false;
  for (let i = 0; i < nx; i++)
    for (let j = 0; j < ny; j++)
      for (let k = 0; k < nz; k++) {
        let isEnd = false;
        [i, j, k].forEach((n, axis) => {
          const { from, step, isHeld } = grid[axis];
          isEnd ||= isHeld && n !== 1;
          place[axis] = isHeld ? pose[axis] : from + n * step;
        });
        const value = isEnd ? OUTSIDE : at(place);
        values[(i * ny + j) * nz + k] = value;
        const isAtEdge = [i, j, k].some((n, axis) => !grid[axis].isHeld && (n === 0 || n === sizes[axis] - 1));
        touchesEdge ||= value > 0 && isAtEdge;
      }
  return { values, grid, sizes, touchesEdge };
}

/** A grid that holds the whole body: a coarse one grows until nothing is reached at its edge. */
function found(at, scene, pose) {
  let share = FIRST_SHARE;
  while (share < LAST_SHARE && scanned(at, box(scene, share), pose, COARSE).touchesEdge) share *= 1.6;
  return scanned(at, box(scene, share), pose, CELLS);
}

const CORNERS = Array.from({ length: 8 }, (_, n) => [n & 1, (n >> 1) & 1, (n >> 2) & 1]);
const EDGES = CORNERS.flatMap((_, a) => [1, 2, 4].filter((bit) => !(a & bit)).map((bit) => [a, a | bit]));

/** The surface where the values are 0: one vertex in every cell that it passes, one square across every edge. */
function surface({ values, grid, sizes: [nx, ny, nz] }) {
  const index = (i, j, k) => (i * ny + j) * nz + k;
  const vertices = [];
  const numbers = new Int32Array(values.length).fill(-1);
  for (let i = 0; i < nx - 1; i++)
    for (let j = 0; j < ny - 1; j++)
      for (let k = 0; k < nz - 1; k++) {
        const of = CORNERS.map(([a, b, c]) => values[index(i + a, j + b, k + c)]);
        const crossed = EDGES.filter(([a, b]) => of[a] > 0 !== of[b] > 0);
        if (crossed.length === 0) continue;
        const sum = [0, 0, 0];
        for (const [a, b] of crossed) {
          const part = of[a] / (of[a] - of[b]);
          for (let d = 0; d < 3; d++) sum[d] += CORNERS[a][d] + part * (CORNERS[b][d] - CORNERS[a][d]);
        }
        numbers[index(i, j, k)] = vertices.length / 3;
        [i, j, k].forEach((n, d) => vertices.push(grid[d].from + grid[d].step * (n + sum[d] / crossed.length)));
      }
  return { vertices, faces: squares(values, numbers, [nx, ny, nz], index) };
}

function squares(values, numbers, [nx, ny, nz], index) {
  const faces = [];
  const square = (inside, a, b, c, d) => {
    const [p, q, r, s] = [a, b, c, d].map((at) => numbers[at]);
    faces.push(...(inside ? [p, q, r, p, r, s] : [p, r, q, p, s, r]));
  };
  for (let i = 1; i < nx - 1; i++)
    for (let j = 1; j < ny - 1; j++)
      for (let k = 1; k < nz - 1; k++) {
        const here = values[index(i, j, k)] > 0;
        const differs = (a, b, c) => values[index(i + a, j + b, k + c)] > 0 !== here;
        if (differs(1, 0, 0)) square(here, index(i, j - 1, k - 1), index(i, j, k - 1), index(i, j, k), index(i, j - 1, k));
        if (differs(0, 1, 0)) square(!here, index(i - 1, j, k - 1), index(i, j, k - 1), index(i, j, k), index(i - 1, j, k));
        if (differs(0, 0, 1)) square(here, index(i - 1, j - 1, k), index(i, j - 1, k), index(i, j, k), index(i - 1, j, k));
      }
  return faces;
}

/** Vertices and faces of the workspace at the angles of a pose. */
export function workspace(kinematics, scene, pose, tool) {
  const at = (place) => room(kinematics, [...place, ...pose.slice(3)], tool);
  return surface(found(at, scene, pose));
}

export function bodyOf({ vertices, faces }, look) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(vertices, 3));
  geometry.setIndex(faces);
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, look);
}

/** The edges of the axis limits; held letters have the pose's value. */
export function limitsBox(scene, pose) {
  const range = ["X", "Y", "Z"].map((letter, k) => {
    const axis = scene.axes.find((axis) => axis.letter === letter);
    return axis ? [axis.min, axis.max] : [pose[k], pose[k]];
  });
  const corner = ([a, b, c]) => new THREE.Vector3(range[0][a], range[1][b], range[2][c]);
  return EDGES.flatMap(([a, b]) => [corner(CORNERS[a]), corner(CORNERS[b])]);
}
