// SPDX-License-Identifier: GPL-2.0-or-later
//! The path of a tool change, from one offset to another.

use super::disturbed;
use kinematics::{Fault, Pose, Vector3};

/// From one offset to another at a pose that stays.
#[derive(Clone, Copy)]
pub(super) struct Path {
    pub(super) pose: Pose,
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
}

impl Path {
    /// The offset after a share of the path, from 0 to 1.
    pub(super) fn at(&self, share: f64) -> Vector3<f64> {
        if share >= 1.0 { self.to } else { self.from + (self.to - self.from) * share }
    }

    /// Refuses a pose that has changed although the feed is inhibited.
    pub(super) fn refuse_other_pose(&self, pose: &Pose) -> Result<(), Fault> {
        if *pose == self.pose { Ok(()) } else { Err(disturbed()) }
    }
}

/// How far the platform shifts when the offset changes by `change` at a pose: (R − I) Δo.
pub fn shift(pose: &Pose, change: &Vector3<f64>) -> Vector3<f64> {
    pose.rotation() * change - change
}
