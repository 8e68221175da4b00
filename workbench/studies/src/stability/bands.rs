// SPDX-License-Identifier: GPL-2.0-or-later
//! Unstable depths at a spindle speed. Instability can be an island between stable depths.

use crate::stability::floquet::Period;
use crate::stability::root;
use nalgebra::{Complex, ComplexField};

/// Depths sampled before any refinement.
const LOOKS: usize = 48;

/// A maximum of the largest multiplier above this, but below 1, is refined: an
/// island may lie between two sampled depths.
const NEARLY: f64 = 0.8;

/// Type of stability loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loss {
    /// A vibration that is no multiple of the tooth period (a pair of multipliers).
    Hopf,
    /// A vibration of two tooth periods (multiplier -1).
    Doubling,
    /// A growing deflection (multiplier 1).
    Fold,
}

/// A range of unstable depths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Lower end, mm.
    pub low: f64,
    /// Upper end, mm; at most the largest depth sampled.
    pub high: f64,
    /// Type of stability loss at the lower end.
    pub loss: Loss,
}

fn over(period: &Period, depth: f64) -> f64 {
    period.multiplier(depth).modulus() - 1.0
}

impl Loss {
    fn of(multiplier: Complex<f64>) -> Self {
        match multiplier {
            m if m.im.abs() > 1e-6 * m.modulus() => Self::Hopf,
            m if m.re < 0.0 => Self::Doubling,
            _ => Self::Fold,
        }
    }
}

/// Returns the unstable depths up to `most` (mm).
pub fn bands(period: &Period, most: f64) -> Vec<Band> {
    let mut found = vec![];
    let mut low: Option<f64> = None;
    for [from, to] in passages(period, most) {
        let Some(depth) = root::between(|depth| over(period, depth), from, to) else { continue };
        match low.take() {
            None => low = Some(depth),
            Some(low) => found.push(band(period, low, depth)),
        }
    }
    found.extend(low.map(|low| band(period, low, most)));
    found
}

/// Returns the least depth at which stability is lost, up to `most` (mm).
pub fn first_limit(period: &Period, most: f64) -> Option<f64> {
    let [from, to] = *passages(period, most).first()?;
    root::between(|depth| over(period, depth), from, to)
}

fn band(period: &Period, low: f64, high: f64) -> Band {
    Band { low, high, loss: Loss::of(period.multiplier(low)) }
}

/// Returns the pairs of depths between which stability changes, in order.
fn passages(period: &Period, most: f64) -> Vec<[f64; 2]> {
    let mut looks: Vec<[f64; 2]> = (0..=LOOKS)
        .map(|k| most * k as f64 / LOOKS as f64)
        .map(|depth| [depth, over(period, depth)])
        .collect();
    for k in 1..LOOKS {
        let [before, at, after] = [k - 1, k, k + 1].map(|k| looks[k][1]);
        // A narrow unstable island, or a narrow stable gap.
        let is_peak = at >= before && at >= after && at < 0.0 && at > NEARLY - 1.0;
        let is_gap = at <= before && at <= after && at > 0.0 && at < 1.0 / NEARLY - 1.0;
        if is_peak || is_gap {
            let sign = if is_peak { -1.0 } else { 1.0 };
            let [low, high] = [k - 1, k + 1].map(|k| looks[k][0]);
            let width = 1e-3 * (high - low);
            let depth = root::least(|depth| sign * over(period, depth), low, high, width);
            looks.push([depth, over(period, depth)]);
        }
    }
    looks.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let changes = looks.windows(2).filter(|pair| (pair[0][1] < 0.0) != (pair[1][1] < 0.0));
    changes.map(|pair| [pair[0][0], pair[1][0]]).collect()
}
