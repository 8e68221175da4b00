// SPDX-License-Identifier: GPL-2.0-or-later
//! Calibration of simulated machines whose true geometry is known.

use calibrate::at_tool;
use calibrate::fit::{Fit, Misfit, fit, held_out, residuals};
use calibrate::model::{Frame, Model, Quantity, Tolerance};
use calibrate::observe::{rank, unseen};
use calibrate::plan::{next_best, tip_deviation};
use calibrate::reading::{Changed, Instrument, Measured, Reading};
use calibrate::rewrite::calibrated;
use kinematics::{Letter, Machine, Pose, Solver, Vector3};
use machine::read::mechanism::Mechanism;
use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, Normal};
use test_support::shipped::{self, cases};

const MACHINE: &str = "lab-hexapod";

/// Noise of the probe, mm.
const NOISE: f64 = 1e-3;

/// Tolerance of an anchor's coordinate and of a length, mm: it causes tip errors of about half a millimeter.
const TOLERANCE: f64 = 0.2;

const TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 60.0);

struct Dice(Pcg64);

impl Dice {
    fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    fn normal(&mut self) -> f64 {
        Normal::standard().inverse_cdf(self.0.random_range(f64::EPSILON..1.0))
    }

    fn vector(&mut self, deviation: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| deviation * self.normal())
    }
}

fn drawn(config: &Mechanism, tolerance: &Tolerance) -> Model {
    Model::new(config.geometry, [0.0; 8], tolerance).unwrap()
}

/// Draws a built machine: every parameter deviates according to its tolerance, and frames are at their assumed
/// poses.
fn built(model: &Model, dice: &mut Dice) -> Vec<f64> {
    let draw = |parameter: &calibrate::model::Parameter| match parameter.quantity {
        Quantity::Frame(..) => 0.0,
        _ => parameter.deviation * dice.normal(),
    };
    model.parameters.iter().map(draw).collect()
}

/// Returns the true pose when the control commands `pose`.
fn true_pose(control: &Machine, truth: &Machine, pose: &Pose) -> Pose {
    let joints = control.inverse(pose, &TOOL).unwrap();
    truth.forward(&joints, pose, &TOOL, &Solver::default()).unwrap().pose
}

/// Returns a reading of each pose: `measure` of the true pose.
fn read(
    control: &Machine,
    truth: &Machine,
    poses: &[Pose],
    mut measure: impl FnMut(&Pose) -> Measured,
) -> Vec<Reading> {
    let reading = |(i, pose): (usize, &Pose)| Reading {
        name: format!("reading {i}"),
        group: i,
        joints: control.inverse(pose, &TOOL).unwrap(),
        pose: *pose,
        tool: TOOL,
        frame: 0,
        measured: measure(&true_pose(control, truth, pose)),
        instrument: Instrument::default(),
    };
    poses.iter().enumerate().map(reading).collect()
}

fn positions(config: &Mechanism, truth: &Machine, poses: &[Pose], dice: &mut Dice) -> Vec<Reading> {
    read(&config.machine, truth, poses, |pose| {
        Measured::Position(pose.position - TOOL + dice.vector(NOISE))
    })
}

/// Returns the largest distance between the true tip and the commanded one, over poses that
/// were not measured.
fn tip_error(control: &Machine, truth: &Machine, config: &Mechanism) -> f64 {
    let error = |pose: &Pose| (true_pose(control, truth, pose).position - pose.position).norm();
    at_tool::poses(config, &TOOL, 300, 77).iter().map(error).fold(0.0, f64::max)
}

#[test]
fn drawn_poses_are_within_the_axis_limits_whatever_the_tool() {
    for machine in shipped::unchained() {
        let config = shipped::config(machine);
        // A tool offset longer than the margin of any axis at the poses drawn.
        let offset = 60.0 * config.units_per_mm * config.spindle.z.signum();
        let tool = config.spindle + Vector3::new(0.0, 0.0, offset);
        let poses = at_tool::poses(&config, &tool, 60, 3);
        assert_eq!(poses.len(), 60, "{machine}");
        for pose in poses {
            for (k, value) in pose.to_degrees().into_iter().enumerate() {
                let axis = &config.axes[k];
                // Rounding of degrees to radians and back.
                let room = 1e-9 * (1.0 + value.abs());
                assert!(
                    value > axis.min - room && value < axis.max + room,
                    "{machine} {k}: {value}"
                );
            }
        }
    }
}

/// Computes by how much the derivatives of the residuals by each parameter differ from differences over `step`.
pub(crate) fn off_derivatives(
    model: &Model,
    readings: &[&Reading],
    changes: &[f64],
    step: impl Fn(usize) -> f64,
) -> impl Iterator<Item = f64> {
    let (_, jacobian) = residuals(model, readings, changes).unwrap();
    (0..model.parameters.len()).map(move |k| {
        let at = |by: f64| {
            let mut moved = changes.to_vec();
            moved[k] += by;
            residuals(model, readings, &moved).unwrap().0
        };
        let by = step(k);
        ((at(by) - at(-by)) / (2.0 * by) - jacobian.column(k)).amax()
    })
}

#[test]
fn the_derivatives_are_those_of_the_residuals() {
    for machine in shipped::unchained() {
        let config = shipped::config(machine);
        let tolerance = Tolerance { lead: 0.01, trigger: 0.1, ..Tolerance::of_lengths(TOLERANCE) };
        let turned = Frame {
            origin: Vector3::new(30.0, -20.0, 5.0),
            rotation: Pose::from_degrees([0.0, 0.0, 0.0, 10.0, -20.0, 30.0]).rotation(),
        };
        let model = drawn(&config, &tolerance).with_unknown_frame(turned);
        let mut dice = Dice::new(1);
        let changes: Vec<f64> =
            model.parameters.iter().map(|p| 0.1 * p.deviation * dice.normal()).collect();
        let poses = at_tool::poses(&config, &config.spindle, 3, 5);
        let measures: [fn(&Frame, &Pose) -> Measured; 5] = [
            |_, _| Measured::Bore { axis: [3.0, 4.0], radius: 5.0 },
            |_, _| Measured::Face(1.0),
            |_, _| Measured::Distance(100.0),
            |_, _| Measured::Position(Vector3::zeros()),
            |frame, pose| {
                Measured::Pose(Vector3::zeros(), frame.rotation.transpose() * pose.rotation())
            },
        ];
        for measure in measures {
            let tool = config.spindle;
            let joints = |pose: &Pose| config.machine.inverse(pose, &tool).unwrap();
            let readings: Vec<Reading> = poses
                .iter()
                .map(|pose| Reading {
                    name: String::new(),
                    group: 0,
                    joints: joints(pose),
                    pose: *pose,
                    tool,
                    frame: 0,
                    measured: measure(&turned, pose),
                    instrument: Instrument::default(),
                })
                .collect();
            let readings: Vec<&Reading> = readings.iter().collect();
            let steps = |k: usize| 1e-3 * model.parameters[k].deviation;
            for (k, miss) in off_derivatives(&model, &readings, &changes, steps).enumerate() {
                // Rates are at most a thousand lengths per radian: poses are accurate to 1e-9, over
                // steps of 1e-4, and third derivatives leave 1e3 · 1e-8 / 6.
                let what = (&readings[0].measured, &model.parameters[k]);
                assert!(miss < 1e-4, "{machine} {what:?}: {miss}");
            }
        }
    }
}

#[test]
fn ranks_are_those_of_the_theory_and_what_is_missing_has_a_name() {
    let config = shipped::config(MACHINE);
    let model = drawn(&config, &Tolerance::of_lengths(TOLERANCE));
    let known = model.clone().with_frame(Frame::BASE);
    let unknown = model.with_unknown_frame(Frame::BASE);
    let varied = at_tool::poses(&config, &TOOL, 60, 3);
    let level: Vec<Pose> =
        varied.iter().map(|pose| Pose { angles: Vector3::zeros(), ..*pose }).collect();
    let check = |model: &Model, poses: &[Pose], measure: fn(&Pose) -> Measured| {
        let readings = read(&config.machine, &config.machine, poses, measure);
        let all: Vec<&Reading> = readings.iter().collect();
        let zero = vec![0.0; model.parameters.len()];
        let (_, jacobian) = residuals(model, &all, &zero).unwrap();
        let rank = rank(model, &jacobian);
        let unseen = unseen(model, &readings, &jacobian);
        let missing: usize = unseen.iter().map(|(count, _)| count).sum();
        assert_eq!(rank + missing, model.parameters.len(), "{unseen:?}");
        (rank, unseen)
    };
    let place = |pose: &Pose| Measured::Position(pose.position - TOOL);
    let (full, unseen) =
        check(&known, &varied, |pose| Measured::Pose(pose.position - TOOL, pose.rotation()));
    assert_eq!((full, unseen.len()), (42, 0));
    let (tip, unseen) = check(&known, &varied, place);
    assert_eq!((tip, unseen[0].0), (39, 3));
    // Six parameters of the frame, of which only the three of the center's position have an effect.
    let distance: fn(&Pose) -> Measured = |pose| Measured::Distance((pose.position - TOOL).norm());
    let (distances, unseen) = check(&unknown, &varied, distance);
    assert_eq!(distances - 3, 33);
    assert_eq!(unseen.iter().map(|(count, _)| *count).collect::<Vec<_>>(), [3, 6, 3]);
    let (one, unseen) = check(&known, &level, place);
    assert!(one <= 24, "{one}");
    assert!(unseen.iter().any(|(_, text)| text.contains("several tilts")), "{unseen:?}");
}

#[test]
fn half_a_millimeter_becomes_two_micrometers_over_the_workspace() {
    let config = shipped::config(MACHINE);
    let model = drawn(&config, &Tolerance::of_lengths(TOLERANCE)).with_frame(Frame::BASE);
    let mut dice = Dice::new(2);
    let truth = model.machine(&built(&model, &mut dice)).unwrap();
    let before = tip_error(&config.machine, &truth, &config);
    let readings = positions(&config, &truth, &at_tool::poses(&config, &TOOL, 250, 4), &mut dice);
    let found = fit(&model, &readings, None).unwrap();
    let after = tip_error(&model.machine(&found.changes).unwrap(), &truth, &config);
    println!("tip error {before:.4} mm before, {after:.5} mm after; noise {:.6}", found.noise);
    assert!(before > 0.5 && after < 2e-3, "{before} {after}");
    // From 750 numbers the deviation is known to 1/√1500 = 2.6 %, by the median to 4 %; the tolerance is four times
    // that.
    assert!((found.noise / NOISE - 1.0).abs() < 0.16, "{}", found.noise);
    let held_out = held_out(&model, &readings, &found, |_| {}).unwrap();
    // Readings left out fit as well as those used, except for the 10 % due to 39 unknowns in 750 numbers.
    assert!(held_out / found.rms() < 1.1, "{held_out} {}", found.rms());
    assert!(found.outliers.is_empty(), "{:?}", found.outliers);
}

/// Simulates touches of a plate of holes, at several tilts: each hole at two heights of four walls, and the
/// face beside it.
fn touches(config: &Mechanism, truth: &Machine, plate: &Frame, dice: &mut Dice) -> Vec<Reading> {
    let control = &config.machine;
    let mut readings = vec![];
    let mut group = 0;
    for tilt in [[0.0, 0.0], [12.0, 0.0], [-12.0, 0.0], [0.0, 12.0], [0.0, -12.0], [9.0, 9.0]] {
        for hole in 0..9 {
            let (x, y) = (f64::from(hole % 3 - 1) * 40.0, f64::from(hole / 3 - 1) * 40.0);
            group += 1;
            for wall in 0..5 {
                let angle = f64::from(wall) * std::f64::consts::FRAC_PI_2;
                let (radius, measured) = match wall {
                    4 => (15.0, Measured::Face(3.0)),
                    _ => (7.0, Measured::Bore { axis: [x, y], radius: 7.0 }),
                };
                let height = if wall == 4 { 3.0 } else { -2.0 };
                let local =
                    Vector3::new(x + radius * angle.cos(), y + radius * angle.sin(), height);
                let noise = dice.vector(NOISE);
                let point = plate.origin + plate.rotation * local + noise;
                // Joints at which the true machine reaches the touch.
                let wanted = Pose {
                    position: point + TOOL,
                    angles: Vector3::new(tilt[0], tilt[1], 0.0).map(f64::to_radians),
                };
                let joints = truth.inverse(&wanted, &TOOL).unwrap();
                let pose =
                    control.forward(&joints, &wanted, &TOOL, &Solver::default()).unwrap().pose;
                let name = format!("touch {}", readings.len());
                readings.push(Reading {
                    name,
                    group,
                    joints,
                    pose,
                    tool: TOOL,
                    frame: 0,
                    measured,
                    instrument: Instrument::default(),
                });
            }
        }
    }
    readings
}

#[test]
fn touches_on_a_plate_of_unknown_place_calibrate_where_they_were_made() {
    let config = shipped::config(MACHINE);
    let plate = Frame {
        origin: Vector3::new(3.0, -4.0, 600.0),
        rotation: Pose::from_degrees([0.0, 0.0, 0.0, 0.3, -0.2, 4.0]).rotation(),
    };
    let model = drawn(&config, &Tolerance::of_lengths(TOLERANCE));
    let mut dice = Dice::new(3);
    let truth = model.machine(&built(&model, &mut dice)).unwrap();
    // The initial guess is off by a millimeter and half a degree.
    let guess = Frame {
        origin: plate.origin + Vector3::new(1.0, -0.7, 0.5),
        rotation: Pose::from_degrees([0.0, 0.0, 0.0, 0.0, 0.0, 3.5]).rotation(),
    };
    let readings = touches(&config, &truth, &plate, &mut dice);
    let model = model.with_unknown_frame(guess);
    let found = fit(&model, &readings, None).unwrap();
    let calibrated = model.machine(&found.changes).unwrap();
    // Distance between the true tip and the commanded one, both relative to the plate.
    let seen = model.frame(0, &found.changes);
    let error = |control: &Machine, frame: &Frame| {
        readings
            .iter()
            .step_by(7)
            .map(|r| {
                let (pose, tool) = (
                    Pose { position: r.pose.position + Vector3::new(4.0, -4.0, 3.0), ..r.pose },
                    TOOL,
                );
                let joints = control.inverse(&pose, &tool).unwrap();
                let true_pose =
                    truth.forward(&joints, &pose, &tool, &Solver::default()).unwrap().pose;
                (plate.seen(&(true_pose.position - tool)) - frame.seen(&(pose.position - tool)))
                    .norm()
            })
            .fold(0.0, f64::max)
    };
    let (before, after) = (error(&config.machine, &plate), error(&calibrated, &seen));
    println!("touches: {before:.4} mm before, {after:.5} mm after");
    assert!(before > 0.2 && after < 2e-3, "{before} {after}");
}

#[test]
fn what_one_orientation_does_not_tell_is_not_moved() {
    let config = shipped::config(MACHINE);
    let model = drawn(&config, &Tolerance::of_lengths(TOLERANCE)).with_frame(Frame::BASE);
    let mut dice = Dice::new(5);
    let truth = model.machine(&built(&model, &mut dice)).unwrap();
    let level: Vec<Pose> = at_tool::poses(&config, &TOOL, 100, 6)
        .iter()
        .map(|pose| Pose { angles: Vector3::zeros(), ..*pose })
        .collect();
    let readings = positions(&config, &truth, &level, &mut dice);
    let found = fit(&model, &readings, None).unwrap();
    // The residual equals the noise, although half of the parameters were not determined.
    assert!(found.rms() < 1.1 * NOISE, "{}", found.rms());
    let change = |place| found.changes[model.number(place).unwrap()];
    for leg in 0..6 {
        for axis in 0..3 {
            // One orientation does not determine the sum of base and platform anchor; the observable
            // difference is split equally between both.
            let sum = change(Quantity::Base(leg, axis)) + change(Quantity::Platform(leg, axis));
            // The true tilt of the platform differs from level by 1e-3, which makes the sum observable to that extent.
            assert!(sum.abs() < 2e-2 * TOLERANCE, "leg {leg} axis {axis}: {sum}");
            let k = model.number(Quantity::Base(leg, axis)).unwrap();
            assert!(found.deviation(k) > 0.6 * TOLERANCE, "{}", found.deviation(k));
        }
    }
}

/// Returns the share of 95 % intervals that contain the truth, over parameters and runs, and the least and
/// largest share of one parameter.
fn coverage(runs: usize) -> (f64, f64, f64) {
    let config = shipped::config(MACHINE);
    let model = drawn(&config, &Tolerance::of_lengths(TOLERANCE)).with_frame(Frame::BASE);
    let poses = at_tool::poses(&config, &TOOL, 30, 8);
    let reach = Normal::standard().inverse_cdf(0.975);
    let mut held = vec![0; model.parameters.len()];
    for run in 0..runs {
        let mut dice = Dice::new(1000 + run as u64);
        let changes = built(&model, &mut dice);
        let truth = model.machine(&changes).unwrap();
        let readings = positions(&config, &truth, &poses, &mut dice);
        let found = fit(&model, &readings, Some(NOISE)).unwrap();
        for (k, held) in held.iter_mut().enumerate() {
            *held +=
                usize::from((found.changes[k] - changes[k]).abs() <= reach * found.deviation(k));
        }
    }
    let share = |count: usize| count as f64 / runs as f64;
    let all = held.iter().sum::<usize>() as f64 / (runs * held.len()) as f64;
    (all, share(*held.iter().min().unwrap()), share(*held.iter().max().unwrap()))
}

#[test]
fn intervals_of_95_percent_hold_the_truth_as_often_as_they_say() {
    let runs = cases(50);
    let (all, least, largest) = coverage(runs);
    println!(
        "{runs} runs: {:.2} % over all parameters, {:.2} to {:.2} % of one",
        100.0 * all,
        100.0 * least,
        100.0 * largest
    );
    // Parameters of one run are correlated: the 42 of a run are counted as one, which gives
    // the largest possible spread of their mean. A false alarm once in a thousand runs.
    let law = Binomial::new(0.95, runs as u64).unwrap();
    let share = |p: f64| law.inverse_cdf(p) as f64 / runs as f64;
    assert!(share(5e-4) <= all && all <= share(0.9995), "{all}");
    // For the worst of 42 parameters.
    assert!(share(5e-4 / 42.0) <= least && largest <= 1.0, "{least} {largest}");
    if runs >= 500 {
        assert!((0.93..=0.97).contains(&all), "{all}");
    }
}

#[test]
fn chosen_poses_need_fewer_readings_than_random_ones() {
    let config = shipped::config(MACHINE);
    let model = drawn(&config, &Tolerance::of_lengths(TOLERANCE)).with_frame(Frame::BASE);
    let zero = vec![0.0; model.parameters.len()];
    let changed = Changed::new(&model, &zero).unwrap();
    let rows = |pose: &Pose| {
        let reading = &read(&config.machine, &config.machine, &[*pose], |pose| {
            Measured::Position(pose.position)
        })[0];
        changed.residual(reading, pose).unwrap().1
    };
    let candidates: Vec<DMatrix<f64>> =
        at_tool::poses(&config, &TOOL, 200, 9).iter().map(rows).collect();
    let tips: Vec<DMatrix<f64>> = at_tool::workspace(&config, &TOOL)
        .iter()
        .map(|pose| at_tool::rates(&model, &changed.at(*pose, &TOOL).unwrap()))
        .collect();
    let stacked = |numbers: &[usize]| {
        let blocks: Vec<DMatrix<f64>> = numbers.iter().map(|i| candidates[*i].clone()).collect();
        let mut all = DMatrix::zeros(3 * blocks.len(), model.parameters.len());
        blocks.iter().enumerate().for_each(|(i, block)| all.rows_mut(3 * i, 3).copy_from(block));
        all
    };
    let none = DMatrix::zeros(0, model.parameters.len());
    let chosen = next_best(&model, &none, &candidates, &tips, NOISE, 20);
    let with_chosen = tip_deviation(&model, &stacked(&chosen), &tips, NOISE);
    // Ten random orders of 200 poses: how many of the first poses are needed.
    let mut needed: Vec<usize> = (0..10)
        .map(|turn| {
            let order: Vec<usize> = (0..200).map(|i| (i * 7 + turn * 20) % 200).collect();
            let enough = |count: &usize| {
                tip_deviation(&model, &stacked(&order[..*count]), &tips, NOISE) <= with_chosen
            };
            (1..=200).find(enough).unwrap_or(200)
        })
        .collect();
    needed.sort_unstable();
    println!("20 chosen poses: {with_chosen:.5} mm; random ones need {needed:?}");
    assert!(needed[0] > 20, "{needed:?}");
}

fn measured_machine() -> (Mechanism, Model, Vec<Reading>) {
    let config = shipped::config(MACHINE);
    let model = drawn(&config, &Tolerance::of_lengths(TOLERANCE)).with_frame(Frame::BASE);
    let mut dice = Dice::new(11);
    let truth = model.machine(&built(&model, &mut dice)).unwrap();
    let readings = positions(&config, &truth, &at_tool::poses(&config, &TOOL, 60, 12), &mut dice);
    (config, model, readings)
}

fn spoilt(readings: &mut [Reading], number: usize, by: Vector3<f64>) {
    if let Measured::Position(place) = &mut readings[number].measured {
        *place += by;
    }
}

#[test]
fn an_outlier_is_named_and_changes_nothing() {
    let (_, model, mut readings) = measured_machine();
    let without: Vec<Reading> = readings
        .iter()
        .enumerate()
        .filter(|(i, _)| *i != 17 && *i != 40)
        .map(|(_, r)| r.clone())
        .collect();
    let clean: Fit = fit(&model, &without, None).unwrap();
    spoilt(&mut readings, 17, Vector3::new(0.0, 0.3, 0.0));
    spoilt(&mut readings, 40, Vector3::new(0.012, 0.0, 0.0));
    let found = fit(&model, &readings, None).unwrap();
    let named: Vec<usize> = found.outliers.iter().map(|outlier| outlier.reading).collect();
    assert_eq!(named, [17, 40]);
    assert!((found.outliers[0].miss - 0.3).abs() < 0.05, "{:?}", found.outliers);
    for (k, (a, b)) in clean.changes.iter().zip(&found.changes).enumerate() {
        // The same readings have the same minimum, up to the termination of the search.
        assert!((a - b).abs() < 1e-3 * clean.deviation(k), "{k}: {a} {b}");
    }
}

#[test]
fn too_few_readings_and_too_many_outliers_are_refused() {
    let (_, model, mut readings) = measured_machine();
    let few = fit(&model, &readings[..13], None);
    assert!(matches!(few, Err(Misfit::TooFew { numbers: 39, determined: 39 })), "{few:?}");
    for i in 0..12 {
        spoilt(&mut readings, 5 * i, Vector3::new(0.0, 0.1 * i as f64 + 0.2, 0.0));
    }
    let many = fit(&model, &readings, Some(NOISE));
    assert!(matches!(many, Err(Misfit::TooManyOutliers(7, 60))), "{many:?}");
}

/// Compares the joints of a calibrated file, read back, with those of the changed model: anchors, offsets, rods and leads.
#[test]
fn a_calibrated_file_has_every_change_of_the_model() {
    let tolerance = Tolerance { lead: 0.01, ..Tolerance::of_lengths(TOLERANCE) };
    for name in ["hexapod", "linear-delta", "rotary-delta"] {
        let config = shipped::config(name);
        let model = Model::new(config.geometry, config.offsets, &tolerance).unwrap();
        let changes = built(&model, &mut Dice::new(5));
        let text = calibrated(&config, &model, &changes).unwrap();
        let written = shipped::machine_of(&config.file, &text);
        let mut pose = config.home;
        let moved = Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l));
        moved.for_each(|letter| pose[letter.index()] += if letter.is_angle() { 4.0 } else { 10.0 });
        let joints = |machine: &Machine| {
            machine.inverse(&Pose::from_degrees(pose), &config.spindle).unwrap()
        };
        let (own, wanted) =
            (joints(&written.first().machine), joints(&model.machine(&changes).unwrap()));
        for (i, joint) in config.joints.iter().enumerate() {
            // A joint depends on some ten lengths, each rounded to 1e-6 mm.
            assert!(
                (own[i] - wanted[i]).abs() < 2e-5,
                "{name}: {} {}",
                joint.name,
                own[i] - wanted[i]
            );
        }
    }
}
