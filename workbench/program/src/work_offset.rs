// SPDX-License-Identifier: GPL-2.0-or-later
//! A work offset that makes a program fit: shifted, and if the program keeps the platform
//! level also rotated about Z, as a workpiece is clamped in another position.
//!
//! A compass search over X Y Z and the rotation minimizes the missing margin of some poses of the program
//! to joint ranges, cones, rod distance, conditioning, axis limits; [`crate::preflight`] decides whether
//! the program fits, on the moves that LinuxCNC then commands.

use crate::motion::Move;
use kinematics::{Fault, Letter, Limits, Vector3};
use machine::limits;
use machine::proof::reach::Reach;
use machine::read::joints::Axis;
use machine::read::mechanism::Mechanism;
use serde::Serialize;

/// Number of sampled poses of the program.
const POSES: usize = 500;

/// Required margin, as a share of the limit's range, to cover what is between the poses.
const MARGIN: f64 = 0.02;

/// Missing margin of a pose without joint values, in ranges.
const UNREACHED: f64 = 3.0;

/// First and last step of the search, as shares of the machine's size, and the rotation that corresponds
/// to a step of the whole size.
const STEPS: [f64; 2] = [0.2, 2e-4];
const TURN_DEG: f64 = 90.0;

/// Initial rotations of a search: the nearest that fits is as good as any.
const STARTS_DEG: [f64; 8] = [0.0, 45.0, -45.0, 90.0, -90.0, 135.0, -135.0, 180.0];

/// Halvings of the resulting offset, which may be larger than necessary.
const HALVINGS: usize = 12;

/// Largest number of steps.
const MOST: usize = 400;

/// Digits after the decimal point of a rotation, in degrees.
const TURN_DIGITS: i32 = 2;

/// Margin of a rotation to the limits of X and Y, as a share of the machine's size: more than
/// rounding its angle and its shift moves the ends of the program.
const ROUNDED: f64 = 5e-4;

/// A change of the active work offset: its origin O and rotation r become
/// R(turn) O + shift and r + turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Offset {
    /// Shift x y z, machine units.
    pub shift: [f64; 3],
    /// Rotation about Z, degrees.
    pub turn: f64,
}

impl Offset {
    /// Returns the block that changes the active offset.
    pub fn block(&self) -> String {
        // #5220 is the number of the active coordinate system, 20 parameters each from #5221 on.
        let now = |n: usize| format!("#[{} + 20*#5220]", 5201 + n);
        let plus = |value: String, more: f64| match more {
            0.0 => format!("[{value}]"),
            _ => format!("[{value} + {more}]"),
        };
        let [dx, dy, dz] = self.shift;
        let turn = self.turn;
        if turn == 0.0 {
            let [x, y, z] = [plus(now(0), dx), plus(now(1), dy), plus(now(2), dz)];
            return format!("G10 L2 P0 X{x} Y{y} Z{z}");
        }
        let x = plus(format!("{}*COS[{turn}] - {}*SIN[{turn}]", now(0), now(1)), dx);
        let y = plus(format!("{}*SIN[{turn}] + {}*COS[{turn}]", now(0), now(1)), dy);
        format!("G10 L2 P0 X{x} Y{y} Z{} R{}", plus(now(2), dz), plus(now(9), turn))
    }
}

/// Poses of a program, evenly over its moves, and at most as many as the search can evaluate.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// Each with the number of its tool.
    poses: Vec<([f64; 6], usize)>,
    tools: Vec<[f64; 3]>,
    /// Every how many-th pose is kept, and the number of poses so far.
    stride: usize,
    seen: usize,
    is_level: bool,
}

impl Default for Poses {
    fn default() -> Self {
        Self { poses: vec![], tools: vec![], stride: 1, seen: 0, is_level: true }
    }
}

impl Poses {
    /// Adds the poses of a move.
    pub(super) fn see(&mut self, from: &[f64; 6], step: &Move) {
        // Moves before the program do not use its offset.
        if step.line == 0 {
            return;
        }
        self.is_level &= step.end[3..5] == [0.0, 0.0];
        let middle = std::array::from_fn(|k| (from[k] + step.end[k]) / 2.0);
        for pose in [middle, step.end] {
            if self.seen.is_multiple_of(self.stride) {
                let tool = self.tool(&step.tool);
                self.poses.push((pose, tool));
            }
            self.seen += 1;
        }
        if self.poses.len() >= 2 * POSES {
            let mut is_even = false;
            self.poses.retain(|_| {
                is_even = !is_even;
                is_even
            });
            self.stride *= 2;
        }
    }

    fn tool(&mut self, tool: &[f64; 3]) -> usize {
        self.tools.iter().position(|known| known == tool).unwrap_or_else(|| {
            self.tools.push(*tool);
            self.tools.len() - 1
        })
    }

    /// Returns whether the program may be rotated: X and Y move and the platform stays level, so that every
    /// rotation about Z cuts the same.
    pub fn may_turn(&self, config: &Mechanism) -> bool {
        let moved = |letter| !config.machine.layout().is_held(letter);
        moved(Letter::X) && moved(Letter::Y) && self.is_level
    }
}

/// Searches for an offset with which the sampled poses fit. The last argument receives the completed share, and
/// returns whether to continue the search.
pub type Search =
    fn(&Mechanism, &Poses, &mut dyn FnMut(f64) -> bool) -> Result<Option<Offset>, Fault>;

/// Searches for a shift, see [`Search`].
///
/// # Errors
/// A tool vector that the machine cannot take.
pub fn shift(
    config: &Mechanism,
    poses: &Poses,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<Offset>, Fault> {
    Ok(Compass::new(config, poses, 0.0)?.from(0.0, 3, progress))
}

/// Searches for a shift and turn, see [`Search`].
///
/// # Errors
/// A tool vector that the machine cannot take.
pub fn turn(
    config: &Mechanism,
    poses: &Poses,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<Offset>, Fault> {
    let search = Compass::new(config, poses, ROUNDED * config.machine.size())?;
    let mut starts = STARTS_DEG.into_iter().enumerate();
    let all = STARTS_DEG.len() as f64;
    Ok(starts.find_map(|(n, start)| {
        search.from(start, 4, &mut |share| progress((n as f64 + share) / all))
    }))
}

/// Shift x y z and rotation, about the center of the program.
type Shift = [f64; 4];

struct Compass<'a> {
    config: &'a Mechanism,
    /// Limits without those of the axes, which have a margin for a rotation.
    limits: Limits,
    /// By tool number.
    reaches: Vec<Reach<'a>>,
    poses: &'a Poses,
    /// Center of rotation.
    middle: [f64; 2],
    /// Margin to the limits of X and Y.
    room: f64,
}

impl<'a> Compass<'a> {
    fn new(config: &'a Mechanism, poses: &'a Poses, room: f64) -> Result<Self, Fault> {
        let reach =
            |tool: &[f64; 3]| Reach::with_tool(config, config.spindle + Vector3::from(*tool));
        let reaches = poses.tools.iter().map(reach).collect::<Result<_, _>>()?;
        let limits = limits::beyond_axes(config);
        let mut search = Self { config, limits, reaches, poses, middle: [0.0; 2], room };
        search.middle = std::array::from_fn(|k| {
            let along = poses.poses.iter().map(|(pose, tool)| pose[k] - poses.tools[*tool][k]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            if low <= high { (low + high) / 2.0 } else { 0.0 }
        });
        Ok(search)
    }

    /// Searches from a rotation on, over X Y Z and with four `steps` over the rotation as well.
    fn from(
        &self,
        turn: f64,
        steps: usize,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Option<Offset> {
        let size = self.config.machine.size();
        let mut at = [0.0, 0.0, 0.0, turn];
        let mut lack = self.lack(&at);
        let mut step = STEPS[0];
        for n in 0..MOST {
            let halved = (STEPS[0] / step).ln() / (STEPS[0] / STEPS[1]).ln();
            let goes_on = progress(halved.max(n as f64 / MOST as f64));
            if !goes_on || lack == 0.0 || step < STEPS[1] {
                break;
            }
            let near = (0..2 * steps).map(|n| {
                let mut near: Shift = at;
                let long = if n / 2 < 3 { step * size } else { step * TURN_DEG };
                near[n / 2] += if n % 2 == 0 { long } else { -long };
                (self.lack(&near), near)
            });
            match near.min_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((less, near)) if less < lack => (lack, at) = (less, near),
                _ => step /= 2.0,
            }
        }
        if lack > 0.0 {
            return None;
        }
        // No larger than necessary.
        let (mut less, mut enough) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let share = (less + enough) / 2.0;
            let part = at.map(|x| share * x);
            *(if self.lack(&part) == 0.0 { &mut enough } else { &mut less }) = share;
        }
        Some(self.rounded(&at.map(|x| enough * x)))
    }

    /// Rounds to digits that are easy to type, and that change nothing within the margin.
    fn rounded(&self, at: &Shift) -> Offset {
        let away_from_0 =
            |x: f64, per_unit: f64| (x * per_unit).abs().ceil().copysign(x) / per_unit;
        let turn = away_from_0(at[3], 10.0_f64.powi(TURN_DIGITS));
        let turn = if turn.abs() > 180.0 { turn - 360.0_f64.copysign(turn) } else { turn };
        let place = [at[0], at[1], at[2], turn];
        // R(turn) 0 + shift is the image of the offset 0.
        let [x, y] = self.turned([0.0, 0.0], &place);
        let per_unit = 10.0_f64.powi(-(self.config.machine.size() * 1e-4).log10().floor() as i32);
        Offset { shift: [x, y, at[2]].map(|x| away_from_0(x, per_unit)), turn }
    }

    /// Rotates a position in X and Y about the center and shifts it.
    fn turned(&self, [x, y]: [f64; 2], at: &Shift) -> [f64; 2] {
        if at[3] == 0.0 {
            return [x + at[0], y + at[1]];
        }
        let (sine, cosine) = at[3].to_radians().sin_cos();
        let (x, y) = (x - self.middle[0], y - self.middle[1]);
        [
            self.middle[0] + cosine * x - sine * y + at[0],
            self.middle[1] + sine * x + cosine * y + at[1],
        ]
    }

    fn moved(&self, pose: &[f64; 6], tool: usize, at: &Shift) -> [f64; 6] {
        let [tool_x, tool_y, _] = self.poses.tools[tool];
        let [x, y] = self.turned([pose[0] - tool_x, pose[1] - tool_y], at);
        [x + tool_x, y + tool_y, pose[2] + at[2], pose[3], pose[4], pose[5]]
    }

    /// Returns the sum of the missing margins of the poses.
    fn lack(&self, at: &Shift) -> f64 {
        let lack_of =
            |(pose, tool): &([f64; 6], usize)| self.lack_of(&self.moved(pose, *tool, at), *tool);
        self.poses.poses.iter().map(lack_of).sum()
    }

    fn lack_of(&self, pose: &[f64; 6], tool: usize) -> f64 {
        let reach = &self.reaches[tool];
        let lacking = |margin: f64, range: f64| (MARGIN - margin / range).max(0.0);
        let beyond = |(k, (x, axis)): (usize, (&f64, &Axis))| {
            // Otherwise an axis may be at its limit.
            let room = if k < 2 { self.room } else { 0.0 };
            (axis.min + room - x).max(x + room - axis.max).max(0.0) / self.config.machine.size()
        };
        let axes: f64 = pose.iter().zip(&self.config.programmed).enumerate().map(beyond).sum();
        let Ok(at) = reach.at(pose) else { return axes + UNREACHED };
        let mut lack = axes;
        limits::each(&at, &self.limits, |margin| {
            lack += lacking(margin.room(), margin.scale());
        });
        lack
    }
}
