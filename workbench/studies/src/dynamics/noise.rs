// SPDX-License-Identifier: GPL-2.0-or-later
//! A random force of a stated spectrum: white noise through a filter, sampled exactly.

use crate::study::forcing::Band;
use kinematics::Vector3;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// A spectrum of variance 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spectrum {
    /// Ornstein-Uhlenbeck: flat up to a corner, decreasing with the square of the frequency above it:
    /// 4 a/(a² + (2πf)²) with a = 2π corner.
    Corner {
        /// Hz.
        corner: f64,
    },
    /// x'' + (ω₀/Q) x' + ω₀² x = white noise: a band around a frequency, of width middle/Q.
    Band {
        /// Hz.
        middle: f64,
        /// Q.
        quality: f64,
    },
}

impl From<Band> for Spectrum {
    fn from(band: Band) -> Self {
        match band {
            Band::Corner(corner) => Self::Corner { corner },
            Band::About { hz, quality } => Self::Band { middle: hz, quality },
        }
    }
}

impl Spectrum {
    /// Returns the filter x' = A x + white noise whose first state has the spectrum; the covariance of its states is
    /// 1, that of the white noise -(A + Aᵀ).
    pub fn filter(&self) -> DMatrix<f64> {
        match *self {
            Self::Corner { corner } => DMatrix::from_element(1, 1, -TAU * corner),
            Self::Band { middle, quality } => {
                // The second state is the rate over ω₀.
                let omega = TAU * middle;
                DMatrix::from_row_slice(2, 2, &[0.0, omega, -omega, -omega / quality])
            }
        }
    }

    /// Computes the one-sided density at a frequency in Hz, 1/Hz.
    pub fn density(&self, hz: f64) -> f64 {
        let omega = TAU * hz;
        match *self {
            Self::Corner { corner } => {
                let a = TAU * corner;
                4.0 * a / (a * a + omega * omega)
            }
            Self::Band { middle, quality } => {
                let own = TAU * middle;
                let width = own / quality;
                let off = own * own - omega * omega;
                4.0 * width * own * own / (off * off + (width * omega).powi(2))
            }
        }
    }

    /// Returns the highest relevant frequency, Hz.
    pub fn reach(&self) -> f64 {
        match *self {
            Self::Corner { corner } => corner,
            Self::Band { middle, quality } => middle * (1.0 + 0.5 / quality),
        }
    }
}

/// Terms of the series: 2^-20/20! is far below rounding.
const TERMS: u32 = 20;

/// Computes the exponential of a square matrix: the series of a scaled matrix, squared repeatedly.
pub(crate) fn exponential(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let size = matrix.amax() * matrix.nrows() as f64;
    let halvings = (2.0 * size).max(1.0).log2().ceil() as i32;
    let part = matrix * 2.0_f64.powi(-halvings);
    let unit = DMatrix::identity(matrix.nrows(), matrix.ncols());
    // From the last term inwards.
    let series = (1..=TERMS).rev().fold(unit.clone(), |sum, k| &unit + &part * sum / f64::from(k));
    (0..halvings).fold(series, |power, _| &power * &power)
}

/// Computes the transition matrix of a filter over a step, and the covariance added by the step (Van Loan 1978),
/// without cancellation for short steps.
fn sampled(a: &DMatrix<f64>, step: f64) -> [DMatrix<f64>; 2] {
    let n = a.nrows();
    let mut block = DMatrix::zeros(2 * n, 2 * n);
    block.view_mut((0, 0), (n, n)).copy_from(&-a);
    block.view_mut((0, n), (n, n)).copy_from(&-(a + a.transpose()));
    block.view_mut((n, n), (n, n)).copy_from(&a.transpose());
    let power = exponential(&(block * step));
    let decay = power.view((n, n), (n, n)).transpose();
    let added = &decay * power.view((0, n), (n, n));
    [decay, (&added + added.transpose()) / 2.0]
}

/// A random force in machine axes.
#[derive(Clone, Debug)]
pub struct Noise {
    sigma: Vector3<f64>,
    decay: DMatrix<f64>,
    gain: DMatrix<f64>,
    /// One column for each axis.
    states: DMatrix<f64>,
    random: Pcg64,
}

impl Noise {
    /// Creates a force with standard deviations along X Y Z in N, sampled every `step` seconds. Equal seeds give
    /// equal forces.
    pub fn new(sigma: Vector3<f64>, spectrum: &Spectrum, step: f64, seed: u64) -> Self {
        let [decay, added] = sampled(&spectrum.filter(), step);
        let mut noise = Self {
            sigma,
            states: DMatrix::zeros(decay.nrows(), 3),
            decay,
            gain: added.cholesky().expect("what a step adds is positive").l(),
            random: Pcg64::seed_from_u64(seed),
        };
        noise.states = noise.normal();
        noise
    }

    fn normal(&mut self) -> DMatrix<f64> {
        DMatrix::from_fn(self.states.nrows(), 3, |_, _| StandardNormal.sample(&mut self.random))
    }

    pub fn force(&self) -> Vector3<f64> {
        Vector3::from_fn(|k, _| self.sigma[k] * self.states[(0, k)])
    }

    pub fn step(&mut self) {
        let normal = self.normal();
        let added = &self.gain * normal;
        self.states = &self.decay * &self.states + added;
    }
}
