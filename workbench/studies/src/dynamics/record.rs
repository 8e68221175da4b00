// SPDX-License-Identifier: GPL-2.0-or-later
//! Record of a motion: the deviation of the tool tip from its command over time.

use kinematics::{Matrix3, Vector3};
use std::f64::consts::TAU;

/// Displacements of the tool tip from its command at regular times.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Seconds between two of them.
    pub step: f64,
    /// mm, machine axes.
    pub tip: Vec<Vector3<f64>>,
    /// Largest force magnitude of every leg, N.
    pub forces: Vec<f64>,
    /// Volume that a cutter has removed from a stock, mm³; `None` without a stock.
    pub removed: Option<f64>,
}

/// Smallest number of overlapping segments of a record over which a spectrum is averaged.
const SEGMENTS: usize = 8;

impl Record {
    /// Adds a moment.
    pub fn see(&mut self, tip: Vector3<f64>, forces: &[f64]) {
        self.tip.push(tip);
        self.forces.resize(forces.len(), 0.0);
        for (most, force) in self.forces.iter_mut().zip(forces) {
            if force.abs() > most.abs() {
                *most = *force;
            }
        }
    }

    pub fn mean(&self) -> Vector3<f64> {
        self.tip.iter().sum::<Vector3<f64>>() / self.tip.len() as f64
    }

    /// Computes the covariance about the mean.
    pub fn covariance(&self) -> Matrix3<f64> {
        let mean = self.mean();
        let square = |tip: &Vector3<f64>| (tip - mean) * (tip - mean).transpose();
        self.tip.iter().map(square).sum::<Matrix3<f64>>() / self.tip.len() as f64
    }

    /// Returns the largest magnitudes along X Y Z.
    pub fn peaks(&self) -> Vector3<f64> {
        self.tip.iter().fold(Vector3::zeros(), |most, tip| most.sup(&tip.abs()))
    }

    /// Computes the one-sided spectral densities along X Y Z at frequencies in Hz, mm²/Hz: a mean over overlapping
    /// segments with Hann's window (Welch 1967).
    pub fn spectrum(&self, frequencies: &[f64]) -> Vec<Vector3<f64>> {
        let part = (2 * self.tip.len() / (SEGMENTS + 1)).max(2).min(self.tip.len());
        let mean = self.mean();
        let window = |k: usize| 0.5 - 0.5 * (TAU * k as f64 / part as f64).cos();
        let power: f64 = (0..part).map(|k| window(k).powi(2)).sum::<f64>() / self.step;
        let parts: Vec<Vec<Vector3<f64>>> = (0..)
            .map(|k| k * (part / 2))
            .take_while(|first| first + part <= self.tip.len())
            .map(|first| {
                let own = self.tip[first..first + part].iter().enumerate();
                own.map(|(k, tip)| (tip - mean) * window(k)).collect()
            })
            .collect();
        let density = |hz: &f64| {
            let sum: Vector3<f64> = parts.iter().map(|part| self.power(part, *hz)).sum();
            sum * (2.0 / (power * parts.len() as f64))
        };
        frequencies.iter().map(density).collect()
    }

    /// Computes the squared magnitude of the Fourier sum of a segment at a frequency (Goertzel 1958).
    fn power(&self, part: &[Vector3<f64>], hz: f64) -> Vector3<f64> {
        let turn = 2.0 * (TAU * hz * self.step).cos();
        let (mut last, mut before) = (Vector3::zeros(), Vector3::<f64>::zeros());
        for value in part {
            (last, before) = (value + last * turn - before, last);
        }
        let mixed = last.component_mul(&before) * turn;
        last.component_mul(&last) + before.component_mul(&before) - mixed
    }
}
