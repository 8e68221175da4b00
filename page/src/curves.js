// SPDX-License-Identifier: GPL-2.0-or-later
// Curves over the time of a program, with a mark at the current time.
import uPlot from "uplot";
import { CURVES } from "./colors.js";

const SAMPLES = 1500;

/** Computes the curves that pkm does not send: joint motion per tool motion, conditioning, and dependent coordinates. */
function computed(program, mechanism) {
  const { kinematics, scene } = mechanism;
  const count = Math.min(SAMPLES, program.times.length * 4);
  const times = Array.from({ length: count }, (_, n) => (n / (count - 1)) * program.end);
  const answers = times.map((time) => {
    const { pose, tool } = program.at(time);
    try {
      return kinematics.at(pose, tool);
    } catch {
      return undefined;
    }
  });
  const joint = (i) => ({
    name: scene.joints[i].name, unit: `per ${scene.length_unit} of the tool`, range: [null, null],
    values: answers.map((answer) => answer?.ratios[i] ?? null),
  });
  const full = (letter, unit) => ({
    name: letter, unit, range: [null, null], values: answers.map((answer) => answer?.full["XYZABC".indexOf(letter)] ?? null),
  });
  // One plot has one unit.
  const dependent = [["XYZ", scene.length_unit], ["ABC", "degrees"]].flatMap(([own, unit]) => {
    const letters = [...scene.dependent].filter((letter) => own.includes(letter));
    return letters.length ? [[`dependent ${letters.join(" ")}`, letters.map((letter) => full(letter, unit))]] : [];
  });
  return {
    times,
    groups: {
      ...Object.fromEntries(dependent),
      "joint motion for tool motion": scene.joints.map((_, i) => joint(i)),
      conditioning: [{ name: "conditioning", unit: "", range: [scene.conditioning_limit, null], values: answers.map((answer) => answer?.conditioning ?? null) }],
    },
  };
}

/** Returns the groups of curves by name, each with its times. */
export function groups(program, mechanism) {
  const all = new Map();
  const { names, values } = program.curves ?? { names: [], values: [[]] };
  names.forEach(({ group, ...curve }, i) => {
    if (!all.has(group)) all.set(group, { times: Array.from(values[0]), curves: [] });
    all.get(group).curves.push({ ...curve, values: Array.from(values[i + 1], (value) => (isFinite(value) ? value : null)) });
  });
  const own = computed(program, mechanism);
  for (const [name, curves] of Object.entries(own.groups)) all.set(name, { times: own.times, curves });
  return all;
}

/** A plot of one group of curves in an element; `chosen` gets a time that was clicked. */
export class Curves {
  constructor(element, chosen) {
    Object.assign(this, { element, chosen, time: 0 });
  }

  show({ times, curves }) {
    this.plot?.destroy();
    const unit = curves[0]?.unit ?? "";
    const isOneRange = curves.every(({ range }) => String(range) === String(curves[0].range));
    const limits = isOneRange ? curves[0].range.filter((end) => end !== null) : [];
    const series = curves.map(({ name }, i) => ({
      label: name, stroke: CURVES[i % CURVES.length], width: 1.3, dash: i >= CURVES.length ? [6, 3] : undefined,
      value: (_, value) => (value === null ? "–" : value.toPrecision(5)),
    }));
    const axis = { stroke: "#16202a", grid: { stroke: "#dde2e7" }, font: "12px sans-serif" };
    // uPlot ignores a new size while it calls these.
    const fit = (plot) => queueMicrotask(() => this.fit(plot));
    const options = {
      width: this.element.clientWidth, height: this.element.clientHeight,
      scales: { x: { time: false } },
      axes: [{ ...axis, label: "time, s", labelSize: 18, size: 36 }, { ...axis, label: unit || "no dimension", size: 64, labelSize: 18 }],
      series: [{ label: "s" }, ...series],
      cursor: { drag: { x: true, y: false } },
      hooks: { draw: [(plot) => this.mark(plot, limits)], ready: [fit], setSize: [fit] },
    };
    this.plot = new uPlot(options, [times, ...curves.map(({ values }) => values)], this.element);
    this.plot.over.addEventListener("click", () => {
      const { left } = this.plot.cursor;
      if (left >= 0) this.chosen(this.plot.posToVal(left, "x"));
    });
  }

  /** Draws the current time, and the limits that all curves share. */
  mark(plot, limits) {
    const { ctx: pen, bbox } = plot;
    pen.save();
    pen.beginPath();
    pen.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    pen.clip();
    const line = (from, to, color, dash) => {
      pen.strokeStyle = color;
      pen.setLineDash(dash);
      pen.lineWidth = 1.5 * devicePixelRatio;
      pen.beginPath();
      pen.moveTo(...from);
      pen.lineTo(...to);
      pen.stroke();
    };
    for (const limit of limits) {
      const y = plot.valToPos(limit, "y", true);
      line([bbox.left, y], [bbox.left + bbox.width, y], "#d55e00", [8, 5]);
    }
    const x = plot.valToPos(this.time, "x", true);
    line([x, bbox.top], [x, bbox.top + bbox.height], "#16202a", []);
    pen.restore();
  }

  at(time) {
    this.time = time;
    this.plot?.redraw(false);
  }

  /** Makes room below the plot for its key, which has more lines in a narrow picture. */
  fit(plot) {
    if (plot !== this.plot) return;
    const height = this.element.clientHeight - plot.root.querySelector(".u-legend").offsetHeight;
    if (height !== plot.height) plot.setSize({ width: this.element.clientWidth, height });
  }

  resize() {
    this.plot?.setSize({ width: this.element.clientWidth, height: this.plot.height });
  }
}
