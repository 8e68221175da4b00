// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm sensitivity`.

use super::failure::{Failure, refused, report_error};
use super::poses::At;
use super::{Bar, MachineFile, StudyFile, Verdict, in_words, moves, output};
use draw::plot::Plot;
use draw::sensitivity::of_sensitivity;
use kinematics::{Letter, Pose, Vector3};
use machine::files::write_whole;
use machine::proof::axis_box;
use machine::read::mechanism::Mechanism;
use program::replay::replay_seen;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use studies::study::file::{Lacking, Study};
use studies::study::sensitivity::{
    Kind, LENGTH_MM, Point, Sensitivity, along, axis_sigma, csv, monte_carlo, near, ratios,
};

/// Joint errors if the study has none.
const SIGMA_UM: f64 = 10.0;

/// Poses of a motion law, one turn.
const LAW_POSES: usize = 500;

/// Compute the effect of joint errors on the pose, and the conditioning
///
/// At one pose: the motion of each coordinate per unit of each joint; the conditioning (singular
/// values of the Jacobian, with angles times a length); the standard deviation of every
/// coordinate for random joint errors, by covariance and by sampling the forward kinematics, with
/// the largest error if every joint is off by one standard deviation; and the nearest singular
/// poses along random rays from the middle of the axis limits outwards (parallel: the legs do not
/// constrain the platform; serial: a rod is perpendicular to the motion of its lower end;
/// constraint: the constraints cease to determine the dependent coordinates). Along
/// a program or a motion law: joint values, their rates and the standard deviations, as CSV and
/// plots.
///
///     [legs]
///     joint_sigma_um = 10          # or a list, one per leg [default: 10]
///     [law]                        # for --law: a spiral around home
///     period_s = 6.283185307179586
///     radius_mm = 10
///     growth_mm = 20
///     rise_mm = 10
///     bend_mm = 10
///     amplitude_deg = [2, 2, 2]
///
/// Exit status: 0, 1 if the pose is singular or the program leaves the machine's reach, 2 if
/// input or output failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    at: At,
    #[command(flatten)]
    study: StudyFile,
    /// Length that converts angles to lengths, mm
    #[arg(long, value_name = "MM", default_value_t = LENGTH_MM)]
    length: f64,
    /// Number of samples through the forward kinematics
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    draws: usize,
    /// Number of rays of the search for singular poses
    #[arg(long, value_name = "N", default_value_t = 2000)]
    rays: usize,
    /// Extent of the search, in half widths of the axis limits
    #[arg(long, value_name = "FACTOR", default_value_t = 3.0)]
    factor: f64,
    /// Also follow this program
    #[arg(long, value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath, value_parser = super::input::Program, conflicts_with = "law")]
    along: Option<PathBuf>,
    /// Also follow the motion law of the study file
    #[arg(long)]
    law: bool,
    /// Print the ratios of rates at this time of the motion, as tabulated in paper 001; they are
    /// not partial derivatives and hold only along this path
    #[arg(long, value_name = "SECONDS")]
    ratios: Option<f64>,
    /// Write the results along the motion as CSV
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
    /// Draw SVG files into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_constrained()?;
    let study = arguments.study.read()?;
    let (pose, tool) = arguments.at.read(&config)?;
    check(arguments)?;
    let sigma = sigma(arguments, &config, &study)?;
    let length = arguments.length * config.units_per_mm;
    let found = Sensitivity::at(&config, &pose, &tool, length)
        .map_err(|fault| Failure::at(in_words(&pose), fault))?;
    let Some(found) = found else {
        let text = format!(
            "{}: singular pose: the legs do not constrain the platform; choose another pose",
            in_words(&pose)
        );
        report_error(&text);
        return Ok(Verdict::Misfit);
    };
    let (points, end) = motion(arguments, &config, &study, &tool, &sigma, length)?;
    if let Some(file) = &arguments.csv {
        write_whole(file, &csv(&config, &points))?;
    }
    if let Some(folder) = &arguments.plots {
        let plots = of_sensitivity(&config, &found, &sigma, &points)?;
        Plot::write_all(&plots, folder)?;
    }
    let mut answer = report(arguments, &config, &pose, &tool, &found, &sigma)?;
    answer["ratios"] = report_ratios(arguments, &config, &points)?;
    output::answer(&answer)?;
    if let Some(text) = &end {
        report_error(&text);
    }
    Ok(if end.is_none() { Verdict::Fits } else { Verdict::Misfit })
}

fn check(arguments: &Arguments) -> Result<(), Failure> {
    let positive = [("--length", arguments.length), ("--factor", arguments.factor)];
    for (name, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(refused(format!("{name} {value}: expected more than 0")));
        }
    }
    let moves = arguments.law || arguments.along.is_some();
    if !moves && (arguments.csv.is_some() || arguments.ratios.is_some()) {
        let text = "--csv and --ratios need a motion: add --along PROGRAM.ngc or --law";
        return Err(refused(text));
    }
    match arguments.draws {
        0 | 1 => Err(refused(format!("--draws {}: expected 2 or more", arguments.draws))),
        _ => Ok(()),
    }
}

fn sigma(arguments: &Arguments, config: &Mechanism, study: &Study) -> Result<Vec<f64>, Failure> {
    let named = |lacking: Lacking| match &arguments.study.study {
        Some(file) => Failure::at(file.display(), lacking),
        None => lacking.into(),
    };
    if let Some(sigma) = study.joint_sigma(config).map_err(named)? {
        return Ok(sigma);
    }
    let text =
        format!("[legs]\njoint_sigma_um = {SIGMA_UM:?}\n[table]\njoint_sigma_um = {SIGMA_UM:?}\n");
    let usual = Study::parse(&text)?;
    Ok(usual.joint_sigma(config)?.unwrap_or_default())
}

/// One pose of a motion.
struct Step {
    time: f64,
    pose: [f64; 6],
    rate: [f64; 6],
    tool: Vector3<f64>,
}

/// Computes the results along the motion, and why it ends early.
fn motion(
    arguments: &Arguments,
    config: &Mechanism,
    study: &Study,
    tool: &Vector3<f64>,
    sigma: &[f64],
    length: f64,
) -> Result<(Vec<Point>, Option<String>), Failure> {
    let (steps, mut end) = match &arguments.along {
        Some(program) => of_program(config, program)?,
        None if arguments.law => (of_law(config, study, tool, arguments.ratios)?, None),
        None => return Ok((vec![], None)),
    };
    let mut points = vec![];
    let (bar, count) = (Bar::new("along the motion"), steps.len());
    for step in steps {
        bar.set(points.len() as f64 / count as f64);
        let motion = (&step.pose, &step.rate);
        match along(config, step.time, motion, &step.tool, sigma, length) {
            Ok(point) => points.push(point),
            Err(error) => {
                end = Some(error.to_string());
                break;
            }
        }
    }
    Ok((points, end))
}

/// Returns one turn of the motion law, evenly spaced, and the requested time.
fn of_law(
    config: &Mechanism,
    study: &Study,
    tool: &Vector3<f64>,
    asked: Option<f64>,
) -> Result<Vec<Step>, Failure> {
    let missing = || {
        refused(
            "--law: the study file has no section [law]; see pkm help sensitivity for an example",
        )
    };
    let law = study.law.as_ref().ok_or_else(missing)?;
    let even = (0..=LAW_POSES).map(|k| law.period_s.0 * k as f64 / LAW_POSES as f64);
    let mut times: Vec<f64> = even.chain(asked).collect();
    times.retain(|time| (0.0..=law.period_s.0).contains(time));
    times.sort_by(f64::total_cmp);
    times.dedup();
    let step = |time: f64| {
        let (pose, rate) = law.at(config, time);
        Step { time, pose, rate, tool: *tool }
    };
    Ok(times.into_iter().map(step).collect())
}

fn of_program(config: &Mechanism, program: &Path) -> Result<(Vec<Step>, Option<String>), Failure> {
    let moves = moves(config, program)?;
    let mut steps = vec![];
    let mut before = config.home;
    let replayed = replay_seen(config, &moves, config.period, |visit| {
        let rate = std::array::from_fn(|k| (visit.pose[k] - before[k]) / config.period);
        before = visit.pose;
        steps.push(Step { time: visit.time, pose: visit.pose, rate, tool: visit.tool.into() });
    });
    Ok((steps, replayed.err().map(|fault| format!("{}: {fault}", program.display()))))
}

fn report(
    arguments: &Arguments,
    config: &Mechanism,
    pose: &Pose,
    tool: &Vector3<f64>,
    found: &Sensitivity,
    sigma: &[f64],
) -> Result<Value, Failure> {
    let bar = Bar::spinner("sampling joint errors");
    let drawn = monte_carlo(config, pose, tool, sigma, arguments.draws)
        .map_err(|fault| Failure::at(in_words(pose), fault))?;
    bar.say("searching for singular poses".into());
    let range = axis_box::range(config);
    let near = near(config, &range, tool, arguments.rays, arguments.factor);
    drop(bar);
    let unit = config.length_unit();
    let mut out = output::people();
    writeln!(out, "{} at {}", config.file.display(), in_words(pose))?;
    let [most, least] = found.singular_values;
    writeln!(
        out,
        "  singular values  {most:.4} to {least:.4}, angles times {} mm",
        arguments.length
    )?;
    writeln!(out, "  condition        {:.2}", most / least)?;
    writeln!(out, "  determinant      {:.4}", found.determinant)?;
    writeln!(out, "\nper joint unit: X Y Z in {unit}, A B C in degrees")?;
    let row = |name: &str, values: [f64; 6]| {
        let cells: Vec<String> = values.iter().map(|x| format!("{:>13.6}", x + 0.0)).collect();
        format!("  {name:<15}{}", cells.concat())
    };
    for (j, joint) in config.joints.iter().enumerate() {
        writeln!(out, "{}", row(&joint.name, std::array::from_fn(|i| found.gain[(i, j)])))?;
    }
    let spread: Vec<String> = sigma.iter().map(|s| format!("{s:.6}")).collect();
    writeln!(out, "\nfor errors of the joints with standard deviations {}", spread.join(" "))?;
    writeln!(out, "{}", row("covariance", found.sigma(sigma)))?;
    writeln!(out, "{}", row(&format!("{} samples", drawn.count), drawn.sigma))?;
    writeln!(out, "{}", row("largest", found.worst(sigma)))?;
    let axis = axis_sigma(found, sigma);
    writeln!(
        out,
        "  spindle axis     {:.6} and {:.6} degrees in two directions; off by {:.6}, {} samples {:.6} (root mean square)",
        axis[0],
        axis[1],
        axis[0].hypot(axis[1]),
        drawn.count,
        drawn.axis
    )?;
    writeln!(
        out,
        "\nsingular poses on {} rays to {} times the axis limits",
        near.rays, arguments.factor
    )?;
    let mut singular = vec![];
    let is_bound = config.machine.layout().constraints() > 0;
    let kinds =
        [Kind::Parallel, Kind::Serial].into_iter().chain(is_bound.then_some(Kind::Constraint));
    for kind in kinds {
        let name = match kind {
            Kind::Parallel => "parallel",
            Kind::Serial => "serial",
            Kind::Constraint => "constraint",
        };
        let nearest = near.nearest.iter().find(|found| found.kind == kind);
        singular.extend(
            nearest.map(|found| json!({ "kind": name, "reach": found.reach, "pose": found.pose })),
        );
        match nearest {
            Some(found) => writeln!(
                out,
                "  {name:<15}  at {:.3} times the limits: {}",
                found.reach,
                in_words(&Pose::from_degrees(found.pose))
            )?,
            None => writeln!(out, "  {name:<15}  none found")?,
        }
    }
    writeln!(out, "  conditioning     {:.4} at least on the rays within the limits", near.least)?;
    out.flush()?;
    let gain = |j: usize| -> [f64; 6] { std::array::from_fn(|i| found.gain[(i, j)]) };
    Ok(json!({
        "machine": config.file,
        "pose": pose.to_degrees(),
        "singular_values": found.singular_values,
        "determinant": found.determinant,
        "per_joint_unit": (0..config.joints.len()).map(gain).collect::<Vec<_>>(),
        "joint_sigma": sigma,
        "sigma_by_covariance": found.sigma(sigma),
        "draws": drawn.count,
        "sigma_by_draws": drawn.sigma,
        "all_together": found.worst(sigma),
        "axis_sigma_deg": axis,
        "axis_rms_by_draws_deg": drawn.axis,
        "rays": near.rays,
        "singular_poses": singular,
        "least_conditioning": near.least,
    }))
}

fn report_ratios(
    arguments: &Arguments,
    config: &Mechanism,
    points: &[Point],
) -> Result<Value, Failure> {
    let Some(time) = arguments.ratios else { return Ok(Value::Null) };
    let nearest =
        points.iter().min_by(|a, b| (a.time - time).abs().total_cmp(&(b.time - time).abs()));
    let Some(point) = nearest else { return Ok(Value::Null) };
    let mut out = output::people();
    writeln!(
        out,
        "\nratios of rates at {} s along this motion, joint by coordinate: no partial derivatives;\n\
         of rank 1 on any machine, infinite where a coordinate stands still;\n\
         in joint units per {} for X Y Z, per degree for A B C",
        point.time,
        config.length_unit()
    )?;
    let letters: String = Letter::ALL.iter().map(|l| format!("{:>13}", l.name())).collect();
    writeln!(out, "{:<17}{letters}", "")?;
    let count = config.joints.len();
    let rows = ratios(&point.rates[..count], &point.rate);
    for (joint, row) in config.joints.iter().zip(&rows) {
        let cells: String = row.iter().map(|x| format!("{x:>13.4}")).collect();
        writeln!(out, "  {:<15}{cells}", joint.name)?;
    }
    out.flush()?;
    Ok(json!({ "seconds": point.time, "joints_by_coordinates": rows }))
}
