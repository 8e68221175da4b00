// SPDX-License-Identifier: GPL-2.0-or-later
//! Where LinuxCNC's trajectory planner puts the machine in every servo cycle of a program.
//!
//! What version 2.9 does, followed cycle by cycle: trapezoids of speed on every move, corners that are
//! stopped at (G61), passed tangentially, rounded by an arc or by two moves that overlap (G64), speeds
//! at corners from a look ahead over the queue, moves merged into one by the tolerance Q, and joints that
//! follow through a cubic spline. Motion is at 100 % feed override.
//!
//! Left out, so that motion there is an estimate: arcs that round corners between lines and arcs
//! (two moves that overlap, or a tangential corner, take their place), motion that follows the spindle, and
//! how fast the interpreter fills the queue (one move a cycle is assumed).

use crate::program::corner::{Rounding, altitude, half_angle, overlap_speeds, rounding_arc};
use crate::program::interpreter::Move;
use crate::program::pieces::Source;
use crate::program::segment::{
    ALONG_CIRCLES, End, FUZZ, Segment, Shape, forget_kink, join, slow_at_kink,
};
use crate::read::machine::MachineConfig;
use kinematics::Vector3;
use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI};

/// Lengths, times and speeds that count as none.
const NO_LENGTH: f64 = 1e-12;
const NO_TIME: f64 = 1e-12;
const NO_SPEED: f64 = 1e-8;
/// A segment lasts at least this many cycles.
const LEAST_CYCLES: f64 = 1.02;
/// Segments from the end of the queue that the look ahead reaches, and peaks after which it stops.
const LOOK_AHEAD: usize = 50;
const PEAKS: usize = 4;
/// Corners are tangential where passing them takes no more than this share of the acceleration.
const KINK: f64 = 0.1;
/// Corners sharper than this to straight back are stopped at, radians squared.
const SHARP: f64 = (2.0 * PI / 180.0) * (2.0 * PI / 180.0);
/// A line before a rounding arc that lasts fewer cycles becomes a part of it.
const GAP_CYCLES: f64 = 4.0;
/// Segments shorter than this, seconds, change their speed at one rate.
const RAMP_SECONDS: f64 = 0.01;
/// Cycles at rest at the end and at every standstill, more than the joints' spline spans.
const REST: usize = 4;

/// One servo cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Number of the move.
    pub number: usize,
    /// Share of the move that is done.
    pub share: f64,
    /// Commanded pose.
    pub pose: [f64; 6],
    /// Tool offset of the move, without that of the spindle.
    pub tool: [f64; 3],
}

/// Shows every servo cycle of the moves from `[TRAJ]HOME` on.
pub fn run(config: &MachineConfig, moves: &[Move], mut see: impl FnMut(&Cycle)) {
    let mut source = Source::new(config, moves);
    let mut planner = Planner::new(config);
    let mut next = source.next();
    loop {
        if let Some(segment) = next.take_if(|next| planner.queue.is_empty() || !next.stands) {
            planner.add(segment);
            next = source.next();
        }
        let Some(head) = planner.queue.front() else { return };
        let (number, tool) = (head.number, head.tool);
        planner.cycle();
        let share = planner.queue.front().filter(|head| head.number == number);
        let share = share.map_or(1.0, |head| head.progress / head.target);
        let cycle = Cycle { number, share, pose: planner.pose, tool };
        see(&cycle);
        if planner.queue.is_empty() {
            (0..REST).for_each(|_| see(&cycle));
        }
    }
}

struct Planner<'a> {
    config: &'a MachineConfig,
    queue: VecDeque<Segment>,
    pose: [f64; 6],
}

impl<'a> Planner<'a> {
    fn new(config: &'a MachineConfig) -> Self {
        Self { config, queue: VecDeque::new(), pose: config.home }
    }

    // ---- filling the queue

    fn add(&mut self, mut next: Segment) {
        if let Some(mut before) = self.queue.pop_back() {
            if before.rapid != next.rapid {
                join(&mut before, &mut next, End::Stop);
            }
            let rounding = self.treat_corner(&mut before, &mut next);
            match rounding {
                Some(Rounding { segment, consumes: false }) => {
                    before.finalize();
                    self.queue.extend([before, segment]);
                }
                Some(Rounding { segment, consumes: true }) => self.queue.push_back(segment),
                None => {
                    before.finalize();
                    self.queue.push_back(before);
                }
            }
        }
        self.queue.push_back(next);
        self.look_ahead();
    }

    /// Decides how a corner is passed; an arc that rounds it, if that is best.
    fn treat_corner(&self, before: &mut Segment, next: &mut Segment) -> Option<Rounding> {
        if before.progress > before.target / 2.0 {
            return None;
        }
        if before.turns || next.turns || before.end == End::Stop {
            return None;
        }
        if (before.finish + next.start).norm_squared() < SHARP {
            join(before, next, End::Stop);
            return None;
        }
        let speed = before.planned_speed().min(next.planned_speed());
        let jump = speed / self.config.period + next.acceleration;
        let mut share = self.share_of_axes(&((next.start - before.finish) * jump));
        if [&*before, &*next].iter().any(|s| matches!(s.shape, Shape::Circle { .. })) {
            share /= ALONG_CIRCLES;
        }
        if share < KINK {
            join(before, next, End::Tangent);
            slow_at_kink(before, next, speed, share);
            return None;
        }
        slow_at_kink(before, next, speed * KINK / share, KINK);
        if before.end != End::Overlap {
            return None;
        }
        let rounding = self.rounding(before, next);
        let speeds = [
            self.overlap_speed(before, next),
            before.kink_speed.unwrap_or(0.0),
            rounding.as_ref().map_or(0.0, |rounding| rounding.segment.most),
        ];
        if speeds[2] > speeds[0].max(speeds[1]) {
            forget_kink(before, next);
            return rounding.map(|rounding| rounding.cut(before, next));
        }
        if speeds[1] > speeds[0] {
            join(before, next, End::Tangent);
        } else {
            forget_kink(before, next);
            join(before, next, End::Overlap);
        }
        None
    }

    /// Largest share of the axes' accelerations that a vector of X Y Z takes.
    fn share_of_axes(&self, acceleration: &Vector3<f64>) -> f64 {
        let share = |(a, axis): (&f64, &crate::read::joints::Axis)| a.abs() / axis.max_acceleration;
        let shares = acceleration.iter().zip(&self.config.axes).map(share);
        shares.filter(|share| share.is_finite()).fold(0.0, f64::max)
    }

    /// What overlapping is worth: half the speed in the middle of the corner, since it costs half of the
    /// acceleration.
    fn overlap_speed(&self, before: &Segment, next: &Segment) -> f64 {
        let (this, other) = overlap_speeds(before, next);
        half_angle(&before.pulls().1, &next.pulls().0).sin() * (this + other) / 4.0
    }

    /// An arc that rounds the corner of two lines.
    fn rounding(&self, before: &Segment, next: &Segment) -> Option<Rounding> {
        if before.shape != Shape::Line || next.shape != Shape::Line || before.finalized {
            return None;
        }
        let theta = half_angle(&before.finish, &next.start);
        // LinuxCNC's least angle.
        if !(1e-6..=FRAC_PI_2 - 1e-6).contains(&theta) {
            return None;
        }
        let binormal = before.finish.cross(&next.start).normalize();
        let turn = PI - 2.0 * theta;
        let share_of_length = 0.25;
        let tolerances = [before, next].map(|segment| {
            let longest = segment.nominal * share_of_length;
            if segment.tolerance == 0.0 { longest } else { segment.tolerance.min(longest) }
        });
        let tolerance = tolerances[0].min(tolerances[1]);
        let room = before.target.min(before.nominal / 2.0).min(next.target / 2.0);
        let depth = (theta.cos() * tolerance / (1.0 - theta.sin())).min(room);
        let acceleration = self.in_plane(&binormal, |axis| axis.max_acceleration);
        let across = acceleration * (1.0 - ALONG_CIRCLES * ALONG_CIRCLES).sqrt();
        let requested = before.planned_speed().max(next.planned_speed());
        let planar = self.in_plane(&binormal, |axis| axis.max_velocity);
        let goal = requested.min(planar.max(altitude(before, next, turn)));
        let widest = theta.tan() * depth;
        let speed = (across * widest).sqrt().min(goal);
        // As long as two moves that overlap would take.
        let overlap = acceleration / 2.0;
        let seconds = (2.0 * overlap * depth).sqrt().min(speed) / overlap;
        let radius = (speed * speed / across).max((seconds * speed / turn).min(widest));
        let cut = radius / theta.tan();
        if radius < NO_LENGTH || radius * turn < FUZZ {
            return None;
        }
        let left = before.target - cut;
        let consumes = left / speed < GAP_CYCLES * self.config.period && !before.overlaps_before;
        let mut segment = rounding_arc(before, next, radius, cut, theta, consumes.then_some(left));
        (segment.requested, segment.most) = (requested, speed);
        segment.acceleration = acceleration;
        segment.cycle = self.config.period;
        segment.finalize();
        Some(Rounding { segment, consumes })
    }

    /// Largest circle in a plane inside the limits of X Y Z.
    fn in_plane(
        &self,
        normal: &Vector3<f64>,
        limit: impl Fn(&crate::read::joints::Axis) -> f64,
    ) -> f64 {
        let extent = |(n, axis): (&f64, &crate::read::joints::Axis)| {
            limit(axis) / (1.0 - n * n).max(0.0).sqrt().max(NO_LENGTH)
        };
        normal.iter().zip(&self.config.axes).map(extent).fold(f64::INFINITY, f64::min)
    }

    /// From the end of the queue: how fast segments may end so that what follows can brake.
    fn look_ahead(&mut self) {
        let (mut peaks, mut seen_stop) = (0, false);
        for n in (1..self.queue.len()).rev().take(LOOK_AHEAD + 1) {
            let (front, back) = self.queue.as_mut_slices();
            let split = front.len();
            let (before, next) = if n < split {
                let (a, b) = front.split_at_mut(n);
                (&mut a[n - 1], &mut b[0])
            } else if n == split {
                (&mut front[n - 1], &mut back[0])
            } else {
                let (a, b) = back.split_at_mut(n - split);
                (&mut a[n - split - 1], &mut b[0])
            };
            if before.end != End::Tangent {
                if seen_stop {
                    return;
                }
                seen_stop = true;
                continue;
            }
            // A quarter of it is gone: too late.
            if before.progress >= before.target / 4.0 || before.splitting || before.overlapping {
                return;
            }
            let kink = before.kink_speed.unwrap_or(f64::INFINITY);
            if next.finalized {
                let acceleration = next.tangential_acceleration();
                let reach = (next.final_speed.powi(2) + 2.0 * acceleration * next.target).sqrt();
                let limit = next.most.min(before.most).min(kink);
                before.at_peak |= reach >= limit;
                before.final_speed = reach.min(limit);
                next.most = next.most.min(next.target / (self.config.period * LEAST_CYCLES));
            } else {
                let reach = (next.tangential_acceleration() * next.target).sqrt();
                before.final_speed = before.most.min(reach.min(next.target_speed())).min(kink);
                next.final_speed = 0.0;
            }
            peaks += usize::from(next.at_peak);
            if peaks > PEAKS {
                return;
            }
        }
    }

    // ---- one servo cycle

    fn cycle(&mut self) {
        self.activate();
        if self.queue[0].splitting {
            self.split();
        } else {
            self.go_on();
        }
        if self.queue[0].remove {
            self.queue.pop_front();
        }
    }

    /// Short segments in a row change their speed evenly.
    fn activate(&mut self) {
        let head = &mut self.queue[0];
        if head.active {
            return;
        }
        head.active = true;
        let end = head.final_speed.min(head.target_speed());
        let seconds = 2.0 * head.to_go() / (head.speed + end);
        head.ramps = seconds < RAMP_SECONDS && !head.rapid && head.end == End::Tangent;
    }

    fn go_on(&mut self) {
        let next = (self.queue.len() > 1).then_some(1);
        self.queue[0].cycle = self.config.period;
        self.update(0, next);
        if next.is_none() {
            return;
        }
        let (this, other) = overlap_speeds(&self.queue[0], &self.queue[1]);
        self.queue[1].overlap_speed = other;
        let head = &mut self.queue[0];
        head.overlap_speed = this;
        head.overlapping |=
            head.end == End::Overlap && head.brakes_to_end && head.speed < head.overlap_speed;
        if head.overlapping {
            self.update(1, None);
        }
    }

    /// The last cycle of a segment, of which the next one takes the rest.
    fn split(&mut self) {
        if self.queue[0].remove {
            return;
        }
        let head = &mut self.queue[0];
        let before = head.place();
        head.progress = head.target;
        let after = head.place();
        head.remove = true;
        let (end, left, speed) = (head.end, self.config.period - head.cycle, head.split_speed);
        self.shift(&before, &after);
        if self.queue.len() < 2 {
            return;
        }
        if end == End::Tangent {
            (self.queue[1].cycle, self.queue[1].speed) = (left, speed);
        }
        self.update(1, (self.queue.len() > 2).then_some(2));
    }

    fn shift(&mut self, before: &[f64; 6], after: &[f64; 6]) {
        self.pose.iter_mut().zip(before.iter().zip(after)).for_each(|(x, (a, b))| *x += b - a);
    }

    fn update(&mut self, n: usize, next: Option<usize>) {
        let before = self.queue[n].place();
        let final_speed = self.final_speed(n, next);
        let ramp = self.queue[n].ramps && self.queue[n].end == End::Tangent;
        let ramped = ramp && final_speed >= NO_SPEED;
        let (acceleration, wanted) = match ramped {
            true => even(&self.queue[n], final_speed),
            false => trapezoid(&self.queue[n], final_speed),
        };
        advance(&mut self.queue[n], acceleration, wanted);
        self.check_end(n, next);
        let after = self.queue[n].place();
        self.shift(&before, &after);
    }

    fn final_speed(&self, n: usize, next: Option<usize>) -> f64 {
        let segment = &self.queue[n];
        if segment.end != End::Tangent {
            return 0.0;
        }
        let after = next.map_or(0.0, |next| self.queue[next].target_speed());
        segment.final_speed.min(segment.target_speed()).min(after)
    }

    /// Whether the segment ends within the next cycle, which is then split.
    fn check_end(&mut self, n: usize, next: Option<usize>) {
        let final_speed = self.final_speed(n, next);
        let period = self.config.period;
        let segment = &mut self.queue[n];
        segment.cycle = period;
        let to_go = segment.to_go();
        let stops = matches!(segment.end, End::Stop | End::Exact);
        if to_go <= NO_LENGTH {
            segment.progress = segment.target;
            segment.remove |= stops;
            set_split(segment, 0.0, segment.speed);
            return;
        }
        if stops {
            return;
        }
        let mean = (segment.speed + final_speed) / 2.0;
        if mean <= NO_SPEED {
            return;
        }
        let (mut seconds, mut end) = ((to_go / mean).max(NO_TIME / 2.0), final_speed);
        let most = segment.tangential_acceleration();
        let rate = (end - segment.speed) / seconds;
        if rate.abs() > most {
            let rate = most.copysign(rate);
            let root = (segment.speed / rate).powi(2) + 2.0 / rate * to_go;
            if root < 0.0 {
                return;
            }
            seconds = -segment.speed / rate + root.sqrt().copysign(rate);
            end = segment.speed + seconds * rate;
        }
        if seconds < NO_TIME {
            segment.progress = segment.target;
            set_split(segment, 0.0, end);
        } else if seconds < period {
            set_split(segment, seconds, end);
        }
    }
}

fn set_split(segment: &mut Segment, seconds: f64, speed: f64) {
    if segment.splitting && seconds > 0.0 {
        return;
    }
    segment.splitting = true;
    segment.cycle = seconds;
    segment.split_speed = speed;
}

/// Acceleration of a trapezoid of speed, and the speed that would be reached without limits.
fn trapezoid(segment: &Segment, final_speed: f64) -> (f64, f64) {
    let most = segment.tangential_acceleration();
    let step = most * segment.cycle / 2.0;
    let root = final_speed.powi(2)
        + most * (2.0 * segment.to_go() - segment.speed * segment.cycle)
        + step * step;
    let wanted = if root > step * step { root.sqrt() - step } else { -step };
    let target = segment.target_speed();
    let speed = wanted.clamp(-target, target);
    let acceleration = (speed - segment.speed) / segment.cycle.max(NO_TIME);
    (acceleration.clamp(-most, most), wanted)
}

/// The same for an even change of speed up to the end.
fn even(segment: &Segment, final_speed: f64) -> (f64, f64) {
    let mean = (segment.speed + final_speed) / 2.0;
    let seconds = (segment.to_go() / mean).max(1e-16);
    let most = segment.tangential_acceleration();
    (((final_speed - segment.speed) / seconds).clamp(-most, most), final_speed)
}

fn advance(segment: &mut Segment, acceleration: f64, wanted: f64) {
    let next = segment.speed + acceleration * segment.cycle;
    if next < 0.0 {
        if segment.to_go() < segment.speed * segment.cycle {
            segment.progress = segment.target;
        }
        segment.speed = 0.0;
    } else {
        let way = (next + segment.speed) / 2.0 * segment.cycle;
        segment.progress = (segment.progress + way).min(segment.target);
        segment.speed = next;
    }
    segment.brakes_to_end = (wanted - segment.speed).abs() < NO_SPEED && acceleration < 0.0;
}
