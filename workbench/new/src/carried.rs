// SPDX-License-Identifier: GPL-2.0-or-later
//! Values kept from an older configuration, which replace those that [`crate::ini`] would choose.

use crate::kinds::MachineKind;

/// A joint of the older configuration.
#[derive(Clone, Debug, Default)]
pub struct CarriedJoint {
    pub kind: &'static str,
    /// HOME in the older configuration; an extra axis keeps it.
    pub home: f64,
    pub range: [f64; 2],
    /// Maximum speed and acceleration.
    pub motion: [f64; 2],
    /// Other lines of its section: following errors, homing, and keys for drives.
    pub lines: String,
}

/// Limits of a coordinate, and its maximum speed and acceleration.
#[derive(Clone, Copy, Debug)]
pub struct CarriedAxis {
    pub letter: char,
    /// Limits in the older configuration, if any.
    pub limits: Option<[f64; 2]>,
    pub motion: [f64; 2],
}

/// All values that are kept.
#[derive(Clone, Debug, Default)]
pub struct Carried {
    /// Comment at the head of the file, one entry per paragraph.
    pub about: Vec<String>,
    /// Origin, for the page of the machine.
    pub source: String,
    /// Lines of `[DISPLAY]`; the first names the user interface.
    pub display: String,
    /// Servo period in nanoseconds.
    pub period: u32,
    /// Lines of `[PKM]`.
    pub machine: String,
    /// Direction in which tools point, if known.
    pub direction: Option<&'static str>,
    /// Maximum speed and acceleration along X Y Z and of angles, per second.
    pub motion: [[f64; 2]; 2],
    /// Initial speeds of a user interface.
    pub start: [f64; 2],
    /// Joints of the legs, then of extra axes.
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

    /// Returns the direction in which tools point if the older configuration does not give it: a delta hangs above its
    /// work.
    pub fn usual_direction(kind: &MachineKind) -> Option<&'static str> {
        kind.name.ends_with("delta").then_some("down")
    }
}
