// SPDX-License-Identifier: GPL-2.0-or-later
//! The legs along a sequence of poses: angles, gaps, and paths of points of the platform.

use crate::course::{Course, lines_over, strips_over};
use crate::lines::Line;
use crate::plot::{DrawError, Plot};
use crate::strips::Strip;
use crate::thin::{thin, thin_low};
use machine::read::mechanism::Mechanism;
use studies::study::rods::Rods;

/// Draws pictures of the legs along a sequence of poses.
///
/// # Errors
/// As [`DrawError`].
pub fn of_rods(config: &Mechanism, course: &Course, rods: &[Rods]) -> Result<Vec<Plot>, DrawError> {
    let mut plots = vec![];
    for (file, caption, y, value, limit) in ANGLES {
        let strips: Vec<Strip> = (0..config.legs())
            .filter(|i| rods.first().is_some_and(|first| value(first, *i).is_some()))
            .map(|i| {
                let points = rods.iter().map(|rods| value(rods, i).unwrap_or(f64::NAN));
                let points = course.at.iter().copied().zip(without_turns(points));
                let line = Line { name: config.joints[i].name.clone(), points: thin(points) };
                Strip::of(line, limit(config, i).into_iter().collect())
            })
            .collect();
        if !strips.is_empty() {
            plots.push(strips_over(course, file, caption, y, &strips)?);
        }
    }
    plots.push(between(course, rods)?);
    plots.extend(gaps(config, course, rods)?);
    plots.extend(traces(config, course, rods)?);
    Ok(plots)
}

type Angle = fn(&Rods, usize) -> Option<f64>;

/// The largest value that the machine's file permits for a leg.
type Most = fn(&Mechanism, usize) -> Option<f64>;

/// Pictures of angles: file, caption, ordinate, value, limit.
const ANGLES: [(&str, &str, &str, Angle, Most); 5] = [
    (
        "rods-elevation.svg",
        "Legs above the XY plane",
        "elevation in degrees",
        |r, i| Some(r.rods[i].elevation),
        |_, _| None,
    ),
    (
        "rods-azimuth.svg",
        "Legs about Z, from X",
        "azimuth in degrees",
        |r, i| Some(r.rods[i].azimuth),
        |_, _| None,
    ),
    (
        "base-cones.svg",
        "Legs from their direction at home, at the base",
        "angle in degrees",
        |r, i| Some(r.rods[i].base_cone),
        |config, i| config.angles[i].cones[0],
    ),
    (
        "platform-cones.svg",
        "Legs from their direction at home, at the platform",
        "angle in degrees",
        |r, i| Some(r.rods[i].platform_cone),
        |config, i| config.angles[i].cones[1],
    ),
    (
        "guide-angles.svg",
        "Rods to their guides",
        "angle in degrees",
        |r, i| r.rods[i].guide,
        |_, _| None,
    ),
];

/// Unwraps angles in degrees, each to within half a turn of the previous one.
fn without_turns(angles: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    angles.scan(None, |last: &mut Option<f64>, angle| {
        let turns = last.map_or(0.0, |last| ((angle - last) / 360.0).round());
        *last = Some(angle - 360.0 * turns);
        *last
    })
}

fn between(course: &Course, rods: &[Rods]) -> Result<Plot, DrawError> {
    let line =
        |name: &str, pick: fn(f64, f64) -> f64| Line {
            name: name.into(),
            points: thin(course.at.iter().copied().zip(
                rods.iter().map(|rods| rods.between.iter().copied().reduce(pick).unwrap_or(0.0)),
            )),
        };
    let lines = vec![line("greatest", f64::max), line("least", f64::min)];
    lines_over(course, "between.svg", "Angles between two legs", "angle in degrees", lines)
}

fn gaps(config: &Mechanism, course: &Course, rods: &[Rods]) -> Result<Option<Plot>, DrawError> {
    let gaps = rods.iter().map(|rods| rods.nearest.map_or(f64::NAN, |n| n.distance));
    let points = thin_low(course.at.iter().copied().zip(gaps));
    if points.is_empty() {
        return Ok(None);
    }
    let lines = vec![Line { name: "nearest pair".into(), points }];
    let y = format!("gap in {}", config.length_unit());
    lines_over(course, "gaps.svg", "Least gap between two legs", &y, lines).map(Some)
}

fn traces(config: &Mechanism, course: &Course, rods: &[Rods]) -> Result<Vec<Plot>, DrawError> {
    let count = rods.first().map_or(0, |rods| rods.points.len());
    let trace = |k: usize| {
        let line = |axis: usize| Line {
            name: ["X", "Y", "Z"][axis].into(),
            points: thin(course.at.iter().copied().zip(rods.iter().map(|r| r.points[k][axis]))),
        };
        let caption = format!("Point {k} of the platform, in base");
        let y = format!("position in {}", config.length_unit());
        lines_over(course, &format!("point-{k}.svg"), &caption, &y, [0, 1, 2].map(line).into())
    };
    (0..count).map(trace).collect()
}
