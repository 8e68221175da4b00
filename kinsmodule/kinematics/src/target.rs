// SPDX-License-Identifier: GPL-2.0-or-later
//! Targets that joints set for the legs: from here on the code does not depend on the kind of leg.

use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, between, pair, put};
use crate::mechanism::Mechanism;

/// Joint values as seen by the solver: moving base anchors and target lengths.
pub(crate) struct Target<const N: usize> {
    pub anchors: Lanes3<N>,
    pub length: [f64; N],
    pub joints: [f64; N],
}

impl<const N: usize> Target<N> {
    /// Creates a target to be filled in by [`Mechanism::aim`].
    #[inline(always)]
    pub fn of(joints: [f64; N]) -> Self {
        Self { anchors: Lanes3::ZERO, length: [0.0; N], joints }
    }
}

impl<const N: usize> Mechanism<N> {
    /// Computes moving base anchors and target lengths of the joints.
    pub(crate) fn target(&self, joints: &[f64; N]) -> Result<Target<N>, Fault> {
        let mut target = Target::of(*joints);
        self.aim(&mut target)?;
        Ok(target)
    }

    /// Fills in a target for its joints.
    #[inline(always)]
    pub(crate) fn aim(&self, target: &mut Target<N>) -> Result<(), Fault> {
        for i in (0..N).step_by(2) {
            // Pair by pair: a copy of everything would be a call of memcpy, which takes longer.
            target.anchors.put(i, self.base.pair(i));
            put(&mut target.length, i, pair(&target.joints, i) + pair(&self.offset, i));
        }
        if !self.moving && between(&target.length, 0.0, f64::MAX).all() {
            return Ok(());
        }
        self.drive(target)
    }

    /// Fills in a target leg by leg, each by its kind; names the leg that refuses.
    fn drive(&self, target: &mut Target<N>) -> Result<(), Fault> {
        for i in 0..N {
            let joint = target.joints[i];
            if !joint.is_finite() {
                return Err(Fault::of_joint(Cause::JointNotFinite, &self.layout, i, joint));
            }
            let drive = self.legs[i]
                .drive(joint + self.offset[i])
                .map_err(|cause| Fault::of_joint(cause, &self.layout, i, joint))?;
            target.anchors.set(i, self.base.get(i) + drive.displacement);
            target.length[i] = drive.length;
        }
        Ok(())
    }
}
