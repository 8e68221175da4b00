// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm path`.

use super::failure::{Failure, refused};
use super::{Bar, MachineFile, Verdict, output, write_out};
use draw::curve::{of_carriages, of_job, of_route};
use draw::plot::{DrawError, Plot};
use machine::files::{check_writable, write_whole};
use machine::read::mechanism::Mechanism;
use paths::carriages;
use paths::file::PathFile;
use paths::job::{self, Job, job};
use paths::route::{Route, route};
use paths::table::csv;
use paths::whole::MovedStart;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A curve that is longer in space than in x and y by a smaller share counts as level.
const LEVEL: f64 = 1e-9;

/// Write programs along curves, and report the joint motion
///
/// Reads a curve from a TOML file: a pair of one-parametric families, x = f(t) and y = g(t) or
/// alpha(x, y, t) = 0 and beta(x, y, t) = 0; an equation F(x, y) = 0; or control points, a DXF or
/// SVG drawing; with laws for height, tilt and speed. If the machine can follow the path,
/// the program goes to standard output or to --output; its distance from the curve is proved to
/// be below chord_mm. Turning points of t are reported; a singular point is refused with its
/// position.
///
///     [parameters]
///     h = 16
///     [curve]
///     x_mm = "h*(t - sin(t))"      # or alpha, beta and start_mm, or f and start_mm
///     y_mm = 0
///     t = [0, "2*pi"]
///     [laws]                       # of t, s (arc length, mm), u (fraction of it), x, y, z
///     z_mm = "h*(1 - cos(t))"
///     b_deg = "-15*cos(t/2)"
///     speed_mm_per_s = 20
///     [tolerance]
///     chord_mm = 0.005
///     angle_deg = 0.01
///     [program]
///     zero_mm = [0, 0, 160]        # of the workpiece, in machine coordinates
///     tool = 1
///     spindle_rpm = 6000
///     clear_z_mm = 40
///     moves = "arcs"               # or "lines"
///
/// A drawing replaces x_mm, y_mm and t; arcs stay arcs, splines stay splines:
///
///     [curve]
///     dxf = "part.dxf"             # or svg; or points, a CSV file of control points
///     dxf_layer = "CUT"
///
/// Conversely, laws of the joints give the path of the tool, as CSV:
///
///     [carriages]
///     t_s = [0, 6]
///     laws_mm_or_deg = ["810 + 5*sin(t)", ...] # one per joint
///
/// Common operations, from zigzag to drill, are given as [[operation]].
///
/// Expressions have + - * / ^, sin cos tan asin acos atan atan2 sinh cosh tanh asinh exp ln sqrt,
/// pi and the names in [parameters]; angles are in radians. `pkm help studies/paths` lists all keys.
///
/// Exit status: 0, or 2 if the file describes no path that the machine can follow; then nothing
/// is written.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// TOML file that describes the path
    #[arg(value_name = "PATH.toml", value_hint = clap::ValueHint::FilePath)]
    path: PathBuf,
    /// Write the program here instead of to standard output
    #[arg(short, long, value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath)]
    output: Option<PathBuf>,
    /// Write a table with a row for the end of every move, and for points along a long line: t, arc
    /// length, pose, tangent, joints, their rates at the programmed speed, and the platform's center;
    /// work coordinates in mm and degrees, joints and center in machine units
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
    /// Draw the families with the curve, the split and the joints as SVG files into this folder
    /// (created if needed); for [[operation]], each joint over the length of every operation
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let file = PathFile::read(&arguments.path)?;
    let place = arguments.path.display();
    match (&file.curve, file.operation.is_empty(), &file.carriages) {
        (Some(_), true, None) => {
            let bar = Bar::spinner("finding the path");
            let found = route(&config, &file).map_err(|error| Failure::at(place, error))?;
            let plots = || of_route(&config, &found);
            write(arguments, &found.program, || csv(&config, &found.rows), plots, bar)?;
            report(&found);
            output::answer(&of_program(arguments, &config, &found.program, &route_value(&found)))?;
        }
        (None, true, Some(_)) => return backwards(arguments, &config, &file),
        (None, false, None) => {
            let bar = Bar::spinner("finding the path");
            let found = job(&config, &file).map_err(|error| Failure::at(place, error))?;
            let plots = || of_job(&config, &found);
            write(arguments, &found.program, || job::csv(&config, &found), plots, bar)?;
            report_job(&config, &found);
            let operations = json!({ "operations": found.done.iter().map(|done| json!({
                "name": done.name,
                "length": done.along.last().map_or(0.0, |along| along.length),
            })).collect::<Vec<_>>() });
            output::answer(&of_program(arguments, &config, &found.program, &operations))?;
        }
        _ => {
            let text =
                format!("{place}: expected exactly one of [curve], [[operation]] and [carriages]");
            return Err(refused(text));
        }
    }
    Ok(Verdict::Fits)
}

/// Computes the path of the tool from laws of the joints.
fn backwards(
    arguments: &Arguments,
    config: &Mechanism,
    file: &PathFile,
) -> Result<Verdict, Failure> {
    if arguments.output.is_some() {
        let text = "--output: laws of joints give no program; use --csv for the path of the tool";
        return Err(refused(text));
    }
    let bar = Bar::spinner("finding the path");
    let places = carriages::taken(config, file)
        .map_err(|error| Failure::at(arguments.path.display(), error))?;
    arguments.csv.as_deref().map_or(Ok(()), check_writable)?;
    if let Some(folder) = &arguments.plots {
        Plot::write_all(&of_carriages(config, &places)?, folder)?;
    }
    let text = carriages::csv(config, &places);
    drop(bar);
    write_out(&text, arguments.csv.as_deref())?;
    output::answer(&json!({ "machine": config.file, "path": arguments.path, "table": text }))?;
    Ok(Verdict::Fits)
}

/// Returns a program and its results for JSON.
fn of_program(arguments: &Arguments, config: &Mechanism, text: &str, found: &Value) -> Value {
    let files: Vec<_> = [&arguments.output, &arguments.csv].into_iter().flatten().collect();
    let mut all = json!({
        "machine": config.file,
        "path": arguments.path,
        "program": text,
        "files": files,
    });
    if let (Some(all), Some(found)) = (all.as_object_mut(), found.as_object()) {
        all.extend(found.clone());
    }
    all
}

fn route_value(found: &Route) -> Value {
    let arcs = found.pieces.iter().filter(|piece| piece.arc.is_some()).count();
    json!({
        "lines": found.pieces.len() - arcs,
        "arcs": arcs,
        "deviation_mm": found.pieces.iter().map(|piece| piece.deviation).fold(0.0, f64::max),
        "length_mm": found.length,
        "seconds": found.seconds,
        "turnings": found.curve.turnings.iter().map(|turning| json!({ "t": turning.t, "at": turning.at })).collect::<Vec<_>>(),
        "is_closed": found.curve.is_closed,
        "start_moved_by_mm": found.curve.moved_start.map_or(0.0, |moved| moved.distance),
    })
}

fn write(
    arguments: &Arguments,
    program: &str,
    csv: impl FnOnce() -> String,
    plots: impl FnOnce() -> Result<Vec<Plot>, DrawError>,
    bar: Bar,
) -> Result<(), Failure> {
    let files = [&arguments.csv, &arguments.output];
    files.into_iter().flatten().try_for_each(|file| check_writable(file))?;
    if let Some(folder) = &arguments.plots {
        Plot::write_all(&plots()?, folder)?;
    }
    if let Some(file) = &arguments.csv {
        write_whole(file, &csv())?;
    }
    drop(bar);
    write_out(program, arguments.output.as_deref())
}

/// Reports the changes of the joints by operation (paper 003, figure 8).
fn report_job(config: &Mechanism, job: &Job) {
    let unit = config.length_unit();
    for (n, done) in job.done.iter().enumerate() {
        let Some(end) = done.along.last() else { continue };
        let change = |i: usize| {
            let values = done.along.iter().map(|along| along.change[i]);
            let (low, high) =
                values.fold((0.0_f64, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
            format!("{} {low:.3}..{high:.3}", config.joints[i].name)
        };
        let changes: Vec<String> = (0..config.joints.len()).map(change).collect();
        let changes = changes.join(", ");
        output::remark(&format!("{}: {}, {:.3} {unit}; {changes}", n + 1, done.name, end.length));
    }
}

fn report(found: &Route) {
    let arcs = found.pieces.iter().filter(|piece| piece.arc.is_some()).count();
    let most = found.pieces.iter().map(|piece| piece.deviation).fold(0.0, f64::max);
    output::remark(&format!(
        "{} lines and {arcs} arcs, at most {most:.6} mm from the curve; {:.6} mm long, {:.2} s at \
         the programmed speeds",
        found.pieces.len() - arcs,
        found.length,
        found.seconds
    ));
    // Laws count the length of a plane curve without its height.
    if found.length - found.curve.length > LEVEL * found.length {
        let flat = found.curve.length;
        output::remark(&format!("s, the arc length in x and y, ends at {flat:.6} mm"));
    }
    if let Some(MovedStart { at: [x, y], distance }) = found.curve.moved_start {
        output::remark(&format!(
            "the curve starts at x {x:.6} y {y:.6}, {distance:.6} mm from start_mm, which is not on it"
        ));
    }
    for turning in &found.curve.turnings {
        let [x, y] = turning.at;
        output::remark(&format!("t turns back at t = {:.6}: x {x:.6} y {y:.6}", turning.t));
    }
    if found.curve.is_closed {
        output::remark("the curve is closed");
    }
}
