// SPDX-License-Identifier: GPL-2.0-or-later
//! The preparation of a counted run of `pkmkins.monitor`: a machine in motion with everything
//! to guard, a geometry to freeze, a tool that changes at a tilt.

use crate::cases::{Aim, Case};
use abi_tests::control::Control;
use abi_tests::guarded::set_limits;
use abi_tests::module::{Joints, Module, Pose};

/// Seconds of a servo cycle.
const PERIOD: f64 = 1e-3;

/// Cycles of a motion until it is detected, and until each pose ahead of it was checked.
const BEGINNING: u32 = 3;
const GOING_ON: u32 = BEGINNING + 9;

/// Moves to the case's pose, by the case's step in each cycle: the motion continues in the typical
/// case; otherwise it has just begun, with all poses ahead to check. Every limit is
/// set and none is violated that would skip the rest, so that all of them are compared.
pub fn move_on(case: &Case, control: &Control, module: &Module) {
    stand_still(module);
    set_limits(&control.mechanisms(), module);
    let speed = case.joints.iter().take(3).map(|step| step * step).sum::<f64>().sqrt() / PERIOD;
    for pin in ["requested-vel", "current-vel"] {
        module.set(pin, speed);
    }
    // `limit` is in per cent of the required conditioning here.
    module.set("conditioning-limit", f64::from(case.limit) / 100.0);
    let cycles = if case.aim == Aim::Typical { GOING_ON } else { BEGINNING };
    for back in (0..cycles).rev().map(f64::from) {
        let mut pose = case.pose;
        for (value, step) in pose.iter_mut().zip(&case.joints) {
            *value -= back * step;
        }
        // Slightly off the straight line, so that the path ahead is a circle.
        pose[2] += 1e-3 * back * back * case.joints[0];
        servo_cycle(module, &pose);
        if back > 0.0 {
            module.monitor();
        }
    }
}

/// Turns a motion into a jog in world mode, with an active correction of every joint: at 1e-6 of the
/// size per second none arrives within the counted cycles.
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
        // Alternate the direction from case to case.
        module.set(&format!("joint-correction.{n}"), (1e-6 * size).copysign(case.joints[0]));
    }
}

/// Cycles of a commanded motion through a singular pose in each direction.
pub const PASSING: u32 = 24;

/// Returns the pose commanded in a cycle of [`pass_singular`].
pub fn passing_pose(case: &Case, cycle: u32) -> Pose {
    let steps = f64::from(cycle.min(PASSING - cycle));
    std::array::from_fn(|k| case.pose[k] + steps * case.joints[k])
}

/// Prepares forward in a cycle of a commanded motion through a singular pose; returns the joints of the cycle. Cycle 0
/// applies the geometry again.
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

/// Ends a motion and clears its reports. The number of cycles plus those of the
/// motion is odd, so that successive cases cover each of the cycles over which the monitor spreads its updates.
fn stand_still(module: &Module) {
    module.set("requested-vel", 0.0);
    for reset in [1.0, 0.0, 0.0] {
        module.set("fault-reset", reset);
        module.monitor();
    }
}

/// Makes the seed of the next call of forward its start, with the pose at home known until then unless
/// the joints are not homed.
pub fn begin_forward(case: &Case, control: &Control, module: &Module) {
    let home = if case.is_before_homing() { [f64::NAN; 9] } else { control.home() };
    module.take_reference_away_at(&home);
}

/// Makes the kinematics calls of a cycle; any may be refused.
fn servo_cycle(module: &Module, pose: &Pose) {
    if let Ok(joints) = module.inverse(pose) {
        let _ = module.forward(&joints, pose);
    }
    let _ = module.inverse(pose);
}

/// Runs one cycle of a change of the tool at the case's pose; the first one requests it.
pub fn change_tool(case: &Case, control: &Control, module: &Module) {
    if case.limit == 0 {
        begin_change(case, control, module);
    }
    servo_cycle(module, &case.pose);
}

fn begin_change(case: &Case, control: &Control, module: &Module) {
    let offset = |joints: &Joints| {
        // Request it for a second mechanism at the same time.
        for stem in ["", "second."].into_iter().take(control.mechanisms().len()) {
            let pins = ["tool-offset-x", "tool-offset-y", "tool-offset"];
            for (pin, value) in pins.into_iter().zip(joints) {
                module.set(&format!("{stem}{pin}"), *value);
            }
        }
    };
    // It takes effect at once with the machine off.
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

/// Prepares a geometry to freeze again and a fault to report.
pub fn make_busy(case: &Case, control: &Control, module: &Module) {
    module.set("apply", 0.0);
    module.monitor();
    let joints = module.inverse(&control.home()).expect("home");
    let _ = module.forward(&joints, &control.home());
    let _ = module.inverse(&case.pose);
    let _ = module.inverse(&[f64::NAN; 9]);
    module.set("apply", 1.0);
}
