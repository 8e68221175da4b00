// SPDX-License-Identifier: GPL-2.0-or-later
//! Commanded motions through singular poses: forward, which stays on its side of them, must not tell
//! the mirror image of the commanded pose as if it were the machine's.

use abi_tests::geometry::distance;
use abi_tests::machines::{random_hexapod, random_pose};
use abi_tests::module::Pose;
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::sequence::{Line, PASSED, Sequences};
use abi_tests::subjects::{Subject, hexapods, subjects};
use kinematics::Cause;

/// How far forward's pose may be from the commanded one where the joints are exactly its own, relative
/// to the machine's size: next to a singular pose roundings of 1e-16 make their square root of a pose.
const SAME_REL: f64 = 1e-6;

#[test]
fn lines_of_the_hexapods_through_singular_poses_are_refused_beyond_them() {
    let mut random = Random::new(61);
    assert_eq!(PASSED, Cause::SingularPassed.code());
    for Subject { name, machine, .. } in hexapods() {
        for step in [0.02, 0.5] {
            let mut found = Sequences::default();
            let modules = || machine.module();
            let from = machine.home.expect("home");
            found.follow_lines((&machine, &modules), &from, step, &mut random);
            let enough = found.lines >= 8 && 2 * found.passed >= found.lines;
            assert!(enough && found.answered == 0, "{name}: {found:?}");
            assert!(found.farthest <= SAME_REL, "{name}: {found:?}");
        }
    }
}

#[test]
fn lines_of_random_machines_through_singular_poses_are_refused_beyond_them() {
    let mut random = Random::new(62);
    let mut found = Sequences::default();
    for _ in 0..cases(8) {
        let start = random_pose(&mut random, 1000.0);
        let mut hexapod = random_hexapod(&mut random, 1000.0);
        hexapod.home = Some(start);
        let machine = Parallel::from(hexapod);
        if !machine.apply(&machine.loaded()) {
            continue;
        }
        let step = random.between(0.02, 0.5);
        found.follow_lines((&machine, &|| machine.module()), &start, step, &mut random);
    }
    assert!(found.lines >= 8 && found.passed > 0 && found.answered == 0, "{found:?}");
    assert!(found.farthest <= SAME_REL, "{found:?}");
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
