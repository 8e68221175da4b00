// SPDX-License-Identifier: GPL-2.0-or-later
//! Thinned course of a machine in a program: as many samples for a second as for a day.
//!
//! A sample represents a stretch of the program. If there are too many, every two neighbors
//! are joined, and from then on stretches are twice as long. For the values of every cycle, a sample
//! has the extremes, so that a peak of one cycle is never lost. Margins of limits other than the
//! ranges of axes and joints take longer to compute: they are those of one pose at the start of
//! each stretch, at the resolution of that time. [`crate::preflight`] proves whether a program satisfies them.

use crate::loads::Motion;
use crate::motion::Move;
use kinematics::{Letter, Limit, Limits, MAX_EXTRA, MAX_JOINTS, Margin, Part, Pose, Vector3};
use linuxcnc::row::Row;
use machine::limits;
use machine::read::joints::Joint;
use machine::read::mechanism::Mechanism;
use serde::Serialize;

/// Largest number of samples: several for each column of pixels of a wide plot.
pub const MOST_SAMPLES: usize = 8192;

/// Values of a mechanism's joints, then of the extra axes.
pub type AllJoints = [f64; MAX_JOINTS + MAX_EXTRA];

/// The abscissa of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Abscissa {
    /// Seconds of the machine's time.
    Seconds,
    /// Machine units along the path of the control point; degrees for moves that only rotate.
    Length,
}

/// Remaining shares of the limits' ranges, by [`Limit::index`]: 0 at the limit, negative beyond
/// it, infinite if the machine has no such limit, minus infinity if nothing can be computed.
pub type Rooms = [f64; Limit::ALL.len()];

/// A stretch of a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Abscissa of its start.
    pub at: f64,
    /// Lowest and highest line in it.
    pub lines: [u32; 2],
    /// The sampled pose with the least room.
    pub pose: [f64; 6],
    /// Lowest and highest value of each coordinate.
    pub poses: [[f64; 2]; 6],
    /// Lowest and highest value of each joint; infinite and reversed if there is none.
    pub joints: [[f64; 2]; MAX_JOINTS + MAX_EXTRA],
    /// Largest speed of each joint as a share of its limit.
    pub speeds: AllJoints,
    /// Largest acceleration of each joint as a share of its limit.
    pub accelerations: AllJoints,
    /// Largest following error of each joint as a share of the limit at its speed.
    pub errors: AllJoints,
    /// Least room to each limit of the pose.
    pub rooms: Rooms,
    /// Least share of the feed that the guard allows.
    pub feed: f64,
}

impl Sample {
    /// Returns the least room to any limit.
    pub fn room(&self) -> f64 {
        let shares = [&self.speeds, &self.accelerations, &self.errors];
        let motion = shares.into_iter().flatten().map(|share| 1.0 - share);
        self.rooms.iter().copied().chain(motion).fold(f64::INFINITY, f64::min)
    }

    /// Joins this stretch and the next one.
    fn joined(mut self, next: &Self) -> Self {
        if next.room_of_pose() < self.room_of_pose() {
            self.pose = next.pose;
        }
        self.lines = [self.lines[0].min(next.lines[0]), self.lines[1].max(next.lines[1])];
        widen(&mut self.poses, &next.poses);
        widen(&mut self.joints, &next.joints);
        raise(&mut self.speeds, &next.speeds);
        raise(&mut self.accelerations, &next.accelerations);
        raise(&mut self.errors, &next.errors);
        let rooms = self.rooms.iter_mut().zip(&next.rooms);
        rooms.for_each(|(room, other)| *room = room.min(*other));
        self.feed = self.feed.min(next.feed);
        self
    }

    fn room_of_pose(&self) -> f64 {
        self.rooms.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

fn widen(ranges: &mut [[f64; 2]], others: &[[f64; 2]]) {
    for (range, other) in ranges.iter_mut().zip(others) {
        *range = [range[0].min(other[0]), range[1].max(other[1])];
    }
}

fn raise(values: &mut AllJoints, others: &AllJoints) {
    values.iter_mut().zip(others).for_each(|(value, other)| *value = value.max(*other));
}

/// Thinned course of a machine in a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Thinned {
    /// The abscissa of the samples.
    pub abscissa: Abscissa,
    /// At most [`MOST_SAMPLES`], in order.
    pub samples: Vec<Sample>,
    /// Abscissa of the end of the program.
    pub end: f64,
}

impl Thinned {
    /// Returns the abscissa at which a line is nearest to a pose; none if the line is not executed.
    pub fn place(&self, config: &Mechanism, line: u32, pose: &[f64; 6]) -> Option<f64> {
        let half_size = config.machine.size() / 2.0;
        let distance = |sample: &Sample| -> f64 {
            let parts = sample.pose.iter().zip(pose).enumerate();
            let part = |(k, (a, b)): (usize, (&f64, &f64))| {
                let scale = if k < 3 { 1.0 } else { half_size.to_radians() };
                (scale * (a - b)).powi(2)
            };
            parts.map(part).sum()
        };
        let inside = self.samples.iter().filter(|s| (s.lines[0]..=s.lines[1]).contains(&line));
        // The first of equal ones.
        let nearest = inside.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some(nearest.at)
    }

    /// Returns the lowest and highest value of a coordinate or of a joint.
    pub fn range(&self, of: impl Fn(&Sample) -> [f64; 2]) -> [f64; 2] {
        self.samples.iter().map(of).fold([f64::INFINITY, f64::NEG_INFINITY], |range, other| {
            [range[0].min(other[0]), range[1].max(other[1])]
        })
    }
}

/// Samples a program as it runs.
pub struct Course<'a> {
    config: &'a Mechanism,
    limits: Limits,
    motion: Motion<{ MAX_JOINTS + MAX_EXTRA }>,
    result: Thinned,
    /// Number of moments per sample.
    width: u64,
    /// Number of moments in the last sample.
    filled: u64,
}

/// A moment, without its margins.
struct Moment {
    at: f64,
    line: u32,
    /// Programmed pose.
    pose: [f64; 6],
    /// The machine's own pose, to which the tool vector belongs.
    machine: [f64; 6],
    tool: Vector3<f64>,
    joints: Option<AllJoints>,
    shares: [AllJoints; 3],
    feed: f64,
}

impl<'a> Course<'a> {
    /// Creates an empty course over time.
    pub fn new(config: &'a Mechanism) -> Self {
        Self::over(config, Abscissa::Seconds)
    }

    fn over(config: &'a Mechanism, abscissa: Abscissa) -> Self {
        let mut limits = limits::of(config);
        for (range, axis) in limits.axis.iter_mut().zip(&config.programmed) {
            *range = [axis.min, axis.max];
        }
        let result = Thinned { abscissa, samples: vec![], end: 0.0 };
        Self { config, limits, motion: Motion::START, result, width: 1, filled: 0 }
    }

    /// Samples the path of moves from `[TRAJ]HOME` on, without time.
    pub fn along(config: &'a Mechanism, moves: &[Move]) -> Thinned {
        let mut course = Self::over(config, Abscissa::Length);
        let total: f64 = lengths(config, moves).map(|(_, length)| length).sum();
        let (mut before, mut extra) = (0.0, [0.0; MAX_EXTRA]);
        for (number, (step, (from, length))) in moves.iter().zip(lengths(config, moves)).enumerate()
        {
            let tool = config.spindle + Vector3::from(step.tool);
            let count = (length / total * MOST_SAMPLES as f64).ceil().max(1.0);
            // The end of a move is the start of the next one.
            for n in usize::from(number > 0)..=count as usize {
                let share = n as f64 / count;
                let programmed = std::array::from_fn(|k| from[k] + share * (step.end[k] - from[k]));
                let values =
                    std::array::from_fn(|k| extra[k] + share * (step.extra_end[k] - extra[k]));
                let machine = config.carried(&programmed, &values, &tool).unwrap_or([f64::NAN; 6]);
                let pose = config.reported_pose(&programmed, &values);
                let tool = config.chain.machine_tool(&tool);
                let at = config.machine.at(&Pose::from_degrees(machine), &tool);
                let joints = at.map(|at| course.all_joints(at.joints(), &values));
                course.take(&Moment {
                    at: before + share * length,
                    line: step.line,
                    pose,
                    machine,
                    tool,
                    joints: joints.ok(),
                    shares: [[0.0; MAX_JOINTS + MAX_EXTRA]; 3],
                    feed: 1.0,
                });
            }
            before += length;
            extra = step.extra_end;
        }
        course.finish()
    }

    /// Adds a servo cycle.
    pub fn see(&mut self, row: &Row) {
        let at = row.cycle as f64 * self.config.period;
        let first = self.config.place.first_joint;
        let all = |own: &[f64], extra| self.all_joints(&own[first..], extra);
        let joints = all(&row.joints, &row.extra.positions);
        let (errors, allowed) =
            (all(&row.errors, &row.extra.errors), all(&row.allowed, &row.extra.allowed));
        let [speeds, accelerations] = self.motion.next(row, &joints, self.config.period);
        let shares = [
            shares(&speeds, self.each_joint(Joint::speed)),
            shares(&accelerations, self.each_joint(|joint| joint.max_acceleration)),
            shares(&errors, allowed.into_iter()),
        ];
        let (machine, tool) = row.machine(self.config);
        let pose = self.config.reported_pose(&row.of(self.config).pose, &row.extra.positions);
        let (joints, feed) = (Some(joints), row.feed);
        self.take(&Moment { at, line: row.line, pose, machine, tool, joints, shares, feed });
    }

    /// Returns the values of the mechanism's joints, then those of the extra axes, and 0 beyond.
    fn all_joints(&self, own: &[f64], extra: &[f64; MAX_EXTRA]) -> AllJoints {
        let own = own.iter().take(self.config.joints.len());
        let mut all = [0.0; MAX_JOINTS + MAX_EXTRA];
        all.iter_mut().zip(own.chain(extra)).for_each(|(to, value)| *to = *value);
        all
    }

    /// Returns a limit of each joint, extra axes included.
    fn each_joint(&self, limit: impl Fn(&Joint) -> f64) -> impl Iterator<Item = f64> {
        let extra = self.config.extra.iter().map(|axis| &axis.joint);
        self.config.joints.iter().chain(extra).map(limit)
    }

    fn take(&mut self, moment: &Moment) {
        self.result.end = moment.at;
        let starts = self.filled == 0 || self.filled == self.width;
        let rooms = if starts { self.rooms(moment) } else { self.rooms_of_ranges(moment) };
        let [speeds, accelerations, errors] = moment.shares;
        let sample = Sample {
            at: moment.at,
            lines: [moment.line; 2],
            pose: moment.pose,
            poses: moment.pose.map(|value| [value; 2]),
            joints: moment
                .joints
                .map_or([[f64::INFINITY, f64::NEG_INFINITY]; MAX_JOINTS + MAX_EXTRA], |all| {
                    all.map(|value| [value; 2])
                }),
            speeds,
            accelerations,
            errors,
            rooms,
            feed: moment.feed,
        };
        match self.result.samples.last_mut() {
            Some(last) if !starts => {
                *last = last.joined(&sample);
                self.filled += 1;
            }
            _ => {
                self.make_room();
                self.result.samples.push(sample);
                self.filled = 1;
            }
        }
    }

    /// Joins neighbors if one more sample would be too many.
    fn make_room(&mut self) {
        let samples = &mut self.result.samples;
        if samples.len() < MOST_SAMPLES {
            return;
        }
        let pairs = samples.chunks(2).map(|pair| match pair {
            [first, second] => first.joined(second),
            single => single[0],
        });
        *samples = pairs.collect();
        self.width *= 2;
    }

    /// Returns the rooms to all limits of the pose.
    fn rooms(&self, moment: &Moment) -> Rooms {
        let mut rooms = self.rooms_of_ranges(moment);
        // Axis limits apply to the programmed pose, and are already evaluated.
        let own = Limits { axis: Limits::NONE.axis, ..self.limits };
        match self.config.machine.at(&Pose::from_degrees(moment.machine), &moment.tool) {
            Ok(at) => limits::each(&at, &own, |margin| lower(&mut rooms, &margin)),
            Err(fault) => rooms[Margin::of_fault(&fault).limit.index()] = f64::NEG_INFINITY,
        }
        rooms
    }

    /// Returns the rooms in the ranges of axes and joints, which are cheap to compute.
    fn rooms_of_ranges(&self, moment: &Moment) -> Rooms {
        let mut rooms = [f64::INFINITY; Limit::ALL.len()];
        let axes = Letter::ALL.into_iter().zip(moment.pose).zip(self.limits.axis);
        for ((letter, value), range) in axes {
            let (limit, part) = (Limit::Axis, Part::Axis(letter));
            lower(&mut rooms, &Margin { limit, part, value, range });
        }
        let joints = moment.joints.iter().flatten().enumerate();
        for (i, value) in joints.take(self.config.joints.len() + self.config.extra.len()) {
            let (limit, part, range) = (Limit::JointRange, Part::Joint(i), self.config.range_of(i));
            lower(&mut rooms, &Margin { limit, part, value: *value, range });
        }
        rooms
    }

    /// Returns the result.
    pub fn finish(self) -> Thinned {
        self.result
    }
}

fn lower(rooms: &mut Rooms, margin: &Margin) {
    let room = &mut rooms[margin.limit.index()];
    *room = room.min(margin.share());
}

/// Returns absolute values as shares of their limits, and 0 for values without one.
fn shares(values: &AllJoints, limits: impl Iterator<Item = f64>) -> AllJoints {
    let mut shares = [0.0; MAX_JOINTS + MAX_EXTRA];
    for (share, (value, limit)) in shares.iter_mut().zip(values.iter().zip(limits)) {
        // NaN counts as beyond any limit.
        *share = match value.abs() / limit {
            _ if *value == 0.0 => 0.0,
            found if found.is_nan() => f64::INFINITY,
            found => found,
        };
    }
    shares
}

/// Returns starts and lengths of moves.
fn lengths<'a>(
    config: &Mechanism,
    moves: &'a [Move],
) -> impl Iterator<Item = ([f64; 6], f64)> + 'a {
    moves.iter().scan(config.start, |at, step| {
        let from = std::mem::replace(at, step.end);
        let delta: [f64; 6] = std::array::from_fn(|k| step.end[k] - from[k]);
        let norm = |part: &[f64]| part.iter().map(|d| d * d).sum::<f64>().sqrt();
        let length = norm(&delta[..3]);
        Some((from, if length > 0.0 { length } else { norm(&delta[3..]) }))
    })
}
