// SPDX-License-Identifier: GPL-2.0-or-later
//! The moves of a program as one of two mechanisms makes them.
//!
//! A block moves both, and takes as long as LinuxCNC makes it: the feed is that of X Y Z together where
//! one of them moves, else that of U V W, else that of A B C. Each mechanism by itself then has moves
//! with the feed that comes to the same time.

use crate::program::motion::{Beside, Move, MoveKind, ProgramError, read};
use crate::program::replay::duration;
use crate::read::machine::Mechanism;
use std::path::{Path, PathBuf};

/// Reads all moves of a program as this mechanism of a file with two makes them, and the names of its files; `whole`
/// is both.
///
/// # Errors
/// As [`read`].
pub fn moves_of(
    mechanism: &Mechanism,
    whole: &Mechanism,
    program: &Path,
) -> Result<(Vec<Move>, Vec<PathBuf>), ProgramError> {
    let mut half = Half::new(mechanism, whole);
    let (all, files) = read(whole, program, None)?;
    Ok((all.iter().map(|step| half.of(step)).collect(), files))
}

/// Makes moves of one mechanism of moves of both.
pub struct Half<'a> {
    mechanism: &'a Mechanism,
    whole: &'a Mechanism,
    /// Where both stand.
    at: [[f64; 6]; 2],
}

impl<'a> Half<'a> {
    /// Starts where both are at home.
    pub fn new(mechanism: &'a Mechanism, whole: &'a Mechanism) -> Self {
        let second = whole.second.as_deref().unwrap_or(whole);
        Self { mechanism, whole, at: [whole.home, second.home] }
    }

    /// The part of the mechanism in the next move.
    pub fn of(&mut self, step: &Move) -> Move {
        let mut own = *step;
        let (Some(beside), Some(second)) = (step.second, self.whole.second.as_deref()) else {
            return own;
        };
        let [of_first, of_second] = self.at;
        let seconds = seconds([self.whole, second], [&of_first, &of_second], step, &beside);
        let from = if self.mechanism.place.is_second { of_second } else { of_first };
        self.at = [step.end, beside.end];
        if self.mechanism.place.is_second {
            (own.end, own.tool) = (beside.end, beside.tool);
        }
        own.second = None;
        lasting(&mut own, &from, seconds);
        own
    }
}

/// Seconds that a move of both takes.
fn seconds(
    [first, second]: [&Mechanism; 2],
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
