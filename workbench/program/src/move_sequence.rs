// SPDX-License-Identifier: GPL-2.0-or-later
//! Checks the moves of one mechanism in order, with its tool changes.

use crate::follow_move::{Course, Found, Leg, Pilot, length};
use crate::motion::{Move, MoveKind, ROUNDING};
use crate::report::{LeastMargin, Preflight};
use kinematics::{Fault, Letter, Limit, Matrix3, Part, Pose, Vector3};
use machine::limits;
use machine::proof::reach::Reach;
use machine::read::direction::ToolDirection;
use machine::read::mechanism::Mechanism;

/// Checks the moves of a program in order, starting at `[TRAJ]HOME`.
pub struct Flight<'a> {
    pilot: Pilot<'a>,
    number: usize,
    fault: Option<Fault>,
}

impl<'a> Flight<'a> {
    /// Starts before the first move.
    ///
    /// # Errors
    /// A spindle offset without a legal pose at home.
    pub fn new(config: &'a Mechanism) -> Result<Self, Fault> {
        let pilot = Pilot::new(config).map_err(|fault| config.place.counted(fault))?;
        Ok(Self { pilot, number: 0, fault: None })
    }

    /// Starts at the end of a move.
    ///
    /// # Errors
    /// A tool without a legal pose at home.
    pub fn standing(config: &'a Mechanism, end: &Move) -> Result<Self, Fault> {
        let mut flight = Self::new(config)?;
        let pilot = &mut flight.pilot;
        pilot.tool = config.spindle + Vector3::from(end.tool);
        pilot.reach =
            Reach::with_tool(config, pilot.tool).map_err(|fault| config.place.counted(fault))?;
        (pilot.at, pilot.extra) = (end.end, end.extra_end);
        Ok(flight)
    }

    /// Checks the next move.
    pub fn see(&mut self, step: &Move) {
        if self.fault.is_some() {
            return;
        }
        match self.pilot.change_tool(self.number, step) {
            Ok(()) => self.pilot.go(self.number, step),
            Err(fault) => self.fault = Some(fault),
        }
        self.number += 1;
    }

    /// Returns the result after the last move, without what depends on time.
    ///
    /// # Errors
    /// A tool vector without a legal pose at home.
    pub fn finish(self) -> Result<Preflight, Fault> {
        let place = self.pilot.config.place;
        self.fault.map_or_else(|| Ok(self.pilot.finish()), |fault| Err(place.counted(fault)))
    }
}

impl Pilot<'_> {
    /// Checks the straight platform motion due to a tool offset if it is tilted.
    fn change_tool(&mut self, number: usize, step: &Move) -> Result<(), Fault> {
        let tool = self.config.spindle + Vector3::from(step.tool);
        if tool == self.tool {
            return Ok(());
        }
        let change = tool - self.tool;
        let pose = self.config.carried(&self.at, &self.extra, &self.tool)?;
        let shift = self.shift(&pose) * change;
        if shift.norm() > ROUNDING * self.config.machine.size() {
            self.result.tilted_tool_changes.push((step.file, step.line));
            // Checked as a motion of the old tool. If a table makes part of it, only its end is checked, with the next
            // move.
            let active = |letter| self.config.machine.layout().coordinates().contains(letter);
            if [Letter::X, Letter::Y, Letter::Z].into_iter().all(active) {
                let delta = [shift.x, shift.y, shift.z, 0.0, 0.0, 0.0];
                let (from, line, file) = (self.at, step.line, step.file);
                let reported = if self.config.chain.is_empty() { delta } else { [0.0; 6] };
                let course = Course::Straight { from: pose, delta };
                self.follow(&Leg { number, line, file, from, delta: reported, course });
            }
        }
        self.reach = Reach::with_tool(self.config, tool)?;
        self.tool = tool;
        Ok(())
    }

    /// Returns the map from the tool vector to the platform's displacement, at this pose of the machine.
    fn shift(&self, pose: &[f64; 6]) -> Matrix3<f64> {
        let chain = &self.config.chain;
        match chain.is_empty() {
            true => Pose::from_degrees(*pose).rotation() - Matrix3::identity(),
            false => chain.tool_shift(&self.config.world(&self.at, &self.extra), &self.tool),
        }
    }

    fn go(&mut self, number: usize, step: &Move) {
        let from = self.at;
        let delta: [f64; 6] = std::array::from_fn(|k| step.end[k] - from[k]);
        let course = self.course(step, &from, &delta);
        let mut leg = Leg { number, line: step.line, file: step.file, from, delta, course };
        if let Course::Carried { from, delta } = &leg.course {
            // Reported positions have the angles of the axes.
            leg.from.copy_from_slice(&from[..6]);
            leg.delta.copy_from_slice(&delta[..6]);
        }
        if self.falls_to_zero(step) {
            self.result.rapids_to_zero.push((step.file, step.line));
        }
        self.check_axes(&leg, &step.end);
        self.follow(&leg);
        self.widen_axes(&step.end);
        self.result.poses.see(&from, step);
        self.result.is_still &= step.stays(self.config);
        self.result.moves += 1;
        self.result.length += length(&delta);
        self.result.advance += self.advance(&leg);
        (self.at, self.extra) = (step.end, step.extra_end);
    }

    /// Returns whether a rapid goes down to the machine's Z0 (`G53 G0 Z0`, or `G28` without a stored position) although
    /// home is above it. Postprocessors use Z0 for the top of the travel, where it is on other machines.
    fn falls_to_zero(&self, step: &Move) -> bool {
        let slack = ROUNDING * self.config.machine.size();
        let z = Letter::Z.index();
        step.kind == MoveKind::Rapid
            && self.config.tool_direction == Some(ToolDirection::Down)
            && self.config.home[z] > slack
            && step.end[z].abs() <= slack
            && self.at[z] > slack
    }

    /// Returns the machine's motion in a move.
    fn course(&self, step: &Move, from: &[f64; 6], delta: &[f64; 6]) -> Course {
        if self.config.chain.is_empty() {
            return Course::Straight { from: *from, delta: *delta };
        }
        let begin = self.config.world(from, &self.extra);
        let end = self.config.world(&step.end, &step.extra_end);
        Course::Carried { from: begin, delta: std::array::from_fn(|k| end[k] - begin[k]) }
    }

    /// Checks axis limits, which hold on a straight line that ends within them.
    fn check_axes(&mut self, leg: &Leg, end: &[f64; 6]) {
        let slack = ROUNDING * self.config.machine.size();
        for (k, axis) in self.config.programmed.iter().enumerate() {
            let part = Part::Axis(Letter::ALL[k]);
            // Each limit separately: the violated one may not be the nearer one at the start.
            let ends = [
                [leg.from[k] - axis.min, end[k] - axis.min],
                [axis.max - leg.from[k], axis.max - end[k]],
            ];
            for [before, margin] in ends.into_iter().filter(|[_, margin]| margin.is_finite()) {
                self.note(Limit::Axis, margin, part, leg);
                if margin < -slack {
                    let share = if before > 0.0 { before / (before - margin) } else { 0.0 };
                    let (limit, ends) = (Limit::Axis, [axis.min, axis.max]);
                    self.report(leg, &Found { limit, share, part, ends, fault: None }, margin);
                }
            }
        }
    }

    fn finish(mut self) -> Preflight {
        self.result.breaks.sort_by(|a, b| a.step.cmp(&b.step).then(a.share.total_cmp(&b.share)));
        for limit in Limit::ALL {
            let Some((value, of, (line, file))) = self.margins[limit.index()] else { continue };
            let unit = limits::unit(self.config, limit, of);
            let part = limits::part(self.config, limit, of);
            self.result.margins.push(LeastMargin {
                limit: limit.into(),
                value,
                unit,
                part,
                of,
                line,
                file,
            });
        }
        self.result.ranges = self.ranges();
        if let Some(first) = self.result.breaks.first() {
            let whole = self.result.advance;
            self.result.runnable = if whole > 0.0 { first.before / whole } else { 0.0 };
        }
        self.result
    }
}
