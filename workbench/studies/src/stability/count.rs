// SPDX-License-Identifier: GPL-2.0-or-later
//! Counts of unstable roots of one loop at many cutting stiffnesses: crossings and samples are computed once.

use crate::stability::lag::{Crossing, GRID, Lag, Limit};
use nalgebra::Complex;

/// Relative distance from a crossing at which roots are counted.
const BESIDE: f64 = 1e-6;

/// Counts the roots with a positive real part: by eigenvalues, and with measured responses by Nyquist's criterion, as all
/// of them are stable without cutting.
#[derive(Clone, Debug)]
pub struct Counter<'a> {
    lag: &'a Lag,
    crossings: Vec<Crossing>,
    /// Frequency in rad/s and receptance in mm/N, rising; empty without measured responses.
    samples: Vec<(f64, Complex<f64>)>,
}

impl Lag {
    /// Prepares counts of unstable roots.
    pub fn counter(&self) -> Counter<'_> {
        let crossings = self.crossings();
        let mut samples = vec![];
        if !self.measured.is_empty() {
            let mut omegas = self.grid(GRID);
            // A real K next to a crossing passes 0 nearer than the samples are to each other.
            omegas.extend(crossings.iter().map(|found| found.omega));
            omegas.sort_by(f64::total_cmp);
            samples = omegas.into_iter().map(|omega| (omega, self.receptance(omega))).collect();
        }
        Counter { lag: self, crossings, samples }
    }

    /// Returns the limit cutting stiffness: K = 0 is stable, so it is the smallest positive crossing.
    pub fn limit(&self) -> Limit {
        self.counter().limit()
    }

    /// Counts the roots with a positive real part at one cutting stiffness; see [`Counter`].
    pub fn unstable(&self, stiffness: Complex<f64>) -> usize {
        match self.measured.is_empty() {
            true => self.unstable_roots(stiffness),
            false => self.counter().unstable(stiffness),
        }
    }

    /// Counts eigenvalues with a positive real part. NaN counts as unstable.
    fn unstable_roots(&self, stiffness: Complex<f64>) -> usize {
        self.roots(stiffness).iter().filter(|root| !(root.re <= 0.0)).count()
    }
}

impl Counter<'_> {
    /// Returns all crossings, sorted by stiffness.
    pub fn crossings(&self) -> &[Crossing] {
        &self.crossings
    }

    /// Counts the unstable roots at a cutting stiffness, N/mm.
    pub fn unstable(&self, stiffness: Complex<f64>) -> usize {
        match self.samples.is_empty() {
            true => self.lag.unstable_roots(stiffness),
            false => self.turns(self.lag, stiffness),
        }
    }

    /// Counts the unstable roots of the same loop with another lag in s.
    pub fn unstable_with(&self, lag: f64, stiffness: Complex<f64>) -> usize {
        match self.samples.is_empty() {
            true => self.lag.with_lag(lag).unstable_roots(stiffness),
            false => self.turns(&Lag { lag, ..Lag::default() }, stiffness),
        }
    }

    /// Counts the unstable roots just below and just above a crossing.
    pub fn beside(&self, found: &Crossing) -> [usize; 2] {
        [1.0 - BESIDE, 1.0 + BESIDE]
            .map(|share| self.unstable(Complex::new(found.stiffness * share, 0.0)))
    }

    /// Returns the limit cutting stiffness: K = 0 is stable, so it is the smallest positive crossing.
    pub fn limit(&self) -> Limit {
        let positive: Vec<Crossing> =
            self.crossings.iter().copied().filter(|found| found.stiffness > 0.0).collect();
        Limit { crossing: positive.first().copied(), is_certified: self.agrees(&positive) }
    }

    /// Returns whether the numbers of unstable roots agree with these being all positive crossings: equal
    /// just above a crossing and just below the next, 0 at K = 0, and equal above the last and far beyond it.
    fn agrees(&self, positive: &[Crossing]) -> bool {
        if !self.lag.measured.is_empty() {
            let Some(limit) = positive.first() else { return false };
            if !self.lag.is_closed(limit.stiffness) {
                return false;
            }
        }
        let at = |stiffness: f64| self.unstable(Complex::new(stiffness, 0.0));
        let mut count = 0;
        let mut agrees = at(0.0) == count;
        for (k, Crossing { stiffness, .. }) in positive.iter().enumerate() {
            // Noise has crossings nearer to each other than the distance at which roots are counted.
            let to = |other: &Crossing| f64::midpoint(*stiffness, other.stiffness);
            let before = k.checked_sub(1).map_or(0.0, |k| to(&positive[k]));
            let next = positive.get(k + 1).map_or(f64::INFINITY, to);
            agrees &= at((stiffness * (1.0 - BESIDE)).max(before)) == count;
            count = at((stiffness * (1.0 + BESIDE)).min(next));
        }
        let last = positive.last().map_or(self.lag.at_rest().abs(), |last| last.stiffness);
        agrees && at(last * 1e3) == count
    }

    /// Returns the turns about 0 of `1 + K G/(1 + iωT)` over negative and positive frequencies: the net number of times
    /// that the polygon of its samples passes the positive real axis.
    fn turns(&self, delay: &Lag, stiffness: Complex<f64>) -> usize {
        let open = |(omega, response): &(f64, Complex<f64>)| response / delay.delay(*omega);
        let positive = self.samples.iter().map(open);
        let negative = self.samples.iter().rev().map(|sample| open(sample).conj());
        // Beyond the highest frequency the open loop shrinks to 0.
        let beyond = Complex::new(1.0, 0.0);
        let mut before = beyond;
        let mut turns = 0_i64;
        let curve = negative.chain(positive).map(|open| 1.0 + open * stiffness);
        for next in curve.chain([beyond]) {
            let (from, to) = (before.im >= 0.0, next.im >= 0.0);
            if from != to {
                // On which side of 0 the segment passes the real axis.
                let side = before.re * next.im - before.im * next.re;
                turns += i64::from(to && side > 0.0) - i64::from(from && side < 0.0);
            }
            before = next;
        }
        turns.unsigned_abs() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::lag::Term;

    #[test]
    fn a_crossing_that_is_left_out_is_noticed() {
        // The links of tests/cases/two-links.toml with a lag of 30 ms: three crossings.
        let terms = vec![Term::link(2.27, 13.96, 38_900.0), Term::link(8.65, 38.51, 93_000.0)];
        let lag = Lag { terms, lag: 0.03, ..Lag::default() };
        let counter = lag.counter();
        let all = counter.crossings();
        assert!(all.len() == 3 && counter.agrees(all));
        for left in 0..3 {
            let mut some = all.to_vec();
            some.remove(left);
            assert!(!counter.agrees(&some), "{left}");
        }
    }
}
