// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether a program fits a machine: every move followed over its whole length, and what LinuxCNC
//! makes of it in time.
//!
//! One move after the other is followed (`follow`), and every change of a tool, as they come from
//! the interpreter: what is kept does not grow with the program. Everything that depends on time
//! comes from LinuxCNC's own servo cycles ([`crate::program::loads`]).

use crate::control::process::{self, Options};
use crate::control::row::{Ending, Outcome, Row};
use crate::limits;
use crate::program::both::Flights;
use crate::program::findings::{
    Break, LeastMargin, Peak, Place, Preflight, Range, Rule, Time, Timing,
};
use crate::program::follow::{Course, Found, Leg, Pilot, length};
use crate::program::interpreter::Move;
use crate::program::loads::{Beyond, Demands, Load, Loads};
use crate::proof::reach::Reach;
use crate::read::machine::MachineConfig;
use kinematics::{Fault, Letter, Limit, Matrix3, Part, Pose, Vector3};
use std::cmp::Ordering;
use std::ops::ControlFlow;
use std::path::Path;

/// Rounding of the interpreter's positions, as a share of the machine's size.
const ROUNDING: f64 = 1e-9;

/// Follows the moves of a program one after the other, from `[TRAJ]HOME` on.
pub struct Flight<'a> {
    pilot: Pilot<'a>,
    number: usize,
    fault: Option<Fault>,
}

impl<'a> Flight<'a> {
    /// Before the first move.
    ///
    /// # Errors
    /// A spindle that the machine cannot take.
    pub fn new(config: &'a MachineConfig) -> Result<Self, Fault> {
        Ok(Self { pilot: Pilot::new(config)?, number: 0, fault: None })
    }

    /// Follows the next move.
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

    /// What is known after the last move: nothing yet of what depends on time.
    ///
    /// # Errors
    /// A tool vector that the machine cannot take.
    pub fn finish(self) -> Result<Preflight, Fault> {
        self.fault.map_or_else(|| Ok(self.pilot.finish()), Err)
    }
}

/// Follows all moves of a program.
///
/// # Errors
/// A tool vector that the machine cannot take.
pub fn preflight(config: &MachineConfig, moves: &[Move]) -> Result<Preflight, Fault> {
    let mut flight = Flights::new(config)?;
    moves.iter().for_each(|step| flight.see(step));
    flight.finish()
}

/// What LinuxCNC makes of a program in time; `see` is shown every servo cycle, and ends the run where
/// it breaks.
pub fn timed(
    config: &MachineConfig,
    program: &Path,
    options: &Options,
    mut see: impl FnMut(&Row) -> ControlFlow<()>,
) -> Time {
    let mut loads = Loads::new(config);
    let outcome = process::run(config, program, options, |row| {
        loads.see(row);
        see(row)
    });
    match outcome {
        Ok(outcome) => Time::Judged(Timing::of(config, loads.finish(), outcome)),
        Err(cause) => Time::NotJudged(cause.to_string()),
    }
}

impl Pilot<'_> {
    /// The tool offset moves the platform along a straight line, where it is tilted.
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
            // As a motion of the old tool. Where a table takes part of it, only its end is judged,
            // with the next move.
            let active = |letter| self.config.machine.layout().coordinates().contains(letter);
            if [Letter::X, Letter::Y, Letter::Z].into_iter().all(active) {
                let delta = [shift.x, shift.y, shift.z, 0.0, 0.0, 0.0];
                let (from, line, file) = (self.at, step.line, step.file);
                let told = if self.config.chain.is_empty() { delta } else { [0.0; 6] };
                let course = Course::Straight { from: pose, delta };
                self.follow(&Leg { number, line, file, from, delta: told, course });
            }
        }
        self.reach = Reach::with_tool(self.config, tool)?;
        self.tool = tool;
        Ok(())
    }

    /// How the platform shifts with the tool vector, at this pose of the machine.
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
            // What is told of a place has the angles of the axes.
            leg.from.copy_from_slice(&from[..6]);
            leg.delta.copy_from_slice(&delta[..6]);
        }
        self.check_axes(&leg, &step.end);
        self.follow(&leg);
        self.widen_axes(&step.end);
        self.result.poses.see(&from, step);
        let stays = step.end == self.config.start;
        self.result.is_still &= stays && !matches!(leg.course, Course::Carried { .. });
        self.result.moves += 1;
        self.result.length += length(&delta);
        (self.at, self.extra) = (step.end, step.extra_end);
    }

    /// What the machine does in a move.
    fn course(&self, step: &Move, from: &[f64; 6], delta: &[f64; 6]) -> Course {
        if self.config.chain.is_empty() {
            return Course::Straight { from: *from, delta: *delta };
        }
        let begin = self.config.world(from, &self.extra);
        let end = self.config.world(&step.end, &step.extra_end);
        Course::Carried { from: begin, delta: std::array::from_fn(|k| end[k] - begin[k]) }
    }

    /// Axis limits hold on a straight line that ends within them.
    fn check_axes(&mut self, leg: &Leg, end: &[f64; 6]) {
        let slack = ROUNDING * self.config.machine.size();
        for (k, axis) in self.config.programmed.iter().enumerate() {
            let part = Part::Axis(Letter::ALL[k]);
            // Each limit by itself: the one that is left need not be the nearer one at the start.
            let ends = [
                [leg.from[k] - axis.min, end[k] - axis.min],
                [axis.max - leg.from[k], axis.max - end[k]],
            ];
            for [before, margin] in ends.into_iter().filter(|[_, margin]| margin.is_finite()) {
                self.note(Limit::Axis, margin, part, leg.line);
                if margin < -slack {
                    let share = if before > 0.0 { before / (before - margin) } else { 0.0 };
                    let (limit, ends) = (Limit::Axis, [axis.min, axis.max]);
                    self.tell(leg, &Found { limit, share, part, ends, fault: None }, margin);
                }
            }
        }
    }

    fn finish(mut self) -> Preflight {
        self.result.breaks.sort_by(|a, b| a.step.cmp(&b.step).then(a.share.total_cmp(&b.share)));
        for limit in Limit::ALL {
            let Some((value, of, line)) = self.margins[limit.index()] else { continue };
            let unit = limits::unit(self.config, limit, of);
            let part = limits::part(self.config, limit, of);
            self.result.margins.push(LeastMargin {
                limit: limit.into(),
                value,
                unit,
                part,
                of,
                line,
            });
        }
        self.result.ranges = self.ranges();
        if let Some(first) = self.result.breaks.first() {
            // A program that only turns has no length.
            self.result.runnable =
                if self.result.length > 0.0 { first.before / self.result.length } else { 0.0 };
        }
        self.result
    }
}

impl Preflight {
    /// The same with what LinuxCNC makes of the program: limits that it leaves in time are breaks as
    /// the others are, and so is what LinuxCNC stops at.
    pub fn with_time(mut self, config: &MachineConfig, time: Time) -> Self {
        self.time = time;
        let Time::Judged(timing) = &self.time else { return self };
        for (limit, peaks) in
            [(Limit::JointSpeed, &timing.speeds), (Limit::JointAcceleration, &timing.accelerations)]
        {
            self.margins.extend(least(config, limit, peaks));
        }
        self.breaks.extend(timing.breaks.iter().cloned());
        let first = config.guarded_joints();
        self.ranges.extend(config.extra.iter().zip(&timing.extra).enumerate().map(
            |(n, (axis, used))| {
                let joint = &axis.joint;
                let ends = [joint.min.max(axis.axis.min), joint.max.min(axis.axis.max)];
                Range::of(config, Limit::JointRange, Part::Joint(first + n), *used, ends)
            },
        ));
        self
    }
}

/// The least margin of the joints.
fn least(config: &MachineConfig, limit: Limit, peaks: &[Peak]) -> Option<LeastMargin> {
    let margin = |(joint, peak): (usize, &Peak)| LeastMargin {
        limit: limit.into(),
        value: peak.limit - peak.value,
        unit: limits::unit(config, limit, Part::Joint(joint)),
        part: limits::part(config, limit, Part::Joint(joint)),
        of: Part::Joint(joint),
        line: peak.place.line,
    };
    let margins = peaks.iter().enumerate().map(margin);
    margins.min_by(|a, b| a.value.total_cmp(&b.value)).filter(|margin| margin.value.is_finite())
}

impl Timing {
    /// Judges a run.
    pub fn of(config: &MachineConfig, demands: Demands, outcome: Outcome) -> Self {
        let Demands { speed, acceleration, following, lines, extra, last, .. } = demands;
        let mut breaks = [
            breaks_of(config, Rule::Limit(Limit::JointSpeed), &speed),
            breaks_of(config, Rule::Limit(Limit::JointAcceleration), &acceleration),
            breaks_of(config, Rule::FollowingError, &following),
        ]
        .concat();
        breaks.extend(stop(&outcome, &last));
        breaks.sort_by(|a, b| a.seconds.partial_cmp(&b.seconds).unwrap_or(Ordering::Equal));
        let factors = lines.iter().map(|line| line.factor);
        Self {
            seconds: outcome.seconds,
            ending: outcome.ending,
            messages: outcome.messages,
            speeds: speed.peaks,
            accelerations: acceleration.peaks,
            following_errors: following.peaks,
            extra,
            feed_factor: factors.fold(f64::INFINITY, f64::min),
            lines,
            breaks,
        }
    }
}

fn breaks_of(config: &MachineConfig, limit: Rule, load: &Load) -> Vec<Break> {
    let found = load.peaks.iter().zip(&load.beyond).enumerate();
    let told = found.filter_map(|(joint, (peak, beyond))| {
        let Beyond { place, lines } = (*beyond)?;
        let (part, text) = sentence(config, limit, joint, peak);
        Some(in_time(limit, part, &place, lines, text))
    });
    told.collect()
}

/// What breaks, and how.
fn sentence(config: &MachineConfig, limit: Rule, joint: usize, peak: &Peak) -> (String, String) {
    let Peak { value, limit: most, .. } = peak;
    let joint = Part::Joint(joint);
    match limit {
        Rule::Limit(limit) => {
            let (part, unit) =
                (limits::part(config, limit, joint), limits::unit(config, limit, joint));
            let text = format!(
                "{part} goes beyond {most} {unit}, in this program up to {value:.4} {unit}"
            );
            (part, text)
        }
        Rule::FollowingError | Rule::Control | Rule::Mechanisms => {
            let limit = Limit::JointRange;
            let (part, unit) =
                (limits::part(config, limit, joint), limits::unit(config, limit, joint));
            let text = format!(
                "{part} lags behind its command by {value:.4} {unit}, where LinuxCNC allows \
                 {most:.4} {unit}"
            );
            (part, text)
        }
    }
}

/// What LinuxCNC says where it stops the program.
fn stop(outcome: &Outcome, last: &Place) -> Option<Break> {
    if outcome.ending == Ending::Finished {
        return None;
    }
    let errors = outcome.messages.iter().filter(|told| told.is_error());
    let first = errors.clone().next();
    let (line, seconds) =
        first.map_or((last.line, last.seconds), |told| (told.place(), told.seconds));
    let texts: Vec<&str> = errors.map(|told| told.text.as_str()).collect();
    let text = match texts.is_empty() {
        true => "LinuxCNC stops here, without a message".into(),
        false => format!("LinuxCNC stops here: {}", texts.join("; ")),
    };
    let place = Place { line, seconds, ..*last };
    Some(in_time(Rule::Control, String::new(), &place, 1, text))
}

/// A break that LinuxCNC's cycles show.
fn in_time(limit: Rule, part: String, place: &Place, lines: usize, text: String) -> Break {
    let Place { line, pose, seconds } = *place;
    let (file, moves) = (0, lines);
    let (step, share, last, before) = (usize::MAX, 0.0, usize::MAX, f64::INFINITY);
    Break {
        limit,
        part,
        line,
        file,
        pose,
        of_second: false,
        seconds: Some(seconds),
        moves,
        step,
        share,
        last,
        before,
        text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::row::{Beside, Extra, Flags, Message, MessageKind};
    use kinematics::MAX_JOINTS;

    fn config() -> MachineConfig {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hexapod/hexapod.ini");
        MachineConfig::read(&file).unwrap()
    }

    /// Half a second in line 4 in which strut 2 runs at this speed.
    fn run(config: &MachineConfig, speed: f64, outcome: Outcome) -> Preflight {
        let mut loads = Loads::new(config);
        for cycle in 0..500 {
            let strut = 900.0 + speed * cycle as f64 * config.period;
            loads.see(&Row {
                cycle,
                line: 4,
                flags: Flags { on: true, ..Flags::default() },
                pose: config.home,
                joints: std::array::from_fn(|i| if i == 2 { strut } else { 900.0 }),
                errors: [0.0; MAX_JOINTS],
                allowed: [1.0; MAX_JOINTS],
                extra: Extra::default(),
                second: Beside::default(),
                tool: [0.0; 3],
                feed: 1.0,
            });
        }
        let timing = Timing::of(config, loads.finish(), outcome);
        preflight(config, &[]).unwrap().with_time(config, Time::Judged(timing))
    }

    fn finished() -> Outcome {
        Outcome { ending: Ending::Finished, cycles: 500, seconds: 0.5, messages: vec![] }
    }

    #[test]
    fn a_joint_that_is_too_fast_breaks_the_program_and_one_that_is_not_tells_its_margin() {
        let config = config();
        let most = config.joints[2].max_velocity;
        let slow = run(&config, most / 2.0, finished());
        assert!(slow.fits(), "{:?}", slow.breaks);
        let margin = slow.margins.iter().find(|margin| margin.limit == Limit::JointSpeed).unwrap();
        assert!((margin.value - most / 2.0).abs() < 1e-6 && margin.line == 4, "{margin:?}");
        let Time::Judged(timing) = &slow.time else { panic!() };
        assert!((timing.feed_factor - 2.0).abs() < 1e-6, "{}", timing.feed_factor);
        let fast = run(&config, 2.0 * most, finished());
        let [told] = fast.breaks.as_slice() else { panic!("{:?}", fast.breaks) };
        assert!(told.limit == Limit::JointSpeed && told.limit.is_of_time() && told.line == 4);
        assert!(told.text.starts_with("the speed of strut 2 goes beyond"), "{}", told.text);
        assert_eq!((told.moves, told.seconds), (1, Some(0.0)));
    }

    #[test]
    fn what_linuxcnc_stops_at_is_a_break_in_its_words_and_what_it_only_shows_is_none() {
        let config = config();
        let error = |kind| Message {
            kind,
            text: "joint 2 following error".into(),
            line: 4,
            read: 4,
            seconds: 0.3,
        };
        let shown = Outcome { messages: vec![error(MessageKind::Display)], ..finished() };
        assert!(run(&config, 1.0, shown.clone()).fits());
        let stopped = Outcome { ending: Ending::Stopped, ..shown.clone() };
        let told = &run(&config, 1.0, stopped).breaks[0];
        assert_eq!(told.text, "LinuxCNC stops here, without a message");
        assert_eq!((told.line, told.seconds), (4, Some(0.499)));
        let messages = vec![error(MessageKind::Error)];
        let stopped = Outcome { ending: Ending::Stopped, messages, ..shown };
        let told = &run(&config, 1.0, stopped).breaks[0];
        assert_eq!(told.text, "LinuxCNC stops here: joint 2 following error");
        assert_eq!((told.limit, told.line, told.seconds), (Rule::Control, 4, Some(0.3)));
    }

    #[test]
    fn time_that_is_not_judged_breaks_nothing() {
        let config = config();
        let found = preflight(&config, &[]).unwrap();
        let told = found.with_time(&config, Time::NotJudged("no LinuxCNC".into()));
        assert!(told.fits() && told.time == Time::NotJudged("no LinuxCNC".into()));
    }
}
