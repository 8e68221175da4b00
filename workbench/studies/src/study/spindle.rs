// SPDX-License-Identifier: GPL-2.0-or-later
//! `[spindle]` of a study: a shaft on two elastic supports, with elastic joints to arbor and tool.

use crate::study::number::{NotNegative, Positive};
use serde::Deserialize;

/// A shaft of cylinders on two bearings; lengths from its rear end to the nose or tool tip.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Spindle {
    /// Young's modulus of the shaft.
    pub youngs_n_per_mm2: Positive,
    pub density_kg_per_m3: Positive,
    /// Damping ratio of the shaft itself, added to the damping of the bearings.
    pub damping_ratio: NotNegative,
    /// Cylinders from the rear end on; the last one is the overhang that commands change.
    pub sections: Vec<Section>,
    pub bearings: [Bearing; 2],
    #[serde(default)]
    pub joints: Vec<ShaftJoint>,
    /// Number of modes used.
    #[serde(default = "three")]
    pub modes: u8,
}

fn three() -> u8 {
    3
}

/// One of `[[spindle.sections]]`.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Section {
    pub length_mm: Positive,
    pub diameter_mm: Positive,
    #[serde(default)]
    pub bore_mm: NotNegative,
}

/// One of `[[spindle.bearings]]`.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Bearing {
    /// Distance from the rear end.
    pub at_mm: NotNegative,
    /// Displacement per force; 0 for a rigid bearing.
    pub compliance_um_per_n: NotNegative,
    /// Angle per moment; if missing, the shaft rotates freely at the bearing.
    pub angular_rad_per_n_m: Option<NotNegative>,
    /// Force per speed.
    #[serde(default)]
    pub damping_n_s_per_mm: NotNegative,
}

/// One of `[[spindle.joints]]`: springs where the shaft continues as arbor or tool.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ShaftJoint {
    /// Distance from the rear end.
    pub at_mm: Positive,
    /// Displacement of one side against the other per force.
    #[serde(default)]
    pub compliance_um_per_n: NotNegative,
    /// Rotation of one side against the other per moment.
    #[serde(default)]
    pub angular_rad_per_n_m: NotNegative,
}
