// SPDX-License-Identifier: GPL-2.0-or-later
//! Properties that hold for any machine: tool offset, joint offsets, units, hash.

mod common;

use common::tolerances::{EXACT, GOLDEN_JOINT, ROUND_TRIP};
use common::{NO_TOOL, cases, geometry, paper_004, rng, servo_step, shipped};
use kinematics::leg::{LegKind, StrutGeometry};
use kinematics::{Coordinates, Geometry, Machine, Pose, Solver, Vector3};

#[test]
fn a_tool_changes_no_joint_of_a_level_platform_and_moves_the_tip_of_a_tilted_one() {
    let [case, _] = shipped();
    let tool = Vector3::new(5.0, -3.0, 120.0);
    let level = Pose::from_degrees([40.0, -20.0, 200.0, 0.0, 0.0, 0.0]);
    let without = case.machine.inverse(&level, &NO_TOOL).unwrap();
    let with = case.machine.inverse(&level, &tool).unwrap();
    for i in 0..6 {
        assert!((without[i] - with[i]).abs() < GOLDEN_JOINT);
    }
    let tilted = Pose::from_degrees([40.0, -20.0, 200.0, 15.0, -10.0, 5.0]);
    let joints = case.machine.inverse(&tilted, &tool).unwrap();
    let found = case.machine.forward(&joints, &tilted, &NO_TOOL, &Solver::default()).unwrap();
    // P = t − o + R o: without its tool the control point lies at t + (R − 1) o.
    let expected = tilted.position + tilted.rotation() * tool - tool;
    assert!((found.pose.position - expected).norm() < GOLDEN_JOINT);
}

#[test]
fn a_long_tool_keeps_the_servo_step_certified() {
    let [case, _] = shipped();
    let tool = Vector3::new(0.0, 0.0, 300.0);
    let mut rng = rng(7);
    for _ in 0..cases(2000) {
        let pose = (case.sample)(&mut rng);
        let seed = servo_step(&mut rng, &pose, 0.5);
        let joints = case.machine.inverse(&pose, &tool).unwrap();
        let found = case.machine.forward(&joints, &seed, &tool, &Solver::default()).unwrap();
        assert_eq!(found.sub_steps, 1);
        let error = found.pose.distance(&pose, case.machine.radius());
        assert!(error <= ROUND_TRIP * case.machine.size());
    }
}

#[test]
fn a_joint_offset_is_taken_from_the_joint_and_given_back_by_forward() {
    let offset = [1.0, -2.0, 3.0, 0.0, 5.5, -600.0];
    let plain = Machine::freeze(&paper_004(10.0), &[0.0; 6]).unwrap();
    let shifted = Machine::freeze(&paper_004(10.0), &offset).unwrap();
    let pose = Pose::from_degrees([50.0, 100.0, 120.0, -15.0, 12.0, 8.0]);
    let a = plain.inverse(&pose, &NO_TOOL).unwrap();
    let b = shifted.inverse(&pose, &NO_TOOL).unwrap();
    for i in 0..6 {
        assert!((a[i] - b[i] - offset[i]).abs() < GOLDEN_JOINT);
    }
    let found = shifted.forward(&b, &pose, &NO_TOOL, &Solver::default()).unwrap();
    assert!(found.pose.distance(&pose, shifted.radius()) < GOLDEN_JOINT);
}

/// The same machine with every length multiplied.
fn scaled(given: &Geometry<6>, by: f64) -> Geometry<6> {
    let scale = |v: [f64; 3]| v.map(|x| x * by);
    let struts = given.legs.map(|leg| {
        let LegKind::Strut(strut) = leg.kind;
        StrutGeometry { lead: strut.lead * by, ..strut }
    });
    let home = given.home.map(|h| [h[0] * by, h[1] * by, h[2] * by, h[3], h[4], h[5]]);
    geometry(given.legs.map(|l| scale(l.base)), given.legs.map(|l| scale(l.platform)), struts, home)
}

#[test]
fn a_machine_scaled_by_a_power_of_two_gives_the_same_bits() {
    let given = paper_004(10.0);
    let plain = Machine::freeze(&given, &[0.0; 6]).unwrap();
    let [case, _] = shipped();
    for by in [2.0_f64.powi(-10), 2.0_f64.powi(7)] {
        let other = Machine::freeze(&scaled(&given, by), &[0.0; 6]).unwrap();
        let solver = Solver { convergence_criterion: 1e-9 * by, ..Solver::default() };
        let mut rng = rng(8);
        for _ in 0..200 {
            let pose = (case.sample)(&mut rng);
            let near = |p: &Pose| Pose { position: p.position * by, ..*p };
            let joints = plain.inverse(&pose, &NO_TOOL).unwrap();
            let others = other.inverse(&near(&pose), &NO_TOOL).unwrap();
            for i in 0..6 {
                assert!((joints[i] * by - others[i]).abs() <= EXACT);
            }
            let a = plain.forward(&joints, &case.home, &NO_TOOL, &Solver::default()).unwrap();
            let b = other.forward(&others, &near(&case.home), &NO_TOOL, &solver).unwrap();
            assert_eq!(a.iterations, b.iterations);
            assert_eq!(near(&a.pose), b.pose);
        }
    }
}

#[test]
fn a_machine_in_inches_or_metres_behaves_as_in_millimetres() {
    let given = paper_004(10.0);
    let [case, _] = shipped();
    for by in [1.0 / 25.4, 1e-3] {
        let other = Machine::freeze(&scaled(&given, by), &[0.0; 6]).unwrap();
        let mut rng = rng(9);
        for _ in 0..500 {
            let pose = (case.sample)(&mut rng);
            let pose = Pose { position: pose.position * by, ..pose };
            let home = Pose { position: case.home.position * by, ..case.home };
            let joints = other.inverse(&pose, &NO_TOOL).unwrap();
            let found = other.forward(&joints, &home, &NO_TOOL, &Solver::default()).unwrap();
            assert!(found.pose.distance(&pose, other.radius()) <= ROUND_TRIP * other.size());
        }
    }
}

#[test]
fn the_hash_follows_every_value_that_enters_the_joints_and_no_other() {
    let given = paper_004(10.0);
    let hash = given.hash();
    let differs = |change: &dyn Fn(&mut Geometry<6>)| {
        let mut other = given;
        change(&mut other);
        other.hash() != hash
    };
    assert!(differs(&|g| g.legs[5].base[2] += 1e-9));
    assert!(differs(&|g| g.legs[0].platform[0] += 1e-9));
    assert!(differs(&|g| g.home.as_mut().unwrap()[2] += 1e-9));
    assert!(differs(&|g| g.home = None));
    assert!(differs(&|g| g.coordinates = Coordinates::parse(b"XYZCBA").unwrap()));
    assert!(differs(&|g| {
        let LegKind::Strut(s) = &mut g.legs[1].kind;
        s.lead = -s.lead;
    }));
    // Without a lead the axes say nothing.
    let plain = paper_004(0.0);
    let mut turned = plain;
    turned.legs[0] = kinematics::LegGeometry::strut(
        plain.legs[0].base,
        plain.legs[0].platform,
        StrutGeometry { base_axis: [1.0, 2.0, 3.0], ..StrutGeometry::default() },
    );
    assert_eq!(plain.hash(), turned.hash());
}

#[test]
fn angles_keep_whole_turns_of_the_seed() {
    let [case, _] = shipped();
    let pose = Pose::from_degrees([10.0, 0.0, 250.0, 5.0, -4.0, 725.0]);
    let seed = Pose::from_degrees([10.1, 0.0, 250.1, 5.1, -4.1, 725.2]);
    let joints = case.machine.inverse(&pose, &NO_TOOL).unwrap();
    let found = case.machine.forward(&joints, &seed, &NO_TOOL, &Solver::default()).unwrap();
    for (a, b) in found.pose.to_degrees().iter().zip(pose.to_degrees()) {
        assert!((a - b).abs() < 1e-9);
    }
}
