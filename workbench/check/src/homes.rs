// SPDX-License-Identifier: GPL-2.0-or-later
//! HOME of joints and axes against the kinematics and the limits, and the order of homing.

use crate::findings::Report;
use crate::fixes::has_all_digits;
use crate::homing::{self, Trouble};
use crate::sequence;
use crate::wiring::at_key;
use kinematics::Letter;
use machine::digits::plain;
use machine::limits;
use machine::read::diagnostic::Severity;
use machine::read::error::MachineError;
use machine::read::ini::{Ini, IniError};
use machine::read::joints::JointKind;
use machine::read::mechanism::Mechanism;

/// Largest difference between HOME of a joint and the kinematics at [TRAJ]HOME, as a share of the
/// machine's size (of a radian for arms): some micrometers, so that four digits after the decimal point
/// in millimeters suffice.
const HOME_TOLERANCE: f64 = 1e-5;

/// Largest difference that is described as zero to three digits, far below the resolution of any encoder.
const NEXT_TO_NOTHING: f64 = 5e-4;

/// Checks homes and homing.
///
/// # Errors
/// The machine's home is not legal, or a value is not a number.
pub(super) fn check(report: &mut Report, config: &Mechanism) -> Result<(), MachineError> {
    let ini = &config.ini;
    homes(report, ini, config)?;
    for trouble in homing::check(ini, config)? {
        report.finding(severity(&trouble), homing_problem(ini, config, &trouble)?);
    }
    Ok(())
}

/// Describes the coordinates at home that follow from constraints; `None` without constraints. A point beside its plane, or
/// an axis that is not square, shows in them.
fn dependent(config: &Mechanism) -> Option<String> {
    let letters = config.dependent();
    let full = config.machine.full_pose(&config.home_pose(), &config.spindle).ok()?.to_degrees();
    let values: Vec<String> = letters
        .iter()
        .map(|letter| {
            let unit = if letter.is_angle() { "degrees" } else { config.length_unit() };
            // Without the sign of a zero.
            let value = (full[letter.index()] * 1e3).round() / 1e3 + 0.0;
            format!("{} {value:.3} {unit}", letter.name())
        })
        .collect();
    (!values.is_empty()).then(|| format!("at home, from the constraints: {}", values.join(", ")))
}

fn tolerance(config: &Mechanism, kind: JointKind) -> f64 {
    match kind {
        JointKind::Arm => HOME_TOLERANCE.to_degrees(),
        _ => HOME_TOLERANCE * config.machine.size(),
    }
}

/// Formats a difference: with three digits after the decimal point, or that it is less.
fn off(value: f64, unit: &str) -> String {
    match value < NEXT_TO_NOTHING {
        true => format!("less than 0.001 {unit}"),
        false => format!("{value:.3} {unit}"),
    }
}

/// Checks HOME of joints and axes against the kinematics and the limits.
fn homes(report: &mut Report, ini: &Ini, config: &Mechanism) -> Result<(), MachineError> {
    let joints = config
        .machine
        .inverse(&config.home_pose(), &config.spindle)
        .map_err(|fault| MachineError::of_geometry(&config.ini, &config.place, fault))?;
    let mut farthest = (0.0, config.length_unit());
    for (i, (joint, wanted)) in config.joints.iter().zip(joints).enumerate() {
        let section = config.place.joint_section(i);
        let away = (joint.home - wanted).abs();
        let unit = config.unit(joint.kind);
        if !(away <= farthest.0) {
            farthest = (away, unit);
        }
        if !(away <= tolerance(config, joint.kind)) {
            let leg = if i < config.legs() { config.place.leg_section(i) } else { "PKM".into() };
            // A point beside its plane turns the platform at home.
            let constraints = match config.machine.layout().constraints() {
                0 => "",
                _ => "[CONSTRAINT_N], ",
            };
            let text = format!(
                "off by {}: the kinematics give {} = {} at [TRAJ]HOME; use that (pkm check --fix writes it), or \
                 correct {constraints}[TRAJ]HOME or [{leg}] if this value was measured",
                off(away, unit),
                joint.name,
                plain(wanted)
            );
            report.finding(Severity::Error, at_key(ini, &section, "HOME", &text));
        }
        if !(joint.min..=joint.max).contains(&wanted) {
            let text = format!(
                "[TRAJ]HOME needs {} of {}: widen its limits {} to {}, or move HOME",
                plain(wanted),
                joint.name,
                joint.min,
                joint.max
            );
            report.finding(Severity::Error, at_key(ini, "TRAJ", "HOME", &text));
        }
    }
    for (letter, (axis, home)) in Letter::ALL.iter().zip(config.axes.iter().zip(config.home)) {
        if !(axis.min..=axis.max).contains(&home) {
            let name = config.place.letter(*letter);
            let text = format!(
                "{name} = {home} is outside [AXIS_{name}], {} to {}: move HOME, or widen the limits",
                axis.min, axis.max
            );
            report.finding(Severity::Error, at_key(ini, "TRAJ", "HOME", &text));
        }
    }
    extra_homes(report, ini, config);
    axis_homes(report, ini, config);
    let (farthest, unit) = farthest;
    let by = match farthest < NEXT_TO_NOTHING {
        true => off(farthest, unit),
        false => format!("up to {}", off(farthest, unit)),
    };
    let mut pairs = config.joints.iter().zip(joints);
    report.fact(
        "home",
        match pairs.all(|(joint, wanted)| has_all_digits(config, joint.home, wanted)) {
            true => "joint HOME is that of the inverse kinematics at [TRAJ]HOME".into(),
            false => format!(
                "joint HOME differs from the inverse kinematics at [TRAJ]HOME by {by}; run pkm check --fix to write all \
                 digits"
            ),
        },
    );
    if let Some(text) = dependent(config) {
        report.fact("follows", text);
    }
    Ok(())
}

/// Reports `[AXIS_L]HOME`, which only old versions of LinuxCNC read.
fn axis_homes(report: &mut Report, ini: &Ini, config: &Mechanism) {
    for letter in Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l)) {
        let (section, home) = (config.place.axis_section(letter), config.start[letter.index()]);
        let Ok(given) = ini.number_or(&section, "HOME", home) else { continue };
        if given != home {
            let text = format!(
                "[TRAJ]HOME has {} at {home}, and LinuxCNC {} ignores this key: use the same value, or \
                 remove the line",
                config.place.letter(letter),
                crate::linuxcnc()
            );
            report.finding(Severity::Warning, at_key(ini, &section, "HOME", &text));
        }
    }
}

/// Checks HOME of extra axes against the limits of joint and axis.
fn extra_homes(report: &mut Report, ini: &Ini, config: &Mechanism) {
    for (n, extra) in config.extra.iter().enumerate() {
        let (joint, axis) = (&extra.joint, &extra.axis);
        let (least, most) = (joint.min.max(axis.min), joint.max.min(axis.max));
        if !(least..=most).contains(&joint.home) {
            let text = format!(
                "{} is outside its limits as joint and as [AXIS_{}], {least} to {most}: correct HOME",
                joint.name, extra.letter
            );
            let section = format!("JOINT_{}", config.place.first_extra_joint + n);
            report.finding(Severity::Error, at_key(ini, &section, "HOME", &text));
        }
    }
}

fn severity(trouble: &Trouble) -> Severity {
    match trouble {
        Trouble::LeftOut(_) | Trouble::Switch(..) => Severity::Warning,
        Trouble::Limit(..) | Trouble::NoPose(..) => Severity::Error,
    }
}

fn homing_problem(ini: &Ini, config: &Mechanism, trouble: &Trouble) -> Result<IniError, IniError> {
    Ok(match trouble {
        Trouble::LeftOut(i) => {
            let section = format!("JOINT_{i}");
            let text = match ini.first(&section, "HOME_SEQUENCE") {
                None => {
                    "Home All skips this joint, and world mode needs all joints homed: set it to \
                         the number of the others"
                        .into()
                }
                Some(_) => format!(
                    "Home All stops before this joint, because no joint has the number {}, and world mode needs all \
                     joints homed: number from 0 or 1 without gaps",
                    sequence::end(ini)?
                ),
            };
            at_key(ini, &section, "HOME_SEQUENCE", &text)
        }
        Trouble::Switch(i, beyond, unit) => {
            let text = format!(
                "the switch is {} outside MIN_LIMIT to MAX_LIMIT: expected the joint value at the switch; keep it only \
                 if the switch is beyond the travel of programs",
                off(*beyond, unit)
            );
            at_key(ini, &format!("JOINT_{i}"), "HOME_OFFSET", &text)
        }
        Trouble::Limit(sequence, margin) => {
            let text = format!(
                "between HOME and the switches at HOME_OFFSET {}; home more legs together, or move \
                 the switches",
                limits::sentence(config, margin)
            );
            at_sequence(ini, *sequence, &text)
        }
        Trouble::NoPose(sequence, fault) => {
            let text = format!(
                "no pose between HOME and the switches at HOME_OFFSET: {fault}; home more legs \
                 together, or move the switches"
            );
            at_sequence(ini, *sequence, &text)
        }
    })
}

fn at_sequence(ini: &Ini, sequence: i64, text: &str) -> IniError {
    let is_it = |section: &&str| {
        let number = ini.number_or(section, "HOME_SEQUENCE", f64::NAN);
        number.is_ok_and(|number| number.abs() == sequence.abs() as f64)
    };
    let section = ini.sections().filter(|name| name.starts_with("JOINT_")).find(is_it);
    at_key(ini, section.unwrap_or("JOINT_0"), "HOME_SEQUENCE", text)
}
