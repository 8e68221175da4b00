// SPDX-License-Identifier: GPL-2.0-or-later
// Unpacking of the data that pkm packs into the page.

export function bytes(base64) {
  const text = atob(base64);
  const all = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) all[i] = text.charCodeAt(i);
  return all;
}

/** Returns the bytes of a packed part of the page, by its id. */
export async function unpacked(id) {
  const gzip = new Blob([bytes(document.getElementById(id).textContent)]);
  const stream = gzip.stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Decodes an array of 64-bit numbers. */
export function numbers(base64) {
  return new Float64Array(bytes(base64).buffer);
}

/** Decodes equally long columns of numbers: Float64Array for program points, Float32Array for curves. */
export function columns({ rows, columns: count, bytes: base64 }, Kind = Float64Array) {
  const all = new Kind(bytes(base64).buffer);
  return Array.from({ length: count }, (_, k) => all.subarray(k * rows, (k + 1) * rows));
}
