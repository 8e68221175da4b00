// SPDX-License-Identifier: GPL-2.0-or-later
//! Subcommands of other packages, as git has them: `pkm design` runs the program `pkm-design` in PATH.

use super::failure::{Failure, refused};
use super::{Verdict, grammar, output};
use std::ffi::OsString;
use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Those of the Python package.
const OF_PYTHON: [&str; 2] = ["design", "compare"];

pub fn run(words: &[OsString]) -> Result<Verdict, Failure> {
    let (name, rest) = words
        .split_first()
        .map_or((String::new(), words), |(name, rest)| (name.to_string_lossy().into_owned(), rest));
    let program = format!("pkm-{name}");
    let mut command = Command::new(&program);
    command.args(rest);
    if output::is_json() {
        command.args(["--format", "json"]);
    }
    if output::is_quiet() {
        command.arg("--quiet");
    }
    // Comes back only where the program did not start.
    let error = command.exec();
    match error.kind() {
        ErrorKind::NotFound => Err(unknown(&name)),
        _ => Err(Failure::at(program, error)),
    }
}

fn unknown(name: &str) -> Failure {
    if OF_PYTHON.contains(&name) {
        return refused(format!(
            "pkm {name} comes with the Python package pkmkins, and there is no program pkm-{name} in PATH: \
             docs/python.md says how to install it"
        ));
    }
    // The grammar says what may have been meant.
    let strict = grammar().allow_external_subcommands(false);
    if let Err(error) = strict.try_get_matches_from(std::env::args_os()) {
        error.exit();
    }
    refused(format!("there is no subcommand {name}"))
}
