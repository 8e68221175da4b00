// SPDX-License-Identifier: GPL-2.0-or-later
// Asks built kinematics: ask.mjs FILE.wasm QUESTIONS ANSWERS. The questions are 64-bit numbers: for each machine how many numbers
// describe it, these, how many poses, and nine numbers for each pose. The answers are a code and the block of numbers each.
import { createWriteStream, readFileSync } from "node:fs";

const [wasm, asked] = process.argv.slice(2, 4).map((file) => readFileSync(file));
const { instance: { exports } } = await WebAssembly.instantiate(wasm, {});
const block = new Float64Array(exports.memory.buffer, exports.numbers(), exports.capacity());
const given = new Float64Array(new Uint8Array(asked).buffer);
const answers = createWriteStream(process.argv[4]);
let place = 0;
const next = (count) => given.subarray(place, (place += count));
while (place < given.length) {
  const described = next(next(1)[0]);
  block.set(described);
  if (exports.take_machine(described.length) !== 1) throw new Error("a machine is not taken");
  for (let left = next(1)[0]; left > 0; left--) {
    block.set(next(9));
    answers.write(Buffer.from(Float64Array.of(exports.draw(), ...block).buffer));
  }
}
answers.end();
