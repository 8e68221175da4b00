// SPDX-License-Identifier: GPL-2.0-or-later
//! Floquet multipliers of the delay equation by collocation: they decide stability.
//!
//! The delay is the tooth period, so the delayed displacement lies on the same nodes one
//! period earlier. A period is divided where a tooth enters or leaves. While a tooth cuts, the modes are
//! collocated on Chebyshev nodes; in between they move freely, which is solved exactly. The map from
//! one period to the next acts on the state of the modes and the displacement at the nodes.

use crate::dense;
use crate::stability::process::{Piece, Process, Row};
use nalgebra::{Complex, DMatrix, DVector, Matrix3x2};
use std::f64::consts::{PI, TAU};

/// Nodes of a piece, and additional nodes per period of the fastest mode: errors below 1e-8.
const NODES: [f64; 2] = [12.0, 8.0];

/// Most periods of the fastest mode in a tooth period: a matrix of some 400 rows.
const MOST_PERIODS: f64 = 25.0;

/// A spindle speed at which the modes vibrate too often between two teeth.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "{rpm} 1/min: the fastest mode, {hz:.1} Hz, oscillates more than {MOST_PERIODS} times between \
     teeth; expected at least {slowest:.0} 1/min"
)]
pub struct TooSlow {
    pub rpm: f64,
    pub hz: f64,
    /// The lowest permitted speed, 1/min.
    pub slowest: f64,
}

/// Refuses spindle speeds (1/min) that require too many nodes.
///
/// # Errors
/// See [`TooSlow`].
pub fn fast_enough(rows: &[Row], process: &Process, rpm: f64) -> Result<(), TooSlow> {
    let hz = rows.iter().map(|row| row.omega).fold(0.0, f64::max) / TAU;
    let slowest = 60.0 * hz / (process.teeth as f64 * MOST_PERIODS);
    if rpm >= slowest { Ok(()) } else { Err(TooSlow { rpm, hz, slowest }) }
}

/// One tooth period at a spindle speed, for any depth.
#[derive(Clone, Debug)]
pub struct Period {
    modes: usize,
    stretches: Vec<Stretch>,
}

/// A part of the period.
#[derive(Clone, Debug)]
enum Stretch {
    /// The map of the modes' states.
    Free(DMatrix<f64>),
    Cut(Cut),
}

/// A part with teeth in cut: linear maps from the state x at the start and from the displacements
/// `d = u - u'` at the nodes, for a depth of 1.
#[derive(Clone, Debug)]
struct Cut {
    from_state: DMatrix<f64>,
    /// Displacements at the nodes from `d`.
    from_cut: DMatrix<f64>,
    /// State at the end from the state.
    to_state: DMatrix<f64>,
    /// State at the end from `d`.
    to_state_from_cut: DMatrix<f64>,
}

impl Period {
    /// Computes the maps at a spindle speed in 1/min.
    pub fn new(rows: &[Row], process: &Process, rpm: f64) -> Self {
        Self::with_more_nodes(rows, process, rpm, 0)
    }

    /// Computes the maps with more nodes in every piece, to measure their effect.
    pub fn with_more_nodes(rows: &[Row], process: &Process, rpm: f64, more: usize) -> Self {
        let turn = TAU * rpm / 60.0;
        let fastest = rows.iter().map(|row| row.omega).fold(0.0, f64::max);
        let stretch = |piece: &Piece| {
            let time = (piece.to - piece.from) / turn;
            if piece.shifts.is_empty() {
                return Stretch::Free(free(rows, time));
            }
            let nodes = (NODES[0] + NODES[1] * fastest * time / TAU).ceil() as usize + more;
            Stretch::Cut(Cut::new(rows, process, piece, time, nodes))
        };
        Self { modes: rows.len(), stretches: process.pieces().iter().map(stretch).collect() }
    }

    /// Returns the multiplier of largest modulus at a depth (mm): the loop is stable if it is below 1.
    /// Returns NaN if the multipliers cannot be computed.
    pub fn multiplier(&self, depth: f64) -> Complex<f64> {
        let none = Complex::new(f64::NAN, f64::NAN);
        let Some(matrix) = self.monodromy(depth) else { return none };
        let Some(all) = dense::eigenvalues(matrix) else { return none };
        let largest = all.iter().copied().max_by(|a, b| a.norm_sqr().total_cmp(&b.norm_sqr()));
        largest.unwrap_or(none)
    }

    /// Returns the map of the state and of the displacements one period earlier; `None` if the
    /// collocated equations have no solution.
    fn monodromy(&self, depth: f64) -> Option<DMatrix<f64>> {
        let states = 2 * self.modes;
        let nodes = |stretch: &Stretch| match stretch {
            Stretch::Free(_) => 0,
            Stretch::Cut(cut) => cut.from_cut.nrows(),
        };
        let size = states + self.stretches.iter().map(nodes).sum::<usize>();
        let mut state = DMatrix::identity(states, size);
        let mut whole = DMatrix::zeros(size, size);
        let mut place = states;
        for stretch in &self.stretches {
            match stretch {
                Stretch::Free(map) => state = map * state,
                Stretch::Cut(cut) => {
                    let count = cut.from_cut.nrows();
                    // (1 - a G) u = H x - a G u'.
                    let system = DMatrix::identity(count, count) - &cut.from_cut * depth;
                    let mut right = &cut.from_state * &state;
                    let mut old = right.columns_mut(place, count);
                    old -= &cut.from_cut * depth;
                    let mut moved = dense::solved(system, &right)?;
                    whole.rows_mut(place, count).copy_from(&moved);
                    let mut own = moved.columns_mut(place, count);
                    own -= DMatrix::identity(count, count);
                    state = &cut.to_state * state + &cut.to_state_from_cut * moved * depth;
                    place += count;
                }
            }
        }
        whole.rows_mut(0, states).copy_from(&state);
        Some(whole)
    }
}

/// Returns the map of displacement and speed of each mode over a time of free motion.
fn free(rows: &[Row], time: f64) -> DMatrix<f64> {
    let mut map = DMatrix::zeros(2 * rows.len(), 2 * rows.len());
    for (j, row) in rows.iter().enumerate() {
        let decay = row.zeta * row.omega;
        let [s, c] = swung(row, time);
        let block = [[c + decay * s, s], [-row.omega * row.omega * s, c - decay * s]];
        for i in 0..2 {
            for k in 0..2 {
                map[(2 * j + i, 2 * j + k)] = block[i][k];
            }
        }
    }
    map
}

/// Returns `e^{-ζωt}` times sine over its angular frequency, and times cosine, of the damped motion;
/// hyperbolic functions for an overdamped mode.
fn swung(row: &Row, time: f64) -> [f64; 2] {
    let decay = row.zeta * row.omega;
    let square = row.omega * row.omega * (1.0 - row.zeta * row.zeta);
    let left = (-decay * time).exp();
    if square > 0.0 {
        let damped = square.sqrt();
        let (s, c) = (damped * time).sin_cos();
        [left * s / damped, left * c]
    } else if square < 0.0 {
        let rate = (-square).sqrt();
        let [slow, fast] = [rate - decay, -rate - decay].map(|rate| (rate * time).exp());
        [(slow - fast) / (2.0 * rate), (slow + fast) / 2.0]
    } else {
        [left * time, left]
    }
}

impl Cut {
    fn new(rows: &[Row], process: &Process, piece: &Piece, time: f64, nodes: usize) -> Self {
        let places: Vec<f64> =
            (0..nodes).map(|k| -(PI * k as f64 / (nodes - 1) as f64).cos()).collect();
        let slopes = differentiation(&places) * (2.0 / time);
        let forces: Vec<Matrix3x2<f64>> = places[1..]
            .iter()
            .map(|x| {
                let angle = piece.from + (x + 1.0) / 2.0 * (piece.to - piece.from);
                piece.shifts.iter().map(|shift| process.at(angle + shift)).sum()
            })
            .collect();
        let (inner, states) = (nodes - 1, 2 * rows.len());
        let mut cut = Self {
            from_state: DMatrix::zeros(2 * inner, states),
            from_cut: DMatrix::zeros(2 * inner, 2 * inner),
            to_state: DMatrix::zeros(states, states),
            to_state_from_cut: DMatrix::zeros(states, 2 * inner),
        };
        for (j, row) in rows.iter().enumerate() {
            cut.add(j, row, &Solved::new(row, &slopes), &forces);
        }
        cut
    }

    fn add(&mut self, j: usize, row: &Row, solved: &Solved, forces: &[Matrix3x2<f64>]) {
        let inner = forces.len();
        let last = inner - 1;
        let columns = [&solved.from_place, &solved.from_speed];
        for i in 0..inner {
            for a in 0..2 {
                for (k, column) in columns.iter().enumerate() {
                    self.from_state[(2 * i + a, 2 * j + k)] = row.motion[a] * column[i];
                }
            }
        }
        for k in 0..inner {
            let pushed = row.force.transpose() * forces[k];
            for b in 0..2 {
                for i in 0..inner {
                    let moved = solved.from_force[(i, k)] * pushed[b];
                    for a in 0..2 {
                        self.from_cut[(2 * i + a, 2 * k + b)] += row.motion[a] * moved;
                    }
                }
                let column = 2 * k + b;
                self.to_state_from_cut[(2 * j, column)] = solved.from_force[(last, k)] * pushed[b];
                self.to_state_from_cut[(2 * j + 1, column)] = solved.last_speed[k] * pushed[b];
            }
        }
        for (k, column) in columns.iter().enumerate() {
            self.to_state[(2 * j, 2 * j + k)] = column[last];
            self.to_state[(2 * j + 1, 2 * j + k)] = solved.end_speed[k];
        }
    }
}

/// One mode on the nodes after the first: its displacements from their causes.
struct Solved {
    from_force: DMatrix<f64>,
    /// From the displacement at the start.
    from_place: DVector<f64>,
    /// From the speed at the start.
    from_speed: DVector<f64>,
    /// Speed at the end from forces at the nodes.
    last_speed: DVector<f64>,
    /// Speed at the end from displacement and speed at the start.
    end_speed: [f64; 2],
}

impl Solved {
    /// Solves the collocated mode.
    ///
    /// With D = [d₀ D₁] and v = D₁ q + d₀ q₀, collocation of v' = -ω² q - 2ζω v + f is
    /// `(D₁² + 2ζω D₁ + ω²) q = f - (D₁ + 2ζω) d₀ q₀ - d₀ v₀`.
    fn new(row: &Row, slopes: &DMatrix<f64>) -> Self {
        let inner = slopes.nrows() - 1;
        let first = slopes.view((1, 0), (inner, 1)).column(0).into_owned();
        let rest = slopes.view((1, 1), (inner, inner)).into_owned();
        let rate = 2.0 * row.zeta * row.omega;
        let mut system = &rest * &rest + &rest * rate;
        for i in 0..inner {
            system[(i, i)] += row.omega * row.omega;
        }
        // Regular, because the nodes are distinct: the matrix of a differential equation with initial values.
        let from_force = dense::solved(system, &DMatrix::identity(inner, inner))
            .unwrap_or_else(|| DMatrix::from_element(inner, inner, f64::NAN));
        let from_place = &from_force * (-(&rest * &first) - &first * rate);
        let from_speed = &from_force * -&first;
        let last = rest.row(inner - 1);
        let last_speed = (last * &from_force).transpose();
        let end_speed = [
            last.dot(&from_place.transpose()) + first[inner - 1],
            last.dot(&from_speed.transpose()),
        ];
        Self { from_force, from_place, from_speed, last_speed, end_speed }
    }
}

/// Returns the differentiation matrix of the polynomial through values at Chebyshev nodes (Trefethen,
/// Spectral Methods in MATLAB, chapter 6).
fn differentiation(places: &[f64]) -> DMatrix<f64> {
    let count = places.len();
    let weight = |k: usize| {
        let size = if k == 0 || k == count - 1 { 2.0 } else { 1.0 };
        if k.is_multiple_of(2) { size } else { -size }
    };
    let mut slopes = DMatrix::from_fn(count, count, |i, k| match i == k {
        true => 0.0,
        false => weight(i) / weight(k) / (places[i] - places[k]),
    });
    // The derivative of a constant is 0.
    for i in 0..count {
        slopes[(i, i)] = -slopes.row(i).sum();
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector2, Vector3};

    #[test]
    fn free_motion_follows_its_equation_however_it_is_damped() {
        for zeta in [0.02, 0.999_999, 1.0, 1.000_001, 4.0] {
            let row = Row { omega: 50.0, zeta, motion: Vector2::x(), force: Vector3::x() };
            let step = 1e-5;
            let [before, at, after] = [0.03 - step, 0.03, 0.03 + step].map(|t| free(&[row], t));
            // M' = A M, by finite differences: the error is of the order of the squared step.
            let law = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -2500.0, -100.0 * zeta]);
            let slope = (after - before) / (2.0 * step);
            assert!((slope - &law * &at).norm() < 1e-5 * (law * at).norm(), "{zeta}");
            assert!((free(&[row], 0.0) - DMatrix::identity(2, 2)).norm() < 1e-15);
        }
    }
}
