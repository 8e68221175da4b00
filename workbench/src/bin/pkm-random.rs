// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm-random INI SEED SECONDS`: a program of random moves and tool changes that the
//! machine can run, to standard output.

use pkm::machine::MachineConfig;
use pkm::random_program::random_program;
use std::process::ExitCode;

const USAGE: &str = "usage: pkm-random INI SEED SECONDS";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match program(&arguments) {
        Ok(text) => {
            print!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("pkm-random: {error}");
            ExitCode::from(2)
        }
    }
}

fn program(arguments: &[String]) -> Result<String, String> {
    let [ini, seed, seconds] = arguments else { return Err(USAGE.into()) };
    let config = MachineConfig::read(ini.as_ref()).map_err(|error| error.to_string())?;
    let seed = seed.parse().map_err(|_| format!("{seed} is no seed; {USAGE}"))?;
    let seconds: f64 = seconds.parse().map_err(|_| format!("{seconds} is no number; {USAGE}"))?;
    random_program(&config, seed, seconds)
}
