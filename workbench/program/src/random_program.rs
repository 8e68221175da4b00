// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs of random moves that a machine can run: every straight line is checked
//! beforehand, with a feed that all joints can follow.

use kinematics::{
    Joints, Letter, Limits, Link, MAX_EXTRA, MAX_JOINTS, POSE_LETTERS, Pose, Vector3, World,
};
use machine::limits;
use machine::read::joints::Axis;
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fmt::Write;

/// Share of a joint's speed and acceleration limits that a move may use: blending
/// corners and cubic interpolation need the rest.
const SHARE: f64 = 0.6;

/// Margin to the limits as a share of their range.
const MARGIN: f64 = 0.02;

/// Joint motion due to rounding, as a share of the machine's size.
const ROUNDING: f64 = 1e-10;

/// Poses sampled along one move or tool change.
const PLACES: usize = 200;

/// Tested moves before a machine counts as unable to move.
const TRIES: usize = 2000;

/// Largest rotation of an axis in one move, degrees.
const TURN_DEG: f64 = 120.0;

/// Number of moves per tool change.
const MOVES_PER_TOOL: u32 = 8;

/// A pose from which no legal move was found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("no legal move found from {0:?} in {TRIES} tries; widen the limits, or move [TRAJ]HOME")]
pub struct NoMove([f64; 6]);

/// Returns a program of at least `seconds` of motion from the machine's home; the same seed
/// gives the same program.
///
/// # Errors
/// No legal move is found from some pose.
pub fn random_program(config: &Mechanism, seed: u64, seconds: f64) -> Result<String, NoMove> {
    let mut walk = Walk {
        config,
        limits: limits::beyond_axes(config),
        rng: Pcg64::seed_from_u64(seed),
        pose: config.world(&config.start, &[0.0; MAX_EXTRA]),
        tool: Vector3::zeros(),
        time: 0.0,
        text: format!("(random moves, seed {seed})\nG21 G17 G40 G49 G80 G90 G94 G64\nM52 P1\n"),
    };
    if config.units_per_mm != 1.0 {
        walk.text = walk.text.replace("G21", "G20");
    }
    while walk.time < seconds {
        if walk.rng.random_range(0..MOVES_PER_TOOL) == 0 {
            walk.change_tool();
        } else {
            walk.go()?;
        }
    }
    walk.text += "M2\n";
    Ok(walk.text)
}

struct Walk<'a> {
    config: &'a Mechanism,
    /// Limits without those of the axes, which apply to the ends of moves.
    limits: Limits,
    rng: Pcg64,
    /// LinuxCNC's commanded pose, tool offset included.
    pose: World,
    /// Tool offset, without the spindle offset.
    tool: Vector3<f64>,
    /// Least duration of the program so far.
    time: f64,
    text: String,
}

impl Walk<'_> {
    /// Selects another tool offset if no leg leaves its range on the path, otherwise none.
    fn change_tool(&mut self) {
        let reach = 0.2 * self.config.machine.radius();
        let next = if self.rng.random_range(0..3) == 0 {
            Vector3::zeros()
        } else {
            let mut part = |low: f64, high: f64| round(self.rng.random_range(low..high) * reach);
            Vector3::new(part(-0.3, 0.3), part(-0.3, 0.3), part(0.0, 1.0))
        };
        let from = self.tool;
        let way = |share: f64| (self.pose, from + (next - from) * share);
        if self.followed(way).is_none()
            || (self.config.refuses_tool_motion() && self.moves_joints(way))
        {
            return;
        }
        self.tool = next;
        let line = if next == Vector3::zeros() {
            writeln!(self.text, "G49")
        } else {
            writeln!(self.text, "G43.1 X{} Y{} Z{}", next.x, next.y, next.z)
        };
        line.expect("a string takes any text");
    }

    fn go(&mut self) -> Result<(), NoMove> {
        for _ in 0..TRIES {
            let next = self.draw();
            let (from, tool) = (self.pose, self.tool);
            let way =
                |share: f64| (std::array::from_fn(|i| from[i] + share * (next[i] - from[i])), tool);
            if let Some(seconds) = self.followed(way) {
                // Also slow moves.
                let slower: f64 = self.rng.random_range(1.0..2.0);
                self.write_move(&next, seconds * slower);
                return Ok(());
            }
        }
        Err(NoMove(std::array::from_fn(|k| self.pose[k])))
    }

    /// Returns a random end point in the axis limits: near or far, in position, in angles or in both.
    fn draw(&mut self) -> World {
        let share: f64 = self.rng.random_range(0.05..1.0);
        let what = self.rng.random_range(0..4);
        let mut next = self.pose;
        for letter in Letter::ALL {
            let i = letter.index();
            let axis = &self.config.programmed[i];
            let free = !self.config.machine.layout().is_held(letter) && axis.max > axis.min;
            if free && what != usize::from(letter.is_angle()) && axis.max - axis.min < 1e6 {
                let to = self.rng.random_range(axis.min..axis.max);
                next[i] = round(self.pose[i] + share * (to - self.pose[i]));
            }
        }
        for link in self.config.chain.links() {
            if self.rng.random_range(0..2) == 0 {
                let [low, high] = self.near(link);
                next[link.place] = round(self.rng.random_range(low..high));
            }
        }
        next
    }

    /// Returns the range of an axis that carries something, for one move.
    fn near(&self, link: &Link) -> [f64; 2] {
        let reach = if link.is_rotary() { TURN_DEG } else { 0.2 * self.config.machine.size() };
        let here = self.pose[link.place];
        let letter = POSE_LETTERS[link.place];
        let axis = self.config.extra.iter().find(|axis| axis.letter == letter);
        axis.map_or([here, here + reach], |axis| {
            let least = axis.joint.min.max(axis.axis.min);
            let most = axis.joint.max.min(axis.axis.max);
            [(here - reach).max(least), (here + reach).min(most)]
        })
    }

    /// Returns the least duration of a path in seconds, `None` if a limit is violated, or forward does not
    /// follow.
    fn followed(&self, way: impl Fn(f64) -> (World, Vector3<f64>)) -> Option<f64> {
        let mut joints = Vec::with_capacity(PLACES + 1);
        let mut seed = self.of_machine(&way(0.0))?.0;
        for k in 0..=PLACES {
            let (pose, tool) = self.of_machine(&way(k as f64 / PLACES as f64))?;
            let here = self.config.machine.at(&pose, &tool).ok()?;
            let (machine, solver) = (&self.config.machine, &self.config.solver);
            seed = machine.forward(here.joints(), &seed, &tool, solver).ok()?.pose;
            let mut is_inside = true;
            limits::each(&here, &self.limits, |margin| {
                is_inside &= margin.room() >= MARGIN * margin.scale();
            });
            if !is_inside {
                return None;
            }
            joints.push(*here.joints());
        }
        let (from, to) = (way(0.0).0, way(1.0).0);
        Some(self.joint_seconds(&joints).max(self.axis_seconds(&from, &to)))
    }

    /// Returns whether the joints differ between both ends of a path, or are not known, by more than rounding.
    fn moves_joints(&self, way: impl Fn(f64) -> (World, Vector3<f64>)) -> bool {
        let joints = |share| {
            let (pose, tool) = self.of_machine(&way(share))?;
            self.config.machine.inverse(&pose, &tool).ok()
        };
        let (Some(from), Some(to)) = (joints(0.0), joints(1.0)) else { return true };
        let rounding = ROUNDING * self.config.machine.size();
        from.iter().zip(&to).any(|(a, b)| (a - b).abs() > rounding)
    }

    /// Returns the machine's own pose and tool vector.
    fn of_machine(&self, (world, offset): &(World, Vector3<f64>)) -> Option<(Pose, Vector3<f64>)> {
        let (chain, tool) = (&self.config.chain, self.config.spindle + offset);
        let pose = match chain.is_empty() {
            true => std::array::from_fn(|k| world[k]),
            false => self.config.machine.pose_of_world(chain, world, &tool).ok()?,
        };
        Some((Pose::from_degrees(pose), chain.machine_tool(&tool)))
    }

    /// Returns the duration in seconds in which the joints can run through these values, equally spaced in time.
    fn joint_seconds(&self, joints: &[Joints]) -> f64 {
        let count = (joints.len() - 1) as f64;
        let mut seconds = 0.0_f64;
        for (i, limits) in self.config.joints.iter().enumerate().take(MAX_JOINTS) {
            for three in joints.windows(3) {
                let rate = (three[1][i] - three[0][i]).abs() * count;
                let change = (three[2][i] - 2.0 * three[1][i] + three[0][i]).abs() * count * count;
                seconds = seconds
                    .max(rate / (SHARE * limits.speed()))
                    .max((change / (SHARE * limits.max_acceleration)).sqrt());
            }
        }
        seconds
    }

    fn axis_seconds(&self, from: &World, to: &World) -> f64 {
        let own = self.config.programmed.iter().enumerate();
        let own = own.filter(|(k, _)| !self.config.chain.is_extra(*k));
        let places = self.config.extra_axes.places();
        let extra = places.zip(self.config.extra.iter().map(|extra| &extra.axis));
        let seconds = |(k, axis): (usize, &Axis)| (to[k] - from[k]).abs() / axis.max_velocity;
        own.chain(extra).map(seconds).fold(0.0, f64::max)
    }

    fn write_move(&mut self, next: &World, seconds: f64) {
        let part = |range: std::ops::Range<usize>| {
            range.map(|i| (next[i] - self.pose[i]).powi(2)).sum::<f64>().sqrt()
        };
        // LinuxCNC's rule: the feed is that of X Y Z together if one of them moves, then that of U V W.
        let parts = [part(0..3), part(6..9), part(3..6)];
        let length = parts.into_iter().find(|length| *length > 0.0).unwrap_or(0.0);
        if length == 0.0 {
            return;
        }
        let mut line = format!("G1 F{:.4}", 60.0 * length / seconds);
        for (i, letter) in POSE_LETTERS.into_iter().enumerate() {
            if next[i] != self.pose[i] {
                let offset = if i < 3 { self.tool[i] } else { 0.0 };
                write!(line, " {letter}{}", round(next[i] - offset))
                    .expect("a string takes any text");
            }
        }
        self.text += &line;
        self.text += "\n";
        self.pose = *next;
        self.time += seconds;
    }
}

/// Rounds to the digits of a program line.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
