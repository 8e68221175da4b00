// SPDX-License-Identifier: GPL-2.0-or-later
//! The path of a tool change, from one offset to another.

use super::{Cycle, disturbed};
use kinematics::{Fault, Pose, Vector3};

/// A path from one offset to another, while LinuxCNC's pose stays.
#[derive(Clone, Copy)]
pub(super) struct Path {
    /// The machine's pose at the beginning, and its tool vector.
    pub(super) pose: Pose,
    pub(super) tool: Vector3<f64>,
    pub(super) travel: Vector3<f64>,
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
    /// Whether the machine has constraints: the platform then also rotates, and its pose stays while its tool vector
    /// changes.
    pub(super) turns: bool,
}

impl Path {
    /// Returns the offset after a fraction of the path, from 0 to 1.
    pub(super) fn at(&self, share: f64) -> Vector3<f64> {
        if share >= 1.0 { self.to } else { self.from + (self.to - self.from) * share }
    }

    /// Returns the machine's pose there, for the tool vector at the beginning.
    pub(super) fn pose_at(&self, share: f64) -> Pose {
        if self.turns {
            return self.pose;
        }
        Pose { position: self.pose.position + self.travel * share, ..self.pose }
    }

    /// Returns the tool vector of the machine's pose there.
    pub(super) fn tool_at(&self, share: f64) -> Vector3<f64> {
        if self.turns { self.at(share) } else { self.tool }
    }

    /// Refuses a pose that has changed although the feed is inhibited.
    pub(super) fn refuse_other_pose(&self, cycle: &Cycle<'_>, pose: &Pose) -> Result<(), Fault> {
        if cycle.is_elsewhere(&self.pose, pose) { Err(disturbed()) } else { Ok(()) }
    }
}

/// Returns the shift of the platform when the offset changes by `change` at a pose: (R − I) Δo.
pub fn shift(pose: &Pose, change: &Vector3<f64>) -> Vector3<f64> {
    pose.rotation() * change - change
}
