// SPDX-License-Identifier: GPL-2.0-or-later
//! Check whether a program fits a machine: every move over its whole length, and LinuxCNC's
//! timing.
//!
//! LinuxCNC reads the program and runs it in virtual time ([`linuxcnc`]). Each commanded move is
//! checked in turn (`follow`), and every tool change: memory does not grow with the
//! program. Every servo cycle is judged for limits that depend on time ([`crate::loads`]) and on the pose
//! ([`crate::servo_cycles`]).

use crate::loads::{Beyond, Demands, Load, Loads};
use crate::mechanism_moves::Half;
use crate::motion::{Move, ROUNDING, Translator};
use crate::report::{Break, LeastMargin, Peak, Place, Preflight, Rule, Time, Timing};
use crate::servo_cycles::Cycles;
use crate::two_mechanisms::Flights;
use kinematics::{Fault, Letter, Limit, Part};
use linuxcnc::process::{Event, Options, run_with_moves};
use linuxcnc::refusal::NotJudged;
use linuxcnc::row::{Ending, Outcome, Row};
use machine::files::{self, AtFile};
use machine::limits;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::cmp::Ordering;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::mpsc;

/// Checks all moves of a program.
///
/// # Errors
/// A tool vector without a legal pose at home.
pub fn preflight(mechanisms: &[Mechanism], moves: &[Move]) -> Result<Preflight, Fault> {
    let mut flight = Flights::new(mechanisms)?;
    moves.iter().for_each(|step| flight.see(step));
    flight.finish()
}

/// A judged program.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The result.
    pub found: Preflight,
    /// Files of the lines, by the numbers in their findings; the first one is the program.
    pub files: Vec<PathBuf>,
}

impl Judged {
    /// Returns the number of a file, adding a new one.
    fn number_of(&mut self, file: PathBuf) -> usize {
        self.files.iter().position(|known| *known == file).unwrap_or_else(|| {
            self.files.push(file);
            self.files.len() - 1
        })
    }
}

/// Why a program is not judged.
#[derive(Debug, thiserror::Error)]
pub enum JudgeError {
    /// LinuxCNC does not run the program.
    #[error(transparent)]
    NotJudged(#[from] NotJudged),
    /// A tool vector without a legal pose at home.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// A file of the program cannot be read.
    #[error(transparent)]
    File(#[from] AtFile<io::Error>),
    /// LinuxCNC stops the program before anything moves.
    #[error("{}:{line}: {text}", .file.display())]
    NeverStarts {
        /// Its file.
        file: PathBuf,
        /// Line in which it stops.
        line: u32,
        /// LinuxCNC's message.
        text: String,
    },
    /// The program does not move the machine.
    #[error("{}: the program moves nothing; add a block such as G1 X10 F600", .0.display())]
    MovesNothing(PathBuf),
}

/// Judges a program: LinuxCNC runs it, every move is checked over its whole length, and every servo cycle is
/// judged. If LinuxCNC stops at a limit, it runs the program again without its limits, for the
/// remaining lines; and if lines begin with `/`, once more with these.
///
/// `see` receives every servo cycle of the first run.
///
/// # Errors
/// LinuxCNC does not reach a first move; a file cannot be read; a tool without a legal pose at home.
pub fn judge(
    config: &MachineConfig,
    program: &Path,
    options: &Options,
    see: &mut (dyn FnMut(&Row) + Send),
) -> Result<Judged, JudgeError> {
    let mut judged = judge_once(config, program, options, see)?;
    if options.block_delete && has_deletable(&judged.files)? {
        let kept = Options { block_delete: false, ..options.clone() };
        let Judged { found: mut other, files } = judge_once(config, program, &kept, &mut |_| ())?;
        // It may call other subroutines, and in another order.
        let numbers: Vec<usize> = files.into_iter().map(|file| judged.number_of(file)).collect();
        let renumber = |file: &mut usize| *file = numbers.get(*file).copied().unwrap_or(0);
        other.breaks.iter_mut().for_each(|answer| renumber(&mut answer.file));
        other.margins.iter_mut().for_each(|margin| renumber(&mut margin.file));
        judged.found.add_variant(other, "with block delete off");
    }
    Ok(judged)
}

fn judge_once(
    config: &MachineConfig,
    program: &Path,
    options: &Options,
    see: &mut (dyn FnMut(&Row) + Send),
) -> Result<Judged, JudgeError> {
    let (mut judged, time) = followed(config, program, options, see)?;
    let is_stopped = matches!(&time, Time::Judged(timing) if timing.ending == Ending::Stopped);
    if is_stopped {
        let open = Options { open_limits: true, ..options.clone() };
        let (beyond, _) = followed(config, program, &open, &mut |_| ())?;
        // Without its limits LinuxCNC reaches at least the same move.
        if beyond.found.moves >= judged.found.moves {
            judged = beyond;
        }
    }
    judged.found = judged.found.with_time(config, time);
    Ok(judged)
}

/// Number of moves passed at once, and of such batches before LinuxCNC waits.
const BATCH: usize = 256;
const BATCHES: usize = 64;

/// Runs a program and checks its moves in parallel.
fn followed(
    config: &MachineConfig,
    program: &Path,
    options: &Options,
    see: &mut (dyn FnMut(&Row) + Send),
) -> Result<(Judged, Time), JudgeError> {
    // One of two mechanisms is judged by the motion of both.
    let is_half = config.is_half();
    let read = is_half.then(|| MachineConfig::from_ini(&config.ini).ok()).flatten();
    let whole = read.as_ref().unwrap_or(config);
    let (sender, receiver) = mpsc::sync_channel::<Vec<Move>>(BATCHES);
    let mut half = is_half.then(|| Half::new(config.first(), whole));
    let mut flights = Flights::new(&config.mechanisms)?;
    let run = move || -> Result<_, Fault> {
        let mut translator = Translator::new(whole);
        let (mut cycles, mut loads) = (Cycles::new(config)?, Loads::new(config));
        let (mut files, mut batch, mut sent) = (vec![], vec![], 0);
        let outcome = run_with_moves(whole, program, options, |event| match event {
            Event::File(name) => {
                files.push(PathBuf::from(name));
                ControlFlow::Continue(())
            }
            Event::Move(commanded) => {
                translator.see(commanded, |step| batch.push(*step));
                cycles.take(commanded, sent + batch.len());
                if batch.len() < BATCH {
                    return ControlFlow::Continue(());
                }
                sent += batch.len();
                match sender.send(std::mem::take(&mut batch)) {
                    Ok(()) => ControlFlow::Continue(()),
                    Err(_) => ControlFlow::Break(()),
                }
            }
            Event::Row(row) => {
                if !is_half {
                    loads.see(row);
                    cycles.see(row);
                }
                see(row);
                ControlFlow::Continue(())
            }
        });
        // The receiver has ended only if it has failed.
        let _ = sender.send(batch);
        Ok((outcome, files, cycles.used(), cycles.finish(), loads.finish()))
    };
    let (found, ran) = std::thread::scope(|scope| {
        let run = scope.spawn(run);
        for step in receiver.into_iter().flatten() {
            let step = match &mut half {
                Some(half) => half.of(&step),
                None => step,
            };
            flights.see(&step);
        }
        (flights.finish(), run.join().expect("the run has said why it panicked"))
    });
    let (outcome, files, used, [beyond, off_path], demands) = ran?;
    let mut found = found?;
    // Ends of moves are reported as programmed.
    let rounding = ROUNDING * config.first().machine.size();
    for (range, [low, high]) in found.ranges.iter_mut().zip(used) {
        range.widen([low + rounding, high - rounding]);
    }
    found.add_cycles(beyond);
    found.off_path = off_path;
    found.is_whole = matches!(&outcome, Ok(outcome) if outcome.ending == Ending::Finished);
    let time = match outcome {
        // Without a start, nothing is judged at all.
        Err(cause) if found.moves <= 1 => return Err(cause.into()),
        Err(cause) => Time::NotJudged(cause.to_string()),
        Ok(_) if is_half => Time::NotJudged(NotJudged::HalfOfPair.to_string()),
        Ok(outcome) => Time::Judged(Timing::of(config, demands, outcome)),
    };
    Ok((Judged { found, files }, time))
}

/// Returns whether lines of these files begin with `/`.
///
/// # Errors
/// A file cannot be read.
pub fn has_deletable(files: &[PathBuf]) -> Result<bool, AtFile<io::Error>> {
    for file in files {
        let text = files::read(file)?;
        if text
            .split(|byte| *byte == b'\n')
            .any(|line| line.trim_ascii_start().first() == Some(&b'/'))
        {
            return Ok(true);
        }
    }
    Ok(false)
}

impl Preflight {
    /// Adds the violations in servo cycles: other limits, and limits violated before the first commanded move
    /// that violates them.
    fn add_cycles(&mut self, beyond: Vec<Break>) {
        for answer in beyond {
            match self.breaks.iter_mut().find(|known| known.is_like(&answer)) {
                None => self.breaks.push(answer),
                Some(known) if known.seconds.is_none() && answer.step <= known.step => {
                    *known = answer
                }
                Some(_) => {}
            }
        }
    }

    /// Adds the findings of another run of the same program, under `condition`.
    fn add_variant(&mut self, other: Self, condition: &str) {
        for answer in other.breaks {
            let is_here = |known: &Break| (known.file, known.line) == (answer.file, answer.line);
            if !self.breaks.iter().any(|known| known.is_like(&answer) && is_here(known)) {
                self.breaks.push(Break { text: format!("{condition}: {}", answer.text), ..answer });
            }
        }
        for margin in other.margins {
            let is_same = |known: &&mut LeastMargin| known.limit == margin.limit;
            match self.margins.iter_mut().find(is_same) {
                Some(known) if known.value <= margin.value => {}
                Some(known) => *known = margin,
                None => self.margins.push(margin),
            }
        }
        for (known, range) in self.ranges.iter_mut().zip(other.ranges) {
            known.widen(range.used);
        }
        self.is_still &= other.is_still;
        self.is_whole &= other.is_whole;
        if let (Time::Judged(_), Time::NotJudged(cause)) = (&self.time, &other.time) {
            self.time = Time::NotJudged(format!("{condition}: {cause}"));
        }
    }

    /// Adds LinuxCNC's timing: limits violated in time and LinuxCNC's own stops are violations like
    /// the others.
    pub fn with_time(mut self, config: &MachineConfig, time: Time) -> Self {
        self.time = time;
        if let Time::Judged(timing) = &self.time {
            let (speeds, accelerations) = (&timing.speeds, &timing.accelerations);
            self.margins.extend(least(config, Limit::JointSpeed, speeds));
            self.margins.extend(least(config, Limit::JointAcceleration, accelerations));
            self.breaks.extend(timing.breaks.iter().cloned());
        }
        let in_time = self.breaks.iter().filter(|broken| broken.seconds.is_some());
        let shares = in_time.map(|broken| self.share(broken.before));
        self.runnable = shares.fold(self.runnable, f64::min);
        self
    }
}

/// Returns the least margin of the joints.
fn least(config: &MachineConfig, limit: Limit, peaks: &[Peak]) -> Option<LeastMargin> {
    let margin = |((one, joint), peak): ((&Mechanism, usize), &Peak)| LeastMargin {
        limit: limit.into(),
        value: peak.limit - peak.value,
        unit: limits::unit(one, limit, Part::Joint(joint)),
        part: limits::part(one, limit, Part::Joint(joint)),
        of: Part::Joint(joint),
        line: peak.place.line,
        file: peak.place.file,
    };
    let margins = config.all_joints().zip(peaks).map(margin);
    margins.min_by(|a, b| a.value.total_cmp(&b.value)).filter(|margin| margin.value.is_finite())
}

impl Timing {
    /// Judges a run.
    pub fn of(config: &MachineConfig, demands: Demands, outcome: Outcome) -> Self {
        let Demands { speed, acceleration, following, lines, last } = demands;
        let mut breaks = [
            breaks_of(config, Rule::Limit(Limit::JointSpeed), &speed),
            breaks_of(config, Rule::Limit(Limit::JointAcceleration), &acceleration),
            breaks_of(config, Rule::FollowingError, &following),
        ]
        .concat();
        breaks.extend(stop(config, &outcome, &last));
        breaks.sort_by(|a, b| a.seconds.partial_cmp(&b.seconds).unwrap_or(Ordering::Equal));
        let factors = lines.iter().map(|line| line.factor);
        Self {
            seconds: outcome.seconds,
            ending: outcome.ending,
            messages: outcome.messages,
            speeds: speed.peaks,
            accelerations: acceleration.peaks,
            following_errors: following.peaks,
            feed_factor: factors.fold(f64::INFINITY, f64::min),
            lines,
            breaks,
        }
    }
}

fn breaks_of(config: &MachineConfig, limit: Rule, load: &Load) -> Vec<Break> {
    let found = config.all_joints().zip(load.peaks.iter().zip(&load.beyond));
    let answer = found.filter_map(|((mechanism, joint), (peak, beyond))| {
        let Beyond { place, lines } = (*beyond)?;
        let (part, text) = sentence(mechanism, limit, joint, peak);
        Some(Break::in_time(config, limit, part, &place, lines, text))
    });
    answer.collect()
}

/// Returns the part that violates a limit, and a sentence about it.
fn sentence(config: &Mechanism, limit: Rule, joint: usize, peak: &Peak) -> (String, String) {
    let Peak { value, limit: most, .. } = peak;
    let joint = Part::Joint(joint);
    let of = if let Rule::Limit(limit) = limit { limit } else { Limit::JointRange };
    let (part, unit) = (limits::part(config, of, joint), limits::unit(config, of, joint));
    let text = match limit {
        Rule::Limit(_) => {
            format!("{part} exceeds {most} {unit}, reaching {value:.4} {unit} in this program")
        }
        _ => format!(
            "{part} lags its command by {value:.4} {unit}, but LinuxCNC allows {most:.4} {unit}"
        ),
    };
    (part, text)
}

/// Adds the reason to LinuxCNC's refusal of a letter: the interpreter knows only those of `[TRAJ]COORDINATES`.
pub fn explained(config: &MachineConfig, text: &str) -> String {
    let of_letter = |letter: Letter| {
        let refused = format!("Bad character '{}' used", letter.name().to_ascii_lowercase());
        text.contains(&refused)
    };
    let layout = config.first().machine.layout();
    let mut dependent = Letter::ALL.into_iter().filter(|letter| {
        layout.is_dependent(*letter) && layout.is_held(*letter) && of_letter(*letter)
    });
    let Some(letter) = dependent.next() else { return text.into() };
    let commanded: Vec<String> =
        layout.coordinates().as_slice().iter().map(|letter| letter.name().to_string()).collect();
    let (name, commanded) = (letter.name(), commanded.join(" "));
    format!("{text}: on this machine {name} follows from {commanded}; remove it from the program")
}

/// Returns LinuxCNC's message if it stops the program.
fn stop(config: &MachineConfig, outcome: &Outcome, last: &Place) -> Option<Break> {
    if outcome.ending == Ending::Finished {
        return None;
    }
    let errors = outcome.messages.iter().filter(|answer| answer.is_error());
    let first = errors.clone().next();
    let (line, file, seconds) = first.map_or((last.line, last.file, last.seconds), |answer| {
        (answer.place(), answer.file, answer.seconds)
    });
    let texts: Vec<String> = errors.map(|answer| explained(config, &answer.text)).collect();
    let text = match texts.is_empty() {
        true => "LinuxCNC stops here, without a message".into(),
        false => format!("LinuxCNC stops here: {}", texts.join("; ")),
    };
    let place = Place { line, file, seconds, ..*last };
    Some(Break::in_time(config, Rule::Control, String::new(), &place, 1, text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinematics::MAX_JOINTS;
    use linuxcnc::row::{Beside, Extra, Flags, Message, MessageKind};

    fn config() -> MachineConfig {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/hexapod/hexapod.ini");
        MachineConfig::read(&file).unwrap()
    }

    /// Returns half a second in line 4 in which strut 2 moves at this speed.
    fn run(config: &MachineConfig, speed: f64, outcome: Outcome) -> Preflight {
        let mut loads = Loads::new(config);
        for cycle in 0..500 {
            let strut = 900.0 + speed * cycle as f64 * config.period;
            loads.see(&Row {
                cycle,
                line: 4,
                file: 0,
                number: 0,
                flags: Flags { on: true, ..Flags::default() },
                pose: config.first().home,
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
        preflight(&config.mechanisms, &[]).unwrap().with_time(config, Time::Judged(timing))
    }

    fn finished() -> Outcome {
        Outcome { ending: Ending::Finished, cycles: 500, seconds: 0.5, messages: vec![] }
    }

    #[test]
    fn a_joint_that_is_too_fast_breaks_the_program_and_a_slower_one_has_a_margin() {
        let config = config();
        let most = config.first().joints[2].max_velocity;
        let slow = run(&config, most / 2.0, finished());
        assert!(slow.fits(), "{:?}", slow.breaks);
        let margin = slow.margins.iter().find(|margin| margin.limit == Limit::JointSpeed).unwrap();
        assert!((margin.value - most / 2.0).abs() < 1e-6 && margin.line == 4, "{margin:?}");
        let Time::Judged(timing) = &slow.time else { panic!() };
        assert!((timing.feed_factor - 2.0).abs() < 1e-6, "{}", timing.feed_factor);
        let fast = run(&config, 2.0 * most, finished());
        let [answer] = fast.breaks.as_slice() else { panic!("{:?}", fast.breaks) };
        assert!(answer.limit == Limit::JointSpeed && answer.limit.is_of_time() && answer.line == 4);
        assert!(answer.text.starts_with("the speed of strut 2 exceeds"), "{}", answer.text);
        assert_eq!((answer.moves, answer.seconds), (1, Some(0.0)));
    }

    #[test]
    fn what_linuxcnc_stops_at_is_a_break_in_its_words_and_what_it_only_shows_is_none() {
        let config = config();
        let error = |kind| Message {
            kind,
            text: "joint 2 following error".into(),
            line: 4,
            file: 0,
            read: 4,
            seconds: 0.3,
        };
        let shown = Outcome { messages: vec![error(MessageKind::Display)], ..finished() };
        assert!(run(&config, 1.0, shown.clone()).fits());
        let stopped = Outcome { ending: Ending::Stopped, ..shown.clone() };
        let answer = &run(&config, 1.0, stopped).breaks[0];
        assert_eq!(answer.text, "LinuxCNC stops here, without a message");
        assert_eq!((answer.line, answer.seconds), (4, Some(0.499)));
        let messages = vec![error(MessageKind::Error)];
        let stopped = Outcome { ending: Ending::Stopped, messages, ..shown };
        let answer = &run(&config, 1.0, stopped).breaks[0];
        assert_eq!(answer.text, "LinuxCNC stops here: joint 2 following error");
        assert_eq!((answer.limit, answer.line, answer.seconds), (Rule::Control, 4, Some(0.3)));
    }

    #[test]
    fn time_that_is_not_judged_breaks_nothing() {
        let config = config();
        let found = preflight(&config.mechanisms, &[]).unwrap();
        let answer = found.with_time(&config, Time::NotJudged("no LinuxCNC".into()));
        assert!(answer.fits() && answer.time == Time::NotJudged("no LinuxCNC".into()));
    }
}
