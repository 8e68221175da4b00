// SPDX-License-Identifier: GPL-2.0-or-later
//! What goes before a counted run of `pkmkins.monitor`: a machine in motion with everything
//! to guard, a geometry to freeze, a tool that changes at a tilt.

use crate::cases::{Aim, Case};
use abi_tests::control::Control;
use abi_tests::guarded::set_limits;
use abi_tests::module::{Joints, Module, Pose};

/// Seconds of a servo cycle.
const PERIOD: f64 = 1e-3;

/// Cycles of a motion until it is seen as one, and until each place ahead of it was looked at.
const BEGINNING: u32 = 3;
const GOING_ON: u32 = BEGINNING + 9;

/// A motion up to the case's pose, by the case's step in each cycle: one that goes on in the usual
/// case; else one that has just begun, with all places to be looked at. Every limit is
/// set and none of those that would spare the rest is met, so that all of them are compared.
pub fn move_on(case: &Case, control: &Control, module: &Module) {
    stand_still(module);
    set_limits(&control.mechanisms(), module);
    let speed = case.joints.iter().take(3).map(|step| step * step).sum::<f64>().sqrt() / PERIOD;
    for pin in ["requested-vel", "current-vel"] {
        module.set(pin, speed);
    }
    // `limit` is a share in per cent here: of the hold that the legs would have to keep.
    module.set("conditioning-limit", f64::from(case.limit) / 100.0);
    let cycles = if case.aim == Aim::Typical { GOING_ON } else { BEGINNING };
    for back in (0..cycles).rev().map(f64::from) {
        let mut pose = case.pose;
        for (value, step) in pose.iter_mut().zip(&case.joints) {
            *value -= back * step;
        }
        // A little off the straight line, so that the way ahead is a circle.
        pose[2] += 1e-3 * back * back * case.joints[0];
        servo_cycle(module, &pose);
        if back > 0.0 {
            module.monitor();
        }
    }
}

/// Ends a motion and what was told about it. The number of cycles is odd together with those of the
/// motion, so that one case after the other counts each of the cycles in which the monitor shows all it has.
fn stand_still(module: &Module) {
    module.set("requested-vel", 0.0);
    for reset in [1.0, 0.0, 0.0] {
        module.set("fault-reset", reset);
        module.monitor();
    }
}

/// The kinematics calls of a cycle; any may be refused.
fn servo_cycle(module: &Module, pose: &Pose) {
    if let Ok(joints) = module.inverse(pose) {
        let _ = module.forward(&joints, pose);
    }
    let _ = module.inverse(pose);
}

/// One cycle of a change of the tool at the case's pose; in the first it is asked for.
pub fn change_tool(case: &Case, control: &Control, module: &Module) {
    if case.limit == 0 {
        begin_change(case, control, module);
    }
    servo_cycle(module, &case.pose);
}

fn begin_change(case: &Case, control: &Control, module: &Module) {
    let offset = |joints: &Joints| {
        // Of a second mechanism at the same time.
        for stem in ["", "second."].into_iter().take(control.mechanisms().len()) {
            let pins = ["tool-offset-x", "tool-offset-y", "tool-offset"];
            for (pin, value) in pins.into_iter().zip(joints) {
                module.set(&format!("{stem}{pin}"), *value);
            }
        }
    };
    // Taken at once with the machine off.
    module.set("machine-on", 0.0);
    offset(&[0.0; 16]);
    stand_still(module);
    set_limits(&control.mechanisms(), module);
    module.set("machine-on", 1.0);
    for _ in 0..2 {
        servo_cycle(module, &case.pose);
        module.monitor();
    }
    offset(&case.joints);
}

/// A geometry to freeze again and a fault to tell.
pub fn make_busy(case: &Case, control: &Control, module: &Module) {
    module.set("apply", 0.0);
    module.monitor();
    let joints = module.inverse(&control.home()).expect("home");
    let _ = module.forward(&joints, &control.home());
    let _ = module.inverse(&case.pose);
    let _ = module.inverse(&[f64::NAN; 9]);
    module.set("apply", 1.0);
}
