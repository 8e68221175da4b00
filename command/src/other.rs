// SPDX-License-Identifier: GPL-2.0-or-later
//! Subcommands of other packages, as in git: `pkm design` runs the program `pkm-design` in PATH.

use super::Cli;
use super::failure::{Failure, refused};
use clap::CommandFactory;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Subcommands of the Python package.
const OF_PYTHON: [&str; 2] = ["design", "compare"];

/// Replaces this process by another package's program if the first word names one, with the remaining words. Returns
/// if it names none, for the grammar to report, or with the reason why it did not start.
pub fn run(mut words: impl Iterator<Item = OsString>) -> Option<Failure> {
    let name = words.next()?.into_string().ok()?;
    if name.starts_with('-') || Cli::command().find_subcommand(&name).is_some() {
        return None;
    }
    let program = format!("pkm-{name}");
    let error = Command::new(&program).args(words).exec();
    match error.kind() {
        ErrorKind::NotFound if OF_PYTHON.contains(&name.as_str()) => Some(refused(format!(
            "pkm {name} comes with the Python package pkmkins, and there is no program {program} in PATH: \
             install it, see `pkm help reference/python`"
        ))),
        ErrorKind::NotFound => None,
        _ => Some(Failure::at(program, error)),
    }
}
