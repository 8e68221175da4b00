// SPDX-License-Identifier: GPL-2.0-or-later
//! Positions of limit violations, as marks in the plots of a page.

use crate::plot::DrawError;
use crate::sheet::Area;
use crate::style::{SMALL, mark_letters, width_of};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

/// Most violations named in one label.
const MOST_NAMED: usize = 3;

/// Most labels above each other, and their distance in pixels.
const LEVELS: usize = 3;
const LEVEL: i32 = 18;

/// Height of the labels of marks, pixels.
pub(super) const LABELS: u32 = LEVELS as u32 * LEVEL as u32 + 6;

/// A limit violation and its position.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Line number, after the name of its file unless it is the program.
    pub place: String,
    /// Text of the line.
    pub block: String,
    /// The violation, in a sentence.
    pub text: String,
    /// Position on the common axis; `None` if the program does not reach it.
    pub at: Option<f64>,
    /// X Y Z A B C at the violation, machine units and degrees.
    pub pose: [f64; 6],
}

/// Marks at one position, with their label.
pub(super) struct Flag {
    pub(super) at: f64,
    label: String,
}

/// Groups marks that are nearer to each other than `near`.
pub(super) fn flags(marks: &[Mark], near: f64) -> Vec<Flag> {
    let mut places: Vec<(f64, usize)> =
        marks.iter().enumerate().filter_map(|(k, mark)| Some((mark.at?, k))).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let groups = places.chunk_by(|a, b| b.0 - a.0 < near);
    let flag = |group: &[(f64, usize)]| {
        let numbers: Vec<usize> = group.iter().map(|place| place.1).collect();
        Flag { at: group[0].0, label: label(marks, &numbers) }
    };
    groups.map(flag).collect()
}

/// Returns the numbers of violations as in the table, with their lines.
pub(super) fn label(marks: &[Mark], numbers: &[usize]) -> String {
    let mut numbers = numbers.to_vec();
    numbers.sort_unstable();
    let lines = numbers.chunk_by(|a, b| marks[*a].place == marks[*b].place);
    let words = lines.map(|group| {
        let names: Vec<String> =
            group.iter().take(MOST_NAMED).map(|k| (k + 1).to_string()).collect();
        let more = if group.len() > MOST_NAMED { " …" } else { "" };
        format!("{}{more}: {}", names.join(", "), marks[group[0]].place)
    });
    let words: Vec<String> = words.collect();
    let more = if words.len() > MOST_NAMED { "; …" } else { "" };
    words[..words.len().min(MOST_NAMED)].join("; ") + more
}

/// Writes the labels of marks above their positions, in pixels, up to the right end.
/// Without room only the mark itself remains, because the page lists all of them.
pub(super) fn write_flags(
    area: &Area,
    flags: &[(i32, &Flag)],
    bottom: i32,
    end: i32,
) -> Result<(), DrawError> {
    let mut free = [i32::MIN; LEVELS];
    for (x, flag) in flags {
        let width = width_of(&flag.label, SMALL) as i32 + 8;
        let left = (*x).min(end - width);
        let Some(level) = free.iter().position(|free| *free <= left) else { continue };
        free[level] = left + width;
        let y = bottom - LEVEL * (level as i32 + 1) + LEVEL / 2;
        let style = mark_letters(HPos::Left, VPos::Center);
        area.draw(&Text::new(flag.label.clone(), (left, y), style))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(line: u32, at: f64) -> Mark {
        Mark {
            place: format!("line {line}"),
            block: String::new(),
            text: String::new(),
            at: Some(at),
            pose: [0.0; 6],
        }
    }

    #[test]
    fn marks_at_one_place_share_a_label() {
        let marks = [mark(4, 1.0), mark(9, 50.0), mark(4, 1.001), mark(5, 1.002)];
        let flags = flags(&marks, 0.1);
        let labels: Vec<&str> = flags.iter().map(|flag| flag.label.as_str()).collect();
        assert_eq!(labels, ["1, 3: line 4; 4: line 5", "2: line 9"]);
    }
}
