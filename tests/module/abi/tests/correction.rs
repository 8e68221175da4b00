// SPDX-License-Identifier: GPL-2.0-or-later
//! Corrections of joints while the machine runs.

use abi_tests::machines::paper_004;
use abi_tests::module::{ALL_IS_SHOWN, Module, Pose};
use kinematics::Cause;

const POSE: Pose = [10.0, -20.0, 260.0, 12.0, -5.0, 0.0, 0.0, 0.0, 0.0];
/// Period of the monitor, seconds.
const PERIOD: f64 = 1e-3;
/// Accuracy of forward: its convergence criterion.
const FORWARD_MM: f64 = 1e-9;

/// Returns a machine at a pose, whose strut 2 may be corrected by 0.1 mm at 1 mm/s.
fn corrected() -> Module {
    let module = paper_004().module();
    module.set("correction-limit.2", 0.1);
    module.set("correction-rate.2", 1.0);
    cycle(&module);
    module
}

/// Runs a cycle at the pose and returns its joints.
fn cycle(module: &Module) -> [f64; 16] {
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    let found = module.forward(&joints, &POSE).expect("its own joints");
    for (a, b) in found.iter().zip(POSE) {
        assert!((a - b).abs() < FORWARD_MM, "{found:?}");
    }
    let _ = module.inverse(&POSE);
    module.monitor();
    joints
}

#[test]
fn it_comes_into_effect_at_its_rate_and_the_pose_stays() {
    let module = corrected();
    let before = cycle(&module);
    module.set("joint-correction.2", 0.1);
    for n in 1..=120 {
        module.monitor();
        let joints = cycle(&module);
        // The monitor has run 2 n - 1 times, each for one period at 1 mm/s.
        let wanted = (f64::from(2 * n - 1) * PERIOD).min(0.1);
        assert!((joints[2] - before[2] - wanted).abs() < 1e-12, "{n}: {}", joints[2] - before[2]);
        for i in [0, 1, 3, 4, 5] {
            assert_eq!(joints[i], before[i]);
        }
    }
    assert_eq!(module.get("joint-correction-eff.2"), 0.1);
    module.set("joint-correction.2", 0.0);
    (0..120).for_each(|_| module.monitor());
    assert_eq!(cycle(&module), before);
}

#[test]
fn without_a_limit_nothing_is_corrected() {
    let module = paper_004().module();
    let before = cycle(&module);
    module.set("joint-correction.2", 0.1);
    module.set("correction-rate.2", 1.0);
    (0..10).for_each(|_| module.monitor());
    assert_eq!(cycle(&module), before);
    assert_eq!(module.get("fault"), 0.0);
}

#[test]
fn what_is_beyond_the_limit_or_no_number_is_refused_and_the_last_one_stays() {
    for bad in [0.2, -0.11, 1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let module = corrected();
        let before = cycle(&module);
        module.set("joint-correction.2", 0.05);
        (0..100).for_each(|_| module.monitor());
        module.set("joint-correction.2", bad);
        (0..100).for_each(|_| module.monitor());
        assert_eq!(module.get("fault"), f64::from(Cause::CorrectionBeyond.code()), "{bad}");
        assert_eq!(module.get("fault-leg"), 2.0);
        assert!((cycle(&module)[2] - before[2] - 0.05).abs() < 1e-12, "{bad}");
    }
}

#[test]
fn a_limit_or_a_rate_that_is_none_moves_nothing_at_once() {
    let module = corrected();
    let before = cycle(&module);
    module.set("joint-correction.2", 0.1);
    (0..200).for_each(|_| module.monitor());
    for bad in [f64::NAN, -1.0, f64::INFINITY] {
        module.set("correction-rate.2", bad);
        module.set("joint-correction.2", -0.1);
        module.monitor();
        assert!((cycle(&module)[2] - before[2] - 0.1).abs() < 1e-12, "{bad}");
    }
    module.set("correction-rate.2", 1.0);
    // Without a limit it returns at its rate.
    module.set("correction-limit.2", f64::NAN);
    module.monitor();
    assert!((cycle(&module)[2] - before[2] - 0.099).abs() < 1e-12);
    (0..200).for_each(|_| module.monitor());
    assert_eq!(cycle(&module), before);
}

#[test]
fn the_range_of_the_joint_keeps_room_for_it() {
    let module = corrected();
    let joint = cycle(&module)[2];
    module.set("min-limit.2", joint - 5.0);
    module.set("max-limit.2", joint + 50.0);
    (0..ALL_IS_SHOWN).for_each(|_| {
        cycle(&module);
    });
    assert!((module.get("margin.2") - 4.9).abs() < 1e-9, "{}", module.get("margin.2"));
}
