// SPDX-License-Identifier: GPL-2.0-or-later
//! Traces made up from the host library are judged as they deserve, and the report of
//! `pkm-report` holds what it promises.

use kinematics::Pose;
use pkm::machine::{JOINTS, MachineConfig};
use pkm::trace::{RunResult, Sample, judge, read_trace};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

const PERIOD: f64 = 1e-3;

fn ini() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hexapod/hexapod.ini")
}

fn config() -> MachineConfig {
    MachineConfig::read(&ini()).unwrap()
}

/// A smooth tilt out and back, from rest to rest; drives without lag.
fn samples(config: &MachineConfig) -> Vec<Sample> {
    let cycles = 4000;
    let mut samples: Vec<Sample> = (0..cycles)
        .map(|k| {
            let phase = (k as f64 - 500.0).clamp(0.0, 3000.0) / 3000.0 * std::f64::consts::TAU;
            let share = 0.5 - 0.5 * phase.cos();
            let mut pose = config.home;
            pose[0] += 60.0 * share * phase.sin();
            pose[2] -= 40.0 * share;
            pose[3] += 20.0 * share;
            pose[4] += 10.0 * share;
            at(config, k, pose)
        })
        .collect();
    for k in (1..samples.len()).rev() {
        samples[k].forward = samples[k - 1].pose;
    }
    samples
}

fn at(config: &MachineConfig, k: usize, pose: [f64; 6]) -> Sample {
    let asked = Pose::from_degrees(pose);
    let joints = config.machine.inverse(&asked, &config.spindle).unwrap();
    Sample {
        time: k as f64 * PERIOD,
        in_world: k >= 100,
        pose,
        joints,
        motors: joints,
        forward: pose,
        corrections: config.machine.corrections(&asked, &config.spindle).unwrap(),
        tool_z: 0.0,
        iterations: 2.0,
        residual: 1e-12,
    }
}

fn result(config: &MachineConfig) -> RunResult {
    RunResult { ok: true, geometry_hash: config.geometry.hash(), ..RunResult::default() }
}

/// Names of the figures that are not as they must be.
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
fn a_joint_off_by_a_nanometre_and_more_is_seen() {
    let names = bad(|samples, _| samples[2000].joints[3] += 2e-9);
    assert!(names.contains(&"joints against host inverse".into()), "{names:?}");
}

#[test]
fn a_jump_of_a_motor_is_seen_in_speed_and_acceleration() {
    let names = bad(|samples, _| samples[2000..].iter_mut().for_each(|s| s.motors[0] += 2.0));
    assert!(names.contains(&"joint speed, motors".into()), "{names:?}");
    assert!(names.contains(&"joint acceleration, motors".into()), "{names:?}");
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
    assert_eq!(names, ["forward of the feedback (joints)"]);
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
fn a_cone_left_in_the_program_is_seen() {
    let mut config = config();
    config.base_cone[4] = Some(1.0);
    let report = judge(&config, &samples(&config), &result(&config)).unwrap();
    let bad: Vec<_> = report.checks.iter().filter(|c| !c.kept).map(|c| c.name.as_str()).collect();
    assert_eq!(bad, ["cone of the base joints, program"]);
}

fn csv(samples: &[Sample]) -> String {
    let mut text = String::from("t_s,phase,x,y,z,a,b,c");
    for prefix in ["j", "m"] {
        (0..JOINTS).for_each(|i| write!(text, ",{prefix}{i}").unwrap());
    }
    text.push_str(",fx,fy,fz,fa,fb,fc");
    (0..JOINTS).for_each(|i| write!(text, ",corr{i}").unwrap());
    text.push_str(",tool_z,iterations,residual\n");
    for s in samples {
        write!(text, "{},{}", s.time, if s.in_world { 2 } else { 0 }).unwrap();
        let sixes = [&s.pose, &s.joints, &s.motors, &s.forward, &s.corrections];
        sixes.into_iter().flatten().for_each(|v| write!(text, ",{v}").unwrap());
        writeln!(text, ",{},{},{}", s.tool_z, s.iterations, s.residual).unwrap();
    }
    text
}

#[test]
fn a_trace_reads_back_to_the_same_bits_and_bad_columns_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trace.csv");
    let written = samples(&config());
    std::fs::write(&file, csv(&written)).unwrap();
    assert_eq!(read_trace(&file).unwrap(), written);
    std::fs::write(&file, csv(&written).replace("corr5", "corr6")).unwrap();
    assert!(read_trace(&file).unwrap_err().contains("expected the columns t_s,phase,x"));
}

#[test]
fn the_report_is_written_and_the_exit_code_tells_the_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let (trace, json, out) =
        (folder.path().join("t.csv"), folder.path().join("r.json"), folder.path().join("out"));
    let config = config();
    std::fs::write(&trace, csv(&samples(&config))).unwrap();
    let hash = config.geometry.hash();
    let run = |hash: u32, trace: &Path| {
        std::fs::write(&json, format!(r#"{{"ok": true, "geometry_hash": {hash}}}"#)).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_pkm-report"));
        command.args([&ini(), trace, &json, &out]).output().unwrap()
    };
    let good = run(hash, &trace);
    assert_eq!(good.status.code(), Some(0), "{good:?}");
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 6);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("struts.svg") && page.contains("largest nut correction"));
    assert_eq!(run(hash ^ 1, &trace).status.code(), Some(1));
    assert_eq!(run(hash, &out.join("none.csv")).status.code(), Some(2));
}
