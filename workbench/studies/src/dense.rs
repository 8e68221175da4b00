// SPDX-License-Identifier: GPL-2.0-or-later
//! Eigenvalues of matrices of any size, and solutions of linear equations.
//!
//! Generic library code is compiled where it is used: in this crate that is at the optimization level which
//! large matrices need.

use nalgebra::{Complex, ComplexField, DMatrix, Dyn, Schur};

pub type ComplexMatrix = DMatrix<Complex<f64>>;

/// Steps of the eigenvalue routine for each row of its matrix: far more than it needs.
const SCHUR_STEPS: usize = 200;

/// Computes the eigenvalues of a matrix; `None` if an entry is not finite or the routine does not converge.
pub fn eigenvalues(matrix: DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    Some(schur(matrix)?.complex_eigenvalues().iter().copied().collect())
}

pub fn complex_eigenvalues(matrix: ComplexMatrix) -> Option<Vec<Complex<f64>>> {
    // The diagonal of a complex Schur form.
    Some(complex_schur(matrix)?.1.diagonal().iter().copied().collect())
}

/// Computes U and T with A = U T U*, U unitary and T upper triangular; `None` as for [`eigenvalues`].
pub fn complex_schur(matrix: ComplexMatrix) -> Option<(ComplexMatrix, ComplexMatrix)> {
    schur(matrix).map(Schur::unpack)
}

/// Solves A X = B; `None` if A is singular.
pub fn solved(a: DMatrix<f64>, b: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    a.lu().solve(b)
}

fn schur<T: ComplexField<RealField = f64>>(matrix: DMatrix<T>) -> Option<Schur<T, Dyn>> {
    let steps = SCHUR_STEPS * matrix.nrows();
    let is_finite = matrix.iter().all(|entry| entry.is_finite());
    is_finite.then(|| Schur::try_new(matrix, f64::EPSILON, steps)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_has_its_angle_and_what_is_no_number_has_no_eigenvalues() {
        let (s, c) = 0.3_f64.sin_cos();
        let turn = DMatrix::from_row_slice(2, 2, &[c, -s, s, c]);
        let complex = turn.map(|entry| Complex::new(entry, 0.0));
        for mut found in [eigenvalues(turn), complex_eigenvalues(complex)].map(Option::unwrap) {
            found.sort_by(|a, b| a.im.total_cmp(&b.im));
            for (value, angle) in found.iter().zip([-0.3, 0.3]) {
                // Rounding of a matrix of order 2.
                assert!(
                    (value - Complex::new(angle.cos(), angle.sin())).modulus() < 1e-15,
                    "{value}"
                );
            }
        }
        let bad = DMatrix::from_element(2, 2, f64::NAN);
        assert_eq!(complex_eigenvalues(bad.map(|entry| Complex::new(entry, 0.0))), None);
        assert_eq!(eigenvalues(bad), None);
    }
}
