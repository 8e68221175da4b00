// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm scene`.

use super::failure::Failure;
use super::{MachineFile, Verdict, output, write_out};
use machine::scene::Scene;
use serde_json::json;
use std::path::PathBuf;

/// Write the machine as one JSON object, for viewers
///
/// Has what is needed to draw the machine and to move the drawing: anchors, guides, arms, table,
/// limits, cones, unit, and the geometry hash by which a viewer sees that the machine it looks at
/// is another one. No kinematics are needed: lower ends of legs follow from joint values, upper
/// ends from the pose. docs/reference/view.md has the fields and the two formulas.
///
/// Exit status: 0, or 2 where the file describes no machine or the output cannot be written.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Writes the object here instead of to standard output
    #[arg(short, long, value_name = "SCENE.json", value_hint = clap::ValueHint::FilePath)]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let scene = Scene::new(&config);
    write_out(&scene.json(), arguments.output.as_deref())?;
    output::answer(&json!({ "machine": config.file, "scene": scene, "file": arguments.output }))?;
    Ok(Verdict::Fits)
}
