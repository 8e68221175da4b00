// SPDX-License-Identifier: GPL-2.0-or-later
//! Time, iterations, failures and wrong results of the built module compared with LinuxCNC's
//! modules for the same machines, measured alternately in one run, as Markdown.
//!
//! Wall times depend on the machine and are printed, never asserted; only the ratio
//! of two modules measured alternately is reproducible.

use abi_tests::geometry::distance;
use abi_tests::guarded::set_limits;
use abi_tests::limit::{Rates, forward, inverse};
use abi_tests::machines::{
    Hexapod, PAPER_004_HOME, genhexkins_default, one_servo_step_from, paper_004, paper_004_pose,
    tilted,
};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects;
use abi_tests::tolerances::{GENHEXKINS_SAME, WRONG_REL};
use std::hint::black_box;
use std::time::Instant;

/// Number of poses per batch: enough for the clock, few enough for the cache.
const POSES: usize = 500;

/// Number of servo steps from the pose of a case to the neighboring one and back: enough for the clock.
const STEPS: usize = 10;

/// Number of batches per measurement; the tenth fastest is reported: other processes only slow
/// the others down.
const BATCHES: usize = 101;

/// genhexkins fails at an error sum above `max-error`, by default 500 lengths
/// of any unit; this lets it continue, so that its speed can be measured.
const NO_MAX_ERROR: f64 = 1e9;

/// Placeholder for a missing value.
const NONE: &str = "–";

/// A machine with its poses.
struct Subject {
    name: &'static str,
    machine: Parallel,
    home: Pose,
    sample: fn(&mut Random) -> Pose,
    /// LinuxCNC's module for such a machine, if there is one.
    theirs: Option<Theirs>,
    /// Frozen by its first call, without a monitor, as with a HAL file for LinuxCNC's module.
    drops_in: bool,
}

/// One of LinuxCNC's modules and its pins for the subject.
struct Theirs {
    name: &'static str,
    wire: Box<dyn Fn(&Module)>,
}

/// Results of the calls of one module on one subject.
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
    joints: Joints,
    /// A pose one servo step away, and its joints.
    near: Pose,
    near_joints: Joints,
}

/// Returns hexapods, to compare with genhexkins.
fn hexapods() -> Vec<Subject> {
    let without_lead = Hexapod { lead: 0.0, ..paper_004() };
    let mut home = [0.0; 9];
    home[2] = 20.0;
    let default = Hexapod { home: Some(home), ..genhexkins_default(&Module::genhexkins()) };
    let sample: fn(&mut Random) -> Pose = paper_004_pose;
    let unknown = |machine: &Hexapod| Hexapod { home: None, ..machine.clone() };
    let drop_in = |subject: Subject| Subject { drops_in: true, ..subject };
    let (screws, struts) = (unknown(&paper_004()), unknown(&without_lead));
    vec![
        hexapod("paper 004, lead 10", paper_004(), PAPER_004_HOME, sample),
        hexapod("paper 004, lead 0", without_lead, PAPER_004_HOME, sample),
        drop_in(hexapod("paper 004, lead 10, as a drop-in", screws, PAPER_004_HOME, sample)),
        drop_in(hexapod("paper 004, lead 0, as a drop-in", struts, PAPER_004_HOME, sample)),
        drop_in(hexapod(
            "genhexkins' defaults, as a drop-in",
            unknown(&default),
            home,
            genhexkins_pose,
        )),
        hexapod("genhexkins' defaults", default, home, genhexkins_pose),
    ]
}

/// Creates a hexapod; genhexkins uses its literal arcsin, and returns a result for any error.
fn hexapod(
    name: &'static str,
    machine: Hexapod,
    home: Pose,
    sample: fn(&mut Random) -> Pose,
) -> Subject {
    let pins = machine.clone();
    let wire = Box::new(move |module: &Module| {
        pins.wire(module);
        module.set("max-error", NO_MAX_ERROR);
    });
    let theirs = Some(Theirs { name: "genhexkins", wire });
    Subject { name, machine: machine.into(), home, sample, theirs, drops_in: false }
}

/// Returns machines with rods and the tripod, with LinuxCNC's module if there is one.
fn others() -> Vec<Subject> {
    let of = |subject: subjects::Subject| Subject {
        name: subject.name,
        home: subject.home(),
        theirs: theirs(subject.name),
        machine: subject.machine,
        sample: subject.sample,
        drops_in: false,
    };
    subjects::subjects()
        .into_iter()
        .chain(subjects::constrained())
        .filter(|subject| subject.machine.tool == [0.0; 3] && !subject.name.contains("hexapod"))
        .map(of)
        .collect()
}

fn theirs(machine: &str) -> Option<Theirs> {
    if machine == "pentapod on rings" {
        let wire = Box::new(|module: &Module| {
            subjects::sample_pentapod().wire_legs(module);
            module.set("max-error", NO_MAX_ERROR);
        });
        return Some(Theirs { name: "pentakins", wire });
    }
    let (name, pins): (_, &[(&str, f64)]) = match machine {
        "linear delta" => ("lineardeltakins", &[("R", 130.25), ("L", 269.0)]),
        "rotary delta" => ("rotarydeltakins", &[("shinlength", 18.0), ("footradius", 5.0)]),
        "tripod" => ("tripodkins", &[("Bx", 10.0), ("Cx", 5.0), ("Cy", 7.071)]),
        _ => return None,
    };
    let wire = Box::new(|module: &Module| pins.iter().for_each(|(pin, v)| module.set(pin, *v)));
    Some(Theirs { name, wire })
}

/// Returns a random pose of genhexkins' default geometry (inches) with up to 20° of tilt: beyond
/// it has singular poses.
fn genhexkins_pose(random: &mut Random) -> Pose {
    let (a, b) = tilted(20.0 * random.between(0.0, 1.0).sqrt(), random.within(180.0));
    let (x, y, z) = (random.within(5.0), random.within(5.0), random.between(15.0, 25.0));
    [x, y, z, a, b, 0.0, 0.0, 0.0, 0.0]
}

fn case(subject: &Subject, module: &Module, random: &mut Random) -> Case {
    let pose = (subject.sample)(random);
    let joints = module.inverse(&pose).expect("a pose of the workspace");
    let mut near = one_servo_step_from(&pose, subject.machine.size(), random);
    for k in (0..6).filter(|k| !subject.machine.moves(*k)) {
        near[k] = pose[k];
    }
    // Near the edge of the workspace there may be none.
    let (near, near_joints) = module.inverse(&near).map_or((pose, joints), |own| (near, own));
    Case { pose, joints, near, near_joints }
}

/// Returns the mean time of a call of `run` over all cases, nanoseconds.
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

/// Returns the mean time of a call of forward, nanoseconds. A seed other than the previous result means a machine
/// that was homed, as LinuxCNC passes it: then forward starts at home. Servo steps continue from the last pose.
fn forward_batch(module: &Module, cases: &[Case], seed: Seed, home: &Pose) -> f64 {
    let (forward, _) = module.entry_points();
    // One variable for all calls, as in LinuxCNC's status.
    let mut world = *home;
    let mut solve = |joints: &Joints, seed: Option<&Pose>| {
        if let Some(seed) = seed {
            world = *seed;
        }
        // SAFETY: as above.
        black_box(unsafe { forward(joints.as_ptr(), &mut world, &0, &mut 0) });
        black_box(&world);
    };
    if let Seed::Home = seed {
        return timed(cases, |case| solve(&case.joints, Some(home)));
    }
    let mut spent = 0.0;
    for case in cases {
        solve(&case.near_joints, Some(&case.near));
        // There and back.
        let steps = [&case.joints, &case.near_joints].into_iter().cycle().take(STEPS);
        let start = Instant::now();
        steps.for_each(|joints| solve(black_box(joints), None));
        spent += start.elapsed().as_nanos() as f64;
    }
    spent / (cases.len() * STEPS) as f64
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Returns the tenth fastest of some times.
fn undisturbed(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len().min(10) - 1]
}

/// Returns the times of undisturbed batches of `measure` for all modules, alternately, for the same
/// clock, temperature and load.
fn in_turns(modules: &[Module], mut measure: impl FnMut(&Module) -> f64) -> Vec<f64> {
    let mut times = vec![Vec::new(); modules.len()];
    for batch in 0..BATCHES {
        for k in 0..modules.len() {
            let which = (batch + k) % modules.len();
            times[which].push(measure(&modules[which]));
        }
    }
    times.iter_mut().map(|t| undisturbed(t)).collect()
}

/// Counts iterations, failures and wrong poses; separate from the timing, because it reads pins.
fn judged(module: &Module, subject: &Subject, cases: &[Case], seed: Seed) -> Outcome {
    let mut result = Outcome::default();
    for case in cases {
        let start = match seed {
            Seed::ServoStep => &module.forward(&case.near_joints, &case.near).unwrap_or(case.near),
            Seed::Home => &subject.home,
        };
        // The most since this reset: genhexkins solves again for the GUI's pins
        // within the same call, and last-iterations is that of the second solution.
        let counts = module.has("max-iterations");
        if counts {
            module.set("max-iterations", 0.0);
        }
        let Ok(found) = module.forward(&case.joints, start) else {
            result.failures += 1;
            continue;
        };
        if counts {
            result.iterations.push(module.get("max-iterations"));
        }
        let mut found = found;
        // pentakins does not change C, which it does not have.
        (0..6).filter(|k| !subject.machine.moves(*k)).for_each(|k| found[k] = 0.0);
        let apart = distance(&found, &case.pose, subject.machine.radius());
        let allowed = (WRONG_REL * subject.machine.size()).max(GENHEXKINS_SAME);
        result.wrong += usize::from(apart.is_nan() || apart > allowed);
    }
    result
}

/// Returns median and maximum of the iterations.
fn iterations(outcome: &Outcome) -> String {
    let mut sorted = outcome.iterations.clone();
    if sorted.is_empty() {
        return NONE.to_string();
    }
    let median = median(&mut sorted);
    format!("{median:.0} / {:.0}", sorted[sorted.len() - 1])
}

/// Returns the time of the arithmetic alone, and the ratio of the measured time to it; for
/// hexapods one servo step away.
fn limit(call: &str, subject: &Subject, judged: &[Outcome], time: f64, rates: &Rates) -> String {
    let lead = match subject.name {
        "paper 004, lead 10" => true,
        "paper 004, lead 0" => false,
        _ => return format!("{NONE} | {NONE}"),
    };
    let work = match (call, judged.first()) {
        ("inverse", _) => inverse(lead),
        ("forward, servo step", Some(ours)) => forward(lead, median(&mut ours.iterations.clone())),
        _ => return format!("{NONE} | {NONE}"),
    };
    let least = rates.least(&work);
    format!("{least:.0} | {:.1}", time / least)
}

/// Prints one row: ours, then theirs if there is one.
fn row(call: &str, subject: &Subject, judged: &[Outcome], times: &[f64], rates: &Rates) {
    let mut cells = Vec::new();
    for which in 0..2 {
        cells.push(times.get(which).map_or(NONE.to_string(), |time| format!("{time:.0}")));
        if let Some(result) = judged.get(which) {
            cells.push(iterations(result));
            cells.push(format!("{} / {}", result.failures, result.wrong));
        } else {
            cells.extend([NONE.to_string(), NONE.to_string()]);
        }
    }
    let theirs = subject.theirs.as_ref().map_or(NONE, |theirs| theirs.name);
    let ratio = times.get(1).map_or(NONE.to_string(), |time| format!("{:.2}", time / times[0]));
    let limit = limit(call, subject, judged, times[0], rates);
    let cells = cells.join(" | ");
    println!("| {call} | {} | {cells} | {theirs} | {ratio} | {limit} |", subject.name);
}

fn ours(subject: &Subject) -> Module {
    if !subject.drops_in {
        return subject.machine.module();
    }
    let module = subject.machine.loaded();
    subject.machine.wire(&module);
    // Forward, as LinuxCNC calls it first: from home, which fixes the folds of the corrections.
    let joints = module.inverse(&subject.home).expect("home");
    module.forward(&joints, &subject.home).expect("home");
    module
}

/// Returns ours with the subject's machine, then theirs if there is one.
fn modules(subject: &Subject) -> Vec<Module> {
    let mut modules = vec![ours(subject)];
    modules.extend(subject.theirs.iter().map(|theirs| {
        let module = Module::of_linuxcnc(theirs.name);
        (theirs.wire)(&module);
        module
    }));
    modules
}

fn bench(subject: &Subject, rates: &Rates) {
    let modules = modules(subject);
    let mut random = Random::new(9);
    let cases: Vec<Case> = (0..POSES).map(|_| case(subject, &modules[0], &mut random)).collect();
    row("inverse", subject, &[], &in_turns(&modules, |m| inverse_batch(m, &cases)), rates);
    for (call, seed) in [("forward, servo step", Seed::ServoStep), ("forward, home", Seed::Home)] {
        let judged: Vec<Outcome> =
            modules.iter().map(|m| judged(m, subject, &cases, seed)).collect();
        let times = in_turns(&modules, |m| forward_batch(m, &cases, seed, &subject.home));
        row(call, subject, &judged, &times, rates);
    }
}

/// Measures from home with the shipped settings: the state after homing.
fn from_home(subject: &Subject) {
    let modules = modules(subject);
    let mut random = Random::new(10);
    let count = cases(20_000);
    let cases: Vec<Case> = (0..count).map(|_| case(subject, &modules[0], &mut random)).collect();
    for module in &modules {
        match module.name() {
            "genhexkins" => module.set("max-error", 500.0),
            "pentakins" => module.set("max-error", 100.0),
            _ => {}
        }
        let result = judged(module, subject, &cases, Seed::Home);
        println!(
            "| {} | {} | {count} | {} ({:.1} %) | {} | {} |",
            subject.name,
            module.name(),
            result.failures,
            100.0 * result.failures as f64 / count as f64,
            result.wrong,
            iterations(&result),
        );
    }
}

/// Number of cycles of a motion of [`cycle_batch`].
const CYCLES: usize = 20;

/// Returns the mean times of forward, inverse and monitor in a servo cycle of motions with everything guarded,
/// each including the time of the clock, nanoseconds.
fn cycle_batch(module: &Module, motions: &[Vec<(Pose, Joints)>]) -> [f64; 3] {
    let mut spent = [0.0; 3];
    let mut count = 0.0;
    for motion in motions {
        let Some((mut world, begin)) = motion.first().copied() else { continue };
        // From home to the start of the motion.
        module.forward_into(&begin, &mut world);
        for pair in motion.windows(2) {
            let [(_, joints), (pose, _)] = pair else { continue };
            let mut commanded: Joints = [0.0; 16];
            let start = Instant::now();
            black_box(module.forward_into(joints, &mut world));
            let after_forward = Instant::now();
            black_box(module.inverse_into(pose, &mut commanded));
            let after_inverse = Instant::now();
            module.monitor();
            let times =
                [after_forward - start, after_inverse - after_forward, after_inverse.elapsed()];
            for (sum, time) in spent.iter_mut().zip(times) {
                *sum += time.as_nanos() as f64;
            }
            count += 1.0;
        }
    }
    spent.map(|sum| sum / count)
}

/// Returns a motion of [`CYCLES`] servo steps from a pose of the workspace toward home.
fn motion(
    subject: &subjects::Subject,
    module: &Module,
    random: &mut Random,
) -> Vec<(Pose, Joints)> {
    let (from, home) = ((subject.sample)(random), subject.home());
    let way = (0..3).map(|k| (home[k] - from[k]).powi(2)).sum::<f64>().sqrt();
    let share = (5e-4 * subject.machine.size() / way.max(1e-3 * subject.machine.size())).min(0.04);
    let pose = |n: usize| std::array::from_fn(|k| from[k] + n as f64 * share * (home[k] - from[k]));
    (0..=CYCLES).map(pose).filter_map(|pose| Some((pose, module.inverse(&pose).ok()?))).collect()
}

/// Returns the time to read the clock, nanoseconds.
fn clock() -> f64 {
    let start = Instant::now();
    (0..1000).for_each(|_| _ = black_box(Instant::now()));
    start.elapsed().as_nanos() as f64 / 1000.0
}

/// Measures the whole servo cycle, with everything guarded.
fn cycles(subject: &subjects::Subject) {
    let module = subject.machine.module();
    set_limits(&[&subject.machine], &module);
    let speed = 0.5 * subject.machine.size();
    for pin in ["requested-vel", "current-vel"] {
        module.set(pin, speed);
    }
    module.set("conditioning-limit", 0.01);
    let mut random = Random::new(11);
    let motions: Vec<_> = (0..20).map(|_| motion(subject, &module, &mut random)).collect();
    let batches: Vec<[f64; 3]> = (0..BATCHES).map(|_| cycle_batch(&module, &motions)).collect();
    let of = |k: usize| undisturbed(&mut batches.iter().map(|batch| batch[k]).collect::<Vec<_>>());
    let [forward, inverse, monitor] = [0, 1, 2].map(of);
    let all = forward + inverse + monitor;
    println!("| {} | {forward:.0} | {inverse:.0} | {monitor:.0} | {all:.0} |", subject.name);
}

fn main() {
    let mut subjects = hexapods();
    subjects.extend(others());
    println!(
        "The tenth fastest of {BATCHES} batches of {POSES} calls, the modules in turns; iterations are"
    );
    println!("median / most; genhexkins with max-error lifted, so that it answers at all, and");
    println!("including the second solution it makes for its GUI pins.\n");
    println!(
        "| call | machine | pkmkins ns | iterations | failed / wrong \
         | theirs ns | iterations | failed / wrong | theirs | times as fast \
         | arithmetic ns | times that |"
    );
    println!("|---|---|--:|--:|--:|--:|--:|--:|---|--:|--:|--:|");
    let rates = Rates::measured();
    subjects.iter().for_each(|subject| bench(subject, &rates));
    println!("\nArithmetic: what the operations of the call take at the rate of many that do not");
    println!(
        "wait for each other, here {:.2} ns for a multiplication or addition, {:.2} for a",
        rates.flop, rates.division
    );
    println!("division, {:.2} for a root (all in pairs), {:.1} for an arc.", rates.root, rates.arc);
    println!(
        "\nA servo cycle with everything guarded, ns (each with the {:.0} that the clock takes):\n",
        clock()
    );
    println!("| machine | forward | inverse | monitor | together |");
    println!("|---|--:|--:|--:|--:|");
    subjects::subjects().iter().chain(&subjects::constrained()).for_each(cycles);
    println!("\nFrom home, all modules with their default settings:\n");
    println!("| machine | module | poses | failed | wrong | iterations |");
    println!("|---|---|--:|--:|--:|--:|");
    subjects.iter().for_each(from_home);
}
