// SPDX-License-Identifier: GPL-2.0-or-later
//! What forward must find: the end of the one continuous path from the seed along
//! the straight line of the joint values, followed in steps so small that no
//! solver's cleverness is needed.
//!
//! It stands on inverse and Jacobian only, which other tests compare with
//! genhexkins and with differences.

use crate::module::{Joints, Module, Pose};
use crate::parallel::{Kind, Leg, Parallel};

/// Steps of the path: small beside any distance at which two poses share joints.
const STEPS: usize = 1000;

/// Newton steps a place of the path may take; two are usual.
const CORRECTIONS: usize = 20;

/// Joint residual that ends a correction, relative to the machine's size (to half a turn).
const CONVERGED: f64 = 1e-13;

/// Follows the joints from those of `seed` to `joints`. `None` where the path meets a
/// singular pose, or one that inverse refuses: then there is nothing that forward may find.
///
/// For machines with as many legs as coordinates and no table.
pub fn connected_pose(
    module: &Module,
    machine: &Parallel,
    joints: &Joints,
    seed: &Pose,
) -> Option<Pose> {
    let tracker = Tracker::new(module, machine);
    let start = module.inverse(seed).ok()?;
    let side = tracker.solved(&start, seed, &[0.0; 6])?.1.signum();
    let mut pose = *seed;
    for step in 1..=STEPS {
        let share = step as f64 / STEPS as f64;
        let target = std::array::from_fn(|j| start[j] + share * (joints[j] - start[j]));
        // The determinant passes zero at a singular pose: beyond it the path is another.
        if tracker.correct(&target, &mut pose)?.signum() != side {
            return None;
        }
    }
    Some(pose)
}

/// Whether det J has the sign at `pose` that it has at `seed`: if not, a singular pose lies
/// between them on any path. `None` where inverse refuses one of them.
///
/// For machines as [`connected_pose`] takes them.
pub fn same_handed(module: &Module, machine: &Parallel, pose: &Pose, seed: &Pose) -> Option<bool> {
    let tracker = Tracker::new(module, machine);
    let sign = |pose: &Pose| {
        let joints = module.inverse(pose).ok()?;
        Some(tracker.solved(&joints, pose, &[0.0; 6])?.1.signum())
    };
    Some(sign(pose)? == sign(seed)?)
}

struct Tracker<'a> {
    module: &'a Module,
    /// Places in the pose of the coordinates that the legs move.
    letters: Vec<usize>,
    /// Largest joint residual that ends a correction, joint by joint.
    converged: Vec<f64>,
}

impl Tracker<'_> {
    fn new<'a>(module: &'a Module, machine: &Parallel) -> Tracker<'a> {
        let letters: Vec<usize> = (0..6).filter(|c| machine.moves(*c)).collect();
        assert!(machine.table.is_empty() && letters.len() == machine.legs.len());
        let of = |leg: &Leg| match leg.kind {
            Kind::Crank { .. } => CONVERGED * 180.0,
            _ => CONVERGED * machine.size(),
        };
        Tracker { module, letters, converged: machine.legs.iter().map(of).collect() }
    }

    /// Newton's method back to the path; det J there.
    fn correct(&self, target: &Joints, pose: &mut Pose) -> Option<f64> {
        for _ in 0..CORRECTIONS {
            let here = self.module.inverse(pose).ok()?;
            let mut residual = [0.0; 6];
            for n in 0..self.letters.len() {
                residual[n] = target[n] - here[n];
            }
            let (step, determinant) = self.solved(&here, pose, &residual)?;
            for (letter, change) in self.letters.iter().zip(step) {
                pose[*letter] += change;
            }
            if residual.iter().zip(&self.converged).all(|(r, limit)| r.abs() <= *limit) {
                return Some(determinant);
            }
        }
        None
    }

    /// Solution of J x = b over the letters that move, by elimination with row exchange,
    /// and det J.
    fn solved(&self, joints: &Joints, pose: &Pose, b: &[f64; 6]) -> Option<([f64; 6], f64)> {
        let jacobian = self.module.jacobian(joints, pose).ok()?;
        let count = self.letters.len();
        let mut rows = [[0.0; 7]; 6];
        for (i, row) in rows.iter_mut().enumerate().take(count) {
            for (place, letter) in row.iter_mut().zip(&self.letters) {
                *place = jacobian[i][*letter];
            }
            row[6] = b[i];
        }
        let determinant = eliminated(&mut rows, count)?;
        Some((std::array::from_fn(|i| rows[i][6]), determinant))
    }
}

/// Turns the first `count` columns into the unit matrix; their determinant.
fn eliminated(rows: &mut [[f64; 7]; 6], count: usize) -> Option<f64> {
    let mut determinant = 1.0;
    for k in 0..count {
        let pivot = (k..count).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs()))?;
        if rows[pivot][k] == 0.0 {
            return None;
        }
        if pivot != k {
            rows.swap(pivot, k);
            determinant = -determinant;
        }
        determinant *= rows[k][k];
        eliminate(rows, k);
    }
    Some(determinant)
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
