// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether a program fits a machine: every move followed over its whole length.
//!
//! One move after the other is followed (`follow`), and every change of a tool.
//! Joint speeds and accelerations are those of LinuxCNC's planner and of its interpolation of joints,
//! cycle by cycle ([`crate::program::loads`]). How much faster a line may be programmed is told for the feed
//! as the axes allow it ([`duration`]), taken as reached on every move.

use crate::limits;
use crate::program::findings::{Break, LeastMargin, Preflight};
use crate::program::follow::{Found, Leg, Pilot, length};
use crate::program::interpreter::Move;
use crate::program::loads::{Load, Peak, loads};
use crate::program::replay::duration;
use crate::proof::reach::Reach;
use crate::read::machine::MachineConfig;
use kinematics::{Fault, Letter, Limit, Part, Pose, Vector3};

/// Rounding of the interpreter's positions, as a share of the machine's size.
const ROUNDING: f64 = 1e-9;

/// Follows the moves of a program from `[TRAJ]HOME` on.
///
/// `progress` is told the share that is done; `keep` makes it keep [`Preflight::samples`].
///
/// # Errors
/// A tool vector that the machine cannot take.
pub fn preflight(
    config: &MachineConfig,
    moves: &[Move],
    keep: bool,
    mut progress: impl FnMut(f64),
) -> Result<Preflight, Fault> {
    let mut pilot = Pilot::new(config, keep)?;
    for (n, step) in moves.iter().enumerate() {
        if n % 256 == 0 {
            progress(n as f64 / moves.len() as f64);
        }
        pilot.change_tool(n, step)?;
        pilot.go(n, step);
    }
    pilot.drive(moves);
    Ok(pilot.finish(moves))
}

impl Pilot<'_> {
    /// The tool offset moves the platform along a straight line, where it is tilted.
    fn change_tool(&mut self, number: usize, step: &Move) -> Result<(), Fault> {
        let tool = self.config.spindle + Vector3::from(step.tool);
        if tool == self.tool {
            return Ok(());
        }
        let change = tool - self.tool;
        let shift = Pose::from_degrees(self.at).rotation() * change - change;
        if shift.norm() > ROUNDING * self.config.machine.size() {
            self.result.tilted_tool_changes.push((step.path.file, step.line));
            // As a motion of the old tool. Where a table takes part of it, only its end is judged,
            // with the next move.
            let active = |letter| self.config.machine.layout().coordinates().contains(letter);
            if [Letter::X, Letter::Y, Letter::Z].into_iter().all(active) {
                let delta = [shift.x, shift.y, shift.z, 0.0, 0.0, 0.0];
                let (from, line, file) = (self.at, step.line, step.path.file);
                let leg = Leg { number, line, file, from, delta, duration: 0.0 };
                self.follow(&leg);
            }
        }
        self.reach = Reach::with_tool(self.config, tool)?;
        self.tool = tool;
        Ok(())
    }

    fn go(&mut self, number: usize, step: &Move) {
        let from = self.at;
        let delta: [f64; 6] = std::array::from_fn(|k| step.end[k] - from[k]);
        let leg = Leg {
            number,
            line: step.line,
            file: step.path.file,
            from,
            delta,
            duration: duration(self.config, &from, step),
        };
        self.check_axes(&leg, &step.end);
        self.follow(&leg);
        self.result.moves += 1;
        self.result.time += leg.duration;
        self.result.length += length(&delta);
        self.at = step.end;
    }

    /// Speeds and accelerations of the joints.
    fn drive(&mut self, moves: &[Move]) {
        let found = loads(self.config, moves);
        self.result.time = found.time;
        self.judge_load(Limit::JointSpeed, &found.speed, moves);
        self.judge_load(Limit::JointAcceleration, &found.acceleration, moves);
        self.result.speeds = found.speed.peaks;
        self.result.accelerations = found.acceleration.peaks;
    }

    fn judge_load(&mut self, limit: Limit, load: &Load, moves: &[Move]) {
        for (joint, Peak { value, limit: most, line, .. }) in load.peaks.iter().enumerate() {
            self.note(limit, most - value, Part::Joint(joint), *line);
        }
        let Some(beyond) = load.beyond else { return };
        let Peak { value, limit: most, .. } = load.peaks[beyond.joint];
        let joint = Part::Joint(beyond.joint);
        let unit = limits::unit(self.config, limit, joint);
        let part = limits::part(self.config, limit, joint);
        self.result.breaks.push(Break {
            limit,
            line: moves[beyond.at.number].line,
            file: moves[beyond.at.number].path.file,
            pose: beyond.at.pose,
            step: beyond.at.number,
            share: beyond.at.share,
            text: format!(
                "{part} goes beyond {most} {unit}, in this program up to {value:.4} {unit}"
            ),
        });
    }

    /// Axis limits hold on a straight line that ends within them.
    fn check_axes(&mut self, leg: &Leg, end: &[f64; 6]) {
        let slack = ROUNDING * self.config.machine.size();
        for (k, axis) in self.config.axes.iter().enumerate() {
            let (low, high) = (end[k] - axis.min, axis.max - end[k]);
            let margin = low.min(high);
            if !margin.is_finite() {
                continue;
            }
            let part = Part::Axis(Letter::ALL[k]);
            self.note(Limit::Axis, margin, part, leg.line);
            let before = (leg.from[k] - axis.min).min(axis.max - leg.from[k]);
            if margin < -slack {
                let share = if before > 0.0 { before / (before - margin) } else { 0.0 };
                let found = Found { share, part, ends: [axis.min, axis.max], fault: None };
                self.tell(leg, Limit::Axis, &found, margin);
            }
        }
    }

    fn finish(mut self, moves: &[Move]) -> Preflight {
        self.result.breaks.sort_by(|a, b| a.step.cmp(&b.step).then(a.share.total_cmp(&b.share)));
        for limit in Limit::ALL {
            let Some((value, of, line)) = self.margins[limit.index()] else { continue };
            let unit = limits::unit(self.config, limit, of);
            let part = limits::part(self.config, limit, of);
            self.result.margins.push(LeastMargin { limit, value, unit, part, of, line });
        }
        if let Some(first) = self.result.breaks.first() {
            let mut at = self.config.home;
            let mut kept = 0.0;
            for (n, step) in moves.iter().enumerate().take(first.step + 1) {
                let long = length(&std::array::from_fn(|k| step.end[k] - at[k]));
                kept += if n < first.step { long } else { first.share * long };
                at = step.end;
            }
            // A program that only turns has no length.
            self.result.runnable =
                if self.result.length > 0.0 { kept / self.result.length } else { 0.0 };
        }
        self.result
    }
}
