// SPDX-License-Identifier: GPL-2.0-or-later
//! The tool table, `[EMCIO]TOOL_TABLE`: the offsets that a program may activate.

use crate::files::{self, AtFile};
use crate::read::ini::{Excerpt, IniError, Problem};
use crate::read::mechanism::Mechanism;
use kinematics::{Letter, Vector3};
use std::io;
use std::path::PathBuf;

/// A tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// T number.
    pub number: i64,
    /// Offset x y z, machine units.
    pub offset: Vector3<f64>,
    /// Diameter, machine units.
    pub diameter: f64,
    /// Whether the line names a pocket, P.
    pub has_pocket: bool,
    /// A word because of which LinuxCNC drops the whole line, if any.
    pub dropped_by: Option<String>,
    /// Offsets of A, B and C, degrees.
    pub turns: [f64; 3],
    /// Letters of the offset in the table: U V W for a second mechanism.
    letters: [char; 3],
    /// Line in the table, counted from 1.
    pub line: usize,
    /// That line.
    text: String,
}

impl Tool {
    /// Returns number and offset for reports.
    pub fn name(&self) -> String {
        let words = self.letters.iter().zip(self.offset.iter());
        let words: Vec<String> =
            words.filter(|(_, x)| **x != 0.0).map(|(letter, x)| format!(" {letter}{x}")).collect();
        format!("T{}{}", self.number, words.concat())
    }

    /// Returns the refusal of its length along the platform's Z, in the table of this machine.
    pub fn refuse_length(&self, config: &Mechanism, expected: &str) -> IniError {
        self.refuse(config, self.letters[2], self.name(), expected)
    }

    /// Returns the refusal of its line.
    pub fn refuse_line(&self, config: &Mechanism, expected: &str) -> IniError {
        self.refuse(config, '\0', self.text.trim().into(), expected)
    }

    /// Returns the refusal of its diameter.
    pub fn refuse_diameter(&self, config: &Mechanism, expected: &str) -> IniError {
        self.refuse(config, 'D', format!("T{} D{}", self.number, self.diameter), expected)
    }

    /// Returns the refusal of the word of a letter.
    fn refuse(&self, config: &Mechanism, letter: char, found: String, expected: &str) -> IniError {
        let is_it = |word: &&str| word.to_ascii_uppercase().starts_with(letter);
        let words = self.text.split(';').next().unwrap_or_default();
        let part = words.split_whitespace().find(is_it).map_or(0..words.len(), |word| {
            let start = words.find(word).unwrap_or(0);
            start..start + word.len()
        });
        IniError(Box::new(Problem {
            file: config.program.tool_table.clone().unwrap_or_default(),
            line: Some(self.line),
            section: String::new(),
            key: String::new(),
            found: Some(found),
            expected: expected.into(),
            excerpt: Some(Excerpt { text: self.text.clone(), part }),
        }))
    }
}

/// Letters of angular offsets.
const TURNS: [char; 3] = ['A', 'B', 'C'];
const OTHERS: &str = "XYZUVWIJQ";

/// An unreadable tool table, or an invalid line of it.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file cannot be read.
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
    /// An invalid line.
    #[error("{}:{line}: {error}", .file.display())]
    Line {
        /// The table.
        file: PathBuf,
        /// Its line, counted from 1.
        line: usize,
        /// Its error.
        error: BadTool,
    },
}

/// An error in a line of the tool table.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum BadTool {
    /// A malformed word.
    #[error("expected a letter and a number, such as T1 or Z40.5, not {0}")]
    Word(String),
    /// A missing tool number.
    #[error("the tool has no number; add one, such as T1")]
    NoNumber,
}

/// Returns the tools of a machine; none if its file names no table.
///
/// # Errors
/// See [`TableError`].
pub fn read(config: &Mechanism) -> Result<Vec<Tool>, TableError> {
    let Some(file) = &config.program.tool_table else { return Ok(vec![]) };
    let bytes = files::read(file)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut tools = vec![];
    for (n, line) in text.lines().enumerate() {
        let words = line.split(';').next().unwrap_or_default();
        if !words.trim().is_empty() {
            let bad = |error| TableError::Line { file: file.clone(), line: n + 1, error };
            let letters = [Letter::X, Letter::Y, Letter::Z].map(|l| config.place.letter(l));
            let tool = tool(words, letters).map_err(bad)?;
            tools.push(Tool { line: n + 1, text: line.into(), ..tool });
        }
    }
    Ok(tools)
}

/// Parses a line: letters, each followed by its number.
fn tool(words: &str, letters: [char; 3]) -> Result<Tool, BadTool> {
    let offset = Vector3::zeros();
    let mut found = Tool {
        number: 0,
        offset,
        diameter: 0.0,
        has_pocket: false,
        dropped_by: None,
        turns: [0.0; 3],
        letters,
        line: 0,
        text: String::new(),
    };
    let mut has_number = false;
    for word in words.split_whitespace() {
        let refused = || BadTool::Word(word.into());
        let letter = word.chars().next().ok_or_else(refused)?.to_ascii_uppercase();
        let value: f64 = word[letter.len_utf8()..].parse().map_err(|_| refused())?;
        if !value.is_finite() {
            return Err(refused());
        }
        if letter == 'T' {
            (found.number, has_number) = (value as i64, true);
        } else if letter == 'P' {
            found.has_pocket = true;
        } else if letter == 'D' {
            found.diameter = value;
        } else if let Some(k) = letters.iter().position(|own| *own == letter) {
            found.offset[k] = value;
        } else if let Some(k) = TURNS.iter().position(|own| *own == letter) {
            found.turns[k] = value;
        } else if !OTHERS.contains(letter) {
            found.dropped_by = Some(word.into());
        }
        if letter == 'T' && !(0.0..=f64::from(i32::MAX)).contains(&value.abs()) {
            found.dropped_by = Some(word.into());
        }
    }
    if has_number { Ok(found) } else { Err(BadTool::NoNumber) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_stand_in_any_order_and_other_letters_do_not_count() {
        let letters = ['X', 'Y', 'Z'];
        let line = "P3 Z+40.5 t2 D5 x-1.25 I12 W7";
        let found = tool(line, letters).unwrap();
        assert_eq!((found.number, found.offset), (2, Vector3::new(-1.25, 0.0, 40.5)));
        assert_eq!(found.name(), "T2 X-1.25 Z40.5");
        assert_eq!(tool(line, ['U', 'V', 'W']).unwrap().name(), "T2 W7");
    }

    #[test]
    fn what_is_no_tool_is_refused() {
        for (line, expected) in [
            ("T1 Zlong", "not Zlong"),
            ("T1 Znan", "not Znan"),
            ("T1 é", "not é"),
            ("P1 Z3", "no number"),
        ] {
            assert!(
                tool(line, ['X', 'Y', 'Z']).unwrap_err().to_string().contains(expected),
                "{line}"
            );
        }
    }
}
