// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm calibrate` on logs as the calibration program writes them: what it tells and writes, and
//! what it refuses.

use crate::shipped;
use kinematics::{Machine, Pose, Solver, Vector3};
use pkm::calibrate::log::HEADER;
use pkm::calibrate::model::{Frame, Model, Tolerance};
use pkm::calibrate::plate::Plate;
use pkm::machine::MachineConfig;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 60.0);

/// Anchors and lengths of the machine built are off by so much at most, mm.
const OFF: f64 = 0.3;

/// Noise of the probe at most, mm.
const NOISE: f64 = 1e-3;

fn plate_file() -> PathBuf {
    shipped::folder("hexapod").join("calibration/plate.toml")
}

/// A machine built unlike its drawing, and a plate in it.
struct Shop {
    config: MachineConfig,
    truth: Machine,
    plate: Plate,
    frame: Frame,
    random: Pcg64,
}

impl Shop {
    fn new() -> Self {
        let config = shipped::config("hexapod");
        let mut random = Pcg64::seed_from_u64(21);
        let model = Model::new(config.geometry, [0.0; 8], &Tolerance::of_lengths(1.0)).unwrap();
        let changes: Vec<f64> =
            model.parameters.iter().map(|_| random.random_range(-OFF..OFF)).collect();
        let frame = Frame {
            origin: Vector3::new(0.9, -0.7, 200.4),
            rotation: Pose::from_degrees([0.0, 0.0, 0.0, 0.1, -0.2, 0.4]).rotation(),
        };
        let plate = Plate::read(&plate_file(), 1.0).unwrap();
        Self { truth: model.machine(&changes).unwrap(), config, plate, frame, random }
    }

    /// Log of a touch of every wall and face at these tilts.
    fn log(&mut self, tilts: &[[f64; 2]]) -> String {
        let mut text = format!("{HEADER}\nunit 1.000000\n");
        let mut number = 0;
        for tilt in tilts {
            for hole in self.plate.hole.clone() {
                for approach in [1, -1, 2, -2, -3] {
                    number += 1;
                    self.touch(&mut text, number, hole.number, hole.place, *tilt, approach);
                }
            }
        }
        writeln!(text, "end {number}.000000").unwrap();
        text
    }

    fn touch(
        &mut self,
        text: &mut String,
        number: i32,
        hole: u32,
        [x, y]: [f64; 2],
        tilt: [f64; 2],
        approach: i32,
    ) {
        let sign = f64::from(approach.signum());
        let local = match approach.abs() {
            1 => Vector3::new(x + 3.0 * sign, y, -4.0),
            2 => Vector3::new(x, y + 3.0 * sign, -4.0),
            _ => Vector3::new(x + 14.0, y + 14.0, 3.0),
        };
        let noise = Vector3::from_fn(|_, _| self.random.random_range(-NOISE..NOISE));
        let wanted = Pose {
            position: self.frame.origin + self.frame.rotation * local + noise + TOOL,
            angles: Vector3::new(tilt[0], tilt[1], 0.0) * std::f64::consts::PI / 180.0,
        };
        let joints = self.truth.inverse(&wanted, &TOOL).unwrap();
        let seen =
            self.config.machine.forward(&joints, &wanted, &TOOL, &Solver::default()).unwrap();
        let mut at = seen.pose.to_degrees();
        at[2] -= TOOL.z;
        let list =
            |values: &[f64]| values.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(" ");
        writeln!(
            text,
            "touch {number}.000000 hole {hole}.000000 approach {approach}.000000 at {}\njoints {number}.000000 {} tool 0.000000 0.000000 60.000000 geometry {}.000000",
            list(&at),
            list(&joints[..6]),
            self.config.geometry.hash()
        )
        .unwrap();
    }
}

const TILTS: [[f64; 2]; 6] =
    [[0.0, 0.0], [15.0, 0.0], [-15.0, 0.0], [0.0, 15.0], [0.0, -15.0], [11.0, 11.0]];

/// Answer of the command to a log, with its exit code, and its folder.
fn answer(folder: &Path, log: &str, more: &[&str]) -> (String, i32) {
    fs::write(folder.join("probe.log"), log).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    command
        .arg("calibrate")
        .arg(shipped::ini("hexapod"))
        .arg("probe.log")
        .arg("--plate")
        .arg(plate_file());
    let output = command.args(more).current_dir(folder).env("NO_COLOR", "1").output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout) + &text(&output.stderr), output.status.code().unwrap())
}

#[test]
fn a_log_becomes_a_file_with_the_true_geometry_and_a_difference_to_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut shop = Shop::new();
    let log = shop.log(&TILTS);
    let (text, code) = answer(folder.path(), &log, &["--write", "new.ini", "--next", "3"]);
    assert_eq!(code, 0, "{text}");
    for part in [
        "where base and measuring frame stand together",
        "tip at worst",
        "-BASE = 540.918",
        "+OFFSET = ",
        "to measure next",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let old = fs::read_to_string(shipped::ini("hexapod")).unwrap();
    let new = fs::read_to_string(folder.path().join("new.ini")).unwrap();
    let comments = |text: &str| text.lines().filter(|line| line.starts_with('#')).count();
    assert_eq!(comments(&old), comments(&new));
    // The plate is probed again, with the new file.
    let file = folder.path().join("new.ini");
    shop.config = MachineConfig::read(&file).unwrap();
    let again = shop.log(&TILTS);
    fs::write(folder.path().join("again.log"), again).unwrap();
    let holes = |machine: &Path, log: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
        command.arg("calibrate").arg(machine).arg(log).arg("--plate").arg(plate_file());
        let output = command.current_dir(folder.path()).output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        let (_, rest) = text.split_once("off by ").unwrap();
        rest.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    let (before, after) = (holes(&shipped::ini("hexapod"), "probe.log"), holes(&file, "again.log"));
    println!("holes: {before} mm before, {after} mm after");
    // Four touches of the noise on each hole, the largest of 54; and what calibration leaves.
    assert!(before > 0.03 && after < 3.0 * NOISE, "{before} {after}");
}

#[test]
fn what_is_wrong_with_a_log_is_told_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let log = Shop::new().log(&TILTS[..2]);
    let lines: Vec<&str> = log.lines().collect();
    let without = |from: usize, to: usize| [&lines[..from], &lines[to..]].concat().join("\n");
    let twice = [&lines[..6], &lines[4..]].concat().join("\n");
    let foreign = log.replacen("touch 3.", "hello\ntouch 3.", 1);
    let swapped = log
        .replace(" hole 5.", " hole 99.")
        .replace(" hole 6.", " hole 5.")
        .replace(" hole 99.", " hole 6.");
    let elsewhere = log.replace(" hole 5.", " hole 55.");
    let moved = shifted(&log, [10.0, 0.0, -200.0]);
    let cases = [
        ("".to_string(), "is neither a log of the calibration program"),
        (without(4, 6), "touch 2 is missing, 3 follows"),
        (without(5, 6), "expected \"joints 2 …"),
        (twice, "touch 2 is there twice"),
        (foreign, "\"hello\" is no line of the calibration program"),
        (without(lines.len() - 1, lines.len()), "the program did not run to its end"),
        (log.replace("unit 1.", "unit 0."), "logged in inches on a machine in mm"),
        (swapped, "holes in the wrong order: what the log calls hole 5 is 6, 6 is 5"),
        (elsewhere, "the plate has no hole 55"),
        (moved, " -200.0000 from the position logged"),
        (
            log.replace("geometry 1844604530.", "geometry 1844604531."),
            "logged with geometry 0x6df26e73",
        ),
        (log.replace(" 60.000000 geometry", " 61.000000 geometry"), "another tool offset"),
        (log.clone() + "touch 1", "two logs in one file?"),
        ("1 2 3 4 5 6 0 0 0\n".into(), "points of PROBEOPEN alone do not say"),
    ];
    for (log, expected) in cases {
        let (text, code) = answer(folder.path(), &log, &["--write", "new.ini"]);
        assert_eq!(code, 2, "{text}");
        assert!(text.contains(expected), "{expected}: {text}");
        assert!(!folder.path().join("new.ini").exists());
    }
    let few = Shop {
        plate: Plate { hole: Shop::new().plate.hole[..2].to_vec(), ..Shop::new().plate },
        ..Shop::new()
    }
    .log(&TILTS[..1]);
    let (text, code) = answer(folder.path(), &few, &[]);
    assert!(code == 2 && text.contains("probe three at least"), "{text}");
    let own = shipped::ini("hexapod");
    let (text, code) = answer(folder.path(), &log, &["--write", own.to_str().unwrap()]);
    assert!(code == 2 && text.contains("--in-place writes into it"), "{text}");
}

/// The positions of a log shifted, as a work offset does it.
fn shifted(log: &str, by: [f64; 3]) -> String {
    let shift = |line: &str| match line.split_once(" at ") {
        Some((before, at)) => {
            let mut numbers: Vec<f64> = at.split(' ').map(|word| word.parse().unwrap()).collect();
            (0..3).for_each(|k| numbers[k] += by[k]);
            let words: Vec<String> = numbers.iter().map(|x| format!("{x:.6}")).collect();
            format!("{before} at {}", words.join(" "))
        }
        None => line.into(),
    };
    log.lines().map(shift).collect::<Vec<_>>().join("\n")
}

#[test]
fn an_outlier_is_named_with_its_line_and_one_orientation_is_said_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut shop = Shop::new();
    let mut log = shop.log(&TILTS);
    // A chip on the wall: the ball was 0.05 mm too early, and so were the joints.
    let spoilt = Shop::chip(&mut shop, &log, 61);
    log = spoilt;
    let (text, code) = answer(folder.path(), &log, &[]);
    assert_eq!(code, 1, "{text}");
    // 0.05 without what the touch itself has pulled the machine along.
    assert!(text.contains("probe.log:123: hole 4, wall at +X is left out: 0.04"), "{text}");
    let level = shop.log(&TILTS[..1]);
    let (text, _) = answer(folder.path(), &level, &[]);
    assert!(text.contains("measure at several tilts"), "{text}");
}

impl Shop {
    /// The log with touch `number`, along +X, 0.05 mm short of the wall.
    fn chip(&mut self, log: &str, number: usize) -> String {
        let mut lines: Vec<String> = log.lines().map(Into::into).collect();
        let hole = self.plate.hole[(number - 1) / 5 % 9];
        let mut text = String::new();
        let place = [hole.place[0] - 0.05, hole.place[1]];
        self.touch(&mut text, number as i32, hole.number, place, TILTS[(number - 1) / 45], 1);
        let at = 2 + 2 * (number - 1);
        for (line, new) in lines[at..at + 2].iter_mut().zip(text.lines()) {
            *line = new.into();
        }
        lines.join("\n")
    }
}
