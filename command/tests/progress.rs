// SPDX-License-Identifier: GPL-2.0-or-later
//! Progress of slow commands: on a terminal none is silent for seconds, and a pipe gets none.

use crate::commands::Bench;
use crate::cut::PROGRAM;
use crate::dynamics_command::STUDY;
use crate::new::example;
use std::fs;
use std::process::{Command, Stdio};
use test_support::CUT;
use test_support::shipped::folder;

/// Commands that may take more than seconds, and what each shows meanwhile. PKM stands for linear-delta.ini.
const SLOW: &[(&str, &[&str])] = &[
    ("new NEW --out made", &["creating the machine"]),
    ("check PKM", &["reading the machine"]),
    ("check PKM --fix", &["homes"]),
    ("homing PKM", &["simulating homing"]),
    ("boxes PKM", &["proving boxes"]),
    ("preflight PKM part.ngc", &["running"]),
    ("run PKM part.ngc", &["running"]),
    ("view PKM part.ngc --html view.html", &["running"]),
    ("replay PKM part.ngc", &["reading the program", "replaying"]),
    ("rods PKM part.ngc", &["reading the program", "following the program", "measuring the rods"]),
    ("random PKM --seconds 1", &["choosing moves"]),
    ("path PKM vase.toml", &["finding the path"]),
    (
        "workspace PKM --plots drawn --grid 4 --bands 4",
        &["looking along rays", "drawing the workspace"],
    ),
    ("sensitivity PKM --study study.toml", &["sampling joint errors"]),
    ("stiffness PKM --study study.toml --grid 2 --plots drawn", &["mapping"]),
    (
        "dynamics PKM --study force.toml --shake noise",
        &["vibration modes", "shaking", "linear theory"],
    ),
    (
        "stability pose PKM --study study.toml --columns 3 --speeds 7000 7100 --rpm 7000",
        &["stable depths", "limits by zero order and at single speeds"],
    ),
    ("stability map PKM --study study.toml --grid 2", &["limit depths"]),
    (
        "stability program PKM part.ngc --study study.toml",
        &["reading the program", "limit depths", "the best speed"],
    ),
    ("cut PKM part.ngc --study study.toml", &["reading the program", "running", "limit depths"]),
    ("measure HEXAPOD.ini HEXAPOD-dial.toml -o dial", &["choosing poses"]),
    ("measure HEXAPOD.ini HEXAPOD-probe.toml -o plate", &["choosing touches"]),
    ("calibrate HEXAPOD.ini dial.csv", &["reading the measurements"]),
];

/// Returns a folder with the files of all commands.
fn bench() -> Bench {
    let bench =
        Bench::new().with("study.toml", CUT).with("force.toml", STUDY).with("part.ngc", PROGRAM);
    let (hexapod, delta) = (folder("hexapod"), folder("linear-delta"));
    for (from, to) in [
        (hexapod.join("hexapod.ini"), "HEXAPOD.ini"),
        (hexapod.join("hexapod.tbl"), "hexapod.tbl"),
        (hexapod.join("calibration/dial.toml"), "HEXAPOD-dial.toml"),
        (hexapod.join("calibration/probe.toml"), "HEXAPOD-probe.toml"),
        (delta.join("paths/twisted-vase.toml"), "vase.toml"),
    ] {
        fs::copy(from, bench.0.path().join(to)).unwrap();
    }
    bench
}

/// Returns what a command writes to a terminal, which `script` provides.
fn on_terminal(bench: &Bench, words: &str) -> String {
    let command = format!("{} {words}", env!("CARGO_BIN_EXE_pkm"));
    let output = Command::new("script")
        .args(["--quiet", "--command", &command, "/dev/null"])
        .current_dir(bench.0.path())
        .env("TERM", "xterm")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn every_slow_command_shows_progress_on_a_terminal_and_none_in_a_pipe() {
    let mut wrong = String::new();
    for (words, shown) in SLOW {
        let words = words.replace("PKM", "linear-delta.ini");
        let words = words.replace("NEW", &example("linear-delta"));
        let terminal = on_terminal(&bench(), &words);
        for message in *shown {
            if !terminal.contains(&format!("{message}, 0s so far")) {
                wrong += &format!("pkm {words}: no {message:?} on a terminal: {terminal}\n");
            }
        }
        // The same, but for a terminal.
        let piped = bench().answer(&words, "");
        for trace in ["so far", " left", "\r", "\u{1b}"] {
            if piped.contains(trace) {
                wrong += &format!("pkm {words}: {trace:?} in a pipe: {piped}\n");
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}
