// SPDX-License-Identifier: GPL-2.0-or-later
// The kinematics of a mechanism: pkmkins' own, built for the browser.

/** A pose that is refused, with its reason and the way out. */
export class Refusal extends Error {
  constructor(code, text) {
    super(text);
    this.code = code;
  }
}

export class Kinematics {
  /** Of a compiled module and the numbers of a mechanism, as pkm has written them; of one that does not see the tool poses
   * are the platform's own. */
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
    // Behind joints and ratios, ends of legs, rotation, three places, and the conditioning.
    this.countPlace = 2 * this.joints + 6 * this.legs + 9 + 9 + 1;
  }

  /** The block of numbers that the kinematics take and give; their memory never grows. */
  numbers() {
    this.block ??= new Float64Array(this.exports.memory.buffer, this.exports.numbers(), this.exports.capacity());
    return this.block;
  }

  /** Asks about a pose with a tool vector: the code of a refusal, or 0. */
  asked(pose, tool) {
    const numbers = this.numbers();
    numbers.set(pose);
    numbers.set(this.seesTool ? tool : [0, 0, 0], pose.length);
    return this.exports.draw();
  }

  /** Everything about a pose with a tool vector, or a Refusal. */
  at(pose, tool) {
    const code = this.asked(pose, tool);
    if (code !== 0) throw new Refusal(code, this.message());
    return this.answer(this.numbers());
  }

  /** The least share of the range that limits leave at a pose, NaN where it is refused; `isLeftOut` gets kind of part and
   * its number. */
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
    const [conditioning, count] = next(2);
    const margins = Array.from({ length: count }, () => {
      const [limit, kind, first, second, value, low, high, share] = next(this.marginLength);
      return { limit, kind, first, second, value, low, high, share };
    });
    return { joints, ratios, legs, rotation, nose, tip, table, conditioning, margins };
  }
}

/** Name of a margin's limit and part among those of its mechanism. */
export function key({ limit, kind, first, second }) {
  return `${limit} ${kind} ${first} ${second}`;
}

/** The margin with the least share of its range left. */
export function least(margins) {
  return margins.reduce((worst, margin) => (worst && worst.share <= margin.share ? worst : margin), undefined);
}
