// SPDX-License-Identifier: GPL-2.0-or-later
//! Extra axes: joints that pass a coordinate of LinuxCNC's pose through.

use super::Module;
use kinematics::{Cause, ExtraAxes, Fault};

/// Coordinates of LinuxCNC's pose: X Y Z A B C U V W.
pub type World = [f64; 9];

impl Module {
    /// The extra axes.
    #[inline(always)]
    pub fn extra(&self) -> &ExtraAxes {
        &self.load.extra
    }

    /// Takes the coordinates of extra axes and of a second mechanism out of the pose of the tool, where
    /// legs and table hold them at 0. One of an extra axis that is no number leaves a pose that is none,
    /// which is refused as such.
    #[inline(never)]
    pub fn without_extra(&self, world: &World) -> [f64; 6] {
        let mut pose = [world[0], world[1], world[2], world[3], world[4], world[5]];
        for place in self.load.other_places() {
            if let Some(value) = pose.get_mut(place) {
                *value = 0.0;
            }
        }
        let values = self.extra().places().filter_map(|place| world.get(place));
        pose[0] += values.map(|value| value * 0.0).sum::<f64>();
        pose
    }

    /// Whether joints of extra axes, those behind all others, are numbers.
    pub fn check_extra(&mut self, joints: &[f64]) -> Result<(), Fault> {
        let Some(i) = joints.iter().position(|value| !value.is_finite()) else { return Ok(()) };
        let number = self.load.first_extra_joint() + i;
        let fault = Fault::of_joint(Cause::JointNotFinite, self.layout(), number, joints[i]);
        self.skip_forward();
        self.recorded(Err(fault))
    }

    /// A forward call that is refused for what is not the mechanism's.
    pub fn skip_forward(&mut self) {
        self.calls.note_forward();
        self.note_refusal();
    }

    /// Forward was refused: LinuxCNC may hand its NaN over to inverse.
    pub fn note_refusal(&mut self) {
        self.refused = true;
        self.pins.fwd_kins_fail.set(true);
    }
}
