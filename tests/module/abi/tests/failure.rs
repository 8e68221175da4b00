// SPDX-License-Identifier: GPL-2.0-or-later
//! Invalid input: always a code, nothing moved, nothing lost, no message from the
//! servo thread's kinematics calls.

use abi_tests::control::controls;
use abi_tests::geometry::distance;
use abi_tests::machines::{PAPER_004_HOME, paper_004};
use abi_tests::module::{Columns, Joints, Module, Pose};
use abi_tests::tolerances::WRONG_REL;
use kinematics::{Cause, MAX_ITERATIONS};

const NOT_FINITE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
const SEED: Pose = [10.0, -20.0, 260.0, 3.0, -4.0, 2.0, 0.25, 0.5, 0.75];
const NO_POSE: Pose = [f64::NAN; 9];

fn assert_same_pose(found: &Pose, expected: &Pose) {
    let machine = paper_004();
    let apart = distance(found, expected, machine.radius());
    assert!(apart <= WRONG_REL * machine.size(), "{found:?} is not {expected:?}");
}

/// Returns the values of all pins except the fault record, to show that a call did not change them.
fn pins_but_faults(module: &Module) -> Vec<(String, u64)> {
    let pins = module.pins().into_iter().filter(|pin| !pin.name.contains(".fault"));
    pins.map(|pin| (pin.name.clone(), pin.get().to_bits())).collect()
}

fn assert_marked_unusable(pose: &Pose, before: &Pose) {
    assert!(pose[..6].iter().all(|v| v.is_nan()), "x to c must be NaN: {pose:?}");
    assert_eq!(pose[6..], before[6..], "u v w are not the module's");
}

#[test]
fn the_calls_before_homing_fail_and_leave_no_trace() {
    // LinuxCNC calls forward with all joints 0 and seed 0 until the joints are configured.
    for wired in [false, true] {
        let module = Module::pkmkins(&[]);
        if wired {
            paper_004().wire(&module);
        }
        module.monitor();
        let before: Vec<_> = module.pins().iter().map(|p| p.get().to_bits()).collect();
        for _ in 0..65 {
            let mut world = [0.0; 9];
            assert!(module.forward_into(&[0.0; 16], &mut world) < 0);
            module.monitor();
        }
        let after: Vec<_> = module.pins().iter().map(|p| p.get().to_bits()).collect();
        assert_eq!(after, before);
        assert_eq!(module.messages().len(), 0, "{:?}", module.messages());
    }
}

#[test]
fn joints_of_zero_after_freezing_are_no_reason_for_alarm_either() {
    // Seeds as LinuxCNC passes them before homing: zeros first, then [TRAJ]HOME. NaN instead
    // would reach its planner.
    for seed in [[0.0; 9], PAPER_004_HOME] {
        let module = paper_004().module();
        for _ in 0..65 {
            let mut world = seed;
            assert!(module.forward_into(&[0.0; 16], &mut world) < 0);
            assert_eq!(world, seed);
            module.monitor();
        }
        assert_eq!(module.get("fault-count"), 0.0);
        assert!(!module.is_on("fwd-kins-fail"));
        assert_eq!(module.messages().len(), 0, "{:?}", module.messages());
    }
}

#[test]
fn no_fault_floods_the_operator() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    module.follow(&joints, &SEED).expect("its own joints");
    module.clear_messages();
    module.set("fault-reset", 1.0);
    for cycle in 0..900 {
        // Another joint in every cycle, so that no two successive faults are equal.
        let mut broken = joints;
        broken[cycle % 6] = f64::NAN;
        assert!(module.forward_into(&broken, &mut SEED.clone()) < 0);
        let mut far = SEED;
        far[cycle % 6] = f64::NAN;
        assert!(module.inverse_into(&far, &mut [0.0; 16]) < 0);
        module.monitor();
    }
    let said = module.messages();
    assert!((1..=4).contains(&said.len()), "{} messages", said.len());
}

#[test]
fn a_fault_is_reported_again_after_a_quiet_period() {
    let module = paper_004().module();
    let refuse = || {
        let mut pose = SEED;
        pose[0] = f64::NAN;
        assert!(module.inverse_into(&pose, &mut [0.0; 16]) < 0);
        module.monitor();
    };
    module.clear_messages();
    refuse();
    refuse();
    assert_eq!(module.messages().len(), 1);
    for _ in 0..1000 {
        module.monitor();
    }
    refuse();
    assert_eq!(module.messages().len(), 2);
}

#[test]
fn a_machine_whose_joints_are_zero_at_home_is_found_there() {
    let machine = paper_004();
    let module = machine.module();
    let home = module.inverse(&PAPER_004_HOME).expect("home");
    for leg in 0..6 {
        module.set(&format!("offset.{leg}"), home[leg]);
    }
    module.apply();
    let found = module.follow(&[0.0; 16], &PAPER_004_HOME).expect("home, at joints of zero");
    assert_same_pose(&found, &PAPER_004_HOME);
}

#[test]
fn joints_of_zero_after_a_pose_was_known_are_a_failure() {
    let module = paper_004().module();
    let joints = module.inverse(&PAPER_004_HOME).expect("home");
    module.follow(&joints, &PAPER_004_HOME).expect("home");
    let mut world = PAPER_004_HOME;
    assert_eq!(module.forward_into(&[0.0; 16], &mut world), Cause::JointNotPositive.code());
    assert!(world[..6].iter().all(|v| v.is_nan()), "{world:?}");
}

#[test]
fn inverse_refuses_a_pose_that_is_not_finite_and_leaves_the_joints_alone() {
    let module = paper_004().module();
    for component in 0..6 {
        for value in NOT_FINITE {
            let mut pose = SEED;
            pose[component] = value;
            let mut joints = [7.0; 16];
            let code = module.inverse_into(&pose, &mut joints);
            assert_eq!(code, Cause::PoseNotFinite.code(), "{pose:?}");
            assert_eq!(joints, [7.0; 16], "{pose:?}");
        }
    }
}

#[test]
fn coordinates_the_machine_has_not_can_not_poison_its_joints() {
    let module = paper_004().module();
    let clean = module.inverse(&SEED).expect("a pose of the workspace");
    for component in 6..9 {
        for value in NOT_FINITE {
            let mut pose = SEED;
            pose[component] = value;
            let mut joints = [7.0; 16];
            match module.inverse_into(&pose, &mut joints) {
                0 => assert_eq!(joints[..6], clean[..6], "{pose:?}"),
                _ => assert_eq!(joints, [7.0; 16], "{pose:?}"),
            }
        }
    }
}

#[test]
fn inverse_writes_six_joints_and_nothing_behind_them() {
    let module = paper_004().module();
    let mut joints = [7.0; 16];
    assert_eq!(module.inverse_into(&SEED, &mut joints), 0);
    assert!(joints[..6].iter().all(|j| *j > 390.0));
    assert_eq!(joints[6..], [7.0; 10]);
}

#[test]
fn forward_leaves_u_v_w_alone_when_it_succeeds() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    let pose = module.follow(&joints, &SEED).expect("its own joints");
    assert_eq!(pose[6..], SEED[6..]);
}

#[test]
fn angles_beyond_a_million_degrees_are_refused() {
    let module = paper_004().module();
    for component in 3..6 {
        let mut pose = SEED;
        pose[component] = 1.1e6;
        assert_eq!(module.inverse(&pose), Err(Cause::AngleTooLarge.code()), "{pose:?}");
    }
}

#[test]
fn a_pose_that_closes_a_strut_is_refused_by_leg() {
    let machine = paper_004();
    let module = machine.module();
    let mut pose = [0.0; 9];
    for (k, value) in pose.iter_mut().enumerate().take(3) {
        *value = machine.base[4][k] - machine.platform[4][k];
    }
    assert_eq!(module.inverse(&pose), Err(Cause::StrutTooShort.code()));
    module.monitor();
    assert_eq!(module.get("fault-leg"), 4.0);
}

#[test]
fn forward_refuses_joints_that_are_not_finite_and_marks_the_pose() {
    let module = paper_004().module();
    let good = module.inverse(&SEED).expect("a pose of the workspace");
    for joint in 0..6 {
        for value in NOT_FINITE {
            let mut joints = good;
            joints[joint] = value;
            let mut world = SEED;
            let code = module.forward_into(&joints, &mut world);
            assert_eq!(code, Cause::JointNotFinite.code(), "joint {joint} {value}");
            assert_marked_unusable(&world, &SEED);
            module.monitor();
            assert_eq!(module.get("fault-leg"), joint as f64);
        }
    }
}

#[test]
fn joints_of_other_machines_do_not_matter() {
    let module = paper_004().module();
    let mut joints = module.inverse(&SEED).expect("a pose of the workspace");
    joints[6..].fill(f64::NAN);
    let pose = module.follow(&joints, &SEED).expect("its own six joints");
    assert_same_pose(&pose, &SEED);
}

#[test]
fn joints_that_close_no_platform_are_refused_and_the_pose_is_marked() {
    let module = paper_004().module();
    let good = module.inverse(&SEED).expect("a pose of the workspace");
    // Far too long, far too short, negative, and one strut shorter than its neighbors allow.
    let bad = |joint: usize, value: f64| {
        let mut joints = good;
        joints[joint] = value;
        joints
    };
    for joints in [bad(0, 5000.0), bad(3, 1.0), bad(5, -900.0), bad(2, 390.0), bad(1, 0.0)] {
        for seed in [SEED, PAPER_004_HOME] {
            let mut world = seed;
            assert!(module.forward_into(&joints, &mut world) < 0, "{joints:?} gave {world:?}");
            assert_marked_unusable(&world, &seed);
        }
    }
}

#[test]
fn huge_and_tiny_numbers_are_refused_or_solved_but_never_poison() {
    let module = paper_004().module();
    for value in [f64::MAX, f64::MIN, f64::MIN_POSITIVE, 1e300, -1e300, 1e-320] {
        for component in 0..6 {
            let mut pose = SEED;
            pose[component] = value;
            let mut joints = [7.0; 16];
            match module.inverse_into(&pose, &mut joints) {
                0 => assert!(joints[..6].iter().all(|j| j.is_finite()), "{pose:?}: {joints:?}"),
                _ => assert_eq!(joints, [7.0; 16], "{pose:?}"),
            }
            let mut seed = SEED;
            seed[component] = value;
            let good = module.inverse(&SEED).expect("a pose of the workspace");
            if let Ok(found) = module.follow(&good, &seed) {
                assert!(found.iter().all(|v| v.is_finite()), "seed {seed:?}: {found:?}");
            }
        }
    }
}

#[test]
fn forward_goes_on_from_the_last_good_pose_when_the_seed_is_nan() {
    let module = paper_004().module();
    let good = module.inverse(&SEED).expect("a pose of the workspace");
    module.follow(&good, &SEED).expect("its own joints");
    let mut world = SEED;
    assert!(module.forward_into(&[f64::NAN; 16], &mut world) < 0);
    // LinuxCNC passes its result on: the next call's seed is the NaN of the failure.
    let mut next = SEED;
    next[0] += 0.5;
    let joints = module.inverse(&next).expect("a pose of the workspace");
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert_same_pose(&world, &next);
    assert_eq!(world[6..], SEED[6..]);
}

#[test]
fn feedback_and_command_both_recover_from_nan_seeds() {
    // In joint mode the two are called in turn, each with a separate pose, with a
    // following error between them.
    let module = paper_004().module();
    let mut behind = SEED;
    behind[2] -= 2.0;
    let expected = [SEED, behind];
    let joints = expected.map(|p| module.inverse(&p).expect("a pose of the workspace"));
    // The same two variables in every cycle, as in LinuxCNC's status.
    let mut worlds = expected;
    for cycle in 0..3 {
        if cycle > 0 {
            worlds = [NO_POSE; 2];
        }
        for ((joints, world), pose) in joints.iter().zip(&mut worlds).zip(expected) {
            assert_eq!(module.forward_into(joints, world), 0);
            assert_same_pose(world, &pose);
        }
    }
}

#[test]
fn a_nan_seed_with_no_earlier_pose_is_refused_or_answered_rightly() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    let mut world = NO_POSE;
    match module.forward_into(&joints, &mut world) {
        code if code < 0 => assert!(world[..6].iter().all(|v| v.is_nan()), "{world:?}"),
        _ => assert_same_pose(&world, &SEED),
    }
}

#[test]
fn infinite_seeds_are_no_seeds() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    module.follow(&joints, &SEED).expect("its own joints");
    for component in 0..6 {
        let mut seed = SEED;
        seed[component] = f64::INFINITY;
        let mut world = seed;
        if module.forward_into(&joints, &mut world) < 0 {
            assert_marked_unusable(&world, &seed);
        } else {
            assert_same_pose(&world, &SEED);
        }
    }
}

#[test]
fn limit_iterations_outside_its_range_is_refused() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    let most = f64::from(MAX_ITERATIONS);
    for limit in [0.0, most + 1.0, f64::from(u32::MAX)] {
        module.set("limit-iterations", limit);
        let mut world = SEED;
        let code = module.forward_into(&joints, &mut world);
        assert_eq!(code, Cause::LimitIterationsInvalid.code(), "{limit}");
        assert_marked_unusable(&world, &SEED);
    }
    for limit in [1.0, 2.0, most] {
        module.set("limit-iterations", limit);
        let result = module.follow(&joints, &SEED);
        assert!(result.is_ok() || result == Err(Cause::TooManyIterations.code()), "{result:?}");
    }
}

#[test]
fn solver_knobs_are_live_and_checked() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    for criterion in [f64::NAN, f64::INFINITY, -1.0] {
        module.set("convergence-criterion", criterion);
        let result = module.follow(&joints, &SEED);
        assert_eq!(result, Err(Cause::CriterionInvalid.code()), "{criterion}");
    }
    module.set("convergence-criterion", 1e-9);
    assert!(module.follow(&joints, &SEED).is_ok());
}

#[test]
fn max_error_is_accepted_and_makes_no_large_machine_fail() {
    let module = paper_004().module();
    let mut pose = SEED;
    pose[2] += 100.0;
    let joints = module.inverse(&pose).expect("a pose of the workspace");
    for value in [0.0, -1.0, f64::NAN, 1e-9, 500.0] {
        module.set("max-error", value);
        assert_same_pose(&module.follow(&joints, &PAPER_004_HOME).expect("solves"), &pose);
    }
}

#[test]
fn kinematics_calls_use_neither_hal_nor_rtapi_and_print_nothing() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    let before = module.hal_calls();
    for pose in [SEED, NO_POSE] {
        let _ = module.inverse(&pose);
        let _ = module.follow(&joints, &pose);
        let _ = module.follow(&[-1.0; 16], &pose);
        let _ = module.jacobian(&joints, &pose);
    }
    assert_eq!(module.hal_calls(), before);
}

#[test]
fn inverse_leaves_every_pin_but_the_fault_record_alone() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    module.follow(&joints, &SEED).expect("its own joints");
    let before = pins_but_faults(&module);
    let mut other = SEED;
    other[0] = -50.0;
    for pose in [other, NO_POSE] {
        let _ = module.inverse(&pose);
        assert_eq!(pins_but_faults(&module), before);
    }
}

#[test]
fn inverse_is_independent_of_earlier_calls() {
    let module = paper_004().module();
    let first = module.inverse(&SEED);
    for other in [PAPER_004_HOME, NO_POSE, [50.0; 9]] {
        let _ = module.inverse(&other);
        assert_eq!(module.inverse(&SEED), first);
    }
}

#[test]
fn a_fault_is_counted_named_printed_once_and_reset() {
    let module = paper_004().module();
    assert!(module.inverse(&NO_POSE).is_err());
    module.monitor();
    assert_eq!(module.get("fault") as i32, Cause::PoseNotFinite.code());
    assert_eq!(module.get("fault-count"), 1.0);
    module.monitor();
    let messages = module.messages();
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert!(messages[0].text.contains(Cause::PoseNotFinite.text()), "{messages:?}");
    assert!(messages[0].text.contains(Cause::PoseNotFinite.remedy()), "{messages:?}");
    module.set("fault-reset", 1.0);
    module.monitor();
    assert_eq!(module.get("fault"), 0.0);
    assert_eq!(module.get("fault-leg"), -1.0);
}

#[test]
fn a_failure_repeated_every_cycle_does_not_flood_the_log() {
    let module = paper_004().module();
    for _ in 0..1000 {
        let mut world = SEED;
        assert!(module.forward_into(&[-1.0; 16], &mut world) < 0);
        module.monitor();
    }
    assert!(module.messages().len() <= 2, "{} messages", module.messages().len());
}

#[test]
fn forward_writes_the_pins_people_look_at() {
    let module = paper_004().module();
    let joints: Joints = module.inverse(&SEED).expect("a pose of the workspace");
    let pose = module.follow(&joints, &SEED).expect("its own joints");
    module.monitor_until_all_is_shown();
    for (axis, value) in ["x", "y", "z", "a", "b", "c"].into_iter().zip(pose) {
        assert_eq!(module.get(axis), value);
    }
    assert!(!module.is_on("fwd-kins-fail"));
    assert!(module.get("last-iterations") >= 1.0);
    assert!(module.get("max-iterations") >= module.get("last-iterations"));
    assert!(module.get("residual") <= module.get("convergence-criterion"));
    assert_eq!(module.get("assembly").abs(), 1.0);
    assert!((0..6).any(|leg| module.get(&format!("correction.{leg}")) != 0.0));
    let mut world = SEED;
    assert!(module.forward_into(&[-1.0; 16], &mut world) < 0);
    module.monitor();
    assert!(module.is_on("fwd-kins-fail"));
    module.follow(&joints, &NO_POSE).expect("from the last good pose");
    module.monitor();
    assert!(!module.is_on("fwd-kins-fail"));
}

/// LinuxCNC passes the NaN of a refused forward to inverse when it is switched off and on again.
#[test]
fn the_nan_of_a_refused_forward_is_not_reported_as_a_fault_of_the_program() {
    let module = paper_004().module();
    let joints = module.inverse(&SEED).expect("a pose of the workspace");
    module.follow(&joints, &SEED).expect("its own joints");
    let mut bad = joints;
    bad[2] = 390.0;
    let mut world = SEED;
    let code = module.forward_into(&bad, &mut world);
    assert!(code < 0);
    assert_eq!(module.inverse(&world), Err(Cause::PoseNotFinite.code()));
    module.monitor();
    assert_eq!(module.get("fault"), f64::from(code));
    assert_eq!((module.get("fault-count"), module.messages().len()), (1.0, 1));
    // A pose from another source is reported again once inverse was called with a good one.
    module.inverse(&SEED).expect("a pose of the workspace");
    assert_eq!(module.inverse(&NO_POSE), Err(Cause::PoseNotFinite.code()));
    assert_eq!(module.get("fault"), f64::from(Cause::PoseNotFinite.code()));
}

#[test]
fn the_tool_of_identity_kinematics_stands_upright_for_all_joint_values() {
    let module = paper_004().module();
    assert_eq!(module.switch(1), 0);
    let upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for joints in [[0.0; 16], [30.0; 16], [-500.0; 16]] {
        assert_eq!(module.tool_frame(&joints), Ok(upright));
    }
}

/// Returns whether the columns are orthonormal, within the rounding of a product of a few rotations.
fn are_orthonormal(columns: &Columns) -> bool {
    let dot = |a: usize, b: usize| (0..3).map(|k| columns[a][k] * columns[b][k]).sum::<f64>();
    let pairs = (0..3).flat_map(|a| (0..3).map(move |b| (a, b)));
    pairs.into_iter().all(|(a, b)| (dot(a, b) - f64::from(u8::from(a == b))).abs() < 1e-12)
}

#[test]
fn a_joint_that_is_no_number_never_gives_a_frame_of_nan() {
    for control in controls() {
        let (module, home, name) = (control.module(), control.home(), control.name());
        let joints = module.inverse(&home).expect("the reference pose");
        module.forward(&joints, &home).expect("its own joints");
        let frames = |joints: &Joints| [module.tool_frame(joints), module.work_frame(joints)];
        for frame in frames(&joints) {
            assert!(frame.is_ok_and(|columns| are_orthonormal(&columns)), "{name}: {frame:?}");
        }
        for (joint, value) in
            (0..control.joints()).flat_map(|joint| NOT_FINITE.map(|value| (joint, value)))
        {
            let mut bad = joints;
            bad[joint] = value;
            let [tool, work] = frames(&bad);
            assert_eq!(tool, Err(-1), "{name}: joint {joint} is {value}");
            // No joint rotates the workpiece of a single machine: it is fixed to the base.
            let is_refused = work == Err(-1) || work.is_ok_and(|columns| are_orthonormal(&columns));
            assert!(is_refused, "{name}: joint {joint} is {value}: {work:?}");
        }
    }
}
