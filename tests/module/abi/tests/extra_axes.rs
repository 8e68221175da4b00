// SPDX-License-Identifier: GPL-2.0-or-later
//! Extra axes: joints after those of legs and table that pass their coordinate through.

use abi_tests::module::{Module, Pose};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, subjects};
use kinematics::{Cause, POSE_LETTERS};

/// Returns letters of a pose that neither legs nor table of a machine move, in an order other than
/// LinuxCNC's.
fn free_letters(subject: &Subject) -> Vec<usize> {
    (0..POSE_LETTERS.len()).rev().filter(|k| *k > 5 || !subject.machine.moves(*k)).collect()
}

fn with_axes(subject: &Subject, axes: &[usize]) -> Module {
    let letters: String = axes.iter().map(|k| POSE_LETTERS[*k]).collect();
    let module = subject.machine.loaded_with(&[("axes", &letters)]);
    assert!(subject.machine.apply(&module), "{}: {:?}", subject.name, module.messages());
    module
}

/// Returns a pose of the workspace whose other coordinates are not 0.
fn with_values(pose: Pose, axes: &[usize], random: &mut Random) -> Pose {
    let mut pose = pose;
    for k in axes {
        pose[*k] = random.within(500.0);
    }
    pose
}

#[test]
fn every_machine_passes_them_through_and_is_itself_as_without_them() {
    let mut random = Random::new(71);
    for subject in subjects() {
        let axes = free_letters(&subject);
        let (plain, module) = (subject.machine.module(), with_axes(&subject, &axes));
        let count = subject.machine.joints();
        for _ in 0..cases(100) {
            let pose = (subject.sample)(&mut random);
            let given = with_values(pose, &axes, &mut random);
            let expected = plain.inverse(&pose).expect("a pose of the workspace");
            let joints = module.inverse(&given).expect("the same with other axes");
            assert_eq!(joints[..count], expected[..count], "{} at {given:?}", subject.name);
            for (i, k) in axes.iter().enumerate() {
                assert_eq!(joints[count + i], given[*k], "{} at {given:?}", subject.name);
            }
            let found = module.forward(&joints, &given).expect("its own joints");
            let mut of_plain = plain.forward(&expected, &pose).expect("its own joints");
            axes.iter().for_each(|k| of_plain[*k] = given[*k]);
            assert_eq!(found, of_plain, "{}", subject.name);
        }
    }
}

#[test]
fn letters_that_are_no_axis_stay_refused_or_alone() {
    let subject = lathe();
    let module = with_axes(&subject, &[5, 8]);
    let mut pose = subject.home();
    [pose[5], pose[6], pose[8]] = [30.0, 12.0, -7.0];
    let joints = module.inverse(&pose).expect("C and W are axes, and U is not checked");
    assert_eq!(module.forward(&joints, &pose).expect("its own joints")[6], 12.0);
    pose[3] = 1.0;
    assert_eq!(module.inverse(&pose), Err(Cause::HeldA.code()));
}

#[test]
fn what_is_no_number_is_refused_with_its_joint_and_changes_nothing() {
    let subject = lathe();
    let module = with_axes(&subject, &[5, 8]);
    let count = subject.machine.joints();
    let good = with_values(subject.home(), &[5, 8], &mut Random::new(72));
    let joints = module.inverse(&good).expect("the reference pose");
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for k in [5, 8] {
            let mut bad = good;
            bad[k] = value;
            let mut untouched = [4.0; 16];
            assert_eq!(module.inverse_into(&bad, &mut untouched), Cause::PoseNotFinite.code());
            assert_eq!(untouched, [4.0; 16]);
        }
        for i in [count, count + 1] {
            let mut bad = joints;
            bad[i] = value;
            let mut world = good;
            assert_eq!(module.forward_into(&bad, &mut world), Cause::JointNotFinite.code());
            assert!(world[0].is_nan(), "LinuxCNC must stop");
            assert_eq!(module.get("fault-leg"), i as f64);
            assert!(module.is_on("fwd-kins-fail"));
        }
        assert_eq!(
            module.forward(&joints, &good).map(|pose| [pose[5], pose[8]]),
            Ok([good[5], good[8]])
        );
        assert!(!module.is_on("fwd-kins-fail"));
    }
}

/// Two corrections are sufficient from the last pose, but not from the reference pose.
#[test]
fn forward_goes_on_from_the_last_pose_after_a_cycle_with_one_that_is_no_number() {
    let subject = lathe();
    let module = with_axes(&subject, &[5, 8]);
    let mut world = subject.home();
    let mut joints = [0.0; 16];
    let target = (subject.sample)(&mut Random::new(73));
    for step in 1..=300 {
        let share = f64::from(step) / 300.0;
        let home = subject.home();
        world = std::array::from_fn(|k| home[k] + share * (target[k] - home[k]));
        joints = module.inverse(&world).expect("within the workspace");
        assert_eq!(module.forward_into(&joints, &mut world), 0);
        module.monitor();
    }
    module.set("limit-iterations", 2.0);
    let mut bad = joints;
    bad[subject.machine.joints()] = f64::NAN;
    let mut of_linuxcnc = world;
    assert_eq!(module.forward_into(&bad, &mut of_linuxcnc), Cause::JointNotFinite.code());
    module.monitor();
    let mut of_linuxcnc = subject.home();
    assert_eq!(module.forward_into(&joints, &mut of_linuxcnc), 0);
}

#[test]
fn the_identity_kinematics_pass_them_through_as_well() {
    let subject = lathe();
    let module = with_axes(&subject, &[8, 5]);
    let count = subject.machine.joints();
    let pose = with_values(subject.home(), &[5, 8], &mut Random::new(73));
    module.inverse(&pose).expect("the reference pose");
    assert_eq!(module.switch(1), 0);
    let joints = module.inverse(&pose).expect("every letter has a joint");
    assert_eq!(joints[count..count + 2], [pose[8], pose[5]]);
    assert_eq!(module.forward(&joints, &pose), Ok(pose));
}

#[test]
fn the_jacobian_has_a_row_for_each() {
    let subject = lathe();
    let module = with_axes(&subject, &[8, 5]);
    let count = subject.machine.joints();
    let pose = with_values(subject.home(), &[5, 8], &mut Random::new(74));
    let joints = module.inverse(&pose).expect("the reference pose");
    let plain = subject.machine.module();
    plain.inverse(&subject.home()).expect("the reference pose");
    let mut expected = plain.jacobian(&joints, &subject.home()).expect("regular");
    // The rotation of the platform in its C is constant: the axis C is a different coordinate.
    expected.iter_mut().for_each(|row| row[5] = 0.0);
    [expected[count][8], expected[count + 1][5]] = [1.0, 1.0];
    assert_eq!(module.jacobian(&joints, &pose), Ok(expected));
}

fn lathe() -> Subject {
    let mut all = subjects().into_iter();
    all.find(|subject| subject.name == "four-rod lathe").expect("one of the machines")
}
