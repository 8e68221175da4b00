// SPDX-License-Identifier: GPL-2.0-or-later
//! Calibration of machines with constraints of the platform, whose true geometry is known.

use crate::calibrate::off_derivatives;
use crate::shop::{Shop, dial};
use crate::two_runs::{AGAIN, READING, Table};
use calibrate::at_tool;
use calibrate::constraint::ConstraintPart;
use calibrate::fit::{fit, residuals};
use calibrate::model::{Frame, Model, Quantity, Tolerance};
use calibrate::observe::{rank, unseen};
use calibrate::reading::{Instrument, Measured, Reading};
use calibrate::rewrite::calibrated;
use calibrate::study::{next_poses, study};
use kinematics::{Joints, Machine, Pose, Solver, Vector3};
use machine::passive::parts;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use machine::rows::with_dependent;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ContinuousCDF, Normal};
use std::path::Path;
use test_support::shipped::{self, CONSTRAINED, cases};

/// Noise of a tracker, mm, and of its angles times the platform's radius.
const NOISE: f64 = 1e-3;
/// Tolerance of every parameter, mm.
const TOLERANCE: f64 = 0.2;
const TOOL: Vector3<f64> = Vector3::new(10.0, -15.0, 60.0);

/// Returns a shipped machine; of one with a redundant constraint the copy without it, which `pkm calibrate` asks for.
fn independent(machine: &str) -> Mechanism {
    let config = shipped::config(machine);
    if machine != "exechon" {
        return config;
    }
    let text = config.ini.text();
    let (before, rest) = text.split_once("[CONSTRAINT_2]").unwrap();
    let (_, rest) = rest.split_once("[CONSTRAINT_3]").unwrap();
    let text =
        format!("{before}[CONSTRAINT_2]{rest}").replacen("constraints=4", "constraints=3", 1);
    read(&config.file, &text)
}

fn read(file: &Path, text: &str) -> Mechanism {
    let ini = Ini::parse(file, text).unwrap();
    let config = MachineConfig::leniently(&ini, Some(Lenient::Constraints)).unwrap();
    config.mechanism(1).unwrap()
}

fn normal(rng: &mut Pcg64) -> f64 {
    Normal::standard().inverse_cdf(rng.random_range(f64::EPSILON..1.0))
}

/// Returns the pose of joints, dependent coordinates included.
fn whole(machine: &Machine, joints: &Joints, seed: &Pose) -> Pose {
    let found = machine.forward(joints, seed, &TOOL, &Solver::default()).unwrap().pose;
    with_dependent(machine, &found, &TOOL).unwrap()
}

fn model(config: &Mechanism) -> Model {
    let tolerance = Tolerance::of_lengths(TOLERANCE);
    Model::new(config.geometry, config.offsets, &tolerance).unwrap().with_frame(Frame::BASE)
}

fn reading(config: &Mechanism, pose: &Pose, measured: Measured) -> Reading {
    Reading {
        name: String::new(),
        group: 0,
        joints: config.machine.inverse(pose, &TOOL).unwrap(),
        pose: *pose,
        tool: TOOL,
        frame: 0,
        measured,
        instrument: Instrument::default(),
    }
}

#[test]
fn parameters_are_those_that_the_equations_depend_on() {
    let count = |machine: &str, wanted: fn(ConstraintPart) -> bool| {
        let quantities = model(&independent(machine)).parameters.into_iter().map(|p| p.quantity);
        let is_wanted = |quantity: &Quantity| matches!(quantity, Quantity::Constraint(_, part) if wanted(*part));
        quantities.filter(is_wanted).count()
    };
    // One joint of base, two planes with shift and tilts, and two axes with tilts.
    assert_eq!(count("tricept", |part| matches!(part, ConstraintPart::Base(_))), 3);
    assert_eq!(count("tricept", |_| true), 3 + 2 * 3 + 4);
    // All points are anchors of legs; the tilts of three planes remain.
    assert_eq!(count("exechon", |_| true), 3 * 2);
    // The platform's points are anchors of legs; the shifts and tilts of three planes remain.
    assert_eq!(count("z3-head", |_| true), 3 * 3);
}

#[test]
fn the_derivatives_are_those_of_the_residuals() {
    let mut rng = Pcg64::seed_from_u64(60);
    for machine in CONSTRAINED {
        let config = independent(machine);
        let model = model(&config);
        let changes: Vec<f64> =
            model.parameters.iter().map(|p| p.deviation * normal(&mut rng)).collect();
        let measures = [
            Measured::Position(Vector3::zeros()),
            Measured::Pose(Vector3::zeros(), config.home_pose().rotation()),
        ];
        for measured in measures {
            let poses = at_tool::poses(&config, &TOOL, 3, 5);
            let readings: Vec<Reading> =
                poses.iter().map(|pose| reading(&config, pose, measured)).collect();
            let readings: Vec<&Reading> = readings.iter().collect();
            // Poses are accurate to 1e-8, over steps of 0.2.
            for (k, miss) in off_derivatives(&model, &readings, &changes, |_| 0.1).enumerate() {
                assert!(miss < 1e-5, "{machine} {:?}: {miss}", model.parameters[k]);
            }
        }
    }
}

/// Returns measurements of a tracker on a machine that differs from the drawing.
fn tracked(
    config: &Mechanism,
    model: &Model,
    rng: &mut Pcg64,
    has_angles: bool,
) -> (Machine, Vec<Reading>) {
    let hidden: Vec<f64> = model.parameters.iter().map(|p| p.deviation * normal(rng)).collect();
    let truth = model.machine(&hidden).unwrap();
    let mut poses = at_tool::poses(config, &TOOL, 80, 7);
    // The poses of the legs are at one position of the table.
    for letter in config.machine.layout().table().as_slice() {
        poses.iter_mut().for_each(|pose| pose.position[letter.index()] += 100.0 * normal(rng));
    }
    let readings = poses.iter().map(|pose| {
        let joints = config.machine.inverse(pose, &TOOL).unwrap();
        let there = whole(&truth, &joints, pose);
        let mut noise = || Vector3::from_fn(|_, _| NOISE * normal(rng));
        let place = there.position - TOOL + noise();
        let turn = nalgebra::Rotation3::new(noise() / config.machine.radius());
        let measured = match has_angles {
            true => Measured::Pose(place, turn.into_inner() * there.rotation()),
            false => Measured::Position(place),
        };
        reading(config, pose, measured)
    });
    let readings = readings.collect();
    (truth, readings)
}

#[test]
fn a_hidden_machine_is_found_from_measured_poses() {
    let mut rng = Pcg64::seed_from_u64(61);
    for machine in CONSTRAINED {
        let config = independent(machine);
        let model = model(&config);
        let (truth, readings) = tracked(&config, &model, &mut rng, true);
        let found = fit(&model, &readings, None).unwrap();
        assert!(found.outliers.is_empty(), "{machine}: {:?}", found.outliers);
        // 480 numbers determine the noise to 10 %.
        assert!((found.noise / NOISE - 1.0).abs() < 0.2, "{machine}: {}", found.noise);
        let after = model.machine(&found.changes).unwrap();
        let (mut before_worst, mut after_worst): (f64, f64) = (0.0, 0.0);
        for pose in at_tool::poses(&config, &TOOL, 200, 77) {
            let joints = config.machine.inverse(&pose, &TOOL).unwrap();
            let there = whole(&truth, &joints, &pose);
            let radius = config.machine.radius();
            let drawn = with_dependent(&config.machine, &pose, &TOOL).unwrap();
            before_worst = before_worst.max(drawn.distance(&there, radius));
            after_worst = after_worst.max(whole(&after, &joints, &pose).distance(&there, radius));
        }
        println!("{machine}: {before_worst} {after_worst}");
        // 80 poses and some 34 parameters: the noise of a pose falls to about half, and the largest of 200 is four
        // deviations of six numbers.
        assert!(before_worst > 0.2, "{machine}: {before_worst}");
        assert!(after_worst < 8.0 * NOISE, "{machine}: {after_worst}");
        check_file(&config, &model, &found.changes);
    }
}

/// Checks that the written file is the fitted machine, whose joints are still shared.
fn check_file(config: &Mechanism, model: &Model, changes: &[f64]) {
    let text = calibrated(config, model, changes).unwrap();
    let (read, fitted) = (read(&config.file, &text), model.machine(changes).unwrap());
    assert_eq!(parts(&read).len(), parts(config).len());
    for pose in at_tool::poses(config, &TOOL, 20, 9) {
        let joints = fitted.inverse(&pose, &TOOL).unwrap();
        let written = read.machine.inverse(&pose, &TOOL).unwrap();
        for (one, other) in joints.iter().zip(written) {
            // The file has six decimals of lengths.
            assert!((one - other).abs() < 1e-5, "{one} {other}");
        }
    }
}

#[test]
fn changes_that_no_reading_detects_have_a_name() {
    let mut rng = Pcg64::seed_from_u64(62);
    for machine in CONSTRAINED {
        let config = independent(machine);
        let model = model(&config).with_unknown_frame(Frame::BASE);
        for has_angles in [true, false] {
            let (_, mut readings) = tracked(&config, &model, &mut rng, has_angles);
            readings.iter_mut().for_each(|reading| reading.frame = 1);
            let all: Vec<&Reading> = readings.iter().collect();
            let (_, jacobian) =
                residuals(&model, &all, &vec![0.0; model.parameters.len()]).unwrap();
            let found = unseen(&model, &readings, &jacobian);
            println!("{machine} {has_angles}: {found:?}");
            let named: usize = found.iter().map(|(count, _)| count).sum();
            assert_eq!(rank(&model, &jacobian) + named, model.parameters.len());
            assert!(
                found.iter().all(|(_, text)| !text.contains("do not distinguish")),
                "{machine}: {found:?}"
            );
        }
    }
}

/// Returns a shop with a dial of 2 um on a plate, with or without two edges.
fn shop(machine: &str, has_edges: bool) -> Shop {
    let config = independent(machine);
    let height = config.home[2] - 60.0;
    Shop::of(config, &dial([0.0, 0.0, height], 160.0, has_edges, "mm"), 0.1)
}

#[test]
fn twelve_machines_stay_below_their_bounds() {
    let (mut machines, mut violations) = (0, 0);
    for machine in CONSTRAINED {
        let mut shop = shop(machine, true);
        let (mut all_drawn, mut all_calibrated) = (0.0, 0.0);
        for run in 0..cases(4) as u64 {
            shop.build(900 + run);
            let table = shop.table(2, 2.0);
            let study = study(&shop.config, shop.given(&table), |_| {}).unwrap();
            let error = shop.error(&study.model.machine(&study.found.changes).unwrap());
            let drawn = shop.error(&shop.config.machine);
            let below = study.shape[1].below;
            println!("{machine} {run}: drawn {drawn:.5}, {error:.5} below {below:.5}");
            machines += 1;
            violations += usize::from(error > below);
            all_drawn += drawn;
            all_calibrated += error;
            assert_eq!(next_poses(&shop.config, &study, 2).unwrap().len(), 2);
        }
        // A few readings with a tool along Z: the tip improves on average, not on every machine.
        assert!(all_calibrated < 0.8 * all_drawn, "{machine}: {all_calibrated} {all_drawn}");
    }
    // The bound holds with 95 %.
    assert!(machines >= 12 && 20 * violations <= machines, "{violations} of {machines}");
}

#[test]
fn good_tables_are_accepted() {
    for machine in CONSTRAINED {
        let mut shop = shop(machine, true);
        for seed in 0..cases(10) as u64 {
            for is_drawn in [true, false] {
                shop.build(seed);
                if is_drawn {
                    shop.truth = shop.config.machine.clone();
                    shop.find_objects();
                }
                let table = shop.table(2, 2.0);
                if let Err(refused) = shop.read(&table) {
                    panic!("{machine} {seed} {is_drawn}: {refused}");
                }
            }
        }
    }
}

#[test]
fn mistakes_are_named() {
    for machine in CONSTRAINED {
        let mut shop = shop(machine, false);
        shop.build(40);
        let good = Table::new(&shop.table(2, 2.0));
        let (low, high) = good.extremes(30);
        let line = |row: usize| good.line(row);
        let both = |table: &Table, row: usize, factor: f64| {
            table.with([row], READING, |x| x * factor).with([row], AGAIN, |x| x * factor)
        };
        let exchanged = good.exchanged(low, high, READING).exchanged(low, high, AGAIN);
        let exchange = format!(
            "the readings of lines {} and {} would fit if exchanged",
            line(low),
            line(high)
        );
        let cases = [
            (exchanged, line(low), exchange),
            (both(&good, 7, 1e-3), line(7), " um of pose 7 ".into()),
            (
                good.with([19], AGAIN, |x| x / 25.4),
                line(19),
                " of pose 19 in column again does not fit the other run, but ".to_string(),
            ),
            (
                good.with(1..=30, AGAIN, |x| x + 100.0),
                line(1),
                "in all rows the second run is +".into(),
            ),
        ];
        for (table, line, expected) in cases {
            let refused = shop.read(&table.text()).err().map_or("0:0".into(), |e| e.to_string());
            println!("{machine}: {refused}");
            let at: usize = refused.split(':').nth(1).unwrap().parse().unwrap();
            assert!(
                at == line && refused.contains(&expected),
                "{machine} {line} {expected}: {refused}"
            );
        }
    }
}
