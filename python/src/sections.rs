// SPDX-License-Identifier: GPL-2.0-or-later
//! The text of an INI file for a machine without one: legs and letters, with the keys of the file.
//!
//! It is read like any other file, so that keys, ranges and messages are the reader's.

use pyo3::exceptions::{PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use std::fmt::Write;

/// Limits of a joint or axis without given ones: beyond the reach of any machine.
const FAR: f64 = 1e9;

/// The parts of a machine.
pub struct Parts<'py> {
    pub legs: Vec<Bound<'py, PyDict>>,
    pub coordinates: String,
    pub table: String,
    pub home: [f64; 3],
    pub unit: String,
    /// Keys of `[PKM]`.
    pub pkm: Option<Bound<'py, PyDict>>,
}

impl Parts<'_> {
    /// Returns the text.
    ///
    /// # Errors
    /// A leg without a kind, or a value that is neither a word nor numbers.
    pub fn text(&self) -> PyResult<String> {
        let kinds = self.legs.iter().map(kind).collect::<PyResult<Vec<_>>>()?;
        let groups: Vec<String> = kinds
            .chunk_by(|one, next| one == next)
            .map(|group| format!("{}:{}", group[0], group.len()))
            .collect();
        let joints = self.legs.len() + self.table.len();
        let mut letters: Vec<char> = self.coordinates.chars().chain(self.table.chars()).collect();
        letters.sort_by_key(|letter| "XYZABC".find(*letter));
        let [x, y, z] = self.home;
        let table = match self.table.is_empty() {
            true => String::new(),
            false => format!(" table={}", self.table),
        };
        let mut text = format!(
            "[KINS]\nKINEMATICS = pkmkins legs={} coordinates={}{table}\nJOINTS = {joints}\n\
             [TRAJ]\nCOORDINATES = {}\nHOME = {x} {y} {z}\nLINEAR_UNITS = {}\nANGULAR_UNITS = degree\n\
             MAX_LINEAR_VELOCITY = {FAR}\nMAX_LINEAR_ACCELERATION = {FAR}\n\
             [EMCMOT]\nSERVO_PERIOD = 1000000\n[PKM]\n",
            groups.join(","),
            self.coordinates,
            letters.iter().collect::<String>(),
            self.unit,
        );
        if let Some(pkm) = &self.pkm {
            push_keys(&mut text, pkm, &[])?;
        }
        if !text.contains("\nSCREW_LEAD = ") {
            text.push_str("SCREW_LEAD = 0\n");
        }
        for (n, leg) in self.legs.iter().enumerate() {
            let _ = writeln!(text, "[LEG_{n}]");
            push_keys(&mut text, leg, &["kind", "limits"])?;
        }
        for n in 0..joints {
            let limits = self.legs.get(n).map(limits).transpose()?.unwrap_or([-FAR, FAR]);
            let _ = writeln!(text, "[JOINT_{n}]\nTYPE = LINEAR\nHOME = 0");
            push_limits(&mut text, limits);
        }
        for letter in letters {
            let _ = writeln!(text, "[AXIS_{letter}]");
            push_limits(&mut text, [-FAR, FAR]);
        }
        Ok(text)
    }
}

fn push_limits(text: &mut String, [low, high]: [f64; 2]) {
    let _ = writeln!(
        text,
        "MIN_LIMIT = {low}\nMAX_LIMIT = {high}\nMAX_VELOCITY = {FAR}\nMAX_ACCELERATION = {FAR}"
    );
}

fn kind(leg: &Bound<PyDict>) -> PyResult<String> {
    match leg.get_item("kind")? {
        Some(kind) => kind.extract(),
        None => Err(PyKeyError::new_err("a leg needs a kind: strut, slider, crank or ring")),
    }
}

fn limits(leg: &Bound<PyDict>) -> PyResult<[f64; 2]> {
    let Some(limits) = leg.get_item("limits")? else { return Ok([-FAR, FAR]) };
    let [low, high]: [f64; 2] = limits.extract()?;
    match low.is_finite() && high.is_finite() && low < high {
        true => Ok([low, high]),
        false => Err(PyValueError::new_err(format!(
            "limits: {low} and {high}; expected two numbers, the smaller first"
        ))),
    }
}

/// Adds keys in small letters, except those that are not keys of the file.
fn push_keys(text: &mut String, keys: &Bound<PyDict>, others: &[&str]) -> PyResult<()> {
    for (key, value) in keys.iter() {
        let key: String = key.extract()?;
        if !others.contains(&key.as_str()) {
            let _ = writeln!(text, "{} = {}", key.to_uppercase(), words(&key, &value)?);
        }
    }
    Ok(())
}

/// Formats a word, a number or a sequence of numbers as in the file.
fn words(key: &str, value: &Bound<PyAny>) -> PyResult<String> {
    if let Ok(word) = value.cast::<PyString>() {
        return Ok(word.to_str()?.into());
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(number.to_string());
    }
    let numbers: Vec<f64> = value.extract().map_err(|_| {
        PyTypeError::new_err(format!("{key}: {value}; expected a word, a number or numbers"))
    })?;
    Ok(numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" "))
}
