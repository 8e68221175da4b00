// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkmkins-pins MACHINE.ini` prints the values of the module's pins, for `hal/pkmkins.tcl`.
//!
//! Exit code 1: the file is refused, and standard error has the message of `pkm check`; 2: the command line or standard
//! output is wrong. Nothing is printed on standard output unless the whole file is valid.

use machine::read::diagnostic::of_machine;
use machine::read::pins::printed;
use std::env;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

const VERSION: &str = env!("CARGO_PKG_VERSION");

fn main() -> ExitCode {
    let arguments: Vec<_> = env::args_os().skip(1).collect();
    let text = match arguments.as_slice() {
        [word] if word == "--version" => format!("pkmkins-pins {VERSION}\n"),
        [file] => match printed(Path::new(file), VERSION) {
            Ok(text) => text,
            Err(error) => {
                anstream::eprintln!("{}", of_machine(&error));
                return ExitCode::from(1);
            }
        },
        _ => {
            eprintln!(
                "pkmkins-pins: expected one argument, the INI file: pkmkins-pins MACHINE.ini"
            );
            return ExitCode::from(2);
        }
    };
    match io::stdout().write_all(text.as_bytes()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("pkmkins-pins: standard output: {error}");
            ExitCode::from(2)
        }
    }
}
