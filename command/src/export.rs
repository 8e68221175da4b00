// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm export`.

use super::failure::Failure;
use super::{MachineFile, Verdict, output};
use export::folder::{Format, write};
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use studies::study::file::Study;

/// Write the machine as a model for simulators
///
/// Writes rigid bodies, joints with their limits, and the loops that the legs close: MJCF for
/// MuJoCo, SDF for Gazebo, URDF for ROS and Pinocchio. URDF has no loops; a second file lists
/// them. A strut with a screw becomes a thread between two universal joints, so that the change
/// of length by nut rotation comes from the mechanism. Each constraint of the platform becomes a
/// light passive body. Without --study, masses are those of solid steel bars. Every folder gets a
/// README with parameters, idealizations and what was left out.
///
/// The model opens assembled at [TRAJ]HOME; `pkm joints --passive` computes its joint values at
/// other poses. `pkm help guide/simulators` has examples.
///
/// Exit status: 0, or 2 if the file describes no machine, a folder holds another model, or the
/// output cannot be written.
#[derive(clap::Args, Debug)]
#[command(group = clap::ArgGroup::new("formats").required(true).multiple(true))]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Write an MJCF model for MuJoCo into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath, group = "formats")]
    mjcf: Option<PathBuf>,
    /// Write an SDF model for Gazebo into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath, group = "formats")]
    sdf: Option<PathBuf>,
    /// Write a URDF model, and its loops as JSON, into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath, group = "formats")]
    urdf: Option<PathBuf>,
    /// Read masses and the ratings of the drives from this TOML file
    #[arg(long, value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    study: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_named_constrained()?;
    let study = arguments.study.as_deref().map(Study::read).transpose()?;
    let model = export::assemble::model(&config, study.as_ref())
        .map_err(|error| Failure::at(config.file.display(), error))?;
    let (mut files, mut left_out) = (vec![], model.left_out.clone());
    for (format, folder) in [
        (Format::Mjcf, &arguments.mjcf),
        (Format::Sdf, &arguments.sdf),
        (Format::Urdf, &arguments.urdf),
    ] {
        if let Some(folder) = folder {
            let written = write(&model, &config, format, folder)?;
            left_out.extend(written.left_out);
            files.extend(written.files);
        }
    }
    // Formats in one folder share a README.
    files.sort();
    files.dedup();
    let mut out = output::people();
    files.iter().try_for_each(|file| writeln!(out, "{}", file.display()))?;
    writeln!(out, "masses: {}", model.masses)?;
    for left in &left_out {
        writeln!(out, "left out: {left}")?;
    }
    output::answer(&json!({
        "machine": config.file,
        "files": files,
        "masses": model.masses,
        "left_out": left_out,
    }))?;
    Ok(Verdict::Fits)
}
