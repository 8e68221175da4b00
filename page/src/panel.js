// SPDX-License-Identifier: GPL-2.0-or-later
// The panel beside the picture: pose, limits, travel left, and display options.
import { ofShare } from "./colors.js";
import { box, choice, element, shown } from "./elements.js";
import { key } from "./kinematics.js";
import { homeOf } from "./mechanism.js";
import { Stage } from "./stage.js";
import { travel } from "./travel.js";
import { limitsBox, workspace } from "./workspace.js";

/** Number of nearest limits that are listed. */
const LISTED = 9;

/** Milliseconds without a change before the workspace, which takes long, is computed. */
const PEACE = 250;

/** Milliseconds between two computations of the travel left. */
const SOON = 400;

/** Degrees in each direction of the slider of a rotary extra axis. Its field accepts more turns. */
const TURN = 360;

export class Panel {
  constructor(page) {
    this.page = page;
    this.isSpaceShown = !page.program && !page.data.is_live;
    this.pose = element("div", { class: "pose" });
    this.limits = element("div", { class: "limits" });
    this.travel = element("table", { class: "travel" });
    this.joints = element("table", { class: "joints" });
    this.root = element("aside", {},
      this.which(), section("Pose", this.pose, this.handles()), section("Nearest limits", this.limits),
      section("Joints", this.joints), section("Travel left from here", this.travel), section("Show", this.views()));
    this.build();
  }

  which() {
    const { mechanisms } = this.page;
    if (mechanisms.length < 2) return undefined;
    const names = mechanisms.map((_, i) => `mechanism ${i + 1}`);
    return choice("mechanism", names, (name) => {
      this.page.which = names.indexOf(name);
      this.build();
      this.show();
    });
  }

  /** Creates a slider for each coordinate of the mechanism and for each extra axis. */
  build() {
    const { page } = this;
    const { scene } = page.current;
    const own = scene.axes.map((axis) => {
      const k = "XYZABC".indexOf(axis.letter);
      const set = (value) => page.take(page.current.place.pose.with(k, value));
      return this.slider(axis, 0.1 * (axis.max - axis.min), ({ pose }) => pose[k], set);
    });
    const extra = scene.extra_axes.map(({ letter, min, max }) => {
      const set = (value) => page.take(page.current.place.pose, undefined, page.which, { [letter]: value });
      const within = "ABC".includes(letter) ? { letter, min: Math.max(min, -TURN), max: Math.min(max, TURN) } : { letter, min, max };
      const slider = this.slider(within, 0, ({ extra: values }) => values[letter], set);
      if (scene.chain.every((link) => link.letter !== letter)) {
        slider.root.title = `${letter} carries nothing that is drawn`;
        slider.range.disabled = slider.field.disabled = true;
      }
      return slider;
    });
    this.sliders = [...own, ...extra];
    this.pose.replaceChildren(...this.sliders.map(({ root }) => root), element("button", { onclick: () => this.home() }, "home"));
  }

  /** Creates a slider and a field for a letter; `of` returns its value at a place, `set` moves to a value. */
  slider({ letter, min, max }, beyond, of, set) {
    const range = element("input", { type: "range", min: min - beyond, max: max + beyond, step: "any", "aria-label": letter });
    const field = element("input", { type: "number", step: "any", "aria-label": `${letter} as a number` });
    const taken = (value) => {
      if (value === "" || !isFinite(value)) return;
      this.page.player?.pause();
      set(Number(value));
    };
    range.addEventListener("input", () => taken(range.value));
    field.addEventListener("change", () => taken(field.value));
    const unit = "ABC".includes(letter) ? "°" : this.page.current.scene.length_unit;
    return { of, range, field, root: element("label", {}, element("b", {}, letter), range, field, element("i", {}, unit)) };
  }

  home() {
    this.page.player?.pause();
    const { pose, tool, extra } = homeOf(this.page.current);
    this.page.take(pose, tool, this.page.which, extra);
  }

  /** Lets the user drag the tool in the picture, and returns the list of modes. */
  handles() {
    const letters = () => this.page.current.scene.axes.map(({ letter }) => letter);
    const taken = (place) => (this.grip = { place, pose: [...this.page.current.place.pose] });
    this.handle = this.page.stage.handle(letters, taken, (place, turn) => {
      const wanted = [...place.map((value, k) => this.grip.pose[k] + value - this.grip.place[k]), ...turn];
      const moved = this.grip.pose.map((value, k) => (letters().includes("XYZABC"[k]) ? wanted[k] : value));
      this.page.player?.pause();
      this.isDragged = true;
      this.page.take(moved);
      this.isDragged = false;
    });
    return choice("drag", ["drag: nothing", "drag: move", "drag: turn"], (name) => {
      this.follow();
      this.handle.mode(name.slice(6) === "nothing" ? "none" : name.slice(6));
    });
  }

  /** Keeps the handle at the tool tip, or at the platform's origin if poses are those of the platform; relative to the base. */
  follow() {
    if (this.isDragged) return;
    const { drawn, drawing } = this.page.current;
    drawing.onBase.add(this.handle.proxy);
    this.handle.proxy.position.set(...drawn.tip);
    this.handle.proxy.rotation.set(...drawn.full.slice(3).map((angle) => (angle * Math.PI) / 180), "ZYX");
  }

  views() {
    const { page } = this;
    const { stage } = page;
    const drawings = page.mechanisms.map(({ drawing }) => drawing);
    const each = (act) => (isOn) => {
      drawings.forEach((drawing) => act(drawing, isOn));
      stage.redraw();
    };
    const looks = Stage.views().map((name) => element("button", { onclick: () => page.look(name) }, name));
    const space = box("workspace at these angles, and axis limits", (isOn) => {
      this.isSpaceShown = isOn;
      this.space();
    }, this.isSpaceShown);
    const all = [
      element("div", { class: "looks" }, ...looks),
      box("joint numbers", each((drawing, isOn) => (drawing.labels.visible = isOn)), true),
      box("cones of the joints", each((drawing, isOn) => drawing.showCones(isOn))),
      space,
      this.section(),
    ];
    if (page.program && !page.program.isEmpty) all.push(...this.overTime());
    return element("div", {}, ...all);
  }

  section() {
    const { stage, box: everything } = this.page;
    const slider = element("input", { type: "range", min: 0, max: 1, step: "any", ".value": 0.5, "aria-label": "position of the cut" });
    const act = () => {
      const letter = list.value.slice(5);
      const k = "XYZ".indexOf(letter);
      const [low, high] = [everything.min.toArray()[k], everything.max.toArray()[k]];
      stage.cut(k < 0 ? undefined : letter, low + slider.value * (high - low));
    };
    const list = choice("cut", ["cut: nothing", "cut: X", "cut: Y", "cut: Z"], act);
    slider.addEventListener("input", act);
    return element("div", { class: "cut" }, list, slider);
  }

  overTime() {
    const { page } = this;
    const names = ["trace: nothing", "trace: tool tip", ...page.mechanisms[0].scene.legs.map((_, i) => `trace: upper end ${i}`)];
    return [
      box("tool path, colored by the nearest limit", (isOn) => {
        page.stage.path.visible = isOn;
        page.stage.redraw();
      }, true),
      box("space swept by rods and platform", (isOn) => page.player.sweep(isOn)),
      choice("trace", names, (name) => page.player.trace(names.indexOf(name) - 1)),
    ];
  }

  show() {
    const { place, drawn, scene, limits } = this.page.current;
    for (const { of, range, field } of this.sliders ?? []) {
      range.value = of(place);
      if (document.activeElement !== field) field.value = shown(of(place), 4);
    }
    this.showLimits(drawn.margins, limits);
    const own = scene.joints.map(({ name, unit }, i) => ({ name, unit, value: drawn.joints[i] }));
    const unitOf = (letter) => ("ABC".includes(letter) ? "degrees" : scene.length_unit);
    const extra = scene.extra_axes.map(({ letter }) => (
      { name: `axis ${letter}`, unit: unitOf(letter), value: place.extra[letter] }));
    const dependent = [...scene.dependent].map((letter) => (
      { name: `dependent ${letter}`, unit: unitOf(letter), value: drawn.full["XYZABC".indexOf(letter)] }));
    this.joints.replaceChildren(...[...own, ...extra, ...dependent].map(({ name, unit, value }) => element("tr", {},
      element("td", {}, name), element("td", {}, shown(value, 4)), element("td", {}, unit))));
    if (this.handle) this.follow();
    this.page.stage.space.matrix.copy(this.page.current.drawing.at.base);
    // While the machine moves, travel is computed at intervals; the workspace is computed once the machine rests.
    this.travelWaits ??= setTimeout(() => {
      this.travelWaits = undefined;
      this.showTravel();
    }, SOON);
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.space(), PEACE);
  }

  showLimits(margins, names) {
    const nearest = margins.filter(({ share }) => isFinite(share) || share < 0).sort((a, b) => a.share - b.share).slice(0, LISTED);
    this.limits.replaceChildren(...nearest.map((margin) => {
      const { part, limit, unit } = names[key(margin)];
      const { value, low, high, share } = margin;
      const allowed = [low, high].map((end) => (isFinite(end) ? shown(end, 3) : "")).join(" … ");
      const bar = element("meter-bar", { title: `${limit}: ${shown(value)} ${unit}, allowed ${allowed}` });
      bar.style.setProperty("--share", `${100 * Math.min(Math.max(share, 0), 1)}%`);
      bar.style.setProperty("--color", ofShare(share).getStyle());
      const words = share < 0 ? "beyond" : `${shown(100 * Math.min(share, 1), 0)} %`;
      return element("div", { class: share < 0 ? "limit broken" : "limit" }, element("span", {}, named(part, limit)), bar, element("em", {}, words));
    }));
  }

  showTravel() {
    const { current, refusals, which } = this.page;
    const { kinematics, place } = current;
    const rows = refusals[which] ? [] : travel(kinematics, current, place);
    this.travel.replaceChildren(...rows.map(({ letter, sign, left, unit, end }) =>
      element("tr", { title: end }, element("td", {}, `${sign > 0 ? "+" : "−"}${letter}`), element("td", {}, shown(left, 2)), element("td", {}, unit), element("td", {}, end))));
  }

  space() {
    const { stage, current } = this.page;
    const angles = `${this.isSpaceShown} ${this.page.which} ${current.place.pose.slice(3)} ${current.place.tool}`;
    if (angles === this.shownSpace) return;
    this.shownSpace = angles;
    const { kinematics, scene, place } = current;
    if (!this.isSpaceShown) stage.showSpace();
    else stage.showSpace(workspace(kinematics, scene, place.pose, place.tool), limitsBox(scene, place.pose));
  }
}

/** Returns the name of a part, followed by its limit unless the name implies it. */
function named(part, limit) {
  const isSaid = ["joint range", "axis range", "clearance of legs"].includes(limit) || part.includes(limit);
  return isSaid ? part.replace(/^the /, "") : `${part.replace(/^the /, "")}, ${limit}`;
}

function section(name, ...children) {
  return element("details", { open: true }, element("summary", {}, name), ...children);
}
