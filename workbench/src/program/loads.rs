// SPDX-License-Identifier: GPL-2.0-or-later
//! Speeds and accelerations that a program asks of the joints, cycle by cycle as LinuxCNC commands
//! them: the inverse of the planner's poses, passed through the cubic spline of its joints.

use crate::program::interpreter::Move;
use crate::program::planner::{self, Cycle};
use crate::read::joints::Joint;
use crate::read::machine::MachineConfig;
use kinematics::{Joints, Pose, Vector3};
use serde::Serialize;

/// Largest value of a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Joint.
    pub joint: String,
    /// In the joint's unit a second, or a second squared.
    pub value: f64,
    /// Its limit.
    pub limit: f64,
    /// Line of the program.
    pub line: u32,
}

/// A place where a joint is beyond its limit for the first time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Joint.
    pub joint: usize,
    /// The cycle.
    pub at: Cycle,
}

/// Speeds or accelerations of all joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// By joint.
    pub peaks: Vec<Peak>,
    /// Where the first limit is left.
    pub beyond: Option<Beyond>,
}

/// What a program asks of the joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Loads {
    /// Speeds.
    pub speed: Load,
    /// Accelerations.
    pub acceleration: Load,
    /// Seconds of motion.
    pub time: f64,
}

/// Follows the moves from `[TRAJ]HOME` on in servo cycles. Poses without joint values, and tool
/// changes, interrupt the calculation.
pub fn loads(config: &MachineConfig, moves: &[Move]) -> Loads {
    let mut spline = Spline::default();
    let [speed, acceleration] =
        [|joint: &Joint| joint.max_velocity, |joint: &Joint| joint.max_acceleration]
            .map(|limit| empty(config, limit));
    let mut found = Loads { speed, acceleration, time: 0.0 };
    let mut tool = None;
    planner::run(config, moves, |cycle| {
        found.time += config.period;
        if tool != Some(cycle.tool) {
            (tool, spline) = (Some(cycle.tool), Spline::default());
        }
        let offset = config.spindle + Vector3::from(cycle.tool);
        let joints = config.machine.inverse(&Pose::from_degrees(cycle.pose), &offset);
        let Ok(joints) = joints else {
            spline = Spline::default();
            return;
        };
        let line = moves[cycle.number].line;
        if let Some((speed, acceleration)) = spline.rates(&joints, config.period) {
            found.speed.note(&speed, cycle, line);
            found.acceleration.note(&acceleration, cycle, line);
        }
    });
    found
}

fn empty(config: &MachineConfig, limit: impl Fn(&Joint) -> f64) -> Load {
    let peak = |joint: &Joint| Peak {
        joint: joint.name.clone(),
        value: 0.0,
        limit: limit(joint),
        line: 0,
    };
    Load { peaks: config.joints.iter().map(peak).collect(), beyond: None }
}

impl Load {
    fn note(&mut self, values: &Joints, cycle: &Cycle, line: u32) {
        for (joint, (peak, value)) in self.peaks.iter_mut().zip(values).enumerate() {
            if value.abs() > peak.value {
                (peak.value, peak.line) = (value.abs(), line);
                if peak.value > peak.limit && self.beyond.is_none() {
                    self.beyond = Some(Beyond { joint, at: *cycle });
                }
            }
        }
    }
}

/// LinuxCNC's joint commands: a uniform cubic B-spline through the inverse of the poses, at its knots.
#[derive(Default)]
struct Spline {
    /// The last joint values, the newest last, and how many there are.
    knots: [Joints; 3],
    filled: usize,
    place: Option<Joints>,
    speed: Option<Joints>,
}

impl Spline {
    /// Speeds and accelerations of the newest command, as soon as there are enough.
    fn rates(&mut self, joints: &Joints, period: f64) -> Option<(Joints, Joints)> {
        self.knots = [self.knots[1], self.knots[2], *joints];
        self.filled += 1;
        if self.filled < self.knots.len() {
            return None;
        }
        let [a, b, c] = &self.knots;
        let each = |value: &dyn Fn(usize) -> f64| -> Joints { std::array::from_fn(value) };
        let place = each(&|n| (a[n] + 4.0 * b[n] + c[n]) / 6.0);
        let last = self.place.replace(place)?;
        let speed = each(&|n| (place[n] - last[n]) / period);
        let before = self.speed.replace(speed)?;
        Some((speed, each(&|n| (speed[n] - before[n]) / period)))
    }
}
