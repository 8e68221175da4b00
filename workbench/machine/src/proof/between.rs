// SPDX-License-Identifier: GPL-2.0-or-later
//! Least distance of two mechanisms on straight paths that both traverse simultaneously.
//!
//! As for two legs of one machine ([`crate::proof::spans`]): let w be the unit vector from the nearest
//! point of one line to that of the other at the center. Then their distance is at least the minimum of w · (a − b)
//! over the ends a and b. Both have traversed the same share of their paths at any time, so their slopes are
//! combined. A platform is represented by the lines between any two of its anchors, as in the core.

use crate::proof::bounds::SecondDerivatives;
use crate::proof::reach::{LegMiddle, ROUNDING, Reach, Spread};
use kinematics::{Body, Fault, Segment, Vector3};

/// Bounds of the distance of two mechanisms on a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Distance at the center.
    pub distance: f64,
    /// Lower bound; minus infinity if unknown.
    pub least: f64,
    /// The nearest parts at the center.
    pub bodies: [Body; 2],
}

/// An end of a line on a path traversed in unit time.
#[derive(Clone, Copy)]
struct End {
    point: Vector3<f64>,
    /// First-order displacement to the end of the path.
    step: Vector3<f64>,
    /// Bound of its second derivative.
    second: f64,
    /// Bound of its displacement.
    farthest: f64,
}

/// A line of a mechanism.
struct Line {
    body: Body,
    ends: [End; 2],
}

impl Line {
    fn segment(&self) -> Segment {
        Segment { base: self.ends[0].point, platform: self.ends[1].point }
    }

    /// Bounds the displacement of all points of the line by that of its ends.
    fn farthest(&self) -> f64 {
        self.ends[0].farthest.max(self.ends[1].farthest)
    }
}

impl Reach<'_> {
    /// Returns the lines of the legs and of the platform about a pose, and whether their nonlinearity
    /// on the path from `middle - step` to `middle + step` is bounded.
    fn lines(&self, middle: &[f64; 6], step: &[f64; 6]) -> Result<(Vec<Line>, bool), Fault> {
        let mut at = self.nowhere();
        let middle = self.middle(&mut at, middle)?;
        let spread = self.spread([*step]);
        let legs = 0..self.config.legs();
        let seconds: Option<Vec<_>> =
            legs.clone().map(|i| self.second_derivatives(i, &middle, &spread)).collect();
        let of_leg = |i: usize| ends(&middle.legs[i], &spread, seconds.as_ref().map(|all| &all[i]));
        let all: Vec<[End; 2]> = legs.clone().map(of_leg).collect();
        let of_legs = legs.clone().map(|i| Line { body: Body::Leg(i), ends: all[i] });
        let edges = legs.clone().flat_map(|i| (i + 1..all.len()).map(move |j| [i, j]));
        let edges = edges.map(|[i, j]| Line { body: Body::Platform, ends: [all[i][1], all[j][1]] });
        Ok((of_legs.chain(edges).collect(), seconds.is_some()))
    }
}

fn ends(leg: &LegMiddle, spread: &Spread, seconds: Option<&SecondDerivatives>) -> [End; 2] {
    let bounds = seconds.map_or([[f64::INFINITY; 2]; 2], |seconds| {
        seconds.ends.map(|second| [second, seconds.farthest])
    });
    let along = |gradient: &dyn Fn(usize) -> Vector3<f64>| -> Vector3<f64> {
        let along = |step: &[f64; 6]| (0..6).map(|k| gradient(k) * step[k]).sum::<Vector3<f64>>();
        spread.steps.iter().map(along).sum()
    };
    let steps = [along(&|k| leg.motions[k] - leg.changes[k]), along(&|k| leg.motions[k])];
    let points = [leg.segment.base, leg.segment.platform];
    std::array::from_fn(|e| {
        let [second, farthest] = bounds[e];
        End { point: points[e], step: steps[e], second, farthest }
    })
}

/// Bounds the distance of two mechanisms on the paths from `middle - step` to `middle + step`. Bounds that are
/// `enough` are not refined.
///
/// # Errors
/// A central pose has no joint values.
pub fn approach(
    reaches: [&Reach; 2],
    middles: [&[f64; 6]; 2],
    steps: [&[f64; 6]; 2],
    enough: f64,
) -> Result<Approach, Fault> {
    let (one, one_known) = reaches[0].lines(middles[0], steps[0])?;
    let (other, other_known) = reaches[1].lines(middles[1], steps[1])?;
    let size = reaches.map(|reach| reach.config.machine.size()).into_iter().fold(0.0, f64::max);
    let rounding = ROUNDING * size;
    let mut found = Approach {
        distance: f64::INFINITY,
        least: if one_known && other_known { f64::INFINITY } else { f64::NEG_INFINITY },
        bodies: [Body::Platform; 2],
    };
    for mine in &one {
        for theirs in &other {
            let gap = mine.segment().gap(&theirs.segment());
            let distance = gap.norm();
            if !(distance >= found.distance) {
                (found.distance, found.bodies) = (distance, [mine.body, theirs.body]);
            }
            let coarse = distance - mine.farthest() - theirs.farthest() - rounding;
            let least = match coarse >= enough || distance == 0.0 {
                true => coarse,
                // Intersecting lines have no direction between them, only the coarse bound.
                false => coarse.max(least_gap(mine, theirs, &(gap / distance)) - rounding),
            };
            // NaN proves nothing.
            found.least = if least.is_nan() { f64::NEG_INFINITY } else { found.least.min(least) };
        }
    }
    Ok(found)
}

/// Bounds the least distance of two lines along a direction.
fn least_gap(mine: &Line, theirs: &Line, w: &Vector3<f64>) -> f64 {
    let apart = |a: &End, b: &End| {
        w.dot(&(a.point - b.point)) - w.dot(&(a.step - b.step)).abs() - (a.second + b.second) / 2.0
    };
    let all = mine.ends.iter().flat_map(|a| theirs.ends.iter().map(move |b| apart(a, b)));
    all.fold(f64::INFINITY, |least, own| if own >= least { least } else { own })
}
