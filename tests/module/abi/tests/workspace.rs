// SPDX-License-Identifier: GPL-2.0-or-later
//! The declared workspaces of every machine: every pose is found again, through the
//! built module, one servo step away and from home.

use abi_tests::geometry::distance;
use abi_tests::machines::one_servo_step_from;
use abi_tests::module::{Module, Pose};
use abi_tests::parallel::{Kind, Parallel};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, subjects};
use abi_tests::tolerances::{INVERSE_REL, NEAR_ITERATIONS, ROUND_TRIP_REL};

/// Returns the distance of forward's result from the pose of the joints.
fn error(subject: &Subject, module: &Module, pose: &Pose, seed: &Pose) -> f64 {
    let joints = module.inverse(pose).expect("a pose of the workspace");
    let found = module.forward(&joints, seed);
    let found = found
        .unwrap_or_else(|code| panic!("{}: code {code} from {seed:?} to {pose:?}", subject.name));
    let apart = distance(&found, pose, subject.machine.radius());
    let is_found = apart <= ROUND_TRIP_REL * subject.machine.size();
    assert!(is_found, "{}: {apart} from {pose:?} to {found:?}", subject.name);
    apart
}

/// Returns a seed a servo step away, in every coordinate, including constant ones: they are not read.
fn near_seed(subject: &Subject, pose: &Pose, random: &mut Random) -> Pose {
    one_servo_step_from(pose, subject.machine.size(), random)
}

#[test]
fn every_pose_is_found_again_from_one_servo_step_away_within_three_iterations() {
    let mut slow = Vec::new();
    for subject in subjects() {
        let module = subject.machine.module();
        let mut random = Random::new(11);
        let count = cases(100_000);
        let mut worst = 0.0_f64;
        for _ in 0..count {
            let pose = (subject.sample)(&mut random);
            let seed = near_seed(&subject, &pose, &mut random);
            worst = worst.max(error(&subject, &module, &pose, &seed));
        }
        let most = module.get("max-iterations");
        let relative = worst / subject.machine.size();
        println!(
            "{}: {count} poses, worst {relative:.1e} of size, {most} iterations",
            subject.name
        );
        if !(most <= NEAR_ITERATIONS) {
            slow.push(format!("{}: {most} iterations", subject.name));
        }
    }
    assert!(slow.is_empty(), "{slow:?}");
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
            worst = worst.max(error(&subject, &module, &pose, &subject.home()));
        }
        let most = module.get("max-iterations");
        let relative = worst / subject.machine.size();
        println!(
            "{}: {count} poses, worst {relative:.1e} of size, {most} iterations",
            subject.name
        );
    }
}

/// No constant of the module contains a length: a machine in meters or inches
/// is solved as well as in millimeters, and scaled by a power of two to the same bits.
#[test]
fn units_do_not_matter() {
    for subject in subjects() {
        for scale in [1.0 / 1000.0, 1.0 / 25.4, 1.0 / 1024.0, 1024.0] {
            compare_units(&subject, scale);
        }
    }
}

fn compare_units(subject: &Subject, scale: f64) {
    let (plain, scaled) = (subject.machine.module(), scaled(&subject.machine, scale).module());
    // The only absolute length is a pin, which the operator sets with the units.
    scaled.set("convergence-criterion", 1e-9 * scale);
    let mut random = Random::new(13);
    for _ in 0..cases(1_000) {
        let pose = (subject.sample)(&mut random);
        let joints = plain.inverse(&pose).expect("a pose of the workspace");
        let small = scaled.inverse(&in_units(&pose, scale)).expect("the same pose");
        for (n, (one, other)) in joints.iter().zip(small).enumerate() {
            // The angle of a crank does not contain a length.
            let (unit, whole) = match subject.machine.legs.get(n).map(|leg| &leg.kind) {
                Some(Kind::Crank { .. }) => (1.0, 180.0),
                _ => (scale, scale * subject.machine.size()),
            };
            let apart = (one * unit - other).abs();
            assert!(apart <= INVERSE_REL * whole, "{}: {pose:?} {scale}", subject.name);
        }
        let found = plain.forward(&joints, &subject.home()).expect("solves");
        let home = in_units(&subject.home(), scale);
        let also = scaled.forward(&small, &home).expect("solves in these units too");
        assert_same(&in_units(&found, scale), &also, scale, &subject.machine);
    }
}

fn assert_same(one: &Pose, other: &Pose, scale: f64, machine: &Parallel) {
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

fn scaled(machine: &Parallel, scale: f64) -> Parallel {
    let point = |point: [f64; 3]| point.map(|length| length * scale);
    let mut small = machine.clone();
    for leg in &mut small.legs {
        leg.base = point(leg.base);
        leg.platform = point(leg.platform);
        match &mut leg.kind {
            Kind::Strut { lead, .. } => *lead *= scale,
            Kind::Ring { radius } => *radius *= scale,
            Kind::Slider { rod, .. } => *rod *= scale,
            Kind::Crank { arm, rod, .. } => {
                *arm = point(*arm);
                *rod *= scale;
            }
        }
    }
    Parallel {
        centre: point(machine.centre),
        tool: point(machine.tool),
        spindle_offset: machine.spindle_offset * scale,
        home: machine.home.map(|home| in_units(&home, scale)),
        ..small
    }
}
