// SPDX-License-Identifier: GPL-2.0-or-later
//! Calibration of machines with constraints of the platform, whose true geometry is known.

use calibrate::at_tool;
use calibrate::constraint::ConstraintPart;
use calibrate::fit::{fit, residuals};
use calibrate::model::{Frame, Model, Quantity, Tolerance};
use calibrate::reading::{Instrument, Measured, Reading};
use calibrate::rewrite::calibrated;
use kinematics::{Joints, Machine, Pose, Solver, Vector3};
use machine::passive::parts;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use machine::rows::with_dependent;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ContinuousCDF, Normal};
use test_support::constrained::constrained;

/// Noise of a tracker, mm, and of its angles times the platform's radius.
const NOISE: f64 = 1e-3;
/// Tolerance of every parameter, mm.
const TOLERANCE: f64 = 0.2;
const TOOL: Vector3<f64> = Vector3::new(10.0, -15.0, 60.0);
const MACHINES: [&str; 2] = ["tricept", "z3-head"];

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
        let quantities = model(&constrained(machine)).parameters.into_iter().map(|p| p.quantity);
        let is_wanted = |quantity: &Quantity| matches!(quantity, Quantity::Constraint(_, part) if wanted(*part));
        quantities.filter(is_wanted).count()
    };
    // One joint of base, two planes with shift and tilts, and two axes with tilts.
    assert_eq!(count("tricept", |part| matches!(part, ConstraintPart::Base(_))), 3);
    assert_eq!(count("tricept", |_| true), 3 + 2 * 3 + 4);
    // The platform's points are the anchors of the legs.
    assert_eq!(count("z3-head", |_| true), 3 * 3);
}

#[test]
fn the_derivatives_are_those_of_the_residuals() {
    let mut rng = Pcg64::seed_from_u64(60);
    for machine in MACHINES {
        let config = constrained(machine);
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
            let (_, jacobian) = residuals(&model, &readings, &changes).unwrap();
            for k in 0..model.parameters.len() {
                let at = |step: f64| {
                    let mut moved = changes.clone();
                    moved[k] += step;
                    residuals(&model, &readings, &moved).unwrap().0
                };
                // Poses are accurate to 1e-8, over steps of 0.2.
                let slope = (at(0.1) - at(-0.1)) / 0.2;
                let miss = (slope - jacobian.column(k)).amax();
                assert!(miss < 1e-5, "{machine} {:?}: {miss}", model.parameters[k]);
            }
        }
    }
}

#[test]
fn a_hidden_machine_is_found_from_measured_poses() {
    let mut rng = Pcg64::seed_from_u64(61);
    for machine in MACHINES {
        let config = constrained(machine);
        let model = model(&config);
        let hidden: Vec<f64> =
            model.parameters.iter().map(|p| p.deviation * normal(&mut rng)).collect();
        let truth = model.machine(&hidden).unwrap();
        let readings: Vec<Reading> = at_tool::poses(&config, &TOOL, 80, 7)
            .iter()
            .map(|pose| {
                let joints = config.machine.inverse(pose, &TOOL).unwrap();
                let there = whole(&truth, &joints, pose);
                let mut noise = || Vector3::from_fn(|_, _| NOISE * normal(&mut rng));
                let place = there.position - TOOL + noise();
                let turn = nalgebra::Rotation3::new(noise() / config.machine.radius());
                let measured = Measured::Pose(place, turn.into_inner() * there.rotation());
                reading(&config, pose, measured)
            })
            .collect();
        let found = fit(&model, &readings, None).unwrap();
        assert!(found.outliers.is_empty(), "{machine}: {:?}", found.outliers);
        // 480 numbers estimate the noise to 10 %.
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
    let ini = Ini::parse(&config.file, &text).unwrap();
    let read = MachineConfig::leniently(&ini, Some(Lenient::Constraints)).unwrap();
    let (read, fitted) = (read.first(), model.machine(changes).unwrap());
    assert_eq!(parts(read).len(), parts(config).len());
    for pose in at_tool::poses(config, &TOOL, 20, 9) {
        let joints = fitted.inverse(&pose, &TOOL).unwrap();
        let written = read.machine.inverse(&pose, &TOOL).unwrap();
        for (one, other) in joints.iter().zip(written) {
            // The file has six decimals of lengths.
            assert!((one - other).abs() < 1e-5, "{one} {other}");
        }
    }
}
