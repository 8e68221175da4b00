// SPDX-License-Identifier: GPL-2.0-or-later
// Colors that are distinguishable for color-blind users, after Okabe and Ito.
import { Color } from "three";

export const COLORS = {
  background: 0xf4f6f8,
  base: 0x6b7785,
  guide: 0x9aa5b1,
  barrel: 0x56789a,
  rod: 0xc3ccd6,
  arm: 0x8a6d9e,
  passive: 0xb58f5a,
  joint: 0x30363d,
  platform: 0x0072b2,
  spindle: 0x4a5561,
  tool: 0x009e73,
  table: 0xb9c2cc,
  workspace: 0x56b4e9,
  limits: 0x3d4650,
  near: 0xe69f00,
  broken: 0xd55e00,
};

/** A limit is near if less than this share of its range is left. */
export const NEAR = 0.1;

/** Colors of curves, in order. */
export const CURVES = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c6d31", "#7f7f7f", "#b8860b", "#444499"];

const STOPS = [
  [-1e-9, new Color(COLORS.broken)],
  [0, new Color(COLORS.near)],
  [NEAR, new Color(0xf0e442)],
  [0.3, new Color(0x56b4e9)],
  [0.5, new Color(0x0072b2)],
];

/** Returns the color for the share of range left: blue far from limits, yellow near one, orange at it, vermilion beyond. */
export function ofShare(share) {
  const above = STOPS.findIndex(([at]) => share <= at);
  if (above === 0) return STOPS[0][1].clone();
  if (above < 0) return STOPS.at(-1)[1].clone();
  const [[from, a], [to, b]] = [STOPS[above - 1], STOPS[above]];
  return a.clone().lerp(b, (share - from) / (to - from));
}

/** Returns the color of a part that has `share` of its range left and the usual color `own`. */
export function ofPart(share, own) {
  if (share < 0) return COLORS.broken;
  return share < NEAR ? COLORS.near : own;
}
