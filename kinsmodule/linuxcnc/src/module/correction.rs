// SPDX-License-Identifier: GPL-2.0-or-later
//! Corrections of the joints while the machine runs, for the changes of leg length from heat and weight.
//!
//! LinuxCNC's joint values are those of the kinematics plus the correction in effect. It follows
//! the values on the pins at a limited rate, within a limit for which the joint limits are narrowed:
//! every proof is about the joint values of the kinematics, and remains valid.

use super::{Kind, Module};
use crate::pins::CorrectionPins;
use kinematics::{Cause, Fault, Joints, MAX_JOINTS};

/// The correction added to the joint values now.
pub(super) struct Correction {
    in_effect: Joints,
    /// Whether any value is not 0.
    is_on: bool,
}

impl Correction {
    pub(super) const NONE: Self = Self { in_effect: [0.0; MAX_JOINTS], is_on: false };

    /// Adds the correction to joint values of the kinematics.
    pub(super) fn add(&self, joints: &mut Joints) {
        // Without a correction the values stay identical bit by bit.
        if !self.is_on {
            return;
        }
        joints.iter_mut().zip(&self.in_effect).for_each(|(joint, own)| *joint += own);
    }

    /// Returns LinuxCNC's joint values minus the correction.
    pub(super) fn taken_from(&self, joints: &[f64]) -> Joints {
        let mut own = joints.iter().zip(&self.in_effect).map(|(joint, added)| joint - added);
        core::array::from_fn(|_| own.next().unwrap_or(0.0))
    }
}

impl Module {
    /// Moves the correction in effect toward the requested one, once a cycle. A request beyond its
    /// limit, or NaN, changes nothing.
    pub(super) fn advance_correction(&mut self, seconds: f64) {
        let mut pins = self.pins.corrections(self.load.layout.joints());
        let is_wanted = self.correction.is_on || pins.any(CorrectionPins::is_allowed);
        if !is_wanted || self.kind != Kind::Machine {
            return;
        }
        let Correction { in_effect, is_on } = &mut self.correction;
        let mut refused = None;
        *is_on = false;
        let pins = self.pins.corrections(self.load.layout.joints());
        for (i, (pins, own)) in pins.zip(in_effect).enumerate() {
            let (asked, limit) = (pins.asked.get(), pins.bound());
            let is_within = asked.abs() <= limit;
            if !is_within && limit > 0.0 {
                refused = refused.or(Some((i, asked)));
            }
            // A reduced limit also applies to the correction in effect.
            let wanted = if is_within { asked } else { own.max(-limit).min(limit) };
            let step = pins.step(seconds);
            // This cycle's joint values contain the old correction; the new one applies from the next cycle.
            let shown = *own;
            pins.shown.set(shown);
            *own += (wanted - *own).max(-step).min(step);
            *is_on |= *own != 0.0 || shown != 0.0;
        }
        if let Some((i, asked)) = refused {
            let cause = Cause::CorrectionBeyond;
            self.record(&Fault::of_joint(cause, self.layout(), i, asked));
        }
    }
}
