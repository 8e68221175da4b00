// SPDX-License-Identifier: GPL-2.0-or-later
//! The moves of a program as one of two mechanisms makes them.
//!
//! A block moves both, and takes as long as LinuxCNC makes it: the feed is that of X Y Z together where
//! one of them moves, else that of U V W, else that of A B C. Each mechanism by itself then has moves
//! with the feed that comes to the same time.

use crate::program::interpreter::{Beside, InterpreterError, Move, MoveKind, moves};
use crate::program::replay::duration;
use crate::read::machine::MachineConfig;
use std::path::Path;

/// All moves of a program as this mechanism of a file with two makes them; `whole` is both.
///
/// # Errors
/// As [`moves`].
pub fn moves_of(
    mechanism: &MachineConfig,
    whole: &MachineConfig,
    program: &Path,
) -> Result<Vec<Move>, InterpreterError> {
    let Some(second) = whole.second.as_deref() else { return moves(mechanism, program, None) };
    let (mut of_first, mut of_second) = (whole.home, second.home);
    let mut all = moves(whole, program, None)?;
    for step in &mut all {
        let Some(beside) = step.second else { continue };
        let seconds = seconds([whole, second], [&of_first, &of_second], step, &beside);
        let from = if mechanism.place.is_second { of_second } else { of_first };
        (of_first, of_second) = (step.end, beside.end);
        if mechanism.place.is_second {
            (step.end, step.tool) = (beside.end, beside.tool);
        }
        step.second = None;
        lasting(step, &from, seconds);
    }
    Ok(all)
}

/// Seconds that a move of both takes.
fn seconds(
    [first, second]: [&MachineConfig; 2],
    [of_first, of_second]: [&[f64; 6]; 2],
    step: &Move,
    beside: &Beside,
) -> f64 {
    let moves = |from: &[f64; 6], to: &[f64; 6]| (0..3).any(|k| from[k] != to[k]);
    let own = Move { end: beside.end, second: None, ..*step };
    // Where X Y Z move they set the feed, and the others only keep their limits.
    let leads = moves(of_first, &step.end);
    let rapid = |step: &Move| Move { kind: MoveKind::Rapid, ..*step };
    let (lead, follow) = match leads || !moves(of_second, &beside.end) {
        true => (*step, rapid(&own)),
        false => (rapid(step), own),
    };
    duration(first, of_first, &lead).max(duration(second, of_second, &follow))
}

/// Gives a move these seconds, which pass for a mechanism that stands as well, and the feed that comes to
/// them.
fn lasting(step: &mut Move, from: &[f64; 6], seconds: f64) {
    step.lasts = Some(seconds);
    let norm =
        |k: std::ops::Range<usize>| k.map(|k| (step.end[k] - from[k]).powi(2)).sum::<f64>().sqrt();
    let (linear, angular) = (norm(0..3), norm(3..6));
    if seconds > 0.0 {
        (step.feed, step.angular_feed) = (linear / seconds, angular / seconds);
        if step.kind == MoveKind::Rapid {
            step.kind = MoveKind::Feed;
        }
    }
}
