// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm new`.

use super::failure::{self, Failure, report_error};
use super::input::file_of_dash;
use super::{Bar, Verdict, output, print_text};
use clap::{Arg, ArgMatches, Command};
use machine::read::diagnostic::rendered;
use new::kinds::{KINDS, MachineKind};
use new::make::{Made, Order, limit_lines, make};
use new::parameters::{Measure, Need, Parameter};
use new::program::next_steps;
use new::questions::{Dialogue, Given};
use new::table::columns;
use new::values::{Refusal, Values};
use serde_json::json;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};

const ABOUT: &str = "Make a complete LinuxCNC configuration of a machine";

const LONG: &str = "Make a complete LinuxCNC configuration of a machine

Writes a folder with an INI file, a tool table, an operator panel, a first program and a page of next steps. \
HOME of every joint comes from the kinematics, the axis limits are proved, and joint speeds follow from the \
tool speed. The result passes `pkm check`. Without options, on a terminal, pkm asks for every value and shows \
its unit, its meaning and an example. `pkm help reference/pkm` has the details.

Exit status: 0 if the folder was made, 1 if a machine with these values cannot work (with the reason), 2 if a \
value is invalid or the folder exists. Nothing is written unless the status is 0.";

/// Name and folder of a machine, and its given values.
#[derive(Debug)]
pub struct Arguments {
    kind: Option<&'static MachineKind>,
    name: Option<String>,
    out: Option<PathBuf>,
    given: Given,
}

impl clap::Args for Arguments {
    fn augment_args(command: Command) -> Command {
        let command = command.about(ABOUT).long_about(LONG);
        KINDS.iter().fold(command, |command, kind| command.subcommand(of_kind(kind)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl clap::FromArgMatches for Arguments {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut arguments = Self { kind: None, name: None, out: None, given: Given::new() };
        arguments.update_from_arg_matches(matches)?;
        Ok(arguments)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        let Some((name, matches)) = matches.subcommand() else { return Ok(()) };
        self.kind = KINDS.iter().find(|kind| kind.name == name);
        self.name = matches.get_one::<String>("NAME").cloned();
        self.out = matches.get_one::<PathBuf>("out").cloned();
        for parameter in self.kind.map(MachineKind::parameters).unwrap_or_default() {
            if let Some(words) = matches.get_many::<String>(parameter.name) {
                let words = words.cloned();
                let words = match parameter.measure {
                    Measure::File => words.map(file_of_dash).collect(),
                    _ => words.collect(),
                };
                self.given.insert(parameter.name, words);
            }
        }
        Ok(())
    }
}

/// Returns the grammar of a kind, from its table.
fn of_kind(kind: &'static MachineKind) -> Command {
    let name = Arg::new("NAME").help("Name of the machine and of its folder [default: the kind]");
    let out = Arg::new("out")
        .long("out")
        .value_name("FOLDER")
        .value_parser(clap::value_parser!(PathBuf))
        .value_hint(clap::ValueHint::DirPath)
        .help("Folder to create [default: NAME]; also the machine's name if NAME is missing");
    let text = format!(
        "{}\n\nColumns of the table of anchors: {}",
        sentence(kind.text),
        columns(kind.leg).join(",")
    );
    let command =
        Command::new(kind.name).about(sentence(kind.text)).long_about(text).arg(name).arg(out);
    command.args(kind.parameters().iter().map(option))
}

fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
    first + letters.as_str()
}

fn option(parameter: &Parameter) -> Arg {
    let Parameter { name, measure, default, need, text } = *parameter;
    let inches = if default == "0" { "" } else { ", or the same in inches" };
    let unit = match measure.is_length() {
        true => format!(" {}{inches}", measure.unit("mm")),
        false => String::new(),
    };
    let words = match measure {
        Measure::Choice(words) => format!("{}; ", words.join(" or ")),
        _ => String::new(),
    };
    let note = match (need, default) {
        (Need::Optional, "") => String::new(),
        (Need::Optional, default) => format!(" [{words}default: {default}{unit}]"),
        (_, "") => " [required]".into(),
        (_, default) => format!(" [required, for example {default}{unit}]"),
    };
    let hint = match measure {
        Measure::File => clap::ValueHint::FilePath,
        _ => clap::ValueHint::Other,
    };
    let count = measure.values().len();
    let action = match measure {
        Measure::Limits => clap::ArgAction::Append,
        _ => clap::ArgAction::Set,
    };
    Arg::new(name)
        .action(action)
        .long(name)
        .value_names(measure.values())
        .num_args(count)
        .allow_hyphen_values(count > 0 && !matches!(measure, Measure::Choice(_) | Measure::File))
        .value_hint(hint)
        .help(format!("{text}{note}"))
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    match made(arguments) {
        Ok(()) => Ok(Verdict::Fits),
        Err(Stop::Refused(Refusal::Misfit(text))) => {
            report_error(&text);
            Ok(Verdict::Misfit)
        }
        Err(Stop::Refused(refusal)) => Err(refusal.into()),
        Err(Stop::Failed(failure)) => Err(failure),
    }
}

/// Why nothing was created.
enum Stop {
    Refused(Refusal),
    Failed(Failure),
}

impl From<Refusal> for Stop {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

fn made(arguments: &Arguments) -> Result<(), Stop> {
    let (kind, given) = answered(arguments)?;
    let values = Values::new(kind.name, &kind.parameters(), &given)?;
    let last =
        arguments.out.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy());
    let name = match (&arguments.name, last) {
        (Some(name), _) => name.clone(),
        (None, Some(last)) => last.into_owned(),
        (None, None) => kind.name.into(),
    };
    let folder = arguments.out.clone().unwrap_or_else(|| PathBuf::from(&name));
    let order = Order { kind, values: &values, name: &name, folder: &folder };
    let bar = Bar::spinner("creating the machine");
    let made = make(&order, |what, share| match share {
        Some(share) => bar.set(share),
        None => bar.next(what.into()),
    })?;
    drop(bar);
    Failure::unless_unread(print_text(&text(&made, &order)))?;
    let file = folder.join(format!("{name}.ini"));
    output::answer(&json!({
        "folder": folder,
        "machine": file,
        "boxes": made.boxes,
        "limits": made.report.suggestion,
        "wider_limits": made.report.wider(),
        "findings": made.report.findings,
    }))?;
    Ok(())
}

/// Returns kind and values, asked for if none is given and standard input is a terminal.
fn answered(arguments: &Arguments) -> Result<(&'static MachineKind, Given), Stop> {
    let is_asked = !output::is_json() && io::stdin().is_terminal() && io::stderr().is_terminal();
    let (mut answers, mut questions) = (io::stdin().lock(), io::stderr());
    let mut dialogue = Dialogue { answers: &mut answers, questions: &mut questions };
    let kind = match arguments.kind {
        Some(kind) => kind,
        None if is_asked => dialogue.kind().map_err(Failure::from)?,
        None => {
            let names: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
            let text = format!(
                "no kind of machine given: run pkm new KIND with one of {}",
                names.join(", ")
            );
            return Err(failure::refused(text).into());
        }
    };
    let given = match arguments.given.is_empty() && is_asked {
        true => dialogue.values(kind).map_err(Failure::from)?,
        false => arguments.given.clone(),
    };
    Ok((kind, given))
}

fn text(made: &Made, order: &Order) -> String {
    let findings: String = made
        .report
        .findings
        .iter()
        .map(|f| format!("{}\n\n", rendered(f.severity, &f.problem)))
        .collect();
    let notes = format!(
        "Created {}. Proved: without a tool{} the machine reaches every pose within\n\n{}\n{}\n\n",
        order.folder.display(),
        if order.values.has_wrist() { " and with the wrist at 0" } else { "" },
        limit_lines(&made.report.config),
        made.boxes
    );
    let farther = match made.report.wider() {
        Some(_) => {
            "With less tilt the machine reaches farther: pkm check has the ranges, and wider axis limits.\n\n"
        }
        None => "",
    };
    let next = next_steps("  ", order.folder, order.name);
    format!("{notes}{farther}{findings}Next:\n\n{next}")
}
