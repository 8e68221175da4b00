// SPDX-License-Identifier: GPL-2.0-or-later
//! The way into world mode of a machine with more legs than coordinates.
//!
//! Its joints may contradict each other a little: a home switch that is off by 0.3 mm is enough. Joint mode
//! leaves them as they are, and forward takes the pose that fits them best. The joints of that pose are
//! others, so that all would jump as LinuxCNC enters world mode and calls inverse. Here is what they differ
//! by: inverse adds it, and the monitor brings it to 0 at a low speed. Without a monitor, or without limits
//! of the joints, inverse refuses a difference that would be felt, and names the joint.

use super::Module;
use crate::tool::{JointLimits, NOTICEABLE};
use kinematics::{Cause, Fault, Joints, MAX_JOINTS, Pose};

/// Share of the speed that a joint reaches from standstill in a servo cycle.
///
/// LinuxCNC may stop the joints within a cycle whenever it changes its mode, and its interpolator makes up
/// for up to three cycles at once then: a third leaves the acceleration within the limit, and a tenth of it
/// is for a jog that begins meanwhile.
const SPEED_SHARE: f64 = 0.3;

/// What joint values differ by from those of the pose that they fit best.
pub(super) struct Contradiction {
    left: Joints,
    is_on: bool,
    /// Why inverse is refused while it lasts.
    fault: Option<Fault>,
}

impl Contradiction {
    pub(super) const NONE: Self = Self { left: [0.0; MAX_JOINTS], is_on: false, fault: None };

    #[inline(always)]
    pub(super) fn is_on(&self) -> bool {
        self.is_on
    }
}

impl Module {
    /// Keeps what the joints differ by from those of the pose found for them: for the commanded joints, in
    /// joint mode, and for the present ones while the machine is off, which then become the commanded ones.
    #[inline(always)]
    pub(super) fn note_contradiction(&mut self, joints: &Joints, found: &Pose, address: usize) {
        if self.layout().is_redundant() && (!self.handed.is_feedback(address) || self.is_off()) {
            self.contradiction = self.contradicted(joints, found).unwrap_or(Contradiction::NONE);
        }
    }

    #[inline(never)]
    fn contradicted(&self, joints: &Joints, found: &Pose) -> Option<Contradiction> {
        let machine = &self.frozen.as_ref()?.machine;
        let mut own = machine.inverse(found, &self.tool.of_machine()).ok()?;
        self.correction.add(&mut own);
        let mut left = [0.0; MAX_JOINTS];
        let (mut worst, mut largest) = (0, 0.0);
        let pairs = joints.iter().zip(&own).take(self.layout().joints());
        for (i, (to, (joint, own))) in left.iter_mut().zip(pairs).enumerate() {
            *to = joint - own;
            if !(f64::abs(*to) <= largest) {
                (worst, largest) = (i, f64::abs(*to));
            }
        }
        let is_felt = machine.travel(joints, &own) > NOTICEABLE * machine.size();
        let can_ramp = self.is_monitored
            && self
                .pins
                .limits(&self.load)
                .iter()
                .take(self.layout().joints())
                .all(JointLimits::are_known);
        let cause = Cause::JointsInconsistent;
        let fault =
            (is_felt && !can_ramp).then(|| Fault::of_joint(cause, self.layout(), worst, largest));
        Some(Contradiction { left, is_on: can_ramp || fault.is_some(), fault })
    }

    /// Adds to the joints of a pose what those of joint mode differ by.
    ///
    /// # Errors
    /// `JointsInconsistent`, with the joint that differs most.
    // Most machines never come here.
    #[cold]
    #[inline(never)]
    pub(super) fn contradicted_joints(&self, joints: &mut [f64]) -> Result<(), Fault> {
        // Also with `.machine-on` still low: LinuxCNC raises it after the cycle in which it begins to command.
        let Contradiction { left, fault, .. } = &self.contradiction;
        if let Some(fault) = fault {
            return Err(*fault);
        }
        joints.iter_mut().zip(left).for_each(|(joint, own)| *joint += own);
        Ok(())
    }

    /// Brings the joints nearer to those of the commanded pose, in a cycle of world mode.
    #[inline(always)]
    pub(super) fn settle_contradiction(&mut self, is_commanded: bool, seconds: f64) {
        if self.contradiction.is_on && is_commanded && self.contradiction.fault.is_none() {
            self.contradiction_settled(seconds);
        }
    }

    // A frame of its own: a cycle that freezes a geometry needs none of it.
    #[cold]
    #[inline(never)]
    fn contradiction_settled(&mut self, seconds: f64) {
        let limits = self.pins.limits(&self.load);
        let mut cycles = 0.0;
        for (left, limits) in self.contradiction.left.iter().zip(&limits) {
            let speed = (SPEED_SHARE * limits.acceleration * seconds).min(limits.velocity);
            let own = left.abs() / (speed * seconds);
            if !(own <= cycles) {
                cycles = own;
            }
        }
        let kept = if cycles > 1.0 { 1.0 - 1.0 / cycles } else { 0.0 };
        self.contradiction.left.iter_mut().for_each(|left| *left *= kept);
        self.contradiction.is_on = kept > 0.0;
    }

    /// Whether the joints are on their way to those of the commanded pose, so that nothing else may move.
    pub(super) fn is_settling(&self) -> bool {
        self.contradiction.is_on && self.contradiction.fault.is_none()
    }
}
