// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm-boxes INI`: proves the `[BOX_K]` sections of a machine, or finds one for it.
//!
//! With `boxes=` in `[KINS]KINEMATICS` every section is proved again. Without, boxes that
//! fill the axis limits are sought, proved and printed. Exit code 0: proved; 1: not; 2: the file
//! cannot be used.

use pkm::boxes;
use pkm::machine::MachineConfig;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [file] = arguments.as_slice() else {
        eprintln!("usage: pkm-boxes INI");
        return ExitCode::from(2);
    };
    let config = match MachineConfig::read(file) {
        Ok(config) => config,
        Err(error) => {
            eprintln!("pkm-boxes: {error}");
            return ExitCode::from(2);
        }
    };
    let result = if config.boxes.is_empty() { find(&config) } else { prove(&config) };
    match result {
        Ok(text) => {
            // A reader that has gone away does not change the verdict.
            let _ = write!(std::io::stdout(), "{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("pkm-boxes: {error}");
            ExitCode::from(1)
        }
    }
}

fn find(config: &MachineConfig) -> Result<String, String> {
    let found = boxes::found(config).map_err(|doubt| doubt.to_string())?;
    let letters = config.machine.layout().coordinates().as_slice();
    let mut text = format!("# boxes={} in [KINS]KINEMATICS\n", found.len());
    for (k, (section, cells)) in found.iter().enumerate() {
        text += &format!("\n# proved with {cells} cells\n");
        text += &boxes::text(k, section, letters, config.legs());
    }
    Ok(text)
}

fn prove(config: &MachineConfig) -> Result<String, String> {
    let mut text = String::new();
    for (k, section) in config.boxes.iter().enumerate() {
        let cells = boxes::prove(config, section).map_err(|doubt| format!("[BOX_{k}] {doubt}"))?;
        let c = section.claim.contraction;
        text += &format!("[BOX_{k}] proved with {cells} cells: contraction {c}\n");
    }
    Ok(text)
}
