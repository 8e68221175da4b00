// SPDX-License-Identifier: GPL-2.0-or-later
//! Pins of the correction of a joint.

use super::maker::Maker;
use crate::hal::{Direction, HalError, Pin};
use crate::tool::JointLimits;

/// What is asked, allowed and in effect, in joint units.
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

    /// Whether there may be one.
    pub fn is_allowed(&self) -> bool {
        self.limit.get() != 0.0
    }

    /// The largest correction, either way; 0 where the pin gives no length.
    pub fn bound(&self) -> f64 {
        positive(self.limit.get())
    }

    /// How much it may change in a cycle.
    pub fn step(&self, seconds: f64) -> f64 {
        positive(self.rate.get() * seconds)
    }

    /// What the limits of the joint leave to its motion.
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

/// A number that is more than 0 and finite, or 0.
fn positive(value: f64) -> f64 {
    if value > 0.0 && value.is_finite() { value } else { 0.0 }
}
