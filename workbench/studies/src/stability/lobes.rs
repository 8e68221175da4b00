// SPDX-License-Identifier: GPL-2.0-or-later
//! Stability lobes of the zero-order approximation: the force averaged over a turn (Altintas and
//! Budak 1995). Exact for turning, whose force is constant.
//!
//! With the averaged force `a B̄ (u - u')` the loop is on its limit if `a (1 - e^{-iωτ}) λ = 1`
//! for an eigenvalue λ(ω) of `H(iω) B̄`. At a speed n the depth a is the least `1/Re ν` of those
//! `ν = (1 - e^{-iωτ}) λ` that are real and positive. Over all speeds it is `1/(2 max Re λ)`.

use crate::stability::grid::frequencies;
use crate::stability::process::{Process, Row, receptance};
use crate::stability::root;
use nalgebra::{Complex, ComplexField, Matrix2, Matrix2x3, Matrix3x2, Rotation3, Vector3};
use std::f64::consts::TAU;
use std::sync::Arc;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// Depth of cut, mm.
    pub depth: f64,
    /// Angular frequency of the vibration, rad/s.
    pub omega: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobePoint {
    /// Spindle speed, 1/min.
    pub rpm: f64,
    /// Depth and frequency.
    pub limit: Limit,
}

/// Least number of evenly spaced frequencies, and number around each mode.
const COUNT: usize = 8000;
const ABOUT: usize = 400;

/// Both numbers for thousands of poses: for floors, whose frequency is refined, and for
/// limits at one speed.
const COARSE: [usize; 2] = [800, 80];

/// Least number of frequencies per period of the factor 1 - e^{-iωτ}.
const A_PERIOD: f64 = 32.0;

/// Upper end of the frequencies, in multiples of the highest resonance.
const BEYOND: f64 = 5.0;

/// Modes, and their receptance at the frequencies of possible chatter.
#[derive(Debug)]
struct Sampled {
    rows: Vec<Row>,
    grid: Vec<f64>,
    receptances: Vec<Matrix2x3<Complex<f64>>>,
}

/// Both eigenvalues of `H(iω) B̄` over the frequencies of possible chatter.
#[derive(Clone, Debug)]
pub struct Lobes {
    sampled: Arc<Sampled>,
    process: Process,
    mean: Matrix3x2<f64>,
    branches: [Vec<Complex<f64>>; 2],
}

impl Lobes {
    /// Computes the lobes for spindle speeds (1/min) of at least `slowest`.
    pub fn new(rows: &[Row], process: &Process, slowest: f64) -> Self {
        Self::on_grid(rows, process, [COUNT.max(periods(rows, process, slowest)), ABOUT])
    }

    /// Computes the lobes from fewer frequencies, for maps of many poses.
    pub fn coarse(rows: &[Row], process: &Process, slowest: f64) -> Self {
        let even = COARSE[0].max(periods(rows, process, slowest));
        Self::on_grid(rows, process, [even, COARSE[1]])
    }

    /// Computes the lobes from `even` evenly spaced frequencies and `about` around each mode.
    fn on_grid(rows: &[Row], process: &Process, [even, about]: [usize; 2]) -> Self {
        let resonances: Vec<[f64; 2]> =
            rows.iter().map(|row| [row.omega, 2.0 * row.zeta * row.omega]).collect();
        let grid = frequencies(&resonances, even, about, BEYOND);
        let receptances = grid.iter().map(|omega| receptance(rows, *omega)).collect();
        let sampled = Arc::new(Sampled { rows: rows.to_vec(), grid, receptances });
        Self::of(sampled, process, process.mean())
    }

    fn of(sampled: Arc<Sampled>, process: &Process, mean: Matrix3x2<f64>) -> Self {
        let mut branches = [vec![], vec![]];
        let mut before: Option<[Complex<f64>; 2]> = None;
        for response in &sampled.receptances {
            let mut pair = eigenvalues(response, &mean);
            if let Some([a, b]) = before {
                let kept = (pair[0] - a).modulus() + (pair[1] - b).modulus();
                let swapped = (pair[1] - a).modulus() + (pair[0] - b).modulus();
                if swapped < kept {
                    pair.swap(0, 1);
                }
            }
            before = Some(pair);
            (0..2).for_each(|k| branches[k].push(pair[k]));
        }
        Self { sampled, process: *process, mean, branches }
    }

    /// Returns the lobes with the feed turned by an angle in the cutter plane, rad.
    pub fn turned(&self, angle: f64) -> Self {
        // The eigenvalues with H turned are those with H as it is and the force turned back.
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle).into_inner();
        let flat = turn.fixed_view::<2, 2>(0, 0).transpose();
        Self::of(self.sampled.clone(), &self.process, turn * self.process.mean() * flat)
    }

    /// Returns the eigenvalue at a frequency that is nearest to a value.
    fn nearest(&self, omega: f64, near: Complex<f64>) -> Complex<f64> {
        let [a, b] = eigenvalues(&receptance(&self.sampled.rows, omega), &self.mean);
        if (a - near).modulus() <= (b - near).modulus() { a } else { b }
    }

    /// Returns an eigenvalue between the k-th frequency of the grid and the next, on a branch.
    fn between(&self, branch: usize, k: usize, omega: f64) -> Complex<f64> {
        let [low, high] = [self.sampled.grid[k], self.sampled.grid[k + 1]];
        let [from, to] = [self.branches[branch][k], self.branches[branch][k + 1]];
        self.nearest(omega, from + (to - from) * ((omega - low) / (high - low)))
    }

    /// Returns the least limit depth at a spindle speed (1/min); `None` if every depth is stable.
    pub fn limit(&self, rpm: f64) -> Option<Limit> {
        self.limits(rpm).into_iter().min_by(|a, b| a.depth.total_cmp(&b.depth))
    }

    /// Returns all depths at which a pair of roots crosses the imaginary axis at a spindle speed.
    pub fn limits(&self, rpm: f64) -> Vec<Limit> {
        let delay = self.process.delay(rpm);
        let factors: Vec<Complex<f64>> =
            self.sampled.grid.iter().map(|omega| factor(*omega, delay)).collect();
        let mut found = vec![];
        for branch in 0..2 {
            let values = &self.branches[branch];
            let mut before = factors[0] * values[0];
            for k in 0..self.sampled.grid.len() - 1 {
                let next = factors[k + 1] * values[k + 1];
                if before.im * next.im < 0.0 && before.re.max(next.re) > 0.0 {
                    found.extend(self.crossing(branch, k, delay));
                }
                before = next;
            }
        }
        found
    }

    fn crossing(&self, branch: usize, k: usize, delay: f64) -> Option<Limit> {
        let value = |omega: f64| factor(omega, delay) * self.between(branch, k, omega);
        let omega =
            root::between(|omega| value(omega).im, self.sampled.grid[k], self.sampled.grid[k + 1])?;
        let at = value(omega);
        // A jump between branches changes the sign too, but there the value is not real.
        let is_real = at.re > 0.0 && at.im.abs() < 1e-6 * at.modulus();
        is_real.then(|| Limit { depth: 1.0 / at.re, omega })
    }

    /// Returns the least limit depth over all spindle speeds; `None` if every depth is stable.
    pub fn floor(&self) -> Option<Limit> {
        let (branch, k) = self.largest()?;
        let [low, high] = [self.sampled.grid[k - 1], self.sampled.grid[k + 1]];
        let value = |omega: f64| {
            let side = if omega < self.sampled.grid[k] { k - 1 } else { k };
            self.between(branch, side, omega).re
        };
        // At a minimum the value changes with the square of the frequency error.
        let omega = root::least(|omega| -value(omega), low, high, 1e-9 * high);
        Some(Limit { depth: 0.5 / value(omega), omega })
    }

    /// Returns branch and grid index of the largest positive real part, ends excluded.
    fn largest(&self) -> Option<(usize, usize)> {
        let inner = 1..self.sampled.grid.len() - 1;
        let places = (0..2).flat_map(|branch| inner.clone().map(move |k| (branch, k)));
        let value = |(branch, k): &(usize, usize)| self.branches[*branch][*k].re;
        places.max_by(|a, b| value(a).total_cmp(&value(b))).filter(|place| value(place) > 0.0)
    }

    /// Returns the classical lobes: for each frequency at which an eigenvalue has a limit, its depth and
    /// the speeds of lobes 0 to `count - 1`, grouped by lobe.
    pub fn curves(&self, count: usize) -> Vec<Vec<LobePoint>> {
        let mut lobes = vec![];
        for j in 0..count {
            for branch in &self.branches {
                let mut points = vec![];
                for (omega, value) in self.sampled.grid.iter().zip(branch) {
                    if value.re > 0.0 {
                        let depth = 0.5 / value.re;
                        let turn = -(1.0 - 1.0 / (value * depth)).argument();
                        let turn = turn.rem_euclid(TAU) + TAU * j as f64;
                        let rpm = 60.0 * omega / (self.process.teeth as f64 * turn);
                        points.push(LobePoint { rpm, limit: Limit { depth, omega: *omega } });
                    }
                }
                lobes.push(points);
            }
        }
        lobes
    }
}

/// Returns how many evenly spaced frequencies resolve the factor 1 - e^{-iωτ} at the slowest speed.
fn periods(rows: &[Row], process: &Process, slowest: f64) -> usize {
    let top = BEYOND * rows.iter().map(|row| row.omega).fold(0.0, f64::max);
    (A_PERIOD * top * process.delay(slowest) / TAU) as usize
}

fn factor(omega: f64, delay: f64) -> Complex<f64> {
    let (s, c) = (omega * delay).sin_cos();
    Complex::new(1.0 - c, s)
}

fn eigenvalues(response: &Matrix2x3<Complex<f64>>, mean: &Matrix3x2<f64>) -> [Complex<f64>; 2] {
    let product: Matrix2<Complex<f64>> = Matrix2::from_fn(|i, k| {
        (0..3).map(|m| response[(i, m)] * mean[(m, k)]).sum::<Complex<f64>>()
    });
    let half = (product[(0, 0)] + product[(1, 1)]) / 2.0;
    let gap = (product[(0, 0)] - product[(1, 1)]) / 2.0;
    let root = (gap * gap + product[(0, 1)] * product[(1, 0)]).sqrt();
    [half + root, half - root]
}
