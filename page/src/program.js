// SPDX-License-Identifier: GPL-2.0-or-later
// A program through time: poses between the points that pkm has kept, lines, curves.
import { columns } from "./unpack.js";

/** Numbers of a mechanism in a point: x y z a b c, tool x y z. */
const VALUES = 9;

/** The last place whose value is at most this one. */
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
  constructor(data) {
    Object.assign(this, { name: data.name, end: data.end, report: data.report });
    [this.times, ...this.values] = columns(data.points);
    [this.lineTimes, this.lineNumbers] = columns(data.lines);
    this.text = data.text.split(/\r?\n/);
    this.curves = data.curves && { names: data.curves.names, values: columns(data.curves.values, Float32Array) };
  }

  get isEmpty() {
    return this.times.length === 0;
  }

  /** Pose and tool of mechanism `which` at a time; linear between points. */
  at(time, which = 0) {
    const { times } = this;
    const i = before(times, time);
    const next = Math.min(i + 1, times.length - 1);
    const part = next === i ? 0 : Math.min(Math.max((time - times[i]) / (times[next] - times[i]), 0), 1);
    const value = (k) => {
      const column = this.values[which * VALUES + k];
      return column[i] + part * (column[next] - column[i]);
    };
    const all = Array.from({ length: VALUES }, (_, k) => value(k));
    return { pose: all.slice(0, 6), tool: all.slice(6) };
  }

  /** Pose and tool at a point. */
  point(i, which = 0) {
    const all = Array.from({ length: VALUES }, (_, k) => this.values[which * VALUES + k][i]);
    return { pose: all.slice(0, 6), tool: all.slice(6) };
  }

  line(time) {
    return this.lineNumbers.length ? this.lineNumbers[before(this.lineTimes, time)] : 0;
  }

  /** Units of length a second. */
  speed(time) {
    const step = 0.005;
    const [from, to] = [Math.max(time - step, 0), Math.min(time + step, this.end)];
    const [a, b] = [this.at(from).pose, this.at(to).pose];
    return to > from ? Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) / (to - from) : 0;
  }

  /** When a line begins; with a pose, when it comes nearest to it. */
  timeOf(line, pose) {
    const starts = this.lineNumbers.indexOf(line);
    if (starts < 0) return undefined;
    const from = this.lineTimes[starts];
    if (!pose) return from;
    const to = this.lineTimes[starts + 1] ?? this.end;
    let best = { time: from, distance: Infinity };
    for (let n = 0; n <= 200; n++) {
      const time = from + (n / 200) * (to - from);
      const distance = Math.hypot(...this.at(time).pose.map((value, k) => value - pose[k]));
      if (distance < best.distance) best = { time, distance };
    }
    return best.time;
  }
}
