// SPDX-License-Identifier: GPL-2.0-or-later
//! `[LEG_N]OFFSET` moves only the zero of a joint: every command must give the same output as
//! without it, except joint values.

use crate::commands::Bench;
use calibrate::model::{Model, Tolerance};
use kinematics::{Joints, Pose};
use machine::read::mechanism::Mechanism;
use std::fs;
use std::path::Path;
use studies::study::stiffness::with_platform;
use test_support::shipped::{MACHINES, ini};

/// A power of two, so that sums lose few digits.
const OFFSET: f64 = 16.0;

/// Joint values are sums of numbers up to some thousands of machine units or degrees.
const SAME_JOINT: f64 = 1e-9;

/// Returns the text of a machine whose legs' joints are all shifted by `OFFSET`.
fn shifted(text: &str) -> String {
    let mut section = String::new();
    let mut new = String::new();
    for line in text.lines() {
        if let Some(name) = line.trim().strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            section = name.into();
        }
        new += &shifted_line(&section, line);
        new += "\n";
        if line.trim() == format!("[{section}]") && section.starts_with("LEG_") {
            new += &format!("OFFSET = {OFFSET}\n");
        }
    }
    new
}

/// Shifts the values of a leg's joint; joints of a table follow.
fn shifted_line(section: &str, line: &str) -> String {
    let number = section.strip_prefix("JOINT_").and_then(|n| n.parse::<usize>().ok());
    let Some((key, value)) = line.split_once('=').filter(|_| number.is_some()) else {
        return line.into();
    };
    match key.trim() {
        "HOME" | "HOME_OFFSET" | "MIN_LIMIT" | "MAX_LIMIT" => {
            format!("{key}= {}", value.trim().parse::<f64>().unwrap() - OFFSET)
        }
        _ => line.into(),
    }
}

fn config(file: &Path, text: &str) -> Mechanism {
    test_support::shipped::machine_of(file, text).mechanism(1).unwrap()
}

fn assert_same(file: &Path, legs: usize, found: &Joints, expected: &Joints, shift: f64) {
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        let by = if i < legs { shift } else { 0.0 };
        assert!((found - expected + by).abs() <= SAME_JOINT, "{}: joint {i}", file.display());
    }
}

#[test]
fn every_machine_made_of_a_file_keeps_its_offsets() {
    for file in MACHINES.map(ini) {
        let text = fs::read_to_string(&file).unwrap();
        if text.contains("[CHAIN_") {
            // HOME of an axis that carries something is 0.
            continue;
        }
        let (plain, moved) = (config(&file, &text), config(&file, &shifted(&text)));
        let legs = plain.legs();
        assert_eq!(moved.offsets[..legs], vec![OFFSET; legs]);
        let tool = plain.spindle;
        let pose = plain.home_pose();
        let expected = plain.machine.inverse(&pose, &tool).unwrap();
        let model = Model::new(moved.geometry, moved.offsets, &Tolerance::of_lengths(1.0)).unwrap();
        let machines = [
            moved.machine.clone(),
            with_platform(&moved, 1.0).unwrap().machine,
            model.machine(&vec![0.0; model.parameters.len()]).unwrap(),
        ];
        for machine in &machines {
            let joints = machine.inverse(&pose, &tool).unwrap();
            assert_same(&file, legs, &joints, &expected, OFFSET);
            let found = machine.forward(&joints, &pose, &tool, &moved.solver).unwrap().pose;
            assert!(Pose::distance(&found, &pose, machine.radius()) <= SAME_JOINT);
        }
    }
}

/// Compares both outputs word by word: joint values differ by `OFFSET` in separate columns, and are ignored
/// in a line about one joint; all other numbers are the same.
fn assert_alike(words: &str, expected: &str, found: &str) {
    let lines = |text: &str| -> Vec<String> {
        let of_joint = |line: &&str| line.trim_start().starts_with("carriage ");
        text.lines().filter(|line| !of_joint(line)).map(Into::into).collect()
    };
    let (expected, found) = (lines(expected), lines(found));
    assert_eq!(found.len(), expected.len(), "{words}: {found:?}");
    let columns: Vec<bool> = found[0].split(',').map(is_joint).collect();
    for (expected, found) in expected.iter().zip(&found) {
        let fields = |line: &str| line.split([',', ' ']).map(String::from).collect::<Vec<_>>();
        let (expected, found) = (fields(expected), fields(found));
        assert_eq!(found.len(), expected.len(), "{words}: {found:?}");
        for (k, (expected, found)) in expected.iter().zip(&found).enumerate() {
            let by = if columns.get(k) == Some(&true) { OFFSET } else { 0.0 };
            let is_same = match (expected.parse::<f64>(), found.parse::<f64>()) {
                (Ok(expected), Ok(found)) if expected.is_finite() => {
                    (found - expected + by).abs() <= SAME_JOINT
                }
                _ => expected == found,
            };
            assert!(is_same, "{words}: {found} instead of {expected}");
        }
    }
}

/// Returns whether a column of CSV has joint values.
fn is_joint(name: &str) -> bool {
    name.strip_prefix("joint_").is_some_and(|n| n.parse::<usize>().is_ok())
}

#[test]
fn the_commands_answer_as_without_offsets_but_for_joint_values() {
    let program = "G21 G90\nM52 P1\nG1 X10 F6000\nM2\n";
    let study = "[legs]\nstiffness_n_per_um = 100\n";
    let plain = Bench::new().with("line.ngc", program).with("study.toml", study);
    let moved = Bench::new().with("line.ngc", program).with("study.toml", study);
    let file = moved.0.path().join("linear-delta.ini");
    fs::write(&file, shifted(&fs::read_to_string(&file).unwrap())).unwrap();
    // Its panel shows the shifted ranges.
    assert!(moved.answer("panel linear-delta.ini", "").ends_with("exit 0\n"));
    for words in [
        "check linear-delta.ini",
        "preflight linear-delta.ini line.ngc",
        "replay linear-delta.ini line.ngc --period 0.05",
        "rods linear-delta.ini line.ngc --period 0.05",
        "sensitivity linear-delta.ini --draws 100 --rays 20",
        "stiffness linear-delta.ini --study study.toml",
        "boxes linear-delta.ini",
        "random linear-delta.ini --seed 3 --seconds 5",
    ] {
        assert_alike(words, &plain.answer(words, ""), &moved.answer(words, ""));
    }
    let joints = |bench: &Bench| -> Vec<f64> {
        let reported = bench.answer("joints linear-delta.ini --pose 10 -20 50 0 0 0", "");
        reported.split_whitespace().filter_map(|word| word.parse().ok()).take(3).collect()
    };
    let (expected, found) = (joints(&plain), joints(&moved));
    for (expected, found) in expected.iter().zip(&found) {
        assert!((expected - found - OFFSET).abs() <= SAME_JOINT, "{expected} {found}");
    }
    assert_eq!(found.len(), 3);
}
