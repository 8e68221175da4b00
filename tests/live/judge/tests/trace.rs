// SPDX-License-Identifier: GPL-2.0-or-later
//! Tests the verdicts on traces generated with the host library, and the content of `judge`'s
//! report.

use draw::sample::Sample;
use judge::trace::{RunResult, judge, read_trace};
use kinematics::{MAX_EXTRA, Pose, Vector3};
use machine::read::joints::{ExtraAxis, JointKind};
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

const PERIOD: f64 = 1e-3;

/// A tool that extends to the side, in units of any of the machines.
const TOOL: [f64; 3] = [1.5, -0.5, 2.0];

fn ini(machine: &str) -> PathBuf {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../configs");
    configs.join(machine).join(format!("{machine}.ini"))
}

fn config_of(machine: &str) -> Mechanism {
    MachineConfig::read(&ini(machine)).unwrap().mechanism(1).unwrap()
}

fn config() -> Mechanism {
    config_of("hexapod")
}

/// Motion of the generated trace from home: smoothly out and back in X and Z, and a tilt.
const HEXAPOD: [f64; 6] = [60.0, 0.0, -40.0, 20.0, 10.0, 0.0];

fn samples(config: &Mechanism) -> Vec<Sample> {
    samples_by(config, HEXAPOD)
}

/// Returns samples from rest to rest; drives without lag.
fn samples_by(config: &Mechanism, by: [f64; 6]) -> Vec<Sample> {
    let cycles = 4000;
    let mut samples: Vec<Sample> = (0..cycles)
        .map(|k| {
            let phase = (k as f64 - 500.0).clamp(0.0, 3000.0) / 3000.0 * std::f64::consts::TAU;
            let share = 0.5 - 0.5 * phase.cos();
            let mut pose: [f64; 6] = std::array::from_fn(|i| config.home[i] + share * by[i]);
            pose[0] += (phase.sin() - 1.0) * share * by[0];
            at(config, k, pose)
        })
        .collect();
    for k in (1..samples.len()).rev() {
        samples[k].forward = samples[k - 1].pose;
    }
    samples
}

fn at(config: &Mechanism, k: usize, pose: [f64; 6]) -> Sample {
    let asked = Pose::from_degrees(pose);
    let tool = config.spindle + Vector3::from(TOOL);
    let joints = config.machine.inverse(&asked, &tool).unwrap();
    Sample {
        time: k as f64 * PERIOD,
        in_world: k >= 100,
        pose,
        joints,
        motors: joints,
        extra: std::array::from_fn(|n| {
            let of_axis = |axis: &ExtraAxis| axis.joint.home + n as f64 + pose[0] - config.home[0];
            config.extra.get(n).map_or(0.0, of_axis)
        }),
        passed: 0.0,
        forward: pose,
        corrections: config.machine.at(&asked, &tool).unwrap().corrections(),
        tool: tool.into(),
        on_work: None,
        iterations: 2.0,
        residual: 1e-12,
    }
}

fn result(config: &Mechanism) -> RunResult {
    RunResult { ok: true, geometry_hash: config.hash, ..RunResult::default() }
}

/// Returns names of the figures that exceed their bounds.
fn bad(change: impl Fn(&mut Vec<Sample>, &mut RunResult)) -> Vec<String> {
    let config = config();
    let (mut samples, mut result) = (samples(&config), result(&config));
    change(&mut samples, &mut result);
    let report = judge(&config, &samples, &result).unwrap();
    report.checks.into_iter().filter(|check| !check.kept).map(|check| check.name).collect()
}

#[test]
fn a_faultless_trace_passes() {
    assert_eq!(bad(|_, _| {}), Vec::<String>::new());
}

#[test]
fn a_joint_off_by_a_nanometer_and_more_is_seen() {
    let names = bad(|samples, _| samples[2000].joints[3] += 2e-9);
    assert!(names.contains(&"struts against host inverse".into()), "{names:?}");
}

#[test]
fn a_jump_of_a_motor_is_seen_in_speed_and_acceleration() {
    let names = bad(|samples, _| samples[2000..].iter_mut().for_each(|s| s.motors[0] += 2.0));
    assert!(names.contains(&"joint speed, motors".into()), "{names:?}");
    assert!(names.contains(&"joint acceleration, motors".into()), "{names:?}");
}

#[test]
fn a_drive_that_settles_only_after_world_mode_has_begun_is_not_taken_for_one_at_rest() {
    let config = config();
    let names = bad(|samples, _| {
        for k in 100..105 {
            samples[k].motors[3] -= 3e-5;
            let (seed, tool) = (Pose::from_degrees(samples[k].pose), samples[k].tool.into());
            let found = config.machine.forward(&samples[k].motors, &seed, &tool, &config.solver);
            samples[k + 1].forward = found.unwrap().pose.to_degrees();
        }
    });
    assert_eq!(names, [""; 0]);
}

#[test]
fn too_many_iterations_and_a_residual_are_seen() {
    let names =
        bad(|samples, _| (samples[9 * 100].iterations, samples[900].residual) = (4.0, 1e-8));
    assert_eq!(names, ["residual shown", "iterations of forward"]);
}

#[test]
fn a_wrong_forward_pose_is_seen() {
    let names = bad(|samples, _| samples[2000].forward[5] += 1e-6);
    assert_eq!(names, ["struts, forward of the feedback"]);
}

#[test]
fn messages_faults_and_another_geometry_are_seen() {
    let names = bad(|_, result| {
        result.messages.push(("error".into(), "joint 1 following error".into()));
        result.fault_count = 1;
        result.geometry_hash ^= 1;
    });
    let expected =
        ["messages to the operator", "faults of the module", "geometry frozen by the module"];
    assert_eq!(names, expected);
}

#[test]
fn a_strut_beyond_its_limit_is_seen() {
    let mut config = config();
    config.joints[2].max = 900.0;
    let report = judge(&config, &samples(&config), &result(&config)).unwrap();
    let strut = report.checks.iter().find(|check| check.name == "strut 2").unwrap();
    assert!(!strut.kept, "{strut:?}");
}

#[test]
fn a_motor_at_its_limit_may_round_beyond_it() {
    let config = config();
    let at_end = |by: f64| {
        let mut samples = samples(&config);
        samples[2000..].iter_mut().for_each(|s| s.motors[2] = config.joints[2].max + by);
        let report = judge(&config, &samples, &result(&config)).unwrap();
        report.checks.into_iter().find(|check| check.name == "strut 2").unwrap().kept
    };
    assert!(at_end(1e-13) && !at_end(1e-8));
}

#[test]
fn a_cone_left_in_the_program_is_seen() {
    let mut config = config();
    config.angles[4].cones[0] = Some(1.0);
    let report = judge(&config, &samples(&config), &result(&config)).unwrap();
    let bad: Vec<_> = report.checks.iter().filter(|c| !c.kept).map(|c| c.name.as_str()).collect();
    assert_eq!(bad, ["base cone, program"]);
}

/// Machines with joints other than struts, and their motions.
const OTHERS: [(&str, [f64; 6]); 4] = [
    ("four-rod-lathe", [50.0, 20.0, -40.0, 0.0, 10.0, 0.0]),
    ("pyramid", [60.0, 30.0, -40.0, 10.0, 10.0, 0.0]),
    ("rotary-delta", [1.0, 1.0, -2.0, 0.0, 0.0, 0.0]),
    ("lathe-counter-spindle", [50.0, 20.0, -40.0, 0.0, 10.0, 0.0]),
];

#[test]
fn traces_of_carriages_tables_and_arms_are_judged_joint_by_joint() {
    for (machine, by) in OTHERS {
        let config = config_of(machine);
        let (faultless, result) = (samples_by(&config, by), result(&config));
        let bad = |samples: &[Sample]| -> Vec<String> {
            let report = judge(&config, samples, &result).unwrap();
            report.checks.into_iter().filter(|c| !c.kept).map(|c| c.name).collect()
        };
        assert_eq!(bad(&faultless), Vec::<String>::new(), "{machine}");
        for (i, joint) in config.joints.iter().enumerate() {
            let mut samples = faultless.clone();
            samples[2000].joints[i] += 2e-9;
            let name = format!("{} against host inverse", joint.kind.plural());
            assert!(bad(&samples).contains(&name), "{machine} {}: {name}", joint.name);
        }
        let mut samples = faultless.clone();
        samples[2000].forward[2] += 1e-6;
        let names = bad(&samples);
        assert!(names[0].ends_with(", forward of the feedback"), "{machine}: {names:?}");
    }
}

#[test]
fn carriages_that_lag_apart_are_no_fault_of_a_redundant_machine() {
    let config = config_of("pyramid");
    let mut samples = samples_by(&config, OTHERS[1].1);
    for sample in &mut samples[1000..3000] {
        sample.motors[1] += 0.2;
    }
    for k in 1001..=3000 {
        let (seed, tool) = (Pose::from_degrees(samples[k].forward), samples[k].tool());
        let found = config.machine.forward(&samples[k - 1].motors, &seed, &tool, &config.solver);
        let found = found.unwrap();
        (samples[k].forward, samples[k].residual) = (found.pose.to_degrees(), found.residual);
    }
    // The sudden lag is a jump of the motors, which is not tested here.
    let report = judge(&config, &samples, &result(&config)).unwrap();
    let bad = report.checks.iter().filter(|c| !c.kept && !c.name.ends_with(", motors"));
    assert_eq!(bad.map(|c| &c.name).collect::<Vec<_>>(), Vec::<&String>::new());
}

fn csv(config: &Mechanism, samples: &[Sample]) -> String {
    let joints = config.joints.len();
    let struts = config.joints.iter().filter(|joint| joint.kind == JointKind::Strut).count();
    let mut text = String::from("t_s,phase,x,y,z,a,b,c");
    let extra = config.extra.len();
    for (prefix, count) in [("j", joints + extra), ("m", joints + extra)] {
        (0..count).for_each(|i| write!(text, ",{prefix}{i}").unwrap());
    }
    text.push_str(",fx,fy,fz,fa,fb,fc");
    (0..struts).for_each(|i| write!(text, ",corr{i}").unwrap());
    text.push_str(",tool_x,tool_y,tool_z,iterations,residual\n");
    for s in samples {
        write!(text, "{},{}", s.time, if s.in_world { 2 } else { 0 }).unwrap();
        let (joints, motors, extra) = (&s.joints[..joints], &s.motors[..joints], &s.extra[..extra]);
        let mut pose = s.pose;
        for (place, value) in config.extra_axes.places().zip(extra).filter(|(k, _)| *k < 6) {
            pose[place] = *value;
        }
        let (forward, corrections) = (&s.forward[..], &s.corrections[..struts]);
        let parts = [&pose[..], joints, extra, motors, extra, forward, corrections, &s.tool];
        parts.into_iter().flatten().for_each(|v| write!(text, ",{v}").unwrap());
        writeln!(text, ",{},{}", s.iterations, s.residual).unwrap();
    }
    text
}

#[test]
fn a_trace_reads_back_to_the_same_bits_and_bad_columns_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trace.csv");
    for (machine, by) in OTHERS.into_iter().chain([("hexapod", HEXAPOD)]) {
        let config = config_of(machine);
        let written = samples_by(&config, by);
        let text = csv(&config, &written);
        std::fs::write(&file, &text).unwrap();
        assert_eq!(read_trace(&config, &file).unwrap(), written, "{machine}");
        let last = format!("m{}", config.joints.len() + config.extra.len() - 1);
        std::fs::write(&file, text.replace(&last, "m99")).unwrap();
        let error = read_trace(&config, &file).unwrap_err();
        assert!(error.contains("expected the columns t_s,phase,x"), "{error}");
    }
}

#[test]
fn a_trace_of_a_rotary_table_has_the_tip_on_the_work() {
    let config = config_of("hexapod-rotary-table");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trace.csv");
    let tool = config.spindle + Vector3::from(TOOL);
    let turned = |k: usize| 0.1 * k as f64;
    let row = |k: usize| {
        let mut extra = [0.0; MAX_EXTRA];
        extra[0] = turned(k);
        let [x, y, z, ..] = config.home;
        let programmed = [x + 0.1 * k as f64, y + 3.0, z, 0.0, 0.0, 0.0];
        let own = config.carried(&programmed, &extra, &tool).unwrap();
        let joints = config.machine.inverse(&Pose::from_degrees(own), &tool).unwrap();
        let base = at(&config, k, config.home);
        Sample { pose: programmed, joints, motors: joints, extra, forward: own, ..base }
    };
    let written: Vec<Sample> = (0..300).map(row).collect();
    std::fs::write(&file, csv(&config, &written)).unwrap();
    let read = read_trace(&config, &file).unwrap();
    let along = tool.normalize();
    for (k, (sample, given)) in read.iter().zip(&written).enumerate() {
        let [tip, axis] = sample.on_work.expect("the table carries the work").map(Vector3::from);
        let [x, y, z, ..] = given.pose;
        // Coordinates of some hundred millimeters: rounding.
        assert!((tip - (Vector3::new(x, y, z) - tool)).norm() < 1e-12 * 1e3, "{k} {tip}");
        assert!((sample.place() - tip).norm() == 0.0 && (axis.z - along.z).abs() < 1e-12);
        // On the work, a level tool turns against the table.
        let angle = axis.xy().angle(&along.xy()).to_degrees();
        // acos loses half of the digits at 0.
        assert!((angle - turned(k)).abs() < 1e-5, "{k} {angle}");
    }
}

/// Returns exit code and standard output of judge, which writes into `folder`/out.
fn report(folder: &Path, machine: &str, hash: u32, trace: &Path) -> (Option<i32>, String) {
    let (json, out) = (folder.join("r.json"), folder.join("out"));
    std::fs::write(&json, format!(r#"{{"ok": true, "geometry_hash": {hash}}}"#)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_judge"));
    let output = command.args([&ini(machine), trace, &json, &out]).output().unwrap();
    (output.status.code(), String::from_utf8(output.stdout).unwrap())
}

#[test]
fn the_report_is_written_and_the_exit_code_gives_the_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("t.csv");
    let config = config();
    std::fs::write(&trace, csv(&config, &samples(&config))).unwrap();
    let hash = config.hash;
    let run = |hash: u32, trace: &Path| report(folder.path(), "hexapod", hash, trace);
    let good = run(hash, &trace);
    assert_eq!(good.0, Some(0), "{good:?}");
    assert!(good.1.contains("14 links + 5 loops - 18 joints = 1; mobility by count 6"), "{good:?}");
    let out = folder.path().join("out");
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 7);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("struts.svg") && page.contains("largest nut correction"));
    assert_eq!(run(hash ^ 1, &trace).0, Some(1));
    assert_eq!(run(hash, &out.join("none.csv")).0, Some(2));
}

#[test]
fn the_report_of_any_machine_has_a_plot_for_each_kind_of_joint() {
    for (machine, by) in OTHERS {
        let folder = tempfile::tempdir().unwrap();
        let trace = folder.path().join("t.csv");
        let config = config_of(machine);
        std::fs::write(&trace, csv(&config, &samples_by(&config, by))).unwrap();
        let (code, text) = report(folder.path(), machine, config.hash, &trace);
        assert_eq!(code, Some(0), "{text}");
        let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
        for group in config.all_groups() {
            let stem = group.kind.plural().replace(' ', "-");
            let stem = match (group.kind, group.unit) {
                (JointKind::Extra, "degrees") => format!("rotary-{stem}"),
                (JointKind::Extra, _) => format!("linear-{stem}"),
                _ => stem,
            };
            for plot in ["", "-path", "-speeds"].map(|kind| format!("{stem}{kind}.svg")) {
                assert!(page.contains(&plot), "{machine}: {plot}");
                let svg = std::fs::read_to_string(folder.path().join("out").join(&plot)).unwrap();
                let joints = group.joints.iter().map(|i| &config.joint(*i).name);
                joints.for_each(|name| assert!(svg.contains(name), "{machine} {plot}: {name}"));
            }
        }
        assert!(!page.contains("corrections.svg"), "{machine}");
    }
}
