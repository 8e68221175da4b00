// SPDX-License-Identifier: GPL-2.0-or-later
//! The look ahead along a motion: the speed that it allows, and its safety for any input.

use crate::common::machines::declared;
use crate::common::tolerances::{CENTRAL_DIFFERENCE, SPEED_BETWEEN_PLACES, SPEED_SHARE};
use crate::common::{Case, NO_TOOL, cases, direction, rng, uniform};
use kinematics::{Cause, Limits, MAX_JOINTS, MAX_LEGS, Motion, Outlook, Planner, Pose, Sight};
use rand_pcg::Pcg64;

const PERIOD: f64 = 1e-3;

/// Fraction of the planner's acceleration that the core assumes, as in the manual.
const COUNTED_ON: f64 = 0.43;

/// A machine in straight motion. Units of the machine, degrees and seconds.
struct Drive<'a> {
    case: &'a Case,
    pose: [f64; 6],
    rate: [f64; 6],
    limits: Limits,
    planner: Planner,
}

impl<'a> Drive<'a> {
    /// Returns speeds and limits of a typical machine, so that joints limit only some of the motions.
    fn random(case: &'a Case, rng: &mut Pcg64) -> Self {
        let size = case.machine.size();
        let pose = (case.sample)(rng);
        let (go, turn) = (direction(rng) * 0.4 * size, direction(rng) * 30.0);
        let there = Pose::from_degrees(std::array::from_fn(|k| {
            pose.to_degrees()[k] + if k < 3 { go[k] } else { turn[k - 3] }
        }));
        let there = case.without_held(&there).to_degrees();
        let pose = pose.to_degrees();
        Self {
            case,
            pose,
            rate: std::array::from_fn(|k| there[k] - pose[k]),
            limits: Limits {
                min: [-1e99; MAX_JOINTS],
                max: [1e99; MAX_JOINTS],
                speed: std::array::from_fn(|_| uniform(rng, 0.1, 1.0) * size),
                ..Limits::NONE
            },
            planner: Planner {
                linear: uniform(rng, 0.5, 5.0) * size,
                angular: uniform(rng, 50.0, 500.0),
                requested: uniform(rng, 0.5, 2.0),
                latency: 0.0,
                notice: None,
            },
        }
    }

    fn at(&self, time: f64) -> Pose {
        Pose::from_degrees(std::array::from_fn(|k| self.pose[k] + self.rate[k] * time))
    }

    fn motion(&self) -> Option<Motion> {
        let poses = [self.at(-2.0 * PERIOD), self.at(-PERIOD), self.at(0.0)];
        Motion::of(&self.case.machine, poses.each_ref(), PERIOD, self.planner.linear)
    }

    fn outlook(&self) -> Outlook {
        let motion = self.motion().expect("it moves");
        self.case.machine.nowhere().ahead((&NO_TOOL, &self.limits), &motion, &self.planner)
    }

    /// Returns the outlook after a time, using the sight from before.
    fn outlook_in_turn(&self, sight: &mut Sight) -> Outlook {
        let motion = self.motion().expect("it moves");
        let mut at = self.case.machine.nowhere();
        at.ahead_in_turn(sight, (&NO_TOOL, &self.limits), &motion, &self.planner)
    }

    fn later(&self, cycles: u32) -> Self {
        let pose = self.at(f64::from(cycles) * PERIOD).to_degrees();
        Self { pose, limits: self.limits, planner: self.planner, ..*self }
    }

    /// Returns the deceleration as a multiple of the present speed, per second.
    fn braking(&self) -> f64 {
        let norm = |part: &[f64]| part.iter().map(|v| v * v).sum::<f64>().sqrt();
        let fastest = self.rate[3..].iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let linear = self.planner.linear / norm(&self.rate[..3]);
        COUNTED_ON * linear.min(self.planner.angular / fastest)
    }

    /// Returns the largest multiple of the present speed at which no joint is too fast after a time, by
    /// differences of inverse; 0 if there are no joints.
    fn fastest(&self, time: f64) -> f64 {
        let step = 1e-5;
        let inverse = |time| self.case.machine.inverse(&self.at(time), &NO_TOOL).ok();
        let Some((before, after)) = inverse(time - step).zip(inverse(time + step)) else {
            return 0.0;
        };
        let rates = before.iter().zip(&after).map(|(a, b)| (b - a).abs() / (2.0 * step));
        rates
            .zip(&self.limits.speed)
            .map(|(rate, limit)| limit / rate)
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns the largest multiple of the present speed from which the whole path ahead can be braked
    /// for, sampled so densely that nothing is missed, and the deciding position as a fraction of
    /// the braking distance.
    fn least(&self) -> (f64, f64) {
        let braking = self.braking();
        let horizon = 1.0 / (2.0 * braking);
        let speeds = (0..=400).map(|k| {
            let share = f64::from(k) / 400.0;
            let time = horizon * share;
            ((self.fastest(time).powi(2) + 2.0 * braking * time).sqrt(), share)
        });
        speeds.min_by(|one, other| one.0.total_cmp(&other.0)).expect("places")
    }

    /// Returns whether joints exist along the whole path.
    fn stays_within_reach(&self) -> bool {
        let horizon = 0.6 / self.braking();
        (0..=40).all(|k| self.fastest(horizon * f64::from(k) / 40.0) > 0.0)
    }
}

fn each_drive(count: usize, seed: u64, mut check: impl FnMut(&Drive<'_>, &mut Pcg64)) {
    for case in declared() {
        let mut rng = rng(seed);
        for _ in 0..cases(count) {
            let drive = Drive::random(&case, &mut rng);
            check(&drive, &mut rng);
        }
    }
}

#[test]
fn the_speed_allowed_can_be_braked_for_all_that_lies_ahead_and_is_no_slower_than_needed() {
    let (mut here, mut ahead, mut boldest, mut shyest) = (0, 0, 0.0_f64, f64::INFINITY);
    each_drive(300, 71, |drive, rng| {
        // Only one joint is limited, so that the limit is often reached only later on the path.
        let one = uniform(rng, 0.0, drive.case.machine.layout().joints() as f64) as usize;
        let speed =
            std::array::from_fn(|i| if i == one { drive.limits.speed[i] / 3.0 } else { 1e99 });
        let limits = Limits { speed, ..drive.limits };
        let drive = Drive { limits, planner: drive.planner, ..*drive };
        let (needed, share) = drive.least();
        // A path whose braking distance is shorter than itself gives no bound for faster ones.
        if needed < 1.0 && drive.stays_within_reach() {
            let found = drive.outlook().allowed;
            *if share > 0.0 { &mut ahead } else { &mut here } += 1;
            boldest = boldest.max(found / needed);
            shyest = shyest.min(found / needed);
        }
    });
    println!("{here} limited at once, {ahead} ahead: {shyest} to {boldest} of what just suffices");
    assert!(here > cases(1000) && ahead > cases(20), "{here} and {ahead} motions were limited");
    assert!(boldest <= SPEED_BETWEEN_PLACES, "{boldest} of the speed that can be braked");
    assert!(shyest >= SPEED_SHARE, "only {shyest} of the speed that can be braked");
}

#[test]
fn a_wider_margin_never_slows_the_machine() {
    each_drive(60, 72, |drive, rng| {
        let found = drive.outlook().allowed;
        let mut wider = Drive { limits: drive.limits, planner: drive.planner, ..*drive };
        match uniform(rng, 0.0, 3.0) as usize {
            0 => wider.limits.speed = drive.limits.speed.map(|v| v * uniform(rng, 1.0, 2.0)),
            1 => wider.limits.speed[0] *= 2.0,
            _ => wider.limits.conditioning = 0.0,
        }
        let of_wider = wider.outlook().allowed;
        assert!(of_wider >= found, "{}: {found}, with more margin {of_wider}", drive.case.name);
        let mut narrower = Drive { limits: drive.limits, planner: drive.planner, ..*drive };
        narrower.limits.conditioning = uniform(rng, 0.0, 1.0);
        let of_narrower = narrower.outlook().allowed;
        assert!(of_narrower <= found, "{}: {found}, with less {of_narrower}", drive.case.name);
    });
}

#[test]
fn what_takes_longer_to_act_or_brakes_worse_never_makes_it_faster() {
    each_drive(60, 73, |drive, rng| {
        let found = drive.outlook().allowed;
        let mut later = Drive { limits: drive.limits, planner: drive.planner, ..*drive };
        // The sampled positions differ then, so the values between them may differ too.
        later.planner.latency = uniform(rng, 0.0, 0.01);
        assert!(later.outlook().allowed <= found * SPEED_BETWEEN_PLACES / SPEED_SHARE);
        let mut weaker = Drive { limits: drive.limits, planner: drive.planner, ..*drive };
        weaker.planner.linear *= 0.5;
        weaker.planner.angular *= 0.5;
        assert!(weaker.outlook().allowed <= found * SPEED_BETWEEN_PLACES / SPEED_SHARE);
    });
}

/// Tests NaN, infinities, denormals and nonsense in every input of the look ahead.
#[test]
fn no_input_makes_the_allowed_speed_nan_or_negative_and_nan_allows_nothing() {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324, -1.0, 0.0, 1e308];
    each_drive(1, 74, |drive, _| {
        for value in odd {
            for field in 0..12 {
                let mut spoilt = Drive { limits: drive.limits, planner: drive.planner, ..*drive };
                match field {
                    0 => spoilt.limits.speed = [value; MAX_JOINTS],
                    1 => spoilt.planner.linear = value,
                    2 => spoilt.planner.angular = value,
                    3 => spoilt.planner.latency = value,
                    4 => spoilt.planner.requested = value,
                    5 => spoilt.limits.conditioning = value,
                    6 => spoilt.limits.max = [value; MAX_JOINTS],
                    7 => spoilt.limits.base_cone = [value; MAX_LEGS],
                    8 => spoilt.limits.clearance = value,
                    9 => spoilt.limits.tilt = value,
                    10 => spoilt.limits.platform_pyramid = [[value; 2]; MAX_LEGS],
                    _ => spoilt.limits.axis[2] = [f64::NEG_INFINITY, value],
                }
                let found = spoilt.outlook();
                assert!(found.allowed >= 0.0, "field {field} = {value}: {found:?}");
                let turns = drive.rate[3..].iter().any(|rate| *rate != 0.0);
                let travels = drive.rate[..3].iter().any(|rate| *rate != 0.0);
                let needed = [true, travels, turns, true].get(field) == Some(&true);
                let nothing = value.is_nan() && needed;
                assert!(!nothing || found.allowed == 0.0, "field {field}: {found:?}");
                let is_reported = value.is_nan() && [6, 7, 9, 10].contains(&field);
                assert!(!is_reported || found.soon.is_some(), "field {field}: {found:?}");
            }
        }
        for k in (0..6).filter(|k| drive.rate[*k] != 0.0) {
            for value in [f64::NAN, f64::INFINITY] {
                let mut spoilt = Drive { limits: drive.limits, planner: drive.planner, ..*drive };
                spoilt.pose[k] = value;
                assert!(spoilt.motion().is_none(), "a direction from a pose of {value}");
            }
        }
    });
}

#[test]
fn the_hold_of_the_legs_slows_in_proportion_only_on_the_way_where_it_falls() {
    let case = &declared()[0];
    let still = |c: f64, rate: f64| {
        let mut drive = Drive::random(case, &mut rng(75));
        drive.pose = [0.0, 0.0, 250.0, 0.0, 0.0, c];
        drive.rate = [0.0, 0.0, 0.0, 0.0, 0.0, rate];
        drive.limits.speed = [1e99; MAX_JOINTS];
        // Braking so fast that the position itself decides.
        drive.planner = Planner { linear: 1e9, angular: 1e9, requested: 1.0, ..drive.planner };
        drive
    };
    let hold = case
        .machine
        .at(&still(30.0, 1.0).at(0.0), &NO_TOOL)
        .expect("a pose")
        .smallest_singular_value();
    let allowed = |share: f64, rate: f64| {
        let mut drive = still(30.0, rate);
        drive.limits.conditioning = hold / share;
        drive.outlook()
    };
    for share in [0.5, 1.0, 1.25, 1.5, 1.9] {
        let found = allowed(share, 10.0);
        let expected = (share - 1.0).max(0.0);
        // The path ahead, some 1e-8 degrees, changes the conditioning by as little.
        assert!((found.allowed - expected).abs() < 1e-6, "{share}: {found:?}");
        let why = found.because.expect("something limits").0.cause;
        assert_eq!(why, Cause::ConditioningAhead);
        assert!(allowed(share, -10.0).allowed > 1e90, "slowed on the way out");
    }
    assert!(allowed(2.1, 10.0).allowed > 1e90);
}

#[test]
fn a_motion_is_none_at_rest_and_without_a_period() {
    let case = &declared()[0];
    let pose = case.home;
    let of = |poses: [&Pose; 3], period: f64| Motion::of(&case.machine, poses, period, 1e3);
    assert_eq!(of([&pose; 3], PERIOD), None);
    let mut near = pose;
    near.position.x += 1e-9;
    assert_eq!(of([&pose, &pose, &near], PERIOD), None);
    near.position.x += 1e-3;
    assert!(of([&pose, &pose, &near], PERIOD).is_some());
    assert_eq!(of([&pose, &pose, &near], f64::NAN), None);
}

#[test]
fn joints_and_rates_of_a_motion_are_those_of_the_poses_themselves() {
    each_drive(20, 76, |drive, _| {
        let (machine, pose) = (&drive.case.machine, drive.at(0.0));
        let at = machine.at(&pose, &NO_TOOL).expect("a pose");
        drive.case.assert_joints_at(&at, &machine.inverse(&pose, &NO_TOOL).expect("a pose"));
        let rates = at.rates(&drive.rate).expect("rates");
        let step = 1e-6;
        let joints = |time| machine.inverse(&drive.at(time), &NO_TOOL).expect("a pose");
        let (before, after) = (joints(-step), joints(step));
        for (i, rate) in rates.iter().enumerate() {
            let expected = (after[i] - before[i]) / (2.0 * step);
            // The speeds are some hundred units per second, and steps of time 1e-6.
            let most = CENTRAL_DIFFERENCE * (1.0 + expected.abs()) * 100.0;
            assert!((rate - expected).abs() < most, "{}: {rate} {expected}", drive.case.name);
        }
    });
}

#[test]
fn places_looked_at_in_turn_show_what_all_at_once_show_some_cycles_later() {
    let (mut limited, mut most, mut least) = (0, 0.0_f64, f64::INFINITY);
    each_drive(60, 78, |drive, rng| {
        let mut sight = Sight::NONE;
        let all_at_last = |drive: &Drive<'_>, sight: &mut Sight| {
            for _ in 0..Sight::OLDEST {
                drive.outlook_in_turn(sight);
            }
            assert_eq!(drive.outlook_in_turn(sight), drive.outlook());
        };
        all_at_last(drive, &mut sight);
        for cycle in 1..20 {
            let now = drive.later(cycle);
            let (found, whole) = (now.outlook_in_turn(&mut sight), now.outlook());
            if whole.allowed < 2.0 && drive.stays_within_reach() {
                limited += 1;
                most = most.max(found.allowed / whole.allowed);
                least = least.min(found.allowed / whole.allowed);
            }
        }
        // Beyond a corner everything is new.
        let corner = Drive::random(drive.case, rng);
        all_at_last(&corner, &mut sight);
    });
    println!("{limited} looks in turn allow {least} to {most} of those at all places");
    assert!(limited > cases(1000));
    // Eight cycles at 0.4 machine sizes per second are a three hundredth of the machine.
    assert!(most < 1.03 && least > 0.97, "{least} {most}");
}
