// SPDX-License-Identifier: GPL-2.0-or-later
//! More legs than coordinates: slightly contradicting joints are averaged,
//! which `.residual` shows; more than `.residual-limit` is a code that names the leg.

use abi_tests::geometry::norm;
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::{Kind, Parallel};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, octopod, pyramid, pyramid_pose, subjects};
use abi_tests::tolerances::{
    LEAST_SQUARES_STEP, PYRAMID_RESIDUAL, PYRAMID_RESIDUAL_MM, SETTLED_RESIDUAL_REL,
};
use kinematics::Cause;

fn home() -> Pose {
    pyramid().home.expect("given")
}

/// Returns the pyramid's joints at home with one carriage `off` millimeters from its position.
fn with_error(leg: usize, off: f64) -> Joints {
    let mut joints = pyramid().module().inverse(&home()).expect("home");
    joints[leg] += off;
    joints
}

#[test]
fn one_carriage_a_millimeter_off_passes_and_leaves_a_quarter_of_it() {
    let module = pyramid().module();
    for leg in 0..4 {
        for off in [1.0, -1.0] {
            let joints = with_error(leg, off);
            module.forward(&joints, &home()).expect("a following error");
            let residual = module.get("residual");
            assert!(
                (residual - PYRAMID_RESIDUAL).abs() <= PYRAMID_RESIDUAL_MM,
                "{leg} {off}: {residual}"
            );
        }
    }
}

#[test]
fn joints_of_a_pose_leave_no_residual() {
    for subject in redundant() {
        let module = subject.machine.module();
        let mut random = Random::new(51);
        for _ in 0..cases(1_000) {
            let pose = (subject.sample)(&mut random);
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            module.forward(&joints, &subject.home()).expect("its own joints");
            let residual = module.get("residual");
            let allowed = SETTLED_RESIDUAL_REL * subject.machine.size();
            assert!(residual <= allowed, "{}: {residual} at {pose:?}", subject.name);
        }
    }
}

fn redundant() -> Vec<Subject> {
    let moved = |machine: &Parallel| machine.coordinates.len();
    subjects().into_iter().filter(|s| s.machine.legs.len() > moved(&s.machine)).collect()
}

/// The default is 5e-3 of the platform's radius, 0.6 mm of 120 mm: a quarter of 2.4 mm.
#[test]
fn by_default_a_carriage_more_than_two_millimeters_off_is_refused_and_named() {
    let module = pyramid().module();
    for leg in 0..4 {
        for off in [2.3, -2.3] {
            let joints = with_error(leg, off);
            assert!(module.forward(&joints, &home()).is_ok(), "{leg} {off}");
        }
        for off in [2.5, -2.5, 5.0, -20.0] {
            assert_contradiction(&module, leg, off);
        }
    }
}

fn assert_contradiction(module: &Module, leg: usize, off: f64) {
    let joints = with_error(leg, off);
    // The leg is named by comparison with the last pose.
    module.forward(&with_error(leg, 0.0), &home()).expect("home");
    let mut world = home();
    let code = module.forward_into(&joints, &mut world);
    assert_eq!(code, Cause::JointsInconsistent.code(), "{leg} {off}");
    assert!(world[..5].iter().all(|v| v.is_nan()), "{world:?}");
    assert_eq!(world[5..], home()[5..], "C is held, U V W are not the module's");
    assert!(module.is_on("fwd-kins-fail"));
    module.monitor();
    assert_eq!(module.get("fault-leg"), leg as f64, "{off}");
    assert_eq!(module.get("fault"), f64::from(Cause::JointsInconsistent.code()));
}

#[test]
fn the_limit_is_live_and_0_is_the_default() {
    let module = pyramid().module();
    let joints = with_error(2, 1.0);
    for (limit, passes) in
        [(0.26, true), (0.24, false), (0.0, true), (1e-6, false), (-0.0, true), (1e6, true)]
    {
        module.set("residual-limit", limit);
        let found = module.forward(&joints, &home());
        let refused = Err(Cause::JointsInconsistent.code());
        assert!(if passes { found.is_ok() } else { found == refused }, "{limit}: {found:?}");
    }
    // With a large limit, joints that the default refuses are accepted.
    module.set("residual-limit", 10.0);
    assert!(module.forward(&with_error(0, 20.0), &home()).is_ok());
}

#[test]
fn a_limit_that_is_no_positive_number_is_refused() {
    let module = pyramid().module();
    let joints = module.inverse(&home()).expect("home");
    for limit in [-1.0, -1e-300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        module.set("residual-limit", limit);
        let mut world = home();
        let code = module.forward_into(&joints, &mut world);
        assert_eq!(code, Cause::ResidualLimitInvalid.code(), "{limit}");
        assert!(world[..5].iter().all(|v| v.is_nan()), "{world:?}");
        assert!(module.inverse(&home()).is_ok(), "{limit} concerns forward only");
    }
    module.set("residual-limit", 0.0);
    assert!(module.forward(&joints, &home()).is_ok());
}

/// Before homing all joints are 0 and do not contradict; a wrong limit is reported then too.
#[test]
fn a_wrong_limit_is_reported_before_homing() {
    let module = pyramid().module();
    module.set("residual-limit", f64::NAN);
    let code = module.forward_into(&[0.0; 16], &mut home());
    assert_eq!(code, Cause::ResidualLimitInvalid.code());
}

#[test]
fn where_legs_are_as_many_as_coordinates_the_limit_refuses_no_pose() {
    for subject in subjects().iter().filter(|s| s.name.ends_with("lathe")) {
        let module = subject.machine.module();
        module.set("residual-limit", 1e-300);
        let joints = module.inverse(&subject.home()).expect("home");
        assert!(module.forward(&joints, &subject.home()).is_ok(), "{}", subject.name);
    }
}

#[test]
fn of_eight_struts_the_one_that_is_off_is_named() {
    let machine = octopod();
    let module = machine.module();
    let home = machine.home.expect("given");
    let joints = module.inverse(&home).expect("home");
    for leg in 0..8 {
        for off in [8.0, -8.0] {
            let mut broken = joints;
            broken[leg] += off;
            let refused = Err(Cause::JointsInconsistent.code());
            assert_eq!(module.forward(&broken, &home), refused, "{leg} {off}");
            module.monitor();
            assert_eq!(module.get("fault-leg"), leg as f64, "{off}");
        }
    }
}

/// Such a large error that least squares nearly diverges: never reported as a problem of the solver's
/// settings.
#[test]
fn a_grossly_wrong_carriage_is_a_contradiction_too() {
    // Inverse of a module without a contradiction so far: it adds none to its joints.
    let (module, sound) = (pyramid().module(), pyramid().module());
    let mut random = Random::new(54);
    let (mut message, mut right, mut wrong) = (0, 0, 0);
    for leg in (0..4).cycle().take(cases(2_000)) {
        let pose = pyramid_pose(&mut random);
        let mut joints = sound.inverse(&pose).expect("a pose of the workspace");
        joints[leg] += random.within(150.0);
        let Err(code) = module.forward(&joints, &pose) else { continue };
        assert_ne!(code, Cause::NotConverged.code(), "{joints:?} from {pose:?}");
        if code == Cause::JointsInconsistent.code() {
            module.monitor();
            message += 1;
            let named = module.get("fault-leg");
            right += u32::from(named == leg as f64);
            wrong += u32::from(named != leg as f64 && named >= 0.0);
        }
    }
    println!("of {message} contradictions {right} are named rightly, {wrong} wrongly");
    assert!(right > 0 && wrong == 0, "{right} {wrong}");
}

/// Following errors of a moving machine: every carriage lags behind its position.
#[test]
fn following_errors_of_all_carriages_pass_and_blur_the_pose_no_more_than_themselves() {
    let (module, sound) = (pyramid().module(), pyramid().module());
    let mut random = Random::new(52);
    for _ in 0..cases(10_000) {
        let pose = pyramid_pose(&mut random);
        let mut joints = sound.inverse(&pose).expect("a pose of the workspace");
        for joint in &mut joints[..4] {
            *joint += random.within(0.5);
        }
        let found = module.forward(&joints, &pose).expect("half a millimeter each");
        // Z follows at most a carriage's error over the least rate, 1.3 (golden Jacobian);
        // at home they are its mean.
        assert!((found[2] - pose[2]).abs() <= 0.5, "{found:?} of {pose:?}");
    }
}

/// The result is the least sum of the squared misfits of the legs' lengths: every
/// neighboring pose has a larger one.
#[test]
fn the_pose_of_contradicting_joints_is_the_least_squares_one() {
    for subject in redundant() {
        let (module, sound) = (subject.machine.module(), subject.machine.module());
        module.set("residual-limit", subject.machine.size());
        let mut random = Random::new(53);
        for _ in 0..cases(300) {
            let pose = (subject.sample)(&mut random);
            let mut joints = sound.inverse(&pose).expect("a pose of the workspace");
            for joint in &mut joints[..subject.machine.legs.len()] {
                *joint += random.within(2.0);
            }
            let found = module.forward(&joints, &pose).expect("wide limit");
            let least = misfit(&subject.machine, &joints, &found);
            assert!(least > 0.0);
            for c in (0..6).filter(|c| is_of_legs(&subject.machine, *c)) {
                for step in [LEAST_SQUARES_STEP, -LEAST_SQUARES_STEP] {
                    let mut beside = found;
                    beside[c] += step;
                    let there = misfit(&subject.machine, &joints, &beside);
                    assert!(there > least, "{} {c} {step}: {there} {least}", subject.name);
                }
            }
        }
    }
}

fn is_of_legs(machine: &Parallel, coordinate: usize) -> bool {
    machine.coordinates.contains(["X", "Y", "Z", "A", "B", "C"][coordinate])
}

/// Returns the sum of the squared differences between the legs' lengths and their nominal ones.
fn misfit(machine: &Parallel, joints: &Joints, pose: &Pose) -> f64 {
    let of = |n: usize| {
        let length = match machine.legs[n].kind {
            Kind::Strut { .. } | Kind::Ring { .. } => joints[n],
            Kind::Slider { rod, .. } | Kind::Crank { rod, .. } => rod,
        };
        (norm(machine.span(pose, n, joints[n])) - length).powi(2)
    };
    (0..machine.legs.len()).map(of).sum()
}

/// Makes the calls of a cycle in joint mode: forward for feedback and command, no inverse.
fn joint_mode(module: &Module, joints: &Joints, poses: &mut [Pose; 2], period: i64) {
    for pose in poses {
        assert!(module.forward_into(joints, pose) >= 0, "joints that nearly fit");
    }
    module.monitor_in_cycle_of(period);
}

#[test]
fn joints_of_joint_mode_go_to_those_of_the_pose_as_slowly_as_they_can_stop_in_a_cycle() {
    let mut random = Random::new(431);
    for subject in redundant() {
        let machine = &subject.machine;
        for period in [250_000, 1_000_000, 2_000_000] {
            let (module, size) = (machine.module(), machine.size());
            let dt = period as f64 * 1e-9;
            // Per cycle 0.3 of the smaller limit, because LinuxCNC may change its mode in any cycle (the module's
            // `tool`).
            let (speed, acceleration) = (0.1 * size, 2.0 * size);
            for n in 0..machine.joints() {
                module.set(&format!("max-velocity.{n}"), speed);
                module.set(&format!("max-acceleration.{n}"), acceleration);
            }
            module.set("residual-limit", 0.01 * size);
            let most = 0.3 * speed.min(acceleration * dt) * dt;
            let home = (subject.sample)(&mut random);
            let fitting = module.inverse(&home).expect("a pose of the workspace");
            let mut joints = fitting;
            joints[1] += 100.0 * most;
            let mut poses = [home; 2];
            module.monitor_in_cycle_of(period);
            module.set("machine-on", 1.0);
            (0..5).for_each(|_| joint_mode(&module, &joints, &mut poses, period));
            // LinuxCNC's poses keep their addresses.
            let command = poses[1];
            // World mode: the joints start where they are, and end at those of the pose.
            let expected = machine.module().inverse(&command).expect("the pose found");
            let (mut before, mut cycles) = (joints, 0);
            while cycles < 1000 {
                assert!(module.forward_into(&before, &mut poses[0]) >= 0);
                let now = module.inverse(&command).expect("on the way");
                module.monitor_in_cycle_of(period);
                let steps = now.iter().zip(&before).map(|(a, b)| (a - b).abs());
                let step = steps.fold(0.0, f64::max);
                assert!(step <= most * (1.0 + 1e-6), "{}: {step} of {most}", subject.name);
                before = now;
                cycles += 1;
                if !module.is_on("feed-inhibit") {
                    break;
                }
            }
            for n in 0..machine.joints() {
                let off = (before[n] - expected[n]).abs();
                assert!(off <= most, "{}: joint {n} off by {off}", subject.name);
            }
            // The joint with the largest error determines the number of cycles.
            let all = joints.iter().zip(&expected).map(|(a, b)| (a - b).abs());
            let needed = all.fold(0.0, f64::max) / most;
            let range = needed.floor()..=needed + 3.0;
            assert!(range.contains(&f64::from(cycles)), "{}: {cycles} of {needed}", subject.name);
        }
    }
}

#[test]
fn joints_of_joint_mode_that_cannot_settle_are_refused_and_the_one_that_is_off_by_most_is_named() {
    let mut random = Random::new(432);
    for subject in redundant() {
        // Without limits the module does not know how slowly the joints have to settle.
        let (machine, size) = (&subject.machine, subject.machine.size());
        for off in [0.005 * size, -0.005 * size] {
            let module = machine.module();
            module.set("residual-limit", 0.01 * size);
            let home = (subject.sample)(&mut random);
            let mut joints = module.inverse(&home).expect("a pose of the workspace");
            joints[machine.legs.len() - 1] += off;
            let mut poses = [home; 2];
            module.monitor();
            module.set("machine-on", 1.0);
            (0..5).for_each(|_| joint_mode(&module, &joints, &mut poses, 1_000_000));
            let fitting = machine.module().inverse(&poses[1]).expect("the pose found");
            let away = |n: &usize| (joints[*n] - fitting[*n]).abs();
            let most = (0..machine.joints()).max_by(|a, b| away(a).total_cmp(&away(b)));
            let refused = Err(Cause::JointsInconsistent.code());
            assert_eq!(module.inverse(&poses[1]), refused, "{}", subject.name);
            module.monitor();
            assert_eq!(Some(module.get("fault-leg") as usize), most, "{}", subject.name);
        }
    }
}
