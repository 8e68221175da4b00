// SPDX-License-Identifier: GPL-2.0-or-later
//! Switchable kinematics: type 0 is the machine, type 1 moves joints by letters.

use abi_tests::geometry::distance;
use abi_tests::machines::paper_004;
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::subjects::{four_rod_lathe, octopod, pyramid};
use abi_tests::tolerances::{SAME_COMPONENT, WRONG_REL};
use kinematics::Cause;

const POSE: Pose = [10.0, -20.0, 260.0, 3.0, -4.0, 2.0, 0.0, 0.0, 0.0];
const HELD: [Cause; 6] =
    [Cause::HeldX, Cause::HeldY, Cause::HeldZ, Cause::HeldA, Cause::HeldB, Cause::HeldC];
const LETTERS: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];

fn types(module: &Module) -> [bool; 3] {
    [0, 1, 2].map(|kind| module.is_on(&format!("kinstype.is-{kind}")))
}

#[test]
fn the_kinstype_pins_follow_the_switch() {
    let module = paper_004().module();
    assert_eq!(types(&module), [true, false, false]);
    assert_eq!(module.switch(1), 0);
    assert_eq!(types(&module), [false, true, false]);
    assert_eq!(module.switch(0), 0);
    assert_eq!(types(&module), [true, false, false]);
}

#[test]
fn types_that_do_not_exist_are_refused_and_change_nothing() {
    let module = paper_004().module();
    let joints = module.inverse(&POSE);
    for from in [0, 1] {
        assert_eq!(module.switch(from), 0);
        let before = types(&module);
        for kind in [2, 3, -1, i32::MAX, i32::MIN] {
            assert_ne!(module.switch(kind), 0, "{kind}");
            assert_eq!(types(&module), before, "{kind}");
            assert_eq!(module.get("fault"), f64::from(Cause::KinematicsTypeUnknown.code()));
        }
    }
    module.monitor();
    let said = module.messages();
    assert_eq!(said.len(), 1, "one message, however often it was asked for: {said:?}");
    assert_eq!(said[0].level, 1, "an error, so that the operator sees it");
    assert_eq!(module.switch(0), 0);
    module.follow(&joints.expect("a pose of the workspace"), &POSE).expect("its own joints");
    assert_eq!(module.inverse(&POSE), joints);
}

/// KINSTYPE_IDENTITY and KINSTYPE_PRIMARY of LinuxCNC's kinematics.h, and a type that does not exist there.
const IDENTITY: i32 = 1;
const PRIMARY: i32 = 2;
const NONE: i32 = -1;

fn flags(module: &Module) -> [i32; 5] {
    [0, 1, 2, -1, i32::MAX].map(|kind| module.type_flags(kind))
}

#[test]
fn the_types_say_what_they_are_whichever_is_in_force() {
    let module = paper_004().module();
    for kind in [0, 1] {
        assert_eq!(module.switch(kind), 0);
        assert_eq!(flags(&module), [PRIMARY, IDENTITY, NONE, NONE, NONE]);
    }
    for machine in [pyramid(), octopod()] {
        assert_eq!(flags(&machine.module()), [PRIMARY, NONE, NONE, NONE, NONE]);
    }
}

#[test]
fn with_identityfirst_type_0_is_the_identity_and_type_1_the_machine() {
    let machine = paper_004();
    let expected = machine.module().inverse(&POSE).expect("a pose of the workspace");
    let module = Module::pkmkins(&[("sparm", "identityfirst")]);
    machine.wire(&module);
    module.apply();
    assert_eq!(flags(&module), [IDENTITY, PRIMARY, NONE, NONE, NONE]);
    assert_eq!(types(&module), [true, false, false]);
    let joints = module.inverse(&POSE).expect("identity knows no limit");
    assert_eq!(joints[..6], POSE[..6]);
    module.follow(&expected, &POSE).expect("joints are letters");
    assert_eq!(module.switch(1), 0, "{:?}", module.messages());
    assert_eq!(types(&module), [false, true, false]);
    assert_eq!(module.inverse(&POSE), Err(Cause::PoseUnknown.code()), "not before forward");
    let found = module.follow(&expected, &[0.0; 9]).expect("from the pose given as home");
    assert!(distance(&found, &POSE, machine.radius()) <= WRONG_REL * machine.size(), "{found:?}");
    assert_eq!(module.inverse(&POSE), Ok(expected));
    assert_eq!(module.switch(0), 0);
    assert_eq!(types(&module), [true, false, false]);
    assert_eq!(module.inverse(&POSE).map(|joints| joints[0]), Ok(POSE[0]));
    assert_ne!(module.switch(2), 0);
}

#[test]
fn identityfirst_is_refused_where_legs_exceed_coordinates() {
    let given =
        [("legs", "slider:4"), ("coordinates", "ZAB"), ("table", "XY"), ("sparm", "identityfirst")];
    let said = Module::try_pkmkins(&given).err().expect("refused").messages.join(" ");
    assert!(said.contains("sparm=identityfirst") && said.contains("coordinates"), "{said}");
}

/// Calls forward with a seed from LinuxCNC's home pose, not from joint values.
fn found_after(module: &Module) {
    let joints = paper_004().module().inverse(&POSE).expect("a pose of the workspace");
    let mut seed = POSE;
    seed[0] += 0.1;
    let found = module.follow(&joints, &seed).expect("a good seed");
    assert!((found[2] - POSE[2]).abs() < SAME_COMPONENT, "{found:?}");
}

#[test]
fn a_switch_before_any_pose_is_known_does_not_block_forward() {
    for reference in [true, false] {
        let mut machine = paper_004();
        machine.home = machine.home.filter(|_| reference);
        let module = Module::pkmkins(&[]);
        machine.wire(&module);
        assert_eq!(module.switch(1), 0);
        assert_eq!(module.switch(0), 0);
        found_after(&module);
    }
}

#[test]
fn a_geometry_applied_after_a_switch_starts_from_the_seed_again() {
    for reference in [true, false] {
        let mut machine = paper_004();
        machine.home = machine.home.filter(|_| reference);
        let module = machine.module();
        found_after(&module);
        assert_eq!(module.switch(1), 0);
        assert_eq!(module.switch(0), 0);
        module.apply();
        found_after(&module);
    }
}

#[test]
fn identity_gives_each_joint_the_letter_at_its_place_in_coordinates() {
    for coordinates in ["XYZABC", "CBAZYX", "zxybca"] {
        let module = Module::pkmkins(&[("coordinates", coordinates)]);
        paper_004().wire(&module);
        module.apply();
        assert_eq!(module.switch(1), 0);
        let joints = module.inverse(&POSE).expect("identity knows no limit");
        let mut pose = [0.0; 9];
        for (joint, letter) in coordinates.to_uppercase().chars().enumerate() {
            let at = LETTERS.iter().position(|l| l.starts_with(letter)).expect("a letter");
            assert_eq!(joints[joint], POSE[at], "{coordinates} joint {joint}");
            pose[at] = joints[joint];
        }
        assert_eq!(module.follow(&joints, &[0.0; 9]), Ok(pose), "{coordinates}");
    }
}

#[test]
fn the_order_of_letters_means_nothing_to_the_machine() {
    let reference = paper_004().module().inverse(&POSE);
    let module = Module::pkmkins(&[("coordinates", "CBAZYX")]);
    paper_004().wire(&module);
    module.apply();
    assert_eq!(module.inverse(&POSE), reference);
}

#[test]
fn identity_refuses_what_is_not_finite() {
    let module = paper_004().module();
    assert_eq!(module.switch(1), 0);
    let mut pose = POSE;
    pose[4] = f64::NAN;
    let mut joints = [7.0; 16];
    assert!(module.inverse_into(&pose, &mut joints) < 0);
    assert_eq!(joints, [7.0; 16]);
    let mut world = POSE;
    assert!(module.forward_into(&[f64::INFINITY; 16], &mut world) < 0);
    assert!(world[..6].iter().all(|v| v.is_nan()), "{world:?}");
}

/// After a switch LinuxCNC's seeds contain joint values: both of the
/// next forward calls, feedback and command, need the last good pose of type 0.
#[test]
fn back_from_identity_both_forward_calls_find_the_pose_again() {
    let machine = paper_004();
    let module = machine.module();
    let joints: Joints = module.inverse(&POSE).expect("a pose of the workspace");
    // The same two variables in every cycle, as in LinuxCNC's status.
    let mut worlds = [POSE, POSE];
    let mut cycle = |what: &str| {
        for world in &mut worlds {
            assert_eq!(module.forward_into(&joints, world), 0, "{what}");
        }
        worlds
    };
    cycle("before");
    assert_eq!(module.switch(1), 0);
    cycle("identity");
    assert_eq!(module.switch(0), 0);
    for pose in cycle("after") {
        let apart = distance(&pose, &POSE, machine.radius());
        assert!(apart <= WRONG_REL * machine.size(), "{pose:?}");
    }
}

#[test]
fn switching_to_the_type_that_is_on_already_keeps_the_seed() {
    let machine = paper_004();
    let module = machine.module();
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    module.follow(&joints, &POSE).expect("its own joints");
    assert_eq!(module.switch(0), 0);
    let pose = module.follow(&joints, &POSE).expect("its own joints");
    assert!(distance(&pose, &POSE, machine.radius()) <= WRONG_REL * machine.size());
}

/// Its four carriages move three coordinates: no letter belongs to a carriage.
#[test]
fn identity_is_refused_where_legs_exceed_coordinates_and_changes_nothing() {
    for machine in [pyramid(), octopod()] {
        let module = machine.module();
        let home = machine.home.expect("given");
        let joints = module.inverse(&home).expect("home");
        module.clear_messages();
        for _ in 0..3 {
            assert_eq!(module.switch(1), Cause::IdentityImpossible.code());
            assert_eq!(types(&module), [true, false, false]);
            assert_eq!(module.get("fault"), f64::from(Cause::IdentityImpossible.code()));
        }
        module.monitor();
        let said = module.messages();
        assert_eq!(said.len(), 1, "one message, however often it was asked for: {said:?}");
        assert!(said[0].text.contains(Cause::IdentityImpossible.text()), "{said:?}");
        assert_eq!(module.inverse(&home), Ok(joints));
        assert_eq!(module.switch(0), 0);
        assert!(module.follow(&joints, &home).is_ok());
    }
}

/// Without the monitor nothing else reports it.
#[test]
fn without_the_monitor_a_refused_identity_is_reported_at_once() {
    let machine = pyramid();
    let module = machine.loaded();
    machine.wire(&module);
    module.inverse(&machine.home.expect("given")).expect("home");
    assert_eq!(module.switch(1), Cause::IdentityImpossible.code());
    assert_eq!(module.messages().len(), 1, "{:?}", module.messages());
}

/// Joint j is the j-th letter of `coordinates`, followed by the letters of `table`; forward
/// returns 0 for letters without a joint, and inverse refuses any other value there.
#[test]
fn identity_of_fewer_coordinates_follows_the_letters_and_then_the_table() {
    let mut three = pyramid();
    three.legs.pop();
    let tables = ["XY", "YX"].map(|table| Parallel { table, ..three.clone() });
    let lathes =
        ["XYZB", "BZYX", "YBXZ"].map(|coordinates| Parallel { coordinates, ..four_rod_lathe() });
    for machine in tables.into_iter().chain(lathes) {
        let module = machine.loaded();
        machine.wire(&module);
        assert_eq!(module.switch(1), 0, "{}", machine.coordinates);
        let letters: Vec<usize> = machine
            .coordinates
            .chars()
            .chain(machine.table.chars())
            .map(|letter| LETTERS.iter().position(|l| l.starts_with(letter)).expect("a letter"))
            .collect();
        let held: Vec<usize> = (0..6).filter(|c| !letters.contains(c)).collect();
        assert_refuses_held(&module, &held);
        let mut pose = POSE;
        for letter in &held {
            pose[*letter] = 0.0;
        }
        let mut joints = [7.0; 16];
        assert_eq!(module.inverse_into(&pose, &mut joints), 0);
        for (joint, letter) in letters.iter().enumerate() {
            assert_eq!(joints[joint], POSE[*letter], "{} joint {joint}", machine.coordinates);
        }
        assert!(joints[letters.len()..].iter().all(|guard| *guard == 7.0));
        let mut seed = [11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0];
        let mut expected = pose;
        expected[6..].copy_from_slice(&seed[6..]);
        assert_eq!(module.forward_into(&joints, &mut seed), 0);
        assert_eq!(seed, expected, "{}", machine.coordinates);
        let jacobian = module.jacobian(&joints, &POSE).expect("identity knows no limit");
        for (joint, row) in jacobian.iter().enumerate() {
            for (column, value) in row.iter().enumerate() {
                let is_letter = letters.get(joint) == Some(&column);
                assert_eq!(*value, f64::from(u8::from(is_letter)), "[{joint}][{column}]");
            }
        }
    }
}

/// Checks that each constant letter is refused with its own code, and that rounding of work offsets passes.
fn assert_refuses_held(module: &Module, held: &[usize]) {
    for letter in held {
        for (value, refuse) in [(1.0, true), (-1e-3, true), (1e-12, false), (-0.0, false)] {
            let mut pose = [0.0; 9];
            pose[*letter] = value;
            let mut joints = [7.0; 16];
            let code = module.inverse_into(&pose, &mut joints);
            let expected = if refuse { HELD[*letter].code() } else { 0 };
            assert_eq!(code, expected, "{} {value}", LETTERS[*letter]);
            assert!(!refuse || joints == [7.0; 16]);
        }
    }
}

#[test]
fn a_lathe_comes_back_from_identity_with_its_pose() {
    let machine = four_rod_lathe();
    let module = machine.module();
    let pose: Pose = [50.0, 430.0, 900.0, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0];
    let joints = module.inverse(&pose).expect("a pose of the workspace");
    let mut world = pose;
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert_eq!(module.switch(1), 0);
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert_eq!(world[..3], joints[..3], "X Y Z now hold joint values");
    assert_eq!(module.switch(0), 0);
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert!(distance(&world, &pose, machine.radius()) <= WRONG_REL * machine.size(), "{world:?}");
}

/// LinuxCNC's motion controller with the kinematics, for drives that follow exactly.
struct Controller<'a> {
    module: &'a Module,
    /// LinuxCNC's poses of feedback and command.
    worlds: [Pose; 2],
    joints: Joints,
}

impl<'a> Controller<'a> {
    fn at(module: &'a Module, pose: &Pose) -> Self {
        let joints = module.inverse(pose).expect("a pose of the workspace");
        let mut controller = Self { module, worlds: [*pose; 2], joints };
        assert_eq!(controller.cycle(pose), 0);
        controller
    }

    /// Runs a cycle in world mode: forward of the feedback, inverse of the command; returns its code.
    fn cycle(&mut self, command: &Pose) -> i32 {
        self.worlds[1] = *command;
        let [feedback, command] = &mut self.worlds;
        self.module.forward_into(&self.joints, feedback);
        self.module.inverse_into(command, &mut self.joints)
    }

    /// Requests other kinematics; if they are refused LinuxCNC does not change the commanded pose, and
    /// it ignores the result of forward.
    fn switch(&mut self, kind: i32) -> i32 {
        let code = self.module.switch(kind);
        if code == 0 {
            self.module.forward_into(&self.joints, &mut self.worlds[1]);
        }
        code
    }
}

/// A strut of this length closes no platform with the others of [`POSE`].
const TOO_SHORT: f64 = 390.0;

#[test]
fn a_switch_back_where_the_joints_close_no_platform_is_refused_and_changes_nothing() {
    let module = paper_004().module();
    let mut controller = Controller::at(&module, &POSE);
    let start = controller.joints;
    assert_eq!(controller.switch(1), 0);
    let mut command = controller.worlds[1];
    while command[2] > TOO_SHORT {
        command[2] -= 0.5;
        assert_eq!(controller.cycle(&command), 0);
    }
    let (joints, faults) = (controller.joints, module.get("fault-count"));
    let code = controller.switch(0);
    assert!(code < 0, "the switch was made");
    assert_eq!(module.get("fault"), f64::from(code));
    assert_eq!(module.get("fault-count"), faults + 1.0);
    assert_eq!(types(&module), [false, true, false]);
    module.monitor();
    let text = module.messages().pop().expect("a message").text;
    assert!(text.contains(&format!("[code {code}]")), "{text}");
    // The joints stay, and the operator moves them back.
    assert_eq!(controller.cycle(&command), 0);
    assert_eq!(controller.joints, joints);
    while command[2] < start[2] - 20.0 {
        command[2] += 0.5;
        assert_eq!(controller.cycle(&command), 0);
    }
    assert_eq!(controller.switch(0), 0);
    let pose = controller.worlds[1];
    let before = controller.joints;
    assert_eq!(controller.cycle(&pose), 0);
    let moved = controller.joints.iter().zip(before).map(|(a, b)| (a - b).abs());
    assert!(moved.fold(0.0, f64::max) < SAME_COMPONENT, "the joints jumped: {pose:?}");
}

/// In the cycle of the switch an end point may have been requested: it is not the joints' position.
#[test]
fn a_switch_back_looks_at_the_commanded_joints_and_not_at_end_points_of_queued_moves() {
    let module = paper_004().module();
    let mut controller = Controller::at(&module, &POSE);
    assert_eq!(controller.switch(1), 0);
    let command = controller.worlds[1];
    assert_eq!(controller.cycle(&command), 0);
    let mut end = command;
    end[2] = TOO_SHORT;
    assert!(module.inverse(&end).is_ok());
    assert_eq!(controller.switch(0), 0);
}

#[test]
fn after_a_switch_back_inverse_refuses_until_forward_has_found_a_pose() {
    for drop_in in [false, true] {
        let mut machine = paper_004();
        machine.home = machine.home.filter(|_| !drop_in);
        let module = if drop_in {
            let module = Module::pkmkins(&[]);
            machine.wire(&module);
            module
        } else {
            machine.module()
        };
        let joints = module.inverse(&POSE).expect("a pose of the workspace");
        assert_eq!(module.switch(1), 0);
        assert_eq!(module.switch(0), 0);
        let refused = Err(Cause::PoseUnknown.code());
        assert_eq!(module.inverse(&POSE), refused);
        let mut bad = joints;
        bad[2] = TOO_SHORT;
        assert!(module.follow(&bad, &POSE).is_err());
        assert_eq!(module.inverse(&POSE), refused);
        assert!(module.follow(&joints, &POSE).is_ok());
        assert_eq!(module.inverse(&POSE), Ok(joints));
    }
}

/// Before homing LinuxCNC does not know the joints: a switch does not depend on them.
#[test]
fn before_homing_the_kinematics_may_be_switched_there_and_back() {
    for boxes in [0, 1] {
        let machine = Parallel::from(paper_004());
        let module = machine.loaded_with_boxes(boxes);
        machine.wire(&module);
        let mut world = [0.0; 9];
        for joints in [[0.0; 16], [7.0; 16]] {
            assert_eq!(module.switch(1), 0);
            assert_eq!(module.forward_into(&joints, &mut world), 0);
            assert_eq!(module.switch(0), 0, "{joints:?}");
            assert_eq!(types(&module), [true, false, false]);
        }
    }
}

/// The seed of the first forward then contains joint values.
#[test]
fn a_machine_homed_in_identity_kinematics_is_found_from_its_reference_pose() {
    let machine = paper_004();
    let module = machine.module();
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    assert_eq!(module.switch(1), 0);
    let mut world = [0.0; 9];
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert_eq!(module.switch(0), 0);
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert!(distance(&world, &POSE, machine.radius()) <= WRONG_REL * machine.size(), "{world:?}");
}
