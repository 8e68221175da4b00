// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm preflight`.

use super::failure::{Failure, MovesNothing, refused, tell_error};
use super::run::{Control, Progress};
use super::{Bar, MachineFile, Verdict, output, report, told};
use draw::margins::figures;
use draw::page::{self, Report, of_program};
use kinematics::Letter;
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use workbench::check::cautions::{Caution, cautions, once};
use workbench::control::process::Options;
use workbench::control::row::{Ending, Message, Row};
use workbench::control::trace::Trace;
use workbench::files::{self, Locate, open, write_whole};
use workbench::program::course::{Course, Thinned};
use workbench::program::findings::{Break, LineLoad, Preflight, Range, Rule, Time, Timing};
use workbench::program::motion;
use workbench::program::offset::{self, Offset};
use workbench::program::preflight::{Judged, judge};
use workbench::read::machine::MachineConfig;

/// Checks before cutting that a program fits a machine
///
/// LinuxCNC runs the program in virtual time, with the machine's tool table, parameters and startup
/// code, from the HOME of its joints. Every move that it commands is examined over its whole length:
/// axis limits, reach, joint ranges, cones and singular poses are proved, not sampled. The same
/// limits are judged in every servo cycle; joint speeds, accelerations, following errors, messages
/// and the duration are LinuxCNC's own. A limit that is exceeded is reported with its first line and
/// place, and with the number of moves that exceed it; one that is kept, with the smallest margin.
/// For a program that does not fit, pkm searches for a work offset with which it does: shifted, and
/// where the program tilts the platform also turned about Z. Another run checks it. Several
/// programs, or those of a folder, end in a table.
///
/// Exit status: 0 if the program fits (there may be warnings), 1 if it does not, 2 if that could not
/// be judged; of several programs the worst.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Programs, - for standard input, or folders with programs (*.ngc, *.nc)
    #[arg(value_name = "PROGRAM.ngc", required = true, value_hint = clap::ValueHint::AnyPath, value_parser = super::input::Program)]
    programs: Vec<PathBuf>,
    /// Also writes one page with plots; of one program
    #[arg(long, value_name = "FILE.html", value_hint = clap::ValueHint::FilePath)]
    report: Option<PathBuf>,
    /// Also writes every servo cycle, as pkm run does; of one program, and where LinuxCNC ran it
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
    /// Moves after which a program counts as endless
    #[arg(long, value_name = "NUMBER", default_value_t = Options::default().most_moves)]
    most_moves: u64,
    /// Seconds of reading without a move after which a program counts as endless
    #[arg(long, value_name = "SECONDS", default_value_t = Options::default().most_work)]
    patience: f64,
    /// Whether a user interface of LinuxCNC waits for the answer.
    #[arg(skip)]
    is_filter: bool,
}

impl Judging {
    /// For a user interface that waits for the answer.
    fn of_filter() -> Self {
        let patience = Options::default().most_work;
        let most_moves = Options::default().most_moves;
        Self { control: Control::default(), most_moves, patience, is_filter: true }
    }
}

/// Most warnings that the page repeats above its plots; its copy of the answer has more.
const MOST_NOTES: usize = 20;

/// What is told; docs/json.md describes it.
#[derive(Serialize)]
pub struct Answer {
    machine: String,
    program: String,
    /// Files that lines belong to, by the numbers told with them.
    pub files: Vec<PathBuf>,
    /// Unknown where nothing that was judged breaks, and not all was judged.
    fits: Option<bool>,
    #[serde(flatten)]
    pub found: Preflight,
    warnings: Vec<Caution>,
    /// Another work offset, under which the program fits.
    offset: Option<Suggestion>,
}

/// A program of several that could not be judged at all.
#[derive(Serialize)]
struct Unread {
    machine: String,
    program: String,
    error: String,
}

/// A work offset that was checked, and the block that sets it.
#[derive(Serialize)]
struct Suggestion {
    #[serde(flatten)]
    offset: Offset,
    block: String,
    /// Whether LinuxCNC ran the program with it.
    time_judged: bool,
}

impl Suggestion {
    /// What was looked at.
    const fn checked(&self) -> &'static str {
        match self.time_judged {
            true => "checked, with the whole program",
            false => "what was judged of it was checked; not all of it was",
        }
    }
}

impl Answer {
    /// Names the place of a finding.
    pub fn place(&self, file: usize, line: u32) -> String {
        place(&self.files, file, line)
    }

    pub fn verdict(&self) -> Verdict {
        match self.fits {
            Some(true) => Verdict::Fits,
            Some(false) => Verdict::Misfit,
            None => Verdict::Unjudged,
        }
    }
}

/// What a user interface asks of a program.
pub enum Judgement {
    /// Everything was judged, and nothing breaks.
    Fits,
    /// The path fits; why nothing is known of what depends on time.
    NotJudged(String),
    /// What does not fit, in a sentence each.
    Misfit(Vec<String>),
}

/// Whether a program fits a machine: its path, and what LinuxCNC makes of it.
pub fn judgement(machine: &MachineFile, program: &Path) -> Result<Judgement, Failure> {
    let config = machine.read_all()?;
    let answer = judged(&config, &Judging::of_filter(), program, &mut |_| {})?;
    let texts = texts(&answer.files)?;
    let blocks: Vec<Vec<&str>> = texts.iter().map(|text| text.lines().collect()).collect();
    let told = |told| in_a_sentence(&config, &answer, told, &blocks);
    Ok(match (answer.fits, &answer.found.time) {
        (None, Time::NotJudged(cause)) => Judgement::NotJudged(cause.clone()),
        (Some(true), _) => Judgement::Fits,
        _ => Judgement::Misfit(answer.found.breaks.iter().map(told).collect()),
    })
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_all()?;
    if config.second.is_some() && arguments.report.is_some() {
        let text = "--report shows one mechanism: --mechanism 1 or 2 says which";
        return Err(refused(text));
    }
    if let [program] = arguments.programs.as_slice()
        && !program.is_dir()
    {
        return run_one(&config, arguments, program);
    }
    for (name, file) in [("--report", &arguments.report), ("--trace", &arguments.trace)] {
        if file.is_some() {
            let text = format!("{name} takes one program: name one alone, or leave {name} out");
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
    let mut course = arguments.report.as_ref().map(|_| Course::new(config));
    let mut trace = arguments.trace.as_deref().map(|file| Trace::new(config, file)).transpose()?;
    let answer = judged(config, &arguments.judging, program, &mut |row| {
        if let Some(course) = &mut course {
            course.see(row);
        }
        // What cannot be written is said at the end.
        let _ = trace.as_mut().map(|trace| trace.see(row));
    })?;
    let is_judged = matches!(answer.found.time, Time::Judged(_));
    trace.map_or(Ok(()), |trace| trace.finish(is_judged))?;
    let course = course.filter(|_| is_judged).map(Course::finish);
    let texts = texts(&answer.files)?;
    let blocks: Vec<Vec<&str>> = texts.iter().map(|text| text.lines().collect()).collect();
    if let Some(file) = &arguments.report {
        let course = match course.filter(|course| shows_what_breaks(config, &answer.found, course))
        {
            Some(course) => course,
            None => Course::along(config, &motion::moves(config, program, None)?),
        };
        write_report(file, config, &answer, &course, &blocks)?;
    }
    // A reader that has gone away does not change the verdict.
    Failure::unless_unread(told(&to_people(config, &answer, &blocks)))?;
    output::answer(&answer)?;
    Ok(answer.verdict())
}

/// Whether the cycles come to what breaks first. LinuxCNC refuses some moves beforehand, before the motion comes
/// near them: then the path shows it.
fn shows_what_breaks(config: &MachineConfig, found: &Preflight, course: &Thinned) -> bool {
    let of = |is_of_time| found.breaks.iter().find(|told| told.limit.is_of_time() == is_of_time);
    let (Some(path), Some(time)) = (of(false), of(true)) else { return true };
    found.time.is_whole()
        || path.line > time.line
        || course.place(config, path.line, &path.pose).is_some()
}

/// Programs one after another; what is wrong with one does not keep the others from being judged.
fn run_all(
    config: &MachineConfig,
    arguments: &Arguments,
    programs: &[PathBuf],
) -> Result<Verdict, Failure> {
    let mut table = vec![];
    let mut list = vec![];
    for program in programs {
        let name = program.display().to_string();
        match judged(config, &arguments.judging, program, &mut |_| {}) {
            Ok(answer) => {
                let verdict = answer.verdict();
                table.push((name, verdict, summary(&answer)));
                let texts = texts(&answer.files)?;
                let blocks: Vec<Vec<&str>> =
                    texts.iter().map(|text| text.lines().collect()).collect();
                let mut text = to_people(config, &answer, &blocks);
                text += if text.is_empty() { "" } else { "\n" };
                Failure::unless_unread(told(&text))?;
                list.push((verdict, serde_json::to_value(&answer)?));
            }
            Err(failure) => {
                let error = failure.to_string();
                tell_error(&failure);
                let machine = config.file.display().to_string();
                let unread = Unread { machine, program: name.clone(), error };
                list.push((Verdict::Unjudged, serde_json::to_value(&unread)?));
                table.push((name, Verdict::Unjudged, unread.error));
            }
        }
    }
    Failure::unless_unread(told(&in_a_table(&table)))?;
    output::list(list);
    let worst = |(_, verdict, _): &(_, Verdict, _)| *verdict;
    Ok(table.iter().map(worst).max().unwrap_or(Verdict::Fits))
}

/// The programs, those of folders in the order of their names.
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
            return Err(refused(format!("{}: no programs in it (*.ngc, *.nc)", path.display())));
        }
        files.sort();
        all.extend(files);
    }
    Ok(all)
}

/// Everything about one program; `see` gets every servo cycle of it.
pub fn judged(
    config: &MachineConfig,
    judging: &Judging,
    program: &Path,
    see: &mut (dyn FnMut(&Row) + Send),
) -> Result<Answer, Failure> {
    // Said before LinuxCNC starts, in the system's words.
    open(program)?;
    let Judged { found, files } = followed(config, judging, program, None, see)?;
    if let Some((line, file, text)) = found.never_starts() {
        let line = line.max(1);
        return Err(refused(format!("{}:{line}: {text}", files[file].display())));
    }
    if found.is_still() && found.fits() {
        return Err(MovesNothing(program.into()).into());
    }
    let mut warnings = cautions(config, &config.ini, &texts(&files)?);
    warnings.extend(found.tilted_tool_changes.iter().map(|change| tilted(*change)));
    warnings.extend(found.off_path.iter().map(|off| Caution {
        line: Some(off.line),
        file: off.file,
        text: off.text.clone(),
    }));
    let warnings = once(warnings);
    let fits = match (&found.time, found.fits()) {
        (_, false) => Some(false),
        (Time::Judged(_), true) => Some(true),
        (Time::NotJudged(_), true) => None,
    };
    Ok(Answer {
        machine: config.file.display().to_string(),
        program: program.display().to_string(),
        files,
        fits,
        warnings,
        offset: offset(config, judging, program, &found)?,
        found,
    })
}

/// Judges a program after a block, and shows how far it is.
fn followed(
    config: &MachineConfig,
    judging: &Judging,
    program: &Path,
    block: Option<&str>,
    see: &mut (dyn FnMut(&Row) + Send),
) -> Result<Judged, Failure> {
    let options = Options {
        block: block.map(Into::into),
        most_moves: judging.most_moves,
        most_work: judging.patience,
        ..judging.control.options()
    };
    let mut progress = match judging.is_filter {
        false => Progress::new(config, program)?,
        true => Progress::of_filter(config, program)?,
    };
    Ok(judge(config, program, &options, &mut |row| {
        progress.see(row);
        see(row);
        ControlFlow::Continue(())
    })?)
}

fn texts(files: &[PathBuf]) -> Result<Vec<String>, Failure> {
    let text = |file: &PathBuf| {
        let bytes = files::read(file)?;
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

/// Of coordinates that are told.
const PLACES: f64 = 1e-4;

/// Least share of the programmed feed that three digits show.
const LEAST_FEED: f64 = 1e-3;

/// Another work offset that the interpreter and the whole check confirm: a shift where one will
/// do, else one that is turned as well.
fn offset(
    config: &MachineConfig,
    judging: &Judging,
    program: &Path,
    found: &Preflight,
) -> Result<Option<Suggestion>, Failure> {
    // Another place does not make a program slower, two mechanisms have two places, and who opens a
    // program does not wait for a search.
    if judging.is_filter
        || found.breaks.iter().all(|told| told.limit.is_of_time())
        || config.second.is_some()
    {
        return Ok(None);
    }
    if !config.chain.is_empty() {
        // The search knows the machine's own poses alone.
        return Ok(None);
    }
    let bar = Bar::new("looking for another work offset");
    let shifted = offset::shift(config, &found.poses, |share| bar.set(share))?;
    drop(bar);
    if let Some(found) = confirmed(config, judging, program, shifted)? {
        return Ok(Some(found));
    }
    if !found.poses.may_turn(config) {
        return Ok(None);
    }
    let bar = Bar::new("looking for a turned work offset");
    let turned = offset::turn(config, &found.poses, |share| bar.set(share))?;
    drop(bar);
    confirmed(config, judging, program, turned)
}

fn confirmed(
    config: &MachineConfig,
    judging: &Judging,
    program: &Path,
    offset: Option<Offset>,
) -> Result<Option<Suggestion>, Failure> {
    let Some(offset) = offset else { return Ok(None) };
    let block = offset.block();
    // Under another offset LinuxCNC may refuse the program: cutter radii, arcs.
    let checked = followed(config, judging, program, Some(&block), &mut |_| {});
    let found = checked.ok().map(|judged| judged.found).filter(Preflight::fits);
    Ok(found.map(|found| Suggestion { offset, block, time_judged: found.time.is_whole() }))
}

/// What is told to people: of everything, or of what does not fit alone.
fn to_people(config: &MachineConfig, answer: &Answer, blocks: &[Vec<&str>]) -> String {
    match output::is_quiet() {
        true => {
            let text = match (&answer.found.time, answer.verdict()) {
                (Time::NotJudged(cause), Verdict::Unjudged) => format!("not judged: {cause}\n"),
                _ => String::new(),
            };
            text + findings_in_words(config, answer, blocks).trim_start()
        }
        false => in_words(config, answer, blocks),
    }
}

fn in_words(config: &MachineConfig, answer: &Answer, blocks: &[Vec<&str>]) -> String {
    let verdict = match (answer.verdict(), answer.warnings.is_empty()) {
        (Verdict::Fits, true) => "The program fits the machine.",
        (Verdict::Fits, false) => "The program fits the machine; look at the warnings.",
        (Verdict::Misfit, _) => "The program does not fit the machine.",
        (Verdict::Unjudged, _) => {
            "What was judged of the program fits the machine; not all of it was."
        }
    };
    let findings = findings_in_words(config, answer, blocks);
    facts_in_words(config, answer) + &findings + "\n" + verdict + "\n"
}

/// What it takes of the machine, and how much is to spare.
fn facts_in_words(config: &MachineConfig, answer: &Answer) -> String {
    let found = &answer.found;
    let mut text = format!("{} on {}\n", answer.program, answer.machine);
    let mut row = |name: &str, value: String| text.push_str(&format!("  {name:<18} {value}\n"));
    let unit = config.length_unit();
    row("moves", format!("{}, {:.1} {unit} long", found.moves, found.length));
    match &found.time {
        Time::Judged(timing) => row("time", duration(timing)),
        Time::NotJudged(cause) => row("time", format!("not judged: {cause}")),
    }
    let is_stopped =
        matches!(&found.time, Time::Judged(timing) if timing.ending == Ending::Stopped);
    let to_the_stop = if is_stopped { " (up to the stop)" } else { "" };
    for margin in &found.margins {
        let how_far = if margin.limit.is_of_time() { to_the_stop } else { "" };
        let place = match margin.line {
            0 => format!("{}, before the program", margin.part),
            line => format!("{}, {}", margin.part, answer.place(margin.file, line)),
        };
        let side = if margin.value < 0.0 { "beyond" } else { "to spare" };
        let amount = format!("{:.4} {}", margin.value.abs(), margin.unit);
        row(margin.limit.name(), format!("{} {side}: {place}{how_far}", amount.trim_end()));
    }
    for range in &found.ranges {
        row(&range.part, used(range));
    }
    if let Time::Judged(timing) = &found.time
        && let Some(least) = timing.lines.iter().min_by(|a, b| a.factor.total_cmp(&b.factor))
    {
        row("feed", feed(answer, least) + to_the_stop);
    }
    if !found.fits() {
        row("runs", format!("{:.1} % of the path before the first limit", 100.0 * found.runnable));
    }
    text
}

/// What does not fit, and what would.
fn findings_in_words(config: &MachineConfig, answer: &Answer, blocks: &[Vec<&str>]) -> String {
    let (found, unit) = (&answer.found, config.length_unit());
    let mut text = String::new();
    for told in &found.breaks {
        text.push_str(&format!("\nerror: {}", in_a_sentence(config, answer, told, blocks)));
    }
    for Caution { line, file, text: caution } in &answer.warnings {
        let place = line.map_or(String::new(), |line| place(&answer.files, *file, line) + ": ");
        text.push_str(&format!("\nwarning: {place}{caution}\n"));
    }
    text.push_str(&shown(answer));
    if let Some(suggestion) = &answer.offset {
        let Suggestion { offset: Offset { shift: [x, y, z], turn }, block, .. } = suggestion;
        let how = match *turn {
            0.0 => format!("shifted by X {x} Y {y} Z {z} {unit}"),
            _ => format!(
                "turned by {turn} degrees about Z and then shifted by X {x} Y {y} Z {z} {unit}"
            ),
        };
        text.push_str(&format!(
            "\nhelp: the program fits with its work offset {how}: {}.\n  \
             Clamp the workpiece there, and once before the program run:\n  {block}\n",
            suggestion.checked()
        ));
    }
    text
}

/// What LinuxCNC shows to the operator of a program that it runs to its end.
fn shown(answer: &Answer) -> String {
    let Time::Judged(timing) = &answer.found.time else { return String::new() };
    let shown = timing.messages.iter().filter(|_| timing.ending == Ending::Finished);
    shown
        .map(|Message { text, line, file, seconds, .. }| {
            let place = answer.place(*file, *line);
            format!("\nnote: {place}, after {seconds:.1} s: LinuxCNC shows: {text}\n")
        })
        .collect()
}

/// What a program uses of an axis or joint.
fn used(Range { unit, used: [low, high], allowed, .. }: &Range) -> String {
    let [least, most] =
        allowed.map(|end| if end.is_finite() { end.to_string() } else { "any".into() });
    // No -0, and no -0.000 of what rounds to 0.
    let [low, high] = [low, high].map(|value| (value * 1e3).round() / 1e3 + 0.0);
    format!("{low:.3} to {high:.3} of {least} to {most} {unit}")
}

fn duration(timing: &Timing) -> String {
    match timing.ending {
        Ending::Finished => format!("{:.1} s", timing.seconds),
        Ending::Stopped => format!("{:.1} s, then LinuxCNC stops it", timing.seconds),
    }
}

/// In a few words, for the table.
fn summary(answer: &Answer) -> String {
    let found = &answer.found;
    if let Some(first) = found.breaks.first() {
        let more = match found.breaks.len() - 1 {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        return format!("{}: {}{more}", answer.place(first.file, first.line), first.limit.name());
    }
    match &found.time {
        Time::Judged(timing) => duration(timing),
        Time::NotJudged(cause) => format!("time not judged: {cause}"),
    }
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

/// The greatest feed that the joint speeds allow.
fn feed(answer: &Answer, LineLoad { line, file, factor }: &LineLoad) -> String {
    let place = answer.place(*file, *line);
    if *factor < LEAST_FEED {
        return format!(
            "joint speeds allow less than {LEAST_FEED} times the programmed one, in {place}"
        );
    }
    format!("joint speeds allow {factor:.3} times the programmed one, in {place}")
}

/// What is in the line of a break.
fn block<'a>(told: &Break, blocks: &[Vec<&'a str>]) -> Option<&'a str> {
    let number = (told.line as usize).checked_sub(1)?;
    blocks[told.file].get(number).copied()
}

fn in_a_sentence(
    config: &MachineConfig,
    answer: &Answer,
    told: &Break,
    blocks: &[Vec<&str>],
) -> String {
    let mechanism = config.second.as_deref().filter(|_| told.of_second).unwrap_or(config);
    let words: Vec<String> = Letter::ALL
        .iter()
        .zip(told.pose)
        // Letters of another mechanism, or of nothing.
        .filter(|(letter, _)| {
            !mechanism.place.is_of_pair || !mechanism.machine.layout().is_held(**letter)
        })
        .map(|(letter, value)| {
            // What rounds to 0 has no sign.
            let value = (value / PLACES).round() * PLACES + 0.0;
            format!("{}{value:.4}", mechanism.place.letter(*letter))
        })
        .collect();
    let block = block(told, blocks).map_or(String::new(), |block| format!("  {}\n", block.trim()));
    let more = match told.moves {
        0 | 1 => String::new(),
        moves => format!(", the first of {moves}"),
    };
    format!(
        "{}: {}: {}\n{block}  at {}{more}\n",
        answer.place(told.file, told.line),
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
    let found = &answer.found;
    let place_of = |_: Rule, file: usize, line: u32| answer.place(file, line);
    let block_of = |told: &Break| block(told, blocks).unwrap_or_default().trim().to_string();
    let marks = report::marks(config, found, course, &place_of, block_of);
    let rows = report::rows(config, found, &place_of);
    let help = answer.offset.as_ref().map(|found| {
        let words = format!(
            "The program fits with another work offset: {}. Clamp the workpiece there, and once before \
             the program run:",
            found.checked()
        );
        (words, found.block.clone())
    });
    let warnings = answer.warnings.iter().map(|Caution { line, file, text }| {
        line.map_or(String::new(), |line| place(&answer.files, *file, line) + ": ") + text
    });
    let text = of_program(&Report {
        program: &answer.program,
        machine: &answer.machine,
        verdict: match answer.fits {
            Some(true) => page::Verdict::Fits,
            Some(false) => page::Verdict::Misfit,
            None => page::Verdict::NotJudged,
        },
        why: report::why(found, &rows, &place_of),
        notes: warnings.take(MOST_NOTES).collect(),
        help,
        rows,
        marks: &marks,
        figures: &figures(config, course, &marks)?,
        text: &in_words(config, answer, blocks),
    });
    Ok(write_whole(file, &text)?)
}
