// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm random`.

use super::failure::{Failure, refused, report_error};
use super::{Bar, MachineFile, Verdict, output, print_text};
use program::random_program::random_program;
use serde_json::json;

/// Write a program of random moves that the machine can run
///
/// Makes straight moves within joint ranges and cones, at feeds that all joints can follow, with
/// tilts if the machine tilts, and with changes of the tool offset. Use it for soak tests of a
/// machine or its simulation. The program goes to standard output.
///
/// Exit status: 0 if a program was written, 1 if no move is possible, 2 if the file describes no
/// machine.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Seed; the same number gives the same program
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    seed: u64,
    /// Minimum duration of the program
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    seconds: f64,
}

/// Longest program, seconds: a day.
const LONGEST: f64 = 86_400.0;

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let seconds = arguments.seconds;
    if !(seconds > 0.0 && seconds <= LONGEST) {
        let text = format!("--seconds {seconds}: expected more than 0 and at most {LONGEST}");
        return Err(refused(text));
    }
    let config = arguments.machine.read_constrained()?;
    let bar = Bar::spinner("choosing moves");
    let found = random_program(&config, arguments.seed, seconds);
    drop(bar);
    match found {
        Ok(text) => {
            print_text(&text)?;
            output::answer(&json!({ "machine": config.file, "program": text }))?;
            Ok(Verdict::Fits)
        }
        Err(error) => {
            report_error(&format!("{}: {error}", config.file.display()));
            Ok(Verdict::Misfit)
        }
    }
}
