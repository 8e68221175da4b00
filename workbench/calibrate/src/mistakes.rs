// SPDX-License-Identifier: GPL-2.0-or-later
//! Typing mistakes in readings, detected by the other readings: one in another unit, two exchanged,
//! several a row too high or too low, all with an offset. Of two runs, a mistake may be in one or in both.
//!
//! The comparison of both runs comes first (`runs`). The search runs if the readings as typed do not fit the machine
//! within its tolerances. The linear model at the best fit selects likely mistakes: with M = 1 + J Σ Jᵀ, all in units
//! of noise, readings y give yᵀ M⁻¹ y, which is the sum of squares that the fit leaves. The most likely ones are
//! fitted. A mistake is accepted if correcting it makes that sum ordinary, and is no worse than leaving out the
//! readings concerned.

use super::fit::{Misfit, chi_square, most_probable, residuals};
use super::gauge::Scale;
use super::log::BadLog;
use super::model::Model;
use super::reading::Reading;
use super::runs::{self, Found, LIKELIER, Order, Suspect};
use super::sheet::{Row, Sheet, UNUSUAL, rounded};
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
    /// Index of the row.
    index: usize,
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

/// Compares both runs of every table; returns a mistake with the number of its file. If it may be in either run, the
/// run whose correction fits the other readings better is named.
pub fn compare_runs(
    config: &Mechanism,
    model: &Model,
    readings: &[Reading],
    typed: &[Typed],
    noise: f64,
) -> Option<(usize, BadLog)> {
    typed.iter().find_map(|table| {
        let mistake = match runs::compare(&table.sheet)? {
            Found::Offset(line, text) => BadLog { line, text },
            Found::Typed(suspects) => {
                let left =
                    |suspect: &Suspect| corrected(config, model, readings, table, suspect, noise);
                let (best, text) = match &suspects[..] {
                    [first, second] => {
                        let [a, b] = [left(first), left(second)];
                        let best = if a <= b { first } else { second };
                        let is_clear = (a - b).abs() > most(1);
                        (best, if is_clear { &best.text } else { &best.undecided })
                    }
                    all => (all.first()?, &all.first()?.text),
                };
                BadLog { line: best.line, text: text.clone() }
            }
        };
        Some((table.file, mistake))
    })
}

/// Returns the sum of squares that the fit leaves of readings with a run corrected, each in the deviation that the
/// corrected runs show.
fn corrected(
    config: &Mechanism,
    model: &Model,
    readings: &[Reading],
    table: &Typed,
    suspect: &Suspect,
    noise: f64,
) -> f64 {
    let mut sheet = table.sheet.clone();
    for (row, value) in &suspect.meant {
        sheet.rows[*row].shown[suspect.run] = *value;
    }
    let weight = noise / sheet.gauge.length(config, sheet.deviation());
    let mut undone = readings.to_vec();
    for number in numbers(config, readings, table, noise) {
        let shown = sheet.rows[number.index].shown[number.run];
        let Some(new) = retyped(config, readings, table, &number, shown) else {
            return f64::INFINITY;
        };
        undone[number.reading] = new;
        undone[number.reading].instrument.weight = weight;
    }
    let all: Vec<&Reading> = undone.iter().collect();
    remaining(model, &all, noise).map_or(f64::INFINITY, |(sum, _)| sum)
}

/// Returns the sum of squares that the fit leaves, and the count of numbers.
fn remaining(model: &Model, readings: &[&Reading], noise: f64) -> Result<(f64, usize), Misfit> {
    let start = vec![0.0; model.parameters.len()];
    let changes = most_probable(model, readings, &start, noise)?;
    let (left, _) = residuals(model, readings, &changes)?;
    Ok((chi_square(model, &left, &changes, noise), left.len()))
}

/// Returns a reading with another typed value, if the machine can reach its pose.
fn retyped(
    config: &Mechanism,
    readings: &[Reading],
    table: &Typed,
    number: &Number,
    shown: f64,
) -> Option<Reading> {
    let (gauge, stop) = (&table.sheet.gauge, &number.row.stop);
    let new = gauge.reading(config, &table.sheet.objects[stop.object], stop.at, shown).ok()?;
    let old = &readings[number.reading];
    Some(Reading {
        name: old.name.clone(),
        group: old.group,
        frame: old.frame,
        instrument: old.instrument,
        ..new
    })
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
        let Some(new) = retyped(config, readings, table, number, *shown) else { return Ok(false) };
        undone[number.reading] = new;
        about.push(number.reading);
    }
    let rest: Vec<&Reading> =
        readings.iter().enumerate().filter(|(i, _)| !about.contains(i)).map(|(_, r)| r).collect();
    let (with, count) = remaining(model, &undone.iter().collect::<Vec<_>>(), noise)?;
    let (without, _) = remaining(model, &rest, noise)?;
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
    for (index, row) in table.sheet.rows.iter().enumerate() {
        for run in 0..row.shown.len() {
            let taken = &readings[table.first + count];
            let object = &table.sheet.objects[row.stop.object];
            let slope = table.sheet.gauge.slope(config, object, &taken.pose, &taken.tool)
                * taken.instrument.weight
                / noise;
            let (reading, place) = (table.first + count, rows_before + count);
            found.push(Number { row, index, run, reading, place, slope });
            count += 1;
        }
    }
    found.sort_by_key(|number| (number.run, number.place));
    found
}

/// Readings of one row that share a mistake: of one run, or of both.
type Cell<'a> = Vec<&'a Number<'a>>;

/// Returns the columns that a mistake may be in: of two runs the first, the second, or both.
fn columns<'a>(numbers: &'a [Number<'a>]) -> Vec<Vec<Cell<'a>>> {
    let of = |runs: std::ops::Range<usize>| {
        let mut cells: Vec<Cell> = vec![];
        for number in numbers.iter().filter(|number| runs.contains(&number.run)) {
            match cells.iter_mut().find(|cell| cell[0].index == number.index) {
                Some(cell) => cell.push(number),
                None => cells.push(vec![number]),
            }
        }
        cells.sort_by_key(|cell| cell[0].index);
        cells
    };
    match numbers.iter().any(|number| number.run > 0) {
        true => vec![of(0..1), of(1..2), of(0..2)],
        false => vec![of(0..1)],
    }
}

/// Returns the likely mistakes, the best first.
fn likely(sheet: &Sheet, linear: &Linear, numbers: &[Number]) -> Vec<Mistake> {
    let mut all: Vec<Mistake> = offset(sheet, linear, numbers).into_iter().collect();
    for column in columns(numbers) {
        all.extend(units(sheet, linear, &column));
        all.extend(orders(linear, &column));
    }
    all.sort_by(|a, b| a.chi_square.total_cmp(&b.chi_square));
    all.truncate(CLOSELY);
    all
}

/// Returns the offset of all readings that explains them best, if it is large.
fn offset(sheet: &Sheet, linear: &Linear, numbers: &[Number]) -> Option<Mistake> {
    let mut slopes = DVector::zeros(linear.y.len());
    for number in numbers {
        slopes[number.place] = number.slope;
    }
    let solved = linear.factor.solve(&slopes);
    let offset = -solved.dot(&linear.y) / solved.dot(&slopes);
    if !(offset.abs() > UNUSUAL * sheet.gauge.deviation) {
        return None;
    }
    let changed: Vec<(&Number, f64)> =
        numbers.iter().map(|number| (number, number.row.shown[number.run] + offset)).collect();
    let chi_square = explained(linear, &changed)?;
    // Tolerances and the pose of the object nearly absorb an offset of a dial: a large one explains little.
    if !(linear.chi_square(&linear.y) - chi_square > 2.0 * LIKELIER) {
        return None;
    }
    let own = sheet.gauge.scale;
    let text = format!(
        "all readings would fit if larger by {:.4} {own}: was the radius of a ball left out, or the gauge set to \
         another length? correct them, or state a larger \"zero\" in a new table",
        rounded(offset)
    );
    let meant = changed.iter().map(|(number, shown)| (number.place, *shown)).collect();
    Some(Mistake { chi_square, meant, line: numbers.first()?.row.line, text })
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

/// Returns mistakes of one row in another unit.
fn units(sheet: &Sheet, linear: &Linear, column: &[Cell]) -> Vec<Mistake> {
    let own = sheet.gauge.scale;
    let mut found = vec![];
    for cell in column {
        let row = cell[0].row;
        for scale in Scale::ALL.into_iter().filter(|scale| *scale != own) {
            let shown = |number: &Number| number.row.shown[number.run];
            let meant = |number: &Number| shown(number) * scale.in_mm() / own.in_mm();
            let changed: Vec<(&Number, f64)> =
                cell.iter().map(|number| (*number, meant(number))).collect();
            if let Some(chi_square) = explained(linear, &changed) {
                let list = |of: &dyn Fn(&Number) -> f64| {
                    let words: Vec<String> = cell.iter().map(|n| of(n).to_string()).collect();
                    words.join(" and ")
                };
                let text = format!(
                    "{} {own} of pose {} does not fit the other readings, but {} {scale} would: enter {} {own}",
                    list(&shown),
                    row.pose,
                    list(&shown),
                    list(&|number| rounded(meant(number)))
                );
                let meant = changed.iter().map(|(number, shown)| (number.place, *shown)).collect();
                found.push(Mistake { chi_square, meant, line: row.line, text });
            }
        }
    }
    found
}

/// Returns mistakes of the order.
fn orders(linear: &Linear, column: &[Cell]) -> Vec<Mistake> {
    let mut found = vec![];
    for first in 0..column.len() {
        for last in first + 1..column.len() {
            let block = &column[first..=last];
            let orders = Order::of(block.len()).iter();
            found.extend(orders.filter_map(|order| reordered(linear, block, *order)));
        }
    }
    found
}

/// Returns a mistake of the order, unless leaving out one row explains as much.
fn reordered(linear: &Linear, block: &[Cell], order: Order) -> Option<Mistake> {
    let mut meant: Vec<&Cell> = block.iter().collect();
    order.apply(&mut meant);
    let mut changed: Vec<(&Number, f64)> = vec![];
    for (cell, from) in block.iter().zip(meant) {
        for number in cell {
            let other = from.iter().find(|other| other.run == number.run)?;
            let shown = other.row.shown[other.run];
            if shown != number.row.shown[number.run] {
                changed.push((number, shown));
            }
        }
    }
    let chi_square = explained(linear, &changed)?;
    let limit = most(linear.y.len());
    let places = |cell: &Cell| cell.iter().map(|number| number.place).collect::<Vec<_>>();
    if block.iter().any(|cell| linear.without(&places(cell)) <= limit) {
        return None;
    }
    let (first, last) = (block.first()?[0].row.line, block.last()?[0].row.line);
    let meant = changed.iter().map(|(number, shown)| (number.place, *shown)).collect();
    Some(Mistake { chi_square, meant, line: first, text: order.text("", first, last) })
}
