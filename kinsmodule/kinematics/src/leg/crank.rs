// SPDX-License-Identifier: GPL-2.0-or-later
//! Rod of fixed length on the end of an arm that rotates about a fixed axis (rotary delta).
//!
//! c(θ) = g + m(θ), d = L, where m(θ) is the arm m₀ rotated by θ about the unit axis k
//! through the hip g (the base anchor), right-handed. With m⊥ = m₀ − (k·m₀)k,
//! w = p − g, a = w·m⊥, b = w·(k×m⊥), |w − m(θ)| = L becomes
//!
//! ```text
//! a cos θ + b sin θ = T,   T = (|w|² + |m₀|² − L²)/2 − (k·m₀)(k·w)
//! θ = atan2(b, a) + side acos(T/√(a²+b²))
//! ```
//!
//! with no solution if |T| > √(a²+b²). The two angles are added as complex numbers, so
//! that θ lies within ±180° and jumps only where the arm points opposite to m₀: a sum of
//! arcs would jump by a full turn wherever the anchor crosses the far side of the hip. With
//! u = (p − c)/L, u · ∂c/∂θ = −side √(a²+b²−T²)/L. Joint values are in degrees, so that
//! ∂c/∂q = (π/180) k × m(θ).

use super::{Drive, LEAST_DRIVE, Refusal, SecondDerivatives, direction, rod_length, side_sign};
use crate::fault::Cause;
use crate::trig::{RADIANS, arc_all_around, sincos_of_one};
use libm::sqrt;
use nalgebra::Vector3;

/// Arms nearer to their axis than this share of their length do not move their end.
const LEAST_ARM: f64 = 1e-6;

/// Largest angle that forward accepts for an arm, degrees from 0. Inverse returns no angle beyond half a
/// turn: the first cycle of world mode would command a full turn back. The excess covers rounding.
const MOST_TURNED: f64 = 180.0 + 1e-9;

/// Parameters of a crank besides its two anchors; the base anchor is its hip, a point
/// on the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrankGeometry {
    /// Direction of the axis in base; any length. Positive angles rotate the arm
    /// right-handed about it.
    pub axis: [f64; 3],
    /// From the hip to the end of the arm at 0 degrees, in base, machine units.
    pub arm: [f64; 3],
    /// Length of the rod, machine units.
    pub rod: f64,
    /// Which of the two arm angles: +1 the larger one, −1 the smaller.
    pub side: i32,
}

/// A checked crank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crank {
    axis: Vector3<f64>,
    /// Component of the arm along the axis, signed.
    along: f64,
    /// Component of the arm perpendicular to the axis, at 0 and at 90 degrees.
    across: [Vector3<f64>; 2],
    arm: f64,
    rod: f64,
    side: f64,
    /// side, divided by the lengths of arm and rod.
    towards: f64,
}

impl Crank {
    pub fn new(given: &CrankGeometry) -> Result<Self, Refusal> {
        let axis = direction(&given.axis).ok_or((Cause::ArmZero, 0.0))?;
        let whole = Vector3::from(given.arm);
        let along = axis.dot(&whole);
        let across = whole - axis * along;
        let arm = across.norm();
        if !(arm > LEAST_ARM * whole.norm()) {
            return Err((Cause::ArmZero, arm));
        }
        let rod = rod_length(given.rod)?;
        let side = side_sign(given.side)?;
        let towards = side / (arm * rod);
        Ok(Self { axis, along, across: [across, axis.cross(&across)], arm, rod, side, towards })
    }

    pub fn joint(&self, w: &Vector3<f64>) -> Result<f64, Refusal> {
        let [s, c] = self.arm_towards(w)?;
        Ok(arc_all_around(s, c) / RADIANS)
    }

    /// Computes a vector in the direction of the arm, in components along the 90 and 0 degree directions.
    #[inline(always)]
    pub fn arm_towards(&self, w: &Vector3<f64>) -> Result<[f64; 2], Refusal> {
        let a = w.dot(&self.across[0]);
        let b = w.dot(&self.across[1]);
        let reach = a * a + b * b;
        // |w − along k|² + arm² − L² over 2: the same T without cancellation.
        let apart = w - self.axis * self.along;
        let t = (apart.norm_squared() + self.arm * self.arm - self.rod * self.rod) * 0.5;
        let squared = reach - t * t;
        let least = LEAST_DRIVE * self.arm * self.rod;
        if !(squared >= least * least) {
            return Err(self.refused(apart, sqrt(reach), t));
        }
        let turned = self.side * sqrt(squared);
        Ok([b * t + a * turned, a * t - b * turned])
    }

    /// Returns why an anchor at `apart` from the center of the circle has no joint value.
    fn refused(&self, apart: Vector3<f64>, reach: f64, t: f64) -> Refusal {
        let squared = (reach - t) * (reach + t);
        if !(squared >= 0.0) {
            return (Cause::OutOfReach, self.missing(&apart, reach / self.arm));
        }
        (Cause::DeadPoint, sqrt(squared) / (self.arm * self.rod))
    }

    /// Computes the length missing between the rod and an anchor at `apart` from the center of the arm end's
    /// circle, `from_axis` away from the axis; negative if the rod is too long.
    fn missing(&self, apart: &Vector3<f64>, from_axis: f64) -> f64 {
        let above = self.axis.dot(apart);
        let from = |across: f64| sqrt(across * across + above * above);
        let nearest = from(from_axis - self.arm);
        if nearest > self.rod {
            return nearest - self.rod;
        }
        from(from_axis + self.arm) - self.rod
    }

    pub fn drive(&self, q: f64) -> Result<Drive, Cause> {
        if !(q.abs() <= MOST_TURNED) {
            return Err(Cause::JointAngleTooLarge);
        }
        let [s, c] = sincos_of_one(q * RADIANS);
        let displacement = self.axis * self.along + self.across[0] * c + self.across[1] * s;
        let towards = (self.across[0] * s - self.across[1] * c) * self.towards;
        Ok(Drive { displacement, length: self.rod, towards })
    }

    pub fn transmission(&self, q: f64, u: &Vector3<f64>) -> f64 {
        let [s, c] = sincos_of_one(q * RADIANS);
        u.dot(&((self.across[1] * c - self.across[0] * s) * RADIANS))
    }

    pub fn margin(&self, transmission: f64) -> f64 {
        -self.side * transmission / (self.arm * RADIANS)
    }

    pub fn rod(&self) -> f64 {
        self.rod
    }

    /// Returns the rod's length divided by the arm's.
    pub fn ratio(&self) -> f64 {
        self.rod / self.arm
    }

    pub fn second_derivatives(&self, dq: f64) -> SecondDerivatives {
        let turn = (dq * RADIANS).abs();
        SecondDerivatives { turn, anchor: self.arm * turn * turn, length: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few roundings of numbers below 10.
    const ROUNDING: f64 = 1e-14;

    /// Creates an arm of 3 perpendicular to the axis Z and 2 along it, with a rod of 5.
    fn crank() -> Crank {
        let given =
            CrankGeometry { axis: [0.0, 0.0, 4.0], arm: [3.0, 0.0, 2.0], rod: 5.0, side: 1 };
        Crank::new(&given).expect("a crank")
    }

    #[test]
    fn the_arm_stands_where_the_triangle_says() {
        // The arm along Y, its end at (0, 3, 2), and the rod perpendicular to it.
        let joint = crank().joint(&Vector3::new(5.0, 3.0, 2.0)).map(|q| q - 90.0);
        assert!(joint.is_ok_and(|off| off.abs() < 10.0 * ROUNDING), "{joint:?}");
    }

    #[test]
    fn a_rod_that_only_just_reaches_is_at_its_dead_point_and_not_out_of_reach() {
        // 3 + 5 from the axis, in the plane of the circle: within reach, but at the dead point.
        let reported = crank().joint(&Vector3::new(0.0, 8.0, 2.0));
        assert_eq!(reported, Err((Cause::DeadPoint, 0.0)));
        let (cause, lacks) = crank().joint(&Vector3::new(0.0, 8.5, 2.0)).expect_err("refused");
        assert_eq!(cause, Cause::OutOfReach);
        assert!((lacks - 0.5).abs() < ROUNDING, "{lacks}");
        let (cause, lacks) = crank().joint(&Vector3::new(1.5, 0.0, 2.0)).expect_err("refused");
        assert_eq!(cause, Cause::OutOfReach);
        assert!((lacks + 0.5).abs() < ROUNDING, "{lacks}");
    }

    #[test]
    fn the_end_of_the_arm_bends_as_on_its_circle() {
        let second = crank().second_derivatives(-60.0);
        let turn = core::f64::consts::FRAC_PI_3;
        assert!((second.turn - turn).abs() < ROUNDING, "{}", second.turn);
        assert!((second.anchor - 3.0 * turn * turn).abs() < ROUNDING, "{}", second.anchor);
        assert_eq!(second.length, 0.0);
    }
}
