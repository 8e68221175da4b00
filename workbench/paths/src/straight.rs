// SPDX-License-Identifier: GPL-2.0-or-later
//! Joins lines along straight stretches of a curve that families define.
//!
//! Such a curve is enclosed more widely than it bends, so its proved pieces are shorter than its shape requires. Over a
//! piece the curve is as near to the chord as proved, and no point of that chord is farther from a longer chord than
//! the farther one of its ends, because the distance from a segment is convex.

use crate::base::Form;
use crate::motion::Node;
use crate::piece::{Piece, ROUNDING, Wanted};
use crate::pieces::deviation;
use crate::whole::{Curve, CurveError};
use nalgebra::Vector3;

/// Subranges of a piece in which its deviation is proved again: a bound that is all overestimate falls by their cube.
const PARTS: usize = 4;
/// Largest number of pieces in a line, which limits the time of the search.
const MOST: usize = 1000;
/// Share of the tolerance within which points count as straight. The chords of a bent curve that use the whole
/// tolerance differ by all of it.
const STRAIGHT: f64 = 0.25;

/// Joins lines, given with their ends, where one line is proved to be near enough to the curve. Lines along which tilt or
/// speed change stay as they are.
///
/// # Errors
/// See [`CurveError`].
pub(super) fn joined(
    curve: &Curve,
    pieces: &[Piece],
    ends: &[[Node; 2]],
    wanted: &Wanted,
) -> Result<Vec<Piece>, CurveError> {
    let mut all = vec![];
    let mut first = 0;
    while first < pieces.len() {
        let count = match curve.laws.is_fixed() {
            true => straight(curve, &pieces[first..], &ends[first..], wanted.chord),
            false => 1,
        };
        let (piece, count) = longest(curve, &pieces[first..first + count], &ends[first..], wanted)?;
        all.push(piece);
        first += count;
    }
    Ok(all)
}

fn place(node: &Node) -> Vector3<f64> {
    Vector3::new(node.pose[0], node.pose[1], node.pose[2])
}

/// A straight line from start to end.
struct Segment {
    from: Vector3<f64>,
    to: Vector3<f64>,
}

impl Segment {
    fn distance(&self, point: &Vector3<f64>) -> f64 {
        let along = self.to - self.from;
        let share = (point - self.from).dot(&along) / along.norm_squared();
        (self.from + along * share.clamp(0.0, 1.0) - point).norm()
    }

    /// Returns the largest distance of the ends of lines, which must follow each other along the segment; infinite if
    /// they do not.
    fn farthest(&self, ends: &[[Node; 2]]) -> f64 {
        let along = self.to - self.from;
        let reach = |[start, end]: &[Node; 2]| {
            let (start, end) = (place(start), place(end));
            match (end - start).dot(&along) > 0.0 {
                true => self.distance(&start).max(self.distance(&end)),
                false => f64::INFINITY,
            }
        };
        ends.iter().map(reach).fold(0.0, f64::max)
    }

    fn over(ends: &[[Node; 2]]) -> Self {
        Self { from: place(&ends[0][0]), to: place(&ends[ends.len() - 1][1]) }
    }
}

/// Returns the number of lines from the first one that seem to be straight.
fn straight(curve: &Curve, pieces: &[Piece], ends: &[[Node; 2]], chord: f64) -> usize {
    let is_line = |piece: &Piece| {
        piece.arc.is_none() && matches!(curve.parts[piece.part].form, Form::Implicit(..))
    };
    let most = pieces.iter().take(MOST).take_while(|piece| is_line(piece)).count();
    let seems = |count: &usize| {
        let ends = &ends[..*count];
        Segment::over(ends).farthest(ends) <= STRAIGHT * chord
    };
    (2..=most).take_while(seems).last().unwrap_or(1)
}

/// Joins as many lines as are proved to be near enough to the curve; returns their number too.
fn longest(
    curve: &Curve,
    pieces: &[Piece],
    ends: &[[Node; 2]],
    wanted: &Wanted,
) -> Result<(Piece, usize), CurveError> {
    let bounds = match pieces.len() {
        1 => vec![],
        _ => {
            pieces.iter().map(|piece| bound(curve, piece, wanted)).collect::<Result<Vec<_>, _>>()?
        }
    };
    for count in (2..=pieces.len()).rev() {
        let whole = Segment::over(&ends[..count]);
        let of =
            |(bound, ends): (&f64, &[Node; 2])| bound + whole.farthest(std::slice::from_ref(ends));
        let most = bounds[..count].iter().zip(ends).map(of).fold(0.0, f64::max);
        if most <= wanted.chord {
            let (first, last) = (&pieces[0], &pieces[count - 1]);
            let from = Some((first.part, first.range[0]));
            return Ok((Piece { from, deviation: most + ROUNDING, ..last.clone() }, count));
        }
    }
    Ok((pieces[0].clone(), 1))
}

/// Returns a bound of the distance between a piece and the curve, from enclosures over parts of it.
fn bound(curve: &Curve, piece: &Piece, wanted: &Wanted) -> Result<f64, CurveError> {
    let [from, to] = piece.range;
    let at = |k: usize| if k == PARTS { to } else { from + (to - from) * k as f64 / PARTS as f64 };
    let mut points = vec![];
    for k in 0..=PARTS {
        let pose = curve.at(piece.part, at(k))?.pose.map(|x| x.value.middle());
        points.push(Vector3::new(pose[0], pose[1], pose[2]));
    }
    let chord = Segment { from: points[0], to: points[PARTS] };
    let mut most = 0.0_f64;
    for k in 0..PARTS {
        let Some(own) = deviation(curve, piece.part, [at(k), at(k + 1)], wanted)? else {
            return Ok(piece.deviation);
        };
        most = most.max(own + chord.distance(&points[k]).max(chord.distance(&points[k + 1])));
    }
    Ok(most.min(piece.deviation))
}
