// SPDX-License-Identifier: GPL-2.0-or-later
//! The course of a program while it cuts: over time, so that every pass of a loop is visible, or along the path of its
//! feed moves if LinuxCNC cannot run it.
//!
//! A stretch has the largest values of several moments. If there are too many stretches, every two neighbors are joined
//! and from then on stretches are twice as long: memory does not grow with the duration of a program.

use linuxcnc::row::Row;
use program::timeline::Abscissa;
use serde::Serialize;

/// Largest number of stretches: more than one for each column of pixels of a plot.
const MOST: usize = 2048;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Course {
    /// Seconds from the start, or machine units along the feed moves.
    pub over: Abscissa,
    /// Abscissa of the end.
    pub end: f64,
    pub stretches: Vec<Stretch>,
    /// The positions where stability was assessed.
    pub positions: Vec<Position>,
}

/// The largest values of a stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Stretch {
    /// Abscissa of its start.
    pub at: f64,
    /// Line at its start.
    pub line: u32,
    /// Feed per tooth, mm.
    pub chip_mm: f64,
    /// Force on the tool, N.
    pub force_n: f64,
    /// Share of the capacity of the most loaded drive; none if the study has no capacity.
    pub drive_share: Option<f64>,
    /// Displacement of the tool by the mean cutting force, um.
    pub deflection_um: f64,
    /// Displacement of the tool by inertia, um; 0 without time.
    pub inertia_um: f64,
}

/// A position where stability was assessed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Position {
    pub at: f64,
    pub line: u32,
    /// Depth up to which every cut is stable, mm.
    pub stable_to_mm: f64,
    /// Amplitude of the tool's vibration under the teeth, um; none in turning.
    pub vibration_um: Option<f64>,
}

impl Stretch {
    fn join(&mut self, next: &Self) {
        self.chip_mm = self.chip_mm.max(next.chip_mm);
        self.force_n = self.force_n.max(next.force_n);
        self.drive_share =
            [self.drive_share, next.drive_share].into_iter().flatten().reduce(f64::max);
        self.deflection_um = self.deflection_um.max(next.deflection_um);
        self.inertia_um = self.inertia_um.max(next.inertia_um);
    }
}

/// Joins moments to stretches.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stretches {
    all: Vec<Stretch>,
    /// Moments of the last stretch.
    filled: u64,
    /// Halvings of the number of stretches.
    halved: u32,
}

impl Stretches {
    /// Adds the next moment.
    pub fn add(&mut self, moment: Stretch) {
        match self.all.last_mut() {
            Some(last) if self.filled < 1 << self.halved => {
                last.join(&moment);
                self.filled += 1;
                return;
            }
            _ => {}
        }
        if self.all.len() == MOST {
            let pairs = self.all.chunks(2).map(|pair| {
                let mut first = pair[0];
                pair[1..].iter().for_each(|next| first.join(next));
                first
            });
            self.all = pairs.collect();
            self.halved += 1;
        }
        self.all.push(moment);
        self.filled = 1;
    }

    /// Returns the largest feed per tooth between two abscissas, mm; `None` without a moment.
    pub fn chip_between(&self, [from, to]: [f64; 2]) -> Option<f64> {
        let first = self.all.partition_point(|stretch| stretch.at <= from).saturating_sub(1);
        let inside = self.all[first..].iter().take_while(|stretch| stretch.at < to);
        inside.map(|stretch| stretch.chip_mm).reduce(f64::max)
    }

    /// Returns the stretches, in order.
    pub fn finish(self) -> Vec<Stretch> {
        self.all
    }
}

/// The times at which LinuxCNC makes the moves of a program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clock {
    /// Number of straight moves up to the end of each command.
    ends: Vec<usize>,
    /// Begin and end of the motion of each command, s.
    times: Vec<[f64; 2]>,
    pose: [f64; 6],
}

impl Clock {
    /// Adds a command of LinuxCNC that becomes this number of straight moves.
    pub fn command(&mut self, moves: usize) {
        self.ends.push(self.ends.last().unwrap_or(&0) + moves);
    }

    /// Adds a servo cycle at a time in s.
    pub fn see(&mut self, row: &Row, at: f64) {
        if row.line > 0 && self.times.len() <= row.number {
            self.times.resize(row.number + 1, [at; 2]);
        }
        // A dwell or the end of the program does not belong to the last move.
        if let Some(last) = self.times.last_mut().filter(|_| row.pose != self.pose) {
            last[1] = at;
        }
        self.pose = row.pose;
    }

    /// Returns the times at which the command of a straight move begins and ends, s; `None` if the program is stopped
    /// before it.
    pub fn of_command(&self, step: usize) -> Option<[f64; 2]> {
        self.times.get(self.ends.partition_point(|end| *end <= step)).copied()
    }

    /// Returns the time at which a straight move ends, s; `None` if the program is stopped before it.
    pub fn end_of(&self, step: usize) -> Option<f64> {
        let [begin, end] = self.of_command(step)?;
        let command = self.ends.partition_point(|end| *end <= step);
        let first = if command > 0 { self.ends[command - 1] } else { 0 };
        let share = (step + 1 - first) as f64 / (self.ends.get(command)? - first) as f64;
        Some(begin + share * (end - begin))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_peak_is_lost_however_long_the_program_is() {
        let mut stretches = Stretches::default();
        let count = 10 * MOST;
        for n in 0..count {
            let force_n = if n == 12_345 { 7.0 } else { 1.0 };
            stretches.add(Stretch { at: n as f64, force_n, ..Stretch::default() });
        }
        let all = stretches.finish();
        assert!((MOST / 2..=MOST).contains(&all.len()), "{}", all.len());
        let peaks: Vec<&Stretch> = all.iter().filter(|stretch| stretch.force_n == 7.0).collect();
        let [peak] = peaks[..] else { panic!("{peaks:?}") };
        let next = all.iter().find(|stretch| stretch.at > peak.at).unwrap();
        assert!(peak.at <= 12_345.0 && 12_345.0 < next.at, "{peak:?} {next:?}");
        assert!(all.windows(2).all(|pair| pair[0].at < pair[1].at));
    }

    #[test]
    fn the_chip_of_a_move_is_not_that_of_its_neighbors() {
        let mut stretches = Stretches::default();
        assert_eq!(stretches.chip_between([0.0, 1.0]), None);
        for (at, chip_mm) in
            [(0.0, 5.0), (1.0, 5.0), (1.0, 2.0), (2.0, 3.0), (3.0, 7.0), (4.0, 9.0)]
        {
            stretches.add(Stretch { at, chip_mm, ..Stretch::default() });
        }
        assert_eq!(stretches.chip_between([1.0, 3.0]), Some(3.0));
        // Between two moments counts the one before.
        assert_eq!(stretches.chip_between([3.2, 3.4]), Some(7.0));
    }

    #[test]
    fn a_move_ends_where_its_motion_does() {
        let mut clock = Clock::default();
        // A line and a dwell, an arc of four straight moves, a command that LinuxCNC skips, one that runs, one that it
        // does not reach.
        [1, 4, 1, 1, 1].into_iter().for_each(|moves| clock.command(moves));
        for (number, at, x) in [
            (0, 1.0, 0.1),
            (0, 2.0, 0.2),
            (0, 3.0, 0.2),
            (1, 4.0, 0.3),
            (1, 12.0, 0.4),
            (3, 13.0, 0.5),
            (3, 14.0, 0.6),
            (3, 15.0, 0.6),
        ] {
            let pose = [x, 0.0, 0.0, 0.0, 0.0, 0.0];
            clock.see(&Row { line: 1, number, pose, ..Row::default() }, at);
        }
        let ends: Vec<Option<f64>> = (0..9).map(|step| clock.end_of(step)).collect();
        assert_eq!(ends[..7], [2.0, 6.0, 8.0, 10.0, 12.0, 13.0, 14.0].map(Some));
        assert_eq!(ends[7..], [None, None]);
    }
}
