// SPDX-License-Identifier: GPL-2.0-or-later
//! The given values of a machine: every value of its kind's table, checked, with defaults.

use crate::parameters::{ANCHORS, LIMITS, Measure, Need, Parameter, UNIT};
use crate::wrist;
use kinematics::Letter;
use machine::read::ini::decimal;
use std::collections::BTreeMap;

/// Millimeters per inch.
pub const MM_PER_INCH: f64 = 25.4;

/// Largest plausible number, and smallest positive one, in any unit: beyond them a file in decimals, and
/// differences of lengths, lose necessary digits.
pub(super) const MOST: f64 = 1e7;
const LEAST: f64 = 1e-6;

/// Largest angle of either sign, degrees.
const HALF_TURN: f64 = 180.0;

/// Significant digits of a default in inches.
const SHORT: i32 = 3;

/// Why no machine is created.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    #[error("{0}")]
    Input(String),
    #[error("{0}")]
    Misfit(String),
}

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Numbers(Vec<f64>),
    Word(String),
    Limits(Vec<(Letter, [f64; 2])>),
}

/// Values by the names of their parameters, in machine units and degrees.
#[derive(Clone, Debug)]
pub struct Values(BTreeMap<&'static str, Value>);

impl Refusal {
    /// Replaces a path by another one in the refusal.
    #[must_use]
    pub fn renamed(self, from: &str, to: &str) -> Self {
        match self {
            Self::Input(text) => Self::Input(text.replace(from, to)),
            Self::Misfit(text) => Self::Misfit(text.replace(from, to)),
        }
    }
}

impl Values {
    /// Checks the words given for the parameters of a machine; the others get their defaults.
    ///
    /// # Errors
    /// A value is invalid or missing.
    pub fn new(
        machine: &str,
        parameters: &[Parameter],
        given: &BTreeMap<&'static str, Vec<String>>,
    ) -> Result<Self, Refusal> {
        let mut values = Self(BTreeMap::new());
        let per_mm = unit(given)?;
        let by_table = given.contains_key(ANCHORS.name);
        let mut missing = vec![];
        for parameter in parameters {
            let words = given.get(parameter.name);
            if by_table && parameter.need == Need::Anchor {
                if words.is_some() {
                    let text = format!(
                        "--{} has no effect with --anchors, whose table contains it: remove one of them",
                        parameter.name
                    );
                    return Err(Refusal::Input(text));
                }
                continue;
            }
            match words {
                Some(words) => values.set(parameter, words)?,
                None if parameter.need != Need::Optional => missing.push(*parameter),
                None => values.set_default(parameter, per_mm)?,
            }
        }
        if !missing.is_empty() {
            return Err(Refusal::Input(missing_text(machine, &missing)));
        }
        Ok(values)
    }

    fn set(&mut self, parameter: &Parameter, words: &[String]) -> Result<(), Refusal> {
        let value = parsed(parameter, words)?;
        self.0.insert(parameter.name, value);
        Ok(())
    }

    fn set_default(&mut self, parameter: &Parameter, per_mm: f64) -> Result<(), Refusal> {
        match default(parameter, per_mm) {
            words if words.is_empty() => Ok(()),
            words => self.set(parameter, &words),
        }
    }

    fn numbers(&self, name: &str) -> Option<&[f64]> {
        match self.0.get(name) {
            Some(Value::Numbers(numbers)) => Some(numbers),
            _ => None,
        }
    }

    /// Returns the numbers of a parameter, if it has any.
    pub fn list<const N: usize>(&self, parameter: &str) -> Option<[f64; N]> {
        self.numbers(parameter).and_then(|numbers| numbers.try_into().ok())
    }

    /// Returns whether the platform carries a wrist.
    pub fn has_wrist(&self) -> bool {
        self.numbers(wrist::NAME).is_some()
    }

    /// Returns its single number; 0 if there is none.
    pub fn number(&self, name: &str) -> f64 {
        self.numbers(name).map_or(0.0, |numbers| numbers[0])
    }

    /// Returns its word; empty if there is none.
    pub fn word(&self, name: &str) -> &str {
        match self.0.get(name) {
            Some(Value::Word(word)) => word,
            _ => "",
        }
    }

    /// Returns the requested limits.
    pub fn limits(&self) -> &[(Letter, [f64; 2])] {
        match self.0.get(LIMITS.name) {
            Some(Value::Limits(limits)) => limits,
            _ => &[],
        }
    }

    /// Returns the name of the unit of length.
    pub fn unit(&self) -> &str {
        self.word(UNIT.name)
    }

    /// Converts a length in mm to machine units, with few digits.
    pub fn from_mm(&self, mm: f64) -> f64 {
        if self.unit() == "mm" { mm } else { rounded(SHORT, mm / MM_PER_INCH) }
    }
}

/// Returns the machine units per millimeter from the given words.
fn unit(given: &BTreeMap<&'static str, Vec<String>>) -> Result<f64, Refusal> {
    match given.get(UNIT.name) {
        Some(words) => match parsed(&UNIT, words)? {
            Value::Word(word) if word == "inch" => Ok(1.0 / MM_PER_INCH),
            _ => Ok(1.0),
        },
        None => Ok(1.0),
    }
}

fn missing_text(machine: &str, missing: &[Parameter]) -> String {
    let line = |p: &Parameter| {
        let example = match p.default {
            "" => String::new(),
            example => format!(", such as {example}"),
        };
        format!("\n  --{} {}: {}{example}", p.name, p.measure.values().join(" "), p.text)
    };
    let lines: String = missing.iter().map(line).collect();
    format!(
        "{machine}: values are missing; add them (examples in mm), or run without options on a terminal to be asked:{lines}"
    )
}

/// Returns the words of a parameter's default in this unit, none if it has no default.
pub fn default(parameter: &Parameter, per_mm: f64) -> Vec<String> {
    let in_unit = |word: &str| match decimal(word) {
        Some(number) if parameter.measure.is_length() && per_mm != 1.0 => {
            rounded(SHORT, number * per_mm).to_string()
        }
        _ => word.into(),
    };
    parameter.default.split_ascii_whitespace().map(in_unit).collect()
}

/// Rounds to significant digits.
pub(crate) fn rounded(significant: i32, number: f64) -> f64 {
    if number == 0.0 {
        return 0.0;
    }
    let digits = significant - 1 - number.abs().log10().floor() as i32;
    // Divides by powers of ten, because they have no exact inverse.
    match digits {
        0.. => (number * 10_f64.powi(digits)).round() / 10_f64.powi(digits),
        _ => (number / 10_f64.powi(-digits)).round() * 10_f64.powi(-digits),
    }
}

/// Checks the words of a parameter.
///
/// # Errors
/// The expected words.
pub fn check(parameter: &Parameter, words: &[String]) -> Result<(), Refusal> {
    parsed(parameter, words).map(|_| ())
}

fn parsed(parameter: &Parameter, words: &[String]) -> Result<Value, Refusal> {
    let refused = |expected: &str| {
        let text = format!("--{} {}: expected {expected}", parameter.name, words.join(" "));
        Refusal::Input(text)
    };
    match parameter.measure {
        Measure::Choice(_) | Measure::Hands | Measure::Letters | Measure::File => {
            let word = words.join(" ");
            word_fits(parameter.measure, &word).map_err(|expected| refused(&expected))?;
            Ok(Value::Word(word))
        }
        Measure::Limits => limits(words).map(Value::Limits).map_err(|expected| refused(&expected)),
        _ => {
            let numbers: Option<Vec<f64>> = words.iter().map(|word| decimal(word)).collect();
            let count = parameter.measure.values().len();
            let numbers = numbers.filter(|numbers| numbers.len() == count);
            let numbers = numbers.ok_or_else(|| {
                refused(&match count {
                    1 => "a decimal number".into(),
                    _ => format!("{count} decimal numbers"),
                })
            })?;
            numbers_fit(parameter.measure, &numbers).map_err(|expected| refused(&expected))?;
            Ok(Value::Numbers(numbers))
        }
    }
}

/// Parses letters with their limits, three words each.
fn limits(words: &[String]) -> Result<Vec<(Letter, [f64; 2])>, String> {
    let of = |three: &[String]| {
        let [letter, low, high] = three else { return None };
        let letter = Letter::ALL.into_iter().find(|known| *letter == known.name().to_string())?;
        Some((letter, [decimal(low)?, decimal(high)?]))
    };
    let found: Option<Vec<_>> = words.chunks(3).map(of).collect();
    let found = found.ok_or("a letter of XYZABC and two decimal numbers, such as X -60 60")?;
    for (n, (letter, ends)) in found.iter().enumerate() {
        if found[..n].iter().any(|(other, _)| other == letter) {
            return Err(format!("{} once", letter.name()));
        }
        numbers_fit(Measure::Travel, ends)?;
    }
    Ok(found)
}

fn word_fits(measure: Measure, word: &str) -> Result<(), String> {
    let of = |letters: &str| !word.is_empty() && word.chars().all(|c| letters.contains(c));
    match measure {
        Measure::Choice(words) if !words.contains(&word) => Err(words.join(" or ")),
        Measure::Hands if !of("RL") => {
            Err("capital letters R and L, one for all screws or one for each".into())
        }
        Measure::Letters if !of("XYZABC") => Err("capital letters of XYZABC".into()),
        _ => Ok(()),
    }
}

fn numbers_fit(measure: Measure, numbers: &[f64]) -> Result<(), String> {
    if numbers.iter().any(|x| x.abs() > MOST) {
        return Err(format!("at most {MOST} in size"));
    }
    let fits = match measure {
        Measure::Distance => numbers[0] >= 0.0,
        Measure::Travel => numbers[0] < numbers[1],
        Measure::Swing => numbers[0] < numbers[1] && numbers.iter().all(|a| a.abs() < 180.0),
        Measure::Angle(most) => numbers[0] > 0.0 && numbers[0] <= f64::from(most),
        Measure::Place | Measure::Places(_) => true,
        Measure::Turn => numbers[0].abs() <= HALF_TURN,
        _ => numbers[0] >= LEAST,
    };
    if fits {
        return Ok(());
    }
    Err(match measure {
        Measure::Distance => "0 or more".into(),
        Measure::Travel => "the smaller number first".into(),
        Measure::Swing => {
            "more than -180 and less than 180 degrees, the smaller number first".into()
        }
        Measure::Angle(most) => format!("more than 0 and at most {most} degrees"),
        Measure::Turn => format!("-{HALF_TURN} to {HALF_TURN} degrees"),
        _ if numbers[0] > 0.0 => format!("{LEAST} or more"),
        _ => "more than 0".into(),
    })
}
