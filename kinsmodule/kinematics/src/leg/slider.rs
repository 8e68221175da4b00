// SPDX-License-Identifier: GPL-2.0-or-later
//! Rod of fixed length on a carriage that moves along a straight guide.
//!
//! c(q) = g + q e, d = L, with the guide through g (the base anchor) along the unit
//! vector e. For w = p − g and s = e · w (papers 000 and 003, in the form that holds for
//! a guide of any direction; paper 003 equation 5):
//!
//! ```text
//! q = s + side √(L² − |w|² + s²)
//! ```
//!
//! The root's argument is L² minus the squared distance of the platform anchor from the
//! guide: if it is negative, the rod does not reach. With u = (p − c)/L,
//! u · e = −side √(…)/L, hence u · ṗ = (u · e) q'.

use super::{Drive, LEAST_DRIVE, Refusal, direction, rod_length, side_sign};
use crate::fault::Cause;
use libm::sqrt;
use nalgebra::Vector3;

/// Parameters of a slider besides its two anchors; the base anchor is the point of the
/// guide at joint value 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliderGeometry {
    /// Direction of the guide in base, towards increasing joint values; any length.
    pub guide: [f64; 3],
    /// Length of the rod, machine units.
    pub rod: f64,
    /// Which of the two carriage positions, seen along the guide: +1 ahead of the
    /// platform anchor, −1 behind it.
    pub side: i32,
}

/// A checked slider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slider {
    pub guide: Vector3<f64>,
    pub rod: f64,
    pub side: f64,
    /// −side · guide, divided by the rod's length.
    pub towards: Vector3<f64>,
    /// Square of the smallest root at which the joint drives the leg.
    pub least_square: f64,
}

impl Slider {
    pub fn new(given: &SliderGeometry) -> Result<Self, Refusal> {
        let guide = direction(&given.guide).ok_or((Cause::GuideZero, 0.0))?;
        let rod = rod_length(given.rod)?;
        let side = side_sign(given.side)?;
        let least = LEAST_DRIVE * rod;
        Ok(Self { guide, rod, side, towards: guide * (-side / rod), least_square: least * least })
    }

    pub fn joint(&self, w: &Vector3<f64>) -> Result<f64, Refusal> {
        let along = self.guide.dot(w);
        let apart = w - self.guide * along;
        let squared = self.rod * self.rod - apart.norm_squared();
        if squared >= self.least_square {
            return Ok(along + self.side * sqrt(squared));
        }
        self.refused(apart.norm())
    }

    /// Returns why an anchor at this distance from the guide has no joint value.
    fn refused(&self, from_guide: f64) -> Result<f64, Refusal> {
        let squared = (self.rod - from_guide) * (self.rod + from_guide);
        if !(squared >= 0.0) {
            return Err((Cause::OutOfReach, from_guide - self.rod));
        }
        Err((Cause::DeadPoint, sqrt(squared) / self.rod))
    }

    pub fn drive(&self, q: f64) -> Drive {
        Drive { displacement: self.guide * q, length: self.rod, towards: self.towards }
    }

    pub fn transmission(&self, u: &Vector3<f64>) -> f64 {
        u.dot(&self.guide)
    }

    pub fn margin(&self, transmission: f64) -> f64 {
        -self.side * transmission
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few roundings of numbers below 20.
    const ROUNDING: f64 = 1e-14;

    /// Creates a guide along the diagonal of a square, with a rod of 5.
    fn slider(side: i32) -> Slider {
        Slider::new(&SliderGeometry { guide: [2.0, 2.0, 0.0], rod: 5.0, side }).expect("a slider")
    }

    /// Returns an anchor at this distance along and from the guide.
    fn anchor(along: f64, off: f64) -> Vector3<f64> {
        let diagonal = core::f64::consts::FRAC_1_SQRT_2;
        Vector3::new(along * diagonal, along * diagonal, off)
    }

    #[test]
    fn the_carriage_stands_where_pythagoras_says_on_either_side() {
        for (side, expected) in [(1, 11.0), (-1, 3.0)] {
            let joint = slider(side).joint(&anchor(7.0, 3.0)).expect("within reach");
            assert!((joint - expected).abs() < ROUNDING, "{joint} {expected}");
        }
    }

    #[test]
    fn missing_length_and_weak_drive_of_a_rod_are_reported() {
        let reported = |off| slider(1).joint(&anchor(7.0, off)).expect_err("refused");
        let (cause, lacks) = reported(5.5);
        assert_eq!(cause, Cause::OutOfReach);
        assert!((lacks - 0.5).abs() < ROUNDING, "{lacks}");
        // The root of 5² − 4.995² is 0.0447 of 5; the limit is 0.05.
        let (cause, drive) = reported(4.995);
        assert_eq!(cause, Cause::DeadPoint);
        // The root of a difference that loses three digits.
        assert!((drive - sqrt(1.0 - 0.999 * 0.999)).abs() < 1e3 * ROUNDING, "{drive}");
        assert!(slider(1).joint(&anchor(7.0, 5.0 * 0.9987)).is_ok());
    }
}
