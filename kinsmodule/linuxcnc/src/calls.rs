// SPDX-License-Identifier: GPL-2.0-or-later
//! The kinematics calls of a servo cycle, and the pose commanded in it.

use kinematics::Pose;

/// The kinematics calls of a servo cycle.
///
/// **The rule**: the commanded pose of a cycle is the one of the first inverse after the last
/// forward. LinuxCNC's motion controller calls forward for the feedback first, then inverse for the commanded pose in
/// world mode, or forward again for the commanded joints in joint mode. Its command handler calls inverse for the end
/// points of queued moves: before the controller, or after it if a HAL file adds the two in reverse order. A cycle may
/// have no commanded pose: in joint mode, with the machine off, and between two points of a slower trajectory period.
#[derive(Clone, Copy, Default)]
pub struct Calls {
    /// Whether the next inverse is for the commanded pose.
    awaits_command: bool,
    /// Whether the last forward followed another without an inverse between them.
    repeated: bool,
    /// The pose commanded since the last forward.
    commanded: Option<Pose>,
    /// The pose commanded in the cycle before.
    before: Option<Pose>,
}

impl Calls {
    pub fn note_forward(&mut self) {
        self.repeated = self.awaits_command;
        self.awaits_command = true;
        // The monitor, if it runs, has already ended the cycle.
        if self.commanded.is_some() || self.repeated {
            self.before = self.commanded.take();
        }
    }

    /// Returns whether the next inverse is for the commanded pose.
    pub fn awaits_command(&self) -> bool {
        self.awaits_command
    }

    /// Notes a call of inverse; returns whether it is for the commanded pose.
    pub fn takes_command(&mut self) -> bool {
        core::mem::take(&mut self.awaits_command)
    }

    /// Notes a call of inverse with the machine's kinematics.
    pub fn note_inverse(&mut self, pose: &Pose) {
        if self.takes_command() {
            self.commanded = Some(*pose);
        }
    }

    /// Returns whether the current forward is for the commanded joints: the second of a cycle. LinuxCNC calls
    /// it in joint mode, and as it leaves that mode, to continue from that pose.
    pub fn is_for_commanded_joints(&self) -> bool {
        self.repeated
    }

    /// Returns the pose commanded in the cycle before the current forward: the last one that its joints can have
    /// followed.
    pub fn commanded_before(&self) -> Option<&Pose> {
        self.before.as_ref()
    }

    /// Returns whether a pose has been commanded in this cycle.
    pub fn has_commanded(&self) -> bool {
        self.commanded.is_some()
    }

    /// Ends a cycle, as the monitor runs after all its calls; returns the pose commanded in it.
    pub fn end_cycle(&mut self) -> Option<Pose> {
        // An inverse before the next forward is for the end point of a queued move.
        self.awaits_command = false;
        self.before = self.commanded.take();
        self.before
    }
}
