// SPDX-License-Identifier: GPL-2.0-or-later
//! The path of a tool change, from one offset to another.

use super::{Cycle, disturbed};
use kinematics::{Fault, Pose, Vector3};

/// From one offset to another at a pose of LinuxCNC's that stays.
#[derive(Clone, Copy)]
pub(super) struct Path {
    /// The machine's pose at the beginning, and the tool vector that it belongs to.
    pub(super) pose: Pose,
    pub(super) tool: Vector3<f64>,
    pub(super) travel: Vector3<f64>,
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
}

impl Path {
    /// The offset after a share of the path, from 0 to 1.
    pub(super) fn at(&self, share: f64) -> Vector3<f64> {
        if share >= 1.0 { self.to } else { self.from + (self.to - self.from) * share }
    }

    /// The machine's pose there, for the tool vector at the beginning.
    pub(super) fn pose_at(&self, share: f64) -> Pose {
        Pose { position: self.pose.position + self.travel * share, ..self.pose }
    }

    /// Refuses a pose that has changed although the feed is inhibited.
    pub(super) fn refuse_other_pose(&self, cycle: &Cycle<'_>, pose: &Pose) -> Result<(), Fault> {
        if cycle.is_elsewhere(&self.pose, pose) { Err(disturbed()) } else { Ok(()) }
    }
}

/// How far the platform shifts when the offset changes by `change` at a pose: (R − I) Δo.
pub fn shift(pose: &Pose, change: &Vector3<f64>) -> Vector3<f64> {
    pose.rotation() * change - change
}
