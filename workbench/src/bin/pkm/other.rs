// SPDX-License-Identifier: GPL-2.0-or-later
//! Subcommands of other packages, as git has them: `pkm design` runs the program `pkm-design` in PATH.

use super::failure::{Failure, refused};
use super::{Cli, Verdict, output};
use clap::CommandFactory;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// How much a word may differ from the one that was meant, by Jaro and Winkler: as clap judges its own.
const ALIKE: f64 = 0.8;

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
        ErrorKind::NotFound => Err(refused(unknown(&name))),
        _ => Err(Failure::at(program, error)),
    }
}

fn unknown(name: &str) -> String {
    if matches!(name, "design" | "compare") {
        return format!(
            "pkm {name} comes with the Python package pkmkins, and there is no program pkm-{name} in PATH: \
             docs/python.md says how to install it"
        );
    }
    let cli = Cli::command();
    let known = cli.get_subcommands().map(|command| (command.get_name(), command));
    let near = known
        .map(|(known, _)| (strsim::jaro_winkler(known, name), known))
        .filter(|(likeness, _)| *likeness > ALIKE)
        .max_by(|one, other| one.0.total_cmp(&other.0));
    let hint =
        near.map_or("pkm --help lists them".into(), |(_, near)| format!("did you mean {near}?"));
    format!("there is no subcommand {name}, and no program pkm-{name} in PATH: {hint}")
}
