// SPDX-License-Identifier: GPL-2.0-or-later
//! Frequency responses of the loop, and its stability margins.

use crate::stability::lag::{Crossing, Lag};
use nalgebra::{Complex, ComplexField};
use std::f64::consts::PI;

/// The loop's response at an angular frequency, mm/N.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Angular frequency, rad/s.
    pub omega: f64,
    /// Displacement of the tool relative to the work while cutting, `W = G/(1 + K G/(1 + iωT))`.
    pub cutting: Complex<f64>,
    /// The displacement without cutting, G.
    pub free: Complex<f64>,
    /// Each link's own displacement under a force on it alone.
    pub terms: Vec<Complex<f64>>,
    /// The open loop, `K G/(1 + iωT)`.
    pub open: Complex<f64>,
}

/// Distance of a loop from its limit of stability, at a cutting stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Limit cutting stiffness over the given one; infinite without a limit.
    pub gain: f64,
    /// Further angle by which the open loop `K G/(1 + iωT)` may lag where its modulus is 1, rad; `None`
    /// if it never is 1.
    pub phase: Option<f64>,
    /// Least distance of the open loop from -1.
    pub distance: f64,
    /// Index of oscillation: the largest amplitude of the closed loop over the amplitude at rest; `None` if the
    /// measured frequencies begin too high to be at rest, or end below the largest amplitude.
    pub index: Option<f64>,
    /// Angular frequency of the largest amplitude, rad/s.
    pub peak: f64,
    /// Angular frequency above which the amplitude stays below 1/√2 of the amplitude at rest, rad/s; `None` if the measured
    /// frequencies do not contain it.
    pub bandwidth: Option<f64>,
    /// Decay rate of the slowest root, 1/s; negative if it grows; `None` for measured responses.
    pub decay: Option<f64>,
}

/// A disturbance has settled when a share of e⁻³ is left.
const SETTLED: f64 = 3.0;

impl Margins {
    /// Returns the time after which e⁻³ of a disturbance is left, s; `None` if it grows, or for measured responses.
    pub fn settling(&self) -> Option<f64> {
        self.decay.filter(|decay| *decay > 0.0).map(|decay| SETTLED / decay)
    }
}

/// Share of the slowest resonance up to which the lowest measured frequency counts as rest: an undamped oscillator is
/// there 1/(1 - 0.25²) = 1.07 times as compliant as at rest.
const AT_REST: f64 = 0.25;

/// Sample frequencies of a response.
const COUNT: usize = 8000;

impl Lag {
    /// Returns the response at a cutting stiffness (N/mm) and an angular frequency.
    pub fn response(&self, stiffness: f64, omega: f64) -> Response {
        let free = self.receptance(omega);
        let open = self.open(stiffness, omega);
        Response {
            omega,
            cutting: free / (1.0 + open),
            free,
            terms: self.parts(omega).collect(),
            open,
        }
    }

    /// Returns the response of the whole loop to a force on one term alone, as in equation 1 of paper 002:
    /// W times that term's share of G.
    pub fn response_to(&self, term: usize, stiffness: f64, omega: f64) -> Complex<f64> {
        self.terms[term].at(omega) / (1.0 + self.open(stiffness, omega))
    }

    fn open(&self, stiffness: f64, omega: f64) -> Complex<f64> {
        self.receptance(omega) * stiffness / self.delay(omega)
    }

    /// Returns the responses at frequencies from 0 (or the lowest measured) up, dense around each term's.
    pub fn responses(&self, stiffness: f64) -> Vec<Response> {
        let rest = self.measured.is_empty().then_some(0.0);
        rest.into_iter()
            .chain(self.grid(COUNT))
            .map(|omega| self.response(stiffness, omega))
            .collect()
    }

    /// Returns the margins at a cutting stiffness above 0, with this limit.
    pub fn margins(&self, stiffness: f64, limit: Option<Crossing>) -> Margins {
        let limit = limit.map_or(f64::INFINITY, |limit| limit.stiffness);
        let grid = self.grid(COUNT);
        let amount = |omega: f64| self.response(stiffness, omega).cutting.modulus();
        let rest = amount(0.0);
        let peak = grid.iter().copied().max_by(|a, b| amount(*a).total_cmp(&amount(*b)));
        let peak = peak.unwrap_or_default();
        let open = |omega: f64| self.open(stiffness, omega);
        let distances = grid.iter().map(|omega| (1.0 + open(*omega)).modulus());
        let passes = |level: f64, of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let rest = |omega: f64| of(omega) - level;
            let pairs = grid.windows(2);
            pairs.filter_map(|pair| super::root::between(rest, pair[0], pair[1])).collect()
        };
        let to_turn = |omega: f64| (open(omega).argument() + PI).rem_euclid(2.0 * PI);
        let phases = passes(1.0, &|omega| open(omega).modulus()).into_iter().map(to_turn);
        let roots = || self.roots(Complex::new(stiffness, 0.0)).into_iter().map(|root| root.re);
        let decay = || -roots().fold(f64::NEG_INFINITY, f64::max);
        let cut = rest / 2.0_f64.sqrt();
        let last = passes(cut, &amount).last().copied();
        let [low, high] = self.range();
        let is_at_rest = low <= AT_REST * self.slowest();
        let is_below = high.is_infinite() || amount(high) < cut;
        Margins {
            gain: limit / stiffness,
            phase: phases.min_by(f64::total_cmp),
            distance: distances.fold(f64::INFINITY, f64::min),
            index: (is_at_rest && peak < high).then(|| amount(peak).max(rest) / rest),
            peak,
            bandwidth: last.filter(|_| is_at_rest && is_below),
            decay: self.measured.is_empty().then(decay),
        }
    }
}

/// Removes jumps by whole turns from angles.
pub fn unwrapped(angles: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut before: Option<f64> = None;
    let mut next = |angle: f64| {
        let turns = before.map_or(0.0, |before| ((before - angle) / (2.0 * PI)).round());
        before = Some(angle + turns * 2.0 * PI);
        angle + turns * 2.0 * PI
    };
    angles.into_iter().map(&mut next).collect()
}
