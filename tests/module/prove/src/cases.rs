// SPDX-License-Identifier: GPL-2.0-or-later
//! The calls to count: typical ones of a servo cycle, and hard ones found by
//! search. The search runs at full speed and counts solves; valgrind then counts instructions.

use crate::monitored::{PASSING, begin_forward, pass_singular, passing_pose};
use abi_tests::control::{Control, in_a_chain, on_one_guide};
use abi_tests::machines::{one_servo_step_from, paper_004};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::random::Random;
use abi_tests::subjects::subjects;
use kinematics::{Cause, MAX_ITERATIONS};
use std::collections::BTreeSet;

/// A function of the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Call {
    /// `kinematicsInverse`.
    Inverse,
    /// `kinematicsForward`.
    Forward,
    /// `kinematicsJacobian`.
    Jacobian,
    /// `pkmkins.monitor` while the machine moves and everything is guarded.
    Monitor,
    /// `pkmkins.monitor` in a cycle of a tool change at a tilt.
    ToolChange,
    /// `pkmkins.monitor` as the call that freezes the geometry.
    Applying,
    /// `kinematicsInverse` as the call that freezes the geometry.
    Freezing,
    /// `kinematicsForward` that searches a box with all its steps, without success.
    Searching,
    /// `kinematicsForward` in the cycles around a commanded motion through a singular pose, code -41
    /// among them, and back.
    Passing,
    /// `pkmkins.monitor` in a guarded jog in world mode while corrections of all joints change.
    Jog,
}

/// Every counted state, with its name in the tables: a new one needs a line here, its cases in
/// [`Search::cases`], and the preparation of its call in [`crate::monitored`].
const CALLS: [(Call, &str); 10] = [
    (Call::Inverse, "inverse"),
    (Call::Forward, "forward"),
    (Call::Jacobian, "Jacobian"),
    (Call::Monitor, "monitor"),
    (Call::ToolChange, "monitor, tool change"),
    (Call::Applying, "monitor that freezes"),
    (Call::Freezing, "inverse that freezes"),
    (Call::Searching, "forward that searches"),
    (Call::Passing, "forward, code -41"),
    (Call::Jog, "monitor, jog with corrections"),
];

impl Call {
    /// Returns the name in the tables.
    pub fn name(self) -> &'static str {
        CALLS[self as usize].1
    }
}

/// The purpose of a count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// The usual count.
    Typical,
    /// The largest count.
    Worst,
    /// One of a row of forward calls limited to 1, 2, 3 … solves; the row's number.
    Row(usize),
}

/// One call.
#[derive(Clone, Debug)]
pub struct Case {
    pub machine: usize,
    /// The function.
    pub call: Call,
    pub aim: Aim,
    /// Pose to calculate, or seed.
    pub pose: Pose,
    /// Joints of forward; the motion of the monitor's machine in a cycle, its new tool offset.
    pub joints: Joints,
    /// Largest number of solves for forward; per cent of conditioning that the monitor's machine must
    /// keep; or the number of the cycle since its tool offset was requested, or of one that passes a
    /// singular pose.
    pub limit: u32,
    /// Solves that forward needs, allowed or not.
    pub solves: u32,
}

/// Number of poses of a function in the typical case.
const TYPICAL: usize = 31;

/// Number of searches per machine: their steps differ little.
const SEARCHES: usize = 4;

/// Number of wild poses per machine, and of pairs of unrelated poses.
const WILD: usize = 80;

/// Number of hard forward calls that are counted, and of others; for each kind the number of limited ones,
/// and of their limits, chosen at random.
const HARD: usize = 40;
const ROWS: usize = 6;
const CUTS: usize = 12;

/// Letters of LinuxCNC's pose.
const LETTERS: usize = 9;

/// Returns whether a letter is a length; the others are angles.
fn is_length(letter: usize) -> bool {
    !(3..6).contains(&letter)
}

/// Cycles of a tool change: five at rest, the survey of 65 poses, four per cycle, and some of
/// the motion itself. Changes in the typical case, and at wild poses.
const CHANGE: u32 = 26;
const CHANGES: usize = 3;
const WILD_CHANGES: usize = 20;

/// Per cent of conditioning that machines must keep by default, and a value above that of every
/// machine, which makes them stop and report.
const USUAL_HOLD: u32 = 5;
const EVERY_HOLD: u32 = 300;

/// Number of lines from home that are followed to pass a singular pose, their longest in steps, and the length of a
/// step as a fraction of the machine's size, or in degrees.
const LINES: usize = 40;
const LONGEST: u32 = 600;
const STEP: f64 = 2e-3;
const STEP_DEGREES: f64 = 0.5;

/// Number of bisections between a pose that forward finds and one that it does not: the last two are
/// adjacent, with a singular pose between.
const HALVINGS: usize = 40;

/// Returns every kind of leg, with and without a lead, least squares, and eight legs; then a chain, and two
/// mechanisms, each of which is also included alone.
pub fn machines() -> Vec<Control> {
    let mut struts = subjects();
    let plain = abi_tests::machines::Hexapod { lead: 0.0, ..paper_004() };
    struts[1].name = "hexapod of paper 004, lead 0";
    struts[1].machine = plain.into();
    struts.retain(|s| !matches!(s.name, "laboratory hexapod" | "tripod"));
    struts.retain(|s| !matches!(s.name, "pyramid with a tool" | "linear delta"));
    struts.retain(|s| s.name != "rings, struts and carriages");
    let alone = struts.into_iter().map(Control::Alone);
    alone.chain([in_a_chain(), on_one_guide()]).collect()
}

/// Creates the machine for the search: frozen by its first call, without a monitor.
pub fn unmonitored(control: &Control) -> Module {
    let module = control.loaded();
    control.wire(&module);
    module.inverse(&control.home()).expect("home");
    module
}

/// Creates a machine with a box about home whose steps are too short to reach anything, for each mechanism.
pub fn searching(control: &Control) -> Module {
    let plain = control.module();
    let module = control.loaded_with_boxes(1);
    for (machine, stem) in control.mechanisms().into_iter().zip(["", "second."]) {
        let home = machine.home.expect("every machine has a reference pose");
        for (i, letter) in ["x", "y", "z", "a", "b", "c"].into_iter().enumerate() {
            if !module.has(&format!("{stem}box.0.matrix.{letter}.0")) {
                continue;
            }
            let half = if i < 3 { 0.02 * machine.size() } else { 3.0 };
            module.set(&format!("{stem}box.0.low.{letter}"), home[i] - half);
            module.set(&format!("{stem}box.0.high.{letter}"), home[i] + half);
            for n in 0..machine.legs.len() {
                let sign = if (i + n) % 2 == 0 { 1.0 } else { -1.0 };
                module.set(&format!("{stem}box.0.matrix.{letter}.{n}"), sign * 1e-6);
            }
        }
        module.set(&format!("{stem}box.0.steps"), 4096.0);
        let hash = plain.get(&format!("{stem}geometry-hash"));
        module.set(&format!("{stem}box.0.geometry"), hash);
    }
    assert!(control.apply(&module), "{:?}", module.messages());
    module
}

/// Returns all calls of all machines; the same every time.
pub fn all(machines: &[Control]) -> Vec<Case> {
    machines.iter().enumerate().flat_map(|(i, control)| Search::new(i, control).cases()).collect()
}

struct Search<'a> {
    machine: usize,
    control: &'a Control,
    module: Module,
    random: Random,
}

impl<'a> Search<'a> {
    fn new(machine: usize, control: &'a Control) -> Self {
        let module = unmonitored(control);
        Self { machine, control, module, random: Random::new(91) }
    }

    fn cases(mut self) -> Vec<Case> {
        let mut cases = vec![self.case(Call::Freezing, Aim::Worst, self.control.home())];
        for _ in 0..TYPICAL {
            let pose = self.control.sample(&mut self.random);
            cases.push(self.case(Call::Inverse, Aim::Typical, pose));
            cases.push(self.case(Call::Jacobian, Aim::Typical, pose));
            cases.push(self.motion(Aim::Typical, pose, 1.0, USUAL_HOLD));
            cases.push(self.servo_step(pose));
        }
        for _ in 0..CHANGES {
            let pose = self.control.sample(&mut self.random);
            cases.extend(self.change(Aim::Typical, pose));
        }
        let mut random = Random::new(92);
        cases.extend(self.jogs(&cases));
        cases.extend(self.passing());
        for _ in 0..SEARCHES {
            let pose = self.control.sample(&mut random);
            let joints = self.module.inverse(&pose).expect("a pose of the workspace");
            cases.push(Case { joints, ..self.case(Call::Searching, Aim::Worst, pose) });
        }
        let wild = self.wild();
        for pose in &wild {
            cases.push(self.case(Call::Inverse, Aim::Worst, *pose));
            cases.push(self.case(Call::Jacobian, Aim::Worst, *pose));
        }
        for pose in wild.iter().take(10) {
            cases.push(self.case(Call::Applying, Aim::Worst, *pose));
        }
        for (n, pose) in wild.iter().enumerate() {
            let far = [1e-3, 1.0, 1e2][n % 3];
            cases.push(self.motion(Aim::Worst, *pose, far, [USUAL_HOLD, EVERY_HOLD][n % 2]));
        }
        for pose in wild.iter().take(WILD_CHANGES) {
            cases.extend(self.change(Aim::Worst, *pose));
        }
        cases.extend(self.hard(&wild));
        cases
    }

    fn case(&self, call: Call, aim: Aim, pose: Pose) -> Case {
        let (machine, limit) = (self.machine, MAX_ITERATIONS);
        Case { machine, call, aim, pose, joints: [0.0; 16], limit, solves: 0 }
    }

    /// Returns a pose one servo step away, in U V W as well if something moves them.
    fn near(&mut self, pose: &Pose) -> Pose {
        let size = self.control.size();
        let mut near = one_servo_step_from(pose, size, &mut self.random);
        if (6..LETTERS).any(|i| self.control.moves(i)) {
            let go = one_servo_step_from(&[0.0; 9], size, &mut self.random);
            (6..LETTERS).for_each(|i| near[i] += go[i - 6]);
        }
        near
    }

    /// Returns forward one servo step away.
    fn servo_step(&mut self, pose: Pose) -> Case {
        let near = self.near(&pose);
        let mut seed = pose;
        for (i, value) in seed.iter_mut().enumerate() {
            if self.control.moves(i) {
                *value = near[i];
            }
        }
        let joints = self.module.inverse(&pose).expect("a pose of the workspace");
        Case { joints, ..self.case(Call::Forward, Aim::Typical, seed) }
    }

    /// Returns a motion at a pose, by `far` servo steps in a cycle.
    fn motion(&mut self, aim: Aim, pose: Pose, far: f64, limit: u32) -> Case {
        let near = self.near(&pose);
        let mut case = Case { limit, ..self.case(Call::Monitor, aim, pose) };
        for (i, step) in case.joints.iter_mut().enumerate().take(LETTERS) {
            if self.control.moves(i) {
                *step = far * (near[i] - pose[i]);
            }
        }
        case
    }

    /// Returns all cycles of a tool change at a pose, by up to a fifteenth of the machine's size.
    fn change(&mut self, aim: Aim, pose: Pose) -> Vec<Case> {
        let mut case = self.case(Call::ToolChange, aim, pose);
        for value in case.joints.iter_mut().take(3) {
            *value = self.random.within(self.control.size() / 15.0);
        }
        (0..CHANGE).map(|limit| Case { limit, ..case.clone() }).collect()
    }

    /// Returns the same motions as those of [`Call::Monitor`], as jogs.
    fn jogs(&self, cases: &[Case]) -> Vec<Case> {
        let motions = cases.iter().filter(|case| case.call == Call::Monitor);
        motions.map(|case| Case { call: Call::Jog, ..case.clone() }).collect()
    }

    /// Returns all cycles of a commanded motion through a singular pose and back, if one of some random lines from
    /// home leads through one. The cycles in which forward is called beyond it are the typical ones here.
    fn passing(&self) -> Vec<Case> {
        let mut random = Random::new(93);
        let module = self.control.module();
        for _ in 0..LINES {
            let mut case = self.case(Call::Passing, Aim::Worst, self.control.home());
            for i in (0..LETTERS).filter(|i| self.control.moves(*i)) {
                let most = if is_length(i) { STEP * self.control.size() } else { STEP_DEGREES };
                case.joints[i] = random.within(most);
            }
            let Some(crossing) = first_passed(self.control, &module, &case) else { continue };
            // Restart from shortly before.
            for (value, step) in case.pose.iter_mut().zip(&case.joints) {
                *value += f64::from(crossing.saturating_sub(PASSING / 4)) * step;
            }
            let codes: Vec<i32> = (0..PASSING)
                .map(|limit| {
                    let case = Case { limit, ..case.clone() };
                    let joints = pass_singular(&case, self.control, &module);
                    module.forward_into(&joints, &mut passing_pose(&case, limit))
                })
                .collect();
            if !codes.contains(&Cause::SingularPassed.code()) {
                continue;
            }
            let aim = |k: usize| {
                let is_beyond = codes[k] == Cause::SingularPassed.code();
                if is_beyond { Aim::Typical } else { Aim::Worst }
            };
            return (0..PASSING)
                .map(|limit| Case { limit, aim: aim(limit as usize), ..case.clone() })
                .collect();
        }
        vec![]
    }

    /// Returns poses that no program should contain.
    fn wild(&mut self) -> Vec<Pose> {
        let mut wild = vec![[f64::NAN; 9], [f64::INFINITY; 9], [0.0; 9]];
        let size = self.control.size();
        for _ in 0..WILD {
            let mut pose = self.control.sample(&mut self.random);
            for i in (0..LETTERS).filter(|i| self.control.moves(*i)) {
                let far = if is_length(i) { 0.5 * size } else { 60.0 };
                pose[i] += self.random.within(far);
            }
            wild.push(pose);
        }
        for i in (0..LETTERS).filter(|i| self.control.moves(*i)) {
            for value in self.odd(i, size) {
                let mut pose = self.control.home();
                pose[i] = value;
                wild.push(pose);
            }
        }
        wild
    }

    /// Returns values of a coordinate at which library functions take another branch.
    fn odd(&mut self, coordinate: usize, size: f64) -> Vec<f64> {
        let small = [f64::NAN, f64::NEG_INFINITY, 5e-324, 1e-310, -0.0, 1e-30];
        let large: Vec<f64> = match coordinate {
            _ if is_length(coordinate) => vec![3.0 * size, -100.0 * size, 1e15 * size, 1e300],
            // Near whole quarter turns the argument cancels; far from 0 it is reduced in parts.
            _ => vec![
                89.999_999,
                90.0,
                -90.000_000_1,
                180.0,
                270.0,
                360.0,
                720.000_000_000_1,
                -3_600.0,
                99_999.5,
                359_999.999,
                999_990.0,
                999_999.999_9,
                1.1e6,
            ],
        };
        small.into_iter().chain(large).collect()
    }

    /// Returns forward calls that need many solves, and those that fail in every way.
    fn hard(&mut self, wild: &[Pose]) -> Vec<Case> {
        let mut cases = Vec::new();
        let mut noisy = Vec::new();
        let home = self.control.home();
        for pose in wild {
            cases.extend(self.edge(&home, pose));
            let (from, to) = (self.control.sample(&mut self.random), *pose);
            cases.extend(self.edge(&from, &to));
            noisy.extend(self.noisy(&from, &home));
        }
        // Inconsistent legs are searched for the wrong one at the end.
        let contradicting: Vec<Case> = noisy.iter().take(ROWS).cloned().collect();
        cases.extend(noisy);
        cases.sort_by_key(|case| std::cmp::Reverse(case.solves));
        let apart = cases.len() / HARD;
        let others: Vec<Case> = cases.iter().skip(HARD).step_by(apart).cloned().collect();
        cases.truncate(HARD);
        let hardest = cases.iter().take(ROWS).chain(others.iter().take(ROWS)).cloned();
        let cut: Vec<Case> = hardest.chain(contradicting).collect();
        for (n, case) in cut.iter().enumerate() {
            cases.extend(self.row(case, n));
        }
        cases.extend(others);
        cases.extend(self.broken());
        cases
    }

    /// Returns a call limited to one solve, to all but the last, and at random pairs of
    /// successive limits between.
    fn row(&mut self, case: &Case, number: usize) -> Vec<Case> {
        let mut limits = BTreeSet::from([1, case.solves.max(2) - 1, case.solves]);
        for _ in 0..CUTS {
            let limit = self.random.between(1.0, f64::from(case.solves)) as u32;
            limits.extend([limit, (limit + 1).min(case.solves)]);
        }
        let cut = |limit| Case { aim: Aim::Row(number), limit, ..case.clone() };
        limits.into_iter().map(cut).collect()
    }

    /// Returns forward from one pose to the joints of another.
    fn forward(&self, joints: Joints, seed: Pose) -> Case {
        let case = Case { joints, ..self.case(Call::Forward, Aim::Worst, seed) };
        Case { solves: self.solves(&case), ..case }
    }

    /// Returns two neighbors between one pose and another: the last that forward finds, and the first that
    /// it does not.
    fn edge(&self, from: &Pose, to: &Pose) -> Vec<Case> {
        let between = |t: f64| -> Pose { std::array::from_fn(|i| from[i] + t * (to[i] - from[i])) };
        let joints = |t: f64| self.module.inverse(&between(t)).ok();
        let finds = |t: f64| joints(t).is_some_and(|q| self.module.forward(&q, from).is_ok());
        let (mut low, mut high) = (0.0, 1.0);
        if finds(high) {
            return joints(high).map(|q| self.forward(q, *from)).into_iter().collect();
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if finds(middle) { low = middle } else { high = middle }
        }
        [low, high].into_iter().filter_map(joints).map(|q| self.forward(q, *from)).collect()
    }

    /// Returns joints that no pose has, or that are inconsistent.
    fn noisy(&mut self, pose: &Pose, seed: &Pose) -> Option<Case> {
        let mut joints = self.module.inverse(pose).ok()?;
        let share = self.random.between(0.0, 0.1);
        for (i, joint) in joints.iter_mut().enumerate().take(self.control.joints()) {
            *joint *= 1.0 + share * if i % 2 == 0 { 1.0 } else { -1.0 };
        }
        Some(self.forward(joints, *seed))
    }

    /// Returns NaN, infinity and denormals in a joint or in the seed.
    fn broken(&self) -> Vec<Case> {
        let home = self.control.home();
        let joints = self.module.inverse(&home).expect("home");
        let mut cases = vec![self.forward(joints, [f64::NAN; 9]), self.forward([0.0; 16], home)];
        for value in [f64::NAN, f64::INFINITY, 5e-324, 1e300] {
            for joint in 0..self.control.joints() {
                let mut joints = joints;
                joints[joint] = value;
                cases.push(self.forward(joints, home));
            }
        }
        cases
    }

    /// Returns the fewest solves with which a forward call ends otherwise than for want of solves.
    fn solves(&self, case: &Case) -> u32 {
        let (mut low, mut high) = (0, MAX_ITERATIONS);
        while high - low > 1 {
            let middle = (low + high) / 2;
            self.module.set("limit-iterations", f64::from(MAX_ITERATIONS));
            begin_forward(case, self.control, &self.module);
            self.module.set("limit-iterations", f64::from(middle));
            match self.module.forward_from(&case.joints, &case.pose)
                == Cause::TooManyIterations.code()
            {
                true => low = middle,
                false => high = middle,
            }
        }
        self.module.set("limit-iterations", f64::from(MAX_ITERATIONS));
        high
    }
}

impl Case {
    /// Returns whether its joints are those of a machine that is not homed.
    pub fn is_before_homing(&self) -> bool {
        self.joints.iter().all(|joint| *joint == 0.0)
    }

    /// Writes the data for the measured program as one line.
    pub fn to_line(&self) -> String {
        let mut line = format!("{} {} {} ", self.machine, self.call as usize, self.limit);
        line.push_str(if self.aim == Aim::Typical { "monitored" } else { "alone" });
        for value in self.pose.iter().chain(&self.joints) {
            line.push_str(&format!(" {:x}", value.to_bits()));
        }
        line
    }

    /// Reads a line; of the aim only whether a monitor runs is restored.
    pub fn from_line(line: &str) -> Option<Case> {
        let mut words = line.split_whitespace();
        let machine = words.next()?.parse().ok()?;
        let (call, _) = *CALLS.get(words.next()?.parse::<usize>().ok()?)?;
        let limit = words.next()?.parse().ok()?;
        let aim = if words.next()? == "monitored" { Aim::Typical } else { Aim::Worst };
        let bits = |word: &str| u64::from_str_radix(word, 16).ok().map(f64::from_bits);
        let values: Vec<f64> = words.map(bits).collect::<Option<_>>()?;
        let (pose, joints) = values.split_at_checked(9)?;
        let (pose, joints) = (pose.try_into().ok()?, joints.try_into().ok()?);
        Some(Case { machine, call, aim, pose, joints, limit, solves: 0 })
    }
}

/// Follows a case's line from home; returns the first cycle in which forward is beyond a singular pose.
fn first_passed(control: &Control, module: &Module, case: &Case) -> Option<u32> {
    assert!(control.apply(module), "{:?}", module.messages());
    let at =
        |n: u32| -> Pose { std::array::from_fn(|k| case.pose[k] + f64::from(n) * case.joints[k]) };
    let mut world = case.pose;
    let mut joints = module.inverse(&world).ok()?;
    for n in 0..LONGEST {
        match module.forward_into(&joints, &mut world) {
            0 => {}
            code if code == Cause::SingularPassed.code() => return Some(n),
            _ => return None,
        }
        if module.inverse_into(&at(n), &mut joints) != 0 {
            return None;
        }
        module.monitor();
    }
    None
}
