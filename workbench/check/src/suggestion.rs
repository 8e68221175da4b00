// SPDX-License-Identifier: GPL-2.0-or-later
//! Text of proved axis limits, and of the gain by a smaller tilt.

use kinematics::Letter;
use machine::proof::axis_box::AxisBox;
use machine::read::mechanism::Mechanism;
use std::fmt::Write;

pub(crate) fn shown_pose(config: &Mechanism, pose: &[f64; 6]) -> String {
    let moved = |letter: &&Letter| !config.machine.layout().is_held(**letter);
    let word =
        |letter: &Letter| format!("{}{:.2}", config.place.letter(*letter), pose[letter.index()]);
    Letter::ALL.iter().filter(moved).map(word).collect::<Vec<_>>().join(" ")
}

/// Returns tilts and widths of their boxes as a table; empty if there are none.
pub fn tilt_table(config: &Mechanism, tilts: &[(f64, Option<AxisBox>)]) -> String {
    let letters: Vec<Letter> = [Letter::X, Letter::Y, Letter::Z]
        .into_iter()
        .filter(|letter| !config.machine.layout().is_held(*letter))
        .collect();
    let mut text = String::new();
    for (tilt, part) in tilts {
        let part = part.map(|part| part.rounded());
        let range = |letter: &Letter| match part {
            Some(AxisBox { low, high }) => {
                let k = letter.index();
                format!("  {} {} to {}", config.place.letter(*letter), low[k], high[k])
            }
            None => String::new(),
        };
        let ranges: String = letters.iter().map(range).collect();
        let ranges = if ranges.is_empty() { "  none proved about home" } else { &ranges };
        // Rounded down: a proof for a larger tilt covers a smaller one.
        let _ = writeln!(text, "  {:>6.2}°{ranges}", (tilt * 100.0).floor() / 100.0);
    }
    text
}

/// Returns the limits of the coordinates that the machine moves as lines of an INI file.
pub fn axis_lines(config: &Mechanism, limits: &AxisBox) -> String {
    let mut text = String::new();
    for letter in Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l)) {
        let (low, high) = (limits.low[letter.index()], limits.high[letter.index()]);
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "[AXIS_{}]\nMIN_LIMIT = {low}\nMAX_LIMIT = {high}",
            config.place.letter(letter)
        );
    }
    text
}
