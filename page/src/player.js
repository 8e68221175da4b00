// SPDX-License-Identifier: GPL-2.0-or-later
// Playback of a program: slider, text, marks, curves, path.
import { Curves, groups } from "./curves.js";
import { Rows, choice, element, shown } from "./elements.js";
import { answer } from "./kinematics.js";
import { vector } from "./parts.js";

const SPEEDS = ["0.1 ×", "0.5 ×", "1 ×", "2 ×", "5 ×", "20 ×", "100 ×"];

/** Height of a program line, the same as in page.css. */
const LINE = 18;

/** Number of moments that the swept volume is drawn from. */
const SWEPT = 240;

export class Player {
  constructor(page) {
    this.page = page;
    this.program = page.program;
    this.time = 0;
    this.rate = 1;
    this.isPlaying = false;
    this.marks = this.program.report.breaks.map((readout) => this.mark(readout));
    this.root = element("section", { class: "player" }, this.program.isEmpty ? undefined : this.bar(), this.middle());
  }

  mark(readout) {
    const which = readout.of_second ? 1 : 0;
    const { coordinates, table } = this.page.mechanisms[which].scene;
    const isOwn = readout.file === 0;
    const time = readout.seconds ?? (isOwn ? this.program.timeOf(readout.line, readout.pose, which, coordinates + table) : undefined);
    const place = isOwn ? `line ${readout.line}` : `${this.program.report.files[readout.file].split("/").pop()}, line ${readout.line}`;
    return { time, line: readout.line, isOwn, text: `${place}: ${readout.limit}: ${readout.text}` };
  }

  bar() {
    const { end } = this.program;
    this.button = element("button", { class: "play", onclick: () => this.toggle() }, "play");
    this.slider = element("input", { type: "range", min: 0, max: end, step: "any", ".value": 0, "aria-label": "time" });
    this.slider.addEventListener("input", () => {
      this.pause();
      this.go(Number(this.slider.value));
    });
    this.readout = element("output", {});
    const speed = choice("speed", SPEEDS, (name) => (this.rate = parseFloat(name)));
    speed.value = "1 ×";
    const marks = element("div", { class: "marks" }, ...this.marks.filter(({ time }) => time !== undefined).map((mark) => {
      const flag = element("button", { class: "mark", title: mark.text, onclick: () => this.goTo(mark) }, "▼");
      flag.style.left = `${(100 * mark.time) / end}%`;
      return flag;
    }));
    return element("div", { class: "bar" }, this.button, speed, element("div", { class: "time" }, marks, this.slider), this.readout);
  }

  middle() {
    const { program } = this;
    const broken = new Set(this.marks.filter(({ isOwn }) => isOwn).map(({ line }) => line));
    this.rows = new Rows(program.text, LINE, (text, i) =>
      element("div", {
        class: `${i + 1 === this.line ? "now" : ""} ${broken.has(i + 1) ? "broken" : ""}`,
        onclick: () => this.goToLine(i + 1),
      }, element("b", {}, String(i + 1)), text));
    const found = element("div", { class: "found" }, ...this.findings());
    const text = element("div", { class: "program" }, found, this.rows.root);
    if (program.isEmpty) return element("div", { class: "middle" }, text);
    this.groups = groups(program, this.page.mechanisms[0]);
    this.plot = element("div", { class: "plot" });
    this.curves = new Curves(this.plot, (time) => {
      this.pause();
      this.go(time);
    });
    const names = [...this.groups.keys()];
    const list = choice("curves", names, (name) => this.curves.show(this.groups.get(name)));
    return element("div", { class: "middle" }, text, element("div", { class: "curves" }, list, this.plot));
  }

  findings() {
    const cause = this.program.notJudged;
    const notJudged = cause && element("p", { class: "warning" }, cause);
    const marks = this.marks.map((mark) => element("button", { class: "finding", onclick: () => this.goTo(mark) }, mark.text));
    const warnings = this.program.report.warnings.map(({ line, text }) => element("p", { class: "warning" }, line ? `line ${line}: ${text}` : text));
    return [notJudged, ...marks, ...warnings].filter((part) => part);
  }

  /** Draws curves and path once the page is laid out. */
  start() {
    if (this.program.isEmpty) return;
    this.curves.show([...this.groups.values()][0]);
    new ResizeObserver(() => this.curves.resize()).observe(this.plot);
    this.drawPath();
    this.go(0);
  }

  drawPath() {
    const { program, page } = this;
    // At a refused pose the position of the tip on the work is unknown.
    const all = Array.from(program.times, (time, i) => ({ time, ...this.moment(program.point(i)) }));
    const moments = all.filter(({ drawn }) => drawn);
    const shares = moments.map(({ drawn }) => drawn.margins.reduce((least, { share }) => Math.min(least, share), 1));
    const points = moments.map(({ at }) => at.tool.at(-1).clone().applyMatrix4(at.work.clone().invert()).toArray());
    this.path = points.map((at, i) => ({ at, time: moments[i].time }));
    page.stage.showPath(points, shares);
  }

  sweep(isOn) {
    const { mechanisms, stage } = this.page;
    const all = isOn ? this.moments().flatMap(({ drawn, at }) => mechanisms[0].drawing.outline(drawn, at)) : [];
    stage.showSweep(all);
  }

  /** Draws the trace of the tool tip (0) or of a leg's upper end (1, 2, …) in the world; a negative number removes it. */
  trace(which) {
    const of = ({ drawn, at }) => (which === 0 ? at.tool.at(-1) : vector(drawn.legs[which - 1].upper).applyMatrix4(at.base));
    this.page.stage.showTrace(which < 0 ? [] : this.moments(8 * SWEPT).map(of));
  }

  /** Returns the answer of the kinematics at a place, and positions in the world; undefined if the pose is refused. */
  moment(place) {
    const [mechanism] = this.page.mechanisms;
    try {
      const drawn = answer(mechanism, place);
      return { drawn, at: mechanism.drawing.placed(drawn, place) };
    } catch {
      return undefined;
    }
  }

  /** Returns `moment` at equidistant times of the program, without refused poses. */
  moments(count = SWEPT) {
    const times = Array.from({ length: count }, (_, n) => (n / (count - 1)) * this.program.end);
    return times.map((time) => this.moment(this.program.at(time))).filter((moment) => moment);
  }

  toggle() {
    if (this.program.isEmpty) return;
    if (this.isPlaying) this.pause();
    else {
      if (this.time >= this.program.end) this.go(0);
      this.isPlaying = true;
      this.before = undefined;
      this.button.textContent = "pause";
    }
  }

  pause() {
    if (!this.isPlaying) return;
    this.isPlaying = false;
    this.button.textContent = "play";
    this.page.panel.show();
  }

  tick(now) {
    if (!this.isPlaying) return;
    const step = this.before === undefined ? 0 : ((now - this.before) / 1000) * this.rate;
    this.before = now;
    this.go(Math.min(this.time + step, this.program.end));
    if (this.time >= this.program.end) this.pause();
  }

  /** Goes to the time and line of a mark. A mark that the run did not reach has no time, only a line. */
  goTo({ time, line, isOwn = true }) {
    this.pause();
    if (time !== undefined) this.go(time);
    if (isOwn) this.setLine(line);
  }

  goToLine(line) {
    const time = this.program.timeOf(line);
    if (time !== undefined) this.goTo({ time, line });
  }

  go(time) {
    this.time = time;
    this.slider.value = time;
    this.page.mechanisms.forEach((_, which) => {
      const { pose, tool, extra } = this.program.at(time, which);
      this.page.take(pose, tool, which, extra);
    });
    this.setLine(this.program.line(time));
    this.curves.at(time);
  }

  setLine(line) {
    const hasChanged = line !== this.line;
    this.line = line;
    const { length_unit: unit } = this.page.mechanisms[0].scene;
    this.rows.go(Math.max(line - 1, 0), hasChanged);
    if (this.program.isEmpty) return;
    this.readout.textContent = `${shown(this.time, 2)} of ${shown(this.program.end, 1)} s · line ${line} · ${shown(this.program.speed(this.time), 1)} ${unit}/s`;
  }
}
