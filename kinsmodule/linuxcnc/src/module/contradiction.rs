// SPDX-License-Identifier: GPL-2.0-or-later
//! The change to world mode of a machine with more legs than coordinates.
//!
//! Its joints may be slightly inconsistent: a home switch that is off by 0.3 mm is enough. Joint mode
//! leaves them unchanged, and forward finds the pose that fits them best. The joints of that pose
//! differ, so that all joints would jump as LinuxCNC enters world mode and calls inverse. This module keeps
//! the difference: inverse adds it, and the monitor reduces it to 0 at a low speed. Without a monitor, or
//! without limits of the joints, inverse refuses a noticeable difference, and names the joint.

use super::{Module, joints_of};
use crate::tool::{IMPERCEPTIBLE, JointLimits, NOTICEABLE};
use kinematics::{Cause, Fault, Joints, MAX_JOINTS, Pose};

/// The difference of joint values from those of the pose that fits them best.
pub(super) struct Contradiction {
    left: Joints,
    is_on: bool,
    /// Whether the joints are moving to those of the commanded pose.
    is_settling: bool,
    /// Why inverse is refused while it lasts.
    fault: Option<Fault>,
}

impl Contradiction {
    pub(super) const NONE: Self =
        Self { left: [0.0; MAX_JOINTS], is_on: false, is_settling: false, fault: None };

    pub(super) fn is_on(&self) -> bool {
        self.is_on
    }
}

impl Module {
    /// Keeps the difference of the joints from those of the pose found for them: for the commanded joints, in
    /// joint mode, and for the present ones while the machine is off, which then become the commanded ones.
    pub(super) fn note_contradiction(&mut self, joints: &[f64], found: &Pose, address: usize) {
        if self.layout().is_redundant() && (!self.handed.is_feedback(address) || self.is_off()) {
            self.contradiction = self.contradicted(joints, found).unwrap_or(Contradiction::NONE);
        }
    }

    fn contradicted(&self, joints: &[f64], found: &Pose) -> Option<Contradiction> {
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
        let way = machine.travel(&joints_of(joints), &own);
        if way <= IMPERCEPTIBLE * machine.size() {
            return None;
        }
        let limits = self.pins.limits(&self.load);
        let mut of_joints = limits.iter().take(self.layout().joints());
        let can_settle = self.is_monitored && of_joints.all(JointLimits::are_known);
        let is_refused = !can_settle && way > NOTICEABLE * machine.size();
        let cause = Cause::JointsInconsistent;
        let fault = is_refused.then(|| Fault::of_joint(cause, self.layout(), worst, largest));
        Some(Contradiction { left, is_on: can_settle || is_refused, is_settling: false, fault })
    }

    /// Adds the difference from joint mode to the joints of a pose.
    ///
    /// # Errors
    /// `JointsInconsistent`, with the joint that differs most.
    pub(super) fn contradicted_joints(&self, joints: &mut [f64]) -> Result<(), Fault> {
        // Also with `.machine-on` still low: LinuxCNC raises it after the cycle in which it begins to command.
        let Contradiction { left, fault, .. } = &self.contradiction;
        if let Some(fault) = fault {
            return Err(*fault);
        }
        joints.iter_mut().zip(left).for_each(|(joint, own)| *joint += own);
        Ok(())
    }

    /// Moves the joints toward those of the commanded pose, in a cycle of world mode.
    pub(super) fn settle_contradiction(&mut self, is_commanded: bool, seconds: f64) {
        let Contradiction { is_on, fault, .. } = &self.contradiction;
        self.contradiction.is_settling = *is_on && is_commanded && fault.is_none();
        if !self.contradiction.is_settling {
            return;
        }
        let limits = self.pins.limits(&self.load);
        let mut cycles = 0.0;
        for (left, limits) in self.contradiction.left.iter().zip(&limits) {
            let own = left.abs() / (limits.stoppable_speed(seconds) * seconds);
            if !(own <= cycles) {
                cycles = own;
            }
        }
        let kept = if cycles > 1.0 { 1.0 - 1.0 / cycles } else { 0.0 };
        self.contradiction.left.iter_mut().for_each(|left| *left *= kept);
        self.contradiction.is_on = kept > 0.0;
    }

    /// Returns whether the joints are moving to those of the commanded pose, so that no other motion may
    /// begin.
    pub(super) fn is_settling(&self) -> bool {
        self.contradiction.is_settling
    }
}
