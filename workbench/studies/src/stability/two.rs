// SPDX-License-Identifier: GPL-2.0-or-later
//! D-partitions by two parameters of the loop, which paper 002 mentions but does not show.

use crate::stability::lag::{Lag, Term};
use crate::stability::partition::Point;
use nalgebra::Complex;

impl Lag {
    /// Returns the boundary in the plane of lag T (s) and cutting stiffness K (N/mm) at an angular
    /// frequency: `K = -1/Re G`, `T = Im G/(ω Re G)`. Further boundaries are the lines T = 0 and
    /// `K = -1/G(0)`.
    pub fn lag_and_stiffness(&self, omega: f64) -> Point {
        let value = self.receptance(omega);
        Point { omega, at: [value.im / (omega * value.re), -1.0 / value.re] }
    }

    /// Returns the boundary in the plane of the stiffness k of the first link and the cutting stiffness K
    /// (both N/mm) at an angular frequency: none or two points.
    ///
    /// With u = 1/K and β the receptance of the other links, the receptance of the first one is
    /// `X = -(1 + iωT) u - β`, and `1/X = k - m ω² + i h ω` has the imaginary part h ω:
    /// `h ω [(u + Re β)² + (ω T u + Im β)²] = ω T u + Im β`.
    pub fn link_and_stiffness(&self, omega: f64) -> Vec<Point> {
        let Some((first, others)) = self.terms.split_first() else { return vec![] };
        let (mass, damping) = (1.0 / first.gain, first.rate / first.gain);
        let measured = self.measured.iter().map(|own| own.at(omega));
        let beta: Complex<f64> = others.iter().map(|term| term.at(omega)).chain(measured).sum();
        let (drag, turn) = (damping * omega, omega * self.lag);
        let a = drag * (1.0 + turn * turn);
        let b = 2.0 * drag * (beta.re + turn * beta.im) - turn;
        let c = drag * beta.norm_sqr() - beta.im;
        let root = (b * b - 4.0 * a * c).sqrt();
        if !(root >= 0.0) {
            return vec![];
        }
        // The sum without cancellation, and the other root from their product.
        let large = -(b + root.copysign(b)) / 2.0;
        let roots = [large / a, c / large];
        let point = |u: f64| {
            let own = -self.delay(omega) * u - beta;
            let stiffness = (1.0 / own).re + mass * omega * omega;
            Point { omega, at: [stiffness, 1.0 / u] }
        };
        roots.map(point).into()
    }

    /// Returns the loop with another stiffness of its first link; mass and damping are unchanged.
    pub fn with_first(&self, stiffness: f64) -> Self {
        let mut terms = self.terms.clone();
        if let Some(first) = terms.first_mut() {
            *first = Term { square: stiffness * first.gain, ..*first };
        }
        Self { terms, ..self.clone() }
    }
}
