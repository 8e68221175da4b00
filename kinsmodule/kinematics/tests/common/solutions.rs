// SPDX-License-Identifier: GPL-2.0-or-later
//! Every real pose of given joints, by Newton's method from many random starts.
//!
//! Based on the equations of the reference tracker, without a seed: it does not decide which of the
//! poses is the right one.

use super::reference::{Row, State, Tracker};
use super::uniform;
use kinematics::{Joints, Pose, Vector3};
use nalgebra::{UnitQuaternion, Vector4};
use rand_pcg::Pcg64;
use std::f64::consts::PI;

/// Starts of one search. Of poses known beforehand it misses one in some thousand,
/// which the test that uses it counts.
const STARTS: usize = 200;

/// Steps of one start; most that converge need a dozen.
const STEPS: usize = 40;

/// Newton's step, relative to size, that ends a start: its square is negligible.
const SETTLED: f64 = 1e-8;

/// Poses nearer than this, relative to size, count as equal: a hundred times the error that a start may
/// have near a singular pose.
pub const SAME_POSE: f64 = 1e-6;

/// Returns the poses that the joints allow, with every rod on its side.
pub fn all_solutions(tracker: &Tracker, joints: &Joints, rng: &mut Pcg64) -> Vec<Pose> {
    let mut poses: Vec<Pose> = Vec::new();
    for _ in 0..STARTS {
        let Some(pose) = settled(tracker, joints, anywhere(tracker, rng)) else { continue };
        if !poses.iter().any(|known| is_same(tracker, known, &pose)) {
            poses.push(pose);
        }
    }
    poses
}

/// Returns whether two poses of the same joints are equal.
pub fn is_same(tracker: &Tracker, one: &Pose, other: &Pose) -> bool {
    one.distance(other, tracker.radius()) <= SAME_POSE * tracker.size()
}

/// Returns a position within one size about home, with any orientation that its angles allow.
fn anywhere(tracker: &Tracker, rng: &mut Pcg64) -> State {
    let mut state = tracker.home();
    let size = tracker.size();
    for k in (0..3).filter(|k| tracker.is_active(*k)) {
        state.centre[k] += uniform(rng, -size, size);
    }
    if tracker.turns_freely() {
        state.rotation = turned_anyhow(rng).to_rotation_matrix().into_inner();
        return state;
    }
    for k in (0..3).filter(|k| tracker.is_active(k + 3)) {
        state.angles[k] = uniform(rng, -PI, PI);
    }
    state.rotation = Pose { position: Vector3::zeros(), angles: state.angles }.rotation();
    state
}

/// Returns a uniformly distributed orientation.
fn turned_anyhow(rng: &mut Pcg64) -> UnitQuaternion<f64> {
    loop {
        let q = Vector4::from_fn(|_, _| uniform(rng, -1.0, 1.0));
        if (0.01..1.0).contains(&q.norm_squared()) {
            return UnitQuaternion::from_quaternion(q.into());
        }
    }
}

/// Runs Newton's method with steps of at most one radius, which keeps it from jumping.
fn settled(tracker: &Tracker, joints: &Joints, mut state: State) -> Option<Pose> {
    for _ in 0..STEPS {
        let (residuals, rows, _) = tracker.of_any_side(joints, &state);
        let (step, _) = tracker.newton_step(&tracker.charted(&rows, &state), &residuals)?;
        let length = step.norm();
        let shorter = (tracker.radius() / length).min(1.0);
        state = tracker.moved(&state, &Row::from(step * shorter));
        if length <= SETTLED * tracker.size() {
            let pose = tracker.pose(&state, joints);
            return tracker.fits(&pose, joints).then_some(pose);
        }
    }
    None
}
