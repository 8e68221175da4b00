// SPDX-License-Identifier: GPL-2.0-or-later
//! A move, followed over its whole length.
//!
//! A move is straight in X Y Z A B C, angles included, as LinuxCNC's joints see it. A piece of it
//! is a [`crate::proof::cell::Way`]: the values in its middle, their slopes and a bound of their second
//! derivatives, which give their range over the piece. A piece that is not proved to keep a limit
//! is halved, the earlier half first, until a pose is found beyond the limit or the piece is too
//! short to matter: then the move touches the limit. So every limit has the first place where it
//! breaks, and a move without one is proved to keep all of them everywhere.

use crate::limits;
use crate::program::findings::{Break, LineLoad, Preflight, Sample};
use crate::proof::cell::Way;
use crate::proof::reach::Reach;
use crate::proof::spans::Course;
use crate::read::machine::MachineConfig;
use kinematics::{Fault, Limit, MAX_JOINTS, Margin, Part, Vector3};

/// A piece of a move is halved until it is this short, as a share of the machine's size: far
/// below what any machine resolves.
const SHORTEST: f64 = 1e-6;

/// Halving ends here at the latest: numbers have no more digits.
const MOST_HALVINGS: i32 = 40;

/// Least margins are told within this share of the limit's range.
const ACCURACY: f64 = 0.01;

/// The same of the conditioning, whose bound is one of first order.
const CONDITIONING_ACCURACY: f64 = 0.05;

/// Speeds below this share of their limit are told as a bound, without [`ACCURACY`].
const SLOW: f64 = 0.5;

/// Poses looked at on a move that breaks a limit, for how far it leaves it.
const SAMPLES: usize = 33;

/// One limit of one part over a piece.
#[derive(Clone, Copy, Debug)]
struct Check {
    limit: Limit,
    part: Part,
    /// Smallest and largest value that the limit allows.
    ends: [f64; 2],
    /// Margin in the middle.
    seen: f64,
    /// The margin is proved to be at least this everywhere.
    proved: f64,
    /// What the margin is measured by.
    range: f64,
}

impl Check {
    fn found(&self, share: f64) -> Found {
        Found { share, part: self.part, ends: self.ends, fault: None }
    }

    /// How far the pieces of a move have to be cut for the figures that are told, to a share of `scale`
    /// times the range.
    fn is_coarse(&self, least: f64, scale: f64) -> bool {
        let accuracy =
            if self.limit == Limit::Conditioning { CONDITIONING_ACCURACY } else { ACCURACY };
        self.proved < least - accuracy * self.range * scale
            && match self.limit {
                Limit::JointSpeed => self.proved < (1.0 - SLOW) * self.range,
                Limit::Axis | Limit::Reach | Limit::JointAcceleration => false,
                _ => true,
            }
    }
}

/// A straight line to follow.
pub(super) struct Leg {
    /// Number of the move.
    pub(super) number: usize,
    pub(super) line: u32,
    pub(super) file: usize,
    pub(super) from: [f64; 6],
    pub(super) delta: [f64; 6],
    /// Seconds; 0 where nothing is said of speeds.
    pub(super) duration: f64,
}

impl Leg {
    fn at(&self, share: f64) -> [f64; 6] {
        std::array::from_fn(|k| self.from[k] + share * self.delta[k])
    }
}

/// Where a move first leaves a limit.
#[derive(Clone, Copy)]
pub(super) struct Found {
    pub(super) share: f64,
    pub(super) part: Part,
    /// Smallest and largest value that the limit allows.
    pub(super) ends: [f64; 2],
    /// Why the pose there has no joint values.
    pub(super) fault: Option<Fault>,
}

/// Firsts of one move, by limit.
type Firsts = [Option<Found>; Limit::ALL.len()];

pub(super) struct Pilot<'a> {
    pub(super) config: &'a MachineConfig,
    pub(super) reach: Reach<'a>,
    pub(super) tool: Vector3<f64>,
    pub(super) at: [f64; 6],
    keep: bool,
    checks: Vec<Check>,
    /// Least margins seen, which tell how fine the pieces have to be.
    least: [f64; Limit::ALL.len()],
    pub(super) margins: [Option<(f64, Part, u32)>; Limit::ALL.len()],
    pub(super) result: Preflight,
}

impl<'a> Pilot<'a> {
    pub(super) fn new(config: &'a MachineConfig, keep: bool) -> Result<Self, Fault> {
        Ok(Self {
            config,
            reach: Reach::new(config)?,
            tool: config.spindle,
            at: config.home,
            keep,
            checks: vec![],
            least: [f64::INFINITY; Limit::ALL.len()],
            margins: [None; Limit::ALL.len()],
            result: Preflight {
                moves: 0,
                length: 0.0,
                time: 0.0,
                pieces: 0,
                breaks: vec![],
                margins: vec![],
                runnable: 1.0,
                feed_factor: f64::INFINITY,
                lines: vec![],
                speeds: vec![],
                accelerations: vec![],
                tilted_tool_changes: vec![],
                samples: vec![],
            },
        })
    }

    pub(super) fn follow(&mut self, leg: &Leg) {
        let size = self.config.machine.size();
        let turn: f64 = leg.delta[3..].iter().map(|d| d.abs().to_radians()).sum();
        let extent = length(&leg.delta) + turn * size / 2.0;
        let shortest = (SHORTEST * size / extent).clamp(0.5_f64.powi(MOST_HALVINGS), 1.0);
        let mut firsts = Firsts::default();
        let mut load = 0.0;
        let mut open = vec![(0.0, 1.0)];
        while let Some((from, to)) = open.pop() {
            if !self.is_done(leg, from, to, shortest, &mut firsts, &mut load) {
                let middle = (from + to) / 2.0;
                open.extend([(middle, to), (from, middle)]);
            }
        }
        self.note_load(leg, load);
        if firsts.iter().any(Option::is_some) {
            let worst = self.sample(leg);
            for ((limit, found), worst) in Limit::ALL.into_iter().zip(firsts).zip(worst) {
                if let Some(found) = found {
                    self.tell(leg, limit, &found, worst);
                }
            }
        }
    }

    /// Whether a piece needs no halving; what is found goes into `firsts`.
    fn is_done(
        &mut self,
        leg: &Leg,
        from: f64,
        to: f64,
        shortest: f64,
        firsts: &mut Firsts,
        load: &mut f64,
    ) -> bool {
        let reach = &mut firsts[Limit::Reach.index()];
        if reach.is_some_and(|found| found.share <= from) {
            // Beyond a place that cannot be reached nothing is known.
            return true;
        }
        self.result.pieces += 1;
        let (middle, half) = ((from + to) / 2.0, (to - from) / 2.0);
        let is_short = to - from <= shortest;
        let pose = leg.at(middle);
        let way = match self.reach.way(&pose, &leg.delta.map(|d| d * half)) {
            Ok(way) => way,
            Err(fault) => {
                let (part, ends) = (Part::Whole, [0.0, f64::INFINITY]);
                earlier(reach, Found { share: middle, part, ends, fault: Some(fault) });
                return is_short;
            }
        };
        self.weigh(&way, leg, half);
        let checks = std::mem::take(&mut self.checks);
        let mut done = true;
        for check in &checks {
            let first = &mut firsts[check.limit.index()];
            done &= self.is_settled(check, [from, middle], is_short, first, load);
        }
        if done {
            for check in &checks {
                let first = &firsts[check.limit.index()];
                if first.is_none_or(|found| found.share > from) {
                    self.close(check, leg, load);
                }
            }
            self.keep_sample(leg, middle, &pose, &way, &checks);
        }
        self.checks = checks;
        done
    }

    /// Whether a limit needs no halving of a piece, which begins and has its middle at these shares.
    fn is_settled(
        &self,
        check: &Check,
        [from, middle]: [f64; 2],
        is_short: bool,
        first: &mut Option<Found>,
        load: &mut f64,
    ) -> bool {
        if check.limit == Limit::JointSpeed {
            *load = load.max(1.0 - check.seen / check.range);
            return is_short || !check.is_coarse((1.0 - *load) * check.range, load.max(1.0));
        }
        if check.seen < 0.0 {
            earlier(first, check.found(middle));
        }
        if first.is_some_and(|found| found.share <= from) {
            return true;
        }
        let fails = check.proved < 0.0;
        // Where nothing is known, reach is what fails.
        if fails && is_short && check.proved.is_finite() {
            earlier(first, check.found(from));
        }
        let least = self.least[check.limit.index()].min(check.seen);
        is_short || !(fails || check.is_coarse(least, 1.0))
    }

    /// What a piece contributes that stays as it is.
    fn close(&mut self, check: &Check, leg: &Leg, load: &mut f64) {
        let kind = check.limit.index();
        self.least[kind] = self.least[kind].min(check.seen);
        if check.limit == Limit::JointSpeed {
            *load = load.max(1.0 - check.proved / check.range);
            return;
        }
        if check.limit != Limit::Reach && check.proved.is_finite() {
            self.note(check.limit, check.proved.min(check.seen), check.part, leg.line);
        }
    }

    /// Margins of all limits over a piece with this half width, into `checks`.
    fn weigh(&mut self, way: &Way, leg: &Leg, half: f64) {
        let joints = &self.config.joints;
        self.checks.clear();
        self.checks.extend(way.spans.iter().map(|span| Check {
            limit: span.margin.limit,
            part: span.margin.part,
            ends: span.margin.range,
            seen: span.margin.room(),
            proved: span.room(),
            range: limits::scale(&span.margin),
        }));
        for (i, course) in way.joints.iter().enumerate() {
            let (part, known) = (Part::Joint(i), course.second_derivative.is_finite());
            let (limit, proved) = (Limit::Reach, if known { 1.0 } else { -1.0 });
            let ends = [0.0, f64::INFINITY];
            self.checks.push(Check { limit, part, ends, seen: 1.0, proved, range: 1.0 });
        }
        if leg.duration == 0.0 {
            return;
        }
        let per_second = 1.0 / (leg.duration * half);
        for (i, (course, joint)) in way.joints.iter().zip(joints).enumerate() {
            let (limit, part, range) = (Limit::JointSpeed, Part::Joint(i), joint.max_velocity);
            let seen = range - course.slope * per_second;
            let proved = seen - course.second_derivative * per_second;
            // What is not a number proves nothing.
            let proved = if proved.is_nan() { f64::NEG_INFINITY } else { proved };
            self.checks.push(Check { limit, part, ends: [-range, range], seen, proved, range });
        }
    }

    pub(super) fn note(&mut self, limit: Limit, value: f64, part: Part, line: u32) {
        let margin = &mut self.margins[limit.index()];
        if margin.is_none_or(|(least, ..)| value < least) {
            *margin = Some((value, part, line));
        }
    }

    fn note_load(&mut self, leg: &Leg, load: f64) {
        if leg.duration == 0.0 {
            return;
        }
        let factor = 1.0 / load;
        self.result.feed_factor = self.result.feed_factor.min(factor);
        match self.result.lines.last_mut() {
            Some(last) if last.line == leg.line => last.factor = last.factor.min(factor),
            _ => self.result.lines.push(LineLoad { line: leg.line, factor }),
        }
    }

    /// How far a move leaves its limits: least margins seen.
    fn sample(&mut self, leg: &Leg) -> [f64; Limit::ALL.len()] {
        let mut worst = [f64::INFINITY; Limit::ALL.len()];
        let half = 0.5 / SAMPLES as f64;
        for n in 0..=SAMPLES {
            let pose = leg.at(n as f64 / SAMPLES as f64);
            let Ok(way) = self.reach.way(&pose, &leg.delta.map(|d| d * half)) else { continue };
            self.weigh(&way, leg, half);
            for check in std::mem::take(&mut self.checks) {
                let worst = &mut worst[check.limit.index()];
                *worst = worst.min(check.seen);
                if check.seen < 0.0 && check.limit != Limit::JointSpeed {
                    self.note(check.limit, check.seen, check.part, leg.line);
                }
            }
        }
        worst
    }

    fn keep_sample(&mut self, leg: &Leg, share: f64, pose: &[f64; 6], way: &Way, checks: &[Check]) {
        if !self.keep {
            return;
        }
        let shares =
            checks.iter().filter(|c| !limits::is_of_feed(c.limit) && c.limit != Limit::Reach);
        let mut joints = [0.0; MAX_JOINTS];
        joints
            .iter_mut()
            .zip(&way.joints)
            .for_each(|(joint, Course { middle, .. })| *joint = *middle);
        let mut speeds = [0.0; MAX_JOINTS];
        for check in checks.iter().filter(|check| check.limit == Limit::JointSpeed) {
            if let Part::Joint(i) = check.part {
                speeds[i] = 1.0 - check.seen / check.range;
            }
        }
        self.result.samples.push(Sample {
            time: self.result.time + share * leg.duration,
            line: leg.line,
            pose: *pose,
            joints,
            speeds,
            margin: shares.map(|check| check.seen / check.range).fold(f64::INFINITY, f64::min),
        });
    }

    /// Tells a break, if it is the first of its limit; `worst` is the least margin of the move.
    pub(super) fn tell(&mut self, leg: &Leg, limit: Limit, found: &Found, worst: f64) {
        let order = (leg.number, found.share);
        let told = self.result.breaks.iter().position(|told| told.limit == limit);
        if let Some(told) = told {
            let first = &self.result.breaks[told];
            if (first.step, first.share) <= order {
                return;
            }
            self.result.breaks.remove(told);
        }
        self.result.breaks.push(Break {
            limit,
            line: leg.line,
            file: leg.file,
            pose: leg.at(found.share),
            step: leg.number,
            share: found.share,
            text: self.sentence(limit, found, worst),
        });
    }

    fn sentence(&self, limit: Limit, found: &Found, worst: f64) -> String {
        if let Some(fault) = found.fault {
            return fault.to_string();
        }
        let config = self.config;
        let part = limits::part(config, limit, found.part);
        let margin = Margin { limit, part: found.part, value: f64::NAN, range: found.ends };
        let bound = limits::bound(config, &margin);
        match limit {
            Limit::Reach => format!("{part} comes too near to a dead point"),
            Limit::Conditioning if worst < 0.0 => format!(
                "the legs hardly hold the platform: conditioning {:.4} on this move (0: a singular \
                 pose), where pkmkins stops the machine at {bound}",
                worst + config.conditioning_limit
            ),
            Limit::Clearance if config.clearance.is_none() => {
                format!("{part} falls to nothing: they meet")
            }
            _ if worst < 0.0 => {
                let unit = limits::unit(config, limit, found.part);
                format!("{part} leaves its limit of {bound}, on this move by {:.4} {unit}", -worst)
            }
            _ => format!("{part} touches its limit of {bound}"),
        }
    }
}

fn earlier(first: &mut Option<Found>, found: Found) {
    if first.is_none_or(|first| found.share < first.share) {
        *first = Some(found);
    }
}

pub(super) fn length(delta: &[f64; 6]) -> f64 {
    delta[..3].iter().map(|d| d * d).sum::<f64>().sqrt()
}
