// SPDX-License-Identifier: GPL-2.0-or-later
//! Traces of a running LinuxCNC, judged against the host library.
//!
//! A trace holds one line a servo cycle; its columns are described in
//! tests/live/README.md. The checks recompute what the module did with the same core,
//! and hold positions, speeds and cones to the limits of the INI file.

use crate::machine::{JOINTS, MachineConfig};
use kinematics::{Fault, Pose, Vector3};
use serde::Deserialize;
use std::fmt;
use std::path::Path;

/// Coarse joint commands against host inverse, in mm.
const JOINT_TOLERANCE_MM: f64 = 1e-9;

/// Host forward of the coarse joints against the commanded pose, as a share of the size.
const ROUND_TRIP: f64 = 1e-10;

/// Joints of the pose that forward shows against the feedback, in units of the
/// convergence criterion: forward stops on the residual of six legs, each within it.
const FEEDBACK: f64 = 10.0;

/// Iterations of forward one servo step away.
const MOST_ITERATIONS: f64 = 3.0;

/// Sampled speeds and accelerations are differences of rounded positions.
const LIMIT_ROUNDING: f64 = 1e-6;

/// Widest column of the table that is padded.
const WIDEST: usize = 34;

const PROGRAM_PHASE: f64 = 2.0;
const COLUMNS: usize = 35;
const LETTERS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// One servo cycle. Lengths in machine units, angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds since the first line.
    pub time: f64,
    /// Homed, in world mode: the joints follow the pose.
    pub in_world: bool,
    /// Commanded pose x y z a b c.
    pub pose: [f64; 6],
    /// Commanded joints, before LinuxCNC smooths them.
    pub joints: [f64; JOINTS],
    /// Motor positions after this cycle's command; a searching joint counts from power-up.
    pub motors: [f64; JOINTS],
    /// What forward made of the motor positions of the cycle before.
    pub forward: [f64; 6],
    /// Nut corrections that the module shows.
    pub corrections: [f64; JOINTS],
    /// Tool vector's z, spindle offset included.
    pub tool_z: f64,
    /// Iterations of the last forward call.
    pub iterations: f64,
    /// Largest leg residual of the last forward call.
    pub residual: f64,
}

impl Sample {
    /// The tool vector.
    pub fn tool(&self) -> Vector3<f64> {
        Vector3::new(0.0, 0.0, self.tool_z)
    }
}

/// What `run_live.py` found; fields that a failed run lacks are zero.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct RunResult {
    /// Configuration.
    pub config: String,
    /// Program.
    pub program: String,
    /// Motions of the program.
    pub moves: u64,
    /// Servo cycles that were not recorded.
    pub overruns: u64,
    /// Duration of the program, seconds.
    pub seconds: f64,
    /// Kind and text from LinuxCNC's error channel.
    pub messages: Vec<(String, String)>,
    /// Faults that the module counted.
    pub fault_count: u64,
    /// Hash of the geometry that the module froze.
    pub geometry_hash: u32,
    /// Longest run of the servo thread, nanoseconds.
    pub servo_tmax_ns: f64,
    /// Longest run of the motion controller alone, kinematics included, nanoseconds.
    pub motion_tmax_ns: f64,
    /// Whether the run went to its end without a message.
    pub ok: bool,
    /// Why not.
    pub error: Option<String>,
}

/// Reads a trace.
///
/// # Errors
/// A sentence naming file, line and what was expected.
pub fn read_trace(file: &Path) -> Result<Vec<Sample>, String> {
    let named = |error: &dyn fmt::Display| format!("{}: {error}", file.display());
    let mut reader = csv::Reader::from_path(file).map_err(|e| named(&e))?;
    let expected = columns();
    if reader.headers().map_err(|e| named(&e))?.iter().ne(expected.iter().map(String::as_str)) {
        return Err(named(&format!("expected the columns {}", expected.join(","))));
    }
    let samples = reader
        .deserialize()
        .map(|row| row.map_err(|e: csv::Error| e.to_string()).and_then(sample))
        .enumerate()
        .map(|(i, row)| row.map_err(|e| named(&format!("line {}: {e}", i + 2))))
        .collect::<Result<Vec<Sample>, String>>()?;
    if let Some(i) = samples.windows(2).position(|pair| pair[1].time <= pair[0].time) {
        return Err(named(&format!("line {}: the time does not advance", i + 3)));
    }
    if samples.iter().filter(|s| s.in_world).count() < 3 {
        return Err(named(&"holds no world mode (phase 2): nothing to judge"));
    }
    Ok(samples)
}

fn columns() -> Vec<String> {
    let numbered = |prefix: &'static str| (0..JOINTS).map(move |i| format!("{prefix}{i}"));
    let lettered = |prefix: &'static str| LETTERS.map(|l| format!("{prefix}{l}"));
    let mut columns = vec!["t_s".to_string(), "phase".to_string()];
    columns.extend(lettered(""));
    columns.extend(numbered("j").chain(numbered("m")));
    columns.extend(lettered("f"));
    columns.extend(numbered("corr"));
    columns.extend(["tool_z", "iterations", "residual"].map(Into::into));
    columns
}

fn sample(row: Vec<f64>) -> Result<Sample, String> {
    if let Some(bad) = row.iter().find(|value| !value.is_finite()) {
        return Err(format!("{bad} is no value of a machine that runs"));
    }
    let row: [f64; COLUMNS] = row
        .try_into()
        .map_err(|row: Vec<f64>| format!("{} values, expected {COLUMNS}", row.len()))?;
    let (iterations, residual) = (row[33], row[34]);
    if iterations < 0.0 || residual < 0.0 {
        return Err(format!("{iterations} iterations and a residual of {residual} cannot be"));
    }
    let six = |from: usize| std::array::from_fn(|i| row[from + i]);
    Ok(Sample {
        time: row[0],
        in_world: row[1] == PROGRAM_PHASE,
        pose: six(2),
        joints: six(8),
        motors: six(14),
        forward: six(20),
        corrections: six(26),
        tool_z: row[32],
        iterations,
        residual,
    })
}

/// Reads the result file of a run.
///
/// # Errors
/// A sentence naming the file.
pub fn read_result(file: &Path) -> Result<RunResult, String> {
    let text = std::fs::read(file).map_err(|e| format!("{}: {e}", file.display()))?;
    serde_json::from_slice(&text).map_err(|e| format!("{}: {e}", file.display()))
}

/// A figure, what is allowed, and whether it was kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// What was measured.
    pub name: String,
    /// The figure with its unit.
    pub found: String,
    /// What is allowed; empty where nothing is asked.
    pub allowed: String,
    /// Whether the figure is as it must be.
    pub kept: bool,
}

/// A sample on which the host library fails.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceFault {
    /// Seconds since the first line of the trace.
    pub time: f64,
    /// Why.
    pub fault: Fault,
}

impl fmt::Display for TraceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "trace at {} s: {}", self.time, self.fault)
    }
}

impl std::error::Error for TraceFault {}

impl Sample {
    fn failed(&self) -> impl Fn(Fault) -> TraceFault + use<> {
        let time = self.time;
        move |fault| TraceFault { time, fault }
    }
}

/// A judged trace.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Every figure, in the order of the table.
    pub checks: Vec<Check>,
}

impl Report {
    /// Whether everything was as it must be.
    pub fn kept(&self) -> bool {
        self.checks.iter().all(|check| check.kept)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |text: fn(&Check) -> &str| {
            self.checks.iter().map(|check| text(check).chars().count()).max().unwrap_or(0)
        };
        // A long message must not push the last column off the screen.
        let (names, found) = (width(|c| &c.name), width(|c| &c.found).min(WIDEST));
        for Check { name, found: value, allowed, kept } in &self.checks {
            let mark = if *kept { "    " } else { "BAD " };
            let line = format!("{mark}{name:names$}  {value:found$}  {allowed}");
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// Judges a trace and its result against the machine.
///
/// # Errors
/// A call of the host library that fails on a sampled pose or on sampled joints.
pub fn judge(
    config: &MachineConfig,
    samples: &[Sample],
    result: &RunResult,
) -> Result<Report, TraceFault> {
    let world: Vec<Sample> = samples.iter().filter(|s| s.in_world).copied().collect();
    let offsets = motor_offsets(&world);
    let mut checks = run_checks(config, &world, result);
    checks.extend(kinematics_checks(config, &world, &offsets)?);
    checks.extend(limit_checks(config, samples, &world, &offsets));
    checks.extend(cone_checks(config, samples, &world, &offsets)?);
    checks.push(servo_check(config, result));
    Ok(Report { checks })
}

/// Joint value minus motor position: the machine stands still when world mode begins.
fn motor_offsets(world: &[Sample]) -> [f64; JOINTS] {
    std::array::from_fn(|i| world[0].joints[i] - world[0].motors[i])
}

fn run_checks(config: &MachineConfig, world: &[Sample], result: &RunResult) -> Vec<Check> {
    let texts: Vec<String> =
        result.messages.iter().map(|(kind, text)| format!("{kind}: {}", text.trim())).collect();
    let messages = if texts.is_empty() { "none".to_string() } else { texts.join("; ") };
    let end = if result.ok { "to its end" } else { "not to its end" };
    let error = result.error.clone().unwrap_or_else(|| end.into());
    let hash = config.geometry.hash();
    vec![
        info("moves", result.moves.to_string()),
        info("time of the program", format!("{:.1} s", result.seconds)),
        info("servo cycles in world mode", world.len().to_string()),
        check("program ran", error, "to its end", result.ok),
        check("messages to the operator", messages, "none", texts.is_empty()),
        check("faults of the module", result.fault_count.to_string(), "0", result.fault_count == 0),
        check("servo cycles not recorded", result.overruns.to_string(), "0", result.overruns == 0),
        check(
            "geometry frozen by the module",
            format!("{:08x}", result.geometry_hash),
            &format!("{hash:08x}, that of the INI file"),
            result.geometry_hash == hash,
        ),
    ]
}

fn kinematics_checks(
    config: &MachineConfig,
    world: &[Sample],
    offsets: &[f64; JOINTS],
) -> Result<Vec<Check>, TraceFault> {
    let machine = &config.machine;
    let (mut joints, mut round_trip, mut feedback) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut seed = Pose::from_degrees(world[0].pose);
    for (k, sample) in world.iter().enumerate() {
        let (pose, tool) = (Pose::from_degrees(sample.pose), sample.tool());
        let asked = machine.inverse(&pose, &tool).map_err(sample.failed())?;
        joints = joints.max(largest_gap(&asked, &sample.joints));
        let solution = machine.forward(&sample.joints, &seed, &tool, &config.solver);
        seed = solution.map_err(sample.failed())?.pose;
        round_trip = round_trip.max(pose.distance(&seed, machine.radius()));
        if k > 0 {
            let shown = Pose::from_degrees(sample.forward);
            let shown = machine.inverse(&shown, &tool).map_err(sample.failed())?;
            let measured = std::array::from_fn(|i| world[k - 1].motors[i] + offsets[i]);
            feedback = feedback.max(largest_gap(&shown, &measured));
        }
    }
    let size = machine.size();
    let most = |value: fn(&Sample) -> f64| world.iter().map(value).fold(0.0, f64::max);
    let correction = most(|s| s.corrections.iter().fold(0.0, |m: f64, c| m.max(c.abs())));
    let criterion = config.solver.convergence_criterion;
    let iterations = most(|s| s.iterations);
    let unit = config.length_unit();
    let length = |name: &str, found: f64, allowed: f64| {
        let text = |value: f64| format!("{value:.2e} {unit}");
        check(name, text(found), &format!("at most {}", text(allowed)), found <= allowed)
    };
    Ok(vec![
        length("joints against host inverse", joints, JOINT_TOLERANCE_MM * config.units_per_mm),
        length("forward against inverse (pose)", round_trip, ROUND_TRIP * size),
        length("forward of the feedback (joints)", feedback, FEEDBACK * criterion),
        length("residual shown", most(|s| s.residual), criterion),
        check(
            "iterations of forward",
            format!("{iterations}"),
            &format!("at most {MOST_ITERATIONS}"),
            iterations <= MOST_ITERATIONS,
        ),
        info("largest nut correction", format!("{correction:.4} {unit}")),
    ])
}

fn largest_gap(a: &[f64; JOINTS], b: &[f64; JOINTS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn limit_checks(
    config: &MachineConfig,
    samples: &[Sample],
    world: &[Sample],
    offsets: &[f64; JOINTS],
) -> Vec<Check> {
    let motors = |i: usize| samples.iter().map(|s| s.motors[i] + offsets[i]).collect::<Vec<_>>();
    let commands = |i: usize| world.iter().map(|s| s.joints[i]).collect::<Vec<_>>();
    let mut checks = vec![];
    for (i, joint) in config.joints.iter().enumerate() {
        let (low, high) = range(&motors(i));
        let allowed = format!("{} to {} {}", joint.min, joint.max, config.length_unit());
        let kept = low >= joint.min && high <= joint.max;
        checks.push(check(&format!("strut {i}"), format!("{low:.3} to {high:.3}"), &allowed, kept));
    }
    for (what, positions) in
        [("motors", &motors as &dyn Fn(usize) -> Vec<f64>), ("commands", &commands)]
    {
        let rates = config.joints.iter().enumerate().map(|(i, joint)| {
            let (speed, acceleration) = rates(&positions(i), config.period);
            (speed / joint.max_velocity, acceleration / joint.max_acceleration)
        });
        let (speed, acceleration) =
            rates.fold((0.0, 0.0), |(s, a): (f64, f64), (ds, da)| (s.max(ds), a.max(da)));
        checks.push(share(&format!("joint speed, {what}"), speed));
        checks.push(share(&format!("joint acceleration, {what}"), acceleration));
    }
    checks
}

fn range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
}

/// Largest first and second differences, per second and per second squared.
fn rates(positions: &[f64], period: f64) -> (f64, f64) {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    let speed = largest(&mut positions.windows(2).map(|w| w[1] - w[0]));
    let acceleration = largest(&mut positions.windows(3).map(|w| w[2] - 2.0 * w[1] + w[0]));
    (speed / period, acceleration / (period * period))
}

fn cone_checks(
    config: &MachineConfig,
    samples: &[Sample],
    world: &[Sample],
    offsets: &[f64; JOINTS],
) -> Result<Vec<Check>, TraceFault> {
    let mut homing = Cones::default();
    for (sample, pose) in homing_poses(config, samples, offsets)? {
        homing.add(config, &pose, &config.spindle).map_err(sample.failed())?;
    }
    let mut program = Cones::default();
    for sample in world {
        let pose = Pose::from_degrees(sample.pose);
        program.add(config, &pose, &sample.tool()).map_err(sample.failed())?;
    }
    let mut checks = homing.checks(config, "homing");
    checks.extend(program.checks(config, "program"));
    Ok(checks)
}

/// Where the platform was before world mode: followed back from the pose that is known.
fn homing_poses<'a>(
    config: &MachineConfig,
    samples: &'a [Sample],
    offsets: &[f64; JOINTS],
) -> Result<Vec<(&'a Sample, Pose)>, TraceFault> {
    let before: Vec<&Sample> = samples.iter().take_while(|s| !s.in_world).collect();
    let mut poses = vec![];
    let mut seed = config.home_pose();
    for sample in before.into_iter().rev() {
        let joints = std::array::from_fn(|i| sample.motors[i] + offsets[i]);
        let solution = config.machine.forward(&joints, &seed, &config.spindle, &config.solver);
        seed = solution.map_err(sample.failed())?.pose;
        poses.push((sample, seed));
    }
    Ok(poses)
}

/// Largest cone angles, as (angle, limit) of the joint that comes nearest to its limit.
#[derive(Default)]
struct Cones {
    base: [f64; JOINTS],
    platform: [f64; JOINTS],
}

impl Cones {
    fn add(
        &mut self,
        config: &MachineConfig,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<(), Fault> {
        let angles = config.cone_angles(pose, tool)?;
        for i in 0..JOINTS {
            self.base[i] = self.base[i].max(angles.base[i]);
            self.platform[i] = self.platform[i].max(angles.platform[i]);
        }
        Ok(())
    }

    fn checks(&self, config: &MachineConfig, when: &str) -> Vec<Check> {
        let parts = [
            ("base", &self.base, &config.base_cone),
            ("platform", &self.platform, &config.platform_cone),
        ];
        parts
            .into_iter()
            .map(|(body, angles, limits)| cone_check(body, when, angles, limits))
            .collect()
    }
}

fn cone_check(
    body: &str,
    when: &str,
    angles: &[f64; JOINTS],
    limits: &[Option<f64>; JOINTS],
) -> Check {
    let name = format!("cone of the {body} joints, {when}");
    let kept = angles.iter().zip(limits).all(|(angle, limit)| limit.is_none_or(|l| *angle <= l));
    let lowest = limits.iter().flatten().copied().reduce(f64::min);
    let allowed = lowest.map_or(String::new(), |limit| format!("at most {limit} degrees"));
    check(&name, format!("{:.2} degrees", range(angles).1), &allowed, kept)
}

fn servo_check(config: &MachineConfig, result: &RunResult) -> Check {
    let text = |ns: f64| format!("{:.1} us", ns / 1e3);
    let found = format!(
        "{} ({} of them motion and kinematics)",
        text(result.servo_tmax_ns),
        text(result.motion_tmax_ns)
    );
    info(&format!("longest servo cycle of {:.0} us", config.period * 1e6), found)
}

fn check(name: &str, found: String, allowed: &str, kept: bool) -> Check {
    Check { name: name.into(), found, allowed: allowed.into(), kept }
}

fn info(name: &str, found: String) -> Check {
    check(name, found, "", true)
}

/// A share of a limit that may not be passed.
fn share(name: &str, found: f64) -> Check {
    let kept = found <= 1.0 + LIMIT_ROUNDING;
    check(name, format!("{:.1} % of the limit", found * 100.0), "at most 100 %", kept)
}
