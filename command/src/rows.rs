// SPDX-License-Identifier: GPL-2.0-or-later
//! Rows of numbers: from the command line, or as CSV from a file or standard input.

use super::Verdict;
use super::failure::{Failure, refused, report_error};
use super::input::RowFile;
use super::output::{self, Table};
use kinematics::Fault;
use machine::files::open;
use serde_json::json;
use std::io::{Read, Write};
use std::path::Path;

const INPUT: &str = "standard input";

/// Result of a row: numbers, or a fault.
pub type Answer = Result<Vec<f64>, Fault>;

/// The input: one row, or those of a file.
pub enum Question<'a> {
    Row(Vec<f64>),
    /// Rows, and the option that gives one row instead.
    Rows(&'a RowFile, &'static str),
}

/// Writes a line of numbers for one row, or for every row of a file, whose header must
/// name all `columns` (others are ignored), a row of CSV under the header `named`. The cells of a row
/// without a result stay empty.
pub fn answer(
    machine: &Path,
    question: &Question,
    columns: &[String],
    named: &[String],
    mut reply: impl FnMut(&[f64]) -> Answer,
) -> Result<Verdict, Failure> {
    let given = match question {
        Question::Row(given) => given,
        Question::Rows(file, instead) => {
            return stream(machine, Rows::open(file, columns, instead)?, named, reply);
        }
    };
    match reply(given) {
        Ok(values) => {
            let mut out = output::people();
            for (name, value) in named.iter().zip(&values) {
                writeln!(out, "{name} = {value}")?;
            }
            output::answer(&json!({ "machine": machine, "columns": named, "rows": [values] }))?;
            Ok(Verdict::Fits)
        }
        Err(fault) => {
            report_error(&fault);
            Ok(Verdict::Misfit)
        }
    }
}

fn stream(
    machine: &Path,
    rows: Rows,
    named: &[String],
    mut reply: impl FnMut(&[f64]) -> Answer,
) -> Result<Verdict, Failure> {
    let name = rows.name.clone();
    let mut table = Table::new(named.to_vec())?;
    let mut verdict = Verdict::Fits;
    rows.each(|line, values| {
        let cells = match reply(values) {
            Ok(values) => values.into_iter().map(Some).collect(),
            Err(fault) => {
                report_error(&format!("{name}:{line}: {fault}"));
                verdict = Verdict::Misfit;
                vec![None; named.len()]
            }
        };
        table.row(cells)
    })?;
    table.finish(machine)?;
    Ok(verdict)
}

/// Rows of a file or of standard input, whose header has named the required columns.
pub struct Rows {
    reader: csv::Reader<Box<dyn Read>>,
    places: Vec<usize>,
    /// Name of the file.
    name: String,
}

impl Rows {
    /// Reads the header, which must name all `columns`; others are ignored. `instead` is the alternative
    /// that an error suggests if nothing was given.
    pub fn open(file: &RowFile, columns: &[String], instead: &str) -> Result<Self, Failure> {
        let names = columns.join(",");
        if file.is_forgotten() {
            let text = "no input, and standard input is a terminal";
            return Err(refused(format!(
                "{text}: give {instead}, or CSV rows with the header {names}"
            )));
        }
        let (name, input): (String, Box<dyn Read>) = match file.file() {
            None => (INPUT.into(), Box::new(std::io::stdin().lock())),
            Some(file) => (file.display().to_string(), Box::new(open(file)?)),
        };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(input);
        let header = reader.headers().map_err(|error| unread(&name, error))?;
        let place = |name: &String| header.iter().position(|word| word.eq_ignore_ascii_case(name));
        if let Some(missing) = columns.iter().find(|name| place(name).is_none()) {
            let text = format!("{name}:1: the header has no column {missing}");
            return Err(refused(format!("{text}; expected {names}")));
        }
        let places = columns.iter().filter_map(place).collect();
        Ok(Self { reader, places, name })
    }

    /// Passes every row with its line to a function.
    pub fn each(
        self,
        mut see: impl FnMut(u64, &[f64]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let name = &self.name;
        for record in self.reader.into_records() {
            let record = record.map_err(|error| unread(name, error))?;
            let line = record.position().map_or(0, csv::Position::line);
            let values = numbers(&record, &self.places)
                .map_err(|error| Failure::at(format_args!("{name}:{line}"), error))?;
            see(line, &values)?;
        }
        Ok(())
    }
}

/// A cell that is not a number.
#[derive(Debug, thiserror::Error)]
#[error("\"{0}\" is not a number; expected one such as 12.5")]
struct NoNumber(String);

fn numbers(record: &csv::StringRecord, places: &[usize]) -> Result<Vec<f64>, NoNumber> {
    let number = |place: &usize| {
        let word = record.get(*place).unwrap_or_default();
        word.parse().map_err(|_| NoNumber(word.into()))
    };
    places.iter().map(number).collect()
}

/// Returns the error of a row of another length, or of bytes that are not text, with its line.
fn unread(name: &str, error: csv::Error) -> Failure {
    let line = error.position().map(csv::Position::line);
    let place = line.map_or(name.to_string(), |line| format!("{name}:{line}"));
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            refused(format!("{place}: {len} cells; expected {expected_len}, as in the header"))
        }
        csv::ErrorKind::Utf8 { .. } => refused(format!("{place}: not text; expected CSV in UTF-8")),
        _ => Failure::at(place, error),
    }
}
