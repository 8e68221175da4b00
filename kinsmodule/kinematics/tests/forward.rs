// SPDX-License-Identifier: GPL-2.0-or-later
//! Forward kinematics against inverse and against the reference tracker.

mod common;

use common::tolerances::{ROUND_TRIP, SERVO_REACH, SUB_STEPS_FROM_HOME, WRONG};
use common::{Case, NO_TOOL, cases, rng, servo_step, shipped};
use kinematics::{Certificate, Method, Solver};

/// Servo-step figures of one machine.
#[derive(Default)]
struct Figures {
    worst: f64,
    iterations: u32,
    reach: f64,
    sub_steps: u32,
}

fn near_figures(case: &Case, count: usize) -> Figures {
    let mut rng = rng(1);
    let mut figures = Figures::default();
    let solver = Solver::default();
    for _ in 0..count {
        let pose = (case.sample)(&mut rng);
        let seed = servo_step(&mut rng, &pose, 0.5);
        let joints = case.machine.inverse(&pose, &NO_TOOL).unwrap();
        let found = case
            .machine
            .forward(&joints, &seed, &NO_TOOL, &solver)
            .unwrap_or_else(|e| panic!("{}: {pose:?} from {seed:?}: {e}", case.name));
        let Certificate::Ball(reach) = found.certificate else { panic!("no certificate") };
        assert_eq!(found.sub_steps, 1, "{}: {pose:?} from {seed:?} needed tracking", case.name);
        figures.worst = figures
            .worst
            .max(found.pose.distance(&pose, case.machine.radius()) / case.machine.size());
        figures.iterations = figures.iterations.max(found.iterations);
        figures.reach = figures.reach.max(reach);
    }
    figures
}

#[test]
fn forward_recovers_pose_one_servo_step_away_within_three_certified_iterations() {
    for case in shipped() {
        let f = near_figures(&case, cases(100_000));
        println!(
            "{}: mismatch {:.1e} of size, iterations {}, reach {:.3}",
            case.name, f.worst, f.iterations, f.reach
        );
        assert!(f.worst <= ROUND_TRIP, "{}: {:e}", case.name, f.worst);
        assert!(f.iterations <= 3, "{}: {}", case.name, f.iterations);
        assert!(f.reach < SERVO_REACH, "{}: {}", case.name, f.reach);
    }
}

#[test]
fn forward_from_home_reaches_the_whole_workspace_certified() {
    for case in shipped() {
        let mut rng = rng(2);
        let mut f = Figures::default();
        for _ in 0..cases(10_000) {
            let pose = (case.sample)(&mut rng);
            let joints = case.machine.inverse(&pose, &NO_TOOL).unwrap();
            let found = case
                .machine
                .forward(&joints, &case.home, &NO_TOOL, &Solver::default())
                .unwrap_or_else(|e| panic!("{}: {pose:?}: {e}", case.name));
            f.worst = f
                .worst
                .max(found.pose.distance(&pose, case.machine.radius()) / case.machine.size());
            f.iterations = f.iterations.max(found.iterations);
            f.sub_steps = f.sub_steps.max(found.sub_steps);
        }
        println!(
            "{}: mismatch {:.1e} of size, iterations {}, sub-steps {}",
            case.name, f.worst, f.iterations, f.sub_steps
        );
        assert!(f.worst <= ROUND_TRIP, "{}: {:e}", case.name, f.worst);
        assert!(f.sub_steps <= SUB_STEPS_FROM_HOME, "{}: {}", case.name, f.sub_steps);
    }
}

#[test]
fn plain_newton_from_home_needs_at_most_six_iterations() {
    let solver = Solver { method: Method::PlainNewton, ..Solver::default() };
    for case in shipped() {
        let mut rng = rng(3);
        let mut most = 0;
        for _ in 0..cases(10_000) {
            let pose = (case.sample)(&mut rng);
            let joints = case.machine.inverse(&pose, &NO_TOOL).unwrap();
            let found = case.machine.forward(&joints, &case.home, &NO_TOOL, &solver).unwrap();
            assert!(
                found.pose.distance(&pose, case.machine.radius()) <= WRONG * case.machine.size()
            );
            most = most.max(found.iterations);
        }
        println!("{}: {most}", case.name);
        assert!(most <= 6, "{}: {most}", case.name);
    }
}
