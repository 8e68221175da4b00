// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stiffness`.

use super::failure::{Failure, refused, report_error};
use super::poses::At;
use super::{Bar, MachineFile, Verdict, in_words, output};
use draw::ellipsoid::of_ellipsoids;
use draw::plot::Plot;
use draw::stiffness::{of_platform_sizes, of_stiffness};
use kinematics::{Pose, Vector3};
use machine::files::{Locate, csv};
use machine::proof::axis_box;
use machine::read::mechanism::Mechanism;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use studies::study::file::Study;
use studies::study::map::Map;
use studies::study::springs::Springs;
use studies::study::stiffness::{Ellipsoid, Stiffness, with_platform};
use studies::study::workspace::Workspace;

/// Compared factors of the platform's size.
const SIZES: [f64; 7] = [0.4, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0];

/// Compute the stiffness at the tool tip
///
/// Reads the stiffness of every leg (joints, rod and drive in series, as one value or two) and of
/// the table's axes from a study file. Reports at one pose: the 6 by 6 stiffness matrix at the
/// tool tip; the principal axes of displacement under a force and of rotation under a moment; and
/// how the smallest of them change with the size of the platform. --plots draws both ellipsoids,
/// and maps of both over the axis limits, in three planes through the pose (in its own plane on a
/// planar machine); unreachable areas stay empty.
///
/// N/um, N m/rad, mm, degrees; machine axes. Coordinates constrained by guides count as rigid, and
/// so do passive joints and passive legs behind [CONSTRAINT_N]: they carry load without yielding.
///
/// With the motors held, an axial force turns the screw of its strut against both cardan joints.
/// `screw = "self-locking"` assigns that torque to friction in the thread.
///
///     [legs]
///     stiffness_n_per_um = 10      # or a list, one per leg; or the keys of rod and drive of
///                                  # `pkm dynamics`
///     screw = "backdrivable"       # or "self-locking"
///     [table]                      # if the machine has one
///     stiffness_n_per_um = 50
///
/// Exit status: 0, 1 if the pose is singular, 2 if input or output failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Read stiffnesses from this TOML file
    #[arg(long, value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    study: PathBuf,
    #[command(flatten)]
    at: At,
    /// Draw ellipsoids and maps as SVG files into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
    /// Write the maps as CSV
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
    /// Number of points along each side of a map
    #[arg(long, value_name = "N", default_value_t = 41, value_parser = clap::value_parser!(u16).range(2..=1001))]
    grid: u16,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_constrained()?;
    let study = Study::read(&arguments.study)?;
    let springs = Springs::of(&config, &study).at(&arguments.study)?;
    let (pose, tool) = arguments.at.read(&config)?;
    let found = Stiffness::at(&config, &pose, &tool, &springs)
        .map_err(|fault| Failure::at(in_words(&pose), fault))?;
    let Some(found) = found else {
        let text = format!(
            "{}: singular pose: the legs do not constrain the platform; choose another pose",
            in_words(&pose)
        );
        report_error(&text);
        return Ok(Verdict::Misfit);
    };
    if arguments.plots.is_some() || arguments.csv.is_some() {
        draw(arguments, &config, &study, &pose, &tool, &springs, &found)?;
    }
    report(&config, &pose, &found, &sizes(&config, &pose, &tool, &springs))?;
    Ok(Verdict::Fits)
}

fn draw(
    arguments: &Arguments,
    config: &Mechanism,
    study: &Study,
    pose: &Pose,
    tool: &Vector3<f64>,
    springs: &Springs,
    found: &Stiffness,
) -> Result<(), Failure> {
    let [_, _, _, a, b, c] = pose.to_degrees();
    let workspace = Workspace::new(config, *tool, vec![[a, b, c]], study)?;
    let range = axis_box::range(config);
    let map = |[across, up]: [usize; 2]| {
        let reached = |place: &Vector3<f64>| workspace.check(place).is_ok();
        let at = |pose: &Pose| Stiffness::at(config, pose, tool, springs).ok().flatten();
        Map::over(pose, [across, up], [&range.low, &range.high], arguments.grid.into(), |pose| {
            let found = at(pose).filter(|_| reached(&pose.position))?;
            let ([push, turn], [x, y, z, a, b, c]) = (found.least(), found.along());
            Some([push, turn, x, y, z, a, b, c])
        })
    };
    let bar = Bar::new("mapping");
    let planes = workspace.planes();
    let mapped = |(done, plane): (usize, &[usize; 2])| {
        bar.set(done as f64 / planes.len() as f64);
        map(*plane)
    };
    let maps: Vec<Map<8>> = planes.iter().enumerate().map(mapped).collect();
    drop(bar);
    if maps.iter().all(Map::is_empty) {
        return Err(refused(format!(
            "{}: no point of the maps is within the machine's limits; choose another pose with --pose, or \
             review the axis limits with pkm check",
            config.file.display()
        )));
    }
    let mut files = vec![];
    if let Some(file) = &arguments.csv {
        let least = ["translation_n_per_um", "rotation_n_m_per_rad"].map(String::from);
        let along = ["x", "y", "z"].map(|axis| format!("along_{axis}_n_per_um"));
        let about = ["x", "y", "z"].map(|axis| format!("about_{axis}_n_m_per_rad"));
        let header = ["x", "y", "z"].map(String::from).into_iter();
        let header: Vec<String> = header.chain(least).chain(along).chain(about).collect();
        let rows = maps.iter().flat_map(Map::rows).map(|(place, values)| {
            place.into_iter().chain(values.map(|value| value * 1e-3)).collect::<Vec<_>>()
        });
        files.push((file.clone(), csv(&header, rows)));
    }
    let mut plots = vec![];
    if arguments.plots.is_some() {
        for map in &maps {
            plots.extend(of_stiffness(config, map)?);
        }
        plots.push(of_platform_sizes(&sizes(config, pose, tool, springs))?);
        plots.extend(of_ellipsoids(found)?);
    }
    Ok(Plot::write_with(&plots, arguments.plots.as_deref(), files)?)
}

/// Returns factor, and the smallest stiffness of translation and rotation, if the scaled machine is valid.
fn sizes(
    config: &Mechanism,
    pose: &Pose,
    tool: &Vector3<f64>,
    springs: &Springs,
) -> Vec<(f64, [f64; 2])> {
    let of = |factor: f64| {
        let config = with_platform(config, factor).ok()?;
        let found = Stiffness::at(&config, pose, tool, springs).ok()??;
        Some((factor, found.least()))
    };
    SIZES.into_iter().filter_map(of).collect()
}

/// Formats a stiffness with decimals.
fn shown(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}") } else { "rigid".into() }
}

fn report(
    config: &Mechanism,
    pose: &Pose,
    found: &Stiffness,
    sizes: &[(f64, [f64; 2])],
) -> Result<(), Failure> {
    let mut out = output::people();
    writeln!(out, "{} at {}", config.file.display(), in_words(pose))?;
    match &found.matrix {
        Some(matrix) => {
            writeln!(out, "\nmatrix at the tool tip: N/mm, N/rad; N mm/mm, N mm/rad")?;
            for i in 0..6 {
                let cell = |k: usize| {
                    let size = (matrix[(i, i)] * matrix[(k, k)]).sqrt();
                    // A value that rounds to 0 is shown as 0.
                    let value =
                        if matrix[(i, k)].abs() > 1e-12 * size { matrix[(i, k)] } else { 0.0 };
                    format!("{value:>15.6e}")
                };
                writeln!(out, "{}", (0..6).map(cell).collect::<String>())?;
            }
        }
        None => writeln!(out, "\nGuides constrain some coordinates: there is no 6 by 6 matrix.")?,
    }
    for (name, unit, scale, ellipsoid) in [
        ("displacement under a force", "N/um", 1e-3, found.translation()),
        ("rotation under a moment", "N m/rad", 1e-3, found.rotation()),
    ] {
        let Ellipsoid { stiffness, axes } = ellipsoid;
        writeln!(out, "\n{name}: stiffness in {unit} along")?;
        for (k, value) in stiffness.iter().enumerate() {
            let axis = axes.column(k);
            let value = shown(value * scale, 3);
            writeln!(out, "{value:>16}  {:8.4} {:8.4} {:8.4}", axis[0], axis[1], axis[2])?;
        }
    }
    let along = found.along().map(|value| value * 1e-3);
    let row = |values: &[f64], decimals: usize| -> String {
        values.iter().map(|value| format!("{:>13}", shown(*value, decimals))).collect()
    };
    writeln!(out, "\nstiffness along X Y Z in N/um, about X Y Z in N m/rad")?;
    writeln!(out, "   {}\n   {}", row(&along[..3], 3), row(&along[3..], 1))?;
    writeln!(out, "\nsize of the platform: smallest stiffness in N/um, in N m/rad")?;
    for (factor, [translation, rotation]) in sizes {
        let [translation, rotation] = [shown(translation * 1e-3, 3), shown(rotation * 1e-3, 1)];
        writeln!(out, "{factor:>16}  {translation:>12} {rotation:>12}")?;
    }
    out.flush()?;
    let ellipsoid = |Ellipsoid { stiffness, axes }: Ellipsoid| {
        let axis = |k: usize| json!({ "stiffness": stiffness[k] * 1e-3, "axis": axes.column(k).as_slice() });
        (0..3).map(axis).collect::<Vec<_>>()
    };
    let size = |(factor, [translation, rotation]): &(f64, [f64; 2])| {
        json!({
            "factor": factor,
            "translation_n_per_um": translation * 1e-3,
            "rotation_n_m_per_rad": rotation * 1e-3,
        })
    };
    let rows = |matrix: &nalgebra::Matrix6<f64>| -> Vec<Vec<f64>> {
        matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
    };
    output::answer(&json!({
        "machine": config.file,
        "pose": pose.to_degrees(),
        "matrix": found.matrix.as_ref().map(rows),
        "translation_n_per_um": ellipsoid(found.translation()),
        "rotation_n_m_per_rad": ellipsoid(found.rotation()),
        "along_n_per_um": &along[..3],
        "about_n_m_per_rad": &along[3..],
        "platform_sizes": sizes.iter().map(size).collect::<Vec<_>>(),
    }))
}
