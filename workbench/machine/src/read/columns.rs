// SPDX-License-Identifier: GPL-2.0-or-later
//! Names of columns in tables of poses and joints, and a pose in words.

use kinematics::{Letter, Pose};

/// Returns the column names of a pose: x y z a b c.
pub fn coordinates() -> Vec<String> {
    Letter::ALL.iter().map(|letter| letter.name().to_ascii_lowercase().to_string()).collect()
}

/// Returns the column names of joint values.
pub fn joint_names(count: usize) -> Vec<String> {
    (0..count).map(|i| format!("joint_{i}")).collect()
}

/// Returns a pose as in a block of a program.
pub fn in_words(pose: &Pose) -> String {
    let word = |(letter, value): (&Letter, f64)| format!("{}{:.4}", letter.name(), value + 0.0);
    Letter::ALL.iter().zip(pose.to_degrees()).map(word).collect::<Vec<_>>().join(" ")
}
