// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm boxes`.

use super::{Bar, Failure, MachineFile, Verdict};
use pkm::proof::boxes;
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

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let bar = Bar::spinner("looking for a proof");
    let result = if config.boxes.is_empty() { found(&config) } else { proved(&config) };
    drop(bar);
    match result {
        Ok(text) => {
            let mut out = std::io::stdout().lock();
            write!(out, "{text}")?;
            out.flush()?;
            Ok(Verdict::Fits)
        }
        Err(text) => {
            let file = config.file.display();
            let _ = writeln!(anstream::stderr(), "pkm: {file}: {text}");
            Ok(Verdict::Misfit)
        }
    }
}

fn found(config: &MachineConfig) -> Result<String, String> {
    let found = boxes::found(config).map_err(|doubt| doubt.to_string())?;
    let letters = config.machine.layout().coordinates().as_slice();
    let mut text = format!("# boxes={} in [KINS]KINEMATICS\n", found.len());
    for (k, (section, cells)) in found.iter().enumerate() {
        text += &format!("\n# proved with {cells} cells\n");
        text += &boxes::text(k, section, letters, config.legs());
    }
    Ok(text)
}

fn proved(config: &MachineConfig) -> Result<String, String> {
    let mut text = String::new();
    for (k, section) in config.boxes.iter().enumerate() {
        let cells = boxes::prove(config, section).map_err(|doubt| format!("[BOX_{k}] {doubt}"))?;
        let c = section.claim.contraction;
        text += &format!("[BOX_{k}] proved with {cells} cells: contraction {c}\n");
    }
    Ok(text)
}
