// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm frames`.

use super::failure::Failure;
use super::{MachineFile, Verdict, output, write_out};
use check::screws;
use draw::frames::of_machine;
use machine::read::error::MachineError;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use serde_json::json;
use std::path::PathBuf;

/// Draw the machine with its frames and signs
///
/// Draws the machine at [TRAJ]HOME in two views at one scale, as SVG: the numbered legs at base
/// and platform, the axes of base and platform, the positive direction of every joint, the
/// direction of the tool, the hands of the screws, and the motion of table and other axes.
/// Compare the drawing with the machine: it shows how the kinematics interpret the file. Machines
/// that are long in Z, such as lathes, are drawn lying down. `pkm help guide/frames` explains the
/// signs.
///
/// Exit status: 0, or 2 if the file describes no machine or the output cannot be written.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Write the drawing here instead of to standard output
    #[arg(short, long, value_name = "FRAMES.svg", value_hint = clap::ValueHint::FilePath)]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let machine = &arguments.machine;
    // A file with boxes of another geometry is accepted.
    let ini = Ini::read(&machine.machine)?;
    let config = machine.meant(MachineConfig::leniently(&ini, Some(Lenient::Report))?)?;
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
