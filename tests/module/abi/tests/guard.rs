// SPDX-License-Identifier: GPL-2.0-or-later
//! The monitor's guard of the motion: the values of its pins, and the feed that it allows.

use abi_tests::geometry::{Vector, cross, dot, minus, norm, plus, rotation, scaled, turned, unit};
use abi_tests::machines::{PAPER_004_HOME, paper_004, paper_004_pose};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::{Kind, Parallel};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, subjects};
use kinematics::Cause;
use nalgebra::DMatrix;

const PERIOD: f64 = 1e-3;

/// Moves the machine to a pose as LinuxCNC does in a cycle: feedback, then command.
fn cycle(module: &Module, feedback: &Pose, command: &Pose) {
    let joints = module.inverse(feedback).expect("a pose of the workspace");
    module.follow(&joints, feedback).expect("its own joints");
    module.inverse(command).expect("a pose of the workspace");
    module.monitor();
}

// ---------------------------------------------------------------- what is shown at a pose

/// Returns the directions of the legs, base to platform, in base.
fn directions(machine: &Parallel, pose: &Pose, joints: &Joints) -> Vec<Vector> {
    (0..machine.legs.len()).map(|n| unit(machine.span(pose, n, joints[n]))).collect()
}

fn angle(a: Vector, b: Vector) -> f64 {
    norm(cross(a, b)).atan2(dot(a, b)).to_degrees()
}

fn untilted(pose: &Pose, v: Vector) -> Vector {
    let r = rotation(pose);
    std::array::from_fn(|k| (0..3).map(|i| r[i][k] * v[i]).sum())
}

/// Returns the rows of the legs over the active coordinates, by small motions of the platform.
fn rows(subject: &Subject, pose: &Pose, directions: &[Vector]) -> Vec<Vec<f64>> {
    let machine = &subject.machine;
    let moved = |k: usize| machine.coordinates.contains(["X", "Y", "Z", "A", "B", "C"][k]);
    let legs = machine.legs.len() as f64;
    let centroid: Vector =
        std::array::from_fn(|k| machine.legs.iter().map(|l| l.platform[k]).sum::<f64>() / legs);
    let reference = if (0..3).all(moved) { centroid } else { machine.centre };
    let group = (3..6).all(moved);
    // In the platform: a ring's point at its strut.
    let end = |n: usize| {
        let along_ring = minus(machine.anchor(pose, n), machine.joint_centre(pose, n));
        plus(machine.legs[n].platform, untilted(pose, along_ring))
    };
    let of = |n: usize, k: usize| {
        let arm = turned(&rotation(pose), minus(end(n), reference));
        let mut axis = [0.0; 3];
        if k < 3 || group {
            axis[k % 3] = 1.0;
        }
        let speed = match k {
            0..3 => axis,
            _ if group => scaled(cross(axis, arm), 1.0 / machine.radius()),
            _ => by_angle(pose, minus(end(n), reference), k, machine.radius()),
        };
        dot(directions[n], speed)
    };
    let active: Vec<usize> = (0..6).filter(|k| moved(*k)).collect();
    (0..machine.legs.len()).map(|n| active.iter().map(|k| of(n, *k)).collect()).collect()
}

/// Returns the velocity of a platform point per unit of radius · angle `k` of the pose.
fn by_angle(pose: &Pose, point: Vector, k: usize, radius: f64) -> Vector {
    // A millionth of a radian: differences accurate to nine digits.
    let step = 1e-6_f64;
    let at = |sign: f64| {
        let mut turned_pose = *pose;
        turned_pose[k] += sign * step.to_degrees();
        turned(&rotation(&turned_pose), point)
    };
    scaled(minus(at(1.0), at(-1.0)), 1.0 / (2.0 * step * radius))
}

fn smallest_singular_value(rows: &[Vec<f64>]) -> f64 {
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, k| rows[i][k]).singular_values().min()
}

/// Returns the distance of two segments, by ternary search along both (it is convex).
fn distance(one: [Vector; 2], other: [Vector; 2]) -> f64 {
    let at = |s: [Vector; 2], share: f64| plus(s[0], scaled(minus(s[1], s[0]), share));
    let least = |f: &dyn Fn(f64) -> f64| {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..80 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if f(a) < f(b) { high = b } else { low = a }
        }
        f((low + high) / 2.0)
    };
    least(&|s| least(&|t| norm(minus(at(one, s), at(other, t)))))
}

/// Returns the nearest pair of legs that share no anchor.
fn nearest(machine: &Parallel, pose: &Pose, joints: &Joints) -> Option<(f64, [usize; 2])> {
    let segment = |n: usize| {
        let top = machine.anchor(pose, n);
        [minus(top, machine.span(pose, n, joints[n])), top]
    };
    let mut all = vec![];
    for j in 0..machine.legs.len() {
        for i in 0..j {
            let (one, other) = (&machine.legs[i], &machine.legs[j]);
            let is = |leg: &abi_tests::parallel::Leg, kind: &str| leg.kind.name() == kind;
            let fixed = |leg| is(leg, "strut") || is(leg, "ring");
            let base = one.base == other.base && fixed(one) && fixed(other);
            let points = !is(one, "ring") && !is(other, "ring");
            if !base && (one.platform != other.platform || !points) {
                all.push((distance(segment(i), segment(j)), [i, j]));
            }
        }
    }
    all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
}

fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found}, expected {expected}");
}

#[test]
fn every_value_at_a_pose_is_that_of_an_independent_computation() {
    for subject in subjects() {
        let mut random = Random::new(61);
        let machine = &subject.machine;
        let module = machine.module();
        let home_joints = module.inverse(&subject.home()).expect("home");
        let home = directions(machine, &subject.home(), &home_joints);
        for _ in 0..cases(20) {
            let pose = (subject.sample)(&mut random);
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            for n in 0..machine.joints() {
                module.set(&format!("min-limit.{n}"), joints[n] - 3.0 - n as f64);
                module.set(&format!("max-limit.{n}"), joints[n] + 5.0);
            }
            cycle(&module, &pose, &pose);
            module.monitor_until_all_is_shown();
            check_joints(&subject, &module, &pose);
            let now = directions(machine, &pose, &joints);
            let name = subject.name;
            for n in 0..machine.legs.len() {
                // 1e-9 degrees: roundings of coordinates a million times smaller than a leg.
                let base = module.get(&format!("base-angle.{n}"));
                close(base, angle(now[n], home[n]), 1e-9, name);
                let platform = module.get(&format!("platform-angle.{n}"));
                close(platform, angle(untilted(&pose, now[n]), home[n]), 1e-9, name);
            }
            let expected = smallest_singular_value(&rows(&subject, &pose, &now));
            // 1e-6: differences by angle are accurate to nine digits, and the root of AᵀA halves
            // the digits of small values.
            close(module.get("conditioning"), expected, 1e-6, name);
            check_nearest(&subject, &module, &pose, &joints);
        }
    }
}

fn check_joints(subject: &Subject, module: &Module, pose: &Pose) {
    let step = 1e-4 * subject.machine.size();
    for n in 0..subject.machine.joints() {
        let margin = module.get(&format!("margin.{n}"));
        // Forward's pose equals the requested one to 1e-10 of the size.
        close(margin, 3.0_f64.min(5.0).max(3.0 + n as f64).min(5.0), 1e-6, subject.name);
        let rate = |k: usize| {
            if !subject.machine.moves(k) {
                return 0.0;
            }
            let at = |sign: f64| {
                let mut moved = *pose;
                moved[k] += sign * step;
                module.inverse(&moved).expect("beside a pose of the workspace")[n]
            };
            (at(1.0) - at(-1.0)) / (2.0 * step)
        };
        let expected = norm([rate(0), rate(1), rate(2)]);
        // Steps of 1e-4 of the size: the third derivative leaves 1e-8 times a factor that grows
        // with the ratio.
        let found = module.get(&format!("speed-ratio.{n}"));
        close(found, expected, 1e-5 * (1.0 + expected.powi(3)), subject.name);
    }
}

fn check_nearest(subject: &Subject, module: &Module, pose: &Pose, joints: &Joints) {
    let found = ["rod-pair-a", "rod-pair-b"].map(|pin| module.get(pin));
    match nearest(&subject.machine, pose, joints) {
        None => {
            assert_eq!(found, [-1.0, -1.0]);
            assert_eq!(module.get("rod-distance"), 1e99);
        }
        Some((distance, pair)) => {
            // The ternary search finds the least value to the root of rounding.
            close(
                module.get("rod-distance"),
                distance,
                1e-6 * subject.machine.size(),
                subject.name,
            );
            let expected = pair.map(|n| n as f64);
            let other = found.map(|n| n as usize);
            if found != expected {
                // By symmetry two pairs may be equally near.
                let again = pair_distance(subject, pose, joints, other);
                close(again, distance, 1e-6 * subject.machine.size(), subject.name);
            }
        }
    }
}

fn pair_distance(subject: &Subject, pose: &Pose, joints: &Joints, pair: [usize; 2]) -> f64 {
    let machine = &subject.machine;
    let [one, other] = pair.map(|n| {
        let top = machine.anchor(pose, n);
        [minus(top, machine.span(pose, n, joints[n])), top]
    });
    distance(one, other)
}

// ---------------------------------------------------------------- the feed it allows

/// A planner as simple as LinuxCNC's along one move: the speed follows the scaled feed at a given
/// acceleration, and decreases toward the end.
struct Drive<'a> {
    module: &'a Module,
    path: &'a dyn Fn(f64) -> Pose,
    length: f64,
    feed: f64,
    acceleration: f64,
}

#[derive(Default)]
struct Run {
    cycles: usize,
    /// Largest joint speed as a share of the limit.
    fastest: f64,
    scales: Vec<f64>,
    inhibited: bool,
    /// Its end.
    at: f64,
}

impl Drive<'_> {
    /// Runs the move from standstill; `guarded` is M52 P1.
    fn run(&self, guarded: bool) -> Run {
        let (mut s, mut v) = (0.0, 0.0);
        let mut run = Run::default();
        let mut before: Option<Joints> = None;
        while s < self.length * (1.0 - 1e-9) && run.cycles < 60_000 {
            let inhibited = self.module.is_on("feed-inhibit");
            let scale = if guarded { self.module.get("feed-scale") } else { 1.0 };
            let target = if inhibited && guarded { 0.0 } else { self.feed * scale };
            let end = (2.0 * self.acceleration * (self.length - s)).sqrt();
            let change = self.acceleration * PERIOD;
            let last = v;
            v = target.min(end).clamp(v - change, v + change).max(0.0);
            let way = (last + v) / 2.0 * PERIOD;
            s = (s + way.max(1e-9 * self.length)).min(self.length);
            self.publish(v, s);
            let pose = (self.path)(s);
            cycle(self.module, &pose, &pose);
            run.see(self.module, before, &pose);
            before = Some(self.module.inverse(&pose).expect("on the path"));
            if guarded && self.module.is_on("feed-inhibit") && v == 0.0 {
                break;
            }
        }
        run.at = s;
        run.inhibited = self.module.is_on("feed-inhibit");
        run
    }

    fn publish(&self, v: f64, s: f64) {
        self.module.set("requested-vel", self.feed);
        self.module.set("current-vel", v);
        self.module.set("distance-to-go", self.length - s);
    }
}

impl Run {
    fn see(&mut self, module: &Module, before: Option<Joints>, pose: &Pose) {
        let joints = module.inverse(pose).expect("on the path");
        for n in 0..6 {
            let speed = before.map_or(0.0, |before| (joints[n] - before[n]).abs() / PERIOD);
            self.fastest = self.fastest.max(speed / module.get(&format!("max-velocity.{n}")));
        }
        let scale = module.get("feed-scale");
        assert!((module.get("feed-floor")..=1.0).contains(&scale), "feed scale {scale}");
        self.scales.push(scale);
        self.cycles += 1;
    }

    fn turns(&self) -> usize {
        let steps: Vec<f64> = self.scales.windows(2).map(|w| w[1] - w[0]).collect();
        let steps: Vec<f64> = steps.into_iter().filter(|d| d.abs() > 1e-6).collect();
        steps.windows(2).filter(|w| w[0] * w[1] < 0.0).count()
    }
}

fn hexapod(speed: f64) -> Module {
    let module = paper_004().module();
    for n in 0..6 {
        module.set(&format!("min-limit.{n}"), 390.0);
        module.set(&format!("max-limit.{n}"), 1410.0);
        module.set(&format!("max-velocity.{n}"), speed);
    }
    module.set("linear-acceleration", 1000.0);
    module.set("angular-acceleration", 200.0);
    module
}

fn pose(x: f64, y: f64, z: f64, a: f64, b: f64) -> Pose {
    [x, y, z, a, b, 0.0, 0.0, 0.0, 0.0]
}

/// Returns the least duration of a path with a feed, an acceleration and the joint speed limits, seconds: the
/// allowed speed at many positions, swept forward and backward.
fn least_time(drive: &Drive<'_>, speed: f64) -> f64 {
    const PLACES: usize = 20_000;
    let step = drive.length / PLACES as f64;
    let joints: Vec<Joints> = (0..=PLACES)
        .map(|k| drive.module.inverse(&(drive.path)(k as f64 * step)).expect("on the path"))
        .collect();
    let allowed = |k: usize| {
        let rate = |n: usize| ((joints[k + 1][n] - joints[k][n]) / step).abs();
        (0..6).map(|n| speed / rate(n)).fold(drive.feed, f64::min)
    };
    let mut v: Vec<f64> = (0..PLACES).map(allowed).collect();
    let most = 2.0 * drive.acceleration * step;
    let mut last = 0.0;
    for value in v.iter_mut() {
        *value = value.min((last * last + most).sqrt());
        last = *value;
    }
    last = 0.0;
    for value in v.iter_mut().rev() {
        *value = value.min((last * last + most).sqrt());
        last = *value;
    }
    v.iter().map(|v| step / v).sum()
}

type Path = dyn Fn(f64) -> Pose;

fn line(s: f64) -> Pose {
    pose(-100.0 + s, 40.0, 120.0 + 0.6 * s, 0.0, 0.0)
}

/// Returns a straight line with a tangential arc.
fn line_and_arc(s: f64) -> Pose {
    if s < 100.0 {
        return pose(-100.0 + s, -50.0, 250.0, 0.0, 0.0);
    }
    let (sine, cosine) = ((s - 100.0) / 50.0).sin_cos();
    pose(50.0 * sine, -50.0 * cosine, 250.0, 0.0, 0.0)
}

fn tilting(s: f64) -> Pose {
    pose(-50.0 + 0.5 * s, 0.0, 250.0, -15.0 + 0.3 * s, 10.0 - 0.2 * s)
}

/// Returns a short arc with a large rotation of the platform: a degree on 0.05 mm.
fn rotating_arc(s: f64) -> Pose {
    let (sine, cosine) = (s / 5.0).sin_cos();
    [5.0 * sine, -5.0 * cosine, 250.0, 0.0, 0.0, 20.0 * s, 0.0, 0.0, 0.0]
}

/// Returns a rotation about Z without translation: LinuxCNC's speeds are degrees per second then.
fn turning(s: f64) -> Pose {
    [0.0, 0.0, 250.0, 0.0, 0.0, s, 0.0, 0.0, 0.0]
}

const FEED: f64 = 200.0;
const ACCELERATION: f64 = 1000.0;

fn drive<'a>(module: &'a Module, path: &'a Path, length: f64) -> Drive<'a> {
    Drive { module, path, length, feed: FEED, acceleration: ACCELERATION }
}

#[test]
fn joints_stay_within_their_speeds_where_the_feed_alone_would_drive_them_beyond() {
    let paths: [(&str, &Path, f64); 3] = [
        ("line", &line, 200.0),
        ("line and arc", &line_and_arc, 250.0),
        ("tilting", &tilting, 100.0),
    ];
    for (name, path, length) in paths {
        for speed in [50.0, 80.0] {
            let free = drive(&hexapod(speed), path, length).run(false);
            assert!(free.fastest > 1.2, "{name}, {speed}: nothing to guard, {}", free.fastest);
            let module = hexapod(speed);
            let drive = drive(&module, path, length);
            let run = drive.run(true);
            assert!(!run.inhibited && run.at > length * 0.999, "{name}, {speed}: at {}", run.at);
            assert!(run.fastest <= 1.0, "{name}, {speed}: {} of the limit", run.fastest);
            let lost = run.cycles as f64 * PERIOD / least_time(&drive, speed) - 1.0;
            println!(
                "{name}, joints to {speed} mm/s: {:.1} % more time than the least",
                100.0 * lost
            );
            // Two per cent is the margin to the speed limits; braking with less than half the
            // acceleration costs the rest.
            assert!(lost < 0.035, "{name}, {speed}: {lost}");
        }
    }
}

/// The feed's floor is far beyond the joints' limits, and so is half of it, and the first cycles
/// decide: 200 degrees/s² are 10 mm/s² of the arc.
#[test]
fn a_rotation_heavy_arc_from_standstill_never_takes_a_joint_beyond_its_speed() {
    let arc = |module: &Module, guarded: bool| {
        Drive { acceleration: 10.0, ..drive(module, &rotating_arc, 2.0) }.run(guarded)
    };
    let free = arc(&hexapod(50.0), false);
    assert!(free.fastest > 2.0, "nothing to guard: {}", free.fastest);
    let module = hexapod(50.0);
    let run = arc(&module, true);
    println!("{} of the limit alone, {} guarded, to {}", free.fastest, run.fastest, run.at);
    assert!(run.fastest <= 1.0, "{} of the limit", run.fastest);
    // The program is stopped, with a reason, once the allowed speed is nearly reached.
    assert!(run.inhibited && run.fastest > 0.8, "{} of the limit", run.fastest);
    assert_eq!(module.get("fault") as i32, Cause::JointTooFast.code());
}

#[test]
fn an_arc_too_short_to_gather_a_speed_that_is_too_fast_is_not_stopped() {
    let module = hexapod(200.0);
    let arc = Drive { acceleration: 10.0, ..drive(&module, &rotating_arc, 0.5) };
    let run = arc.run(true);
    assert!(!run.inhibited && run.at > 0.499, "at {}", run.at);
    assert!(run.fastest <= 1.0, "{} of the limit", run.fastest);
}

/// A corner as LinuxCNC blends it: a line along X decelerates while one along Z accelerates. It reports the
/// sum of both speeds, and the requested one of the faster line alone.
fn corner(module: &Module, requests: [f64; 2], guarded: bool) -> Run {
    const BEGINS: usize = 400;
    // LinuxCNC halves the acceleration if moves are blended.
    let change = ACCELERATION / 2.0 * PERIOD;
    let (mut v, mut way) = ([0.0_f64; 2], [0.0; 2]);
    let mut run = Run::default();
    let mut before: Option<Joints> = None;
    while run.cycles < 2 * BEGINS {
        let scale = if guarded { module.get("feed-scale") } else { 1.0 };
        let moves = usize::from(run.cycles >= BEGINS);
        for n in 0..2 {
            let target = if n == moves { scale * requests[n] } else { 0.0 };
            let last = v[n];
            v[n] = target.clamp(last - change, last + change);
            way[n] += (last + v[n]) / 2.0 * PERIOD;
        }
        module.set("requested-vel", if v[0] > v[1] { requests[0] } else { requests[1] });
        module.set("current-vel", v[0] + v[1]);
        module.set("distance-to-go", 100.0);
        let pose = pose(-60.0 + way[0], 0.0, 220.0 + way[1], 0.0, 0.0);
        cycle(module, &pose, &pose);
        run.see(module, before, &pose);
        before = Some(module.inverse(&pose).expect("on the path"));
    }
    run.inhibited = module.is_on("feed-inhibit");
    run.at = way[1];
    run
}

#[test]
fn joints_stay_within_their_speeds_where_a_move_begins_while_another_one_ends() {
    const SPEED: f64 = 50.0;
    for requests in [[200.0, 200.0], [200.0, 80.0], [100.0, 300.0], [60.0, 300.0]] {
        let free = corner(&hexapod(SPEED), requests, false);
        let module = hexapod(SPEED);
        let run = corner(&module, requests, true);
        println!("{requests:?}: {} of the limit, alone {}", run.fastest, free.fastest);
        assert!(free.fastest > 1.2, "{requests:?}: nothing to guard, {}", free.fastest);
        assert!(!run.inhibited && run.at > 5.0, "{requests:?}: at {}", run.at);
        // The guard aims at 0.98, and the second line always has the floor of the feed.
        let most = 0.98 + module.get("feed-floor") * requests[1] / SPEED;
        assert!(run.fastest <= most, "{requests:?}: {} of the limit", run.fastest);
    }
}

#[test]
fn the_feed_scale_does_not_swing() {
    // Six struts take turns in limiting a quarter arc: a rise and a fall for each.
    let module = hexapod(50.0);
    let run = drive(&module, &line_and_arc, 250.0).run(true);
    assert!(run.turns() <= 2 * 6 * 2, "{} turns", run.turns());
    // A straight line has one slowest place.
    let module = hexapod(50.0);
    let run = drive(&module, &line, 200.0).run(true);
    assert!(run.turns() <= 2, "{} turns", run.turns());
}

#[test]
fn calls_for_the_end_points_of_queued_moves_change_nothing() {
    let scales = |queued: bool| {
        let module = hexapod(50.0);
        let drive = drive(&module, &line, 200.0);
        let far = pose(90.0, -90.0, 200.0, 5.0, 5.0);
        (0..400)
            .map(|k| {
                let s = 0.1 * f64::from(k);
                drive.publish(100.0, s);
                let here = line(s);
                let joints = module.inverse(&here).expect("on the path");
                if queued {
                    module.inverse(&far).expect("reachable");
                }
                module.follow(&joints, &here).expect("its own joints");
                module.inverse(&here).expect("on the path");
                if queued {
                    module.inverse(&far).expect("reachable");
                }
                module.monitor();
                module.get("feed-scale")
            })
            .collect::<Vec<_>>()
    };
    let undisturbed = scales(false);
    assert!(undisturbed.iter().any(|scale| *scale < 0.9), "nothing was limited");
    assert_eq!(scales(true), undisturbed);
}

#[test]
fn a_machine_stops_before_its_legs_lose_hold_and_may_go_back() {
    let module = hexapod(1e99);
    module.set("conditioning-limit", 0.3);
    let to =
        Drive { module: &module, path: &turning, length: 80.0, feed: 15.0, acceleration: 200.0 };
    let run = to.run(true);
    assert!(run.inhibited, "not stopped, at {}", run.at);
    let hold = module.get("conditioning");
    // The floor of the feed, 0.3 degrees per second, is stopped within a thousandth of a degree.
    assert!(hold > 0.3 * 0.999 && hold < 0.3 * 1.03, "conditioning {hold}");
    assert_eq!(module.get("feed-scale"), module.get("feed-floor"));
    assert_eq!(module.get("limit-reason") as i32, Cause::ConditioningAhead.code());
    assert_eq!(module.get("fault") as i32, Cause::ConditioningAhead.code());
    let reported: Vec<_> = module.messages().into_iter().map(|message| message.text).collect();
    assert_eq!(reported.len(), 1, "{reported:?}");
    assert!(reported[0].contains("[code -93]"), "{reported:?}");
    // The program is aborted: no move is requested any more.
    module.set("requested-vel", 0.0);
    module.set("current-vel", 0.0);
    cycle(&module, &turning(run.at), &turning(run.at));
    assert!(!module.is_on("feed-inhibit"));
    let back = move |s: f64| turning(run.at - s);
    let run = Drive { module: &module, path: &back, length: run.at, ..to }.run(true);
    assert!(!run.inhibited && module.messages().len() == 1, "the way back was stopped");
}

#[test]
fn limits_within_the_braking_distance_are_reported_with_leg_and_reason() {
    // 100 mm/s stop within 12 mm at the assumed share of 1000 mm/s².
    let along = |s: f64| pose(s, 0.0, 250.0, 0.0, 0.0);
    let seen = |set: &dyn Fn(&Module)| {
        let module = hexapod(1e99);
        set(&module);
        let drive = drive(&module, &along, 200.0);
        for k in 0..5 {
            drive.publish(100.0, 0.1 * f64::from(k));
            cycle(&module, &along(0.1 * f64::from(k)), &along(0.1 * f64::from(k)));
        }
        let on = module.is_on("limit-soon");
        (on, module.get("limit-leg") as i32, module.get("limit-reason") as i32)
    };
    assert_eq!(seen(&|_| {}), (false, -1, 0));
    let joints = |s: f64| hexapod(1e99).inverse(&along(s)).expect("on the path");
    let leg = (0..6).find(|n| joints(6.0)[*n] > joints(0.5)[*n] + 1.0).expect("a strut that grows");
    let limit = |s: f64| {
        let end = joints(s)[leg];
        seen(&|module| module.set(&format!("max-limit.{leg}"), end))
    };
    assert_eq!(limit(8.0), (true, leg as i32, Cause::JointLimitAhead.code()));
    assert_eq!(limit(30.0), (false, -1, 0));
    let cone = |name: &str| {
        let pin = format!("{name}.2");
        seen(&|module| module.set(&pin, 0.05))
    };
    assert_eq!(cone("base-cone"), (true, 2, Cause::BaseConeAhead.code()));
    assert_eq!(cone("platform-cone"), (true, 2, Cause::PlatformConeAhead.code()));
    let (on, leg, reason) = seen(&|module| module.set("rod-clearance", 500.0));
    assert!(on && leg >= 0 && reason == Cause::LegsNear.code(), "{on} {leg} {reason}");
    let (on, leg, reason) = seen(&|module| module.set("max-velocity.4", 5.0));
    assert_eq!((on, leg, reason), (true, 4, Cause::JointTooFast.code()));
}

/// Returns every pin that the guard reads.
fn read_pins() -> Vec<String> {
    let single = [
        "conditioning-limit",
        "rod-clearance",
        "tilt-limit",
        "feed-floor",
        "max-override",
        "linear-acceleration",
        "angular-acceleration",
        "requested-vel",
        "current-vel",
        "distance-to-go",
    ];
    let each = ["base-cone", "platform-cone", "min-limit", "max-limit", "max-velocity"];
    let of_leg = each.iter().map(|name| format!("{name}.3"));
    let pyramids = ["base", "platform"]
        .iter()
        .flat_map(|end| ["about", "across"].map(|way| format!("{end}-pyramid.3.{way}")));
    single.iter().map(ToString::to_string).chain(of_leg).chain(pyramids).collect()
}

#[test]
fn no_input_makes_the_feed_scale_anything_but_a_share_above_the_floor() {
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324, -1.0, 0.0, 1e308];
    for pin in read_pins() {
        for value in bad {
            let module = hexapod(80.0);
            let drive = drive(&module, &line, 200.0);
            for k in 0..12 {
                let s = 20.0 + 0.2 * f64::from(k);
                drive.publish(200.0, s);
                if k > 4 {
                    module.set(&pin, value);
                }
                cycle(&module, &line(s), &line(s));
                let scale = module.get("feed-scale");
                let floor = if pin == "feed-floor" { f64::MIN_POSITIVE / 4e15 } else { 0.02 };
                assert!(scale >= floor && scale <= 1.0, "{pin} = {value}: {scale}");
            }
            let limits = ["max-velocity.3", "linear-acceleration"];
            let careful = value.is_nan() && limits.contains(&pin.as_str());
            assert!(!careful || module.get("feed-scale") == 0.02, "{pin} = {value} set free");
        }
    }
}

/// Returns the feed scales of a drive whose joints may be as fast as `speed`, cycle by cycle; the
/// planner ignores them.
fn scales_along(line: &Path, speed: f64, floor: f64) -> Vec<f64> {
    let module = hexapod(speed);
    module.set("feed-floor", floor);
    let drive = drive(&module, line, 200.0);
    (0..200)
        .map(|k| {
            let s = f64::from(k);
            drive.publish(1000.0, s);
            module.set("requested-vel", 1000.0);
            cycle(&module, &line(s), &line(s));
            module.get("feed-scale")
        })
        .collect()
}

#[test]
fn the_feed_scale_is_a_share_above_its_floor_that_grows_with_the_speed_of_the_joints() {
    let mut random = Random::new(62);
    let mut below_one = 0;
    for _ in 0..cases(10) {
        let [from, to]: [Pose; 2] = std::array::from_fn(|_| paper_004_pose(&mut random));
        let line = move |s: f64| std::array::from_fn(|k| from[k] + s / 200.0 * (to[k] - from[k]));
        let floor = random.between(0.01, 0.3);
        let speed = random.between(20.0, 800.0);
        let [slow, fast] = [speed, 1.5 * speed].map(|speed| scales_along(&line, speed, floor));
        let mut last = 1.0;
        for (slow, fast) in slow.iter().zip(&fast) {
            assert!((floor..=1.0).contains(slow), "{slow}, floor {floor}");
            assert!(fast >= slow, "faster joints, slower feed: {slow} {fast}");
            // 1 in a tenth of a second; rounding.
            assert!(*slow <= last + 0.01 + 1e-12, "rises from {last} to {slow}");
            last = *slow;
            below_one += usize::from(*slow < 1.0 && *slow > floor);
        }
    }
    assert!(below_one > 100, "only {below_one} cycles were scaled");
}

#[test]
fn a_floor_of_the_feed_scale_outside_its_range_is_two_percent() {
    for (given, floor) in [(1.0, 1.0), (0.0, 0.02), (-0.5, 0.02), (1.5, 0.02), (f64::NAN, 0.02)] {
        // Joints that may hardly move leave only the floor.
        let scales = scales_along(&line, 1e-3, given);
        assert_eq!(scales.into_iter().fold(f64::INFINITY, f64::min), floor, "{given}");
    }
}

#[test]
fn before_homing_and_after_a_jump_of_the_pose_the_feed_scale_is_a_number() {
    let module = Module::pkmkins(&[]);
    module.monitor();
    assert_eq!((module.get("feed-scale"), module.is_on("feed-inhibit")), (1.0, false));
    let module = hexapod(80.0);
    for s in [0.0, 0.1, 0.2, 150.0, 0.0, 0.0] {
        drive(&module, &line, 200.0).publish(100.0, s);
        cycle(&module, &line(s), &line(s));
        assert!((0.02..=1.0).contains(&module.get("feed-scale")));
    }
}

#[test]
fn the_times_of_the_last_calls_are_shown_in_nanoseconds() {
    let module = hexapod(80.0);
    module.monitor();
    cycle(&module, &PAPER_004_HOME, &PAPER_004_HOME);
    for pin in ["inverse-time", "forward-time"] {
        // The stub's clock advances by one nanosecond whenever it is read.
        assert_eq!(module.get(pin), 1.0, "{pin}");
    }
}

#[test]
fn with_the_identity_kinematics_nothing_is_guarded() {
    let module = hexapod(10.0);
    let drive = drive(&module, &line, 200.0);
    for k in 0..5 {
        drive.publish(100.0, 0.1 * f64::from(k));
        cycle(&module, &line(0.1 * f64::from(k)), &line(0.1 * f64::from(k)));
    }
    assert!(module.get("feed-scale") < 0.5 && module.is_on("limit-soon"));
    module.switch(1);
    for _ in 0..200 {
        module.monitor();
    }
    assert_eq!((module.get("feed-scale"), module.is_on("limit-soon")), (1.0, false));
}

/// Turns of a leg in a cardan joint since the reference pose: about the axis that is fixed in the joint's body, and
/// across it.
fn turns(axis: Vector, home: Vector, now: Vector) -> [f64; 2] {
    let across = |v: Vector| dot(v, axis).asin();
    let flat = |v: Vector| minus(v, scaled(axis, dot(v, axis)));
    let about = angle(flat(home), flat(now));
    [about, (across(now) - across(home)).abs().to_degrees()]
}

#[test]
fn each_cone_and_each_turn_of_a_cardan_joint_has_the_limit_of_its_own_pin() {
    let machine = Parallel::from(paper_004());
    let module = machine.module();
    let mut random = Random::new(65);
    let home_joints = module.inverse(&PAPER_004_HOME).expect("home");
    let home = directions(&machine, &PAPER_004_HOME, &home_joints);
    for _ in 0..cases(2) {
        let pose = paper_004_pose(&mut random);
        let joints = module.inverse(&pose).expect("a pose of the workspace");
        let now = directions(&machine, &pose, &joints);
        for n in 0..6 {
            let Kind::Strut { base_axis, platform_axis, .. } = machine.legs[n].kind else {
                unreachable!("six struts")
            };
            let in_platform = untilted(&pose, now[n]);
            let base = turns(unit(base_axis), home[n], now[n]);
            let platform = turns(unit(platform_axis), home[n], in_platform);
            for (pin, value, cause) in [
                ("base-cone.N", angle(now[n], home[n]), Cause::BaseConeAhead),
                ("platform-cone.N", angle(in_platform, home[n]), Cause::PlatformConeAhead),
                ("base-pyramid.N.about", base[0], Cause::BasePyramidAhead),
                ("base-pyramid.N.across", base[1], Cause::BasePyramidAhead),
                ("platform-pyramid.N.about", platform[0], Cause::PlatformPyramidAhead),
                ("platform-pyramid.N.across", platform[1], Cause::PlatformPyramidAhead),
            ] {
                let pin = pin.replace('N', &n.to_string());
                // A millionth is far above rounding, and distinguishes one turn from any other.
                for (share, code) in [(1.0 - 1e-6, cause.code()), (1.0 + 1e-6, 0)] {
                    module.set(&pin, value * share);
                    (0..3).for_each(|_| cycle(&module, &pose, &pose));
                    let found = ["limit-reason", "limit-leg"].map(|pin| module.get(pin) as i32);
                    let leg = if code == 0 { -1 } else { n as i32 };
                    assert_eq!(found, [code, leg], "{pin} of {share} times {value} at {pose:?}");
                }
                module.set(&pin, 0.0);
            }
        }
    }
}
