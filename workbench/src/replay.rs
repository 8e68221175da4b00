// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs replayed without a machine: moves, poses at the servo period, inverse,
//! forward seeded by the pose before.
//!
//! Between its end points a move runs at constant speed; acceleration and blending
//! are left out, so that speeds are upper bounds for straight pieces.

use crate::interpreter::{Move, MoveKind};
use crate::machine::{JOINTS, MachineConfig};
use kinematics::{Certificate, Fault, Pose, Solution, Vector3};
use std::fmt;

/// A value and the program line it occurred in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct At {
    /// The value.
    pub value: f64,
    /// Line of the program, counted from 1.
    pub line: u32,
}

/// Smallest and largest value seen.
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

/// What a replay found. Lengths in machine units, angles in degrees, time in seconds.
#[derive(Clone, Debug)]
pub struct Replay {
    /// Moves with a length.
    pub moves: usize,
    /// Poses computed, one a servo period.
    pub poses: usize,
    /// Duration.
    pub time: f64,
    /// Largest distance ‖(Δp, r·turn)‖ between a pose and forward of its joints.
    pub mismatch: At,
    /// The same, as a share of the machine's size.
    pub relative_mismatch: f64,
    /// Most iterations of one forward call.
    pub iterations_max: u32,
    /// Mean of the iterations.
    pub iterations_mean: f64,
    /// Share of the poses that one certified ball proved.
    pub certified: f64,
    /// Joint values, per joint.
    pub joints: [Range; JOINTS],
    /// Pose coordinates x y z a b c.
    pub pose: [Range; 6],
    /// Largest amount of a nut correction.
    pub correction: At,
    /// Largest cone angle, per base joint.
    pub base_cone: [At; JOINTS],
    /// Largest cone angle, per platform joint.
    pub platform_cone: [At; JOINTS],
    /// Largest joint speed, per joint.
    pub joint_speed: [At; JOINTS],
    /// Largest move of a joint by a change of the tool length alone.
    pub tool_step: At,
}

/// Where a replay ended early.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReplayFault {
    /// Line of the program, counted from 1.
    pub line: u32,
    /// The pose asked for: x y z in machine units, a b c in degrees.
    pub pose: [f64; 6],
    /// Whether forward failed (else inverse).
    pub forward: bool,
    /// Why.
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
pub fn replay(config: &MachineConfig, moves: &[Move], period: f64) -> Result<Replay, ReplayFault> {
    let mut player = Player::new(config, period);
    for step in moves {
        player.change_tool(step)?;
        player.play(step)?;
    }
    Ok(player.finish())
}

/// Seconds a move takes: feed or rapid speed, slowed down to the limits of the axes.
///
/// LinuxCNC's rule: the feed is that of X Y Z together where one of them moves, else
/// that of A B C together.
pub fn duration(config: &MachineConfig, from: &[f64; 6], step: &Move) -> f64 {
    let delta: [f64; 6] = std::array::from_fn(|i| step.end[i] - from[i]);
    let norm = |part: &[f64]| part.iter().map(|d| d * d).sum::<f64>().sqrt();
    let (linear, angular) = (norm(&delta[..3]), norm(&delta[3..]));
    let slowest_axis = delta
        .iter()
        .zip(&config.axes)
        .map(|(d, axis)| d.abs() / axis.max_velocity)
        .fold(0.0, f64::max);
    let limited = slowest_axis.max(linear / config.max_linear_velocity).max(if linear == 0.0 {
        angular / config.max_angular_velocity
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

struct Player<'a> {
    config: &'a MachineConfig,
    period: f64,
    at: [f64; 6],
    tool: Vector3<f64>,
    joints: Option<[f64; JOINTS]>,
    seed: Pose,
    iterations: u64,
    proved: usize,
    result: Replay,
}

impl<'a> Player<'a> {
    fn new(config: &'a MachineConfig, period: f64) -> Self {
        let nowhere = At { value: 0.0, line: 0 };
        Self {
            config,
            period,
            at: config.home,
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
                joints: [Range::EMPTY; JOINTS],
                pose: [Range::EMPTY; 6],
                correction: nowhere,
                base_cone: [nowhere; JOINTS],
                platform_cone: [nowhere; JOINTS],
                joint_speed: [nowhere; JOINTS],
                tool_step: nowhere,
            },
        }
    }

    /// A new tool length leaves the commanded pose and moves the joints, unless the
    /// platform is level.
    fn change_tool(&mut self, step: &Move) -> Result<(), ReplayFault> {
        let tool = self.config.spindle + Vector3::from(step.tool);
        if tool == self.tool {
            return Ok(());
        }
        let before = self.joints;
        self.tool = tool;
        self.joints = None;
        let after = self.visit(self.at, step.line)?;
        for (old, new) in before.iter().flatten().zip(after) {
            larger(&mut self.result.tool_step, (new - old).abs(), step.line);
        }
        Ok(())
    }

    fn play(&mut self, step: &Move) -> Result<(), ReplayFault> {
        let from = self.at;
        let duration = duration(self.config, &from, step);
        let periods = (duration / self.period).ceil().max(1.0);
        for k in 1..=periods as u64 {
            let share = k as f64 / periods;
            let pose = std::array::from_fn(|i| from[i] + share * (step.end[i] - from[i]));
            self.visit(pose, step.line)?;
        }
        self.at = step.end;
        self.result.moves += usize::from(duration > 0.0);
        Ok(())
    }

    /// Inverse, forward and the records of one pose.
    fn visit(&mut self, pose: [f64; 6], line: u32) -> Result<[f64; JOINTS], ReplayFault> {
        let asked = Pose::from_degrees(pose);
        let failed = |forward| move |fault| ReplayFault { line, pose, forward, fault };
        let machine = &self.config.machine;
        let joints = machine.inverse(&asked, &self.tool).map_err(failed(false))?;
        let solution = machine
            .forward(&joints, &self.seed, &self.tool, &self.config.solver)
            .map_err(failed(true))?;
        self.seed = solution.pose;
        self.note_solution(&asked, &solution, line);
        self.note_pose(&asked, line).map_err(failed(false))?;
        self.note_joints(&joints, line);
        for (range, value) in self.result.pose.iter_mut().zip(pose) {
            range.add(value, line);
        }
        self.joints = Some(joints);
        Ok(joints)
    }

    fn note_solution(&mut self, asked: &Pose, solution: &Solution<JOINTS>, line: u32) {
        let distance = asked.distance(&solution.pose, self.config.machine.radius());
        larger(&mut self.result.mismatch, distance, line);
        self.result.iterations_max = self.result.iterations_max.max(solution.iterations);
        self.iterations += u64::from(solution.iterations);
        let ball = matches!(solution.certificate, Certificate::Ball(_));
        self.proved += usize::from(ball && solution.sub_steps == 1);
        self.result.poses += 1;
    }

    fn note_pose(&mut self, asked: &Pose, line: u32) -> Result<(), Fault> {
        for correction in self.config.machine.corrections(asked, &self.tool)? {
            larger(&mut self.result.correction, correction.abs(), line);
        }
        let cones = self.config.cone_angles(asked, &self.tool)?;
        for i in 0..JOINTS {
            larger(&mut self.result.base_cone[i], cones.base[i], line);
            larger(&mut self.result.platform_cone[i], cones.platform[i], line);
        }
        Ok(())
    }

    fn note_joints(&mut self, joints: &[f64; JOINTS], line: u32) {
        for (i, joint) in joints.iter().enumerate() {
            self.result.joints[i].add(*joint, line);
            if let Some(before) = self.joints {
                let speed = (joint - before[i]).abs() / self.period;
                larger(&mut self.result.joint_speed[i], speed, line);
            }
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
    /// Every limit of the machine that the program leaves, one sentence each.
    pub fn violations(&self, config: &MachineConfig) -> Vec<String> {
        let mut found = vec![];
        for (i, (range, joint)) in self.joints.iter().zip(&config.joints).enumerate() {
            let name = format!("joint {i}");
            check_range(&mut found, &name, range, joint.min, joint.max);
            check_most(
                &mut found,
                &format!("speed of {name}"),
                self.joint_speed[i],
                joint.max_velocity,
            );
        }
        for (i, (range, axis)) in self.pose.iter().zip(&config.axes).enumerate() {
            let name = format!("axis {}", ["X", "Y", "Z", "A", "B", "C"][i]);
            check_range(&mut found, &name, range, axis.min, axis.max);
        }
        let cones = [
            ("base", &self.base_cone, &config.base_cone),
            ("platform", &self.platform_cone, &config.platform_cone),
        ];
        for (body, angles, limits) in cones {
            for (i, (angle, limit)) in angles.iter().zip(limits).enumerate() {
                let limit = limit.unwrap_or(f64::INFINITY);
                check_most(&mut found, &format!("cone angle of {body} joint {i}"), *angle, limit);
            }
        }
        found
    }
}

fn check_range(found: &mut Vec<String>, name: &str, range: &Range, min: f64, max: f64) {
    if range.min.value < min {
        let At { value, line } = range.min;
        found.push(format!("line {line}: {name} reaches {value:.3}, below {min}"));
    }
    check_most(found, name, range.max, max);
}

fn check_most(found: &mut Vec<String>, name: &str, At { value, line }: At, max: f64) {
    if value > max {
        found.push(format!("line {line}: {name} reaches {value:.3}, above {max}"));
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
        writeln!(f, "largest joint speed {:.2} per second", most(&self.joint_speed))?;
        let low = self.joints.iter().fold(f64::INFINITY, |low, r| low.min(r.min.value));
        let high = self.joints.iter().fold(0.0, |high: f64, r| high.max(r.max.value));
        write!(
            f,
            "joints {low:.3} to {high:.3}; tool changes move them by {:.2e}",
            self.tool_step.value
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn config() -> MachineConfig {
        let ini = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hexapod/hexapod.ini");
        MachineConfig::read(&ini).unwrap()
    }

    fn rapid(line: u32, end: [f64; 6], tool_z: f64) -> Move {
        let tool = [0.0, 0.0, tool_z];
        Move { kind: MoveKind::Rapid, line, end, feed: 0.0, angular_feed: 0.0, tool }
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

    #[test]
    fn limits_left_are_named_with_their_line() {
        let mut config = config();
        (config.joints[3].max, config.axes[0].max, config.base_cone[0]) = (940.0, 10.0, Some(0.5));
        let moves = [rapid(7, [20.0, 0.0, 200.0, 0.0, 0.0, 0.0], 0.0)];
        let found = replay(&config, &moves, 1e-3).unwrap().violations(&config);
        let starts = ["line 7: joint 3 reaches", "line 7: axis X reaches 20.000, above 10"];
        for start in starts.into_iter().chain(["line 7: cone angle of base joint 0 reaches"]) {
            assert!(found.iter().any(|text| text.starts_with(start)), "{start}: {found:?}");
        }
        assert_eq!(found.len(), 3, "{found:?}");
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
