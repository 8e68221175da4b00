// SPDX-License-Identifier: GPL-2.0-or-later
//! `judge INI TRACE.csv RESULT.json OUT_DIR`: checks one recorded run.
//!
//! Prints a table and writes report.html with plots into OUT_DIR. Exit code 0: all
//! figures are within their bounds; 1: at least one is not; 2: the run cannot be judged.

use judge::{page, trace};
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use std::error::Error;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

const USAGE: &str = "usage: judge INI TRACE.csv RESULT.json OUT_DIR";

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    match <[PathBuf; 4]>::try_from(arguments) {
        Err(_) => unjudged(USAGE),
        Ok(arguments) => match run(&arguments) {
            Ok(true) => ExitCode::SUCCESS,
            Ok(false) => ExitCode::from(1),
            Err(error) => unjudged(&error.to_string()),
        },
    }
}

fn unjudged(error: &str) -> ExitCode {
    eprintln!("judge: {error}");
    ExitCode::from(2)
}

/// Returns whether every figure is within its bound.
fn run([ini, trace_file, result_file, folder]: &[PathBuf; 4]) -> Result<bool, Box<dyn Error>> {
    let machine = MachineConfig::leniently(&Ini::read(ini)?, Some(Lenient::Constraints))?;
    let config = machine.first();
    let result = trace::read_result(result_file)?;
    let samples = trace::read_trace(config, trace_file).map_err(|error| match &result.error {
        Some(reason) => format!("{error}; the run itself failed: {reason}"),
        None => error,
    })?;
    let judged = trace::judge(config, &samples, &result)?;
    page::write(folder, config, &samples, &result, &judged)?;
    // If the reader has closed the pipe the verdict is the same.
    let _ = writeln!(std::io::stdout(), "{judged}report: {}", folder.join("report.html").display());
    Ok(judged.kept())
}
