// SPDX-License-Identifier: GPL-2.0-or-later
//! One move of a program along a curve, and what it has to keep.

use crate::curve::file::{Moves, Tolerance};
use crate::curve::whole::{Curve, CurveError};

/// Decimals of a word.
pub(super) const DECIMALS: usize = 6;
/// What rounding to them does to a place, mm: half a unit in each of three words.
pub(super) const ROUNDING: f64 = 1e-6;
/// Largest change of the programmed speed within a piece, as a share.
const SPEED_CHANGE: f64 = 0.02;

/// What must be kept.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Distance of the programmed path from the curve, mm.
    pub chord: f64,
    /// Error of an angle, degrees.
    pub angle: f64,
    /// Whether arcs may take the place of lines.
    pub moves: Moves,
}

impl Wanted {
    /// What is left of tolerances when words are rounded.
    ///
    /// # Errors
    /// Nothing is left.
    pub fn new(tolerance: &Tolerance, moves: Moves) -> Result<Self, CurveError> {
        let left = |key: &str, value: f64| match value > 2.0 * ROUNDING {
            true => Ok(value - ROUNDING),
            false => Err(CurveError::Keys(format!(
                "[tolerance] {key}: {value} is less than words of {DECIMALS} decimals can keep, {}",
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
    /// The part of the curve.
    pub part: usize,
    /// First and last parameter.
    pub range: [f64; 2],
    /// The arc, if it is none of lines.
    pub arc: Option<Arc>,
    /// How far it may be from the curve, mm: proved.
    pub deviation: f64,
}

/// An arc from the end of the move before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// 0 to 2: G17, G18, G19.
    pub plane: usize,
    /// Centre in the two axes of the plane, mm.
    pub centre: [f64; 2],
    /// Counterclockwise, G3.
    pub is_left: bool,
    /// How long it is, mm.
    pub length: f64,
}

/// How much the programmed speed changes over a range, as a share of what one piece may hold.
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
