// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stability map`.

use super::super::failure::{Failure, refused};
use super::super::poses::At;
use super::super::{Bar, MachineFile, Verdict, in_words, output};
use super::setup;
use draw::plot::Plot;
use draw::stability::of_depths;
use kinematics::{Letter, Pose};
use machine::files::{csv, write_whole};
use machine::proof::axis_box;
use rayon::prelude::*;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use studies::stability::WORTH;
use studies::stability::floquet::fast_enough;
use studies::study::file::Study;
use studies::study::workspace::Workspace;

/// Map the limit depth over a plane of the workspace
///
/// Computes the limit depth by the zero-order approximation over a plane through a pose, within
/// the axis limits: at one spindle speed, or the minimum over all speeds. Feeds in all
/// directions, every ten degrees, are examined, and the lowest limit counts. Unreachable areas
/// stay empty. Zero order gives a quick overview; use `pkm stability pose` for the result at a
/// pose.
///
/// mm, degrees, 1/min. The last line on standard error reports the poses per second.
///
/// Exit status: 0, or 2 if no point is within the machine's limits, or input or output failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Read masses, springs, dampers and cutting coefficients from this TOML file
    #[arg(long, value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    study: PathBuf,
    #[command(flatten)]
    at: At,
    /// Spindle speed, 1/min [default: all speeds]
    #[arg(long, value_name = "RPM", value_parser = super::positive)]
    rpm: Option<f64>,
    /// Plane of the map: xy, xz or yz
    #[arg(long, value_name = "PLANE", default_value = "xy", value_parser = plane)]
    plane: [usize; 2],
    /// Number of points along each side
    #[arg(long, value_name = "N", default_value_t = 41, value_parser = clap::value_parser!(u16).range(2..=1001))]
    grid: u16,
    /// Write X Y Z and the limit depth as CSV
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
    /// Draw an SVG file into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
}

fn plane(text: &str) -> Result<[usize; 2], String> {
    match text {
        "xy" => Ok([0, 1]),
        "xz" => Ok([0, 2]),
        "yz" => Ok([1, 2]),
        _ => Err("expected xy, xz or yz".into()),
    }
}

/// A position and its limit depth, mm; infinite if every depth is stable.
struct MapPoint {
    position: [f64; 3],
    depth: f64,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let study = Study::read(&arguments.study)?;
    let setup = setup(&config, &study, &arguments.study)?;
    let (pose, tool) = arguments.at.read(&config)?;
    let [_, _, _, a, b, c] = pose.to_degrees();
    let workspace = Workspace::new(&config, tool, vec![[a, b, c]], &study)?;
    let axes = workspace.axes();
    if let Some(k) = arguments.plane.into_iter().find(|k| !axes.contains(k)) {
        let letter = ["X", "Y", "Z"][k];
        return Err(refused(format!(
            "--plane: no joint moves {letter}; choose the plane of the machine"
        )));
    }
    let range = axis_box::range(&config);
    let count = usize::from(arguments.grid);
    let side = |k: usize| -> Vec<f64> {
        let share = |n: usize| n as f64 / (count - 1) as f64;
        (0..count).map(|n| range.low[k] + (range.high[k] - range.low[k]) * share(n)).collect()
    };
    let sides = arguments.plane.map(side);
    if let Some(rpm) = arguments.rpm {
        let at = |error| Failure::at(in_words(&pose), error);
        let feed = pose.rotation().column(0).into_owned();
        fast_enough(&setup.rows(&pose, &tool, &feed).map_err(at)?, &setup.process, rpm)?;
    }
    let bar = Bar::new("limit depths");
    let (start, done) = (Instant::now(), AtomicUsize::new(0));
    let depth = |n: usize| -> Result<Option<f64>, Failure> {
        let mut at = pose;
        at.position[arguments.plane[0]] = sides[0][n % count];
        at.position[arguments.plane[1]] = sides[1][n / count];
        bar.set(done.fetch_add(1, Ordering::Relaxed) as f64 / (count * count) as f64);
        if workspace.check(&at.position).is_err() {
            return Ok(None);
        }
        let found = setup.least(&at, &tool, arguments.rpm);
        let found = found.map_err(|error| Failure::at(in_words(&at), error))?;
        Ok(Some(found.map_or(f64::INFINITY, |limit| limit.depth)))
    };
    let depths: Vec<Option<f64>> =
        (0..count * count).into_par_iter().map(depth).collect::<Result<_, _>>()?;
    let seconds = start.elapsed().as_secs_f64();
    drop(bar);
    let places = places(&pose, arguments.plane, &sides, &depths);
    if places.is_empty() {
        return Err(refused(format!(
            "{}: no point of the map is within the machine's limits; choose another pose with --pose, or \
             review the axis limits with pkm check",
            config.file.display()
        )));
    }
    if let Some(file) = &arguments.csv {
        let header = ["x", "y", "z", "limit_depth_mm"];
        let row = |place: &MapPoint| {
            let [x, y, z] = place.position;
            [x, y, z, place.depth]
        };
        write_whole(file, &csv(&header, places.iter().map(row)))?;
    }
    if let Some(folder) = &arguments.plots {
        let letters = arguments.plane.map(|k| Letter::ALL[k].name());
        let what = arguments.rpm.map_or("all speeds".into(), |rpm| format!("{rpm} 1/min"));
        let values: Vec<f64> = depths.iter().map(|depth| depth.unwrap_or(f64::NAN)).collect();
        let plot = of_depths(letters, config.length_unit(), &sides, &values, &what)?;
        Plot::write_all(&[plot], folder)?;
    }
    report(&config.file, &places, arguments.rpm)?;
    let judged = places.len() as f64;
    let threads = rayon::current_num_threads();
    let rate = judged / seconds;
    output::remark(&format!(
        "{judged} poses in {seconds:.1} s, {rate:.0} a second, threads: {threads}"
    ));
    Ok(Verdict::Fits)
}

fn places(
    pose: &Pose,
    plane: [usize; 2],
    sides: &[Vec<f64>; 2],
    depths: &[Option<f64>],
) -> Vec<MapPoint> {
    let count = sides[0].len();
    let place = |(n, depth): (usize, &Option<f64>)| {
        let mut position: [f64; 3] = pose.position.into();
        (position[plane[0]], position[plane[1]]) = (sides[0][n % count], sides[1][n / count]);
        depth.map(|depth| MapPoint { position, depth })
    };
    depths.iter().enumerate().filter_map(place).collect()
}

fn report(machine: &std::path::Path, places: &[MapPoint], rpm: Option<f64>) -> Result<(), Failure> {
    let mut out = output::people();
    let what = rpm.map_or("over all speeds".into(), |rpm| format!("at {rpm} 1/min"));
    writeln!(out, "{}: limit depth by zero order, worst feed, {what}", machine.display())?;
    let least = places.iter().min_by(|a, b| a.depth.total_cmp(&b.depth));
    let most = places.iter().max_by(|a, b| a.depth.total_cmp(&b.depth));
    for (name, place) in [("least", least), ("most", most)] {
        let Some(MapPoint { position: [x, y, z], depth }) = place else { continue };
        if depth.is_finite() {
            writeln!(out, "  {name:<6} {depth:10.4} mm at X{x:.3} Y{y:.3} Z{z:.3}")?;
        }
    }
    match places.iter().filter(|place| place.depth.is_infinite()).count() {
        0 => {}
        count => writeln!(out, "  every depth is stable at {count} of {} positions", places.len())?,
    }
    writeln!(out, "{WORTH}")?;
    out.flush()?;
    let shown = |MapPoint { position, depth }: &MapPoint| json!({ "position": position, "limit_depth_mm": depth });
    output::answer(&json!({
        "machine": machine,
        "rpm": rpm,
        "least": least.map(shown),
        "most": most.map(shown),
        "places": places.iter().map(shown).collect::<Vec<_>>(),
    }))
}
