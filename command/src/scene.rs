// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm scene`.

use super::failure::Failure;
use super::{MachineFile, Verdict, output, write_out};
use machine::scene::Scene;
use serde_json::json;
use std::path::PathBuf;

/// Write the machine as one JSON object, for viewers
///
/// The object has everything needed to draw and move the machine: anchors, guides, arms, table,
/// limits, cones, unit, and the geometry hash, with which a viewer detects that it watches
/// another machine. A viewer needs no kinematics: lower ends of legs follow from joint values,
/// upper ends from the pose. `pkm help reference/view` describes the fields and the two formulas.
///
/// Exit status: 0, or 2 if the file describes no machine or the output cannot be written.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Write the object here instead of to standard output
    #[arg(short, long, value_name = "SCENE.json", value_hint = clap::ValueHint::FilePath)]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_constrained()?;
    let scene = Scene::new(&config);
    write_out(&scene.json(), arguments.output.as_deref())?;
    output::answer(&json!({ "machine": config.file, "scene": scene, "file": arguments.output }))?;
    Ok(Verdict::Fits)
}
