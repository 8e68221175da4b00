// SPDX-License-Identifier: GPL-2.0-or-later
//! Mistakes that the second run of a table shows: both runs read the same poses, so the readings of a row differ
//! only by the gauge's scatter and its drift.
//!
//! The search runs if the differences scatter more than the stated deviation explains, or if their mean is far from 0. A
//! correction of one run is accepted if the rows that it changes differ as all others do afterwards, but not before.
//! Center and scatter are medians, so one mistake is found beside others.

use super::fit::MEDIAN_TO_DEVIATION;
use super::gauge::{Kind, Scale};
use super::sheet::{FEWEST, Sheet, UNUSUAL, rounded};

/// Largest distance of a corrected row from the center, in deviations. One of 500 good rows exceeds it by chance in 3 %
/// of all tables.
const ORDINARY: f64 = 4.0;

/// Distance above which a row is mistyped, in deviations. One of 500 good rows exceeds it in one of a million tables.
const ODD: f64 = 6.0;

/// Deviations above which a row counts no more, so that a row that is far off does not hide the others.
const MOST_COUNTED: f64 = 10.0;

/// Factor by which a correction of most rows must reduce the scatter. A search in good readings finds an order that
/// halves it.
const CLEARLY: f64 = 4.0;

/// Logarithm of the likelihood ratio above which a correction is accepted: the search tries thousands.
pub(crate) const LIKELIER: f64 = 12.0;

/// Largest share of mistyped rows; with more, the gauge scatters.
const MOST_MISTYPED: f64 = 0.1;

/// A changed order of readings in consecutive rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// The first and the last exchanged.
    Exchanged,
    /// The first of some rows typed last.
    Up,
    /// The last of some rows typed first.
    Down,
}

impl Order {
    /// Returns the orders of this number of rows: of two rows, all are the exchange.
    pub(crate) fn of(rows: usize) -> &'static [Self] {
        if rows > 2 { &[Self::Exchanged, Self::Up, Self::Down] } else { &[Self::Exchanged] }
    }

    pub(crate) fn apply<T>(self, rows: &mut [T]) {
        match self {
            Self::Exchanged => rows.swap(0, rows.len() - 1),
            Self::Up => rows.rotate_left(1),
            Self::Down => rows.rotate_right(1),
        }
    }

    /// Returns the order that undoes this one.
    fn inverse(self) -> Self {
        match self {
            Self::Exchanged => Self::Exchanged,
            Self::Up => Self::Down,
            Self::Down => Self::Up,
        }
    }

    /// Describes the mistake in some columns of the lines `first` to `last`.
    pub(crate) fn text(self, columns: &str, first: usize, last: usize) -> String {
        match self {
            Self::Exchanged => format!(
                "the readings of lines {first} and {last}{columns} would fit if exchanged: check their order"
            ),
            Self::Up | Self::Down => format!(
                "the readings of lines {first} to {last}{columns} would fit if moved by a row: check for a row too \
                 high or too low"
            ),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    /// Readings in this unit.
    Unit(Scale),
    /// Readings in another order, from the first to the last of these pairs.
    Order(Order, usize, usize),
    /// One reading that contradicts the other of its row.
    Alone,
}

/// A mistake, its run, and the readings meant by pair.
type Correction = (Mistake, usize, Vec<(usize, f64)>);

/// A mistake in one run, and its correction.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Suspect {
    pub(crate) run: usize,
    /// Indices of rows, with the readings meant.
    pub(crate) meant: Vec<(usize, f64)>,
    pub(crate) line: usize,
    /// Description of the mistake in this run.
    pub(crate) text: String,
    /// Description if the other readings do not show which run it is in.
    pub(crate) undecided: String,
}

/// Result of comparing both runs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Found {
    /// A typing mistake: in one of two runs, if both would explain the differences.
    Typed(Vec<Suspect>),
    /// A run with an offset, with a line and a description.
    Offset(usize, String),
}

/// Rows read twice.
struct Pairs<'a> {
    sheet: &'a Sheet,
    /// Indices of the rows.
    rows: Vec<usize>,
    /// The readings of each run.
    shown: [Vec<f64>; 2],
    /// Least deviation of a difference, from the stated one.
    least: f64,
}

/// Center and deviation of differences.
#[derive(Clone, Copy)]
struct Spread {
    middle: f64,
    deviation: f64,
    /// Center above which it is no drift.
    far: f64,
}

impl Spread {
    /// Returns the distance from the center in deviations.
    fn away(&self, difference: f64) -> f64 {
        ((difference - self.middle) / self.deviation).abs()
    }

    /// Returns the negative logarithm of the likelihood, except for a constant.
    fn cost(&self, differences: &[f64]) -> f64 {
        let square = |x: &f64| 0.5 * self.away(*x).min(MOST_COUNTED).powi(2);
        let drift = 0.5 * (self.middle / self.far).abs().min(MOST_COUNTED).powi(2);
        let scatter = differences.iter().map(square).sum::<f64>();
        differences.len() as f64 * self.deviation.ln() + scatter + drift
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Compares both runs of a table.
pub(crate) fn compare(sheet: &Sheet) -> Option<Found> {
    let scatter = sheet.scatter().filter(|scatter| scatter.rows >= FEWEST)?;
    let pairs = Pairs::new(sheet);
    let is_offset = scatter.drift.abs() > UNUSUAL * sheet.deviation();
    let corrected = (scatter.is_more || is_offset).then(|| pairs.corrected()).flatten();
    let moved = || scatter.is_more.then(|| pairs.moved()).flatten();
    let mistyped = || scatter.is_more.then(|| pairs.mistyped()).flatten();
    corrected
        .map(Found::Typed)
        .or_else(moved)
        .or_else(|| mistyped().map(Found::Typed))
        .or_else(|| is_offset.then(|| pairs.offset(0, scatter.drift)))
}

impl<'a> Pairs<'a> {
    fn new(sheet: &'a Sheet) -> Self {
        let pairs = sheet.rows.iter().enumerate().filter_map(|(k, row)| match row.shown[..] {
            [first, second] => Some((k, [first, second])),
            _ => None,
        });
        let (rows, shown): (Vec<usize>, Vec<[f64; 2]>) = pairs.unzip();
        let shown = [0, 1].map(|run| shown.iter().map(|pair| pair[run]).collect());
        // The variance of a difference of two readings is twice that of one.
        let least = 2.0_f64.sqrt() * sheet.gauge.deviation;
        Self { sheet, rows, shown, least }
    }

    fn differences(&self) -> Vec<f64> {
        self.shown[1].iter().zip(&self.shown[0]).map(|(second, first)| second - first).collect()
    }

    fn spread(&self, differences: &[f64]) -> Spread {
        let middle = median(differences.to_vec());
        let away = differences.iter().map(|x| (x - middle).abs()).collect();
        let deviation = (median(away) * MEDIAN_TO_DEVIATION).max(self.least);
        Spread { middle, deviation, far: UNUSUAL * self.sheet.gauge.deviation }
    }

    fn line(&self, pair: usize) -> usize {
        self.sheet.rows[self.rows[pair]].line
    }

    /// Returns the best correction that explains the differences, in the run that it is in or may be in.
    fn corrected(&self) -> Option<Vec<Suspect>> {
        let differences = self.differences();
        let before = self.spread(&differences);
        let cost = before.cost(&differences);
        let units = [0, 1].into_iter().flat_map(|run| self.units(run, &differences));
        // An order in the first run is equivalent to the inverse one in the second.
        let orders = self.orders(&before, &differences);
        let judged = units.chain(orders).filter_map(|(mistake, run, meant)| {
            let mut after = differences.clone();
            for (pair, value) in &meant {
                after[*pair] = if run == 1 {
                    value - self.shown[0][*pair]
                } else {
                    self.shown[1][*pair] - value
                };
            }
            let spread = self.spread(&after);
            let is_odd = meant.iter().any(|(pair, _)| before.away(differences[*pair]) > ODD);
            let is_drift = before.middle.abs() > before.far && spread.middle.abs() < spread.far;
            let is_clear = CLEARLY * spread.deviation < before.deviation;
            let is_good = (is_odd || is_clear || is_drift)
                && meant.iter().all(|(pair, _)| spread.away(after[*pair]) < ORDINARY);
            let less = cost - spread.cost(&after);
            (is_good && less > LIKELIER).then_some((less, mistake, run, meant))
        });
        let (_, mistake, run, meant) = judged.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut suspects = vec![self.suspect(mistake, run, meant)?];
        if let Mistake::Order(order, first, last) = mistake {
            let order = order.inverse();
            let meant = self.reordered(order, 1 - run, first, last);
            suspects.extend(self.suspect(Mistake::Order(order, first, last), 1 - run, meant));
        }
        Some(suspects)
    }

    /// Returns corrections of the unit in one run: of the rows that come nearer to the other run.
    fn units(&self, run: usize, differences: &[f64]) -> impl Iterator<Item = Correction> {
        let own = self.sheet.gauge.scale;
        Scale::ALL.into_iter().filter(move |scale| *scale != own).map(move |scale| {
            let meant = (0..self.rows.len()).filter_map(|pair| {
                let value = self.shown[run][pair] * scale.in_mm() / own.in_mm();
                let away = (value - self.shown[1 - run][pair]).abs();
                (2.0 * away < differences[pair].abs()).then_some((pair, value))
            });
            (Mistake::Unit(scale), run, meant.collect())
        })
    }

    /// Returns changed orders in the second run that bring it nearer to the first.
    fn orders(&self, before: &Spread, differences: &[f64]) -> Vec<Correction> {
        let away = |x: f64| (x - before.middle).abs();
        let mut found = vec![];
        for first in 0..self.rows.len() {
            for last in first + 1..self.rows.len() {
                for order in Order::of(last + 1 - first) {
                    let meant = self.reordered(*order, 1, first, last);
                    let old: f64 = meant.iter().map(|(pair, _)| away(differences[*pair])).sum();
                    let new: f64 =
                        meant.iter().map(|(pair, x)| away(x - self.shown[0][*pair])).sum();
                    if 2.0 * new < old {
                        found.push((Mistake::Order(*order, first, last), 1, meant));
                    }
                }
            }
        }
        found
    }

    /// Returns the readings that an order changes.
    fn reordered(&self, order: Order, run: usize, first: usize, last: usize) -> Vec<(usize, f64)> {
        let mut values = self.shown[run][first..=last].to_vec();
        order.apply(&mut values);
        let changed = (first..).zip(values).filter(|(pair, new)| self.shown[run][*pair] != *new);
        changed.collect()
    }

    /// Returns the row whose readings contradict each other the most, unless many do.
    fn mistyped(&self) -> Option<Vec<Suspect>> {
        let differences = self.differences();
        let spread = self.spread(&differences);
        let away = |pair: &usize| spread.away(differences[*pair]);
        let odd: Vec<usize> = (0..self.rows.len()).filter(|pair| away(pair) > ODD).collect();
        let worst = odd.iter().copied().max_by(|a, b| away(a).total_cmp(&away(b)))?;
        let is_few = odd.len() <= 1 || odd.len() as f64 <= MOST_MISTYPED * self.rows.len() as f64;
        let suspect = |run: usize| {
            self.suspect(Mistake::Alone, run, vec![(worst, self.shown[1 - run][worst])])
        };
        is_few.then(|| [suspect(0), suspect(1)].into_iter().flatten().collect())
    }

    /// Describes a mistake in one run; `None` if it changes no reading.
    fn suspect(&self, mistake: Mistake, run: usize, meant: Vec<(usize, f64)>) -> Option<Suspect> {
        let column = ["reading", "again"][run];
        let own = self.sheet.gauge.scale;
        let (pair, value) = *meant.first()?;
        let row = &self.sheet.rows[self.rows[pair]];
        let line = row.line;
        let (text, undecided) = match mistake {
            Mistake::Unit(scale) if meant.len() == 1 => {
                let text = format!(
                    "{} {own} of pose {} in column {column} does not fit the other run, but {} {scale} would: enter \
                     {} {own}",
                    self.shown[run][pair],
                    row.pose,
                    self.shown[run][pair],
                    rounded(value)
                );
                (text.clone(), text)
            }
            Mistake::Unit(scale) => {
                let text = format!(
                    "{} of {} readings in column {column} fit the other run if they are in {scale}: convert them to \
                     {own}",
                    meant.len(),
                    self.rows.len()
                );
                (text.clone(), text)
            }
            Mistake::Order(order, first, last) => {
                let (first, last) = (self.line(first), self.line(last));
                let text = |columns: &str| order.text(columns, first, last);
                (text(&format!(" in column {column}")), text(" in one of both columns"))
            }
            Mistake::Alone => {
                let [first, second] = [0, 1].map(|run| self.shown[run][pair]);
                let text = |which: &str| {
                    format!(
                        "the readings of pose {}, {first} and {second} {own}, differ unlike those of all other poses: \
                         {which}; correct it, or enter \"-\"",
                        row.pose
                    )
                };
                let wrong = self.shown[run][pair];
                (
                    text(&format!("{wrong} in column {column} is wrong")),
                    text("one of them is wrong"),
                )
            }
        };
        let meant = meant.into_iter().map(|(pair, value)| (self.rows[pair], value)).collect();
        Some(Suspect { run, meant, line, text, undecided })
    }

    /// Returns a large step of the differences between two rows.
    fn moved(&self) -> Option<Found> {
        let differences = self.differences();
        let cost = self.spread(&differences).cost(&differences);
        let far = UNUSUAL * self.sheet.gauge.deviation;
        let step = |pair: usize| {
            let (start, end) = differences.split_at(pair);
            let [step, start] = [median(end.to_vec()), median(start.to_vec())];
            let step = step - start;
            let after: Vec<f64> = differences
                .iter()
                .enumerate()
                .map(|(k, x)| if k < pair { *x } else { x - step })
                .collect();
            let spread = self.spread(&after);
            let is_good = step.abs() > far && after.iter().all(|x| spread.away(*x) < ORDINARY);
            let less = cost - spread.cost(&after);
            (is_good && less > LIKELIER).then_some((less, pair, step))
        };
        // A part of two rows has a median that none of them exceeds.
        let steps = (2..self.rows.len().saturating_sub(1)).filter_map(step);
        let (_, pair, step) = steps.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(self.offset(pair, step))
    }

    /// Describes an offset of the second run from a pair on.
    fn offset(&self, pair: usize, offset: f64) -> Found {
        let gauge = &self.sheet.gauge;
        let rows = match pair {
            0 => "in all rows".to_string(),
            _ => format!("from line {} on", self.line(pair)),
        };
        let what = match gauge.kind {
            Kind::Bar => {
                "the radius of a ball was left out in one run, or the bar's length has changed"
            }
            Kind::Dial | Kind::Feeler => {
                "the gauge was set anew, its end's radius was left out, or something has moved"
            }
        };
        let text = format!(
            "{rows} the second run is {:+.4} {} from the first: {what}; correct one run, or read both again",
            rounded(offset),
            gauge.scale
        );
        Found::Offset(self.line(pair), text)
    }
}
