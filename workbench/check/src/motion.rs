// SPDX-License-Identifier: GPL-2.0-or-later
//! Settings of LinuxCNC's motion that are probably not intended: units, periods, missing keys, extreme values.

use crate::findings::Report;
use crate::motors::{self, Motor};
use crate::wiring::at_key;
use kinematics::{Joints, Letter, Pose};
use machine::digits::plain;
use machine::read::diagnostic::Severity;
use machine::read::ini::IniError;
use machine::read::joints::{Joint, JointKind};
use machine::read::mechanism::Mechanism;

/// Usual servo periods, nanoseconds: from the shortest that a computer can keep to the longest that a drive can follow.
const PERIODS: [f64; 2] = [100_000.0, 10_000_000.0];

/// Largest number of spindles in LinuxCNC.
const SPINDLES: usize = 8;

/// Following error limit, as a share of a joint's range, above which it no longer stops anything in time.
const LOOSE: f64 = 0.1;

/// Largest ratio of the joint speed that a single axis may require to the joint's speed: a lower ratio is left to the
/// guard, and a speed per minute is 60 times as large.
const FAST: f64 = 10.0;

/// Largest change of a joint's speed by a correction in a cycle, in units of its rate: once when it begins, and twice
/// if LinuxCNC changes its mode meanwhile and drops the two cycles by which its smoothing is late.
const IN_A_CYCLE: f64 = 2.0;

/// Backlash of a drive, in mm and degrees, above which its unit is doubted: worn screws and gears have less.
const WORN: f64 = 1.0;

/// Steps of finite differences: share of the machine's size, and degrees.
const STEP: [f64; 2] = [1e-4, 0.01];

/// Checks all of it.
///
/// # Errors
/// A value that is not a number.
pub(super) fn check(report: &mut Report, config: &Mechanism) -> Result<(), IniError> {
    if !config.place.is_second {
        angles(report, config);
        letters(report, config);
        period(report, config)?;
        answers(report, config)?;
        spindles(report, config);
    }
    for (i, joint) in config.joints.iter().enumerate() {
        let section = config.place.joint_section(i);
        kind(report, config, &section, joint);
        following(report, config, &section, joint)?;
        ramp(report, config, &section, joint);
    }
    for motor in motors::of(config) {
        backlash(report, config, &motor)?;
    }
    tables(report, config);
    extra(report, config);
    let letters = Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l));
    for letter in letters {
        let section = config.place.axis_section(letter);
        defaults(report, config, &section);
        wrapped(report, config, letter, &section);
        too_fast(report, config, letter, &section);
    }
    Ok(())
}

/// Checks that the angular unit is degrees, as in the kinematics. LinuxCNC accepts a name, in lower or upper case, or
/// the number of units per degree; `degrees` ends its start, as does a missing key.
fn angles(report: &mut Report, config: &Mechanism) {
    let is_degree = config.ini.first("TRAJ", "ANGULAR_UNITS").is_some_and(|entry| {
        let value = entry.value.to_lowercase();
        ["deg", "degree"].contains(&value.as_str()) || value.parse() == Ok(1.0)
    });
    if !is_degree {
        let text = "expected degree, the unit of the kinematics and of all angles in the file";
        report.finding(Severity::Error, at_key(&config.ini, "TRAJ", "ANGULAR_UNITS", text));
    }
}

fn period(report: &mut Report, config: &Mechanism) -> Result<(), IniError> {
    let [least, most] = PERIODS;
    let given = config.ini.first("EMCMOT", "SERVO_PERIOD");
    if let Some(entry) = given.filter(|entry| entry.value.trim().parse::<i64>().is_err()) {
        let text = "LinuxCNC fails to start: expected whole nanoseconds, usually 1000000";
        report.finding(Severity::Error, config.ini.refuse(entry, text));
    }
    let period = config.ini.number_or("EMCMOT", "SERVO_PERIOD", 1e6)?;
    if !(least..=most).contains(&period) {
        let text = format!(
            "a servo cycle of {} ms: expected nanoseconds, {least} to {most}, usually 1000000",
            period * 1e-6
        );
        report.finding(Severity::Warning, at_key(&config.ini, "EMCMOT", "SERVO_PERIOD", &text));
    }
    Ok(())
}

/// Checks how long LinuxCNC's task waits for motion, which accepts a command in a servo cycle.
fn answers(report: &mut Report, config: &Mechanism) -> Result<(), IniError> {
    const KEY: (&str, &str) = ("EMCMOT", "COMM_TIMEOUT");
    if config.ini.number_or(KEY.0, KEY.1, 1.0)? <= config.period {
        let text = "LinuxCNC fails to start, because motion answers once per servo cycle: expected seconds, usually 1";
        report.finding(Severity::Error, at_key(&config.ini, KEY.0, KEY.1, text));
    }
    Ok(())
}

/// Checks the number of spindles that LinuxCNC's task sets up, and that programs may name.
fn spindles(report: &mut Report, config: &Mechanism) {
    let Some(entry) = config.ini.first("TRAJ", "SPINDLES") else { return };
    let count = entry.value.trim().parse::<usize>();
    if !count.is_ok_and(|count| (1..=SPINDLES).contains(&count)) {
        let text = format!(
            "LinuxCNC fails to start: expected an integer from 1 to {SPINDLES}, 1 for a machine without a spindle"
        );
        report.finding(Severity::Error, config.ini.refuse(entry, &text));
    }
}

/// Reports lengths that are declared as angles, or vice versa.
fn kind(report: &mut Report, config: &Mechanism, section: &str, joint: &Joint) {
    let expected = if joint.kind == JointKind::Arm { "ANGULAR" } else { "LINEAR" };
    if let Some(entry) = config.ini.first(section, "TYPE").filter(|entry| entry.value != expected) {
        let text = format!("expected {expected}, the type of {}", joint.name);
        report.finding(Severity::Error, config.ini.refuse(entry, &text));
    }
}

/// Reports following errors that are LinuxCNC's defaults, or that stop nothing.
fn following(
    report: &mut Report,
    config: &Mechanism,
    section: &str,
    joint: &Joint,
) -> Result<(), IniError> {
    let (ini, unit) = (&config.ini, config.unit(joint.kind));
    let range = plain(joint.max - joint.min);
    let most = plain(LOOSE * range);
    let allowed = ini.number_or(section, "FERROR", 1.0)?;
    let least = ini.number_or(section, "MIN_FERROR", 0.0)?;
    let text = match ini.first(section, "FERROR") {
        None => {
            Some(format!("LinuxCNC uses 1 {unit}: set the allowed following error at MAX_VELOCITY"))
        }
        Some(_) if allowed >= most => Some(format!(
            "{} may lag by {allowed} {unit}, {most} or more of its range of {}: a drive that does not follow moves the \
             platform far before it stops",
            joint.name, range
        )),
        _ => None,
    };
    if let Some(text) = text {
        report.finding(Severity::Warning, at_key(ini, section, "FERROR", &text));
    }
    if least > allowed {
        let text =
            format!("it exceeds FERROR, {allowed}, which then has no effect: use less than FERROR");
        report.finding(Severity::Warning, at_key(ini, section, "MIN_FERROR", &text));
    }
    Ok(())
}

/// Reports corrections whose acceleration exceeds the drive's: they reach their full speed in a cycle.
fn ramp(report: &mut Report, config: &Mechanism, section: &str, joint: &Joint) {
    let [_, rate] = joint.correction;
    let most = plain(joint.max_acceleration * config.period / IN_A_CYCLE);
    if rate > most {
        let text = format!(
            "it starts and stops within a servo cycle, in which at most {most} {} per second keep MAX_ACCELERATION = {}: \
             lower it",
            config.unit(joint.kind),
            joint.max_acceleration
        );
        report.finding(Severity::Error, at_key(&config.ini, section, "CORRECTION_RATE", &text));
    }
}

/// Reports backlash beyond that of any drive, or with the wrong sign.
fn backlash(
    report: &mut Report,
    config: &Mechanism,
    Motor { section, joint, unit, turns }: &Motor,
) -> Result<(), IniError> {
    const KEY: &str = "BACKLASH";
    let ini = &config.ini;
    let play = ini.number_or(section, KEY, 0.0)?;
    let scale = if *turns { 1.0 } else { config.units_per_mm };
    let text = if play < 0.0 {
        format!("LinuxCNC then increases the play: use {}, or remove the key", -play)
    } else if play > WORN * scale {
        format!(
            "at every reversal of {} LinuxCNC moves the drive by {play} {unit}, and the platform too if the play is \
             smaller: expected the play in {unit}",
            joint.name
        )
    } else {
        return Ok(());
    };
    report.finding(Severity::Warning, at_key(ini, section, KEY, &text));
    Ok(())
}

/// Reports table axes that are slower than the coordinate that they follow one to one while the machine is level, or
/// whose range is smaller.
fn tables(report: &mut Report, config: &Mechanism) {
    let joints =
        config.joints[config.legs()..].iter().zip(config.machine.layout().table().as_slice());
    for (n, (joint, letter)) in joints.enumerate() {
        let (own, axis) =
            (config.place.joint_section(config.legs() + n), config.place.axis_section(*letter));
        let limits = config.programmed[letter.index()];
        for (key, of_axis, of_joint) in [
            ("MAX_VELOCITY", limits.max_velocity, joint.max_velocity - joint.correction[1]),
            ("MAX_ACCELERATION", limits.max_acceleration, joint.max_acceleration),
        ] {
            if of_axis > of_joint {
                let text = format!(
                    "expected at most {of_joint} of [{own}], which follows this axis one to one: above that it falls behind, \
                     and LinuxCNC stops the machine"
                );
                report.finding(Severity::Error, at_key(&config.ini, &axis, key, &text));
            }
        }
        ends(report, config, (&own, &axis), [joint.min, joint.max], [limits.min, limits.max]);
    }
}

/// Reports extra axes whose range is smaller than their coordinate's.
fn extra(report: &mut Report, config: &Mechanism) {
    for (n, extra) in config.extra.iter().enumerate() {
        let own = format!("JOINT_{}", config.place.first_extra_joint + n);
        let axis = format!("AXIS_{}", extra.letter);
        let (joint, limits) = (&extra.joint, extra.axis);
        ends(report, config, (&own, &axis), [joint.min, joint.max], [limits.min, limits.max]);
    }
}

/// Reports ends of a joint that its axis exceeds.
fn ends(
    report: &mut Report,
    config: &Mechanism,
    (joint, axis): (&str, &str),
    own: [f64; 2],
    of_axis: [f64; 2],
) {
    let is_beyond = [of_axis[0] < own[0], of_axis[1] > own[1]];
    for (k, key) in ["MIN_LIMIT", "MAX_LIMIT"].into_iter().enumerate() {
        // An axis without an end is reported separately.
        if is_beyond[k] && of_axis[k].is_finite() {
            let text = format!(
                "[{axis}]{key} = {} is beyond this limit, and LinuxCNC stops programs at the joint's limit: make the axis \
                 range smaller than the joint range",
                of_axis[k]
            );
            report.finding(Severity::Warning, at_key(&config.ini, joint, key, &text));
        }
    }
}

/// Reports letters that LinuxCNC reads as axes and that are there by mistake, for example in a comment.
fn letters(report: &mut Report, config: &Mechanism) {
    let Some(entry) = config.ini.first("TRAJ", "COORDINATES") else { return };
    if !entry
        .value
        .chars()
        .all(|c| c.is_whitespace() || "XYZABCUVW".contains(c.to_ascii_uppercase()))
    {
        let text = "LinuxCNC reads every letter here as an axis, also in a comment: write only the letters of the axes";
        report.finding(Severity::Error, config.ini.refuse(entry, text));
    }
}

/// Reports speeds and accelerations of axes that are LinuxCNC's defaults.
fn defaults(report: &mut Report, config: &Mechanism, section: &str) {
    for key in ["MAX_VELOCITY", "MAX_ACCELERATION"] {
        if config.ini.first(section, key).is_none() {
            let text =
                "LinuxCNC uses 1, which is slow for most machines: set the value of the tool";
            report.finding(Severity::Warning, at_key(&config.ini, section, key, text));
        }
    }
}

/// Reports an axis that cannot rotate fully, but is configured as one that wraps.
fn wrapped(report: &mut Report, config: &Mechanism, letter: Letter, section: &str) {
    let Some(entry) = config.ini.first(section, "WRAPPED_ROTARY") else { return };
    let range = config.axes[letter.index()].max - config.axes[letter.index()].min;
    if range < 360.0 && !["0", "no", "false", "off"].contains(&entry.value.to_lowercase().as_str())
    {
        let text = format!(
            "LinuxCNC then rotates the short way to every angle, but the limits allow only {range} degrees: remove the line"
        );
        report.finding(Severity::Warning, config.ini.refuse(entry, &text));
    }
}

/// Reports an axis whose speed no joint can nearly reach.
fn too_fast(report: &mut Report, config: &Mechanism, letter: Letter, section: &str) {
    let k = letter.index();
    let step = if letter.is_angle() { STEP[1] } else { STEP[0] * config.machine.size() };
    let joints = |way: f64| -> Option<Joints> {
        let mut pose = config.home;
        pose[k] += way * step;
        config.machine.inverse(&Pose::from_degrees(pose), &config.spindle).ok()
    };
    let (Some(before), Some(behind)) = (joints(-1.0), joints(1.0)) else { return };
    let speed = config.axes[k].max_velocity;
    let rate = |i: usize| (behind[i] - before[i]).abs() / (2.0 * step) * speed;
    let share = |i: usize| rate(i) / config.joints[i].max_velocity;
    let most = (0..config.joints.len()).max_by(|i, j| share(*i).total_cmp(&share(*j)));
    if let Some(i) = most.filter(|i| share(*i) > FAST) {
        let Joint { name, kind, max_velocity, .. } = &config.joints[i];
        let text = format!(
            "at home {name} would need {:.0} {} per second, but its MAX_VELOCITY is {max_velocity}: expected a speed \
             per second, not per minute, that the joints can follow",
            rate(i),
            config.unit(*kind)
        );
        report.finding(Severity::Warning, at_key(&config.ini, section, "MAX_VELOCITY", &text));
    }
}
