// SPDX-License-Identifier: GPL-2.0-or-later
//! Bounds of the values of limits over a cell.
//!
//! **Distance of legs**: let w be the unit vector from the nearest point of one leg to that of the
//! other at the center. Everywhere in the cell, their distance is at least the minimum of w · (a − b) over the
//! ends a of one leg and b of the other. Each of these four values has a slope, and
//! its second derivative is bounded by those of the ends.
//!
//! **Tilt, pyramids**: cosines of angles between a leg, or the tool axis, and vectors that are
//! fixed in base or platform, as for the cones.

use crate::proof::bounds::SecondDerivatives;
use crate::proof::reach::{LegMiddle, Middle, RADIANS, ROUNDING, Reach, Spread};
use kinematics::{Limit, Margin, Part, Vector3};
use std::ops::ControlFlow;

/// A value over a cell, or over a path traversed in two units of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Value at the center.
    pub middle: f64,
    /// First-order change from the center to the end: never negative.
    pub slope: f64,
    /// Bound of its second derivative on every straight path from the center to an end, traversed
    /// in one unit of time; infinite if unknown.
    pub second_derivative: f64,
    /// Bound of the rounding error.
    pub rounding: f64,
}

impl Course {
    /// Returns bounds of all its values.
    pub fn range(&self) -> (f64, f64) {
        let room = self.slope + self.second_derivative / 2.0 + self.rounding;
        (self.middle - room, self.middle + room)
    }
}

/// The value of a limit over a cell or a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Margin at the center.
    pub margin: Margin,
    /// Lower and upper bound of the value; infinite if unknown. Distances of legs that are
    /// nowhere the nearest ones have a looser lower bound than necessary.
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

    /// Returns a lower bound of the value's distance from the ends of its range, negative
    /// outside; minus infinity if unknown.
    pub fn room(&self) -> f64 {
        let [low, high] = self.margin.range;
        let room = (self.ends[0] - low).min(high - self.ends[1]);
        // NaN proves nothing.
        if room.is_nan() { f64::NEG_INFINITY } else { room }
    }
}

/// A leg over a cell, as vectors fixed in base or platform.
struct Lean<'a> {
    i: usize,
    middle: &'a Middle<'a>,
    spread: &'a Spread,
    second_derivative: Option<&'a SecondDerivatives>,
}

impl Lean<'_> {
    /// Bounds the product of the leg's direction and a unit vector of base or platform.
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
        // cos = n · d; in the platform d rotates, too.
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
    /// Visits all configured limits of the pose alone except its axes and the conditioning.
    /// Bounds of distances that are `enough` are not refined.
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
            let is_platform = limit == Limit::PlatformCone;
            let home = &self.home[lean.i][usize::from(is_platform)];
            let course = lean.course(is_platform, home);
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

    /// Bounds the angles about the fixed axis of a cardan joint and across it, degrees.
    fn turns(&self, lean: &Lean, is_platform: bool) -> Option<[[f64; 2]; 2]> {
        let screw = self.config.geometry.legs()[lean.i].kind.screw();
        let axis = if is_platform { screw.platform_axis } else { screw.base_axis };
        let axis = Vector3::from(axis).try_normalize(0.0)?;
        let home = &self.home[lean.i][usize::from(is_platform)];
        let zero = (home - axis * axis.dot(home)).try_normalize(0.0)?;
        let quarter = axis.cross(&zero);
        let [x, y, sine] =
            [zero, quarter, axis].map(|vector| lean.course(is_platform, &vector).range());
        let across = [sine.0, sine.1].map(|sine| sine.clamp(-1.0, 1.0).asin() / RADIANS);
        // If the leg may point along the axis, in either direction, any angle is possible.
        let about = match x.0 <= 0.0 && y.0 <= 0.0 && y.1 >= 0.0 {
            true => [-180.0, 180.0],
            false => {
                let corners = [(x.0, y.0), (x.0, y.1), (x.1, y.0), (x.1, y.1)];
                let angles = corners.map(|(x, y)| y.atan2(x) / RADIANS);
                // The folds below ignore NaN.
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

    /// Returns whether joint `i` equals a coordinate of the pose plus a constant: a table axis without rotation.
    fn is_coordinate(&self, i: usize, spread: &Spread) -> bool {
        i >= self.config.legs() && spread.turn == 0.0 && spread.commanded.is_none()
    }

    /// Bounds the joint of a table axis that compensates the platform's own motion: the commanded coordinate less that of
    /// the platform.
    fn compensating_course(&self, i: usize, middle: &Middle, spread: &Spread) -> Option<Course> {
        let commanded = spread.commanded.as_ref()?;
        let table = self.config.machine.layout().table().as_slice();
        let k = table.get(i.checked_sub(self.config.legs())?)?.index();
        let change = |(own, step): (&[f64; 6], &[f64; 6])| (step[k] - own[k]).abs();
        Some(Course {
            middle: middle.at.joints()[i],
            slope: spread.steps.iter().zip(commanded).map(change).sum(),
            second_derivative: 0.0,
            rounding: ROUNDING * self.config.machine.size(),
        })
    }

    /// Bounds joint `i` over a cell; a leg's needs second derivatives.
    pub(super) fn joint_course(
        &self,
        i: usize,
        middle: &Middle,
        spread: &Spread,
        seconds: Option<&[SecondDerivatives]>,
    ) -> Course {
        if let Some(course) = self.compensating_course(i, middle, spread) {
            return course;
        }
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

    /// Bounds the distances between legs; bounds that are `enough`, or of pairs that are nowhere the nearest,
    /// are not refined.
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
        // The distance of two legs decreases by at most the sum of their motions, twice the farthest.
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

    /// Bounds the least distance of two legs along a direction.
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

/// Roundings of a table axis' value over a cell, each one unit in the last place of the largest number: center
/// and half width of the cell, their sum, and adding and subtracting the tool vector.
const TABLE_ROUNDINGS: f64 = 8.0;

/// Returns the limit instead of a table axis' value that differs from it by rounding alone. LinuxCNC accepts a
/// table axis at its limit, because the inverse returns the coordinate itself; it refuses, also in virtual time,
/// values that are beyond. Legs have no such tolerance: the inverse may round to a value beyond the limit.
fn at_limit(value: f64, range: [f64; 2], low: f64, high: f64) -> f64 {
    let rounding = TABLE_ROUNDINGS * f64::EPSILON * low.abs().max(high.abs());
    range.into_iter().find(|limit| (value - limit).abs() <= rounding).unwrap_or(value)
}

/// Bounds the cosine of the angle between the tool axis and Z of base.
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
