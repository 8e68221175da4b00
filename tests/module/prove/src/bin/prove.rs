// SPDX-License-Identifier: GPL-2.0-or-later
//! `prove [FILE]`: prints all checks of the built module as a table; exit 1 if one fails. Only x86-64 instructions are
//! followed: for 64-bit ARM it lists the checks that this excludes.

use abi_tests::module::pkmkins_path;
use prove::built::Built;
use prove::checks::{Check, checks};
use prove::contract::{CONTRACT, Contract};
use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let path = std::env::args_os().nth(1).map_or_else(pkmkins_path, PathBuf::from);
    match proved(&path) {
        Ok((built, checks)) => shown(&built, &checks),
        Err(error) => {
            eprintln!("prove: {}: {error}", path.display());
            ExitCode::from(2)
        }
    }
}

fn proved(path: &PathBuf) -> Result<(Built, Vec<Check>), String> {
    let contract = Contract::parse(CONTRACT).map_err(|e| format!("contract.toml: {e}"))?;
    let data = std::fs::read(path).map_err(|e| e.to_string())?;
    let built = Built::read(&data)?;
    let checks = checks(&built, &contract);
    Ok((built, checks))
}

fn shown(built: &Built, checks: &[Check]) -> ExitCode {
    println!("| check | found | allowed | |\n|---|---|---|---|");
    for check in checks {
        let verdict = if check.complaints.is_empty() { "ok" } else { "FAILED" };
        println!("| {} | {} | {} | {verdict} |", check.name, check.found, check.bound);
    }
    let complaints: Vec<&String> = checks.iter().flat_map(|c| &c.complaints).collect();
    for complaint in &complaints {
        println!("prove: {complaint}");
    }
    if !built.is_followed {
        println!(
            "prove: not judged, for instructions are followed on x86-64 alone: stack, recursion, \
             traps, callees, entry points by address, imports called in the servo thread"
        );
    }
    let failed = checks.iter().filter(|c| !c.complaints.is_empty()).count();
    println!("\nprove: {} passed, {failed} failed", checks.len() - failed);
    ExitCode::from(u8::from(failed > 0))
}
