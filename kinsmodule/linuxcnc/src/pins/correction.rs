// SPDX-License-Identifier: GPL-2.0-or-later
//! Pins of the correction of a joint.

use super::maker::Maker;
use crate::hal::{Direction, HalError, Pin};
use crate::tool::JointLimits;

/// The requested, allowed and effective correction, in joint units.
#[repr(C)]
pub struct CorrectionPins {
    pub asked: Pin<f64>,
    limit: Pin<f64>,
    rate: Pin<f64>,
    pub shown: Pin<f64>,
}

impl CorrectionPins {
    pub(super) fn create(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::{In, Out};
        for (pin, direction, name) in [
            (&mut self.asked, In, "joint-correction"),
            (&mut self.limit, In, "correction-limit"),
            (&mut self.rate, In, "correction-rate"),
            (&mut self.shown, Out, "joint-correction-eff"),
        ] {
            make.one(pin, direction, make.of_joint(name, n), 0.0)?;
        }
        Ok(())
    }

    /// Returns whether a correction is allowed.
    pub fn is_allowed(&self) -> bool {
        self.limit.get() != 0.0
    }

    /// Returns the largest correction in either direction; 0 if the pin gives no length.
    pub fn bound(&self) -> f64 {
        positive(self.limit.get())
    }

    /// Returns the largest change in a cycle.
    pub fn step(&self, seconds: f64) -> f64 {
        positive(self.rate.get() * seconds)
    }

    /// Returns the limits that remain for the motion of the joint.
    pub(super) fn room_in(&self, limits: JointLimits) -> JointLimits {
        let (bound, rate) = (self.bound(), positive(self.rate.get()));
        JointLimits {
            least: limits.least + bound,
            most: limits.most - bound,
            velocity: limits.velocity - rate,
            ..limits
        }
    }
}

/// Returns a positive finite number unchanged, otherwise 0.
fn positive(value: f64) -> f64 {
    if value > 0.0 && value.is_finite() { value } else { 0.0 }
}
