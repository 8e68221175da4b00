// SPDX-License-Identifier: GPL-2.0-or-later
//! Searches of joints for their switches: direction, speed, and latching.

use crate::findings::Report;
use crate::homing_paths::Homing;
use crate::motors::{self, Motor};
use crate::wiring::at_key;
use machine::limits;
use machine::read::diagnostic::Severity;
use machine::read::ini::IniError;
use machine::read::mechanism::Mechanism;

/// Share of a joint's range at its ends: a switch there is approached from the other end, elsewhere from both.
const END: f64 = 0.05;

/// Largest share of the poses within the axis limits in which a joint may be beyond its switch: a switch is reached
/// from nearly all of them, or must stay closed over most of the travel, as on machines with switches in the middle.
const BEYOND: f64 = 0.9;

/// Checks all of it.
///
/// # Errors
/// A value that is not a number.
pub(super) fn check(report: &mut Report, config: &Mechanism) -> Result<(), IniError> {
    // For machines whose axes carry something homing is not checked.
    let homing = Homing::new(config)?;
    for (i, motor) in motors::of(config).into_iter().enumerate() {
        let share = homing.as_ref().and_then(|homing| homing.share_closed(i));
        for (key, text) in of_joint(config, &motor, share)? {
            report.finding(Severity::Warning, at_key(&config.ini, &motor.section, key, &text));
        }
    }
    Ok(())
}

/// Returns keys of a joint with their mistakes.
fn of_joint(
    config: &Mechanism,
    motor: &Motor,
    share_closed: Option<f64>,
) -> Result<Vec<(&'static str, String)>, IniError> {
    let number = |key| config.ini.number_or(&motor.section, key, 0.0);
    let [speed, latch, offset] =
        [number("HOME_SEARCH_VEL")?, number("HOME_LATCH_VEL")?, number("HOME_OFFSET")?];
    let mut found = vec![];
    found.extend(back(motor, number("HOME_FINAL_VEL")?).map(|text| ("HOME_FINAL_VEL", text)));
    if number("HOME_ABSOLUTE_ENCODER")? != 0.0 {
        return Ok(found);
    }
    found.extend(fast(motor, speed).map(|text| ("HOME_SEARCH_VEL", text)));
    let away = away(motor, speed, offset).or_else(|| beyond(motor, speed, offset, share_closed?));
    found.extend(away.map(|text| ("HOME_SEARCH_VEL", text)));
    // Its sign is free: with the sign of the search the switch is approached again, with the opposite one it is left.
    found.extend(fast(motor, latch).map(|text| ("HOME_LATCH_VEL", text)));
    if speed != 0.0 && latch.abs() > speed.abs() {
        let text = format!(
            "the joint approaches the switch again at this speed for an exact position, and searches at {speed}: expected less"
        );
        found.push(("HOME_LATCH_VEL", text));
    }
    Ok(found)
}

/// Reports a move to HOME with a sign, which is unnecessary.
fn back(motor: &Motor, speed: f64) -> Option<String> {
    (speed < 0.0).then(|| {
        format!(
            "LinuxCNC then moves to HOME at MAX_VELOCITY = {}, in either direction: expected {}",
            motor.joint.max_velocity, -speed
        )
    })
}

/// Reports a search that LinuxCNC makes at the joint's full speed.
fn fast(&Motor { joint, unit, .. }: &Motor, speed: f64) -> Option<String> {
    let most = joint.max_velocity;
    (speed.abs() > most).then(|| {
        format!(
            "LinuxCNC limits it to MAX_VELOCITY = {most}, at which {} overruns its switch by {} {unit}: \
             expected a slow speed",
            joint.name,
            limits::shown(most * most / (2.0 * joint.max_acceleration))
        )
    })
}

/// Reports a search in the direction away from the switch.
fn away(&Motor { joint, .. }: &Motor, speed: f64, offset: f64) -> Option<String> {
    let share = (offset - joint.min) / (joint.max - joint.min);
    let (is_away, end) = match speed {
        speed if speed > 0.0 => (share < END, "lower"),
        speed if speed < 0.0 => (share > 1.0 - END, "upper"),
        _ => return None,
    };
    is_away.then(|| {
        format!(
            "the switch is at the {end} end, at HOME_OFFSET = {offset}, but the search moves to the other end: \
             expected {}",
            -speed
        )
    })
}

/// Reports a search from the side of its switch on which nearly all poses are.
fn beyond(&Motor { joint, .. }: &Motor, speed: f64, offset: f64, share: f64) -> Option<String> {
    (share > BEYOND).then(|| {
        format!(
            "in {:.0} % of the poses within the axis limits {} is beyond its switch, from HOME_OFFSET = {offset} to {}, \
             and never finds it unless the switch is closed there: expected {}, or a switch that stays closed to that end",
            100.0 * share,
            joint.name,
            if speed < 0.0 { joint.min } else { joint.max },
            -speed
        )
    })
}
