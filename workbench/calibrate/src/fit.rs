// SPDX-License-Identifier: GPL-2.0-or-later
//! Least squares on readings and drawing, and the detection of outliers.
//!
//! Minimizes Σ (residual/noise)² + Σ (change/deviation)²: the most probable machine if the
//! drawing's tolerances and the noise are normal. A value that no reading determines keeps the drawing's value,
//! because only the second sum depends on it.

use super::least_squares::{Linear, NotConverged, minimum};
use super::model::Model;
use super::reading::{Changed, Reading};
use kinematics::Fault;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Normal};

/// Probability of an outlier in readings that have none.
const FALSE_ALARM: f64 = 1e-3;

/// Largest share of outliers that can be distinguished from a machine unlike its drawing.
const MOST_OUTLIERS: f64 = 0.1;

/// Least redundancy of a reading: the share of its error that remains in the residual. With less, the fit
/// follows the reading whatever it is, and cannot judge it.
const LEAST_FREE: f64 = 1e-3;

/// Ratio of the standard deviation of a normal distribution to the median of |x|.
pub(crate) const MEDIAN_TO_DEVIATION: f64 = 1.4826;

/// Initial noise if none is given, in sizes of the machine.
const FIRST_NOISE: f64 = 1e-5;

/// Rounds after which the noise has converged: each changes it only by the small effect of the drawing's
/// weight.
const NOISE_ROUNDS: usize = 4;

/// Number of groups of readings that are held out in turn.
const FOLDS: usize = 5;

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Misfit {
    #[error(
        "too few readings: {numbers} numbers determine {determined} values, so none can be verified; measure more"
    )]
    TooFew { numbers: usize, determined: usize },
    #[error("{0}: {1}")]
    Unreachable(String, Fault),
    #[error(
        "with a tool of {0} the machine reaches no pose within the axis limits: check length, unit and sign of the tool"
    )]
    NoWorkspace(f64),
    #[error(
        "{0} of {1} readings contradict the others: check plate, probe and the order of the holes, or use a larger --noise"
    )]
    TooManyOutliers(usize, usize),
    #[error(transparent)]
    Search(#[from] NotConverged),
}

/// A reading that contradicts the others, and is left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlier {
    pub reading: usize,
    /// Distance from the value that the other readings imply, in units of length.
    pub miss: f64,
    pub deviations: f64,
}

/// Result of fitting a model to readings.
#[derive(Clone, Debug)]
pub struct Fit {
    pub changes: Vec<f64>,
    /// Covariance of the changes.
    pub covariance: DMatrix<f64>,
    /// Standard deviation of one number of a reading.
    pub noise: f64,
    /// Derivatives of the numbers of the accepted readings with respect to the parameters.
    pub jacobian: DMatrix<f64>,
    pub residuals: DVector<f64>,
    /// Readings left out, in the order in which they were found.
    pub outliers: Vec<Outlier>,
}

impl Fit {
    /// Returns the standard deviation of a parameter.
    pub fn deviation(&self, k: usize) -> f64 {
        self.covariance[(k, k)].max(0.0).sqrt()
    }

    /// Returns the residual whose reading, left out, would reduce the sum of squares the most, and the
    /// reduction.
    pub(crate) fn foremost(&self) -> (usize, f64) {
        let squares = judged(self).into_iter().map(|size| size.map_or(0.0, |size| size * size));
        let (place, square) =
            squares.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0));
        (place, square / (self.noise * self.noise))
    }

    /// Returns the root mean square of the residuals.
    pub fn rms(&self) -> f64 {
        rms(&self.residuals)
    }
}

pub(crate) fn rms(values: &DVector<f64>) -> f64 {
    (values.norm_squared() / values.len().max(1) as f64).sqrt()
}

/// Returns the residuals of readings, stacked, and their derivatives, each times the weight of its
/// instrument.
///
/// # Errors
/// A reading that is impossible for the changed machine.
pub fn residuals(model: &Model, readings: &[&Reading], changes: &[f64]) -> Result<Linear, Misfit> {
    let changed = Changed::new(model, changes).map_err(|fault| {
        Misfit::Unreachable("this geometry is not a valid machine".into(), fault)
    })?;
    let rows = readings.iter().map(|reading| reading.measured.rows()).sum();
    let mut values = DVector::zeros(rows);
    let mut jacobian = DMatrix::zeros(rows, model.parameters.len());
    let mut row = 0;
    for reading in readings {
        let (value, by, _) = changed
            .residual(reading, &reading.pose)
            .map_err(|fault| Misfit::Unreachable(reading.name.clone(), fault))?;
        let weight = reading.instrument.weight;
        values.rows_mut(row, value.len()).copy_from(&(&value * weight));
        jacobian.rows_mut(row, value.len()).copy_from(&(by * weight));
        row += value.len();
    }
    Ok((values, jacobian))
}

/// Returns the sum of squares of residuals and changes, each in its standard deviations: distributed as for as
/// many normal numbers as there are residuals, if noise and tolerances are as stated.
pub(crate) fn chi_square(
    model: &Model,
    residuals: &DVector<f64>,
    changes: &[f64],
    noise: f64,
) -> f64 {
    let prior = model.parameters.iter().zip(changes).map(|(p, x)| (x / p.deviation).powi(2));
    residuals.norm_squared() / (noise * noise) + prior.sum::<f64>()
}

/// Returns the most probable changes for this noise.
pub(super) fn most_probable(
    model: &Model,
    readings: &[&Reading],
    start: &[f64],
    noise: f64,
) -> Result<Vec<f64>, Misfit> {
    let deviation: Vec<f64> = model.parameters.iter().map(|p| p.deviation).collect();
    let scaled = |x: &[f64]| x.iter().zip(&deviation).map(|(x, d)| x * d).collect::<Vec<f64>>();
    let mut fault = None;
    let found =
        minimum(&start.iter().zip(&deviation).map(|(x, d)| x / d).collect::<Vec<f64>>(), |x| {
            match residuals(model, readings, &scaled(x)) {
                Ok((values, jacobian)) => Some(with_prior(values, jacobian, &deviation, noise, x)),
                Err(misfit) => {
                    fault = Some(misfit);
                    None
                }
            }
        });
    match (found, fault) {
        (Ok(x), _) => Ok(scaled(&x)),
        (Err(_), Some(misfit)) => Err(misfit),
        (Err(text), None) => Err(Misfit::Search(text)),
    }
}

/// Appends the changes in units of their deviation to the residuals in units of noise.
fn with_prior(
    values: DVector<f64>,
    jacobian: DMatrix<f64>,
    deviation: &[f64],
    noise: f64,
    x: &[f64],
) -> Linear {
    let (rows, columns) = jacobian.shape();
    let mut all = DVector::zeros(rows + columns);
    all.rows_mut(0, rows).copy_from(&(values / noise));
    all.rows_mut(rows, columns).copy_from_slice(x);
    let mut by = DMatrix::zeros(rows + columns, columns);
    for k in 0..columns {
        by.view_mut((0, k), (rows, 1)).copy_from(&(jacobian.column(k) * (deviation[k] / noise)));
        by[(rows + k, k)] = 1.0;
    }
    (all, by)
}

/// Returns the covariance of the changes, for readings with these derivatives.
pub(crate) fn covariance(model: &Model, jacobian: &DMatrix<f64>, noise: f64) -> DMatrix<f64> {
    let n = model.parameters.len();
    let deviation = DVector::from_iterator(n, model.parameters.iter().map(|p| p.deviation));
    let scaled =
        DMatrix::from_fn(jacobian.nrows(), n, |i, k| jacobian[(i, k)] * deviation[k] / noise);
    let information = DMatrix::identity(n, n) + scaled.transpose() * &scaled;
    let inverse = information.cholesky().map(|factor| factor.inverse());
    // The identity plus a square is positive definite, unless an entry is NaN.
    let inverse = inverse.unwrap_or_else(|| DMatrix::from_element(n, n, f64::NAN));
    DMatrix::from_fn(n, n, |i, k| inverse[(i, k)] * deviation[i] * deviation[k])
}

/// Fits a model to readings. Without a `noise` the noise of the readings is estimated; readings that
/// contradict the others are left out one by one.
///
/// # Errors
/// See [`Misfit`].
pub fn fit(model: &Model, readings: &[Reading], noise: Option<f64>) -> Result<Fit, Misfit> {
    let mut believed: Vec<usize> = (0..readings.len()).collect();
    let mut outliers = vec![];
    let mut start = vec![0.0; model.parameters.len()];
    loop {
        let chosen: Vec<&Reading> = believed.iter().map(|i| &readings[*i]).collect();
        let mut found = settled(model, &chosen, &start, noise)?;
        let Some((place, outlier)) = worst(&found, &chosen, &believed) else {
            found.outliers = outliers;
            return Ok(found);
        };
        outliers.push(outlier);
        if outliers.len() as f64 > MOST_OUTLIERS * readings.len() as f64 {
            return Err(Misfit::TooManyOutliers(outliers.len(), readings.len()));
        }
        believed.remove(place);
        start = found.changes;
    }
}

/// Fits all of these readings.
fn settled(
    model: &Model,
    readings: &[&Reading],
    start: &[f64],
    given: Option<f64>,
) -> Result<Fit, Misfit> {
    if given.is_none() {
        check_count(model, readings, start)?;
    }
    let mut noise = given.unwrap_or(FIRST_NOISE * model.size());
    let mut changes = start.to_vec();
    let rounds = if given.is_some() { 1 } else { NOISE_ROUNDS };
    let mut left = vec![];
    for _ in 0..rounds {
        changes = most_probable(model, readings, &changes, noise)?;
        let (values, jacobian) = residuals(model, readings, &changes)?;
        let covariance = covariance(model, &jacobian, noise);
        left.push(Fit {
            changes: changes.clone(),
            covariance,
            noise,
            jacobian,
            residuals: values,
            outliers: vec![],
        });
        if given.is_none() {
            noise = left.last().map_or(noise, scatter).max(f64::EPSILON * model.size());
        }
    }
    Ok(left.pop().expect("there is at least one round"))
}

/// Refuses too few readings to check any of them: without scatter the noise cannot be estimated.
fn check_count(model: &Model, readings: &[&Reading], changes: &[f64]) -> Result<(), Misfit> {
    let (values, jacobian) = residuals(model, readings, changes)?;
    let determined = super::observe::rank(model, &jacobian);
    match values.len() > determined {
        true => Ok(()),
        false => Err(Misfit::TooFew { numbers: values.len(), determined }),
    }
}

/// Returns the residuals, each divided by the root of its redundancy; `None` if the redundancy is
/// too small.
fn judged(found: &Fit) -> Vec<Option<f64>> {
    let weight = &found.jacobian * &found.covariance;
    let square = found.noise * found.noise;
    let free = |i: usize| 1.0 - weight.row(i).dot(&found.jacobian.row(i)) / square;
    let judge = |i: usize| {
        let free = free(i);
        (free > LEAST_FREE).then(|| found.residuals[i] / free.sqrt())
    };
    (0..found.residuals.len()).map(judge).collect()
}

/// Estimates the noise of the readings by the median, which a tenth of outliers changes only slightly.
fn scatter(found: &Fit) -> f64 {
    let mut sizes: Vec<f64> = judged(found).into_iter().flatten().map(f64::abs).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).map_or(found.noise, |median| median * MEDIAN_TO_DEVIATION)
}

/// Returns the reading that agrees least with the others, if noise does not explain it: its index among
/// the accepted readings.
fn worst(found: &Fit, readings: &[&Reading], numbers: &[usize]) -> Option<(usize, Outlier)> {
    let noise = found.noise.max(scatter(found));
    let rows =
        readings.iter().enumerate().flat_map(|(i, r)| std::iter::repeat_n(i, r.measured.rows()));
    let sizes = rows.zip(judged(found)).filter_map(|(i, size)| Some((i, size?.abs())));
    let (place, miss) = sizes.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let deviations = miss / noise;
    let miss = miss / readings[place].instrument.weight;
    let outlier = Outlier { reading: numbers[place], miss, deviations };
    (deviations > largest_by_chance(found.residuals.len())).then_some((place, outlier))
}

/// Returns the value that the largest of `count` normal numbers exceeds once in a thousand times, in deviations.
pub(crate) fn largest_by_chance(count: usize) -> f64 {
    Normal::standard().inverse_cdf(1.0 - FALSE_ALARM / (2.0 * count.max(1) as f64))
}

/// Returns the root mean square residual of readings left out of the fit: groups of readings are left out in
/// turn, outliers are ignored. `progress` receives the share done.
///
/// # Errors
/// See [`Misfit`].
pub fn held_out(
    model: &Model,
    readings: &[Reading],
    found: &Fit,
    mut progress: impl FnMut(f64),
) -> Result<f64, Misfit> {
    let is_outlier = |i: usize| found.outliers.iter().any(|outlier| outlier.reading == i);
    let believed = || readings.iter().enumerate().filter(|(i, _)| !is_outlier(*i)).map(|(_, r)| r);
    let mut left: Vec<f64> = vec![];
    for fold in 0..FOLDS {
        let (out, rest): (Vec<&Reading>, Vec<&Reading>) =
            believed().partition(|reading| reading.group % FOLDS == fold);
        if !out.is_empty() && !rest.is_empty() {
            let changes = most_probable(model, &rest, &found.changes, found.noise)?;
            left.extend(residuals(model, &out, &changes)?.0.iter());
        }
        progress((fold + 1) as f64 / FOLDS as f64);
    }
    Ok(rms(&DVector::from_vec(left)))
}
