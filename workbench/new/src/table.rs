// SPDX-License-Identifier: GPL-2.0-or-later
//! Legs from a table of anchors, a CSV file with one line per leg.

use crate::anchors::Leg;
use crate::values::{MOST as MOST_LENGTH, Refusal};
use keys::{Key, Need, of_leg};
use kinematics::leg::Kind;
use machine::files::read_text;
use machine::read::ini::decimal;
use std::path::Path;

const MOST: usize = kinematics::MAX_LEGS;

/// Returns the keys that a leg of this kind needs: each of their numbers is a column.
fn needed(kind: Kind) -> impl Iterator<Item = &'static Key> {
    of_leg(kind).filter(|key| key.need == Need::Needed)
}

/// Returns the names of the columns: the leg's number, then those of its numbers.
pub fn columns(kind: Kind) -> Vec<String> {
    let of = |key: &Key| -> Vec<String> {
        let name = key.name.to_ascii_lowercase();
        match key.parts {
            [] => vec![name],
            parts => parts.iter().map(|part| format!("{name}_{part}")).collect(),
        }
    };
    std::iter::once("leg".into()).chain(needed(kind).flat_map(of)).collect()
}

/// Reads the legs.
///
/// # Errors
/// The file cannot be read, or a line is not a leg: with its location.
pub fn read(file: &Path, kind: Kind) -> Result<Vec<Leg>, Refusal> {
    let text = read_text(file).map_err(|error| Refusal::Input(error.to_string()))?;
    let at = |line: usize, expected: String| {
        Refusal::Input(format!("{}:{line}: {expected}", file.display()))
    };
    let names = columns(kind);
    // Spreadsheets write a byte order mark before the first line, and quotes.
    let mut lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .enumerate()
        .map(|(n, line)| (n + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let heading = lines.next().unwrap_or((1, ""));
    if !heading.1.contains(',') && heading.1.contains([';', '\t']) {
        let text = "cells are separated by semicolons or tabs: save the table with commas";
        return Err(at(heading.0, text.into()));
    }
    if fields(heading.1) != names {
        return Err(at(heading.0, format!("expected the heading {}", names.join(","))));
    }
    let mut legs = vec![];
    for (n, line) in lines {
        legs.push(leg(&fields(line), &names, kind, legs.len()).map_err(|text| at(n, text))?);
    }
    if legs.is_empty() || legs.len() > MOST {
        let count = text.lines().count();
        return Err(at(
            count,
            format!("expected 1 to {MOST} legs, one per line; found {}", legs.len()),
        ));
    }
    Ok(legs)
}

fn fields(line: &str) -> Vec<&str> {
    line.split(',').map(|cell| cell.trim().trim_matches('"')).collect()
}

fn leg(fields: &[&str], names: &[String], kind: Kind, n: usize) -> Result<Leg, String> {
    if fields.len() != names.len() {
        let (found, wanted) = (fields.len(), names.len());
        return Err(format!("expected {wanted} fields, {}; found {found}", names.join(",")));
    }
    if fields[0] != n.to_string() {
        return Err(format!("expected leg {n} next, found {:?}", fields[0]));
    }
    let mut numbers = vec![];
    for (name, field) in names.iter().zip(fields).skip(1) {
        let number = decimal(field).filter(|number| number.is_finite());
        let number =
            number.ok_or_else(|| format!("{name}: expected a decimal number, found {field:?}"))?;
        if number.abs() > MOST_LENGTH {
            return Err(format!("{name}: expected at most {MOST_LENGTH} in size, found {field}"));
        }
        numbers.push(number);
    }
    let mut leg = Leg::default();
    let (mut rest, mut words) = (numbers.as_slice(), &fields[1..]);
    for key in needed(kind) {
        let (own, other) = rest.split_at(key.count());
        let (named, left) = words.split_at(key.count());
        if let Some((word, _)) = named.iter().zip(own).find(|(word, x)| !key.range.holds(word, **x))
        {
            return Err(format!(
                "{}: expected {}, found {word}",
                key.name.to_ascii_lowercase(),
                key.expected()
            ));
        }
        leg.0.push((key, own.to_vec()));
        (rest, words) = (other, left);
    }
    Ok(leg)
}
