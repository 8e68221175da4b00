// SPDX-License-Identifier: GPL-2.0-or-later
// The kinematics of a mechanism: the same code as in the module, compiled to WebAssembly.

/** A refused pose: the code, and a message with the reason and the remedy. */
export class Refusal extends Error {
  constructor(code, text) {
    super(text);
    this.code = code;
  }
}

export class Kinematics {
  /** Creates the kinematics from a compiled module and a mechanism's numbers, as pkm writes them. Without `seesTool`, poses
   * are those of the platform, and tool vectors are ignored. */
  static async of(module, described, seesTool) {
    const { exports } = await WebAssembly.instantiate(module, {});
    const machine = new Kinematics(exports, seesTool);
    machine.numbers().set(described);
    if (exports.take_machine(described.length) !== 1) throw new Error("the machine data of this page are not readable");
    return machine;
  }

  constructor(exports, seesTool) {
    this.exports = exports;
    this.seesTool = seesTool;
    this.joints = exports.most_joints();
    this.legs = exports.most_legs();
    this.marginLength = exports.margin_length();
    // The count follows joints and ratios, ends of legs, the rotation, three points, the full pose, and the conditioning.
    this.countPlace = 2 * this.joints + 6 * this.legs + 9 + 9 + 6 + 1;
  }

  /** Returns the block for input and output of the kinematics. It stays valid because their memory never grows. */
  numbers() {
    this.block ??= new Float64Array(this.exports.memory.buffer, this.exports.numbers(), this.exports.capacity());
    return this.block;
  }

  /** Computes a pose with a tool vector; returns the code of a refusal, or 0. */
  asked(pose, tool) {
    const numbers = this.numbers();
    numbers.set(pose);
    numbers.set(this.seesTool ? tool : [0, 0, 0], pose.length);
    return this.exports.draw();
  }

  /** Returns all results at a pose with a tool vector; throws a Refusal if the pose is refused. */
  at(pose, tool) {
    const code = this.asked(pose, tool);
    if (code !== 0) throw new Refusal(code, this.message());
    return this.answer(this.numbers());
  }

  /** Returns the least share of a limit's range left at a pose, NaN if the pose is refused. `isLeftOut` gets the kind and
   * number of a part, and returns whether to skip it. */
  least(pose, tool, isLeftOut) {
    if (this.asked(pose, tool) !== 0) return NaN;
    const numbers = this.numbers();
    const count = numbers[this.countPlace];
    let least = Infinity;
    for (let n = 0; n < count; n++) {
      const at = this.countPlace + 1 + n * this.marginLength;
      if (!isLeftOut(numbers[at + 1], numbers[at + 2])) least = Math.min(least, numbers[at + this.marginLength - 1]);
    }
    return least;
  }

  message() {
    const { message, message_length, memory } = this.exports;
    return new TextDecoder().decode(new Uint8Array(memory.buffer, message(), message_length()));
  }

  answer(numbers) {
    let place = 0;
    const next = (count) => Array.from(numbers.subarray(place, (place += count)));
    const joints = next(this.joints);
    const ratios = next(this.joints);
    const legs = Array.from({ length: this.legs }, () => ({ lower: next(3), upper: next(3) }));
    const rotation = [next(3), next(3), next(3)];
    const [nose, tip, table] = [next(3), next(3), next(3)];
    const full = next(6);
    const [conditioning, count] = next(2);
    const margins = Array.from({ length: count }, () => {
      const [limit, kind, first, second, value, low, high, share] = next(this.marginLength);
      return { limit, kind, first, second, value, low, high, share };
    });
    return { joints, ratios, legs, rotation, nose, tip, table, full, conditioning, margins };
  }
}

/** Returns the key of a margin: its limit and part, unique in its mechanism. */
export function key({ limit, kind, first, second }) {
  return `${limit} ${kind} ${first} ${second}`;
}

/** Returns all results of a mechanism at a place, with the margins of its extra axes; throws a Refusal if the pose is refused. */
export function answer({ kinematics, scene, limits }, { pose, tool, extra }) {
  const drawn = kinematics.at(pose, tool);
  const slides = scene.extra_axes.map(({ letter, min, max }) => {
    const [name] = Object.entries(limits).find(([, { part, limit }]) => part === `axis ${letter}` && limit === "joint range");
    const [limit, kind, first, second] = name.split(" ").map(Number);
    const value = extra[letter];
    return { limit, kind, first, second, value, low: min, high: max, share: Math.min(value - min, max - value) / (max - min) };
  });
  return { ...drawn, margins: [...drawn.margins, ...slides] };
}

/** Returns the margin with the least share of its range left. */
export function least(margins) {
  return margins.reduce((worst, margin) => (worst && worst.share <= margin.share ? worst : margin), undefined);
}
