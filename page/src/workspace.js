// SPDX-License-Identifier: GPL-2.0-or-later
// The workspace at fixed angles: the surface around the poses that keep all limits.
import * as THREE from "three";
import { PART } from "./mechanism.js";

/** Cells along each side of the drawn grid, and of the coarse grid that searches the extent. */
const CELLS = 32;
const COARSE = 14;

/** First and last extent of the search beyond the axis limits, as shares of their ranges. */
const FIRST_SHARE = 0.25;
const LAST_SHARE = 60;

/** Value at unreachable poses. It is near 0, so that the surface lies near the last reachable pose. */
const OUTSIDE = -0.05;

/** Returns the least share of range left at a pose; negative if a limit is violated or the pose is unreachable. */
function room(kinematics, pose, tool) {
  const least = kinematics.least(pose, tool, (kind) => kind === PART.axis);
  return Number.isNaN(least) ? OUTSIDE : Math.max(Math.min(least, 1), -1);
}

/** Returns the ranges of X, Y and Z, extended by a share of each; undefined for a letter that does not move. */
function box(scene, share) {
  return ["X", "Y", "Z"].map((letter) => {
    const axis = scene.axes.find((axis) => axis.letter === letter);
    const beyond = axis && share * (axis.max - axis.min);
    return axis && { from: axis.min - beyond, to: axis.max + beyond };
  });
}

/** Samples values on a grid with `cells` cells along each side. A letter that does not move gets a thin slab. */
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

/** Samples a grid that encloses the whole workspace: a coarse one grows until no pose at its edge is reachable. */
function found(at, scene, pose) {
  let share = FIRST_SHARE;
  while (share < LAST_SHARE && scanned(at, box(scene, share), pose, COARSE).touchesEdge) share *= 1.6;
  return scanned(at, box(scene, share), pose, CELLS);
}

const CORNERS = Array.from({ length: 8 }, (_, n) => [n & 1, (n >> 1) & 1, (n >> 2) & 1]);
const EDGES = CORNERS.flatMap((_, a) => [1, 2, 4].filter((bit) => !(a & bit)).map((bit) => [a, a | bit]));

/** Computes the surface of value 0 (surface nets): one vertex in every cell it crosses, one square for every crossed edge. */
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

/** Computes vertices and faces of the workspace at the angles of a pose. */
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

/** Returns the edges of the axis limits' box. Letters that do not move have the pose's value. */
export function limitsBox(scene, pose) {
  const range = ["X", "Y", "Z"].map((letter, k) => {
    const axis = scene.axes.find((axis) => axis.letter === letter);
    return axis ? [axis.min, axis.max] : [pose[k], pose[k]];
  });
  const corner = ([a, b, c]) => new THREE.Vector3(range[0][a], range[1][b], range[2][c]);
  return EDGES.flatMap(([a, b]) => [corner(CORNERS[a]), corner(CORNERS[b])]);
}
