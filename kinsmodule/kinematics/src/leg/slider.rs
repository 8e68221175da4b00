// SPDX-License-Identifier: GPL-2.0-or-later
//! Rod of fixed length on a carriage that runs along a straight guide.
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
//! guide: where that is negative the rod does not reach. With u = (p − c)/L,
//! u · e = −side √(…)/L, hence u · ṗ = (u · e) q'.

use super::{Drive, LEAST_DRIVE, Refusal, direction, rod_length, side_sign};
use crate::fault::Cause;
use libm::sqrt;
use nalgebra::Vector3;

/// What belongs to a slider beside its two anchors; the base anchor is the point of the
/// guide with joint value 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliderGeometry {
    /// Direction of the guide in base, towards growing joint values; any length.
    pub guide: [f64; 3],
    /// Length of the rod, machine units.
    pub rod: f64,
    /// Which of the two carriage places, seen along the guide: +1 the one ahead of the
    /// platform anchor, −1 the one behind.
    pub side: i32,
}

/// A checked slider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slider {
    guide: Vector3<f64>,
    rod: f64,
    side: f64,
}

impl Slider {
    pub fn new(given: &SliderGeometry) -> Result<Self, Refusal> {
        Ok(Self {
            guide: direction(&given.guide).ok_or((Cause::GuideZero, 0.0))?,
            rod: rod_length(given.rod)?,
            side: side_sign(given.side)?,
        })
    }

    #[inline]
    pub fn joint(&self, w: &Vector3<f64>) -> Result<f64, Refusal> {
        let along = self.guide.dot(w);
        let from_guide = (w - self.guide * along).norm();
        // (L − h)(L + h) keeps the digits that L² − h² loses near the dead point.
        let squared = (self.rod - from_guide) * (self.rod + from_guide);
        if !(squared >= 0.0) {
            return Err((Cause::OutOfReach, from_guide - self.rod));
        }
        let root = sqrt(squared);
        if !(root >= LEAST_DRIVE * self.rod) {
            return Err((Cause::DeadPoint, root / self.rod));
        }
        Ok(along + self.side * root)
    }

    #[inline]
    pub fn drive(&self, q: f64) -> Drive {
        Drive { displacement: self.guide * q, length: self.rod }
    }

    #[inline]
    pub fn gain(&self, u: &Vector3<f64>) -> f64 {
        u.dot(&self.guide)
    }

    #[inline]
    pub fn margin(&self, gain: f64) -> f64 {
        -self.side * gain
    }
}
