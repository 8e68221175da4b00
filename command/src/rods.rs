// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm rods`.

use super::failure::{Failure, report_error};
use super::output::Table;
use super::poses::{Source, Stop};
use super::{Bar, MachineFile, StudyFile, Verdict};
use draw::course::Course;
use draw::plot::Plot;
use draw::rods::of_rods;
use kinematics::Vector3;
use machine::read::columns::{coordinates, joint_names};
use machine::read::mechanism::Mechanism;
use std::path::PathBuf;
use studies::study::rods::{Rods, View};

/// Report the positions of the legs along a program or list of poses
///
/// Writes CSV to standard output, one row per pose: joint values; for every leg both ends (the
/// base end moves with its carriage or arm), length, elevation above the XY plane, azimuth about
/// Z, the angle at both joints to its direction at home, and the angle to its guide; the angles
/// between all legs; the gap between the two nearest legs with their numbers; and points of the
/// platform. Units: machine units and degrees. The gap is the distance between center lines minus
/// `rod_diameter_mm` of the study file.
///
/// Exit status: 0, 1 if a pose has no joint values (reported on standard error), 2 if input or
/// output failed.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    source: Source,
    /// Platform point to follow, in the platform frame; repeatable
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    point: Vec<f64>,
    #[command(flatten)]
    study: StudyFile,
    /// Also draw angles, gaps and points as SVG files into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_constrained()?;
    let study = arguments.study.read()?;
    let diameter = study.legs.rod_diameter_mm.map_or(0.0, |d| d.0 * config.units_per_mm);
    let points = arguments.point.chunks(3).map(Vector3::from_column_slice).collect();
    let view = View::new(&config, points, diameter);
    let mut source = arguments.source.read(&config)?;
    let mut message: Vec<String> = source.end.take().into_iter().collect();
    let (mut seen, count) = (vec![], source.stops.len());
    let bar = Bar::new("measuring the rods");
    for (n, stop) in source.stops.iter().enumerate() {
        bar.set(n as f64 / count as f64);
        match view.at(&stop.pose, &stop.tool) {
            Ok(rods) => seen.push((*stop, rods)),
            Err(fault) => message.push(format!("line {}: {fault}", stop.line)),
        }
    }
    if let Some(folder) = arguments.plots.as_ref().filter(|_| !seen.is_empty()) {
        let course = match source.is_program {
            true => Course::in_time(seen.iter().map(|(stop, _)| stop.time).collect()),
            false => Course::by_number(seen.len()),
        };
        let rods: Vec<Rods> = seen.iter().map(|(_, rods)| rods.clone()).collect();
        Plot::write_all(&of_rods(&config, &course, &rods)?, folder)?;
    }
    drop(bar);
    for text in &message {
        report_error(text);
    }
    write_rows(&config, &view, &seen)?;
    Ok(if message.is_empty() { Verdict::Fits } else { Verdict::Misfit })
}

fn write_rows(config: &Mechanism, view: &View, seen: &[(Stop, Rods)]) -> Result<(), Failure> {
    let names = [
        vec!["time".into(), "line".into()],
        coordinates(),
        joint_names(config.joints.len()),
        view.names(),
    ];
    let mut table = Table::new(names.concat())?;
    for (stop, rods) in seen {
        let joints = config.machine.inverse(&stop.pose, &stop.tool)?;
        let place = [stop.time, stop.line as f64].into_iter().chain(stop.pose.to_degrees());
        let numbers = place.chain(joints.into_iter().take(config.joints.len())).map(Some);
        table.row(numbers.chain(rods.values()).collect())?;
    }
    table.finish(&config.file)
}
