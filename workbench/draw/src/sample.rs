// SPDX-License-Identifier: GPL-2.0-or-later
//! Input data of the plots of a motion.

use kinematics::{Joints, PerLeg, Vector3};

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
    /// Largest difference between an extra axis's coordinate and its joint; poses do not include these coordinates.
    pub passed: f64,
    /// Forward solution of the motor positions of the previous cycle.
    pub forward: [f64; 6],
    /// Nut corrections published by the module, 0 for legs that are not struts.
    pub corrections: PerLeg,
    /// Tool vector, spindle offset included.
    pub tool: [f64; 3],
    /// Iterations of the last forward call.
    pub iterations: f64,
    /// Largest leg residual of the last forward call.
    pub residual: f64,
}

impl Sample {
    pub fn tool(&self) -> Vector3<f64> {
        Vector3::from(self.tool)
    }
}
