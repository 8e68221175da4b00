// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm run`.

use super::failure::Failure;
use super::{Bar, MachineFile, Verdict, output};
use linuxcnc::process::{self, Options};
use linuxcnc::row::{Ending, Message, MessageKind, Outcome, Row};
use linuxcnc::trace::Trace;
use machine::files::open;
use machine::read::facts::FileFacts;
use machine::read::machine::MachineConfig;
use program::preflight::explained;
use program::progress::Done;
use program::verdict::Step;
use serde::Serialize;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Run a program in LinuxCNC without hardware, faster than the machine
///
/// LinuxCNC's interpreter, planner and motion controller run in virtual time, with pkmkins, with
/// drives that keep the joints' speeds and accelerations, and with a spindle that needs time to
/// start. Standard output gets LinuxCNC's messages to the operator and the duration of the
/// program. --trace writes a row for every servo cycle: time, line, pose, commanded joint values,
/// following errors, tool offset in effect and the feed allowed by the guard, in machine units
/// and degrees.
///
/// The machine's own files are not changed, and a machine that runs on this computer is not
/// affected.
///
/// Exit status: 0 if the program runs to its end, 1 if LinuxCNC stops it, 2 if it could not be
/// run.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// The program (- for standard input)
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath, value_parser = super::input::Program)]
    program: PathBuf,
    /// Write every servo cycle to this file, as CSV
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    trace: Option<PathBuf>,
    /// Copy the files that the program writes, for example with LOGOPEN, into this folder
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    written: Option<PathBuf>,
    #[command(flatten)]
    control: Control,
}

/// How a program is run, as options.
#[derive(clap::Args, Clone, Debug)]
pub struct Control {
    /// Stop after this much machine time
    #[arg(long, value_name = "SECONDS", default_value_t = Options::default().most_seconds)]
    most_time: f64,
    /// Stop if nothing moves for this much machine time
    #[arg(long, value_name = "SECONDS", default_value_t = Options::default().most_standstill)]
    most_standstill: f64,
    /// Also run this HAL file after those of the simulated machine, for a probe or another spindle
    #[arg(long, value_name = "FILE.hal", value_hint = clap::ValueHint::FilePath)]
    hal: Vec<PathBuf>,
    /// Let the program write any file of yours, start programs and use the network; by default the
    /// kernel forbids this, and nothing runs on a kernel that cannot
    #[arg(long)]
    unconfined: bool,
}

impl Control {
    /// Returns the options of a run.
    pub fn options(&self) -> Options {
        Options {
            most_seconds: self.most_time,
            most_standstill: self.most_standstill,
            hal: self.hal.clone(),
            unconfined: self.unconfined,
            ..Options::default()
        }
    }
}

/// The results.
#[derive(Serialize)]
struct Answer<'a> {
    machine: &'a Path,
    program: &'a Path,
    #[serde(flatten)]
    outcome: &'a Outcome,
    trace: Option<&'a Path>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_named_constrained()?;
    open(&arguments.program)?;
    let mut trace = arguments.trace.as_deref().map(|file| Trace::new(&config, file)).transpose()?;
    let mut progress = Progress::new(&config, &arguments.program)?;
    let options = Options { written: arguments.written.clone(), ..arguments.control.options() };
    let outcome = process::run(&config, &arguments.program, &options, |row| {
        progress.see(row);
        trace.as_mut().map_or(ControlFlow::Continue(()), |trace| trace.see(row))
    });
    drop(progress);
    trace.map_or(Ok(()), |trace| trace.finish(outcome.is_ok()))?;
    let outcome = outcome?;
    output::answer(&Answer {
        machine: &config.file,
        program: &arguments.program,
        outcome: &outcome,
        trace: arguments.trace.as_deref(),
    })?;
    report(&config, &arguments.program, &outcome)?;
    Ok(match outcome.ending {
        Ending::Finished => Verdict::Fits,
        Ending::Stopped => Verdict::Misfit,
    })
}

fn report(config: &MachineConfig, program: &Path, outcome: &Outcome) -> Result<(), Failure> {
    let mut out = output::people();
    for message in &outcome.messages {
        let word = match message.kind {
            MessageKind::Error => "error: ",
            MessageKind::Text | MessageKind::Display => "",
        };
        let Message { line, read, seconds, .. } = message;
        let text = explained(config, &message.text);
        let place = match line {
            0 => format!("reading line {read}, before the first move"),
            _ => format!("line {line}, {seconds:.3} s"),
        };
        writeln!(out, "{}: {place}: {word}{text}", program.display())?;
    }
    let ending = match outcome.ending {
        Ending::Finished => "runs to its end in",
        Ending::Stopped => "is stopped by LinuxCNC after",
    };
    writeln!(out, "{}: {ending} {:.3} s", program.display(), outcome.seconds)?;
    Ok(())
}

/// Progress by line and machine time while the program runs.
pub struct Progress {
    bar: Bar,
    period: f64,
    done: Done,
    /// Whether a user interface of LinuxCNC shows the progress.
    is_filter: bool,
}

/// Number of cycles between two progress messages.
const STRIDE: u64 = 1000;

impl Progress {
    /// Creates a progress bar, hidden if standard error is not a terminal.
    pub fn new(config: &FileFacts, program: &Path) -> Result<Self, Failure> {
        let (bar, done) = (Bar::spinner("running"), Done::of(program)?);
        Ok(Self { bar, period: config.period, done, is_filter: false })
    }

    /// Creates the progress of one of LinuxCNC's filters, on standard error.
    pub fn of_filter(config: &FileFacts, program: &Path) -> Result<Self, Failure> {
        Ok(Self { is_filter: true, ..Self::new(config, program)? })
    }

    /// Shows a step of a verdict.
    pub fn show(&mut self, step: Step) {
        match step {
            Step::Row(row) | Step::Trial(row) => self.see(row),
            Step::Search(kind, share) => {
                if share == 0.0 {
                    self.bar.next(kind.into());
                    self.done.restart();
                }
                self.bar.set(share);
            }
        }
    }

    /// Shows a servo cycle.
    pub fn see(&mut self, row: &Row) {
        self.done.see(row.line);
        if row.cycle.is_multiple_of(STRIDE) {
            let seconds = row.cycle as f64 * self.period;
            self.bar.say(format!("running: line {}, {seconds:.0} s of machine time", row.line));
            self.bar.show(self.done.share());
            if self.is_filter {
                eprintln!("FILTER_PROGRESS={}", self.done.percent(row.line));
            }
        }
    }
}
