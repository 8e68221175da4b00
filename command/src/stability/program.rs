// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stability program`.

use super::super::failure::{Failure, refused};
use super::super::{Bar, MachineFile, READING, Verdict, in_words, output, report_deleted};
use super::{Speeds, setup};
use ::program::mechanism_moves::moves_of;
use ::program::motion::{Move, MoveKind, Spindle};
use draw::plot::Plot;
use draw::stability::of_path;
use kinematics::Pose;
use machine::files::{Locate, csv, open, write_whole};
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;
use studies::cut::{program, stance};
use studies::stability::WORTH;
use studies::stability::path::{Best, Depth, Path, Stop};
use studies::study::file::Study;

/// Find the program line that is nearest to chatter
///
/// Examines positions along the feed moves of a program, with the machine's modes there, the feed
/// of the move and the programmed spindle speed, and computes by collocation the depth up to
/// which the cut is stable. Reports the line with the lowest limit, and the best spindle speed
/// for the whole program. If the study gives the depth of cut, the margin is the limit divided by
/// that depth.
///
///     [cutting]
///     depth_mm = 0.5               # and the keys of `pkm stability pose`
///
/// mm, 1/min.
///
/// Exit status: 0, 1 if the depth of cut exceeds the limit somewhere, 2 if that could not be
/// judged: feed moves that were not examined, a program without a spindle speed, input or output
/// that failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    job: Job,
    #[command(flatten)]
    speeds: Speeds,
    /// Write line, pose, speed and depths of every position as CSV
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
    /// Draw an SVG file into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
}

/// A program that cuts on a machine, and the number of positions to examine.
#[derive(clap::Args, Debug)]
pub struct Job {
    #[command(flatten)]
    pub machine: MachineFile,
    /// The program (- for standard input)
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath, value_parser = super::super::input::Program)]
    pub program: PathBuf,
    /// Read masses, springs, dampers, drives and cutting coefficients from this TOML file
    #[arg(long, value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    pub study: PathBuf,
    /// Spindle speed for all lines, 1/min [default: as programmed]
    #[arg(long, value_name = "RPM", value_parser = super::positive)]
    pub rpm: Option<f64>,
    /// Maximum number of positions, at the ends of feed moves, where stability (and with `pkm cut`
    /// vibration and resolution) is examined
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub places: u32,
}

#[derive(Serialize)]
struct Answer {
    machine: PathBuf,
    program: PathBuf,
    places: usize,
    feed_moves: usize,
    deepest_mm: f64,
    worst: Worst,
    depth_mm: Option<f64>,
    /// Ratio of the limit to the depth of cut.
    margin: Option<f64>,
    best_rpm: Option<f64>,
    best_stable_to_mm: Option<f64>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Worst {
    line: u32,
    pose: [f64; 6],
    rpm: f64,
    stable_to_mm: f64,
    zero_order_over_all_speeds_mm: Option<f64>,
}

/// Number of spindle speeds in the search for the best one.
const SPEEDS: usize = 61;

/// Largest tested depth without --deepest and without a depth of cut, mm; with one, this
/// many times that.
const DEEPEST: f64 = 20.0;

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.job.machine.read()?;
    stance::check(&config)?;
    let study = Study::read(&arguments.job.study)?;
    let setup = setup(&config, &study, &arguments.job.study)?;
    let range = arguments.speeds.range()?;
    let moves = arguments.job.moves(&config)?;
    let program = &arguments.job.program;
    let (stops, feed_moves) =
        program::stops(&config, &moves, arguments.job.places as usize).at(program)?;
    let against = study.turning.as_ref();
    let against = against.map(|own| program::against_thicker(&config, &moves, own)).transpose();
    let warning = against.at(program)?.flatten().map(program::thinner);
    let cut = study.cutting.and_then(|cutting| cutting.depth_mm);
    let cut = cut.or(study.turning.and_then(|turning| turning.depth_mm).map(|depth| depth.0));
    let deepest = arguments.speeds.deepest.unwrap_or(cut.map_or(DEEPEST, |cut| DEEPEST * cut));
    let place = |stop: usize| {
        let Stop { line, programmed, .. } = &stops[stop];
        let pose = in_words(&Pose::from_degrees(*programmed));
        format!("{}: line {line}: {pose}", arguments.job.program.display())
    };
    let path = Path::new(&setup, &stops, deepest)
        .map_err(|(stop, error)| Failure::at(place(stop), error))?;
    path.check(range[0]).map_err(|(stop, error)| Failure::at(place(stop), error))?;
    let bar = Bar::new("limit depths");
    let depths = path.depths(|share| bar.set(share));
    drop(bar);
    let bar = Bar::spinner("the best speed");
    let speed = |k: usize| range[0] + (range[1] - range[0]) * k as f64 / (SPEEDS - 1) as f64;
    let best = path.best(&(0..SPEEDS).map(speed).collect::<Vec<_>>());
    drop(bar);
    write(arguments, &stops, &depths, deepest)?;
    let files = [config.file.clone(), arguments.job.program.clone()];
    let answer = Answer {
        warnings: warning.into_iter().collect(),
        ..answer(files, &stops, &depths, feed_moves, deepest, cut, best)
    };
    output::answer(&answer)?;
    let mut out = output::people();
    writeln!(out, "{} on {}", answer.program.display(), answer.machine.display())?;
    report(&mut out, &answer)?;
    out.flush()?;
    Ok(match answer.margin {
        Some(margin) if !(margin > 1.0) => Verdict::Misfit,
        Some(_) if answer.places < answer.feed_moves => Verdict::Unjudged,
        _ => Verdict::Fits,
    })
}

impl Job {
    /// Returns the program's moves at its spindle speeds, or all at the given one. Refused if an extra
    /// axis rotates the workpiece in the cut, or moves together with the tool: then chip and speed are unknown.
    pub fn moves(&self, config: &Mechanism) -> Result<Vec<Move>, Failure> {
        // Reported before LinuxCNC starts, in the system's words.
        open(&self.program)?;
        let whole = MachineConfig::whole_of(config)?;
        let bar = Bar::spinner(READING);
        let (mut moves, files) = moves_of(config, &whole, &self.program)?;
        drop(bar);
        report_deleted(&self.program, &files)?;
        let moves_extra = |step: &&Move| step.kind == MoveKind::Feed && step.extra;
        if let Some(step) = moves.iter().find(moves_extra) {
            let (file, line) = (self.program.display(), step.line);
            return Err(refused(format!(
                "{file}: line {line}: an extra axis moves in the cut, so the motion of the tool in the work is \
                 unknown; move that axis alone, between the cuts"
            )));
        }
        if let Some(rpm) = self.rpm {
            moves.iter_mut().for_each(|step| step.spindle = Spindle::Turning(rpm));
        }
        Ok(moves)
    }
}

fn answer(
    [machine, program]: [PathBuf; 2],
    stops: &[Stop],
    depths: &[Depth],
    feed_moves: usize,
    deepest_mm: f64,
    depth_mm: Option<f64>,
    best: Option<Best>,
) -> Answer {
    let pairs = stops.iter().zip(depths);
    let least = pairs.min_by(|a, b| a.1.stable_to.total_cmp(&b.1.stable_to));
    let (stop, depth) = least.expect("a program with feed moves has places");
    Answer {
        machine,
        program,
        places: stops.len(),
        feed_moves,
        deepest_mm,
        worst: Worst {
            line: stop.line,
            pose: stop.programmed,
            rpm: stop.rpm,
            stable_to_mm: depth.stable_to,
            zero_order_over_all_speeds_mm: depth.floor.is_finite().then_some(depth.floor),
        },
        depth_mm,
        margin: depth_mm.map(|cut| depth.stable_to / cut),
        best_rpm: best.map(|best| best.rpm),
        best_stable_to_mm: best.map(|best| best.stable_to),
        warnings: vec![],
    }
}

fn write(
    arguments: &Arguments,
    stops: &[Stop],
    depths: &[Depth],
    deepest: f64,
) -> Result<(), Failure> {
    if let Some(file) = &arguments.csv {
        let header = [
            "line",
            "x",
            "y",
            "z",
            "a",
            "b",
            "c",
            "rpm",
            "stable_to_mm",
            "zero_order_over_all_speeds_mm",
        ];
        let row = |(stop, depth): (&Stop, &Depth)| {
            let mut cells = vec![f64::from(stop.line)];
            cells.extend(stop.programmed);
            cells.extend([stop.rpm, depth.stable_to, depth.floor]);
            cells
        };
        write_whole(file, &csv(&header, stops.iter().zip(depths).map(row)))?;
    }
    if let Some(folder) = &arguments.plots {
        let depths: Vec<f64> = depths.iter().map(|depth| depth.stable_to).collect();
        Plot::write_all(&[of_path(&depths, deepest)?], folder)?;
    }
    Ok(())
}

fn report(out: &mut impl Write, answer: &Answer) -> Result<(), Failure> {
    let Worst { line, rpm, stable_to_mm, pose, .. } = &answer.worst;
    let at_least = |depth: f64| if depth < answer.deepest_mm { "" } else { "at least " };
    let [places, moves] = [answer.places, answer.feed_moves];
    writeln!(
        out,
        "  {places} positions on {moves} feed moves, depths up to {} mm",
        answer.deepest_mm
    )?;
    let place = in_words(&Pose::from_degrees(*pose));
    writeln!(
        out,
        "  least limit   {}{stable_to_mm:.4} mm at line {line}, {rpm} 1/min, {place}",
        at_least(*stable_to_mm)
    )?;
    if let (Some(depth), Some(margin)) = (answer.depth_mm, answer.margin) {
        let word = if margin > 1.0 { "stable everywhere" } else { "unstable" };
        writeln!(out, "  depth of cut  {depth} mm: {word}, margin {margin:.3}")?;
        if places < moves {
            let rest = moves - places;
            writeln!(
                out,
                "  not judged    {rest} feed moves; use --places {moves} to examine all"
            )?;
        }
    }
    if let (Some(rpm), Some(depth)) = (answer.best_rpm, answer.best_stable_to_mm) {
        writeln!(
            out,
            "  best speed    {rpm:.1} 1/min for the whole: stable to {}{depth:.4} mm",
            at_least(depth)
        )?;
    }
    for warning in &answer.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    writeln!(out, "{WORTH}")?;
    Ok(())
}
