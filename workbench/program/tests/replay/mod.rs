// SPDX-License-Identifier: GPL-2.0-or-later
//! Runs every replay case of tests/cases/replay.toml, and checks that every shipped program has one.

mod case;

use case::{Case, Outcome};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use test_support::shipped::{MACHINES, cases_of, configs, folder};

fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == extension));
    files.sort();
    files
}

#[test]
fn every_case_keeps_its_expectations() {
    let cases: Vec<Case> = cases_of("replay.toml");
    let outcomes: Vec<Result<Outcome, String>> =
        cases.par_iter().map(|case| case.run(configs())).collect();
    let mut failures = vec![];
    for (case, outcome) in cases.iter().zip(outcomes) {
        let name = format!("{} {}", case.machine, case.program);
        match outcome {
            Ok(outcome) => {
                println!("{name}\n{}\n", outcome.replay);
                failures.extend(outcome.failures.iter().map(|text| format!("{name}: {text}")));
            }
            Err(error) => failures.push(format!("{name}: {error}")),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_shipped_program_has_a_case() {
    let covered: BTreeSet<(String, String)> = cases_of("replay.toml")
        .into_iter()
        .map(|case: Case| (case.machine, case.program))
        .collect();
    for name in MACHINES {
        for program in files(&folder(name).join("programs"), "ngc") {
            let program = format!("programs/{}", program.file_name().unwrap().display());
            let key = (name.to_string(), program);
            assert!(
                covered.contains(&key),
                "no case in tests/cases/replay.toml for {} {}",
                key.0,
                key.1
            );
        }
    }
}
