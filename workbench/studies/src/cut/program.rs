// SPDX-License-Identifier: GPL-2.0-or-later
//! Determines which lines of a program cut, and where to assess stability.

use crate::cut::stance::Stance;
use crate::stability::path::Stop;
use crate::study::cutting::Turning;
use kinematics::{Fault, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use program::motion::{Move, MoveKind, Spindle};
use std::collections::BTreeMap;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Its largest feed, machine units per second; infinite if the spindle determines it.
    pub feed: f64,
    /// Spindle speed, 1/min.
    pub rpm: f64,
}

/// Why the cutting conditions of a program are unknown.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoCut {
    #[error("the program has no feed moves: add some")]
    NoFeed,
    #[error("line {0}: the tool cuts without a spindle speed; add an S word, or --rpm")]
    NoSpeed(u32),
    /// The spindle is off: neither M3 nor M4, or M5 since.
    #[error("line {0}: the tool cuts with the spindle stopped; add M3 or M4, or --rpm")]
    Standing(u32),
    /// G96: the speed depends on the position.
    #[error("line {0}: with G96 the spindle speed depends on the position; set one with --rpm")]
    Surface(u32),
    #[error("line {0}: the spindle speed is unknown; set one with --rpm")]
    Unknown(u32),
    #[error("line {0}: it cuts at several spindle speeds; set one with --rpm")]
    Several(u32),
    #[error("line {0}: {1}")]
    Fault(u32, Fault),
    /// Every cut that is not across it.
    #[error(
        "line {0}: the feed is against [turning] thicker, as in every cut of the program, but a tool that moves with the \
         feed makes the chip thicker; reverse the sign of thicker"
    )]
    Thinner(u32),
}

/// Cosine of the angle to [`Turning::thicker`] up to which a feed is across it: a tenth of a degree.
const ACROSS: f64 = 1.7e-3;

/// Returns the number of feed moves against the direction of a thicker chip, and the line of the first one.
///
/// # Errors
/// [`NoCut::Thinner`] if there is no feed move along it, or see [`stance`].
pub fn against_thicker(
    config: &Mechanism,
    moves: &[Move],
    turning: &Turning,
) -> Result<Option<(usize, u32)>, NoCut> {
    let (mut along, mut against) = (0, 0);
    let mut first = None;
    for [from, step] in cuts(moves) {
        let feed = Vector3::from_fn(|k, _| step.end[k] - from.end[k]);
        let stance = stance(config, step).map_err(|fault| NoCut::Fault(step.line, fault))?;
        let cosine = (stance.work * feed).dot(&turning.thicker.0) / feed.norm();
        along += usize::from(cosine > ACROSS);
        if cosine < -ACROSS {
            against += 1;
            first = first.or(Some(step.line));
        }
    }
    match first {
        Some(line) if along == 0 => Err(NoCut::Thinner(line)),
        first => Ok(first.map(|line| (against, line))),
    }
}

/// Returns a warning about feed moves that [`against_thicker`] found.
pub fn thinner((count, line): (usize, u32)) -> String {
    format!(
        "line {line}: the feed is against [turning] thicker, {count} such moves in all; their limit depth is that of a \
         chip that the feed makes thicker. Judge cuts in this direction with another study"
    )
}

/// Returns the feed moves of a program: the start of each, and the move.
pub fn cuts(moves: &[Move]) -> impl Iterator<Item = [&Move; 2]> {
    numbered_cuts(moves).map(|(_, pair)| pair)
}

/// Returns the feed moves with their indices.
fn numbered_cuts(moves: &[Move]) -> impl Iterator<Item = (usize, [&Move; 2])> {
    let pairs = moves.windows(2).map(|pair| [&pair[0], &pair[1]]);
    let pairs = pairs.enumerate().map(|(k, pair)| (k + 1, pair));
    pairs.filter(|(_, [from, step])| step.kind == MoveKind::Feed && step.end != from.end)
}

/// Returns the length of a move in machine units; degrees if only rotary axes move.
pub fn length([from, step]: [&Move; 2]) -> f64 {
    let norm = |letters: std::ops::Range<usize>| {
        letters.map(|k| (step.end[k] - from.end[k]).powi(2)).sum::<f64>().sqrt()
    };
    let linear = norm(0..3);
    if linear > 0.0 { linear } else { norm(3..6) }
}

/// Returns the length of the feed moves up to the end of each of these moves, which are in order.
pub fn lengths(moves: &[Move], stops: &[Stop]) -> Vec<f64> {
    let mut cuts = numbered_cuts(moves).peekable();
    let mut total = 0.0;
    let up_to = |stop: &Stop| {
        while let Some((_, pair)) = cuts.next_if(|(number, _)| *number <= stop.step) {
            total += length(pair);
        }
        total
    };
    stops.iter().map(up_to).collect()
}

/// Returns the spindle speed of a feed move, 1/min.
fn rpm(step: &Move) -> Result<f64, NoCut> {
    match step.spindle {
        Spindle::Turning(rpm) if rpm > 0.0 => Ok(rpm),
        Spindle::Standing(rpm) if rpm > 0.0 => Err(NoCut::Standing(step.line)),
        Spindle::Turning(_) | Spindle::Standing(_) => Err(NoCut::NoSpeed(step.line)),
        Spindle::Surface => Err(NoCut::Surface(step.line)),
        Spindle::Unknown => Err(NoCut::Unknown(step.line)),
    }
}

/// Returns the lines with feed moves.
///
/// # Errors
/// See [`NoCut`].
pub fn lines(moves: &[Move]) -> Result<BTreeMap<u32, Line>, NoCut> {
    let mut lines = BTreeMap::new();
    for [_, step] in cuts(moves) {
        let rpm = rpm(step)?;
        let line = lines.entry(step.line).or_insert(Line { feed: step.feed, rpm });
        if line.rpm != rpm {
            return Err(NoCut::Several(step.line));
        }
        line.feed = line.feed.max(step.feed);
    }
    if lines.is_empty() { Err(NoCut::NoFeed) } else { Ok(lines) }
}

/// Returns ends of the feed moves, evenly selected if there are more than `most`, and the number of moves.
///
/// # Errors
/// See [`NoCut`].
pub fn stops(config: &Mechanism, moves: &[Move], most: usize) -> Result<(Vec<Stop>, usize), NoCut> {
    let all: Vec<(usize, [&Move; 2])> = numbered_cuts(moves).collect();
    if all.is_empty() {
        return Err(NoCut::NoFeed);
    }
    // A move that is not selected needs a speed as well.
    all.iter().try_for_each(|(_, [_, step])| rpm(step).map(drop))?;
    let count = all.len().min(most);
    let stop = |k: usize| -> Result<Stop, NoCut> {
        let (number, [from, step]) = all[k * all.len() / count];
        let feed = Vector3::from_fn(|i, _| step.end[i] - from.end[i]);
        let stance = stance(config, step).map_err(|fault| NoCut::Fault(step.line, fault))?;
        Ok(Stop {
            step: number,
            line: step.line,
            programmed: step.end,
            pose: Pose::from_degrees(stance.pose),
            tool: stance.tool,
            rotation: stance.rotation,
            // A move of rotary axes alone has no linear feed: use the worst feed, as in a plunge.
            feed: match feed.norm() > 0.0 {
                true => stance.work * feed,
                false => stance.rotation.column(2).into_owned(),
            },
            rpm: rpm(step)?,
        })
    };
    Ok(((0..count).map(stop).collect::<Result<_, _>>()?, all.len()))
}

/// Returns the stance at the end of a move.
///
/// # Errors
/// As [`Stance::at`].
pub fn stance(config: &Mechanism, step: &Move) -> Result<Stance, Fault> {
    let tool = config.spindle + Vector3::from(step.tool);
    Stance::at(config, &step.end, &config.world(&step.end, &step.extra_end), &tool)
}
