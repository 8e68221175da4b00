// SPDX-License-Identifier: GPL-2.0-or-later
//! Tool offsets are requests: they take effect if they move no joint.

use abi_tests::geometry::{minus, norm, plus, rotation, turned};
use abi_tests::machines::{Hexapod, PAPER_004_HOME, paper_004};
use abi_tests::module::{Module, Pose};
use abi_tests::tolerances::{SAME_COMPONENT, SAME_JOINT_MM};
use kinematics::Cause;

const LEVEL: Pose = [10.0, -20.0, 260.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
const TILTED: Pose = [10.0, -20.0, 260.0, 12.0, -5.0, 0.0, 0.0, 0.0, 0.0];
const TOOLS: [&str; 3] = ["tool-offset", "tool-offset-x", "tool-offset-y"];

fn on(module: &Module) {
    module.set("machine-on", 1.0);
}

/// Moves the machine to a pose as LinuxCNC does.
fn at(module: &Module, pose: &Pose) {
    let joints = module.inverse(pose).expect("a pose of the workspace");
    module.follow(&joints, pose).expect("its own joints");
    let _ = module.inverse(pose);
    module.monitor();
}

#[test]
fn a_tool_offset_changes_no_joint_of_a_level_platform() {
    for pin in TOOLS {
        let module = paper_004().module();
        at(&module, &LEVEL);
        on(&module);
        let before = module.inverse(&LEVEL).expect("level");
        module.set(pin, 80.0);
        module.monitor();
        let after = module.inverse(&LEVEL).expect("level");
        for (one, other) in before.iter().zip(after) {
            assert!((one - other).abs() < SAME_JOINT_MM, "{pin}: {one} {other}");
        }
    }
}

#[test]
fn taken_level_it_is_in_force_when_the_platform_tilts() {
    let expected = Hexapod { tool_offset: 80.0, ..paper_004() }.module().inverse(&TILTED);
    let module = paper_004().module();
    at(&module, &LEVEL);
    on(&module);
    module.set("tool-offset", 80.0);
    at(&module, &LEVEL);
    at(&module, &LEVEL);
    assert_eq!(module.get("tool-offset-eff-z"), 80.0);
    assert_eq!(module.inverse(&TILTED), expected);
}

#[test]
fn changed_while_tilted_without_limits_to_go_by_it_is_refused_and_says_why() {
    for pin in TOOLS {
        let module = paper_004().module();
        at(&module, &TILTED);
        on(&module);
        let before = module.inverse(&TILTED).expect("tilted");
        module.set(pin, 80.0);
        at(&module, &TILTED);
        let mut joints = [7.0; 16];
        let code = module.inverse_into(&TILTED, &mut joints);
        assert_eq!(code, Cause::ToolChangedTilted.code(), "{pin}");
        assert_eq!(joints, [7.0; 16], "{pin}");
        module.monitor();
        let said: String = module.messages().into_iter().map(|m| m.text).collect();
        assert!(said.contains(Cause::ToolChangedTilted.text()), "'{said}'");
        module.set(pin, 0.0);
        module.monitor();
        assert_eq!(module.inverse(&TILTED), Ok(before), "{pin} taken back");
    }
}

/// A HAL file for genhexkins connects neither `.machine-on` nor the monitor.
#[test]
fn in_a_drop_in_hal_file_a_change_at_a_tilt_is_refused_too() {
    for pin in TOOLS {
        let module = Module::pkmkins(&[]);
        paper_004().wire(&module);
        let joints = module.inverse(&TILTED).expect("a pose of the workspace");
        module.follow(&joints, &TILTED).expect("its own joints");
        module.set(pin, 80.0);
        assert_eq!(module.inverse(&TILTED), Err(Cause::ToolChangedTilted.code()), "{pin}");
        module.set(pin, 0.0);
        assert_eq!(module.inverse(&TILTED), Ok(joints), "{pin} taken back");
    }
}

#[test]
fn with_the_machine_off_it_is_taken_at_any_tilt() {
    let expected = Hexapod { tool_offset: 80.0, ..paper_004() }.module().inverse(&TILTED);
    let module = paper_004().module();
    at(&module, &TILTED);
    module.set("tool-offset", 80.0);
    module.monitor();
    assert_eq!(module.inverse(&TILTED), expected);
}

/// P = t − o + R o: all three components move the platform's origin alike.
#[test]
fn the_offset_is_a_vector_in_the_platform() {
    let machine = Hexapod { lead: 0.0, ..paper_004() };
    let o = [7.0, -11.0, 80.0];
    let module = machine.module();
    for (pin, value) in ["tool-offset-x", "tool-offset-y", "tool-offset"].into_iter().zip(o) {
        module.set(pin, value);
    }
    let joints = module.inverse(&TILTED).expect("tilted");
    let r = rotation(&TILTED);
    let t = [TILTED[0], TILTED[1], TILTED[2]];
    for (leg, joint) in joints.iter().enumerate().take(6) {
        let anchor = plus(minus(t, o), turned(&r, plus(o, machine.platform[leg])));
        let length = norm(minus(anchor, machine.base[leg]));
        assert!((joint - length).abs() < SAME_JOINT_MM, "leg {leg}: {} {length}", joints[leg]);
    }
}

#[test]
fn forward_uses_the_offset_that_inverse_uses() {
    let module = Hexapod { tool_offset: 80.0, spindle_offset: -30.0, ..paper_004() }.module();
    let joints = module.inverse(&TILTED).expect("tilted");
    let pose = module.follow(&joints, &PAPER_004_HOME).expect("its own joints");
    for (one, other) in pose.iter().zip(TILTED) {
        assert!((one - other).abs() < SAME_COMPONENT, "{pose:?}");
    }
}

#[test]
fn an_offset_that_is_not_finite_is_refused_and_forgotten_when_mended() {
    for pin in TOOLS {
        for value in [f64::NAN, f64::INFINITY] {
            let module = paper_004().module();
            at(&module, &LEVEL);
            on(&module);
            let before = module.inverse(&LEVEL);
            module.set(pin, value);
            module.monitor();
            let mut joints = [7.0; 16];
            let code = module.inverse_into(&LEVEL, &mut joints);
            assert_eq!(code, Cause::ToolNotFinite.code(), "{pin} {value}");
            assert_eq!(joints, [7.0; 16]);
            module.set(pin, 0.0);
            module.monitor();
            assert_eq!(module.inverse(&LEVEL), before, "{pin} {value}");
        }
    }
}

/// The display continues with the active tool.
#[test]
fn a_tool_offset_beyond_any_machine_is_refused_by_inverse() {
    for pin in TOOLS {
        for value in [1e12, -1e300] {
            let module = paper_004().module();
            at(&module, &LEVEL);
            let joints = module.inverse(&LEVEL).expect("level");
            module.set(pin, value);
            assert_eq!(module.inverse(&LEVEL), Err(Cause::ToolTooLong.code()), "{pin}");
            assert!(module.follow(&joints, &LEVEL).is_ok(), "{pin}");
            module.set(pin, 0.0);
            assert_eq!(module.inverse(&LEVEL), Ok(joints), "{pin} set back");
        }
    }
}
