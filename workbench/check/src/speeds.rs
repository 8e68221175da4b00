// SPDX-License-Identifier: GPL-2.0-or-later
//! Speeds of the path, `[TRAJ]`, compared with those of the axes, and initial jog speeds of the user interface.

use crate::findings::Report;
use crate::programs;
use crate::wiring::at_key;
use kinematics::Letter;
use machine::read::diagnostic::Severity;
use machine::read::ini::{Entry, Ini};
use machine::read::mechanism::Mechanism;

/// Largest ratio between the speed of the path and that of the axes: less than a wrong unit (an inch is 25.4 mm,
/// a minute 60 seconds), more than on a machine that is commissioned slowly.
const OFF: f64 = 20.0;

/// Part of the names of keys.
const LINEAR: &str = "LINEAR";

/// Checks all of it.
pub(super) fn check(report: &mut Report, config: &Mechanism) {
    path(report, config);
    let moved = || Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l));
    for (kind, is_there) in [(LINEAR, true), ("ANGULAR", moved().any(|l| l.is_angle()))] {
        if is_there {
            jogs(report, &config.ini, kind);
        }
    }
}

/// Reports a speed of the path that no axis nearly reaches, or that limits everything. LinuxCNC compares it with
/// lengths alone.
fn path(report: &mut Report, config: &Mechanism) {
    const KEY: &str = "MAX_LINEAR_VELOCITY";
    let moved = Letter::ALL
        .into_iter()
        .filter(|l| !l.is_angle() && !config.machine.layout().is_held(*l))
        .map(|letter| config.axes[letter.index()].max_velocity);
    let (fastest, squares) =
        moved.fold((0.0_f64, 0.0), |(most, sum), speed| (most.max(speed), sum + speed * speed));
    let (limit, unit) = (config.max_velocity[0], config.length_unit());
    if fastest == 0.0 {
        return;
    }
    let text = if limit * OFF < fastest {
        format!(
            "this limits every move, but [AXIS_*]MAX_VELOCITY allow {fastest} {unit} per second: \
             expected {unit} per second, as there"
        )
    } else if limit.is_finite() && limit > OFF * squares.sqrt() {
        format!(
            "it has no effect, because [AXIS_*]MAX_VELOCITY together allow {:.0} {unit} per second: expected a speed \
             per second, not per minute",
            squares.sqrt()
        )
    } else {
        return;
    };
    report.finding(Severity::Warning, at_key(&config.ini, "TRAJ", KEY, &text));
}

/// Checks the initial and final speeds of the jog sliders.
fn jogs(report: &mut Report, ini: &Ini, kind: &str) {
    let [most, first] = [format!("MAX_{kind}_VELOCITY"), format!("DEFAULT_{kind}_VELOCITY")];
    let is_axis = programs::is_axis(ini);
    // For angles AXIS uses 1 instead of a value that is not a number.
    let ends = |speed: f64| is_axis && (speed <= 0.0 || (speed.is_nan() && kind == LINEAR));
    match given(ini, &most) {
        None if is_axis && kind == LINEAR => {
            let text = "AXIS fails to start, and LinuxCNC with it: expected the highest jog speed";
            report.finding(Severity::Error, at_key(ini, "DISPLAY", &most, text));
        }
        Some((entry, speed)) if ends(speed) => {
            let text = "AXIS fails to start, and LinuxCNC with it: expected more than 0";
            report.finding(Severity::Error, ini.refuse(entry, text));
        }
        _ => (),
    }
    let (severity, error) = match given(ini, &first) {
        None if is_axis && given(ini, &most).is_some() => {
            let text = format!("jogs start at {most}: expected a slow speed");
            (Severity::Warning, ini.error("DISPLAY", &first, None, &text))
        }
        Some((entry, 0.0)) => {
            let text =
                "jogs do not move until the operator moves their slider: expected a slow speed";
            (Severity::Warning, ini.refuse(entry, text))
        }
        Some((entry, speed)) if ends(speed) => {
            let text =
                "AXIS fails to start, and LinuxCNC with it: expected a slow speed, more than 0";
            (Severity::Error, ini.refuse(entry, text))
        }
        _ => return,
    };
    report.finding(severity, error);
}

/// Returns the value that user interfaces read, NaN if it is not a number.
fn given<'a>(ini: &'a Ini, key: &str) -> Option<(&'a Entry, f64)> {
    let entry = ini.first("DISPLAY", key).or_else(|| ini.first("TRAJ", key))?;
    Some((entry, entry.value.trim().parse().unwrap_or(f64::NAN)))
}
