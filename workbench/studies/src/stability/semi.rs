// SPDX-License-Identifier: GPL-2.0-or-later
//! Floquet multipliers by first-order semi-discretization (Insperger and Stépán 2004), as a check.
//!
//! Within a step the delayed displacement is linear, and the direction of the force is its exact mean.
//! The error decreases with the square of the number of steps.

use crate::dense;
use crate::dynamics::noise::exponential;
use crate::stability::process::{Process, Row};
use nalgebra::{ComplexField, DMatrix};
use std::f64::consts::TAU;

/// Returns the largest modulus of a multiplier at a spindle speed (1/min) and a depth (mm), with `steps`
/// steps (2 at least) per tooth period; `None` if [`dense::eigenvalues`] fails.
pub fn multiplier(
    rows: &[Row],
    process: &Process,
    rpm: f64,
    depth: f64,
    steps: usize,
) -> Option<f64> {
    let states = 2 * rows.len();
    let step = process.delay(rpm) / steps as f64;
    let turn = TAU * rpm / 60.0 * step;
    let (free, push, see) = matrices(rows);
    let size = states + 2 * steps;
    let mut whole = DMatrix::<f64>::identity(size, size);
    for i in 0..steps {
        let from = process.arc[0] + turn * i as f64;
        let mean = process.mean_between(from, from + turn) * depth;
        let force = &push * DMatrix::from_fn(3, 2, |i, k| mean[(i, k)]);
        let [kept, constant, linear] = propagators(&(&free + &force * &see), step);
        let oldest = whole.rows(size - 2, 2).into_owned();
        let next = whole.rows(size - 4, 2) - &oldest;
        let state = whole.rows(0, states).into_owned();
        let moved = kept * &state - constant * &force * &oldest - linear * &force * next / step;
        let mut shifted = DMatrix::zeros(size, size);
        shifted.rows_mut(0, states).copy_from(&moved);
        shifted.rows_mut(states, 2).copy_from(&(&see * &state));
        let kept = size - states - 2;
        shifted.rows_mut(states + 2, kept).copy_from(&whole.rows(states, kept));
        whole = shifted;
    }
    let all = dense::eigenvalues(whole)?;
    Some(all.iter().map(|value| value.modulus()).fold(0.0, f64::max))
}

/// Returns the matrices of free motion, of the forces' effect, and of the observed displacements.
fn matrices(rows: &[Row]) -> (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>) {
    let states = 2 * rows.len();
    let mut free = DMatrix::zeros(states, states);
    let mut push = DMatrix::zeros(states, 3);
    let mut see = DMatrix::zeros(2, states);
    for (j, row) in rows.iter().enumerate() {
        free[(2 * j, 2 * j + 1)] = 1.0;
        free[(2 * j + 1, 2 * j)] = -row.omega * row.omega;
        free[(2 * j + 1, 2 * j + 1)] = -2.0 * row.zeta * row.omega;
        (0..3).for_each(|k| push[(2 * j + 1, k)] = row.force[k]);
        (0..2).for_each(|k| see[(k, 2 * j)] = row.motion[k]);
    }
    (free, push, see)
}

/// Computes `e^{Lh}`, `∫e^{L(h-s)} ds` and `∫e^{L(h-s)} s ds` from 0 to h, by one exponential.
fn propagators(law: &DMatrix<f64>, step: f64) -> [DMatrix<f64>; 3] {
    let size = law.nrows();
    let mut block = DMatrix::zeros(3 * size, 3 * size);
    block.view_mut((0, 0), (size, size)).copy_from(law);
    for k in 0..size {
        block[(k, size + k)] = 1.0;
        block[(size + k, 2 * size + k)] = 1.0;
    }
    let power = exponential(&(block * step));
    [0, 1, 2].map(|k| power.view((0, k * size), (size, size)).into_owned())
}
