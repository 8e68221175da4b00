// SPDX-License-Identifier: GPL-2.0-or-later
//! Location of a mechanism in its INI file, which may describe two.
//!
//! Each is read as an ordinary machine in its own coordinates. This module has the differences: the first number
//! of its legs and joints, the letters of its coordinates, and the names of sections.

use kinematics::{Fault, Letter, Load, POSE_LETTERS};

/// LinuxCNC's coordinates for X Y Z A B C of a second mechanism, unless the file names others.
const OWN: [usize; 6] = [6, 7, 8, 3, 4, 5];

/// Location of a mechanism in its file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Number of its first leg.
    pub first_leg: usize,
    /// Number of its first joint.
    pub first_joint: usize,
    /// Number of the first joint of the extra axes, after those of all mechanisms.
    pub first_extra_joint: usize,
    /// Whether it is the second one.
    pub is_second: bool,
    /// Indices of its X Y Z A B C among LinuxCNC's letters. Coordinates that a second mechanism keeps constant
    /// have their own indices, and no value there.
    pub places: [usize; 6],
}

impl Place {
    /// Returns the mechanisms of a file, with their load parameters as if each were alone.
    pub(super) fn all(load: &Load) -> Vec<(Self, Load)> {
        let first = Self {
            first_leg: 0,
            first_joint: 0,
            first_extra_joint: load.first_extra_joint(),
            is_second: false,
            places: [0, 1, 2, 3, 4, 5],
        };
        let second = load.second().map(|second| Self {
            first_leg: load.layout.legs(),
            first_joint: load.layout.joints(),
            is_second: true,
            places: std::array::from_fn(|k| second.place(Letter::ALL[k]).unwrap_or(OWN[k])),
            ..first
        });
        [(first, *load)].into_iter().chain(second.zip(load.of_second())).collect()
    }

    /// Returns LinuxCNC's letter of one of its coordinates.
    pub fn letter(&self, letter: Letter) -> char {
        POSE_LETTERS[self.places[letter.index()]]
    }

    /// Returns the section of the mechanism as a whole.
    pub fn machine_section(&self) -> &'static str {
        if self.is_second { "SECOND" } else { "PKM" }
    }

    /// Returns the section of its leg `n`, counted from 0.
    pub fn leg_section(&self, n: usize) -> String {
        leg_section(self.first_leg + n)
    }

    /// Returns the section of its joint `n`, counted from 0.
    pub fn joint_section(&self, n: usize) -> String {
        format!("JOINT_{}", self.first_joint + n)
    }

    /// Returns the section of the axis of one of its coordinates.
    pub fn axis_section(&self, letter: Letter) -> String {
        format!("AXIS_{}", self.letter(letter))
    }

    /// Returns the section of pose box `k`.
    pub fn box_section(&self, k: usize) -> String {
        format!("{}{k}", self.box_prefix())
    }

    /// Returns the prefix of the names of these sections.
    pub fn box_prefix(&self) -> &'static str {
        if self.is_second { "SECOND_BOX_" } else { "BOX_" }
    }

    /// Returns the load parameter with the number of its pose boxes.
    pub fn boxes_parameter(&self) -> &'static str {
        if self.is_second { "second_boxes" } else { "boxes" }
    }

    /// Returns a fault with the numbers that legs and joints have in the file.
    pub fn counted(&self, fault: Fault) -> Fault {
        fault.counted_from(self.first_leg as u8, self.first_joint as u8)
    }
}

/// Returns the section of leg `n` of a file.
pub(super) fn leg_section(n: usize) -> String {
    format!("LEG_{n}")
}
