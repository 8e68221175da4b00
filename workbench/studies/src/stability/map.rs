// SPDX-License-Identifier: GPL-2.0-or-later
//! Stable depths over spindle speeds, sampled more densely where they change.

use crate::stability::bands::{Band, bands};
use crate::stability::floquet::Period;
use crate::stability::process::{Process, Row};
use rayon::prelude::*;

/// Halvings of the initial distance between speeds.
const ROUNDS: usize = 4;

/// No speed is inserted between two neighbors if no border moves by more than this share of the
/// largest depth.
const STEP: f64 = 0.03;

/// Unstable depths at a spindle speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    pub rpm: f64,
    pub bands: Vec<Band>,
}

impl Column {
    /// Returns the depth below which all depths are stable; `most` if no depth up to `most` is unstable.
    pub fn stable_to(&self, most: f64) -> f64 {
        self.bands.first().map_or(most, |band| band.low)
    }
}

/// Stable and unstable depths over spindle speeds.
#[derive(Clone, Debug, PartialEq)]
pub struct StableMap {
    /// The largest depth sampled, mm.
    pub most: f64,
    /// Columns by rising speed.
    pub columns: Vec<Column>,
}

impl StableMap {
    /// Computes the map between two speeds (1/min), from `first` speeds; `progress` receives the share done.
    pub fn new(
        rows: &[Row],
        process: &Process,
        [low, high]: [f64; 2],
        most: f64,
        first: usize,
        progress: impl Fn(f64) + Sync,
    ) -> Self {
        let column =
            |rpm: f64| Column { rpm, bands: bands(&Period::new(rows, process, rpm), most) };
        let step = (high - low) / (first - 1) as f64;
        let speeds: Vec<f64> = (0..first).map(|k| low + step * k as f64).collect();
        let mut columns: Vec<Column> = speeds.into_par_iter().map(column).collect();
        for round in 0..ROUNDS {
            progress((round + 1) as f64 / (ROUNDS + 1) as f64);
            let width = step / f64::from(1 << round);
            let needed = columns.windows(2).filter(|pair| {
                // Only between speeds of the last round: a wider gap was even before.
                let is_narrow = pair[1].rpm - pair[0].rpm < 1.5 * width;
                is_narrow && !is_even(&pair[0], &pair[1], most)
            });
            let between: Vec<f64> = needed.map(|pair| (pair[0].rpm + pair[1].rpm) / 2.0).collect();
            columns.extend(between.into_par_iter().map(column).collect::<Vec<_>>());
            columns.sort_by(|a, b| a.rpm.total_cmp(&b.rpm));
        }
        Self { most, columns }
    }

    /// Returns the ranges of sampled speeds (1/min) at which no depth up to the largest one is unstable.
    pub fn without_unstable(&self) -> Vec<[f64; 2]> {
        let runs = self.columns.chunk_by(|a, b| a.bands.is_empty() == b.bands.is_empty());
        let runs = runs.filter(|run| run[0].bands.is_empty());
        runs.map(|run| [run[0].rpm, run[run.len() - 1].rpm]).collect()
    }

    /// Returns the column whose stable range from 0 is largest.
    pub fn best(&self) -> &Column {
        self.by_depth(true)
    }

    /// Returns the column whose stable range from 0 is smallest.
    pub fn worst(&self) -> &Column {
        self.by_depth(false)
    }

    fn by_depth(&self, is_best: bool) -> &Column {
        let key = |column: &&Column| column.stable_to(self.most);
        let all = self.columns.iter();
        let found = match is_best {
            true => all.max_by(|a, b| key(a).total_cmp(&key(b))),
            false => all.min_by(|a, b| key(a).total_cmp(&key(b))),
        };
        found.expect("a map has columns")
    }
}

/// Returns whether two columns have as many bands, with borders near each other.
fn is_even(a: &Column, b: &Column, most: f64) -> bool {
    let near = |x: f64, y: f64| (x - y).abs() <= STEP * most;
    let pairs = a.bands.iter().zip(&b.bands);
    a.bands.len() == b.bands.len()
        && pairs.into_iter().all(|(a, b)| near(a.low, b.low) && near(a.high, b.high))
}
