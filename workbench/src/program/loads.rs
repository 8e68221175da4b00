// SPDX-License-Identifier: GPL-2.0-or-later
//! What a program asks of the joints, from LinuxCNC's own servo cycles: speeds, accelerations,
//! following errors, ranges, and the feed that every line leaves room for.
//!
//! Rows come one after the other and are forgotten again; what is kept grows with the lines of the
//! program, not with its cycles. A speed is the difference of two commands over the period, an
//! acceleration that of two speeds. Cycles in which pkmkins moves the joints for another tool
//! offset are no speed of the program, neither are those with the drives off.

use crate::control::row::Row;
use crate::program::findings::{LineLoad, Peak, Place, Range};
use crate::read::joints::Joint;
use crate::read::machine::MachineConfig;
use kinematics::{Joints, Letter, Limit, MAX_JOINTS, Part};
use std::collections::{BTreeMap, VecDeque};

/// Cycles left out before and after those in which the tool offset moves: LinuxCNC's interpolator of
/// joints answers two cycles late and over three.
const AROUND_TOOL_OFFSETS: u64 = 5;

/// Where a joint first goes beyond its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// The place.
    pub place: Place,
    /// How often a line goes beyond it: lines, where none comes twice.
    pub lines: usize,
}

/// Values of one kind of every joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// By joint: where the share of the limit is largest.
    pub peaks: Vec<Peak>,
    /// By joint: where its limit is left, if it is.
    pub beyond: Vec<Option<Beyond>>,
    /// By joint: the last line that was beyond it.
    last: Vec<Option<u32>>,
}

impl Load {
    fn new(joints: &[Joint], limit: impl Fn(&Joint) -> f64) -> Self {
        let peak = |joint: &Joint| Peak {
            joint: joint.name.clone(),
            value: 0.0,
            limit: limit(joint),
            place: Place::default(),
        };
        Self {
            peaks: joints.iter().map(peak).collect(),
            beyond: vec![None; joints.len()],
            last: vec![None; joints.len()],
        }
    }

    fn note(&mut self, joint: usize, value: f64, limit: f64, place: &Place) {
        let peak = &mut self.peaks[joint];
        if value / limit > peak.share() {
            (peak.value, peak.limit, peak.place) = (value, limit, *place);
        }
        if value > limit {
            let beyond = self.beyond[joint].get_or_insert(Beyond { place: *place, lines: 0 });
            if self.last[joint].replace(place.line) != Some(place.line) {
                beyond.lines += 1;
            }
        }
    }
}

/// What a program asks of the joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Demands {
    /// Speeds.
    pub speed: Load,
    /// Accelerations.
    pub acceleration: Load,
    /// Following errors, against what LinuxCNC allows in the same cycle.
    pub following: Load,
    /// By how much the feed of a line may be multiplied, for every line that moves a joint.
    pub lines: Vec<LineLoad>,
    /// What is used of every axis and joint.
    pub ranges: Vec<Range>,
    /// Seconds with the drives on.
    pub duration: f64,
    /// Where the program was in the last cycle with the drives on.
    pub last: Place,
}

/// Adds up rows.
pub struct Loads<'a> {
    config: &'a MachineConfig,
    /// Rows with the drives on that are not judged yet, since a tool offset may move after them.
    waiting: VecDeque<Row>,
    /// The row judged last, and the speeds of the joints in it.
    last: Option<Row>,
    speeds: Option<Joints>,
    /// Rows up to this cycle are no motion of the program.
    tool_moves_to: u64,
    /// Line that is judged, and its largest share of a speed limit.
    line: (u32, f64),
    lines: BTreeMap<u32, f64>,
    axes: [[f64; 2]; 6],
    joints: [[f64; 2]; MAX_JOINTS],
    cycles: u64,
    end: Place,
    speed: Load,
    acceleration: Load,
    following: Load,
}

/// Of no value.
const EMPTY: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

fn widen([low, high]: &mut [f64; 2], value: f64) {
    (*low, *high) = (low.min(value), high.max(value));
}

impl<'a> Loads<'a> {
    /// Before the first row.
    pub fn new(config: &'a MachineConfig) -> Self {
        let joints = &config.joints;
        Self {
            config,
            waiting: VecDeque::new(),
            last: None,
            speeds: None,
            tool_moves_to: 0,
            line: (0, 0.0),
            lines: BTreeMap::new(),
            axes: [EMPTY; 6],
            joints: [EMPTY; MAX_JOINTS],
            cycles: 0,
            end: Place::default(),
            speed: Load::new(joints, |joint| joint.max_velocity),
            acceleration: Load::new(joints, |joint| joint.max_acceleration),
            following: Load::new(joints, |_| f64::INFINITY),
        }
    }

    /// Adds the row of the next servo cycle.
    pub fn see(&mut self, row: &Row) {
        if !row.flags.on {
            self.interrupt();
            return;
        }
        self.note_place(row);
        if row.flags.tool_busy {
            let first = row.cycle.saturating_sub(AROUND_TOOL_OFFSETS);
            self.judge_before(first);
            self.waiting.clear();
            (self.last, self.speeds) = (None, None);
            self.tool_moves_to = row.cycle + AROUND_TOOL_OFFSETS;
        } else if row.cycle >= self.tool_moves_to {
            self.waiting.push_back(*row);
        }
        self.judge_before(row.cycle.saturating_sub(AROUND_TOOL_OFFSETS));
    }

    /// Everything, after the last row.
    pub fn finish(mut self) -> Demands {
        self.interrupt();
        self.close_line();
        let lines =
            self.lines.iter().map(|(line, share)| LineLoad { line: *line, factor: share.recip() });
        Demands {
            lines: lines.collect(),
            ranges: self.ranges(),
            duration: self.cycles as f64 * self.config.period,
            last: self.end,
            speed: self.speed,
            acceleration: self.acceleration,
            following: self.following,
        }
    }

    fn ranges(&self) -> Vec<Range> {
        if self.cycles == 0 {
            return vec![];
        }
        let config = self.config;
        let axes = Letter::ALL.into_iter().zip(&config.axes).zip(&self.axes);
        let axes = axes.filter(|((letter, _), _)| !config.machine.layout().is_held(*letter)).map(
            |((letter, axis), used)| {
                Range::of(config, Limit::Axis, Part::Axis(letter), *used, [axis.min, axis.max])
            },
        );
        let joints =
            config.joints.iter().zip(&self.joints).enumerate().map(|(i, (joint, used))| {
                let has = [joint.min, joint.max];
                Range::of(config, Limit::JointRange, Part::Joint(i), *used, has)
            });
        axes.chain(joints).collect()
    }

    /// What counts in every cycle with the drives on.
    fn note_place(&mut self, row: &Row) {
        self.cycles += 1;
        self.axes.iter_mut().zip(row.pose).for_each(|(range, value)| widen(range, value));
        self.joints.iter_mut().zip(row.joints).for_each(|(range, value)| widen(range, value));
        let place = self.place(row);
        self.end = place;
        for joint in 0..self.config.joints.len() {
            self.following.note(joint, row.errors[joint].abs(), row.allowed[joint], &place);
        }
    }

    /// Nothing is known of the motion between the rows before and after.
    fn interrupt(&mut self) {
        self.judge_before(u64::MAX);
        (self.last, self.speeds) = (None, None);
    }

    fn judge_before(&mut self, cycle: u64) {
        while self.waiting.front().is_some_and(|row| row.cycle < cycle)
            && let Some(row) = self.waiting.pop_front()
        {
            self.judge(row);
        }
    }

    /// A step belongs to the row that it starts from.
    fn judge(&mut self, row: Row) {
        let Some(before) = self.last.replace(row) else { return };
        let (joints, period) = (self.config.joints.len(), self.config.period);
        let place = self.place(&before);
        let speeds = std::array::from_fn(|i| (row.joints[i] - before.joints[i]) / period);
        let slower = self.speeds.replace(speeds);
        if self.line.0 != before.line {
            self.close_line();
            self.line = (before.line, 0.0);
        }
        for joint in 0..joints {
            let limits = &self.config.joints[joint];
            let (speed, limit) = (speeds[joint].abs(), limits.max_velocity);
            self.speed.note(joint, speed, limit, &place);
            self.line.1 = self.line.1.max(speed / limit);
            if let Some(slower) = slower {
                let acceleration = (speeds[joint] - slower[joint]).abs() / period;
                self.acceleration.note(joint, acceleration, limits.max_acceleration, &place);
            }
        }
    }

    fn close_line(&mut self) {
        let (line, share) = self.line;
        if share > 0.0 {
            let most = self.lines.entry(line).or_default();
            *most = most.max(share);
        }
    }

    fn place(&self, row: &Row) -> Place {
        let seconds = row.cycle as f64 * self.config.period;
        Place { line: row.line, pose: row.pose, seconds }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::row::Flags;
    use std::path::Path;

    /// Some hundred differences of numbers near 1000 over a thousandth of a second, twice.
    const ROUNDING: f64 = 1e-5;

    fn config() -> MachineConfig {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hexapod/hexapod.ini");
        MachineConfig::read(&file).unwrap()
    }

    /// The first joint at these places, one a cycle, all others at rest.
    fn rows(places: &[f64]) -> Vec<Row> {
        let row = |(cycle, place): (usize, &f64)| Row {
            cycle: cycle as u64,
            line: 1 + cycle as u32 / 20,
            flags: Flags { on: true, ..Flags::default() },
            pose: [*place, 0.0, 0.0, 0.0, 0.0, 0.0],
            joints: std::array::from_fn(|i| if i == 0 { *place } else { 500.0 }),
            errors: [0.0; MAX_JOINTS],
            allowed: [1.0; MAX_JOINTS],
            tool: [0.0; 3],
            feed: 1.0,
        };
        places.iter().enumerate().map(row).collect()
    }

    fn judged(config: &MachineConfig, rows: &[Row]) -> Demands {
        let mut loads = Loads::new(config);
        rows.iter().for_each(|row| loads.see(row));
        loads.finish()
    }

    fn assert_near(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() <= ROUNDING * expected.abs().max(1.0),
            "{found} {expected}"
        );
    }

    /// At rest for 30 cycles, then steps that grow by `more` for ten, then at rest again.
    fn ramp(more: f64) -> Vec<f64> {
        let (mut place, mut step) = (500.0, 0.0);
        let run = |n: usize| {
            if (30..40).contains(&n) {
                step += more;
                place += step;
            }
            place
        };
        (0..60).map(run).collect()
    }

    /// One way behind the other.
    fn twice(one: &[f64], other: &[f64]) -> Vec<f64> {
        let on = one.last().unwrap() - other[0];
        one.iter().copied().chain(other.iter().map(|place| place + on)).collect()
    }

    #[test]
    fn peaks_are_differences_of_commands_with_line_pose_and_time() {
        let config = config();
        let places = ramp(0.001);
        let found = judged(&config, &rows(&places));
        // Ten steps on it does 0.01 a millisecond, and stops within one cycle.
        let speed = &found.speed.peaks[0];
        assert_near(speed.value, 10.0);
        assert_eq!((speed.place.line, speed.place.pose[0]), (2, places[38]));
        assert_near(speed.place.seconds, 0.038);
        let stop = &found.acceleration.peaks[0];
        assert_near(stop.value, 10_000.0);
        assert_eq!((stop.place.line, stop.limit), (2, config.joints[0].max_acceleration));
        assert_eq!(found.speed.peaks[1].value, 0.0);
        assert_near(found.duration, 0.060);
        assert_eq!(found.last.line, 3);
    }

    #[test]
    fn a_limit_that_is_left_is_told_with_its_first_place_and_the_lines_that_leave_it() {
        let mut config = config();
        config.joints[0].max_velocity = 8.5;
        let found = judged(&config, &rows(&twice(&ramp(0.001), &ramp(0.001))));
        let beyond = found.speed.beyond[0].unwrap();
        assert_eq!(beyond.lines, 2);
        // The ninth step is the first above 8.5 a second.
        assert_near(beyond.place.seconds, 0.037);
        assert_eq!(found.speed.beyond[1], None);
    }

    #[test]
    fn cycles_about_a_moving_tool_offset_are_no_speed_of_the_program() {
        let config = config();
        let mut rows = rows(&ramp(0.001));
        for busy in 35..38 {
            rows[busy].flags.tool_busy = true;
        }
        let found = judged(&config, &rows);
        // Rows 30 to 42 are left out; nothing moves in the others.
        assert_eq!(found.speed.peaks[0].value, 0.0);
        assert_eq!(found.acceleration.peaks[0].value, 0.0);
        // What joints pass through counts all the same.
        let joint = found.ranges.iter().find(|range| range.part == "strut 0").unwrap();
        assert_near(joint.used[1], 500.055);
        rows[35].flags.tool_busy = false;
        rows[36].flags.tool_busy = false;
        // Six cycles before the first busy one are motion of the program.
        assert_near(judged(&config, &rows).speed.peaks[0].value, 2.0);
    }

    #[test]
    fn nothing_counts_while_the_drives_are_off() {
        let config = config();
        let mut rows = rows(&ramp(0.001));
        for row in &mut rows[29..45] {
            row.flags.on = false;
            row.errors[0] = 2.0;
        }
        let found = judged(&config, &rows);
        assert_eq!(found.speed.peaks[0].value, 0.0);
        assert_eq!(found.following.peaks[0].value, 0.0);
        assert_near(found.duration, 0.044);
    }

    #[test]
    fn following_errors_are_judged_by_what_is_allowed_in_the_same_cycle() {
        let config = config();
        let mut rows = rows(&ramp(0.001));
        (rows[10].errors[0], rows[10].allowed[0]) = (-0.9, 1.0);
        (rows[50].errors[0], rows[50].allowed[0]) = (0.3, 0.2);
        let found = judged(&config, &rows).following;
        let peak = &found.peaks[0];
        assert_eq!((peak.value, peak.limit, peak.place.line), (0.3, 0.2, 3));
        assert_eq!(found.beyond[0].unwrap().place.seconds, 0.05);
    }

    #[test]
    fn every_line_tells_once_by_how_much_its_feed_may_be_multiplied() {
        let mut config = config();
        config.joints[0].max_velocity = 20.0;
        let found = judged(&config, &rows(&ramp(0.001)));
        let [only] = found.lines.as_slice() else { panic!("{:?}", found.lines) };
        assert_eq!(only.line, 2);
        assert_near(only.factor, 2.0);
        // The same lines again, half as fast: a loop.
        let mut all = rows(&twice(&ramp(0.001), &ramp(0.0005)));
        all[60..].iter_mut().for_each(|row| row.line -= 3);
        assert_eq!(judged(&config, &all).lines, found.lines);
    }
}
