// SPDX-License-Identifier: GPL-2.0-or-later
//! Samples of machines with constraints of the platform.

use crate::shipped::root;
use kinematics::{Pose, Vector3};
use machine::read::mechanism::Mechanism;
use rand::Rng;
use rand_pcg::Pcg64;
use serde::Deserialize;

/// A pose of the platform and its joints, computed by a separate program.
#[derive(Deserialize)]
pub struct Golden {
    pub machine: String,
    /// Vector from the platform's origin to the control point, in the platform frame.
    pub tip: [f64; 3],
    /// Pose of the control point in base, degrees.
    pub pose: [f64; 6],
    pub joints: Vec<f64>,
}

/// Returns the separately computed poses.
pub fn golden() -> Vec<Golden> {
    #[derive(Deserialize)]
    struct File {
        row: Vec<Golden>,
    }
    let file = root().join("tests/cases/golden/constraints.toml");
    toml::from_str::<File>(&std::fs::read_to_string(file).unwrap()).unwrap().row
}

/// Samples one of LinuxCNC's poses within the limits of the axes.
pub fn commanded(config: &Mechanism, rng: &mut Pcg64) -> Pose {
    Pose::from_degrees(std::array::from_fn(|k| match config.axes[k] {
        axis if axis.min < axis.max && axis.max.is_finite() => rng.random_range(axis.min..axis.max),
        _ => config.home[k],
    }))
}

/// Samples a tool vector across and along the axis, the spindle included.
pub fn tool(config: &Mechanism, rng: &mut Pcg64) -> Vector3<f64> {
    config.spindle
        + Vector3::new(
            rng.random_range(-60.0..60.0),
            rng.random_range(-60.0..60.0),
            rng.random_range(0.0..150.0),
        )
}
