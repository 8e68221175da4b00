// SPDX-License-Identifier: GPL-2.0-or-later
//! One mode of vibration, as it is felt at the tool tip.

use nalgebra::Vector3;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Angular frequency without damping, rad/s.
    pub omega: f64,
    /// Damping ratio.
    pub zeta: f64,
    /// Displacement of the tool tip in the mass-normalized mode, machine axes, 1/sqrt(t).
    pub tip: Vector3<f64>,
}
