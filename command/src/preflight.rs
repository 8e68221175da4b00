// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm preflight`.

use super::failure::{Failure, refused, report_error};
use super::run::{Control, Progress};
use super::{Bar, MachineFile, READING, Verdict, output, print_text, report};
use linuxcnc::process::Options;
use linuxcnc::row::Row;
use linuxcnc::trace::Trace;
use machine::files::{Locate, write_whole};
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use program::motion;
use program::report::{Preflight, Time};
use program::timeline::{Course, Thinned};
use program::verdict::{ProgramVerdict, Step, judge};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Check before cutting that a program fits the machine
///
/// LinuxCNC runs the program in virtual time, with the machine's tool table, parameters and
/// startup code, starting at the HOME of the joints. Every commanded move is examined over its
/// whole length: axis limits, reach, joint ranges, cones and singular poses are proved, not
/// sampled. The same limits are judged in every servo cycle; joint speeds, accelerations,
/// following errors, messages and the duration come from LinuxCNC itself.
///
/// For each violated limit, the report has the first line, the position and the number of moves;
/// for each limit kept, the smallest margin. If a program does not fit, pkm searches for a work
/// offset with which it does, shifted and, if the program tilts the platform, also turned about
/// Z; a second run verifies it. Several programs, or a folder of programs, end with a table.
///
/// Exit status: 0 if the program fits (there may be warnings), 1 if it does not, 2 if it could
/// not be judged; for several programs the worst.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Programs (- for standard input), or folders of programs (*.ngc, *.nc)
    #[arg(value_name = "PROGRAM.ngc", required = true, value_hint = clap::ValueHint::AnyPath, value_parser = super::input::Program)]
    programs: Vec<PathBuf>,
    /// Also write a page with plots; for a single program
    #[arg(long, value_name = "FILE.html", value_hint = clap::ValueHint::FilePath)]
    report: Option<PathBuf>,
    /// Also write every servo cycle, as pkm run does; for a single program
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    trace: Option<PathBuf>,
    #[command(flatten)]
    judging: Judging,
}

/// How a program is read and run, as options.
#[derive(clap::Args, Clone, Debug)]
pub struct Judging {
    #[command(flatten)]
    control: Control,
    /// Refuse a program as endless after this many moves
    #[arg(long, value_name = "NUMBER", default_value_t = Options::default().most_moves)]
    most_moves: u64,
    /// Refuse a program as endless after this many seconds of reading without a move
    #[arg(long, value_name = "SECONDS", default_value_t = Options::default().most_work)]
    patience: f64,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_named_constrained()?;
    if config.mechanisms.len() > 1 && arguments.report.is_some() {
        let text = "--report shows one mechanism: add --mechanism 1 or --mechanism 2";
        return Err(refused(text));
    }
    if let [program] = arguments.programs.as_slice()
        && !program.is_dir()
    {
        return run_one(&config, arguments, program);
    }
    for (name, file) in [("--report", &arguments.report), ("--trace", &arguments.trace)] {
        if file.is_some() {
            let text = format!("{name} works with a single program: name one, or remove {name}");
            return Err(refused(text));
        }
    }
    run_all(&config, arguments, &programs(&arguments.programs)?)
}

fn run_one(
    config: &MachineConfig,
    arguments: &Arguments,
    program: &Path,
) -> Result<Verdict, Failure> {
    let mut course = arguments.report.as_ref().map(|_| Course::new(config.first()));
    let mut trace = arguments.trace.as_deref().map(|file| Trace::new(config, file)).transpose()?;
    let verdict = judged(config, &arguments.judging, program, |row| {
        if let Some(course) = &mut course {
            course.see(row);
        }
        // A write error is reported at the end.
        let _ = trace.as_mut().map(|trace| trace.see(row));
    })?;
    let is_judged = matches!(verdict.found.time, Time::Judged(_));
    trace.map_or(Ok(()), |trace| trace.finish(is_judged))?;
    if let Some(file) = &arguments.report {
        let course = course.filter(|_| is_judged).map(Course::finish);
        let shown =
            course.filter(|course| shows_what_breaks(config.first(), &verdict.found, course));
        let course = match shown {
            Some(course) => course,
            None => {
                let bar = Bar::spinner(READING);
                let course = Course::along(config.first(), &motion::moves(config, program, None)?);
                drop(bar);
                course
            }
        };
        write_whole(file, &report::page(&verdict, &course)?)?;
    }
    // A closed reader does not change the verdict.
    Failure::unless_unread(print_text(&to_people(&verdict)))?;
    output::answer(&verdict)?;
    Ok(verdict.fits.into())
}

/// Returns whether the servo cycles reach the first violation. LinuxCNC refuses some moves in advance, before the
/// motion is near them: then the path shows it.
fn shows_what_breaks(config: &Mechanism, found: &Preflight, course: &Thinned) -> bool {
    let of =
        |is_of_time| found.breaks.iter().find(|message| message.limit.is_of_time() == is_of_time);
    let (Some(path), Some(time)) = (of(false), of(true)) else { return true };
    found.time.is_whole()
        || path.line > time.line
        || course.place(config, path.line, &path.pose).is_some()
}

/// Judges programs one after another; an error in one does not prevent the others from being judged.
fn run_all(
    config: &MachineConfig,
    arguments: &Arguments,
    programs: &[PathBuf],
) -> Result<Verdict, Failure> {
    let mut table = vec![];
    let mut list = vec![];
    for program in programs {
        let name = program.display().to_string();
        match judged(config, &arguments.judging, program, |_| ()) {
            Ok(verdict) => {
                let mut text = to_people(&verdict);
                text += if text.is_empty() { "" } else { "\n" };
                Failure::unless_unread(print_text(&text))?;
                list.push((verdict.fits.into(), serde_json::to_value(&verdict)?));
                table.push((name, verdict.fits.into(), verdict.summary()));
            }
            Err(failure) => {
                let error = failure.to_string();
                report_error(&failure);
                let machine = config.file.display().to_string();
                let unread = json!({ "machine": machine, "program": name, "error": error });
                list.push((Verdict::Unjudged, unread));
                table.push((name, Verdict::Unjudged, error));
            }
        }
    }
    Failure::unless_unread(print_text(&in_a_table(&table)))?;
    output::list(list);
    let worst = |(_, verdict, _): &(_, Verdict, _)| *verdict;
    Ok(table.iter().map(worst).max().unwrap_or(Verdict::Fits))
}

/// Returns the programs, those of folders sorted by name.
fn programs(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut all = vec![];
    for path in given {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).at(path)?;
        let entries = entries.map(|entry| Ok(entry.at(path)?.path()));
        let mut files = entries.collect::<Result<Vec<_>, Failure>>()?;
        files.retain(|file| file.extension().is_some_and(|end| end == "ngc" || end == "nc"));
        if files.is_empty() {
            return Err(refused(format!(
                "{}: this folder has no programs (*.ngc, *.nc)",
                path.display()
            )));
        }
        files.sort();
        all.extend(files);
    }
    Ok(all)
}

/// Judges a program and shows the progress; `see` receives every servo cycle of it.
pub fn judged<'a>(
    config: &'a MachineConfig,
    judging: &Judging,
    program: &Path,
    mut see: impl FnMut(&Row) + Send,
) -> Result<ProgramVerdict<'a>, Failure> {
    let Judging { control, most_moves, patience } = judging;
    let options = Options { most_moves: *most_moves, most_work: *patience, ..control.options() };
    let mut progress = Progress::new(config, program)?;
    Ok(judge(config, program, &options, true, &mut |step| {
        progress.show(step);
        if let Step::Row(row) = step {
            see(row);
        }
    })?)
}

/// Returns the text for the user: everything, or with --quiet only the misfits.
fn to_people(verdict: &ProgramVerdict) -> String {
    if !output::is_quiet() {
        return verdict.text();
    }
    let text = match (&verdict.found.time, verdict.fits) {
        (Time::NotJudged(cause), None) => format!("not judged: {cause}\n"),
        _ => String::new(),
    };
    text + verdict.findings().trim_start()
}

fn in_a_table(rows: &[(String, Verdict, String)]) -> String {
    let width = rows.iter().map(|(name, ..)| name.chars().count()).max().unwrap_or(0);
    let row = |(name, verdict, about): &(String, Verdict, String)| {
        let verdict = match verdict {
            Verdict::Fits => "fits",
            Verdict::Misfit => "does not fit",
            Verdict::Unjudged => "not judged",
        };
        format!("{name:<width$}  {verdict:<12}  {about}\n")
    };
    rows.iter().map(row).collect()
}
