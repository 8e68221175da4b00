// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC in virtual time, as `make install` has installed it.

use crate::shipped::{self, MACHINES};
use pkm::control::process::{self, Patience};
use pkm::control::refusal::NotJudged;
use pkm::control::row::{Ending, MessageKind, Outcome, Row};
use std::fs;
use std::path::{Path, PathBuf};

fn programs(machine: &str) -> Vec<PathBuf> {
    let folder = fs::read_dir(shipped::folder(machine).join("programs")).unwrap();
    let mut programs: Vec<PathBuf> = folder.map(|entry| entry.unwrap().path()).collect();
    programs.sort();
    programs
}

fn run(machine: &str, program: &Path) -> (Outcome, Vec<Row>) {
    let mut rows = vec![];
    let config = shipped::config(machine);
    let outcome = process::run(&config, program, Patience::default(), |row| rows.push(*row));
    (outcome.unwrap(), rows)
}

fn run_text(machine: &str, text: &str, patience: Patience) -> Result<Outcome, NotJudged> {
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    fs::write(&file, text).unwrap();
    process::run(&shipped::config(machine), file.path(), patience, |_| ())
}

#[test]
fn every_shipped_program_runs_to_its_end_without_a_message() {
    for machine in MACHINES {
        for program in programs(machine) {
            let (outcome, rows) = run(machine, &program);
            let name = program.display();
            assert_eq!(outcome.ending, Ending::Finished, "{name}: {:?}", outcome.messages);
            assert!(outcome.messages.iter().all(|m| m.kind != MessageKind::Error), "{name}");
            assert_eq!(rows.len() as u64, outcome.cycles, "{name}: a row is missing");
            assert!(rows.iter().zip(1..).all(|(row, n)| row.cycle == n), "{name}");
        }
    }
}

#[test]
fn the_same_program_gives_the_same_rows_also_in_several_runs_at_once() {
    let program = &programs("hexapod")[0];
    let (outcome, rows) = run("hexapod", program);
    let runs: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..3).map(|_| scope.spawn(|| run("hexapod", program))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    for (other, others) in runs {
        assert_eq!(outcome, other);
        assert!(rows == others, "rows differ");
    }
}

#[test]
fn what_linuxcnc_stops_is_told_with_its_line_and_words() {
    let text = "G21 G90 G61\nG1 F3000 X10\nX0\nX500\nM2\n";
    let outcome = run_text("hexapod", text, Patience::default()).unwrap();
    assert_eq!(outcome.ending, Ending::Stopped);
    let message = &outcome.messages[0];
    assert!(message.text.contains("line 4") && message.text.contains("X's positive limit"));
}

#[test]
fn loops_without_an_end_and_standstills_without_an_end_are_not_judged() {
    let short = Patience { most_seconds: 20.0, most_standstill: 2.0 };
    let moving = "G21 G90\no1 while [1]\nG0 X1\nG0 X-1\no1 endwhile\nM2\n";
    assert!(matches!(run_text("hexapod", moving, short), Err(NotJudged::TooLong(..))));
    let standing = "G21 G90\nG0 X1\nG4 P60\nM2\n";
    let found = run_text("hexapod", standing, short);
    assert!(matches!(found, Err(NotJudged::Stands(_, 2))), "{found:?}");
}
