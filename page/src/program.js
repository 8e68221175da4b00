// SPDX-License-Identifier: GPL-2.0-or-later
// A program over time: poses interpolated between the points that pkm kept, lines, curves.
import { columns } from "./unpack.js";

/** Number of values of a pose, which the tool vector follows. */
const POSE = 6;

/** Number of moments searched for the position of a mark in its line. */
const MOST_LOOKS = 4000;

/** Returns the index of the last of the ascending `values` that is at most `value`, or 0. */
export function before(values, value) {
  let [low, high] = [0, values.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (values[middle] <= value) low = middle;
    else high = middle - 1;
  }
  return low;
}

export class Program {
  /** Unpacks a program; `letters` are those of the machine's extra axes. */
  constructor(data, letters) {
    Object.assign(this, { name: data.name, end: data.end, report: data.report, letters });
    this.ofMechanism = data.of_mechanism;
    [this.times, ...this.values] = columns(data.points);
    [this.lineTimes, this.lineNumbers] = columns(data.lines);
    this.text = data.text.split(/\r?\n/);
    this.curves = data.curves && { names: data.curves.names, values: columns(data.curves.values, Float32Array) };
  }

  /** Returns why the program's timing was not judged, if so. */
  get notJudged() {
    const cause = this.report.time.not_judged;
    return cause && `time not judged: ${cause}`;
  }

  get isEmpty() {
    return this.times.length === 0;
  }

  /** Returns pose, tool and extra axes of mechanism `which` at a time, linear between points. */
  at(time, which = 0) {
    const { times } = this;
    const i = before(times, time);
    const next = Math.min(i + 1, times.length - 1);
    const part = next === i ? 0 : Math.min(Math.max((time - times[i]) / (times[next] - times[i]), 0), 1);
    return this.place(which, (column) => column[i] + part * (column[next] - column[i]));
  }

  /** Returns pose, tool and extra axes of mechanism `which` at point `i`. */
  point(i, which = 0) {
    return this.place(which, (column) => column[i]);
  }

  place(which, value) {
    const own = this.values.slice(which * this.ofMechanism, (which + 1) * this.ofMechanism).map(value);
    const extra = this.values.slice(this.values.length - this.letters.length).map((column, n) => [this.letters[n], value(column)]);
    return { pose: own.slice(0, POSE), tool: own.slice(POSE), extra: Object.fromEntries(extra) };
  }

  line(time) {
    return this.lineNumbers.length ? this.lineNumbers[before(this.lineTimes, time)] : 0;
  }

  /** Returns the speed of the pose at a time, in units of length per second. */
  speed(time) {
    const step = 0.005;
    const [from, to] = [Math.max(time - step, 0), Math.min(time + step, this.end)];
    const [a, b] = [this.at(from).pose, this.at(to).pose];
    return to > from ? Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) / (to - from) : 0;
  }

  /** Returns when a line first begins; with a pose, when mechanism `which` comes nearest to it within the line, measured in
   * `letters`. */
  timeOf(line, pose, which = 0, letters = "XYZABC") {
    const starts = Array.from(this.lineNumbers.keys()).filter((i) => this.lineNumbers[i] === line);
    if (starts.length === 0) return undefined;
    if (!pose) return this.lineTimes[starts[0]];
    const looks = Math.max(Math.round(MOST_LOOKS / starts.length), 2);
    let best = { distance: Infinity };
    for (const start of starts) {
      const [from, to] = [this.lineTimes[start], this.lineTimes[start + 1] ?? this.end];
      for (let n = 0; n <= looks; n++) {
        const time = from + (n / looks) * (to - from);
        const own = this.at(time, which).pose;
        const distance = Math.hypot(...own.map((value, k) => (letters.includes("XYZABC"[k]) ? value - pose[k] : 0)));
        if (distance < best.distance) best = { time, distance };
      }
    }
    return best.time;
  }
}
