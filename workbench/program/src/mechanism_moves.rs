// SPDX-License-Identifier: GPL-2.0-or-later
//! The moves of a program as one of two mechanisms makes them.
//!
//! A block moves both, and takes as long as LinuxCNC makes it: the feed is that of X Y Z together where
//! one of them moves, else that of U V W, else that of A B C. Each mechanism by itself then has moves
//! with the feed that comes to the same time.

use crate::motion::{Move, MoveKind, ProgramError, read};
use crate::replay::duration;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::path::{Path, PathBuf};

/// Reads all moves of a program as this mechanism of `whole` makes them, and the names of its files.
///
/// # Errors
/// As [`read`].
pub fn moves_of(
    mechanism: &Mechanism,
    whole: &MachineConfig,
    program: &Path,
) -> Result<(Vec<Move>, Vec<PathBuf>), ProgramError> {
    let mut half = Half::new(mechanism, whole);
    let (all, files) = read(whole, program, None)?;
    Ok((all.into_iter().map(|step| half.of(&step)).collect(), files))
}

/// Makes moves of one mechanism of moves of both.
pub struct Half<'a> {
    mechanism: &'a Mechanism,
    whole: &'a MachineConfig,
    /// Where each stands.
    at: Vec<[f64; 6]>,
}

impl<'a> Half<'a> {
    /// Starts where all are at home.
    pub fn new(mechanism: &'a Mechanism, whole: &'a MachineConfig) -> Self {
        Self { mechanism, whole, at: whole.mechanisms.iter().map(|one| one.home).collect() }
    }

    /// The part of the mechanism in the next move.
    pub fn of(&mut self, step: &Move) -> Move {
        let [first, second] = self.whole.mechanisms.as_slice() else { return *step };
        let each: Vec<Move> = step.of_each().collect();
        let [one, other] = each.as_slice() else { return *step };
        let seconds = seconds([first, second], [&self.at[0], &self.at[1]], [one, other]);
        let number = usize::from(self.mechanism.place.is_second);
        let mut own = each[number];
        lasting(&mut own, &self.at[number], seconds);
        self.at = vec![one.end, other.end];
        own
    }
}

/// Seconds that a move of both takes.
fn seconds(
    [first, second]: [&Mechanism; 2],
    [of_first, of_second]: [&[f64; 6]; 2],
    [one, other]: [&Move; 2],
) -> f64 {
    let moves = |from: &[f64; 6], to: &[f64; 6]| (0..3).any(|k| from[k] != to[k]);
    // Where X Y Z move they set the feed, and the others only keep their limits.
    let leads = moves(of_first, &one.end);
    let rapid = |step: &Move| Move { kind: MoveKind::Rapid, ..*step };
    let (lead, follow) = match leads || !moves(of_second, &other.end) {
        true => (*one, rapid(other)),
        false => (rapid(one), *other),
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
