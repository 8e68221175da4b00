// SPDX-License-Identifier: GPL-2.0-or-later
//! Values that LinuxCNC accepts, but that suggest another unit, another version or another machine.

use crate::findings::Report;
use crate::wiring::at_key;
use kinematics::Letter;
use machine::limits;
use machine::read::diagnostic::Severity;
use machine::read::ini::IniError;
use machine::read::joints::JointKind;
use machine::read::mechanism::{LegAngles, Mechanism};

/// Seconds from standstill to the largest speed, above which the unit of the acceleration is doubted.
const SLOW: f64 = 5.0;

/// Largest ratio of the accelerations of the axes to that of the path: smaller than for a wrong unit.
const FAR: f64 = 20.0;

/// Smallest clearance of legs, as a share of the machine's size: thinner legs support nothing.
const THIN: f64 = 1e-3;

/// Largest distance of a limit relative to the machine's size (its largest length from an origin): a choice between
/// existing machines and another unit, with which it is 25.4 times as far.
pub const AWAY: f64 = 10.0;

/// Largest common angle in radians: no joint of a leg swings so little in degrees.
const RADIANS: f64 = std::f64::consts::PI;

/// Keys with their usual values, and the expectation.
const USUAL: [(&str, &str, [f64; 2], &str); 4] = [
    ("TASK", "CYCLE_TIME", [1e-4, 0.1], "expected seconds, usually 0.001 to 0.01"),
    ("EMCIO", "CYCLE_TIME", [1e-4, 1.0], "expected seconds, usually 0.1"),
    ("DISPLAY", "MAX_FEED_OVERRIDE", [0.0, 10.0], "expected a factor: 1.2 is 120 %"),
    ("DISPLAY", "MAX_SPINDLE_OVERRIDE", [0.0, 10.0], "expected a factor: 1.2 is 120 %"),
];

/// Checks all of it.
///
/// # Errors
/// A value that is not a number.
pub(super) fn check(report: &mut Report, config: &Mechanism) -> Result<(), IniError> {
    if !config.place.is_second {
        version(report, config);
        path(report, config)?;
        tool_change(report, config);
        for (section, key, [least, most], expected) in USUAL {
            let value = config.ini.number_or(section, key, most)?;
            if !(least..=most).contains(&value) {
                warn(report, config, (section, key), expected);
            }
        }
    }
    thin(report, config);
    angles(report, config);
    for letter in Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l)) {
        let axis = &config.axes[letter.index()];
        let section = config.place.axis_section(letter);
        if axis.min == axis.max {
            let text = "the axis cannot move, because MIN_LIMIT is the same: expected more";
            warn(report, config, (&section, "MAX_LIMIT"), text);
        }
        slow(report, config, &section, [axis.max_velocity, axis.max_acceleration]);
        if !letter.is_angle() {
            away(report, config, &section, [axis.min, axis.max]);
        }
    }
    for (i, joint) in config.joints.iter().enumerate() {
        let section = config.place.joint_section(i);
        slow(report, config, &section, [joint.max_velocity, joint.max_acceleration]);
        if joint.kind != JointKind::Arm {
            away(report, config, &section, [joint.min, joint.max]);
        }
    }
    Ok(())
}

fn warn(report: &mut Report, config: &Mechanism, (section, key): (&str, &str), text: &str) {
    report.finding(Severity::Warning, at_key(&config.ini, section, key, text));
}

/// Reports another version, with which LinuxCNC converts the file before it starts.
fn version(report: &mut Report, config: &Mechanism) {
    const KEY: (&str, &str) = ("EMC", "VERSION");
    if config.ini.first(KEY.0, KEY.1).is_none_or(|entry| entry.value != "1.1") {
        let text = "LinuxCNC treats the file as one of an old version and offers to convert it: expected 1.1";
        warn(report, config, KEY, text);
    }
}

/// Checks LinuxCNC's position before it requests another tool.
fn tool_change(report: &mut Report, config: &Mechanism) {
    const KEY: (&str, &str) = ("EMCIO", "TOOL_CHANGE_POSITION");
    let Some(entry) = config.ini.first(KEY.0, KEY.1) else { return };
    let numbers: Vec<f64> =
        entry.value.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let beyond = Letter::ALL.into_iter().zip(numbers).zip(&config.programmed).find(
        |((letter, value), axis)| {
            !config.machine.layout().is_held(*letter) && !(axis.min..=axis.max).contains(value)
        },
    );
    if let Some(((letter, value), axis)) = beyond {
        let text = format!(
            "LinuxCNC moves there before every tool change, but {} = {value} is outside {} to {}: expected a \
             position within the axis limits",
            config.place.letter(letter),
            axis.min,
            axis.max
        );
        report.finding(Severity::Error, config.ini.refuse(entry, &text));
    }
}

/// Reports an acceleration of the path that limits everything.
fn path(report: &mut Report, config: &Mechanism) -> Result<(), IniError> {
    const KEY: (&str, &str) = ("TRAJ", "MAX_LINEAR_ACCELERATION");
    let moved = Letter::ALL
        .into_iter()
        .filter(|l| !l.is_angle() && !config.machine.layout().is_held(*l))
        .map(|letter| config.axes[letter.index()].max_acceleration);
    let most = moved.filter(|most| most.is_finite()).fold(0.0, f64::max);
    if config.ini.number_or(KEY.0, KEY.1, most)? * FAR < most {
        let text = format!(
            "this limits every move, but [AXIS_*]MAX_ACCELERATION allow {most}: expected {} per second squared, as there",
            config.length_unit()
        );
        warn(report, config, KEY, &text);
    }
    Ok(())
}

/// Reports a clearance of unrealistically thin legs.
fn thin(report: &mut Report, config: &Mechanism) {
    let least = THIN * config.machine.size();
    if let Some(clearance) = config.clearance.filter(|clearance| *clearance < least) {
        let text = format!(
            "center lines of legs may come as close as {clearance} {unit}: expected their diameter and some margin, in \
             {unit}, as for all lengths",
            unit = config.length_unit()
        );
        warn(report, config, ("PKM", "ROD_CLEARANCE"), &text);
    }
}

/// Reports limits of angles in radians.
fn angles(report: &mut Report, config: &Mechanism) {
    let small = |key, of: fn(&LegAngles) -> Option<f64>| {
        let mut angles = config.angles.iter().map(of).enumerate();
        let is_small = |(leg, angle): (usize, Option<f64>)| {
            Some((leg, angle.filter(|angle| *angle <= RADIANS)?))
        };
        let (leg, angle) = angles.find_map(is_small)?;
        Some((config.place.leg_section(leg), key, angle))
    };
    let found = [
        small("BASE_CONE", |leg| leg.cones[0]),
        small("PLATFORM_CONE", |leg| leg.cones[1]),
        small("BASE_PYRAMID", |leg| leg.pyramids[0].map(|[about, across]| about.min(across))),
        small("PLATFORM_PYRAMID", |leg| leg.pyramids[1].map(|[about, across]| about.min(across))),
        config
            .tilt_limit
            .filter(|most| *most <= RADIANS)
            .map(|most| ("PKM".into(), "TILT_LIMIT", most)),
    ];
    for (section, key, angle) in found.into_iter().flatten() {
        let text = format!(
            "almost no pose is within this limit: expected degrees, as for all angles; {angle} radians are {:.1}",
            angle.to_degrees()
        );
        warn(report, config, (&section, key), &text);
    }
    let is_turned =
        |letter: &Letter| letter.is_angle() && !config.machine.layout().is_held(*letter);
    if config.tilt_limit.is_some() && !Letter::ALL.iter().any(is_turned) {
        let text = "the platform does not tilt, so this limits nothing: remove the key";
        warn(report, config, ("PKM", "TILT_LIMIT"), text);
    }
}

/// Reports limits much farther away than the machine is large.
fn away(report: &mut Report, config: &Mechanism, section: &str, limits: [f64; 2]) {
    let (size, unit) = (config.machine.size(), config.length_unit());
    for (key, limit) in ["MIN_LIMIT", "MAX_LIMIT"].into_iter().zip(limits) {
        if limit.is_finite() && limit.abs() > AWAY * size {
            let text = format!(
                "no anchor is more than {} {unit} from the origin of its frame, so nothing gets that far: expected {unit}, as for all \
                 lengths",
                limits::shown(size)
            );
            warn(report, config, (section, key), &text);
        }
    }
}

/// Reports an acceleration in another unit than the speed.
fn slow(report: &mut Report, config: &Mechanism, section: &str, [speed, most]: [f64; 2]) {
    let seconds = speed / most;
    if seconds.is_finite() && seconds > SLOW {
        let text = format!(
            "MAX_VELOCITY = {speed} is reached after {} s: expected the unit of MAX_VELOCITY, but per second squared",
            limits::shown(seconds)
        );
        warn(report, config, (section, "MAX_ACCELERATION"), &text);
    }
}
