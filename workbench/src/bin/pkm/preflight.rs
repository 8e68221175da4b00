// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm preflight`.

use super::{Failure, MachineFile, Verdict};
use indicatif::{ProgressBar, ProgressStyle};
use kinematics::Letter;
use pkm::cautions::{Caution, cautions};
use pkm::ini::Ini;
use pkm::interpreter::{self, Move};
use pkm::machine::MachineConfig;
use pkm::preflight::{Break, LineLoad, Preflight, preflight};
use pkm::{fit, plots, report};
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;

/// Steps of the progress bar.
const STEPS: u64 = 1000;

/// Checks before cutting that a program fits a machine
///
/// LinuxCNC's interpreter reads the program with the machine's tool table, parameters and
/// startup code; every move, taken as starting from [TRAJ]HOME, is followed over its whole length.
/// Axis limits, reach, joint ranges, cones and singular poses are proved, not sampled: a limit
/// that is not told as broken holds everywhere between the ends of the moves. Joint speeds and
/// accelerations are those of the programmed feed, as LinuxCNC's planner limits it, at a feed
/// override of 100 %. Every limit is told with the first line that breaks it, and with how near
/// the program comes to it. Where it does not fit, a shift of the work offset is searched that
/// makes it fit, and checked by running the interpreter again.
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

/// What is told.
#[derive(Serialize)]
struct Answer<'a> {
    machine: String,
    program: String,
    fits: bool,
    #[serde(flatten)]
    found: &'a Preflight,
    warnings: Vec<Caution>,
    /// Shift of the work offset, X Y Z in machine units, under which the program fits.
    shift: Option<[f64; 3]>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let ini = Ini::read(&arguments.machine.machine)?;
    let bytes = std::fs::read(&arguments.program)
        .map_err(|error| Failure::at(&arguments.program, error))?;
    let text = String::from_utf8_lossy(&bytes);
    let moves = interpreter::moves(&config, &arguments.program, None)
        .map_err(|error| Failure::Told(error.to_string()))?;
    if moves.iter().all(|step| step.line == 0) {
        return Err(Failure::at(&arguments.program, "the program moves nothing"));
    }
    let found = followed(&config, &moves, arguments.report.is_some(), "following the moves")?;
    let mut warnings = cautions(&config, &ini, &text);
    warnings.extend(found.tilted_tool_changes.iter().map(|line| tilted(*line)));
    let answer = Answer {
        machine: config.file.display().to_string(),
        program: arguments.program.display().to_string(),
        fits: found.fits(),
        found: &found,
        warnings,
        shift: if found.fits() { None } else { shift(&config, arguments, &moves)? },
    };
    let blocks: Vec<&str> = text.lines().collect();
    if let Some(file) = &arguments.report {
        write_report(file, &config, &answer, &blocks)?;
    }
    let verdict = if answer.fits { Verdict::Fits } else { Verdict::Misfit };
    // A reader that has gone away does not change the verdict.
    match tell(arguments.format, &config, &answer, &blocks) {
        Err(Failure::Unread) | Ok(()) => Ok(verdict),
        Err(failure) => Err(failure),
    }
}

fn followed(
    config: &MachineConfig,
    moves: &[Move],
    keep: bool,
    message: &'static str,
) -> Result<Preflight, Failure> {
    // Hidden where standard error is no terminal.
    let bar = ProgressBar::new(STEPS).with_message(message);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {percent} %") {
        bar.set_style(style);
    }
    let found =
        preflight(config, moves, keep, |share| bar.set_position((share * STEPS as f64) as u64));
    bar.finish_and_clear();
    found.map_err(|fault| Failure::Told(fault.to_string()))
}

fn tilted(line: u32) -> Caution {
    let text = "the tool offset changes while the platform is tilted: the program waits while \
                pkmkins moves it";
    Caution { line: Some(line), text: text.into() }
}

/// A shift that the interpreter and the whole check confirm.
fn shift(
    config: &MachineConfig,
    arguments: &Arguments,
    moves: &[Move],
) -> Result<Option<[f64; 3]>, Failure> {
    let found = fit::shift(config, moves).map_err(|fault| Failure::Told(fault.to_string()))?;
    let Some(shift) = found.filter(|shift| shift.iter().any(|x| *x != 0.0)) else {
        return Ok(None);
    };
    let Ok(moves) = interpreter::shifted_moves(config, &arguments.program, shift) else {
        return Ok(None);
    };
    let checked = followed(config, &moves, false, "trying another work offset")?;
    Ok(checked.fits().then_some(shift))
}

fn tell(
    format: Format,
    config: &MachineConfig,
    answer: &Answer,
    blocks: &[&str],
) -> Result<(), Failure> {
    let mut out = anstream::stdout().lock();
    match format {
        Format::Text => out.write_all(in_words(config, answer, blocks).as_bytes())?,
        Format::Json => {
            let text = serde_json::to_string_pretty(answer)
                .map_err(|error| Failure::Told(format!("standard output: {error}")))?;
            writeln!(out, "{text}")?;
        }
    }
    out.flush()?;
    Ok(())
}

fn in_words(config: &MachineConfig, answer: &Answer, blocks: &[&str]) -> String {
    let found = answer.found;
    let mut text = format!("{} on {}\n", answer.program, answer.machine);
    let mut row = |name: &str, value: String| text.push_str(&format!("  {name:<18} {value}\n"));
    let unit = config.length_unit();
    row("moves", format!("{}, {:.1} {unit} long", found.moves, found.length));
    row("time", format!("{:.1} s at the programmed feed, without acceleration", found.time));
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
        let LineLoad { line, factor } = least;
        let feed =
            format!("joint speeds allow {factor:.3} times the programmed one, in line {line}");
        row("feed", feed);
    }
    if !found.fits() {
        row("runs", format!("{:.1} % of the path before the first limit", 100.0 * found.runnable));
    }
    for told in &found.breaks {
        text.push_str(&format!("\nerror: {}", in_a_sentence(told, blocks)));
    }
    for Caution { line, text: caution } in &answer.warnings {
        let place = line.map_or(String::new(), |line| format!("line {line}: "));
        text.push_str(&format!("\nwarning: {place}{caution}\n"));
    }
    if let Some([x, y, z]) = answer.shift {
        text.push_str(&format!(
            "\nhelp: the program fits with its work offset shifted by X {x} Y {y} Z {z} {unit}: \
             checked, with the whole program\n"
        ));
    }
    let verdict = match (answer.fits, answer.warnings.is_empty()) {
        (true, true) => "The program fits the machine.",
        (true, false) => "The program fits the machine; look at the warnings.",
        (false, _) => "The program does not fit the machine.",
    };
    text + "\n" + verdict + "\n"
}

fn in_a_sentence(told: &Break, blocks: &[&str]) -> String {
    let place: Vec<String> = Letter::ALL
        .iter()
        .zip(told.pose)
        .map(|(letter, value)| format!("{}{:.4}", letter.name(), value + 0.0))
        .collect();
    let block = (told.line as usize).checked_sub(1).and_then(|n| blocks.get(n));
    let block = block.map_or(String::new(), |block| format!("  {}\n", block.trim()));
    format!(
        "line {}: {}: {}\n{block}  at {}\n",
        told.line,
        told.limit.name(),
        told.text,
        place.join(" ")
    )
}

fn write_report(
    file: &std::path::Path,
    config: &MachineConfig,
    answer: &Answer,
    blocks: &[&str],
) -> Result<(), Failure> {
    let plots = plots::of_places(config, &answer.found.places).map_err(Failure::Told)?;
    let page = report::single_page(&answer.program, &in_words(config, answer, blocks), &plots);
    report::write_whole(file, &page).map_err(Failure::Told)
}
