// SPDX-License-Identifier: GPL-2.0-or-later
//! Geometry of the legs, against independent values and closed loops.

use kinematics::{Pose, Vector3};
use machine::proof::axis_box;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use studies::study::rods::{Rods, View};
use test_support::shipped::{MACHINES, config};

/// Lengths near 1000 mm with some roundings of 1e-13.
const LENGTH_MM: f64 = 1e-9;

fn at(machine: &str, pose: [f64; 6]) -> Rods {
    let config = config(machine);
    View::new(&config, vec![], 0.0).at(&Pose::from_degrees(pose), &config.spindle).unwrap()
}

#[test]
fn the_least_distance_of_legs_at_home_is_that_of_an_independent_calculation() {
    for (machine, distance) in
        [("four-rod-lathe", 120.0), ("six-rod-lathe", 120.0), ("pyramid", 169.705627485)]
    {
        let found = at(machine, config(machine).home).nearest.unwrap();
        // The values have nine decimals.
        assert!((found.distance - distance).abs() < 1e-6, "{machine} {found:?}");
    }
}

/// Ranges of the independent scans, each the least of 500 random poses.
const SCANS: [(&str, [[f64; 2]; 6], f64); 3] = [
    (
        "four-rod-lathe",
        [[-120.0, 120.0], [380.0, 520.0], [600.0, 1400.0], [0.0; 2], [-20.0, 20.0], [0.0; 2]],
        120.0,
    ),
    (
        "six-rod-lathe",
        [
            [-80.0, 80.0],
            [410.0, 500.0],
            [600.0, 1400.0],
            [-12.0, 12.0],
            [-12.0, 12.0],
            [-12.0, 12.0],
        ],
        62.0,
    ),
    (
        "pyramid",
        [[-150.0, 150.0], [-150.0, 150.0], [150.0, 390.0], [-20.0, 20.0], [-20.0, 20.0], [0.0; 2]],
        166.0,
    ),
];

#[test]
fn the_least_distance_over_a_workspace_is_that_of_an_independent_scan() {
    for (machine, ranges, expected) in SCANS {
        let config = config(machine);
        let view = View::new(&config, vec![], 0.0);
        let mut rng = Pcg64::seed_from_u64(1);
        // The pyramid's tool is 150 long in the independent values; its INI file includes it in the center.
        let gaps = (0..500).map(|_| {
            let pose = ranges.map(|[low, high]| low + (high - low) * rng.random::<f64>());
            let rods = view.at(&Pose::from_degrees(pose), &config.spindle).unwrap();
            rods.nearest.unwrap().distance
        });
        let least = gaps.fold(f64::INFINITY, f64::min);
        // Other random poses: the least of 500 differs by some percent.
        assert!((least / expected - 1.0).abs() < 0.15, "{machine} {least}");
    }
}

#[test]
fn ends_lengths_and_directions_belong_together_on_every_machine() {
    for machine in MACHINES {
        let config = config(machine);
        let range = axis_box::range(&config);
        let mut rng = Pcg64::seed_from_u64(2);
        let view = View::new(&config, vec![Vector3::from(config.geometry.legs()[0].platform)], 5.0);
        for _ in 0..20 {
            let pose = Pose::from_degrees(range.at(std::array::from_fn(|_| rng.random())));
            let Ok(rods) = view.at(&pose, &config.spindle) else { continue };
            assert_eq!(rods.values().len(), view.names().len());
            for rod in &rods.rods {
                let (e, a) = (rod.elevation.to_radians(), rod.azimuth.to_radians());
                let along = Vector3::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin());
                let end = rod.ends.base + along * rod.length;
                assert!((end - rod.ends.platform).norm() < LENGTH_MM, "{machine} {rod:?}");
            }
            // If the leg ends on a ring, the point is the ring's center.
            let radius = config.geometry.legs()[0].kind.ring_radius();
            let apart = (rods.points[0] - rods.rods[0].ends.platform).norm();
            assert!((apart - radius).abs() < LENGTH_MM, "{machine}: {apart}");
            let pairs = config.pairs();
            let distance = |[i, j]: &[usize; 2]| rods.rods[*i].ends.distance(&rods.rods[*j].ends);
            let least = pairs.iter().map(distance).fold(f64::INFINITY, f64::min);
            if let Some(nearest) = rods.nearest {
                let [i, j] = nearest.pair;
                let own = rods.rods[i].ends.distance(&rods.rods[j].ends);
                assert!((nearest.distance + 5.0 - own).abs() < LENGTH_MM);
                assert!(least <= own);
            }
        }
    }
}

#[test]
fn two_carriages_of_a_rail_close_the_loop_of_paper_003() {
    // Equation 3 with the sign of l2 that follows from the algebra: rods A and B of one rail are in
    // a plane with it while B = 0.
    for pose in [[0.0, 450.0, 1000.0, 0.0, 0.0, 0.0], [80.0, 400.0, 800.0, 0.0, 0.0, 0.0]] {
        let rods = at("four-rod-lathe", pose).rods;
        let (a, b) = (&rods[0], &rods[1]);
        let d = (b.ends.base - a.ends.base).norm();
        let g = (b.ends.platform - a.ends.platform).norm();
        let [p1, p4] = [a, b].map(|rod| rod.guide.unwrap().to_radians());
        let (l1, l2) = (a.length, b.length);
        let squared = l1 * l1 + l2 * l2 + d * d + 2.0 * l1 * l2 * (p1 + p4).cos()
            - 2.0 * d * (l1 * p1.cos() + l2 * p4.cos());
        // Squares near 1e6 mm^2 with roundings of 1e-10.
        assert!((squared - g * g).abs() < 1e-8, "{squared} {}", g * g);
        let between = at("four-rod-lathe", pose).between[0].to_radians();
        assert!((p1 + p4 + between - std::f64::consts::PI).abs() < 1e-12);
    }
}

#[test]
fn carriages_stand_where_the_repaired_equations_of_paper_003_put_them() {
    let config = config("four-rod-lathe");
    for pose in [[100.0, 400.0, 700.0, 0.0, 15.0, 0.0], [-80.0, 500.0, 1300.0, 0.0, -10.0, 0.0]] {
        let rods = at("four-rod-lathe", pose).rods;
        let joints = config.machine.inverse(&Pose::from_degrees(pose), &config.spindle).unwrap();
        for (i, rod) in rods.iter().enumerate() {
            let (base, end) = (Vector3::from(config.geometry.legs()[i].base), rod.ends.platform);
            let kinematics::LegKind::Slider(slider) = config.geometry.legs()[i].kind else {
                panic!("a lathe on sliders")
            };
            let side = f64::from(slider.side);
            // Equation 13: guides along Z, with the square of l that is missing in print.
            let across = (end - base).xy().norm_squared();
            let carriage = end.z - base.z + side * (slider.rod.powi(2) - across).sqrt();
            assert!((carriage - joints[i]).abs() < LENGTH_MM, "{carriage} {}", joints[i]);
            // Equations 7 to 9: the line x = t z + d, y = k z + b with t = k = 0.
            let c = end.z.powi(2) + across - slider.rod.powi(2);
            let line = end.z + side * (end.z.powi(2) - c).sqrt();
            assert!((line - base.z - joints[i]).abs() < LENGTH_MM);
        }
    }
}
