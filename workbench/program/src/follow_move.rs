// SPDX-License-Identifier: GPL-2.0-or-later
//! Checks a move over its whole length.
//!
//! A move is straight in X Y Z A B C, angles included, for LinuxCNC's joints; if axes carry workpiece,
//! tool or legs it is a curve for the machine, which is enclosed ([`machine::proof::carried`]). A piece of it
//! is a [`machine::proof::cell::PathBounds`]: the values at its center, their slopes and a bound of their second
//! derivatives, which give their range over the piece. A piece on which a limit is not proved
//! is halved, the earlier half first, until a pose violates the limit or the piece is too
//! short to matter: then the move touches the limit. So every violated limit has a first position,
//! and a move without one is proved to satisfy all limits everywhere.

use crate::motion::{Move, extra_home};
use crate::report::{Break, Preflight, Range, Time};
use crate::work_offset::Poses;
use kinematics::{
    Cause, Fault, Letter, Limit, MAX_EXTRA, MAX_JOINTS, Margin, Part, Vector3, World,
};
use machine::limits;
use machine::proof::carried::Enclosure;
use machine::proof::cell::PathBounds;
use machine::proof::reach::Reach;
use machine::proof::spans;
use machine::read::mechanism::Mechanism;

/// Shortest piece of a move that is halved, as a share of the machine's size: far
/// below the resolution of any machine.
pub(super) const SHORTEST: f64 = 1e-6;

/// Largest number of halvings: numbers have no more digits.
pub(super) const MOST_HALVINGS: i32 = 40;

/// Accuracy of reported least margins, as a share of the limit's range.
pub(super) const ACCURACY: f64 = 0.01;

/// Accuracy of the least conditioning, whose bound is of first order.
const CONDITIONING_ACCURACY: f64 = 0.05;

/// Poses sampled on a move that violates a limit, for the size of the violation.
pub(super) const SAMPLES: usize = 33;

/// One limit of one part over a piece.
#[derive(Clone, Copy, Debug)]
struct Check {
    limit: Limit,
    part: Part,
    /// Smallest and largest value that the limit allows.
    ends: [f64; 2],
    /// Margin at the center.
    seen: f64,
    /// Proved lower bound of the margin.
    proved: f64,
    /// Range to which the margin is relative.
    range: f64,
}

impl Check {
    fn found(&self, share: f64) -> Found {
        Found { limit: self.limit, share, part: self.part, ends: self.ends, fault: None }
    }

    /// Returns whether a piece must be halved for the accuracy of the reported margins.
    fn is_coarse(&self, least: f64) -> bool {
        let accuracy =
            if self.limit == Limit::Conditioning { CONDITIONING_ACCURACY } else { ACCURACY };
        self.proved < least - accuracy * self.range && self.limit != Limit::Reach
    }
}

/// Motion of the machine along a move.
pub(super) enum Course {
    /// The machine's own pose moves straight.
    Straight { from: [f64; 6], delta: [f64; 6] },
    /// LinuxCNC's pose moves straight, and axes carry something.
    Carried { from: World, delta: World },
}

/// A move to check, straight for LinuxCNC.
pub(super) struct Leg {
    /// Number of the move.
    pub(super) number: usize,
    pub(super) line: u32,
    pub(super) file: usize,
    /// Programmed start, and values of the extra axes in the places of their letters.
    pub(super) from: World,
    pub(super) delta: World,
    pub(super) course: Course,
}

impl Leg {
    fn at(&self, share: f64) -> World {
        std::array::from_fn(|k| self.from[k] + share * self.delta[k])
    }
}

/// The first violation of a limit in a move.
#[derive(Clone, Copy)]
pub(super) struct Found {
    pub(super) limit: Limit,
    pub(super) share: f64,
    pub(super) part: Part,
    /// Smallest and largest value that the limit allows.
    pub(super) ends: [f64; 2],
    /// Why the pose there has no joint values.
    pub(super) fault: Option<Fault>,
}

impl Found {
    /// Returns whether this is the limit of this part. If one leg does not reach, nothing is known about the
    /// others: reach is a single limit.
    fn is_of(&self, limit: Limit, part: Part) -> bool {
        self.limit == limit && (limit == Limit::Reach || self.part == part)
    }
}

/// First violations of one move: one for every limit of every part.
#[derive(Default)]
struct Firsts(Vec<Found>);

impl Firsts {
    /// Returns the share of the move before the first violation.
    fn share(&self, limit: Limit, part: Part) -> Option<f64> {
        let found = self.0.iter().find(|found| found.is_of(limit, part));
        found.map(|found| found.share)
    }

    /// Adds a violation, or keeps the earlier one.
    fn note(&mut self, found: Found) {
        match self.0.iter_mut().find(|first| first.is_of(found.limit, found.part)) {
            Some(first) if !(found.share < first.share) => {}
            Some(first) => *first = found,
            None => self.0.push(found),
        }
    }
}

/// Poses of the machine: a center plus a sum of steps; `None` if a piece is too long for a bound.
type Enclosed = ([f64; 6], Option<Vec<[f64; 6]>>);

/// A least margin, with its part, line and file.
type Nearest = (f64, Part, (u32, usize));

pub(super) struct Pilot<'a> {
    pub(super) config: &'a Mechanism,
    pub(super) reach: Reach<'a>,
    pub(super) tool: Vector3<f64>,
    /// Programmed coordinates, and the values of the extra axes.
    pub(super) at: [f64; 6],
    pub(super) extra: [f64; MAX_EXTRA],
    /// Tool offset with which the spindle has turned last; `None` before its first turn.
    pub(super) spun: Option<[f64; 3]>,
    checks: Vec<Check>,
    /// Least margins so far, which determine the necessary length of pieces.
    least: [f64; Limit::ALL.len()],
    pub(super) margins: [Option<Nearest>; Limit::ALL.len()],
    axes: [[f64; 2]; 6],
    joints: [[f64; 2]; MAX_JOINTS],
    extra_axes: [[f64; 2]; MAX_EXTRA],
    pub(super) result: Preflight,
}

impl<'a> Pilot<'a> {
    pub(super) fn new(config: &'a Mechanism) -> Result<Self, Fault> {
        let extra = extra_home(config);
        Ok(Self {
            config,
            reach: Reach::new(config)?,
            tool: config.spindle,
            at: config.start,
            extra,
            spun: None,
            checks: vec![],
            least: [f64::INFINITY; Limit::ALL.len()],
            margins: [None; Limit::ALL.len()],
            axes: config.start.map(|value| [value; 2]),
            joints: [[f64::INFINITY, f64::NEG_INFINITY]; MAX_JOINTS],
            extra_axes: extra.map(|value| [value; 2]),
            result: Preflight {
                moves: 0,
                length: 0.0,
                advance: 0.0,
                pieces: 0,
                breaks: vec![],
                margins: vec![],
                ranges: vec![],
                is_whole: true,
                last: (0, 0),
                runnable: 1.0,
                time: Time::NotJudged(String::new()),
                tilted_tool_changes: vec![],
                rapids_to_zero: vec![],
                feeds_without_spindle: vec![],
                off_path: vec![],
                is_still: true,
                poses: Poses::default(),
            },
        })
    }

    pub(super) fn follow(&mut self, leg: &Leg) {
        let size = self.config.machine.size();
        let shortest = (SHORTEST * size / self.extent(leg)).clamp(0.5_f64.powi(MOST_HALVINGS), 1.0);
        let mut firsts = Firsts::default();
        if let Err((share, fault)) = self.refuse_unconnected(leg) {
            let (limit, part, ends) = (Limit::Reach, Part::Whole, [0.0, f64::INFINITY]);
            firsts.note(Found { limit, share, part, ends, fault: Some(fault) });
        }
        let mut open = vec![(0.0, 1.0)];
        while let Some((from, to)) = open.pop() {
            if !self.is_done(leg, from, to, shortest, &mut firsts) {
                let middle = (from + to) / 2.0;
                open.extend([(middle, to), (from, middle)]);
            }
        }
        if let Some(end) = firsts.share(Limit::Reach, Part::Whole) {
            // Beyond an unreachable pose nothing is known.
            firsts.0.retain(|found| found.limit == Limit::Reach || found.share < end);
        }
        if !firsts.0.is_empty() {
            let worst = self.sample(leg, &firsts);
            for (found, worst) in firsts.0.iter().zip(worst) {
                self.report(leg, found, worst);
            }
        }
    }

    /// Proves that the platform is connected with home along the whole move.
    fn refuse_unconnected(&self, leg: &Leg) -> Result<(), (f64, Fault)> {
        self.reach.refuse_unconnected(|middle, half| {
            let (middle, steps) = self.enclosed(leg, middle, half)?;
            Ok(steps.map(|steps| (middle, steps)))
        })?;
        match &leg.course {
            Course::Straight { .. } => Ok(()),
            Course::Carried { from, delta } => {
                self.reach.refuse_unconnected_tip(from, delta, &self.tool)
            }
        }
    }

    /// Returns the weight of a move in the program's length.
    pub(super) fn advance(&self, leg: &Leg) -> f64 {
        advance(&leg.delta, arm(self.config))
    }

    /// Estimates the machine's displacement, with angles multiplied by half of its size.
    fn extent(&self, leg: &Leg) -> f64 {
        let arm = arm(self.config);
        match &leg.course {
            Course::Straight { delta, .. } => advance(&padded(delta), arm),
            Course::Carried { .. } => {
                self.enclosure(leg, 0.5, 0.5).map_or(f64::INFINITY, |whole| {
                    whole.extent(arm).unwrap_or_else(|| self.advance(leg))
                })
            }
        }
    }

    /// Bounds the machine's motion over a piece.
    fn bounds(&self, leg: &Leg, middle: f64, half: f64) -> Result<PathBounds, Fault> {
        let (middle, steps) = self.enclosed(leg, middle, half)?;
        self.reach.bounds_within(&middle, steps.as_deref())
    }

    /// Encloses the machine's poses over a piece.
    fn enclosed(&self, leg: &Leg, middle: f64, half: f64) -> Result<Enclosed, Fault> {
        match &leg.course {
            Course::Straight { from, delta } => {
                let pose = std::array::from_fn(|k| from[k] + middle * delta[k]);
                Ok((pose, Some(vec![delta.map(|d| d * half)])))
            }
            Course::Carried { .. } => {
                let Enclosure { middle, steps } = self.enclosure(leg, middle, half)?;
                Ok((middle, steps.map(|steps| steps.to_vec())))
            }
        }
    }

    /// Encloses the machine's poses over a piece of a move with axes that carry something.
    fn enclosure(&self, leg: &Leg, middle: f64, half: f64) -> Result<Enclosure, Fault> {
        let (from, delta) = match &leg.course {
            Course::Carried { from, delta } => (*from, *delta),
            Course::Straight { .. } => (leg.from, [0.0; 9]),
        };
        let world = std::array::from_fn(|k| from[k] + middle * delta[k]);
        self.reach.enclosure(&world, &delta.map(|d| d * half), &self.tool)
    }

    /// Returns whether a piece needs no halving; adds violations to `firsts`.
    fn is_done(
        &mut self,
        leg: &Leg,
        from: f64,
        to: f64,
        shortest: f64,
        firsts: &mut Firsts,
    ) -> bool {
        let unreached = firsts.share(Limit::Reach, Part::Whole);
        if unreached.is_some_and(|share| share <= from) {
            // Beyond an unreachable pose nothing is known.
            return true;
        }
        self.result.pieces += 1;
        let (middle, half) = ((from + to) / 2.0, (to - from) / 2.0);
        let is_short = to - from <= shortest;
        let bounds = match self.bounds(leg, middle, half) {
            Ok(bounds) => bounds,
            Err(fault) => {
                let (limit, ends) = (Limit::Reach, [0.0, f64::INFINITY]);
                let (share, part, fault) = (middle, Part::Whole, Some(fault));
                firsts.note(Found { limit, share, part, ends, fault });
                return is_short;
            }
        };
        self.weigh(&bounds);
        let checks = std::mem::take(&mut self.checks);
        let mut done = true;
        for check in &checks {
            done &= self.is_settled(check, [from, middle], is_short, firsts);
        }
        if done {
            for check in &checks {
                let first = firsts.share(check.limit, check.part);
                if first.is_none_or(|share| share > from) {
                    self.close(check, leg);
                }
            }
            self.widen(&bounds);
        }
        self.checks = checks;
        done
    }

    /// Returns whether a limit needs no halving of a piece, which begins and has its center at these shares.
    fn is_settled(
        &self,
        check: &Check,
        [from, middle]: [f64; 2],
        is_short: bool,
        firsts: &mut Firsts,
    ) -> bool {
        if check.seen < 0.0 {
            firsts.note(check.found(middle));
        }
        if firsts.share(check.limit, check.part).is_some_and(|share| share <= from) {
            return true;
        }
        let fails = check.proved < 0.0;
        // If nothing is known, reach is the violated limit.
        if fails && is_short && check.proved.is_finite() {
            firsts.note(check.found(from));
        }
        let least = self.least[check.limit.index()].min(check.seen);
        is_short || !(fails || check.is_coarse(least))
    }

    /// Records the margin of a piece that is not halved.
    fn close(&mut self, check: &Check, leg: &Leg) {
        let kind = check.limit.index();
        self.least[kind] = self.least[kind].min(check.seen);
        if check.limit != Limit::Reach && check.proved.is_finite() {
            self.note(check.limit, check.proved.min(check.seen), check.part, leg);
        }
    }

    /// Computes the margins of all limits over a piece, into `checks`.
    fn weigh(&mut self, bounds: &PathBounds) {
        self.checks.clear();
        self.checks.extend(bounds.spans.iter().map(|span| Check {
            limit: span.margin.limit,
            part: span.margin.part,
            ends: span.margin.range,
            seen: span.margin.room(),
            proved: span.room(),
            range: span.margin.scale(),
        }));
        let unknown = bounds.joints.iter().position(|course| !course.second_derivative.is_finite());
        let (limit, ends) = (Limit::Reach, [0.0, f64::INFINITY]);
        let (part, proved) = match unknown {
            _ if !bounds.is_determined => (Part::Whole, -1.0),
            Some(i) => (Part::Joint(i), -1.0),
            None => (Part::Whole, 1.0),
        };
        self.checks.push(Check { limit, part, ends, seen: 1.0, proved, range: 1.0 });
    }

    /// Extends the ranges of the joints to first order, which is accurate enough for the short pieces.
    fn widen(&mut self, bounds: &PathBounds) {
        for (range, spans::Course { middle, slope, .. }) in
            self.joints.iter_mut().zip(&bounds.joints)
        {
            *range = [range[0].min(middle - slope), range[1].max(middle + slope)];
        }
    }

    /// Extends the used ranges of the axes by a straight move.
    pub(super) fn widen_axes(&mut self, step: &Move) {
        let extra = self.extra_axes.iter_mut().zip(&step.extra_end);
        for (range, value) in self.axes.iter_mut().zip(&step.end).chain(extra) {
            *range = [range[0].min(*value), range[1].max(*value)];
        }
    }

    /// Returns the used ranges of the axes and joints.
    pub(super) fn ranges(&self) -> Vec<Range> {
        let config = self.config;
        let axes = Letter::ALL.into_iter().zip(&config.programmed).zip(self.axes);
        let axes = axes.filter(|((letter, _), _)| !config.machine.layout().is_held(*letter)).map(
            |((letter, axis), used)| {
                Range::of(config, Limit::Axis, Part::Axis(letter), used, [axis.min, axis.max])
            },
        );
        let extra = self.extra_axes.into_iter().take(config.extra.len());
        let joints = self.joints.into_iter().take(config.joints.len()).chain(extra).enumerate();
        let joints = joints.map(|(i, used)| {
            Range::of(config, Limit::JointRange, Part::Joint(i), used, config.range_of(i))
        });
        axes.chain(joints).collect()
    }

    pub(super) fn note(&mut self, limit: Limit, value: f64, part: Part, leg: &Leg) {
        let margin = &mut self.margins[limit.index()];
        if margin.is_none_or(|(least, ..)| value < least) {
            *margin = Some((value, part, (leg.line, leg.file)));
        }
    }

    /// Samples the least margins of a move, in the order of `firsts`.
    fn sample(&mut self, leg: &Leg, firsts: &Firsts) -> Vec<f64> {
        let mut worst = vec![f64::INFINITY; firsts.0.len()];
        let half = 0.5 / SAMPLES as f64;
        // Both ends, and pieces that together cover the move without exceeding its ends.
        let pieces = (0..SAMPLES).map(|n| ((2 * n + 1) as f64 * half, half));
        for (middle, half) in pieces.chain([(0.0, 0.0), (1.0, 0.0)]) {
            let Ok(bounds) = self.bounds(leg, middle, half) else { continue };
            self.widen(&bounds);
            self.weigh(&bounds);
            for check in std::mem::take(&mut self.checks) {
                let of = |found: &Found| found.is_of(check.limit, check.part);
                if let Some(n) = firsts.0.iter().position(of) {
                    worst[n] = worst[n].min(check.seen);
                }
                if check.seen < 0.0 {
                    self.note(check.limit, check.seen, check.part, leg);
                }
            }
        }
        worst
    }

    /// Records a violation; `worst` is the least margin of the move.
    pub(super) fn report(&mut self, leg: &Leg, found: &Found, worst: f64) {
        let part = limits::part(self.config, found.limit, found.part);
        let is_reach = found.limit == Limit::Reach;
        let of = |message: &&mut Break| {
            message.limit == found.limit && (is_reach || message.part == part)
        };
        if let Some(message) = self.result.breaks.iter_mut().find(of) {
            // Moves are in program order; a tool change precedes its move.
            message.moves += usize::from(message.last != leg.number);
            message.last = leg.number;
            return;
        }
        let world = leg.at(found.share);
        self.result.breaks.push(Break {
            limit: found.limit.into(),
            part,
            line: leg.line,
            file: leg.file,
            pose: std::array::from_fn(|k| world[k]),
            words: self.config.words(&world),
            of_second: false,
            seconds: None,
            moves: 1,
            step: leg.number,
            share: found.share,
            last: leg.number,
            before: self.result.advance + found.share * self.advance(leg),
            text: self.sentence(found, worst),
        });
    }

    fn sentence(&self, found: &Found, worst: f64) -> String {
        let limit = found.limit;
        if let Some(fault) = found.fault {
            return fault.to_string();
        }
        let config = self.config;
        let part = limits::part(config, limit, found.part);
        let margin = Margin { limit, part: found.part, value: f64::NAN, range: found.ends };
        let bound = limits::bound(config, &margin);
        match limit {
            // The only reason that is not of a joint.
            Limit::Reach if found.part == Part::Whole => {
                Fault::from(Cause::ConstraintSingular).to_string()
            }
            Limit::Reach => format!("{part} comes too close to a dead point"),
            Limit::Conditioning if worst < 0.0 => format!(
                "the move is near a singularity: conditioning {:.4} (0: singular); pkmkins stops the \
                 machine at {bound}",
                worst + config.conditioning_limit
            ),
            Limit::Clearance if config.clearance.is_none() => {
                format!("{part} becomes 0: they meet")
            }
            _ if worst < 0.0 => {
                let unit = limits::unit(config, limit, found.part);
                format!("{part} violates its limit of {bound} on this move by {:.4} {unit}", -worst)
            }
            _ => format!("{part} reaches its limit of {bound}"),
        }
    }
}

/// Returns the arm at which angles count: half of the machine's size.
pub(super) fn arm(config: &Mechanism) -> f64 {
    config.machine.size() / 2.0
}

/// Estimates the displacement of a body that also rotates: its angles are multiplied by `arm`. That of slides is added.
pub(super) fn advance(delta: &World, arm: f64) -> f64 {
    let turn: f64 = delta[3..6].iter().map(|d| d.abs().to_radians()).sum();
    length(&delta[..3]) + length(&delta[6..]) + turn * arm
}

/// Returns a motion without extra axes.
pub(super) fn padded(delta: &[f64; 6]) -> World {
    std::array::from_fn(|k| delta.get(k).copied().unwrap_or(0.0))
}

pub(super) fn length(delta: &[f64]) -> f64 {
    delta.iter().map(|d| d * d).sum::<f64>().sqrt()
}
