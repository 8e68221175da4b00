// SPDX-License-Identifier: GPL-2.0-or-later
//! Coordinates that the legs do not move: held at 0, or moved by a table.

use crate::common::machines::{declared, four_rod_lathe, pyramid};
use crate::common::tolerances::{GOLDEN_JOINT, ROUND_TRIP};
use crate::common::{Case, NO_TOOL, cases, rng};
use kinematics::{Cause, Letter, MachinePart, Pose, Solver, Vector3};

const CODES: [Cause; 6] =
    [Cause::HeldX, Cause::HeldY, Cause::HeldZ, Cause::HeldA, Cause::HeldB, Cause::HeldC];

fn held(case: &Case) -> Vec<usize> {
    let layout = case.machine.layout();
    Letter::ALL.iter().filter(|l| layout.is_held(**l)).map(|l| l.index()).collect()
}

fn with(pose: &Pose, k: usize, value: f64) -> Pose {
    let mut v = pose.to_degrees();
    v[k] = value;
    Pose::from_degrees(v)
}

#[test]
fn a_pose_that_asks_for_a_held_coordinate_is_refused_with_the_code_of_its_letter() {
    let mut refused = 0;
    for case in declared() {
        for k in held(&case) {
            let unit = if k < 3 { case.machine.size() } else { 1.0 };
            for value in [1.1e-9 * unit, -1.1e-9 * unit, 1.0, -90.0] {
                let pose = with(&case.home, k, value);
                let faults = [
                    case.machine.inverse(&pose, &NO_TOOL).unwrap_err(),
                    case.machine.at(&pose, &NO_TOOL).err().unwrap(),
                ];
                for fault in faults {
                    assert_eq!(fault.cause, CODES[k], "{} {value}", case.name);
                    assert!((fault.value - value).abs() <= 1e-15 * value.abs(), "{fault}");
                    refused += 1;
                }
            }
        }
    }
    // 2 + 1 + 3 + 3 + 3 + 1 + 3 + 1 + 2 + 3 letters of ten machines.
    assert_eq!(refused, 22 * 4 * 2);
}

#[test]
fn what_rounding_leaves_of_a_held_coordinate_counts_as_0() {
    for case in declared() {
        let joints = case.joints(&case.home);
        for k in held(&case) {
            let unit = if k < 3 { case.machine.size() } else { 1.0 };
            for value in [0.9e-9 * unit, -0.9e-9 * unit, -0.0] {
                assert_eq!(case.joints(&with(&case.home, k, value)), joints, "{}", case.name);
            }
        }
    }
}

#[test]
fn forward_reads_no_held_coordinate_of_the_seed_and_returns_0() {
    let mut seen = 0;
    for case in declared() {
        let mut rng = rng(60);
        for _ in 0..cases(200) {
            let pose = (case.sample)(&mut rng);
            let joints = case.joints(&pose);
            let solve = |seed: &Pose| {
                case.machine.forward(&joints, seed, &NO_TOOL, &Solver::default()).unwrap()
            };
            let plain = solve(&case.home);
            for k in held(&case) {
                for value in [f64::NAN, f64::NEG_INFINITY, 1e300, -7.0] {
                    assert_eq!(solve(&with(&case.home, k, value)), plain, "{} {k}", case.name);
                }
                assert_eq!(plain.pose.to_degrees()[k].to_bits(), 0.0_f64.to_bits());
                seen += 1;
            }
        }
    }
    assert_eq!(seen, 22 * cases(200));
}

#[test]
fn the_table_takes_x_and_y_over_and_forward_gives_them_back() {
    let case = pyramid();
    let tool = Vector3::new(4.0, -6.0, 35.0);
    let mut rng = rng(61);
    for _ in 0..cases(1000) {
        let pose = (case.sample)(&mut rng);
        let Ok(joints) = case.machine.inverse(&pose, &tool) else { continue };
        let d = pose.position - tool + pose.rotation() * (tool + Vector3::new(0.0, 0.0, 150.0));
        assert!((joints[4] - d.x).abs() < GOLDEN_JOINT && (joints[5] - d.y).abs() < GOLDEN_JOINT);
        // The table's earlier position does not affect the legs.
        let seed = with(&with(&case.home, 0, 1e4), 1, -1e4);
        let found = case.machine.forward(&joints, &seed, &tool, &Solver::default()).unwrap();
        assert!(case.apart(&found.pose, &pose) <= ROUND_TRIP, "{pose:?}");
        // The table alone only moves the pose.
        let mut moved = joints;
        moved[4] += 10.0;
        let other = case.machine.forward(&moved, &seed, &tool, &Solver::default()).unwrap();
        let by = other.pose.position - found.pose.position;
        assert!((by - Vector3::new(10.0, 0.0, 0.0)).norm() < GOLDEN_JOINT);
        assert_eq!(other.pose.angles, found.pose.angles);
    }
}

#[test]
fn a_table_joint_that_is_not_finite_is_refused_by_its_number_and_letter() {
    let case = pyramid();
    for (joint, letter) in [(4, Letter::X), (5, Letter::Y)] {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut joints = case.joints(&case.home);
            joints[joint] = bad;
            let solver = Solver::default();
            let fault = case.machine.forward(&joints, &case.home, &NO_TOOL, &solver).unwrap_err();
            let named = Some(MachinePart::TableAxis(joint as u8, letter));
            assert_eq!((fault.cause, fault.part), (Cause::JointNotFinite, named));
        }
    }
}

#[test]
fn an_angle_of_its_own_keeps_whole_turns() {
    let case = four_rod_lathe();
    for turns in [-2.0, 1.0, 100.0] {
        for b in [-15.0, 0.0, 5.0] {
            let pose = with(&case.home, 4, b + 360.0 * turns);
            let plain = case.joints(&with(&case.home, 4, b));
            let joints = case.joints(&pose);
            for i in 0..4 {
                assert!((joints[i] - plain[i]).abs() < GOLDEN_JOINT);
            }
            for away in [0.01, -8.0] {
                let seed = with(&pose, 4, b + 360.0 * turns + away);
                let found = case.machine.forward(&joints, &seed, &NO_TOOL, &Solver::default());
                let found = found.unwrap().pose.to_degrees();
                // 1e-8 degrees: joints to rounding, over degrees of some thousands.
                assert!((found[4] - b - 360.0 * turns).abs() < 1e-8, "{found:?}");
            }
        }
    }
}
