// SPDX-License-Identifier: GPL-2.0-or-later
//! The moves of a program for one of two mechanisms.
//!
//! A block moves both, with LinuxCNC's duration: the feed is that of X Y Z together if
//! one of them moves, otherwise that of U V W, otherwise that of A B C. Each single mechanism then has moves
//! with the feed that gives the same duration.

use crate::motion::{Move, MoveKind, ProgramError, read};
use crate::replay::duration;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::path::{Path, PathBuf};

/// Reads all moves of a program for this mechanism of `whole`, and the names of its files.
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

/// Converts moves of both mechanisms to those of one.
pub struct Half<'a> {
    mechanism: &'a Mechanism,
    whole: &'a MachineConfig,
    /// Current poses of the mechanisms.
    at: Vec<[f64; 6]>,
}

impl<'a> Half<'a> {
    /// Starts with all mechanisms at home.
    pub fn new(mechanism: &'a Mechanism, whole: &'a MachineConfig) -> Self {
        Self { mechanism, whole, at: whole.mechanisms.iter().map(|one| one.home).collect() }
    }

    /// Returns the part of the mechanism in the next move.
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

/// Returns the duration of a move of both, seconds.
fn seconds(
    [first, second]: [&Mechanism; 2],
    [of_first, of_second]: [&[f64; 6]; 2],
    [one, other]: [&Move; 2],
) -> f64 {
    let moves = |from: &[f64; 6], to: &[f64; 6]| (0..3).any(|k| from[k] != to[k]);
    // If X Y Z move they determine the feed, and the others only limit it.
    let leads = moves(of_first, &one.end);
    let rapid = |step: &Move| Move { kind: MoveKind::Rapid, ..*step };
    let (lead, follow) = match leads || !moves(of_second, &other.end) {
        true => (*one, rapid(other)),
        false => (rapid(one), *other),
    };
    duration(first, of_first, &lead).max(duration(second, of_second, &follow))
}

/// Sets the duration of a move, even if the mechanism does not move, and the corresponding
/// feed.
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
