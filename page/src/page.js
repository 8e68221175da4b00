// SPDX-License-Identifier: GPL-2.0-or-later
// The page of `pkm view`: docs/reference/view.md.
import * as THREE from "three";
import { element, hexadecimal, shown } from "./elements.js";
import { Kinematics, Refusal, answer, key, least } from "./kinematics.js";
import { follow } from "./live.js";
import { Mechanism, homeOf } from "./mechanism.js";
import { Panel } from "./panel.js";
import { vector } from "./parts.js";
import { Player } from "./player.js";
import { Program } from "./program.js";
import { Recorder, wanted } from "./record.js";
import { shape } from "./shape.js";
import { Stage } from "./stage.js";
import { numbers, unpacked } from "./unpack.js";

const VERSION = 2;

class Page {
  constructor(data, mechanisms) {
    this.data = data;
    this.mechanisms = mechanisms;
    this.which = 0;
    const record = wanted();
    this.canvas = element("canvas", { class: "picture", tabindex: "0", "aria-label": "the machine in 3D" });
    this.canvas.addEventListener("keydown", ({ key: pressed }) => pressed === " " && this.player?.toggle());
    this.size = Math.max(...mechanisms.map(sizeOf));
    this.refusals = mechanisms.map(() => undefined);
    for (const mechanism of mechanisms) this.build(mechanism);
    this.box = this.everything();
    const letters = mechanisms.map(({ scene }) => scene.coordinates).join("");
    // Long passive legs make no lathe.
    const mayLie = mechanisms.every(({ scene }) => scene.passive.length === 0);
    this.problems = [...data.problems];
    this.stage = new Stage(this.canvas, this.size, this.box, mayLie && letters, record !== undefined);
    for (const { drawing } of mechanisms) this.stage.scene.add(drawing.group);
    mechanisms[0].shapes.forEach((given) => this.addShape(given));
    this.box = this.everything();
    for (const { drawing, drawn } of mechanisms) drawing.buildCones(drawn);
    if (data.program) this.program = new Program(data.program, mechanisms[0].scene.extra_axes.map(({ letter }) => letter));
    this.lay(record);
  }

  /** Creates the drawing of a mechanism, at home. */
  build(mechanism) {
    const { scene } = mechanism;
    mechanism.drawing = new Mechanism(scene, this.size);
    mechanism.place = homeOf(mechanism);
    mechanism.drawn = answer(mechanism, mechanism.place);
    mechanism.drawing.place(mechanism.drawn, mechanism.place);
  }

  /** Adds a shape from a file in the frame of its part. */
  addShape(given) {
    const { base, platform } = this.mechanisms[0].drawing;
    const frames = { base, platform, spindle: platform, table: this.stage.work };
    try {
      frames[given.part].add(shape(given));
    } catch (error) {
      this.problems.push(`${given.part} is drawn without its model: ${given.name}: ${error.message}`);
    }
  }

  lay(record) {
    const root = document.getElementById("page");
    const stage = element("div", { class: "stage" }, this.canvas);
    this.reason = element("p", { class: "reason", role: "status", hidden: true });
    stage.append(this.reason);
    this.panel = new Panel(this);
    if (this.program) this.player = new Player(this);
    root.append(this.header(), stage, this.panel.root, this.player?.root ?? "");
    root.classList.toggle("has-program", this.player !== undefined);
    const resize = () => {
      const { width, height } = stage.getBoundingClientRect();
      if (width > 0 && !record) this.stage.resize(width, height);
    };
    new ResizeObserver(resize).observe(stage);
    resize();
    this.mechanisms.forEach((_, which) => this.show(which));
    this.panel.space();
    this.look("3D");
    if (this.player) this.player.start();
    if (this.data.is_live) follow(this);
    if (record) new Recorder(this).run(record);
    else this.loop();
  }

  header() {
    const { title, error, program } = this.data;
    const hash = this.mechanisms.map(({ scene }) => hexadecimal(scene.geometry_hash)).join(", ");
    const fits = { true: "fits", false: "does not fit", null: "not judged" }[String(program?.report.fits ?? null)];
    const verdict = program && element("span", { class: `verdict ${fits.replaceAll(" ", "-")}` }, fits);
    this.state = element("span", { class: "state" });
    const about = program ? `${program.name.split("/").pop()}` : "";
    return element("header", {},
      element("h1", {}, title), element("span", { class: "about" }, about), verdict,
      this.program?.notJudged && element("span", { class: "about" }, this.program.notJudged), this.state,
      error && element("p", { class: "error", role: "alert" }, error),
      ...this.problems.map((text) => element("p", { class: "error", role: "alert" }, text)),
      element("span", { class: "hash" }, `geometry ${hash}`));
  }

  loop() {
    const tick = (now) => {
      this.player?.tick(now);
      this.stage.draw();
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  get current() {
    return this.mechanisms[this.which];
  }

  /** Returns the bounding box of everything that the picture must show. */
  everything() {
    const box = new THREE.Box3();
    for (const { drawing } of this.mechanisms) {
      drawing.group.updateMatrixWorld(true);
      drawing.labels.visible = false;
      box.expandByObject(drawing.base).expandByObject(drawing.platform);
      drawing.labels.visible = true;
      const ends = drawing.legs.flatMap(({ lower, upper }) => [lower, upper]);
      ends.forEach((end) => box.expandByPoint(end.getWorldPosition(new THREE.Vector3())));
      drawing.passive.forEach(({ bar }) => box.expandByObject(bar));
      drawing.at.tool.forEach((point) => box.expandByPoint(point));
      drawing.tables.filter(({ parent }) => parent).forEach((table) => box.expandByObject(table));
    }
    return box;
  }

  /** Points the camera at everything that is shown, from the view `name`. */
  look(name) {
    const box = this.box.clone();
    if (this.panel.isSpaceShown) box.expandByObject(this.stage.space);
    this.stage.look(name, box);
  }

  /** Returns the positions on the page of the first mechanism's legs, at 60 % of their lengths. */
  seen() {
    this.stage.redraw();
    this.stage.draw();
    const { left, top } = this.canvas.getBoundingClientRect();
    const { drawn, drawing } = this.mechanisms[0];
    const names = this.mechanisms[0].scene.joints.map(({ name }) => name);
    const middle = ({ lower, upper }) => vector(lower).lerp(vector(upper), 0.6).applyMatrix4(drawing.at.base);
    const parts = this.mechanisms[0].scene.legs.map((_, i) => ({ name: names[i], place: middle(drawn.legs[i]) }));
    return parts.map(({ name, place }) => {
      const [x, y] = this.stage.onCanvas(place);
      return { name, at: [left + x, top + y] };
    });
  }

  /** Moves a mechanism to a pose, with a tool vector and values of the extra axes by letter; those left out keep their
   * values. If the pose is refused, the drawing stays and the page shows the reason. */
  take(pose, tool, which = this.which, extra = {}) {
    const mechanism = this.mechanisms[which];
    const { place } = mechanism;
    mechanism.place = { pose: [...pose], tool: [...(tool ?? place.tool)], extra: { ...place.extra, ...extra } };
    this.show(which);
  }

  show(which) {
    const mechanism = this.mechanisms[which];
    try {
      mechanism.drawn = answer(mechanism, mechanism.place);
      mechanism.drawing.place(mechanism.drawn, mechanism.place);
      this.refusals[which] = undefined;
      this.moveWork(mechanism);
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      this.refusals[which] = error;
    }
    this.reason.textContent = this.mechanisms.map((_, i) => this.whyNot(i)).find((text) => text) ?? "";
    this.reason.hidden = this.reason.textContent === "";
    this.panel.show();
    this.stage.redraw();
  }

  /** Returns why a mechanism cannot be at its pose: a refusal, or the limit violated most; undefined if it can. */
  whyNot(which) {
    const { drawn, limits } = this.mechanisms[which];
    if (this.refusals[which]) return this.refusals[which].message;
    const worst = least(drawn.margins);
    if (!worst || worst.share >= 0) return undefined;
    const { part, unit, limit } = limits[key(worst)];
    const { value, low, high } = worst;
    const [side, end] = value < low ? ["below", low] : ["above", high];
    return `${part} is at ${shown(value)} ${unit}, ${side} its limit of ${shown(end)} (${limit})`;
  }

  moveWork(mechanism) {
    if (mechanism === this.mechanisms[0]) this.stage.work.matrix.copy(mechanism.drawing.at.work);
  }
}

/** Returns the size of the machine, guides included; sizes of drawn parts are shares of it. */
function sizeOf({ scene }) {
  const guides = scene.legs.map((leg, i) => (leg.kind === "slider" ? [(scene.joints[i].max - scene.joints[i].min) * 0.7, 0, 0] : [0, 0, 0]));
  const lengths = scene.legs.flatMap((leg) => [leg.base, leg.platform, ...(leg.rod ? [[leg.rod, 0, 0]] : [])]);
  return Math.max(...[...lengths, ...guides].map((v) => Math.hypot(...v)));
}

/** Replaces missing limits of axes, which are null in JSON, by finite ones for sliders: two machine sizes, or a turn. */
function bounded(scene) {
  const size = sizeOf({ scene });
  const axes = scene.axes.map(({ letter, min, max }) => {
    const k = "XYZABC".indexOf(letter);
    const far = k < 3 ? 2 * size : 360;
    const [hasMin, hasMax] = [min !== null, max !== null];
    return { letter, hasMin, hasMax, min: hasMin ? min : scene.home.pose[k] - far, max: hasMax ? max : scene.home.pose[k] + far };
  });
  return { ...scene, axes };
}

/** Returns positions of what is drawn: ends of legs, the tip, and frames as matrices in column order. */
function onGround({ stage }, { legs, passive, onBase, group, at }) {
  group.updateMatrixWorld(true);
  const place = (object) => object.getWorldPosition(new THREE.Vector3()).toArray();
  return {
    passive: passive.map(({ from, to }) => [from, to].map((end) => end.clone().applyMatrix4(onBase.matrixWorld).toArray())),
    lower: legs.map(({ lower }) => place(lower)), upper: legs.map(({ upper }) => place(upper)),
    tip: at.tool.at(-1).toArray(), base: onBase.matrixWorld.toArray(), work: stage.work.matrix.toArray(),
  };
}

/** Returns the interface for tests and other programs: it sets poses and times, and returns numbers. */
function interfaceOf(page) {
  return {
    take: (pose, tool, which = 0, extra = {}) => page.take(pose, tool, which, extra),
    go: (time) => page.player.go(time),
    look: (name) => page.look(name),
    state: (which = 0) => {
      const { place, drawn, scene, drawing } = page.mechanisms[which];
      const { joints, legs, tip, nose, full, conditioning } = drawn;
      const count = scene.joints.length;
      return {
        ...place, tip, nose, full, conditioning, joints: joints.slice(0, count), legs: legs.slice(0, scene.legs.length),
        refusal: page.refusals[which]?.message, code: page.refusals[which]?.code ?? 0,
        time: page.player?.time, line: page.player?.line, live: page.live,
        platform: drawing.platform.matrix.toArray(), ground: onGround(page, drawing),
      };
    },
    path: () => page.player.path,
    curves: () => Array.from(page.player.groups, ([name, group]) => ({ name, ...group })),
    end: () => page.program?.end ?? 0,
    mechanisms: () => page.mechanisms.map(({ scene, tool }) => ({ scene, tool })),
    seen: () => page.seen(),
    marks: () => page.player?.marks ?? [],
    workspace: () => page.stage.space.children.map(({ geometry }) => geometry.attributes.position.count),
  };
}

async function start() {
  const [code, text] = await Promise.all([unpacked("kinematics"), unpacked("data")]);
  const data = JSON.parse(new TextDecoder().decode(text));
  if (data.version !== VERSION) throw new Error(`this page needs data of version ${VERSION}, but found ${data.version}`);
  const module = await WebAssembly.compile(code);
  document.title = data.title;
  const mechanisms = await Promise.all(data.mechanisms.map(async (mechanism) => ({
    ...mechanism, scene: bounded(mechanism.scene), kinematics: await Kinematics.of(module, numbers(mechanism.numbers), mechanism.scene.sees_tool),
  })));
  window.pkm = interfaceOf(new Page(data, mechanisms));
}

start().catch((error) => {
  document.getElementById("page").append(element("p", { class: "error", role: "alert" }, `This page cannot be shown: ${error.message}`));
  throw error;
});
