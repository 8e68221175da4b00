// SPDX-License-Identifier: GPL-2.0-or-later
//! Telescopic strut between two cardan joints: q = |p − a|.
//!
//! c(q) = a, d(q) = q, hence u · ṗ = q' (paper 004, Novikov et al. 2011; also
//! LinuxCNC's genhexkins). The nut-rotation correction is added in [`crate::Machine`],
//! see the module `nut`.

use super::Drive;
use crate::fault::Cause;
use nalgebra::Vector3;

/// Parameters of a strut besides its two anchors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StrutGeometry {
    /// Direction of the base cardan joint's axis that is fixed in base; any length.
    pub base_axis: [f64; 3],
    /// Direction of the platform cardan joint's axis that is fixed in the platform; any length.
    pub platform_axis: [f64; 3],
    /// Screw travel per turn in machine units, negative for the opposite hand; 0 = no correction.
    pub lead: f64,
}

/// Speed of the platform anchor along the strut per joint rate.
pub(super) const TRANSMISSION: f64 = 1.0;

pub(super) fn joint(length: f64) -> f64 {
    length
}

pub(super) fn drive(q: f64) -> Result<Drive, Cause> {
    if !(q > 0.0) {
        return Err(Cause::JointNotPositive);
    }
    Ok(Drive { displacement: Vector3::zeros(), length: q, towards: Vector3::zeros() })
}
