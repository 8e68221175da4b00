// SPDX-License-Identifier: GPL-2.0-or-later
//! The masses of a leg that rotates and changes its length.
//!
//! A leg has the energy `T = μa l'²/2 + J ω²/2`: a compact mass μa moves along it with the platform joint, e behind that
//! joint, and all masses have the moment of inertia `J(l) = J₀ + μa (l - e)²` about the base joint, J₀ of those that
//! only rotate. The mass μt that moves across is J/l² at the start. It does not determine e and J₀ alone: e is 0, or, if
//! J would then be less than μa l², such that J₀ is 0. With the span s from base to platform joint, l = |s|, n = s/l and
//! v⊥ the part of s' across n, Lagrange's equations give the force by which the platform joint moves the leg:
//!
//! ```text
//! [μa nnᵀ + J/l² (1 - nnᵀ)] s'' + n (μa/l - J'/2l²) v⊥² + (J'/l² - 2J/l³) l' v⊥
//! ```

use kinematics::{Matrix3, Vector3};

/// Masses of a leg, t and mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrutMass {
    /// Mass that moves along the leg.
    axial: f64,
    /// Its distance from the platform joint.
    behind: f64,
    /// Moment of inertia about the base joint of the masses that only rotate.
    turned: f64,
}

impl StrutMass {
    /// Creates the masses of a leg from those that move along and across it at a length.
    pub fn new(axial: f64, across: f64, length: f64) -> Self {
        let distance = length * if across < axial { (across / axial).sqrt() } else { 1.0 };
        let turned = (across * length * length - axial * distance * distance).max(0.0);
        Self { axial, behind: length - distance, turned }
    }

    /// Returns whether the leg has mass at all.
    pub fn is_there(&self) -> bool {
        self.axial + self.turned > 0.0
    }

    /// Returns the moment of inertia about the base joint at a length, and its derivative.
    fn inertia(&self, length: f64) -> [f64; 2] {
        let distance = length - self.behind;
        [self.turned + self.axial * distance * distance, 2.0 * self.axial * distance]
    }

    /// Returns the mass that the platform joint moves, as a matrix, from its distance from the base joint.
    pub fn matrix(&self, span: &Vector3<f64>) -> Matrix3<f64> {
        let length = span.norm();
        let along = span * span.transpose() / (length * length);
        let across = self.inertia(length)[0] / (length * length);
        along * self.axial + (Matrix3::identity() - along) * across
    }

    /// Returns the force by which the platform joint moves the leg without acceleration, from its distance from the
    /// base joint and the rate of that.
    pub fn rotation(&self, span: &Vector3<f64>, rate: &Vector3<f64>) -> Vector3<f64> {
        let length = span.norm();
        let along = span / length;
        let longer = along.dot(rate);
        let across = rate - along * longer;
        let [own, slope] = self.inertia(length);
        let square = length * length;
        along * (across.norm_squared() * (self.axial / length - slope / (2.0 * square)))
            + across * (longer * (slope / square - 2.0 * own / (square * length)))
    }

    /// Returns the kinetic energy.
    pub fn energy(&self, span: &Vector3<f64>, rate: &Vector3<f64>) -> f64 {
        rate.dot(&(self.matrix(span) * rate)) / 2.0
    }
}
