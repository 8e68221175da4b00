// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC in virtual time, as installed by `make install`.

use linuxcnc::process::Options;
use linuxcnc::refusal::NotJudged;
use linuxcnc::row::{Ending, MessageKind};
use std::fs;
use std::path::PathBuf;
use test_support::control::{bounded, run, run_text};
use test_support::shipped;

fn programs(machine: &str) -> Vec<PathBuf> {
    let folder = fs::read_dir(shipped::folder(machine).join("programs")).unwrap();
    let mut programs: Vec<PathBuf> = folder.map(|entry| entry.unwrap().path()).collect();
    programs.sort();
    programs
}

// tests/live/truth.py checks the result of all programs, and that every cycle has a row.
#[test]
fn a_program_runs_to_its_end_with_a_row_for_every_cycle() {
    for machine in ["hexapod", "rotary-delta"] {
        let program = &programs(machine)[0];
        let (outcome, rows) = run(machine, program);
        let name = program.display();
        assert_eq!(outcome.ending, Ending::Finished, "{name}: {:?}", outcome.messages);
        assert!(outcome.messages.iter().all(|m| m.kind != MessageKind::Error), "{name}");
        assert_eq!(rows.len() as u64, outcome.cycles, "{name}: a row is missing");
        assert!(rows.iter().zip(1..).all(|(row, n)| row.cycle == n), "{name}");
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
fn stops_of_linuxcnc_are_reported_with_their_line_and_words() {
    let text = "G21 G90 G61\nG1 F3000 X10\nX0\nX500\nM2\n";
    let outcome = run_text("hexapod", text, &Options::default()).unwrap();
    assert_eq!(outcome.ending, Ending::Stopped);
    let message = &outcome.messages[0];
    assert!(message.text.contains("line 4") && message.text.contains("X's positive limit"));
}

#[test]
fn messages_in_latin_1_are_shown() {
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    // More messages than the channel can store.
    let lines = b"(MSG,Fr\xe4ser)\nG4 P0.001\n".repeat(50);
    fs::write(&file, [b"G21 G90\nG0 X1\n", &lines[..], b"M2\n"].concat()).unwrap();
    let (outcome, _) = run("hexapod", file.path());
    let texts = outcome.messages.iter().filter(|message| message.text.trim() == "Fr\u{e4}ser");
    assert_eq!((outcome.ending, texts.count()), (Ending::Finished, 50));
}

#[test]
fn loops_without_an_end_and_standstills_without_an_end_are_not_judged() {
    let short = Options { most_seconds: 20.0, most_standstill: 2.0, ..Options::default() };
    let short = bounded(short);
    let moving = "G21 G90\no1 while [1]\nG0 X1\nG0 X-1\no1 endwhile\nM2\n";
    assert!(matches!(run_text("hexapod", moving, &short), Err(NotJudged::TooLong(..))));
    let standing = "G21 G90\nG0 X1\nG4 P60\nM2\n";
    let found = run_text("hexapod", standing, &short);
    assert!(matches!(found, Err(NotJudged::Stands(_, 2))), "{found:?}");
}

#[test]
fn an_endless_loop_without_motion_is_not_judged() {
    let text = "G21 G90\nG0 X1\no1 while [1]\n#1 = 1\no1 endwhile\nM2\n";
    // It reaches its last cycle in a small part of this.
    let impatient = Options { most_work: 1.5, ..Options::default() };
    let refusal = run_text("hexapod", text, &impatient).unwrap_err();
    assert!(refusal.to_string().contains("a loop without an end"), "{refusal}");
}

// Later than 2.9, nets to `iocontrol` wait until milltask creates its pins.
#[test]
fn a_net_to_a_pin_that_never_appears_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let hal = folder.path().join("more.hal");
    fs::write(&hal, "net lost iocontrol.0.no-such-pin\n").unwrap();
    let options = Options { hal: vec![hal], ..Options::default() };
    let refused = run_text("hexapod", "M2\n", &options).unwrap_err().to_string();
    assert!(refused.contains("there is no pin iocontrol.0.no-such-pin"), "{refused}");
}
