// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm filter`.

use super::failure::{Failure, refused, tell_error};
use super::preflight::misfits;
use super::{MachineFile, Verdict};
use pkm::files::Locate;
use std::io::Write;
use std::path::PathBuf;

/// What LinuxCNC calls the file of the machine that runs.
const INI: &str = "INI_FILE_NAME";

/// Lets a program through into a user interface of LinuxCNC where it fits the machine
///
/// For AXIS and the others, which run a filter on every file that they open. In the INI file:
///
///     [FILTER]
///     PROGRAM_EXTENSION = .ngc,.nc G code that fits the machine
///     ngc = pkm filter
///     nc = pkm filter
///
/// A program that fits comes out as it is. Of any other one the user interface shows every
/// limit that it leaves with its first line and the reason, as `pkm preflight` does, and does
/// not load it. How far the check is goes to the bar of the user interface. Where LinuxCNC
/// cannot be run in virtual time the path alone is judged.
///
/// Exit status: 0 where nothing that was judged breaks, 1 where something does, 2 where the program or the
/// machine cannot be read.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    /// The program
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath)]
    program: PathBuf,
    /// The machine's LinuxCNC INI file, instead of the one that LinuxCNC runs
    #[arg(long, value_name = "MACHINE.ini", value_hint = clap::ValueHint::FilePath)]
    machine: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let given = arguments.machine.clone().or_else(|| std::env::var_os(INI).map(Into::into));
    let Some(machine) = given else {
        return Err(refused(format!(
            "which machine? LinuxCNC names its INI file in {INI}; elsewhere --machine does"
        )));
    };
    let program = &arguments.program;
    let text = std::fs::read(program).at(program)?;
    let found = misfits(&MachineFile { machine, mechanism: None }, program)?;
    if found.is_empty() {
        let mut out = std::io::stdout().lock();
        out.write_all(&text)?;
        out.flush()?;
        return Ok(Verdict::Fits);
    }
    tell_error(&format!("{} does not fit the machine\n", program.display()));
    for told in &found {
        tell_error(told);
    }
    Ok(Verdict::Misfit)
}
