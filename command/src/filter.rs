// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm filter`.

use super::failure::{Failure, refused, report_error};
use super::run::Progress;
use super::{Verdict, output};
use linuxcnc::process::Options;
use machine::files::read;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use program::report::Time;
use program::verdict::judge;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;

/// LinuxCNC's variable with the file of the running machine.
const INI: &str = "INI_FILE_NAME";

/// Pass a program to the LinuxCNC GUI only if it fits
///
/// For AXIS and other GUIs that filter every file they open. Add to the INI file:
///
///     [FILTER]
///     PROGRAM_EXTENSION = .ngc,.nc G code that fits the machine
///     ngc = pkm filter
///     nc = pkm filter
///
/// A program that fits is passed on unchanged. For any other program the GUI shows every violated
/// limit with its first line and the reason, as `pkm preflight` does, and does not load it. A
/// program that LinuxCNC cannot run to its end in virtual time is also held back, with the
/// reason. The GUI's progress bar shows the progress of the check.
///
/// Exit status: 0 if the program fits, 1 if it does not, 2 if it could not be judged.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    /// The program (- for standard input)
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath, value_parser = super::input::Program)]
    program: PathBuf,
    /// The machine's LinuxCNC INI file [default: that of the running LinuxCNC]
    #[arg(long, value_name = "MACHINE.ini", value_hint = clap::ValueHint::FilePath, value_parser = super::input::ini_file())]
    machine: Option<PathBuf>,
    /// No effect: promised by earlier versions, which could accept a program that LinuxCNC had not run
    #[arg(long, hide = true)]
    path_is_enough: bool,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let given = arguments.machine.clone().or_else(|| std::env::var_os(INI).map(Into::into));
    let Some(machine) = given else {
        return Err(refused(format!(
            "no machine given: {INI} is not set outside LinuxCNC; add --machine MACHINE.ini"
        )));
    };
    // The option has no effect: it is accepted for users of earlier versions.
    let _ = arguments.path_is_enough;
    let program = &arguments.program;
    let text = read(program)?;
    let config = MachineConfig::leniently(&Ini::read(&machine)?, Some(Lenient::Constraints))?;
    let mut progress = Progress::of_filter(&config, program)?;
    // A user who opens a program does not wait for the search for another work offset.
    let judged =
        judge(&config, program, &Options::default(), false, &mut |step| progress.show(step))?;
    let reasons = match (judged.fits, &judged.found.time) {
        (Some(true), _) => vec![],
        (None, Time::NotJudged(cause)) => {
            vec![format!("{} is not judged: {cause}", program.display())]
        }
        _ => {
            let head = format!("{} does not fit the machine\n", program.display());
            let breaks = judged.found.breaks.iter().map(|broken| judged.sentence(broken));
            [head].into_iter().chain(breaks).collect()
        }
    };
    let verdict = judged.fits.into();
    output::answer(&json!({ "machine": machine, "program": program, "reasons": reasons }))?;
    for reason in &reasons {
        report_error(reason);
    }
    if verdict == Verdict::Fits {
        let mut out = output::people();
        out.write_all(&text)?;
        out.flush()?;
    }
    Ok(verdict)
}
