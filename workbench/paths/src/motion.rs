// SPDX-License-Identifier: GPL-2.0-or-later
//! Positions and rates at the ends of the pieces of a curve, and the duration of each piece.

use crate::piece::Piece;
use crate::whole::{Curve, CurveError, Here};

/// Below this share of the curve's length per range of the parameter the tip counts as at rest.
const STANDS: f64 = 1e-9;

/// A point of the curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The curve's parameter.
    pub t: f64,
    /// Arc length so far, mm: in x and y for families.
    pub s: f64,
    /// x y z in mm, a b c in degrees, in work coordinates.
    pub pose: [f64; 6],
    /// Unit vector of the tip's motion; `None` at a cusp and where the tip is at rest.
    pub tangent: Option<[f64; 3]>,
    /// Rate of the pose, mm/s and degrees/s, at the programmed speed; `None` without a speed, and at
    /// a cusp.
    pub rate: Option<[f64; 6]>,
}

/// Programmed speed of rotations with the tip at rest.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Angular speed where the tip is at rest, degrees/s.
    pub turn: Option<f64>,
}

/// Returns the start and end points of all pieces.
///
/// # Errors
/// See [`CurveError`].
pub fn nodes(curve: &Curve, pieces: &[Piece], pace: &Pace) -> Result<Vec<[Node; 2]>, CurveError> {
    let pair = |piece: &Piece| {
        let (part, at) = piece.from.unwrap_or((piece.part, piece.range[0]));
        Ok([node(curve, part, at, pace)?, node(curve, piece.part, piece.range[1], pace)?])
    };
    pieces.iter().map(pair).collect()
}

/// Computes one point.
///
/// # Errors
/// See [`CurveError`].
pub fn node(curve: &Curve, part: usize, at: f64, pace: &Pace) -> Result<Node, CurveError> {
    let here = curve.at(part, at)?;
    let slope = here.pose.map(|x| x.first().middle());
    let speed = norm(&slope[..3]);
    let [from, to] = curve.parts[part].range;
    let moves = speed * (to - from) > STANDS * (curve.length + 1.0);
    let by_time = match (moves, curve.speed(part, at)?, pace.turn) {
        (true, Some(wanted), _) => Some(wanted / speed),
        (false, _, Some(turn)) if norm(&slope[3..]) > 0.0 => Some(turn / norm(&slope[3..])),
        _ => None,
    };
    Ok(Node {
        t: here.t.value.middle(),
        s: curve.length_at(part, at)?,
        pose: values(&here),
        tangent: moves.then(|| [slope[0], slope[1], slope[2]].map(|x| x / speed)),
        rate: by_time.map(|by_time| slope.map(|x| x * by_time)),
    })
}

fn values(here: &Here) -> [f64; 6] {
    here.pose.map(|x| x.value.middle())
}

fn norm(of: &[f64]) -> f64 {
    of.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns the length of a piece as in LinuxCNC: of the tip in mm (true), or in degrees if the tip is at rest.
pub(super) fn length(piece: &Piece, [from, to]: &[Node; 2]) -> (f64, bool) {
    let change: [f64; 6] = std::array::from_fn(|k| to.pose[k] - from.pose[k]);
    let straight = norm(&change[..3]);
    match (&piece.arc, straight > 0.0) {
        (Some(arc), _) => (arc.length, true),
        (None, true) => (straight, true),
        (None, false) => (norm(&change[3..]), false),
    }
}

/// Returns the length by which the tip's path over a piece is longer than the arc length, mm: the arc length of a plane
/// curve does not count its height.
///
/// # Errors
/// See [`CurveError`].
pub(super) fn rise(curve: &Curve, piece: &Piece) -> Result<f64, CurveError> {
    let dimensions = curve.parts[piece.part].dimensions();
    let excess = |at: f64| -> Result<f64, CurveError> {
        let slope = curve.at(piece.part, at)?.pose.map(|x| x.first().middle());
        Ok(norm(&slope[..3]) - norm(&slope[..dimensions]))
    };
    // Gauss-Legendre with two points: the slope may be infinite at the ends of the range.
    let [from, to] = piece.range;
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let far = half / 3.0_f64.sqrt();
    Ok(half * (excess(middle - far)? + excess(middle + far)?))
}

/// Returns the duration of a piece, s.
///
/// # Errors
/// No law gives the speed.
pub fn seconds(
    curve: &Curve,
    piece: &Piece,
    ends: &[Node; 2],
    pace: &Pace,
) -> Result<f64, CurveError> {
    let (length, moves) = length(piece, ends);
    let missing = |key: &str| {
        let t = ends[0].t;
        CurveError::Keys(format!("[laws] {key}: missing, needed at t = {t}"))
    };
    if !moves {
        return pace.turn.map(|turn| length / turn).ok_or_else(|| missing("turn_deg_per_s"));
    }
    let [from, to] = piece.range;
    let slowness = |at: f64| -> Result<f64, CurveError> {
        let speed = curve.speed(piece.part, at)?;
        speed.map(|speed| 1.0 / speed).ok_or_else(|| missing("speed_mm_per_s"))
    };
    // Simpson's rule for the time per length.
    let mean = (slowness(from)? + 4.0 * slowness(0.5 * (from + to))? + slowness(to)?) / 6.0;
    Ok(length * mean)
}
