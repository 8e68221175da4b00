// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm boxes`.

use super::failure::{Failure, tell_error};
use super::{Bar, MachineFile, Verdict};
use pkm::proof::boxes as proof;
use pkm::proof::one_to_one::Doubt;
use pkm::read::boxes;
use pkm::read::machine::MachineConfig;
use std::io::Write;

/// Finds and proves boxes of poses for the start without a seed
///
/// With boxes= in [KINS]KINEMATICS every [BOX_K] section of the file is proved again: that on its
/// poses no two have the same joint values. Without, boxes that fill the axis limits are sought
/// and proved; standard output gets their sections, to be put into the file, and the number for
/// boxes=. That takes seconds to minutes.
///
/// Exit status: 0 where all boxes are proved, 1 where one is not or none is found, 2 where the
/// file describes no machine.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
}

/// Why there is no proof.
#[derive(Debug, thiserror::Error)]
enum Unproved {
    /// Of any box.
    #[error(transparent)]
    Search(#[from] Doubt),
    /// Of a section of the file.
    #[error("[{0}] {1}")]
    Section(String, Doubt),
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_all()?;
    let mut verdict = Verdict::Fits;
    for mechanism in config.mechanisms() {
        verdict = verdict.max(of_mechanism(mechanism)?);
    }
    Ok(verdict)
}

fn of_mechanism(config: &MachineConfig) -> Result<Verdict, Failure> {
    let bar = Bar::spinner("looking for a proof");
    let result = if config.boxes.is_empty() { found(config) } else { proved(config) };
    drop(bar);
    match result {
        Ok(text) => {
            let mut out = std::io::stdout().lock();
            write!(out, "{text}")?;
            out.flush()?;
            Ok(Verdict::Fits)
        }
        Err(error) => {
            tell_error(&format!("{}: {error}", config.file.display()));
            Ok(Verdict::Misfit)
        }
    }
}

fn found(config: &MachineConfig) -> Result<String, Unproved> {
    let found = proof::found(config)?;
    let letters = config.machine.layout().coordinates().as_slice();
    let parameter = config.place.boxes_parameter();
    let mut text = format!("# {parameter}={} in [KINS]KINEMATICS\n", found.len());
    for (k, (section, cells)) in found.iter().enumerate() {
        text += &format!("\n# proved with {cells} cells\n");
        text += &boxes::text(&config.place.box_section(k), section, letters, config.legs());
    }
    Ok(text)
}

fn proved(config: &MachineConfig) -> Result<String, Unproved> {
    let mut text = String::new();
    for (k, section) in config.boxes.iter().enumerate() {
        let name = config.place.box_section(k);
        let cells = proof::prove(config, section)
            .map_err(|doubt| Unproved::Section(name.clone(), doubt))?;
        let c = section.claim.contraction;
        text += &format!("[{name}] proved with {cells} cells: contraction {c}\n");
    }
    Ok(text)
}
