// SPDX-License-Identifier: GPL-2.0-or-later
//! Rods on carriages and cranks: the ends of their reach, their dead points, the other
//! side of each, and invalid geometries.

use abi_tests::geometry::Vector;
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::{Kind, Leg, Parallel, wire_vector};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{
    Subject, four_rod_lathe, linear_delta, pose, pyramid, rods, rotary_delta, six_rod_lathe,
    subjects,
};
use abi_tests::tolerances::{SAME_COMPONENT, WRONG_REL};
use kinematics::Cause;

fn at(x: f64, y: f64, z: f64) -> Pose {
    pose([x, y, z, 0.0, 0.0, 0.0])
}

fn sample_rotary() -> Parallel {
    Parallel { home: Some(at(0.0, 0.0, -12.0)), ..rotary_delta(10.0, 10.0, 18.0, 5.0) }
}

/// A machine, a path out of its reach, and the leg that ends it.
type WayOut = (Parallel, fn(f64) -> Pose, f64);

fn ways_out() -> Vec<WayOut> {
    vec![
        (four_rod_lathe(), |s| at(150.0 * s, 450.0 + 150.0 * s, 1000.0), 2.0),
        (four_rod_lathe(), |s| at(-150.0 * s, 450.0 + 150.0 * s, 1000.0), 0.0),
        (six_rod_lathe(), |s| at(-110.0 * s, 450.0 + 60.0 * s, 1000.0), 2.0),
        (linear_delta(163.25, 33.0, 269.0), |s| at(0.0, -250.0 * s, 40.0), 0.0),
        (linear_delta(163.25, 33.0, 269.0), |s| at(220.0 * s, 127.0 * s, 40.0), 1.0),
        (sample_rotary(), |s| at(0.0, 3.0 * s, -12.0 - 18.0 * s), 0.0),
        (sample_rotary(), |s| at(-3.0 * s, -1.5 * s, -12.0 - 18.0 * s), 1.0),
    ]
}

#[test]
fn on_the_way_out_comes_the_dead_point_and_then_the_end_of_reach_named_by_leg() {
    for (machine, way, leg) in ways_out() {
        let module = machine.module();
        let mut order = Vec::new();
        for step in 0..=2_000 {
            let pose = way(f64::from(step) / 2_000.0);
            let mut joints = [7.0; 16];
            let code = module.inverse_into(&pose, &mut joints);
            if code != 0 {
                assert_eq!(joints, [7.0; 16], "{pose:?}");
                module.monitor();
                assert_eq!(module.get("fault-leg"), leg, "{pose:?} of {machine:?}");
            }
            if order.last() != Some(&code) {
                order.push(code);
            }
            // Further out other legs do not reach, either.
            if code == Cause::OutOfReach.code() {
                break;
            }
        }
        let expected = [0, Cause::DeadPoint.code(), Cause::OutOfReach.code()];
        assert_eq!(order, expected, "{machine:?}");
    }
}

#[test]
fn forward_over_a_dead_point_or_beyond_reach_is_refused_and_leaves_no_pose() {
    for (machine, way, _) in ways_out() {
        let module = machine.module();
        // The last pose for which inverse returns joints, with its carriages driven further equally.
        let reached: Vec<(Pose, Joints)> = (0..2_000)
            .map(|step| way(f64::from(step) / 2_000.0))
            .map_while(|pose| Some((pose, module.inverse(&pose).ok()?)))
            .collect();
        let (seed, joints) = reached[reached.len() - 1];
        let (_, before) = reached[reached.len() - 50];
        let mut refused = 0;
        for far in 1..=60 {
            let beyond: Joints =
                std::array::from_fn(|n| joints[n] + f64::from(far) * (joints[n] - before[n]) / 5.0);
            let mut world = seed;
            match module.forward_into(&beyond, &mut world) {
                0 => assert!(belongs(&module, &machine, &beyond, &world), "{world:?}"),
                _ => {
                    refused += 1;
                    assert!(world[..3].iter().all(|v| v.is_nan()), "{world:?}");
                    module.monitor();
                    let held_up = [
                        Cause::DeadPoint,
                        Cause::PathStalled,
                        Cause::NearlySingular,
                        Cause::JointAngleTooLarge,
                    ];
                    let code = module.get("fault") as i32;
                    assert!(held_up.iter().any(|cause| cause.code() == code), "{code}");
                }
            }
        }
        assert!(refused > 0, "{machine:?}");
    }
}

/// Returns whether a pose has these joints, by inverse.
fn belongs(module: &Module, machine: &Parallel, joints: &Joints, pose: &Pose) -> bool {
    module.inverse(pose).is_ok_and(|own| {
        let legs = own.iter().zip(joints).zip(&machine.legs);
        let off = legs.map(|((own, given), leg)| match leg.kind {
            Kind::Crank { .. } => (own - given).abs() / 180.0,
            _ => (own - given).abs() / machine.size(),
        });
        off.fold(0.0, f64::max) <= WRONG_REL
    })
}

/// The other position of a carriage, or of an arm, under the same platform.
#[test]
fn joints_of_another_side_are_never_answered_with_the_pose_they_would_fit() {
    for subject in with_rods() {
        let module = subject.machine.module();
        let mut random = Random::new(71);
        let (mut refused, mut crossed) = (0, 0);
        for _ in 0..cases(500) {
            let pose = (subject.sample)(&mut random);
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            for (n, leg) in subject.machine.legs.iter().enumerate() {
                let anchor = subject.machine.anchor(&pose, n);
                let Some(other) = leg.other_side(anchor, joints[n]) else { continue };
                let mut broken = joints;
                broken[n] = other;
                match module.forward(&broken, &pose) {
                    Err(_) => refused += 1,
                    Ok(found) => {
                        crossed += 1;
                        let message = format!("{} leg {n}: {found:?}", subject.name);
                        assert!(belongs(&module, &subject.machine, &broken, &found), "{message}");
                    }
                }
            }
        }
        println!("{}: {refused} refused, {crossed} have a pose on their own side", subject.name);
        assert!(refused > 0, "{}", subject.name);
    }
}

fn with_rods() -> Vec<Subject> {
    let is_rod = |leg: &Leg| !matches!(leg.kind, Kind::Strut { .. } | Kind::Ring { .. });
    subjects().into_iter().filter(|s| s.machine.legs.iter().any(is_rod)).collect()
}

/// Random joints from the ranges of the workspace and beyond: a returned pose is
/// theirs, and on the right side of every rod.
#[test]
fn of_random_joints_none_is_answered_with_a_pose_of_others() {
    for subject in rods().into_iter().filter(|s| !s.name.starts_with("pyramid")) {
        let module = subject.machine.module();
        let mut random = Random::new(72);
        let ranges = ranges(&subject, &module);
        let (mut answered, mut refused) = (0, 0);
        for _ in 0..cases(5_000) {
            let mut joints = [0.0; 16];
            for (joint, (low, high)) in joints.iter_mut().zip(&ranges) {
                let beyond = 0.2 * (high - low);
                *joint = random.between(low - beyond, high + beyond);
            }
            match module.forward(&joints, &subject.home()) {
                Err(_) => refused += 1,
                Ok(found) => {
                    answered += 1;
                    let message = format!("{}: {joints:?} gave {found:?}", subject.name);
                    assert!(belongs(&module, &subject.machine, &joints, &found), "{message}");
                }
            }
        }
        println!("{}: {answered} answered, {refused} refused", subject.name);
        assert!(answered > 0 && refused > 0, "{}", subject.name);
    }
}

/// Returns the smallest and largest joints of random poses.
fn ranges(subject: &Subject, module: &Module) -> Vec<(f64, f64)> {
    let mut random = Random::new(73);
    let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); subject.machine.joints()];
    for _ in 0..1_000 {
        let pose = (subject.sample)(&mut random);
        let joints = module.inverse(&pose).expect("a pose of the workspace");
        for (range, joint) in ranges.iter_mut().zip(joints) {
            *range = (range.0.min(joint), range.1.max(joint));
        }
    }
    ranges
}

/// Changes of one pin that make a slider machine invalid.
const BAD_SLIDERS: &[(&str, f64, Cause, i32)] = &[
    ("rod.2", 0.0, Cause::RodNotPositive, 2),
    ("rod.3", -550.0, Cause::RodNotPositive, 3),
    ("rod.1", f64::NAN, Cause::GeometryNotFinite, 1),
    ("rod.0", f64::INFINITY, Cause::GeometryNotFinite, 0),
    ("rod.2", 100.0, Cause::OutOfReach, 2),
    ("side.0", 0.0, Cause::SideInvalid, 0),
    ("side.3", 2.0, Cause::SideInvalid, 3),
    ("side.1", -2.0, Cause::SideInvalid, 1),
    ("guide.1.z", f64::NAN, Cause::GeometryNotFinite, 1),
    ("guide.2.x", f64::NEG_INFINITY, Cause::GeometryNotFinite, 2),
    ("base.3.y", f64::NAN, Cause::GeometryNotFinite, 3),
    ("platform.0.z", f64::NAN, Cause::GeometryNotFinite, 0),
    ("offset.2", f64::NAN, Cause::GeometryNotFinite, 2),
    ("centre.z", f64::NAN, Cause::CentreNotFinite, -1),
    ("centre.x", f64::INFINITY, Cause::CentreNotFinite, -1),
    ("home.z", f64::NAN, Cause::HomeNotFinite, -1),
    ("home.c", 5.0, Cause::HomeHeld, -1),
    ("spindle-offset", f64::NAN, Cause::ToolNotFinite, -1),
    ("rod.2", 1e160, Cause::LengthTooLarge, 2),
    ("base.1.x", 1e300, Cause::LengthTooLarge, 1),
    ("offset.3", 1e17, Cause::OffsetTooLarge, 3),
    ("centre.z", 1e9, Cause::CentreTooFar, -1),
    ("spindle-offset", -1e12, Cause::ToolTooLong, -1),
];

const BAD_CRANKS: &[(&str, f64, Cause, i32)] = &[
    ("rod.1", 0.0, Cause::RodNotPositive, 1),
    ("rod.0", -18.0, Cause::RodNotPositive, 0),
    ("rod.2", 1.0, Cause::OutOfReach, 2),
    ("rod.2", 100.0, Cause::OutOfReach, 2),
    ("side.2", 0.0, Cause::SideInvalid, 2),
    ("side.0", 7.0, Cause::SideInvalid, 0),
    ("axis.1.x", f64::NAN, Cause::GeometryNotFinite, 1),
    ("arm.2.z", f64::INFINITY, Cause::GeometryNotFinite, 2),
    ("offset.0", f64::INFINITY, Cause::GeometryNotFinite, 0),
    ("centre.y", f64::NAN, Cause::CentreNotFinite, -1),
    ("home.a", 1.0, Cause::HomeHeld, -1),
    ("arm.1.x", 1e160, Cause::LengthTooLarge, 1),
    ("offset.2", -1.1e6, Cause::OffsetTooLarge, 2),
];

#[test]
fn a_bad_value_is_refused_by_leg_and_the_last_good_geometry_stays() {
    for (machine, bad) in [(pyramid(), BAD_SLIDERS), (sample_rotary(), BAD_CRANKS)] {
        for (pin, value, cause, leg) in bad {
            let change = |module: &Module| module.set(pin, *value);
            assert_refused(&machine, &format!("{pin} {value}"), &change, *cause, *leg);
        }
    }
}

#[test]
fn vectors_without_a_direction_are_refused_by_leg() {
    let vector = |name: &'static str, n: usize, value: Vector| {
        move |module: &Module| wire_vector(module, name, n, value)
    };
    let none = [0.0; 3];
    let slider = |change: &dyn Fn(&Module), cause, leg| {
        assert_refused(&pyramid(), "guide", change, cause, leg);
    };
    slider(&vector("guide", 3, none), Cause::GuideZero, 3);
    slider(&vector("guide", 0, [-0.0; 3]), Cause::GuideZero, 0);
    let crank = |change: &dyn Fn(&Module), leg| {
        assert_refused(&sample_rotary(), "crank", change, Cause::ArmZero, leg);
    };
    crank(&vector("axis", 1, none), 1);
    crank(&vector("arm", 2, none), 2);
    // Along the axis of leg 0, which is X: its end is fixed.
    crank(&vector("arm", 0, [-10.0, 0.0, 0.0]), 0);
    crank(&vector("arm", 0, [1e-300, 0.0, 0.0]), 0);
}

fn assert_refused(
    machine: &Parallel,
    what: &str,
    change: &dyn Fn(&Module),
    cause: Cause,
    leg: i32,
) {
    let module = machine.module();
    let home = machine.home.expect("given");
    let joints = module.inverse(&home).expect("home");
    let hash = module.get("geometry-hash");
    change(&module);
    module.apply();
    assert!(!module.is_on("geometry-ok"), "{what}");
    assert_eq!(module.get("fault"), f64::from(cause.code()), "{what}: {:?}", module.messages());
    assert_eq!(module.get("fault-leg"), f64::from(leg), "{what}");
    let said: String = module.messages().into_iter().map(|m| m.text).collect();
    assert!(said.contains(cause.text()), "{what}: '{said}'");
    if leg >= 0 {
        let named = [format!("leg {leg}:"), format!("legs {leg} and ")];
        assert!(named.iter().any(|name| said.contains(name)), "{what}: '{said}'");
    }
    assert_eq!(module.inverse(&home), Ok(joints), "{what}");
    assert!(module.follow(&joints, &home).is_ok(), "{what}");
    assert_eq!(module.get("geometry-hash"), hash, "{what}");
}

/// Without an earlier good geometry, a bad one is refused in all calls.
#[test]
fn a_bad_first_geometry_answers_no_call() {
    let machine = pyramid();
    let module = machine.loaded();
    machine.wire(&module);
    module.set("side.1", 0.0);
    module.apply();
    let mut joints = [7.0; 16];
    let home = machine.home.expect("given");
    assert_eq!(module.inverse_into(&home, &mut joints), Cause::NoGeometry.code());
    assert_eq!(joints, [7.0; 16]);
}

/// Equal guides and rods: the platform swings on parallel rods in any position.
#[test]
fn parallel_rods_on_parallel_guides_leave_a_free_motion_and_are_refused() {
    let mut machine = linear_delta(163.25, 33.0, 269.0);
    for leg in &mut machine.legs {
        leg.base = [leg.platform[0] + 130.0, leg.platform[1], 0.0];
    }
    let module = machine.loaded();
    assert!(!machine.apply(&module));
    assert_eq!(module.get("fault"), f64::from(Cause::SingularAtHome.code()));
}

/// Legs that can only lift, and a platform that must be shifted: no number of them is sufficient.
#[test]
fn legs_that_leave_a_coordinate_free_are_refused() {
    let machine = Parallel { coordinates: "ZABC", table: "", ..pyramid() };
    let module = machine.loaded();
    assert!(!machine.apply(&module));
    assert_eq!(module.get("fault"), f64::from(Cause::SingularAtHome.code()));
}

/// Of the fifteen sets of four coordinates of the symmetric four-rod lathe four are
/// regular; each needs Y and B, and not both of X and C, nor of Z and A.
#[test]
fn the_four_rod_lathe_holds_its_platform_in_four_sets_of_coordinates_only() {
    let mut machine = four_rod_lathe();
    // The frame's origin at the reference pose: all constant coordinates are 0 there.
    for leg in &mut machine.legs {
        leg.base[1] -= 450.0;
        leg.base[2] -= 1000.0;
    }
    machine.home = Some([0.0; 9]);
    let mut regular = Vec::new();
    for coordinates in quadruples() {
        machine.coordinates = coordinates;
        let module = machine.loaded();
        if machine.apply(&module) {
            regular.push(coordinates);
        } else {
            let code = f64::from(Cause::SingularAtHome.code());
            assert_eq!(module.get("fault"), code, "{coordinates}");
        }
    }
    assert_eq!(regular, ["XYZB", "XYAB", "YZBC", "YABC"]);
}

fn quadruples() -> [&'static str; 15] {
    [
        "XYZA", "XYZB", "XYZC", "XYAB", "XYAC", "XYBC", "XZAB", "XZAC", "XZBC", "XABC", "YZAB",
        "YZAC", "YZBC", "YABC", "ZABC",
    ]
}

#[test]
fn pins_of_rods_changed_after_freezing_are_shown_and_change_no_joint() {
    for (machine, pins) in [
        (
            pyramid(),
            &["base.0.x", "platform.1.y", "guide.2.z", "rod.3", "side.0", "offset.1", "centre.z"][..],
        ),
        (
            sample_rotary(),
            &["base.2.y", "axis.0.x", "arm.1.z", "rod.0", "side.2", "offset.0", "centre.x"],
        ),
    ] {
        let module = machine.module();
        let home = machine.home.expect("given");
        let joints = module.inverse(&home).expect("home");
        let hash = module.get("geometry-hash");
        for pin in pins {
            let value = module.get(pin);
            module.set(pin, value + 1.0);
            module.monitor_until_all_is_shown();
            assert!(module.is_on("geometry-changed"), "{pin}");
            assert_eq!(module.inverse(&home), Ok(joints), "{pin}");
            module.set(pin, value);
            module.monitor_until_all_is_shown();
            assert!(!module.is_on("geometry-changed"), "{pin} set back");
            assert_eq!(module.get("geometry-hash"), hash, "{pin}");
        }
    }
}

#[test]
fn the_hash_follows_every_value_of_a_rod() {
    for (machine, pins) in [
        (pyramid(), &["base.0.x", "platform.1.y", "guide.2.z", "rod.3", "centre.z"][..]),
        (sample_rotary(), &["base.2.y", "axis.0.x", "arm.1.z", "rod.0", "centre.x"]),
    ] {
        let module = machine.module();
        let hash = module.get("geometry-hash");
        for pin in pins {
            let value = module.get(pin);
            module.set(pin, value + 1e-3);
            module.apply();
            assert!(module.is_on("geometry-ok"), "{pin}: {:?}", module.messages());
            assert_ne!(module.get("geometry-hash"), hash, "{pin}");
            module.set(pin, value);
            module.apply();
            assert_eq!(module.get("geometry-hash"), hash, "{pin} set back");
        }
        module.set("offset.0", 3.0);
        module.apply();
        assert_eq!(module.get("geometry-hash"), hash, "an offset moves a joint, not the machine");
    }
    // A side is a value too: the pyramid with all four sides changed is another machine.
    let mut turned = pyramid();
    for leg in &mut turned.legs {
        if let Kind::Slider { side, .. } = &mut leg.kind {
            *side = -*side;
        }
    }
    assert_ne!(turned.module().get("geometry-hash"), pyramid().module().get("geometry-hash"));
}

#[test]
fn an_offset_is_taken_from_the_joint_in_the_joints_own_unit() {
    for subject in subjects() {
        let module = subject.machine.module();
        let pose = (subject.sample)(&mut Random::new(74));
        let plain = module.inverse(&pose).expect("a pose of the workspace");
        for n in 0..subject.machine.legs.len() {
            module.set(&format!("offset.{n}"), 2.0 + n as f64);
        }
        module.apply();
        let joints = module.inverse(&pose).expect("a pose of the workspace");
        for n in 0..subject.machine.joints() {
            let offset = if n < subject.machine.legs.len() { 2.0 + n as f64 } else { 0.0 };
            assert_eq!(joints[n], plain[n] - offset, "{} joint {n}", subject.name);
        }
        let found = module.forward(&joints, &pose).expect("its own joints");
        for (one, other) in found.iter().zip(pose) {
            assert!((one - other).abs() <= SAME_COMPONENT, "{}: {found:?}", subject.name);
        }
    }
}

/// A guide may be given by two points: its length is irrelevant.
#[test]
fn guides_and_axes_of_any_length_are_directions() {
    for machine in [pyramid(), sample_rotary()] {
        let mut long = machine.clone();
        for leg in &mut long.legs {
            match &mut leg.kind {
                Kind::Slider { guide, .. } => *guide = guide.map(|v| v * 1024.0),
                Kind::Crank { axis, .. } => *axis = axis.map(|v| v / 1024.0),
                Kind::Strut { .. } | Kind::Ring { .. } => {}
            }
        }
        let home = machine.home.expect("given");
        assert_eq!(long.module().inverse(&home), machine.module().inverse(&home));
    }
}

/// LinuxCNC calls forward with all joints 0 and a seed of 0 until the joints are known.
#[test]
fn calls_before_homing_raise_no_alarm_and_never_lie() {
    for subject in subjects() {
        let module = subject.machine.module();
        let (mut failed, mut solved) = (0, 0);
        for seed in [[0.0; 9], subject.home()] {
            for _ in 0..65 {
                let mut world = seed;
                if module.forward_into(&[0.0; 16], &mut world) < 0 {
                    failed += 1;
                    assert_eq!(world, seed, "{}", subject.name);
                } else {
                    solved += 1;
                    // Carriages and arms at 0 may have a pose, far below.
                    assert!(belongs(&module, &subject.machine, &[0.0; 16], &world), "{world:?}");
                }
                module.monitor();
            }
        }
        println!("{}: {failed} failed, {solved} solved", subject.name);
        assert_eq!(module.get("fault-count"), 0.0, "{}", subject.name);
        assert_eq!(module.messages().len(), 0, "{}: {:?}", subject.name, module.messages());
    }
}

#[test]
fn calls_before_homing_without_a_geometry_raise_no_alarm_either() {
    for subject in subjects() {
        let module = subject.machine.loaded();
        for _ in 0..65 {
            let mut world = [0.0; 9];
            assert!(module.forward_into(&[0.0; 16], &mut world) < 0);
            assert_eq!(world, [0.0; 9], "{}", subject.name);
            module.monitor();
        }
        assert_eq!(module.messages().len(), 0, "{}: {:?}", subject.name, module.messages());
    }
}
