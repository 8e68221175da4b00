// SPDX-License-Identifier: GPL-2.0-or-later
//! Accuracy of the tip's motion over the workspace: its errors at many poses, minus the part that a better placement
//! of the workpiece would remove.
//!
//! No measurement determines a common motion of base and workpiece, and gauges on planes and balls determine less than
//! that. The error after the best rigid motion of the workpiece is the error of the machined part.

use super::model::Model;
use super::plate::fitted;
use super::reading::Changed;
use kinematics::{Fault, Joints, Machine, Pose, Solver, Vector3};
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ContinuousCDF, Normal};

/// Machines drawn from a covariance: they determine the 95 % quantile to half a percent of probability.
const DRAWS: usize = 2000;

/// Root mean square of the tip's error over poses, machine units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Square root of its mean square, over all possible machines.
    pub expected: f64,
    /// Upper bound with the requested confidence.
    pub below: f64,
}

/// Returns the rates of the tip at poses with respect to the parameters of the machine, three rows per pose, minus
/// the rigid motion that fits best.
///
/// # Errors
/// As [`Machine::inverse`].
pub(crate) fn rates(
    model: &Model,
    changed: &Changed,
    poses: &[Pose],
    tool: &Vector3<f64>,
) -> Result<DMatrix<f64>, Fault> {
    let mut rates = DMatrix::zeros(3 * poses.len(), model.parameters.len());
    let mut rigid = DMatrix::zeros(3 * poses.len(), 6);
    for (i, pose) in poses.iter().enumerate() {
        let posed = changed.at(*pose, tool)?;
        rates.rows_mut(3 * i, 3).copy_from(&posed.rates.rows(0, 3));
        rigid.fixed_view_mut::<3, 3>(3 * i, 0).fill_with_identity();
        rigid.fixed_view_mut::<3, 3>(3 * i, 3).copy_from(&posed.tip.cross_matrix());
    }
    for (k, parameter) in model.parameters.iter().enumerate() {
        if !parameter.quantity.is_of_machine() {
            rates.column_mut(k).fill(0.0);
        }
    }
    // Columns of equal norm, so that rounding does not count as a motion.
    for mut column in rigid.column_iter_mut() {
        let norm = column.norm();
        column /= norm.max(f64::MIN_POSITIVE);
    }
    let svd = rigid.svd(true, false);
    let Some(motions) = svd.u else { return Ok(rates) };
    let kept: Vec<usize> =
        (0..svd.singular_values.len()).filter(|k| svd.singular_values[*k] > 1e-9).collect();
    let motions = motions.select_columns(&kept);
    Ok(&rates - &motions * (motions.transpose() * &rates))
}

/// Returns the error for parameters with this covariance and these rates.
pub(crate) fn of_covariance(
    rates: &DMatrix<f64>,
    covariance: &DMatrix<f64>,
    confidence: f64,
) -> Shape {
    let eigen = covariance.clone().symmetric_eigen();
    let spread = DVector::from_iterator(
        eigen.eigenvalues.len(),
        eigen.eigenvalues.iter().map(|value| value.max(0.0).sqrt()),
    );
    let by_draw = rates * &eigen.eigenvectors * DMatrix::from_diagonal(&spread);
    // The sum of squares depends only on the singular values.
    let squares: Vec<f64> = by_draw.singular_values().iter().map(|value| value * value).collect();
    let poses = rates.nrows() as f64 / 3.0;
    let mut random = Pcg64::seed_from_u64(0);
    let law = Normal::standard();
    let mut normal = || law.inverse_cdf(random.random_range(f64::EPSILON..1.0));
    let mut drawn: Vec<f64> = (0..DRAWS)
        .map(|_| squares.iter().map(|square| square * normal().powi(2)).sum::<f64>())
        .collect();
    drawn.sort_by(f64::total_cmp);
    let place = ((confidence * DRAWS as f64).ceil() as usize).clamp(1, DRAWS) - 1;
    let root = |sum: f64| (sum / poses).sqrt();
    Shape { expected: root(squares.iter().sum()), below: root(drawn[place]) }
}

/// Returns the errors of the tip of a true machine under a control with another geometry, at poses, minus the rigid
/// motion that fits best: for simulations, where the truth is known. `drives` returns the joints that the drives reach
/// for commanded ones.
///
/// # Errors
/// As [`Machine::inverse`] and [`Machine::forward`].
pub fn errors(
    control: &Machine,
    truth: &Machine,
    drives: impl Fn(&Joints) -> Joints,
    poses: &[Pose],
    tool: &Vector3<f64>,
) -> Result<Vec<f64>, Fault> {
    let mut wanted = vec![];
    let mut reached = vec![];
    for pose in poses {
        let joints = drives(&control.inverse(pose, tool)?);
        let there = truth.forward(&joints, pose, tool, &Solver::default())?.pose;
        wanted.push(pose.position - tool);
        reached.push(there.position - tool);
    }
    let frame = fitted(&wanted, &reached);
    Ok(wanted.iter().zip(&reached).map(|(a, b)| (frame.seen(b) - a).norm()).collect())
}
