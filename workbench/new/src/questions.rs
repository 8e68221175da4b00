// SPDX-License-Identifier: GPL-2.0-or-later
//! Asks for every value of a kind, with its unit, default and meaning.

use crate::kinds::{KINDS, MachineKind};
use crate::parameters::{ANCHORS, Need, Parameter, UNIT};
use crate::values::{MM_PER_INCH, check, default};
use std::collections::BTreeMap;
use std::io::{self, BufRead, Write};

/// Words by the names of their parameters.
pub type Given = BTreeMap<&'static str, Vec<String>>;

/// Input and output of a dialog.
pub struct Dialogue<'a> {
    pub answers: &'a mut dyn BufRead,
    pub questions: &'a mut dyn Write,
}

impl Dialogue<'_> {
    /// Asks for the kind.
    ///
    /// # Errors
    /// The answers have ended.
    pub fn kind(&mut self) -> io::Result<&'static MachineKind> {
        for kind in KINDS {
            writeln!(self.questions, "  {:<15} {}", kind.name, kind.text)?;
        }
        loop {
            let answer = self.answer("Kind of machine: ")?;
            match KINDS.iter().find(|kind| kind.name == answer) {
                Some(kind) => return Ok(kind),
                None => writeln!(self.questions, "  expected one of the kinds above")?,
            }
        }
    }

    /// Asks for all values of a kind; those without an answer get their defaults.
    ///
    /// # Errors
    /// The answers have ended.
    pub fn values(&mut self, kind: &MachineKind) -> io::Result<Given> {
        writeln!(
            self.questions,
            "{}: {}. Press Enter for the value in brackets.",
            kind.name, kind.text
        )?;
        let mut given = Given::new();
        for parameter in kind.parameters() {
            if parameter.need == Need::Anchor && given.contains_key(ANCHORS.name) {
                continue;
            }
            let words = self.value(&parameter, &given)?;
            if !words.is_empty() {
                given.insert(parameter.name, words);
            }
        }
        Ok(given)
    }

    fn value(&mut self, parameter: &Parameter, given: &Given) -> io::Result<Vec<String>> {
        let unit = given.get(UNIT.name).map_or("mm", |words| words[0].as_str());
        let per_mm = if unit == "inch" { 1.0 / MM_PER_INCH } else { 1.0 };
        let default = default(parameter, per_mm);
        let (shown, of_unit) = (default.join(" "), parameter.measure.unit(unit));
        let question =
            format!("{}\n  --{} ({of_unit}) [{shown}]: ", parameter.text, parameter.name);
        loop {
            let answer = self.answer(&question)?;
            let words: Vec<String> = match answer.is_empty() {
                true => default.clone(),
                false => answer.split_ascii_whitespace().map(String::from).collect(),
            };
            if words.is_empty() && parameter.need == Need::Optional {
                return Ok(words);
            }
            match check(parameter, &words) {
                Ok(()) => return Ok(words),
                Err(refusal) => writeln!(self.questions, "  {refusal}")?,
            }
        }
    }

    fn answer(&mut self, question: &str) -> io::Result<String> {
        write!(self.questions, "{question}")?;
        self.questions.flush()?;
        let mut line = String::new();
        match self.answers.read_line(&mut line)? {
            0 => Err(io::Error::new(
                io::ErrorKind::UnexpectedEof,
                "input ended before all answers; nothing was created",
            )),
            _ => Ok(line.trim().into()),
        }
    }
}
