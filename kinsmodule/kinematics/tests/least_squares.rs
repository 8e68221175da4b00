// SPDX-License-Identifier: GPL-2.0-or-later
//! More legs than coordinates: forward by least squares, and inconsistent
//! joints.

use crate::common::machines::{eight_struts, pyramid};
use crate::common::tolerances::ROUND_TRIP;
use crate::common::{NO_TOOL, cases, rng, uniform};
use kinematics::{Cause, Method, Solver};

#[test]
fn one_carriage_of_the_pyramid_1_mm_off_at_home_leaves_a_quarter_of_it() {
    let case = pyramid();
    let solver = Solver { residual_limit: 0.3, ..Solver::default() };
    for leg in 0..4 {
        for off in [1.0, -1.0] {
            let mut joints = case.joints(&case.home);
            joints[leg] += off;
            let found = case.machine.forward(&joints, &case.home, &NO_TOOL, &solver).unwrap();
            // 0.2503 was computed independently, over legs and signs; to its last digit.
            assert!((found.residual - 0.2503).abs() < 1e-3, "{leg} {off}: {}", found.residual);
            assert!(found.pose.is_finite());
        }
    }
}

#[test]
fn the_residual_limit_separates_following_errors_from_contradictions_and_names_the_carriage() {
    let case = pyramid();
    let home = case.joints(&case.home);
    for leg in 0..4 {
        for sign in [1.0, -1.0] {
            let judged = |off: f64, residual_limit: f64| {
                let mut joints = home;
                joints[leg] += sign * off;
                let solver = Solver { residual_limit, ..Solver::default() };
                case.machine.forward(&joints, &case.home, &NO_TOOL, &solver)
            };
            // The default is 5e-3 of 120 mm = 0.6 mm: 2.4 mm off, minus the nonlinear part.
            for (off, limit) in [(2.2, 0.0), (0.9, 0.25), (1e-3, 1e-3)] {
                assert!(judged(off, limit).is_ok(), "{leg} {sign} {off}");
            }
            for (off, limit) in [(2.6, 0.0), (1.1, 0.25), (50.0, 0.0), (5e-3, 1e-3)] {
                let fault = judged(off, limit).unwrap_err();
                let named = (fault.cause, fault.number());
                assert_eq!(named, (Cause::JointsInconsistent, Some(leg as u8)), "{sign} {off}");
                assert!((fault.value / off - 0.25).abs() < 0.02, "{off}: {fault}");
            }
            for bad in [f64::NAN, f64::INFINITY] {
                let fault = judged(bad, 0.0).unwrap_err();
                assert_eq!((fault.cause, fault.number()), (Cause::JointNotFinite, Some(leg as u8)));
            }
        }
    }
}

#[test]
fn the_carriage_that_is_off_is_named_all_over_the_workspace() {
    for (case, off) in [(pyramid(), 4.0), (eight_struts(), 12.0)] {
        let mut rng = rng(50);
        let mut named = 0;
        for _ in 0..cases(1000) {
            let pose = (case.sample)(&mut rng);
            let seed = case.servo_step(&mut rng, &pose);
            let mut joints = case.joints(&pose);
            let leg = (uniform(&mut rng, 0.0, 1.0) * case.geometry.legs().len() as f64) as usize;
            joints[leg] += if uniform(&mut rng, -1.0, 1.0) < 0.0 { -off } else { off };
            match case.machine.forward(&joints, &seed, &NO_TOOL, &Solver::default()) {
                Ok(found) => panic!("{}: {joints:?} gave {found:?}", case.name),
                Err(fault) => {
                    assert_eq!(fault.cause, Cause::JointsInconsistent, "{}: {fault}", case.name);
                    named += usize::from(fault.number() == Some(leg as u8));
                }
            }
        }
        println!("{}: {named} of {}", case.name, cases(1000));
        // The joints of the others differ from the seed by a servo step at most, far less than
        // the wrong joint.
        assert!(named == cases(1000), "{}: {named}", case.name);
    }
}

/// Tests a jog, or an encoder that loses counts: the last pose follows until the limit is reached.
#[test]
fn a_carriage_that_creeps_away_is_never_taken_for_another_and_is_named_in_the_end() {
    let case = pyramid();
    let mut rng = rng(53);
    for n in 0..cases(200) {
        let mut seed = (case.sample)(&mut rng);
        let (leg, step) = (n % 4, if n % 8 < 4 { 0.02 } else { -0.02 });
        let mut joints = case.joints(&seed);
        let mut named = None;
        // 10 mm, four times the allowed deviation.
        for _ in 0..500 {
            joints[leg] += step;
            match case.machine.forward(&joints, &seed, &NO_TOOL, &Solver::default()) {
                Ok(found) => seed = found.pose,
                Err(fault) => {
                    assert_eq!(fault.cause, Cause::JointsInconsistent, "{fault}");
                    assert!(fault.number().is_none_or(|i| usize::from(i) == leg), "{leg}: {fault}");
                    named = fault.number();
                }
            }
        }
        assert!(named.is_some(), "{seed:?}");
    }
}

#[test]
fn consistent_joints_leave_nothing_and_need_three_solves() {
    for case in [pyramid(), eight_struts()] {
        let mut rng = rng(51);
        for _ in 0..cases(10_000) {
            let pose = (case.sample)(&mut rng);
            let seed = case.servo_step(&mut rng, &pose);
            let joints = case.joints(&pose);
            let found = case.machine.forward(&joints, &seed, &NO_TOOL, &Solver::default()).unwrap();
            assert!(found.iterations <= 3, "{}: {}", case.name, found.iterations);
            assert!(case.apart(&found.pose, &pose) <= ROUND_TRIP, "{}", case.name);
            assert!(found.residual <= ROUND_TRIP * case.machine.size(), "{}", found.residual);
        }
    }
}

/// Tests that the sum of the squared residuals is least at the pose found.
#[test]
fn the_pose_of_contradicting_joints_is_the_least_squares_one_by_either_search() {
    let case = eight_struts();
    let mut rng = rng(52);
    for _ in 0..cases(200) {
        let pose = (case.sample)(&mut rng);
        let joints = case.joints(&pose).map(|q| q + uniform(&mut rng, -0.3, 0.3));
        let squares = |pose: &kinematics::Pose| {
            let legs = case.joints(pose);
            (0..8).map(|i| (legs[i] - joints[i]).powi(2)).sum::<f64>()
        };
        let by = |method| {
            let solver = Solver { method, ..Solver::default() };
            case.machine.forward(&joints, &pose, &NO_TOOL, &solver).unwrap().pose
        };
        let found = by(Method::Certified);
        // Gauss-Newton stops with steps of 1e-12 of the size.
        assert!(case.apart(&found, &by(Method::PlainNewton)) <= ROUND_TRIP);
        for k in 0..6 {
            for by in [-1e-3, 1e-3] {
                let mut v = found.to_degrees();
                v[k] += by;
                assert!(squares(&kinematics::Pose::from_degrees(v)) > squares(&found), "{k}");
            }
        }
    }
}

#[test]
fn a_residual_limit_that_is_no_length_is_refused() {
    let case = pyramid();
    let joints = case.joints(&case.home);
    for residual_limit in [-1.0, f64::NAN, f64::INFINITY] {
        let solver = Solver { residual_limit, ..Solver::default() };
        let fault = case.machine.forward(&joints, &case.home, &NO_TOOL, &solver).unwrap_err();
        assert_eq!(fault.cause, Cause::ResidualLimitInvalid);
    }
}
