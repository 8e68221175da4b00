// SPDX-License-Identifier: GPL-2.0-or-later
//! Coordinates that a machine does not move, and table axes that move others.

use abi_tests::geometry::{cross, distance, dot, norm, unit};
use abi_tests::module::{Module, Pose};
use abi_tests::parallel::{Kind, LETTERS, Parallel};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, pyramid, pyramid_pose, subjects};
use abi_tests::tolerances::{INVERSE_REL, ROUND_TRIP_REL, SAME_COMPONENT, SAME_JOINT_MM};
use kinematics::Cause;

const HELD: [Cause; 6] =
    [Cause::HeldX, Cause::HeldY, Cause::HeldZ, Cause::HeldA, Cause::HeldB, Cause::HeldC];

/// Returns every machine with constant coordinates, including one with constant translations.
fn holding() -> Vec<Subject> {
    let without_table = Parallel { table: "", ..pyramid() };
    let sample = |random: &mut Random| {
        let mut pose = pyramid_pose(random);
        pose[..2].fill(0.0);
        // With constant X and Y, a tilt is about the center: the tip moves along them.
        pose[3..].fill(0.0);
        pose
    };
    let mut all: Vec<Subject> = subjects()
        .into_iter()
        .filter(|subject| (0..6).any(|c| !subject.machine.moves(c)))
        .collect();
    all.push(Subject { name: "pyramid without table", machine: without_table, sample });
    all
}

fn held(machine: &Parallel) -> Vec<usize> {
    (0..6).filter(|c| !machine.moves(*c)).collect()
}

#[test]
fn inverse_refuses_a_held_coordinate_by_its_letter_and_leaves_the_joints_alone() {
    let mut letters = [0; 6];
    for subject in holding() {
        let module = subject.machine.module();
        let good = (subject.sample)(&mut Random::new(41));
        module.inverse(&good).expect("a pose of the workspace");
        for coordinate in held(&subject.machine) {
            letters[coordinate] += 1;
            let unit = if coordinate < 3 { subject.machine.size() } else { 1.0 };
            for value in [1e-6, -1e-6, 1.0, -30.0] {
                let mut pose = good;
                pose[coordinate] = value * unit;
                let mut joints = [7.0; 16];
                let code = module.inverse_into(&pose, &mut joints);
                assert_eq!(code, HELD[coordinate].code(), "{}: {pose:?}", subject.name);
                assert_eq!(joints, [7.0; 16], "{}", subject.name);
                module.monitor();
                assert_eq!(module.get("fault-leg"), -1.0);
            }
            for value in [f64::NAN, f64::INFINITY] {
                let mut pose = good;
                pose[coordinate] = value;
                assert_eq!(module.inverse(&pose), Err(Cause::PoseNotFinite.code()));
            }
        }
    }
    // X and Y by the machine without its table; Z by none.
    assert!([0, 1, 3, 4, 5].iter().all(|c| letters[*c] > 0), "{letters:?}");
}

/// Rounding of a pose that LinuxCNC interpolates must not stop or move the machine.
#[test]
fn a_held_coordinate_that_is_0_but_for_rounding_changes_no_bit() {
    for subject in holding() {
        let module = subject.machine.module();
        let good = (subject.sample)(&mut Random::new(42));
        let joints = module.inverse(&good).expect("a pose of the workspace");
        for coordinate in held(&subject.machine) {
            let unit = if coordinate < 3 { subject.machine.size() } else { 1.0 };
            for value in [1e-10, -1e-10, -0.0] {
                let mut pose = good;
                pose[coordinate] = value * unit;
                assert_eq!(module.inverse(&pose), Ok(joints), "{}: {pose:?}", subject.name);
            }
        }
    }
}

#[test]
fn forward_writes_0_to_held_coordinates_for_any_seed() {
    for subject in holding() {
        let module = subject.machine.module();
        let pose = (subject.sample)(&mut Random::new(43));
        let joints = module.inverse(&pose).expect("a pose of the workspace");
        let found = module.forward(&joints, &pose).expect("its own joints");
        for value in [0.0, 5.0, -1e3, 1e300, f64::NAN, f64::INFINITY] {
            let mut seed = pose;
            for coordinate in held(&subject.machine) {
                seed[coordinate] = value;
            }
            let code = module.forward_into(&joints, &mut seed);
            assert_eq!(code, 0, "{}: from {value}", subject.name);
            let from = seed;
            for coordinate in held(&subject.machine) {
                assert_eq!(from[coordinate].to_bits(), 0, "{}: {from:?}", subject.name);
            }
            let apart = distance(&from, &found, subject.machine.radius());
            assert!(apart <= ROUND_TRIP_REL * subject.machine.size(), "{}: {value}", subject.name);
        }
    }
}

#[test]
fn a_refused_forward_spoils_only_the_coordinates_that_move() {
    for subject in subjects() {
        let module = subject.machine.module();
        let pose = (subject.sample)(&mut Random::new(44));
        let mut joints = module.inverse(&pose).expect("a pose of the workspace");
        joints[1] = f64::NAN;
        let mut world = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
        let before = world;
        assert_eq!(module.forward_into(&joints, &mut world), Cause::JointNotFinite.code());
        for c in 0..9 {
            if c < 6 && subject.machine.moves(c) {
                assert!(world[c].is_nan(), "{}: {world:?}", subject.name);
            } else {
                assert_eq!(world[c], before[c], "{}: {world:?}", subject.name);
            }
        }
    }
}

#[test]
fn a_refused_inverse_of_held_coordinates_is_no_fault_of_the_next_call() {
    let module = pyramid().module();
    let pose = pyramid().home.expect("given");
    let joints = module.inverse(&pose);
    let mut turned = pose;
    turned[5] = 1.0;
    assert_eq!(module.inverse(&turned), Err(Cause::HeldC.code()));
    assert_eq!(module.inverse(&pose), joints);
    module.monitor();
    let said: String = module.messages().into_iter().map(|m| m.text).collect();
    assert!(said.contains(Cause::HeldC.text()), "'{said}'");
}

/// Independent equations: every leg has the length of its rod or its
/// joint value, and is on its side; every table axis has its component of the point.
#[test]
fn joints_satisfy_the_equations_of_their_legs_and_of_the_table() {
    for subject in subjects() {
        let module = subject.machine.module();
        let machine = &subject.machine;
        let allowed = INVERSE_REL * machine.size();
        let mut random = Random::new(45);
        for _ in 0..cases(2_000) {
            let pose = (subject.sample)(&mut random);
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            for n in 0..machine.legs.len() {
                let message = format!("{} leg {n} at {pose:?}", subject.name);
                assert_leg(machine, n, &pose, joints[n], allowed, &message);
            }
            let point = machine.point(&pose);
            for (i, letter) in machine.table.chars().enumerate() {
                let k = ['X', 'Y', 'Z'].iter().position(|l| *l == letter).expect("a letter");
                let off = (joints[machine.legs.len() + i] - point[k]).abs();
                assert!(off <= allowed, "{}: table {letter} at {pose:?}", subject.name);
            }
        }
    }
}

fn assert_leg(machine: &Parallel, n: usize, pose: &Pose, joint: f64, allowed: f64, message: &str) {
    let leg = &machine.legs[n];
    let span = machine.span(pose, n, joint);
    let (length, side) = match leg.kind {
        // The correction of a lead is compared with genhexkins.
        Kind::Strut { lead, .. } if lead != 0.0 => return,
        Kind::Strut { .. } | Kind::Ring { .. } => (joint, None),
        Kind::Slider { rod, side, .. } | Kind::Crank { rod, side, .. } => (rod, Some(side)),
    };
    assert!((norm(span) - length).abs() <= allowed, "{message}: {} not {length}", norm(span));
    if let (Some(side), Some(motion)) = (side, leg.motion(joint)) {
        assert!(f64::from(side) * dot(unit(span), motion) < 0.0, "{message}: on the other side");
    }
}

#[test]
fn a_table_letter_moves_its_joint_alone_and_in_the_same_sense() {
    let module = pyramid().module();
    let home = pyramid().home.expect("given");
    let at_home = module.inverse(&home).expect("home");
    for (letter, joint) in [(0, 4), (1, 5)] {
        for value in [12.5, -150.0, 1e4] {
            let mut pose = home;
            pose[letter] = value;
            let joints = module.inverse(&pose).expect("the table has no end here");
            let mut expected = at_home;
            expected[joint] = value;
            assert_eq!(joints, expected, "{} {value}", LETTERS[letter]);
            let found = module.forward(&joints, &home).expect("however far the table");
            assert_eq!(found[letter], value, "{found:?}");
        }
    }
}

/// The letters of `table` are joints in the given order.
#[test]
fn table_letters_in_another_order_are_joints_in_another_order() {
    let pose: Pose = [30.0, -40.0, 280.0, 5.0, -6.0, 0.0, 0.0, 0.0, 0.0];
    let xy = pyramid().module().inverse(&pose).expect("a pose of the workspace");
    let yx = Parallel { table: "YX", ..pyramid() }.module().inverse(&pose);
    let yx = yx.expect("a pose of the workspace");
    assert_eq!(yx[..4], xy[..4]);
    assert_eq!((yx[4], yx[5]), (xy[5], xy[4]));
}

/// A tilt about the center does not move the table: with the tool tip there, A and B
/// move no table.
#[test]
fn a_tilt_about_the_centre_moves_the_table_by_the_tips_way() {
    let tilt: Pose = [0.0, 0.0, 270.0, 0.0, 20.0, 0.0, 0.0, 0.0, 0.0];
    let joints = pyramid().module().inverse(&tilt).expect("a pose of the workspace");
    let way = 150.0 * 20_f64.to_radians().sin();
    assert!((joints[4] - way).abs() <= SAME_JOINT_MM, "{} {way}", joints[4]);
    assert_eq!(joints[5], 0.0);
    // A tool of −150 moves the tip to the center.
    let at_centre = Parallel { tool: [0.0, 0.0, -150.0], ..pyramid() };
    let joints = at_centre.module().inverse(&tilt).expect("a pose of the workspace");
    assert!(joints[4].abs() <= SAME_JOINT_MM, "{}", joints[4]);
}

#[test]
fn without_a_table_a_tilt_may_not_move_the_tip_in_held_coordinates_but_the_centre() {
    // X and Y are constant: they are the tip's, and 0 in a legal pose.
    let machine = Parallel { table: "", centre: [0.0; 3], ..pyramid() };
    let module = machine.module();
    let pose: Pose = [0.0, 0.0, 270.0, 10.0, -12.0, 0.0, 0.0, 0.0, 0.0];
    let joints = module.inverse(&pose).expect("a pose of the workspace");
    let found = module.forward(&joints, &machine.home.expect("given")).expect("its own joints");
    for (one, other) in found.iter().zip(pose) {
        assert!((one - other).abs() <= SAME_COMPONENT, "{found:?}");
    }
}

#[test]
fn a_table_joint_that_is_not_finite_is_refused_by_its_number() {
    let machine = pyramid();
    let module = machine.module();
    let home = machine.home.expect("given");
    let good = module.inverse(&home).expect("home");
    for joint in [4, 5] {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut joints = good;
            joints[joint] = value;
            let mut world = home;
            let code = module.forward_into(&joints, &mut world);
            assert_eq!(code, Cause::JointNotFinite.code(), "joint {joint} {value}");
            assert!(world[..5].iter().all(|v| v.is_nan()), "{world:?}");
            assert_eq!(world[5], home[5], "C is held");
            module.monitor();
            assert_eq!(module.get("fault-leg"), joint as f64);
        }
    }
}

/// A tool change moves no joint of a level machine, with or without a table, and is refused at a tilt
/// if the joints have no limits.
#[test]
fn tool_offsets_act_on_a_table_machine_as_on_any() {
    let level: Pose = [20.0, 30.0, 300.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let tilted: Pose = [20.0, 30.0, 300.0, 8.0, -5.0, 0.0, 0.0, 0.0, 0.0];
    for pin in ["tool-offset", "tool-offset-x", "tool-offset-y"] {
        let module = pyramid().module();
        module.set("machine-on", 1.0);
        let at = |pose: &Pose, module: &Module| {
            let joints = module.inverse(pose).expect("a pose of the workspace");
            module.follow(&joints, pose).expect("its own joints");
            let _ = module.inverse(pose);
            module.monitor();
            joints
        };
        let before = at(&level, &module);
        module.set(pin, 25.0);
        module.monitor();
        let after = at(&level, &module);
        for (one, other) in before.iter().zip(after) {
            assert!((one - other).abs() <= SAME_JOINT_MM, "{pin}: {one} {other}");
        }
        let with_tool = at(&tilted, &module);
        module.set(pin, 0.0);
        at(&tilted, &module);
        let refused = module.inverse(&tilted);
        assert_eq!(refused, Err(Cause::ToolChangedTilted.code()), "{pin}");
        module.set(pin, 25.0);
        assert_eq!(module.inverse(&tilted), Ok(with_tool), "{pin} set back");
    }
}

/// The axis of a crank and the direction of its arm are right-handed: a positive angle
/// rotates the arm toward axis × arm.
#[test]
fn crank_angles_are_right_handed_degrees_from_the_arm_as_given() {
    let subject = subjects().into_iter().find(|s| s.name == "rotary delta").expect("there");
    let module = subject.machine.module();
    // Elbow 25 degrees below outward, the foot below it by shin geometry.
    let leg = &subject.machine.legs[0];
    let Kind::Crank { axis, arm, rod, .. } = leg.kind else { panic!("a crank") };
    let elbow = abi_tests::geometry::plus(leg.base, leg.displacement(25.0));
    assert!(elbow[2] < 0.0 && dot(cross(axis, arm), [0.0, 0.0, 1.0]) < 0.0, "down is positive");
    let across = elbow[1] - leg.platform[1];
    let pose: Pose =
        [0.0, 0.0, elbow[2] - (rod * rod - across * across).sqrt(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let joints = module.inverse(&pose).expect("a pose below the base");
    for joint in &joints[..3] {
        assert!((joint - 25.0).abs() <= SAME_JOINT_MM, "{joints:?}");
    }
}
