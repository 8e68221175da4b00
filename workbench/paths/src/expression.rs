// SPDX-License-Identifier: GPL-2.0-or-later
//! Expressions of a path file: parsed once, evaluated with their derivatives.
//!
//! Numbers, names, `+ - * / ^`, parentheses and functions in mathematical notation: `-t^2` is
//! −(t²) and `2^3^2` is 2^9. Angles of functions are in radians.

use crate::grammar::{self, Binary, FUNCTIONS, Tree, Unary};
use machine::proof::interval::Interval;
use machine::proof::jet::Taylor;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Largest number of variables of an expression.
const SLOTS: usize = 6;

/// Why an expression cannot be parsed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExpressionError {
    /// A syntax error: its position, from 1, and what was expected.
    #[error("\"{text}\", character {at}: {expected}")]
    Malformed {
        text: String,
        /// Number of the character, from 1.
        at: usize,
        expected: String,
    },
    #[error("\"{text}\": unknown name {name}; known names are {known}")]
    Unknown { text: String, name: String, known: String },
}

/// Why an expression has no value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Trouble {
    #[error("\"{0}\" divides by 0")]
    Division(String),
    #[error("\"{text}\" has no real value: {function} of {argument}")]
    Complex { text: String, function: &'static str, argument: f64 },
    #[error(
        "the path is unbounded there: a pole, a divisor of 0 or a jump of an angle; change the range of t"
    )]
    Pole,
    #[error("\"{0}\" overflows")]
    Overflow(String),
}

/// A parsed expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    text: String,
    tree: Tree,
}

impl Expression {
    /// Parses an expression of these variables, in the order in which values are given, and of
    /// named numbers.
    ///
    /// # Errors
    /// See [`ExpressionError`].
    pub fn parse(
        text: &str,
        variables: &[&str],
        numbers: &BTreeMap<String, f64>,
    ) -> Result<Self, ExpressionError> {
        let malformed = |at: usize, expected: String| ExpressionError::Malformed {
            text: text.into(),
            at: text[..at].chars().count() + 1,
            expected,
        };
        let mut tree = grammar::parse(text).map_err(|(at, expected)| malformed(at, expected))?;
        resolve(&mut tree, variables, numbers).map_err(|name| ExpressionError::Unknown {
            text: text.into(),
            name,
            known: known(variables, numbers),
        })?;
        Ok(Self { text: text.into(), tree })
    }

    pub fn constant(value: f64) -> Self {
        Self { text: value.to_string(), tree: Tree::Number(value) }
    }

    /// Returns its value and derivatives at values of the variables.
    ///
    /// # Errors
    /// See [`Trouble`]. Over a range only a fault in the whole range is an error; a possible fault
    /// somewhere in it makes the result unbounded.
    pub fn at(&self, variables: &[Taylor]) -> Result<Taylor, Trouble> {
        let found = self.of(&self.tree, variables)?;
        // With numbers as variables the result must be a number.
        let is_number = variables.iter().all(|variable| variable.value.is_thin());
        match is_number && !found.value.middle().is_finite() {
            true => Err(Trouble::Overflow(self.text.clone())),
            false => Ok(found),
        }
    }

    /// Returns whether any variable occurs in it.
    pub(super) fn is_variable(&self) -> bool {
        (0..SLOTS).any(|slot| self.uses(slot))
    }

    /// Returns whether a variable occurs in it.
    pub(super) fn uses(&self, slot: usize) -> bool {
        fn uses(tree: &Tree, slot: usize) -> bool {
            match tree {
                Tree::Slot(own) => *own == slot,
                Tree::Unary(_, of) => uses(of, slot),
                Tree::Binary(_, a, b) => uses(a, slot) || uses(b, slot),
                Tree::Number(_) | Tree::Name(_) => false,
            }
        }
        uses(&self.tree, slot)
    }

    fn of(&self, tree: &Tree, variables: &[Taylor]) -> Result<Taylor, Trouble> {
        Ok(match tree {
            Tree::Number(value) => Taylor::constant(*value),
            Tree::Slot(slot) => variables[*slot],
            // Unreachable: `resolve` has replaced all names.
            Tree::Name(_) => Taylor::constant(f64::NAN),
            Tree::Unary(function, of) => self.unary(*function, self.of(of, variables)?)?,
            Tree::Binary(operator, a, b) => {
                self.binary(*operator, self.of(a, variables)?, self.of(b, variables)?)?
            }
        })
    }

    fn unary(&self, function: Unary, of: Taylor) -> Result<Taylor, Trouble> {
        let inside = |name, range: Interval| match meets(of.value, range) {
            true => Ok(()),
            false => Err(self.complex(name, of.value.middle())),
        };
        Ok(match function {
            Unary::Negative => -of,
            Unary::Sin => of.sin(),
            Unary::Cos => of.cos(),
            Unary::Tan => of.sin() / of.cos(),
            Unary::Atan => of.atan(),
            Unary::Sinh => of.sinh(),
            Unary::Cosh => of.cosh(),
            Unary::Tanh => of.tanh(),
            Unary::Asinh => of.asinh(),
            Unary::Exp => of.exp(),
            Unary::Asin => {
                inside("asin", Interval::new(-1.0, 1.0))?;
                of.asin()
            }
            Unary::Acos => {
                inside("acos", Interval::new(-1.0, 1.0))?;
                of.acos()
            }
            Unary::Sqrt => {
                inside("sqrt", Interval::new(0.0, f64::INFINITY))?;
                of.sqrt()
            }
            Unary::Ln => {
                inside("ln", Interval::new(f64::MIN_POSITIVE, f64::INFINITY))?;
                of.ln()
            }
        })
    }

    fn binary(&self, operator: Binary, a: Taylor, b: Taylor) -> Result<Taylor, Trouble> {
        Ok(match operator {
            Binary::Plus => a + b,
            Binary::Minus => a - b,
            Binary::Times => a * b,
            Binary::Over if is_zero(&b) => return Err(Trouble::Division(self.text.clone())),
            Binary::Over => a / b,
            Binary::Angle => Taylor::angle(&a, &b),
            Binary::Power => return self.power(a, b),
        })
    }

    fn power(&self, base: Taylor, exponent: Taylor) -> Result<Taylor, Trouble> {
        let integer = exponent.as_constant().filter(|n| n.fract() == 0.0 && n.abs() < 1e3);
        match (integer, exponent.as_constant()) {
            (Some(n), _) if n < 0.0 && is_zero(&base) => Err(Trouble::Division(self.text.clone())),
            (Some(n), _) => Ok(base.powi(n as i32)),
            (None, _) if base.value.high < 0.0 => Err(self.complex("a power", base.value.middle())),
            (None, Some(n)) => Ok(base.powf(n)),
            (None, None) => Ok((base.ln() * exponent).exp()),
        }
    }

    fn complex(&self, function: &'static str, argument: f64) -> Trouble {
        Trouble::Complex { text: self.text.clone(), function, argument }
    }
}

/// Returns whether it is 0 up to rounding, as 1 + cos(pi) is.
fn is_zero(of: &Taylor) -> bool {
    // Some roundings of numbers near 1; a curve has no range as narrow.
    const ROUNDING: f64 = 1e-14;
    of.value.contains(0.0) && of.value.magnitude() <= ROUNDING
}

fn meets(a: Interval, b: Interval) -> bool {
    // NaN meets every range: the operation that produced it reports it.
    !(a.high < b.low || a.low > b.high)
}

/// Lists the names of the variables, numbers and functions.
fn known(variables: &[&str], numbers: &BTreeMap<String, f64>) -> String {
    let names = variables.iter().copied().chain(numbers.keys().map(String::as_str)).chain(["pi"]);
    let names = names.chain(FUNCTIONS.iter().map(|(name, _)| *name)).chain(["atan2"]);
    names.collect::<Vec<_>>().join(", ")
}

fn resolve(
    tree: &mut Tree,
    variables: &[&str],
    numbers: &BTreeMap<String, f64>,
) -> Result<(), String> {
    match tree {
        Tree::Name(name) => {
            *tree = if let Some(slot) = variables.iter().position(|own| own == name) {
                Tree::Slot(slot)
            } else if let Some(value) = numbers.get(name.as_str()) {
                Tree::Number(*value)
            } else if name == "pi" {
                Tree::Number(PI)
            } else {
                return Err(name.clone());
            };
            Ok(())
        }
        Tree::Unary(_, of) => resolve(of, variables, numbers),
        Tree::Binary(_, a, b) => {
            resolve(a, variables, numbers)?;
            resolve(b, variables, numbers)
        }
        Tree::Number(_) | Tree::Slot(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers() -> BTreeMap<String, f64> {
        BTreeMap::from([("R_1".into(), 3.0)])
    }

    fn value(text: &str) -> f64 {
        let expression = Expression::parse(text, &["t", "s"], &numbers()).unwrap();
        let at = |x| Taylor::constant(x);
        expression.at(&[at(2.0), at(5.0)]).unwrap().value.middle()
    }

    #[test]
    fn expressions_mean_what_mathematics_means() {
        for (text, expected) in [
            ("-t^2", -4.0),
            ("2^3^t", 512.0),
            ("2^-1", 0.5),
            ("6/2/3", 1.0),
            ("1 - 2 - 3", -4.0),
            ("-t*s + R_1", -7.0),
            (" ( t + s ) * 2e-1 ", 1.4),
            ("--t", 2.0),
            ("atan2(t, -t)", 0.75 * PI),
            ("sqrt(t^2) + cos(pi)", 1.0),
            ("t^0.5*t^0.5", 2.0000000000000004),
            ("t^s", 32.00000000000001),
            ("(-t)^3", -8.0),
            ("tan(1)/tan(1) * ln(exp(3))", 3.0),
        ] {
            assert!((value(text) - expected).abs() < 1e-13, "{text}: {}", value(text));
        }
    }

    #[test]
    fn a_syntax_error_is_reported_with_its_place() {
        for (text, expected) in [
            ("2*", "character 3: expected a number, a name or ("),
            ("2 t", "character 3: expected an operator"),
            ("(2 + t", "character 7"),
            ("sin + 1", "a known function with its arguments"),
            ("sin(1, 2)", "a known function with its arguments"),
            ("foo(1)", "a known function with its arguments"),
            ("q + t", "unknown name q; known names are t, s, R_1, pi, sin"),
            ("", "character 1: expected a number"),
            ("é", "character 1"),
        ] {
            let message = Expression::parse(text, &["t", "s"], &numbers()).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
        }
        for long in ["(".repeat(100), "-".repeat(2000)] {
            assert!(Expression::parse(&long, &[], &numbers()).is_err());
        }
    }

    #[test]
    fn a_missing_value_is_reported_with_its_cause() {
        for (text, expected) in [
            ("1/(t - 2)", "divides by 0"),
            ("sqrt(t - 5)", "sqrt of -3"),
            ("(t - 5)^0.5", "a power of -3"),
            ("asin(t)", "asin of 2"),
            ("ln(t - 2)", "ln of 0"),
            ("(t-2)^-1", "divides by 0"),
            ("exp(1e9)", "overflows"),
            ("sqrt(exp(1e9) - exp(1e9))", "overflows"),
            ("(exp(1e9) - exp(1e9))^t^0.5", "overflows"),
        ] {
            let expression = Expression::parse(text, &["t"], &numbers()).unwrap();
            let message = expression.at(&[Taylor::constant(2.0)]).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }
}
