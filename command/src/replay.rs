// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm replay`.

use super::failure::{Failure, refused, report_error};
use super::output::Table;
use super::{Bar, MachineFile, Verdict, moves};
use draw::motion;
use draw::plot::Plot;
use draw::sample::Sample;
use kinematics::MAX_EXTRA;
use machine::files::Locate;
use machine::read::columns::{coordinates, joint_names};
use machine::read::mechanism::Mechanism;
use program::replay::{Visit, duration_of_all, replay_seen};
use std::path::PathBuf;

/// Write the joint values along a program
///
/// LinuxCNC runs the program in virtual time, with the machine's tool table, parameters and
/// startup code. Every commanded move is followed at its feed, without acceleration and blending,
/// and the kinematics compute the joints of a pose every servo period. Standard output gets CSV:
/// time in seconds, line of the program, pose and joint values, in machine units and degrees.
/// Violated limits are reported on standard error.
///
/// Exit status: 0 if the program stays within all limits, 1 if it does not, 2 if LinuxCNC refuses
/// it or files cannot be read or written.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// The program (- for standard input)
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath, value_parser = super::input::Program)]
    program: PathBuf,
    /// Time between poses [default: [EMCMOT]SERVO_PERIOD]
    #[arg(long, value_name = "SECONDS")]
    period: Option<f64>,
    /// Also draw joint values, speeds and path as SVG files into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
}

/// Shortest time between poses, seconds: far below any servo period.
const SHORTEST_PERIOD: f64 = 1e-6;

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_constrained()?;
    let period = arguments.period.unwrap_or(config.period);
    if !(period >= SHORTEST_PERIOD && period.is_finite()) {
        let text = format!("--period {period}: expected at least {SHORTEST_PERIOD} seconds");
        return Err(refused(text));
    }
    let moves = moves(&config, &arguments.program)?;
    if let Some(folder) = &arguments.plots {
        std::fs::create_dir_all(folder).at(folder)?;
    }
    let joints = joint_names(config.joints.len() + config.extra.len());
    let names = [vec!["time".into(), "line".into()], coordinates(), joints];
    let mut table = Table::new(names.concat())?;
    let mut samples = vec![];
    let mut unwritten = None;
    let whole = duration_of_all(&config, &moves);
    let bar = Bar::new("replaying");
    let replayed = replay_seen(&config, &moves, period, |visit| {
        bar.set(visit.time / whole);
        if unwritten.is_none() {
            unwritten = table.row(row(&config, visit)).err();
        }
        if arguments.plots.is_some() {
            samples.push(sample(&config, visit));
        }
    });
    drop(bar);
    match unwritten {
        Some(error) => return Err(error),
        None => table.finish(&config.file)?,
    }
    let message = match &replayed {
        Ok(replay) => replay.violations(&config),
        Err(fault) => vec![fault.to_string()],
    };
    for text in &message {
        report_error(&format!("{}: {text}", arguments.program.display()));
    }
    if let Some(folder) = arguments.plots.as_ref().filter(|_| !samples.is_empty()) {
        Plot::write_all(&motion::all(&config, &samples)?, folder)?;
    }
    Ok(if message.is_empty() { Verdict::Fits } else { Verdict::Misfit })
}

fn row(config: &Mechanism, visit: &Visit) -> Vec<Option<f64>> {
    let place = [visit.time, f64::from(visit.line)].into_iter().chain(visit.pose);
    let joints = visit.joints.into_iter().take(config.joints.len());
    place.chain(joints).chain(config.extra_of(&visit.world)).map(Some).collect()
}

fn sample(config: &Mechanism, visit: &Visit) -> Sample {
    let mut extra = [0.0; MAX_EXTRA];
    extra.iter_mut().zip(config.extra_of(&visit.world)).for_each(|(to, value)| *to = value);
    Sample {
        time: visit.time,
        in_world: true,
        pose: visit.pose,
        joints: visit.joints,
        motors: visit.joints,
        extra,
        passed: 0.0,
        forward: visit.pose,
        corrections: visit.corrections,
        tool: visit.tool,
        on_work: visit.on_work,
        iterations: 0.0,
        residual: 0.0,
    }
}
