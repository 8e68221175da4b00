// SPDX-License-Identifier: GPL-2.0-or-later
//! Files that LinuxCNC writes (PROBEOPEN …): the position of the probe at the end of each probing move, and
//! nothing else. Comments that the user adds state their origin:
//!
//! ```text
//! # machine hexapod.ini
//! # geometry 1844604530
//! # tool 0 0 60                       with the spindle offset
//! # coordinates machine               no work offset, the machine's unit
//! # plate 0 0 150 0 0 0               approximate pose of the plate
//! X Y Z A B C U V W                   LinuxCNC's lines, six decimals
//! ```
//!
//! LinuxCNC writes the tip in the work coordinates and the unit of the program. The position of a line on the
//! plate determines which wall or face it belongs to. The joints are the inverse of the position by the
//! geometry that the file names. A wall that is touched fast and then slowly gives two lines: of consecutive
//! lines at one position of the plate and one orientation, the last one is used.

use super::heading;
use super::log::{self, BadLog, Touch};
use super::model::Frame;
use super::plate::{Hole, Plate};
use super::reading::Reading;
use kinematics::{Pose, Vector3};
use machine::read::mechanism::Mechanism;
use std::fmt;

/// Largest deviation of a ball from its expected position, in its diameters: half the distance
/// from its height on the face to the height at which it enters a bore.
const REACH: f64 = 0.25;

/// Largest distance between lines of one position, in diameters of the ball.
const ONE_PLACE: f64 = 0.1;

/// Depth in a bore that no probe reaches, in diameters of its ball.
const TOO_DEEP: f64 = 10.0;

const COLUMNS: usize = 9;

/// Converts the touches of a file to readings in frame `frame`; `named` precedes the line in their names.
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
    of_machine(config, text)?;
    heading::of_geometry(config, text)?;
    in_machine_coordinates(text)?;
    let tool = heading::tool(text)?;
    let lying = lying(text)?;
    let mut touches: Vec<Touch> = vec![];
    for (line, at) in lines(text)? {
        let (hole, approach) = placed(plate, &lying, &at)
            .map_err(|nowhere| BadLog { line, text: nowhere.to_string() })?;
        let (joints, geometry) = (vec![], config.hash);
        let touch = Touch { line, hole, approach, at, joints, tool: tool.into(), geometry };
        match touches.last_mut() {
            Some(last) if is_one_place(plate, last, &touch) => *last = touch,
            _ => touches.push(touch),
        }
    }
    log::readings_of(plate, &touches, frame, named, |touch| {
        let pose = log::shown(config, touch.at, &tool);
        let joints =
            config.machine.inverse(&pose, &tool).map_err(|fault| touch.bad(fault.to_string()))?;
        Ok((pose, tool, joints))
    })
}

fn of_machine(config: &Mechanism, text: &str) -> Result<(), BadLog> {
    let own = config.file.file_name().unwrap_or_default().to_string_lossy();
    let expected = format!("a line \"# machine {own}\" above the points of PROBEOPEN");
    let (line, name) = heading::value(text, "machine", &expected)?;
    if name == own {
        return Ok(());
    }
    let text = format!("points of {name}: expected points of {own}, the machine to calibrate");
    Err(BadLog { line, text })
}

fn in_machine_coordinates(text: &str) -> Result<(), BadLog> {
    let expected = "a line \"# coordinates machine\"";
    let (line, name) = heading::value(text, "coordinates", expected)?;
    if name == "machine" {
        return Ok(());
    }
    let text = format!(
        "coordinates {name}: expected machine; probe without a work offset (G54 to G59.3, G92)"
    );
    Err(BadLog { line, text })
}

/// Parses the approximate pose of the plate.
fn lying(text: &str) -> Result<Frame, BadLog> {
    let expected = "a line \"# plate X Y Z A B C\", the approximate origin and angles of the plate in \
         machine coordinates";
    let pose = Pose::from_degrees(heading::numbers(text, "plate", expected)?);
    Ok(Frame { origin: pose.position, rotation: pose.rotation() })
}

/// Parses tip and angles of every line, with its number.
fn lines(text: &str) -> Result<Vec<(usize, [f64; 6])>, BadLog> {
    let mut found: Vec<(usize, &str, [f64; 6])> = vec![];
    let own = (1..).zip(text.lines().map(str::trim)).filter(|(_, l)| !heading::is_comment(l));
    for (line, words) in own {
        let bad = |text| Err(BadLog { line, text });
        let numbers = heading::finite(words).filter(|numbers| numbers.len() == COLUMNS);
        let Some(numbers) = numbers else {
            return bad(format!(
                "\"{words}\" is not a line of PROBEOPEN: expected {COLUMNS} numbers X Y Z A B C U V W"
            ));
        };
        if numbers[6..].iter().any(|x| *x != 0.0) {
            return bad("U, V and W must be 0: this machine has no such axes".into());
        }
        // LinuxCNC omits a line equal to the one before.
        if let Some((first, ..)) = found.iter().find(|(_, other, _)| *other == words) {
            return bad(format!("this line repeats line {first}; remove one"));
        }
        found.push((line, words, std::array::from_fn(|k| numbers[k])));
    }
    Ok(found.into_iter().map(|(line, _, at)| (line, at)).collect())
}

/// A position on the plate.
#[derive(Debug)]
struct Spot(Vector3<f64>);

impl fmt::Display for Spot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} {:.3} {:.3} on the plate", self.0.x, self.0.y, self.0.z)
    }
}

/// Why a tip touches no part of the plate.
#[derive(Debug, thiserror::Error)]
enum Nowhere {
    #[error("in another unit than the machine: run the program in the unit of the machine")]
    OtherUnit,
    #[error(
        "{0}: check for work coordinates, a probing move without contact, or a wrong \"# plate\""
    )]
    Elsewhere(Box<Nowhere>),
    #[error("the plate has no hole")]
    NoHole,
    #[error("{0} is over hole {1} or its edge")]
    OverHole(Spot, u32),
    #[error("{0} is neither on the face nor down in a hole")]
    OffPlate(Spot),
    #[error(
        "{place} is not on a wall: the axis of hole {hole} is {away:.3} away, its walls {walls:.3}"
    )]
    NoWall { place: Spot, hole: u32, away: f64, walls: f64 },
    #[error("{0} may be a wall of hole {1} or of hole {2}")]
    TwoWalls(Spot, u32, u32),
}

/// Returns hole and approach of a touch, from its position on the plate.
fn placed(plate: &Plate, lying: &Frame, at: &[f64; 6]) -> Result<(u32, i32), Nowhere> {
    let tip = Vector3::new(at[0], at[1], at[2]);
    touched(plate, lying, &tip).map_err(|nowhere| {
        let mut units = [25.4, 1.0 / 25.4].into_iter();
        match units.any(|unit| touched(plate, lying, &(tip * unit)).is_ok()) {
            true => Nowhere::OtherUnit,
            false => Nowhere::Elsewhere(Box::new(nowhere)),
        }
    })
}

/// Returns hole and approach of a tip, or the reason why it touches nothing.
fn touched(plate: &Plate, lying: &Frame, tip: &Vector3<f64>) -> Result<(u32, i32), Nowhere> {
    let reach = REACH * plate.ball;
    let there = lying.seen(tip);
    let from_axis =
        |hole: &Hole| Vector3::new(there.x - hole.place[0], there.y - hole.place[1], 0.0);
    let mut near: Vec<(f64, &Hole)> =
        plate.hole.iter().map(|hole| (from_axis(hole).norm(), hole)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [_, _, z] = there.into();
    let place = Spot(there);
    let Some((away, hole)) = near.first() else { return Err(Nowhere::NoHole) };
    // On the face the ball's center is half a diameter above it.
    if (z - plate.ball / 2.0).abs() <= reach {
        return match *away > hole.diameter / 2.0 + reach {
            true => Ok((hole.number, -3)),
            false => Err(Nowhere::OverHole(place, hole.number)),
        };
    }
    if z > 0.0 || z < -TOO_DEEP * plate.ball {
        return Err(Nowhere::OffPlate(place));
    }
    let is_wall =
        |(away, hole): &&(f64, &Hole)| (away - (hole.diameter - plate.ball) / 2.0).abs() <= reach;
    match near.iter().filter(is_wall).collect::<Vec<_>>()[..] {
        [(_, hole)] => Ok((hole.number, along(&(lying.rotation * from_axis(hole))))),
        [] => {
            let walls = (hole.diameter - plate.ball) / 2.0;
            Err(Nowhere::NoWall { place, hole: hole.number, away: *away, walls })
        }
        [(_, a), (_, b), ..] => Err(Nowhere::TwoWalls(place, a.number, b.number)),
    }
}

/// Returns the signed number of the axis, X or Y, nearest to a direction.
fn along(direction: &Vector3<f64>) -> i32 {
    let (axis, part) =
        if direction.x.abs() >= direction.y.abs() { (1, direction.x) } else { (2, direction.y) };
    if part < 0.0 { -axis } else { axis }
}

/// Returns whether a touch repeats the one before.
fn is_one_place(plate: &Plate, last: &Touch, touch: &Touch) -> bool {
    let apart = (0..3).map(|k| (touch.at[k] - last.at[k]).powi(2)).sum::<f64>().sqrt();
    let is_face = |touch: &Touch| touch.approach == -3;
    // Touches farther apart than the ball can move from the middle are of two walls.
    let room = match plate.hole(touch.hole) {
        Some(hole) if !is_face(touch) => (hole.diameter - plate.ball) / 2.0,
        _ => f64::INFINITY,
    };
    (last.hole, is_face(last), log::tilt(&last.at))
        == (touch.hole, is_face(touch), log::tilt(&touch.at))
        && apart <= room.min(ONE_PLACE * plate.ball)
}
