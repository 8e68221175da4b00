// SPDX-License-Identifier: GPL-2.0-or-later
//! Legs: what joins base and platform. Each kind is one file with its equation.
//!
//! Every kind is a constraint |p − c(q)| = d(q) between the platform anchor p and a
//! *moving base anchor* c: a strut keeps c and changes d, a rod on a carriage or a
//! crank moves c and keeps d. The solvers see only (c, d) and the unit vector
//! u = (p − c)/d; with q' = dq/dt
//!
//! ```text
//! u · ṗ = (u · ∂c/∂q + ∂d/∂q) q'
//! ```
//!
//! is the one gradient row that Jacobian and Newton's method need.

pub mod strut;

pub use strut::StrutGeometry;

use crate::fault::Cause;
use nalgebra::Vector3;

/// What the integrator wrote for one leg, by kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegKind {
    /// Telescopic strut; joint value = length.
    Strut(StrutGeometry),
}

impl LegKind {
    /// Number of the kind in the geometry hash.
    pub(crate) const fn number(&self) -> f64 {
        match self {
            LegKind::Strut(_) => 1.0,
        }
    }
}

/// A checked leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Leg {
    Strut,
}

/// Moving base anchor (as displacement from the base anchor) and target length.
pub(crate) struct Drive {
    pub displacement: Vector3<f64>,
    pub length: f64,
}

impl Leg {
    /// Native joint value for a platform anchor at `w` from the base anchor, |w| = `length`.
    #[inline]
    pub fn joint(&self, _w: &Vector3<f64>, length: f64) -> Result<f64, Cause> {
        match self {
            Leg::Strut => Ok(strut::joint(length)),
        }
    }

    /// Where the native joint value `q` puts the moving base anchor, and the length it sets.
    #[inline]
    pub fn drive(&self, q: f64) -> Result<Drive, Cause> {
        match self {
            Leg::Strut => strut::drive(q),
        }
    }

    /// Joint rate per speed of the platform anchor along u: 1 / (u · ∂c/∂q + ∂d/∂q).
    #[inline]
    pub fn rate(&self, _u: &Vector3<f64>) -> f64 {
        match self {
            Leg::Strut => strut::RATE,
        }
    }
}
