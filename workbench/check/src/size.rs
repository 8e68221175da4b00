// SPDX-License-Identifier: GPL-2.0-or-later
//! Unit and size of a machine: this shows a file in millimeters that declares inches, or vice versa.

use crate::findings::Report;
use crate::wiring::at_key;
use kinematics::{At, Vector3};
use machine::read::diagnostic::Severity;
use machine::read::joints::JointKind;
use machine::read::mechanism::Mechanism;

/// Usual extent of the joints of base or platform, in meters, beyond which the unit is doubted. A wrong unit makes a
/// machine 25.4 times as large or small: one of 0.4 to 1 m, the usual size, is then beyond 10 m or below 40 mm.
/// Machines
/// in use are well within: from pocket deltas of 0.1 m to gantries of 5 m.
const USUAL_M: [f64; 2] = [0.04, 10.0];

/// Speed of a drive, in meters per second, above which the unit is doubted: the fastest deltas stay below, and a
/// speed per minute, which is 60 times as large, is above it from 10 m/min on.
const FASTEST_M: f64 = 10.0;

/// Meters per millimeter.
const METERS: f64 = 1e-3;

/// Reports unit and size, and unusual ones.
pub(super) fn check(report: &mut Report, config: &Mechanism, at: &At) {
    let extent = extent(config, at);
    let meters = extent * (METERS / config.units_per_mm);
    let (unit, [x, y, z]) = (config.length_unit(), <[f64; 3]>::from(meters));
    let largest = widest(config, at) * METERS / config.units_per_mm;
    // Meters show a wrong unit; drawings in inches are in inches.
    let own = match unit {
        "mm" => String::new(),
        _ => format!("{:.3} x {:.3} x {:.3} {unit}, ", extent.x, extent.y, extent.z),
    };
    let text = format!(
        "lengths in {unit}; at home the joints of all legs span {own}{x:.3} x {y:.3} x {z:.3} m: if \
         that is wrong, correct LINEAR_UNITS"
    );
    report.fact("size", text);
    let [least, most] = USUAL_M;
    if !(least..=most).contains(&largest) {
        let other = if unit == "mm" { "inch" } else { "mm" };
        let text = format!(
            "a machine {largest:.3} m wide: expected {least} to {most} m; if its lengths are in {other}, \
             LINEAR_UNITS = {other}"
        );
        report.finding(Severity::Warning, at_key(&config.ini, "TRAJ", "LINEAR_UNITS", &text));
    }
    speeds(report, config);
}

/// Returns width, depth and height of a box around the joints of all legs, machine units.
fn extent(config: &Mechanism, at: &At) -> Vector3<f64> {
    let segments = &at.segments()[..config.legs()];
    let bases = config.geometry.legs().iter().map(|leg| Vector3::from(leg.base));
    around(segments.iter().flat_map(|leg| [leg.base, leg.platform]).chain(bases))
}

/// Returns the larger extent of the joints of base and platform, which hardly depends on the pose.
fn widest(config: &Mechanism, at: &At) -> f64 {
    let segments = &at.segments()[..config.legs()];
    let base = around(segments.iter().map(|leg| leg.base)).max();
    base.max(around(segments.iter().map(|leg| leg.platform)).max())
}

fn around(points: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let none = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
    let [low, high] = points.fold(none, |[low, high], point| [low.inf(&point), high.sup(&point)]);
    high - low
}

/// Reports drives that are unusually fast, naming the first.
fn speeds(report: &mut Report, config: &Mechanism) {
    let is_length = |kind| kind != JointKind::Arm;
    let speed = |value: f64| value * METERS / config.units_per_mm;
    let mut joints = config.joints.iter().enumerate().filter(|(_, joint)| is_length(joint.kind));
    if let Some((i, joint)) = joints.find(|(_, joint)| speed(joint.max_velocity) > FASTEST_M) {
        let text = format!(
            "{} would run at {:.1} m/s: expected {} per second, not per minute, and at most {FASTEST_M} m/s",
            joint.name,
            speed(joint.max_velocity),
            config.length_unit()
        );
        let section = config.place.joint_section(i);
        report.finding(Severity::Warning, at_key(&config.ini, &section, "MAX_VELOCITY", &text));
    }
}
