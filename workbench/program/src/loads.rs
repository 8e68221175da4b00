// SPDX-License-Identifier: GPL-2.0-or-later
//! The joint loads of a program, from LinuxCNC's own servo cycles: speeds, accelerations,
//! following errors, and the largest feed factor of every line.
//!
//! Rows are processed one by one and not stored; memory grows with the lines of the
//! program, not with its cycles. A speed is the difference of two commands over the period, an
//! acceleration that of two speeds; one that exceeds its limit by no more than the rounding of these
//! differences counts as at its limit (`Rounding`). Cycles in which pkmkins moves the joints for another tool
//! offset do not count as motion of the program, nor do those with the drives off.

use crate::report::{LineLoad, Peak, Place, Places};
use kinematics::{MAX_EXTRA, MAX_JOINTS};
use linuxcnc::row::Row;
use machine::read::joints::Joint;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::collections::{BTreeMap, VecDeque};

/// Cycles ignored before and after those in which the tool offset moves: LinuxCNC's joint interpolator
/// responds two cycles late and over three.
const AROUND_TOOL_OFFSETS: u64 = 5;

/// The largest angle that an inverse returns, degrees.
const HALF_TURN: f64 = 180.0;

/// Roundings of a joint command between LinuxCNC's path and its servo cycle, each one unit in the last place of the
/// largest number involved: some ten operations of the planner, the inverse and the joint interpolator, most of them
/// with smaller numbers. Pure Z moves of a delta whose joints have the acceleration of the axis
/// show half of one.
const ROUNDINGS: f64 = 8.0;

/// Rounding errors of a speed and of an acceleration: two commands enter a speed, and four an
/// acceleration.
#[derive(Clone, Copy)]
struct Rounding {
    speed: f64,
    acceleration: f64,
}

impl Rounding {
    /// Computes the errors for commands near `value`, from numbers of up to `scale`.
    fn of(value: f64, scale: f64, period: f64) -> Self {
        let command = ROUNDINGS * f64::EPSILON * value.abs().max(scale);
        Self { speed: 2.0 * command / period, acceleration: 4.0 * command / (period * period) }
    }
}

/// Returns the limit in place of a value that exceeds it by `rounding` at most.
fn at_most(value: f64, limit: f64, rounding: f64) -> f64 {
    if value > limit && value - limit <= rounding { limit } else { value }
}

/// The first violation of a joint's limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// First position and time.
    pub place: Place,
    /// Number of violating lines; a repeated line counts again.
    pub lines: usize,
}

/// Values of one kind of every joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// By joint: where the load relative to the limit is largest.
    pub peaks: Vec<Peak>,
    /// By joint: the violation of its limit, if any.
    pub beyond: Vec<Option<Beyond>>,
    /// By joint: the last line that violated it.
    last: Vec<Option<(usize, u32)>>,
}

impl Load {
    fn new(joints: &[&Joint], limit: impl Fn(&Joint) -> f64) -> Self {
        let peak = |joint: &Joint| Peak {
            joint: joint.name.clone(),
            value: 0.0,
            limit: limit(joint),
            place: Place::default(),
        };
        Self {
            peaks: joints.iter().map(|joint| peak(joint)).collect(),
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
            let line = (place.file, place.line);
            if self.last[joint].replace(line) != Some(line) {
                beyond.lines += 1;
            }
        }
    }
}

/// Speeds and accelerations of `N` joints from their commands, cycle by cycle.
#[derive(Clone, Copy, Debug)]
pub struct Motion<const N: usize> {
    last: Option<(u64, [f64; N])>,
    speeds: Option<[f64; N]>,
}

impl<const N: usize> Motion<N> {
    /// State before the first cycle.
    pub const START: Self = Self { last: None, speeds: None };

    /// Returns the speeds since the previous cycle, and the accelerations over the two previous ones, in joint units
    /// per second and per second squared. 0 if those cycles are unknown, or the drives were off.
    pub fn next(&mut self, row: &Row, commands: &[f64; N], period: f64) -> [[f64; N]; 2] {
        let last = self.last.take().filter(|(cycle, _)| row.flags.on && cycle + 1 == row.cycle);
        self.last = row.flags.on.then_some((row.cycle, *commands));
        let Some((_, last)) = last else {
            self.speeds = None;
            return [[0.0; N]; 2];
        };
        let speeds = std::array::from_fn(|i| (commands[i] - last[i]) / period);
        let before = self.speeds.replace(speeds).unwrap_or(speeds);
        [speeds, std::array::from_fn(|i| (speeds[i] - before[i]) / period)]
    }
}

/// The joint loads of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Demands {
    /// Speeds.
    pub speed: Load,
    /// Accelerations.
    pub acceleration: Load,
    /// Following errors, relative to LinuxCNC's limit in the same cycle.
    pub following: Load,
    /// Largest feed factor of every line that moves a joint.
    pub lines: Vec<LineLoad>,
    /// Position of the program in the last cycle with the drives on.
    pub last: Place,
}

/// Evaluates rows.
pub struct Loads<'a> {
    config: &'a MachineConfig,
    /// By joint: the largest number from which its commands are calculated, besides their own values.
    scales: Vec<f64>,
    /// Rows with the drives on that are not judged yet, because a tool offset may move after them.
    waiting: VecDeque<(Row, Place)>,
    motion: Motion<MAX_JOINTS>,
    extra: Motion<MAX_EXTRA>,
    places: Places<'a>,
    /// Position of the row judged last: a step belongs to the row at its start.
    before: Place,
    /// Whether the drives were on in the last row.
    was_on: bool,
    /// Tool offsets in effect in the last row with the drives on.
    tools: Option<[[f64; 3]; 2]>,
    /// Rows up to this cycle are not motion of the program.
    tool_moves_to: u64,
    /// Current file and line, and their largest share of a speed limit.
    line: ((usize, u32), f64),
    lines: BTreeMap<(usize, u32), f64>,
    end: Place,
    speed: Load,
    acceleration: Load,
    following: Load,
}

impl<'a> Loads<'a> {
    /// Creates the state before the first row.
    pub fn new(config: &'a MachineConfig) -> Self {
        let joints = &config.all_joints().map(|(one, i)| one.joint(i)).collect::<Vec<_>>();
        let scale = |(one, i): (&Mechanism, usize)| match one.unit_of(i) {
            "degrees" => HALF_TURN,
            _ => config.first().machine.size(),
        };
        Self {
            config,
            scales: config.all_joints().map(scale).collect(),
            waiting: VecDeque::new(),
            motion: Motion::START,
            extra: Motion::START,
            places: Places::new(config),
            before: Place::default(),
            was_on: false,
            tools: None,
            tool_moves_to: 0,
            line: ((0, 0), 0.0),
            lines: BTreeMap::new(),
            end: Place::default(),
            speed: Load::new(joints, Joint::speed),
            acceleration: Load::new(joints, |joint| joint.max_acceleration),
            following: Load::new(joints, |_| f64::INFINITY),
        }
    }

    /// Adds the row of the next servo cycle.
    pub fn see(&mut self, row: &Row) {
        if !row.flags.on {
            if std::mem::take(&mut self.was_on) {
                // A too large error switches the drives off in the same cycle.
                self.note_errors(row);
            }
            self.interrupt();
            return;
        }
        self.was_on = true;
        self.end = self.places.next(row);
        self.note_errors(row);
        let tools = [row.tool, row.second.tool];
        if self.tools.replace(tools).is_some_and(|before| before != tools) {
            let first = row.cycle.saturating_sub(AROUND_TOOL_OFFSETS);
            self.judge_before(first);
            self.waiting.clear();
            self.forget();
            self.tool_moves_to = row.cycle + AROUND_TOOL_OFFSETS;
        } else if row.cycle >= self.tool_moves_to {
            self.waiting.push_back((*row, self.end));
        }
        self.judge_before(row.cycle.saturating_sub(AROUND_TOOL_OFFSETS));
    }

    /// Returns the loads after the last row.
    pub fn finish(mut self) -> Demands {
        self.interrupt();
        self.close_line();
        let lines = self.lines.iter().map(|((file, line), share)| LineLoad {
            line: *line,
            file: *file,
            factor: share.recip(),
        });
        Demands {
            lines: lines.collect(),
            last: self.end,
            speed: self.speed,
            acceleration: self.acceleration,
            following: self.following,
        }
    }

    fn note_errors(&mut self, row: &Row) {
        let (place, count) = (self.end, self.config.guarded_joints());
        let own = row.errors.iter().zip(&row.allowed).take(count);
        let extra =
            row.extra.errors.iter().zip(&row.extra.allowed).take(self.config.first().extra.len());
        for (joint, (error, allowed)) in own.chain(extra).enumerate() {
            self.following.note(joint, error.abs(), *allowed, &place);
        }
    }

    /// Discards the state: the motion between the rows before and after is unknown.
    fn interrupt(&mut self) {
        self.judge_before(u64::MAX);
        self.forget();
    }

    fn forget(&mut self) {
        (self.motion, self.extra) = (Motion::START, Motion::START);
    }

    fn judge_before(&mut self, cycle: u64) {
        while self.waiting.front().is_some_and(|(row, _)| row.cycle < cycle)
            && let Some((row, place)) = self.waiting.pop_front()
        {
            self.judge(row, place);
        }
    }

    fn judge(&mut self, row: Row, here: Place) {
        let [speeds, accelerations] = self.motion.next(&row, &row.joints, self.config.period);
        let extra = self.extra.next(&row, &row.extra.positions, self.config.period);
        let place = std::mem::replace(&mut self.before, here);
        if self.line.0 != (place.file, place.line) {
            self.close_line();
            self.line = ((place.file, place.line), 0.0);
        }
        let own = speeds.iter().zip(&accelerations).zip(&row.joints);
        let own = own.take(self.config.guarded_joints());
        let values = own.chain(extra[0].iter().zip(&extra[1]).zip(&row.extra.positions));
        for (joint, ((one, i), (values, at))) in self.config.all_joints().zip(values).enumerate() {
            let limits = one.joint(i);
            let rounding = Rounding::of(*at, self.scales[joint], self.config.period);
            let speed = at_most(values.0.abs(), limits.speed(), rounding.speed);
            let acceleration =
                at_most(values.1.abs(), limits.max_acceleration, rounding.acceleration);
            self.speed.note(joint, speed, limits.speed(), &place);
            self.acceleration.note(joint, acceleration, limits.max_acceleration, &place);
            self.line.1 = self.line.1.max(speed / limits.speed());
        }
    }

    fn close_line(&mut self) {
        let (line, share) = self.line;
        if share > 0.0 {
            let most = self.lines.entry(line).or_default();
            *most = most.max(share);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use linuxcnc::row::{Beside, Extra, Flags};
    use std::path::Path;

    /// Some hundred differences of numbers near 1000 over a thousandth of a second, twice.
    const ROUNDING: f64 = 1e-5;

    fn config() -> MachineConfig {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/hexapod/hexapod.ini");
        MachineConfig::read(&file).unwrap()
    }

    /// Returns rows with the first joint at these positions, one per cycle, all others at rest.
    fn rows(places: &[f64]) -> Vec<Row> {
        let row = |(cycle, place): (usize, &f64)| Row {
            cycle: cycle as u64,
            line: 1 + cycle as u32 / 20,
            file: 0,
            number: 0,
            flags: Flags { on: true, ..Flags::default() },
            pose: [*place, 0.0, 0.0, 0.0, 0.0, 0.0],
            joints: std::array::from_fn(|i| if i == 0 { *place } else { 500.0 }),
            errors: [0.0; MAX_JOINTS],
            allowed: [1.0; MAX_JOINTS],
            extra: Extra::default(),
            second: Beside::default(),
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

    /// Returns 30 cycles at rest, ten steps that grow by `more`, then rest again.
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

    /// Concatenates two sequences of positions.
    fn twice(one: &[f64], other: &[f64]) -> Vec<f64> {
        let on = one.last().unwrap() - other[0];
        one.iter().copied().chain(other.iter().map(|place| place + on)).collect()
    }

    #[test]
    fn peaks_are_differences_of_commands_with_line_pose_and_time() {
        let config = config();
        let places = ramp(0.001);
        let found = judged(&config, &rows(&places));
        // After ten steps it moves 0.01 per millisecond, and stops within one cycle.
        let speed = &found.speed.peaks[0];
        assert_near(speed.value, 10.0);
        assert_eq!((speed.place.line, speed.place.pose[0]), (2, places[38]));
        assert_near(speed.place.seconds, 0.038);
        let stop = &found.acceleration.peaks[0];
        assert_near(stop.value, 10_000.0);
        assert_eq!(
            (stop.place.line, stop.limit),
            (2, config.mechanisms[0].joints[0].max_acceleration)
        );
        assert_eq!(found.speed.peaks[1].value, 0.0);
        assert_eq!(found.last.line, 3);
    }

    #[test]
    fn a_violated_limit_is_reported_with_its_first_place_and_its_lines() {
        let mut config = config();
        config.mechanisms[0].joints[0].max_velocity = 8.5;
        let found = judged(&config, &rows(&twice(&ramp(0.001), &ramp(0.001))));
        let beyond = found.speed.beyond[0].unwrap();
        assert_eq!(beyond.lines, 2);
        // The ninth step is the first above 8.5 per second.
        assert_near(beyond.place.seconds, 0.037);
        assert_eq!(found.speed.beyond[1], None);
    }

    #[test]
    fn a_correction_may_come_on_top_of_the_speed() {
        let mut config = config();
        config.mechanisms[0].joints[0].correction = [1.0, 2.0];
        config.mechanisms[0].joints[0].max_velocity = 11.5;
        let found = judged(&config, &rows(&ramp(0.001))).speed;
        assert_eq!(found.peaks[0].limit, 9.5);
        // The tenth step is the first above 9.5 per second.
        assert_near(found.beyond[0].unwrap().place.seconds, 0.038);
        config.mechanisms[0].joints[0].max_velocity = 12.5;
        assert_eq!(judged(&config, &rows(&ramp(0.001))).speed.beyond[0], None);
    }

    #[test]
    fn a_value_at_its_limit_within_the_rounding_of_differences_is_within_it() {
        let mut config = config();
        // A stop from 10 per second within a cycle, from differences of numbers near 500.
        let exact = 10_000.0;
        let of = |config: &MachineConfig| judged(config, &rows(&ramp(0.001))).acceleration;
        let seen = of(&config).peaks[0].value;
        assert!(seen != exact && (seen - exact).abs() < 1e-6, "{}", seen - exact);
        config.mechanisms[0].joints[0].max_acceleration = seen - 1e-8;
        let found = of(&config);
        assert_eq!((found.beyond[0], found.peaks[0].value), (None, seen - 1e-8));
        // One rounding of 500 over the square of a millisecond is 1e-7: 8 of them 4 times are 4e-6.
        config.mechanisms[0].joints[0].max_acceleration = seen - 1e-5;
        assert!(of(&config).beyond[0].is_some());
    }

    #[test]
    fn cycles_about_a_moving_tool_offset_are_no_speed_of_the_program() {
        let config = config();
        let mut rows = rows(&ramp(0.001));
        for (moving, row) in rows.iter_mut().enumerate().skip(35) {
            row.tool[0] = moving.min(37) as f64;
        }
        let found = judged(&config, &rows);
        // Rows 30 to 42 are ignored; nothing moves in the others.
        assert_eq!(found.speed.peaks[0].value, 0.0);
        assert_eq!(found.acceleration.peaks[0].value, 0.0);
        // The module is busy before it moves the offset, while the program comes to rest.
        for row in &mut rows[35..37] {
            row.flags.tool_busy = true;
            row.tool[0] = 0.0;
        }
        // Six cycles before the first change are motion of the program.
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
        rows[29].errors[0] = 0.0;
        let found = judged(&config, &rows);
        assert_eq!(found.speed.peaks[0].value, 0.0);
        assert_eq!(found.following.peaks[0].value, 0.0);
    }

    #[test]
    fn the_following_error_that_switches_the_drives_off_counts() {
        let config = config();
        let mut rows = rows(&ramp(0.001));
        rows[35..].iter_mut().for_each(|row| row.flags.on = false);
        (rows[35].errors[0], rows[36].errors[0]) = (1.25, 3.0);
        let found = judged(&config, &rows).following;
        assert_eq!((found.peaks[0].value, found.peaks[0].place.line), (1.25, 2));
        assert_eq!(found.beyond[0].unwrap().lines, 1);
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
    fn every_line_reports_once_by_how_much_its_feed_may_be_multiplied() {
        let mut config = config();
        config.mechanisms[0].joints[0].max_velocity = 20.0;
        let found = judged(&config, &rows(&ramp(0.001)));
        let [only] = found.lines.as_slice() else { panic!("{:?}", found.lines) };
        assert_eq!(only.line, 2);
        assert_near(only.factor, 2.0);
        // The same lines again at half speed: a loop.
        let mut all = rows(&twice(&ramp(0.001), &ramp(0.0005)));
        all[60..].iter_mut().for_each(|row| row.line -= 3);
        assert_eq!(judged(&config, &all).lines, found.lines);
    }
}
