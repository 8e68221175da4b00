// SPDX-License-Identifier: GPL-2.0-or-later
//! Rows of numbers: from the command line, or as CSV from standard input.

use super::Verdict;
use super::failure::{Failure, refused, tell_error};
use kinematics::Fault;
use std::io::Write;

const INPUT: &str = "standard input";

/// What a row came to: numbers, or why there are none.
pub type Answer = Result<Vec<f64>, Fault>;

/// Answers one row of numbers with a line of numbers, or, without any, every row of standard
/// input, whose header has to name all `columns` (others are left alone), with a row of CSV
/// under the header `named`. A row without an answer leaves its cells empty.
pub fn answer(
    given: &[f64],
    columns: &[String],
    named: &[String],
    mut reply: impl FnMut(&[f64]) -> Answer,
) -> Result<Verdict, Failure> {
    if given.is_empty() {
        return stream(columns, named, reply);
    }
    if given.len() != columns.len() {
        let text = format!("expected {} numbers: {}", columns.len(), columns.join(" "));
        return Err(refused(format!("{text}; found {}", given.len())));
    }
    let mut out = anstream::stdout().lock();
    match reply(given) {
        Ok(values) => {
            for (name, value) in named.iter().zip(values) {
                writeln!(out, "{name} = {value}")?;
            }
            Ok(Verdict::Fits)
        }
        Err(fault) => {
            tell_error(&fault);
            Ok(Verdict::Misfit)
        }
    }
}

fn stream(
    columns: &[String],
    named: &[String],
    mut reply: impl FnMut(&[f64]) -> Answer,
) -> Result<Verdict, Failure> {
    let rows = Rows::open(columns)?;
    let mut out = csv::Writer::from_writer(anstream::stdout().lock());
    out.write_record(named)?;
    let mut verdict = Verdict::Fits;
    rows.each(|line, values| {
        let cells = match reply(values) {
            Ok(values) => values.iter().map(f64::to_string).collect(),
            Err(fault) => {
                tell_error(&format!("{INPUT}:{line}: {fault}"));
                verdict = Verdict::Misfit;
                vec![String::new(); named.len()]
            }
        };
        Ok(out.write_record(cells)?)
    })?;
    out.flush()?;
    Ok(verdict)
}

/// Rows of standard input, whose header has named the columns wanted.
pub struct Rows {
    reader: csv::Reader<std::io::StdinLock<'static>>,
    places: Vec<usize>,
}

impl Rows {
    /// Reads the header, which has to name all `columns`; others are left alone.
    pub fn open(columns: &[String]) -> Result<Self, Failure> {
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(std::io::stdin().lock());
        let header = reader.headers().map_err(unread)?;
        let places = places(header, columns)?;
        Ok(Self { reader, places })
    }

    /// Shows every row with its line.
    pub fn each(
        self,
        mut see: impl FnMut(u64, &[f64]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        for record in self.reader.into_records() {
            let record = record.map_err(unread)?;
            let line = record.position().map_or(0, csv::Position::line);
            let values = numbers(&record, &self.places)
                .map_err(|error| Failure::at(format_args!("{INPUT}:{line}"), error))?;
            see(line, &values)?;
        }
        Ok(())
    }
}

fn places(header: &csv::StringRecord, columns: &[String]) -> Result<Vec<usize>, Failure> {
    let place = |name: &String| header.iter().position(|word| word.eq_ignore_ascii_case(name));
    let missing = columns.iter().find(|name| place(name).is_none());
    match missing {
        None => Ok(columns.iter().filter_map(place).collect()),
        Some(name) => Err(refused(format!(
            "{INPUT}:1: the header names no column {name}; expected {}",
            columns.join(",")
        ))),
    }
}

/// A cell that holds none.
#[derive(Debug, thiserror::Error)]
#[error("\"{0}\" is no number")]
struct NoNumber(String);

fn numbers(record: &csv::StringRecord, places: &[usize]) -> Result<Vec<f64>, NoNumber> {
    let number = |place: &usize| {
        let word = record.get(*place).unwrap_or_default();
        word.parse().map_err(|_| NoNumber(word.into()))
    };
    places.iter().map(number).collect()
}

fn unread(error: csv::Error) -> Failure {
    Failure::at(INPUT, error)
}
