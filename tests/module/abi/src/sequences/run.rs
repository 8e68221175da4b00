// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC's motion controller (2.9, control.c), its machine, and their events.

use super::judge::{Judge, REFUSED, Reach, Verdict, brief};
use super::setups::Setup;
use super::system::State;
use crate::module::{Joints, Module, Pose};
use crate::random::Random;
use crate::stub::pass_time;
use std::collections::{BTreeMap, VecDeque};

/// Share of the size by which the module resolves contradicting joints in a cycle: three tenths of the displacement
/// by the acceleration of [`Setup::module`] in a cycle of 1 ms.
const SETTLED_IN_A_CYCLE: f64 = 0.3 * 10.0 * 1e-6;

/// Speeds as shares of the size per cycle: 0.5 m/s and 1 kHz on a machine of 1.25 m, and less.
const SPEEDS: [f64; 4] = [4e-4, 4e-4, 1e-4, 1e-3];

/// Speed of moves through singular poses.
const THROUGH: f64 = 1.5e-3;

/// Number of cycles in which a move reaches its speed.
const RAMP: f64 = 25.0;

/// Least distance from a singular pose when joints are moved individually, as a share of the size: a rigid
/// machine jams there.
const JAMS: f64 = 2e-3;

/// LinuxCNC's pause before a joint's final move to HOME (homing.c), nanoseconds.
const HOMING: i64 = 100_000_000;

/// Number of successive refusals that are judged individually.
const ALIKE: usize = 16;

/// Noise of encoders as shares of the size.
const NOISE: [f64; 6] = [0.0, 0.0, 1e-6, 1e-6, 1e-5, 1e-4];

/// LinuxCNC's mode of the joints.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Motion {
    Free,
    Teleop,
    Coord,
}

/// Cause of a refused cycle.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Injection {
    NotFinite(usize, f64),
    Zeros,
    Far(f64),
    Huge(usize),
    Contradiction(usize, f64),
    Pin(&'static str, f64, i32),
}

/// A move along a line of poses.
#[derive(Clone, Copy, Default)]
struct Plan {
    start: Pose,
    way: Pose,
    /// Share of the path: position, speed, remaining distance.
    at: f64,
    speed: f64,
    most: f64,
    end: f64,
}

/// Result of a run, with its failures.
pub struct Outcome {
    pub cycles: usize,
    /// Number of cycles with an excused result.
    pub excused: usize,
    /// Events, verdicts and refusals.
    pub counts: BTreeMap<String, usize>,
    /// The first unnecessary refusal, and the first of all other errors.
    pub failures: Vec<String>,
}

/// The pose of LinuxCNC for which a call is made.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Caller {
    Feedback,
    Command,
}

pub struct Run<'a> {
    setup: &'a Setup,
    module: Module,
    judge: Judge,
    random: Random,
    cycle: usize,
    history: VecDeque<String>,
    counts: BTreeMap<String, usize>,
    seed: u64,
    /// The first unnecessary refusal.
    refusal: Option<String>,
    /// The first other error.
    failure: Option<String>,
    // LinuxCNC: the two poses at a fixed address.
    poses: Box<[Pose; 2]>,
    feedback_ok: bool,
    command_ok: bool,
    enabled: bool,
    enabling: bool,
    motion: Motion,
    wanted: Motion,
    homed: bool,
    unhomed_for: usize,
    kind_asked: i32,
    kind_known: i32,
    identity: bool,
    reset: usize,
    feedback_refused: bool,
    /// Code of the last call of forward.
    last_code: i32,
    command_verdict_right: bool,
    // The machine.
    noise: f64,
    lag: usize,
    speed: f64,
    /// Speed of the last move.
    fastest: f64,
    /// Longest step of the last cycles.
    recent: f64,
    command: State,
    /// Signs of the commanded pose's determinants, in world mode.
    signs: Option<[i32; 2]>,
    queue: VecDeque<State>,
    actual: State,
    measured: Joints,
    plan: Plan,
    jog: Joints,
    jog_for: usize,
    sagging: Option<Joints>,
    /// Number of cycles with an excused result, and the last of them.
    excused: usize,
    excused_in: usize,
    /// Number of successive refusals.
    in_a_row: usize,
    injection: Option<Injection>,
    /// Cycle of the last disturbance.
    disturbed: usize,
    missed: usize,
    /// Difference between the joints of world mode and those of the pose.
    contradiction: Joints,
    /// World mode is requested in the cycle after homing ends.
    enters_teleop: bool,
    /// Cycles since a commanded pose is known, for effects of a lag.
    commanded_for: usize,
}

impl<'a> Run<'a> {
    /// Runs a machine for a number of cycles, or until an error.
    pub fn of(setup: &'a Setup, seed: u64, cycles: usize) -> Outcome {
        let mut run = Self::new(setup, seed);
        run.start();
        // After another pose LinuxCNC's pose is no longer the machine's.
        while run.cycle < cycles && run.failure.is_none() {
            run.step();
        }
        let mut counts = run.counts;
        for (what, count) in run.judge.counts {
            *counts.entry(what.into()).or_default() += count;
        }
        let failures = run.refusal.into_iter().chain(run.failure).collect();
        Outcome { cycles: run.cycle, excused: run.excused, counts, failures }
    }

    fn new(setup: &'a Setup, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let system = setup.system.clone();
        let at_home = system.at_reference();
        let noise = NOISE[pick(&mut random, NOISE.len())];
        let lag = pick(&mut random, 8);
        let speed = SPEEDS[pick(&mut random, SPEEDS.len())];
        Self {
            setup,
            module: setup.module(),
            judge: Judge::new(system),
            random,
            cycle: 0,
            history: VecDeque::new(),
            counts: BTreeMap::new(),
            seed,
            refusal: None,
            failure: None,
            poses: Box::new([[0.0; 9]; 2]),
            feedback_ok: false,
            command_ok: false,
            enabled: false,
            enabling: false,
            motion: Motion::Free,
            wanted: Motion::Free,
            homed: false,
            unhomed_for: 0,
            kind_asked: 0,
            kind_known: 0,
            identity: false,
            reset: 0,
            feedback_refused: true,
            last_code: 0,
            command_verdict_right: false,
            noise,
            lag,
            speed,
            fastest: speed,
            recent: 0.0,
            command: at_home,
            signs: None,
            queue: VecDeque::new(),
            actual: at_home,
            measured: at_home.joints,
            plan: Plan::default(),
            jog: [0.0; 16],
            jog_for: 0,
            sagging: None,
            excused: 0,
            excused_in: 0,
            in_a_row: 0,
            injection: None,
            disturbed: 0,
            missed: 0,
            contradiction: [0.0; 16],
            enters_teleop: false,
            commanded_for: 0,
        }
    }

    fn chance(&mut self, share: f64) -> bool {
        self.random.between(0.0, 1.0) < share
    }

    fn note(&mut self, what: String) {
        if self.history.len() == 30 {
            self.history.pop_front();
        }
        self.history.push_back(format!("{}: {what}", self.cycle));
    }

    fn event(&mut self, name: &str, what: String) {
        *self.counts.entry(format!("event {name}")).or_default() += 1;
        self.note(format!("{name} {what}"));
    }

    fn fail(&mut self, what: String) {
        let is_refusal = what.contains(REFUSED);
        let history: Vec<_> = self.history.iter().cloned().collect();
        let text = format!(
            "{} with seed {}, cycle {}: {what}
    after: {}",
            self.setup.name,
            self.seed,
            self.cycle,
            history.join("; ")
        );
        let first = if is_refusal { &mut self.refusal } else { &mut self.failure };
        first.get_or_insert(text);
        if is_refusal {
            self.judge.count("REFUSED WITHOUT NEED");
        }
    }

    /// Starts before homing, when LinuxCNC calls forward with joints and poses of 0.
    fn start(&mut self) {
        let monitored = !self.setup.drops_in;
        let (noise, lag, speed) = (self.noise, self.lag, self.speed);
        self.note(format!("noise {noise:.0e}, lag {lag}, speed {speed:.0e}"));
        for _ in 0..3 {
            self.module.forward_into(&[0.0; 16], &mut self.poses[0]);
            if monitored {
                self.module.monitor();
            }
        }
        (self.enabling, self.enabled) = (true, true);
        self.unhome(3);
    }

    fn unhome(&mut self, cycles: usize) {
        self.homed = false;
        self.unhomed_for = cycles;
        (self.motion, self.wanted) = (Motion::Free, Motion::Free);
        (self.jog_for, self.plan) = (0, Plan::default());
    }

    /// Ends homing with the machine at its reference pose.
    fn home(&mut self) {
        self.homed = true;
        pass_time(HOMING);
        let mut state = self.setup.system.at_reference();
        (self.judge.good, self.judge.strayed) = (Some(state), false);
        if !self.setup.system.is_redundant() && !self.judge.held && self.chance(0.3) {
            // A home switch with a small error.
            let mut joints = state.joints;
            for joint in 0..self.setup.system.joints() {
                joints[joint] += self.random.within(1e-4) * self.setup.system.size()
                    / self.setup.system.unit(joint);
            }
            if let (Some(led), _) = self.setup.system.follow(&state, &joints) {
                state = led;
            }
        }
        (self.command, self.actual) = (state, state);
        self.queue.clear();
        (self.judge.crossed, self.judge.held) = (false, false);
        self.enters_teleop = self.chance(0.5);
    }

    // ---- the machine ----

    fn size(&self) -> f64 {
        self.setup.system.size()
    }

    fn measure(&mut self) {
        let system = &self.setup.system;
        self.measured = self.actual.joints;
        if self.noise > 0.0 {
            let amplitude = self.noise * system.least_size();
            for joint in 0..system.joints() {
                let unit = system.unit(joint);
                self.measured[joint] += self.random.within(amplitude) / unit;
            }
        }
    }

    fn reach(&self) -> Reach {
        let system = &self.setup.system;
        let size = system.size();
        let lagging = system.distance(&self.actual.poses, &self.command.poses);
        Reach {
            gap: lagging + 2.0 * self.recent,
            noise: 3.0 * self.noise * size + 1e-13 * size,
            is_passed: false,
        }
    }

    /// Takes a commanded state, which the machine follows a little later.
    fn advance(&mut self, next: State, in_world: bool) {
        if in_world {
            let before =
                self.signs.take().unwrap_or_else(|| self.setup.system.signs(&self.command));
            let now = self.setup.system.signs(&next);
            self.signs = Some(now);
            if before != now {
                self.judge.crossed = true;
                self.event("singular pose passed", String::new());
            }
        } else {
            self.signs = None;
        }
        let went = self.setup.system.distance(&self.command.poses, &next.poses);
        self.recent = self.recent.max(went);
        self.command = next;
    }

    fn follow(&mut self) {
        self.recent *= 0.8;
        if self.enabled {
            self.queue.push_back(self.command);
            while self.queue.len() > self.lag + 1 {
                self.queue.pop_front();
            }
            self.actual = self.queue.front().copied().unwrap_or(self.command);
        } else {
            self.sag();
        }
    }

    /// Moves joints individually, until the machine stops.
    fn moved_joints(&mut self, from: &State, speeds: &Joints) -> Option<State> {
        let system = &self.setup.system;
        let mut joints = from.joints;
        for joint in 0..system.joints() {
            joints[joint] += speeds[joint];
        }
        let (distance, _, margin) = self.judge.watched(from);
        let next = self.setup.system.near(from, &joints, 0.1 * distance)?;
        let (ahead, _, margin_ahead) = self.judge.watched(&next);
        let jams = ahead < JAMS * self.size() && ahead < distance;
        let ends = margin_ahead < 1.2 && margin_ahead < margin;
        (!jams && !ends).then_some(next)
    }

    fn random_speeds(&mut self, share: f64) -> Joints {
        let system = &self.setup.system;
        let mut speeds = [0.0; 16];
        let (count, size) = (system.joints(), system.size());
        let one = if self.chance(0.6) { Some(pick(&mut self.random, count)) } else { None };
        for joint in (0..count).filter(|joint| one.is_none_or(|one| one == *joint)) {
            let unit = system.unit(joint);
            speeds[joint] = self.random.within(share * self.speed * size) / unit;
        }
        speeds
    }

    fn sag(&mut self) {
        let Some(speeds) = self.sagging else { return };
        let next = if self.setup.system.is_redundant() {
            let actual = self.actual;
            self.setup.system.shifted(&actual, 0.2 * self.speed, &mut self.random)
        } else {
            let actual = self.actual;
            self.moved_joints(&actual, &speeds)
        };
        match next {
            Some(next) => {
                let went = self.setup.system.distance(&self.actual.poses, &next.poses);
                self.recent = self.recent.max(went);
                self.actual = next;
            }
            None => self.sagging = Some(speeds.map(|speed| -speed)),
        }
        self.command = self.actual;
    }

    // ---- LinuxCNC ----

    fn forward(&mut self, caller: Caller, joints: &Joints, truth: &State) -> i32 {
        let injection = self.injection;
        let mut given = *joints;
        if caller == Caller::Feedback {
            self.inject_joints(&mut given);
        }
        let place = caller as usize;
        let code = self.module.forward_into(&given, &mut self.poses[place]);
        let world = self.poses[place];
        let verdict = self.judged(code, injection, caller, &given, truth, &world);
        self.last_code = code;
        if code < 0 {
            let kind = if injection.is_some() { "injected" } else { "machine's joints" };
            *self.counts.entry(format!("refusal {code} of {kind}")).or_default() += 1;
            self.note_refusal(code, caller);
        }
        match &verdict {
            Verdict::Right => {}
            Verdict::Excused(why) => {
                self.judge.count(why);
                self.excused += usize::from(self.excused_in != self.cycle);
                self.excused_in = self.cycle;
            }
            Verdict::Wrong(what) => self.fail(format!("{caller:?}: {what}")),
        }
        if caller == Caller::Command {
            self.command_verdict_right = code >= 0 && verdict == Verdict::Right;
        }
        code
    }

    fn note_refusal(&mut self, code: i32, caller: Caller) {
        let what = format!("{caller:?} refused {code}");
        if !self.history.iter().rev().take(2).any(|last| last.ends_with(&what)) {
            self.note(what);
        }
    }

    fn judged(
        &mut self,
        code: i32,
        injection: Option<Injection>,
        caller: Caller,
        given: &Joints,
        truth: &State,
        world: &Pose,
    ) -> Verdict {
        if self.identity {
            return self.judged_identity(code, given, truth, world);
        }
        let own_joints = match injection {
            Some(Injection::Pin(_, _, expected)) => {
                if code < 0 && (expected == 0 || code == expected) {
                    return Verdict::Right;
                }
                true
            }
            Some(_) => caller == Caller::Command,
            None => true,
        };
        if !own_joints {
            // One of two mechanisms may have accepted distant joints that the other one refused.
            let is_far = matches!(injection, Some(Injection::Far(_)));
            self.judge.strayed |= code < 0 && is_far && self.setup.system.is_pair();
            return match injection {
                _ if code < 0 => Verdict::Right,
                Some(Injection::NotFinite(..)) => {
                    Verdict::Wrong(format!("a pose for a joint that is no number: {world:?}"))
                }
                _ => self.judge.accepted_elsewhere(given, world),
            };
        }
        let reach = self.reach();
        if caller == Caller::Feedback
            && let Some(far) = self.judge.elsewhere.take()
            && let Some(verdict) = self.judge.refused_after_far(code, &far, given)
        {
            return verdict;
        }
        if code < 0 && !matches!(code, -41 | -42) {
            // A repeated refusal is the same one: most of them are not judged again.
            self.in_a_row += 1;
            if self.in_a_row > ALIKE && !self.in_a_row.is_multiple_of(ALIKE) {
                return Verdict::Excused("refused as in the cycles before");
            }
        } else {
            self.in_a_row = 0;
        }
        if code < 0 {
            let commanded = self.commanded_for > self.lag + 4 && self.enabled;
            let system = &self.setup.system;
            let is_passed =
                self.signs.is_some() && system.signs(&self.command) != system.signs(truth);
            let reach = Reach { is_passed, ..reach };
            return self.judge.refused(code, truth, given, reach, commanded);
        }
        self.judge.accepted(truth, given, world, reach)
    }

    /// Confirms that the machine has the module's pose, reached from its last good pose. Returns whether
    /// that pose is known: if its path ends at a singular pose, the operator confirms nothing.
    fn confirm(&mut self) -> bool {
        let Some(good) = self.judge.good else { return false };
        let system = &self.setup.system;
        let led = [self.actual, self.command].map(|s| system.follow(&good, &s.joints).0);
        let [Some(actual), Some(command)] = led else { return false };
        (self.actual, self.command) = (actual, command);
        self.queue.clear();
        (self.judge.crossed, self.judge.held) = (false, false);
        self.judge.count("confirmed by fault-reset");
        true
    }

    fn judged_identity(
        &mut self,
        code: i32,
        given: &Joints,
        truth: &State,
        world: &Pose,
    ) -> Verdict {
        let finite = given[..self.setup.system.joints()].iter().all(|q| q.is_finite());
        if code < 0 {
            return if finite && self.injection.is_none() {
                Verdict::Wrong(format!("refused without need: code {code} in the identity"))
            } else {
                Verdict::Right
            };
        }
        let places = self.setup.system.identity_places();
        let same = places.iter().zip(given).all(|(place, joint)| world[*place] == *joint);
        if !same {
            return Verdict::Wrong(format!("another pose: {world:?} of {given:?} in the identity"));
        }
        if self.injection.is_none() {
            self.judge.seen(truth, given);
        } else {
            self.judge.seen_elsewhere(given);
        }
        Verdict::Right
    }

    fn inject_joints(&mut self, joints: &mut Joints) {
        let system = &self.setup.system;
        let count = system.driven();
        match self.injection {
            Some(Injection::NotFinite(joint, value)) => joints[joint] = value,
            Some(Injection::Zeros) => joints[..count].fill(0.0),
            Some(Injection::Huge(joint)) => joints[joint] = 1e7 * system.size(),
            Some(Injection::Far(share)) => {
                for joint in 0..count {
                    let unit = system.unit(joint);
                    joints[joint] += self.random.within(share * system.size()) / unit;
                }
            }
            Some(Injection::Contradiction(joint, share)) => {
                joints[joint] += share * system.size() / system.unit(joint);
            }
            Some(Injection::Pin(..)) | None => {}
        }
    }

    fn switch(&mut self) {
        if self.kind_known == self.kind_asked {
            return;
        }
        self.kind_known = self.kind_asked;
        let code = self.module.switch(self.kind_known);
        if code != 0 {
            self.event("switch refused", format!("{} {code}", self.kind_known));
            // Joints of the previous cycle decide: an operator repeats the switch.
            let injected = self.injection.is_some() || self.cycle <= self.disturbed + 1;
            if self.kind_known == 0 && self.identity && self.homed && !injected {
                let (truth, reach) = (self.command, self.reach());
                let joints = truth.joints;
                let held = self.judge.held || self.judge.crossed;
                let verdict = self.judge.refused(code, &truth, &joints, reach, false);
                match verdict {
                    Verdict::Wrong(_) if self.judge.strayed => {
                        self.judge.count("a long way back from far joints in the identity");
                        self.excused += usize::from(self.excused_in != self.cycle);
                        self.excused_in = self.cycle;
                    }
                    Verdict::Wrong(what) if !held => self.fail(format!("switch: {what}")),
                    _ => self.judge.count("switch refused with reason"),
                }
            }
            // An error of motion: LinuxCNC aborts.
            self.plan.speed = 0.0;
            self.plan.end = self.plan.at;
            self.wanted = self.motion;
            return;
        }
        self.identity = self.kind_known == 1;
        (self.plan, self.commanded_for, self.signs) = (Plan::default(), 0, None);
        let (joints, truth) = (self.command.joints, self.command);
        if self.homed {
            self.forward(Caller::Command, &joints, &truth);
        } else {
            self.module.forward_into(&joints, &mut self.poses[1]);
        }
        self.plan.start = self.poses[1];
    }

    fn forward_of_feedback(&mut self) {
        if !self.homed {
            self.feedback_ok = false;
            return;
        }
        if !self.feedback_ok {
            self.poses[0] = self.setup.world_home();
        }
        let (joints, truth) = (self.measured, self.actual);
        let code = self.forward(Caller::Feedback, &joints, &truth);
        self.feedback_ok = code >= 0;
        self.feedback_refused = code < 0;
    }

    fn is_at_rest(&self) -> bool {
        self.plan.speed == 0.0 && self.jog_for == 0
    }

    /// Returns whether an operator would begin a motion in world mode from LinuxCNC's pose.
    fn may_enter_world(&mut self) -> bool {
        let (command, reach) = (self.command, self.reach());
        let (distance, _, _) = self.judge.watched(&command);
        distance > 10.0 * (reach.gap + 2.0 * (reach.noise * self.size()).sqrt())
            || self.judge.held
            || self.judge.crossed
    }

    fn set_operating_mode(&mut self) {
        if !self.enabling && self.enabled {
            self.enabled = false;
            (self.plan, self.jog_for) = (Plan::default(), 0);
            self.wanted = self.motion;
            self.command = self.actual;
            self.queue.clear();
            self.note("off".into());
        }
        if self.enabling && !self.enabled {
            self.enabled = true;
            // Commands are the feedback of the last cycle.
            let (actual, measured) = (self.actual, self.measured);
            let (distance, _, _) = self.judge.watched(&actual);
            let finite = measured.iter().all(|q| q.is_finite());
            let near = self.setup.system.near(&actual, &measured, 0.2 * distance);
            self.command = near.filter(|_| finite).unwrap_or(actual);
            if !(self.feedback_ok && self.may_enter_world()) {
                (self.motion, self.wanted) = (Motion::Free, Motion::Free);
            }
            self.queue.clear();
            self.signs = None;
            self.plan = Plan { start: self.poses[1], ..Plan::default() };
            self.note(format!("on, {:?}", self.motion));
        }
        if self.enabled && self.wanted != self.motion && self.is_at_rest() {
            self.enter(self.wanted);
        }
    }

    fn enter(&mut self, motion: Motion) {
        match motion {
            Motion::Free => {
                self.motion = motion;
            }
            _ if !self.homed || !self.may_enter_world() => {
                self.wanted = self.motion;
                return;
            }
            Motion::Teleop => {
                self.motion = motion;
                let (joints, truth) = (self.command.joints, self.command);
                self.forward(Caller::Command, &joints, &truth);
            }
            Motion::Coord => {
                if self.motion == Motion::Free && !self.command_verdict_right && !self.identity {
                    // An operator waits until a pose is shown.
                    self.wanted = self.motion;
                    return;
                }
                self.motion = motion;
            }
        }
        (self.commanded_for, self.signs) = (0, None);
        self.plan = Plan { start: self.poses[1], ..Plan::default() };
        self.event("mode", format!("{motion:?}"));
    }

    fn commands(&mut self, calls: bool) {
        if !self.enabled {
            self.commanded_for = 0;
            if calls {
                self.poses[1] = self.poses[0];
            }
            return;
        }
        if self.motion == Motion::Free {
            self.commanded_for = 0;
            self.free(calls);
        } else {
            self.world(calls);
        }
    }

    fn free(&mut self, calls: bool) {
        if self.jog_for > 0 && self.homed {
            self.jog_for -= 1;
            let (command, jog) = (self.command, self.jog);
            let next = if self.setup.system.is_redundant() {
                self.setup.system.shifted(&command, 0.2 * self.speed, &mut self.random)
            } else {
                self.moved_joints(&command, &jog)
            };
            match next {
                Some(next) => self.advance(next, false),
                None => self.jog = jog.map(|speed| -speed),
            }
        }
        if !calls {
            return;
        }
        if !self.homed {
            self.command_ok = false;
            return;
        }
        if !self.command_ok {
            self.poses[1] = self.setup.world_home();
        }
        let (joints, truth) = (self.command.joints, self.command);
        self.command_ok = self.forward(Caller::Command, &joints, &truth) >= 0;
    }

    fn world(&mut self, calls: bool) {
        let before = self.plan;
        self.plan.advance();
        let world = self.plan.pose();
        if calls {
            self.poses[1] = world;
        }
        if !world.iter().all(|v| v.is_finite()) {
            if calls {
                let mut joints = [0.0; 16];
                if self.module.inverse_into(&world, &mut joints) == 0 {
                    self.fail(format!("inverse of {world:?} gives {joints:?}"));
                }
            }
            self.enabling = false;
            return;
        }
        if self.identity {
            self.world_of_identity(&world, &before, calls);
            return;
        }
        let own = self.setup.system.state(&world);
        let mut joints = [0.0; 16];
        let code = if calls {
            self.module.inverse_into(&world, &mut joints)
        } else if own.as_ref().is_some_and(|(_, margin)| *margin > 1.0) {
            0
        } else {
            -1
        };
        if code != 0 {
            self.note(format!("inverse refused {code}"));
            *self.counts.entry(format!("inverse refused {code}")).or_default() += 1;
            let injected = self.injection.is_some();
            if let Some((state, margin)) = own
                && margin > 1.5
                && code != -77
                && !injected
                && !(code == -16 || code == -18)
                && state.poses.iter().all(|pose| pose[4].abs() < 85.0)
            {
                self.fail(format!("inverse refuses {world:?} with {code}"));
            }
            self.enabling = false;
            return;
        }
        let Some((next, _)) = own else {
            self.fail(format!("inverse of {world:?} gives {joints:?}, and no leg reaches"));
            return;
        };
        if calls {
            for joint in 0..self.setup.system.joints() {
                let unit = self.setup.system.unit(joint);
                let allowed = 1e-10 * self.size() / unit;
                let off = joints[joint] - next.joints[joint];
                // Contradicting joints enter world mode unchanged, and are resolved slowly.
                let settles = self.setup.system.is_redundant() && {
                    let slowly = allowed + SETTLED_IN_A_CYCLE * self.size();
                    let moved = slowly + 2.0 * self.speed * self.size() / unit;
                    match self.commanded_for {
                        0 => {
                            // LinuxCNC commands the measured positions while the machine is off.
                            let measured = 2.0 * self.noise * self.size() / unit;
                            let from =
                                |own: f64, more: f64| (joints[joint] - own).abs() <= moved + more;
                            from(self.command.joints[joint], 0.0)
                                || from(self.measured[joint], measured)
                        }
                        _ => {
                            let left = self.contradiction[joint];
                            off.abs() <= left.abs() && (off - left).abs() <= slowly
                        }
                    }
                };
                self.contradiction[joint] = off;
                if !(off.abs() <= allowed || settles) {
                    let own = next.joints[joint];
                    let text =
                        format!("joint {joint} of {world:?} is {own}, not {}", joints[joint]);
                    self.fail(text);
                }
            }
            self.commanded_for += 1;
        }
        let (distance, _, _) = self.judge.watched(&{ self.command });
        let jump = self.setup.system.distance(&self.command.poses, &next.poses);
        if jump > 0.5 * distance + 20.0 * self.fastest * self.size() {
            let command = self.command.poses;
            self.fail(format!(
                "another pose: LinuxCNC's goes from {command:?} to {:?}",
                next.poses
            ));
        }
        self.advance(next, true);
    }

    fn world_of_identity(&mut self, world: &Pose, before: &Plan, calls: bool) {
        let places = self.setup.system.identity_places();
        let mut speeds = [0.0; 16];
        for (joint, place) in places.iter().enumerate() {
            speeds[joint] = world[*place] - self.command.joints[joint];
        }
        let command = self.command;
        let Some(next) = self.moved_joints(&command, &speeds) else {
            // The operator stops before the machine jams.
            self.plan = Plan { speed: 0.0, end: before.at, ..*before };
            let at = self.plan.pose();
            self.poses[1] = at;
            if calls {
                self.inverse_of_identity(&at);
            }
            return;
        };
        if calls {
            self.inverse_of_identity(world);
        }
        self.advance(next, false);
    }

    fn inverse_of_identity(&mut self, world: &Pose) {
        let mut joints = [0.0; 16];
        let code = self.module.inverse_into(world, &mut joints);
        let places = self.setup.system.identity_places();
        let same = places.iter().zip(joints).all(|(place, joint)| world[*place] == joint);
        if code != 0 || !same {
            self.fail(format!("identity: inverse of {world:?} gives {code} {joints:?}"));
        }
    }

    /// Runs a servo cycle.
    fn step(&mut self) {
        self.cycle += 1;
        if self.missed > 0 {
            self.missed -= 1;
            self.commands(false);
            self.follow();
            return;
        }
        self.happen();
        self.follow();
        if !self.homed {
            if self.unhomed_for == 0 {
                self.home();
            } else {
                self.unhomed_for -= 1;
            }
        }
        self.measure();
        let monitored = !self.setup.drops_in;
        if monitored {
            self.module.set("machine-on", f64::from(u8::from(self.enabled)));
        }
        let restore = self.inject_pins();
        if self.chance(0.1) && self.homed && self.motion != Motion::Free && self.enabled {
            // The end point of a queued move.
            let end = self.setup.control.sample(&mut self.random);
            if !self.identity {
                let _ = self.module.inverse_into(&end, &mut [0.0; 16]);
            }
        }
        self.switch();
        self.forward_of_feedback();
        self.set_operating_mode();
        self.commands(true);
        if monitored {
            self.reset_faults();
            self.module.monitor();
            self.module.clear_messages();
        }
        if let Some((pin, value)) = restore {
            self.module.set(pin, value);
        }
        self.injection = None;
        if std::mem::take(&mut self.enters_teleop) {
            self.wanted = Motion::Teleop;
        }
    }

    fn inject_pins(&mut self) -> Option<(&'static str, f64)> {
        let Some(Injection::Pin(pin, value, _)) = self.injection else { return None };
        let before = self.module.get(pin);
        self.module.set(pin, value);
        Some((pin, before))
    }

    fn reset_faults(&mut self) {
        if self.reset == 0 {
            return;
        }
        self.reset -= 1;
        let is_commanded = self.enabled && self.motion != Motion::Free && !self.identity;
        let quiet = !is_commanded && self.homed;
        // An operator can confirm only a pose that was found.
        let finds = self.last_code >= 0 || matches!(self.last_code, -41 | -42);
        let confirms = self.reset == 1 && quiet && finds;
        if confirms && (self.judge.held || self.judge.crossed) && !self.confirm() {
            self.reset = 0;
            return;
        }
        self.module.set("fault-reset", f64::from(u8::from(self.reset > 0)));
    }

    // ---- what happens ----

    fn happen(&mut self) {
        if self.injection.is_none() && self.homed && self.chance(0.01) {
            self.inject();
        }
        if self.homed && self.chance(0.003) {
            self.miss();
        }
        if self.enabled && self.homed && self.is_at_rest() && self.chance(0.1) {
            self.move_on();
        }
        // Beyond a singular pose there are more events.
        let often = match () {
            () if self.judge.held || self.judge.crossed => 4.0,
            () if self.plan.speed > 0.0 && self.fastest == THROUGH => 0.3,
            () => 1.0,
        };
        if self.homed && self.chance(0.003 * often) {
            self.stop();
            self.wanted = [Motion::Free, Motion::Teleop, Motion::Coord][pick(&mut self.random, 3)];
        }
        if self.homed && self.chance(0.0015 * often) {
            if self.enabling {
                self.enabling = false;
                self.event("off", String::new());
                let sags = self.chance(0.6);
                let speeds = self.random_speeds(0.3);
                self.sagging = sags.then_some(speeds);
            } else if self.is_undisturbed() {
                self.enabling = true;
                self.event("on", String::new());
            }
        }
        if !self.enabled && !self.enabling && self.is_undisturbed() && self.chance(0.01) {
            self.enabling = true;
            self.event("on", String::new());
        }
        if self.homed && self.setup.system.has_identity() && self.chance(0.002 * often) {
            if self.is_at_rest() {
                self.kind_asked = 1 - self.kind_asked;
                let kind = self.kind_asked;
                self.event("switch", format!("{kind}"));
            } else {
                self.stop();
            }
        }
        if self.identity && self.is_at_rest() && self.homed && self.chance(0.01) {
            self.kind_asked = 1 - self.kind_known;
            let kind = self.kind_asked;
            self.event("switch", format!("{kind}"));
        }
        if self.chance(0.002) || (self.judge.held && self.chance(0.003)) {
            self.ask_reset();
        }
        if self.chance(0.001) || (self.judge.held && self.chance(0.003)) {
            self.ask_homing();
        }
    }

    /// Returns whether the last feedback was the machine's: LinuxCNC continues from it when it is switched on.
    fn is_undisturbed(&self) -> bool {
        self.injection.is_none() && self.cycle > self.disturbed + 3
    }

    fn ask_reset(&mut self) {
        if self.setup.drops_in || self.reset > 0 {
            return;
        }
        self.reset = 2;
        let in_world = self.enabled && self.motion != Motion::Free;
        self.event("fault-reset", if in_world { "in world mode".into() } else { String::new() });
    }

    fn ask_homing(&mut self) {
        if !(self.enabled && self.homed && self.motion == Motion::Free && self.is_at_rest()) {
            if self.enabled && self.homed {
                self.stop();
                self.wanted = Motion::Free;
            }
            return;
        }
        if self.setup.drops_in && self.feedback_refused && !self.judge.held {
            return;
        }
        let cycles = 3 + pick(&mut self.random, 20);
        self.event("homing", format!("{cycles} cycles"));
        self.unhome(cycles);
    }

    fn stop(&mut self) {
        self.plan.stop();
        self.jog_for = 0;
    }

    fn inject(&mut self) {
        let system = &self.setup.system;
        let (count, driven) = (system.joints(), system.driven());
        let joint = pick(&mut self.random, driven);
        let injection = match pick(&mut self.random, 12) {
            0..3 => {
                let value = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][pick(&mut self.random, 3)];
                Injection::NotFinite(pick(&mut self.random, count), value)
            }
            3 => Injection::Zeros,
            4 => Injection::Far(0.05),
            5 => Injection::Far(0.5),
            6 => Injection::Huge(joint),
            7 => {
                let share = 0.1 * if self.chance(0.5) { 1.0 } else { -1.0 };
                Injection::Contradiction(joint, share)
            }
            8 => Injection::Pin("limit-iterations", 1.0, -35),
            9 => Injection::Pin("limit-iterations", 0.0, -37),
            10 => Injection::Pin("convergence-criterion", f64::NAN, -38),
            _ => Injection::Pin("tool-offset", f64::NAN, 0),
        };
        let name = match injection {
            Injection::Pin(pin, ..) => format!("refusal by {pin}"),
            Injection::NotFinite(..) => "refusal by a joint that is no number".into(),
            Injection::Far(_) => "refusal by far joints".into(),
            Injection::Zeros => "refusal by joints of 0".into(),
            Injection::Huge(_) => "refusal by a huge joint".into(),
            Injection::Contradiction(..) => "refusal by a contradiction".into(),
        };
        self.event(&name, format!("{injection:?}"));
        self.injection = Some(injection);
        self.disturbed = self.cycle;
    }

    /// Skips cycles in which the controller does not run, if they pass no singular pose.
    fn miss(&mut self) {
        let cycles = 1 + pick(&mut self.random, 50);
        let command = self.command;
        let (distance, _, _) = self.judge.watched(&command);
        if distance > 10.0 * cycles as f64 * self.fastest * self.size() && self.injection.is_none()
        {
            self.missed = cycles;
            self.event("missed cycles", format!("{cycles}"));
        }
    }

    fn move_on(&mut self) {
        if self.motion == Motion::Free {
            self.jog = self.random_speeds(2.0);
            self.jog_for = 1 + pick(&mut self.random, 600);
            let jog = self.jog;
            self.event("jog", brief(&jog));
            return;
        }
        let system = &self.setup.system;
        let places = system.moved_places();
        let start = self.poses[1];
        let mut target = start;
        let is_lost = self.feedback_refused && self.chance(0.7);
        let far = !is_lost && self.chance(0.3);
        let through = if !is_lost && self.motion == Motion::Coord && self.chance(0.5) {
            self.through_singular(&start)
        } else {
            None
        };
        if let Some(beyond) = through {
            target = beyond;
        } else if is_lost && !self.identity {
            // Back to where it was.
            target = self.setup.control.home();
        } else if self.identity {
            let speeds = self.random_speeds(100.0);
            for (joint, place) in self.setup.system.identity_places().into_iter().enumerate() {
                target[place] += speeds[joint];
            }
        } else if self.motion == Motion::Teleop {
            let place = places[pick(&mut self.random, places.len())];
            let share = if far { 1.0 } else { 0.2 };
            let size = self.size();
            target[place] += if place > 2 && place < 6 {
                self.random.within(90.0 * share)
            } else {
                self.random.within(share * size)
            };
        } else {
            let sample = self.setup.control.sample(&mut self.random);
            let times = if far { self.random.between(1.5, 4.0) } else { 1.0 };
            for k in places {
                target[k] = start[k] + times * (sample[k] - start[k]);
            }
        }
        let size = self.size();
        let way: Pose = std::array::from_fn(|k| target[k] - start[k]);
        let length = |k: usize| {
            if (3..6).contains(&k) { way[k].abs() * size / 150.0 } else { way[k].abs() }
        };
        let length = (0..9).map(length).fold(0.0, f64::max);
        if !(length > 0.0) {
            return;
        }
        // Lines through singular poses are long, and a sequence is short.
        let speed = if through.is_some() { THROUGH } else { self.speed };
        let most = speed * size / length * self.random.between(0.2, 1.0);
        self.fastest = speed;
        self.plan = Plan { start, way, at: 0.0, speed: 0.0, most, end: 1.0 };
        self.plan.speed = most / RAMP;
        let kind = if through.is_some() { "move through a singular pose" } else { "move" };
        self.event(kind, format!("{} by {}", brief(&start), brief(&way)));
    }

    /// Returns a target beyond a singular pose on a line from here: the nearest on some random lines.
    fn through_singular(&mut self, start: &Pose) -> Option<Pose> {
        if self.identity || self.setup.system.is_redundant() {
            return None;
        }
        let found = (0..6).filter_map(|_| self.beyond_singular(start)).collect::<Vec<_>>();
        found.into_iter().min_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, target)| target)
    }

    /// Returns where a random line from here passes a singular pose, as a share of the size, and a target beyond.
    fn beyond_singular(&mut self, start: &Pose) -> Option<(f64, Pose)> {
        let (places, size) = (self.setup.system.moved_places(), self.size());
        let before = self.setup.system.signs(&self.setup.system.state(start)?.0);
        let one = if self.chance(0.5) {
            Some(places[pick(&mut self.random, places.len())])
        } else {
            None
        };
        let mut way = [0.0; 9];
        for k in places.into_iter().filter(|k| one.is_none_or(|one| one == *k)) {
            let share = self.random.within(1.0);
            let share = if one.is_some() { share.signum() } else { share };
            way[k] = share * if (3..6).contains(&k) { 150.0 } else { size };
        }
        let at = |share: f64| -> Pose { std::array::from_fn(|k| start[k] + share * way[k]) };
        let system = &self.setup.system;
        let share = (1..40).map(|n| 0.02 * f64::from(n)).find_map(|share| {
            let state = system.state(&at(share)).map(|(state, _)| state);
            match state {
                None => Some(None),
                Some(state) => (system.signs(&state) != before).then_some(Some(share)),
            }
        })??;
        let beyond = at(share + self.random.between(0.0, 0.1));
        self.setup.system.state(&beyond).map(|_| (share, beyond))
    }
}

impl Plan {
    fn pose(&self) -> Pose {
        std::array::from_fn(|k| self.start[k] + self.at * self.way[k])
    }

    /// Advances with a trapezoidal speed profile.
    fn advance(&mut self) {
        if self.speed == 0.0 {
            return;
        }
        let ramp = self.most / RAMP;
        let left = self.end - self.at;
        let stopping = self.speed * self.speed / (2.0 * ramp);
        self.speed = if left <= stopping + self.speed {
            (self.speed - ramp).max(0.0)
        } else {
            (self.speed + ramp).min(self.most)
        };
        self.at = (self.at + self.speed).min(self.end);
        if self.at >= self.end {
            self.speed = 0.0;
        }
    }

    fn stop(&mut self) {
        if self.speed > 0.0 {
            let ramp = self.most / RAMP;
            self.end = self.end.min(self.at + self.speed * self.speed / (2.0 * ramp));
        }
    }
}

fn pick(random: &mut Random, count: usize) -> usize {
    (random.between(0.0, count as f64) as usize).min(count - 1)
}
