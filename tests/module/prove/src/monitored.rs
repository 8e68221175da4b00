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

/// Sets what makes of a motion a jog in world mode, with a correction of every joint on its way: at 1e-6 of the
/// size a second none arrives within the cycles that are counted.
pub fn begin_jog(case: &Case, control: &Control, module: &Module) {
    let size = control.size();
    module.set("jogging", 1.0);
    for letter in ["x", "y", "z", "a", "b", "c", "u", "v", "w"] {
        let pin = format!("axis-max-velocity.{letter}");
        if module.has(&pin) {
            module.set(&pin, size);
        }
    }
    for n in (0..).take_while(|n| module.has(&format!("joint-correction.{n}"))) {
        module.set(&format!("correction-limit.{n}"), 1e-3 * size);
        module.set(&format!("correction-rate.{n}"), 1e-6 * size);
        // To and fro, from case to case.
        module.set(&format!("joint-correction.{n}"), (1e-6 * size).copysign(case.joints[0]));
    }
}

/// Cycles of a commanded motion through a singular pose: so many there, and as many back.
pub const PASSING: u32 = 24;

/// The pose that is commanded in a cycle of [`pass_singular`].
pub fn passing_pose(case: &Case, cycle: u32) -> Pose {
    let steps = f64::from(cycle.min(PASSING - cycle));
    std::array::from_fn(|k| case.pose[k] + steps * case.joints[k])
}

/// What goes before forward in a cycle of a commanded motion through a singular pose, the first of which
/// begins anew; returns the joints of the cycle.
pub fn pass_singular(case: &Case, control: &Control, module: &Module) -> Joints {
    let mut joints = [0.0; 16];
    if case.limit == 0 {
        assert!(control.apply(module), "{:?}", module.messages());
        let _ = module.inverse_into(&case.pose, &mut joints);
        return joints;
    }
    let before = passing_pose(case, case.limit - 1);
    let _ = module.inverse_into(&before, &mut joints);
    module.monitor();
    joints
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

/// Lets the seed of the next call of forward be where it starts, with the pose at home known until then unless
/// the joints are not homed.
pub fn begin_forward(case: &Case, control: &Control, module: &Module) {
    let home = if case.is_before_homing() { [f64::NAN; 9] } else { control.home() };
    module.take_reference_away_at(&home);
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
