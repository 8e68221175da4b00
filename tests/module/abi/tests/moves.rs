// SPDX-License-Identifier: GPL-2.0-or-later
//! The guard during moves of machines with properties that are the same in all shipped ones: millimeters and inches,
//! servo cycles of 250 us to 2 ms, feed overrides, joint offsets, a second mechanism, axes that carry something.
//!
//! Joint values along a move come from a second module without guard; their limits are arithmetic.

use abi_tests::control::{Control, controls, in_a_chain};
use abi_tests::geometry::norm;
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::in_unit;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::Subject;
use kinematics::{Cause, ChainGeometry};

/// Cycles until a feed scale acts on the poses: LinuxCNC's planner takes it over in the next cycle.
const LATENCY: usize = 3;

/// Poses along a move at which joint values are sampled.
const PLACES: usize = 40;

/// A machine in some unit, with a module that is guarded and one that gives the joints of a pose.
struct Machine {
    control: Control,
    module: Module,
    plain: Module,
    factor: f64,
    joints: usize,
}

impl Machine {
    fn new(control: &Control, random: &mut Random) -> Self {
        let factor = [1.0, 1.0 / 25.4][random.between(0.0, 2.0) as usize];
        let control = control.scaled(factor);
        let [module, plain] = [control.module(), control.module()];
        let mechanisms = control.mechanisms();
        let joints = mechanisms.iter().map(|machine| machine.joints()).sum();
        let legs = mechanisms.iter().map(|machine| machine.legs.len()).sum();
        for n in 0..legs {
            let offset = 0.1 * control.size() * random.within(1.0);
            [&module, &plain].iter().for_each(|m| m.set(&format!("offset.{n}"), offset));
        }
        [&module, &plain].into_iter().for_each(Module::apply);
        assert!(module.is_on("geometry-ok") && plain.is_on("geometry-ok"), "{}", control.name());
        Self { control, module, plain, factor, joints }
    }

    fn joints(&self, pose: &Pose) -> Joints {
        self.plain.inverse(pose).expect("within reach")
    }

    /// Returns a random pose of the workspace; `original` is the machine in its old unit.
    fn sample(&self, original: &Control, random: &mut Random) -> Pose {
        in_unit(&original.sample(random), self.factor)
    }
}

/// A straight move as LinuxCNC's planner makes it.
struct Move<'a> {
    machine: &'a Machine,
    from: Pose,
    to: Pose,
    /// Feed in LinuxCNC's measure of length, per second.
    feed: f64,
    acceleration: f64,
    feed_override: f64,
    /// Servo period in nanoseconds.
    period: i64,
}

#[derive(Debug, Default)]
struct Outcome {
    /// Largest joint speed, units per second, by joint.
    fastest: Vec<f64>,
    /// Share of the move that was completed.
    share: f64,
    is_inhibited: bool,
    /// Share of the move at which a limit was first reported, with leg or joint and cause.
    reported: Option<(f64, i32, i32)>,
    scales: Vec<f64>,
}

fn lengths(pose: &Pose) -> [f64; 3] {
    [[0, 1, 2], [3, 4, 5], [6, 7, 8]].map(|of| norm(of.map(|k| pose[k])))
}

impl<'a> Move<'a> {
    /// Returns a move of some tenths of a second between two poses of the workspace, of all letters or of one group.
    /// `only` is 0 for X Y Z, 1 for A B C, 2 for U V W, else all; a machine that has none of a group moves all.
    fn random(machine: &'a Machine, original: &Control, only: usize, random: &mut Random) -> Self {
        let [from, other] = [0, 1].map(|_| machine.sample(original, random));
        let mut to = from;
        let letters: Vec<usize> = (0..9).filter(|k| machine.control.moves(*k)).collect();
        let kept = |k: usize| only == 3 || k / 3 == only || !letters.iter().any(|k| k / 3 == only);
        let carries = matches!(machine.control, Control::Carrying(..));
        for k in letters.iter().copied().filter(|k| kept(*k)) {
            // An axis that turns the work bends the path of the tool, which the guard approximates by a circle.
            let share = if carries && k == 5 { 0.02 } else { 0.3 };
            to[k] += share * (other[k] - from[k]);
        }
        let mut new = Self {
            machine,
            from,
            to,
            feed: 0.0,
            acceleration: 0.0,
            feed_override: random.between(0.5, 2.0),
            period: [250_000, 1_000_000, 2_000_000][random.between(0.0, 3.0) as usize],
        };
        let fastest = new.counted() / random.between(0.3, 0.6);
        new.feed = fastest / new.feed_override;
        new.acceleration = fastest / random.between(0.02, 0.1);
        new
    }

    fn change(&self) -> Pose {
        std::array::from_fn(|k| self.to[k] - self.from[k])
    }

    fn at(&self, share: f64) -> Pose {
        let change = self.change();
        std::array::from_fn(|k| self.from[k] + share * change[k])
    }

    /// Returns the length as LinuxCNC counts it: of X Y Z, else of U V W, else of A B C.
    fn counted(&self) -> f64 {
        let [tip, turn, slides] = lengths(&self.change());
        [tip, slides, turn].into_iter().find(|length| *length > 0.0).expect("a move")
    }

    fn seconds(&self) -> f64 {
        self.period as f64 * 1e-9
    }

    /// Returns the joint values at places along the move.
    fn along(&self) -> Vec<Joints> {
        (0..=PLACES).map(|n| self.machine.joints(&self.at(n as f64 / PLACES as f64))).collect()
    }

    /// Returns the largest rate of a joint along the move, per share of it.
    fn steepest(&self, joint: usize) -> f64 {
        let along = self.along();
        let steps = along.windows(2).map(|two| (two[1][joint] - two[0][joint]).abs());
        steps.fold(0.0, f64::max) * PLACES as f64
    }

    /// Returns the requested feed with the override, in shares of the move per second.
    fn fastest(&self) -> f64 {
        self.feed * self.feed_override / self.counted()
    }

    /// Sets the accelerations of LinuxCNC's axes with which its planner gives the move its acceleration.
    fn set_up(&self) {
        let module = &self.machine.module;
        let [tip, all, slides] = lengths(&self.change());
        let change = self.change();
        let turn = match self.machine.control {
            // Each angle has its own acceleration. With two mechanisms the guard combines all of them.
            Control::Alone(_) => (3..6).map(|k| change[k].abs()).fold(0.0, f64::max),
            _ => all,
        };
        let each = |length: f64| {
            let share = length / self.counted();
            if length > 0.0 { self.acceleration * share } else { 1.0 }
        };
        // Axes that carry nothing may be weaker than all others.
        let stronger = if self.has_weak_axes() { 10.0 } else { 1.0 };
        module.set("linear-acceleration", stronger * each(tip.max(slides)));
        module.set("angular-acceleration", stronger * each(turn));
        for (k, axis) in AXES.iter().enumerate() {
            let pin = format!("extra-acceleration.{axis}");
            if stronger > 1.0 && module.has(&pin) {
                module.set(&pin, each(change[k].abs()));
            }
        }
        module.set("max-override", self.feed_override);
    }

    /// Returns whether axes that carry nothing take part in a move, and so determine its acceleration.
    fn has_weak_axes(&self) -> bool {
        let Control::Carrying(_, carrying) = &self.machine.control else { return false };
        carrying.given == ChainGeometry::NONE
            && carrying.axes.iter().any(|k| self.change()[*k] != 0.0)
    }

    fn report(&self, requested: f64, speed: f64, to_go: f64) {
        let pins =
            [("requested-vel", requested), ("current-vel", speed), ("distance-to-go", to_go)];
        pins.into_iter().for_each(|(pin, value)| self.machine.module.set(pin, value));
    }

    fn servo(&self, joints: &mut Joints, pose: &Pose) {
        let module = &self.machine.module;
        module.follow(joints, pose).expect("joints of the cycle before");
        *joints = module.inverse(pose).expect("within reach");
        module.monitor_in_cycle_of(self.period);
    }

    /// Makes the move with M52 P1, and returns what happened.
    fn make(&self) -> Outcome {
        let module = &self.machine.module;
        self.set_up();
        let mut joints = self.machine.joints(&self.from);
        self.report(0.0, 0.0, 0.0);
        (0..30).for_each(|_| self.servo(&mut joints, &self.from));
        let (length, dt) = (self.counted(), self.seconds());
        let mut outcome = Outcome { fastest: vec![0.0; 16], ..Outcome::default() };
        let (mut gone, mut speed) = (0.0, 0.0_f64);
        let mut late = [(1.0, false); LATENCY];
        for _ in 0..100_000 {
            let (scale, is_held) = late[0];
            let asked = if is_held { 0.0 } else { self.feed * self.feed_override * scale };
            let end = (2.0 * self.acceleration * (length - gone)).sqrt();
            let step = self.acceleration * dt;
            let before = speed;
            speed = asked.min(end).clamp((speed - step).max(0.0), speed + step);
            gone = (gone + ((before + speed) / 2.0 * dt).max(1e-9 * length)).min(length);
            self.report(self.feed, speed, length - gone);
            let old = joints;
            self.servo(&mut joints, &self.at(gone / length));
            for (most, (a, b)) in outcome.fastest.iter_mut().zip(old.iter().zip(joints)) {
                *most = most.max((b - a).abs() / dt);
            }
            outcome.share = gone / length;
            if outcome.reported.is_none() && module.is_on("limit-soon") {
                let [leg, why] = ["limit-leg", "limit-reason"].map(|pin| module.get(pin) as i32);
                outcome.reported = Some((outcome.share, leg, why));
            }
            let now = (module.get("feed-scale"), module.is_on("feed-inhibit"));
            outcome.scales.push(now.0);
            late.rotate_left(1);
            late[LATENCY - 1] = now;
            outcome.is_inhibited = now.1;
            if outcome.share >= 1.0 - 1e-9 || (is_held && speed == 0.0) {
                return outcome;
            }
        }
        panic!("{}: a move does not end: {outcome:?}", self.words());
    }

    fn words(&self) -> String {
        let Self { from, to, feed, acceleration, feed_override, period, .. } = self;
        let (name, factor) = (self.machine.control.name(), self.machine.factor);
        format!(
            "{name} times {factor}, {from:?} to {to:?} at {feed} times {feed_override}, {acceleration}, {period} ns"
        )
    }
}

/// Returns the hexapod of paper 004 with axes that carry nothing: it brakes as slowly as these axes.
fn beside_axes() -> Control {
    let Control::Carrying(subject, mut carrying) = in_a_chain() else { unreachable!("a chain") };
    carrying.given = ChainGeometry::NONE;
    let subject = Subject { name: "hexapod beside axes", ..subject };
    Control::Carrying(subject, carrying)
}

/// Tests moves of all machines, each with its own unit, period and override.
fn each_move(seed: u64, count: usize, test: &mut dyn FnMut(&Move<'_>, &mut Random)) {
    let mut random = Random::new(seed);
    for original in controls().into_iter().chain([beside_axes()]) {
        // Cover every group of letters of machines that have more than one.
        let least = if matches!(original, Control::Alone(_)) { 1 } else { 4 };
        // Ten times as many at most: a few of some thousand random moves exceed the estimates below of how soon the
        // guard acts. They are stopped or slowed sooner, and no joint exceeds its limit.
        for case in 0..cases(count).clamp(least, 10 * count.max(least)) {
            let machine = Machine::new(&original, &mut random);
            test(&Move::random(&machine, &original, 3 - case % 4, &mut random), &mut random);
        }
    }
}

#[test]
fn no_joint_is_faster_than_its_limit_and_one_comes_near_to_it() {
    each_move(401, 4, &mut |step, random| {
        let joint = random.between(0.0, step.machine.joints as f64) as usize;
        let free = step.steepest(joint) * step.fastest();
        // Rounding of a joint at rest.
        if free < 1e-6 * step.machine.control.size() {
            return;
        }
        let limit = free * random.between(0.3, 0.9);
        step.machine.module.set(&format!("max-velocity.{joint}"), limit);
        let outcome = step.make();
        let share = outcome.fastest[joint] / limit;
        let what = || format!("{}: joint {joint} at {share} of its limit", step.words());
        assert!(outcome.share > 1.0 - 1e-6 && !outcome.is_inhibited, "{}", what());
        // The guard aims at 0.98 and assumes an override of at least 1. Positions between its samples add less than
        // 0.02, and a short move leaves less than 0.03 unused. At a smaller override it brakes late, because there is
        // room.
        let (aim, more) = match step.feed_override {
            below if below < 1.0 => (0.98 * below, 0.05),
            _ => (0.98, 0.02),
        };
        assert!(share > aim - 0.03 && share < aim + more, "{}, not {aim}", what());
        if let Some(reported) = outcome.reported {
            assert_eq!(
                (reported.1, reported.2),
                (joint as i32, Cause::JointTooFast.code()),
                "{}",
                what()
            );
        }
    });
}

#[test]
fn a_move_that_no_limit_concerns_is_not_slowed_and_nothing_is_reported() {
    each_move(405, 2, &mut |step, _| {
        // The workspace of the pentapod contains poses near its default.
        step.machine.module.set("conditioning-limit", 0.0);
        let outcome = step.make();
        assert!(outcome.scales.iter().all(|scale| *scale == 1.0), "{}", step.words());
        assert!(outcome.reported.is_none() && !outcome.is_inhibited, "{}", step.words());
    });
}

/// Returns the angle of the platform's normal from Z.
fn tilt(pose: &Pose) -> f64 {
    let [a, b] = [pose[3].to_radians(), pose[4].to_radians()];
    (a.cos() * b.cos()).acos().to_degrees()
}

/// Sets one limit that the move violates from some share on; returns the share, the joint that the guard names, and
/// the cause.
fn limited(step: &Move<'_>, random: &mut Random) -> Option<(f64, i32, i32)> {
    let (module, share) = (&step.machine.module, random.between(0.4, 0.8));
    // The only limit: a random move may come near a singularity first.
    module.set("conditioning-limit", 0.0);
    let place = step.at(share);
    // The tilt is algebra where no axis turns work or tool.
    let tilts = |n: usize| tilt(&step.at(n as f64 / PLACES as f64));
    let grows = (1..=PLACES).all(|n| tilts(n) > tilts(n - 1)) && tilts(PLACES) > tilts(0) + 1.0;
    if grows && matches!(step.machine.control, Control::Alone(_)) {
        module.set("tilt-limit", tilt(&place));
        return Some((share, -1, Cause::TiltAhead.code()));
    }
    let joint = random.between(0.0, step.machine.joints as f64) as usize;
    let along = step.along();
    let all = along[PLACES][joint] - along[0][joint];
    let goes_on = |two: &[Joints]| (two[1][joint] - two[0][joint]) * all.signum() > 0.0;
    let enough = 1e-3 * step.machine.control.size();
    if !along.windows(2).all(goes_on) || all.abs() < enough {
        return None;
    }
    let limit = step.machine.joints(&place)[joint];
    module.set(&format!("{}-limit.{joint}", if all > 0.0 { "max" } else { "min" }), limit);
    Some((share, joint as i32, Cause::JointLimitAhead.code()))
}

#[test]
fn a_limit_of_the_pose_is_reported_from_the_braking_distance_on_and_not_much_sooner() {
    let mut checked = 0;
    each_move(402, 4, &mut |step, random| {
        let Some((share, leg, why)) = limited(step, random) else { return };
        let outcome = step.make();
        let what = || format!("{}, limit at {share}: {:?}", step.words(), outcome.reported);
        let (at, found_leg, found_why) = outcome.reported.unwrap_or_else(|| panic!("{}", what()));
        assert_eq!((found_leg, found_why), (leg, why), "{}", what());
        // The stopping distance at full acceleration, as a share of the move.
        let stop = step.fastest() * step.fastest() * step.counted() / (2.0 * step.acceleration);
        let cycle = step.fastest() * step.seconds();
        // The guard assumes 0.43 of the acceleration, looks ahead 1.2 times the braking distance, and evaluates each
        // position every ninth cycle.
        let (least, most) = (stop / 0.43, 1.2 * stop / 0.43 + 14.0 * cycle);
        assert!(share - at <= most, "{}: at most {most}", what());
        if at > stop + 10.0 * cycle {
            assert!(share - at >= least, "{}: at least {least}", what());
            checked += 1;
        }
    });
    println!("{checked} at full speed");
    assert!(checked >= cases(20).min(20));
}

/// Returns a joint whose speed grows along the whole move, and its speeds.
fn growing(step: &Move<'_>) -> Option<(usize, Vec<f64>)> {
    let along = step.along();
    (0..step.machine.joints).find_map(|n| {
        let of = |two: &[Joints]| (two[1][n] - two[0][n]).abs() * PLACES as f64 * step.fastest();
        let speeds: Vec<f64> = along.windows(2).map(of).collect();
        let grows = speeds.windows(2).all(|two| two[1] > two[0]);
        (grows && speeds[PLACES - 1] > 1.05 * speeds[0]).then_some((n, speeds))
    })
}

#[test]
fn what_may_not_be_slowed_is_stopped_before_a_joint_is_too_fast_and_not_where_the_move_ends_before()
{
    let (mut stopped, mut ended) = (0, 0);
    each_move(403, 6, &mut |step, random| {
        let step = &Move { feed_override: step.feed_override.max(1.0), ..*step };
        let Some((joint, speeds)) = growing(step) else { return };
        let module = &step.machine.module;
        module.set("feed-floor", 1.0);
        // The move must be at full speed at the limit.
        let stop = step.fastest() * step.fastest() * step.counted() / (2.0 * step.acceleration);
        let is_legal = stop > 0.2 || random.between(0.0, 1.0) < 0.5;
        // The guard aims at 0.98 of the limit. The last speed is that of the middle of the last part.
        let place = if is_legal { PLACES - 1 } else { PLACES * 7 / 10 };
        let most = speeds[place] + (speeds[place] - speeds[place - 1]);
        // Slightly more for a legal move: the guard approximates a rotation of the work by a circle.
        let more = match step.machine.control {
            _ if !is_legal => 1.0,
            Control::Carrying(..) => 1.02,
            _ => 1.002,
        };
        let limit = more * most / 0.98;
        module.set(&format!("max-velocity.{joint}"), limit);
        let outcome = step.make();
        let what = || {
            let Outcome { share, fastest, .. } = &outcome;
            format!("{}, joint {joint} at {} of {limit} to {share}", step.words(), fastest[joint])
        };
        if is_legal {
            // Beyond its end the joint would be too fast.
            assert!(!outcome.is_inhibited && outcome.share > 1.0 - 1e-6, "{}", what());
            ended += 1;
            return;
        }
        assert!(outcome.is_inhibited && outcome.fastest[joint] <= limit, "{}", what());
        let early = 1.2 * stop / 0.43 + 14.0 * step.fastest() * step.seconds();
        assert!(outcome.share >= 0.7 - early, "{}", what());
        let found = ["fault", "fault-leg"].map(|pin| module.get(pin) as i32);
        assert_eq!(found, [Cause::JointTooFast.code(), joint as i32], "{}", what());
        stopped += 1;
    });
    println!("{stopped} stopped, {ended} not");
    assert!(stopped >= cases(6).min(6) && ended >= cases(6).min(6));
}

const AXES: [&str; 9] = ["x", "y", "z", "a", "b", "c", "u", "v", "w"];

/// A jog of several axes in world mode, each with its own speed and acceleration; the first speeds are those of a
/// move, in the same time. LinuxCNC's task takes over speed limits `task` cycles late, or never.
struct Jog<'a> {
    step: &'a Move<'a>,
    pose: Pose,
    speed: Pose,
    task: Option<usize>,
}

impl Jog<'_> {
    fn keys(&self) -> Pose {
        self.step.change().map(|change| change * self.step.fastest())
    }

    fn set_up(&self) {
        let (module, keys) = (&self.step.machine.module, self.keys());
        let least = |letters: &[usize]| {
            let each = letters.iter().map(|k| keys[*k].abs()).filter(|key| *key > 0.0);
            let least = each.fold(f64::INFINITY, f64::min);
            if least.is_finite() { least / self.ramp() } else { 1.0 }
        };
        module.set("linear-acceleration", least(&[0, 1, 2, 6, 7, 8]));
        module.set("angular-acceleration", least(&[3, 4, 5]));
        for (k, axis) in AXES.iter().enumerate() {
            let pin = format!("axis-max-velocity.{axis}");
            if module.has(&pin) {
                module.set(&pin, keys[k].abs());
            }
        }
    }

    /// Returns the seconds in which an axis gathers its speed.
    fn ramp(&self) -> f64 {
        self.step.feed * self.step.feed_override / self.step.acceleration
    }

    /// Returns whether the key of a letter is released: beyond either end of the move there may be other limits.
    fn is_at_end(&self, k: usize, sign: f64) -> bool {
        let change = self.step.to[k] - self.step.from[k];
        let share = (self.pose[k] - self.step.from[k]) / change;
        change == 0.0 || share > 1.0 || (sign < 0.0 && share < 0.1)
    }

    /// Runs a cycle towards these speeds.
    fn cycle(&mut self, joints: &mut Joints, wanted: &Pose) {
        let (keys, dt) = (self.keys(), self.step.seconds());
        for k in 0..9 {
            let change = keys[k].abs() / self.ramp() * dt;
            self.speed[k] += (wanted[k] - self.speed[k]).clamp(-change, change);
            self.pose[k] += self.speed[k] * dt;
        }
        self.step.servo(joints, &self.pose);
    }

    /// Returns the largest speeds that LinuxCNC's task is given.
    fn most(&self) -> Pose {
        let (module, keys) = (&self.step.machine.module, self.keys());
        std::array::from_fn(|k| {
            let pin = format!("jog-velocity.{}", AXES[k]);
            if module.has(&pin) { module.get(&pin) } else { keys[k].abs() }
        })
    }

    /// Holds the keys, `sign` 1 along the move, until the machine stands; returns whether the guard stopped it.
    fn hold(&mut self, sign: f64, seen: &mut dyn FnMut(&Joints)) -> bool {
        let module = &self.step.machine.module;
        let mut joints = self.step.machine.joints(&self.pose);
        self.step.report(0.0, 0.0, 0.0);
        (0..30).for_each(|_| self.step.servo(&mut joints, &self.pose));
        module.set("jogging", 1.0);
        let (keys, mut most) = (self.keys(), vec![self.keys().map(f64::abs)]);
        let mut is_stopped = false;
        let cycles = (10.0 / self.step.fastest() / self.step.seconds()) as usize;
        for n in 0..cycles {
            let known = self.task.map_or(most[0], |late| most[n.saturating_sub(late)]);
            let wanted: Pose = std::array::from_fn(|k| {
                if is_stopped || self.is_at_end(k, sign) {
                    return 0.0;
                }
                sign * keys[k].signum() * keys[k].abs().min(known[k])
            });
            self.cycle(&mut joints, &wanted);
            seen(&joints);
            is_stopped |= module.is_on("jog-stop");
            let lower = self.most();
            most.push(std::array::from_fn(|k| lower[k].min(most[n][k])));
            let stands = self.speed.iter().all(|speed| *speed == 0.0);
            if stands && (is_stopped || (0..9).all(|k| self.is_at_end(k, sign))) {
                break;
            }
        }
        module.set("jogging", 0.0);
        (0..5).for_each(|_| self.cycle(&mut joints, &[0.0; 9]));
        assert!(!module.is_on("jog-stop"), "nothing is jogged");
        is_stopped
    }
}

#[test]
fn jogs_of_all_letters_end_before_a_limit_and_may_go_back() {
    let mut stopped = 0;
    each_move(404, 4, &mut |step, random| {
        let Some((share, leg, why)) = limited(step, random) else { return };
        let task = [None, Some(10), Some(40)][random.between(0.0, 3.0) as usize];
        let mut jog = Jog { step, pose: step.from, speed: [0.0; 9], task };
        jog.set_up();
        let module = &step.machine.module;
        let mut is_kept = true;
        let limits: Vec<[f64; 2]> = (0..step.machine.joints)
            .map(|n| ["min", "max"].map(|end| module.get(&format!("{end}-limit.{n}"))))
            .collect();
        let mut seen = |joints: &Joints| {
            is_kept &= limits.iter().zip(joints).all(|(l, q)| (l[0]..=l[1]).contains(q));
        };
        let is_stopped = jog.hold(1.0, &mut seen);
        let what = || format!("{}, limit at {share}, task {task:?}: {:?}", step.words(), jog.pose);
        assert!(is_stopped && is_kept, "{}", what());
        let tilted = tilt(&jog.pose);
        assert!(leg >= 0 || tilted <= module.get("tilt-limit"), "{}: {tilted}", what());
        assert_eq!((module.get("fault") as i32, module.get("fault-leg") as i32), (why, leg));
        let name = what();
        assert!(!jog.hold(-1.0, &mut |_| {}), "back: {name}");
        stopped += 1;
    });
    println!("{stopped} jogs stopped");
    assert!(stopped >= cases(4).min(4));
}
