// SPDX-License-Identifier: GPL-2.0-or-later
//! What a machine has from an older configuration, in place of what [`crate::ini`] would choose.

use crate::kinds::MachineKind;

/// A joint of the older configuration.
#[derive(Clone, Debug, Default)]
pub struct CarriedJoint {
    pub kind: &'static str,
    /// Its HOME there; that of an extra axis stays.
    pub home: f64,
    pub range: [f64; 2],
    /// Largest speed and acceleration.
    pub motion: [f64; 2],
    /// Other lines of its section: following errors, homing, and what drives need.
    pub lines: String,
}

/// Limits of a coordinate, and its largest speed and acceleration.
#[derive(Clone, Copy, Debug)]
pub struct CarriedAxis {
    pub letter: char,
    /// As the older configuration has them; `None` where it has none.
    pub limits: Option<[f64; 2]>,
    pub motion: [f64; 2],
}

/// Everything that is carried over.
#[derive(Clone, Debug, Default)]
pub struct Carried {
    /// Comment at the head of the file, one paragraph each.
    pub about: Vec<String>,
    /// Where it comes from, for the page beside it.
    pub source: String,
    /// Lines of `[DISPLAY]`, its first one names the user interface.
    pub display: String,
    /// Servo period, nanoseconds.
    pub period: u32,
    /// Lines of `[PKM]`.
    pub machine: String,
    /// Which way tools point, where that is known.
    pub direction: Option<&'static str>,
    /// Largest speed and acceleration along X Y Z and of angles, a second.
    pub motion: [[f64; 2]; 2],
    /// Speeds that a user interface starts with.
    pub start: [f64; 2],
    /// The joints of the legs, then those of extra axes.
    pub joints: Vec<CarriedJoint>,
    pub axes: Vec<CarriedAxis>,
    /// Letters of extra axes.
    pub extra: String,
    pub tools: String,
}

impl Carried {
    /// Returns the axis of a letter.
    pub fn axis(&self, letter: char) -> Option<&CarriedAxis> {
        self.axes.iter().find(|axis| axis.letter == letter)
    }

    /// Returns which way tools point where the older configuration does not say it: a delta hangs above its work.
    pub fn usual_direction(kind: &MachineKind) -> Option<&'static str> {
        kind.name.ends_with("delta").then_some("down")
    }
}
