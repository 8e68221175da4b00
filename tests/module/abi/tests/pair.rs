// SPDX-License-Identifier: GPL-2.0-or-later
//! Two mechanisms on one module: each behaves as it does alone, and both move together or not at all.

use abi_tests::geometry::{Vector, minus, norm, plus, scaled};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::pair::{Two, pairs, two};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::subjects;
use abi_tests::tolerances::ROUND_TRIP_REL;
use kinematics::Cause;

fn mirrored() -> Two {
    pairs().swap_remove(0)
}

fn both_homed(two: &Two, module: &Module) -> (Pose, Joints) {
    let pose = two.homes();
    let joints = module.inverse(&pose).expect("the reference poses");
    assert_eq!(module.follow(&joints, &pose).map(|_| ()), Ok(()));
    (pose, joints)
}

#[test]
fn each_gives_bit_for_bit_what_it_gives_alone_and_comes_back_to_its_pose() {
    let mut random = Random::new(81);
    for two in pairs() {
        let name = format!("{} and {}", two.first.name, two.second.name);
        let module = two.module();
        let alone = [two.first.machine.module(), two.second.machine.module()];
        // 10^5 poses of the mirrored lathe, which is a shipped machine.
        let count = if two.angles == "C" { cases(100_000) } else { cases(2_000) };
        // Found poses may equal the reference poses or differ by a rounding: near them both start at the same bits.
        let starts = [&two.first, &two.second].map(|subject| {
            let mut home = subject.home();
            home[2] += 1e-3;
            home
        });
        let start = two.world(&starts[0], &starts[1]);
        // A first call of all, in which nothing is known.
        let known = module.inverse(&start).and_then(|joints| module.forward(&joints, &start));
        known.expect("a pose of both workspaces");
        let mut worst = 0.0_f64;
        for _ in 0..count {
            let poses = [(two.first.sample)(&mut random), (two.second.sample)(&mut random)];
            let world = two.world(&poses[0], &poses[1]);
            let joints = module.inverse(&world).expect("poses of both workspaces");
            let expected = [0, 1].map(|i| alone[i].inverse(&poses[i]).expect("the same alone"));
            assert_eq!(joints, two.joints(&expected[0], &expected[1]), "{name} at {world:?}");
            // From near the reference poses, with which the joints of every pose are connected.
            let found = module.forward(&joints, &start).expect("their own joints");
            let own =
                [0, 1].map(|i| alone[i].forward(&expected[i], &starts[i]).expect("the same alone"));
            assert_eq!(found, two.world(&own[0], &own[1]), "{name} at {world:?}");
            let machines = [&two.first.machine, &two.second.machine];
            let back = [found, two.second_of(&found)];
            for i in 0..2 {
                let mut back = back[i];
                // Letters of the other one.
                (0..6).filter(|k| !machines[i].moves(*k)).for_each(|k| back[k] = 0.0);
                worst = worst.max(Two::gap(machines[i], &back, &poses[i]));
            }
        }
        println!("{name}: {count} poses, back within {worst:.1e} of the size");
        assert!(worst <= ROUND_TRIP_REL, "{name}: {worst:e}");
    }
}

#[test]
fn a_module_with_one_mechanism_has_no_pin_of_a_second() {
    for subject in subjects() {
        let module = subject.machine.module();
        assert!(module.pins().iter().all(|pin| !pin.name.contains("second")), "{}", subject.name);
    }
}

#[test]
fn legs_and_joints_of_the_second_are_counted_on() {
    let two = two("pyramid", "linear delta", "");
    let module = two.loaded();
    for pin in ["base.6.x", "guide.4.z", "max-velocity.8", "second.home.x", "second.geometry-ok"] {
        assert!(module.has(pin), "{pin}");
    }
    for pin in ["base.7.x", "max-velocity.9", "second.apply", "second.fault", "second.base.0.x"] {
        assert!(!module.has(pin), "{pin}");
    }
}

#[test]
fn nothing_is_given_in_part() {
    let two = mirrored();
    let module = two.module();
    let (good, joints) = both_homed(&two, &module);
    // Out of reach of the second one's rods: the first one alone could continue.
    let mut far = good;
    far[7] += 5000.0;
    let mut untouched = [4.0; 16];
    assert_eq!(module.inverse_into(&far, &mut untouched), Cause::OutOfReach.code());
    assert_eq!(untouched, [4.0; 16]);
    assert_eq!(module.get("fault") as i32, Cause::OutOfReach.code());
    assert!((4.0..8.0).contains(&module.get("fault-leg")), "{}", module.get("fault-leg"));
    // Joints at which the second one's platform does not close.
    let mut torn = joints;
    torn[4] -= 900.0;
    let mut world = good;
    assert!(module.forward_into(&torn, &mut world) < 0);
    let moved = [0, 1, 2, 4, 5, 6, 7, 8];
    assert!(moved.iter().all(|k| world[*k].is_nan()) && world[3] == 0.0, "{world:?}");
    assert!(module.is_on("fwd-kins-fail") && module.is_on("second.fwd-kins-fail"));
    // LinuxCNC passes the NaN on, and the reason stays that of forward.
    let why = module.get("fault");
    assert_eq!(module.inverse(&world), Err(Cause::PoseNotFinite.code()));
    assert_eq!(module.get("fault"), why);
    let back = module.follow(&joints, &world).expect("the joints of the last good pose");
    assert!(Two::gap(&two.second.machine, &two.second_of(&back), &two.second.home()) < 1e-9);
    assert!(!module.is_on("fwd-kins-fail"));
}

#[test]
fn what_is_no_number_is_refused_with_its_joint() {
    let two = mirrored();
    let module = two.module();
    let (good, joints) = both_homed(&two, &module);
    for value in [f64::NAN, f64::INFINITY] {
        for i in 0..8 {
            let mut bad = joints;
            bad[i] = value;
            assert_eq!(module.follow(&bad, &good), Err(Cause::JointNotFinite.code()), "{i}");
            assert_eq!(module.get("fault-leg"), i as f64);
        }
        for k in [0, 1, 2, 4, 5, 6, 7, 8] {
            let mut bad = good;
            bad[k] = value;
            assert_eq!(module.inverse(&bad), Err(Cause::PoseNotFinite.code()), "{k}");
        }
    }
    assert!(module.follow(&joints, &good).is_ok() && module.inverse(&good) == Ok(joints));
}

#[test]
fn a_fault_of_the_second_names_its_leg_or_the_mechanism() {
    let two = mirrored();
    let module = two.module();
    let (good, joints) = both_homed(&two, &module);
    let said = |module: &Module| {
        module.monitor();
        let all: Vec<String> = module.messages().into_iter().map(|m| m.text).collect();
        module.clear_messages();
        all.join("\n")
    };
    let mut far = good;
    far[8] = f64::NAN;
    assert!(module.inverse(&far).is_err());
    assert!(said(&module).contains("second mechanism: the pose"), "of the whole");
    let mut bad = joints;
    bad[6] = f64::NAN;
    assert!(module.follow(&bad, &good).is_err());
    let text = said(&module);
    assert!(text.contains("joint 6: ") && !text.contains("second"), "{text}");
}

#[test]
fn both_geometries_are_frozen_or_none() {
    let two = mirrored();
    let module = two.module();
    let (good, joints) = both_homed(&two, &module);
    let hashes = ["geometry-hash", "second.geometry-hash"].map(|pin| module.get(pin));
    // Each in turn gets a bad pin while the other one is another good machine.
    for (good_pin, bad_pin, leg) in [("rod.1", "rod.5", 5.0), ("rod.5", "rod.1", 1.0)] {
        module.set(good_pin, 720.0);
        module.set(bad_pin, -1.0);
        module.apply();
        assert!(!module.is_on("geometry-ok") && !module.is_on("second.geometry-ok"));
        assert_eq!(module.get("fault") as i32, Cause::RodNotPositive.code());
        assert_eq!(module.get("fault-leg"), leg);
        assert_eq!(["geometry-hash", "second.geometry-hash"].map(|pin| module.get(pin)), hashes);
        module.monitor_until_all_is_shown();
        assert!(module.is_on("geometry-changed"));
        assert_eq!(module.inverse(&good), Ok(joints), "the last good ones stay");
        module.set(good_pin, 700.0);
        module.set(bad_pin, 700.0);
    }
    module.apply();
    assert!(module.is_on("geometry-ok") && !module.is_on("geometry-changed"));
    module.set("rod.5", f64::NAN);
    module.set("machine-on", 1.0);
    module.apply();
    assert_eq!(module.get("fault") as i32, Cause::ApplyWhileOn.code());
    assert_eq!(module.inverse(&good), Ok(joints));
}

#[test]
fn joints_before_homing_leave_the_pose_alone_and_are_no_fault() {
    let two = mirrored();
    let module = two.module();
    let mut world = two.homes();
    assert_eq!(module.forward_into(&[0.0; 16], &mut world), Cause::NotHomed.code());
    assert_eq!(world, two.homes());
    assert_eq!(module.get("fault-count"), 0.0);
}

#[test]
fn the_identity_kinematics_are_those_of_both() {
    let two = mirrored();
    let module = two.module();
    let (good, joints) = both_homed(&two, &module);
    assert_eq!(module.switch(1), 0);
    let pose = [1.0, 2.0, 3.0, 0.0, 4.0, 8.0, 5.0, 6.0, 7.0];
    let found = module.inverse(&pose).expect("every letter has a joint");
    assert_eq!(found[..8], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    assert_eq!(module.follow(&found, &pose), Ok(pose));
    // Joints at which the second one does not close: neither returns.
    let mut torn = joints;
    torn[4] -= 900.0;
    module.follow(&torn, &pose).expect("letters of joints");
    assert!(module.switch(0) < 0 && module.is_on("kinstype.is-1"));
    module.follow(&joints, &pose).expect("letters of joints");
    assert_eq!(module.switch(0), 0);
    assert!(module.follow(&joints, &good).is_ok() && module.is_on("kinstype.is-0"));
    // Machines with more legs than coordinates have no identity kinematics.
    let module = pairs().swap_remove(1).module();
    assert_eq!(module.switch(1), Cause::IdentityImpossible.code());
    assert!(module.is_on("kinstype.is-0"));
}

#[test]
fn the_jacobian_has_the_rows_of_both_in_their_own_columns() {
    let mut random = Random::new(82);
    for two in pairs() {
        let module = two.module();
        let alone = [two.first.machine.module(), two.second.machine.module()];
        let poses = [(two.first.sample)(&mut random), (two.second.sample)(&mut random)];
        let world = two.world(&poses[0], &poses[1]);
        let joints = module.inverse(&world).expect("poses of both workspaces");
        let own = [0, 1].map(|i| {
            let joints = alone[i].inverse(&poses[i]).expect("the same alone");
            alone[i].jacobian(&joints, &poses[i]).expect("regular")
        });
        let count = two.first.machine.joints();
        let mut expected = own[0];
        // A constant letter of the first one moves none of its joints, also if it belongs to the other one.
        for column in (0..6).filter(|c| !two.first.machine.moves(*c)) {
            expected[..count].iter_mut().for_each(|row| row[column] = 0.0);
        }
        for (row, of_second) in expected[count..].iter_mut().zip(own[1]) {
            for (value, place) in of_second.iter().zip(two.places()) {
                place.into_iter().for_each(|place| row[place] = *value);
            }
        }
        let found = module.jacobian(&joints, &world).expect("regular");
        assert_eq!(found, expected, "{} and {}", two.first.name, two.second.name);
    }
}

#[test]
fn extra_axes_stand_behind_both_and_take_what_is_left() {
    let two = mirrored();
    let module = two.loaded_with(&[("axes", "A")]);
    two.wire(&module);
    module.apply();
    let mut pose = two.homes();
    pose[3] = 33.0;
    let joints = module.inverse(&pose).expect("the reference poses");
    assert_eq!(joints[8], 33.0);
    let plain = two.module();
    let mut expected = plain.inverse(&two.homes()).expect("the reference poses");
    expected[8] = 33.0;
    assert_eq!(joints, expected);
    assert_eq!(module.follow(&joints, &pose).map(|pose| pose[3]), Ok(33.0));
    let mut bad = joints;
    bad[8] = f64::NAN;
    assert_eq!(module.follow(&bad, &pose), Err(Cause::JointNotFinite.code()));
    assert_eq!(module.get("fault-leg"), 8.0);
    assert!(module.follow(&joints, &pose).is_ok());
}

/// Runs a cycle of world mode at a pose, machine on.
fn cycle(module: &Module, pose: &Pose) {
    let joints = module.inverse(pose).expect("a pose of the workspaces");
    module.follow(&joints, pose).expect("its own joints");
    module.inverse(pose).expect("the same");
    module.monitor();
}

#[test]
fn a_tool_change_of_one_at_a_tilt_moves_that_one_and_holds_both() {
    let two = mirrored();
    let module = two.module();
    for j in 0..8 {
        module.set(&format!("max-velocity.{j}"), 400.0);
        module.set(&format!("max-acceleration.{j}"), 4000.0);
    }
    let mut pose = two.homes();
    (pose[4], pose[5]) = (8.0, -5.0);
    cycle(&module, &pose);
    module.set("machine-on", 1.0);
    (0..3).for_each(|_| cycle(&module, &pose));
    let before = module.inverse(&pose).expect("at rest");
    module.set("second.tool-offset-x", 100.0);
    cycle(&module, &pose);
    assert!(module.is_on("second.tool-busy") && module.is_on("tool-busy"));
    assert!(module.is_on("feed-inhibit"), "nothing else may move");
    let mut cycles = 0;
    while module.is_on("tool-busy") {
        cycle(&module, &pose);
        cycles += 1;
        assert!(cycles < 20_000, "a tool change does not end");
    }
    let after = module.inverse(&pose).expect("at rest");
    assert_eq!(after[..4], before[..4], "the first stands still");
    assert!((4..8).all(|j| (after[j] - before[j]).abs() > 0.1), "{after:?} {before:?}");
    assert_eq!(module.get("second.tool-offset-eff-x"), 100.0);
    assert!(!module.is_on("feed-inhibit"));
}

#[test]
fn a_tool_offset_that_linuxcnc_hands_over_is_xyz_for_the_first_and_uvw_for_the_second() {
    let module = mirrored().module();
    let tool = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 4.0, 5.0, 6.0];
    assert_eq!(module.set_tool(Some(&tool)), 0);
    module.monitor();
    let shown =
        |stem: &str| ["x", "y", "z"].map(|l| module.get(&format!("{stem}tool-offset-eff-{l}")));
    module.monitor();
    assert_eq!(shown(""), [1.0, 2.0, 3.0]);
    assert_eq!(shown("second."), [4.0, 5.0, 6.0]);
}

#[test]
fn the_feed_is_that_of_the_slower_one() {
    let two = mirrored();
    let module = two.module();
    for j in 0..8 {
        module.set(&format!("min-limit.{j}"), -100.0);
        module.set(&format!("max-limit.{j}"), 2100.0);
        module.set(&format!("max-velocity.{j}"), if j < 4 { 400.0 } else { 40.0 });
    }
    module.set("linear-acceleration", 400.0);
    module.set("angular-acceleration", 100.0);
    module.set("machine-on", 1.0);
    // Both at 100 mm/s along their Z.
    for (pin, value) in [("requested-vel", 100.0), ("current-vel", 100.0), ("distance-to-go", 1e9)]
    {
        module.set(pin, value);
    }
    let mut pose = two.homes();
    for _ in 0..30 {
        cycle(&module, &pose);
        pose[2] += 0.1;
        pose[8] += 0.1;
    }
    let [own, second] = ["feed-scale", "second.feed-scale"].map(|pin| module.get(pin));
    assert!((own - second).abs() == 0.0 && second < 0.5, "{own} {second}");
    assert!(module.is_on("limit-soon") && module.get("limit-leg") >= 4.0);
}

// ---------------------------------------------------------------- the distance between them

/// Returns the lines of a mechanism, with the number of a leg or -1 for the platform.
fn lines(machine: &Parallel, pose: &Pose, joints: &[f64], first: usize) -> Vec<(f64, [Vector; 2])> {
    let anchors: Vec<Vector> = (0..machine.legs.len()).map(|n| machine.anchor(pose, n)).collect();
    let mut all = vec![];
    for n in 0..anchors.len() {
        let lower = minus(anchors[n], machine.span(pose, n, joints[n]));
        all.push(((first + n) as f64, [lower, anchors[n]]));
        all.extend((0..n).map(|m| (-1.0, [anchors[m], anchors[n]])));
    }
    all
}

/// Returns the distance of two segments, by ternary search along both (it is convex).
fn distance(one: [Vector; 2], other: [Vector; 2]) -> f64 {
    let at = |s: [Vector; 2], share: f64| plus(s[0], scaled(minus(s[1], s[0]), share));
    let least = |f: &dyn Fn(f64) -> f64| {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if f(a) < f(b) { high = b } else { low = a }
        }
        f((low + high) / 2.0)
    };
    least(&|s| least(&|t| norm(minus(at(one, s), at(other, t)))))
}

#[test]
fn the_distance_shown_is_that_of_a_search_along_all_lines_of_both() {
    let mut random = Random::new(83);
    for two in pairs() {
        let module = two.module();
        for _ in 0..3 {
            let poses = [(two.first.sample)(&mut random), (two.second.sample)(&mut random)];
            let world = two.world(&poses[0], &poses[1]);
            cycle(&module, &world);
            module.monitor_until_all_is_shown();
            let joints = module.inverse(&world).expect("poses of both workspaces");
            let count = two.first.machine.joints();
            let one = lines(&two.first.machine, &poses[0], &joints, 0);
            let legs = two.first.machine.legs.len();
            let other = lines(&two.second.machine, &poses[1], &joints[count..], legs);
            let (mut least, mut parts) = (f64::INFINITY, [0.0; 2]);
            for (a, mine) in &one {
                for (b, theirs) in &other {
                    let found = distance(*mine, *theirs);
                    if found < least {
                        (least, parts) = (found, [*a, *b]);
                    }
                }
            }
            let name = format!("{} and {}", two.first.name, two.second.name);
            let shown = module.get("mechanism-distance");
            // The search ends at (2/3)^60 of a line.
            let size = two.first.machine.size().max(two.second.machine.size());
            assert!((shown - least).abs() < 1e-7 * size, "{name}: {shown}, not {least}");
            if least > 1e-6 * size {
                // An anchor belongs to a leg and to the platform: either may be named.
                let named = ["mechanism-pair-a", "mechanism-pair-b"].map(|pin| module.get(pin));
                assert!(
                    (0..2).all(|i| named[i] == parts[i] || named[i] == -1.0 || parts[i] == -1.0),
                    "{name}"
                );
            }
        }
    }
}

/// Returns the mirrored lathe on its guides: the second one displaced by 1600, with a clearance.
fn on_guides(clearance: f64) -> (Two, Module) {
    let mut two = mirrored();
    let mut home = two.second.home();
    home[2] += 1600.0;
    two.second.machine.home = Some(home);
    let module = two.module();
    module.set("mechanism-clearance", clearance);
    module.set("linear-acceleration", 400.0);
    module.set("angular-acceleration", 100.0);
    module.set("machine-on", 1.0);
    (two, module)
}

/// Moves W at this speed, and brakes with 400 mm/s² if feed is inhibited, three cycles late; returns the least
/// distance, and whether it was stopped.
fn approach(two: &Two, module: &Module, mut pose: Pose, speed: f64, way: f64) -> (f64, bool) {
    let (mut v, mut least, mut held) = (0.0_f64, f64::INFINITY, [false; 3]);
    module.set("requested-vel", speed.abs());
    let start = pose[8];
    let mut cycles = 0;
    while (pose[8] - start).abs() < way && !(held[0] && v == 0.0) {
        v = if held[0] { (v - 0.4).max(0.0) } else { (v + 0.4).min(speed.abs()) };
        pose[8] += v * 1e-3 * speed.signum();
        module.set("current-vel", v);
        module.set("distance-to-go", way - (pose[8] - start).abs());
        cycle(module, &pose);
        let joints = module.inverse(&pose).expect("a pose of the workspaces");
        // Carriages 1 and 4 run on one rail, and nothing else is as near.
        least = least.min(joints[4] - joints[1]);
        held = [held[1], held[2], module.is_on("feed-inhibit")];
        cycles += 1;
        assert!(cycles < 60_000, "{pose:?}");
    }
    assert_eq!(two.second.machine.legs.len(), 4);
    (least, held[0])
}

#[test]
fn the_guard_stops_before_the_clearance_is_lost_and_lets_them_move_apart() {
    for speed in [5.0, 30.0, 60.0] {
        let (two, module) = on_guides(150.0);
        let mut pose = two.homes();
        // 241 mm apart, and nearer on the rail of carriages 1 and 4 than on the other one.
        (pose[0], pose[6]) = (30.0, 30.0);
        pose[8] -= 350.0;
        let begin = module.inverse(&pose).map(|joints| joints[4] - joints[1]).expect("in reach");
        let (least, stopped) = approach(&two, &module, pose, -speed, 900.0);
        println!("at {speed} mm/s: stopped {:.3} mm before the limit", least - 150.0);
        assert!(stopped && least >= 150.0, "{speed}: {least}");
        // The assumed braking, 43 % of the acceleration, ten cycles, and the largest spacing between positions of the
        // look-ahead.
        let most = speed * speed / (2.0 * 0.43 * 400.0) + 0.013 * speed + 0.1;
        assert!(least - 150.0 <= most, "{speed}: {} of {most}", least - 150.0);
        assert_eq!(module.get("fault") as i32, Cause::MechanismsNear.code());
        assert_eq!((module.get("fault-leg"), module.get("limit-leg")), (1.0, 1.0));
        assert!(module.is_on("limit-soon"));
        // The program is aborted, and W moves back.
        module.set("requested-vel", 0.0);
        module.set("current-vel", 0.0);
        let mut at = pose;
        at[8] -= begin - least;
        (0..5).for_each(|_| cycle(&module, &at));
        assert!(!module.is_on("feed-inhibit"));
        let (_, stopped) = approach(&two, &module, at, speed, 100.0);
        assert!(!stopped, "{speed}: away");
    }
}

#[test]
fn two_that_stand_too_near_are_reported_and_nothing_is_inhibited_at_rest() {
    let (two, module) = on_guides(150.0);
    let pose = two.homes();
    let distance = gap(&module, &pose);
    for (clearance, is_near) in [(distance * (1.0 + 1e-6), true), (distance * (1.0 - 1e-6), false)]
    {
        module.set("mechanism-clearance", clearance);
        (0..20).for_each(|_| cycle(&module, &pose));
        assert_eq!(module.is_on("limit-soon"), is_near, "{clearance} at {distance}");
        let reason = if is_near { Cause::MechanismsNear.code() } else { 0 };
        assert_eq!(module.get("limit-reason") as i32, reason);
        assert!(!module.is_on("feed-inhibit"), "at rest");
    }
}

#[test]
fn without_a_clearance_nothing_is_stopped_and_one_that_is_no_number_stops_what_comes_nearer() {
    let (two, module) = on_guides(0.0);
    let (least, stopped) = approach(&two, &module, two.homes(), -60.0, 500.0);
    assert!(!stopped && least < 100.0, "{least}");
    let (two, module) = on_guides(f64::NAN);
    let (_, stopped) = approach(&two, &module, two.homes(), -60.0, 500.0);
    assert!(stopped);
    let (two, module) = on_guides(f64::NAN);
    let (_, stopped) = approach(&two, &module, two.homes(), 60.0, 100.0);
    assert!(!stopped, "away");
}

/// Acceleration of the moves below, as set for the guard.
const ACCELERATION: f64 = 400.0;
const PERIOD: f64 = 1e-3;
const CLEARANCE: f64 = 150.0;

/// A straight move, as LinuxCNC's planner makes it.
struct Move {
    start: Pose,
    change: Pose,
    feed: f64,
}

/// LinuxCNC's queue in addition to the whole move.
#[derive(Clone, Copy, Debug)]
enum Queue {
    Alone,
    /// A return to the point at this share, after the move.
    ThenBack(f64),
    /// A move to the point at this share, until the machine brakes for it: the rest is queued then.
    UpTo(f64),
}

impl Move {
    /// Returns a random move of the mirrored lathe on its guides, of one or both, that brings the two nearer together.
    fn random(random: &mut Random, two: &Two) -> Self {
        let mut start = two.homes();
        (start[0], start[6]) = (random.between(25.0, 35.0), random.between(25.0, 35.0));
        start[8] -= random.between(250.0, 450.0);
        let mut change = [0.0; 9];
        match random.between(0.0, 3.0) as u32 {
            0 => change[8] = -random.between(2.0, 60.0),
            1 => change[2] = random.between(2.0, 60.0),
            _ => {
                change[2] = random.within(30.0);
                (change[0], change[6]) = (random.within(5.0), random.within(5.0));
                change[8] = -random.between(2.0, 30.0);
            }
        }
        Self { start, change, feed: random.between(5.0, 60.0) }
    }

    fn at(&self, share: f64) -> Pose {
        std::array::from_fn(|k| self.start[k] + share * self.change[k])
    }

    /// Returns the length as in LinuxCNC: of X Y Z, otherwise of U V W.
    fn length(&self) -> f64 {
        let of = |k: usize| norm([self.change[k], self.change[k + 1], self.change[k + 2]]);
        if of(0) > 0.0 { of(0) } else { of(6) }
    }

    /// Returns the last of 40 shares before which the clearance is kept, and the least distance.
    fn kept(&self, module: &Module) -> (f64, f64) {
        let all: Vec<_> = (0..=40).map(|n| gap(module, &self.at(f64::from(n) / 40.0))).collect();
        let kept = all.iter().take_while(|gap| **gap >= CLEARANCE).count() as f64 - 1.0;
        (kept / 40.0, all.into_iter().fold(f64::INFINITY, f64::min))
    }

    /// Calls inverse for the end point of a move as LinuxCNC's command handler does, before the controller runs.
    fn queue(&self, module: &Module, share: f64) {
        module.inverse(&self.at(share)).expect("a pose of the workspaces");
    }

    /// Makes the move, and returns the final distance, and whether it was stopped. The feed is inhibited three
    /// cycles late. `has_in_position` is whether `in-position` is connected.
    fn make(&self, module: &Module, queue: Queue, has_in_position: bool) -> (f64, bool) {
        let moving = |feed: f64, speed: f64, to_go: f64| {
            let pins = [("requested-vel", feed), ("current-vel", speed), ("distance-to-go", to_go)];
            pins.into_iter().for_each(|(pin, value)| module.set(pin, value));
        };
        let mut joints = module.inverse(&self.start).expect("a pose of the workspaces");
        moving(0.0, 0.0, 0.0);
        (0..3).for_each(|_| servo(module, &mut joints, &self.start));
        module.set("in-position", if has_in_position { 1.0 } else { 0.0 });
        let (length, step) = (self.length(), ACCELERATION * PERIOD);
        let mut end = if let Queue::UpTo(share) = queue { share * length } else { length };
        self.queue(module, end / length);
        module.set("in-position", 0.0);
        let (mut gone, mut speed, mut held) = (0.0, 0.0_f64, [false; 3]);
        for n in 0..60_000 {
            match queue {
                Queue::ThenBack(share) if n == 1 => self.queue(module, share),
                Queue::UpTo(_) if end < length && brakes_to(end - gone) < speed => {
                    // The planner could still stop there.
                    end = length;
                    self.queue(module, 1.0);
                }
                _ => {}
            }
            let wanted = if held[0] { 0.0 } else { self.feed.min(brakes_to(end - gone)) };
            speed = wanted.clamp((speed - step).max(0.0), speed + step);
            gone = (gone + speed * PERIOD).min(end);
            moving(self.feed, speed, end - gone);
            let pose = self.at(gone / length);
            servo(module, &mut joints, &pose);
            held = [held[1], held[2], module.is_on("feed-inhibit")];
            if gone >= length || (held[0] && speed == 0.0) {
                return (gap(module, &pose), held[0]);
            }
        }
        panic!("a move does not end: {gone} of {length}")
    }
}

/// Returns the speed from which the planner stops within a distance; it creeps at the end.
fn brakes_to(distance: f64) -> f64 {
    let step = ACCELERATION * PERIOD;
    ((2.0 * ACCELERATION * distance).sqrt() - step).max(step / 2.0)
}

/// Runs a cycle as LinuxCNC does, at the joints of the previous cycle. Every second inverse is for an end point.
fn servo(module: &Module, joints: &mut Joints, pose: &Pose) {
    module.follow(joints, pose).expect("joints of the cycle before");
    *joints = module.inverse(pose).expect("a pose of the workspaces");
    module.monitor();
}

/// Returns the distance of the two at a pose, as published by the module.
fn gap(module: &Module, pose: &Pose) -> f64 {
    cycle(module, pose);
    module.monitor_until_all_is_shown();
    module.get("mechanism-distance")
}

#[test]
fn a_move_alone_in_the_queue_is_stopped_if_it_loses_the_clearance_and_not_if_it_ends_before() {
    let (two, module) = on_guides(CLEARANCE);
    let mut random = Random::new(84);
    let (mut legal, mut untold, mut illegal) = (0, 0, 0);
    while legal < cases(200) || illegal < cases(50) {
        let step = Move::random(&mut random, &two);
        let (kept, least) = step.kept(&module);
        // The guard has a margin of twice three cycles beyond the end, in case a move is queued that continues.
        let late = 3.0 * PERIOD;
        let room = 2.0 * late * step.feed + 1.1 * late * late * ACCELERATION;
        let beyond = 1.0 + room / step.length();
        if least >= CLEARANCE && gap(&module, &step.at(beyond)) >= CLEARANCE {
            if legal < cases(200) {
                legal += 1;
                untold += usize::from(step.make(&module, Queue::Alone, false).1);
                let (end, stopped) = step.make(&module, Queue::Alone, true);
                assert!(!stopped, "{:?} by {:?}: {end}", step.start, step.change);
            }
        } else if least < CLEARANCE - 1.0
            && gap(&module, &step.start) > CLEARANCE + 10.0
            && illegal < cases(50)
        {
            illegal += 1;
            let up_to = kept * random.between(0.9, 1.0);
            for queue in [Queue::Alone, Queue::ThenBack(up_to), Queue::UpTo(up_to)] {
                let (nearest, stopped) = step.make(&module, queue, true);
                assert!(stopped && nearest >= CLEARANCE, "{queue:?}: {nearest}, to {least}");
            }
        }
    }
    println!("of {legal} legal moves {untold} are stopped where in-position is not connected");
    assert!(untold > 0 || legal < 50, "no move shows the difference");
}
