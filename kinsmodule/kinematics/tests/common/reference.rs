// SPDX-License-Identifier: GPL-2.0-or-later
//! The reference tracker: what the right pose is, found the slow way.
//!
//! Follows the straight joint path from the seed in 1000 steps with Newton's method
//! to 1e-13 of the size at each, and gives up where the Jacobian changes its sign.

use kinematics::{Machine, Method, Pose, Solver};
use nalgebra::Vector3;

const STEPS: usize = 1000;

/// The right pose, or `None` where the path meets a singular pose.
pub fn follow(
    machine: &Machine<6>,
    seed: &Pose,
    joints: &[f64; 6],
    tool: &Vector3<f64>,
) -> Option<Pose> {
    let from = machine.inverse(seed, tool).ok()?;
    let sign = handedness(machine, seed, tool)?;
    let solver = Solver { method: Method::PlainNewton, limit_iterations: 20, ..Solver::default() };
    let mut pose = *seed;
    for step in 1..=STEPS {
        let t = step as f64 / STEPS as f64;
        let target = std::array::from_fn(|i| from[i] + t * (joints[i] - from[i]));
        pose = machine.forward(&target, &pose, tool, &solver).ok()?.pose;
        if handedness(machine, &pose, tool)? != sign {
            return None;
        }
    }
    Some(pose)
}

/// Sign of the Jacobian's determinant.
pub fn handedness(machine: &Machine<6>, pose: &Pose, tool: &Vector3<f64>) -> Option<bool> {
    Some(machine.inverse_jacobian(pose, tool).ok()?.determinant() > 0.0)
}
