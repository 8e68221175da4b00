// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm measure`.

use super::failure::{Failure, refused};
use super::{Bar, MachineFile, Verdict, output, print_text};
use ::program::motion::{Move, MoveKind, Spindle, extra_home};
use ::program::preflight::preflight;
use calibrate::model::Tolerance;
use calibrate::propose::{Proposal, Step, propose};
use calibrate::setup::Setup;
use calibrate::sheet;
use calibrate::{probing, program};
use machine::files::{read_text, write_whole};
use machine::read::mechanism::Mechanism;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Write a program that stops for gauge readings, and their table
///
/// GAUGE.toml describes the gauge (a dial gauge in the spindle, a ball bar, a feeler gauge) and
/// the targets (planes and balls, with their approximate positions); configs/hexapod/calibration
/// has one of each. pkm chooses the poses whose readings best determine the motion of the tip,
/// and checks the whole path against the machine's limits before it writes anything. The program,
/// NAME.ngc, stops at each pose and shows what to read. Enter the readings into NAME.csv, in the
/// column reading and, for a second run, in the column again. Then run `pkm calibrate MACHINE.ini
/// NAME.csv`.
///
/// With gauge = "probe" the program probes the holes of a plate at the tilts that the machine
/// has, and logs each touch to NAME.log for `pkm calibrate --plate`. The second file is then
/// NAME.hal, which latches the joints. Tools may point up or down; the key angles gives the
/// orientation of the plate.
///
/// Exit status: 0 if both files were written, 2 if none was.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// TOML file with the gauge and its targets
    #[arg(value_name = "GAUGE.toml", value_hint = clap::ValueHint::FilePath)]
    gauge: PathBuf,
    /// Name of the program, NAME.ngc, and the table, NAME.csv; existing files are kept
    #[arg(short, long, value_name = "NAME", default_value = "measure")]
    output: PathBuf,
    /// Standard deviation of anchor coordinates and lengths from the drawing, in machine units
    /// [default: 1 mm]
    #[arg(long, value_name = "LENGTH")]
    tolerance: Option<f64>,
}

/// A file that would be overwritten.
#[derive(Debug, thiserror::Error)]
#[error("{}: exists already and may contain readings; choose another name with --output", .0.display())]
struct IsThere(PathBuf);

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.for_measuring(arguments.machine.read_constrained()?)?;
    let tolerance = arguments.tolerance.unwrap_or(config.units_per_mm);
    if !(tolerance > 0.0 && tolerance.is_finite()) {
        return Err(refused(format!("--tolerance {tolerance}: expected more than 0")));
    }
    let text = read_text(&arguments.gauge)?;
    match probing::is_one(&text) {
        true => probe(arguments, &config),
        false => read(arguments, &config, &Tolerance::of_lengths(tolerance)),
    }
}

/// Returns the two files of this name, which must not exist.
fn files(arguments: &Arguments, endings: [&str; 2]) -> Result<[PathBuf; 2], Failure> {
    let files = endings.map(|ending| with_ending(&arguments.output, ending));
    match files.iter().find(|file| file.exists()) {
        Some(there) => Err(IsThere(there.clone()).into()),
        None => Ok(files),
    }
}

/// Writes program and table of a gauge that the operator reads.
fn read(
    arguments: &Arguments,
    config: &Mechanism,
    tolerance: &Tolerance,
) -> Result<Verdict, Failure> {
    let files = files(arguments, ["ngc", "csv"])?;
    let setup = Setup::read(config, &arguments.gauge)?;
    let bar = Bar::new("choosing poses");
    let proposal = propose(config, &setup, tolerance, |share| bar.set(share))
        .map_err(|error| Failure::at(arguments.gauge.display(), error))?;
    bar.next("checking the path".into());
    follow(config, &setup, &proposal)?;
    drop(bar);
    let [program, table] = &files;
    let name = table.file_name().unwrap_or_default().to_string_lossy();
    write_both(
        (program, &program::text(config, &setup, &proposal, &name)),
        (table, &sheet::empty(config, &setup.gauge, &setup.objects, &proposal.stops)),
    )?;
    print_text(&in_words(config, &setup, &proposal, &files))?;
    output::answer(&json!({
        "machine": config.file,
        "files": files,
        "stops": proposal.stops.len(),
        "tip": { "by_drawing": proposal.drawn.expected, "with_readings": proposal.measured.expected },
    }))?;
    Ok(Verdict::Fits)
}

/// Writes program and HAL file of a probe.
fn probe(arguments: &Arguments, config: &Mechanism) -> Result<Verdict, Failure> {
    let [program, hal] = files(arguments, ["ngc", "hal"])?;
    let log = with_ending(&arguments.output, "log");
    let log = log.file_name().unwrap_or_default().to_string_lossy();
    let bar = Bar::spinner("choosing touches");
    let found = probing::probing(config, &arguments.gauge, &log)?;
    drop(bar);
    write_both((&program, &found.program), (&hal, &found.hal))?;
    let tilts: Vec<String> =
        found.tilts.iter().map(|[a, b, c]| format!("A{a} B{b} C{c}")).collect();
    print_text(&format!(
        "{}\n  touches        {}, within all limits\n  tilts          {}\nwritten: {}, {}\n",
        config.file.display(),
        found.touches,
        tilts.join(", "),
        program.display(),
        hal.display()
    ))?;
    output::answer(&json!({
        "machine": config.file,
        "files": [program, hal],
        "stops": found.touches,
        "tilts": found.tilts,
    }))?;
    Ok(Verdict::Fits)
}

/// Appends an ending to a name, which may contain dots.
fn with_ending(name: &Path, ending: &str) -> PathBuf {
    let mut name = name.as_os_str().to_owned();
    name.push(".");
    name.push(ending);
    name.into()
}

/// Writes both files or none.
fn write_both(first: (&Path, &str), second: (&Path, &str)) -> Result<(), Failure> {
    write_whole(first.0, first.1)?;
    write_whole(second.0, second.1).inspect_err(|_| drop(std::fs::remove_file(first.0)))?;
    Ok(())
}

/// Checks the path against the machine's limits, as preflight does.
fn follow(config: &Mechanism, setup: &Setup, proposal: &Proposal) -> Result<(), Failure> {
    let tool = setup.gauge.tool - config.spindle;
    let steps = proposal.paths.iter().flatten().chain(&proposal.home);
    let moves: Vec<Move> =
        steps.map(|step| moved(config, step, tool.into(), setup.feed / 60.0)).collect();
    match preflight(std::slice::from_ref(config), &moves)?.breaks.first() {
        None => Ok(()),
        Some(found) => {
            Err(refused(format!("the path to the poses violates a limit: {}", found.text)))
        }
    }
}

fn moved(config: &Mechanism, step: &Step, tool: [f64; 3], feed: f64) -> Move {
    let mut end = step.at;
    (0..3).for_each(|k| end[k] += tool[k]);
    Move {
        kind: if step.is_slow { MoveKind::Feed } else { MoveKind::Rapid },
        line: 0,
        end,
        feed,
        angular_feed: feed,
        tool,
        file: 0,
        extra: false,
        second: None,
        lasts: None,
        extra_end: extra_home(config),
        spindle: Spindle::Unknown,
        is_per_turn: false,
    }
}

fn in_words(
    config: &Mechanism,
    setup: &Setup,
    proposal: &Proposal,
    [program, table]: &[PathBuf; 2],
) -> String {
    let unit = config.length_unit();
    let Proposal { stops, spread, drawn, measured, .. } = proposal;
    let ([low, high], scale) = (setup.gauge.range, setup.gauge.scale);
    format!(
        "{}\n  poses          {}, within all limits on the whole path\n  tip's motion   rms {:.5} {unit} over the workspace by \
         the drawing, {:.5} with one reading of {} {} at each and drives of exact scale\n  readings       about {}, by the drawing's tolerances with a deviation of {spread:.0} {scale}; the gauge shows {low} to \
         {high}: type - where it does not\nwritten: {}, {}\n",
        config.file.display(),
        stops.len(),
        drawn.expected,
        measured.expected,
        setup.gauge.deviation,
        scale,
        setup.expected,
        program.display(),
        table.display()
    )
}
