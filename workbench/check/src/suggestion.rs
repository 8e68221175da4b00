// SPDX-License-Identifier: GPL-2.0-or-later
//! Text of proved axis limits, and of the gain by a smaller tilt.

use crate::findings::TiltBox;
use kinematics::{Letter, Limit};
use machine::proof::axis_box::{AxisBox, End};
use machine::proof::reach::Stop;
use machine::read::mechanism::Mechanism;
use std::fmt::Write;

pub(crate) fn shown_pose(config: &Mechanism, pose: &[f64; 6]) -> String {
    let moved = |letter: &&Letter| !config.machine.layout().is_held(**letter);
    let word =
        |letter: &Letter| format!("{}{:.2}", config.place.letter(*letter), pose[letter.index()]);
    Letter::ALL.iter().filter(moved).map(word).collect::<Vec<_>>().join(" ")
}

/// Returns the name of a face of a box, such as `-X`.
pub fn face(config: &Mechanism, end: &End) -> String {
    let sign = if end.is_high { '+' } else { '-' };
    format!("{sign}{}", config.place.letter(Letter::ALL[end.k]))
}

/// Returns the name of the limit at a face of a box; `None` if only the proof ends there.
pub fn limit(end: &End) -> Option<&'static str> {
    Some(match end.stop? {
        Stop::Limit(margin) => margin.limit.name(),
        Stop::Fault(_) => Limit::Reach.name(),
    })
}

/// Returns the limits at the faces of a box, each with its faces.
fn ends(config: &Mechanism, ends: &[End]) -> String {
    let mut named: Vec<(&str, Vec<String>)> = vec![];
    for end in ends {
        let name = limit(end).unwrap_or("the proof alone");
        match named.iter_mut().find(|(known, _)| *known == name) {
            Some((_, faces)) => faces.push(face(config, end)),
            None => named.push((name, vec![face(config, end)])),
        }
    }
    let each = named.iter().map(|(name, faces)| format!("{name} ({})", faces.join(" ")));
    each.collect::<Vec<_>>().join(", ")
}

/// Returns tilts and widths of their boxes, and what ends them, as a table; empty if there are none.
pub fn tilt_table(config: &Mechanism, tilts: &[TiltBox]) -> String {
    let letters: Vec<Letter> = [Letter::X, Letter::Y, Letter::Z]
        .into_iter()
        .filter(|letter| !config.machine.layout().is_held(*letter))
        .collect();
    let mut text = String::new();
    for TiltBox { tilt, limits: part, ends: stops } in tilts {
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
        if !stops.is_empty() {
            let _ = writeln!(text, "           ended by {}", ends(config, stops));
        }
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
