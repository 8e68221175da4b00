// SPDX-License-Identifier: GPL-2.0-or-later
//! Constraints of the platform by passive joints, as the integrator wrote them.
//!
//! P is the platform's origin in base and R its orientation; b and m are given in the platform frame, c, n and e in
//! the base frame. Each kind is one equation between the coordinates of the platform.

/// Largest number of constraints of a machine.
pub const MAX_CONSTRAINTS: usize = 6;

/// A constraint as given; directions may have any length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConstraintGeometry {
    /// n · (P + R b − c) = 0: a revolute joint in base keeps a leg, and the platform point at its end, in a plane.
    PointInPlane {
        /// b, machine units.
        platform: [f64; 3],
        /// c, any point of the plane, machine units.
        base: [f64; 3],
        /// n.
        normal: [f64; 3],
    },
    /// (R m) · (c − P − R b) = 0: a revolute joint at the platform, or a passive leg fixed to the platform, keeps a
    /// point of the base in a plane of the platform.
    PlaneThroughPoint {
        /// b, any point of the plane, machine units.
        platform: [f64; 3],
        /// m.
        normal: [f64; 3],
        /// c, machine units.
        base: [f64; 3],
    },
    /// (R m) · e = 0: the two axes of a universal joint stay perpendicular.
    Square {
        /// m.
        platform_axis: [f64; 3],
        /// e.
        base_axis: [f64; 3],
    },
}

impl ConstraintGeometry {
    /// Names of the kinds, in the order of their numbers, which start at 1.
    pub const KINDS: &[&str] = &["point-in-plane", "plane-through-point", "square"];

    /// Fills unused entries.
    pub(crate) const NONE: Self = Self::Square { platform_axis: [0.0; 3], base_axis: [0.0; 3] };

    /// Returns the number of its kind, as pins show it: the place of its name in [`Self::KINDS`], from 1 on.
    pub const fn kind(&self) -> i32 {
        match self {
            Self::PointInPlane { .. } => 1,
            Self::PlaneThroughPoint { .. } => 2,
            Self::Square { .. } => 3,
        }
    }

    /// Returns its vectors, points first.
    pub(crate) const fn vectors(&self) -> ([[f64; 3]; 2], [[f64; 3]; 2]) {
        match *self {
            Self::PointInPlane { platform, base, normal }
            | Self::PlaneThroughPoint { platform, normal, base } => {
                ([platform, base], [normal, normal])
            }
            Self::Square { platform_axis, base_axis } => {
                ([[0.0; 3]; 2], [platform_axis, base_axis])
            }
        }
    }
}
