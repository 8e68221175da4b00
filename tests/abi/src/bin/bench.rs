// SPDX-License-Identifier: GPL-2.0-or-later
//! Time, iterations, failures and wrong results of the built module beside
//! LinuxCNC's genhexkins, measured in one run in turns, as Markdown.
//!
//! Wall times depend on the machine and are printed, never asserted; the ratio
//! of two modules measured in turns is what stays.

use abi_tests::geometry::distance;
use abi_tests::machines::{
    Hexapod, PAPER_004_HOME, genhexkins_default, one_servo_step_from, paper_004, paper_004_pose,
    tilted,
};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::random::{Random, cases};
use abi_tests::tolerances::{GENHEXKINS_SAME, WRONG_REL};
use std::hint::black_box;
use std::time::Instant;

/// Poses a batch: enough for the clock, few enough to stay in the cache.
const POSES: usize = 500;

/// Batches of each measurement; the median of them is reported.
const BATCHES: usize = 101;

/// genhexkins gives up at an error sum above `max-error`, by default 500 lengths
/// of any unit; this lets it go on, so that its speed can be measured at all.
const NO_MAX_ERROR: f64 = 1e9;

/// A machine with the poses it is measured at.
struct Subject {
    name: &'static str,
    machine: Hexapod,
    home: Pose,
    sample: fn(&mut Random) -> Pose,
}

/// What the calls of one module on one subject came to.
#[derive(Default)]
struct Outcome {
    iterations: Vec<f64>,
    failures: usize,
    wrong: usize,
}

/// Start of forward for a pose.
#[derive(Clone, Copy)]
enum Seed {
    ServoStep,
    Home,
}

struct Case {
    pose: Pose,
    near: Pose,
    joints: Joints,
}

fn subjects() -> Vec<Subject> {
    let without_lead = Hexapod { lead: 0.0, ..paper_004() };
    let mut home = [0.0; 9];
    home[2] = 20.0;
    let default = Hexapod { home: Some(home), ..genhexkins_default(&Module::genhexkins()) };
    let sample = paper_004_pose;
    vec![
        Subject { name: "paper 004, lead 10", machine: paper_004(), home: PAPER_004_HOME, sample },
        Subject { name: "paper 004, lead 0", machine: without_lead, home: PAPER_004_HOME, sample },
        Subject { name: "genhexkins' defaults", machine: default, home, sample: genhexkins_pose },
    ]
}

/// Poses of genhexkins' default geometry (inches) with up to 20° of tilt: beyond
/// that it has singular poses.
fn genhexkins_pose(random: &mut Random) -> Pose {
    let (a, b) = tilted(20.0 * random.between(0.0, 1.0).sqrt(), random.within(180.0));
    let (x, y, z) = (random.within(5.0), random.within(5.0), random.between(15.0, 25.0));
    [x, y, z, a, b, 0.0, 0.0, 0.0, 0.0]
}

fn case(subject: &Subject, module: &Module, random: &mut Random) -> Case {
    let pose = (subject.sample)(random);
    let joints = module.inverse(&pose).expect("a pose of the workspace");
    let near = one_servo_step_from(&pose, subject.machine.size(), random);
    Case { pose, near, joints }
}

/// Mean nanoseconds of one call of `run` over all cases.
fn timed(cases: &[Case], mut run: impl FnMut(&Case)) -> f64 {
    let start = Instant::now();
    for case in cases {
        run(black_box(case));
    }
    start.elapsed().as_nanos() as f64 / cases.len() as f64
}

fn inverse_batch(module: &Module, cases: &[Case]) -> f64 {
    let (_, inverse) = module.entry_points();
    let mut joints: Joints = [0.0; 16];
    timed(cases, |case| {
        // SAFETY: every pointer is to a live object of the size LinuxCNC uses.
        black_box(unsafe { inverse(&case.pose, joints.as_mut_ptr(), &0, &mut 0) });
        black_box(&joints);
    })
}

fn forward_batch(module: &Module, cases: &[Case], seed: Seed, home: &Pose) -> f64 {
    let (forward, _) = module.entry_points();
    // One variable for all calls, as LinuxCNC's status has.
    let mut world = *home;
    timed(cases, |case| {
        world = match seed {
            Seed::ServoStep => case.near,
            Seed::Home => *home,
        };
        // SAFETY: as above.
        black_box(unsafe { forward(case.joints.as_ptr(), &mut world, &0, &mut 0) });
        black_box(&world);
    })
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Medians of `measure` for both modules, taken in turns so that both see the
/// same clock, temperature and neighbours.
fn in_turns(modules: &[&Module; 2], mut measure: impl FnMut(&Module) -> f64) -> [f64; 2] {
    let mut times = [Vec::new(), Vec::new()];
    for batch in 0..BATCHES {
        for k in 0..2 {
            let which = (batch + k) % 2;
            times[which].push(measure(modules[which]));
        }
    }
    times.map(|mut t| median(&mut t))
}

/// Iterations, failures and wrong poses; apart from the timing, as it reads pins.
fn judged(module: &Module, subject: &Subject, cases: &[Case], seed: Seed) -> Outcome {
    let mut result = Outcome::default();
    for case in cases {
        let start = match seed {
            Seed::ServoStep => &case.near,
            Seed::Home => &subject.home,
        };
        // The most since this reset: genhexkins solves again for the GUI's pins
        // within the same call, and last-iterations is that second one's.
        module.set("max-iterations", 0.0);
        let Ok(found) = module.forward(&case.joints, start) else {
            result.failures += 1;
            continue;
        };
        result.iterations.push(module.get("max-iterations"));
        let apart = distance(&found, &case.pose, subject.machine.radius());
        let allowed = (WRONG_REL * subject.machine.size()).max(GENHEXKINS_SAME);
        result.wrong += usize::from(apart.is_nan() || apart > allowed);
    }
    result
}

/// Median and most of the iterations.
fn iterations(outcome: &Outcome) -> String {
    let mut sorted = outcome.iterations.clone();
    if sorted.is_empty() {
        return "–".to_string();
    }
    let median = median(&mut sorted);
    format!("{median:.0} / {:.0}", sorted[sorted.len() - 1])
}

fn row(call: &str, subject: &Subject, results: [Option<Outcome>; 2], times: [f64; 2]) {
    let mut cells = Vec::new();
    for (result, time) in results.into_iter().zip(times) {
        cells.push(format!("{time:.0}"));
        if let Some(result) = result {
            cells.push(iterations(&result));
            cells.push(format!("{} / {}", result.failures, result.wrong));
        } else {
            cells.extend(["–".to_string(), "–".to_string()]);
        }
    }
    let ratio = times[1] / times[0];
    println!("| {call} | {} | {} | {ratio:.1} |", subject.name, cells.join(" | "));
}

/// Both modules with the subject's machine; genhexkins with its literal arcsin.
fn modules(subject: &Subject) -> [Module; 2] {
    let ours = Module::pkmkins(&[]);
    assert!(subject.machine.apply(&ours), "{:?}", ours.messages());
    let theirs = Module::genhexkins();
    subject.machine.wire(&theirs);
    theirs.set("max-error", NO_MAX_ERROR);
    [ours, theirs]
}

fn bench(subject: &Subject) {
    let modules = modules(subject);
    let both = [&modules[0], &modules[1]];
    let mut random = Random::new(9);
    let cases: Vec<Case> = (0..POSES).map(|_| case(subject, &modules[0], &mut random)).collect();
    row("inverse", subject, [None, None], in_turns(&both, |m| inverse_batch(m, &cases)));
    for (call, seed) in [("forward, servo step", Seed::ServoStep), ("forward, home", Seed::Home)] {
        let judged = both.map(|m| Some(judged(m, subject, &cases, seed)));
        let times = in_turns(&both, |m| forward_batch(m, &cases, seed, &subject.home));
        row(call, subject, judged, times);
    }
}

/// From home with everything as shipped: what the operator gets after homing.
fn from_home(subject: &Subject) {
    let [ours, theirs] = modules(subject);
    theirs.set("max-error", 500.0);
    let mut random = Random::new(10);
    let count = cases(20_000);
    let cases: Vec<Case> = (0..count).map(|_| case(subject, &ours, &mut random)).collect();
    for (name, module) in [("pkmkins", &ours), ("genhexkins", &theirs)] {
        let result = judged(module, subject, &cases, Seed::Home);
        println!(
            "| {} | {name} | {count} | {} ({:.1} %) | {} | {} |",
            subject.name,
            result.failures,
            100.0 * result.failures as f64 / count as f64,
            result.wrong,
            iterations(&result),
        );
    }
}

fn main() {
    let subjects = subjects();
    println!("Medians of {BATCHES} batches of {POSES} calls, the modules in turns; iterations are");
    println!("median / most; genhexkins with max-error lifted, so that it answers at all, and");
    println!("including the second solution it makes for its GUI pins.\n");
    println!(
        "| call | machine | pkmkins ns | iterations | failed / wrong \
         | genhexkins ns | iterations | failed / wrong | times as fast |"
    );
    println!("|---|---|--:|--:|--:|--:|--:|--:|--:|");
    subjects.iter().for_each(bench);
    println!("\nFrom home, both modules with their default settings:\n");
    println!("| machine | module | poses | failed | wrong | iterations |");
    println!("|---|---|--:|--:|--:|--:|");
    subjects.iter().for_each(from_home);
}
