// SPDX-License-Identifier: GPL-2.0-or-later
//! Certified tracking against the reference tracker: never another pose as success.

mod common;

use common::reference::{follow, handedness};
use common::tolerances::WRONG;
use common::{Case, NO_TOOL, cases, genhexkins_case, rng, shipped};
use kinematics::{Cause, Machine, Pose, Solver};

/// What became of a batch of calls.
#[derive(Debug, Default)]
struct Outcome {
    right: usize,
    refused: usize,
    wrong: usize,
    /// Refused although the reference tracker reached the pose with a regular Jacobian.
    missed: usize,
}

fn judge(outcome: &mut Outcome, machine: &Machine<6>, joints: &[f64; 6], seed: &Pose) {
    let right = follow(machine, seed, joints, &NO_TOOL);
    match (machine.forward(joints, seed, &NO_TOOL, &Solver::default()), right) {
        (Ok(found), Some(pose)) => {
            let apart = found.pose.distance(&pose, machine.radius());
            if apart <= WRONG * machine.size() {
                outcome.right += 1;
            } else {
                outcome.wrong += 1;
            }
        }
        (Ok(_), None) => outcome.wrong += 1,
        (Err(_), Some(_)) => outcome.missed += 1,
        (Err(_), None) => outcome.refused += 1,
    }
}

#[test]
fn from_home_every_pose_of_the_workspace_is_the_one_the_reference_tracker_reaches() {
    for case in shipped() {
        let mut rng = rng(20);
        let mut outcome = Outcome::default();
        for _ in 0..cases(1000) {
            let pose = (case.sample)(&mut rng);
            let joints = case.machine.inverse(&pose, &NO_TOOL).unwrap();
            judge(&mut outcome, &case.machine, &joints, &case.home);
        }
        println!("{}: {outcome:?}", case.name);
        assert_eq!(outcome.right, cases(1000), "{}: {outcome:?}", case.name);
    }
}

#[test]
fn between_far_poses_a_result_is_right_or_refused() {
    let genhexkins = genhexkins_case();
    for case in shipped().iter().chain([&genhexkins]) {
        let mut rng = rng(21);
        let mut outcome = Outcome::default();
        for _ in 0..cases(1000) {
            let (seed, pose) = ((case.sample)(&mut rng), (case.sample)(&mut rng));
            let joints = case.machine.inverse(&pose, &NO_TOOL).unwrap();
            judge(&mut outcome, &case.machine, &joints, &seed);
        }
        println!("{}: {outcome:?}", case.name);
        assert_eq!(outcome.wrong, 0, "{}: {outcome:?}", case.name);
        assert!(outcome.right * 100 >= cases(1000) * 95, "{}: {outcome:?}", case.name);
    }
}

/// Poses beyond the workspace, many of them behind a singular one.
fn wild(case: &Case, rng: &mut rand_pcg::Pcg64) -> Pose {
    let mut v = case.home.to_degrees();
    let size = case.machine.size();
    for (k, value) in v.iter_mut().enumerate() {
        let spread = if k < 3 { 0.4 * size } else { 75.0 };
        *value += common::uniform(rng, -spread, spread);
    }
    Pose::from_degrees(v)
}

#[test]
fn a_pose_behind_a_singular_one_is_refused_and_never_replaced_by_another() {
    let genhexkins = genhexkins_case();
    for case in shipped().iter().chain([&genhexkins]) {
        let mut rng = rng(22);
        let mut outcome = Outcome::default();
        let mut behind = 0;
        for _ in 0..cases(1000) {
            let pose = wild(case, &mut rng);
            let Ok(joints) = case.machine.inverse(&pose, &NO_TOOL) else { continue };
            let sides = [&pose, &case.home].map(|p| handedness(&case.machine, p, &NO_TOOL));
            behind += usize::from(sides[0] != sides[1]);
            judge(&mut outcome, &case.machine, &joints, &case.home);
        }
        println!("{}: {outcome:?}, {behind} behind a singular pose", case.name);
        assert_eq!(outcome.wrong, 0, "{}: {outcome:?}", case.name);
        assert!(behind > 0, "the test must reach beyond singular poses");
    }
}

#[test]
fn the_way_out_of_the_workspace_ends_with_the_cause_of_a_stalled_path() {
    let [case, _] = shipped();
    let joints = case.machine.inverse(&case.home, &NO_TOOL).unwrap();
    let mut torn = joints;
    torn[2] += 600.0;
    let fault = case.machine.forward(&torn, &case.home, &NO_TOOL, &Solver::default()).unwrap_err();
    assert_eq!(fault.cause, Cause::PathStalled, "{fault}");
    assert!(fault.value > 0.0 && fault.value < 1.0, "the share of the path covered: {fault}");
}
