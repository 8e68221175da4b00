// SPDX-License-Identifier: GPL-2.0-or-later
//! Available travel of the machine from a pose, along every single letter, in both directions.
//!
//! The path to the end of the letter's range is checked as a move of a program
//! (`follow`): up to the reported position every limit is proved.

use crate::motion::{Beside, Move, MoveKind, Spindle};
use crate::report::Break;
use crate::two_mechanisms::Flights;
use kinematics::{Fault, Letter, Limit, MAX_EXTRA, POSE_LETTERS, Pose, Vector3, World};
use machine::read::joints::Axis;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use serde::Serialize;

/// Number of parts in which the path is checked: parts after the first violation are skipped.
const PARTS: u32 = 8;

/// A full turn, after which everything repeats.
const TURN: f64 = 360.0;

/// Length of a path without a range limit, in sizes of the machine.
const FAR: f64 = 4.0;

/// Pose and tools of a machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    /// LinuxCNC's pose X Y Z A B C U V W, machine units and degrees.
    pub world: World,
    /// Active tool vectors, of the first mechanism and of a second one, spindle offset included.
    pub tools: [Vector3<f64>; 2],
}

/// Available travel along a letter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Travel {
    /// The letter.
    pub letter: char,
    /// Unit of its values.
    pub unit: &'static str,
    /// Toward smaller values.
    pub minus: Side,
    /// Toward larger values.
    pub plus: Side,
}

/// Available travel along a letter, in one direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Side {
    /// Travel in the letter's unit; `None` if unlimited.
    pub left: Option<f64>,
    /// The part and limit that end it.
    pub stop: Option<String>,
}

/// A letter with its own range.
struct LetterRange {
    place: usize,
    unit: &'static str,
    /// Ends of its range, and the limits that set them.
    ends: [f64; 2],
    names: [String; 2],
    is_angle: bool,
}

impl Stand {
    /// Returns `[TRAJ]HOME`, without a tool.
    pub fn home(config: &MachineConfig) -> Self {
        let mut world = [0.0; 9];
        for mechanism in &config.mechanisms {
            for letter in moved(mechanism) {
                let k = letter.index();
                world[mechanism.place.places[k]] = mechanism.start[k];
            }
        }
        let first = config.first();
        for (place, axis) in first.extra_axes.places().zip(&first.extra) {
            world[place] = axis.joint.home;
        }
        let last = config.mechanisms.last().unwrap_or(first);
        Self { world, tools: [first.spindle, last.spindle] }
    }

    /// Returns the pose of this mechanism in its own letters.
    fn pose_of(&self, mechanism: &Mechanism) -> [f64; 6] {
        let mut pose = mechanism.start;
        for letter in moved(mechanism) {
            let k = letter.index();
            pose[k] = self.world[mechanism.place.places[k]];
        }
        pose
    }

    /// Returns a move that ends here.
    fn reached(&self, config: &MachineConfig) -> Move {
        let mut each = config.mechanisms.iter().zip(self.tools).map(|(mechanism, tool)| Beside {
            end: self.pose_of(mechanism),
            tool: (tool - mechanism.spindle).into(),
        });
        let Beside { end, tool } = each.next().expect("a machine has a mechanism");
        let mut extra_end = [0.0; MAX_EXTRA];
        let places = config.first().extra_axes.places();
        extra_end.iter_mut().zip(places).for_each(|(to, place)| *to = self.world[place]);
        Move {
            kind: MoveKind::Rapid,
            line: 0,
            end,
            feed: f64::INFINITY,
            angular_feed: f64::INFINITY,
            tool,
            file: 0,
            extra: false,
            lasts: None,
            second: each.next(),
            extra_end,
            spindle: Spindle::Unknown,
            is_per_turn: false,
        }
    }
}

/// Returns the available travel along every letter that moves something, in LinuxCNC's order.
///
/// # Errors
/// The pose is not legal.
pub fn travel(config: &MachineConfig, stand: &Stand) -> Result<Vec<Travel>, Fault> {
    stands(config, stand)?;
    let both = |range: &LetterRange| {
        let [minus, plus] = [0, 1].map(|end| side(config, stand, range, end));
        let (letter, unit) = (POSE_LETTERS[range.place], range.unit);
        Ok(Travel { letter, unit, minus: minus?, plus: plus? })
    };
    letter_ranges(config).iter().map(both).collect()
}

/// Refuses a pose without joint values.
fn stands(config: &MachineConfig, stand: &Stand) -> Result<(), Fault> {
    let step = stand.reached(config);
    for (mechanism, tool) in config.mechanisms.iter().zip(stand.tools) {
        let pose = mechanism.carried(&stand.pose_of(mechanism), &step.extra_end, &tool)?;
        let pose = Pose::from_degrees(pose);
        let counted = |fault| mechanism.place.counted(fault);
        mechanism.machine.at(&pose, &mechanism.chain.machine_tool(&tool)).map_err(counted)?;
    }
    Ok(())
}

/// Returns the coordinates that a mechanism moves.
fn moved(mechanism: &Mechanism) -> impl Iterator<Item = Letter> {
    let layout = *mechanism.machine.layout();
    Letter::ALL.into_iter().filter(move |letter| !layout.is_held(*letter))
}

/// Returns the letters with available travel, in LinuxCNC's order.
pub fn letters(config: &MachineConfig) -> String {
    letter_ranges(config).iter().map(|range| POSE_LETTERS[range.place]).collect()
}

fn letter_ranges(config: &MachineConfig) -> Vec<LetterRange> {
    let mut ranges: Vec<LetterRange> = vec![];
    for mechanism in &config.mechanisms {
        for letter in moved(mechanism) {
            let Axis { min, max, .. } = mechanism.programmed[letter.index()];
            let name = of_axis(mechanism.place.letter(letter));
            ranges.push(LetterRange {
                place: mechanism.place.places[letter.index()],
                unit: unit(config, letter.is_angle()),
                ends: [min, max],
                names: [name.clone(), name],
                is_angle: letter.is_angle(),
            });
        }
    }
    let first = config.first();
    for (place, extra) in first.extra_axes.places().zip(&first.extra) {
        let of_joint = format!("{}: {}", extra.joint.name, Limit::JointRange.name());
        let name =
            |joint_ends: bool| if joint_ends { of_joint.clone() } else { of_axis(extra.letter) };
        let is_angle = (3..6).contains(&place);
        ranges.push(LetterRange {
            place,
            unit: unit(config, is_angle),
            ends: [extra.axis.min.max(extra.joint.min), extra.axis.max.min(extra.joint.max)],
            names: [name(extra.joint.min > extra.axis.min), name(extra.joint.max < extra.axis.max)],
            is_angle,
        });
    }
    ranges.sort_by_key(|range| range.place);
    ranges
}

fn of_axis(letter: char) -> String {
    format!("axis {letter}: {}", Limit::Axis.name())
}

fn unit(config: &MachineConfig, is_angle: bool) -> &'static str {
    if is_angle { "degrees" } else { config.length_unit() }
}

/// Returns the available travel toward one end of a letter's range.
fn side(
    config: &MachineConfig,
    stand: &Stand,
    range: &LetterRange,
    end: usize,
) -> Result<Side, Fault> {
    let sign = [-1.0, 1.0][end];
    let free = (sign * (range.ends[end] - stand.world[range.place])).max(0.0);
    // A turn repeats everything except the letter's own range; a length is checked up to its end, if any.
    let far = FAR * config.first().machine.size();
    let followed = match range.is_angle {
        true => free.min(TURN),
        false => {
            if free.is_finite() {
                free
            } else {
                far
            }
        }
    };
    let part = followed / f64::from(PARTS);
    let mut at = stand.clone();
    for n in 0..PARTS {
        let mut next = at.clone();
        next.world[range.place] += sign * part;
        if let Some(first) = first_break(config, range, &at, &next)? {
            let left = part * (f64::from(n) + first.share);
            let stop = format!("{}: {}", first.part, first.limit.name());
            return Ok(Side { left: Some(left), stop: Some(stop) });
        }
        at = next;
    }
    let is_ended = free.is_finite();
    Ok(Side { left: is_ended.then_some(free), stop: is_ended.then(|| range.names[end].clone()) })
}

/// Returns the first violation of a straight move along a letter; the letter's own range is checked by the caller,
/// because the move may begin beyond it.
fn first_break(
    config: &MachineConfig,
    range: &LetterRange,
    at: &Stand,
    next: &Stand,
) -> Result<Option<Break>, Fault> {
    let mut flights = Flights::standing(&config.mechanisms, &at.reached(config))?;
    flights.see(&next.reached(config));
    let own = format!("axis {}", POSE_LETTERS[range.place]);
    let breaks = flights.finish()?.breaks.into_iter();
    let others = breaks.filter(|found| found.limit != Limit::Axis || found.part != own);
    Ok(others.min_by(|a, b| a.share.total_cmp(&b.share)))
}
