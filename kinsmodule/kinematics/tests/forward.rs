// SPDX-License-Identifier: GPL-2.0-or-later
//! Forward kinematics against inverse, over the declared workspace of every machine.

use crate::common::machines::{declared, hexapod, on_circle};
use crate::common::tolerances::{ROUND_TRIP, SERVO_REACH, SUB_STEPS_FROM_HOME, WRONG};
use crate::common::{Case, NO_TOOL, cases, rng, within};
use kinematics::leg::StrutGeometry;
use kinematics::{Cause, Certificate, MAX_ITERATIONS, Method, Pose, Solution, Solver, Vector3};

/// The results for one machine.
#[derive(Default)]
struct Figures {
    worst: f64,
    iterations: u32,
    reach: f64,
    sub_steps: u32,
}

impl Figures {
    fn add(&mut self, case: &Case, pose: &Pose, found: &Solution) {
        let reach = match found.certificate {
            Certificate::Ball(reach) => reach,
            Certificate::Spheres => 0.0,
            Certificate::None => panic!("no certificate"),
        };
        self.worst = self.worst.max(case.apart(&found.pose, pose));
        self.iterations = self.iterations.max(found.iterations);
        self.reach = self.reach.max(reach);
        self.sub_steps = self.sub_steps.max(found.sub_steps);
    }

    fn print(&self, case: &Case) {
        println!(
            "{}: mismatch {:.1e} of size, iterations {}, sub-steps {}, reach {:.3}",
            case.name, self.worst, self.iterations, self.sub_steps, self.reach
        );
    }
}

fn near_figures(case: &Case, count: usize) -> Figures {
    let mut rng = rng(1);
    let mut figures = Figures::default();
    let solver = Solver::default();
    for _ in 0..count {
        let pose = (case.sample)(&mut rng);
        let seed = case.servo_step(&mut rng, &pose);
        let found = case
            .machine
            .forward(&case.joints(&pose), &seed, &NO_TOOL, &solver)
            .unwrap_or_else(|e| panic!("{}: {pose:?} from {seed:?}: {e}", case.name));
        assert_eq!(found.sub_steps, 1, "{}: {pose:?} from {seed:?} needed tracking", case.name);
        figures.add(case, &pose, &found);
    }
    figures
}

#[test]
fn forward_recovers_pose_one_servo_step_away_within_three_certified_iterations() {
    for case in declared() {
        let f = near_figures(&case, cases(100_000));
        f.print(&case);
        assert!(f.worst <= ROUND_TRIP, "{}: {:e}", case.name, f.worst);
        assert!(f.iterations <= 3, "{}: {}", case.name, f.iterations);
        assert!(f.reach < SERVO_REACH, "{}: {}", case.name, f.reach);
    }
}

#[test]
fn forward_recovers_poses_of_struts_that_are_all_but_parallel() {
    // Struts of 1000 mm, alternately offset by 10 mm to the left and to the right at their feet:
    // the stiffness across them is a hundredth of that along them. They are
    // inclined to X, Y and Z, so that no column of the Jacobian is separate from the others.
    let askew = Pose::from_degrees([0.0, 0.0, 0.0, 45.0, 35.0, 20.0]).rotation();
    let angle = |i: usize| 60.0 * i as f64;
    let platform =
        std::array::from_fn(|i| (askew * Vector3::from(on_circle(100.0, angle(i), 0.0))).into());
    let base = std::array::from_fn(|i| {
        let side = if i % 2 == 0 { 10.0 } else { -10.0 };
        let foot = Vector3::from(on_circle(100.0, angle(i), -1000.0));
        (askew * (foot + Vector3::from(on_circle(side, angle(i) + 90.0, 0.0)))).into()
    });
    let geometry = hexapod(base, platform, [StrutGeometry::default(); 6], Some([0.0; 6]));
    let sample = within([-2.0, -2.0, -2.0, -0.2, -0.2, -0.2], [2.0, 2.0, 2.0, 0.2, 0.2, 0.2]);
    let case = Case::new("six all but parallel struts", geometry, sample, 0.05);
    let f = near_figures(&case, cases(1000));
    f.print(&case);
    assert!(f.worst <= ROUND_TRIP, "{:e}", f.worst);
}

#[test]
fn forward_from_home_reaches_the_whole_workspace_certified() {
    for case in declared() {
        let mut rng = rng(2);
        let mut f = Figures::default();
        for _ in 0..cases(10_000) {
            let pose = (case.sample)(&mut rng);
            let found = case
                .machine
                .forward(&case.joints(&pose), &case.home, &NO_TOOL, &Solver::default())
                .unwrap_or_else(|e| panic!("{}: {pose:?}: {e}", case.name));
            // Each sub-step needs a separate solve.
            assert!((1..=found.iterations).contains(&found.sub_steps), "{}: {found:?}", case.name);
            f.add(&case, &pose, &found);
        }
        f.print(&case);
        assert!(f.worst <= ROUND_TRIP, "{}: {:e}", case.name, f.worst);
        assert!(f.sub_steps <= SUB_STEPS_FROM_HOME, "{}: {}", case.name, f.sub_steps);
    }
}

#[test]
fn plain_newton_from_home_needs_at_most_six_iterations() {
    let solver = Solver { method: Method::PlainNewton, ..Solver::default() };
    for case in declared() {
        let mut rng = rng(3);
        let mut most = 0;
        for _ in 0..cases(10_000) {
            let pose = (case.sample)(&mut rng);
            let joints = case.joints(&pose);
            let found = case.machine.forward(&joints, &case.home, &NO_TOOL, &solver).unwrap();
            assert!(case.apart(&found.pose, &pose) <= WRONG, "{}: {pose:?}", case.name);
            most = most.max(found.iterations);
        }
        println!("{}: {most}", case.name);
        assert!(most <= 6, "{}: {most}", case.name);
    }
}

#[test]
fn refusals_name_the_largest_number_of_solves_that_may_be_asked_for() {
    let most = MAX_ITERATIONS.to_string();
    for cause in [Cause::TooManyIterations, Cause::LimitIterationsInvalid] {
        assert!(cause.remedy().contains(&most), "{cause:?}");
    }
    assert!(Cause::LimitIterationsInvalid.text().ends_with(&most));
}
