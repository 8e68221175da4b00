// SPDX-License-Identifier: GPL-2.0-or-later
//! Extra axes that carry the workpiece, the tool or the legs, and a workpiece on the platform.

use abi_tests::carrying::{Carrying, LEGS, TOOL, WORK, carrying};
use abi_tests::geometry::{Vector, minus, norm};
use abi_tests::machines::paper_004;
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::{Kind, Leg, Parallel};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{pose, subjects};
use abi_tests::tolerances::{DIFFERENCE, FRAME, LIMIT_ROUNDING, ROUND_TRIP_REL, SAME_JOINT_MM};
use kinematics::{Cause, ChainGeometry, LinkGeometry, Vector3};

/// Returns the distance of positions, and the largest difference of the rest, degrees and axes.
fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    let places = norm(minus([a[0], a[1], a[2]], [b[0], b[1], b[2]]));
    let rest = a[3..].iter().zip(&b[3..]).map(|(a, b)| (a - b).abs());
    (places, rest.fold(0.0, f64::max))
}

#[test]
fn every_machine_finds_the_pose_back_from_legs_and_axes() {
    let mut random = Random::new(191);
    for subject in subjects() {
        for _ in 0..4 {
            let machine = carrying(&subject, &mut random);
            let (chain, module) = (machine.chain(), machine.module());
            let plain = subject.machine.clone();
            let bare = Parallel { tool: [0.0; 3], spindle_offset: 0.0, ..plain.clone() };
            let plain = if chain.is_bare() { bare.module() } else { plain.module() };
            let count = subject.machine.joints();
            for _ in 0..cases(100) {
                let inside = (subject.sample)(&mut random);
                let world = machine.world(&inside, &chain, &mut random);
                let joints = module.inverse(&world).expect("a pose of the workspace");
                let own = chain.to_machine(&world, &machine.tool()).unwrap();
                let expected = plain.inverse(&pose(own)).expect("the same pose");
                assert_eq!(joints[..count], expected[..count], "{}", subject.name);
                for (i, k) in machine.axes.iter().enumerate() {
                    assert_eq!(joints[count + i], world[*k]);
                }
                let found = module.forward(&joints, &world).expect("its own joints");
                let (place, rest) = apart(&found, &world);
                // As for positions after a dozen rotations at arms of some machine sizes.
                let size = subject.machine.size();
                assert!(place <= 10.0 * ROUND_TRIP_REL * size, "{}: {place}", subject.name);
                assert!(rest <= 1e-7, "{}: {found:?} {world:?}", subject.name);
            }
        }
    }
}

#[test]
fn the_jacobian_is_that_of_differences_of_inverse() {
    let mut random = Random::new(192);
    for subject in subjects() {
        let machine = carrying(&subject, &mut random);
        let (chain, module) = (machine.chain(), machine.module());
        for _ in 0..cases(20) {
            let world = machine.world(&(subject.sample)(&mut random), &chain, &mut random);
            let Ok(joints) = module.inverse(&world) else { continue };
            let found = module.jacobian(&joints, &world).expect("regular");
            for k in 0..9 {
                let held = k < 6 && !subject.machine.moves(k) && !machine.axes.contains(&k);
                if held {
                    continue;
                }
                // Fourth order, as for the machine alone.
                let h = match k {
                    3..6 => 0.003,
                    _ => 2e-4 * subject.machine.size(),
                };
                let at = |n: f64| {
                    let mut moved = world;
                    moved[k] += n * h;
                    module.inverse(&moved)
                };
                let (Ok(a), Ok(b), Ok(c), Ok(d)) = (at(-2.0), at(-1.0), at(1.0), at(2.0)) else {
                    continue;
                };
                for i in 0..subject.machine.joints() + machine.axes.len() {
                    let difference = (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * h);
                    let size = found[i].iter().fold(1.0_f64, |most, v| most.max(v.abs()));
                    // Arms of some machine sizes, in degrees: ten times the machine's own.
                    let off = (found[i][k] - difference).abs();
                    assert!(off <= 10.0 * DIFFERENCE * size, "{} {i} {k}: {off}", subject.name);
                }
            }
        }
    }
}

#[test]
fn frames_of_tool_and_work_are_those_of_the_chain() {
    let mut random = Random::new(193);
    for subject in subjects() {
        let machine = carrying(&subject, &mut random);
        let (chain, module) = (machine.chain(), machine.module());
        for _ in 0..cases(20) {
            let world = machine.world(&(subject.sample)(&mut random), &chain, &mut random);
            let joints = module.inverse(&world).expect("a pose of the workspace");
            module.forward(&joints, &world).expect("its own joints");
            let own = chain.to_machine(&world, &machine.tool()).unwrap();
            let [tool, work] = chain.frames(&kinematics::Pose::from_degrees(own), &world);
            for (found, expected) in
                [(module.tool_frame(&joints), tool), (module.work_frame(&joints), work)]
            {
                let found = found.expect("a pose is known");
                for k in 0..3 {
                    for i in 0..3 {
                        assert!((found[k][i] - expected[(i, k)]).abs() < FRAME, "{}", subject.name);
                    }
                }
            }
        }
    }
}

/// Returns a rod along a vertical guide over a cross table: its joints are X Y Z themselves.
fn three_slides() -> Parallel {
    let kind = Kind::Slider { guide: [0.0, 0.0, 1.0], rod: 400.0, side: 1 };
    let leg = Leg { base: [0.0, 0.0, 400.0], platform: [0.0; 3], kind };
    Parallel { table: "XY", ..Parallel::new(vec![leg], "Z", pose([0.0; 6])) }
}

#[test]
fn a_tilting_rotary_table_is_that_of_linuxcncs_own_kinematics() {
    let mut random = Random::new(194);
    // A about X through a point, C about Z through another one on the table, as in LinuxCNC.
    let (rotary, offset) = ([12.0, -7.0, 31.0], [0.0, -20.0, 45.0]);
    let mut given = ChainGeometry::NONE;
    let tilting: Vector = std::array::from_fn(|k| rotary[k] + offset[k]);
    given.links[0] = LinkGeometry { carries: WORK, axis: [1.0, 0.0, 0.0], point: tilting };
    given.links[2] = LinkGeometry { carries: WORK, axis: [0.0, 0.0, 1.0], point: rotary };
    for length in [0.0, 80.0] {
        let machine = Parallel { tool: [0.0, 0.0, length], ..three_slides() };
        let machine = Carrying { machine, axes: vec![3, 5], given };
        let module = machine.module();
        let theirs = Module::of_linuxcnc("xyzac-trt-kins");
        for (letter, k) in ["x", "y", "z"].into_iter().zip(0..) {
            theirs.set(&format!("{letter}-rot-point"), rotary[k]);
            if k > 0 {
                theirs.set(&format!("{letter}-offset"), offset[k]);
            }
        }
        theirs.set("tool-offset", length);
        let mut farthest = 0.0_f64;
        for _ in 0..cases(50_000) {
            let mut world = pose(std::array::from_fn(|k| match k {
                0..3 => random.within(300.0),
                _ => random.within(180.0),
            }));
            world[4] = 0.0;
            let (joints, expected) = (
                module.inverse(&world).expect("a pose within reach"),
                theirs.inverse(&world).expect("a pose"),
            );
            // Theirs are X Y Z A C, ours Z, the table's X and Y, and the axes A and C.
            for (ours, theirs) in [(1, 0), (2, 1), (0, 2), (3, 3), (4, 4)] {
                let off = (joints[ours] - expected[theirs]).abs();
                farthest = farthest.max(off);
                assert!(off <= SAME_JOINT_MM, "{world:?}: {joints:?} {expected:?}");
            }
            let found = module.forward(&joints, &world).expect("its own joints");
            let of_theirs = theirs.forward(&expected, &world).expect("its own joints");
            let (place, rest) = apart(&found, &of_theirs);
            assert!(place <= 2.0 * SAME_JOINT_MM && rest == 0.0, "{found:?} {of_theirs:?}");
        }
        println!("tool {length}: joints within {farthest:.1e}");
    }
}

/// Returns the hexapod of paper 004 with constant C, over a rotary table.
fn over_a_table() -> Carrying {
    let machine = Parallel { coordinates: "XYZAB", ..paper_004().into() };
    let mut given = ChainGeometry::NONE;
    let point = [20.0, -10.0, 0.0];
    given.links[2] = LinkGeometry { carries: WORK, axis: [0.0, 0.0, 1.0], point };
    Carrying { machine, axes: vec![5], given }
}

/// Adds a turret about Y of the platform and a track under the frame.
fn with_a_turret_on_a_track() -> Carrying {
    let mut over = over_a_table();
    over.axes = vec![5, 8];
    over.given.links[2] =
        LinkGeometry { carries: TOOL, axis: [0.0, 1.0, 0.0], point: [0.0, 0.0, 40.0] };
    over.given.links[5] = LinkGeometry { carries: LEGS, axis: [1.0, 0.0, 0.0], point: [0.0; 3] };
    over
}

#[test]
fn a_track_and_its_letter_alone_leave_the_tip_where_it_is() {
    let machine = with_a_turret_on_a_track();
    let (module, chain) = (machine.module(), machine.chain());
    let mut world = pose([30.0, 20.0, 260.0, 5.0, -8.0, 0.0]);
    let still = module.inverse(&world).expect("a pose of the workspace");
    world[8] = 40.0;
    let moved = module.inverse(&world).expect("a pose of the workspace");
    // The base has moved 40 along X, so the platform is 40 further back relative to the legs.
    let plain = Parallel { coordinates: "XYZAB", ..paper_004().into() }.module();
    let seen = plain.inverse(&pose([-10.0, 20.0, 260.0, 5.0, -8.0, 0.0])).expect("the same");
    for i in 0..6 {
        assert!((moved[i] - seen[i]).abs() < SAME_JOINT_MM && moved[i] != still[i]);
    }
    assert_eq!(moved[7], 40.0);
    let own = chain.to_machine(&world, &Vector3::zeros()).unwrap();
    assert!((own[0] + 10.0).abs() < 1e-12 && (own[1] - 20.0).abs() < 1e-12);
}

/// Runs a servo thread at rest during a tool change.
fn changed(module: &Module, world: &Pose, to: Vector) -> Vec<Joints> {
    let mut all = vec![];
    let cycle = |all: &mut Vec<Joints>| {
        if let Some(joints) = all.last() {
            let found = module.follow(joints, world);
            found.expect("the joints of inverse");
        }
        let asked = module.inverse(world);
        module.monitor();
        all.push(asked.expect("a change goes on"));
    };
    (0..10).for_each(|_| cycle(&mut all));
    for (pin, value) in ["tool-offset-x", "tool-offset-y", "tool-offset"].into_iter().zip(to) {
        module.set(pin, value);
    }
    cycle(&mut all);
    assert!(module.is_on("tool-busy") && module.is_on("feed-inhibit"));
    for _ in 0..20_000 {
        cycle(&mut all);
        if !module.is_on("tool-busy") {
            (0..5).for_each(|_| cycle(&mut all));
            return all;
        }
    }
    panic!("a tool change does not end");
}

#[test]
fn a_tool_changes_within_the_limits_of_the_joints_for_all_turned_axes() {
    for (machine, value) in [(over_a_table(), 70.0), (with_a_turret_on_a_track(), -25.0)] {
        let module = machine.module();
        for i in 0..6 {
            module.set(&format!("max-velocity.{i}"), 100.0);
            module.set(&format!("max-acceleration.{i}"), 100_000.0);
        }
        module.set("machine-on", 1.0);
        let mut world = pose([10.0, -20.0, 260.0, 12.0, -5.0, value]);
        world[8] = 15.0;
        let to = [15.0, -9.0, 60.0];
        let joints = changed(&module, &world, to);
        let after = Carrying {
            machine: Parallel { tool: to, ..machine.machine.clone() },
            axes: machine.axes.clone(),
            given: machine.given,
        };
        let expected = after.module().inverse(&world).expect("the new tool");
        let last = joints.last().unwrap();
        assert!((0..6).all(|i| (last[i] - expected[i]).abs() < SAME_JOINT_MM));
        let shares = |i: usize| {
            let of = |three: &[Joints]| {
                let [a, b, c] = [three[0][i], three[1][i], three[2][i]];
                [(c - b).abs() / 1e-3 / 100.0, (a - 2.0 * b + c).abs() / 1e-6 / 100_000.0]
            };
            joints.windows(3).map(of).fold([0.0_f64; 2], |m, v| [m[0].max(v[0]), m[1].max(v[1])])
        };
        let most = (0..6).map(shares).fold([0.0_f64; 2], |m, v| [m[0].max(v[0]), m[1].max(v[1])]);
        // It moves, uses the share of a limit that a step may use (0.3), and exceeds neither limit.
        assert!(most.iter().all(|share| *share <= 1.0 + LIMIT_ROUNDING), "{most:?}");
        assert!(most.iter().any(|share| *share > 0.2), "{most:?}");
    }
}

#[test]
fn an_axis_that_turns_during_a_tool_change_switches_the_machine_off() {
    let module = over_a_table().module();
    for i in 0..6 {
        module.set(&format!("max-velocity.{i}"), 100.0);
        module.set(&format!("max-acceleration.{i}"), 1000.0);
    }
    module.set("machine-on", 1.0);
    let mut world = pose([10.0, -20.0, 260.0, 12.0, -5.0, 70.0]);
    let cycle = |world: &Pose| {
        let joints = module.inverse(world);
        module.monitor();
        joints.and_then(|joints| module.follow(&joints, world))
    };
    for _ in 0..10 {
        cycle(&world).expect("at rest");
    }
    module.set("tool-offset", 60.0);
    for _ in 0..40 {
        cycle(&world).expect("a change goes on");
    }
    assert!(module.is_on("tool-busy"));
    world[5] += 0.01;
    let _ = cycle(&world);
    assert_eq!(module.get("fault"), f64::from(Cause::ToolChangeDisturbed.code()));
    assert_eq!(module.inverse(&world), Err(Cause::ToolChangeDisturbed.code()));
}

#[test]
fn what_cannot_be_is_refused_with_its_axis_and_the_last_good_chain_stays() {
    let machine = over_a_table();
    let module = machine.module();
    let world = pose([30.0, 20.0, 260.0, 5.0, -8.0, 70.0]);
    let good = module.inverse(&world).expect("a pose of the workspace");
    let hash = module.get("geometry-hash");
    for (pin, value, cause, joint) in [
        ("chain.c.carries", 4.0, Cause::ChainUnknown, 6.0),
        ("chain.c.carries", -1.0, Cause::ChainUnknown, 6.0),
        ("chain.c.axis.z", 0.0, Cause::ChainAxisZero, 6.0),
        ("chain.c.axis.x", f64::NAN, Cause::ChainNotFinite, 6.0),
        ("chain.c.point.y", f64::INFINITY, Cause::ChainNotFinite, 6.0),
        ("chain.c.point.y", 1e10, Cause::ChainTooFar, 6.0),
        ("work-on-platform.x", 5.0, Cause::HolderNotFinite, -1.0),
        ("work-on-platform.y", f64::INFINITY, Cause::HolderNotFinite, -1.0),
    ] {
        let before = module.get(pin);
        module.clear_messages();
        module.set(pin, value);
        module.monitor_until_all_is_shown();
        assert!(module.is_on("geometry-changed"), "{pin}");
        module.apply();
        assert!(!module.is_on("geometry-ok"), "{pin} = {value}");
        assert_eq!(module.get("fault"), f64::from(cause.code()), "{pin} = {value}");
        assert_eq!(module.get("fault-leg"), joint, "{pin} = {value}");
        assert_eq!(module.inverse(&world), Ok(good), "{pin} = {value}");
        assert_eq!(module.get("geometry-hash"), hash);
        module.set(pin, before);
        module.set("fault-reset", 1.0);
        module.monitor();
        module.set("fault-reset", 0.0);
        module.monitor_until_all_is_shown();
        assert!(!module.is_on("geometry-changed"), "{pin}");
    }
    let mut given = machine.given;
    given.links[2].carries = 0;
    let passing = Carrying { given, ..machine };
    assert_ne!(passing.module().get("geometry-hash"), hash);
}

#[test]
fn values_that_are_no_numbers_are_refused_and_change_nothing() {
    let machine = over_a_table();
    let module = machine.module();
    let world = pose([30.0, 20.0, 260.0, 5.0, -8.0, 70.0]);
    let joints = module.inverse(&world).expect("a pose of the workspace");
    for (value, cause) in [
        (f64::NAN, Cause::PoseNotFinite),
        (f64::NEG_INFINITY, Cause::PoseNotFinite),
        (1.1e6, Cause::AngleTooLarge),
    ] {
        let mut bad = world;
        bad[5] = value;
        let mut untouched = [4.0; 16];
        assert_eq!(module.inverse_into(&bad, &mut untouched), cause.code());
        assert_eq!(untouched, [4.0; 16]);
    }
    let mut bad = joints;
    bad[6] = 1.1e6;
    let mut seed = world;
    assert_eq!(module.forward_into(&bad, &mut seed), Cause::AngleTooLarge.code());
    assert!(seed[0].is_nan() && module.is_on("fwd-kins-fail"));
    let found = module.forward(&joints, &world).expect("its own joints");
    assert!(apart(&found, &world).0 < 1e-7 && !module.is_on("fwd-kins-fail"));
}

#[test]
fn only_axes_that_can_carry_have_the_pins_for_it_and_only_those_that_turn_a_point() {
    let machine = Parallel { coordinates: "XYAB", ..paper_004().into() };
    let module = machine.loaded_with(&[("axes", "CZW")]);
    for (name, is_there) in [("c", true), ("w", true), ("z", false), ("u", false), ("a", false)] {
        assert_eq!(module.has(&format!("chain.{name}.carries")), is_there, "{name}");
        assert_eq!(module.has(&format!("chain.{name}.axis.x")), is_there, "{name}");
        assert_eq!(module.has(&format!("chain.{name}.point.z")), name == "c", "{name}");
    }
    assert_eq!(module.get("chain.c.carries"), 0.0);
    assert!(module.get("work-on-platform.y").is_nan());
}
