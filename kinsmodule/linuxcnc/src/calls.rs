// SPDX-License-Identifier: GPL-2.0-or-later
//! Which kinematics calls a servo cycle has brought, and the pose commanded in it.

use kinematics::Pose;

/// The kinematics calls of a servo cycle.
///
/// **The rule**: the commanded pose of a cycle is the one of the first inverse after the last
/// forward. LinuxCNC's motion controller calls forward for the feedback first, then inverse for the
/// commanded pose in world mode, or forward once more for the commanded joints in joint mode. Its
/// command handler calls inverse for the end points of queued moves: before the controller, or after
/// it where a HAL file adds the two the other way round. A cycle may have no commanded pose: in joint
/// mode, with the machine off, and between two points of a slower trajectory period.
#[derive(Clone, Copy, Default)]
pub struct Calls {
    /// Whether the next inverse is the one for the commanded pose.
    awaits_command: bool,
    /// Whether the last forward came after another without an inverse between them.
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
        // The monitor, where it runs, has ended the cycle already.
        if self.commanded.is_some() || self.repeated {
            self.before = self.commanded.take();
        }
    }

    /// Whether the next inverse is the one for the commanded pose.
    pub fn awaits_command(&self) -> bool {
        self.awaits_command
    }

    /// A call of inverse: whether it is the one for the commanded pose.
    pub fn takes_command(&mut self) -> bool {
        core::mem::take(&mut self.awaits_command)
    }

    /// A call of inverse with the machine's kinematics.
    pub fn note_inverse(&mut self, pose: &Pose) {
        if self.takes_command() {
            self.commanded = Some(*pose);
        }
    }

    /// Whether the current forward is for the commanded joints: the second of a cycle. LinuxCNC calls
    /// it in joint mode, and as it leaves that mode, to go on from that pose.
    pub fn is_for_commanded_joints(&self) -> bool {
        self.repeated
    }

    /// The pose commanded in the cycle before the current forward: the last that its joints can have
    /// followed.
    pub fn commanded_before(&self) -> Option<&Pose> {
        self.before.as_ref()
    }

    /// Returns whether a pose has been commanded in this cycle.
    pub fn has_commanded(&self) -> bool {
        self.commanded.is_some()
    }

    /// The monitor runs, after all calls of a cycle: the pose that was commanded in it.
    pub fn end_cycle(&mut self) -> Option<Pose> {
        // An inverse before the next forward is for the end point of a queued move.
        self.awaits_command = false;
        self.before = self.commanded.take();
        self.before
    }
}
