// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm calibrate` on tables of a tracker and of a ball bar: reports and refusals.

use calibrate::at_tool;
use calibrate::model::{Model, Tolerance};
use kinematics::{Pose, Solver, Vector3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fs;
use std::path::Path;
use std::process::Command;
use test_support::shipped;

const MACHINE: &str = "lab-hexapod";
const TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 60.0);

/// Position of tracker and ball bar, mm.
const STAND: Vector3<f64> = Vector3::new(300.0, -200.0, 100.0);

/// Largest deviation of anchors and lengths of the machine built, and noise of one number.
const OFF: f64 = 0.3;
const NOISE: f64 = 1e-3;

const TRACKER: &str = "tip_x,tip_y,tip_z";
const BAR: &str = "distance";

/// Returns a table with this number of poses, tilted or all at one orientation; its first row is line 4.
fn table(columns: &str, count: usize, is_tilted: bool) -> String {
    let config = shipped::config(MACHINE);
    let mut random = Pcg64::seed_from_u64(31);
    let model = Model::new(config.geometry, [0.0; 8], &Tolerance::of_lengths(1.0)).unwrap();
    let changes: Vec<f64> =
        model.parameters.iter().map(|_| random.random_range(-OFF..OFF)).collect();
    let truth = model.machine(&changes).unwrap();
    let hash = config.hash;
    let mut text = format!("# geometry {hash}\n# tool 0 0 60\nx,y,z,a,b,c,{columns}\n");
    for pose in at_tool::poses(&config, &TOOL, count, 2) {
        let angles = if is_tilted { pose.angles } else { Vector3::zeros() };
        let pose = Pose { angles, ..pose };
        let joints = config.machine.inverse(&pose, &TOOL).unwrap();
        let there = truth.forward(&joints, &pose, &TOOL, &Solver::default()).unwrap().pose;
        let mut noise = || random.random_range(-NOISE..NOISE);
        let tip = there.position - TOOL - STAND;
        let measured = match columns {
            TRACKER => vec![tip.x + noise(), tip.y + noise(), tip.z + noise()],
            _ => vec![tip.norm() + noise()],
        };
        let mut shown = Pose { position: pose.position - TOOL, ..pose }.to_degrees().to_vec();
        shown.extend(measured);
        let words: Vec<String> = shown.iter().map(|x| format!("{x:.6}")).collect();
        text.push_str(&format!("{}\n", words.join(",")));
    }
    text
}

/// Returns the command's output for a table, and its exit code.
fn answer(folder: &Path, table: &str) -> (String, i32) {
    fs::write(folder.join("table.csv"), table).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    command.arg("calibrate").arg(shipped::ini(MACHINE)).args(["table.csv", "--write", "new.ini"]);
    let output = command.current_dir(folder).env("NO_COLOR", "1").output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout) + &text(&output.stderr), output.status.code().unwrap())
}

/// Returns a table with one number of a line changed.
fn off(table: &str, line: usize, column: usize, by: f64) -> String {
    let change = |(k, text): (usize, &str)| {
        if k + 1 != line {
            return text.to_string();
        }
        let mut numbers: Vec<f64> = text.split(',').map(|word| word.parse().unwrap()).collect();
        numbers[column] += by;
        numbers.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(",")
    };
    table.lines().enumerate().map(change).collect::<Vec<_>>().join("\n")
}

#[test]
fn tables_calibrate_and_a_line_that_is_off_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (columns, count) in [(TRACKER, 60), (BAR, 120)] {
        let table = table(columns, count, true);
        let (text, code) = answer(folder.path(), &table);
        assert_eq!(code, 0, "{text}");
        assert!(text.contains(&format!("{count} readings")), "{text}");
        let (text, code) = answer(folder.path(), &off(&table, 20, 6, 0.3));
        assert_eq!(code, 1, "{text}");
        // 0.3 minus the influence of the line itself on the fit.
        assert!(
            text.contains("table.csv:20 is left out: it differs from the others by 0."),
            "{text}"
        );
        assert_eq!(text.matches("is left out").count(), 1, "{text}");
    }
}

#[test]
fn one_orientation_is_said_to_be_one() {
    let folder = tempfile::tempdir().unwrap();
    for (columns, count) in [(TRACKER, 60), (BAR, 120)] {
        let (text, code) = answer(folder.path(), &table(columns, count, false));
        assert!(code != 2 && text.contains("measure at several tilts"), "{text}");
    }
}

#[test]
fn errors_in_a_table_are_reported_with_their_line_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let hash = shipped::config(MACHINE).hash;
    for (columns, count) in [(TRACKER, 14), (BAR, 60)] {
        let whole = table(columns, count, true);
        let lines: Vec<&str> = whole.lines().collect();
        let without = |line: usize| [&lines[..line - 1], &lines[line..]].concat().join("\n");
        let with = |more: &str| [&lines[..6], &[more], &lines[6..]].concat().join("\n");
        let short = lines[5].rsplit_once(',').unwrap().0;
        let word = format!("{short},none");
        let endless = format!("{short},inf");
        let heading = |key: &str| format!("# {key} 0 0 0\n{whole}");
        let measured = format!("c,{columns}");
        for (text, reported) in [
            (without(1), ":1: expected a line \"# geometry HASH\"".to_string()),
            (without(2), ":1: expected a line \"# tool X Y Z\"".into()),
            (without(3), "expected columns x,y,z,a,b,c".into()),
            (heading("tool"), ":3: \"tool\" appears twice".into()),
            (heading("geometry"), ":2: \"geometry\" appears twice".into()),
            (whole.replace(&hash.to_string(), "7"), ":1: measured with geometry 0x00000007".into()),
            (whole.replace(&measured, "c"), "table.csv".into()),
            (whole.replace(&measured, "c,far"), "expected columns tip_x,tip_y,tip_z".into()),
            (with(short), ":7: CSV error".into()),
            (with(&word), ":7: \"none\" is not a number".into()),
            (with(&endless), ":7: \"inf\" is not a number".into()),
            (with("hello"), ":7: CSV error".into()),
            (with(lines[5]), ":7: this line repeats line 6".into()),
            (off(&whole, 9, 2, 9000.0), ":9: ".into()),
            (lines[..3].join("\n"), ":1: no row below the header".into()),
            (lines[..8].join("\n"), "too few readings".into()),
        ] {
            let (answer, code) = answer(folder.path(), &text);
            assert_eq!(code, 2, "{reported}: {answer}");
            assert!(answer.contains(&reported), "{reported}: {answer}");
            assert!(!folder.path().join("new.ini").exists(), "{reported}");
        }
    }
}
