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
use crate::program::interpreter::Move;
use crate::program::lines::Lines;
use crate::program::loads::{Beyond, Demands, Load, Loads};
use crate::read::machine::MachineConfig;
use kinematics::{Fault, Limit, Part};
use std::cmp::Ordering;
use std::ops::ControlFlow;
use std::path::Path;

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

impl Preflight {
    /// The same with what LinuxCNC makes of the program: limits that it leaves in time are breaks as
    /// the others are, and so is what LinuxCNC stops at.
    pub fn with_time(mut self, config: &MachineConfig, time: Time) -> Self {
        self.time = time;
        let Time::Judged(timing) = &self.time else { return self };
        for (limit, peaks) in
            [(Limit::JointSpeed, &timing.speeds), (Limit::JointAcceleration, &timing.accelerations)]
        {
            self.margins.extend(least(config, limit, peaks, &self.lines));
        }
        let in_file = |told: &Break| Break { file: self.lines.files(told.line)[0], ..told.clone() };
        self.breaks.extend(timing.breaks.iter().map(in_file));
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
fn least(
    config: &MachineConfig,
    limit: Limit,
    peaks: &[Peak],
    lines: &Lines,
) -> Option<LeastMargin> {
    let margin = |(joint, peak): (usize, &Peak)| LeastMargin {
        limit: limit.into(),
        value: peak.limit - peak.value,
        unit: limits::unit(config, limit, Part::Joint(joint)),
        part: limits::part(config, limit, Part::Joint(joint)),
        of: Part::Joint(joint),
        line: peak.place.line,
        file: lines.files(peak.place.line)[0],
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
