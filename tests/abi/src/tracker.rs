// SPDX-License-Identifier: GPL-2.0-or-later
//! What forward must find: the end of the one continuous path from the seed along
//! the straight line of the joint values, followed in steps so small that no
//! solver's cleverness is needed.
//!
//! It stands on inverse and Jacobian only, which other tests compare with
//! genhexkins and with differences.

use crate::module::{Jacobian, Joints, Module, Pose};

/// Steps of the path: small beside any distance at which two poses share joints.
const STEPS: usize = 1000;

/// Newton steps a place of the path may take; two are usual.
const CORRECTIONS: usize = 20;

/// Joint residual that ends a correction, relative to the machine's size.
const CONVERGED: f64 = 1e-13;

/// Follows the joints from those of `seed` to `joints`. `None` where the path
/// meets a singular pose: then there is nothing that forward may find.
pub fn connected_pose(module: &Module, joints: &Joints, seed: &Pose, size: f64) -> Option<Pose> {
    let start = module.inverse(seed).ok()?;
    let side = factored(module, &start, seed)?.1.signum();
    let mut pose = *seed;
    for step in 1..=STEPS {
        let share = step as f64 / STEPS as f64;
        let target = std::array::from_fn(|j| start[j] + share * (joints[j] - start[j]));
        correct(module, &target, &mut pose, size)?;
        // The determinant passes zero at a singular pose: beyond it the path is another.
        if factored(module, &target, &pose)?.1.signum() != side {
            return None;
        }
    }
    Some(pose)
}

fn correct(module: &Module, target: &Joints, pose: &mut Pose, size: f64) -> Option<()> {
    for _ in 0..CORRECTIONS {
        let here = module.inverse(pose).ok()?;
        let residual: [f64; 6] = std::array::from_fn(|j| target[j] - here[j]);
        let (step, _) = solved(&module.jacobian(&here, pose).ok()?, residual)?;
        for (value, change) in pose.iter_mut().zip(step) {
            *value += change;
        }
        if residual.iter().all(|r| r.abs() <= CONVERGED * size) {
            return Some(());
        }
    }
    None
}

fn factored(module: &Module, joints: &Joints, pose: &Pose) -> Option<([f64; 6], f64)> {
    solved(&module.jacobian(joints, pose).ok()?, [0.0; 6])
}

/// Solution of J x = b by elimination with row exchange, and det J.
fn solved(jacobian: &Jacobian, b: [f64; 6]) -> Option<([f64; 6], f64)> {
    let mut rows: [[f64; 7]; 6] =
        std::array::from_fn(|i| std::array::from_fn(|k| if k < 6 { jacobian[i][k] } else { b[i] }));
    let mut determinant = 1.0;
    for k in 0..6 {
        let pivot = (k..6).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs()))?;
        if rows[pivot][k] == 0.0 {
            return None;
        }
        if pivot != k {
            rows.swap(pivot, k);
            determinant = -determinant;
        }
        determinant *= rows[k][k];
        eliminate(&mut rows, k);
    }
    Some((std::array::from_fn(|i| rows[i][6]), determinant))
}

/// Clears column `k` of every row but the k-th, which gets a 1 there.
fn eliminate(rows: &mut [[f64; 7]; 6], k: usize) {
    let pivot = rows[k].map(|value| value / rows[k][k]);
    rows[k] = pivot;
    for row in rows.iter_mut().enumerate().filter(|(i, _)| *i != k).map(|(_, row)| row) {
        let factor = row[k];
        for (value, above) in row.iter_mut().zip(pivot) {
            *value -= factor * above;
        }
    }
}
