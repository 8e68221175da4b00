// SPDX-License-Identifier: GPL-2.0-or-later
//! Commanded motions through singular poses: forward, which stays on its side of them, must not tell
//! the mirror image of the commanded pose as if it were the machine's.

use abi_tests::geometry::distance;
use abi_tests::machines::{random_hexapod, random_pose};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, hexapods, subjects};
use abi_tests::tracker::same_handed;
use kinematics::Cause;

/// How far forward's pose may be from the commanded one where the joints are exactly its own, relative
/// to the machine's size: next to a singular pose roundings of 1e-16 make their square root of a pose.
const SAME_REL: f64 = 1e-6;

/// How far lines are followed, relative to the machine's size, and how far beyond a singular pose.
const FARTHEST: f64 = 1.5;
const BEYOND: f64 = 0.1;

/// Cycles of a line before its singular pose that are followed.
const BEFORE: usize = 500;

/// A straight line of poses at a constant step.
struct Line {
    start: Pose,
    step: Pose,
}

impl Line {
    fn at(&self, cycle: usize) -> Pose {
        std::array::from_fn(|k| self.start[k] + cycle as f64 * self.step[k])
    }

    /// The first cycle beyond a singular pose; `None` where the legs end before.
    fn crossing(&self, module: &Module, machine: &Parallel, cycles: usize) -> Option<usize> {
        let beyond = |cycle: usize| {
            let at = self.at(cycle);
            // The determinant by pose coordinates has the factor cos B, which is no singular pose.
            let turned = at[4].to_radians().cos() * self.start[4].to_radians().cos() < 0.0;
            same_handed(module, machine, &at, &self.start).map(|same| same == turned)
        };
        // Coarsely first, then cycle by cycle.
        let mut before = 0;
        for cycle in (50..cycles).step_by(50) {
            if beyond(cycle)? {
                return (before..=cycle).find(|cycle| beyond(*cycle) == Some(true));
            }
            before = cycle;
        }
        None
    }
}

/// What forward did beyond the singular pose of a line.
#[derive(Default, Debug)]
struct Told {
    /// Lines that cross one.
    lines: usize,
    /// Lines with a refusal because the commanded motion had passed it.
    passed: usize,
    /// Farthest of forward's poses from the commanded ones, relative to size.
    farthest: f64,
}

impl Told {
    /// Follows a line as LinuxCNC's controller does with drives that follow exactly.
    fn follow(&mut self, machine: &Parallel, line: &Line, step: f64, monitored: bool) {
        let module = machine.module();
        let size = machine.size();
        let cycles = (FARTHEST * size / step) as usize;
        let Some(crossing) = line.crossing(&machine.module(), machine, cycles) else { return };
        self.lines += 1;
        let mut passed = false;
        // Most of the way there is like any other.
        let first = crossing.saturating_sub(BEFORE);
        let start = line.at(first);
        let mut joints: Joints = module.inverse(&start).expect("the start");
        let (mut world, mut command) = (start, start);
        for cycle in first..crossing + (BEYOND * size / step) as usize {
            let code = module.forward_into(&joints, &mut world);
            if code == 0 {
                let apart = distance(&world, &command, machine.radius()) / size;
                self.farthest = self.farthest.max(apart);
                assert!(cycle <= crossing, "told {} cycles beyond, {apart} away", cycle - crossing);
            } else {
                passed |= code == Cause::SingularPassed.code();
                assert!(world[..3].iter().all(|v| v.is_nan() || *v == 0.0), "{world:?}");
                assert_eq!(module.get("fault"), f64::from(code));
            }
            command = line.at(cycle + 1);
            if module.inverse_into(&command, &mut joints) != 0 {
                break;
            }
            if monitored {
                module.monitor();
            }
        }
        self.passed += usize::from(passed);
    }
}

/// Directions of jogs, then any: a length for each coordinate.
fn directions(random: &mut Random, radius: f64, count: usize) -> Vec<[f64; 6]> {
    let mut all: Vec<[f64; 6]> = (0..12)
        .map(|n| {
            let mut direction = [0.0; 6];
            direction[n / 2] = if n % 2 == 0 { 1.0 } else { -1.0 };
            direction
        })
        .collect();
    for _ in 0..count {
        let (go, turn) = (random.direction(), random.direction());
        all.push(std::array::from_fn(|k| if k < 3 { go[k] } else { turn[k - 3] }));
    }
    // An angle moves the anchors by as much as a length.
    let per_length = (1.0 / radius).to_degrees();
    all.iter()
        .map(|d| std::array::from_fn(|k| if k < 3 { d[k] } else { d[k] * per_length }))
        .collect()
}

fn follow_lines(machine: &Parallel, start: &Pose, step: f64, random: &mut Random, told: &mut Told) {
    for (n, direction) in directions(random, machine.radius(), 14).into_iter().enumerate() {
        let mut line = Line { start: *start, step: [0.0; 9] };
        for (to, along) in line.step.iter_mut().zip(direction) {
            *to = step * along;
        }
        told.follow(machine, &line, step, n % 2 == 0);
    }
}

#[test]
fn lines_of_the_hexapods_through_singular_poses_are_refused_beyond_them() {
    let mut random = Random::new(61);
    for Subject { name, machine, .. } in hexapods() {
        for step in [0.02, 0.5] {
            let mut told = Told::default();
            follow_lines(&machine, &machine.home.expect("home"), step, &mut random, &mut told);
            println!("{name}, {step} mm a cycle: {told:?}");
            assert!(told.lines >= 8 && 2 * told.passed >= told.lines, "{name}: {told:?}");
            assert!(told.farthest <= SAME_REL, "{name}: {told:?}");
        }
    }
}

#[test]
fn lines_of_random_machines_through_singular_poses_are_refused_beyond_them() {
    let mut random = Random::new(62);
    let mut told = Told::default();
    for _ in 0..cases(8) {
        let start = random_pose(&mut random, 1000.0);
        let mut hexapod = random_hexapod(&mut random, 1000.0);
        hexapod.home = Some(start);
        let machine = Parallel::from(hexapod);
        if !machine.apply(&machine.loaded()) {
            continue;
        }
        let step = random.between(0.02, 0.5);
        follow_lines(&machine, &start, step, &mut random, &mut told);
    }
    println!("{told:?}");
    assert!(told.lines >= 8 && told.passed > 0, "{told:?}");
    assert!(told.farthest <= SAME_REL, "{told:?}");
}

/// A machine whose drives lag by some cycles, with noise of the encoders.
#[test]
fn no_ordinary_motion_is_taken_for_one_through_a_singular_pose() {
    let all = subjects();
    let cycles = cases(100_000) / all.len();
    for subject in all {
        let mut random = Random::new(63);
        let (machine, module) = (&subject.machine, subject.machine.module());
        let (size, count) = (machine.size(), machine.joints());
        let lag = 5;
        let mut pose = (subject.sample)(&mut random);
        let mut queue = vec![module.inverse(&pose).expect("within the workspace"); lag];
        let mut world = pose;
        let (mut end, mut left) = (pose, 0);
        for cycle in 0..cycles {
            let mut joints = queue[cycle % lag];
            for joint in joints.iter_mut().take(count) {
                *joint += random.within(1e-5 * size);
            }
            let code = module.forward_into(&joints, &mut world);
            assert_ne!(code, Cause::SingularPassed.code(), "{} cycle {cycle}", subject.name);
            if left == 0 {
                end = (subject.sample)(&mut random);
                // 0.5 mm a cycle on a machine of 1250 mm.
                let way = distance(&pose, &end, machine.radius());
                left = (way / (0.5 / 1250.0 * size)).ceil().max(1.0) as usize;
            }
            for (now, end) in pose.iter_mut().zip(end) {
                *now += (end - *now) / left as f64;
            }
            left -= 1;
            if let Ok(commanded) = module.inverse(&pose) {
                queue[cycle % lag] = commanded;
            }
        }
    }
}

/// After the crossing: refused in joint mode as well, until the way back, or with the machine off.
#[test]
fn a_motion_beyond_a_singular_pose_stays_refused_until_it_has_come_back() {
    let machine = Parallel::from(abi_tests::machines::lab_hexapod());
    let (module, home) = (machine.module(), machine.home.expect("home"));
    module.set("machine-on", 1.0);
    let line = Line { start: home, step: pose_of_c(0.5) };
    let crossing = line.crossing(&machine.module(), &machine, 400).expect("a quarter turn or so");
    let mut joints = module.inverse(&home).expect("home");
    let mut world = home;
    let mut cycle = |at: &Pose| {
        let code = module.forward_into(&joints, &mut world);
        let asked = module.inverse_into(at, &mut joints);
        module.monitor();
        assert_eq!(asked, 0, "inverse answers on both sides");
        code
    };
    for n in 0..crossing + 10 {
        cycle(&line.at(n));
    }
    assert_eq!(cycle(&line.at(crossing + 10)), Cause::SingularPassed.code());
    let message = module.messages().pop().expect("the operator is told").text;
    assert!(message.contains(Cause::SingularPassed.text()), "{message}");
    // The same way back: good as soon as the commanded pose is on forward's side again.
    for n in (crossing - 10..crossing + 10).rev() {
        cycle(&line.at(n));
    }
    assert_eq!(cycle(&line.at(crossing - 10)), 0);
    for n in crossing - 10..crossing + 10 {
        cycle(&line.at(n));
    }
    // Joint mode: two forwards a cycle and no inverse.
    let joints = module.inverse(&line.at(crossing + 10)).expect("inverse answers on both sides");
    let mut worlds = [[f64::NAN; 9]; 2];
    for _ in 0..3 {
        for world in &mut worlds {
            assert_eq!(module.forward_into(&joints, world), Cause::SingularPassed.code());
        }
        module.monitor();
    }
    module.set("machine-on", 0.0);
    module.monitor();
    assert_eq!(module.forward_into(&joints, &mut worlds[0]), 0);
}

/// A turn about Z, degrees a cycle.
fn pose_of_c(step: f64) -> Pose {
    [0.0, 0.0, 0.0, 0.0, 0.0, step, 0.0, 0.0, 0.0]
}
