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

    /// Takes the extra axes' coordinates out of the pose of the tool, where legs and table hold them
    /// at 0. One that is no number leaves a pose that is none, which is refused as such.
    #[inline(never)]
    pub fn without_extra(&self, world: &World) -> [f64; 6] {
        let mut pose = [world[0], world[1], world[2], world[3], world[4], world[5]];
        let mut sum = 0.0;
        for place in self.extra().places() {
            sum += world.get(place).map_or(0.0, |value| value * 0.0);
            if let Some(value) = pose.get_mut(place) {
                *value = 0.0;
            }
        }
        pose[0] += sum;
        pose
    }

    /// Whether joints of extra axes, those behind the legs' and the table's, are numbers.
    pub fn check_extra(&mut self, joints: &[f64]) -> Result<(), Fault> {
        let Some(i) = joints.iter().position(|value| !value.is_finite()) else { return Ok(()) };
        let layout = self.layout();
        let fault = Fault::of_joint(Cause::JointNotFinite, layout, layout.joints() + i, joints[i]);
        self.calls.note_forward();
        self.refused = true;
        self.pins.fwd_kins_fail.set(true);
        self.recorded(Err(fault))
    }
}
