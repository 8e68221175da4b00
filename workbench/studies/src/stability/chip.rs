// SPDX-License-Identifier: GPL-2.0-or-later
//! The permissible chip for a cutting stiffness (paper 002).

use crate::study::cutting::Chip;

impl Chip {
    /// Returns the cutting stiffness per millimeter of chip width, `c ζ σ_b`, N/mm².
    pub fn per_width(&self) -> f64 {
        self.factor.0 * self.ratio.0 * self.strength_n_per_mm2.0
    }

    /// Returns the limit width of cut `b = K/(c ζ σ_b)`, mm, for a limit cutting stiffness in N/mm.
    pub fn width(&self, stiffness: f64) -> f64 {
        stiffness / self.per_width()
    }

    /// Returns the limit depth of cut `t = b sin φ`, mm. (The paper divides by sin φ, which contradicts its
    /// own `b = t/sin φ`.)
    pub fn depth(&self, stiffness: f64) -> f64 {
        self.width(stiffness) * self.angle_deg.0.to_radians().sin()
    }
}
