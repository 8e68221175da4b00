// SPDX-License-Identifier: GPL-2.0-or-later
// The 3D picture: camera, lights, and everything in it except the mechanisms.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { TransformControls } from "three/addons/controls/TransformControls.js";
import { Line2 } from "three/addons/lines/Line2.js";
import { LineGeometry } from "three/addons/lines/LineGeometry.js";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { COLORS, ofShare } from "./colors.js";
import { cross } from "./mechanism.js";
import { clear, material, pieces, vector } from "./parts.js";
import { bodyOf } from "./workspace.js";

/** Directions from the target to the camera, as shares of right, up and towards the viewer. */
const VIEWS = {
  "3D": [0.75, 0.55, 1],
  front: [0, 0, 1],
  side: [1, 0, 0],
  top: [0, 1, 1e-6],
};

/** Right, up and towards the viewer in base. Z is up, except for machines that are long in Z, such as lathes. */
const STANDING = ["100", "001", "0-10"].map(unit);
const LYING = { Y: ["001", "010", "-100"].map(unit), X: ["001", "100", "010"].map(unit) };
const LONG = 1.5;

function unit(text) {
  return vector(text.match(/-?\d/g).map(Number));
}

function frame(box, letters) {
  const { x, y, z } = box.getSize(new THREE.Vector3());
  if (letters === false || z < LONG * Math.max(x, y)) return STANDING;
  return LYING[letters.includes("Y") ? "Y" : "X"];
}

/** Camera distance per distance at which everything just fits. */
const BORDER = 1.04;

function corners({ min, max }) {
  return Array.from({ length: 8 }, (_, n) =>
    new THREE.Vector3(n & 1 ? max.x : min.x, n & 2 ? max.y : min.y, n & 4 ? max.z : min.z));
}

export class Stage {
  /** Creates the picture of machines of a size within a box; `letters` are those that the machines move, or false if
   * Z is up in any case. */
  constructor(canvas, size, box, letters, keepsPixels) {
    this.size = size;
    this.frame = frame(box, letters);
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: keepsPixels });
    this.renderer.setPixelRatio(keepsPixels ? 1 : window.devicePixelRatio);
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(COLORS.background);
    this.camera = new THREE.PerspectiveCamera(35, 1, size / 500, size * 60);
    this.camera.up.copy(this.frame[1]);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.listenToKeyEvents(canvas);
    this.addLights();
    this.work = new THREE.Group();
    this.work.matrixAutoUpdate = false;
    this.path = new THREE.Group();
    this.sweep = new THREE.Group();
    this.traces = new THREE.Group();
    this.space = new THREE.Group();
    this.space.matrixAutoUpdate = false;
    this.work.add(this.path, cross(size / 8));
    this.scene.add(this.work, this.sweep, this.traces, this.space);
    this.isStale = true;
    this.controls.addEventListener("change", () => this.redraw());
  }

  addLights() {
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8090a0, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.8);
    const [right, up, near] = this.frame;
    sun.position.set(0, 0, 0).addScaledVector(right, 0.6).addScaledVector(up, 1.4).add(near);
    this.scene.add(sun);
  }

  redraw() {
    this.isStale = true;
  }

  resize(width, height) {
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.path.children.forEach((line) => line.material.resolution.set(width, height));
    this.redraw();
  }

  draw() {
    if (!this.isStale) return;
    this.isStale = false;
    this.renderer.render(this.scene, this.camera);
  }

  /** Moves the camera to a view, as near as the box fits into the picture. */
  look(name, box) {
    const centre = box.getCenter(new THREE.Vector3());
    const way = new THREE.Vector3();
    this.frame.forEach((axis, i) => way.addScaledVector(axis, VIEWS[name][i]));
    way.normalize();
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(way, this.size);
    this.camera.lookAt(centre);
    this.camera.updateMatrixWorld();
    const tall = Math.tan(((this.camera.fov / 2) * Math.PI) / 180);
    const turn = this.camera.quaternion.clone().invert();
    const distance = corners(box).reduce((most, corner) => {
      const seen = corner.sub(centre).applyQuaternion(turn);
      return Math.max(most, seen.z + Math.abs(seen.y) / tall, seen.z + Math.abs(seen.x) / (tall * this.camera.aspect));
    }, 0);
    this.camera.position.copy(centre).addScaledVector(way, BORDER * distance);
    this.controls.update();
    this.redraw();
  }

  /** Returns the position of a point on the canvas, in pixels from its upper left corner. */
  onCanvas(place) {
    const { x, y } = place.clone().project(this.camera);
    const { clientWidth, clientHeight } = this.renderer.domElement;
    return [((x + 1) / 2) * clientWidth, ((1 - y) / 2) * clientHeight];
  }

  static views() {
    return Object.keys(VIEWS);
  }

  /** Hides everything above a value of X or Z, or below a value of Y; without a letter shows everything. */
  cut(letter, value) {
    const normal = { X: [-1, 0, 0], Y: [0, 1, 0], Z: [0, 0, -1] }[letter];
    const offset = letter === "Y" ? -value : value;
    this.renderer.clippingPlanes = normal ? [new THREE.Plane(vector(normal), offset)] : [];
    this.redraw();
  }

  /** Draws the path of the tool in the work's coordinates, colored by the share of range left at each point. */
  showPath(points, shares) {
    clear(this.path);
    if (points.length < 2) return;
    const geometry = new LineGeometry();
    geometry.setPositions(points.flat());
    geometry.setColors(shares.flatMap((share) => ofShare(share).toArray()));
    const look = new LineMaterial({ vertexColors: true, linewidth: 2.2 });
    const size = this.renderer.getSize(new THREE.Vector2());
    look.resolution.copy(size);
    this.path.add(new Line2(geometry, look));
    this.redraw();
  }

  showSweep(points) {
    clear(this.sweep);
    if (points.length) this.sweep.add(pieces(points, COLORS.barrel, { transparent: true, opacity: 0.18 }));
    this.redraw();
  }

  /** Draws the trace of a point in the world. */
  showTrace(points) {
    clear(this.traces);
    if (points.length) {
      const geometry = new THREE.BufferGeometry().setFromPoints(points);
      this.traces.add(new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: 0xcc79a7 })));
    }
    this.redraw();
  }

  /** Draws the workspace and the box of axis limits in the frame of a base; without a surface removes them. */
  showSpace(surface, box) {
    clear(this.space);
    if (surface) {
      const look = material(COLORS.workspace, { transparent: true, opacity: 0.38, side: THREE.DoubleSide, depthWrite: false });
      if (surface.faces.length) this.space.add(bodyOf(surface, look));
      this.space.add(pieces(box, COLORS.limits));
    }
    this.redraw();
  }

  /** Creates a handle that the user drags along and about `letters()`; `taken` gets its position when a drag begins, `moved`
   * its position and angles. */
  handle(letters, taken, moved) {
    const proxy = new THREE.Object3D();
    proxy.rotation.order = "ZYX";
    const handle = new TransformControls(this.camera, this.renderer.domElement);
    handle.attach(proxy);
    handle.setSize(0.7);
    this.scene.add(handle.getHelper());
    const mode = (name) => {
      handle.setMode(name === "turn" ? "rotate" : "translate");
      const own = name === "turn" ? "ABC" : "XYZ";
      [handle.showX, handle.showY, handle.showZ] = [...own].map((letter) => letters().includes(letter));
      handle.enabled = name !== "none";
      handle.getHelper().visible = name !== "none";
      this.redraw();
    };
    handle.addEventListener("dragging-changed", ({ value }) => {
      this.controls.enabled = !value;
      if (value) taken(proxy.position.toArray());
    });
    handle.addEventListener("change", () => this.redraw());
    handle.addEventListener("objectChange", () => moved(proxy.position.toArray(), degrees(proxy.rotation)));
    mode("none");
    return { mode, proxy };
  }
}

function degrees({ x, y, z }) {
  return [x, y, z].map(THREE.MathUtils.radToDeg);
}
