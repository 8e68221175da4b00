// SPDX-License-Identifier: GPL-2.0-or-later
//! One move of a program along a curve, and its tolerances.

use crate::file::{Moves, Tolerance};
use crate::planes::PLANES;
use crate::whole::{Curve, CurveError};
use std::f64::consts::PI;

pub(super) const DECIMALS: usize = 6;
/// Rounding error of a position with these decimals, mm: half a unit in each of three words.
pub(super) const ROUNDING: f64 = 1e-6;
/// Largest distance of an arc from the moves that represent it when limits are checked, mm.
const ARC_ERROR: f64 = 1e-3;
/// Largest change of the programmed speed within a piece, as a share.
const SPEED_CHANGE: f64 = 0.02;

/// Tolerances of a program.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Distance of the programmed path from the curve, mm.
    pub chord: f64,
    /// Error of an angle, degrees.
    pub angle: f64,
    /// Whether arcs may replace lines.
    pub moves: Moves,
}

impl Wanted {
    /// Subtracts the rounding of words from the tolerances.
    ///
    /// # Errors
    /// A tolerance is smaller than the rounding.
    pub fn new(tolerance: &Tolerance, moves: Moves) -> Result<Self, CurveError> {
        let left = |key: &str, value: f64| match value > 2.0 * ROUNDING {
            true => Ok(value - ROUNDING),
            false => Err(CurveError::Keys(format!(
                "[tolerance] {key}: {value} is finer than words with {DECIMALS} decimals allow, {}",
                2.0 * ROUNDING
            ))),
        };
        Ok(Self {
            chord: left("chord_mm", tolerance.chord_mm.0)?,
            angle: left("angle_deg", tolerance.angle_deg.0)?,
            moves,
        })
    }
}

/// One move.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    pub part: usize,
    /// First and last parameter.
    pub range: [f64; 2],
    /// Part and parameter of the start, if the line begins in an earlier part.
    pub from: Option<(usize, f64)>,
    /// The arc; `None` for a line.
    pub arc: Option<Arc>,
    /// Proved bound of the distance from the curve, mm.
    pub deviation: f64,
}

/// An arc from the end of the previous move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// 0 to 2: G17, G18, G19.
    pub plane: usize,
    /// Center in the two axes of the plane, mm.
    pub centre: [f64; 2],
    /// Whether it is counterclockwise, G3.
    pub is_left: bool,
    /// Length, mm.
    pub length: f64,
}

impl Arc {
    /// Returns moves that represent the arc when limits are checked, the last one to its end.
    pub(super) fn places(&self, from: &[f64; 6], to: &[f64; 6], turns: u32) -> Vec<[f64; 6]> {
        let [first, second, across] = PLANES[self.plane];
        let angle =
            |pose: &[f64; 6]| (pose[second] - self.centre[1]).atan2(pose[first] - self.centre[0]);
        let radius = (from[first] - self.centre[0]).hypot(from[second] - self.centre[1]);
        let start = angle(from);
        let side = if self.is_left { 1.0 } else { -1.0 };
        let turn = ((angle(to) - start) * side).rem_euclid(2.0 * PI);
        // The end of a whole turn equals its start up to the last decimal.
        let is_whole = turns > 0 && !(1e-3..2.0 * PI - 1e-3).contains(&turn);
        let turn = if is_whole { 0.0 } else { turn } + 2.0 * PI * f64::from(turns);
        let turn = side * turn;
        let step = (8.0 * ARC_ERROR / radius.max(ARC_ERROR)).sqrt();
        let count = (turn.abs() / step).ceil().max(1.0);
        // Points at every quarter of a whole turn.
        let quarters = 4.0 * f64::from(turns);
        let count = if is_whole { (count / quarters).ceil() * quarters } else { count };
        let place = |n: f64| {
            let share = n / count;
            let mut pose: [f64; 6] = std::array::from_fn(|k| from[k] + (to[k] - from[k]) * share);
            let (sin, cos) = (start + turn * share).sin_cos();
            pose[first] = self.centre[0] + radius * cos;
            pose[second] = self.centre[1] + radius * sin;
            pose[across] = from[across] + (to[across] - from[across]) * share;
            pose
        };
        let mut places: Vec<[f64; 6]> = (1..count as usize).map(|n| place(n as f64)).collect();
        places.push(*to);
        places
    }
}

/// Returns the change of the programmed speed over a range, as a share of the largest change within a piece.
pub(super) fn speed_change(
    curve: &Curve,
    part: usize,
    [from, to]: [f64; 2],
) -> Result<f64, CurveError> {
    if curve.laws.speed.as_ref().is_none_or(|law| !law.is_variable()) {
        return Ok(0.0);
    }
    let at = |at| curve.speed(part, at).map(|speed| speed.unwrap_or(1.0));
    let [a, b, c] = [at(from)?, at(0.5 * (from + to))?, at(to)?];
    Ok((a.max(b).max(c) - a.min(b).min(c)) / b / SPEED_CHANGE)
}
