// SPDX-License-Identifier: GPL-2.0-or-later
//! Input data of the plots of a motion.

use kinematics::{Joints, MAX_EXTRA, PerLeg, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use program::timeline::AllJoints;

/// One servo cycle. Lengths in machine units, angles in degrees; 0 beyond the last joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds since the first line.
    pub time: f64,
    /// Whether the machine is homed and in world mode: the joints follow the pose.
    pub in_world: bool,
    /// Commanded pose x y z a b c.
    pub pose: [f64; 6],
    /// Commanded joints, before LinuxCNC smooths them.
    pub joints: Joints,
    /// Motor positions after this cycle's command; for a joint that is homing, from power-up.
    pub motors: Joints,
    /// Joint values of the extra axes; poses do not include these coordinates.
    pub extra: [f64; MAX_EXTRA],
    /// Largest difference between an extra axis's coordinate and its joint.
    pub passed: f64,
    /// Forward solution of the motor positions of the previous cycle.
    pub forward: [f64; 6],
    /// Nut corrections published by the module, 0 for legs that are not struts.
    pub corrections: PerLeg,
    /// Tool vector, spindle offset included.
    pub tool: [f64; 3],
    /// The tip on the work, and the direction from it to the holder, if axes carry something.
    pub on_work: Option<[[f64; 3]; 2]>,
    /// Iterations of the last forward call.
    pub iterations: f64,
    /// Largest leg residual of the last forward call.
    pub residual: f64,
}

impl Sample {
    /// Returns the commands of all joints: legs, table, then extra axes.
    pub(super) fn commands(&self, config: &Mechanism) -> AllJoints {
        let own = config.joints.len();
        std::array::from_fn(|i| {
            if i < own { self.joints[i] } else { *self.extra.get(i - own).unwrap_or(&0.0) }
        })
    }

    pub fn tool(&self) -> Vector3<f64> {
        Vector3::from(self.tool)
    }

    /// Returns the point whose path is drawn: the control point, or the tip on the work if axes carry something.
    pub fn place(&self) -> Vector3<f64> {
        let [x, y, z, ..] = self.pose;
        self.on_work.map_or(Vector3::new(x, y, z), |[tip, _]| tip.into())
    }

    /// Returns the direction of the tool at that point, tip to holder.
    pub fn axis(&self) -> Vector3<f64> {
        let own = || Pose::from_degrees(self.pose).rotation().column(2).into_owned();
        self.on_work.map_or_else(own, |[_, axis]| axis.into())
    }
}
