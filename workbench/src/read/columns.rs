// SPDX-License-Identifier: GPL-2.0-or-later
//! Names of columns in tables of poses and joints.

/// Those of the coordinates of a pose.
pub const COORDINATES: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// The same, as the beginning of a longer list.
pub fn coordinates() -> Vec<String> {
    COORDINATES.map(String::from).to_vec()
}

/// Those of joint values.
pub fn joint_names(count: usize) -> Vec<String> {
    (0..count).map(|i| format!("joint_{i}")).collect()
}
