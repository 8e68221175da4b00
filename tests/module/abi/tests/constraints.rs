// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines with constraints of the platform in the module: golden poses, dependent coordinates on pins, tool changes
//! at a tilt, and constraints that are refused.

use abi_tests::module::{Joints, Module, Pose};
use kinematics::Cause;
use serde::Deserialize;

type Vector = [f64; 3];

#[derive(Deserialize)]
struct Row {
    machine: String,
    tip: Vector,
    pose: [f64; 6],
    joints: Vec<f64>,
}

#[derive(Deserialize)]
struct Golden {
    row: Vec<Row>,
}

fn golden() -> Vec<Row> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../cases/golden/constraints.toml");
    let text = std::fs::read_to_string(path).unwrap();
    toml::from_str::<Golden>(&text).unwrap().row
}

const X: Vector = [1.0, 0.0, 0.0];
const Y: Vector = [0.0, 1.0, 0.0];
const Z: Vector = [0.0, 0.0, 1.0];

fn on_circle(radius: f64, degrees: f64, z: f64) -> Vector {
    let (sin, cos) = degrees.to_radians().sin_cos();
    [radius * cos, radius * sin, z]
}

fn set(module: &Module, name: &str, values: &[f64]) {
    for (letter, value) in ["x", "y", "z", "a", "b", "c"].iter().zip(values) {
        module.set(&format!("{name}.{letter}"), *value);
    }
}

/// Sets a constraint: its kind, and its vectors by name.
fn constrain(module: &Module, n: usize, kind: f64, vectors: &[(&str, Vector)]) {
    module.set(&format!("constraint.{n}.kind"), kind);
    for (name, vector) in vectors {
        set(module, &format!("constraint.{n}.{name}"), vector);
    }
}

/// Returns a machine of the golden rows with its geometry on pins, not yet applied.
fn machine(name: &str, table: &'static str) -> Module {
    machine_with(name, table, &[])
}

/// Returns the same with more load parameters.
fn machine_with(name: &str, table: &'static str, more: &[(&str, &str)]) -> Module {
    let (legs, coordinates) = match name {
        "z3-head" => ("slider:3", "ZAB"),
        _ => ("strut:3", "XYZ"),
    };
    let mut all = more.to_vec();
    all.extend([("legs", legs), ("coordinates", coordinates), ("table", table)]);
    all.push(("constraints", "3"));
    let module = Module::pkmkins(&all);
    let around = [90.0, 210.0, 330.0];
    match name {
        "tricept" => {
            for (n, t) in around.into_iter().enumerate() {
                set(&module, &format!("base.{n}"), &on_circle(400.0, t, 0.0));
                set(&module, &format!("platform.{n}"), &on_circle(150.0, t, 40.0));
            }
            constrain(&module, 0, 2.0, &[("normal", Y)]);
            constrain(&module, 1, 2.0, &[("normal", X)]);
            constrain(&module, 2, 3.0, &[("platform-axis", Y), ("base-axis", X)]);
        }
        "z3-head" => {
            for (n, t) in around.into_iter().enumerate() {
                set(&module, &format!("base.{n}"), &on_circle(320.0, t, 0.0));
                set(&module, &format!("platform.{n}"), &on_circle(200.0, t, 0.0));
                set(&module, &format!("guide.{n}"), &[0.0, 0.0, -1.0]);
                module.set(&format!("rod.{n}"), 500.0);
                module.set(&format!("side.{n}"), -1.0);
                let vectors = [
                    ("platform", on_circle(200.0, t, 0.0)),
                    ("normal", on_circle(1.0, t + 90.0, 0.0)),
                ];
                constrain(&module, n, 1.0, &vectors);
            }
        }
        _ => {
            let anchors = [
                ([-350.0, 0.0, 0.0], [-150.0, 0.0, 0.0], Y),
                ([350.0, 0.0, 0.0], [150.0, 0.0, 0.0], Y),
                ([0.0, 450.0, 0.0], [0.0, 160.0, 0.0], X),
            ];
            for (n, (base, platform, normal)) in anchors.into_iter().enumerate() {
                set(&module, &format!("base.{n}"), &base);
                set(&module, &format!("platform.{n}"), &platform);
                let vectors = [("platform", platform), ("base", base), ("normal", normal)];
                constrain(&module, n, 2.0, &vectors);
            }
        }
    }
    set(&module, "home", &home(name));
    // Axes of genhexkins' struts, which have no effect without a lead.
    module
}

fn home(name: &str) -> [f64; 6] {
    let z = if name == "z3-head" { -700.0 } else { -900.0 };
    [0.0, 0.0, z, 0.0, 0.0, 0.0]
}

fn world(pose: &[f64; 6]) -> Pose {
    std::array::from_fn(|k| pose.get(k).copied().unwrap_or(0.0))
}

fn applied(name: &str, table: &'static str) -> Module {
    let module = machine(name, table);
    module.apply();
    assert!(module.is_on("geometry-ok"), "{name}: {:?}", module.messages());
    module
}

const DEPENDENT: [(&str, [usize; 3]); 3] =
    [("tricept", [3, 4, 5]), ("z3-head", [0, 1, 5]), ("exechon", [3, 4, 5])];

#[test]
fn golden_poses_have_their_joints_and_dependent_coordinates_on_pins() {
    let rows = golden();
    assert_eq!(rows.len(), 12);
    for Row { machine: name, tip, pose, joints } in rows {
        let module = applied(&name, "");
        for (pin, value) in ["tool-offset-x", "tool-offset-y", "tool-offset"].iter().zip(tip) {
            module.set(pin, -value);
        }
        let (_, dependent) = DEPENDENT.iter().find(|(known, _)| *known == name).unwrap();
        let full: [f64; 6] =
            std::array::from_fn(|k| if k < 3 { pose[k] - tip[k] } else { pose[k] });
        let mut commanded = full;
        dependent.iter().for_each(|k| commanded[*k] = 0.0);
        let found = module.inverse(&world(&commanded)).expect("a pose of the workspace");
        for (one, other) in found.iter().zip(&joints) {
            // The precision that is required of all machines: 1e-9 of a size of 900 mm.
            assert!((one - other).abs() <= 9e-7, "{name} {pose:?}: {found:?}");
        }
        let back = module.forward(&found, &world(&home(&name))).expect("its joints");
        module.monitor_until_all_is_shown();
        for k in 0..6 {
            assert!((back[k] - commanded[k]).abs() <= 1e-7, "{name}: {back:?} {commanded:?}");
            let letter = ["x", "y", "z", "a", "b", "c"][k];
            if dependent.contains(&k) {
                let shown = module.get(&format!("dependent.{letter}"));
                assert!((shown - full[k]).abs() <= 9e-7, "{name} {letter}: {shown} {full:?}");
            }
        }
    }
}

#[test]
fn a_dependent_letter_is_refused_by_its_name() {
    let module = applied("tricept", "");
    let mut pose = world(&home("tricept"));
    pose[4] = 1.0;
    assert_eq!(module.inverse(&pose), Err(Cause::DependentGiven.code()));
    module.monitor();
    let messages = module.messages();
    let last = &messages.last().expect("a message").text;
    assert!(last.contains("on this machine B follows from X Y Z"), "{last}");
}

#[test]
fn a_table_under_a_head_compensates_its_motion_in_both_directions() {
    let module = applied("z3-head", "XY");
    module.set("tool-offset", 150.0);
    let mut seed = world(&home("z3-head"));
    for n in 0..200 {
        let t = f64::from(n) * 0.05;
        let pose = world(&[
            20.0,
            -30.0,
            -700.0 + 5.0 * t.sin(),
            25.0 * t.sin(),
            20.0 * (0.7 * t).sin(),
            0.0,
        ]);
        let joints = module.inverse(&pose).unwrap();
        let back = module.forward(&joints, &seed).unwrap();
        for k in 0..6 {
            // 1e-10 of the size, and as many degrees.
            assert!((back[k] - pose[k]).abs() <= 1e-7, "{back:?} {pose:?}");
        }
        seed = back;
    }
}

#[test]
fn a_constraint_without_kind_or_direction_is_refused_with_its_number() {
    for (n, name, value) in [(1, "kind", 0.0), (2, "base-axis.x", 0.0)] {
        let module = machine("tricept", "");
        module.set(&format!("constraint.{n}.{name}"), value);
        module.apply();
        assert!(!module.is_on("geometry-ok"));
        assert_eq!(module.get("fault"), f64::from(Cause::ConstraintAxisZero.code()));
        assert_eq!(module.get("fault-leg"), f64::from(n));
    }
}

#[test]
fn the_monitor_changes_a_tool_at_a_tilt_within_the_limits_of_the_joints() {
    let (speed, acceleration) = (100.0, 1000.0);
    for name in ["tricept", "z3-head", "exechon"] {
        let module = machine(name, "");
        for n in 0..3 {
            module.set(&format!("min-limit.{n}"), -2000.0);
            module.set(&format!("max-limit.{n}"), 3000.0);
            module.set(&format!("max-velocity.{n}"), speed);
            module.set(&format!("max-acceleration.{n}"), acceleration);
        }
        module.apply();
        module.set("machine-on", 1.0);
        let pose = match name {
            "z3-head" => world(&[0.0, 0.0, -680.0, 15.0, -10.0, 0.0]),
            _ => world(&[150.0, -120.0, -900.0, 0.0, 0.0, 0.0]),
        };
        let mut all: Vec<Joints> = vec![];
        let cycle = |all: &mut Vec<Joints>| {
            if let Some(joints) = all.last() {
                module.follow(joints, &pose).expect("the joints of inverse");
            }
            let joints = module.inverse(&pose);
            module.monitor();
            all.push(joints.expect("the change goes on"));
        };
        (0..10).for_each(|_| cycle(&mut all));
        module.set("tool-offset", 60.0);
        let mut cycles = 0;
        cycle(&mut all);
        while module.is_on("tool-busy") {
            cycle(&mut all);
            cycles += 1;
            assert!(cycles < 40_000, "{name}: the change does not end");
        }
        (0..5).for_each(|_| cycle(&mut all));
        assert!(cycles > 50, "{name}: {cycles}");
        assert_eq!(module.get("tool-offset-eff-z"), 60.0);
        let dt = 1e-3;
        for three in all.windows(3) {
            for n in 0..3 {
                let [a, b, c] = [three[0][n], three[1][n], three[2][n]];
                assert!((c - b).abs() / dt <= speed, "{name} joint {n}");
                // Rounding of 1e-13 mm in a cycle of 1 ms is 1e-7 mm/s².
                let found = (c - 2.0 * b + a).abs() / (dt * dt);
                assert!(found <= acceleration + 1e-3, "{name} joint {n}: {found}");
            }
        }
        // As if the tool had been there before.
        let fresh = machine(name, "");
        fresh.apply();
        fresh.set("tool-offset", 60.0);
        let expected = fresh.inverse(&pose).unwrap();
        for (one, other) in all.last().unwrap().iter().zip(expected) {
            assert!((one - other).abs() <= 1e-9, "{name}: {one} {other}");
        }
    }
}

/// Returns the tricept with a two-axis wrist on its platform.
fn with_wrist() -> Module {
    let module = machine_with("tricept", "", &[("axes", "AB")]);
    for (letter, axis, point) in [("a", X, [0.0, 0.0, -80.0]), ("b", Y, [0.0, 0.0, -120.0])] {
        module.set(&format!("chain.{letter}.carries"), 2.0);
        set(&module, &format!("chain.{letter}.axis"), &axis);
        set(&module, &format!("chain.{letter}.point"), &point);
    }
    module.apply();
    assert!(module.is_on("geometry-ok"), "{:?}", module.messages());
    module
}

#[test]
fn a_wrist_on_a_platform_with_constraints_finds_its_pose_back() {
    let module = with_wrist();
    module.set("tool-offset", 100.0);
    let mut seed = world(&home("tricept"));
    for n in 0..200 {
        let t = f64::from(n) * 0.05;
        let pose = world(&[80.0, -60.0, -1000.0, 30.0 * t.sin(), 25.0 * (0.7 * t).sin(), 0.0]);
        let joints = module.inverse(&pose).unwrap();
        // The wrist's letters are its joints.
        assert_eq!([joints[3], joints[4]], [pose[3], pose[4]]);
        let back = module.forward(&joints, &seed).unwrap();
        for k in 0..6 {
            // 1e-10 of the size, and as many degrees.
            assert!((back[k] - pose[k]).abs() <= 1e-7, "{back:?} {pose:?}");
        }
        seed = back;
    }
}

/// Beside constraints, a change of the tool offset would turn the platform under the axes: the module does not move the
/// joints there. Without a tilt nothing moves.
#[test]
fn a_tool_change_that_moves_a_platform_below_an_axis_is_refused_until_it_is_withdrawn() {
    let table = || {
        let module = machine_with("tricept", "", &[("axes", "C")]);
        module.set("chain.c.carries", 1.0);
        set(&module, "chain.c.axis", &Z);
        set(&module, "chain.c.point", &[30.0, -20.0, -1000.0]);
        module.apply();
        assert!(module.is_on("geometry-ok"), "{:?}", module.messages());
        module
    };
    let level = world(&home("tricept"));
    for (module, tilted) in [
        (with_wrist(), world(&[0.0, 0.0, -950.0, 20.0, 0.0, 0.0])),
        (with_wrist(), world(&[50.0, 0.0, -950.0, 0.0, 0.0, 0.0])),
        (table(), world(&[50.0, 0.0, -950.0, 0.0, 0.0, 90.0])),
    ] {
        module.set("machine-on", 1.0);
        // A servo cycle at a pose: as LinuxCNC, forward of the last joints, then inverse.
        let last = std::cell::RefCell::new(None::<Joints>);
        let cycle = |pose: &Pose| {
            if let Some(joints) = &*last.borrow() {
                // Refused together with inverse.
                let _ = module.follow(joints, pose);
            }
            let joints = module.inverse(pose);
            module.monitor();
            if let Ok(joints) = &joints {
                *last.borrow_mut() = Some(*joints);
            }
            joints
        };
        for (pose, is_refused) in [(level, false), (tilted, true)] {
            module.set("tool-offset", 0.0);
            (0..10).for_each(|_| _ = cycle(&level).expect("without a tool"));
            (0..10).for_each(|_| _ = cycle(&pose).expect("without a tool"));
            let before = cycle(&pose).expect("without a tool");
            module.set("tool-offset", 60.0);
            (0..10).for_each(|_| _ = cycle(&pose));
            let found = cycle(&pose);
            let expected = is_refused.then(|| Cause::ToolChangedTilted.code());
            assert_eq!(found.err(), expected, "{pose:?}");
            assert_eq!(module.get("tool-offset-eff-z"), if is_refused { 0.0 } else { 60.0 });
            if is_refused {
                module.set("tool-offset", 0.0);
                let _ = cycle(&pose);
                assert_eq!(cycle(&pose), Ok(before));
            }
        }
    }
}
