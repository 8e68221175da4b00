// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs replayed without a machine: moves, poses at the servo period, inverse,
//! and forward seeded by the previous pose.
//!
//! Between its end points a move runs at constant speed, without acceleration and blending,
//! so that speeds are upper bounds for straight pieces.

use crate::motion::{Move, MoveKind, ROUNDING as ROUNDED, extra_home};
use kinematics::{
    Certificate, Cones, Fault, Joints, Limit, Limits, MAX_EXTRA, Margin, Part, PerLeg, Pose,
    Solution, Vector3, World,
};
use machine::limits;
use machine::read::joints::Group;
use machine::read::mechanism::Mechanism;
use std::fmt;
use std::ops::ControlFlow;

/// Rounding of LinuxCNC's positions, as a share of the machine's size.
const STILL: f64 = 1e-9;

/// Rounding of accumulated times, as a share of the period.
const ROUNDING: f64 = 1e-6;

/// A value and the program line it occurred in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct At {
    /// The value.
    pub value: f64,
    /// Line of the program, counted from 1.
    pub line: u32,
}

/// Smallest and largest value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest.
    pub min: At,
    /// Largest.
    pub max: At,
}

impl Range {
    const EMPTY: Self = Self {
        min: At { value: f64::INFINITY, line: 0 },
        max: At { value: f64::NEG_INFINITY, line: 0 },
    };

    fn add(&mut self, value: f64, line: u32) {
        if value < self.min.value {
            self.min = At { value, line };
        }
        if value > self.max.value {
            self.max = At { value, line };
        }
    }
}

/// Result of a replay. Lengths in machine units, angles in degrees, time in seconds.
#[derive(Clone, Debug)]
pub struct Replay {
    /// Moves with a length.
    pub moves: usize,
    /// Number of computed poses, one per servo period.
    pub poses: usize,
    /// Duration.
    pub time: f64,
    /// Largest distance ‖(Δp, r·turn)‖ between a pose and the forward solution of its joints.
    pub mismatch: At,
    /// The largest distance as a share of the machine's size.
    pub relative_mismatch: f64,
    /// Most iterations of one forward call.
    pub iterations_max: u32,
    /// Mean number of iterations.
    pub iterations_mean: f64,
    /// Share of the poses proved by a single certified ball.
    pub certified: f64,
    /// The joints by kind.
    pub groups: Vec<Group>,
    /// Joint values, per joint.
    pub joints: Vec<Range>,
    /// Pose coordinates x y z a b c.
    pub pose: [Range; 6],
    /// Largest absolute nut correction.
    pub correction: At,
    /// Largest cone angle at the base, per leg.
    pub base_cone: Vec<At>,
    /// Largest cone angle at the platform, per leg.
    pub platform_cone: Vec<At>,
    /// Largest joint speed, per joint.
    pub joint_speed: Vec<At>,
    /// Largest motion of a joint due to a change of the tool length alone, in its unit.
    pub tool_step: At,
    /// Least |cos| between a rod and the motion of its lower end, 0 at a dead point;
    /// `None` if every leg is a strut.
    pub least_drive: Option<At>,
    /// The largest violation of every violated limit of every part, with its line.
    pub broken: Vec<(Margin, u32)>,
}

/// The end of a replay that failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReplayFault {
    /// Line of the program, counted from 1.
    pub line: u32,
    /// The machine's requested pose: x y z in machine units, a b c in degrees; the programmed one if
    /// there is none.
    pub pose: [f64; 6],
    /// Whether forward failed (otherwise inverse).
    pub forward: bool,
    /// The reason.
    pub fault: Fault,
}

impl fmt::Display for ReplayFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let call = if self.forward { "forward" } else { "inverse" };
        write!(f, "line {}: {call} at {:?}: {}", self.line, self.pose, self.fault)
    }
}

impl std::error::Error for ReplayFault {}

/// Replays moves at the given period (seconds).
///
/// # Errors
/// The first pose at which inverse or forward fails.
pub fn replay(config: &Mechanism, moves: &[Move], period: f64) -> Result<Replay, ReplayFault> {
    replay_seen(config, moves, period, |_| ())
}

/// One pose of a replay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// Seconds since the first pose.
    pub time: f64,
    /// Line of the program, counted from 1.
    pub line: u32,
    /// The machine's own pose: x y z in machine units, a b c in degrees.
    pub pose: [f64; 6],
    /// The programmed pose, with the values of the extra axes if they carry something.
    pub world: World,
    /// Joint values.
    pub joints: Joints,
    /// Nut corrections.
    pub corrections: PerLeg,
    /// Tool vector of the machine's pose, spindle offset included.
    pub tool: [f64; 3],
    /// The tip on the work, and the direction from it to the holder, if axes carry something.
    pub on_work: Option<[[f64; 3]; 2]>,
}

/// Replays moves as [`replay`]; `see` receives every pose.
///
/// # Errors
/// As [`replay`].
pub fn replay_seen(
    config: &Mechanism,
    moves: &[Move],
    period: f64,
    mut see: impl FnMut(&Visit),
) -> Result<Replay, ReplayFault> {
    let mut player = Player::new(config, period, &mut see);
    for step in moves {
        player.change_tool(step)?;
        player.play(step)?;
    }
    player.end()?;
    Ok(player.finish())
}

/// Returns the duration of a move in seconds: feed or rapid speed, limited by the axes, without extra
/// axes.
///
/// LinuxCNC's rule: the feed is that of X Y Z together if one of them moves, otherwise that of U V W, otherwise
/// that of A B C together.
pub fn duration(config: &Mechanism, from: &[f64; 6], step: &Move) -> f64 {
    let mut delta = [0.0; 9];
    delta.iter_mut().zip(step.end.iter().zip(from)).for_each(|(d, (to, from))| *d = to - from);
    seconds(config, &delta, step)
}

/// Returns the duration of a move by these amounts of LinuxCNC's whole pose.
fn seconds(config: &Mechanism, delta: &World, step: &Move) -> f64 {
    if let Some(seconds) = step.lasts {
        return seconds;
    }
    let norm = |part: &[f64]| part.iter().map(|d| d * d).sum::<f64>().sqrt();
    let angular = norm(&delta[3..6]);
    // A tool offset leaves a rounding error in X Y Z even if they stay.
    let least = STILL * config.machine.size();
    let [linear, slides] =
        [&delta[..3], &delta[6..]].map(norm).map(|d| if d > least { d } else { 0.0 });
    let linear = if linear > 0.0 { linear } else { slides };
    let own = config.programmed.iter().enumerate();
    let own = own.filter(|(k, _)| !config.chain.is_extra(*k));
    let extra = config.extra_axes.places().zip(config.extra.iter().map(|extra| &extra.axis));
    let slowest_axis =
        own.chain(extra).map(|(k, axis)| delta[k].abs() / axis.max_velocity).fold(0.0, f64::max);
    let limited = slowest_axis.max(linear / config.max_velocity[0]).max(if linear == 0.0 {
        angular / config.max_velocity[1]
    } else {
        0.0
    });
    match step.kind {
        MoveKind::Rapid => limited,
        _ if linear > 0.0 => limited.max(linear / step.feed),
        _ if angular > 0.0 => limited.max(angular / step.angular_feed),
        _ => 0.0,
    }
}

/// Returns the duration of all moves in seconds, starting at `[TRAJ]HOME`.
pub fn duration_of_all(config: &Mechanism, moves: &[Move]) -> f64 {
    let starts = std::iter::once(config.start).chain(moves.iter().map(|step| step.end));
    starts.zip(moves).map(|(from, step)| duration(config, &from, step)).sum()
}

struct Player<'a> {
    config: &'a Mechanism,
    /// Values of the extra axes.
    extra: [f64; MAX_EXTRA],
    limits: Limits,
    period: f64,
    see: &'a mut dyn FnMut(&Visit),
    at: [f64; 6],
    line: u32,
    /// Time from the start of the next move to the next pose, seconds.
    ahead: f64,
    tool: Vector3<f64>,
    joints: Option<Joints>,
    seed: Pose,
    iterations: u64,
    proved: usize,
    result: Replay,
}

impl<'a> Player<'a> {
    fn new(config: &'a Mechanism, period: f64, see: &'a mut dyn FnMut(&Visit)) -> Self {
        let nowhere = At { value: 0.0, line: 0 };
        Self {
            config,
            extra: extra_home(config),
            // If an axis carries something, axis limits do not apply to the machine's own pose.
            limits: match config.chain.is_empty() {
                true => limits::of(config),
                false => limits::beyond_axes(config),
            },
            period,
            see,
            at: config.start,
            line: 0,
            ahead: 0.0,
            tool: config.spindle,
            joints: None,
            seed: config.home_pose(),
            iterations: 0,
            proved: 0,
            result: Replay {
                moves: 0,
                poses: 0,
                time: 0.0,
                mismatch: nowhere,
                relative_mismatch: 0.0,
                iterations_max: 0,
                iterations_mean: 0.0,
                certified: 0.0,
                groups: config.groups(),
                joints: vec![Range::EMPTY; config.joints.len()],
                pose: [Range::EMPTY; 6],
                correction: nowhere,
                base_cone: vec![nowhere; config.legs()],
                platform_cone: vec![nowhere; config.legs()],
                joint_speed: vec![nowhere; config.joints.len()],
                tool_step: nowhere,
                least_drive: None,
                broken: vec![],
            },
        }
    }

    /// Changes the tool: a new tool length keeps the commanded pose and moves the joints, unless the
    /// platform is level.
    fn change_tool(&mut self, step: &Move) -> Result<(), ReplayFault> {
        let tool = self.config.spindle + Vector3::from(step.tool);
        if tool == self.tool {
            return Ok(());
        }
        // The end of the previous move, after its last pose.
        let before = match self.joints {
            Some(_) => self.joints_at(&self.at, &self.extra),
            None => None,
        };
        self.tool = tool;
        self.joints = None;
        let after = self.visit(self.at, self.extra, step.line)?;
        for (old, new) in before.iter().flatten().zip(after) {
            larger(&mut self.result.tool_step, (new - old).abs(), step.line);
        }
        Ok(())
    }

    /// Visits poses at whole periods since the start of the program, independent of the ends of moves.
    fn play(&mut self, step: &Move) -> Result<(), ReplayFault> {
        let from = self.at;
        let began = self.extra;
        let duration = self.seconds(&from, step);
        while duration > 0.0 && self.ahead <= duration {
            let share = self.ahead / duration;
            let pose = std::array::from_fn(|i| from[i] + share * (step.end[i] - from[i]));
            let extra = std::array::from_fn(|i| began[i] + share * (step.extra_end[i] - began[i]));
            self.visit(pose, extra, step.line)?;
            self.ahead += self.period;
        }
        self.ahead -= duration;
        self.note_end(step)?;
        let is_moved = (from, began) != (step.end, step.extra_end);
        (self.at, self.extra) = (step.end, step.extra_end);
        self.line = step.line;
        self.result.moves += usize::from(is_moved && duration > 0.0);
        Ok(())
    }

    /// Returns the duration of a move in seconds, extra axes included.
    fn seconds(&self, from: &[f64; 6], step: &Move) -> f64 {
        if self.config.extra_axes.is_empty() {
            return duration(self.config, from, step);
        }
        let begin = self.config.world(from, &self.extra);
        let end = self.config.world(&step.end, &step.extra_end);
        seconds(self.config, &std::array::from_fn(|k| end[k] - begin[k]), step)
    }

    /// Returns the machine's pose.
    fn carried(&self, pose: &[f64; 6], extra: &[f64; MAX_EXTRA]) -> Result<[f64; 6], Fault> {
        self.config.carried(pose, extra, &self.tool)
    }

    fn machine_tool(&self) -> Vector3<f64> {
        self.config.chain.machine_tool(&self.tool)
    }

    fn joints_at(&self, pose: &[f64; 6], extra: &[f64; MAX_EXTRA]) -> Option<Joints> {
        let pose = Pose::from_degrees(self.carried(pose, extra).ok()?);
        self.config.machine.inverse(&pose, &self.machine_tool()).ok()
    }

    /// Records limits and ranges at the end of a move, which is usually between two periods.
    fn note_end(&mut self, step: &Move) -> Result<(), ReplayFault> {
        let (line, pose) = (step.line, step.end);
        let machine = &self.config.machine;
        let failed = |pose| move |fault| ReplayFault { line, pose, forward: false, fault };
        let pose = self.carried(&pose, &step.extra_end).map_err(failed(pose))?;
        let at = machine.at(&Pose::from_degrees(pose), &self.machine_tool());
        let at = at.map_err(failed(pose))?;
        self.note_pose(&at, line);
        self.note_extra(&step.extra_end, line);
        for (range, joint) in self.result.joints.iter_mut().zip(at.joints()) {
            range.add(*joint, line);
        }
        for (range, value) in self.result.pose.iter_mut().zip(pose) {
            range.add(value, line);
        }
        Ok(())
    }

    /// Visits the end of the program, which is between two periods.
    fn end(&mut self) -> Result<(), ReplayFault> {
        let is_there = self.result.poses > 0 && self.ahead >= self.period * (1.0 - ROUNDING);
        if !is_there {
            self.visit(self.at, self.extra, self.line)?;
        }
        Ok(())
    }

    /// Computes inverse, forward and the records of one pose.
    fn visit(
        &mut self,
        programmed: [f64; 6],
        extra: [f64; MAX_EXTRA],
        line: u32,
    ) -> Result<Joints, ReplayFault> {
        let refused = |fault| ReplayFault { line, pose: programmed, forward: false, fault };
        let pose = self.carried(&programmed, &extra).map_err(refused)?;
        let (asked, tool) = (Pose::from_degrees(pose), self.machine_tool());
        let failed = |forward| move |fault| ReplayFault { line, pose, forward, fault };
        let machine = &self.config.machine;
        let at = machine.at(&asked, &tool).map_err(failed(false))?;
        let joints = *at.joints();
        let solution = machine
            .forward(&joints, &self.seed, &tool, &self.config.solver)
            .map_err(failed(true))?;
        self.seed = solution.pose;
        self.note_solution(&asked, &solution, line);
        self.note_pose(&at, line);
        self.note_extra(&extra, line);
        self.note_joints(&joints, line);
        for (range, value) in self.result.pose.iter_mut().zip(pose) {
            range.add(value, line);
        }
        self.joints = Some(joints);
        let time = (self.result.poses - 1) as f64 * self.period;
        let (corrections, tool) = (at.corrections(), tool.into());
        let world = self.config.world(&programmed, &extra);
        let on_work = self.config.on_work(&asked, &world, &self.tool);
        (self.see)(&Visit { time, line, pose, world, joints, corrections, tool, on_work });
        Ok(joints)
    }

    fn note_solution(&mut self, asked: &Pose, solution: &Solution, line: u32) {
        let distance = asked.distance(&solution.pose, self.config.machine.radius());
        larger(&mut self.result.mismatch, distance, line);
        self.result.iterations_max = self.result.iterations_max.max(solution.iterations);
        self.iterations += u64::from(solution.iterations);
        let proved = solution.certificate != Certificate::None;
        self.proved += usize::from(proved && solution.sub_steps == 1);
        self.result.poses += 1;
    }

    /// Records the values of one pose.
    fn note_pose(&mut self, at: &kinematics::At, line: u32) {
        for correction in at.corrections() {
            larger(&mut self.result.correction, correction.abs(), line);
        }
        let Cones { base, platform } = at.cones();
        for (records, angles) in
            [(&mut self.result.base_cone, base), (&mut self.result.platform_cone, platform)]
        {
            records.iter_mut().zip(angles).for_each(|(record, angle)| larger(record, angle, line));
        }
        for value in (0..self.config.legs()).filter_map(|i| at.drive(i)) {
            if self.result.least_drive.is_none_or(|least| value < least.value) {
                self.result.least_drive = Some(At { value, line });
            }
        }
        limits::each(at, &self.limits, |margin| self.result.note(margin, line));
    }

    /// Records the limits of the extra axes.
    fn note_extra(&mut self, values: &[f64; MAX_EXTRA], line: u32) {
        let first = self.config.joints.len();
        for (n, (axis, value)) in self.config.extra.iter().zip(values).enumerate() {
            let (limit, part) = (Limit::JointRange, Part::Joint(first + n));
            let margin = Margin { limit, part, value: *value, range: axis.range() };
            if margin.room() < -ROUNDED * self.config.machine.size() {
                self.result.note(margin, line);
            }
        }
    }

    fn note_joints(&mut self, joints: &Joints, line: u32) {
        for (i, joint) in joints.iter().enumerate().take(self.result.joints.len()) {
            self.result.joints[i].add(*joint, line);
            if let Some(before) = self.joints {
                let speed = (joint - before[i]).abs() / self.period;
                larger(&mut self.result.joint_speed[i], speed, line);
            }
        }
        if let Some(before) = self.joints {
            let rates = std::array::from_fn(|i| (joints[i] - before[i]) / self.period);
            let _ = self.limits.speeds(&rates, self.result.joints.len(), |margin| {
                self.result.note(margin, line);
                ControlFlow::<()>::Continue(())
            });
        }
    }

    fn finish(self) -> Replay {
        let poses = self.result.poses.max(1) as f64;
        Replay {
            time: self.result.poses as f64 * self.period,
            relative_mismatch: self.result.mismatch.value / self.config.machine.size(),
            iterations_mean: self.iterations as f64 / poses,
            certified: self.proved as f64 / poses,
            ..self.result
        }
    }
}

fn larger(record: &mut At, value: f64, line: u32) {
    if value > record.value {
        *record = At { value, line };
    }
}

impl Replay {
    fn note(&mut self, margin: Margin, line: u32) {
        if margin.is_kept() {
            return;
        }
        let known = |(m, _): &&mut (Margin, u32)| (m.limit, m.part) == (margin.limit, margin.part);
        match self.broken.iter_mut().find(known) {
            Some((worst, _)) if !(margin.room() < worst.room()) => {}
            Some(worst) => *worst = (margin, line),
            None => self.broken.push((margin, line)),
        }
    }

    /// Returns every limit of the machine that the program violates, one sentence each.
    pub fn violations(&self, config: &Mechanism) -> Vec<String> {
        let sentence = |(margin, line): &(Margin, u32)| {
            let Margin { limit, part, value, range: [low, high] } = *margin;
            let (name, unit) =
                (limits::part(config, limit, part), limits::unit(config, limit, part));
            let beyond = match value < low {
                true => format!("below {low}"),
                false => format!("above {high}"),
            };
            format!("line {line}: {name} reaches {value:.3} {unit}, {beyond}").replace(" ,", ",")
        };
        let mut broken = self.broken.clone();
        broken.sort_by_key(|(margin, _)| margin.limit);
        broken.iter().map(sentence).collect()
    }
}

impl fmt::Display for Replay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let most = |values: &[At]| values.iter().fold(0.0, |most: f64, at| most.max(at.value));
        writeln!(f, "moves {}, poses {}, {:.1} s", self.moves, self.poses, self.time)?;
        writeln!(
            f,
            "forward(inverse): within {:.2e} ({:.2e} of size), line {}",
            self.mismatch.value, self.relative_mismatch, self.mismatch.line
        )?;
        writeln!(
            f,
            "iterations: most {}, mean {:.3}; certified {:.4} %",
            self.iterations_max,
            self.iterations_mean,
            self.certified * 100.0
        )?;
        writeln!(
            f,
            "largest correction {:.4}, line {}",
            self.correction.value, self.correction.line
        )?;
        writeln!(
            f,
            "largest cone angle: base {:.2}, platform {:.2} degrees",
            most(&self.base_cone),
            most(&self.platform_cone)
        )?;
        for group in &self.groups {
            self.write_group(f, group)?;
        }
        if let Some(At { value, line }) = self.least_drive {
            writeln!(f, "closest to a dead point: cosine {value:.3}, line {line}")?;
        }
        write!(f, "tool changes move joints by {:.2e}", self.tool_step.value)
    }
}

impl Replay {
    fn write_group(&self, f: &mut fmt::Formatter<'_>, group: &Group) -> fmt::Result {
        let Group { kind, unit, joints } = group;
        let ranges = || joints.iter().map(|i| &self.joints[*i]);
        let low = ranges().fold(f64::INFINITY, |low, r| low.min(r.min.value));
        let high = ranges().fold(f64::NEG_INFINITY, |high, r| high.max(r.max.value));
        let speed = joints.iter().fold(0.0, |most: f64, i| most.max(self.joint_speed[*i].value));
        let name = kind.plural();
        writeln!(f, "{name} {low:.3} to {high:.3} {unit}, at most {speed:.2} {unit}/s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Spindle;
    use machine::read::machine::MachineConfig;
    use std::path::Path;
    use std::sync::Arc;

    fn config_of(machine: &str) -> Mechanism {
        let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
        let file = configs.join(machine).join(format!("{machine}.ini"));
        MachineConfig::read(&file).unwrap().mechanism(1).unwrap()
    }

    fn config() -> Mechanism {
        config_of("hexapod")
    }

    fn rapid(line: u32, end: [f64; 6], tool_z: f64) -> Move {
        let tool = [0.0, 0.0, tool_z];
        Move {
            kind: MoveKind::Rapid,
            line,
            end,
            feed: 0.0,
            angular_feed: 0.0,
            tool,
            file: 0,
            extra: false,
            second: None,
            lasts: None,
            extra_end: [0.0; MAX_EXTRA],
            spindle: Spindle::Unknown,
            is_per_turn: false,
        }
    }

    #[test]
    fn a_tool_change_moves_no_joint_of_a_level_platform() {
        let low = [20.0, 0.0, 220.0, 0.0, 0.0, 0.0];
        let moves = [rapid(1, low, 0.0), rapid(2, low, 60.0)];
        assert_eq!(replay(&config(), &moves, 1e-3).unwrap().tool_step.value, 0.0);
    }

    #[test]
    fn a_tool_change_on_a_tilted_platform_is_seen() {
        let tilted = [0.0, 0.0, 220.0, 20.0, 0.0, 0.0];
        let moves = [rapid(1, tilted, 0.0), rapid(2, tilted, 60.0)];
        let step = replay(&config(), &moves, 1e-3).unwrap().tool_step;
        assert!(step.value > 1.0 && step.line == 2, "{step:?}");
    }

    /// Checks the period: treating chords of half a period as a full period would halve their speed.
    #[test]
    fn short_moves_run_at_their_feed() {
        let mut config = config();
        Arc::make_mut(&mut config.facts).max_velocity[0] = 100.0;
        let chord = |n: u32| rapid(n, [0.05 * f64::from(n), 0.0, 250.0, 0.0, 0.0, 0.0], 0.0);
        let moves: Vec<Move> = (1..=1000).map(chord).collect();
        let mut poses: Vec<(f64, f64)> = vec![];
        let found = replay_seen(&config, &moves, 1e-3, |visit| {
            poses.push((visit.time, visit.pose[0]));
        });
        assert!(found.is_ok());
        // 50 mm at 100 mm/s; sums of a thousand steps.
        assert_eq!(poses.len(), 501);
        for (time, x) in poses {
            assert!((x - 100.0 * time).abs() < 1e-9, "{x} at {time}");
        }
    }

    #[test]
    fn limits_left_are_named_with_their_line() {
        let mut config = config();
        (config.joints[3].max, config.axes[0].max) = (940.0, 10.0);
        config.angles[0].cones[0] = Some(0.5);
        let moves = [rapid(7, [20.0, 0.0, 200.0, 0.0, 0.0, 0.0], 0.0)];
        let found = replay(&config, &moves, 1e-3).unwrap().violations(&config);
        let starts = ["line 7: strut 3 reaches", "line 7: axis X reaches 20.000 mm, above 10"];
        for start in starts.into_iter().chain(["line 7: the base joint of leg 0 reaches"]) {
            assert!(found.iter().any(|text| text.starts_with(start)), "{start}: {found:?}");
        }
        assert_eq!(found.len(), 3, "{found:?}");
    }

    #[test]
    fn limits_are_reported_in_the_words_and_units_of_the_joint() {
        for (machine, joint, to, text) in [
            ("four-rod-lathe", 1, [0.0, 0.0, 5.0], "carriage 1 reaches 1509.410 mm, above 1500"),
            ("pyramid", 4, [4.0, 0.0, 0.0], "table X reaches 4.000 mm, above 3"),
            ("rotary-delta", 2, [0.0, 0.0, -0.2], "arm 2 reaches 11.320 degrees, above 11"),
        ] {
            let mut config = config_of(machine);
            config.joints[joint].max = text.rsplit(' ').next().unwrap().parse().unwrap();
            let mut end = config.home;
            (0..3).for_each(|i| end[i] += to[i]);
            let found = replay(&config, &[rapid(7, end, 0.0)], 1e-3).unwrap().violations(&config);
            assert_eq!(found, [format!("line 7: {text}")]);
        }
    }

    #[test]
    fn the_place_nearest_to_a_dead_point_is_found_where_there_are_rods() {
        let mut end = config_of("four-rod-lathe").home;
        end[1] += 30.0;
        let moves = [rapid(7, end, 0.0)];
        let least = replay(&config_of("four-rod-lathe"), &moves, 1e-3).unwrap().least_drive;
        // Rods of 700 whose upper ends are at (300, 480) from their rails.
        let expected = (700.0_f64.powi(2) - 300.0_f64.powi(2) - 480.0_f64.powi(2)).sqrt() / 700.0;
        let At { value, line } = least.unwrap();
        assert!((value - expected).abs() < 1e-12 && line == 7, "{value} {line}");
        let strut = rapid(7, [20.0, 0.0, 220.0, 0.0, 0.0, 0.0], 0.0);
        assert_eq!(replay(&config(), &[strut], 1e-3).unwrap().least_drive, None);
    }

    #[test]
    fn a_pose_that_fails_ends_the_replay_with_its_line() {
        let mut end = config().home;
        end[4] = f64::NAN;
        let fault = replay(&config(), &[rapid(9, end, 0.0)], 1e-3).unwrap_err();
        assert_eq!((fault.line, fault.forward), (9, false));
        assert_eq!(fault.fault.cause, kinematics::Cause::PoseNotFinite);
    }
}
