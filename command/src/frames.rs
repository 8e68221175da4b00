// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm frames`.

use super::failure::Failure;
use super::{MachineFile, Verdict, output, write_out};
use check::screws;
use draw::frames::of_machine;
use machine::read::error::MachineError;
use serde_json::json;
use std::path::PathBuf;

/// Draw the machine with its frames and signs
///
/// Draws the machine at [TRAJ]HOME in two views at one scale, as SVG: legs by their numbers at base
/// and platform, the axes of base and platform, which way every joint's value grows, which way tools
/// point, the hands of screws, and what table and other axes do. Compare it with the machine: what
/// is drawn is what the kinematics take the file to say. Machines that are long in Z, as lathes are,
/// lie. docs/guide/frames.md explains the signs.
///
/// Exit status: 0, or 2 where the file describes no machine or the output cannot be written.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Writes the drawing here instead of to standard output
    #[arg(short, long, value_name = "FRAMES.svg", value_hint = clap::ValueHint::FilePath)]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let machine = &arguments.machine;
    // A file whose boxes are still those of another geometry is looked at all the same.
    let config = machine.meant(machine.read_without_boxes()?)?;
    let home = config.machine.at(&config.home_pose(), &config.spindle);
    let home =
        home.map_err(|fault| MachineError::of_geometry(&config.ini, &config.place, fault))?;
    let hands = screws::hands(&config, &home);
    let drawing = of_machine(&config, &home, &hands)?;
    write_out(&drawing, arguments.output.as_deref())?;
    output::answer(
        &json!({ "machine": config.file, "file": arguments.output, "drawing": drawing }),
    )?;
    Ok(Verdict::Fits)
}
