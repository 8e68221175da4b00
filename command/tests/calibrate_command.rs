// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm calibrate` on logs in the format of the calibration program: its reports and files, and
//! its refusals.

use calibrate::fit::fit;
use calibrate::log::HEADER;
use calibrate::model::{Frame, Model, Tolerance};
use calibrate::plate::Plate;
use calibrate::reading::Reading;
use calibrate::study::{self, Given, Wishes};
use kinematics::{Machine, Pose, Solver, Vector3};
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use test_support::shipped;

const TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 60.0);

/// Largest deviation of anchors and lengths of the machine built, mm.
const OFF: f64 = 0.3;

/// Largest noise of the probe, mm.
const NOISE: f64 = 1e-3;

fn plate_file() -> PathBuf {
    shipped::folder("hexapod").join("calibration/plate.toml")
}

/// A machine that differs from its drawing, and a plate on it.
struct Shop {
    config: Mechanism,
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

    /// Returns the log of a touch of every wall and face at these tilts.
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
            angles: Vector3::new(tilt[0], tilt[1], 0.0).map(f64::to_radians),
        };
        let joints = self.truth.inverse(&wanted, &TOOL).unwrap();
        let seen =
            self.config.machine.forward(&joints, &wanted, &TOOL, &Solver::default()).unwrap();
        let mut at = seen.pose.to_degrees();
        // LinuxCNC's own tool offset does not include the spindle offset.
        at[2] -= TOOL.z - self.config.spindle.z;
        let list =
            |values: &[f64]| values.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(" ");
        writeln!(
            text,
            "touch {number}.000000 hole {hole}.000000 approach {approach}.000000 at {}\njoints {number}.000000 {} tool 0.000000 0.000000 60.000000 geometry {}.000000",
            list(&at),
            list(&joints[..6]),
            self.config.hash
        )
        .unwrap();
    }
}

const TILTS: [[f64; 2]; 6] =
    [[0.0, 0.0], [15.0, 0.0], [-15.0, 0.0], [0.0, 15.0], [0.0, -15.0], [11.0, 11.0]];

/// Returns a log of probing on a machine that differs from its drawing.
pub fn log() -> String {
    Shop::new().log(&TILTS)
}

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
        "joint position of base and measuring frame",
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
    shop.config = test_support::shipped::first_of(&file);
    let again = shop.log(&TILTS);
    fs::write(folder.path().join("again.log"), again).unwrap();
    let holes = |machine: &Path, log: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
        command.arg("calibrate").arg(machine).arg(log).arg("--plate").arg(plate_file());
        let output = command.current_dir(folder.path()).output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        let (_, rest) = text.split_once("off by up to ").unwrap();
        rest.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    let (before, after) = (holes(&shipped::ini("hexapod"), "probe.log"), holes(&file, "again.log"));
    println!("holes: {before} mm before, {after} mm after");
    // Four times the noise of a touch on each hole, the largest of 54; and the rest after calibration.
    assert!(before > 0.03 && after < 3.0 * NOISE, "{before} {after}");
}

#[test]
fn errors_in_a_log_are_reported_and_nothing_is_written() {
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
        ("".to_string(), ":1: neither a log of the calibration program"),
        (without(4, 6), "touch 2 is missing, 3 follows"),
        (without(5, 6), "expected \"joints 2 …"),
        (twice, "touch 2 appears twice"),
        (foreign, "\"hello\" is not a line of the calibration program"),
        (without(lines.len() - 1, lines.len()), "the program did not run to its end"),
        (log.replace("unit 1.", "unit 0."), "logged in inches on a machine in mm"),
        (swapped, "holes in the wrong order: in the log hole 5 is 6, 6 is 5"),
        (elsewhere, "the plate has no hole 55"),
        (moved, " -200.0000 from the logged position"),
        (
            log.replace("geometry 1844604530.", "geometry 1844604531."),
            "logged with geometry 0x6df26e73",
        ),
        (log.replace(" 60.000000 geometry", " 61.000000 geometry"), "another tool offset"),
        (log.clone() + "touch 1", "two logs"),
        ("1 2 3 4 5 6 0 0 0\n".into(), "expected a line \"# machine hexapod.ini\""),
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
    assert!(code == 2 && text.contains("probe at least three"), "{text}");
    let own = shipped::ini("hexapod");
    let (text, code) = answer(folder.path(), &log, &["--write", own.to_str().unwrap()]);
    assert!(code == 2 && text.contains("use --in-place"), "{text}");
}

/// Shifts the positions of a log, as a work offset would.
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

const HEADING: &str = "; probed on a Monday\n# machine hexapod.ini\n# geometry 1844604530\n\
    # tool 0 0 60\n# coordinates machine\n# plate 0.9 -0.7 200.4 0 0 0.4\n";

/// Returns the output of PROBEOPEN for the touches of a log: with a fast touch before each.
fn points(log: &str) -> String {
    let mut text = String::from(HEADING);
    for at in log.lines().filter_map(|line| Some(line.split_once(" at ")?.1)) {
        let mut slow: Vec<f64> = at.split(' ').map(|word| word.parse().unwrap()).collect();
        slow.extend([0.0; 3]);
        let mut fast = slow.clone();
        // F900 over a cycle of 1 ms, on either side.
        fast[2] += 0.015;
        for line in [fast, slow] {
            let words: Vec<String> = line.iter().map(|x| format!("{x:.6}")).collect();
            writeln!(text, "{}", words.join(" ")).unwrap();
        }
    }
    text
}

#[test]
fn points_of_probeopen_give_the_result_of_a_log_of_the_same_touches() {
    let folder = tempfile::tempdir().unwrap();
    let mut shop = Shop::new();
    let log = shop.log(&TILTS);
    let tolerance = Tolerance { trigger: 0.05, ..Tolerance::of_lengths(1.0) };
    let wishes = Wishes { tolerance, noise: None, plate: Some(plate_file()) };
    let of = |name: &str, text: &str| {
        let file = folder.path().join(name);
        fs::write(&file, text).unwrap();
        let Given { model, readings, .. } = study::read(&shop.config, &[file], &wishes).unwrap();
        let found = fit(&model, &readings, None).unwrap();
        let reported = |r: &Reading| (r.measured, r.name.split_once(": ").unwrap().1.to_string());
        (readings.iter().map(reported).collect::<Vec<_>>(), found)
    };
    let (touches, by_log) = of("probe.log", &log);
    let (same, by_points) = of("probe.txt", &points(&log));
    assert_eq!(touches, same);
    for (k, (a, b)) in by_log.changes.iter().zip(&by_points.changes).enumerate() {
        // Both are rounded to 1e-6, a six hundredth of the noise; ten times that.
        assert!((a - b).abs() < 0.02 * by_log.deviation(k), "{k}: {a} {b}");
    }
    let (text, code) = answer(folder.path(), &points(&log), &[]);
    assert_eq!(code, 0, "{text}");
}

#[test]
fn the_offset_of_the_spindle_is_no_part_of_the_tip_that_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hexapod.ini");
    let text = fs::read_to_string(shipped::ini("hexapod")).unwrap();
    fs::write(&file, text.replace("[PKM]\n", "[PKM]\nSPINDLE_OFFSET = 20\n")).unwrap();
    let mut shop = Shop { config: test_support::shipped::first_of(&file), ..Shop::new() };
    assert_eq!(shop.config.spindle.z, 20.0);
    let log = shop.log(&TILTS);
    let points = points(&log).replace("200.4 0 0 0.4", "220.4 0 0 0.4");
    let wishes =
        Wishes { tolerance: Tolerance::of_lengths(1.0), noise: None, plate: Some(plate_file()) };
    for text in [log, points] {
        let probed = folder.path().join("probed");
        fs::write(&probed, text).unwrap();
        let Given { model, readings, .. } = study::read(&shop.config, &[probed], &wishes).unwrap();
        // With an offset of 20 mm, joints would belong to another pose.
        assert!(fit(&model, &readings, None).unwrap().rms() < NOISE);
    }
}

#[test]
fn errors_in_points_of_probeopen_are_reported_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let points = points(&Shop::new().log(&TILTS[..2]));
    let changed = |from: &str, to: &str| {
        assert!(points.contains(from), "{from}");
        points.replacen(from, to, 1)
    };
    // Line 8 is the first slow touch, in hole 1.
    let lines: Vec<&str> = points.lines().collect();
    let with = |line: &str| [&lines[..8], &[line], &lines[8..]].concat().join("\n");
    let scaled = |by: f64| {
        let scale = |line: &&str| match line.starts_with(['#', ';']) {
            true => line.to_string(),
            false => {
                let mut x: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
                x[..3].iter_mut().for_each(|x| *x *= by);
                x.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(" ")
            }
        };
        lines.iter().map(scale).collect::<Vec<_>>().join("\n")
    };
    let cases = [
        (changed("# machine hexapod.ini\n", ""), ":1: expected a line \"# machine hexapod.ini\""),
        (
            changed("machine hexapod", "machine lathe"),
            ":2: points of lathe.ini: expected points of",
        ),
        (changed("# geometry 1844604530\n", ""), ":1: expected a line \"# geometry HASH\""),
        (changed("y 1844604530", "y 1844604531"), ":3: measured with geometry 0x6df26e73"),
        (changed("y 1844604530", "y lost"), ":3: \"lost\": expected a line \"# geometry HASH\""),
        (changed("# tool 0 0 60\n", ""), ":1: expected a line \"# tool X Y Z\""),
        (changed("tool 0 0 60", "tool 0 60"), ":4: \"0 60\": expected a line \"# tool X Y Z\""),
        (changed("# tool", "# tool 0 0 50\n# tool"), ":5: \"tool\" appears twice"),
        (changed("# coordinates machine\n", ""), ":1: expected a line \"# coordinates machine\""),
        (
            changed("coordinates machine", "coordinates G54"),
            ":5: coordinates G54: expected machine",
        ),
        (
            changed("# plate 0.9 -0.7 200.4 0 0 0.4\n", ""),
            ":1: expected a line \"# plate X Y Z A B C\"",
        ),
        (
            changed("plate 0.9 -0.7 200.4", "plate 0.9 -0.7 100"),
            "is neither on the face nor down in a hole",
        ),
        (changed("plate 0.9 -0.7", "plate 9 9"), " is not on a wall: the axis of hole 1 is "),
        (scaled(1.0 / 25.4), ":7: in another unit than the machine"),
        (with("1 2 3 4 5 6"), ":9: \"1 2 3 4 5 6\" is not a line of PROBEOPEN"),
        (with("1 2 3 4 5 6 0 0 nan"), "is not a line of PROBEOPEN"),
        (with("hello"), ":9: \"hello\" is not a line of PROBEOPEN"),
        (with("1 2 3 4 5 6 0 0 1"), ":9: U, V and W must be 0"),
        (with(lines[7]), ":9: this line repeats line 8"),
        (with("-50 0 197 0 0 0 0 0 0"), " on the plate is not on a wall"),
        (with("-75 0 203 0 0 0 0 0 0"), "is over hole 4 or its edge"),
        (with("-72 0 201 0 0 0 0 0 0"), "is neither on the face nor down in a hole"),
        (with("-72 0 240 0 0 0 0 0 0"), "is neither on the face nor down in a hole"),
        (lines[..26].join("\n"), "touches in 2 holes do not determine the position of the plate"),
        (lines[..6].join("\n"), ":1: neither a log"),
    ];
    for (text, expected) in cases {
        let (reported, code) = answer(folder.path(), &text, &["--write", "new.ini"]);
        assert_eq!(code, 2, "{expected}: {reported}");
        assert!(reported.contains(expected), "{expected}: {reported}");
        assert!(!folder.path().join("new.ini").exists());
    }
}

#[test]
fn an_outlier_is_named_with_its_line_and_one_orientation_is_said_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut shop = Shop::new();
    let mut log = shop.log(&TILTS);
    // A chip on the wall: the ball was 0.05 mm early, and so were the joints.
    let spoilt = Shop::chip(&mut shop, &log, 61);
    log = spoilt;
    let (text, code) = answer(folder.path(), &log, &[]);
    assert_eq!(code, 1, "{text}");
    // 0.05 minus the influence of the touch itself on the fit.
    assert!(
        text.contains(
            "probe.log:123: hole 4, wall at +X is left out: it differs from the others by 0.04"
        ),
        "{text}"
    );
    let level = shop.log(&TILTS[..1]);
    let (text, _) = answer(folder.path(), &level, &[]);
    assert!(text.contains("measure at several tilts"), "{text}");
}

impl Shop {
    /// Returns the log with touch `number`, along +X, 0.05 mm short of the wall.
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
