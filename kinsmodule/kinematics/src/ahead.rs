// SPDX-License-Identifier: GPL-2.0-or-later
//! Looks ahead along the present motion: at which speed the machine can still brake before a
//! joint exceeds its speed limit or the pose nears a singularity, and which limits lie within the
//! braking distance.
//!
//! A sample ahead is identified by the time σ at which the motion would reach it at its present
//! speed, and speeds are multiples w of the present speed. That needs no unit: lengths and
//! angles of a pose advance together, as LinuxCNC's planner moves them. With at most w(σ)
//! allowed at σ and a deceleration β (of w, per second), the speed now must satisfy
//! w² ≤ w(σ)² + 2 β σ. Between two samples the right side is nearly straight, so its minimum is
//! at one of them.

use crate::at::At;
use crate::corner::Corner;
use crate::fault::{Cause, Fault};
use crate::layout::{Joints, Layout, MAX_LEGS};
use crate::limits::Limits;
use crate::machine::Machine;
use crate::pose::Pose;
use crate::trig::{RADIANS, sincos_of_one};
use libm::sqrt;
use nalgebra::Vector3;

/// Number of samples ahead of the present pose.
const PLACES: usize = 8;
const BETWEEN: usize = PLACES - 1;

/// Samples ahead that are evaluated in each cycle.
const IN_TURN: u32 = 1;

/// Largest change of direction in one cycle, as a share of the motion, up to which earlier samples
/// remain valid: radians if only the direction changes.
const SAME_DIRECTION: f64 = 0.02;

/// The machine slows down below this multiple of the smallest allowed singular value.
const SLOW_FROM: f64 = 2.0;

/// Share of a joint's speed limit that is used. The rest covers the path between samples and a
/// bend that is not visible before it begins.
const SPEED_SHARE: f64 = 0.98;

/// Share of the accelerations that braking may rely on: LinuxCNC's planner halves them where
/// moves blend, and keeps cos 30° of them along an arc.
const BRAKING_SHARE: f64 = 0.43;

/// A path bends by at most this multiple of what the acceleration allows; more is a corner.
const SHARPEST_BEND: f64 = 2.0;

/// Multiple of the braking distance that is sampled, so that an accelerating machine detects a
/// limit before it must brake for it.
const FARTHER: f64 = 1.2;

/// Speed below which the direction is unknown: machine sizes per second.
const AT_REST: f64 = 1e-6;

/// X, Y, Z moving by less than this share of the rotation counts as rounding.
const ROUNDED: f64 = 1e-6;

/// What the planner is able to do and what it is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Planner {
    /// Acceleration of the control point, machine units per s².
    pub linear: f64,
    /// Acceleration of A, B and C, degrees per s².
    pub angular: f64,
    /// Programmed speed, as a multiple of the present speed.
    pub requested: f64,
    /// Seconds until a response affects the motion.
    pub latency: f64,
    /// For a jogged motion: how many seconds earlier to look for limits. A jog must end before a pose
    /// limit; beyond one it may move in the direction that improves.
    pub notice: Option<f64>,
}

/// The present motion, from poses one period apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pose: [f64; 6],
    /// Per second, in machine units and degrees.
    rate: [f64; 6],
    /// Unit vector towards which the linear part turns, and the turn rate in radians per second.
    normal: Vector3<f64>,
    turn: f64,
    speed: f64,
    /// Rate of a move that is ending while this one begins.
    ending: Option<[f64; 6]>,
}

/// Result of looking ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlook {
    /// Largest speed allowed now, as a multiple of the present one.
    pub allowed: f64,
    /// Largest speed that the machine can have reached when a response takes effect, as a multiple of
    /// the present one.
    pub gathered: f64,
    /// Fault that limits the speed, and the time until it is reached at the present speed.
    pub because: Option<(Fault, f64)>,
    /// First fault within the braking distance.
    pub soon: Option<Fault>,
}

impl Motion {
    /// Computes the motion from the last three poses, oldest first, `period` seconds apart; `linear` is
    /// the acceleration that separates a bend from a corner. Returns `None` at rest.
    pub fn of(machine: &Machine, poses: [&Pose; 3], period: f64, linear: f64) -> Option<Self> {
        let [first, second, pose] = poses.map(Pose::to_degrees);
        let rate: [f64; 6] = core::array::from_fn(|k| (pose[k] - second[k]) / period);
        let (along, before) = (
            Vector3::new(rate[0], rate[1], rate[2]),
            Vector3::from_fn(|k, _| (second[k] - first[k]) / period),
        );
        let turning = Vector3::new(rate[3], rate[4], rate[5]) * core::f64::consts::PI / 180.0;
        let speed = along.norm();
        if !(speed + machine.radius() * turning.norm() > AT_REST * machine.size()) {
            return None;
        }
        let turns = turning.norm() * machine.radius();
        let counted = if speed > ROUNDED * turns { speed } else { norm_of_angles(&rate) };
        let mut motion =
            Self { pose, rate, normal: Vector3::zeros(), turn: 0.0, speed: counted, ending: None };
        let direction = along / speed;
        let bend = along - before - direction * direction.dot(&(along - before));
        let sideways = bend.norm() / period;
        if sideways > 0.0 && sideways <= SHARPEST_BEND * linear {
            motion.normal = bend / bend.norm();
            motion.turn = sideways / speed;
            // The difference of two poses gives the direction half a period ago.
            motion.rate = motion.turned(motion.turn * period / 2.0);
            motion.normal = motion.normal_after(motion.turn * period / 2.0, &direction);
        }
        Some(motion)
    }

    /// Returns the move that begins at a corner: it continues straight, and the rest of the previous
    /// move is added to it at the present pose.
    pub fn beginning(&self, corner: &Corner) -> Self {
        Self {
            pose: self.pose,
            rate: corner.beginning,
            normal: Vector3::zeros(),
            turn: 0.0,
            speed: corner.speed,
            ending: Some(corner.ending),
        }
    }

    /// Returns the speed as LinuxCNC's planner counts it, per second: of X, Y, Z in machine units, or of
    /// A, B, C in degrees if only these move.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Computes the pose after `time` at the present speed, along the present osculating circle.
    pub fn pose_after(&self, time: f64) -> Pose {
        self.after(time).0
    }

    /// Returns the guaranteed deceleration: the decrease of the speed, as a multiple of the present one,
    /// per second. Infinite or NaN if the planner has no such limits.
    pub fn braking(&self, planner: &Planner) -> f64 {
        BRAKING_SHARE * self.acceleration(planner)
    }

    /// Returns planner accelerations that give this motion the deceleration `braking`, a share of its
    /// speed per second. Needed if LinuxCNC's pose moves differently from the machine's.
    pub fn braked(&self, braking: f64, planner: &Planner) -> Planner {
        let angular = self.rate[3].abs().max(self.rate[4].abs()).max(self.rate[5].abs());
        Planner { linear: braking * self.linear().norm(), angular: braking * angular, ..*planner }
    }

    /// Rotates the linear part of the rate by an angle.
    fn turned(&self, angle: f64) -> [f64; 6] {
        let [sine, cosine] = sincos_of_one(angle);
        let speed = self.linear().norm();
        let mut rate = self.rate;
        for (k, value) in rate.iter_mut().enumerate().take(3) {
            *value = *value * cosine + self.normal[k] * speed * sine;
        }
        rate
    }

    fn normal_after(&self, angle: f64, direction: &Vector3<f64>) -> Vector3<f64> {
        let [sine, cosine] = sincos_of_one(angle);
        self.normal * cosine - direction * sine
    }

    fn linear(&self) -> Vector3<f64> {
        Vector3::new(self.rate[0], self.rate[1], self.rate[2])
    }

    /// Computes pose and rate after `time` at the present speed, along the present osculating circle.
    fn after(&self, time: f64) -> (Pose, [f64; 6]) {
        let mut pose: [f64; 6] = core::array::from_fn(|k| self.pose[k] + self.rate[k] * time);
        let angle = self.turn * time;
        if angle > 0.0 {
            let [sine, cosine] = sincos_of_one(angle);
            let radius = self.linear().norm() / self.turn;
            for (k, value) in pose.iter_mut().enumerate().take(3) {
                let ahead = self.rate[k] / self.turn * sine;
                *value = self.pose[k] + ahead + self.normal[k] * radius * (1.0 - cosine);
            }
        }
        (Pose::from_degrees(pose), self.turned(angle))
    }

    /// Returns the largest acceleration of the speed w that the planner uses, per second.
    fn acceleration(&self, planner: &Planner) -> f64 {
        let angular = self.rate[3].abs().max(self.rate[4].abs()).max(self.rate[5].abs());
        let share = |limit: f64, rate: f64| if rate > 0.0 { limit / rate } else { f64::INFINITY };
        let (linear, angular) =
            (share(planner.linear, self.linear().norm()), share(planner.angular, angular));
        // `min` would treat NaN as no limit.
        if linear.is_nan() || linear <= angular { linear } else { angular }
    }
}

/// Returns the norm of the rates of A, B and C, degrees per second.
fn norm_of_angles(rate: &[f64; 6]) -> f64 {
    Vector3::new(rate[3], rate[4], rate[5]).norm()
}

/// Result of one sample.
#[derive(Clone, Copy, Debug)]
struct View {
    /// Largest speed at which every joint keeps its speed limit, and the joint that determines it.
    joints: (f64, Option<Fault>),
    /// First violated pose limit, and by how much it is exceeded.
    refused: Option<(Fault, f64)>,
    /// Whether that limit was kept, or violated by less, at the machine's pose when this was sampled.
    gets_worse: bool,
    /// Whether the legs reach the sampled pose.
    is_reached: bool,
}

/// Samples of earlier cycles, so that each cycle evaluates only the present pose and one pose ahead.
/// A sample is used for at most [`Sight::OLDEST`] cycles, and only while the motion keeps nearly the
/// same direction.
#[derive(Clone, Debug)]
pub struct Sight {
    between: [Option<View>; BETWEEN],
    there: Option<View>,
    singular_value: SingularValue,
    /// Rate of the motion in the previous cycle.
    rate: [f64; 6],
    /// Index of the sample to evaluate next.
    next: usize,
}

impl Sight {
    /// Largest age of a sample, in cycles.
    pub const OLDEST: u8 = PLACES as u8 + 1;

    /// No samples.
    pub const NONE: Self = Self {
        between: [None; BETWEEN],
        there: None,
        singular_value: SingularValue { now: 0.0, change: 0.0, limit: 0.0, requested: 0.0 },
        rate: [0.0; 6],
        next: 0,
    };

    /// Discards the oldest sample and returns the index to start from.
    fn begin_cycle(&mut self) -> usize {
        let due = self.next;
        match self.between.get_mut(due) {
            Some(view) => *view = None,
            None => self.there = None,
        }
        self.next = if due < BETWEEN { due + 1 } else { 0 };
        due
    }

    /// Keeps the samples that remain valid for a motion: all of them if its direction is nearly the
    /// same, with speeds rescaled to the present one.
    fn turn_to(&mut self, motion: &Motion, radius: f64) {
        let length = |rate: &[f64; 6]| {
            let turn =
                (rate[3] * rate[3] + rate[4] * rate[4] + rate[5] * rate[5]) * RADIANS * RADIANS;
            let way = rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2];
            sqrt(way + radius * radius * turn)
        };
        let (now, before) = (length(&motion.rate), length(&self.rate));
        let scale = before / now;
        let change = core::array::from_fn(|k| motion.rate[k] * scale - self.rate[k]);
        if !(length(&change) <= SAME_DIRECTION * before && scale > 0.0 && scale.is_finite()) {
            (self.between, self.there) = ([None; BETWEEN], None);
        }
        for view in self.between.iter_mut().chain([&mut self.there]).flatten() {
            view.joints.0 *= scale;
        }
        self.rate = motion.rate;
    }
}

/// One evaluation along a motion.
struct Look<'a, 'b> {
    tool: &'a Vector3<f64>,
    limits: &'a Limits,
    motion: &'a Motion,
    /// Time to the last sample.
    horizon: f64,
    /// The machine at the pose sampled last.
    at: &'a mut At<'b>,
}

impl At<'_> {
    /// Evaluates all nine samples along a motion. Moves the machine from one to the next, like
    /// [`At::ahead_in_turn`] and [`At::here`].
    pub fn ahead(
        &mut self,
        (tool, limits): (&Vector3<f64>, &Limits),
        motion: &Motion,
        planner: &Planner,
    ) -> Outlook {
        self.look((&mut Sight::NONE.clone(), PLACES as u32), (tool, limits), motion, planner)
    }

    /// Like [`At::ahead`], for successive cycles of a motion: evaluates the present pose and one sample
    /// ahead, also where the motion begins or turns. The latency must include [`Sight::OLDEST`] cycles.
    pub fn ahead_in_turn(
        &mut self,
        sight: &mut Sight,
        (tool, limits): (&Vector3<f64>, &Limits),
        motion: &Motion,
        planner: &Planner,
    ) -> Outlook {
        self.look((sight, IN_TURN), (tool, limits), motion, planner)
    }

    fn look(
        &mut self,
        (sight, most): (&mut Sight, u32),
        (tool, limits): (&Vector3<f64>, &Limits),
        motion: &Motion,
        planner: &Planner,
    ) -> Outlook {
        let acceleration = motion.acceleration(planner);
        let braking = BRAKING_SHARE * acceleration;
        let gathered = 1.0 + acceleration * planner.latency;
        if !(braking > 0.0 && braking.is_finite() && planner.latency >= 0.0) {
            return Outlook { allowed: 0.0, gathered, because: None, soon: None };
        }
        let sooner = planner.notice.unwrap_or(0.0);
        let horizon = planner.latency + sooner + FARTHER / (2.0 * braking);
        sight.turn_to(motion, self.radius());
        let nothing = Outlook { allowed: f64::INFINITY, gathered, because: None, soon: None };
        let look = Look { tool, limits, motion, horizon, at: self };
        look.outlook((sight, most), nothing, (braking, planner))
    }

    /// Returns the first limit violated at a pose, at rest.
    pub fn here(&mut self, tool: &Vector3<f64>, limits: &Limits, pose: &Pose) -> Option<Fault> {
        match self.move_to(pose, tool) {
            Ok(()) => refused(self, limits).map(|(fault, _)| fault),
            Err(fault) => Some(fault),
        }
    }
}

/// Returns the first violated limit, and by how much it is exceeded, in its unit.
fn refused(at: &At<'_>, limits: &Limits) -> Option<(Fault, f64)> {
    let margin = at.first_broken(limits)?;
    Some((margin.fault(at.layout())?, -margin.room()))
}

impl Look<'_, '_> {
    /// Evaluates at most `most` samples beside the present pose: first the end of the path if it is
    /// unknown, then those that are due. Fills in an empty outlook.
    fn outlook(
        mut self,
        (sight, most): (&mut Sight, u32),
        mut outlook: Outlook,
        (braking, planner): (f64, &Planner),
    ) -> Outlook {
        let due = sight.begin_cycle();
        let here = self.here();
        let mut left = most;
        if sight.there.is_none() {
            left -= 1;
            let rows = self.rows_of(&here);
            let now = rows.map_or(0.0, |_| self.at.smallest_singular_value());
            let there = self.view(1.0).after(&here);
            sight.there = Some(there);
            sight.singular_value = self.singular_value((rows, now), &there);
        }
        for k in 0..BETWEEN {
            let k = (due + k) % BETWEEN;
            if let Some(view @ None) = sight.between.get_mut(k)
                && left > 0
            {
                *view = Some(self.view(share(k + 1)).after(&here));
                left -= 1;
            }
        }
        let singular_value = SingularValue { requested: planner.requested, ..sight.singular_value };
        let ends = [Some(here), sight.there];
        let views = ends[..1].iter().chain(&sight.between).chain(&ends[1..]);
        let mut kept_until = 0.0;
        for (k, view) in views.enumerate() {
            let Some(view) = view else { continue };
            let mut time = self.horizon * share(k);
            let (mut allowed, mut because) = view.speed(&singular_value, share(k));
            if planner.notice.is_some() && view.gets_worse {
                // The limit lies somewhere after the last sample that keeps it.
                let fault = view.refused.map(|(fault, _)| fault);
                (time, allowed, because) = (kept_until, 0.0, fault);
            } else {
                kept_until = time;
            }
            let now = speed_before(allowed, braking, time - planner.latency);
            if !(now >= outlook.allowed) {
                outlook.allowed = now;
                // Only the pose farther ahead is near-singular: without the rest of the path there is no limit.
                let nears =
                    allowed > 0.0 && because.is_some_and(|f| f.cause == Cause::ConditioningAhead);
                let until = if nears { self.horizon } else { time };
                outlook.because = because.map(|fault| (fault, until));
            }
            if outlook.soon.is_none() {
                let refused = view.refused.map(|(fault, _)| fault);
                outlook.soon = refused.or(because.filter(|_| allowed < 1.0));
            }
        }
        outlook
    }

    /// Evaluates the present pose. At a corner a joint may only use the speed that the ending move
    /// leaves; if that is the only reason, nothing needs to stop, because that move ends.
    fn here(&mut self) -> View {
        let mut view = self.view(0.0);
        let rates = self
            .motion
            .ending
            .map(|ending| (self.at.rates(&ending), self.at.rates(&self.motion.rate)));
        if let Some((Ok(ending), Ok(rates))) = rates {
            let (limits, layout) = (self.limits, self.at.layout());
            let left = core::array::from_fn(|i| left_of(limits.speed[i], ending[i], rates[i]));
            let limits = Limits { speed: left, ..*limits };
            let (speed, _) = joint_speed(&rates, &limits, layout);
            if speed < view.joints.0 {
                view.joints = (speed, None);
            }
        }
        view
    }

    /// Evaluates the pose at a share of the path.
    fn view(&mut self, share: f64) -> View {
        let (pose, rate) = self.motion.after(self.horizon * share);
        let moved = self.at.move_to(&pose, self.tool);
        match moved.and_then(|()| self.at.rates(&rate)) {
            Ok(rates) => View {
                joints: joint_speed(&rates, self.limits, self.at.layout()),
                refused: refused(self.at, self.limits),
                gets_worse: false,
                is_reached: true,
            },
            Err(fault) => View {
                joints: (0.0, Some(fault)),
                refused: Some((fault, f64::INFINITY)),
                gets_worse: false,
                is_reached: false,
            },
        }
    }

    /// Returns the constraint rows of the last sample if they are limited and the legs reach it.
    fn rows_of(&self, view: &View) -> Option<[[f64; 6]; MAX_LEGS]> {
        (self.limits.conditioning != 0.0 && view.is_reached).then(|| self.at.constraint_rows())
    }

    /// Computes how the smallest singular value changes up to the last sample. Its exact value is
    /// needed only if the change of the rows could bring it near the limit: singular values change
    /// by at most the norm of that change (Weyl).
    fn singular_value(
        &self,
        (rows, now): (Option<[[f64; 6]; MAX_LEGS]>, f64),
        there: &View,
    ) -> SingularValue {
        let limit = self.limits.conditioning;
        let none = SingularValue { now, change: 0.0, limit, requested: 0.0 };
        let Some((rows, then)) = rows.zip(self.rows_of(there)) else { return none };
        let mut square = 0.0;
        for (row, then) in rows.iter().zip(&then) {
            for (a, b) in row.iter().zip(then) {
                square += (a - b) * (a - b);
            }
        }
        if now - sqrt(square) > SLOW_FROM * limit {
            return none;
        }
        SingularValue { change: self.at.smallest_singular_value() - now, ..none }
    }
}

/// Returns the share of the path at sample `k`.
fn share(k: usize) -> f64 {
    k as f64 / PLACES as f64
}

impl View {
    /// Compares the sample with the one at the machine's pose.
    fn after(mut self, here: &Self) -> Self {
        self.gets_worse = self.refused.is_some_and(|(fault, beyond)| {
            !here.refused.is_some_and(|(same, less)| {
                (same.cause, same.part) == (fault.cause, fault.part) && !(beyond > less)
            })
        });
        self
    }

    /// Returns the largest speed at this sample and the fault that limits it.
    fn speed(&self, singular_value: &SingularValue, share: f64) -> (f64, Option<Fault>) {
        match singular_value.speed(share) {
            Some((slower, why)) if !(self.joints.0 <= slower) => (slower, Some(why)),
            _ => self.joints,
        }
    }
}

/// Returns the largest speed at which every joint keeps its limit, as a multiple of the speed with
/// these rates, and the joint that determines it.
fn joint_speed(rates: &Joints, limits: &Limits, layout: &Layout) -> (f64, Option<Fault>) {
    let mut slowest = (f64::INFINITY, None);
    for (i, (rate, limit)) in rates.iter().zip(&limits.speed).enumerate() {
        if *rate == 0.0 {
            continue;
        }
        let allowed = SPEED_SHARE * limit.max(0.0) / rate.abs();
        if !(allowed >= slowest.0) {
            let careful = if allowed.is_nan() { 0.0 } else { allowed };
            slowest = (careful, Some((i, *limit)));
        }
    }
    let (speed, joint) = slowest;
    (speed, joint.map(|(i, limit)| Fault::of_joint(Cause::JointTooFast, layout, i, limit)))
}

/// Returns the part of a joint's speed limit that a move with rate `ending` leaves to another move in
/// the direction of `rate`. Computed from the used share, so that nothing is left once that is used up.
fn left_of(limit: f64, ending: f64, rate: f64) -> f64 {
    let used = if (ending > 0.0) == (rate > 0.0) { ending.abs() } else { 0.0 };
    limit - used / SPEED_SHARE
}

/// Returns the speed now that becomes `allowed` by braking for a time at the present speed.
fn speed_before(allowed: f64, braking: f64, time: f64) -> f64 {
    sqrt(allowed * allowed + 2.0 * braking * time.max(0.0))
}

/// Change of the smallest singular value along the path: the machine slows down below twice the
/// limit if the value decreases. Away from a near-singular pose it may move freely.
#[derive(Clone, Copy, Debug)]
struct SingularValue {
    now: f64,
    change: f64,
    limit: f64,
    requested: f64,
}

impl SingularValue {
    /// Returns the speed allowed at a share of the path, with its reason.
    fn speed(&self, share: f64) -> Option<(f64, Fault)> {
        if self.limit == 0.0 || self.change >= 0.0 {
            return None;
        }
        let singular_value = self.now + self.change * share;
        let part = singular_value / self.limit - 1.0;
        if part >= SLOW_FROM - 1.0 {
            return None;
        }
        let speed = if part > 0.0 { part * self.requested } else { 0.0 };
        Some((speed, Fault::with_value(Cause::ConditioningAhead, singular_value)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Geometry, LegGeometry};
    use crate::layout::MAX_JOINTS;
    use crate::leg::StrutGeometry;
    use crate::letters::Letters;

    const PERIOD: f64 = 1e-3;
    const RADIUS: f64 = 50.0;

    /// Goes straight along X, then along a circle towards Y, while A changes steadily.
    fn way(length: f64) -> Pose {
        let angle = length.max(0.0) / RADIUS;
        let [sine, cosine] = sincos_of_one(angle);
        let x = length.min(0.0) + RADIUS * sine;
        Pose::from_degrees([x, RADIUS * (1.0 - cosine), 0.0, 0.1 * length, 0.0, 0.0])
    }

    /// Returns the motion after `length`, at speed 100, for a machine that brakes with `linear`.
    fn seen(length: f64, linear: f64) -> Motion {
        let poses = [length - 0.2, length - 0.1, length].map(way);
        of(&poses, linear).expect("it moves")
    }

    /// Returns three struts from the floor to one point.
    fn geometry() -> Geometry {
        let strut = |base| LegGeometry::strut(base, [0.0; 3], StrutGeometry::default());
        let legs = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [5.0, 7.0, 0.0]].map(strut);
        let [xyz, none] = ["XYZ", ""].map(|text| Letters::parse(text.as_bytes()).expect("letters"));
        Geometry::new(&legs, xyz, none).expect("a layout")
    }

    fn machine() -> Machine {
        Machine::freeze(&geometry(), &[0.0; MAX_LEGS]).expect("a tripod")
    }

    fn of(poses: &[Pose; 3], linear: f64) -> Option<Motion> {
        Motion::of(&machine(), poses.each_ref(), PERIOD, linear)
    }

    const PLANNER: Planner =
        Planner { linear: 50.0, angular: 400.0, requested: 2.0, latency: 0.0, notice: None };

    fn straight(rate: [f64; 6]) -> Motion {
        let pose = [20.0, 10.0, 100.0, 0.0, 0.0, 0.0];
        Motion { pose, rate, normal: Vector3::zeros(), turn: 0.0, speed: 0.0, ending: None }
    }

    fn apart(motion: &Motion, time: f64, expected: &Pose) -> f64 {
        let (found, expected) = (motion.after(time).0, expected.to_degrees());
        found.to_degrees().iter().zip(expected).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
    }

    #[test]
    fn a_circle_is_gone_on_along() {
        // A speed of 100 on a radius of 50 needs an acceleration of 200.
        let motion = seen(10.0, 200.0);
        for time in [0.0, 0.05, 0.2, 0.5] {
            // Chords of 0.1 are shorter than their arcs by a share of 2e-7, over a path of 50.
            let error = apart(&motion, time, &way(10.0 + 100.0 * time));
            assert!(error < 2e-5, "{error} after {time} s");
            let (_, rate) = motion.after(time);
            let ahead = way(10.0 + 100.0 * time + 1e-4).to_degrees();
            let behind = way(10.0 + 100.0 * time - 1e-4).to_degrees();
            for k in 0..6 {
                let expected = (ahead[k] - behind[k]) / 2e-4 * 100.0;
                assert!((rate[k] - expected).abs() < 1e-3, "{k}: {} {expected}", rate[k]);
            }
        }
    }

    #[test]
    fn a_straight_line_and_a_corner_are_gone_on_straight() {
        let motion = seen(-10.0, 200.0);
        assert!(apart(&motion, 0.05, &way(-5.0)) < 1e-9);
        // Without rounding there is no bend.
        let exact = [1.0, 2.0, 3.0].map(|x| Pose::from_degrees([x, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let motion = of(&exact, 200.0).expect("it moves");
        let later = Pose::from_degrees([1003.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(apart(&motion, 1.0, &later), 0.0);
        // A bend beyond what the acceleration allows is a corner.
        assert!(seen(10.0, 200.0 / SHARPEST_BEND * 1.01).turn > 0.0);
        let corner = seen(10.0, 200.0 / SHARPEST_BEND * 0.99);
        assert_eq!(corner.turn, 0.0);
        let [from, to] = [way(9.9), way(10.0)].map(|pose| pose.to_degrees());
        let straight: [f64; 6] = core::array::from_fn(|k| to[k] + 50.0 * (to[k] - from[k]));
        assert!(apart(&corner, 0.05, &Pose::from_degrees(straight)) < 1e-9);
    }

    #[test]
    fn speeds_before_a_place_are_those_of_even_braking() {
        // From 5 to 3 with 8 per second takes a quarter of a second at a mean of 4.
        assert_eq!(speed_before(3.0, 8.0, 1.0), 5.0);
        assert_eq!(speed_before(3.0, 8.0, -1.0), 3.0);
    }

    #[test]
    fn a_turn_alone_is_a_motion_from_a_millionth_of_the_machine_on() {
        // For a level machine the radius is its size.
        let turned = |share: f64| {
            let angle = (share * AT_REST * PERIOD).to_degrees();
            let poses =
                [-2.0, -1.0, 0.0].map(|k| Pose::from_degrees([0.0, 0.0, 0.0, 0.0, 0.0, k * angle]));
            of(&poses, 1.0)
        };
        assert_eq!(turned(0.99), None);
        assert!(turned(1.01).is_some_and(|motion| motion.turn == 0.0));
    }

    #[test]
    fn speeds_are_those_of_the_lengths_and_where_there_are_none_of_the_angles() {
        let moved = |rate: [f64; 6]| {
            let at = |k: f64| Pose::from_degrees(rate.map(|rate| k * PERIOD * rate));
            of(&[-2.0, -1.0, 0.0].map(at), 1.0).expect("it moves").speed()
        };
        // A few roundings of poses, divided by a period.
        let same = |found: f64, expected: f64| (found - expected).abs() < 1e-12;
        assert!(same(moved([3.0, -4.0, 0.0, 60.0, 0.0, 0.0]), 5.0));
        assert!(same(moved([0.0, 0.0, 0.0, 6.0, -10.0, 8.0]), sqrt(200.0)));
        assert!(same(moved([1e-9, 0.0, 0.0, 0.0, 0.0, 5.0]), 5.0));
    }

    #[test]
    fn speed_changes_by_what_the_planner_does_to_the_faster_part() {
        let motion = straight([3.0, -4.0, 0.0, 6.0, -10.0, 8.0]);
        // 50 for a speed of 5 and 400 for one of 10; then 60 for one of 10.
        assert_eq!(motion.acceleration(&PLANNER), 10.0);
        let turning = Planner { angular: 60.0, ..PLANNER };
        assert_eq!(motion.acceleration(&turning), 6.0);
        assert_eq!(straight([5.0, 0.0, 0.0, 0.0, 0.0, 0.0]).acceleration(&turning), 10.0);
        assert_eq!(straight([0.0, 0.0, 0.0, 10.0, 0.0, 0.0]).acceleration(&turning), 6.0);
        assert!(motion.acceleration(&Planner { linear: f64::NAN, ..PLANNER }).is_nan());
    }

    #[test]
    fn what_was_seen_is_forgotten_where_the_direction_changes_by_a_fiftieth_angles_by_the_radius() {
        let along = [10.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let view = View { joints: (3.0, None), refused: None, gets_worse: false, is_reached: true };
        let kept = |turn: f64, faster: f64| {
            let mut sight = Sight { there: Some(view), rate: along, ..Sight::NONE };
            let rate = [10.0, 0.0, 0.0, turn, 0.0, 0.0].map(|rate| rate * faster);
            sight.turn_to(&straight(rate), RADIUS);
            sight.there.map(|view| view.joints.0)
        };
        // At a radius of 50, a fiftieth of 10 is 0.2292 degrees.
        assert!(kept(0.229, 1.0).is_some() && kept(0.2295, 1.0).is_none());
        // Twice the speed halves the allowed multiple.
        assert_eq!(kept(0.0, 2.0), Some(1.5));
        assert_eq!(kept(0.0, -1.0), None);
    }

    #[test]
    fn the_singular_value_allows_its_part_of_the_speed_between_the_limit_and_twice_that() {
        let singular_value =
            SingularValue { now: 0.375, change: -0.25, limit: 0.125, requested: 4.0 };
        // Left of the singular value: 0.25, 0.1875 and 0.125.
        assert_eq!(singular_value.speed(0.5), None);
        let reported = |singular_value| Fault::with_value(Cause::ConditioningAhead, singular_value);
        assert_eq!(singular_value.speed(0.75), Some((2.0, reported(0.1875))));
        assert_eq!(singular_value.speed(1.0), Some((0.0, reported(0.125))));
        let worse = SingularValue { now: 0.25, ..singular_value };
        assert_eq!(worse.speed(1.0), Some((0.0, reported(0.0))));
        assert_eq!(SingularValue { change: 0.0, now: 0.1, ..singular_value }.speed(1.0), None);
        assert_eq!(SingularValue { limit: 0.0, ..singular_value }.speed(1.0), None);
    }

    #[test]
    fn the_slower_of_joints_and_singular_value_is_reported_with_its_reason() {
        let singular_value =
            SingularValue { now: 0.25, change: -0.0625, limit: 0.125, requested: 4.0 };
        let layout = *machine().layout();
        let view = |speed: f64| {
            let rates = core::array::from_fn(|i| [0.0, -4.0, 2.0, 0.0][i.min(3)]);
            let limits = Limits { speed: [speed; MAX_JOINTS], ..Limits::NONE };
            let joints = joint_speed(&rates, &limits, &layout);
            View { joints, refused: None, gets_worse: false, is_reached: true }
        };
        // The second joint allows 0.98 · 8/4, the singular value 4 · (0.1875/0.125 − 1) at its end.
        let (speed, why) = view(8.0).speed(&singular_value, 1.0);
        assert_eq!(
            (speed, why),
            (1.96, Some(Fault::of_joint(Cause::JointTooFast, &layout, 1, 8.0)))
        );
        let slower = SingularValue { requested: 2.0, ..singular_value };
        let reported = Fault::with_value(Cause::ConditioningAhead, 0.1875);
        assert_eq!(view(8.0).speed(&slower, 1.0), (1.0, Some(reported)));
        assert_eq!(view(f64::INFINITY).speed(&slower, 0.0).0, f64::INFINITY);
    }

    #[test]
    fn a_singular_value_that_falls_below_twice_its_limit_on_the_way_is_reported_soon() {
        let machine = machine();
        // Upwards, where the three struts become parallel.
        let motion = straight([0.0, 0.0, 30.0, 0.0, 0.0, 0.0]);
        let (pose, _) = motion.after(0.0);
        let now = machine.at(&pose, &Vector3::zeros()).expect("a pose").smallest_singular_value();
        let look = |share: f64| {
            let limits = Limits { conditioning: share * now, ..Limits::NONE };
            let planner = Planner { requested: 1.0, ..PLANNER };
            machine.nowhere().ahead((&Vector3::zeros(), &limits), &motion, &planner)
        };
        // The singular value decreases by a fifth.
        assert_eq!(look(0.49).soon.map(|fault| fault.cause), Some(Cause::ConditioningAhead));
        assert_eq!(look(0.3).soon, None);
    }

    #[test]
    fn what_slows_on_the_way_is_reported_soon_and_nothing_brakes_before_the_latency_is_over() {
        let machine = machine();
        let motion = straight([-10.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let look = |limits: &Limits, planner: &Planner| {
            machine.nowhere().ahead((&Vector3::zeros(), limits), &motion, planner)
        };
        let free = look(&Limits::NONE, &PLANNER);
        assert_eq!((free.allowed, free.soon), (f64::INFINITY, None));
        // No joint ever needs more speed than the platform's 10 per second.
        let slow = |most: f64| Limits { speed: [most; MAX_JOINTS], ..Limits::NONE };
        assert_eq!(look(&slow(10.3), &PLANNER).soon, None);
        let soon = look(&slow(0.5), &PLANNER).soon.expect("too fast");
        assert_eq!((soon.cause, soon.value), (Cause::JointTooFast, 0.5));
        // The joints need about 2 now, and 6 after ten seconds towards −X: the machine cannot brake
        // before that.
        let at_once = look(&slow(2.0), &PLANNER);
        let late = look(&slow(2.0), &Planner { latency: 10.0, ..PLANNER });
        assert!(at_once.allowed > 0.9 && at_once.allowed < 1.1, "{at_once:?}");
        assert!(late.allowed > 0.2 && late.allowed < 0.4, "{late:?}");
        // Found by the last but one sample for which it is too late to brake: seven eighths of the
        // latency plus 1.2 times the braking time.
        let (fault, time) = late.because.expect("a reason");
        let expected = 0.875 * (10.0 + FARTHER / (2.0 * BRAKING_SHARE * 5.0));
        assert_eq!(fault.cause, Cause::JointTooFast);
        // A few roundings of ten seconds.
        assert!((time - expected).abs() < 1e-14, "{time} {expected}");
    }
}
