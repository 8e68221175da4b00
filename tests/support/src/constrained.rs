// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines with constraints of the platform.

use crate::shipped::root;
use kinematics::{Pose, Vector3};
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use rand::Rng;
use rand_pcg::Pcg64;
use std::path::PathBuf;

pub const CONSTRAINED: [&str; 3] = ["tricept", "exechon", "z3-head"];

/// Returns the INI file of a machine.
pub fn constrained_ini(machine: &str) -> PathBuf {
    root().join(format!("tests/cases/ini/constraints/{machine}.ini"))
}

/// Reads a machine.
pub fn constrained(machine: &str) -> Mechanism {
    let ini = Ini::read(&constrained_ini(machine)).unwrap();
    let config = MachineConfig::leniently(&ini, Some(Lenient::Constraints)).unwrap();
    config.mechanism(1).unwrap()
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
