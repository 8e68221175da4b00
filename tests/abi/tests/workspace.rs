// SPDX-License-Identifier: GPL-2.0-or-later
//! The declared workspaces of both hexapods: every pose found again, through the
//! built module, one servo step away and from home.

use abi_tests::geometry::distance;
use abi_tests::machines::{
    Hexapod, LAB_HOME, PAPER_004_HOME, lab_hexapod, lab_pose, one_servo_step_from, paper_004,
    paper_004_pose,
};
use abi_tests::module::{Module, Pose};
use abi_tests::random::{Random, cases};
use abi_tests::tolerances::{INVERSE_REL, NEAR_ITERATIONS, ROUND_TRIP_REL};

struct Subject {
    name: &'static str,
    machine: Hexapod,
    home: Pose,
    sample: fn(&mut Random) -> Pose,
}

fn subjects() -> [Subject; 3] {
    let (hexapod, lab) = ("hexapod of paper 004", "laboratory hexapod");
    let long_tool = Hexapod { tool_offset: 120.0, ..paper_004() };
    let (home, sample) = (PAPER_004_HOME, paper_004_pose as fn(&mut Random) -> Pose);
    [
        Subject { name: hexapod, machine: paper_004(), home, sample },
        Subject { name: "the same with a tool", machine: long_tool, home, sample },
        Subject { name: lab, machine: lab_hexapod(), home: LAB_HOME, sample: lab_pose },
    ]
}

/// Distance of what forward finds from the pose that the joints belong to.
fn error(subject: &Subject, module: &Module, pose: &Pose, seed: &Pose) -> f64 {
    let joints = module.inverse(pose).expect("a pose of the workspace");
    let found = module.forward(&joints, seed);
    let found = found
        .unwrap_or_else(|code| panic!("{}: code {code} from {seed:?} to {pose:?}", subject.name));
    let apart = distance(&found, pose, subject.machine.radius());
    let message = format!("{}: {apart} from {pose:?} to {found:?}", subject.name);
    assert!(apart <= ROUND_TRIP_REL * subject.machine.size(), "{message}");
    apart
}

#[test]
fn every_pose_is_found_again_from_one_servo_step_away_within_three_iterations() {
    for subject in subjects() {
        let module = subject.machine.module();
        let mut random = Random::new(11);
        let count = cases(100_000);
        let mut worst = 0.0_f64;
        for _ in 0..count {
            let pose = (subject.sample)(&mut random);
            let seed = one_servo_step_from(&pose, subject.machine.size(), &mut random);
            worst = worst.max(error(&subject, &module, &pose, &seed));
        }
        let most = module.get("max-iterations");
        println!("{}: {count} poses, worst {worst:.1e} mm, {most} iterations", subject.name);
        assert!(most <= NEAR_ITERATIONS, "{}: {most} iterations", subject.name);
    }
}

#[test]
fn every_pose_is_found_again_from_home() {
    for subject in subjects() {
        let module = subject.machine.module();
        let mut random = Random::new(12);
        let count = cases(100_000);
        let mut worst = 0.0_f64;
        for _ in 0..count {
            let pose = (subject.sample)(&mut random);
            worst = worst.max(error(&subject, &module, &pose, &subject.home));
        }
        let most = module.get("max-iterations");
        println!("{}: {count} poses, worst {worst:.1e} mm, {most} iterations", subject.name);
    }
}

/// No constant of the module has a length in it: a machine in metres or inches
/// solves as well as in millimetres, and scaled by a power of two to the same bits.
#[test]
fn units_do_not_matter() {
    for scale in [1.0 / 1000.0, 1.0 / 25.4, 1.0 / 1024.0, 1024.0] {
        let subject = subjects().into_iter().next().expect("the first");
        let (plain, scaled) = (subject.machine.module(), scaled(&subject.machine, scale).module());
        // The one absolute length is a pin's, and the operator sets it with the units.
        scaled.set("convergence-criterion", 1e-9 * scale);
        let mut random = Random::new(13);
        for _ in 0..cases(2_000) {
            let pose = (subject.sample)(&mut random);
            let joints = plain.inverse(&pose).expect("a pose of the workspace");
            let small = scaled.inverse(&in_units(&pose, scale)).expect("the same pose");
            for (one, other) in joints.iter().zip(small) {
                let apart = (one * scale - other).abs();
                assert!(apart <= INVERSE_REL * scale * subject.machine.size(), "{pose:?} {scale}");
            }
            let found = plain.forward(&joints, &subject.home).expect("solves");
            let home = in_units(&subject.home, scale);
            let also = scaled.forward(&small, &home).expect("solves in these units too");
            assert_same(&in_units(&found, scale), &also, scale, &subject.machine);
        }
    }
}

fn assert_same(one: &Pose, other: &Pose, scale: f64, machine: &Hexapod) {
    if scale.log2().fract() == 0.0 {
        assert_eq!(one, other, "scale {scale}");
    } else {
        let apart = distance(one, other, scale * machine.radius());
        assert!(apart <= ROUND_TRIP_REL * scale * machine.size(), "{one:?} {other:?}");
    }
}

fn in_units(pose: &Pose, scale: f64) -> Pose {
    let mut scaled = *pose;
    scaled[..3].iter_mut().for_each(|length| *length *= scale);
    scaled
}

fn scaled(machine: &Hexapod, scale: f64) -> Hexapod {
    let points = |points: [[f64; 3]; 6]| points.map(|point| point.map(|length| length * scale));
    Hexapod {
        base: points(machine.base),
        platform: points(machine.platform),
        lead: machine.lead * scale,
        home: machine.home.map(|home| in_units(&home, scale)),
        ..machine.clone()
    }
}
