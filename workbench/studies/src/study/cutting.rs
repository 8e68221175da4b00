// SPDX-License-Identifier: GPL-2.0-or-later
//! The tables of a study that describe cutting: the tool, the chip, masses on springs, a spindle.

use crate::study::masses::Direction;
use crate::study::number::{Half, NotNegative, Positive};
use serde::Deserialize;

/// Why a cutter is invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoCut {
    #[error("teeth = 0: expected at least 1")]
    Teeth,
    #[error(
        "entry_deg = {0}, exit_deg = {1}: expected entry before exit; use 0 to 180 for a slot, 0 to 90 \
         for half immersion up milling, 90 to 180 for down milling"
    )]
    Arc(f64, f64),
}

/// `[cutting]` as written in the file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CuttingKeys {
    teeth: u16,
    entry_deg: Half,
    exit_deg: Half,
    kt_n_per_mm2: Positive,
    kr_n_per_mm2: NotNegative,
    #[serde(default)]
    ka_n_per_mm2: NotNegative,
    depth_mm: Option<Positive>,
}

/// `[cutting]`: a milling cutter in its cut. Angles count from the normal of the feed, in the
/// direction of rotation.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "CuttingKeys")]
pub struct Cutting {
    /// Number of teeth, evenly spaced.
    pub teeth: u16,
    /// Entry angle of a tooth, degrees.
    pub entry_deg: f64,
    /// Exit angle, degrees; more than `entry_deg`.
    pub exit_deg: f64,
    /// Tangential, radial and axial cutting coefficients, N/mm².
    pub coefficients: [f64; 3],
    /// Depth of cut of a program, mm.
    pub depth_mm: Option<f64>,
}

impl Cutting {
    /// Returns the entry and exit angles of a tooth, radians.
    pub fn arc(&self) -> [f64; 2] {
        [self.entry_deg, self.exit_deg].map(f64::to_radians)
    }
}

impl TryFrom<CuttingKeys> for Cutting {
    type Error = NoCut;

    fn try_from(keys: CuttingKeys) -> Result<Self, NoCut> {
        let [entry_deg, exit_deg] = [keys.entry_deg.0, keys.exit_deg.0];
        if keys.teeth == 0 {
            return Err(NoCut::Teeth);
        }
        if !(entry_deg < exit_deg) {
            return Err(NoCut::Arc(entry_deg, exit_deg));
        }
        let depth_mm = keys.depth_mm.map(|depth| depth.0);
        let coefficients = [keys.kt_n_per_mm2.0, keys.kr_n_per_mm2.0, keys.ka_n_per_mm2.0];
        Ok(Self { teeth: keys.teeth, entry_deg, exit_deg, coefficients, depth_mm })
    }
}

/// `[turning]`: a single edge that cuts a rotating workpiece.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Turning {
    /// Cutting coefficient, N/mm².
    pub kf_n_per_mm2: Positive,
    /// Direction of tool motion that makes the chip thicker.
    pub thicker: Direction,
    /// Direction of the cutting force on the tool.
    pub force: Direction,
    /// Depth of cut of a program, mm.
    pub depth_mm: Option<Positive>,
}

/// One of `[[links]]`: a mass on a spring and a damper.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// Name in tables and plots.
    pub name: String,
    pub mass_kg: Positive,
    /// Force per speed.
    pub damping_n_s_per_mm: Positive,
    /// Force per displacement.
    pub stiffness_n_per_um: Positive,
    /// Joints between spindle, arbor and tool, in series with the spring.
    #[serde(default)]
    pub joints: Vec<LinkJoint>,
}

/// Why a joint has no effect.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoJoint {
    #[error(
        "angular_rad_per_n_m = {0} without arm_mm moves nothing: add arm_mm, the distance of the force from the joint"
    )]
    Arm(f64),
    #[error(
        "the joint is rigid: give compliance_um_per_n or angular_rad_per_n_m above 0, or remove the joint"
    )]
    Rigid,
}

/// `[[links.joints]]` as written in the file.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LinkJointKeys {
    #[serde(default)]
    compliance_um_per_n: NotNegative,
    #[serde(default)]
    angular_rad_per_n_m: NotNegative,
    #[serde(default)]
    arm_mm: NotNegative,
}

/// One of `[[links.joints]]`: a spring in series with that of its link.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "LinkJointKeys")]
pub struct LinkJoint {
    /// Displacement per force.
    pub compliance_um_per_n: f64,
    /// Angle per moment.
    pub angular_rad_per_n_m: f64,
    /// Distance of the force from the joint, by which the angle moves the tool; above 0 if the angle is.
    pub arm_mm: f64,
}

impl TryFrom<LinkJointKeys> for LinkJoint {
    type Error = NoJoint;

    fn try_from(keys: LinkJointKeys) -> Result<Self, NoJoint> {
        let [compliance_um_per_n, angular_rad_per_n_m, arm_mm] =
            [keys.compliance_um_per_n.0, keys.angular_rad_per_n_m.0, keys.arm_mm.0];
        if angular_rad_per_n_m > 0.0 && arm_mm == 0.0 {
            return Err(NoJoint::Arm(angular_rad_per_n_m));
        }
        if compliance_um_per_n == 0.0 && angular_rad_per_n_m == 0.0 {
            return Err(NoJoint::Rigid);
        }
        Ok(Self { compliance_um_per_n, angular_rad_per_n_m, arm_mm })
    }
}

/// `[lag]`: a cutting force that follows the chip's thickness with a first-order lag.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct LagKeys {
    /// Time constant of the cutting force.
    pub time_constant_ms: NotNegative,
}

/// `[chip]`: cutting stiffness per millimeter of chip width (paper 002).
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Chip {
    /// The factor c; the paper prints 1.4.
    pub factor: Positive,
    pub ratio: Positive,
    /// Tensile strength σ_b of the work.
    pub strength_n_per_mm2: Positive,
    /// Angle φ between the cutting edge and the feed, in plan.
    pub angle_deg: Half,
}

/// `[overhang]`: compliance of the first link as a function of its overhang.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Overhang {
    /// a0, a1, a2 of the compliance `a0 + a1 l + a2 l²`, um/N, with l in mm.
    pub compliance_um_per_n: [NotNegative; 3],
    /// The tool's own compliance, `cantilever (l/at)³`, um/N.
    pub cantilever_um_per_n: NotNegative,
    /// The overhang at which the tool's own compliance is `cantilever_um_per_n`, mm.
    pub cantilever_at_mm: Positive,
}
