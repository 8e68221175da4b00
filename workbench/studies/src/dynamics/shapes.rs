// SPDX-License-Identifier: GPL-2.0-or-later
//! Modes of a mass and a stiffness, whatever they are of.

use nalgebra::{DMatrix, DVector};

/// Squares of frequencies below this share of the largest are those of motions that nothing holds:
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
    /// Of K φ = ω² M φ; `None` where something moves that nothing holds.
    pub fn of(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Option<Self> {
        let (squares, vectors) = squares(mass, stiffness)?;
        let most = *squares.last()?;
        let is_held = squares.iter().all(|square| *square > HELD * most);
        let omegas = squares.iter().map(|square| square.sqrt()).collect();
        is_held.then_some(Self { omegas, vectors })
    }
}

/// Squares of the angular frequencies, smallest first, and shapes that are normalised by mass; `None`
/// where the mass is no positive definite matrix.
pub fn squares(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Option<(Vec<f64>, DMatrix<f64>)> {
    // With M = LLᵀ a problem that is symmetric: L⁻¹ K L⁻ᵀ.
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
