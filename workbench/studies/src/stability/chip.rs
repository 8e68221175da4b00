// SPDX-License-Identifier: GPL-2.0-or-later
//! From a cutting stiffness to the chip that may be cut (paper 002).

use crate::study::cutting::Chip;

impl Chip {
    /// Cutting stiffness of a millimetre of chip width, `c ζ σ_b`, N/mm².
    pub fn per_width(&self) -> f64 {
        self.factor.0 * self.ratio.0 * self.strength_n_per_mm2.0
    }

    /// Limit width of cut `b = K/(c ζ σ_b)`, mm, for a limit cutting stiffness in N/mm.
    pub fn width(&self, stiffness: f64) -> f64 {
        stiffness / self.per_width()
    }

    /// Limit depth of cut `t = b sin φ`, mm. (The paper divides by sin φ, against its own
    /// `b = t/sin φ`.)
    pub fn depth(&self, stiffness: f64) -> f64 {
        self.width(stiffness) * self.angle_deg.0.to_radians().sin()
    }
}
