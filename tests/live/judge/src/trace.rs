// SPDX-License-Identifier: GPL-2.0-or-later
//! Traces of a running LinuxCNC, checked against the host library.
//!
//! A trace has one line per servo cycle; its columns are described in
//! tests/live/README.md. The checks recompute the module's results with the same core,
//! and compare positions, speeds and cones with the limits of the INI file.

use check::mobility::Structure;
use draw::sample::Sample;
use kinematics::{
    Fault, Joints, LegKind, Limit, Limits, MAX_EXTRA, MAX_JOINTS, Margin, Pose, Vector3,
};
use machine::limits;
use machine::read::joints::{Group, JointKind};
use machine::read::mechanism::Mechanism;
use serde::Deserialize;
use std::fmt;
use std::path::Path;

/// Coarse joint commands against host inverse, and motor positions against their range, to which their offset adds a
/// rounding error; in mm or degrees.
const JOINT_TOLERANCE: f64 = 1e-9;

/// Host forward of the coarse joints against the commanded pose, as a fraction of the size.
const ROUND_TRIP: f64 = 1e-10;

/// Joints of the pose that forward shows against the feedback, in units of the
/// convergence criterion: forward stops on the residual of all legs, each within it.
const FEEDBACK: f64 = 10.0;

/// Iterations of forward one servo step away.
const MOST_ITERATIONS: f64 = 3.0;

/// Sampled speeds and accelerations are differences of rounded positions.
const LIMIT_ROUNDING: f64 = 1e-6;

/// Widest column of the table that is padded.
const WIDEST: usize = 34;

const PROGRAM_PHASE: f64 = 2.0;
const LETTERS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// The results of `run_live.py`; fields that a failed run lacks are zero.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct RunResult {
    /// Configuration.
    pub config: String,
    pub program: String,
    /// Motions of the program.
    pub moves: u64,
    /// Servo cycles that were not recorded.
    pub overruns: u64,
    /// Duration of the program, seconds.
    pub seconds: f64,
    /// Kind and text from LinuxCNC's error channel.
    pub messages: Vec<(String, String)>,
    pub fault_count: u64,
    /// Hash of the geometry that the module froze.
    pub geometry_hash: u32,
    /// Longest run of the servo thread, nanoseconds.
    pub servo_tmax_ns: f64,
    /// Longest run of the motion controller, kinematics included, nanoseconds.
    pub motion_tmax_ns: f64,
    /// Whether the run ended normally without a message.
    pub ok: bool,
    pub error: Option<String>,
}

const MOST_JOINTS: usize = 16;

/// Reads a trace of this machine.
///
/// # Errors
/// A message naming file, line and what was expected.
pub fn read_trace(config: &Mechanism, file: &Path) -> Result<Vec<Sample>, String> {
    let named = |error: &dyn fmt::Display| format!("{}: {error}", file.display());
    let mut reader = csv::Reader::from_path(file).map_err(|e| named(&e))?;
    let header = reader.headers().map_err(|e| named(&e))?;
    let columns = Columns { config };
    let expected = columns.names();
    if header.iter().ne(expected.iter().map(String::as_str)) {
        return Err(named(&format!("expected the columns {}", expected.join(","))));
    }
    let samples = reader
        .deserialize()
        .map(|row| row.map_err(|e: csv::Error| e.to_string()).and_then(|row| columns.sample(row)))
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

/// Order of the values in a line; every machine has its own joints and struts.
struct Columns<'a> {
    config: &'a Mechanism,
}

impl Columns<'_> {
    /// Returns the joints of legs and table, of a second mechanism, which is not judged here, and of extra axes.
    fn joints(&self) -> impl Iterator<Item = usize> + use<> {
        0..self.config.place.first_extra_joint + self.config.extra.len()
    }

    fn struts(&self) -> impl Iterator<Item = usize> {
        let legs = self.config.geometry.legs().iter().enumerate();
        legs.filter(|(_, leg)| matches!(leg.kind, LegKind::Strut(_))).map(|(i, _)| i)
    }

    fn names(&self) -> Vec<String> {
        let lettered = |prefix: &'static str| LETTERS.map(|l| format!("{prefix}{l}"));
        let mut names = vec!["t_s".to_string(), "phase".to_string()];
        names.extend(lettered(""));
        names.extend(self.joints().map(|i| format!("j{i}")));
        names.extend(self.joints().map(|i| format!("m{i}")));
        names.extend(lettered("f"));
        names.extend(self.struts().map(|i| format!("corr{i}")));
        names.extend(["tool_x", "tool_y", "tool_z", "iterations", "residual"].map(String::from));
        names
    }

    fn sample(&self, row: Vec<f64>) -> Result<Sample, String> {
        if let Some(bad) = row.iter().find(|value| !value.is_finite()) {
            return Err(format!("{bad} is no value of a machine that runs"));
        }
        let mut values = row.into_iter();
        let (time, phase) = (next(&mut values), next(&mut values));
        let mut pose = placed(&mut values, 0..6);
        let commands: [f64; MOST_JOINTS] = placed(&mut values, self.joints());
        let motors: [f64; MOST_JOINTS] = placed(&mut values, self.joints());
        let given = pose;
        let passed = self.take_out(&mut pose, &commands);
        let mut sample = Sample {
            time,
            in_world: phase == PROGRAM_PHASE,
            pose,
            joints: self.own(&commands),
            motors: self.own(&motors),
            extra: self.extra(&commands),
            passed,
            forward: placed(&mut values, 0..6),
            corrections: placed(&mut values, self.struts()),
            tool: placed(&mut values, 0..3),
            on_work: None,
            iterations: next(&mut values),
            residual: next(&mut values),
        };
        self.carry(&given, &mut sample)?;
        let Sample { iterations, residual, .. } = sample;
        if iterations < 0.0 || residual < 0.0 {
            return Err(format!("{iterations} iterations and a residual of {residual} cannot be"));
        }
        Ok(sample)
    }
}

impl Columns<'_> {
    /// Removes the coordinates of extra axes and of a second mechanism from a pose; returns the largest difference
    /// of an extra axis's coordinate from its joint.
    fn take_out(&self, pose: &mut [f64; 6], joints: &[f64; MOST_JOINTS]) -> f64 {
        let second = self.config.second_letters.iter().flat_map(|letters| letters.places());
        for place in second {
            pose.get_mut(place).into_iter().for_each(|coordinate| *coordinate = 0.0);
        }
        let extra =
            self.config.extra_axes.places().zip(&joints[self.config.place.first_extra_joint..]);
        let gaps = extra.filter_map(|(place, joint)| {
            let coordinate = pose.get_mut(place)?;
            Some((std::mem::take(coordinate) - joint).abs())
        });
        gaps.fold(0.0, f64::max)
    }

    /// Replaces LinuxCNC's pose and tool vector with the machine's own if axes carry something.
    /// A trace contains no U V W.
    fn carry(&self, given: &[f64; 6], sample: &mut Sample) -> Result<(), String> {
        let (chain, tool) = (&self.config.chain, Vector3::from(sample.tool));
        if chain.is_empty() {
            return Ok(());
        }
        if chain.links().iter().any(|link| link.place > 5) {
            return Err("U, V or W carries something, which a trace does not hold".into());
        }
        let mut world = [0.0; 9];
        world[..6].copy_from_slice(given);
        let pose = self.config.machine.pose_of_world(chain, &world, &tool);
        sample.pose = pose.map_err(|fault| fault.to_string())?;
        sample.on_work = self.config.on_work(&Pose::from_degrees(sample.pose), &world, &tool);
        sample.tool = chain.machine_tool(&tool).into();
        Ok(())
    }

    /// Returns the joints of extra axes.
    fn extra(&self, joints: &[f64; MOST_JOINTS]) -> [f64; MAX_EXTRA] {
        let own = joints.iter().skip(self.config.place.first_extra_joint);
        let mut extra = [0.0; MAX_EXTRA];
        extra
            .iter_mut()
            .zip(own)
            .take(self.config.extra.len())
            .for_each(|(to, value)| *to = *value);
        extra
    }

    /// Returns the joints of legs and table.
    fn own(&self, joints: &[f64; MOST_JOINTS]) -> Joints {
        let count = self.config.joints.len();
        std::array::from_fn(|i| if i < count { joints[i] } else { 0.0 })
    }
}

/// Returns the next value of a line, which has as many as the heading: the CSV reader checks that.
fn next(values: &mut impl Iterator<Item = f64>) -> f64 {
    values.next().unwrap_or_default()
}

/// Returns the next values at these indices; 0 elsewhere.
fn placed<const N: usize>(
    values: &mut impl Iterator<Item = f64>,
    places: impl Iterator<Item = usize>,
) -> [f64; N] {
    let mut all = [0.0; N];
    for place in places {
        all[place] = next(values);
    }
    all
}

/// Reads the result file of a run.
///
/// # Errors
/// A message naming the file.
pub fn read_result(file: &Path) -> Result<RunResult, String> {
    let text = std::fs::read(file).map_err(|e| format!("{}: {e}", file.display()))?;
    serde_json::from_slice(&text).map_err(|e| format!("{}: {e}", file.display()))
}

/// A figure, its bound, and whether it is within the bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Name of the figure.
    pub name: String,
    /// Value with its unit.
    pub found: String,
    /// Bound; empty if there is none.
    pub allowed: String,
    /// Whether the figure is within its bound.
    pub kept: bool,
}

/// A failure of the host library on a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceFault {
    /// Seconds since the first line of the trace.
    pub time: f64,
    /// Cause.
    pub fault: Fault,
}

impl fmt::Display for TraceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "trace at {} s: {}", self.time, self.fault)
    }
}

impl std::error::Error for TraceFault {}

/// Returns a function that converts a failure of the host library on a sample to an error.
fn failed(sample: &Sample) -> impl Fn(Fault) -> TraceFault + use<> {
    let time = sample.time;
    move |fault| TraceFault { time, fault }
}

/// A judged trace.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Every figure, in the order of the table.
    pub checks: Vec<Check>,
}

impl Report {
    /// Returns whether every figure is within its bound.
    pub fn kept(&self) -> bool {
        self.checks.iter().all(|check| check.kept)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |text: fn(&Check) -> &str| {
            self.checks.iter().map(|check| text(check).chars().count()).max().unwrap_or(0)
        };
        // A long message must not move the last column off the screen.
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
/// The host library fails on a sampled pose or on sampled joints.
pub fn judge(
    config: &Mechanism,
    samples: &[Sample],
    result: &RunResult,
) -> Result<Report, TraceFault> {
    let world: Vec<Sample> = samples.iter().filter(|s| s.in_world).copied().collect();
    let offsets = motor_offsets(&world);
    let mut checks = run_checks(config, &world, result);
    checks.extend(structure_checks(config).map_err(failed(&world[0]))?);
    checks.extend(kinematics_checks(config, &world, &offsets)?);
    checks.extend(limit_checks(config, samples, &world, &offsets));
    checks.extend(pose_checks(config, samples, &world, &offsets)?);
    if !config.extra.is_empty() {
        let gap = world.iter().map(|sample| sample.passed).fold(0.0, f64::max);
        checks.push(most("extra axes against their letters", gap, "mm or degrees", 0.0));
    }
    checks.push(servo_check(config, result));
    Ok(Report { checks })
}

/// Cycles without any motion after which command and drive have settled.
const SETTLED: usize = 10;

/// Returns joint values minus motor positions, from the first standstill in world mode: as world mode
/// begins, the motion before may not have ended yet.
fn motor_offsets(world: &[Sample]) -> Joints {
    let still = |part: &&[Sample]| {
        part.iter().all(|s| s.joints == part[0].joints && s.motors == part[0].motors)
    };
    let at = world.windows(SETTLED).find(still).map_or(&world[0], |part| &part[0]);
    std::array::from_fn(|i| at.joints[i] - at.motors[i])
}

fn run_checks(config: &Mechanism, world: &[Sample], result: &RunResult) -> Vec<Check> {
    let texts: Vec<String> =
        result.messages.iter().map(|(kind, text)| format!("{kind}: {}", text.trim())).collect();
    let messages = if texts.is_empty() { "none".to_string() } else { texts.join("; ") };
    let end = if result.ok { "to its end" } else { "not to its end" };
    let error = result.error.clone().unwrap_or_else(|| end.into());
    let hash = config.hash;
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

fn structure_checks(config: &Mechanism) -> Result<[Check; 2], Fault> {
    let structure = Structure::of(config)?;
    Ok([info("structure", structure.loops()), info("mobility at home", structure.mobility())])
}

/// Largest deviations of a trace.
struct Deviations {
    /// Sampled joints from host inverse of the sampled pose, per joint.
    joints: Joints,
    /// Host forward of the sampled joints from the sampled pose.
    round_trip: f64,
    /// Joints of the pose that the module shows from those of the feedback, per joint.
    feedback: Joints,
    /// Least |cos| between a rod and the motion of its lower end.
    least_drive: Option<f64>,
}

impl Deviations {
    fn of(config: &Mechanism, world: &[Sample], offsets: &Joints) -> Result<Self, TraceFault> {
        let mut most = Self {
            joints: [0.0; MAX_JOINTS],
            round_trip: 0.0,
            feedback: [0.0; MAX_JOINTS],
            least_drive: None,
        };
        let mut seed = Pose::from_degrees(world[0].pose);
        for (k, sample) in world.iter().enumerate() {
            seed = most.add(config, sample, &seed).map_err(failed(sample))?;
            if k > 0 {
                let measured = std::array::from_fn(|i| world[k - 1].motors[i] + offsets[i]);
                most.add_feedback(config, sample, &measured).map_err(failed(sample))?;
            }
        }
        Ok(most)
    }

    /// Adds host forward of the sampled joints.
    fn add(&mut self, config: &Mechanism, sample: &Sample, seed: &Pose) -> Result<Pose, Fault> {
        let (pose, tool) = (Pose::from_degrees(sample.pose), sample.tool());
        let asked = config.machine.at(&pose, &tool)?;
        widen(&mut self.joints, asked.joints(), &sample.joints);
        let found = config.machine.forward(&sample.joints, seed, &tool, &config.solver)?.pose;
        self.round_trip = self.round_trip.max(pose.distance(&found, config.machine.radius()));
        let drives = (0..config.legs()).filter_map(|i| asked.drive(i));
        self.least_drive = drives.chain(self.least_drive).reduce(f64::min);
        Ok(found)
    }

    /// Adds the feedback. Inconsistent joints have no exact pose: then the pose shown is
    /// compared with the one that the host finds to fit best.
    fn add_feedback(
        &mut self,
        config: &Mechanism,
        sample: &Sample,
        measured: &Joints,
    ) -> Result<(), Fault> {
        let (machine, tool) = (&config.machine, sample.tool());
        let pose = Pose::from_degrees(sample.forward);
        let shown = machine.inverse(&pose, &tool)?;
        let mut expected = *measured;
        if machine.layout().is_redundant() {
            let fitted = machine.forward(measured, &pose, &tool, &config.solver)?.pose;
            expected = machine.inverse(&fitted, &tool)?;
        }
        widen(&mut self.feedback, &shown, &expected);
        Ok(())
    }
}

fn widen(most: &mut Joints, a: &Joints, b: &Joints) {
    for (most, (a, b)) in most.iter_mut().zip(a.iter().zip(b)) {
        *most = most.max((a - b).abs());
    }
}

fn kinematics_checks(
    config: &Mechanism,
    world: &[Sample],
    offsets: &Joints,
) -> Result<Vec<Check>, TraceFault> {
    let found = Deviations::of(config, world, offsets)?;
    let mut checks = joint_checks(config, &found);
    let round_trip = ROUND_TRIP * config.machine.size();
    let unit = config.length_unit();
    checks.push(most("forward against inverse (pose)", found.round_trip, unit, round_trip));
    let largest = |value: fn(&Sample) -> f64| world.iter().map(value).fold(0.0, f64::max);
    checks.push(most(
        "residual shown",
        largest(|s| s.residual),
        unit,
        config.machine.largest_residual(&config.solver),
    ));
    let iterations = largest(|s| s.iterations);
    checks.push(check(
        "iterations of forward",
        format!("{iterations}"),
        &format!("at most {MOST_ITERATIONS}"),
        iterations <= MOST_ITERATIONS,
    ));
    if config.joints.iter().any(|joint| joint.kind == JointKind::Strut) {
        let correction = largest(|s| s.corrections.iter().fold(0.0, |m: f64, c| m.max(c.abs())));
        checks.push(info("largest nut correction", format!("{correction:.4} {unit}")));
    }
    checks.extend(found.least_drive.map(|cosine| {
        info("nearest to a dead point", format!("cosine of rod and motion {cosine:.3}"))
    }));
    Ok(checks)
}

/// Returns the checks of joints by kind, because their units differ.
fn joint_checks(config: &Mechanism, found: &Deviations) -> Vec<Check> {
    let mut checks = vec![];
    for Group { kind, unit, joints } in config.groups() {
        let largest = |gaps: &Joints| joints.iter().fold(0.0, |m: f64, i| m.max(gaps[*i]));
        let tolerance = if kind == JointKind::Arm { 1.0 } else { config.units_per_mm };
        let name = format!("{} against host inverse", kind.plural());
        checks.push(most(&name, largest(&found.joints), unit, JOINT_TOLERANCE * tolerance));
        let name = format!("{}, forward of the feedback", kind.plural());
        let allowed = FEEDBACK * config.solver.convergence_criterion * per_length(config, kind);
        checks.push(most(&name, largest(&found.feedback), unit, allowed));
    }
    checks
}

/// Returns joint units per machine unit of a residual, which is a length: at the end of an arm
/// one degree is a length too.
fn per_length(config: &Mechanism, kind: JointKind) -> f64 {
    let arms = config.geometry.legs().iter().filter(|leg| leg.kind.is_angular());
    let per_length = arms.map(|leg| leg.kind.lengths()[1].to_radians().recip());
    if kind == JointKind::Arm { per_length.fold(0.0, f64::max) } else { 1.0 }
}

fn limit_checks(
    config: &Mechanism,
    samples: &[Sample],
    world: &[Sample],
    offsets: &Joints,
) -> Vec<Check> {
    let motors = |i: usize| samples.iter().map(|s| s.motors[i] + offsets[i]).collect::<Vec<_>>();
    let commands = |i: usize| world.iter().map(|s| s.joints[i]).collect::<Vec<_>>();
    let mut checks = vec![];
    for (i, joint) in config.joints.iter().enumerate() {
        let (low, high) = range(&motors(i));
        let allowed = format!("{} to {} {}", joint.min, joint.max, config.unit(joint.kind));
        let kept = low >= joint.min - JOINT_TOLERANCE && high <= joint.max + JOINT_TOLERANCE;
        checks.push(check(&joint.name, format!("{low:.3} to {high:.3}"), &allowed, kept));
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

/// Returns the largest first and second differences, per second and per second squared.
fn rates(positions: &[f64], period: f64) -> (f64, f64) {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    let speed = largest(&mut positions.windows(2).map(|w| w[1] - w[0]));
    let acceleration = largest(&mut positions.windows(3).map(|w| w[2] - 2.0 * w[1] + w[0]));
    (speed / period, acceleration / (period * period))
}

/// Checks limits of the poses during homing and in the program, in addition to those of joints and axes.
fn pose_checks(
    config: &Mechanism,
    samples: &[Sample],
    world: &[Sample],
    offsets: &Joints,
) -> Result<Vec<Check>, TraceFault> {
    let mut homing = Worst::new(config);
    for (sample, pose) in homing_poses(config, samples, offsets)? {
        homing.add(config, &pose, &config.spindle).map_err(failed(sample))?;
    }
    let mut program = Worst::new(config);
    for sample in world {
        let pose = Pose::from_degrees(sample.pose);
        program.add(config, &pose, &sample.tool()).map_err(failed(sample))?;
    }
    let mut checks = homing.checks(config, "homing");
    checks.extend(program.checks(config, "program"));
    Ok(checks)
}

/// Returns the platform's poses before world mode: followed back from the known pose.
fn homing_poses<'a>(
    config: &Mechanism,
    samples: &'a [Sample],
    offsets: &Joints,
) -> Result<Vec<(&'a Sample, Pose)>, TraceFault> {
    let before: Vec<&Sample> = samples.iter().take_while(|s| !s.in_world).collect();
    let mut poses = vec![];
    let mut seed = config.home_pose();
    for sample in before.into_iter().rev() {
        let joints = std::array::from_fn(|i| sample.motors[i] + offsets[i]);
        let solution = config.machine.forward(&joints, &seed, &config.spindle, &config.solver);
        seed = solution.map_err(failed(sample))?.pose;
        poses.push((sample, seed));
    }
    Ok(poses)
}

/// The least margin of every limit that is set.
struct Worst {
    limits: Limits,
    margins: [Option<Margin>; Limit::ALL.len()],
}

impl Worst {
    fn new(config: &Mechanism) -> Self {
        Self { limits: limits::of_homing(config), margins: [None; Limit::ALL.len()] }
    }

    fn add(&mut self, config: &Mechanism, pose: &Pose, tool: &Vector3<f64>) -> Result<(), Fault> {
        let at = config.machine.at(pose, tool)?;
        limits::each(&at, &self.limits, |margin| {
            let worst = &mut self.margins[margin.limit.index()];
            if margin.range != Limits::NONE.axis[0]
                && !worst.is_some_and(|worst| worst.room() <= margin.room())
            {
                *worst = Some(margin);
            }
        });
        Ok(())
    }

    fn checks(&self, config: &Mechanism, when: &str) -> Vec<Check> {
        let of = |margin: &Margin| {
            let Margin { limit, part, value, .. } = *margin;
            let unit = limits::unit(config, limit, part);
            let found = format!("{value:.4} {unit} of {}", limits::part(config, limit, part));
            let allowed = limits::bound(config, margin);
            check(&format!("{}, {when}", limit.name()), found, &allowed, margin.is_kept())
        };
        self.margins.iter().flatten().map(of).collect()
    }
}

fn servo_check(config: &Mechanism, result: &RunResult) -> Check {
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

/// Checks a deviation against its bound.
fn most(name: &str, found: f64, unit: &str, allowed: f64) -> Check {
    let text = |value: f64| format!("{value:.2e} {unit}");
    check(name, text(found), &format!("at most {}", text(allowed)), found <= allowed)
}

/// Checks a fraction of a limit.
fn share(name: &str, found: f64) -> Check {
    let kept = found <= 1.0 + LIMIT_ROUNDING;
    check(name, format!("{:.1} % of the limit", found * 100.0), "at most 100 %", kept)
}
