// SPDX-License-Identifier: GPL-2.0-or-later
//! What a structure does of itself and under a force that swings: modes, poles, receptance.

use crate::dynamics::mode::Mode;
use crate::dynamics::structure::Structure;
use nalgebra::{Complex, DMatrix, DVector, Matrix3};

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

impl Structure {
    /// Modes without damping; `None` where something moves that nothing holds.
    pub fn shapes(&self) -> Option<Shapes> {
        Shapes::of(&self.mass, &self.stiffness)
    }

    /// Modes as the tool tip feels them, lowest first; `None` as above. Each has the damping that it
    /// would have alone: dampers that couple modes are in [`Structure::poles`] and
    /// [`Structure::receptance`].
    pub fn modes(&self) -> Option<Vec<Mode>> {
        let shapes = self.shapes()?;
        let mode = |(k, omega): (usize, &f64)| {
            let shape = shapes.vectors.column(k);
            let zeta = shape.dot(&(&self.damping * shape)) / (2.0 * omega);
            let tip = self.tip.fixed_rows::<3>(0) * shape;
            Mode { omega: *omega, zeta, tip }
        };
        Some(shapes.omegas.iter().enumerate().map(mode).collect())
    }

    /// Poles with damping, whatever couples the modes: those that swing, with imaginary parts above 0,
    /// and those that do not; by their amount, smallest first, 1/s. `None` as above.
    pub fn poles(&self) -> Option<Vec<Complex<f64>>> {
        let shapes = self.shapes()?;
        let count = shapes.omegas.len();
        let omegas = DMatrix::from_diagonal(&DVector::from(shapes.omegas));
        // Of (Ω q, q') with x = Φ q: all entries are of the size of a frequency.
        let mut state = DMatrix::zeros(2 * count, 2 * count);
        state.view_mut((0, count), (count, count)).copy_from(&omegas);
        state.view_mut((count, 0), (count, count)).copy_from(&-omegas);
        let damping = shapes.vectors.tr_mul(&(&self.damping * &shapes.vectors));
        state.view_mut((count, count), (count, count)).copy_from(&-damping);
        let poles = state.complex_eigenvalues();
        let mut poles: Vec<_> = poles.iter().copied().filter(|pole| pole.im >= 0.0).collect();
        poles.sort_by(|a, b| a.re.hypot(a.im).total_cmp(&b.re.hypot(b.im)));
        Some(poles)
    }

    /// Displacement of the tool tip per force on it that swings with an angular frequency in rad/s:
    /// H = S (K + iωC - ω²M)⁻¹ Sᵀ, mm/N; `None` where nothing holds the motion.
    pub fn receptance(&self, omega: f64) -> Option<Matrix3<Complex<f64>>> {
        let dynamic = DMatrix::from_fn(self.mass.nrows(), self.mass.nrows(), |i, k| {
            let still = self.stiffness[(i, k)] - omega * omega * self.mass[(i, k)];
            Complex::new(still, omega * self.damping[(i, k)])
        });
        let tip = self.tip.fixed_rows::<3>(0).map(|value| Complex::new(value, 0.0));
        let moved = dynamic.lu().solve(&tip.transpose())?;
        let found = tip * moved;
        found
            .iter()
            .all(|value| value.re.is_finite())
            .then(|| found.fixed_view::<3, 3>(0, 0).into())
    }
}
