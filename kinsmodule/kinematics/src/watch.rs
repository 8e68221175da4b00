// SPDX-License-Identifier: GPL-2.0-or-later
//! What does not change about the legs of a frozen machine and is needed to watch them: where they
//! point at the reference pose, the fixed axes of their joints, and which of them may not touch.

use crate::geometry::{Geometry, LegGeometry};
use crate::layout::{MAX_LEGS, PerLeg};
use crate::leg::{LegKind, direction};
use crate::pose::broad_arcs;
use crate::segment::Segment;
use libm::asin;
use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

const DEGREES: f64 = 180.0 / core::f64::consts::PI;

/// What does not change about the legs of a frozen machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Watch {
    /// The legs' joints at base and platform; `None` without a reference pose.
    joints: Option<[[Joint; 2]; MAX_LEGS]>,
    /// Pairs of legs, lower number first, that share no anchor.
    apart: [[bool; MAX_LEGS]; MAX_LEGS],
}

/// A joint at one end of a leg, in the body that it is fixed to.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Joint {
    /// From base to platform at the reference pose.
    home: Vector3<f64>,
    /// Unit vector of the cardan joint's fixed axis; zeros where none is given.
    axis: Vector3<f64>,
}

/// Angles by which the legs have left their direction at the reference pose, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cones {
    /// As the base joints see it.
    pub base: PerLeg,
    /// As the platform joints see it.
    pub platform: PerLeg,
}

/// Two legs, lower number first, and the distance of their centre lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Machine units.
    pub distance: f64,
    /// Numbers of the legs.
    pub pair: [usize; 2],
}

impl Watch {
    /// Of a geometry, with its legs and orientation at the reference pose.
    pub(crate) fn of(
        geometry: &Geometry,
        home: Option<(&[Segment; MAX_LEGS], &Matrix3<f64>)>,
    ) -> Self {
        let legs = geometry.legs();
        let apart = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let pair = legs.get(i).zip(legs.get(j));
                i < j && pair.is_some_and(|(one, other)| !share_anchor(one, other))
            })
        });
        let joints = home.map(|(segments, rotation)| {
            core::array::from_fn(|i| {
                let home = segments.get(i).map_or(Vector3::zeros(), Segment::span);
                let [base, platform] = axes(legs.get(i));
                let in_platform = rotation.tr_mul(&home);
                [Joint { home, axis: base }, Joint { home: in_platform, axis: platform }]
            })
        });
        Self { joints, apart }
    }

    /// Angles of the legs' cones for an orientation of the platform; zeros where the
    /// machine has no reference pose.
    pub fn cones(&self, rotation: &Matrix3<f64>, legs: &[Segment; MAX_LEGS]) -> Cones {
        let mut cones = Cones { base: [0.0; MAX_LEGS], platform: [0.0; MAX_LEGS] };
        let Some(joints) = &self.joints else { return cones };
        let angles = cones.base.iter_mut().zip(&mut cones.platform);
        for ((leg, joints), (base, platform)) in legs.iter().zip(joints).zip(angles) {
            let now = leg.span();
            let [at_base, at_platform] = joints.map(|joint| joint.home);
            [*base, *platform] =
                angles_between([now, rotation.tr_mul(&now)], [at_base, at_platform]);
        }
        cones
    }

    /// Turns of a leg about the fixed axes of its joints at base and platform since the reference
    /// pose, and its angles across them, degrees: `[about, across]` for either end. NaN where the
    /// joint has no axis, or the machine no reference pose.
    ///
    /// A cardan joint turns about the axis that is fixed in its body, and the leg then about one
    /// square to it: what the leg leaves of a right angle with the fixed axis is its angle across.
    pub fn turns(&self, rotation: &Matrix3<f64>, leg: usize, now: &Segment) -> [[f64; 2]; 2] {
        let joints = self.joints.as_ref().and_then(|joints| joints.get(leg));
        let Some([base, platform]) = joints else { return [[f64::NAN; 2]; 2] };
        let now = now.span();
        [base.turns(&now), platform.turns(&rotation.tr_mul(&now))]
    }

    /// Whether the distance of two legs counts, lower number first: they share no anchor.
    pub fn is_watched(&self, [i, j]: [usize; 2]) -> bool {
        self.apart.get(i).and_then(|row| row.get(j)).is_some_and(|apart| *apart)
    }

    /// The two legs that are nearest to each other, of those that share no anchor.
    pub fn nearest(&self, legs: &[Segment; MAX_LEGS]) -> Option<Nearest> {
        self.nearest_within(legs, f64::INFINITY)
    }

    /// The same of those that are no farther apart than `most`; all that are nearer are among them.
    pub(crate) fn nearest_within(&self, legs: &[Segment; MAX_LEGS], most: f64) -> Option<Nearest> {
        let mut nearest: Option<Nearest> = None;
        for (i, (one, apart)) in legs.iter().zip(&self.apart).enumerate() {
            for (j, (other, apart)) in legs.iter().zip(apart).enumerate() {
                if !apart || one.is_beyond(other, nearest.map_or(most, |n| n.distance)) {
                    continue;
                }
                let distance = one.distance(other);
                if !nearest.is_some_and(|n| n.distance <= distance) {
                    nearest = Some(Nearest { distance, pair: [i, j] });
                }
            }
        }
        nearest
    }
}

impl Joint {
    fn turns(&self, leg: &Vector3<f64>) -> [f64; 2] {
        if self.axis == Vector3::zeros() {
            return [f64::NAN; 2];
        }
        let along = self.axis.dot(leg);
        let turned = self.home.dot(leg) - self.axis.dot(&self.home) * along;
        let about = libm::atan2(self.axis.dot(&self.home.cross(leg)), turned);
        let across = asin((along / leg.norm()).clamp(-1.0, 1.0));
        [about * DEGREES, across * DEGREES]
    }
}

/// Whether two legs meet at the platform, or at a base anchor that stands still.
fn share_anchor(one: &LegGeometry, other: &LegGeometry) -> bool {
    let stands = |leg: &LegGeometry| matches!(leg.kind, LegKind::Strut(_));
    one.platform == other.platform || (one.base == other.base && stands(one) && stands(other))
}

/// Fixed axes of the joints at base and platform.
fn axes(leg: Option<&LegGeometry>) -> [Vector3<f64>; 2] {
    match leg.map(|leg| leg.kind) {
        Some(LegKind::Strut(strut)) => {
            [strut.base_axis, strut.platform_axis].map(|axis| direction(&axis).unwrap_or_default())
        }
        _ => [Vector3::zeros(); 2],
    }
}

/// Angles between two vectors of any length and two others, degrees; 0 where one has none.
fn angles_between(a: [Vector3<f64>; 2], b: [Vector3<f64>; 2]) -> [f64; 2] {
    let across = [a[0].cross(&b[0]).norm_squared(), a[1].cross(&b[1]).norm_squared()];
    let along = f64x2::new([a[0].dot(&b[0]), a[1].dot(&b[1])]);
    (broad_arcs(f64x2::new(across).sqrt(), along) * f64x2::splat(DEGREES)).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_of_directions_are_those_of_their_lengths_across_and_along() {
        // Degrees: 1e-13 are some roundings.
        let x = Vector3::new(2.0, 0.0, 0.0);
        for (direction, degrees) in
            [([3.0, 3.0, 0.0], 45.0), ([-1.0, 0.0, -1.0], 135.0), ([0.0, 0.0, 9.0], 90.0)]
        {
            let [one, other] =
                angles_between([x, Vector3::from(direction)], [Vector3::from(direction), x]);
            assert!((one - degrees).abs() < 1e-13 && one == other);
        }
        assert_eq!(angles_between([x, x], [Vector3::zeros(), x]), [0.0; 2]);
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
            let joint = Joint { home: leg(10.0, lean), axis };
            for (about, across) in [(0.0, 0.0), (30.0, -20.0), (-100.0, 60.0), (5.0, lean)] {
                let [found, beside] = joint.turns(&leg(10.0 + about, across));
                // Degrees: 1e-13 are some roundings.
                assert!((found - about).abs() < 1e-12 && (beside - across).abs() < 1e-12);
            }
        }
        let none = Joint { home: axis, axis: Vector3::zeros() };
        assert!(none.turns(&Vector3::x()).iter().all(|turn| turn.is_nan()));
    }
}
