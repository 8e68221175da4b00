// SPDX-License-Identifier: GPL-2.0-or-later
//! The next poses to measure: the candidates that reduce the tip's uncertainty over the workspace the most.

use super::fit::covariance;
use super::model::Model;
use nalgebra::DMatrix;

/// A possible measurement: derivatives of its numbers with respect to the parameters.
pub type Candidate = DMatrix<f64>;

/// Returns the indices of `count` candidates, best first, each of which reduces the mean
/// variance of the tip the most in its turn. `tips` are rates of the tip over the workspace, `known` the
/// derivatives of the readings already taken. A candidate may occur several times.
pub fn next_best(
    model: &Model,
    known: &DMatrix<f64>,
    candidates: &[Candidate],
    tips: &[DMatrix<f64>],
    noise: f64,
    count: usize,
) -> Vec<usize> {
    let mut spread = covariance(model, known, noise);
    let n = model.parameters.len();
    let weight =
        tips.iter().fold(DMatrix::zeros(n, n), |sum, rates| sum + rates.transpose() * rates);
    let mut chosen = vec![];
    for _ in 0..count {
        let gains = candidates.iter().map(|candidate| gain(&spread, &weight, candidate, noise));
        let best = gains.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((best, _)) = best else { break };
        spread = updated(&spread, &candidates[best], noise);
        chosen.push(best);
    }
    chosen
}

/// Returns the reduction of the sum of the tips' variances by a candidate.
fn gain(spread: &DMatrix<f64>, weight: &DMatrix<f64>, candidate: &Candidate, noise: f64) -> f64 {
    let across = spread * candidate.transpose();
    let own = innovation(candidate, &across, noise);
    let weighted = across.transpose() * weight * &across;
    own.try_inverse().map_or(0.0, |inverse| (inverse * weighted).trace())
}

fn updated(spread: &DMatrix<f64>, candidate: &Candidate, noise: f64) -> DMatrix<f64> {
    let across = spread * candidate.transpose();
    match innovation(candidate, &across, noise).try_inverse() {
        Some(inverse) => spread - &across * inverse * across.transpose(),
        None => spread.clone(),
    }
}

fn innovation(candidate: &Candidate, across: &DMatrix<f64>, noise: f64) -> DMatrix<f64> {
    let rows = candidate.nrows();
    candidate * across + DMatrix::identity(rows, rows) * (noise * noise)
}

/// Returns the standard deviation of the tip, root mean square over `tips`, after readings with these
/// derivatives.
pub fn tip_deviation(model: &Model, read: &DMatrix<f64>, tips: &[DMatrix<f64>], noise: f64) -> f64 {
    let spread = covariance(model, read, noise);
    let variance: f64 =
        tips.iter().map(|rates| (rates * &spread * rates.transpose()).trace()).sum();
    (variance / tips.len().max(1) as f64).sqrt()
}
