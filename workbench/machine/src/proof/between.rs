// SPDX-License-Identifier: GPL-2.0-or-later
//! How near two mechanisms come on straight ways that both run through at the same time.
//!
//! As for two legs of one machine ([`crate::proof::spans`]): with w the unit vector from the nearest
//! point of one line to that of the other in the middle, their distance is at least w · (a − b) for the
//! ends a and b that make it least. Both move with the same share of their ways, so that slopes are
//! taken together. A platform is the lines between every two of its anchors, as the core has it.

use crate::proof::bounds::SecondDerivatives;
use crate::proof::reach::{LegMiddle, ROUNDING, Reach, Spread};
use kinematics::{Body, Fault, Segment, Vector3};

/// What is known of the distance of two mechanisms on a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// In the middle.
    pub distance: f64,
    /// Nowhere less than this; minus infinity where nothing is known.
    pub least: f64,
    /// The nearest parts in the middle.
    pub bodies: [Body; 2],
}

/// An end of a line on a way run through in unit time.
#[derive(Clone, Copy)]
struct End {
    point: Vector3<f64>,
    /// How far it goes to the end of the way, to first order.
    step: Vector3<f64>,
    /// Bound of its second derivative.
    second: f64,
    /// It moves no farther than this.
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

    /// No point of it moves farther than its ends.
    fn farthest(&self) -> f64 {
        self.ends[0].farthest.max(self.ends[1].farthest)
    }
}

impl Reach<'_> {
    /// Lines of the legs and of the platform about a pose, and whether anything is known of how they
    /// bend on the way from `middle - step` to `middle + step`.
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

/// The distance of two mechanisms on the ways from `middle - step` to `middle + step`. Bounds that are
/// `enough` are not made any better.
///
/// # Errors
/// A pose in the middle has no joint values.
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
                // Lines that cross have no direction between them, and only the coarse bound.
                false => coarse.max(least_gap(mine, theirs, &(gap / distance)) - rounding),
            };
            // What is not a number proves nothing.
            found.least = if least.is_nan() { f64::NEG_INFINITY } else { found.least.min(least) };
        }
    }
    Ok(found)
}

/// Least distance of two lines along a direction.
fn least_gap(mine: &Line, theirs: &Line, w: &Vector3<f64>) -> f64 {
    let apart = |a: &End, b: &End| {
        w.dot(&(a.point - b.point)) - w.dot(&(a.step - b.step)).abs() - (a.second + b.second) / 2.0
    };
    let all = mine.ends.iter().flat_map(|a| theirs.ends.iter().map(move |b| apart(a, b)));
    all.fold(f64::INFINITY, |least, own| if own >= least { least } else { own })
}
