// SPDX-License-Identifier: GPL-2.0-or-later
//! Passive parts at random poses: joints and legs that fit together.

use kinematics::{Letter, Pose, Vector3};
use machine::passive::{Passive, PassiveShape, parts};
use machine::scene::Scene;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use serde_json::Value;
use test_support::constrained::{commanded, tool};
use test_support::shipped::{CONSTRAINED, MACHINES, config};

/// Some roundings of lengths of 1e3, and of directions over an axis of 50.
const LENGTH: f64 = 1e-9;
const ANGLE: f64 = 1e-10;

fn shapes(parts: &[Passive]) -> Vec<(usize, PassiveShape)> {
    parts.iter().map(|part| (part.constraint, part.shape)).collect()
}

#[test]
fn every_constraint_has_the_parts_of_the_machine_that_it_describes() {
    use PassiveShape::{Axis, Tube};
    let of = |machine: &str| shapes(&parts(&config(machine)));
    // The tube is in both planes; the universal joint about it has two axes.
    assert_eq!(of("tricept"), [(0, Tube), (2, Axis), (2, Axis)]);
    // A revolute joint of each leg, and the universal joints of the two legs in the common plane.
    let exechon = [(0, Axis), (1, Axis), (2, Axis), (2, Axis), (2, Axis), (2, Axis), (3, Axis)];
    assert_eq!(of("exechon"), exechon);
    assert_eq!(of("z3-head"), [(0, Axis), (1, Axis), (2, Axis)]);
    for machine in MACHINES {
        assert!(parts(&config(machine)).is_empty(), "{machine}");
    }
}

fn direction([from, to]: [Vector3<f64>; 2]) -> Vector3<f64> {
    (to - from).normalize()
}

#[test]
fn passive_joints_fit_their_legs_at_every_pose() {
    let mut rng = Pcg64::seed_from_u64(60);
    for machine in CONSTRAINED {
        let config = config(machine);
        let parts = parts(&config);
        for _ in 0..100 {
            let (pose, tool) = (commanded(&config, &mut rng), tool(&config, &mut rng));
            let Ok(at) = config.machine.at(&pose, &tool) else { continue };
            let ends: Vec<_> = parts.iter().map(|part| part.positions(&at, &tool)).collect();
            let legs = at.segments();
            let leg = |i: usize| direction([legs[i].base, legs[i].platform]);
            let square = |one: Vector3<f64>, other: Vector3<f64>| {
                assert!(one.dot(&other).abs() < ANGLE, "{machine}: {:?}", pose.to_degrees());
            };
            match machine {
                "tricept" => {
                    // The joint of the base is the origin: the tube passes through it, perpendicular to both axes there.
                    let [near, far] = ends[0];
                    assert!(near.cross(&direction([near, far])).norm() < LENGTH);
                    assert!(near.z < 0.0 && far.z > 0.0);
                    square(direction(ends[0]), direction(ends[2]));
                    square(direction(ends[1]), direction(ends[2]));
                    assert!((ends[1][0] + ends[1][1]).norm() < LENGTH);
                }
                "exechon" => {
                    square(direction(ends[0]), leg(0));
                    square(direction(ends[1]), leg(1));
                    square(direction(ends[6]), leg(2));
                    // Each universal joint: base axis, then the axis parallel to that of the leg's revolute joint.
                    for (k, own) in [(2, 0), (4, 1)] {
                        square(direction(ends[k]), direction(ends[k + 1]));
                        let parallel = direction(ends[k + 1]).cross(&direction(ends[own]));
                        assert!(parallel.norm() < ANGLE);
                        let middle = (ends[k][0] + ends[k][1]) / 2.0;
                        assert!((middle - legs[own].base).norm() < LENGTH);
                    }
                }
                _ => (0..3).for_each(|i| {
                    square(direction(ends[i]), leg(i));
                    let middle = (ends[i][0] + ends[i][1]) / 2.0;
                    assert!((middle - legs[i].base).norm() < LENGTH);
                }),
            }
        }
    }
}

fn vector(of: &Value) -> Vector3<f64> {
    Vector3::from_fn(|k, _| of[k].as_f64().unwrap())
}

#[test]
fn the_platform_of_a_scene_follows_from_the_dependent_coordinates() {
    let mut rng = Pcg64::seed_from_u64(61);
    for machine in CONSTRAINED {
        let config = config(machine);
        let scene: Value = serde_json::from_str(&Scene::new(&config).json()).unwrap();
        let dependent = scene["dependent"].as_str().unwrap();
        let mut reached = 0;
        for _ in 0..100 {
            let (pose, tool) = (commanded(&config, &mut rng), tool(&config, &mut rng));
            let Ok(at) = config.machine.at(&pose, &tool) else { continue };
            // LinuxCNC's pose with the values of the pins pkmkins.dependent.L.
            let (mut values, full) = (pose.to_degrees(), at.full_pose().to_degrees());
            for letter in Letter::ALL.into_iter().filter(|l| dependent.contains(l.name())) {
                values[letter.index()] = full[letter.index()];
            }
            let shown = Pose::from_degrees(values);
            let (t, r) = (shown.position, shown.rotation());
            let point = t - tool + r * tool;
            for (i, leg) in scene["legs"].as_array().unwrap().iter().enumerate() {
                let upper = point + r * vector(&leg["platform"]);
                assert!((upper - at.segments()[i].platform).norm() < LENGTH, "{machine} {i}");
            }
            for (part, own) in scene["passive"].as_array().unwrap().iter().zip(parts(&config)) {
                for (end, expected) in
                    part["ends"].as_array().unwrap().iter().zip(own.positions(&at, &tool))
                {
                    let origin = match (end["origin"].as_str().unwrap(), end["leg"].as_u64()) {
                        ("base", _) => Vector3::zeros(),
                        ("platform", _) => point,
                        ("leg", Some(leg)) => at.segments()[leg as usize].base,
                        other => panic!("{other:?}"),
                    };
                    let found = origin + vector(&end["base"]) + r * vector(&end["platform"]);
                    assert!((found - expected).norm() < LENGTH, "{machine}");
                }
            }
            reached += 1;
        }
        assert!(reached > 50, "{machine}: {reached}");
    }
}
