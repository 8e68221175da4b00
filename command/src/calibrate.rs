// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm calibrate`.

use super::failure::{Failure, refused};
use super::{Bar as Progress, MachineFile, Verdict, output};
use calibrate::at_tool::{CONFIDENCE, Ellipsoid};
use calibrate::constraint::ConstraintPart;
use calibrate::model::{Parameter, Quantity, Tolerance};
use calibrate::rewrite;
use calibrate::scale::DriveScale;
use calibrate::sheet::Sheet;
use calibrate::study::{self, Agreement, Study, Wishes};
use draw::bars::{Bar, Group};
use draw::changes::of_changes;
use draw::plot::Plot;
use machine::files::{write_over, write_whole};
use machine::read::mechanism::Mechanism;
use serde_json::{Value, json};
use statrs::distribution::{ContinuousCDF, Normal};
use std::fmt::Write as _;
use std::io::Write;
use std::path::PathBuf;

/// Factor by which the residual of held-out measurements may exceed the one expected from the numbers of measurements
/// and unknowns: the held-out fifth has other poses.
const HELD_OUT: f64 = 1.5;

/// Change of the drives' scale for which the report states the error of the tip.
const SHARE: f64 = 1e-3;

const AXES: [&str; 3] = ["X", "Y", "Z"];

/// Number of standard deviations that a change exceeds once in 16000 cases.
const FAR: f64 = 4.0;

/// Find a machine's true geometry from measurements
///
/// Reads logs of the calibration program, which probes the holes of a plate (--plate); files
/// written by (PROBEOPEN) with the same touches; tables of a laser tracker or ball bar as CSV
/// (columns x,y,z,a,b,c and tip_x,tip_y,tip_z or distance, below lines "# geometry HASH" and "#
/// tool X Y Z"); or the table of `pkm measure` with readings of a dial gauge, a ball bar or a
/// feeler gauge. Each file stands for one position of the plate or instrument, which is estimated
/// as well. All files must belong to the geometry of MACHINE.ini; others are refused.
///
/// A file of PROBEOPEN needs these comments at its top: "# machine MACHINE.ini", "# geometry
/// HASH", "# tool X Y Z", "# coordinates machine" (probed without a work offset, in the machine's
/// unit) and "# plate X Y Z A B C", the approximate position of the plate. Each line is assigned
/// to the nearest wall or face, within a quarter of the ball's diameter. If consecutive lines at
/// one orientation are within a tenth of it, the last one counts (a slow touch after a fast one).
///
/// Constraints of the platform are calibrated as well: shifts and tilts of their planes and axes, the
/// latter as lengths at the radius of the platform, and the points that are no anchors of legs.
///
/// Reports what the measurements determine and what they do not, and why; every changed value
/// with the half width of its 95 % interval; the 95 % region of the tip; and the fit of
/// measurements that were held out. Values that the measurements do not determine stay as in the
/// file. Measurements that contradict the others are named and left out.
///
/// A change above --threshold is written only with --accept. If a single typing mistake (another
/// unit, two values exchanged, a row too high) explains why readings do not fit, they are refused
/// with the line.
///
/// Exit status: 0 if all is well, 1 if something needs attention (a measurement left out, a
/// machine unlike its drawing), 2 if there is no result.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Logs of the calibration program, files of PROBEOPEN, or tables, also those of `pkm measure`
    #[arg(value_name = "LOG", required = true, value_hint = clap::ValueHint::FilePath)]
    files: Vec<PathBuf>,
    /// Plate that was probed
    #[arg(long, value_name = "FILE.toml", value_hint = clap::ValueHint::FilePath)]
    plate: Option<PathBuf>,
    /// Draw the changes of all legs into this folder (SVG)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
    /// Write a copy of MACHINE.ini with the new geometry
    #[arg(long, value_name = "NEW.ini", value_hint = clap::ValueHint::FilePath)]
    write: Option<PathBuf>,
    /// Write the new geometry into MACHINE.ini itself
    #[arg(long, conflicts_with = "write")]
    in_place: bool,
    /// Prove new [BOX_K] sections for the start without a seed (minutes); by default they are
    /// removed
    #[arg(long)]
    boxes: bool,
    /// Standard deviation of anchor coordinates and lengths from the drawing, in machine units
    /// [default: 1 mm]
    #[arg(long, value_name = "LENGTH")]
    tolerance: Option<f64>,
    /// Standard deviation of one measured number [default: estimated from the measurements]
    #[arg(long, value_name = "LENGTH")]
    noise: Option<f64>,
    /// Relative standard deviation of the screw lead; 0 keeps the lead
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    lead: f64,
    /// Standard deviation of the pre-travel of the probe, in machine units; 0 excludes it [default:
    /// 0.05 mm]
    #[arg(long, value_name = "LENGTH")]
    trigger: Option<f64>,
    /// Largest change of an anchor coordinate or a length to write without --accept, in machine
    /// units [default: 4 times --tolerance]
    #[arg(long, value_name = "LENGTH")]
    threshold: Option<f64>,
    /// Write changes above --threshold too
    #[arg(long)]
    accept: bool,
    /// Also list this many poses to measure next, best first
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    next: usize,
}

/// The new file would overwrite the machine's own file.
#[derive(Debug, thiserror::Error)]
#[error("{}: this is the machine's own file; use --in-place to change it", .0.display())]
struct OwnFile(PathBuf);

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.for_measuring(arguments.machine.read_constrained()?)?;
    let constraints = config.machine.layout().constraints();
    if arguments.boxes && constraints > 0 {
        return Err(refused(
            "--boxes: not judged with constraints= in [KINS]KINEMATICS; remove --boxes",
        ));
    }
    let wishes = wishes(arguments, &config)?;
    if arguments.write.as_ref().is_some_and(|new| same_file(new, &config.file)) {
        return Err(OwnFile(config.file.clone()).into());
    }
    let bar = Progress::spinner("reading the measurements");
    let given = study::read(&config, &arguments.files, &wishes)?;
    study::look_for_mistakes(&config, &given, &arguments.files)?;
    bar.next("calibrating".into());
    let study = study::study(&config, given, |share| bar.set(share))?;
    let target = arguments.write.as_ref().or(arguments.in_place.then_some(&config.file));
    bar.next("writing the new file".into());
    let new = new_text(arguments, &config, &study)?;
    let mut text = in_words(&config, &study);
    if arguments.next > 0 {
        bar.next("choosing the next poses".into());
        text += &next(&config, &study, arguments.next)?;
    }
    if let Some(folder) = &arguments.plots {
        Plot::write_all(&[changes(&config, &study)?], folder)?;
    }
    drop(bar);
    let mut concerns = beyond(arguments, &config, &study);
    let is_kept = !concerns.is_empty() && !arguments.accept;
    if let Some(target) = target.filter(|_| is_kept) {
        concerns
            .push(format!("{} is not written; add --accept to write it anyway", target.display()));
    }
    if let Some(target) = target.filter(|_| !is_kept) {
        let names = (config.file.display().to_string(), target.display().to_string());
        match arguments.in_place {
            true => write_over(target, &new)?,
            false => write_whole(target, &new)?,
        }
        text += &format!(
            "\n{}\nwritten: {}\n",
            rewrite::difference(config.ini.text(), &new, (&names.0, &names.1)),
            names.1
        );
    }
    concerns.extend(others(&config, &study));
    for concern in &concerns {
        let _ = write!(text, "\nwarning: {concern}\n");
    }
    let verdict = if concerns.is_empty() { Verdict::Fits } else { Verdict::Misfit };
    let written = target.filter(|_| !is_kept);
    output::answer(&for_programs(&config, &study, written, &concerns))?;
    let mut out = output::people();
    // A closed reader does not change the verdict.
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    Failure::unless_unread(written.map_err(Failure::from))?;
    Ok(verdict)
}

fn same_file(a: &std::path::Path, b: &std::path::Path) -> bool {
    let real = |file: &std::path::Path| std::fs::canonicalize(file).ok();
    real(a).is_some() && real(a) == real(b)
}

fn wishes(arguments: &Arguments, config: &Mechanism) -> Result<Wishes, Failure> {
    let Arguments { tolerance, noise, lead, trigger, .. } = arguments;
    let threshold = arguments.threshold;
    for (name, value) in [("tolerance", *tolerance), ("noise", *noise), ("threshold", threshold)] {
        if let Some(value) = value.filter(|value| !(*value > 0.0 && value.is_finite())) {
            return Err(refused(format!("--{name} {value}: expected more than 0")));
        }
    }
    let trigger = trigger.unwrap_or(0.05 * config.units_per_mm);
    for (name, value) in [("lead", *lead), ("trigger", trigger)] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(refused(format!("--{name} {value}: expected 0 or more")));
        }
    }
    let lengths = tolerance.unwrap_or(config.units_per_mm);
    let is_probed = arguments.plate.is_some();
    let tolerance = Tolerance {
        lead: *lead,
        trigger: if is_probed { trigger } else { 0.0 },
        ..Tolerance::of_lengths(lengths)
    };
    Ok(Wishes { tolerance, noise: *noise, plate: arguments.plate.clone() })
}

/// Returns the new file; nothing is written yet.
fn new_text(arguments: &Arguments, config: &Mechanism, study: &Study) -> Result<String, Failure> {
    let new = rewrite::calibrated(config, &study.model, &study.found.changes)?;
    match arguments.boxes {
        true => Ok(rewrite::with_boxes(&config.file, &new)?),
        false => Ok(new),
    }
}

fn in_words(config: &Mechanism, study: &Study) -> String {
    let Study { model, readings, found, .. } = study;
    let unit = config.length_unit();
    let mut text = format!("{}\n", config.file.display());
    let mut row = |name: &str, value: String| {
        let _ = writeln!(text, "  {name:<14} {value}");
    };
    row(
        "measured",
        format!("{} readings, {} numbers in use", readings.len(), found.residuals.len()),
    );
    row(
        "residuals",
        format!(
            "rms {:.6} {unit} as drawn, {:.6} calibrated, {:.6} held out",
            study.as_drawn,
            found.rms(),
            study.held_out
        ),
    );
    row("noise", format!("{:.6} {unit} of one number", found.noise));
    if let Some(worst) = study.holes.first() {
        let rms = (study.holes.iter().map(|hole| hole.miss * hole.miss).sum::<f64>()
            / study.holes.len() as f64)
            .sqrt();
        row(
            "holes",
            format!(
                "as the control recorded them off by up to {:.4} {unit}, rms {rms:.4} ({})",
                worst.miss, worst.name
            ),
        );
    }
    let all = model.parameters.len();
    row(
        "determined",
        format!("{} of {all} values; {} better than the drawing", study.rank, study.improved),
    );
    for (count, why) in &study.unseen {
        row("", format!("{count} not: {why}"));
    }
    for (k, instrument) in study.instruments.iter().enumerate() {
        let [x, y, z] = model.frame(k, &found.changes).origin.into();
        row("instrument", format!("{instrument} at {x:.4} {y:.4} {z:.4} {unit}"));
    }
    for (name, (before, after)) in
        ["tip at home", "tip at worst"].iter().zip(study.at_tool.iter().flatten())
    {
        row(name, ellipsoid(before, after, unit));
    }
    let [before, after] = study.shape;
    row(
        "tip's motion",
        format!(
            "rms {:.5} {unit} over the workspace, with {:.0} % below {:.5}; by the drawing {:.5}",
            after.expected,
            100.0 * CONFIDENCE,
            after.below,
            before.expected
        ),
    );
    let DriveScale { change, deviation, motion } = study.scale;
    let half = Normal::standard().inverse_cdf(0.5 + CONFIDENCE / 2.0) * deviation;
    match study.scale.is_covered() {
        true => row(
            "drives' scale",
            format!(
                "{:+.4} % +- {:.4} %, which all bounds above include",
                100.0 * change,
                100.0 * half
            ),
        ),
        false => row(
            "not covered",
            format!(
                "the scale of the drives (travel per turn or per step): an error of {} % moves the tip by rms {:.5} \
                 {unit}, which no bound above includes. Measure one length and compare it with LinuxCNC's display: \
                 the travel between two stops, or a part",
                100.0 * SHARE,
                SHARE * motion
            ),
        ),
    }
    if let Some(Agreement { chi_square, numbers, most, .. }) = study.agreement {
        row(
            "agreement",
            format!(
                "chi-square {chi_square:.1} of {numbers} numbers, at most {most:.1} if deviations and \
                 tolerance are as stated"
            ),
        );
    }
    for typed in &study.typed {
        row("two runs", scatter(&typed.sheet));
    }
    text += &values(study);
    text
}

/// Describes the scatter that a second run of the gauge shows.
fn scatter(sheet: &Sheet) -> String {
    let (scale, stated) = (sheet.gauge.scale, sheet.gauge.deviation);
    match sheet.scatter() {
        None => {
            format!("only one run: the stated deviation of {stated} {scale} cannot be verified")
        }
        Some(found) => format!(
            "{} poses twice: deviation {:.3} {scale}, stated {stated}; the second run {:+.3} {scale} on average",
            found.rows, found.deviation, found.drift
        ),
    }
}

fn ellipsoid(before: &Ellipsoid, after: &Ellipsoid, unit: &str) -> String {
    let axes = |e: &Ellipsoid| e.half_axes.map(|axis| format!("{axis:.5}")).join(" x ");
    let [x, y, z] = after.direction.into();
    format!(
        "with {:.0} % within {} {unit} (longest along {x:.2} {y:.2} {z:.2}); by the drawing {}",
        100.0 * CONFIDENCE,
        axes(after),
        axes(before)
    )
}

fn name(quantity: Quantity) -> String {
    let axis = |k: usize| AXES[k % 3];
    match quantity {
        Quantity::Base(leg, k) => format!("LEG_{leg} BASE {}", axis(k)),
        Quantity::Platform(leg, k) => format!("LEG_{leg} PLATFORM {}", axis(k)),
        Quantity::Length(leg) => format!("LEG_{leg} length"),
        Quantity::Constraint(n, part) => format!("CONSTRAINT_{n} {}", part_name(part)),
        Quantity::Lead => "lead".into(),
        Quantity::Scale => "scale of the drives".into(),
        Quantity::Trigger => "probe late by".into(),
        Quantity::Zero(gauge) => format!("zero of gauge {}", gauge + 1),
        Quantity::Frame(frame, k) => format!("file {} coordinate {k}", frame + 1),
    }
}

fn part_name(part: ConstraintPart) -> String {
    let axis = |k: usize| AXES[k % 3];
    match part {
        ConstraintPart::Base(k) => format!("BASE {}", axis(k)),
        ConstraintPart::Platform(k) => format!("PLATFORM {}", axis(k)),
        ConstraintPart::Shift => "shift".into(),
        ConstraintPart::Normal(k) => format!("tilt {}", k + 1),
        ConstraintPart::BaseAxis(k) => format!("base tilt {}", k + 1),
    }
}

fn values(study: &Study) -> String {
    let reach = Normal::standard().inverse_cdf(0.5 + CONFIDENCE / 2.0);
    let mut text =
        "\n  value                      change       +-   of the drawing's\n".to_string();
    let is_frame = |quantity| matches!(quantity, Quantity::Frame(..));
    let parameters = study.model.parameters.iter().enumerate();
    for (k, parameter) in parameters.filter(|(_, p)| !is_frame(p.quantity)) {
        let half = reach * study.found.deviation(k);
        let share = study.found.deviation(k) / parameter.deviation;
        let _ = writeln!(
            text,
            "  {:<24} {:>10.5} {half:>9.5}   {:>3.0} %",
            name(parameter.quantity),
            study.found.changes[k],
            100.0 * share
        );
    }
    text
}

/// Draws the changes of the legs with their intervals.
fn changes(config: &Mechanism, study: &Study) -> Result<Plot, Failure> {
    let reach = Normal::standard().inverse_cdf(0.5 + CONFIDENCE / 2.0);
    let mut groups: Vec<Group> = vec![];
    for (k, parameter) in study.model.parameters.iter().enumerate() {
        let (name, leg) = match parameter.quantity {
            Quantity::Base(leg, axis) => (format!("base {}", AXES[axis]), leg),
            Quantity::Platform(leg, axis) => (format!("platform {}", AXES[axis]), leg),
            Quantity::Length(leg) => ("length".into(), leg),
            _ => continue,
        };
        let bar = Bar {
            number: leg,
            value: study.found.changes[k],
            half: reach * study.found.deviation(k),
        };
        match groups.iter_mut().find(|group| group.name == name) {
            Some(group) => group.bars.push(bar),
            None => groups.push(Group { name, bars: vec![bar] }),
        }
    }
    Ok(of_changes(config.length_unit(), &groups)?)
}

/// Returns the changes that are too large to be written without `--accept`.
fn beyond(arguments: &Arguments, config: &Mechanism, study: &Study) -> Vec<String> {
    let unit = config.length_unit();
    let mut all = vec![];
    for (k, Parameter { quantity, deviation }) in study.model.parameters.iter().enumerate() {
        let most = match (quantity, arguments.threshold) {
            (Quantity::Lead, _) | (_, None) => FAR * deviation,
            (_, Some(threshold)) => threshold,
        };
        let change = study.found.changes[k];
        if quantity.is_of_machine() && !(change.abs() <= most) {
            all.push(format!(
                "{} changes by {change:.4} {unit}, more than {most} {unit} (--threshold): another machine, or a \
                 larger --tolerance",
                name(*quantity)
            ));
        }
    }
    all
}

fn others(config: &Mechanism, study: &Study) -> Vec<String> {
    let Study { found, readings, .. } = study;
    let unit = config.length_unit();
    let left_out = |outlier: &calibrate::fit::Outlier| {
        let name = &readings[outlier.reading].name;
        format!(
            "{name} is left out: it differs from the others by {:.4} {unit}, {:.0} standard deviations",
            outlier.miss, outlier.deviations
        )
    };
    let mut all: Vec<String> = found.outliers.iter().map(left_out).collect();
    if study.held_out > HELD_OUT * expected_held_out(study) {
        all.push(
            "held-out readings fit much worse than those in use: measure at more poses".into(),
        );
    }
    if let Some(Agreement { chi_square, most, foremost, .. }) = study.agreement
        && chi_square > most
    {
        let (number, share) = foremost;
        all.push(format!(
            "the readings fit worse than their deviations and --tolerance allow, chi-square {chi_square:.1} above \
             {most:.1}, {share:.1} of it by {}: measure again, state a larger deviation, or use a larger --tolerance",
            readings[number].name
        ));
    }
    if study.scale.is_off() {
        let DriveScale { change, deviation, .. } = study.scale;
        all.push(format!(
            "the readings fit better if the drives travel {:+.3} % (+- {:.3} %) farther than commanded: measure one length, \
             correct SCALE of the joints, and measure again",
            100.0 * change,
            100.0 * deviation
        ));
    }
    for typed in &study.typed {
        all.extend(of_runs(&typed.sheet));
    }
    all
}

/// Returns the contradictions within a table: readings that are too accurate, and differences between both runs.
fn of_runs(sheet: &Sheet) -> Vec<String> {
    let (scale, stated) = (sheet.gauge.scale, sheet.gauge.deviation);
    let mut all = vec![];
    if sheet.is_too_good() {
        all.push(format!(
            "the readings are closer to the expected ones than the stated deviation of {stated} {scale} \
             allows: check for a copied column expected, or state a smaller deviation"
        ));
    }
    let Some(found) = sheet.scatter() else { return all };
    if found.is_more {
        all.push(format!(
            "the two runs scatter by {:.3} {scale}, more than the stated deviation of {stated} {scale}: using the larger one",
            found.deviation
        ));
    }
    if found.is_copied {
        all.push(
            "both runs have the same reading in every row: check for a copied column, which shows no scatter".into(),
        );
    }
    if found.is_drift {
        all.push(format!(
            "the second run differs by {:+.3} {scale} on average: something has moved or warmed up; measure again",
            found.drift
        ));
    }
    all
}

/// Returns the expected residual of held-out measurements, by the theory of linear least squares: n numbers, minus a
/// fifth, determine r values.
fn expected_held_out(study: &Study) -> f64 {
    let (n, r) = (study.found.residuals.len() as f64, study.rank as f64);
    study.found.rms() * ((1.0 + r / (0.8 * n)) / (1.0 - r / n)).sqrt()
}

fn next(config: &Mechanism, study: &Study, count: usize) -> Result<String, Failure> {
    let poses = study::next_poses(config, study, count)?;
    let mut text = "\n  poses to measure next, best first: tip X Y Z, A B C\n".to_string();
    for pose in poses {
        let words = pose.map(|value| format!("{:>10.3}", value + 0.0));
        let _ = writeln!(text, "  {}", words.concat());
    }
    Ok(text)
}

/// Returns the result for JSON.
fn for_programs(
    config: &Mechanism,
    study: &Study,
    written: Option<&PathBuf>,
    concerns: &[String],
) -> Value {
    let Study { model, readings, found, .. } = study;
    let reach = Normal::standard().inverse_cdf(0.5 + CONFIDENCE / 2.0);
    let value = |(k, parameter): (usize, &Parameter)| {
        json!({
            "name": name(parameter.quantity),
            "change": found.changes[k],
            "half_width": reach * found.deviation(k),
            "share_of_drawing": found.deviation(k) / parameter.deviation,
        })
    };
    let tip = |(before, after): &(Ellipsoid, Ellipsoid)| {
        json!({
            "pose": after.pose.to_degrees(),
            "half_axes": after.half_axes,
            "half_axes_by_drawing": before.half_axes,
        })
    };
    let residuals = json!({ "as_drawn": study.as_drawn, "calibrated": found.rms(), "not_used": study.held_out });
    json!({
        "machine": config.file,
        "readings": readings.len(),
        "numbers": found.residuals.len(),
        "residuals": residuals,
        "noise": found.noise,
        "determined": study.rank,
        "better_than_drawing": study.improved,
        "values": model.parameters.iter().enumerate().map(value).collect::<Vec<_>>(),
        "tip": study.at_tool.iter().flatten().map(tip).collect::<Vec<_>>(),
        "motion": {
            "by_drawing": study.shape[0].expected,
            "expected": study.shape[1].expected,
            "below": study.shape[1].below,
            "not_covered": if study.scale.is_covered() { vec![] } else { vec!["drive-scale"] },
        },
        "drive_scale": {
            "change": study.scale.change,
            "half_width": reach * study.scale.deviation,
            "motion": study.scale.motion,
        },
        "agreement": {
            "chi_square": study.agreement.map(|it| it.chi_square),
            "numbers": study.agreement.map(|it| it.numbers),
            "most": study.agreement.map(|it| it.most),
        },
        "warnings": concerns,
        "written": written,
    })
}
