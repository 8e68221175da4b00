// SPDX-License-Identifier: GPL-2.0-or-later
//! What joints ask of the legs: from here on no leg kind exists.

use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, between, pair, put};
use crate::mechanism::Mechanism;

/// Joints turned into what the solver sees: moving base anchors and target lengths.
pub(crate) struct Target<const N: usize> {
    pub anchors: Lanes3<N>,
    pub length: [f64; N],
    pub joints: [f64; N],
}

impl<const N: usize> Target<N> {
    /// To be filled in by [`Mechanism::aim`].
    #[inline(always)]
    pub fn of(joints: [f64; N]) -> Self {
        Self { anchors: Lanes3::ZERO, length: [0.0; N], joints }
    }
}

impl<const N: usize> Mechanism<N> {
    /// Moving base anchors and target lengths of the joints.
    pub(crate) fn target(&self, joints: &[f64; N]) -> Result<Target<N>, Fault> {
        let mut target = Target::of(*joints);
        self.aim(&mut target)?;
        Ok(target)
    }

    /// Fills a target in for its joints.
    #[inline(always)]
    pub(crate) fn aim(&self, target: &mut Target<N>) -> Result<(), Fault> {
        for i in (0..N).step_by(2) {
            // Pair by pair: at once it would be a call of memcpy, which takes longer.
            target.anchors.put(i, self.base.pair(i));
            put(&mut target.length, i, pair(&target.joints, i) + pair(&self.offset, i));
        }
        if !self.moving && between(&target.length, 0.0, f64::MAX).all() {
            return Ok(());
        }
        self.drive(target)
    }

    /// The same leg by leg, each as its kind has it; names the one that refuses.
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
