// SPDX-License-Identifier: GPL-2.0-or-later
//! The outcome of a forward call, judged by the reference tracker.

use super::reference::Tracker;
use super::tolerances::WRONG;
use super::{Case, NO_TOOL};
use kinematics::{Joints, Pose, Solver};
use std::ops::AddAssign;

/// The outcomes of a batch of calls.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    pub right: usize,
    /// Refused; with [`judged_with_path`] only if no path leads there either.
    pub refused: usize,
    pub wrong: usize,
    /// Refused although the reference tracker reached the pose with a regular Jacobian.
    pub missed: usize,
    /// Only with more legs than coordinates: the least-squares path breaks off, but every leg
    /// fits the pose. Between two poses no pose has the joints of the straight joint path;
    /// the path followed there depends on the weights of the legs, its end does not.
    pub fitting: usize,
}

impl Outcome {
    pub fn calls(&self) -> usize {
        self.right + self.refused + self.wrong + self.missed + self.fitting
    }
}

impl AddAssign for Outcome {
    fn add_assign(&mut self, other: Self) {
        self.right += other.right;
        self.refused += other.refused;
        self.wrong += other.wrong;
        self.missed += other.missed;
        self.fitting += other.fitting;
    }
}

fn one(count: fn(&mut Outcome) -> &mut usize) -> Outcome {
    let mut outcome = Outcome::default();
    *count(&mut outcome) = 1;
    outcome
}

/// Judges one call of forward, counted in one field. Refusals are not examined.
pub fn judged(case: &Case, tracker: &Tracker, joints: &Joints, seed: &Pose) -> Outcome {
    match case.machine.forward(joints, seed, &NO_TOOL, &Solver::default()) {
        Ok(found) => answered(case, tracker, (joints, seed), &found.pose),
        Err(_) => one(|o| &mut o.refused),
    }
}

/// Judges it and searches the path of a refusal, which takes as long as the rest.
pub fn judged_with_path(case: &Case, tracker: &Tracker, joints: &Joints, seed: &Pose) -> Outcome {
    let outcome = judged(case, tracker, joints, seed);
    match outcome.refused > 0 && tracker.follow(seed, joints).is_some() {
        true => one(|o| &mut o.missed),
        false => outcome,
    }
}

fn answered(
    case: &Case,
    tracker: &Tracker,
    (joints, seed): (&Joints, &Pose),
    found: &Pose,
) -> Outcome {
    let is_right = |pose: &Pose| case.apart(found, pose) <= WRONG;
    if tracker.follow(seed, joints).as_ref().is_some_and(is_right) {
        return one(|o| &mut o.right);
    }
    let closely = tracker.follow_closely(seed, joints);
    if closely.as_ref().is_some_and(is_right) {
        return one(|o| &mut o.right);
    }
    let redundant = case.geometry.layout().is_redundant();
    // Near a singular pose the end of the path is accurate only to rounding over the least singular value.
    // Its start is accurate, and only one path leads back there.
    let back = tracker.follow_closely(found, &case.joints(seed));
    if !redundant && back.is_some_and(|back| case.apart(&back, seed) <= WRONG) {
        return one(|o| &mut o.right);
    }
    if redundant && closely.is_none() && tracker.fits(found, joints) {
        return one(|o| &mut o.fitting);
    }
    let (found, seed) = (found.to_degrees(), seed.to_degrees());
    println!("{}: {found:?} from {seed:?} with {joints:?} is wrong", case.name);
    one(|o| &mut o.wrong)
}
