// SPDX-License-Identifier: GPL-2.0-or-later
//! Tables of measuring instruments: CSV with the pose that the control displayed, and the measurement of a tracker
//! or a ball bar at that pose.
//!
//! ```text
//! # geometry 1844604530
//! # tool 0 0 80
//! x,y,z,a,b,c,tip_x,tip_y,tip_z            tracker; tip_a tip_b tip_c as well: full pose
//! x,y,z,a,b,c,distance                     ball bar: the tip from a fixed point
//! ```
//!
//! x y z a b c is the pose of the tip in machine coordinates. The joint values that LinuxCNC commanded are computed from
//! it with the geometry that the table names.

use super::heading;
use super::log::{self, BadLog};
use super::model::Frame;
use super::plate::fitted;
use super::reading::{Instrument, Measured, Reading};
use kinematics::{Pose, Vector3};
use machine::read::columns::coordinates;
use machine::read::mechanism::Mechanism;
use nalgebra::{DMatrix, DVector};

const PLACE: [&str; 3] = ["tip_x", "tip_y", "tip_z"];
const ANGLES: [&str; 3] = ["tip_a", "tip_b", "tip_c"];

/// Parses the readings of a table, in frame `frame`.
///
/// # Errors
/// See [`BadLog`].
pub(crate) fn readings(
    config: &Mechanism,
    text: &str,
    frame: usize,
    named: &str,
) -> Result<Vec<Reading>, BadLog> {
    let bad = |line: usize, text: String| BadLog { line, text };
    heading::of_geometry(config, text)?;
    let tool = heading::tool(text)?;
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = reader.headers().map_err(|error| bad(1, error.to_string()))?.clone();
    let place = |name: &str| header.iter().position(|word| word.eq_ignore_ascii_case(name));
    let places = |names: &[&str]| names.iter().map(|name| place(name)).collect::<Option<Vec<_>>>();
    let names = coordinates();
    let names: Vec<_> = names.iter().map(String::as_str).collect();
    let Some(pose) = places(&names) else {
        return Err(bad(
            1,
            format!("expected columns {} and the measured values", names.join(",")),
        ));
    };
    let (tip, angles, distance) = (places(&PLACE), places(&ANGLES), places(&["distance"]));
    if tip.is_none() == distance.is_none() {
        return Err(bad(1, format!("expected columns {}, or distance", PLACE.join(","))));
    }
    let mut readings = vec![];
    let mut lines: Vec<(csv::StringRecord, usize)> = vec![];
    for record in reader.into_records() {
        let record = record.map_err(|error| {
            bad(error.position().map_or(0, |p| p.line() as usize), error.to_string())
        })?;
        let line = record.position().map_or(0, |p| p.line() as usize);
        if let Some((_, first)) = lines.iter().find(|(other, _)| *other == record) {
            return Err(bad(line, format!("this line repeats line {first}: remove one of them")));
        }
        let cell = |at: usize| {
            let word = record.get(at).unwrap_or_default();
            let number = word.parse().ok().filter(|x: &f64| x.is_finite());
            number.ok_or_else(|| bad(line, format!("\"{word}\" is not a number")))
        };
        let cells =
            |at: &[usize]| at.iter().map(|at| cell(*at)).collect::<Result<Vec<f64>, BadLog>>();
        let shown = cells(&pose)?;
        let measured = match (&tip, &angles, &distance) {
            (_, _, Some(at)) => Measured::Distance(cell(at[0])?),
            (Some(tip), Some(angles), None) => {
                let (tip, angles) = (cells(tip)?, cells(angles)?);
                let pose =
                    Pose::from_degrees([tip[0], tip[1], tip[2], angles[0], angles[1], angles[2]]);
                Measured::Pose(pose.position, pose.rotation())
            }
            (Some(tip), _, _) => Measured::Position(Vector3::from_vec(cells(tip)?)),
            (None, _, None) => unreachable!("one of them is there"),
        };
        let pose = log::shown(config, std::array::from_fn(|k| shown[k]), &tool);
        let joints =
            config.machine.inverse(&pose, &tool).map_err(|fault| bad(line, fault.to_string()))?;
        let name = format!("{named}:{line}");
        let (group, instrument) = (readings.len(), Instrument::default());
        readings.push(Reading { name, group, joints, pose, tool, frame, measured, instrument });
        lines.push((record, line));
    }
    if readings.is_empty() {
        return Err(bad(1, "no row below the header: add the measured values".into()));
    }
    Ok(readings)
}

/// Estimates the pose of the instrument.
pub(crate) fn frame(readings: &[Reading]) -> Frame {
    let tip = |reading: &Reading| reading.pose.position - reading.tool;
    let (mut own, mut seen) = (vec![], vec![]);
    let mut bars = vec![];
    for reading in readings {
        match reading.measured {
            Measured::Position(place) | Measured::Pose(place, _) => {
                own.push(place);
                seen.push(tip(reading));
            }
            Measured::Distance(length) => bars.push((tip(reading), length)),
            Measured::Bore { .. } | Measured::Face(_) => {}
        }
    }
    if bars.is_empty() { fitted(&own, &seen) } else { centre(&bars) }
}

/// Returns the point with these distances from these tips: |t|² − 2 t·c + |c|² = L² is linear in c and |c|².
fn centre(bars: &[(Vector3<f64>, f64)]) -> Frame {
    let mean = bars.iter().map(|(tip, _)| tip).sum::<Vector3<f64>>() / bars.len() as f64;
    let rows = DMatrix::from_fn(bars.len(), 4, |i, k| {
        let tip = bars[i].0 - mean;
        if k < 3 { 2.0 * tip[k] } else { -1.0 }
    });
    let right = DVector::from_fn(bars.len(), |i, _| {
        (bars[i].0 - mean).norm_squared() - bars[i].1 * bars[i].1
    });
    let solved = rows.svd(true, true).solve(&right, 1e-9).unwrap_or_else(|_| DVector::zeros(4));
    Frame { origin: mean + Vector3::new(solved[0], solved[1], solved[2]), ..Frame::BASE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_of_a_ball_bar_is_found() {
        let centre_there = Vector3::new(10.0, -20.0, 300.0);
        let tips = [
            [0.0, 0.0, 0.0],
            [50.0, 0.0, 10.0],
            [0.0, 60.0, -10.0],
            [-40.0, 10.0, 40.0],
            [5.0, 9.0, 90.0],
        ];
        let bars: Vec<_> =
            tips.map(|t| (Vector3::from(t), (Vector3::from(t) - centre_there).norm())).to_vec();
        // Rounding of squares of 300, through equations of that size.
        assert!((centre(&bars).origin - centre_there).norm() < 1e-8);
    }
}
