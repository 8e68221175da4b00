// SPDX-License-Identifier: GPL-2.0-or-later
//! The command `pkm`: one module and one line of the table for each subcommand.
//!
//! A module has `Arguments`, whose documentation is the help, manual page and completion, and
//! `run`. Results go to standard output, errors in the input to standard error.

mod boxes;
mod calibrate;
mod check;
mod completions;
mod cut;
mod dynamics;
mod examples;
mod export;
mod failure;
mod filter;
mod frames;
mod help;
mod homing;
mod input;
mod joints;
mod man;
mod measure;
mod migrate;
mod new;
mod other;
mod output;
mod panel;
mod path;
mod pose;
mod poses;
mod preflight;
mod random;
mod replay;
mod report;
mod rods;
mod rows;
mod run;
mod scene;
mod sensitivity;
mod stability;
mod stiffness;
mod travel;
mod vibration;
mod view;
mod workspace;

use ::machine::files::{leave_nothing, open, write_whole};
use ::machine::read::columns::in_words;
use ::machine::read::ini::{Ini, decimal};
use ::machine::read::machine::{Lenient, MachineConfig, OneMechanism};
use ::machine::read::mechanism::Mechanism;
use ::machine::rows::redundant_constraint;
use ::program::mechanism_moves;
use ::program::motion::Move;
use ::program::preflight::{JudgeError, has_deletable};
use ::studies::study::file::Study;
use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use failure::Failure;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use kinematics::{Chain, Link, POSE_LETTERS};
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::LazyLock;
use std::time::Duration;

/// Steps of a progress bar.
const STEPS: u64 = 1000;

/// Period of animated progress.
const TICK: Duration = Duration::from_millis(100);

/// Exit status of an interrupted command in a shell.
const INTERRUPTED: i32 = 130;

fn main() -> ExitCode {
    // If the system refuses a handler, an interruption still ends the command.
    let _ = ctrlc::set_handler(|| {
        leave_nothing();
        std::process::exit(INTERRUPTED);
    });
    output::choose_colors(std::env::args_os());
    if let Some(failure) = other::run(std::env::args_os().skip(1)) {
        failure.report();
        return ExitCode::from(2);
    }
    if let Some(shown) = help::run(std::env::args_os().skip(1)) {
        return match Failure::unless_unread(shown) {
            Ok(()) => ExitCode::SUCCESS,
            Err(failure) => {
                failure.report();
                ExitCode::from(2)
            }
        };
    }
    let given = std::env::args_os().map(with_whole_number);
    let matches = grammar()
        .try_get_matches_from(given)
        .unwrap_or_else(|error| with_longer_names(error).exit());
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    cli.settings.choose(words(&matches));
    let code = cli.run();
    // Removes the copy of standard input.
    leave_nothing();
    code
}

/// Rewrites a negative number for the parser of the command line, which reads `-.2` and `-1e-3` as options.
fn with_whole_number(word: OsString) -> OsString {
    let number = word.to_str().filter(|word| word.starts_with('-')).and_then(decimal);
    number.map_or(word, |number| number.to_string().into())
}

/// Returns the grammar of the command line, with examples and with the subcommands in groups.
fn grammar() -> clap::Command {
    let command = examples::documented(Cli::command(), "");
    let template = grouped(&command);
    command.help_template(template)
}

/// Returns the template of the help, which lists the subcommands in their groups.
fn grouped(command: &clap::Command) -> String {
    let (header, literal) = (command.get_styles().get_header(), command.get_styles().get_literal());
    let mut groups = String::new();
    for (group, names) in GROUPS {
        groups += &format!("{header}{group}:{header:#}\n");
        for name in *names {
            let about = command.find_subcommand(name).and_then(clap::Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            groups += &format!("  {literal}{name:<12}{literal:#} {about}\n");
        }
        groups.push('\n');
    }
    format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{groups}{header}Options:{header:#}\n{{options}}\n{{after-help}}"
    )
}

/// Adds to an error about an unknown subcommand those whose names contain the word, as `four-rod-lathe` contains
/// `lathe`, and for `pkm help` where the pages are listed; the parser itself suggests similar spellings.
fn with_longer_names(mut error: clap::Error) -> clap::Error {
    if std::env::args_os().nth(1).is_some_and(|word| word == "help") {
        let lists = help::FOLDERS.map(|folder| format!("pkm help {folder}")).join(", ");
        let tip = format!("the pages of the documentation are listed by: {lists}");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    let word = match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(word))
            if error.get(ContextKind::SuggestedSubcommand).is_none() =>
        {
            word.clone()
        }
        _ => return error,
    };
    let mut command = grammar();
    for name in std::env::args_os().skip(1) {
        match command.find_subcommand(name) {
            Some(below) => command = below.clone(),
            None => break,
        }
    }
    let names = command.get_subcommands().map(|below| below.get_name().to_owned());
    let longer: Vec<String> =
        names.filter(|name| name.split('-').any(|part| part == word)).collect();
    if !longer.is_empty() {
        error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(longer));
    }
    error
}

/// Returns the words of the subcommand, such as `stability pose`.
fn words(matches: &clap::ArgMatches) -> String {
    match matches.subcommand() {
        None => String::new(),
        Some((name, below)) => format!("{name} {}", words(below)).trim_end().into(),
    }
}

/// The verdict of a subcommand, the worst last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Everything fits.
    Fits,
    /// Something does not fit.
    Misfit,
    /// Not everything could be judged.
    Unjudged,
}

impl From<Option<bool>> for Verdict {
    fn from(fits: Option<bool>) -> Self {
        match fits {
            Some(true) => Self::Fits,
            Some(false) => Self::Misfit,
            None => Self::Unjudged,
        }
    }
}

impl Verdict {
    /// Returns the verdict for JSON; `None` if not everything could be judged.
    const fn fits(self) -> Option<bool> {
        match self {
            Self::Fits => Some(true),
            Self::Misfit => Some(false),
            Self::Unjudged => None,
        }
    }
}

/// The table of the subcommands, in the groups of the help.
macro_rules! commands {
    ($($group:literal: { $($variant:ident => $module:ident,)* })*) => {
        #[derive(Debug, Subcommand)]
        enum Command {
            $($($variant($module::Arguments),)*)*
        }

        impl Command {
            fn run(&self) -> Result<Verdict, Failure> {
                match self { $($(Self::$variant(arguments) => $module::run(arguments),)*)* }
            }
        }

        /// Headings of the help, and the subcommands below each.
        const GROUPS: &[(&str, &[&str])] = &[$(($group, &[$(stringify!($module)),*])),*];
    };
}

commands! {
    "Machine": {
        New => new,
        Migrate => migrate,
        Check => check,
        Homing => homing,
        Frames => frames,
        View => view,
        Panel => panel,
        Boxes => boxes,
    }
    "Program": {
        Preflight => preflight,
        Run => run,
        Travel => travel,
        Filter => filter,
        Path => path,
        Replay => replay,
        Random => random,
    }
    "Calibration": {
        Measure => measure,
        Calibrate => calibrate,
    }
    "Studies": {
        Workspace => workspace,
        Sensitivity => sensitivity,
        Stiffness => stiffness,
        Rods => rods,
        Dynamics => dynamics,
        Stability => stability,
        Cut => cut,
    }
    "Files and shell": {
        Joints => joints,
        Pose => pose,
        Scene => scene,
        Export => export,
        Man => man,
        Completions => completions,
    }
}

/// Check parallel-kinematic machines and programs before cutting
///
/// Reads the machine from its LinuxCNC INI file and uses the same kinematics as the LinuxCNC
/// module pkmkins. `pkm design` and `pkm compare`, which help to choose a machine before it is
/// built, come with the Python package pkmkins.
///
/// Exit status: 0 if all is well, 1 if something does not fit, 2 if no verdict was possible:
/// invalid input, or a file that cannot be written.
#[derive(Debug, Parser)]
#[command(name = "pkm", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    settings: output::Settings,
}

/// The machine, for every subcommand that needs one.
#[derive(clap::Args, Clone, Debug)]
struct MachineFile {
    /// The machine's LinuxCNC INI file
    #[arg(
        value_name = "MACHINE.ini",
        value_hint = clap::ValueHint::FilePath,
        value_parser = input::ini_file()
    )]
    machine: PathBuf,
    /// Mechanism to use (1 or 2) on a two-mechanism machine, in its own coordinates X Y Z A B C. By
    /// default check, boxes, run, preflight, travel and workspace use both; other subcommands use
    /// the first
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u8).range(1..=2))]
    mechanism: Option<u8>,
}

impl MachineFile {
    /// Reads the selected mechanism.
    fn read(&self) -> Result<Mechanism, Failure> {
        self.meant(self.read_whole()?)
    }

    /// Reads the selected mechanism, also of a machine with constraints of the platform.
    fn read_constrained(&self) -> Result<Mechanism, Failure> {
        let ini = Ini::read(&self.machine)?;
        self.meant(MachineConfig::leniently(&ini, Some(Lenient::Constraints))?)
    }

    /// Returns the selected mechanism.
    fn meant(&self, config: MachineConfig) -> Result<Mechanism, Failure> {
        if self.mechanism.is_none() && config.mechanisms.len() > 1 {
            failure::report_error(&format!(
                "{} has two mechanisms; using only the first (use --mechanism 2 for the second)",
                self.machine.display()
            ));
        }
        Ok(config.mechanism(self.mechanism.unwrap_or(1))?)
    }

    /// Reads everything that the file describes.
    fn read_whole(&self) -> Result<MachineConfig, Failure> {
        Ok(MachineConfig::read(&self.machine)?)
    }

    /// Reads all mechanisms, even with refused boxes.
    fn read_without_boxes(&self) -> Result<MachineConfig, Failure> {
        Ok(MachineConfig::leniently(&Ini::read(&self.machine)?, Some(Lenient::Boxes))?)
    }

    /// Reads all mechanisms, or the selected one, also of a machine with constraints of the platform.
    fn read_named_constrained(&self) -> Result<MachineConfig, Failure> {
        let ini = Ini::read(&self.machine)?;
        self.named(MachineConfig::leniently(&ini, Some(Lenient::Constraints))?)
    }

    /// Returns all mechanisms, or the selected one.
    fn named(&self, config: MachineConfig) -> Result<MachineConfig, Failure> {
        match self.mechanism {
            None => Ok(config),
            Some(number) => Ok(config.mechanism(number)?.into()),
        }
    }

    /// Returns the mechanism of this number, and the other one, if there are two.
    fn of<'a>(
        &self,
        whole: &'a MachineConfig,
        number: Option<u8>,
    ) -> Result<(&'a Mechanism, Option<&'a Mechanism>), Failure> {
        let number = usize::from(number == Some(2));
        let meant = whole.mechanisms.get(number);
        let meant = meant.ok_or_else(|| OneMechanism(self.machine.clone()))?;
        Ok((meant, whole.mechanisms.get(1 - number)))
    }

    /// Prepares a machine for measurements. Axes that carry something must stay at 0, where the machine is the same without
    /// them.
    fn for_measuring(&self, mut config: Mechanism) -> Result<Mechanism, Failure> {
        if let Some(n) = redundant_constraint(&config)? {
            return Err(failure::refused(format!(
                "{}: not judged: CONSTRAINT_{n} follows from the others, and would contradict them after a calibration; \
                 calibrate a copy without it (number the following ones anew, and reduce constraints=)",
                self.machine.display(),
            )));
        }
        if config.chain.is_empty() {
            return Ok(config);
        }
        let file = self.machine.display();
        if config.chain.holder().is_some() {
            return Err(failure::refused(format!(
                "{file}: not judged: the work is on the platform; measurements are only evaluated for tools on the platform"
            )));
        }
        let letter = |link: &Link| POSE_LETTERS[link.place];
        let letters: Vec<String> =
            config.chain.links().iter().map(|link| letter(link).to_string()).collect();
        output::remark(&format!(
            "{file}: axes {} carry work, tool or legs: keep them at 0 in all measurements",
            letters.join(" ")
        ));
        config.chain = Chain::none(config.extra_axes);
        (config.axes, config.home) = (config.programmed.clone(), config.start);
        Ok(config)
    }
}

/// Writes a text completely or not at all to a file, or to standard output.
fn write_out(text: &str, file: Option<&Path>) -> Result<(), Failure> {
    match file {
        Some(file) => Ok(write_whole(file, text)?),
        None => print_text(text),
    }
}

/// Writes text output to standard output.
fn print_text(text: &str) -> Result<(), Failure> {
    let mut out = output::people();
    out.write_all(text.as_bytes())?;
    out.flush()?;
    Ok(())
}

/// Reads the moves of a program, and refuses one without moves.
fn moves(config: &Mechanism, program: &Path) -> Result<Vec<Move>, Failure> {
    // Reported before LinuxCNC starts, in the system's words.
    open(program)?;
    let whole = MachineConfig::whole_of(config)?;
    let bar = Bar::spinner(READING);
    let (moves, files) = mechanism_moves::moves_of(config, &whole, program)?;
    drop(bar);
    report_deleted(program, &files)?;
    match moves.iter().all(|step| step.stays(config)) {
        true => Err(JudgeError::MovesNothing(program.into()).into()),
        false => Ok(moves),
    }
}

/// Reports on standard error that lines were skipped.
fn report_deleted(program: &Path, files: &[PathBuf]) -> Result<(), Failure> {
    if has_deletable(files)? {
        failure::report_error(&format!(
            "{}: lines that begin with / are skipped, as LinuxCNC does by default; remove the / to include them \
             (pkm preflight judges both)",
            program.display()
        ));
    }
    Ok(())
}

/// All bars: two tasks may run at a time.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Progress of a long task and its remaining time; hidden if standard error is not a
/// terminal, and removed with its owner.
struct Bar(ProgressBar);

impl Bar {
    /// Creates the bar of a task of known length.
    fn new(message: &'static str) -> Self {
        let bar = Self::spinner(message);
        bar.set(0.0);
        bar
    }

    /// Creates the bar of a task of unknown length.
    fn spinner(message: &'static str) -> Self {
        let bar = ProgressBar::new_spinner().with_message(message);
        bar.set_style(style(UNKNOWN));
        if output::is_quiet() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
            return Self(bar);
        }
        let bar = Self(BARS.add(bar));
        bar.0.enable_steady_tick(TICK);
        bar.0.force_draw();
        bar
    }

    /// Shows a message about a task of unknown length.
    fn say(&self, message: String) {
        self.0.set_message(message);
    }

    /// Begins the next task, with a new estimate of the time.
    fn next(&self, message: String) {
        self.0.set_style(style(UNKNOWN));
        self.0.unset_length();
        self.0.reset();
        self.0.set_message(message);
        self.0.force_draw();
    }

    /// Sets the completed share.
    fn set(&self, share: f64) {
        if self.0.length().is_none() {
            self.0.set_length(STEPS);
            self.0.set_style(style(KNOWN));
        }
        self.0.set_position((share * STEPS as f64) as u64);
    }

    /// Sets the completed share, if known.
    fn show(&self, share: Option<f64>) {
        match share {
            Some(share) => self.set(share),
            None => self.forget_share(),
        }
    }

    /// Changes to a task of unknown remaining length.
    fn forget_share(&self) {
        if self.0.length().is_some() {
            self.0.set_style(style(UNKNOWN));
            self.0.unset_length();
        }
    }
}

/// Message while LinuxCNC reads a program without servo cycles.
const READING: &str = "reading the program";

/// Templates of bars with and without a length.
const KNOWN: &str = "{msg} {bar:40} {percent} %, {eta} left";
const UNKNOWN: &str = "{spinner} {msg}, {elapsed} so far";

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// What LinuxCNC does not know of the machine.
#[derive(clap::Args, Clone, Debug)]
struct StudyFile {
    /// Read stiffnesses, errors, diameters and limits from this TOML file
    #[arg(long = "study", value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    study: Option<PathBuf>,
}

impl StudyFile {
    /// Reads the file, or returns a study in which every value is missing.
    fn read(&self) -> Result<Study, Failure> {
        Ok(self.study.as_deref().map_or(Ok(Study::default()), Study::read)?)
    }
}

impl Cli {
    /// Runs the subcommand and reports an error on standard error.
    fn run(&self) -> ExitCode {
        let verdict = match self.command.run() {
            Ok(verdict) => verdict,
            Err(failure) if failure.is_unread() => return ExitCode::SUCCESS,
            Err(failure) => {
                failure.report();
                Verdict::Unjudged
            }
        };
        // A closed reader does not change the verdict.
        if let Err(failure) = Failure::unless_unread(output::finish(verdict)) {
            failure.report();
            return ExitCode::from(2);
        }
        match verdict {
            Verdict::Fits => ExitCode::SUCCESS,
            Verdict::Misfit => ExitCode::from(1),
            Verdict::Unjudged => ExitCode::from(2),
        }
    }
}
