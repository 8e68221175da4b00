// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm preflight`.

use super::failure::Failure;
use super::{Bar, MachineFile, Verdict, moving, report};
use kinematics::Letter;
use pkm::check::cautions::{Caution, cautions};
use pkm::draw::margins::figures;
use pkm::draw::page::{self, Report, page};
use pkm::files::{Locate, write_whole};
use pkm::limits::is_of_feed;
use pkm::program::course::{Course, Thinned};
use pkm::program::findings::{Break, LineLoad, Preflight};
use pkm::program::interpreter::{self, Move, Reading};
use pkm::program::offset::{self, Offset};
use pkm::program::preflight::preflight;
use pkm::read::machine::MachineConfig;
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;

/// Checks before cutting that a program fits a machine
///
/// LinuxCNC's interpreter reads the program with the machine's tool table, parameters and
/// startup code; every move, taken as starting from [TRAJ]HOME, is followed over its whole length.
/// Axis limits, reach, joint ranges, cones and singular poses are proved, not sampled: a limit
/// that is not told as broken holds everywhere between the ends of the moves. Joint speeds and
/// accelerations are those of the programmed feed, as LinuxCNC's planner limits it, at a feed
/// override of 100 %. Every limit is told with the first line that breaks it, and with how near
/// the program comes to it. Where it does not fit, a shift of the work offset is searched that
/// makes it fit, and where the program leaves the platform level also a turn about Z; both are
/// checked by running the interpreter again.
///
/// Exit status: 0 where the program fits (warnings may be told), 1 where it does not, 2 where that
/// could not be judged.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// The program
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath)]
    program: PathBuf,
    /// Text for people, or JSON for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Also writes one page with plots
    #[arg(long, value_name = "FILE.html", value_hint = clap::ValueHint::FilePath)]
    report: Option<PathBuf>,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Text,
    Json,
}

/// Most warnings that the page repeats above its plots; its copy of the answer has more.
const MOST_NOTES: usize = 20;

/// What is told.
#[derive(Serialize)]
struct Answer<'a> {
    machine: String,
    program: String,
    /// Files that lines belong to, by the numbers told with them.
    files: &'a [PathBuf],
    fits: bool,
    #[serde(flatten)]
    found: &'a Preflight,
    warnings: Vec<Caution>,
    /// Another work offset, under which the program fits.
    offset: Option<Suggestion>,
}

/// A work offset that was checked, and the block that sets it.
#[derive(Serialize)]
struct Suggestion {
    #[serde(flatten)]
    offset: Offset,
    block: String,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    // Told before the interpreter, in the system's words.
    std::fs::read(&arguments.program).at(&arguments.program)?;
    let Reading { moves, files } = interpreter::reading(&config, &arguments.program)?;
    let texts = texts(&files)?;
    let moves = moving(&config, &arguments.program, moves)?;
    let found = followed(&config, &moves, arguments.report.is_some(), "following the moves")?;
    let mut warnings = cautions(&config, &config.ini, &texts);
    warnings.extend(found.tilted_tool_changes.iter().map(|change| tilted(*change)));
    let answer = Answer {
        machine: config.file.display().to_string(),
        program: arguments.program.display().to_string(),
        files: &files,
        fits: found.fits(),
        found: &found,
        warnings,
        offset: offset(&config, arguments, &moves, &found)?,
    };
    let blocks: Vec<Vec<&str>> = texts.iter().map(|text| text.lines().collect()).collect();
    if let Some(file) = &arguments.report {
        let course = Course::along(&config, &moves);
        write_report(file, &config, &answer, &course, &blocks)?;
    }
    let verdict = if answer.fits { Verdict::Fits } else { Verdict::Misfit };
    // A reader that has gone away does not change the verdict.
    Failure::unless_unread(tell(arguments.format, &config, &answer, &blocks))?;
    Ok(verdict)
}

fn followed(
    config: &MachineConfig,
    moves: &[Move],
    keep: bool,
    message: &'static str,
) -> Result<Preflight, Failure> {
    let bar = Bar::new(message);
    Ok(preflight(config, moves, keep, |share| bar.set(share))?)
}

fn texts(files: &[PathBuf]) -> Result<Vec<String>, Failure> {
    let text = |file: &PathBuf| {
        let bytes = std::fs::read(file).at(file)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    };
    files.iter().map(text).collect()
}

/// Where a line is: its number, behind the name of its file where that is not the program.
fn place(files: &[PathBuf], file: usize, line: u32) -> String {
    match file {
        0 => format!("line {line}"),
        _ => format!("{}, line {line}", files[file].display()),
    }
}

fn tilted((file, line): (usize, u32)) -> Caution {
    let text = "the tool offset changes while the platform is tilted: the program waits while \
                pkmkins moves it";
    Caution { line: Some(line), file, text: text.into() }
}

/// Least share of the programmed feed that three digits show.
const LEAST_FEED: f64 = 1e-3;

/// Another work offset that the interpreter and the whole check confirm: a shift where one will
/// do, else one that is turned as well.
fn offset(
    config: &MachineConfig,
    arguments: &Arguments,
    moves: &[Move],
    found: &Preflight,
) -> Result<Option<Suggestion>, Failure> {
    if found.breaks.iter().all(|told| is_of_feed(told.limit)) {
        // Another place does not make a program slower.
        return Ok(None);
    }
    let bar = Bar::spinner("looking for another work offset");
    let shifted = offset::shift(config, moves)?;
    drop(bar);
    if let Some(found) = confirmed(config, arguments, shifted)? {
        return Ok(Some(found));
    }
    if !offset::may_turn(config, moves) {
        return Ok(None);
    }
    let bar = Bar::spinner("looking for a turned work offset");
    let turned = offset::turn(config, moves)?;
    drop(bar);
    confirmed(config, arguments, turned)
}

fn confirmed(
    config: &MachineConfig,
    arguments: &Arguments,
    offset: Option<Offset>,
) -> Result<Option<Suggestion>, Failure> {
    let Some(offset) = offset else { return Ok(None) };
    let block = offset.block();
    // Under another offset the interpreter may refuse the program: cutter radii, arcs.
    let Ok(moves) = interpreter::moves_after(config, &arguments.program, &block) else {
        return Ok(None);
    };
    let checked = followed(config, &moves, false, "trying another work offset")?;
    Ok(checked.fits().then_some(Suggestion { offset, block }))
}

fn tell(
    format: Format,
    config: &MachineConfig,
    answer: &Answer,
    blocks: &[Vec<&str>],
) -> Result<(), Failure> {
    let mut out = anstream::stdout().lock();
    match format {
        Format::Text => out.write_all(in_words(config, answer, blocks).as_bytes())?,
        Format::Json => {
            writeln!(out, "{}", serde_json::to_string_pretty(answer)?)?;
        }
    }
    out.flush()?;
    Ok(())
}

fn in_words(config: &MachineConfig, answer: &Answer, blocks: &[Vec<&str>]) -> String {
    let found = answer.found;
    let mut text = format!("{} on {}\n", answer.program, answer.machine);
    let mut row = |name: &str, value: String| text.push_str(&format!("  {name:<18} {value}\n"));
    let unit = config.length_unit();
    row("moves", format!("{}, {:.1} {unit} long", found.moves, found.length));
    row("time", format!("{:.1} s of motion", found.time));
    for margin in &found.margins {
        let place = match margin.line {
            0 => format!("{}, before the program", margin.part),
            line => format!("{}, line {line}", margin.part),
        };
        let side = if margin.value < 0.0 { "beyond" } else { "to spare" };
        let amount = format!("{:.4} {}", margin.value.abs(), margin.unit);
        row(margin.limit.name(), format!("{} {side}: {place}", amount.trim_end()));
    }
    if let Some(least) = found.lines.iter().min_by(|a, b| a.factor.total_cmp(&b.factor)) {
        row("feed", feed(least));
    }
    if !found.fits() {
        row("runs", format!("{:.1} % of the path before the first limit", 100.0 * found.runnable));
    }
    for told in &found.breaks {
        text.push_str(&format!("\nerror: {}", in_a_sentence(told, answer.files, blocks)));
    }
    for Caution { line, file, text: caution } in &answer.warnings {
        let place = line.map_or(String::new(), |line| place(answer.files, *file, line) + ": ");
        text.push_str(&format!("\nwarning: {place}{caution}\n"));
    }
    if let Some(Suggestion { offset: Offset { shift: [x, y, z], turn }, block }) = &answer.offset {
        let how = match *turn {
            0.0 => format!("shifted by X {x} Y {y} Z {z} {unit}"),
            _ => format!(
                "turned by {turn} degrees about Z and then shifted by X {x} Y {y} Z {z} {unit}"
            ),
        };
        text.push_str(&format!(
            "\nhelp: the program fits with its work offset {how}: checked, with the whole program.\n  \
             Clamp the workpiece there, and once before the program run:\n  {block}\n"
        ));
    }
    let verdict = match (answer.fits, answer.warnings.is_empty()) {
        (true, true) => "The program fits the machine.",
        (true, false) => "The program fits the machine; look at the warnings.",
        (false, _) => "The program does not fit the machine.",
    };
    text + "\n" + verdict + "\n"
}

/// The greatest feed that the joint speeds allow.
fn feed(LineLoad { line, factor }: &LineLoad) -> String {
    if *factor < LEAST_FEED {
        return format!(
            "joint speeds allow less than {LEAST_FEED} times the programmed one, in line {line}"
        );
    }
    format!("joint speeds allow {factor:.3} times the programmed one, in line {line}")
}

/// What is in the line of a break.
fn block<'a>(told: &Break, blocks: &[Vec<&'a str>]) -> Option<&'a str> {
    let number = (told.line as usize).checked_sub(1)?;
    blocks[told.file].get(number).copied()
}

fn in_a_sentence(told: &Break, files: &[PathBuf], blocks: &[Vec<&str>]) -> String {
    let words: Vec<String> = Letter::ALL
        .iter()
        .zip(told.pose)
        .map(|(letter, value)| format!("{}{:.4}", letter.name(), value + 0.0))
        .collect();
    let block = block(told, blocks).map_or(String::new(), |block| format!("  {}\n", block.trim()));
    format!(
        "{}: {}: {}\n{block}  at {}\n",
        place(files, told.file, told.line),
        told.limit.name(),
        told.text,
        words.join(" ")
    )
}

fn write_report(
    file: &std::path::Path,
    config: &MachineConfig,
    answer: &Answer,
    course: &Thinned,
    blocks: &[Vec<&str>],
) -> Result<(), Failure> {
    let found = answer.found;
    let place_of = |told: &Break| place(answer.files, told.file, told.line);
    let block_of = |told: &Break| block(told, blocks).unwrap_or_default().trim().to_string();
    let marks = report::marks(config, found, course, place_of, block_of);
    let rows = report::rows(config, found, course);
    let help = answer.offset.as_ref().map(|found| {
        let words = "The program fits with another work offset. Clamp the workpiece there, and once \
                     before the program run:";
        (words.to_string(), found.block.clone())
    });
    let warnings = answer.warnings.iter().map(|Caution { line, file, text }| {
        line.map_or(String::new(), |line| place(answer.files, *file, line) + ": ") + text
    });
    let text = page(&Report {
        program: &answer.program,
        machine: &answer.machine,
        verdict: if answer.fits { page::Verdict::Fits } else { page::Verdict::Misfit },
        why: report::why(found, &rows),
        notes: warnings.take(MOST_NOTES).collect(),
        help,
        rows,
        marks: &marks,
        figures: &figures(config, course, &marks)?,
        text: &in_words(config, answer, blocks),
    });
    Ok(write_whole(file, &text)?)
}
