// SPDX-License-Identifier: GPL-2.0-or-later
//! Typing mistakes in readings, detected by the other readings: one in another unit, two exchanged,
//! several a row too high or too low.
//!
//! The search runs if the readings as typed do not fit the machine within its tolerances. The linear model at the
//! best fit selects likely mistakes: with M = 1 + J Σ Jᵀ, all in units of noise, readings y give yᵀ M⁻¹ y,
//! which is the sum of squares that the fit leaves. The most likely ones are fitted. A mistake is accepted if
//! correcting it makes that sum ordinary, and is no worse than leaving out the readings concerned.

use super::fit::{Misfit, chi_square, most_probable, residuals};
use super::gauge::Scale;
use super::log::BadLog;
use super::model::Model;
use super::reading::Reading;
use super::sheet::{Row, Sheet, rounded};
use machine::read::mechanism::Mechanism;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Probability of a search in readings without a mistake.
pub(crate) const FALSE_ALARM: f64 = 1e-3;

/// Returns the value that a sum of squares of `count` normal numbers exceeds once in a thousand times.
pub(crate) fn most(count: usize) -> f64 {
    let law = ChiSquared::new(count.max(1) as f64);
    law.map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - FALSE_ALARM))
}

/// A table of typed readings, and its first index among all readings.
#[derive(Clone, Debug)]
pub struct Typed {
    pub file: usize,
    /// The table.
    pub sheet: Sheet,
    /// Index of its first reading.
    pub first: usize,
}

/// The readings as numbers of the linear model, in units of noise.
struct Linear {
    y: DVector<f64>,
    inverse: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Linear {
    fn chi_square(&self, y: &DVector<f64>) -> f64 {
        y.dot(&self.factor.solve(y))
    }

    /// Returns the sum that remains without some readings.
    fn without(&self, rows: &[usize]) -> f64 {
        let solved = &self.inverse * &self.y;
        let own = DVector::from_fn(rows.len(), |i, _| solved[rows[i]]);
        let block =
            DMatrix::from_fn(rows.len(), rows.len(), |i, k| self.inverse[(rows[i], rows[k])]);
        let gain = block.cholesky().map_or(0.0, |factor| own.dot(&factor.solve(&own)));
        self.y.dot(&solved) - gain
    }
}

/// One typed number: its index among the numbers of the model, and its effect.
struct Number<'a> {
    row: &'a Row,
    run: usize,
    reading: usize,
    place: usize,
    /// Units of noise per unit of the reading.
    slope: f64,
}

/// A typing mistake that may explain the readings.
struct Mistake {
    /// Sum of squares after the correction, by the linear model.
    chi_square: f64,
    /// Indices of the numbers concerned, and their corrected values.
    meant: Vec<(usize, f64)>,
    line: usize,
    text: String,
}

/// Factor by which the linear model may be wrong at a fit that mistakes have distorted.
const ROUGH: f64 = 10.0;

/// Number of likely mistakes that are fitted.
const CLOSELY: usize = 8;

/// Searches for one mistake that explains why readings do not fit; returns it with the number of the file.
///
/// # Errors
/// See [`Misfit`].
pub fn look(
    config: &Mechanism,
    model: &Model,
    readings: &[Reading],
    typed: &[Typed],
    noise: f64,
) -> Result<Option<(usize, BadLog)>, Misfit> {
    let all: Vec<&Reading> = readings.iter().collect();
    let changes = most_probable(model, &all, &vec![0.0; model.parameters.len()], noise)?;
    let (left, jacobian) = residuals(model, &all, &changes)?;
    if !(chi_square(model, &left, &changes, noise) > most(left.len())) {
        return Ok(None);
    }
    let Some(linear) = linear(model, &left, &jacobian, &changes, noise) else { return Ok(None) };
    for table in typed {
        let numbers = numbers(config, readings, table, noise);
        for mistake in likely(&table.sheet, &linear, &numbers) {
            if is_undone(config, model, readings, table, &numbers, &mistake, noise)? {
                return Ok(Some((table.file, BadLog { line: mistake.line, text: mistake.text })));
            }
        }
    }
    Ok(None)
}

/// Returns whether readings with a mistake corrected fit, and as well as without the readings concerned.
fn is_undone(
    config: &Mechanism,
    model: &Model,
    readings: &[Reading],
    table: &Typed,
    numbers: &[Number],
    mistake: &Mistake,
    noise: f64,
) -> Result<bool, Misfit> {
    let mut undone = readings.to_vec();
    let mut about = vec![];
    for (place, shown) in &mistake.meant {
        let Some(number) = numbers.iter().find(|number| number.place == *place) else { continue };
        let (gauge, stop) = (&table.sheet.gauge, &number.row.stop);
        let object = &table.sheet.objects[stop.object];
        let old = &readings[number.reading];
        let Ok(new) = gauge.reading(config, object, stop.at, *shown) else { return Ok(false) };
        undone[number.reading] = Reading {
            name: old.name.clone(),
            group: old.group,
            frame: old.frame,
            instrument: old.instrument,
            ..new
        };
        about.push(number.reading);
    }
    let rest: Vec<&Reading> =
        readings.iter().enumerate().filter(|(i, _)| !about.contains(i)).map(|(_, r)| r).collect();
    let left = |readings: &[&Reading]| -> Result<(f64, usize), Misfit> {
        let start = vec![0.0; model.parameters.len()];
        let changes = most_probable(model, readings, &start, noise)?;
        let (left, _) = residuals(model, readings, &changes)?;
        Ok((chi_square(model, &left, &changes, noise), left.len()))
    };
    let (with, count) = left(&undone.iter().collect::<Vec<_>>())?;
    let (without, _) = left(&rest)?;
    Ok(with <= most(count) && with - without <= most(about.len()))
}

fn linear(
    model: &Model,
    left: &DVector<f64>,
    jacobian: &DMatrix<f64>,
    changes: &[f64],
    noise: f64,
) -> Option<Linear> {
    let y = (left - jacobian * DVector::from_column_slice(changes)) / noise;
    let scaled = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, k| {
        jacobian[(i, k)] * model.parameters[k].deviation / noise
    });
    let count = y.len();
    let factor = (DMatrix::identity(count, count) + &scaled * scaled.transpose()).cholesky()?;
    Some(Linear { y, inverse: factor.inverse(), factor })
}

/// Returns the numbers of a table, those of the first run first.
fn numbers<'a>(
    config: &Mechanism,
    readings: &[Reading],
    table: &'a Typed,
    noise: f64,
) -> Vec<Number<'a>> {
    let rows_before =
        readings[..table.first].iter().map(|reading| reading.measured.rows()).sum::<usize>();
    let mut found = vec![];
    let mut count = 0;
    for row in &table.sheet.rows {
        for run in 0..row.shown.len() {
            let taken = &readings[table.first + count];
            let object = &table.sheet.objects[row.stop.object];
            let slope = table.sheet.gauge.slope(config, object, &taken.pose)
                * taken.instrument.weight
                / noise;
            let (reading, place) = (table.first + count, rows_before + count);
            found.push(Number { row, run, reading, place, slope });
            count += 1;
        }
    }
    found.sort_by_key(|number| (number.run, number.place));
    found
}

/// Returns the likely mistakes, the best first.
fn likely(sheet: &Sheet, linear: &Linear, numbers: &[Number]) -> Vec<Mistake> {
    let mut all = units(sheet, linear, numbers);
    all.extend(shifts(linear, numbers));
    all.sort_by(|a, b| a.chi_square.total_cmp(&b.chi_square));
    all.truncate(CLOSELY);
    all
}

/// Returns the sum of squares with other readings in some rows, if they roughly explain it.
fn explained(linear: &Linear, changed: &[(&Number, f64)]) -> Option<f64> {
    let mut y = linear.y.clone();
    for (number, shown) in changed {
        y[number.place] += number.slope * (shown - number.row.shown[number.run]);
    }
    let chi_square = linear.chi_square(&y);
    let places: Vec<usize> = changed.iter().map(|(number, _)| number.place).collect();
    let most = ROUGH * most(y.len());
    (chi_square <= most && chi_square - linear.without(&places) <= most).then_some(chi_square)
}

/// Returns mistakes of one reading in another unit.
fn units(sheet: &Sheet, linear: &Linear, numbers: &[Number]) -> Vec<Mistake> {
    let own = sheet.gauge.scale;
    let mut found = vec![];
    for number in numbers {
        let shown = number.row.shown[number.run];
        for scale in Scale::ALL.into_iter().filter(|scale| *scale != own) {
            let meant = shown * scale.in_mm() / own.in_mm();
            if let Some(chi_square) = explained(linear, &[(number, meant)]) {
                let text = format!(
                    "{shown} {own} of pose {} does not fit the other readings, but {shown} {scale} would: enter {} {own}",
                    number.row.pose,
                    rounded(meant)
                );
                let meant = vec![(number.place, meant)];
                found.push(Mistake { chi_square, meant, line: number.row.line, text });
            }
        }
    }
    found
}

/// Returns mistakes of the order within one run: the first of some rows typed last, or the last first; for two
/// rows both are the exchange.
fn shifts(linear: &Linear, numbers: &[Number]) -> Vec<Mistake> {
    let mut found = vec![];
    for (i, first) in numbers.iter().enumerate() {
        for k in i + 1..numbers.len() {
            let block = &numbers[i..=k];
            if block[block.len() - 1].run != first.run {
                break;
            }
            let shown: Vec<f64> = block.iter().map(|number| number.row.shown[number.run]).collect();
            let mut orders = vec![];
            let mut exchanged = shown.clone();
            exchanged.swap(0, shown.len() - 1);
            orders.push((exchanged, true));
            if block.len() > 2 {
                let (mut up, mut down) = (shown.clone(), shown.clone());
                up.rotate_left(1);
                down.rotate_right(1);
                orders.extend([(up, false), (down, false)]);
            }
            for (order, is_exchange) in orders {
                found.extend(reordered(linear, block, &order, is_exchange));
            }
        }
    }
    found
}

/// Returns a mistake of the order, unless leaving out one reading explains as much.
fn reordered(
    linear: &Linear,
    block: &[Number],
    order: &[f64],
    is_exchange: bool,
) -> Option<Mistake> {
    let changed: Vec<(&Number, f64)> = block
        .iter()
        .zip(order)
        .filter(|(number, shown)| number.row.shown[number.run] != **shown)
        .map(|(number, shown)| (number, *shown))
        .collect();
    let chi_square = explained(linear, &changed)?;
    let limit = most(linear.y.len());
    if changed.iter().any(|(number, _)| linear.without(&[number.place]) <= limit) {
        return None;
    }
    let (first, last) = (block.first()?.row, block.last()?.row);
    let text = match is_exchange {
        true => format!(
            "the readings of lines {} and {} would fit if exchanged: check their order",
            first.line, last.line
        ),
        false => format!(
            "the readings of lines {} to {} would fit if moved by a row: check for a row too high or \
             too low",
            first.line, last.line
        ),
    };
    let meant = changed.iter().map(|(number, shown)| (number.place, *shown)).collect();
    Some(Mistake { chi_square, meant, line: first.line, text })
}
