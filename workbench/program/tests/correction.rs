// SPDX-License-Identifier: GPL-2.0-or-later
//! Corrections of joints while LinuxCNC runs a program, in virtual time, and the limits that remain for programs.

use crate::preflight::follow;
use kinematics::{Joints, Limit, Pose, Vector3};
use linuxcnc::process::{self, Options};
use linuxcnc::row::{Ending, Row};
use machine::limits;
use machine::read::mechanism::Mechanism;
use program::motion;
use program::preflight::judge;
use program::report::Preflight;
use program::travel::{self, Stand};
use std::fmt::Write as _;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use test_support::shipped;

/// 100 µm at 1 µm/s, in millimeters.
const LIMIT: f64 = 0.1;
const RATE: f64 = 1e-3;
/// Servo period, seconds.
const PERIOD: f64 = 1e-3;
/// Rounding of joint values of some hundred millimeters through text, and of the smoothing's sums.
const SAME_MM: f64 = 1e-9;

/// Returns the hexapod with corrected struts: strut 1 becomes longer and strut 4 shorter.
fn warm_hexapod(folder: &Path) -> Mechanism {
    let source = shipped::folder("hexapod");
    let mut text = fs::read_to_string(source.join("hexapod.ini")).unwrap();
    for n in 0..6 {
        let section = format!("[JOINT_{n}]\n");
        let keys = format!("{section}CORRECTION_LIMIT = {LIMIT}\nCORRECTION_RATE = {RATE}\n");
        assert_eq!(text.matches(&section).count(), 1);
        text = text.replace(&section, &keys);
    }
    fs::write(folder.join("hexapod.ini"), text).unwrap();
    let heat = "setp pkmkins.joint-correction.1 0.1\nsetp pkmkins.joint-correction.4 -0.1\n";
    fs::write(folder.join("heat.hal"), heat).unwrap();
    fs::copy(source.join("hexapod.tbl"), folder.join("hexapod.tbl")).unwrap();
    test_support::shipped::first_of(&folder.join("hexapod.ini"))
}

/// Delay of LinuxCNC's smoothing, in cycles.
const SMOOTHING: usize = 2;

/// The first row that is checked: before it LinuxCNC's smoothing is not yet filled.
const FIRST: usize = 20;

/// Returns tilted circles for longer than the correction takes.
fn program() -> String {
    let mut text = String::from("G21 G90 G64 P0.01\nG1 F1500 X40 Z240\n");
    for n in 0..30 {
        let tilt = if n % 2 == 0 { 6 } else { -6 };
        let _ = writeln!(text, "G3 X40 Y0 I-40 J0 A{tilt} B{tilt} F4000");
    }
    text + "M2\n"
}

#[test]
fn a_correction_of_100_um_comes_in_while_a_program_runs_and_the_pose_is_that_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let config = warm_hexapod(folder.path());
    let file = folder.path().join("circles.ngc");
    fs::write(&file, program()).unwrap();
    let mut rows: Vec<Row> = vec![];
    let options = Options { hal: vec![folder.path().join("heat.hal")], ..Options::default() };
    let outcome = process::run(&config.clone().into(), &file, &options, |row| {
        rows.push(*row);
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(outcome.ending, Ending::Finished, "{:?}", outcome.messages);
    assert!(outcome.messages.is_empty(), "{:?}", outcome.messages);
    let inverse = |row: &Row| -> Joints {
        let pose = Pose::from_degrees(row.pose);
        config.machine.inverse(&pose, &Vector3::from(row.tool)).unwrap()
    };
    let inverse: Vec<Joints> = rows.iter().map(inverse).collect();
    // LinuxCNC's smoothing: a cubic B-spline over three cycles.
    let smoothed = |n: usize, at: &dyn Fn(usize) -> f64| {
        let middle = n - SMOOTHING;
        (at(middle - 1) + 4.0 * at(middle) + at(middle + 1)) / 6.0
    };
    let added = |n: usize, i: usize| rows[n].joints[i] - smoothed(n, &|m| inverse[m][i]);
    // It is applied from the first cycle of the control, before the program begins.
    let begin = added(FIRST, 1);
    println!("{} cycles, {begin} mm at the first", rows.len());
    assert!(begin < LIMIT / 2.0, "{begin}");
    // A line is smoothed to itself, two cycles late; the corner at its end is rounded like everything else.
    let ramp =
        |n: usize| (begin + (n as f64 - (FIRST - SMOOTHING) as f64) * RATE * PERIOD).min(LIMIT);
    for n in FIRST..rows.len() {
        let wanted = smoothed(n, &ramp);
        for (i, sign) in [0.0, 1.0, 0.0, 0.0, -1.0, 0.0].into_iter().enumerate() {
            let off = added(n, i) - sign * wanted;
            assert!(off.abs() < SAME_MM, "strut {i}, cycle {n}: off by {off}");
        }
    }
    let end = rows.len() - 1;
    assert!((added(end, 1) - LIMIT).abs() < SAME_MM && (added(end, 4) + LIMIT).abs() < SAME_MM);
    let most =
        |i: usize| rows.windows(2).map(move |two| (two[1].joints[i] - two[0].joints[i]).abs());
    for (i, joint) in config.joints.iter().enumerate() {
        assert!(most(i).fold(0.0, f64::max) <= joint.max_velocity * PERIOD, "strut {i}");
    }
}

#[test]
fn proofs_leave_room_for_what_may_be_corrected() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, warm] = [shipped::config("hexapod"), warm_hexapod(folder.path())];
    let ranges = |config: &Mechanism| {
        use kinematics::{Limit, Part};
        let of = |limit| limits::range(config, limit, Part::Joint(1)).unwrap();
        [of(Limit::JointRange), of(Limit::JointSpeed)]
    };
    let [[low, high], [_, speed]] = ranges(&plain);
    assert_eq!(ranges(&warm), [[low + LIMIT, high - LIMIT], [RATE - speed, speed - RATE]]);
}

/// Returns a shipped machine with `keys` replaced or added in these sections of its INI file.
fn changed(machine: &str, sections: &[&str], keys: &[(&str, &str)], folder: &Path) -> Mechanism {
    let mut text = fs::read_to_string(shipped::ini(machine)).unwrap();
    for section in sections {
        let head = format!("[{section}]\n");
        let (before, rest) = text.split_once(&head).unwrap();
        let (own, after) = rest.split_once("\n[").unwrap_or((rest, ""));
        let is_kept =
            |line: &&str| !keys.iter().any(|(key, _)| line.starts_with(&format!("{key} =")));
        let mut body: Vec<String> = own.lines().filter(is_kept).map(Into::into).collect();
        body.splice(0..0, keys.iter().map(|(key, value)| format!("{key} = {value}")));
        text = format!("{before}{head}{}\n\n[{after}", body.join("\n"));
    }
    let name = format!("{machine}.ini");
    fs::write(folder.join(&name), text).unwrap();
    let table = format!("{machine}.tbl");
    fs::copy(shipped::folder(machine).join(&table), folder.join(table)).unwrap();
    test_support::shipped::first_of(&folder.join(name))
}

const HEXAPOD: [&str; 6] = ["JOINT_0", "JOINT_1", "JOINT_2", "JOINT_3", "JOINT_4", "JOINT_5"];

/// Judges a program as `pkm preflight`, path and time.
fn judged(config: &Mechanism, program: &str, folder: &Path) -> Preflight {
    let file = folder.join("program.ngc");
    fs::write(&file, program).unwrap();
    let judged = judge(&config.clone().into(), &file, &Options::default(), &mut |_| ());
    let found = judged.unwrap().found;
    assert!(found.time.is_whole(), "{:?}", found.time);
    found
}

#[test]
fn a_program_is_judged_by_the_speed_that_the_correction_leaves() {
    let folder = tempfile::tempdir().unwrap();
    let program = "G21 G90 G64 P0.01\nG1 X20 Y0 Z250 F3000\nG1 X-20\nG1 X20\nM2\n";
    let limits =
        |most| [("MAX_VELOCITY", most), ("CORRECTION_LIMIT", "1"), ("CORRECTION_RATE", "1")];
    let found = judged(
        &changed("hexapod", &HEXAPOD, &limits("22.5"), folder.path()),
        program,
        folder.path(),
    );
    let fast = found.breaks.iter().find(|message| message.limit == Limit::JointSpeed);
    let fast = fast.unwrap_or_else(|| panic!("{:?}", found.margins));
    assert!(fast.text.contains("exceeds 21.5 mm/s") && fast.text.contains("22.0"), "{}", fast.text);
    let found = judged(
        &changed("hexapod", &HEXAPOD, &limits("23.5"), folder.path()),
        program,
        folder.path(),
    );
    assert!(found.fits(), "{:?}", found.breaks);
}

#[test]
fn a_path_is_judged_by_the_range_that_the_correction_leaves() {
    let folder = tempfile::tempdir().unwrap();
    let keys = [("CORRECTION_LIMIT", "450"), ("CORRECTION_RATE", "1")];
    let config = changed("hexapod", &HEXAPOD, &keys, folder.path());
    let program = "G21 G90\nM52 P1\nG1 F1000 Z400\nG1 Z250\nM2\n";
    let found = judged(&config, program, folder.path());
    let left: Vec<_> =
        found.breaks.iter().filter(|message| message.limit == Limit::JointRange).collect();
    assert_eq!(left.len(), 6, "{:?}", found.breaks);
    assert!(left.iter().all(|message| message.text.contains("840 to 960 mm")), "{left:?}");
    let strut = found.ranges.iter().find(|range| range.part == "strut 0").unwrap();
    assert_eq!(strut.allowed, [840.0, 960.0]);
    // The travel available for jogs, as `pkm travel` reports it.
    let whole = config.clone().into();
    let travel = travel::travel(&whole, &Stand::home(&whole)).unwrap();
    let up = travel.iter().find(|way| way.letter == 'Z').unwrap().plus.clone();
    assert!(up.stop.unwrap().starts_with("strut"), "{travel:?}");
}

/// LinuxCNC moves at exactly the acceleration of the axis, which equals that of every joint.
#[test]
fn a_joint_at_the_acceleration_and_speed_of_its_axis_is_within_them() {
    let folder = tempfile::tempdir().unwrap();
    let joints = ["JOINT_0", "JOINT_1", "JOINT_2"];
    let keys = [("MAX_VELOCITY", "100"), ("MAX_ACCELERATION", "1000")];
    let config = changed("linear-delta", &joints, &keys, folder.path());
    let program = "G21 G90 G94 G61\nM52 P1\nG0 X0 Y0 Z20\nG0 Z80\nG1 Z30 F6000\nM2\n";
    let found = judged(&config, program, folder.path());
    assert!(found.fits(), "{:?}", found.breaks);
    let least = found.margins.iter().find(|margin| margin.limit == Limit::JointAcceleration);
    assert!(least.unwrap().value.abs() < 1e-6, "{least:?}");
    let keys = [("MAX_VELOCITY", "100"), ("MAX_ACCELERATION", "999.9999")];
    let config = changed("linear-delta", &joints, &keys, folder.path());
    assert!(!judged(&config, program, folder.path()).fits());
}

/// A table axis is a coordinate: it may reach its limit, but not exceed it.
#[test]
fn a_table_axis_may_go_to_its_limit() {
    let folder = tempfile::tempdir().unwrap();
    let program = "G21 G90 G94\nM52 P1\nG1 X150 F3000\nG1 X-150\nG0 X0\nM2\n";
    let of = |low, high| {
        let keys = [("MIN_LIMIT", low), ("MAX_LIMIT", high)];
        changed("pyramid", &["JOINT_4"], &keys, folder.path())
    };
    let found = judged(&of("-150", "150"), program, folder.path());
    assert!(found.fits(), "{:?}", found.breaks);
    let table =
        |found: &Preflight| found.ranges.iter().find(|range| range.part == "table X").unwrap().used;
    assert_eq!(table(&found), [-150.0, 150.0]);
    let found = judged_path(&of("-150", "149.999"), program, folder.path());
    assert!(!found.fits());
    // Nothing beyond the ends of the moves is reported as used.
    assert_eq!(table(&found), [-150.0, 150.0]);
    // Ends that are not exact for any halving of the move.
    let program = "G21 G90\nG0 X-33.3\nG1 X140.1 F3000\nG1 X-99.7\nG1 X0\nM2\n";
    let found = judged_path(&of("-99.7", "140.1"), program, folder.path());
    assert!(found.fits(), "{:?}", found.breaks);
}

fn judged_path(config: &Mechanism, program: &str, folder: &Path) -> Preflight {
    let file = folder.join("program.ngc");
    fs::write(&file, program).unwrap();
    follow(config, &motion::moves(&config.clone().into(), &file, None).unwrap())
}
