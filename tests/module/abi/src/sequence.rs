// SPDX-License-Identifier: GPL-2.0-or-later
//! Commanded motions along lines through singular poses, cycle by cycle, as LinuxCNC's controller
//! makes them with drives that follow exactly.

use crate::geometry::distance;
use crate::module::{Joints, Module, Pose};
use crate::parallel::Parallel;
use crate::random::Random;
use crate::tracker::same_handed;

/// Length of lines relative to the machine's size, and beyond a singular pose.
const FARTHEST: f64 = 1.5;
const BEYOND: f64 = 0.1;

/// Cycles of a line before its singular pose that are tested.
const BEFORE: usize = 500;

/// Code of the refusal of a commanded motion that has passed a singular pose, as in docs/reference/causes.md.
pub const PASSED: i32 = -41;

/// Number of directions that involve several coordinates.
const OBLIQUE: usize = 14;

/// A straight line of poses at a constant step.
pub struct Line {
    /// Pose in cycle 0.
    pub start: Pose,
    /// Change per cycle.
    pub step: Pose,
}

impl Line {
    #[must_use]
    pub fn at(&self, cycle: usize) -> Pose {
        std::array::from_fn(|k| self.start[k] + cycle as f64 * self.step[k])
    }

    /// Returns the first cycle beyond a singular pose; `None` if the legs end before.
    #[must_use]
    pub fn crossing(&self, module: &Module, machine: &Parallel, cycles: usize) -> Option<usize> {
        let beyond = |cycle: usize| self.is_beyond(module, machine, cycle);
        // First with large steps, then cycle by cycle.
        let mut before = 0;
        for cycle in (50..cycles).step_by(50) {
            if beyond(cycle)? {
                return (before..=cycle).find(|cycle| beyond(*cycle) == Some(true));
            }
            before = cycle;
        }
        None
    }

    /// Returns whether the pose of a cycle is on the other side of singular poses than the start: beyond one of
    /// them, not beyond two. `None` if the legs do not reach it.
    fn is_beyond(&self, module: &Module, machine: &Parallel, cycle: usize) -> Option<bool> {
        let at = self.at(cycle);
        // The determinant by pose coordinates has the factor cos B, whose zero is not a singular pose.
        let turned = at[4].to_radians().cos() * self.start[4].to_radians().cos() < 0.0;
        same_handed(module, machine, &at, &self.start).map(|same| same == turned)
    }
}

/// Results of forward on lines through singular poses.
#[derive(Clone, Copy, Default, Debug)]
pub struct Sequences {
    pub lines: usize,
    /// Lines with a refusal because the commanded motion had passed the singular pose.
    pub passed: usize,
    /// Lines on which forward still returned a pose after the commanded motion had passed it.
    pub answered: usize,
    /// Largest distance of the returned poses from the commanded ones, relative to the machine's size.
    pub farthest: f64,
}

impl Sequences {
    /// Follows lines from a pose, `step` machine units per cycle: along each coordinate in both directions, and
    /// others. Every second one has a monitor. `fresh` creates the tested module; `machine` determines whether a
    /// line passes a singular pose.
    pub fn follow_lines(
        &mut self,
        (machine, fresh): (&Parallel, &dyn Fn() -> Module),
        start: &Pose,
        step: f64,
        random: &mut Random,
    ) {
        for (n, along) in directions(random, machine.radius()).into_iter().enumerate() {
            let mut line = Line { start: *start, step: [0.0; 9] };
            for (to, along) in line.step.iter_mut().zip(along) {
                *to = step * along;
            }
            let cycles = (FARTHEST * machine.size() / step) as usize;
            let Some(crossing) = line.crossing(&machine.module(), machine, cycles) else {
                continue;
            };
            let end = crossing + (BEYOND * machine.size() / step) as usize;
            self.follow(machine, &fresh(), &line, (crossing, end), n % 2 == 0);
        }
    }

    fn follow(
        &mut self,
        machine: &Parallel,
        module: &Module,
        line: &Line,
        (crossing, end): (usize, usize),
        monitored: bool,
    ) {
        self.lines += 1;
        let (mut passed, mut answered) = (false, false);
        // Most of the path there is uniform.
        let first = crossing.saturating_sub(BEFORE);
        let mut command = line.at(first);
        let mut world = command;
        let mut joints: Joints = module.inverse(&command).expect("the start");
        // genhexkins refuses its first call, and forgets its seed.
        let _ = module.forward(&joints, &command);
        for cycle in first..end {
            let code = module.forward_into(&joints, &mut world);
            if code == 0 {
                let apart = distance(&world, &command, machine.radius()) / machine.size();
                self.farthest = self.farthest.max(apart);
                answered |= cycle > crossing
                    && line.is_beyond(&machine.module(), machine, cycle) != Some(false);
            } else {
                passed |= code == PASSED;
            }
            command = line.at(cycle + 1);
            if module.inverse_into(&command, &mut joints) != 0 {
                break;
            }
            if monitored && module.has("fault") {
                module.monitor();
            }
        }
        self.passed += usize::from(passed);
        self.answered += usize::from(answered);
    }
}

/// Returns directions of jogs, then random ones: a length for each coordinate.
fn directions(random: &mut Random, radius: f64) -> Vec<[f64; 6]> {
    let mut all: Vec<[f64; 6]> = (0..12)
        .map(|n| {
            let mut direction = [0.0; 6];
            direction[n / 2] = if n % 2 == 0 { 1.0 } else { -1.0 };
            direction
        })
        .collect();
    for _ in 0..OBLIQUE {
        let (go, turn) = (random.direction(), random.direction());
        all.push(std::array::from_fn(|k| if k < 3 { go[k] } else { turn[k - 3] }));
    }
    // An angle moves the anchors by as much as a length.
    let per_length = (1.0 / radius).to_degrees();
    all.iter()
        .map(|d| std::array::from_fn(|k| if k < 3 { d[k] } else { d[k] * per_length }))
        .collect()
}
