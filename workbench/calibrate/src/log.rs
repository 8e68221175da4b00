// SPDX-License-Identifier: GPL-2.0-or-later
//! Logs of the calibration program: lines that LinuxCNC writes (LOGOPEN), checked against the machine.
//!
//! ```text
//! pkm calibration log 1
//! unit 1                       mm (0: inch), as the program runs
//! touch 1 hole 3 approach -2 at X Y Z A B C
//! joints 1 J0 J1 ... tool X Y Z geometry HASH
//! end 1
//! ```
//!
//! X Y Z is the tip at the position where LinuxCNC reports that the probe tripped, in machine coordinates; an
//! approach is the signed number of the axis of motion: ±1, ±2 along X, Y to the wall of a hole, −3 down
//! to the face beside it. The joints are those latched in the cycle of the trip. LinuxCNC's
//! probed position is its forward kinematics of them, so each touch can be checked separately: the
//! inverse of the position must equal those joints. The check detects work coordinates,
//! another unit, another tool and another geometry.

use super::plate::Plate;
use super::reading::{Instrument, Measured, Reading};
use kinematics::{MAX_JOINTS, Pose, Solver, Vector3};
use machine::read::mechanism::Mechanism;

/// First line of a log.
pub const HEADER: &str = "pkm calibration log 1";

/// Tolerance of the agreement between joints and position: the six decimals that LinuxCNC writes, also of degrees
/// at the platform's radius; in sizes of the machine.
const AGREEMENT: f64 = 1e-7;

/// An error in a log.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{line}: {text}")]
pub struct BadLog {
    /// Line, counted from 1.
    pub line: usize,
    pub text: String,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Touch {
    pub line: usize,
    pub hole: u32,
    /// Signed number of the axis, 1 to 3.
    pub approach: i32,
    /// Tip and angles at the trip.
    pub at: [f64; 6],
    pub joints: Vec<f64>,
    /// Tool vector, spindle offset included.
    pub tool: [f64; 3],
    /// Hash of the geometry that LinuxCNC used.
    pub geometry: u32,
}

/// Pose, tool and joints of a touch.
pub(super) type Taken = (Pose, Vector3<f64>, [f64; MAX_JOINTS]);

impl Touch {
    pub(super) fn bad(&self, text: String) -> BadLog {
        BadLog { line: self.line, text }
    }
}

/// Returns the text after a word at its beginning.
fn behind<'a>(text: &'a str, word: &str) -> Option<&'a str> {
    text.strip_prefix(word)?.strip_prefix(' ')
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split_ascii_whitespace()
        .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()))
        .collect()
}

fn whole(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 1e15).then_some(value as i64)
}

/// Parses the touches of a log, and whether the program ran in millimeters.
///
/// # Errors
/// A line that is missing, duplicated, or not from the calibration program.
pub(crate) fn touches(text: &str) -> Result<(Vec<Touch>, bool), BadLog> {
    let bad = |line: usize, text: String| BadLog { line, text };
    let lines: Vec<(usize, &str)> =
        (1..).zip(text.lines().map(str::trim)).filter(|(_, l)| !l.is_empty()).collect();
    let mut lines = lines.into_iter();
    if lines.next().is_none_or(|(_, line)| line != HEADER) {
        return Err(bad(
            1,
            format!("expected \"{HEADER}\", the first line of the calibration program's log"),
        ));
    }
    let unit = lines.next();
    let is_metric =
        unit.and_then(|(_, line)| whole(numbers(behind(line, "unit")?)?.first().copied()?));
    let Some(is_metric) = is_metric.filter(|unit| (0..=1).contains(unit)) else {
        return Err(bad(
            unit.map_or(1, |(n, _)| n),
            "expected \"unit 1\" (mm) or \"unit 0\" (inch)".into(),
        ));
    };
    let mut found: Vec<Touch> = vec![];
    let mut last = 1;
    while let Some((line, text)) = lines.next() {
        last = line;
        if let Some(count) = behind(text, "end") {
            let count = numbers(count).and_then(|n| whole(*n.first()?));
            return match (count == Some(found.len() as i64), lines.next()) {
                (true, None) => Ok((found, is_metric == 1)),
                (true, Some((line, _))) => Err(bad(
                    line,
                    "lines after the end: if there are two logs, split them into two files".into(),
                )),
                (false, _) => Err(bad(
                    line,
                    format!("\"{text}\" after {} touches: lines are missing", found.len()),
                )),
            };
        }
        let expected = found.len() as i64 + 1;
        let number = |part: Option<&str>| whole(*numbers(part?)?.first()?);
        let foreign = || bad(line, format!("\"{text}\" is not a line of the calibration program"));
        let own = behind(text, "touch").ok_or_else(foreign)?;
        match number(own.split(' ').next()) {
            Some(n) if n == expected => {}
            Some(n) if n < expected => return Err(bad(line, format!("touch {n} appears twice"))),
            Some(n) => return Err(bad(line, format!("touch {expected} is missing, {n} follows"))),
            None => return Err(foreign()),
        }
        let first = first_half(line, own).ok_or_else(foreign)?;
        let Some((line, text)) = lines.next() else {
            return Err(bad(line, format!("the joints of touch {expected} are missing")));
        };
        let second = second_half(text, expected);
        let (joints, tool, geometry) = second.ok_or_else(|| {
            bad(
                line,
                format!(
                    "expected \"joints {expected} … tool X Y Z geometry HASH\", found \"{text}\""
                ),
            )
        })?;
        found.push(Touch { joints, tool, geometry, ..first });
    }
    Err(bad(last, "the log ends without \"end\": the program did not run to its end".into()))
}

/// Parses `N hole H approach A at X Y Z A B C`.
fn first_half(line: usize, text: &str) -> Option<Touch> {
    let (_, rest) = text.split_once(" hole ")?;
    let (hole, rest) = rest.split_once(" approach ")?;
    let (approach, at) = rest.split_once(" at ")?;
    let one = |text: &str| whole(*numbers(text)?.first()?);
    Some(Touch {
        line,
        hole: one(hole)?.try_into().ok()?,
        approach: one(approach)?.try_into().ok()?,
        at: numbers(at)?.try_into().ok()?,
        joints: vec![],
        tool: [0.0; 3],
        geometry: 0,
    })
}

/// Parses `joints N J0 J1 … tool X Y Z geometry HASH`.
fn second_half(text: &str, number: i64) -> Option<(Vec<f64>, [f64; 3], u32)> {
    let (joints, rest) = behind(text, "joints")?.split_once(" tool ")?;
    let (tool, geometry) = rest.split_once(" geometry ")?;
    let joints = numbers(joints)?;
    let (own, joints) = joints.split_first()?;
    let geometry = whole(*numbers(geometry)?.first()?)?.try_into().ok()?;
    (whole(*own)? == number).then_some((joints.to_vec(), numbers(tool)?.try_into().ok()?, geometry))
}

/// Converts the touches to readings in frame `frame`, each checked against the machine; `named` precedes
/// the line in their names.
///
/// # Errors
/// See [`BadLog`].
pub(crate) fn readings(
    config: &Mechanism,
    plate: &Plate,
    text: &str,
    frame: usize,
    named: &str,
) -> Result<Vec<Reading>, BadLog> {
    let (touches, is_metric) = touches(text)?;
    if is_metric != (config.units_per_mm == 1.0) {
        let (unit, own) = if is_metric { ("mm", "inches") } else { ("inches", "mm") };
        let text = format!(
            "logged in {unit} on a machine in {own}: run the program in the unit of the machine"
        );
        return Err(BadLog { line: 2, text });
    }
    readings_of(plate, &touches, frame, named, |touch| checked(config, touch))
}

/// Converts touches to readings; `taken` returns pose, tool and joints of one, or an error.
pub(super) fn readings_of(
    plate: &Plate,
    touches: &[Touch],
    frame: usize,
    named: &str,
    taken: impl Fn(&Touch) -> Result<Taken, BadLog>,
) -> Result<Vec<Reading>, BadLog> {
    let mut groups: Vec<(u32, [i64; 3])> = vec![];
    let mut readings = vec![];
    for touch in touches {
        let (pose, tool, joints) = taken(touch)?;
        let measured = measured(plate, touch)?;
        let place = (touch.hole, tilt(&touch.at));
        let group = groups.iter().position(|other| *other == place).unwrap_or_else(|| {
            groups.push(place);
            groups.len() - 1
        });
        let name = format!(
            "{named}:{}: hole {}, {}",
            touch.line,
            touch.hole,
            approach_name(touch.approach)
        );
        let instrument = Instrument::default();
        readings.push(Reading { name, group, joints, pose, tool, frame, measured, instrument });
    }
    Ok(readings)
}

/// Returns the orientation of a touch, rounded to a hundredth of a degree.
pub(super) fn tilt(at: &[f64; 6]) -> [i64; 3] {
    [3, 4, 5].map(|k| (at[k] * 100.0).round() as i64)
}

/// Returns the pose for a tip that LinuxCNC displays: its tool offset does not include the spindle's.
pub(super) fn shown(config: &Mechanism, at: [f64; 6], tool: &Vector3<f64>) -> Pose {
    let mut pose = Pose::from_degrees(at);
    pose.position += tool - config.spindle;
    pose
}

fn approach_name(approach: i32) -> &'static str {
    match approach {
        1 => "wall at +X",
        -1 => "wall at -X",
        2 => "wall at +Y",
        -2 => "wall at -Y",
        _ => "face",
    }
}

fn measured(plate: &Plate, touch: &Touch) -> Result<Measured, BadLog> {
    let hole = plate.hole(touch.hole);
    let hole = hole
        .ok_or_else(|| touch.bad(format!("the plate has no hole {}: check --plate", touch.hole)))?;
    match touch.approach {
        -3 => Ok(Measured::Face(plate.ball / 2.0)),
        1 | -1 | 2 | -2 => {
            Ok(Measured::Bore { axis: hole.place, radius: (hole.diameter - plate.ball) / 2.0 })
        }
        other => {
            Err(touch.bad(format!("approach {other}: expected 1, -1 (X), 2, -2 (Y) or -3 (down)")))
        }
    }
}

/// Returns pose, tool and joints of a touch, if this machine can have logged it.
fn checked(config: &Mechanism, touch: &Touch) -> Result<Taken, BadLog> {
    let own = config.hash;
    if touch.geometry != own {
        return Err(touch.bad(format!(
            "logged with geometry {:#010x}, but {} has {own:#010x}: calibrate the file that LinuxCNC used",
            touch.geometry,
            config.file.display()
        )));
    }
    if touch.joints.len() != config.joints.len() {
        let (found, expected) = (touch.joints.len(), config.joints.len());
        return Err(
            touch.bad(format!("{found} joints, but the machine has {expected}: use its own log"))
        );
    }
    let tool = Vector3::from(touch.tool);
    let pose = shown(config, touch.at, &tool);
    let mut joints = [0.0; MAX_JOINTS];
    joints[..touch.joints.len()].copy_from_slice(&touch.joints);
    let mine = config.machine.inverse(&pose, &tool).ok();
    let miss = mine.map(|mine| {
        (0..touch.joints.len()).map(|i| (mine[i] - joints[i]).abs()).fold(0.0, f64::max)
    });
    if miss.is_some_and(|miss| miss <= AGREEMENT * config.machine.size()) {
        return Ok((pose, tool, joints));
    }
    Err(touch.bad(disagreement(config, touch, &joints, &tool, miss)))
}

/// Explains why joints and position of a touch do not agree.
fn disagreement(
    config: &Mechanism,
    touch: &Touch,
    joints: &[f64; MAX_JOINTS],
    tool: &Vector3<f64>,
    miss: Option<f64>,
) -> String {
    let there = config.machine.forward(joints, &config.home_pose(), tool, &Solver::default());
    let Ok(there) = there else {
        return "no pose of this machine has these joint values: use its own log".into();
    };
    let tip = there.pose.position - tool + config.spindle;
    let at = Vector3::new(touch.at[0], touch.at[1], touch.at[2]);
    let ratio = tip.norm() / at.norm();
    let unit = [25.4, 1.0 / 25.4].into_iter().find(|unit| (ratio / unit - 1.0).abs() < 1e-3);
    if unit.is_some() {
        return "the position is in another unit than the machine: run the program in the unit of the machine".into();
    }
    // Adding 0 avoids "-0".
    let [x, y, z] = (at - tip).map(|x| (x * 1e4).round() / 1e4 + 0.0).into();
    let miss = miss.map_or(String::new(), |miss| format!(", and joints {miss:.6} off"));
    format!(
        "by its joints the tip was {x:.4} {y:.4} {z:.4} from the logged position{miss}: check for work \
         offsets (G54 to G59.3, G92), and for another tool offset or OFFSET than in the file"
    )
}

/// Returns the approximate center of each hole: the mean of the tips that touched its walls.
pub(crate) fn centres(plate: &Plate, readings: &[Reading]) -> Vec<(u32, Vector3<f64>)> {
    let of = |number: u32, place: [f64; 2]| {
        let tips: Vec<Vector3<f64>> = readings
            .iter()
            .filter(|r| matches!(r.measured, Measured::Bore { axis, .. } if axis == place))
            .map(|r| r.pose.position - r.tool)
            .collect();
        let mean = tips.iter().sum::<Vector3<f64>>() / tips.len().max(1) as f64;
        (!tips.is_empty()).then_some((number, mean))
    };
    plate.hole.iter().filter_map(|hole| of(hole.number, hole.place)).collect()
}
