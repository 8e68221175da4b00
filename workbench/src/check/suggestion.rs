// SPDX-License-Identifier: GPL-2.0-or-later
//! Axis limits that are proved, and what a smaller tilt gains, as text.

use crate::proof::axis_box::AxisBox;
use crate::read::machine::MachineConfig;
use kinematics::Letter;
use std::fmt::Write;

/// Digits after the point of suggested limits, of a box that is 1 to 10 units wide.
const LIMIT_DIGITS: i32 = 3;

pub(crate) fn shown_pose(config: &MachineConfig, pose: &[f64; 6]) -> String {
    let moved = |letter: &&Letter| !config.machine.layout().is_held(**letter);
    let word =
        |letter: &Letter| format!("{}{:.2}", config.place.letter(*letter), pose[letter.index()]);
    Letter::ALL.iter().filter(moved).map(word).collect::<Vec<_>>().join(" ")
}

impl AxisBox {
    /// The pose at these shares of the extents.
    pub fn at(&self, shares: [f64; 6]) -> [f64; 6] {
        std::array::from_fn(|k| self.low[k] + shares[k] * (self.high[k] - self.low[k]))
    }

    /// Ends with few digits, inside this box.
    pub(crate) fn rounded(&self) -> Self {
        let mut rounded = *self;
        for k in 0..6 {
            let width = self.high[k] - self.low[k];
            if width > 0.0 {
                let grid = 10_f64.powi(LIMIT_DIGITS - width.log10().floor() as i32);
                rounded.low[k] = (self.low[k] * grid).ceil() / grid;
                rounded.high[k] = (self.high[k] * grid).floor() / grid;
            }
        }
        rounded
    }
}

/// Tilts and widths of their boxes, as a table; empty where there are none.
pub fn tilt_table(config: &MachineConfig, tilts: &[(f64, Option<AxisBox>)]) -> String {
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
        // Rounded down: what is proved for more holds for less.
        let _ = writeln!(text, "  {:>6.2}°{ranges}", (tilt * 100.0).floor() / 100.0);
    }
    text
}

/// The limits as lines of an INI file, of the coordinates that the machine moves.
pub fn axis_lines(config: &MachineConfig, limits: &AxisBox) -> String {
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
