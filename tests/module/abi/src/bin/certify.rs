// SPDX-License-Identifier: GPL-2.0-or-later
//! Prints how often forward is right, refuses and is wrong, compared with genhexkins and pentakins in one run, as
//! Markdown.
//!
//! The right pose is the end of the path from the seed along the straight line of the
//! joint values; if that reaches a singular pose there is none, and forward must fail.

use abi_tests::geometry::distance;
use abi_tests::machines::{
    Hexapod, PAPER_004_HOME, genhexkins_default, one_servo_step_from, paper_004, paper_004_pose,
};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::sequence::Sequences;
use abi_tests::subjects::{pentapod_pose, sample_pentapod};
use abi_tests::tolerances::{GENHEXKINS_SAME, WRONG_REL};
use abi_tests::tracker::{connected_pose, same_handed};
use std::thread;

/// Number of poses of a row; with PKMKINS_CASES=10 as many as the long tier of the core's tests.
const SERVO_STEPS: usize = 100_000;
const FROM_HOME: usize = 2000;

/// genhexkins and pentakins fail at an error sum above `max-error`, by default 500 and 100 lengths
/// of any unit; this lets them continue.
const NO_MAX_ERROR: f64 = 1e9;

/// A machine with its sampled poses.
struct Subject {
    name: String,
    machine: Parallel,
    home: Pose,
    sample: Box<dyn Fn(&mut Random) -> Pose + Sync>,
    /// LinuxCNC's module for it, and this module with the machine on its pins.
    peer: &'static str,
    theirs: Box<dyn Fn() -> Module + Sync>,
}

/// Start of forward.
#[derive(Clone, Copy, PartialEq)]
enum Seed {
    ServoStep,
    Home,
}

/// Results of a module's calls.
#[derive(Clone, Copy, Default)]
struct Count {
    calls: usize,
    right: usize,
    /// Calls that fail although a right pose exists.
    missed: usize,
    /// Calls that fail because no right pose exists.
    refused: usize,
    wrong: usize,
}

/// Poses with the sign of det J at home, and those beyond a singular pose.
#[derive(Clone, Copy, Default)]
struct Row {
    before: Count,
    behind: Count,
}

impl Subject {
    /// Returns the name without the range of its poses.
    fn machine_name(&self) -> &str {
        self.name.split(", ±").next().unwrap_or(&self.name)
    }

    fn hexapod(
        name: String,
        machine: &Hexapod,
        home: Pose,
        sample: Box<dyn Fn(&mut Random) -> Pose + Sync>,
    ) -> Self {
        let pins = machine.clone();
        let theirs = move || {
            let module = Module::genhexkins();
            pins.wire(&module);
            module.set("max-error", NO_MAX_ERROR);
            module
        };
        let machine = Parallel::from(machine.clone());
        Self { name, machine, home, sample, peer: "genhexkins", theirs: Box::new(theirs) }
    }

    /// Returns the sample configuration of pentakins.
    fn pentapod(name: &str, sample: Box<dyn Fn(&mut Random) -> Pose + Sync>) -> Self {
        let machine = sample_pentapod();
        let pins = machine.clone();
        let theirs = move || {
            let module = Module::of_linuxcnc("pentakins");
            pins.wire_legs(&module);
            module.set("max-error", NO_MAX_ERROR);
            module
        };
        let home = machine.home.expect("given");
        let theirs = Box::new(theirs);
        Self { name: name.to_string(), machine, home, sample, peer: "pentakins", theirs }
    }

    /// Returns the pose with 0 for the machine's constant coordinates; pentakins does not change C.
    fn without_held(&self, mut pose: Pose) -> Pose {
        for k in (0..6).filter(|k| !self.machine.moves(*k)) {
            pose[k] = 0.0;
        }
        pose
    }
}

fn subjects() -> Vec<Subject> {
    let mut home = [0.0; 9];
    home[2] = 20.0;
    let default = Hexapod { home: Some(home), ..genhexkins_default(&Module::genhexkins()) };
    let name = "paper 004, lead 10".to_string();
    let sample = Box::new(paper_004_pose);
    let mut all = vec![Subject::hexapod(name, &paper_004(), PAPER_004_HOME, sample)];
    all.extend([20.0, 40.0, 50.0].map(|most| {
        let name = format!("genhexkins' defaults, ±{most}°");
        let sample = Box::new(move |random: &mut Random| genhexkins_pose(random, most));
        Subject::hexapod(name, &default, home, sample)
    }));
    all.push(Subject::pentapod("pentakins' sample", Box::new(pentapod_pose)));
    all.push(Subject::pentapod("pentakins' sample, ±its axis limits", Box::new(pentakins_pose)));
    all
}

/// Returns a random pose within the axis limits of pentakins' sample configuration; not all are legal.
fn pentakins_pose(random: &mut Random) -> Pose {
    let [x, y, z] = [250.0; 3].map(|most| random.within(most));
    [x, y, z, random.within(50.0), random.within(15.0), 0.0, 0.0, 0.0, 0.0]
}

/// Returns a random pose of genhexkins' default geometry (inches).
fn genhexkins_pose(random: &mut Random, most: f64) -> Pose {
    let (x, y, z) = (random.within(5.0), random.within(5.0), random.between(15.0, 25.0));
    let [a, b, c] = [most; 3].map(|most| random.within(most));
    [x, y, z, a, b, c, 0.0, 0.0, 0.0]
}

/// Both modules with one machine, and the evaluation of their results.
struct Judge {
    machine: Parallel,
    /// Computes joints of poses. Inverse calls of the tested module count as a commanded motion,
    /// with which forward is compared from call to call; sampled poses are not a motion.
    asked: Module,
    modules: [Module; 2],
}

impl Judge {
    fn new(subject: &Subject) -> Self {
        let machine = subject.machine.clone();
        let modules = [machine.module(), (subject.theirs)()];
        Self { asked: machine.module(), modules, machine }
    }

    fn is_same(&self, one: &Pose, other: &Pose) -> bool {
        let allowed = (WRONG_REL * self.machine.size()).max(GENHEXKINS_SAME);
        distance(one, other, self.machine.radius()) <= allowed
    }

    /// Returns the right pose. One servo step from the seed it is the pose itself; the path is followed
    /// only if a module differs.
    fn right(&self, joints: &Joints, seed: &Pose) -> Option<Pose> {
        connected_pose(&self.asked, &self.machine, joints, seed)
    }

    /// Counts one pose for both modules.
    fn add(
        &self,
        rows: &mut [Row; 2],
        pose: &Pose,
        seed: &Pose,
        (subject, start): (&Subject, Seed),
    ) {
        let (asked, home) = (&self.asked, &subject.home);
        let Ok(joints) = asked.inverse(pose) else { return };
        let found = [0, 1].map(|which| self.modules[which].forward(&joints, seed).ok());
        let found = found.map(|found| found.map(|found| subject.without_held(found)));
        let here = |found: &Option<Pose>| found.is_some_and(|found| self.is_same(&found, pose));
        let right = match start == Seed::ServoStep && found.iter().all(here) {
            true => Some(*pose),
            false => self.right(&joints, seed),
        };
        let behind = same_handed(asked, &self.machine, pose, home) != Some(true);
        for (row, found) in rows.iter_mut().zip(found) {
            let count = if behind { &mut row.behind } else { &mut row.before };
            count.calls += 1;
            *match (found, right) {
                (None, None) => &mut count.refused,
                (None, Some(_)) => &mut count.missed,
                (Some(found), Some(right)) if self.is_same(&found, &right) => &mut count.right,
                (Some(_), _) => &mut count.wrong,
            } += 1;
        }
    }
}

/// Counts one thread's share of the poses.
fn judged(subject: &Subject, start: Seed, count: usize, mut random: Random) -> [Row; 2] {
    let judge = Judge::new(subject);
    let mut rows = [Row::default(); 2];
    for _ in 0..count {
        let pose = (subject.sample)(&mut random);
        let seed = match start {
            Seed::ServoStep => {
                let seed = one_servo_step_from(&pose, judge.machine.size(), &mut random);
                subject.without_held(seed)
            }
            Seed::Home => subject.home,
        };
        judge.add(&mut rows, &pose, &seed, (subject, start));
    }
    rows
}

fn sum(one: Count, other: Count) -> Count {
    Count {
        calls: one.calls + other.calls,
        right: one.right + other.right,
        missed: one.missed + other.missed,
        refused: one.refused + other.refused,
        wrong: one.wrong + other.wrong,
    }
}

/// Counts on all cores; the poses depend on their number.
fn on_all_cores(subject: &Subject, start: Seed, count: usize) -> [Row; 2] {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let mut rows = [Row::default(); 2];
    thread::scope(|scope| {
        let share = |k: usize| (count + k) / threads;
        let workers: Vec<_> = (0..threads)
            .map(|k| scope.spawn(move || judged(subject, start, share(k), Random::new(k as u64))))
            .collect();
        for worker in workers {
            for (row, more) in rows.iter_mut().zip(worker.join().expect("no panic")) {
                row.before = sum(row.before, more.before);
                row.behind = sum(row.behind, more.behind);
            }
        }
    });
    rows
}

fn print(call: &str, subject: &Subject, module: &str, row: &Row) {
    let (all, behind) = (sum(row.before, row.behind), row.behind);
    println!(
        "| {call} | {} | {module} | {} | {} | {} | {} | {} | {} | {} | {} |",
        subject.name,
        all.calls,
        all.right,
        all.missed,
        all.refused,
        all.wrong,
        behind.calls,
        behind.right,
        behind.wrong,
    );
}

/// Steps of sequences, machine units per cycle for a machine of 1000.
const STEPS: [f64; 2] = [0.02, 0.5];

/// Prints commanded motions through singular poses.
fn print_sequences() {
    println!(
        "| machine | step of size/1000 | module | lines | refused because the motion has passed it \
         | answered beyond it | farthest from the commanded pose, of size |"
    );
    println!("|---|--:|---|--:|--:|--:|--:|");
    let mut all = subjects();
    all.retain(|subject| subject.peer == "genhexkins");
    all.dedup_by(|one, other| one.machine_name() == other.machine_name());
    for (subject, step) in all.iter().flat_map(|subject| STEPS.map(|step| (subject, step))) {
        let machine = subject.machine.clone();
        let ours = || machine.module();
        let modules: [(&str, &dyn Fn() -> Module); 2] =
            [("pkmkins", &ours), (subject.peer, &subject.theirs)];
        for (name, fresh) in modules {
            let mut found = Sequences::default();
            let way = step / 1000.0 * machine.size();
            found.follow_lines((&machine, fresh), &subject.home, way, &mut Random::new(64));
            let Sequences { lines, passed, answered, farthest } = found;
            println!(
                "| {} | {step} | {name} | {lines} | {passed} | {answered} | {farthest:.1e} |",
                subject.machine_name(),
            );
            assert!(name != "pkmkins" || answered == 0, "a mirror image as success");
        }
    }
}

fn main() {
    print_poses();
    println!();
    print_sequences();
}

fn print_poses() {
    println!(
        "| forward | machine | module | poses | right | failed, a right pose exists \
         | refused, none exists | wrong | behind a singular pose | right | wrong |"
    );
    println!("|---|---|---|--:|--:|--:|--:|--:|--:|--:|--:|");
    let starts =
        [("servo step", Seed::ServoStep, SERVO_STEPS), ("from home", Seed::Home, FROM_HOME)];
    for (call, start, count) in starts {
        for subject in subjects() {
            eprintln!("{call}, {} ...", subject.name);
            let rows = on_all_cores(&subject, start, cases(count));
            print(call, &subject, "pkmkins", &rows[0]);
            print(call, &subject, subject.peer, &rows[1]);
            assert_eq!(rows[0].before.wrong + rows[0].behind.wrong, 0, "another pose as success");
        }
    }
}
