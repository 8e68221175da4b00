// SPDX-License-Identifier: GPL-2.0-or-later
//! The values of limits over a cell, between bounds.
//!
//! **Distance of legs**: with w the unit vector from the nearest point of one leg to that of the
//! other in the middle, their distance is at least w · (a − b) for the ends a of one and b of the
//! other that make it least, wherever the legs are. Each of these four values has a slope, and
//! its second derivative is bounded by those of the ends.
//!
//! **Tilt, pyramids**: cosines of angles between a leg, or the tool axis, and vectors that stand
//! still in base or platform, as those of the cones.

use crate::proof::bounds::SecondDerivatives;
use crate::proof::reach::{LegMiddle, Middle, RADIANS, ROUNDING, Reach, Spread};
use kinematics::{Limit, Margin, Part, Vector3};
use std::ops::ControlFlow;

/// A value over a cell, or on a way run through in two units of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// In the middle.
    pub middle: f64,
    /// How far it changes from there to the end, to first order: never negative.
    pub slope: f64,
    /// Bound of its second derivative on every straight way from the middle to an end, run
    /// through in one unit of time; infinite where none is known.
    pub second_derivative: f64,
    /// Rounding.
    pub rounding: f64,
}

impl Course {
    /// All its values lie between these.
    pub fn range(&self) -> (f64, f64) {
        let room = self.slope + self.second_derivative / 2.0 + self.rounding;
        (self.middle - room, self.middle + room)
    }
}

/// The value of a limit over a cell, or on a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// In the middle.
    pub margin: Margin,
    /// Nowhere less and more than these; infinite where nothing is known. Distances of legs that are
    /// nowhere the nearest ones have a lower bound than need be.
    pub ends: [f64; 2],
}

impl Span {
    pub(super) fn of(
        limit: Limit,
        part: Part,
        value: f64,
        ends: [f64; 2],
        range: [f64; 2],
    ) -> Self {
        Self { margin: Margin { limit, part, value, range }, ends }
    }

    /// The value keeps at least this distance from the ends of its range everywhere, negative
    /// beyond them; minus infinity where nothing is known.
    pub fn room(&self) -> f64 {
        let [low, high] = self.margin.range;
        let room = (self.ends[0] - low).min(high - self.ends[1]);
        // What is not a number proves nothing.
        if room.is_nan() { f64::NEG_INFINITY } else { room }
    }
}

/// A leg over a cell, as vectors that stand still in base or platform see it.
struct Lean<'a> {
    i: usize,
    middle: &'a Middle<'a>,
    spread: &'a Spread,
    second_derivative: Option<&'a SecondDerivatives>,
}

impl Lean<'_> {
    /// Product of the leg's direction and a unit vector of base or platform.
    fn course(&self, is_platform: bool, vector: &Vector3<f64>) -> Course {
        let LegMiddle { n, length, changes, .. } = &self.middle.legs[self.i];
        let vector = if is_platform { self.middle.rotation * vector } else { *vector };
        let cosine = n.dot(&vector);
        let across = vector - n * cosine;
        let gradient = std::array::from_fn(|k| {
            let turned = match is_platform && k >= 3 {
                true => n.dot(&self.middle.axes[k - 3].cross(&vector)),
                false => 0.0,
            };
            across.dot(&changes[k]) / length + turned
        });
        // cos = n · d; in the platform d turns, too.
        let turn = if is_platform { self.spread.turn } else { 0.0 };
        let bound = |second_derivative: &SecondDerivatives| {
            let [first, second] = second_derivative.direction;
            second + 2.0 * first * turn + turn * turn
        };
        Course {
            middle: cosine,
            slope: self.spread.slope(&gradient),
            second_derivative: self.second_derivative.map_or(f64::INFINITY, bound),
            rounding: ROUNDING,
        }
    }
}

impl Reach<'_> {
    /// Visits all limits that are set, of the pose alone but for its axes and the conditioning.
    /// Bounds of distances that are `enough` are not made any better.
    pub(super) fn spans<B>(
        &self,
        middle: &Middle,
        spread: &Spread,
        seconds: Option<&[SecondDerivatives]>,
        enough: f64,
        mut visit: impl FnMut(Span) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for i in 0..self.config.joints.len() {
            let course = self.joint_course(i, middle, spread, seconds);
            let (low, high) = course.range();
            let range = [self.limits.min[i], self.limits.max[i]];
            let [value, low, high] = match self.is_coordinate(i, spread) {
                true => [course.middle, low, high].map(|value| at_limit(value, range, low, high)),
                false => [course.middle, low, high],
            };
            visit(Span::of(Limit::JointRange, Part::Joint(i), value, [low, high], range))?;
        }
        for i in 0..self.config.legs() {
            let lean =
                Lean { i, middle, spread, second_derivative: seconds.map(|seconds| &seconds[i]) };
            self.cones(&lean, &mut visit)?;
            self.pyramids(&lean, &mut visit)?;
        }
        if self.limits.tilt != 0.0 {
            let course = tilt(middle, spread);
            let ends = [f64::NEG_INFINITY, degrees_of_cosine(course.range().0)];
            let value = middle.at.tilt();
            let range = [f64::NEG_INFINITY, self.limits.tilt];
            visit(Span::of(Limit::Tilt, Part::Whole, value, ends, range))?;
        }
        self.gaps(middle, spread, seconds, enough, &mut visit)
    }

    fn cones<B>(
        &self,
        lean: &Lean,
        visit: &mut impl FnMut(Span) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for (limit, most) in [
            (Limit::BaseCone, self.limits.base_cone[lean.i]),
            (Limit::PlatformCone, self.limits.platform_cone[lean.i]),
        ] {
            if most == 0.0 {
                continue;
            }
            let course = lean.course(limit == Limit::PlatformCone, &self.home[lean.i]);
            let ends = [f64::NEG_INFINITY, degrees_of_cosine(course.range().0)];
            let value = degrees_of_cosine(course.middle);
            let range = [f64::NEG_INFINITY, most];
            visit(Span::of(limit, Part::Leg(lean.i), value, ends, range))?;
        }
        ControlFlow::Continue(())
    }

    fn pyramids<B>(
        &self,
        lean: &Lean,
        visit: &mut impl FnMut(Span) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for (limit, most) in [
            (Limit::BasePyramid, self.limits.base_pyramid[lean.i]),
            (Limit::PlatformPyramid, self.limits.platform_pyramid[lean.i]),
        ] {
            if most == [0.0; 2] {
                continue;
            }
            let is_platform = limit == Limit::PlatformPyramid;
            let turns = lean.middle.at.turns()[usize::from(is_platform)];
            let turns = [turns.about[lean.i], turns.across[lean.i]];
            let known = self.turns(lean, is_platform);
            for k in (0..2).filter(|k| most[*k] != 0.0) {
                let ends = known.map_or([f64::NEG_INFINITY, f64::INFINITY], |known| known[k]);
                let range = [-most[k], most[k]];
                visit(Span::of(limit, Part::Leg(lean.i), turns[k], ends, range))?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Ends of the turns about the fixed axis of a cardan joint and across it, degrees.
    fn turns(&self, lean: &Lean, is_platform: bool) -> Option<[[f64; 2]; 2]> {
        let screw = self.config.geometry.legs()[lean.i].kind.screw();
        let axis = if is_platform { screw.platform_axis } else { screw.base_axis };
        let axis = Vector3::from(axis).try_normalize(0.0)?;
        let home = &self.home[lean.i];
        let zero = (home - axis * axis.dot(home)).try_normalize(0.0)?;
        let quarter = axis.cross(&zero);
        let [x, y, sine] =
            [zero, quarter, axis].map(|vector| lean.course(is_platform, &vector).range());
        let across = [sine.0, sine.1].map(|sine| sine.clamp(-1.0, 1.0).asin() / RADIANS);
        // Where the leg may point along the axis, or back, it may be turned by any angle.
        let about = match x.0 <= 0.0 && y.0 <= 0.0 && y.1 >= 0.0 {
            true => [-180.0, 180.0],
            false => {
                let corners = [(x.0, y.0), (x.0, y.1), (x.1, y.0), (x.1, y.1)];
                let angles = corners.map(|(x, y)| y.atan2(x) / RADIANS);
                // The folds below leave out what is not a number.
                if angles.iter().any(|angle| angle.is_nan()) {
                    return None;
                }
                [
                    angles.into_iter().fold(180.0, f64::min),
                    angles.into_iter().fold(-180.0, f64::max),
                ]
            }
        };
        Some([about, across])
    }

    /// Whether joint `i` is a coordinate of the pose but for a constant: a table axis where nothing turns.
    fn is_coordinate(&self, i: usize, spread: &Spread) -> bool {
        i >= self.config.legs() && spread.turn == 0.0
    }

    /// Joint `i` over a cell; without second derivatives nothing is known of a leg's.
    pub(super) fn joint_course(
        &self,
        i: usize,
        middle: &Middle,
        spread: &Spread,
        seconds: Option<&[SecondDerivatives]>,
    ) -> Course {
        // A table axis moves by P − R (o + centre).
        let arm = self.tool + Vector3::from(self.config.geometry.centre);
        let second_derivative = match seconds {
            _ if i >= self.config.legs() => arm.norm() * spread.turn * spread.turn,
            Some(seconds) => seconds[i].joint,
            None => f64::INFINITY,
        };
        let unit = |k: usize| if k < 3 { 1.0 } else { 1.0 / RADIANS };
        let gradient = std::array::from_fn(|k| middle.gradient[(i, k)] * unit(k));
        let rounding = match self.is_coordinate(i, spread) {
            true => 0.0,
            false => ROUNDING * self.config.machine.size(),
        };
        Course {
            middle: middle.at.joints()[i],
            slope: spread.slope(&gradient),
            second_derivative,
            rounding,
        }
    }

    /// Distances of the legs; bounds that are `enough`, or those of pairs that are not the nearest
    /// ones anywhere, are not made any better.
    fn gaps<B>(
        &self,
        middle: &Middle,
        spread: &Spread,
        seconds: Option<&[SecondDerivatives]>,
        enough: f64,
        visit: &mut impl FnMut(Span) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let Some(nearest) = middle.at.nearest().map(|nearest| nearest.distance) else {
            return ControlFlow::Continue(());
        };
        // No two legs come nearer by more than the two that move farthest.
        let farthest = seconds.map_or(f64::INFINITY, |seconds| {
            seconds.iter().map(|second_derivative| second_derivative.farthest).fold(0.0, f64::max)
        });
        if nearest - 2.0 * farthest - ROUNDING * self.config.machine.size() >= enough {
            return ControlFlow::Continue(());
        }
        let nearest = nearest.min(enough);
        for pair @ [i, j] in &self.pairs {
            let gap = middle.legs[*i].segment.gap(&middle.legs[*j].segment);
            let distance = gap.norm();
            let least = seconds.map_or(f64::NEG_INFINITY, |seconds| {
                // No point of a leg moves farther than its ends.
                let least = distance
                    - seconds[*i].farthest
                    - seconds[*j].farthest
                    - ROUNDING * self.config.machine.size();
                match least >= nearest || distance == 0.0 {
                    true => least,
                    false => self.least_gap(*pair, &(gap / distance), middle, spread, seconds),
                }
            });
            let range = [self.limits.clearance, f64::INFINITY];
            let ends = [least, f64::INFINITY];
            visit(Span::of(Limit::Clearance, Part::Legs(*pair), distance, ends, range))?;
        }
        ControlFlow::Continue(())
    }

    /// Least distance of two legs along a direction.
    fn least_gap(
        &self,
        pair: [usize; 2],
        w: &Vector3<f64>,
        middle: &Middle,
        spread: &Spread,
        seconds: &[SecondDerivatives],
    ) -> f64 {
        let [one, other] = pair.map(|i| {
            let leg = &middle.legs[i];
            let ends = [leg.segment.base, leg.segment.platform].map(|end| w.dot(&end));
            let mut gradients = [[0.0; 6]; 2];
            for k in 0..6 {
                gradients[0][k] = w.dot(&(leg.motions[k] - leg.changes[k]));
                gradients[1][k] = w.dot(&leg.motions[k]);
            }
            (ends, gradients, seconds[i].ends)
        });
        let apart = |e: usize, f: usize| {
            let gradient = std::array::from_fn(|k| one.1[e][k] - other.1[f][k]);
            one.0[e] - other.0[f] - spread.slope(&gradient) - (one.2[e] + other.2[f]) / 2.0
        };
        let least = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(e, f)| apart(e, f));
        if least.iter().any(|gap| gap.is_nan()) {
            return f64::NEG_INFINITY;
        }
        least.into_iter().fold(f64::INFINITY, f64::min) - ROUNDING * self.config.machine.size()
    }
}

/// Roundings of a table axis' value over a cell, each by one unit in the last place of the largest number: middle
/// and half of the cell, their sum, the tool's vector in and out.
const TABLE_ROUNDINGS: f64 = 8.0;

/// Returns the limit in place of a table axis' value that differs from it by rounding alone. LinuxCNC lets a
/// table axis go to its limit, as the inverse returns the coordinate itself; it refuses, also in virtual time, what is
/// really beyond. Legs have no such room: the inverse may round to a value beyond the limit.
fn at_limit(value: f64, range: [f64; 2], low: f64, high: f64) -> f64 {
    let rounding = TABLE_ROUNDINGS * f64::EPSILON * low.abs().max(high.abs());
    range.into_iter().find(|limit| (value - limit).abs() <= rounding).unwrap_or(value)
}

/// Cosine of the angle between the tool axis and Z of base.
fn tilt(middle: &Middle, spread: &Spread) -> Course {
    let z = middle.rotation.column(2).into_owned();
    let gradient = std::array::from_fn(|k| match k {
        0..3 => 0.0,
        _ => middle.axes[k - 3].cross(&z).z,
    });
    Course {
        middle: z.z,
        slope: spread.slope(&gradient),
        second_derivative: spread.turn * spread.turn,
        rounding: ROUNDING,
    }
}

fn degrees_of_cosine(cosine: f64) -> f64 {
    cosine.clamp(-1.0, 1.0).acos() / RADIANS
}
