// SPDX-License-Identifier: GPL-2.0-or-later
//! Checks the moves of one mechanism in order, with its tool changes.

use crate::follow_move::{Course, Found, Leg, Pilot, length, padded};
use crate::motion::{Move, MoveKind, ROUNDING, Spindle};
use crate::report::{LeastMargin, Preflight};
use kinematics::{Fault, Letter, Limit, Matrix3, Part, Pose, Vector3, World};
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
        let layout = self.config.machine.layout();
        // Constraints turn the platform on the way.
        let is_constrained = layout.constraints() > 0;
        let shift = match is_constrained {
            true => self.constrained_shift(&tool)?,
            false => self.shift(&pose) * change,
        };
        if shift.norm() > ROUNDING * self.config.machine.size() {
            self.result.tilted_tool_changes.push((step.file, step.line));
            // Checked as a motion of the old tool. If a table makes part of it, or the platform turns, only its end is
            // checked, with the next move, and LinuxCNC's servo cycles.
            let active = |letter| layout.coordinates().contains(letter);
            if !is_constrained && [Letter::X, Letter::Y, Letter::Z].into_iter().all(active) {
                let delta = [shift.x, shift.y, shift.z, 0.0, 0.0, 0.0];
                let from = self.config.world(&self.at, &self.extra);
                let (line, file) = (step.line, step.file);
                let reported = if self.config.chain.is_empty() { padded(&delta) } else { [0.0; 9] };
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

    /// Returns the displacement of a platform with constraints for another tool vector at the present position.
    fn constrained_shift(&self, tool: &Vector3<f64>) -> Result<Vector3<f64>, Fault> {
        let config = self.config;
        let [before, after] = [&self.tool, tool].map(|tool| -> Result<_, Fault> {
            let pose = Pose::from_degrees(config.carried(&self.at, &self.extra, tool)?);
            let own = config.chain.machine_tool(tool);
            let full = config.machine.full_pose(&pose, &own)?;
            Ok(full.position - own + full.rotation() * own)
        });
        Ok(after? - before?)
    }

    fn go(&mut self, number: usize, step: &Move) {
        let begin = self.at;
        let from = self.config.world(&begin, &self.extra);
        let end = self.config.world(&step.end, &step.extra_end);
        let delta: World = std::array::from_fn(|k| end[k] - from[k]);
        let own: [f64; 6] = std::array::from_fn(|k| step.end[k] - begin[k]);
        let course = match self.config.chain.is_empty() {
            true => Course::Straight { from: begin, delta: own },
            false => Course::Carried { from, delta },
        };
        let leg = Leg { number, line: step.line, file: step.file, from, delta, course };
        if self.falls_to_zero(step) {
            self.result.rapids_to_zero.push((step.file, step.line));
        }
        if self.feeds_without_spindle(step) {
            self.result.feeds_without_spindle.push((step.file, step.line));
        }
        self.check_axes(&leg, step);
        self.follow(&leg);
        self.widen_axes(step);
        self.result.poses.see(&begin, step);
        self.result.is_still &= step.stays(self.config);
        self.result.moves += 1;
        self.result.last = (step.file, step.line);
        self.result.length += length(&own[..3]);
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

    /// Returns whether this is the first feed move with a new tool while the spindle stands: M6 has stopped it. Programs
    /// that never turn the spindle, and moves without a tool, cut nothing.
    fn feeds_without_spindle(&mut self, step: &Move) -> bool {
        let (is_turning, is_standing) = match step.spindle {
            Spindle::Turning(_) | Spindle::Surface => (true, false),
            Spindle::Standing(_) => (false, true),
            Spindle::Unknown => (false, false),
        };
        let is_new = self.spun.is_some_and(|tool| tool != step.tool) && step.tool != [0.0; 3];
        let is_found =
            is_standing && is_new && step.kind == MoveKind::Feed && step.end[..3] != self.at[..3];
        if is_turning || is_found {
            self.spun = Some(step.tool);
        }
        is_found
    }

    /// Checks the limits of axes and extra axes, which hold on a straight line that ends within them.
    fn check_axes(&mut self, leg: &Leg, step: &Move) {
        let config = self.config;
        let slack = ROUNDING * config.machine.size();
        let own = config.programmed.iter().enumerate().map(|(k, axis)| {
            let part = Part::Axis(Letter::ALL[k]);
            (Limit::Axis, part, [self.at[k], step.end[k]], [axis.min, axis.max])
        });
        let extra = config.extra.iter().enumerate().map(|(n, axis)| {
            let part = Part::Joint(config.joints.len() + n);
            (Limit::JointRange, part, [self.extra[n], step.extra_end[n]], axis.range())
        });
        for (limit, part, [from, to], ends) in own.chain(extra).collect::<Vec<_>>() {
            // Each end separately: the violated one may not be the nearer one at the start.
            let margins = [[from - ends[0], to - ends[0]], [ends[1] - from, ends[1] - to]];
            for [before, margin] in margins.into_iter().filter(|[_, margin]| margin.is_finite()) {
                self.note(limit, margin, part, leg);
                if margin < -slack {
                    let share = if before > 0.0 { before / (before - margin) } else { 0.0 };
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
            self.result.runnable = self.result.share(first.before);
        }
        self.result
    }
}
