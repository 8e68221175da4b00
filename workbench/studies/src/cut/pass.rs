// SPDX-License-Identifier: GPL-2.0-or-later
//! One pass over the servo cycles of a program.
//!
//! Of every few cycles of a line, the one with the largest acceleration is assessed, with the largest
//! speed among them. Memory grows with the lines of the program, not with its cycles.

use crate::cut::course::{Stretch, Stretches};
use crate::cut::moment::{Judged, Moment, NoMoment, Subject};
use crate::cut::program::{Line, cuts, length, stance};
use crate::cut::stance::Stance;
use kinematics::{Fault, Vector3};
use linuxcnc::row::{Commanded, Row};
use machine::read::mechanism::Mechanism;
use program::motion::Move;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// um per mm.
pub const UM: f64 = 1e3;

/// Cycles of which one is assessed.
pub const WINDOW: u64 = 10;

/// Moments that are assessed together.
const BATCH: usize = 1024;

/// A row faster than the programmed feed by this factor belongs to a rapid move: LinuxCNC keeps
/// a feed per minute to rounding. One per turn follows the measured speed of the spindle, not S exactly: such a
/// move cuts throughout.
const FASTER: f64 = 1.001;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct OfLine {
    pub cycles: u64,
    /// Largest feed per tooth, mm.
    pub chip: f64,
    /// Largest force on the tool, N.
    pub force: f64,
    /// The drive with the largest share of its capacity, and the share.
    pub drive: Option<(usize, f64)>,
    /// Abscissa of that share.
    pub at: f64,
    /// Largest deflection by the mean cutting force, mm.
    pub deflection: f64,
    /// Largest deflection by inertia, mm.
    pub lag: f64,
}

/// A maximum, and its moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Peak {
    pub value: f64,
    /// The moment.
    pub judged: Judged,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    pub lines: BTreeMap<u32, OfLine>,
    /// Largest feed per tooth, force on the tool, deflection, lag by inertia.
    pub peaks: [Option<Peak>; 4],
    /// For each drive, the load of largest magnitude, and its moment.
    pub drives: Vec<Option<Peak>>,
    /// Cycles in which the program cuts.
    pub cutting: u64,
    /// Number of assessed moments.
    pub judged: u64,
    /// The moments in order.
    pub stretches: Stretches,
}

/// Processes rows.
pub struct Pass<'a> {
    subject: &'a Subject<'a>,
    program: &'a BTreeMap<u32, Line>,
    /// The last two rows, if they are consecutive.
    before: Vec<Row>,
    /// Moment of the window, its acceleration, and cycles of the window.
    window: Option<(Moment, f64, u64)>,
    batch: Vec<Moment>,
    /// For each command, whether the spindle sets its feed.
    per_turn: Vec<bool>,
    found: Found,
}

impl<'a> Pass<'a> {
    /// Creates a pass before the first row.
    pub fn new(subject: &'a Subject<'a>, program: &'a BTreeMap<u32, Line>) -> Self {
        let found = Found { drives: vec![None; subject.drives.len()], ..Found::default() };
        Self {
            subject,
            program,
            before: vec![],
            window: None,
            batch: vec![],
            per_turn: vec![],
            found,
        }
    }

    /// Processes the command of the next move.
    pub fn command(&mut self, commanded: &Commanded) {
        self.per_turn.push(commanded.is_per_turn);
    }

    /// Processes the row of a servo cycle.
    ///
    /// # Errors
    /// A moment that cannot be assessed, with its line.
    pub fn see(&mut self, row: &Row) -> Result<(), (u32, NoMoment)> {
        let follows = |last: &Row| last.cycle + 1 == row.cycle && last.tool == row.tool;
        if !row.flags.on || row.flags.tool_busy || !self.before.last().is_none_or(follows) {
            self.before.clear();
        }
        if row.flags.on && !row.flags.tool_busy {
            self.before.push(*row);
        }
        let [a, b, c] = self.before[..] else { return Ok(()) };
        self.before.remove(0);
        self.take([&a, &b, &c])
    }

    fn take(&mut self, rows: [&Row; 3]) -> Result<(), (u32, NoMoment)> {
        let config = self.subject.config;
        let moment = self.moment(rows).map_err(|fault| (rows[1].line, fault.into()))?;
        let acceleration = acceleration(config, &moment.poses);
        let line = self.found.lines.entry(moment.line).or_default();
        line.cycles += 1;
        self.found.cutting += u64::from(moment.rpm.is_some());
        let belongs = |(own, _, cycles): &(Moment, f64, u64)| {
            own.line == moment.line && own.rpm == moment.rpm && *cycles < WINDOW
        };
        if !self.window.as_ref().is_some_and(belongs) {
            self.close()?;
        }
        match &mut self.window {
            None => self.window = Some((moment, acceleration, 1)),
            Some((own, most, cycles)) => {
                let speed = own.speed.max(moment.speed);
                if acceleration > *most {
                    (*own, *most) = (moment, acceleration);
                }
                own.speed = speed;
                *cycles += 1;
            }
        }
        Ok(())
    }

    fn moment(&self, rows: [&Row; 3]) -> Result<Moment, Fault> {
        let config = self.subject.config;
        let [from, row, to] = rows;
        let stance =
            |row: &Row| Stance::at(config, &row.pose, &row.extra.world, &Vector3::from(row.tool));
        let now = stance(row)?;
        // The motion of the platform alone has inertia: the tool is the same in all three.
        let poses = match config.chain.is_bare() {
            true => [
                stance(from)?.with_tool_of(&now).pose,
                now.pose,
                stance(to)?.with_tool_of(&now).pose,
            ],
            false => [stance(from)?.pose, now.pose, stance(to)?.pose],
        };
        let feed = Vector3::from_fn(|k, _| to.pose[k] - from.pose[k]);
        let rate = feed.norm() / (2.0 * config.period);
        let moves = from.pose != to.pose;
        let line = self.program.get(&row.line);
        let is_per_turn = self.per_turn.get(row.number) == Some(&true);
        let cuts = line.filter(|line| moves && (is_per_turn || rate <= line.feed * FASTER));
        Ok(Moment {
            line: row.line,
            at: row.cycle as f64 * config.period,
            programmed: row.pose,
            poses,
            tool: now.tool,
            rotation: now.rotation,
            speed: rate.min(line.map_or(rate, |line| line.feed)) / config.units_per_mm,
            feed: now.work * feed,
            rpm: cuts.map(|line| line.rpm),
        })
    }

    fn close(&mut self) -> Result<(), (u32, NoMoment)> {
        self.batch.extend(self.window.take().map(|(moment, _, _)| moment));
        if self.batch.len() >= BATCH { self.judge() } else { Ok(()) }
    }

    fn judge(&mut self) -> Result<(), (u32, NoMoment)> {
        let subject = self.subject;
        let judge = |moment: &Moment| subject.judge(moment).map_err(|error| (moment.line, error));
        let all: Vec<Judged> = self.batch.par_iter().map(judge).collect::<Result<_, _>>()?;
        self.batch.clear();
        all.iter().for_each(|judged| self.found.add(subject, judged));
        Ok(())
    }

    /// Returns all results, after the last row.
    ///
    /// # Errors
    /// As [`Pass::see`].
    pub fn finish(mut self) -> Result<Found, (u32, NoMoment)> {
        self.close()?;
        self.judge()?;
        Ok(self.found)
    }

    /// Assesses the starts and ends of the feed moves at their feeds, without inertia, for programs that
    /// LinuxCNC cannot run.
    ///
    /// # Errors
    /// As [`Pass::see`].
    pub fn of_moves(mut self, moves: &[Move]) -> Result<Found, (u32, NoMoment)> {
        let config = self.subject.config;
        let mut gone = 0.0;
        for [from, step] in cuts(moves) {
            let start = gone;
            gone += length([from, step]);
            let Some(line) = self.program.get(&step.line) else { continue };
            let feed = Vector3::from_fn(|k, _| step.end[k] - from.end[k]);
            // A move of rotary axes alone has no linear feed, and feed per revolution is unknown here.
            let is_known = feed.norm() > 0.0 && step.feed.is_finite();
            // A move starts with its own tool offset.
            let start_of = Move { end: from.end, extra_end: from.extra_end, ..*step };
            for (at, step) in [(start, &start_of), (gone, step)] {
                let stance = stance(config, step).map_err(|fault| (step.line, fault.into()))?;
                self.batch.push(Moment {
                    line: step.line,
                    at,
                    programmed: step.end,
                    poses: [stance.pose; 3],
                    tool: stance.tool,
                    rotation: stance.rotation,
                    speed: if is_known { step.feed / config.units_per_mm } else { 0.0 },
                    feed: stance.work * feed,
                    rpm: Some(line.rpm),
                });
            }
            if self.batch.len() >= BATCH {
                self.judge()?;
            }
        }
        self.finish()
    }
}

/// Returns the largest coordinate acceleration as a share of the machine's limit.
fn acceleration(config: &Mechanism, [a, b, c]: &[[f64; 6]; 3]) -> f64 {
    let share = |k: usize| {
        let limits = config.max_acceleration;
        (a[k] - 2.0 * b[k] + c[k]).abs() / limits[k / 3]
    };
    (0..6).map(share).fold(0.0, f64::max)
}

impl Found {
    fn add(&mut self, subject: &Subject, judged: &Judged) {
        self.judged += 1;
        // A rapid move produces no surface.
        let lag = judged.chip.map_or(0.0, |_| judged.lag.norm());
        let (chip, deflection) = (judged.chip.unwrap_or_default(), judged.deflection.norm());
        let line = self.lines.entry(judged.line).or_default();
        line.chip = line.chip.max(chip);
        line.force = line.force.max(judged.force);
        line.deflection = line.deflection.max(deflection);
        line.lag = line.lag.max(lag);
        let hardest = subject.hardest(&judged.drives);
        if let Some((drive, share)) = hardest
            && line.drive.is_none_or(|(_, most)| share > most)
        {
            (line.drive, line.at) = (Some((drive, share)), judged.at);
        }
        self.stretches.add(Stretch {
            at: judged.at,
            line: judged.line,
            chip_mm: chip,
            force_n: judged.force,
            drive_share: hardest.map(|(_, share)| share),
            deflection_um: deflection * UM,
            inertia_um: lag * UM,
        });
        let values = [chip, judged.force, deflection, lag];
        for (peak, value) in self.peaks.iter_mut().zip(values) {
            note(peak, value, judged);
        }
        for (peak, [low, high]) in self.drives.iter_mut().zip(&judged.drives) {
            note(peak, if low.abs() > high.abs() { *low } else { *high }, judged);
        }
    }
}

fn note(peak: &mut Option<Peak>, value: f64, judged: &Judged) {
    if peak.as_ref().is_none_or(|peak| value.abs() > peak.value.abs()) {
        *peak = Some(Peak { value, judged: judged.clone() });
    }
}
