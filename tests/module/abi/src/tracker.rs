// SPDX-License-Identifier: GPL-2.0-or-later
//! The required result of forward: the end of the continuous path from the seed along
//! the straight line of the joint values, followed in steps so small that a simple
//! solver suffices.
//!
//! It uses only inverse and Jacobian, which other tests compare with
//! genhexkins and with finite differences.

use crate::module::{Joints, Module, Pose};
use crate::parallel::{Kind, Leg, Parallel};
use nalgebra::{Matrix6, Vector6};

/// Number of steps of the path: small compared with any distance at which two poses share joints.
const STEPS: usize = 1000;

/// Largest number of Newton steps per point of the path; two are usual.
const CORRECTIONS: usize = 20;

/// Joint residual that ends a correction, relative to the machine's size (to half a turn).
const CONVERGED: f64 = 1e-13;

/// Follows the joints from those of `seed` to `joints`. `None` if the path reaches a
/// singular pose, or one that inverse refuses: then no result of forward is correct.
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
        // The determinant passes zero at a singular pose: beyond it the path is another one.
        if tracker.correct(&target, &mut pose)?.signum() != side {
            return None;
        }
    }
    Some(pose)
}

/// Returns whether det J has the sign at `pose` that it has at `seed`: if not, a singular pose is
/// between them on any path. `None` if inverse refuses one of them.
///
/// For machines as in [`connected_pose`].
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
    /// Indices in the pose of the coordinates that the legs move.
    letters: Vec<usize>,
    /// Largest joint residual that ends a correction, for each joint.
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

    /// Returns to the path by Newton's method; returns det J there.
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

    /// Solves J x = b over the letters that move; returns the solution and det J.
    fn solved(&self, joints: &Joints, pose: &Pose, b: &[f64; 6]) -> Option<([f64; 6], f64)> {
        let jacobian = self.module.jacobian(joints, pose).ok()?;
        // Constant coordinates do not change.
        let mut rows = Matrix6::identity();
        for i in 0..self.letters.len() {
            for (k, letter) in self.letters.iter().enumerate() {
                rows[(i, k)] = jacobian[i][*letter];
            }
        }
        let rows = rows.lu();
        let step = rows.solve(&Vector6::from(*b))?;
        Some((step.into(), rows.determinant()))
    }
}
