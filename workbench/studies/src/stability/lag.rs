// SPDX-License-Identifier: GPL-2.0-or-later
//! Masses on springs under a lagging cutting force (paper 002).
//!
//! The tool has relative to the work the receptance `G(p) = Σ gain/(p² + rate p + square)`. For a link
//! with mass m, damping h and stiffness k it is `1/(m p² + h p + k)`; for a mode it is the motion along the
//! chip's thickness under a force along the cutting force. The force is `K/(1 + T p)` times the
//! displacement, so the loop is on the limit of stability if `1 + K G/(1 + T p) = 0` has
//! a root on the imaginary axis. A measured response adds to G; it has no roots, so roots with a positive real part
//! are counted by the turns of `1 + K G/(1 + T p)` about 0 along the imaginary axis (Nyquist). Units: N, mm, s, t.

use crate::dense;
use crate::dynamics::mode::Mode;
use crate::stability::root;
use crate::study::measured::Receptance;
use nalgebra::{Complex, ComplexField, DMatrix, Vector3};

/// A pair of frequency (rad/s) and cutting stiffness (N/mm) on the limit of stability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    pub omega: f64,
    pub stiffness: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// 1/t; of either sign if force and thickness have different directions.
    pub gain: f64,
    /// Twice the damping ratio times the angular frequency, 1/s.
    pub rate: f64,
    /// Square of the undamped angular frequency, 1/s².
    pub square: f64,
}

impl Term {
    /// Creates the term of a mass on a spring and a damper: t, N s/mm, N/mm.
    pub fn link(mass: f64, damping: f64, stiffness: f64) -> Self {
        Self { gain: 1.0 / mass, rate: damping / mass, square: stiffness / mass }
    }

    /// Creates the term of a mode. The unit vectors are the direction of tool motion that increases the chip
    /// thickness, and the direction of the cutting force on the tool.
    pub fn mode(mode: &Mode, thicker: &Vector3<f64>, force: &Vector3<f64>) -> Self {
        Self {
            gain: -thicker.dot(&mode.tip) * force.dot(&mode.tip),
            rate: 2.0 * mode.zeta * mode.omega,
            square: mode.omega * mode.omega,
        }
    }

    /// Returns the receptance at an angular frequency, mm/N.
    pub fn at(&self, omega: f64) -> Complex<f64> {
        Complex::new(self.gain, 0.0) / self.denominator(omega)
    }

    /// Returns a link with another stiffness (N/mm), and the same mass and damping ratio.
    pub fn with_stiffness(&self, stiffness: f64) -> Self {
        let square = stiffness * self.gain;
        Self { gain: self.gain, rate: self.rate * (square / self.square).sqrt(), square }
    }

    fn denominator(&self, omega: f64) -> Complex<f64> {
        Complex::new(self.square - omega * omega, self.rate * omega)
    }

    /// Returns the undamped angular frequency, rad/s.
    pub fn omega(&self) -> f64 {
        self.square.sqrt()
    }
}

/// The loop of a receptance and a cutting force with a lag.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lag {
    /// The receptance: with the measured ones, not empty.
    pub terms: Vec<Term>,
    /// Measured receptances, added to those of the terms.
    pub measured: Vec<Receptance>,
    /// Time constant T of the cutting force, s; 0 or more.
    pub lag: f64,
}

/// The limit cutting stiffness and its certification.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// The smallest positive crossing; `None` if every cutting stiffness is stable.
    pub crossing: Option<Crossing>,
    /// Whether the numbers of unstable roots, counted between neighboring crossings, agree with
    /// these being all crossings.
    pub is_certified: bool,
}

/// Share of the highest measured frequency with which the open loop at that frequency is compared.
const NEAR_END: f64 = 0.95;

/// Open loop that may rise at the highest measured frequency, as between two small resonances.
const SMALL: f64 = 0.1;

/// Steps of Newton's method that polish a root of the polynomial.
const POLISH: usize = 60;

/// Largest ratio of imaginary part to modulus at which a root of the polynomial is tried as real. The
/// polynomial of eight terms loses about eight digits; wrong roots are refused after polishing.
const REAL: f64 = 1e-4;

/// Evenly spaced sample frequencies.
pub(super) const GRID: usize = 4000;

impl Lag {
    /// Returns the receptance G at an angular frequency, mm/N.
    pub fn receptance(&self, omega: f64) -> Complex<f64> {
        self.parts(omega).sum()
    }

    /// Returns the receptance of each term and measured response, mm/N.
    pub fn parts(&self, omega: f64) -> impl Iterator<Item = Complex<f64>> {
        let terms = self.terms.iter().map(move |term| term.at(omega));
        terms.chain(self.measured.iter().map(move |own| own.at(omega)))
    }

    /// Returns the lowest frequency of a resonance, rad/s.
    pub fn slowest(&self) -> f64 {
        let terms = self.terms.iter().map(Term::omega);
        terms.chain(self.measured.iter().map(Receptance::slowest)).fold(f64::INFINITY, f64::min)
    }

    /// Returns whether the measured responses have no common range of frequencies.
    pub fn is_apart(&self) -> bool {
        let [low, high] = self.range();
        !(low < high)
    }

    /// Returns the first term whose natural frequency is outside the measured range, where nothing is examined.
    pub fn outside(&self) -> Option<usize> {
        let [low, high] = self.range();
        self.terms.iter().position(|term| !(low..=high).contains(&term.omega()))
    }

    /// Returns the range of frequencies of all measured responses, rad/s.
    pub fn range(&self) -> [f64; 2] {
        let common = |[low, high]: [f64; 2], [from, to]: [f64; 2]| [low.max(from), high.min(to)];
        self.measured.iter().map(Receptance::range).fold([0.0, f64::INFINITY], common)
    }

    /// Returns sorted frequencies at which the loop is sampled: dense around each term's, and those measured.
    pub fn grid(&self, count: usize) -> Vec<f64> {
        if self.measured.is_empty() {
            return frequencies(&self.terms, count);
        }
        let [low, high] = self.range();
        let own = self.measured.iter().flat_map(|own| own.samples.iter().map(|(omega, _)| *omega));
        let mut all: Vec<f64> = own.collect();
        if !self.terms.is_empty() {
            all.extend(frequencies(&self.terms, count));
        }
        all.retain(|omega| (low..=high).contains(omega));
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// Returns the factor 1 + i ω T.
    pub fn delay(&self, omega: f64) -> Complex<f64> {
        Complex::new(1.0, omega * self.lag)
    }

    /// Returns the boundary of the D-partition: the K that has a root at i ω, `K = -(1 + i ω T)/G(i ω)`.
    pub fn boundary(&self, omega: f64) -> Complex<f64> {
        -self.delay(omega) / self.receptance(omega)
    }

    /// Returns the K at which a real root passes 0.
    pub fn at_rest(&self) -> f64 {
        -1.0 / self.receptance(0.0).re
    }

    /// Returns all real K with roots on the imaginary axis at ω > 0, sorted by K.
    ///
    /// `Σ gain [rate + T (square - ω²)] / |square - ω² + i rate ω|² = 0` times all denominators is
    /// a polynomial of degree 2n - 1 in ω²; its roots come from a companion matrix and are
    /// polished by Newton's method on the sum itself.
    /// A polynomial of many terms loses digits, so sign changes of the sum over frequencies are
    /// used as well.
    pub fn crossings(&self) -> Vec<Crossing> {
        let scale = self.terms.iter().map(|term| term.square).fold(0.0, f64::max);
        let is_real = |root: &Complex<f64>| root.re > 0.0 && root.im.abs() < REAL * root.modulus();
        let polynomial = if self.measured.is_empty() { self.polynomial(scale) } else { vec![] };
        let of_polynomial = roots(&polynomial).into_iter().filter(is_real);
        let mut squares: Vec<f64> =
            of_polynomial.filter_map(|root| self.polished(root.re * scale)).collect();
        // T Re G - Im G/ω, in closed form for the terms.
        let sum = |omega: f64| {
            let measured: Complex<f64> = self.measured.iter().map(|own| own.at(omega)).sum();
            self.sum(omega * omega)[0] + self.lag * measured.re - measured.im / omega
        };
        let grid = self.grid(GRID);
        let changes = grid.windows(2).filter_map(|pair| root::between(sum, pair[0], pair[1]));
        squares.extend(changes.map(|omega| omega * omega));
        squares.sort_by(f64::total_cmp);
        // Rounding shifts a double root by the square root of the rounding error.
        squares.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-9);
        let crossing = |square: f64| {
            let omega = square.sqrt();
            Crossing { omega, stiffness: -1.0 / self.receptance(omega).re }
        };
        let mut all: Vec<Crossing> = squares.into_iter().map(crossing).collect();
        all.sort_by(|a, b| a.stiffness.total_cmp(&b.stiffness));
        all
    }

    /// Returns the coefficients by rising powers of ω²/scale.
    fn polynomial(&self, scale: f64) -> Vec<f64> {
        let time = scale.sqrt();
        let size = |term: &Term| (term.rate / time, term.square / scale);
        let gain = self.terms.iter().map(|term| term.gain.abs()).fold(0.0, f64::max);
        let mut sum = vec![];
        for (j, term) in self.terms.iter().enumerate() {
            let (rate, square) = size(term);
            let lag = self.lag * time;
            let share = term.gain / gain;
            let mut product = vec![share * (rate + lag * square), -share * lag];
            for (i, other) in self.terms.iter().enumerate() {
                let (rate, square) = size(other);
                if i != j {
                    let factor = [square * square, rate * rate - 2.0 * square, 1.0];
                    product = times(&product, &factor);
                }
            }
            sum.resize(product.len(), 0.0);
            sum.iter_mut().zip(product).for_each(|(sum, part)| *sum += part);
        }
        sum
    }

    /// Returns the sum whose zeros are the crossings, and its derivative with respect to ω².
    fn sum(&self, square: f64) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for term in &self.terms {
            let away = term.square - square;
            let rate = term.rate * term.rate;
            let above = term.rate + self.lag * away;
            let below = away * away + rate * square;
            let slope = rate - 2.0 * away;
            sum[0] += term.gain * above / below;
            sum[1] -= term.gain * (self.lag * below + above * slope) / (below * below);
        }
        sum
    }

    fn polished(&self, start: f64) -> Option<f64> {
        let mut square = start;
        for _ in 0..POLISH {
            let [value, slope] = self.sum(square);
            let next = square - value / slope;
            if !(next > 0.5 * start && next < 2.0 * start) {
                return None;
            }
            let is_done = (next - square).abs() <= 4.0 * f64::EPSILON * square;
            square = next;
            if is_done {
                return Some(square);
            }
        }
        // Steps due to rounding alone never end, but they are small.
        let [value, slope] = self.sum(square);
        ((value / slope).abs() < 1e-9 * square).then_some(square)
    }

    /// Returns whether the open loop stays away from -1 beyond the measured frequencies. Below them, all parts are
    /// nearly static. Above them, a resonance turns the open loop by half a turn, so only its modulus counts; one that
    /// rises approaches a resonance, unless it is below a tenth.
    pub fn is_closed(&self, stiffness: f64) -> bool {
        let open = |omega: f64| self.receptance(omega) * stiffness / self.delay(omega);
        if self.measured.is_empty() {
            return true;
        }
        let [low, high] = self.range();
        let size = open(high).modulus();
        let shrinks = size < 1.0 && size < open(NEAR_END * high).modulus();
        (size < SMALL || shrinks) && (open(low).re > 0.0 || open(low).modulus() < 1.0)
    }

    /// Returns all roots of the characteristic equation, 1/s: eigenvalues of the closed loop whose state is
    /// the displacement and speed of each term and the force. Measured responses have none.
    pub fn roots(&self, stiffness: Complex<f64>) -> Vec<Complex<f64>> {
        let count = self.terms.len();
        let size = 2 * count + usize::from(self.lag > 0.0);
        // Time in the unit of the fastest term, forces in that of the stiffest: numbers are near 1.
        let time = self.terms.iter().map(Term::omega).fold(0.0, f64::max);
        let gain = self.terms.iter().map(|term| term.gain.abs()).fold(0.0, f64::max);
        let loop_gain = stiffness * gain / (time * time);
        let real = |value: f64| Complex::new(value, 0.0);
        let mut matrix = DMatrix::from_element(size, size, real(0.0));
        for (j, term) in self.terms.iter().enumerate() {
            let share = real(term.gain / gain);
            matrix[(2 * j, 2 * j + 1)] = real(1.0);
            matrix[(2 * j + 1, 2 * j)] = real(-term.square / (time * time));
            matrix[(2 * j + 1, 2 * j + 1)] = real(-term.rate / time);
            if self.lag > 0.0 {
                matrix[(2 * j + 1, 2 * count)] = -share;
                matrix[(2 * count, 2 * j)] = loop_gain / (self.lag * time);
            } else {
                (0..count).for_each(|i| matrix[(2 * j + 1, 2 * i)] -= share * loop_gain);
            }
        }
        if self.lag > 0.0 {
            matrix[(2 * count, 2 * count)] = real(-1.0 / (self.lag * time));
        }
        eigenvalues(matrix).into_iter().map(|root| root * time).collect()
    }

    /// Returns the same loop with another lag.
    pub fn with_lag(&self, lag: f64) -> Self {
        Self { lag, ..self.clone() }
    }

    /// Returns the lag and crossing of the least limit. It lies at the minimum of Re G, so the limit is
    /// `-1/min Re G`. `None` if Re G is never below 0.
    pub fn worst_lag(&self) -> Option<(f64, Crossing)> {
        let mut best: Option<(f64, Crossing)> = None;
        for omega in self.turning_points() {
            let value = self.receptance(omega);
            let lag = value.im / (omega * value.re);
            let stiffness = -1.0 / value.re;
            let is_less = best.is_none_or(|(_, least)| stiffness < least.stiffness);
            if value.re < 0.0 && lag >= 0.0 && is_less {
                best = Some((lag, Crossing { omega, stiffness }));
            }
        }
        best
    }

    /// Returns the frequencies at which the real part of the receptance has an extremum.
    fn turning_points(&self) -> Vec<f64> {
        let slope = |omega: f64| -> f64 {
            let of = |term: &Term| {
                let away = term.square - omega * omega;
                let rate = term.rate * term.rate;
                let below = away * away + rate * omega * omega;
                term.gain * (away * (2.0 * away - rate) - below) / (below * below)
            };
            self.terms.iter().map(of).sum()
        };
        let grid = self.grid(GRID);
        if !self.measured.is_empty() {
            // Straight lines have their extrema at their ends.
            return grid;
        }
        let pairs = grid.windows(2);
        pairs.filter_map(|pair| root::between(slope, pair[0], pair[1])).collect()
    }
}

/// Returns angular frequencies up to four times the highest of the terms, dense around each of them.
fn frequencies(terms: &[Term], count: usize) -> Vec<f64> {
    let omegas: Vec<[f64; 2]> = terms.iter().map(|term| [term.omega(), term.rate]).collect();
    super::grid::frequencies(&omegas, count, 400, 4.0)
}

fn times(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

/// Returns the roots of a polynomial given by rising powers, from its companion matrix.
fn roots(coefficients: &[f64]) -> Vec<Complex<f64>> {
    let most = coefficients.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
    let is_there = |c: &&f64| c.abs() > f64::EPSILON * most;
    let degree = coefficients.iter().rev().position(|c| is_there(&c));
    let Some(degree) = degree.map(|zeros| coefficients.len() - 1 - zeros) else { return vec![] };
    if degree == 0 {
        return vec![];
    }
    let mut companion = DMatrix::from_element(degree, degree, Complex::new(0.0, 0.0));
    for k in 0..degree {
        companion[(k, degree - 1)] = Complex::new(-coefficients[k] / coefficients[degree], 0.0);
        if k > 0 {
            companion[(k, k - 1)] = Complex::new(1.0, 0.0);
        }
    }
    eigenvalues(companion)
}

/// Returns the eigenvalues of a matrix; NaN if [`dense::complex_eigenvalues`] finds none.
fn eigenvalues(matrix: DMatrix<Complex<f64>>) -> Vec<Complex<f64>> {
    let size = matrix.nrows();
    dense::complex_eigenvalues(matrix)
        .unwrap_or_else(|| vec![Complex::new(f64::NAN, f64::NAN); size])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_gives_its_roots_back() {
        // (x - 2)(x² + 1).
        let mut found = roots(&[-2.0, 1.0, -2.0, 1.0]);
        found.sort_by(|a, b| a.im.total_cmp(&b.im));
        for (root, (re, im)) in found.iter().zip([(0.0, -1.0), (2.0, 0.0), (0.0, 1.0)]) {
            // Rounding of a companion matrix of order 3.
            assert!((root - Complex::new(re, im)).modulus() < 1e-13, "{root}");
        }
        assert!(roots(&[1.0]).is_empty() && roots(&[]).is_empty());
    }
}
