// SPDX-License-Identifier: GPL-2.0-or-later
//! Constants of a frozen machine's legs for monitoring: their directions at the reference pose, the
//! fixed axes of their joints, and which of them must not touch.

use crate::geometry::{Geometry, LegGeometry};
use crate::lanes::{Lanes3, both, cross, dot, pair, put, times, wide};
use crate::layout::{MAX_LEGS, PerLeg};
use crate::leg::direction;
use crate::segment::Segment;
use crate::trig::{DEGREES, broad_arcs};
use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

/// Constants of a frozen machine's legs for monitoring.
#[derive(Clone, Debug, PartialEq)]
pub struct Watch {
    /// The legs' joints at base and platform; `None` without a reference pose.
    joints: Option<[Joints; 2]>,
    /// Number of legs.
    count: usize,
    /// For each leg, the legs of higher numbers with which it shares no anchor: leg j is bit 1 << j.
    apart: [u8; MAX_LEGS],
}

/// The joints at one end of the legs, in the frame of the body to which they are fixed.
#[derive(Clone, Debug, PartialEq)]
struct Joints {
    /// From base to platform at the reference pose.
    home: Lanes3<MAX_LEGS>,
    /// Unit vectors of the cardan joints' fixed axes; zeros where none is given.
    axis: Lanes3<MAX_LEGS>,
}

/// Angles of two legs side by side, as sine and cosine times a common factor, and their
/// unit.
struct Angles {
    sine: f64x2,
    cosine: f64x2,
    unit: f64x2,
}

/// Angles between the legs and their directions at the reference pose, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cones {
    /// At the base joints.
    pub base: PerLeg,
    /// At the platform joints.
    pub platform: PerLeg,
}

/// Rotations of the legs in their cardan joints at one end, degrees, see [`Watch::turns`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turns {
    /// About the axis that is fixed in the body.
    pub about: PerLeg,
    /// Across it.
    pub across: PerLeg,
}

/// Two legs, lower number first, and the distance of their center lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Machine units.
    pub distance: f64,
    /// Numbers of the legs.
    pub pair: [usize; 2],
}

impl Watch {
    /// Computes the constants of a geometry; `home` is its legs, from base to platform, and its orientation at
    /// the reference pose.
    pub(crate) fn of(
        geometry: &Geometry,
        home: Option<(&[Vector3<f64>; MAX_LEGS], &Matrix3<f64>)>,
    ) -> Self {
        let legs = geometry.legs();
        let apart = core::array::from_fn(|i| {
            let is_apart = |j: &usize| {
                let pair = legs.get(i).zip(legs.get(*j));
                i < *j && pair.is_some_and(|(one, other)| !share_anchor(one, other))
            };
            (0..MAX_LEGS).filter(is_apart).fold(0, |row, j| row | 1 << j)
        });
        let joints = home.map(|(spans, rotation)| {
            let mut joints = [Joints::NONE, Joints::NONE];
            let [base, platform] = &mut joints;
            for (i, (span, leg)) in spans.iter().zip(legs).enumerate() {
                let screw = leg.kind.screw();
                let [at_base, at_platform] = [screw.base_axis, screw.platform_axis]
                    .map(|axis| direction(&axis).unwrap_or_default());
                base.set(i, *span, at_base);
                platform.set(i, rotation.tr_mul(span), at_platform);
            }
            joints
        });
        Self { joints, count: legs.len(), apart }
    }

    /// Sets the fixed axes of the joints at base and platform, one for each leg.
    pub(crate) fn set_axes(&mut self, axes: [&[[f64; 3]]; 2]) {
        let Some(joints) = &mut self.joints else { return };
        for (joints, axes) in joints.iter_mut().zip(axes) {
            for (i, axis) in axes.iter().enumerate().take(self.count) {
                joints.axis.set(i, direction(axis).unwrap_or_default());
            }
        }
    }

    /// Computes the angles of the legs' cones for an orientation of the platform; zeros without a
    /// reference pose.
    #[inline(always)]
    pub fn cones(&self, rotation: &Matrix3<f64>, legs: &[Segment; MAX_LEGS]) -> Cones {
        let mut cones = Cones { base: [0.0; MAX_LEGS], platform: [0.0; MAX_LEGS] };
        let Some([base, platform]) = &self.joints else { return cones };
        let back = rotation.transpose();
        for i in (0..MAX_LEGS).step_by(2).take_while(|i| *i < self.count) {
            let now = spans(legs, i);
            put(&mut cones.base, i, base.cones(i, &now).degrees());
            put(&mut cones.platform, i, platform.cones(i, &times(&back, &now)).degrees());
        }
        cones
    }

    /// Computes the rotations of the legs about the fixed axes of their joints at base and platform since the
    /// reference pose, and their angles across them, degrees. NaN if the joint has no axis, or
    /// the machine no reference pose.
    ///
    /// A cardan joint rotates about the axis that is fixed in its body, and the leg then about an axis
    /// perpendicular to it: the angle across is the leg's deviation from a right angle with the fixed axis.
    #[inline(always)]
    pub fn turns(&self, rotation: &Matrix3<f64>, legs: &[Segment; MAX_LEGS]) -> [Turns; 2] {
        let mut turns = [Turns { about: [f64::NAN; MAX_LEGS], across: [f64::NAN; MAX_LEGS] }; 2];
        let Some([base, platform]) = &self.joints else { return turns };
        let back = rotation.transpose();
        for i in (0..MAX_LEGS).step_by(2).take_while(|i| *i < self.count) {
            let now = spans(legs, i);
            let ends = [base.turns(i, &now), platform.turns(i, &times(&back, &now))];
            for (turns, [about, across]) in turns.iter_mut().zip(ends) {
                put(&mut turns.about, i, about.degrees());
                put(&mut turns.across, i, across.degrees());
            }
        }
        turns
    }

    /// Implements [`crate::At::surely_keeps`].
    pub(crate) fn keeps(
        &self,
        (rotation, legs): (&Matrix3<f64>, &[Segment; MAX_LEGS]),
        tilt: f64,
        cones: [&PerLeg; 2],
        pyramids: [&[[f64; 2]; MAX_LEGS]; 2],
    ) -> bool {
        let has_cones = cones != [&[0.0; MAX_LEGS]; 2];
        let has_pyramids = pyramids != [&[[0.0; 2]; MAX_LEGS]; 2];
        let [x, y, z] = [0, 1, 2].map(|row| rotation[(row, 2)]);
        let upright = are_within(both(z * z.abs()), both(x * x + y * y + z * z), both(tilt)).all();
        let Some(joints) = self.joints.as_ref().filter(|_| has_cones || has_pyramids) else {
            return upright && !(has_cones || has_pyramids);
        };
        let back = rotation.transpose();
        for i in (0..MAX_LEGS).step_by(2).take_while(|i| *i < self.count) {
            let now = spans(legs, i);
            let ends = joints.iter().zip([now, times(&back, &now)]);
            for (((joints, now), cone), pyramid) in ends.zip(cones).zip(pyramids) {
                let most = |way: usize| f64x2::new([pyramid[i][way], pyramid[i + 1][way]]);
                let cone = has_cones.then(|| pair(cone, i));
                let pyramid = has_pyramids.then(|| [most(0), most(1)]);
                if !joints.keep(i, &now, cone, pyramid).all() {
                    return false;
                }
            }
        }
        upright
    }

    /// Returns whether the distance of two legs is monitored, lower number first: they share no anchor.
    pub fn is_watched(&self, [i, j]: [usize; 2]) -> bool {
        j < MAX_LEGS && self.apart.get(i).is_some_and(|row| row >> j & 1 == 1)
    }

    /// Returns the two nearest legs among those that share no anchor.
    pub fn nearest(&self, legs: &[Segment; MAX_LEGS]) -> Option<Nearest> {
        self.nearest_within(legs, f64::INFINITY)
    }

    /// Like [`Self::nearest`] if they are nearer than `most`; otherwise returns any pair or `None`.
    pub(crate) fn nearest_within(&self, legs: &[Segment; MAX_LEGS], most: f64) -> Option<Nearest> {
        let (mut middle, mut span) = (Lanes3::<MAX_LEGS>::ZERO, Lanes3::<MAX_LEGS>::ZERO);
        for (i, leg) in legs.iter().enumerate().take(self.count) {
            middle.set(i, leg.base + leg.platform);
            span.set(i, leg.span());
        }
        let mut nearest: Option<Nearest> = None;
        for i in 0..MAX_LEGS {
            let row = self.apart[i];
            if row == 0 {
                continue;
            }
            let own = [wide(&middle.get(i)), wide(&span.get(i))];
            for j in (0..MAX_LEGS).step_by(2) {
                let watched = [row >> j & 1 == 1, row >> j & 2 == 2];
                if watched == [false; 2] {
                    continue;
                }
                let least = nearest.map_or(most, |n| n.distance);
                let beyond = are_beyond(&own, &[middle.pair(j), span.pair(j)], least);
                for (j, (watched, beyond)) in (j..).zip(watched.into_iter().zip(beyond)) {
                    if !watched || beyond {
                        continue;
                    }
                    let distance = legs[i].distance(&legs[j.min(MAX_LEGS - 1)]);
                    if !nearest.is_some_and(|n| n.distance <= distance) {
                        nearest = Some(Nearest { distance, pair: [i, j] });
                    }
                }
            }
        }
        nearest
    }
}

/// Allowance for rounding: a distance or a squared cosine is certainly beyond its limit only
/// by more than this share.
const SLACK: f64 = 1.0 + 1e-9;

/// Returns whether a leg is certainly farther than `distance` from two others, without computing the
/// distance: two planes perpendicular to the line between their midpoints, or to both legs, are then that far
/// apart. Uses twice their midpoints and their spans. False for NaN.
#[inline(always)]
fn are_beyond(one: &[[f64x2; 3]; 2], others: &[[f64x2; 3]; 2], distance: f64) -> [bool; 2] {
    let between: [f64x2; 3] = core::array::from_fn(|k| one[0][k] - others[0][k]);
    let least = both(2.0 * distance * SLACK);
    // Twice the distance of the midpoints, times its own length, less the half lengths.
    let square = dot(&between, &between);
    let free = square - dot(&one[1], &between).abs() - dot(&others[1], &between).abs();
    let beside = free.simd_gt(both(0.0)) & (free * free).simd_gt(least * least * square);
    // The usual case.
    if beside.all() {
        return [true; 2];
    }
    let normal = cross(&one[1], &others[1]);
    let apart = dot(&between, &normal);
    let crossing = (apart * apart).simd_gt(least * least * dot(&normal, &normal));
    (beside | crossing).to_array().map(|mask| mask.to_bits() != 0)
}

impl Joints {
    const NONE: Self = Self { home: Lanes3::ZERO, axis: Lanes3::ZERO };

    fn set(&mut self, i: usize, home: Vector3<f64>, axis: Vector3<f64>) {
        let i = i.min(MAX_LEGS - 1);
        self.home.set(i, home);
        self.axis.set(i, axis);
    }

    /// Computes the angles between legs i and i + 1 and their directions at home; 0 for a leg without length.
    #[inline(always)]
    fn cones(&self, i: usize, now: &[f64x2; 3]) -> Angles {
        let home = self.home.pair(i);
        let across = cross(now, &home);
        Angles { sine: dot(&across, &across).sqrt(), cosine: dot(now, &home), unit: both(DEGREES) }
    }

    /// Computes the rotations of legs i and i + 1, about the fixed axes and across them.
    #[inline(always)]
    fn turns(&self, i: usize, now: &[f64x2; 3]) -> [Angles; 2] {
        let (home, axis) = (self.home.pair(i), self.axis.pair(i));
        let along = dot(&axis, now);
        let turned = dot(&home, now) - dot(&axis, &home) * along;
        let beside = cross(&axis, now);
        // Without an axis the rotation is undefined.
        let unit = dot(&axis, &axis).simd_gt(both(0.0)).select(both(DEGREES), both(f64::NAN));
        [
            Angles { sine: dot(&axis, &cross(&home, now)), cosine: turned, unit },
            Angles { sine: along, cosine: dot(&beside, &beside).sqrt(), unit },
        ]
    }

    /// Returns a mask of those of legs i and i + 1 that certainly keep the limits of their cones, and of their
    /// rotations about and across the axes, in degrees.
    #[inline(always)]
    fn keep(
        &self,
        i: usize,
        now: &[f64x2; 3],
        cone: Option<f64x2>,
        pyramid: Option<[f64x2; 2]>,
    ) -> f64x2 {
        let home = self.home.pair(i);
        let (straight, square) = (dot(now, &home), dot(now, now));
        let mut kept = both(0.0).simd_eq(both(0.0));
        if let Some(most) = cone {
            kept = are_within(straight * straight.abs(), square * dot(&home, &home), most);
        }
        if let Some([about, across]) = pyramid {
            let axis = self.axis.pair(i);
            // 1, or 0 without an axis: then the rotation is undefined.
            let unit = dot(&axis, &axis);
            let along = dot(&axis, now);
            let turned = straight - dot(&axis, &home) * along;
            let sine = dot(&axis, &cross(&home, now));
            let length = turned * turned + sine * sine;
            kept &= are_within(turned * turned.abs() * unit, length, about);
            kept &= are_within((square - along * along) * unit, square, across);
        }
        kept
    }
}

impl Angles {
    #[inline(always)]
    fn degrees(&self) -> f64x2 {
        broad_arcs(self.sine, self.cosine) * self.unit
    }
}

/// Returns a mask of angles that are certainly within ±`most` degrees, or have no limit (0): their cosine is
/// at least 1 − m²/2 + m⁴/24, which no cosine of m exceeds. Compares its square, with its sign, times a length.
/// False for NaN.
#[inline(always)]
fn are_within(cosine: f64x2, length: f64x2, most: f64x2) -> f64x2 {
    // No angle is within a negative limit, and beyond 90 degrees the test is inconclusive.
    let bound = most.fast_max(both(0.0));
    let square = bound * bound * both(1.0 / (DEGREES * DEGREES));
    let least = both(1.0) + square * (square * both(1.0 / 24.0) - both(0.5));
    let least = least.fast_max(both(1e-3));
    // Squares that underflow are below the term that is added.
    let needed = least * least * both(SLACK) * length + both(1e-270);
    cosine.simd_gt(needed) | most.simd_eq(both(0.0))
}

/// Loads legs i and i + 1, from base to platform.
#[inline(always)]
fn spans(legs: &[Segment; MAX_LEGS], i: usize) -> [f64x2; 3] {
    let (one, other) = (legs[i].span(), legs[i + 1].span());
    core::array::from_fn(|k| f64x2::new([one[k], other[k]]))
}

/// Returns whether two legs share a point of the platform, or a fixed base anchor.
fn share_anchor(one: &LegGeometry, other: &LegGeometry) -> bool {
    let is_point = |leg: &LegGeometry| leg.kind.ring_radius() == 0.0;
    let meet = |a: &[f64; 3], b: &[f64; 3], fixed: [bool; 2]| a == b && fixed == [true; 2];
    meet(&one.platform, &other.platform, [one, other].map(is_point))
        || meet(&one.base, &other.base, [one, other].map(|leg| leg.kind.stands()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints(home: Vector3<f64>, axis: Vector3<f64>) -> Joints {
        Joints { home: Lanes3::from_fn(|_| home), axis: Lanes3::from_fn(|_| axis) }
    }

    fn wide(v: Vector3<f64>) -> [f64x2; 3] {
        crate::lanes::wide(&v)
    }

    #[test]
    fn angles_of_directions_are_those_of_their_lengths_across_and_along() {
        // Degrees: 1e-13 is a few roundings.
        let x = Vector3::new(2.0, 0.0, 0.0);
        let home = joints(x, Vector3::zeros());
        for (direction, degrees) in
            [([3.0, 3.0, 0.0], 45.0), ([-1.0, 0.0, -1.0], 135.0), ([0.0, 0.0, 9.0], 90.0)]
        {
            for angle in home.cones(2, &wide(Vector3::from(direction))).degrees().to_array() {
                assert!((angle - degrees).abs() < 1e-13, "{angle}");
            }
        }
        assert_eq!(home.cones(0, &wide(Vector3::zeros())).degrees().to_array(), [0.0; 2]);
    }

    #[test]
    fn a_joint_turns_about_its_axis_and_then_across_wherever_the_leg_stood() {
        let axis = Vector3::new(0.0, 1.0, 0.0);
        for lean in [0.0, 20.0, -35.0_f64] {
            let leg = |about: f64, across: f64| {
                let (sine, cosine) = libm::sincos(about / DEGREES);
                let (up, level) = libm::sincos(across / DEGREES);
                Vector3::new(sine * level, up, cosine * level) * 7.0
            };
            let joints = joints(leg(10.0, lean), axis);
            for (about, across) in [(0.0, 0.0), (30.0, -20.0), (-100.0, 60.0), (5.0, lean)] {
                let turns = joints.turns(4, &wide(leg(10.0 + about, across)));
                for (turn, expected) in turns.iter().zip([about, across]) {
                    let [_, found] = turn.degrees().to_array();
                    // Degrees: 1e-12 is about ten roundings.
                    assert!((found - expected).abs() < 1e-12, "{found} {expected}");
                }
            }
        }
        let turns = joints(axis, Vector3::zeros()).turns(0, &wide(axis));
        assert!(turns.iter().all(|turn| turn.degrees().is_nan().all()));
    }

    #[test]
    fn angles_that_are_surely_within_a_limit_are_and_most_of_those_within_are_surely() {
        let number = |k: usize| libm::sin((k * k + 7) as f64);
        let [mut sure, mut within] = [0; 2];
        for case in 0..3_000 {
            let vector = |k: usize| Vector3::from_fn(|axis, _| number(9 * case + 3 * k + axis));
            let axis = vector(1) / vector(1).norm();
            // Mostly near each other, so that limits of all sizes occur.
            let now = vector(0) + vector(2) * [0.03, 0.3, 3.0][case % 3];
            let joints = joints(vector(0), axis);
            let [about, across] = joints.turns(0, &wide(now));
            let keeps = |[cone, about, across]: [f64; 3]| {
                joints
                    .keep(0, &wide(now), Some(both(cone)), Some([both(about), both(across)]))
                    .all()
            };
            assert!(keeps([0.0; 3]));
            let angles = [joints.cones(0, &wide(now)), about, across];
            for (k, angles) in angles.iter().enumerate() {
                let [degrees, _] = angles.degrees().to_array();
                for most in [degrees.abs(), 1e-3, 3.0, 30.0, 75.0, 100.0, 190.0, -1.0, f64::NAN] {
                    let mut limits = [0.0; 3];
                    limits[k] = most;
                    let is_sure = keeps(limits);
                    assert!(!is_sure || degrees.abs() <= most, "{degrees} {most}");
                    sure += usize::from(is_sure);
                    within += usize::from(degrees.abs() <= most);
                    // 1 − m²/2 + m⁴/24 is a cosine of this.
                    let is_clear = degrees.abs() < 0.99 * most && most <= 75.0 && most > 1.0;
                    assert!(is_sure || !is_clear, "{degrees} {most}");
                }
            }
        }
        assert!(sure > 20_000 && within > sure + 9_000, "{sure} {within}");
        // Without an axis no rotation is within its limit, nor is a length whose square under- or overflows.
        let bare = joints(Vector3::x(), Vector3::zeros());
        let keeps = |length: f64, cone, pyramid| {
            bare.keep(0, &wide(Vector3::x() * length), Some(both(cone)), pyramid).all()
        };
        assert!(!keeps(1.0, 0.0, Some([both(80.0), both(0.0)])));
        assert!(!keeps(1.0, 0.0, Some([both(0.0), both(80.0)])));
        assert!(keeps(1.0, 80.0, Some([both(0.0); 2])) && keeps(1.0, 80.0, None));
        assert!(![0.0, 1e-160, 1e160].iter().any(|length| keeps(*length, 80.0, None)));
    }

    #[test]
    fn what_is_beyond_a_distance_is_farther_and_most_of_what_is_farther_is_beyond() {
        let number = |k: usize| libm::sin((k * k + 5) as f64);
        let mut beyond = [0; 2];
        for case in 0..2_000 {
            let point = |k: usize| Vector3::from_fn(|axis, _| number(12 * case + 3 * k + axis));
            let one = Segment { base: point(0), platform: point(1) };
            let other = Segment { base: point(2), platform: point(3) };
            let seen = |leg: &Segment| [wide(leg.base + leg.platform), wide(leg.span())];
            let is_beyond = |distance| are_beyond(&seen(&one), &seen(&other), distance)[1];
            let distance = one.distance(&other);
            assert!(!is_beyond(distance) && !is_beyond(f64::NAN));
            beyond[0] += usize::from(is_beyond(0.0));
            beyond[1] += usize::from(is_beyond(0.5 * distance));
        }
        assert!(beyond[0] > 600 && beyond[1] > 300, "{beyond:?}");
    }
}
