// SPDX-License-Identifier: GPL-2.0-or-later
//! Corrections of joints while LinuxCNC runs a program, in virtual time.

use crate::shipped;
use kinematics::{Joints, Pose, Vector3};
use std::fmt::Write as _;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use workbench::control::process::{self, Options};
use workbench::control::row::{Ending, Row};
use workbench::limits;
use workbench::read::machine::MachineConfig;

/// 100 µm at 1 µm/s, in millimetres.
const LIMIT: f64 = 0.1;
const RATE: f64 = 1e-3;
/// Servo period, seconds.
const PERIOD: f64 = 1e-3;
/// Joint values of some hundred millimetres through text, and the smoothing's sums.
const SAME_MM: f64 = 1e-9;

/// The hexapod with struts that may be corrected, of which strut 1 grows and strut 4 shrinks.
fn warm_hexapod(folder: &Path) -> MachineConfig {
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
    MachineConfig::read(&folder.join("hexapod.ini")).unwrap()
}

/// Cycles by which LinuxCNC's smoothing is late.
const SMOOTHING: usize = 2;

/// The first row that is looked at: before it the smoothing of LinuxCNC fills.
const FIRST: usize = 20;

/// Tilted circles for longer than the correction takes.
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
    let outcome = process::run(&config, &file, &options, |row| {
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
    // It comes in from the first cycle of the control, before the program begins.
    let begin = added(FIRST, 1);
    println!("{} cycles, {begin} mm at the first", rows.len());
    assert!(begin < LIMIT / 2.0, "{begin}");
    // A line is smoothed to itself, two cycles late; the corner where it ends is rounded as all else is.
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
    let ranges = |config: &MachineConfig| {
        use kinematics::{Limit, Part};
        let of = |limit| limits::range(config, limit, Part::Joint(1)).unwrap();
        [of(Limit::JointRange), of(Limit::JointSpeed)]
    };
    let [[low, high], [_, speed]] = ranges(&plain);
    assert_eq!(ranges(&warm), [[low + LIMIT, high - LIMIT], [RATE - speed, speed - RATE]]);
}
