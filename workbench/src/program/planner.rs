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

use crate::program::interpreter::{Arc, Move, MoveKind, PathMode};
use crate::read::machine::MachineConfig;
use kinematics::Vector3;
use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI};

/// Moves below this length in all of X Y Z, or A B C, do not move these (LinuxCNC's CART_FUZZ).
const FUZZ: f64 = 1e-6;
/// Lengths, times and speeds that count as none.
const NO_LENGTH: f64 = 1e-12;
const NO_TIME: f64 = 1e-12;
const NO_SPEED: f64 = 1e-8;
/// A segment lasts at least this many cycles.
const LEAST_CYCLES: f64 = 1.02;
/// Share of the acceleration that circles leave for changes of speed.
const ALONG_CIRCLES: f64 = 0.5;
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
/// Moves merged at most.
const MERGED: usize = 100;
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

/// How a segment ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Stop,
    /// As stop, where the corner is not passed tangentially.
    Exact,
    Tangent,
    /// The next one begins while this one brakes.
    Overlap,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Line,
    /// With the directions in its plane: tangents at both ends, and to the centre at the start.
    Circle {
        radius: f64,
        /// The radius that bounds the speed: LinuxCNC adds the square of a helix's height over it.
        effective: f64,
        first: Vector3<f64>,
        inward: Vector3<f64>,
        last: Vector3<f64>,
    },
    /// An arc that rounds a corner, behind what it consumes of the line before: where it begins, along the
    /// line and across to the next one.
    Rounding {
        line: f64,
        begin: Vector3<f64>,
        along: Vector3<f64>,
        across: Vector3<f64>,
        radius: f64,
    },
}

/// A motion in the queue.
#[derive(Clone, Debug)]
struct Segment {
    number: usize,
    tool: [f64; 3],
    rapid: bool,
    stands: bool,
    shape: Shape,
    /// Moves rotary axes.
    turns: bool,
    places: Vec<[f64; 6]>,
    /// Of an arc: length up to each place.
    along: Vec<f64>,
    /// Unit tangents.
    start: Vector3<f64>,
    finish: Vector3<f64>,
    /// Length: of X Y Z, or of A B C where those stand still.
    target: f64,
    /// Length before it was cut by roundings.
    nominal: f64,
    requested: f64,
    most: f64,
    /// `[TRAJ]MAX_LINEAR_VELOCITY`, which bounds motion but not the speeds planned for corners.
    limit: f64,
    acceleration: f64,
    /// Share of the acceleration for changes of speed.
    tangential: f64,
    tolerance: f64,
    end: End,
    overlaps_before: bool,
    final_speed: f64,
    kink_speed: Option<f64>,
    kink: f64,
    kink_before: f64,
    finalized: bool,
    at_peak: bool,
    active: bool,
    ramps: bool,
    progress: f64,
    speed: f64,
    cycle: f64,
    overlap_speed: f64,
    overlapping: bool,
    brakes_to_end: bool,
    splitting: bool,
    remove: bool,
    split_speed: f64,
}

impl Segment {
    fn place(&self) -> [f64; 6] {
        match self.shape {
            Shape::Line => mix(&self.places[0], &self.places[1], self.progress / self.target),
            Shape::Circle { .. } => self.on_circle(),
            Shape::Rounding { line, begin, along, across, radius } => {
                let angle = ((self.progress - line) / radius).max(0.0);
                let way = along * (radius * angle.sin() - (line - self.progress).max(0.0))
                    + across * (radius * (1.0 - angle.cos()));
                let xyz = begin + way;
                std::array::from_fn(|k| if k < 3 { xyz[k] } else { self.places[0][k] })
            }
        }
    }

    /// Between the places of an arc a cubic, so that speeds do not jump there.
    fn on_circle(&self) -> [f64; 6] {
        let last = self.places.len() - 1;
        let at = self.progress / self.target * self.along[last];
        let next = self.along.partition_point(|length| *length < at).clamp(1, last);
        let (from, to) = (self.along[next - 1], self.along[next]);
        let t = if to > from { (at - from) / (to - from) } else { 1.0 };
        if last < 2 {
            return mix(&self.places[0], &self.places[1], t);
        }
        let beyond = |a: usize, b: usize, c: usize| -> [f64; 6] {
            let [a, b, c] = [a, b, c].map(|n| &self.places[n]);
            std::array::from_fn(|k| 3.0 * (a[k] - b[k]) + c[k])
        };
        let before = if next > 1 { self.places[next - 2] } else { beyond(0, 1, 2) };
        let after =
            if next < last { self.places[next + 1] } else { beyond(last, last - 1, last - 2) };
        let (a, b) = (&self.places[next - 1], &self.places[next]);
        std::array::from_fn(|k| {
            let (slope, end) = ((b[k] - before[k]) / 2.0, (after[k] - a[k]) / 2.0);
            let way = b[k] - a[k];
            let (square, cube) = (3.0 * way - 2.0 * slope - end, slope + end - 2.0 * way);
            a[k] + t * (slope + t * (square + t * cube))
        })
    }

    /// Direction of the acceleration at the start and at the end, as blending takes it.
    fn pulls(&self) -> (Vector3<f64>, Vector3<f64>) {
        let Shape::Circle { radius, first, inward, last, .. } = self.shape else {
            return (self.start, self.finish);
        };
        let across = (0.5 * self.requested).powi(2) / radius;
        ((first * self.whole_acceleration() + inward * across).normalize(), last)
    }

    fn to_go(&self) -> f64 {
        self.target - self.progress
    }

    /// Requested speed as far as it is allowed.
    fn target_speed(&self) -> f64 {
        self.planned_speed().min(self.limit)
    }

    fn planned_speed(&self) -> f64 {
        self.requested.min(self.most)
    }

    fn whole_acceleration(&self) -> f64 {
        let kept = 1.0 - self.kink.max(self.kink_before);
        let halved = self.overlaps_before || self.end == End::Overlap;
        self.acceleration * kept * if halved { 0.5 } else { 1.0 }
    }

    fn tangential_acceleration(&self) -> f64 {
        let share = if self.shape == Shape::Line { 1.0 } else { self.tangential };
        self.whole_acceleration() * share
    }

    /// Peak of a triangle of speed over the segment, which may still lose half of it.
    fn triangle_speed(&self) -> f64 {
        let length = if self.finalized { self.target } else { self.target / 2.0 };
        (self.tangential_acceleration() * length).sqrt()
    }

    fn clamp(&mut self) {
        self.most = self.most.min(self.target / self.cycle);
    }

    fn finalize(&mut self) {
        if self.finalized {
            return;
        }
        self.clamp();
        if let Shape::Circle { effective: radius, .. } = self.shape {
            let acceleration = self.whole_acceleration();
            let across = (1.0 - ALONG_CIRCLES * ALONG_CIRCLES).sqrt() * acceleration;
            let wanted = self.most * self.most / radius;
            if wanted > across {
                self.most = (across * radius).sqrt();
                self.tangential = ALONG_CIRCLES;
            } else {
                self.tangential = (1.0 - (wanted / acceleration).powi(2)).sqrt();
            }
        }
        self.finalized = true;
    }
}

/// Joins two segments.
fn join(before: &mut Segment, next: &mut Segment, end: End) {
    next.overlaps_before = end == End::Overlap;
    before.end = end;
}

fn slow_at_kink(before: &mut Segment, next: &mut Segment, speed: f64, share: f64) {
    before.kink_speed = Some(speed);
    before.kink = before.kink.max(share);
    next.kink_before = next.kink_before.max(share);
}

fn forget_kink(before: &mut Segment, next: &mut Segment) {
    before.kink_speed = None;
    (before.kink, next.kink_before) = (0.0, 0.0);
}

/// Half the angle between two moves: a quarter turn where they go straight on.
fn half_angle(before: &Vector3<f64>, next: &Vector3<f64>) -> f64 {
    (-before.dot(next)).clamp(-1.0, 1.0).acos() / 2.0
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
        let share =
            |(a, axis): (&f64, &crate::read::machine::Axis)| a.abs() / axis.max_acceleration;
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
        limit: impl Fn(&crate::read::machine::Axis) -> f64,
    ) -> f64 {
        let extent = |(n, axis): (&f64, &crate::read::machine::Axis)| {
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

/// Speeds at which two moves begin to overlap.
fn overlap_speeds(before: &Segment, next: &Segment) -> (f64, f64) {
    let pair = [before, next];
    let accelerations = pair.map(Segment::tangential_acceleration);
    let reached = pair.map(|segment| segment.triangle_speed().min(segment.target_speed()));
    let longest = (before.target / reached[0]).min(next.target / reached[1]);
    let wanted = (reached[0] / accelerations[0]).max(reached[1] / accelerations[1]);
    let seconds = longest.min(wanted);
    let mut speeds = [0, 1].map(|k| reached[k].min(seconds * accelerations[k]));
    let cosine = half_angle(&before.pulls().1, &next.pulls().0).cos();
    // LinuxCNC's bound against division by nearly nothing: a thousandth of a radian.
    if before.tolerance > 0.0 && cosine > (FRAC_PI_2 - 1e-3).cos() {
        let allowed = 2.0 * (accelerations[0] * before.tolerance / cosine).sqrt();
        speeds = speeds.map(|speed| speed.min(allowed));
    }
    (speeds[0], speeds[1])
}

/// Speed in the triangle that the largest velocities of two lines span: its height.
fn altitude(before: &Segment, next: &Segment, turn: f64) -> f64 {
    let clipped = turn.min(PI * 0.49).cos();
    let first = before.most.min(next.most / clipped);
    let second = next.most.min(before.most / clipped);
    let base = (next.start * second - before.finish * first).norm();
    first * second * turn.sin() / base
}

struct Rounding {
    segment: Segment,
    /// The line before has become a part of it.
    consumes: bool,
}

impl Rounding {
    /// Shortens the lines by what the arc takes.
    fn cut(self, before: &mut Segment, next: &mut Segment) -> Self {
        if !self.consumes {
            before.places[1] = self.segment.places[0];
            measure(before);
            join(before, next, End::Tangent);
        }
        next.places[0] = self.segment.places[1];
        measure(next);
        next.overlaps_before = false;
        self
    }
}

/// Length of a line that has been cut.
fn measure(line: &mut Segment) {
    line.target = norm(&between(&line.places[0], &line.places[1])[..3]);
}

fn rounding_arc(
    before: &Segment,
    next: &Segment,
    radius: f64,
    cut: f64,
    theta: f64,
    consumed: Option<f64>,
) -> Segment {
    let corner = Vector3::new(next.places[0][0], next.places[0][1], next.places[0][2]);
    let place = |xyz: Vector3<f64>| -> [f64; 6] {
        std::array::from_fn(|k| if k < 3 { xyz[k] } else { next.places[0][k] })
    };
    let line = consumed.unwrap_or(0.0);
    let begin = corner - before.finish * cut;
    let across = (next.start - before.finish * before.finish.dot(&next.start)).normalize();
    let target = radius * (PI - 2.0 * theta) + line;
    Segment {
        shape: Shape::Rounding { line, begin, along: before.finish, across, radius },
        places: vec![place(begin), place(corner + next.start * cut)],
        target,
        nominal: target,
        tangential: ALONG_CIRCLES,
        end: End::Tangent,
        overlaps_before: false,
        kink_speed: None,
        kink: 0.0,
        kink_before: 0.0,
        finalized: false,
        at_peak: false,
        progress: consumed.map_or(0.0, |_| before.progress),
        speed: consumed.map_or(0.0, |_| before.speed),
        active: false,
        finish: next.start,
        final_speed: 0.0,
        ..before.clone()
    }
}

fn mix(from: &[f64; 6], to: &[f64; 6], share: f64) -> [f64; 6] {
    std::array::from_fn(|k| from[k] + share * (to[k] - from[k]))
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn between(from: &[f64; 6], to: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|k| to[k] - from[k])
}

/// Lengths of X Y Z up to each place.
fn lengths(places: &[[f64; 6]]) -> Vec<f64> {
    let mut sum = 0.0;
    let step = |pair: &[[f64; 6]]| {
        sum += norm(&between(&pair[0], &pair[1])[..3]);
        sum
    };
    std::iter::once(0.0).chain(places.windows(2).map(step).collect::<Vec<_>>()).collect()
}

// ---- moves of the program, as task sends them

/// An end of a straight move, or a whole arc.
struct Piece<'a> {
    number: usize,
    step: &'a Move,
    places: Vec<[f64; 6]>,
    arc: Option<Arc>,
    stands: bool,
}

struct Source<'a> {
    config: &'a MachineConfig,
    moves: &'a [Move],
    next: usize,
    /// End of what was read, and of what was handed on.
    at: [f64; 6],
    sent: [f64; 6],
    waiting: VecDeque<Piece<'a>>,
}

impl<'a> Source<'a> {
    fn new(config: &'a MachineConfig, moves: &'a [Move]) -> Self {
        Self {
            config,
            moves,
            next: 0,
            at: config.home,
            sent: config.home,
            waiting: VecDeque::new(),
        }
    }

    /// The next move that moves anything; arcs whole, or as two lines where they are nearly straight.
    fn piece(&mut self) -> Option<Piece<'a>> {
        if let Some(piece) = self.waiting.pop_front() {
            return Some(piece);
        }
        let mut stands = false;
        let begin = self.at;
        let mut places = vec![];
        while let Some(step) = self.moves.get(self.next) {
            stands |= step.path.stands;
            places.push(step.end);
            self.next += 1;
            let following = self.moves.get(self.next).and_then(|next| next.path.arc);
            let arc = step.path.arc;
            if arc.is_some_and(|arc| following.is_some_and(|next| next.number == arc.number)) {
                continue;
            }
            let number = self.next - 1;
            if !moves_anything(&begin, &places) {
                places.clear();
                continue;
            }
            self.at = step.end;
            if let Some(middle) = nearly_straight(step, &begin, &places) {
                let last = Piece { number, step, places: vec![step.end], arc: None, stands: false };
                self.waiting.push_back(last);
                return Some(Piece { number, step, places: vec![middle], arc: None, stands });
            }
            return Some(Piece { number, step, places, arc, stands });
        }
        None
    }

    /// Straight moves within the tolerance Q of one line become one.
    fn merged(&mut self, begin: &[f64; 6]) -> Option<Piece<'a>> {
        let mut piece = self.piece()?;
        let PathMode::Blend { merging, .. } = piece.step.path.mode else { return Some(piece) };
        if merging == 0.0 || piece.arc.is_some() || piece.step.kind != MoveKind::Feed {
            return Some(piece);
        }
        while piece.places.len() <= MERGED {
            let Some(more) = self.piece() else { break };
            let same = more.step.path.mode == piece.step.path.mode
                && more.step.kind == MoveKind::Feed
                && (more.step.feed, more.step.tool) == (piece.step.feed, piece.step.tool)
                && more.arc.is_none()
                && !more.stands;
            if !same || !on_one_line(begin, &piece.places, &more.places[0], merging) {
                self.waiting.push_front(more);
                break;
            }
            (piece.number, piece.step) = (more.number, more.step);
            piece.places.extend(more.places);
        }
        let last = piece.places[piece.places.len() - 1];
        piece.places = vec![last];
        Some(piece)
    }

    fn next(&mut self) -> Option<Segment> {
        let piece = self.merged(&self.sent.clone())?;
        let mut places = vec![self.sent];
        places.extend(&piece.places);
        self.sent = places[places.len() - 1];
        Some(segment(self.config, &piece, places))
    }
}

fn moves_anything(begin: &[f64; 6], places: &[[f64; 6]]) -> bool {
    let last = &places[places.len() - 1];
    places.len() > 1 || between(begin, last).iter().any(|delta| delta.abs() >= FUZZ)
}

/// The middle of an arc in X Y that blending takes for two lines.
fn nearly_straight(step: &Move, begin: &[f64; 6], places: &[[f64; 6]]) -> Option<[f64; 6]> {
    let PathMode::Blend { merging, .. } = step.path.mode else { return None };
    let middle = places.get((places.len() / 2).checked_sub(1)?).filter(|_| places.len() > 1)?;
    let last = &places[places.len() - 1];
    let flat = |a: &[f64; 6], b: &[f64; 6]| (b[0] - a[0]).hypot(b[1] - a[1]);
    let half = flat(begin, last) / 2.0;
    let deviation = (flat(begin, middle).powi(2) - half * half).max(0.0).sqrt();
    (step.path.arc.is_some_and(|arc| arc.normal == 2) && deviation < merging).then_some(*middle)
}

fn on_one_line(begin: &[f64; 6], chain: &[[f64; 6]], end: &[f64; 6], within: f64) -> bool {
    let place = |p: &[f64; 6]| Vector3::new(p[0], p[1], p[2]);
    let (base, way) = (place(begin), place(end) - place(begin));
    let turned = chain.iter().any(|p| p[3..] != end[3..]);
    if turned || way.norm() == 0.0 {
        return false;
    }
    chain.iter().all(|p| {
        let share = (way.dot(&(place(p) - base)) / way.norm_squared()).clamp(0.0, 1.0);
        (place(p) - base - way * share).norm() <= within
    })
}

/// What the queue gets of a move.
fn segment(config: &MachineConfig, piece: &Piece, places: Vec<[f64; 6]>) -> Segment {
    let step = piece.step;
    let delta = between(&places[0], &places[places.len() - 1]);
    let limits = match piece.arc {
        Some(arc) => circle_limits(config, &arc, &delta, &places),
        None => line_limits(config, &delta),
    };
    let Limits { turns_only, length, most, acceleration } = limits;
    let feed = if turns_only { step.angular_feed } else { step.feed };
    let (end, tolerance) = match step.path.mode {
        PathMode::Stop => (End::Stop, 0.0),
        PathMode::Exact => (End::Exact, 0.0),
        PathMode::Blend { tolerance, .. } => (End::Overlap, tolerance),
    };
    let (start, finish) = directions(&places);
    let mut segment = Segment {
        number: piece.number,
        tool: step.tool,
        rapid: step.kind == MoveKind::Rapid,
        stands: piece.stands,
        shape: piece.arc.map_or(Shape::Line, |arc| circle(&arc, &places, &start, &finish)),
        turns: norm(&delta[3..]) > FUZZ,
        along: piece.arc.map_or(vec![], |_| lengths(&places)),
        places,
        start,
        finish,
        target: length,
        nominal: length,
        requested: if step.kind == MoveKind::Rapid { most } else { feed.min(most) },
        most,
        limit: if turns_only { f64::INFINITY } else { config.max_linear_velocity },
        acceleration,
        tangential: ALONG_CIRCLES,
        tolerance,
        end,
        overlaps_before: false,
        final_speed: 0.0,
        kink_speed: None,
        kink: 0.0,
        kink_before: 0.0,
        finalized: false,
        at_peak: false,
        active: false,
        ramps: false,
        progress: 0.0,
        speed: 0.0,
        cycle: config.period,
        overlap_speed: 0.0,
        overlapping: false,
        brakes_to_end: false,
        splitting: false,
        remove: false,
        split_speed: 0.0,
    };
    segment.clamp();
    segment
}

fn circle(arc: &Arc, places: &[[f64; 6]], start: &Vector3<f64>, finish: &Vector3<f64>) -> Shape {
    let flat = |mut way: Vector3<f64>| {
        way[arc.normal] = 0.0;
        way.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
    };
    let (first, last) = (flat(*start), flat(*finish));
    let bend = places.get(2).map_or_else(Vector3::zeros, |third| {
        let (a, b) = (&places[0], &places[1]);
        Vector3::from_fn(|k, _| a[k] - 2.0 * b[k] + third[k])
    });
    let inward = flat(bend - first * first.dot(&bend));
    let height = places[places.len() - 1][arc.normal] - places[0][arc.normal];
    let effective = arc.radius + height * height / arc.radius;
    Shape::Circle { radius: arc.radius, effective, first, inward, last }
}

struct Limits {
    turns_only: bool,
    length: f64,
    most: f64,
    acceleration: f64,
}

/// Seconds at the axes' speeds, and seconds squared at their accelerations.
fn axis_times(config: &MachineConfig, delta: &[f64; 6]) -> (f64, f64) {
    let moved = delta.iter().zip(&config.axes).filter(|(d, _)| d.abs() >= FUZZ / 10.0);
    moved.fold((0.0, 0.0), |(speed, acceleration): (f64, f64), (d, axis)| {
        let d = d.abs();
        (speed.max(d / axis.max_velocity), acceleration.max(d / axis.max_acceleration))
    })
}

fn line_limits(config: &MachineConfig, delta: &[f64; 6]) -> Limits {
    let turns_only = norm(&delta[..3]) < FUZZ;
    let length = if turns_only { norm(&delta[3..]) } else { norm(&delta[..3]) };
    let (seconds, squared) = axis_times(config, delta);
    Limits { turns_only, length, most: length / seconds, acceleration: length / squared }
}

fn circle_limits(
    config: &MachineConfig,
    arc: &Arc,
    delta: &[f64; 6],
    places: &[[f64; 6]],
) -> Limits {
    let along = lengths(places);
    let length = along[along.len() - 1];
    let in_plane = (length.powi(2) - delta[arc.normal].powi(2)).max(0.0).sqrt();
    let planar = |limit: &dyn Fn(usize) -> f64| {
        (0..3).filter(|axis| *axis != arc.normal).map(limit).fold(f64::INFINITY, f64::min)
    };
    let acceleration = planar(&|axis| config.axes[axis].max_acceleration);
    let across = acceleration * (1.0 - ALONG_CIRCLES * ALONG_CIRCLES).sqrt();
    let speed = planar(&|axis| config.axes[axis].max_velocity).min((across * arc.radius).sqrt());
    let (seconds, squared) = axis_times(config, delta);
    Limits {
        turns_only: false,
        length,
        most: length / seconds.max(in_plane / speed),
        acceleration: length / squared.max(in_plane / acceleration),
    }
}

/// Unit tangents of X Y Z at both ends; between the places of an arc it turns evenly.
fn directions(places: &[[f64; 6]]) -> (Vector3<f64>, Vector3<f64>) {
    let chord = |a: &[f64; 6], b: &[f64; 6]| {
        let way = Vector3::new(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
        // LinuxCNC's direction of a move that stands still in X Y Z.
        if way.norm() < FUZZ * 1e-6 { Vector3::x() } else { way.normalize() }
    };
    let last = places.len() - 1;
    if last < 2 {
        let way = chord(&places[0], &places[last]);
        return (way, way);
    }
    let at_end = |a: Vector3<f64>, b: Vector3<f64>| (a * 1.5 - b * 0.5).normalize();
    (
        at_end(chord(&places[0], &places[1]), chord(&places[1], &places[2])),
        at_end(
            chord(&places[last - 1], &places[last]),
            chord(&places[last - 2], &places[last - 1]),
        ),
    )
}
