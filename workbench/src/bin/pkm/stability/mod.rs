// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stability`.

mod lag;
mod spindle;

use super::Verdict;
use super::failure::Failure;

/// How deep may be cut before it chatters
///
/// `lag` treats masses on springs under a cutting force that lags behind (paper 002), `spindle` a
/// shaft on two bearings. Both need a study file alone.
///
/// Damping and cutting coefficients are your measurements: the limits are about proportional to
/// damping and inverse to the coefficients, and the answer is as good as they are.
#[derive(clap::Args, Debug)]
#[command(subcommand_required = true, arg_required_else_help = true)]
pub struct Arguments {
    #[command(subcommand)]
    question: Question,
}

#[derive(clap::Subcommand, Debug)]
enum Question {
    Lag(lag::Arguments),
    Spindle(spindle::Arguments),
}

/// What every answer ends with.
const WORTH: &str = "Damping and cutting coefficients are those of the study: the limits are about \
                     proportional to damping\nand inverse to the coefficients, and the answer is as \
                     good as they are.";

/// A number above 0 of the command line.
fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("expected a number above 0".into()),
    }
}

/// How results are written to standard output.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    /// Sentences and tables
    Text,
    /// One JSON value
    Json,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    match &arguments.question {
        Question::Lag(arguments) => lag::run(arguments),
        Question::Spindle(arguments) => spindle::run(arguments),
    }
}
