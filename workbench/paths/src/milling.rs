// SPDX-License-Identifier: GPL-2.0-or-later
//! Milling operations of paper 003's table 2: rows, circles, pockets, spirals and helices.

use crate::pen::{Pen, Plane, Step};
use serde::Deserialize;
use std::f64::consts::{PI, TAU};
use studies::study::number::Positive;

/// Parallel rows.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rows {
    #[serde(default)]
    plane: Plane,
    /// First corner.
    start_mm: [f64; 2],
    /// Length of a row along the first axis; negative in the opposite direction.
    length_mm: f64,
    /// Width of all rows along the second axis; negative in the opposite direction.
    width_mm: f64,
    /// Largest distance between rows.
    step_mm: Positive,
    level_mm: f64,
    clear_mm: f64,
    feed_mm_per_min: Positive,
}

/// A circle.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Circle {
    #[serde(default)]
    plane: Plane,
    centre_mm: [f64; 2],
    radius_mm: Positive,
    level_mm: f64,
    clear_mm: f64,
    #[serde(default)]
    clockwise: bool,
    feed_mm_per_min: Positive,
}

/// A round pocket: a spiral, then a circle.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pocket {
    #[serde(default)]
    plane: Plane,
    centre_mm: [f64; 2],
    radius_mm: Positive,
    /// Growth of the radius per turn.
    step_mm: Positive,
    level_mm: f64,
    clear_mm: f64,
    feed_mm_per_min: Positive,
}

/// A flat spiral from its center.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spiral {
    #[serde(default)]
    plane: Plane,
    centre_mm: [f64; 2],
    /// Growth of the radius per turn.
    growth_mm: Positive,
    turns: Positive,
    level_mm: f64,
    clear_mm: f64,
    feed_mm_per_min: Positive,
}

/// A plunge along a cylindrical or conical helix.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Helix {
    #[serde(default)]
    plane: Plane,
    centre_mm: [f64; 2],
    radius_mm: Positive,
    /// Decrease of the radius per turn.
    #[serde(default)]
    shrink_mm: f64,
    /// Change of the level per turn; negative downwards.
    pitch_mm: f64,
    turns: Positive,
    level_mm: f64,
    clear_mm: f64,
    feed_mm_per_min: Positive,
}

impl Rows {
    /// Returns the number of rows, and their distance.
    fn rows(&self) -> (usize, f64) {
        let gaps = (self.width_mm.abs() / self.step_mm.0).ceil().max(1.0);
        (gaps as usize + 1, self.width_mm / gaps)
    }

    pub(super) fn there_and_back(&self) -> Vec<Step> {
        let mut pen = self.zigzag();
        pen.level(self.clear_mm);
        pen.all
    }

    fn zigzag(&self) -> Pen {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let [u, v] = self.start_mm;
        let ends = [u, u + self.length_mm];
        pen.enter(self.clear_mm, self.start_mm, self.level_mm);
        let (rows, step) = self.rows();
        for row in 0..rows {
            let side = v + step * row as f64;
            if row > 0 {
                pen.cut(ends[row % 2], side);
            }
            pen.cut(ends[1 - row % 2], side);
        }
        pen
    }

    /// Cuts all rows in one direction, retracted on the return.
    pub(super) fn one_way(&self) -> Vec<Step> {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let [u, v] = self.start_mm;
        let (rows, step) = self.rows();
        for row in 0..rows {
            let side = v + step * row as f64;
            pen.enter(self.clear_mm, [u, side], self.level_mm);
            pen.cut(u + self.length_mm, side);
        }
        pen.level(self.clear_mm);
        pen.all
    }

    /// Cuts rows in alternating directions, then the boundary.
    pub(super) fn around(&self) -> Vec<Step> {
        let mut pen = self.zigzag();
        let [u, v] = self.start_mm;
        let (end, side) = (u + self.length_mm, v + self.width_mm);
        // The zigzag ends at one of the corners on the far side.
        let last = if self.rows().0 % 2 == 1 { end } else { u };
        let other = u + end - last;
        for (u, v) in [(last, v), (other, v), (other, side), (last, side)] {
            pen.cut(u, v);
        }
        pen.level(self.clear_mm);
        pen.all
    }

    /// Returns why the operation is invalid.
    pub(super) fn refusal(&self) -> Option<String> {
        let zero = self.length_mm == 0.0 || self.width_mm == 0.0;
        zero.then(|| "length_mm and width_mm: expected nonzero numbers".into())
    }
}

impl Circle {
    pub(super) fn moves(&self) -> Vec<Step> {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let [u, v] = self.centre_mm;
        let start = [u + self.radius_mm.0, v];
        pen.enter(self.clear_mm, start, self.level_mm);
        pen.turn([start[0], v, self.level_mm], self.centre_mm, !self.clockwise, 1);
        pen.level(self.clear_mm);
        pen.all
    }
}

/// Cuts a spiral r = k φ up to a radius.
fn spiral(pen: &mut Pen, [u, v]: [f64; 2], level: f64, growth: f64, angle: f64, chord: f64) {
    let k = growth / TAU;
    // |r″| = k √(φ² + 4).
    pen.along(angle, k * angle.hypot(2.0), chord, |at| {
        [u + k * at * at.cos(), v + k * at * at.sin(), level]
    });
}

impl Pocket {
    pub(super) fn moves(&self, chord: f64) -> Vec<Step> {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let (centre, radius) = (self.centre_mm, self.radius_mm.0);
        pen.enter(self.clear_mm, centre, self.level_mm);
        let angle = TAU * radius / self.step_mm.0;
        spiral(&mut pen, centre, self.level_mm, self.step_mm.0, angle, chord);
        // Two halves: the end of the spiral is accurate only to rounding, which is not enough for a whole turn.
        for half in [angle + PI, angle + TAU] {
            let end = [centre[0] + radius * half.cos(), centre[1] + radius * half.sin()];
            pen.turn([end[0], end[1], self.level_mm], centre, true, 0);
        }
        pen.level(self.clear_mm);
        pen.all
    }
}

impl Spiral {
    pub(super) fn moves(&self, chord: f64) -> Vec<Step> {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        pen.enter(self.clear_mm, self.centre_mm, self.level_mm);
        let angle = TAU * self.turns.0;
        spiral(&mut pen, self.centre_mm, self.level_mm, self.growth_mm.0, angle, chord);
        pen.level(self.clear_mm);
        pen.all
    }
}

impl Helix {
    pub(super) fn moves(&self, chord: f64) -> Vec<Step> {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let ([u, v], radius) = (self.centre_mm, self.radius_mm.0);
        pen.enter(self.clear_mm, [u + radius, v], self.level_mm);
        let angle = TAU * self.turns.0;
        let (shrink, pitch) = (self.shrink_mm / TAU, self.pitch_mm / TAU);
        if self.shrink_mm == 0.0 && self.turns.0.fract() == 0.0 {
            let end = self.level_mm + self.pitch_mm * self.turns.0;
            pen.turn([u + radius, v, end], self.centre_mm, true, self.turns.0 as u32);
        } else {
            // |r″|² = r² + (2 κ)², and r is largest at one of the ends.
            let widest = radius.max((radius - shrink * angle).abs());
            pen.along(angle, widest.hypot(2.0 * shrink), chord, |at| {
                let r = radius - shrink * at;
                [u + r * at.cos(), v + r * at.sin(), self.level_mm + pitch * at]
            });
        }
        pen.cut(u, v);
        pen.level(self.clear_mm);
        pen.all
    }

    /// Returns why the operation is invalid.
    pub(super) fn refusal(&self) -> Option<String> {
        let is_gone = self.shrink_mm * self.turns.0 > self.radius_mm.0;
        is_gone.then(|| "shrink_mm: too large, the radius would become negative".into())
    }
}
