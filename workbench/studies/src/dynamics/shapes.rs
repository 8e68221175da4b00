// SPDX-License-Identifier: GPL-2.0-or-later
//! Modes of any mass and stiffness matrix.

use nalgebra::{DMatrix, DVector};

/// Squares of frequencies below this share of the largest belong to unconstrained motions:
/// rounding of an eigenvalue.
const HELD: f64 = 1e-13;

/// Modes without damping.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// Angular frequencies, smallest first, rad/s.
    pub omegas: Vec<f64>,
    /// Their shapes in the structure's coordinates, columns; ΦᵀMΦ = 1.
    pub vectors: DMatrix<f64>,
}

impl Shapes {
    /// Solves K φ = ω² M φ; `None` if some motion is unconstrained.
    pub fn of(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Option<Self> {
        let (squares, vectors) = squares(mass, stiffness)?;
        let most = *squares.last()?;
        let is_held = squares.iter().all(|square| *square > HELD * most);
        let omegas = squares.iter().map(|square| square.sqrt()).collect();
        is_held.then_some(Self { omegas, vectors })
    }
}

/// Computes squares of the angular frequencies, smallest first, and mass-normalized shapes; `None`
/// if the mass matrix is not positive definite.
pub fn squares(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Option<(Vec<f64>, DMatrix<f64>)> {
    // With M = LLᵀ the problem becomes symmetric: L⁻¹ K L⁻ᵀ.
    let lower = mass.clone().cholesky()?.l();
    let half = lower.solve_lower_triangular(stiffness)?;
    let whole = lower.solve_lower_triangular(&half.transpose())?;
    let eigen = ((&whole + whole.transpose()) / 2.0).symmetric_eigen();
    let mut order: Vec<usize> = (0..mass.nrows()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let columns: Vec<DVector<f64>> =
        order.iter().map(|k| eigen.eigenvectors.column(*k).into_owned()).collect();
    let vectors = lower.tr_solve_lower_triangular(&DMatrix::from_columns(&columns))?;
    Some((order.iter().map(|k| eigen.eigenvalues[*k]).collect(), vectors))
}
