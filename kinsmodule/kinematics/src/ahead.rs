// SPDX-License-Identifier: GPL-2.0-or-later
//! Looking ahead along the present motion: which speed lets the machine brake before a
//! joint has to be too fast or the legs hardly hold the platform, and what lies within the
//! braking distance.
//!
//! A place ahead is named by the time σ in which the motion would be there at its present
//! speed, and speeds are multiples w of the present one. That needs no unit: lengths and
//! angles of a pose go on together, as LinuxCNC's planner moves them. With at most w(σ)
//! allowed at σ and a deceleration β (of w, per second), the speed now must satisfy
//! w² ≤ w(σ)² + 2 β σ. Between two places looked at the right side is nearly straight, so that
//! its least value is at one of them.

use crate::fault::{Cause, Fault};
use crate::layout::{Joints, Layout, MAX_LEGS, PerLeg};
use crate::machine::{Machine, Moving, Segment};
use crate::pose::Pose;
use crate::watch::Watch;
use libm::{sincos, sqrt};
use nalgebra::Vector3;

/// Places looked at ahead of the present one.
const PLACES: u32 = 8;

/// Share of a joint's speed limit that is used: what the places between those looked at, and a
/// bend of the path that is not seen before it begins, may add.
const SPEED_SHARE: f64 = 0.98;

/// Share of the accelerations that braking may count on: LinuxCNC's planner halves them where
/// moves blend, and keeps cos 30° of them along an arc.
const BRAKING_SHARE: f64 = 0.43;

/// A path bends at most by this multiple of what the acceleration allows; more is a corner.
const SHARPEST_BEND: f64 = 2.0;

/// Multiple of the braking distance that is looked at, so that a machine that gathers speed
/// sees what comes before it has to brake.
const FARTHER: f64 = 1.2;

/// Speed below which nothing is known of the direction: sizes of the machine per second.
const AT_REST: f64 = 1e-6;

/// What must not be exceeded; infinite or 1e99 where there is no limit.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Smallest joint values.
    pub min: Joints,
    /// Largest joint values.
    pub max: Joints,
    /// Joint speeds, joint units per second.
    pub speed: Joints,
    /// Cones of the base joints, degrees; 0 = no limit.
    pub base_cone: PerLeg,
    /// Cones of the platform joints, degrees; 0 = no limit.
    pub platform_cone: PerLeg,
    /// Conditioning at which the machine has to stand; it slows from twice that.
    pub conditioning: f64,
    /// Smallest distance of legs that share no anchor; 0 = no limit.
    pub clearance: f64,
}

/// What the planner can do, and is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Planner {
    /// Acceleration of the control point, machine units per s².
    pub linear: f64,
    /// Acceleration of A, B and C, degrees per s².
    pub angular: f64,
    /// Speed that the program asks for, as a multiple of the present one.
    pub requested: f64,
    /// Seconds until an answer acts on the motion.
    pub latency: f64,
}

/// The present motion, from poses one period apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pose: [f64; 6],
    /// Per second, machine units and degrees.
    rate: [f64; 6],
    /// Unit vector that the linear part turns towards, and how fast, radians per second.
    normal: Vector3<f64>,
    turn: f64,
}

/// What lies ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlook {
    /// Largest speed allowed now, as a multiple of the present one.
    pub allowed: f64,
    /// What limits it, and the time at the present speed until there.
    pub because: Option<(Fault, f64)>,
    /// The first thing within the braking distance that is not allowed.
    pub soon: Option<Fault>,
}

impl Motion {
    /// Of the last three poses, oldest first, `period` seconds apart; `linear` is the
    /// acceleration that tells a bend from a corner. `None` where the machine stands still.
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
        let mut motion = Self { pose, rate, normal: Vector3::zeros(), turn: 0.0 };
        let direction = along / speed;
        let bend = along - before - direction * direction.dot(&(along - before));
        let sideways = bend.norm() / period;
        if sideways > 0.0 && sideways <= SHARPEST_BEND * linear {
            motion.normal = bend / bend.norm();
            motion.turn = sideways / speed;
            // The difference of two poses shows the direction half a period ago.
            motion.rate = motion.turned(motion.turn * period / 2.0);
            motion.normal = motion.normal_after(motion.turn * period / 2.0, &direction);
        }
        Some(motion)
    }

    /// The rate after its linear part has turned by an angle.
    fn turned(&self, angle: f64) -> [f64; 6] {
        let (sine, cosine) = sincos(angle);
        let speed = self.linear().norm();
        let mut rate = self.rate;
        for (k, value) in rate.iter_mut().enumerate().take(3) {
            *value = *value * cosine + self.normal[k] * speed * sine;
        }
        rate
    }

    fn normal_after(&self, angle: f64, direction: &Vector3<f64>) -> Vector3<f64> {
        let (sine, cosine) = sincos(angle);
        self.normal * cosine - direction * sine
    }

    fn linear(&self) -> Vector3<f64> {
        Vector3::new(self.rate[0], self.rate[1], self.rate[2])
    }

    /// Pose and rate after `time` at the present speed, along the circle that the path
    /// now follows.
    fn after(&self, time: f64) -> (Pose, [f64; 6]) {
        let mut pose: [f64; 6] = core::array::from_fn(|k| self.pose[k] + self.rate[k] * time);
        let angle = self.turn * time;
        if angle > 0.0 {
            let (sine, cosine) = sincos(angle);
            let radius = self.linear().norm() / self.turn;
            for (k, value) in pose.iter_mut().enumerate().take(3) {
                let ahead = self.rate[k] / self.turn * sine;
                *value = self.pose[k] + ahead + self.normal[k] * radius * (1.0 - cosine);
            }
        }
        (Pose::from_degrees(pose), self.turned(angle))
    }

    /// Deceleration of the speed w that the planner is sure to reach, per second.
    fn braking(&self, planner: &Planner) -> f64 {
        let angular = self.rate[3].abs().max(self.rate[4].abs()).max(self.rate[5].abs());
        let share = |limit: f64, rate: f64| if rate > 0.0 { limit / rate } else { f64::INFINITY };
        let (linear, angular) =
            (share(planner.linear, self.linear().norm()), share(planner.angular, angular));
        // Not `min`, which would take NaN for no limit.
        BRAKING_SHARE * if linear.is_nan() || linear <= angular { linear } else { angular }
    }
}

/// A place on the way.
struct Place<'a> {
    machine: &'a Machine,
    tool: &'a Vector3<f64>,
    pose: Pose,
    rate: [f64; 6],
}

impl Watch {
    /// Looks along a motion; work is bounded: nine places.
    pub fn ahead(
        &self,
        machine: &Machine,
        tool: &Vector3<f64>,
        limits: &Limits,
        motion: &Motion,
        planner: &Planner,
    ) -> Outlook {
        let braking = motion.braking(planner);
        if !(braking > 0.0 && braking.is_finite() && planner.latency >= 0.0) {
            return Outlook { allowed: 0.0, because: None, soon: None };
        }
        let horizon = planner.latency + FARTHER / (2.0 * braking);
        let at = |time: f64| {
            let (pose, rate) = motion.after(time);
            Place { machine, tool, pose, rate }
        };
        let hold = Hold::between(&at(0.0), &at(horizon), limits, planner.requested);
        let mut outlook = Outlook { allowed: f64::INFINITY, because: None, soon: None };
        for k in 0..=PLACES {
            let share = f64::from(k) / f64::from(PLACES);
            let time = horizon * share;
            let place = at(time);
            let moving = place.moving();
            let (allowed, because) = match &moving {
                Ok(moving) => moving.speed(machine.layout(), limits, &hold, share),
                Err(fault) => (0.0, Some(*fault)),
            };
            let now = speed_before(allowed, braking, time - planner.latency);
            if !(now >= outlook.allowed) {
                outlook.allowed = now;
                outlook.because = because.map(|fault| (fault, time));
            }
            if outlook.soon.is_none() {
                let slower = because.filter(|_| allowed < 1.0);
                outlook.soon = self.refused(&place, moving, limits).or(slower);
            }
        }
        outlook
    }

    /// What is not allowed at the pose, at rest.
    pub fn here(
        &self,
        machine: &Machine,
        tool: &Vector3<f64>,
        limits: &Limits,
        pose: &Pose,
    ) -> Option<Fault> {
        let place = Place { machine, tool, pose: *pose, rate: [0.0; 6] };
        self.refused(&place, place.moving(), limits)
    }

    fn refused(
        &self,
        place: &Place<'_>,
        moving: Result<Moving, Fault>,
        limits: &Limits,
    ) -> Option<Fault> {
        let moving = match moving {
            Ok(moving) => moving,
            Err(fault) => return Some(fault),
        };
        moving
            .outside(limits, place.machine.layout())
            .or_else(|| self.leaning(place, &moving.segments, limits))
    }

    /// A leg outside its cones, or too near to another.
    fn leaning(
        &self,
        place: &Place<'_>,
        legs: &[Segment; MAX_LEGS],
        limits: &Limits,
    ) -> Option<Fault> {
        let cones = self.cones(&place.pose.rotation(), legs);
        let beyond = |angles: &PerLeg, limits: &PerLeg, cause: Cause| {
            let outside = |angle: &f64, limit: &f64| *limit != 0.0 && !(angle <= limit);
            let found = angles.iter().zip(limits).position(|(angle, limit)| outside(angle, limit));
            found.map(|i| Fault::of_leg(cause, i, angles.get(i).copied().unwrap_or(0.0)))
        };
        let near = || {
            let nearest = (limits.clearance != 0.0).then(|| self.nearest(legs))??;
            let touches = !(nearest.distance >= limits.clearance);
            touches.then(|| Fault::of_legs(Cause::LegsNear, nearest.pair, nearest.distance))
        };
        beyond(&cones.base, &limits.base_cone, Cause::BaseConeAhead)
            .or_else(|| beyond(&cones.platform, &limits.platform_cone, Cause::PlatformConeAhead))
            .or_else(near)
    }
}

/// Speed now that becomes `allowed` by braking for a time at the present speed.
fn speed_before(allowed: f64, braking: f64, time: f64) -> f64 {
    sqrt(allowed * allowed + 2.0 * braking * time.max(0.0))
}

/// How the legs' hold on the platform changes along the way: slow from twice the limit on, if
/// it gets worse. On the way out of such a pose the machine may move.
struct Hold {
    now: f64,
    change: f64,
    limit: f64,
    requested: f64,
}

impl Hold {
    fn between(here: &Place<'_>, there: &Place<'_>, limits: &Limits, requested: f64) -> Self {
        // Where no leg could stand at all, the place itself says so.
        let of = |place: &Place<'_>| place.machine.conditioning(&place.pose, place.tool).ok();
        let now = of(here).unwrap_or(0.0);
        Self {
            now,
            change: of(there).map_or(0.0, |t| t - now),
            limit: limits.conditioning,
            requested,
        }
    }

    /// Speed at a share of the way, with its reason.
    fn speed(&self, share: f64) -> Option<(f64, Fault)> {
        if self.limit == 0.0 || self.change >= 0.0 {
            return None;
        }
        let hold = self.now + self.change * share;
        let part = hold / self.limit - 1.0;
        if part >= 1.0 {
            return None;
        }
        let speed = if part > 0.0 { part * self.requested } else { 0.0 };
        Some((speed, Fault::with_value(Cause::HoldAhead, hold)))
    }
}

impl Place<'_> {
    fn moving(&self) -> Result<Moving, Fault> {
        self.machine.moving(&self.pose, self.tool, &self.rate)
    }
}

impl Moving {
    /// Largest speed here and what limits it.
    fn speed(
        &self,
        layout: &Layout,
        limits: &Limits,
        hold: &Hold,
        share: f64,
    ) -> (f64, Option<Fault>) {
        let (joints, fault) = self.joint_speed(layout, limits);
        match hold.speed(share) {
            Some((slower, why)) if !(joints <= slower) => (slower, Some(why)),
            _ => (joints, fault),
        }
    }

    /// Largest speed at which no joint is too fast, and the joint.
    fn joint_speed(&self, layout: &Layout, limits: &Limits) -> (f64, Option<Fault>) {
        let mut slowest = (f64::INFINITY, None);
        for (i, (rate, limit)) in self.rates.iter().zip(&limits.speed).enumerate() {
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
        let named = |(i, limit)| Fault::of_joint(Cause::JointTooFast, layout, i, limit);
        (speed, joint.map(named))
    }

    /// A joint outside its range.
    fn outside(&self, limits: &Limits, layout: &Layout) -> Option<Fault> {
        let ranges = limits.min.iter().zip(&limits.max);
        for (i, (joint, (min, max))) in
            self.joints.iter().zip(ranges).enumerate().take(layout.joints())
        {
            if !(joint >= min && joint <= max) {
                return Some(Fault::of_joint(Cause::JointLimitAhead, layout, i, *joint));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Geometry, LegGeometry};
    use crate::layout::{Letters, MAX_JOINTS};
    use crate::leg::StrutGeometry;

    const PERIOD: f64 = 1e-3;
    const RADIUS: f64 = 50.0;

    /// Straight along X, then on a circle that turns to Y; A goes on all the while.
    fn way(length: f64) -> Pose {
        let angle = length.max(0.0) / RADIUS;
        let (sine, cosine) = sincos(angle);
        let x = length.min(0.0) + RADIUS * sine;
        Pose::from_degrees([x, RADIUS * (1.0 - cosine), 0.0, 0.1 * length, 0.0, 0.0])
    }

    /// As seen after `length`, at 100 a second, by a machine that brakes with `linear`.
    fn seen(length: f64, linear: f64) -> Motion {
        let poses = [length - 0.2, length - 0.1, length].map(way);
        of(&poses, linear).expect("it moves")
    }

    /// Three struts from the floor to one point.
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

    const NO_LIMITS: Limits = Limits {
        min: [f64::NEG_INFINITY; MAX_JOINTS],
        max: [f64::INFINITY; MAX_JOINTS],
        speed: [f64::INFINITY; MAX_JOINTS],
        base_cone: [0.0; MAX_LEGS],
        platform_cone: [0.0; MAX_LEGS],
        conditioning: 0.0,
        clearance: 0.0,
    };

    const PLANNER: Planner = Planner { linear: 50.0, angular: 400.0, requested: 2.0, latency: 0.0 };

    fn straight(rate: [f64; 6]) -> Motion {
        let pose = [20.0, 10.0, 100.0, 0.0, 0.0, 0.0];
        Motion { pose, rate, normal: Vector3::zeros(), turn: 0.0 }
    }

    fn apart(motion: &Motion, time: f64, expected: &Pose) -> f64 {
        let (found, expected) = (motion.after(time).0, expected.to_degrees());
        found.to_degrees().iter().zip(expected).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
    }

    #[test]
    fn a_circle_is_gone_on_along() {
        // 100 a second on a radius of 50 take 200 a second².
        let motion = seen(10.0, 200.0);
        for time in [0.0, 0.05, 0.2, 0.5] {
            // Chords of 0.1 are shorter than their arcs by 2e-7 of them, over a way of 50.
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
        // Without a rounding there is no bend at all.
        let exact = [1.0, 2.0, 3.0].map(|x| Pose::from_degrees([x, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let motion = of(&exact, 200.0).expect("it moves");
        let later = Pose::from_degrees([1003.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(apart(&motion, 1.0, &later), 0.0);
        // What the acceleration could never have bent is a corner; a little more could.
        assert!(seen(10.0, 200.0 / SHARPEST_BEND * 1.01).turn > 0.0);
        let corner = seen(10.0, 200.0 / SHARPEST_BEND * 0.99);
        assert_eq!(corner.turn, 0.0);
        let [from, to] = [way(9.9), way(10.0)].map(|pose| pose.to_degrees());
        let straight: [f64; 6] = core::array::from_fn(|k| to[k] + 50.0 * (to[k] - from[k]));
        assert!(apart(&corner, 0.05, &Pose::from_degrees(straight)) < 1e-9);
    }

    #[test]
    fn speeds_before_a_place_are_those_of_even_braking() {
        // From 5 to 3 with 8 a second takes a quarter of a second at a mean of 4.
        assert_eq!(speed_before(3.0, 8.0, 1.0), 5.0);
        assert_eq!(speed_before(3.0, 8.0, -1.0), 3.0);
    }

    #[test]
    fn a_turn_alone_is_a_motion_from_a_millionth_of_the_machine_on() {
        // Level machines have their size for a radius.
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
    fn braking_is_the_share_of_what_the_planner_does_to_the_faster_part() {
        let motion = straight([3.0, -4.0, 0.0, 6.0, -10.0, 8.0]);
        // 50 for a speed of 5 and 400 for one of 10; then 60 for one of 10.
        assert_eq!(motion.braking(&PLANNER), BRAKING_SHARE * 10.0);
        let turning = Planner { angular: 60.0, ..PLANNER };
        assert_eq!(motion.braking(&turning), BRAKING_SHARE * 6.0);
        assert_eq!(
            straight([5.0, 0.0, 0.0, 0.0, 0.0, 0.0]).braking(&turning),
            BRAKING_SHARE * 10.0
        );
        assert_eq!(
            straight([0.0, 0.0, 0.0, 10.0, 0.0, 0.0]).braking(&turning),
            BRAKING_SHARE * 6.0
        );
        assert!(motion.braking(&Planner { linear: f64::NAN, ..PLANNER }).is_nan());
    }

    #[test]
    fn the_hold_allows_its_part_of_the_speed_between_the_limit_and_twice_that() {
        let hold = Hold { now: 0.375, change: -0.25, limit: 0.125, requested: 4.0 };
        // 0.25, 0.1875 and 0.125 of the hold are left.
        assert_eq!(hold.speed(0.5), None);
        let told = |hold| Fault::with_value(Cause::HoldAhead, hold);
        assert_eq!(hold.speed(0.75), Some((2.0, told(0.1875))));
        assert_eq!(hold.speed(1.0), Some((0.0, told(0.125))));
        let worse = Hold { now: 0.25, ..hold };
        assert_eq!(worse.speed(1.0), Some((0.0, told(0.0))));
        assert_eq!(Hold { change: 0.0, now: 0.1, ..hold }.speed(1.0), None);
        assert_eq!(Hold { limit: 0.0, ..hold }.speed(1.0), None);
    }

    #[test]
    fn the_slower_of_joints_and_hold_is_told_with_its_reason() {
        let hold = Hold { now: 0.25, change: -0.0625, limit: 0.125, requested: 4.0 };
        let pose = Pose::from_degrees([20.0, 10.0, 100.0, 0.0, 0.0, 0.0]);
        let moving = machine().moving(&pose, &Vector3::zeros(), &[0.0; 6]).expect("within reach");
        let rates = core::array::from_fn(|i| [0.0, -4.0, 2.0, 0.0][i.min(3)]);
        let moving = Moving { rates, ..moving };
        let limits = Limits { speed: [8.0; MAX_JOINTS], ..NO_LIMITS };
        let layout = *machine().layout();
        // The second joint allows 0.98 · 8/4, the hold 4 · (0.1875/0.125 − 1) at its end.
        let (speed, why) = moving.speed(&layout, &limits, &hold, 1.0);
        assert_eq!(
            (speed, why),
            (1.96, Some(Fault::of_joint(Cause::JointTooFast, &layout, 1, 8.0)))
        );
        let slower = Hold { requested: 2.0, ..hold };
        let told = Fault::with_value(Cause::HoldAhead, 0.1875);
        assert_eq!(moving.speed(&layout, &limits, &slower, 1.0), (1.0, Some(told)));
        assert_eq!(moving.speed(&layout, &NO_LIMITS, &slower, 0.0), (f64::INFINITY, None));
    }

    #[test]
    fn what_slows_on_the_way_is_told_soon_and_nothing_brakes_before_the_latency_is_over() {
        let machine = machine();
        let watch = Watch::new(&machine, &geometry());
        let motion = straight([-10.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let look = |limits: &Limits, planner: &Planner| {
            watch.ahead(&machine, &Vector3::zeros(), limits, &motion, planner)
        };
        let free = look(&NO_LIMITS, &PLANNER);
        assert_eq!((free.allowed, free.soon), (f64::INFINITY, None));
        // No joint ever has to be faster than the platform with its 10 a second.
        let slow = |most: f64| Limits { speed: [most; MAX_JOINTS], ..NO_LIMITS };
        assert_eq!(look(&slow(10.3), &PLANNER).soon, None);
        let soon = look(&slow(0.5), &PLANNER).soon.expect("too fast");
        assert_eq!((soon.cause, soon.value), (Cause::JointTooFast, 0.5));
        // The joints need some 2 now, and 6 after ten seconds towards −X, before which the
        // machine cannot brake.
        let at_once = look(&slow(2.0), &PLANNER);
        let late = look(&slow(2.0), &Planner { latency: 10.0, ..PLANNER });
        assert!(at_once.allowed > 0.9 && at_once.allowed < 1.1, "{at_once:?}");
        assert!(late.allowed > 0.2 && late.allowed < 0.4, "{late:?}");
        // Told by the last place but one that cannot be braked for: seven eighths of latency and
        // 1.2 times the braking time.
        let (fault, time) = late.because.expect("a reason");
        let expected = 0.875 * (10.0 + FARTHER / (2.0 * BRAKING_SHARE * 5.0));
        assert_eq!(fault.cause, Cause::JointTooFast);
        // Some roundings of ten seconds.
        assert!((time - expected).abs() < 1e-14, "{time} {expected}");
    }
}
