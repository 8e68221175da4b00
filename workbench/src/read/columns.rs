// SPDX-License-Identifier: GPL-2.0-or-later
//! Names of columns in tables of poses and joints.

use kinematics::Letter;

/// Those of the coordinates of a pose: x y z a b c.
pub fn coordinates() -> Vec<String> {
    Letter::ALL.iter().map(|letter| letter.name().to_ascii_lowercase().to_string()).collect()
}

/// Those of joint values.
pub fn joint_names(count: usize) -> Vec<String> {
    (0..count).map(|i| format!("joint_{i}")).collect()
}
