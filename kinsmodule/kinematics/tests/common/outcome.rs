// SPDX-License-Identifier: GPL-2.0-or-later
//! What forward made of a call, by the reference tracker's judgement.

use super::reference::Tracker;
use super::tolerances::WRONG;
use super::{Case, NO_TOOL};
use kinematics::{Joints, Pose, Solver};
use std::ops::AddAssign;

/// What became of a batch of calls.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    pub right: usize,
    pub refused: usize,
    pub wrong: usize,
    /// Refused although the reference tracker reached the pose with a regular Jacobian.
    pub missed: usize,
    /// More legs than coordinates only: the least-squares path breaks off, but every leg
    /// fits the pose. Between two poses the straight joint path is the joints of no pose;
    /// what is followed there depends on how the legs are weighted, the end does not.
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

/// One call of forward, counted in the one field that it belongs to.
pub fn judged(case: &Case, tracker: &Tracker, joints: &Joints, seed: &Pose) -> Outcome {
    let one = |count: fn(&mut Outcome) -> &mut usize| {
        let mut outcome = Outcome::default();
        *count(&mut outcome) = 1;
        outcome
    };
    let Ok(found) = case.machine.forward(joints, seed, &NO_TOOL, &Solver::default()) else {
        return match tracker.follow(seed, joints) {
            Some(_) => one(|o| &mut o.missed),
            None => one(|o| &mut o.refused),
        };
    };
    let is_right = |pose: &Pose| case.apart(&found.pose, pose) <= WRONG;
    if tracker.follow(seed, joints).as_ref().is_some_and(is_right) {
        return one(|o| &mut o.right);
    }
    let closely = tracker.follow_closely(seed, joints);
    if closely.as_ref().is_some_and(is_right) {
        return one(|o| &mut o.right);
    }
    let redundant = case.geometry.layout().is_redundant();
    // Near a singular pose the end of the way is known to rounding over the least singular value
    // only. Where it set out from is known well, and one way alone leads back there.
    let back = tracker.follow_closely(&found.pose, &case.joints(seed));
    if !redundant && back.is_some_and(|back| case.apart(&back, seed) <= WRONG) {
        return one(|o| &mut o.right);
    }
    if redundant && closely.is_none() && tracker.fits(&found.pose, joints) {
        return one(|o| &mut o.fitting);
    }
    let (found, seed) = (found.pose.to_degrees(), seed.to_degrees());
    println!("{}: {found:?} from {seed:?} with {joints:?} is wrong", case.name);
    one(|o| &mut o.wrong)
}
