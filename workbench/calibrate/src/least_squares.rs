// SPDX-License-Identifier: GPL-2.0-or-later
//! Least squares by Levenberg and Marquardt's method: the library's interface on a function.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra::{DMatrix, DVector, Dyn, U1, VecStorage};

/// Residuals and their derivatives at a point.
pub type Linear = (DVector<f64>, DMatrix<f64>);

struct Problem<F> {
    evaluate: F,
    place: DVector<f64>,
    here: Option<Linear>,
}

impl<F: FnMut(&[f64]) -> Option<Linear>> LeastSquaresProblem<f64, Dyn, Dyn> for Problem<F> {
    type ResidualStorage = VecStorage<f64, Dyn, U1>;
    type JacobianStorage = VecStorage<f64, Dyn, Dyn>;
    type ParameterStorage = VecStorage<f64, Dyn, U1>;

    fn set_params(&mut self, place: &DVector<f64>) {
        self.place.copy_from(place);
        self.here = (self.evaluate)(place.as_slice());
    }

    fn params(&self) -> DVector<f64> {
        self.place.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        self.here.as_ref().map(|(residuals, _)| residuals.clone())
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        self.here.as_ref().map(|(_, jacobian)| jacobian.clone())
    }
}

/// A search that did not converge.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("least squares did not converge: {0}")]
pub struct NotConverged(String);

/// Finds the least-squares minimum near `start`, or reports why none was found. `evaluate` returns `None` if
/// there are no residuals.
pub(crate) fn minimum(
    start: &[f64],
    evaluate: impl FnMut(&[f64]) -> Option<Linear>,
) -> Result<Vec<f64>, NotConverged> {
    let place = DVector::from_column_slice(start);
    let mut problem = Problem { evaluate, place: place.clone(), here: None };
    problem.set_params(&place);
    let (found, report) = LevenbergMarquardt::new().minimize(problem);
    match report.termination {
        // With `NoImprovementPossible` rounding ends the search, not the tolerance.
        TerminationReason::ResidualsZero
        | TerminationReason::Orthogonal
        | TerminationReason::Converged { .. }
        | TerminationReason::NoImprovementPossible(_) => Ok(found.place.as_slice().to_vec()),
        other => Err(NotConverged(format!("{other:?}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_is_found_and_what_cannot_be_evaluated_is_an_error() {
        // (x² − 2)² has its minimum at √2.
        let square = |x: &[f64]| {
            Some((
                DVector::from_element(1, x[0] * x[0] - 2.0),
                DMatrix::from_element(1, 1, 2.0 * x[0]),
            ))
        };
        let found = minimum(&[1.0], square).unwrap();
        // Two roundings of f64 at 1.4.
        assert!((found[0] - 2.0_f64.sqrt()).abs() < 1e-15);
        assert!(minimum(&[1.0], |_| None).is_err());
    }
}
