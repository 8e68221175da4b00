// SPDX-License-Identifier: GPL-2.0-or-later
//! The tool offset in effect, and how it follows the one requested.
//!
//! With the platform tilted by R, an offset that changes by Δo shifts the platform by
//! (R − I) Δo along a straight line, without turning it, while the control point stays.
//! The way along this line is surveyed before it is gone, some places a cycle: inverse
//! and forward must find each, within the limits of the joints, and the largest rates found
//! there bound speed and acceleration of the whole way. It is then gone with constant
//! acceleration, constant speed, constant deceleration.

use kinematics::{Cause, Fault, Jacobian, Joints, MAX_JOINTS, Machine, Pose, Solver, Vector3};
use libm::sqrt;

/// A tool change without a monitor, or without known limits, may shift the platform by no
/// more than this share of the machine's size: less than what following errors of a level
/// platform make of it.
pub const NOTICEABLE: f64 = 1e-5;

/// A shift of the platform by no more than this share of the machine's size is made in
/// one cycle: on a machine of 1 m in cycles of 1 ms that is an acceleration of 1 mm/s².
const IMPERCEPTIBLE: f64 = 1e-9;

/// Cycles without motion before and after a change: LinuxCNC's interpolators lag by two.
const REST_CYCLES: u32 = 5;

/// Longest time in seconds that a motion under way may take to stop.
const MAX_WAIT: f64 = 5.0;

/// Parts into which the way is divided for the survey: rates change little from one to
/// the next, even 3° from the dead point of a rod.
const PARTS: u32 = 64;

/// Places surveyed in one cycle.
const PLACES_PER_CYCLE: u32 = 4;

/// Linear solves that forward may take for a place, so that a cycle's work stays a small part of
/// it: six are enough for every way of the tests. One that asks for four times as many comes too
/// near to a singular pose.
const SOLVES_PER_PLACE: u32 = 24;

/// Share of the machine's size within which a pose found again is the same one.
const SAME_POSE: f64 = 1e-9;

/// Share of a joint's velocity limit that is used.
const VELOCITY_SHARE: f64 = 0.9;

/// Shares of a joint's acceleration limit for speeding up and for the bend of its course.
/// With the 9/8 of the last cycle (see [`Ramp::go_on`]) 0.93 of the limit is used.
const ACCELERATION_SHARE: f64 = 0.56;
const BEND_SHARE: f64 = 0.3;

/// What a joint allows, in joint units and seconds.
#[derive(Clone, Copy)]
pub struct JointLimits {
    pub least: f64,
    pub most: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

impl JointLimits {
    /// Where nobody has set any.
    pub const ABSENT: Self = Self { least: -1e99, most: 1e99, velocity: 1e99, acceleration: 1e99 };

    /// Whether velocity and acceleration are limited at all, by numbers to go by.
    fn are_known(&self) -> bool {
        let Self { velocity, acceleration, .. } = Self::ABSENT;
        self.velocity > 0.0
            && self.velocity < velocity
            && self.acceleration > 0.0
            && self.acceleration < acceleration
    }
}

/// What the monitor sees in one cycle.
pub struct Cycle<'a> {
    pub machine: &'a Machine,
    pub limits: [JointLimits; MAX_JOINTS],
    pub solver: Solver,
    /// The offset that is asked for; may hold NaN.
    pub request: Vector3<f64>,
    /// The pose commanded in this cycle; none outside of world mode.
    pub commanded: Option<Pose>,
    pub seconds: f64,
}

impl Cycle<'_> {
    fn unlimited(&self) -> Option<Fault> {
        let layout = self.machine.layout();
        let mut known = self.limits.iter().take(layout.joints());
        let joint = known.position(|limits| !limits.are_known())?;
        Some(Fault::of_joint(Cause::ToolChangedTilted, layout, joint, 0.0))
    }
}

/// The offset in effect, and the change that is under way.
pub struct Tool {
    offset: Vector3<f64>,
    change: Change,
}

#[derive(Clone, Copy)]
#[allow(clippy::large_enum_variant, reason = "one of it exists, and there is no allocator")]
enum Change {
    None,
    /// Until the motion under way has stopped.
    Waiting(Waiting),
    Surveying(Survey),
    Moving(Ramp),
    /// Until LinuxCNC's interpolators have come to the end, for so many cycles.
    Resting(u32),
    Refused {
        request: Vector3<f64>,
        fault: Fault,
    },
}

impl Tool {
    pub fn new() -> Self {
        Self { offset: Vector3::zeros(), change: Change::None }
    }

    /// The offset in effect.
    pub fn offset(&self) -> Vector3<f64> {
        self.offset
    }

    /// Takes an offset at once.
    pub fn take(&mut self, offset: Vector3<f64>) {
        self.offset = offset;
        self.change = Change::None;
    }

    /// Whether a change is under way, so that nothing else may move.
    pub fn is_busy(&self) -> bool {
        !matches!(self.change, Change::None | Change::Refused { .. })
    }

    /// Whether this offset is in effect.
    #[inline(always)]
    pub fn has(&self, request: &Vector3<f64>) -> bool {
        *request == self.offset
    }

    /// Whether this offset is in effect and nothing is left to be done about it.
    pub fn is_at(&self, request: &Vector3<f64>) -> bool {
        matches!(self.change, Change::None) && self.has(request)
    }

    /// Why this request was refused, if it was.
    pub fn refusal(&self, request: &Vector3<f64>) -> Option<Fault> {
        match &self.change {
            Change::Refused { request: refused, fault } if refused == request => Some(*fault),
            _ => None,
        }
    }

    /// One cycle towards the request.
    ///
    /// # Errors
    /// The fault of a request that is refused from now on. What is in effect stays.
    pub fn advance(&mut self, cycle: &Cycle<'_>) -> Result<(), Fault> {
        let stepped = match &cycle.commanded {
            // Joint mode: inverse is not called, so that nothing can be moved by it.
            None => Ok(Change::None),
            Some(pose) => self.stepped(cycle, pose),
        };
        let refused = |fault| Change::Refused { request: cycle.request, fault };
        self.change = stepped.unwrap_or_else(refused);
        stepped.map(|_| ())
    }

    fn stepped(&mut self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        match self.change {
            Change::None => self.started(cycle, pose),
            Change::Refused { request, .. } if request == cycle.request => Ok(self.change),
            Change::Refused { .. } => self.started(cycle, pose),
            Change::Waiting(waiting) => self.waited(waiting, cycle, pose),
            Change::Surveying(survey) if survey.way.to != cycle.request => {
                self.started(cycle, pose)
            }
            Change::Surveying(survey) => survey.gone_on(cycle, pose),
            Change::Moving(ramp) => self.moved(ramp, cycle, pose),
            Change::Resting(0) => self.started(cycle, pose),
            Change::Resting(cycles) => Ok(Change::Resting(cycles - 1)),
        }
    }

    /// The first step towards a request, if there is one.
    fn started(&mut self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        if self.is_settled(cycle, pose) {
            return Ok(Change::None);
        }
        match cycle.unlimited() {
            Some(fault) => Err(fault),
            None => Ok(Change::Waiting(Waiting { pose: *pose, cycles: 0, seconds: 0.0 })),
        }
    }

    /// Whether nothing is left to be done; a request that moves nothing is taken.
    fn is_settled(&mut self, cycle: &Cycle<'_>, pose: &Pose) -> bool {
        let request = cycle.request;
        // One that cannot be computed with makes inverse fail, which is enough.
        if request == self.offset || cycle.machine.check_tool(&request).is_err() {
            return true;
        }
        let share = if cycle.unlimited().is_some() { NOTICEABLE } else { IMPERCEPTIBLE };
        let moves_nothing =
            shift(pose, &(request - self.offset)).norm() <= share * cycle.machine.size();
        if moves_nothing {
            self.offset = request;
        }
        moves_nothing
    }

    fn waited(
        &mut self,
        waiting: Waiting,
        cycle: &Cycle<'_>,
        pose: &Pose,
    ) -> Result<Change, Fault> {
        if self.is_settled(cycle, pose) {
            return Ok(Change::None);
        }
        let waiting = waiting.gone_on(cycle, pose)?;
        if waiting.cycles < REST_CYCLES {
            return Ok(Change::Waiting(waiting));
        }
        let way = Way { pose: *pose, from: self.offset, to: cycle.request };
        Ok(Change::Surveying(Survey::new(way)))
    }

    fn moved(&mut self, ramp: Ramp, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        ramp.way.held(pose)?;
        let brake = cycle.request != ramp.way.to;
        let ramp = ramp.go_on(brake, cycle.seconds);
        self.offset = ramp.way.at(ramp.share);
        if ramp.share >= 1.0 {
            return Ok(Change::Resting(REST_CYCLES));
        }
        if brake && ramp.speed <= 0.0 {
            self.started(cycle, pose)
        } else {
            Ok(Change::Moving(ramp))
        }
    }
}

/// How far the platform shifts when the offset changes by `change` at a pose: (R − I) Δo.
pub fn shift(pose: &Pose, change: &Vector3<f64>) -> Vector3<f64> {
    pose.rotation() * change - change
}

fn disturbed() -> Fault {
    Cause::ToolChangeDisturbed.into()
}

/// Waiting for the machine to stop.
#[derive(Clone, Copy)]
struct Waiting {
    pose: Pose,
    /// At rest for so many cycles.
    cycles: u32,
    /// Since the change was asked for.
    seconds: f64,
}

impl Waiting {
    fn gone_on(self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Self, Fault> {
        let seconds = self.seconds + cycle.seconds;
        if !(seconds <= MAX_WAIT) {
            return Err(disturbed());
        }
        let cycles = if *pose == self.pose { self.cycles + 1 } else { 0 };
        Ok(Self { pose: *pose, cycles, seconds })
    }
}

/// From one offset to another at a pose that stays.
#[derive(Clone, Copy)]
struct Way {
    pose: Pose,
    from: Vector3<f64>,
    to: Vector3<f64>,
}

impl Way {
    /// The offset after a share of the way, from 0 to 1.
    fn at(&self, share: f64) -> Vector3<f64> {
        if share >= 1.0 { self.to } else { self.from + (self.to - self.from) * share }
    }

    /// Feed is inhibited: a pose that changes nevertheless has come past that.
    fn held(&self, pose: &Pose) -> Result<(), Fault> {
        if *pose == self.pose { Ok(()) } else { Err(disturbed()) }
    }
}

/// What the survey has found of a joint, per share of the way.
#[derive(Clone, Copy, Default)]
struct Course {
    rate: f64,
    largest_rate: f64,
    bend: f64,
    largest_bend: f64,
    /// Of the bend, from one part of the way to the next.
    largest_change: f64,
}

impl Course {
    /// Takes in the rate at the next place.
    fn with(self, place: u32, rate: f64) -> Self {
        let bend = if place > 0 { (rate - self.rate) * f64::from(PARTS) } else { 0.0 };
        let change = if place > 1 { bend - self.bend } else { 0.0 };
        Self {
            rate,
            largest_rate: self.largest_rate.max(rate.abs()),
            bend,
            largest_bend: self.largest_bend.max(bend.abs()),
            largest_change: self.largest_change.max(change.abs()),
        }
    }

    /// Bound of the second derivative: what was seen is the mean of each part, and within
    /// a part it changes about as much as between neighbours.
    fn bend_bound(&self) -> f64 {
        self.largest_bend + self.largest_change
    }

    /// Bound of the rate, between the places too.
    fn rate_bound(&self) -> f64 {
        self.largest_rate + self.bend_bound() / f64::from(PARTS)
    }
}

/// Looks at every place of a way before it is gone.
#[derive(Clone, Copy)]
struct Survey {
    way: Way,
    next: u32,
    courses: [Course; MAX_JOINTS],
}

impl Survey {
    fn new(way: Way) -> Self {
        Self { way, next: 0, courses: [Course::default(); MAX_JOINTS] }
    }

    fn gone_on(mut self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        self.way.held(pose)?;
        for _ in 0..PLACES_PER_CYCLE {
            if self.next > PARTS {
                return Ok(Change::Moving(self.ramp(cycle)));
            }
            self.visit(cycle)?;
            self.next += 1;
        }
        Ok(Change::Surveying(self))
    }

    // A frame of its own: a cycle that freezes a geometry needs none of it.
    #[inline(never)]
    fn visit(&mut self, cycle: &Cycle<'_>) -> Result<(), Fault> {
        let Way { pose, from, to } = &self.way;
        let tool = self.way.at(f64::from(self.next) / f64::from(PARTS));
        let blocked = |fault: Fault| Fault { cause: Cause::ToolOutOfReach, ..fault };
        let joints = cycle.machine.inverse(pose, &tool).map_err(blocked)?;
        within(&joints, cycle)?;
        let travel = shift(pose, &(to - from));
        let before = Pose { position: pose.position - travel / f64::from(PARTS), ..*pose };
        let limit_iterations = cycle.solver.limit_iterations.min(SOLVES_PER_PLACE);
        let solver = Solver { limit_iterations, ..cycle.solver };
        let found = cycle.machine.forward(&joints, &before, &tool, &solver).map_err(blocked)?;
        // Another pose would mean that a singular one lies between this place and the last.
        let miss = found.pose.distance(pose, cycle.machine.radius());
        if !(miss <= SAME_POSE * cycle.machine.size()) {
            return Err(Cause::ToolOutOfReach.into());
        }
        let at = cycle.machine.at(pose, &tool).map_err(blocked)?;
        let jacobian = at.inverse_jacobian().map_err(blocked)?;
        for (i, course) in self.courses.iter_mut().enumerate() {
            let rate = rate_along(&jacobian, i, &travel);
            if !rate.is_finite() {
                return Err(Fault::of_joint(
                    Cause::ToolOutOfReach,
                    cycle.machine.layout(),
                    i,
                    rate,
                ));
            }
            *course = course.with(self.next, rate);
        }
        Ok(())
    }

    /// How the surveyed way is gone. Bounds of one cycle a step or faster need no more.
    fn ramp(&self, cycle: &Cycle<'_>) -> Ramp {
        let mut most_speed = 1.0 / cycle.seconds;
        let mut acceleration = most_speed / cycle.seconds;
        for (course, limits) in self.courses.iter().zip(&cycle.limits) {
            let (rate, bend) = (course.rate_bound(), course.bend_bound());
            most_speed = most_speed
                .min(VELOCITY_SHARE * limits.velocity / rate)
                .min(sqrt(BEND_SHARE * limits.acceleration / bend));
            acceleration = acceleration.min(ACCELERATION_SHARE * limits.acceleration / rate);
        }
        Ramp { way: self.way, share: 0.0, speed: 0.0, most_speed, acceleration }
    }
}

/// Refuses joints beyond their limits.
fn within(joints: &Joints, cycle: &Cycle<'_>) -> Result<(), Fault> {
    let layout = cycle.machine.layout();
    for (i, (joint, limits)) in joints.iter().zip(&cycle.limits).enumerate().take(layout.joints()) {
        if !(*joint >= limits.least && *joint <= limits.most) {
            return Err(Fault::of_joint(Cause::ToolOutOfReach, layout, i, *joint));
        }
    }
    Ok(())
}

/// Rate of joint `i` while the platform travels without turning.
fn rate_along(jacobian: &Jacobian, i: usize, travel: &Vector3<f64>) -> f64 {
    let of = |axis| jacobian.get((i, axis)).map_or(0.0, |rate: &f64| *rate);
    of(0) * travel.x + of(1) * travel.y + of(2) * travel.z
}

/// Going along a surveyed way. Share of the way, and seconds.
#[derive(Clone, Copy)]
struct Ramp {
    way: Way,
    share: f64,
    speed: f64,
    most_speed: f64,
    acceleration: f64,
}

impl Ramp {
    /// One cycle further, or one nearer to standstill.
    ///
    /// At speed v, slower by d in every cycle of t, the rest of the way is
    /// v t + (v − d) t + … = t v (v + d) / 2d; solved for v that is the speed from which
    /// it can still stop at the end. The last step is what is left; from the step before
    /// it the speed falls by at most 9/8 d.
    fn go_on(self, brake: bool, seconds: f64) -> Self {
        let left = 1.0 - self.share;
        let most_change = self.acceleration * seconds;
        let half = most_change / 2.0;
        let stoppable = sqrt(half * half + 2.0 * self.acceleration * left) - half;
        let faster = (self.speed + most_change).min(self.most_speed).min(stoppable);
        let slower = (self.speed - most_change).max(0.0);
        let speed = if brake { slower.min(stoppable) } else { faster };
        let step = speed * seconds;
        // Not more than what is left, nor what rounding would leave for another cycle.
        let share = if step * (1.0 + 1e-9) < left { self.share + step } else { 1.0 };
        Self { share, speed, ..self }
    }
}
