// SPDX-License-Identifier: GPL-2.0-or-later
//! Frequencies at which responses are sampled.

/// Range of the samples around a resonance, in half widths.
const REACH: f64 = 20.0;

/// Returns angular frequencies from a fiftieth of the lowest resonance to `beyond` times the highest,
/// `even` of them evenly spaced, and `about` around each resonance, which is given by its angular frequency
/// and its width (rad/s). Sorted, without duplicates.
pub(super) fn frequencies(
    resonances: &[[f64; 2]],
    even: usize,
    about: usize,
    beyond: f64,
) -> Vec<f64> {
    let omegas = || resonances.iter().map(|[omega, _]| *omega);
    let lowest = 0.02 * omegas().fold(f64::INFINITY, f64::min);
    let highest = beyond * omegas().fold(0.0, f64::max);
    let step = (highest - lowest) / (even - 1) as f64;
    let mut all: Vec<f64> = (0..even).map(|k| lowest + step * k as f64).collect();
    let most = (10.0 * REACH).asinh();
    for [omega, width] in resonances {
        let place = |k: usize| most * (2.0 * k as f64 / (about - 1) as f64 - 1.0);
        all.extend((0..about).map(|k| omega + width * place(k).sinh() / 10.0));
    }
    all.retain(|omega| *omega > 0.0 && *omega <= highest);
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}
