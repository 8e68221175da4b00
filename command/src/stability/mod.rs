// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stability`.

mod lag;
mod map;
mod pose;
pub mod program;
mod spindle;

use super::Verdict;
use super::failure::Failure;
use machine::files::Locate;
use machine::read::mechanism::Mechanism;
use std::path::Path;
use studies::stability::pose::Setup;
use studies::study::file::Study;

/// Compute the depth of cut at which chatter starts
///
/// `pose` judges a machine at a pose, `map` over a plane, `program` along a program. `lag`
/// analyzes a spring-mass model under a lagging cutting force (paper 002), `spindle` a shaft on
/// two bearings; both need only a study file.
///
/// Damping and cutting coefficients are your measurements: limits are roughly proportional to
/// damping and inverse to the coefficients, so the results are no more accurate than these.
#[derive(clap::Args, Debug)]
#[command(subcommand_required = true, arg_required_else_help = true)]
pub struct Arguments {
    #[command(subcommand)]
    question: Question,
}

#[derive(clap::Subcommand, Debug)]
enum Question {
    Pose(pose::Arguments),
    Map(map::Arguments),
    Program(program::Arguments),
    Lag(lag::Arguments),
    Spindle(spindle::Arguments),
}

/// Spindle speeds and depths to examine.
#[derive(clap::Args, Clone, Debug)]
struct Speeds {
    /// Lowest and highest spindle speed, 1/min
    #[arg(long, num_args = 2, value_names = ["LOW", "HIGH"], default_values = ["3000", "18000"], value_parser = positive)]
    speeds: Vec<f64>,
    /// Largest depth to examine, mm
    #[arg(long, value_name = "MM", value_parser = depth)]
    deepest: Option<f64>,
}

/// Returns the machine with the values of its study.
fn setup<'a>(config: &'a Mechanism, study: &Study, file: &Path) -> Result<Setup<'a>, Failure> {
    Ok(Setup::new(config, study).at(file)?)
}

/// Upper bound of lengths, speeds and stiffnesses on the command line.
const LARGEST: f64 = 1e9;

/// Parses a positive number of the command line.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && value < LARGEST => Ok(value),
        _ => Err("expected a number above 0, and below 1e9".into()),
    }
}

/// Largest plausible depth of cut, mm.
const DEEPEST: f64 = 1000.0;

/// Parses a depth on the command line, mm.
pub fn depth(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && value <= DEEPEST => Ok(value),
        _ => Err(format!("expected a depth above 0, and at most {DEEPEST} mm")),
    }
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    match &arguments.question {
        Question::Pose(arguments) => pose::run(arguments),
        Question::Map(arguments) => map::run(arguments),
        Question::Program(arguments) => program::run(arguments),
        Question::Lag(arguments) => lag::run(arguments),
        Question::Spindle(arguments) => spindle::run(arguments),
    }
}
