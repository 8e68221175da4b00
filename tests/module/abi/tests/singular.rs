// SPDX-License-Identifier: GPL-2.0-or-later
//! Commanded motions through singular poses: forward, which stays on its side of them, must not return
//! the mirror image of the commanded pose as the machine's.

use abi_tests::geometry::distance;
use abi_tests::machines::{random_hexapod, random_pose};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::sequence::{Line, PASSED, Sequences};
use abi_tests::subjects::{Subject, hexapods, subjects};
use kinematics::Cause;
use std::cell::RefCell;

/// Largest distance of forward's pose from the commanded one if the joints are exactly its own, relative
/// to the machine's size: near a singular pose roundings of 1e-16 change a pose by their square root.
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

/// A machine whose drives lag by some cycles, with encoder noise.
#[test]
fn no_ordinary_motion_is_taken_for_one_through_a_singular_pose() {
    let all = subjects();
    let cycles = cases(1_000_000) / all.len();
    for subject in all {
        let mut random = Random::new(63);
        let mut noise = 1e-6;
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
                *joint += random.within(noise * size);
            }
            let code = module.forward_into(&joints, &mut world);
            let is_doubted =
                [Cause::SingularPassed, Cause::NotAsCommanded].iter().any(|c| c.code() == code);
            assert!(!is_doubted, "{} cycle {cycle}, noise {noise:.0e}: {code}", subject.name);
            if left == 0 {
                end = (subject.sample)(&mut random);
                noise = [1e-6, 1e-5, 1e-4][random.between(0.0, 3.0) as usize];
                // 0.5 mm per cycle on a machine of 1250 mm.
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

/// The laboratory hexapod beyond a singular pose, with code -41, and the path to move it there again.
struct Beyond {
    module: Module,
    home: Pose,
    line: Line,
    crossing: usize,
    /// At a fixed address, by which the module recognizes LinuxCNC's feedback.
    feedback: Box<RefCell<Pose>>,
    joints: RefCell<Joints>,
}

impl Beyond {
    fn singular() -> Self {
        let machine = Parallel::from(abi_tests::machines::lab_hexapod());
        let (module, home) = (machine.module(), machine.home.expect("home"));
        module.set("machine-on", 1.0);
        let line = Line { start: home, step: pose_of_c(0.5) };
        let crossing =
            line.crossing(&machine.module(), &machine, 400).expect("a quarter turn or so");
        let joints = module.inverse(&home).expect("home");
        let (feedback, joints) = (Box::new(RefCell::new(home)), RefCell::new(joints));
        let beyond = Self { module, home, line, crossing, feedback, joints };
        for n in 0..crossing + 10 {
            beyond.cycle(&beyond.line.at(n));
        }
        assert_eq!(beyond.code(), Cause::SingularPassed.code());
        beyond
    }

    /// Runs a cycle of world mode.
    fn cycle(&self, at: &Pose) -> i32 {
        let code = self.feedback();
        assert_eq!(self.module.inverse_into(at, &mut self.joints.borrow_mut()), 0);
        self.module.monitor();
        code
    }

    /// Runs a cycle without a command and returns its code.
    fn code(&self) -> i32 {
        let code = self.feedback();
        self.module.monitor();
        code
    }

    fn feedback(&self) -> i32 {
        let mut world = self.feedback.borrow_mut();
        let code = self.module.forward_into(&self.joints.borrow(), &mut world);
        // Like LinuxCNC after a refusal.
        if code < 0 {
            *world = self.home;
        }
        code
    }
}

#[test]
fn beyond_a_singular_pose_the_operator_reads_how_to_go_on() {
    let beyond = Beyond::singular();
    let message = beyond.module.messages().pop().expect("the operator sees it").text;
    assert!(message.contains(Cause::SingularPassed.text()), "{message}");
    assert!(message.contains(Cause::SingularPassed.remedy()), "{message}");
}

#[test]
fn the_way_back_ends_the_doubt() {
    let beyond = Beyond::singular();
    for n in (beyond.crossing - 10..beyond.crossing + 10).rev() {
        beyond.cycle(&beyond.line.at(n));
    }
    assert_eq!(beyond.cycle(&beyond.line.at(beyond.crossing - 10)), 0);
}

#[test]
fn joint_mode_and_the_machine_off_do_not_end_the_doubt_and_no_kinematics_are_switched() {
    let beyond = Beyond::singular();
    let passed = Cause::SingularPassed.code();
    // Joint mode: two forward calls per cycle and no inverse.
    let mut command = beyond.home;
    for _ in 0..3 {
        assert_eq!(beyond.feedback(), passed);
        assert_eq!(beyond.module.forward_into(&beyond.joints.borrow(), &mut command), passed);
        command = beyond.home;
        beyond.module.monitor();
    }
    // After a switch to the identity and back, LinuxCNC's planner would keep joint values as coordinates, because it
    // ignores the NaN of forward.
    for kinematics in [1, 0] {
        assert_eq!(beyond.module.switch(kinematics), passed, "{kinematics}");
        assert_eq!(beyond.code(), passed);
    }
    for on in [0.0, 1.0] {
        beyond.module.set("machine-on", on);
        assert_eq!(beyond.code(), passed, "{on}");
    }
}

#[test]
fn homing_at_the_reference_pose_ends_the_doubt_and_homing_elsewhere_does_not() {
    for (at, expected) in [(0, 0), (30, Cause::SingularPassed.code())] {
        let beyond = Beyond::singular();
        *beyond.joints.borrow_mut() = beyond.module.inverse(&beyond.line.at(at)).expect("reached");
        // Not homed: LinuxCNC does not call forward.
        (0..100).for_each(|_| beyond.module.monitor());
        *beyond.feedback.borrow_mut() = beyond.home;
        assert_eq!([beyond.code(), beyond.code()], [expected; 2], "{at}");
    }
}

#[test]
fn fault_reset_ends_the_doubt_where_nothing_is_commanded() {
    let beyond = Beyond::singular();
    let passed = Cause::SingularPassed.code();
    beyond.module.set("fault-reset", 1.0);
    let at = beyond.line.at(beyond.crossing + 10);
    assert_eq!([beyond.cycle(&at), beyond.cycle(&at), beyond.cycle(&at)], [passed; 3]);
    beyond.module.set("fault-reset", 0.0);
    (0..3).for_each(|_| assert_eq!(beyond.code(), passed));
    beyond.module.set("fault-reset", 1.0);
    beyond.code();
    assert_eq!([beyond.code(), beyond.code()], [0; 2]);
}

#[test]
fn fault_reset_ends_no_doubt_while_there_is_no_pose_to_confirm() {
    let beyond = Beyond::singular();
    let joints = *beyond.joints.borrow();
    beyond.joints.borrow_mut()[0] = f64::NAN;
    assert_eq!(beyond.code(), Cause::JointNotFinite.code());
    beyond.module.set("fault-reset", 1.0);
    assert_eq!(beyond.code(), Cause::JointNotFinite.code());
    *beyond.joints.borrow_mut() = joints;
    assert_eq!([beyond.code(), beyond.code()], [Cause::SingularPassed.code(); 2]);
}

#[test]
fn fault_reset_ends_no_doubt_in_world_mode_for_any_commanded_pose() {
    let passed = Cause::SingularPassed.code();
    for coordinate in [1e9, f64::NAN] {
        let beyond = Beyond::singular();
        beyond.module.set("fault-reset", 1.0);
        let at = [coordinate; 9];
        assert_eq!(beyond.feedback(), passed);
        assert!(beyond.module.inverse_into(&at, &mut [0.0; 16]) < 0);
        beyond.module.monitor();
        // The machine is switched off.
        assert_eq!([beyond.code(), beyond.code()], [passed; 2], "{coordinate}");
    }
}

/// Returns a rotation about Z, degrees per cycle.
fn pose_of_c(step: f64) -> Pose {
    [0.0, 0.0, 0.0, 0.0, 0.0, step, 0.0, 0.0, 0.0]
}
