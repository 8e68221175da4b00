// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs of two mechanisms: each is checked separately, then the distance between them.
//!
//! Both traverse a move simultaneously, so their distance is checked like that of two legs of
//! one machine: a piece whose distance is not proved is halved, the earlier half first. A tool offset that
//! changes while a platform is tilted moves that platform along a line, which is checked as a move. If
//! both change in one block their order is unknown, and only the end is judged.

use crate::follow_move::{ACCURACY, MOST_HALVINGS, SAMPLES, SHORTEST, advance, arm, padded};
use crate::motion::Move;
use crate::move_sequence::Flight;
use crate::report::{Break, LeastMargin, Preflight, Rule};
use kinematics::{Body, Fault, Part, Pose, Vector3};
use machine::limits;
use machine::proof::between::{Approach, approach};
use machine::proof::reach::Reach;
use machine::read::mechanism::Mechanism;

/// Checks the moves of a program with every mechanism of a machine.
pub struct Flights<'a> {
    flights: Vec<Flight<'a>>,
    between: Option<Between<'a>>,
}

impl<'a> Flights<'a> {
    /// Creates the state before the first move.
    ///
    /// # Errors
    /// A spindle offset without a legal pose at home.
    pub fn new(mechanisms: &'a [Mechanism]) -> Result<Self, Fault> {
        Ok(Self {
            flights: mechanisms.iter().map(Flight::new).collect::<Result<_, _>>()?,
            between: Between::of(mechanisms)?,
        })
    }

    /// Starts at the end of a move.
    ///
    /// # Errors
    /// A tool without a legal pose at home.
    pub fn standing(mechanisms: &'a [Mechanism], end: &Move) -> Result<Self, Fault> {
        let ends = mechanisms.iter().zip(end.of_each());
        let flights = ends.map(|(mechanism, end)| Flight::standing(mechanism, &end));
        let mut between = Between::of(mechanisms)?;
        between.iter_mut().for_each(|between| between.stand(end));
        Ok(Self { flights: flights.collect::<Result<_, _>>()?, between })
    }

    /// Checks the next move.
    pub fn see(&mut self, step: &Move) {
        self.between.iter_mut().for_each(|between| between.see(step));
        self.flights.iter_mut().zip(step.of_each()).for_each(|(flight, step)| flight.see(&step));
    }

    /// Returns the result after the last move, see [`Flight::finish`].
    ///
    /// # Errors
    /// A tool vector without a legal pose at home.
    pub fn finish(self) -> Result<Preflight, Fault> {
        let each = self.flights.into_iter().map(Flight::finish).collect::<Result<Vec<_>, _>>()?;
        let all = each.into_iter().reduce(Preflight::with_second);
        let mut found = all.expect("a machine has a mechanism");
        self.between.map_or(Ok(()), |between| between.finish(&mut found))?;
        Ok(found)
    }
}

impl Preflight {
    /// Adds the results of the second mechanism in the same moves.
    fn with_second(mut self, second: Self) -> Self {
        self.pieces += second.pieces;
        self.is_still &= second.is_still;
        self.runnable = self.runnable.min(second.runnable);
        self.advance += second.advance;
        self.ranges.extend(second.ranges);
        self.margins.extend(second.margins);
        self.breaks
            .extend(second.breaks.into_iter().map(|message| Break { of_second: true, ..message }));
        for (known, new) in [
            (&mut self.rapids_to_zero, second.rapids_to_zero),
            (&mut self.tilted_tool_changes, second.tilted_tool_changes),
            (&mut self.feeds_without_spindle, second.feeds_without_spindle),
        ] {
            known
                .extend(new.into_iter().filter(|place| !known.contains(place)).collect::<Vec<_>>());
        }
        self
    }
}

/// The distance of two mechanisms.
struct Between<'a> {
    configs: [&'a Mechanism; 2],
    reaches: [Reach<'a>; 2],
    tools: [Vector3<f64>; 2],
    at: [[f64; 6]; 2],
    /// Required distance.
    clearance: f64,
    number: usize,
    /// Length of the first one's path, with its angles multiplied by half of its size.
    advance: f64,
    /// Least distance beyond the clearance, with its parts and line.
    least: Option<(f64, [Body; 2], (u32, usize))>,
    /// Least distance at the center of a piece, less the clearance: an upper bound of the least one.
    nearest: f64,
    broken: Option<Break>,
    fault: Option<Fault>,
}

/// A move of both.
struct Leg<'a> {
    step: &'a Move,
    from: [[f64; 6]; 2],
    delta: [[f64; 6]; 2],
    /// Occasion of the move, for messages.
    when: &'static str,
}

impl Leg<'_> {
    fn at(&self, share: f64) -> [[f64; 6]; 2] {
        [0, 1].map(|i| std::array::from_fn(|k| self.from[i][k] + share * self.delta[i][k]))
    }
}

impl<'a> Between<'a> {
    /// Creates the check; `None` for a single mechanism.
    fn of(mechanisms: &'a [Mechanism]) -> Result<Option<Self>, Fault> {
        let [first, second] = mechanisms else { return Ok(None) };
        let configs = [first, second];
        Ok(Some(Self {
            configs,
            reaches: [Reach::new(first)?, Reach::new(second)?],
            tools: configs.map(|config| config.spindle),
            at: configs.map(|config| config.home),
            clearance: limits::least_distance_between(configs[0]),
            number: 0,
            advance: 0.0,
            least: None,
            nearest: f64::INFINITY,
            broken: None,
            fault: None,
        }))
    }

    /// Moves both to the end of a move.
    fn stand(&mut self, end: &Move) {
        let Some(beside) = end.second else { return };
        self.change_tools([end.tool, beside.tool]);
        self.at = [end.end, beside.end];
    }

    fn see(&mut self, step: &Move) {
        let Some(beside) = step.second.filter(|_| self.fault.is_none()) else { return };
        self.follow_tools(step, [step.tool, beside.tool]);
        self.change_tools([step.tool, beside.tool]);
        if self.fault.is_some() {
            return;
        }
        let ends = [step.end, beside.end];
        let delta = [0, 1].map(|i| std::array::from_fn(|k| ends[i][k] - self.at[i][k]));
        self.follow(&Leg { step, from: self.at, delta, when: "on this move" });
        self.advance += advance(&padded(&delta[0]), arm(self.configs[0]));
        self.at = ends;
        self.number += 1;
    }

    /// Checks the platform motion due to another tool offset. With the tip at t the platform is at t − o + R o: if o
    /// changes by d, it moves by (R − 1) d, as it would by that move with the old tool.
    fn follow_tools(&mut self, step: &Move, tools: [[f64; 3]; 2]) {
        let shift = |i: usize| {
            let change = self.configs[i].spindle + Vector3::from(tools[i]) - self.tools[i];
            Pose::from_degrees(self.at[i]).rotation() * change - change
        };
        let shifts = [shift(0), shift(1)];
        let is_moved = shifts.map(|shift| shift.norm() > SHORTEST * self.configs[0].machine.size());
        if is_moved[0] != is_moved[1] {
            let delta = shifts.map(|shift| [shift.x, shift.y, shift.z, 0.0, 0.0, 0.0]);
            let when = "as the tool offset changes before this move";
            self.follow(&Leg { step, from: self.at, delta, when });
        }
    }

    fn change_tools(&mut self, tools: [[f64; 3]; 2]) {
        for i in 0..2 {
            let tool = self.configs[i].spindle + Vector3::from(tools[i]);
            if tool != self.tools[i] {
                self.tools[i] = tool;
                match Reach::with_tool(self.configs[i], tool) {
                    Ok(reach) => self.reaches[i] = reach,
                    Err(fault) => return self.fault = Some(self.configs[i].place.counted(fault)),
                }
            }
        }
    }

    fn follow(&mut self, leg: &Leg) {
        let size = self.configs[0].machine.size();
        let extent =
            leg.delta.iter().map(|d| advance(&padded(d), arm(self.configs[0]))).sum::<f64>();
        let shortest = (SHORTEST * size / extent).clamp(0.5_f64.powi(MOST_HALVINGS), 1.0);
        let mut first: Option<(f64, [Body; 2])> = None;
        let mut open = vec![(0.0, 1.0)];
        while let Some((from, to)) = open.pop() {
            if first.is_some_and(|(share, _)| share <= from) {
                continue;
            }
            let (middle, half) = ((from + to) / 2.0, (to - from) / 2.0);
            // A pose that is not legal is reported by its own mechanism.
            let Some(found) = self.approach(leg, middle, half) else { continue };
            let [seen, proved] = [found.distance, found.least].map(|d| d - self.clearance);
            let note = |share: f64, first: &mut Option<(f64, [Body; 2])>| {
                if first.is_none_or(|(known, _)| share < known) {
                    *first = Some((share, found.bodies));
                }
            };
            let is_short = to - from <= shortest;
            if seen < 0.0 {
                note(middle, &mut first);
            }
            if proved < 0.0 && is_short && proved.is_finite() {
                note(from, &mut first);
            }
            self.nearest = self.nearest.min(seen);
            let is_coarse = proved < self.nearest - ACCURACY * (self.nearest + self.clearance);
            if !is_short && (proved < 0.0 || is_coarse) {
                open.extend([(middle, to), (from, middle)]);
            } else if proved.is_finite() && self.least.is_none_or(|(least, ..)| proved < least) {
                self.least = Some((proved.min(seen), found.bodies, (leg.step.line, leg.step.file)));
            }
        }
        if let Some((share, bodies)) = first {
            self.report(leg, share, bodies);
        }
    }

    fn approach(&self, leg: &Leg, middle: f64, half: f64) -> Option<Approach> {
        let [one, other] = &self.reaches;
        let poses = leg.at(middle);
        let steps = leg.delta.map(|delta| delta.map(|d| d * half));
        let least = self.least.map_or(0.0, |(least, ..)| least.max(0.0));
        // A distance beyond the reported one does not matter.
        let enough = if half > 0.0 { self.clearance + least } else { f64::NEG_INFINITY };
        approach([one, other], [&poses[0], &poses[1]], [&steps[0], &steps[1]], enough).ok()
    }

    fn report(&mut self, leg: &Leg, share: f64, bodies: [Body; 2]) {
        if let Some(message) = &mut self.broken {
            message.moves += 1;
            return;
        }
        let seen = (0..=SAMPLES).filter_map(|n| {
            self.approach(leg, n as f64 / SAMPLES as f64, 0.0).map(|found| found.distance)
        });
        let worst = seen.fold(f64::INFINITY, f64::min) - self.clearance;
        let (part, unit) = (self.part(bodies), self.configs[0].length_unit());
        let text = match (self.configs[0].mechanism_clearance, worst < 0.0) {
            (None, _) => format!("{part} becomes 0: they meet"),
            (Some(limit), true) => {
                let when = leg.when;
                format!(
                    "{part} violates its limit of {limit} {unit} {when} by {:.4} {unit}",
                    -worst
                )
            }
            (Some(limit), false) => format!("{part} reaches its limit of {limit} {unit}"),
        };
        self.broken = Some(Break {
            limit: Rule::Mechanisms,
            part,
            line: leg.step.line,
            file: leg.step.file,
            pose: leg.at(share)[0],
            words: self.words(leg, share),
            of_second: false,
            seconds: None,
            moves: 1,
            step: self.number,
            share,
            last: self.number,
            before: self.advance + share * advance(&padded(&leg.delta[0]), arm(self.configs[0])),
            text,
        });
    }

    /// Returns the words of both mechanisms in a move, with the extra axes at its end.
    fn words(&self, leg: &Leg, share: f64) -> Vec<(char, f64)> {
        let words = self
            .configs
            .iter()
            .zip(leg.at(share))
            .flat_map(|(config, pose)| config.words(&config.world(&pose, &leg.step.extra_end)));
        words.collect()
    }

    fn part(&self, bodies: [Body; 2]) -> String {
        limits::between(self.configs, bodies)
    }

    fn finish(self, found: &mut Preflight) -> Result<(), Fault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        if let Some((value, bodies, (line, file))) = self.least {
            found.margins.push(LeastMargin {
                limit: Rule::Mechanisms,
                value,
                unit: self.configs[0].length_unit().into(),
                part: self.part(bodies),
                of: Part::Whole,
                line,
                file,
            });
        }
        if let Some(message) = self.broken {
            let share = if self.advance > 0.0 { message.before / self.advance } else { 0.0 };
            found.runnable = found.runnable.min(share);
            found.breaks.push(message);
        }
        found.breaks.sort_by(|a, b| a.step.cmp(&b.step).then(a.share.total_cmp(&b.share)));
        Ok(())
    }
}
