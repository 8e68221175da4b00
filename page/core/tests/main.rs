// SPDX-License-Identifier: GPL-2.0-or-later
//! Tests of the page's inputs and of the answers of its kinematics. tests/page runs the page in a browser.

mod built;

use kinematics::{Joints, Limits, MAX_JOINTS, Pose, Vector3};
use machine::proof::axis_box::range;
use machine::read::mechanism::Mechanism;
use page_core::{Described, Drawn};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use studies::study::rods::View;
use test_support::shipped::{CONSTRAINED, MACHINES, config, whole};

/// Rounding errors of lengths of 1e3.
const LENGTH: f64 = 1e-9;

fn described(config: &Mechanism) -> Described {
    let of = |value: fn(&machine::read::joints::Joint) -> f64| -> Joints {
        std::array::from_fn(|i| config.joints.get(i).map_or(f64::INFINITY, value))
    };
    let limits = Limits { max: of(|joint| joint.max), tilt: 12.5, ..Limits::NONE };
    Described { geometry: config.geometry, offsets: config.offsets, limits }
}

fn numbers(described: &Described) -> Vec<f64> {
    let mut numbers = vec![];
    described.write(|value| numbers.push(value));
    numbers
}

fn mechanisms() -> impl Iterator<Item = Mechanism> {
    let shipped = MACHINES.into_iter().flat_map(|machine| whole(machine).mechanisms);
    shipped.chain(CONSTRAINED.into_iter().map(config))
}

#[test]
fn a_machine_in_numbers_is_the_same_machine() {
    for config in mechanisms() {
        let described = described(&config);
        let read = Described::read(&numbers(&described)).unwrap();
        assert_eq!(read, described);
        assert_eq!(read.geometry.hash(), config.geometry.hash());
    }
}

#[test]
fn other_numbers_are_no_machine() {
    let whole = numbers(&described(&config("hexapod")));
    for length in 0..whole.len() {
        assert!(Described::read(&whole[..length]).is_none(), "the first {length}");
    }
    assert!(Described::read(&[&whole[..], &[0.0]].concat()).is_none());
    for place in 0..20 {
        let mut wrong = whole.clone();
        wrong[place] = f64::NAN;
        assert!(Described::read(&wrong).is_none_or(|read| read.freeze().is_none()), "{place}");
    }
}

#[test]
fn what_is_drawn_is_what_the_machine_and_the_rods_say() {
    let mut rng = Pcg64::seed_from_u64(2020);
    for config in mechanisms() {
        let described = Described::read(&numbers(&described(&config))).unwrap();
        let machine = described.freeze().unwrap();
        let (whole, view) = (range(&config), View::new(&config, vec![], 0.0));
        let mut reached = 0;
        for _ in 0..200 {
            let degrees = whole.at(std::array::from_fn(|_| rng.random()));
            let pose = Pose::from_degrees(degrees);
            let own = Vector3::from_fn(|_, _| rng.random_range(-20.0..20.0) * config.units_per_mm);
            let tool = config.spindle + own;
            let (centre, limits) = (config.geometry.centre, &described.limits);
            let drawn = Drawn::new(&machine, centre, limits, degrees, tool.into());
            let (joints, rods) = (config.machine.inverse(&pose, &tool), view.at(&pose, &tool));
            assert_eq!(drawn.as_ref().map(|drawn| drawn.joints).map_err(|e| *e), joints);
            let (Ok(drawn), Ok(rods)) = (drawn, rods) else { continue };
            for (end, rod) in drawn.segments.iter().zip(&rods.rods) {
                assert_eq!([end.base, end.platform], [rod.ends.base, rod.ends.platform]);
            }
            // A table carries the workpiece below a fixed platform; otherwise the tip is at its programmed position.
            let full = config.machine.full_pose(&pose, &tool).unwrap();
            // Without constraints it is the program's pose, with the motion of a table.
            let is_constrained = config.machine.layout().constraints() > 0;
            let expected = if is_constrained { full.to_degrees() } else { degrees };
            let apart = drawn.full.iter().zip(expected).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f64::max) < LENGTH * config.machine.size().max(1.0));
            let tip = drawn.tip - drawn.table - (pose.position - tool);
            assert!(tip.norm() < LENGTH * config.machine.size().max(1.0), "{tip}");
            let ranges = drawn.margins().filter(|margin| margin.part != kinematics::Part::Whole);
            assert!(ranges.count() >= config.joints.len().min(MAX_JOINTS));
            reached += 1;
        }
        assert!(reached > 100, "{}: {reached}", config.file.display());
    }
}
