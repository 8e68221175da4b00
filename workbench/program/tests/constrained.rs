// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines whose passive joints couple coordinates, as LinuxCNC runs them in virtual time: the commanded joint values
//! of every servo cycle, solved here by Newton's method with all equations of the machine, place the tip as commanded.

use kinematics::{ConstraintGeometry, LegKind, Matrix3, Vector3};
use linuxcnc::process::{self, Options};
use linuxcnc::row::{Ending, Row};
use machine::read::mechanism::Mechanism;
use std::fs;
use std::ops::ControlFlow;
use test_support::shipped::{config, copied};

/// Delay of LinuxCNC's smoothing, in cycles.
const SMOOTHING: usize = 2;

/// Servo period, seconds.
const PERIOD: f64 = 1e-3;

/// Step of numerical derivatives, and number of Newton's steps, which converge quadratically.
const STEP: f64 = 1e-5;
const STEPS: usize = 6;

/// The platform: position of its origin, and orientation.
#[derive(Clone, Copy)]
struct Place {
    position: Vector3<f64>,
    rotation: Matrix3<f64>,
}

impl Place {
    /// Moves by a length or turns by an angle.
    fn moved(&self, step: &[f64; 6]) -> Self {
        let axis = Vector3::new(step[3], step[4], step[5]);
        let angle = axis.norm();
        // Rodrigues' formula.
        let cross = axis.cross_matrix();
        let turn = match angle > 0.0 {
            true => {
                Matrix3::identity()
                    + cross * (angle.sin() / angle)
                    + cross * cross * ((1.0 - angle.cos()) / (angle * angle))
            }
            false => Matrix3::identity(),
        };
        let position = self.position + Vector3::new(step[0], step[1], step[2]);
        Self { position, rotation: turn * self.rotation }
    }
}

/// Returns the values of all equations of legs and constraints.
fn residuals(config: &Mechanism, joints: &[f64], place: &Place) -> Vec<f64> {
    let of = |vector: [f64; 3]| Vector3::from(vector);
    let on = |point: [f64; 3]| place.position + place.rotation * of(point);
    let legs = config.geometry.legs().iter().zip(joints).map(|(leg, value)| match leg.kind {
        LegKind::Strut(_) => (on(leg.platform) - of(leg.base)).norm() - value,
        LegKind::Slider(slider) => {
            let carriage = of(leg.base) + of(slider.guide).normalize() * *value;
            (on(leg.platform) - carriage).norm() - slider.rod
        }
        _ => panic!("no such leg on these machines"),
    });
    let constraints = config.geometry.constraints().iter().map(|constraint| match *constraint {
        ConstraintGeometry::PointInPlane { platform, base, normal } => {
            of(normal).normalize().dot(&(on(platform) - of(base)))
        }
        ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
            (place.rotation * of(normal).normalize()).dot(&(of(base) - on(platform)))
        }
        // As a length.
        ConstraintGeometry::Square { platform_axis, base_axis } => {
            100.0 * (place.rotation * of(platform_axis).normalize()).dot(&of(base_axis).normalize())
        }
    });
    legs.chain(constraints).collect()
}

/// Solves six linear equations by elimination with the largest pivots.
fn solved(mut rows: [[f64; 7]; 6]) -> [f64; 6] {
    for k in 0..6 {
        let pivot = (k..6).max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs())).unwrap();
        rows.swap(k, pivot);
        let own = rows[k];
        for (i, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != k) {
            let share = row[k] / own[k];
            assert!(share.is_finite(), "{i}: the machine is singular");
            row.iter_mut().zip(own).for_each(|(value, own)| *value -= share * own);
        }
    }
    std::array::from_fn(|k| rows[k][6] / rows[k][k])
}

/// Returns the platform of these joint values near another one: least squares, because equations may be redundant.
fn platform(config: &Mechanism, joints: &[f64], mut place: Place) -> Place {
    for _ in 0..STEPS {
        let values = residuals(config, joints, &place);
        let column = |k: usize| -> Vec<f64> {
            let ends = [-STEP, STEP].map(|by| {
                let step = std::array::from_fn(|m| if m == k { by } else { 0.0 });
                residuals(config, joints, &place.moved(&step))
            });
            ends[0].iter().zip(&ends[1]).map(|(low, high)| (high - low) / (2.0 * STEP)).collect()
        };
        let columns: [Vec<f64>; 6] = std::array::from_fn(column);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let normal = std::array::from_fn(|i| {
            std::array::from_fn(|k| match k {
                6 => -dot(&columns[i], &values),
                _ => dot(&columns[i], &columns[k]),
            })
        });
        place = place.moved(&solved(normal));
    }
    place
}

/// Runs a program; returns its servo cycles with the drives on.
fn rows(machine: &str, program: &str) -> (Mechanism, Vec<Row>) {
    let folder = copied(machine);
    let file = folder.path().join("program.ngc");
    fs::write(&file, program).unwrap();
    let config = test_support::shipped::first_of(&folder.path().join(format!("{machine}.ini")));
    let mut rows = vec![];
    let outcome = process::run(&config.clone().into(), &file, &Options::default(), |row| {
        rows.push(*row);
        ControlFlow::Continue(())
    });
    let outcome = outcome.unwrap();
    assert_eq!(outcome.ending, Ending::Finished, "{machine}: {:?}", outcome.messages);
    rows.retain(|row| row.flags.on);
    (config, rows)
}

/// Returns the largest distance of the tip that the joint values give from the commanded one, two cycles before.
fn tip_error(config: &Mechanism, rows: &[Row]) -> f64 {
    let home = config.machine.full_pose(&config.home_pose(), &Vector3::zeros()).unwrap();
    let mut place = Place { position: home.position, rotation: home.rotation() };
    let (legs, table) = (config.legs(), config.machine.layout().table());
    let mut worst = 0.0_f64;
    for (n, row) in rows.iter().enumerate().skip(SMOOTHING) {
        place = platform(config, &row.joints[..legs], place);
        let tool = config.spindle + Vector3::from(row.tool);
        let mut tip = place.position + tool - place.rotation * tool;
        for (letter, value) in table.as_slice().iter().zip(&row.joints[legs..]) {
            tip[letter.index()] += value;
        }
        let commanded = &rows[n - SMOOTHING].pose;
        for k in (0..3).filter(|k| !config.machine.layout().is_held(kinematics::Letter::ALL[*k])) {
            worst = worst.max((tip[k] - commanded[k]).abs());
        }
    }
    worst
}

/// While the head tilts over its whole range, its table keeps the tip in place.
#[test]
fn tip_of_a_tilting_head_stays_in_every_servo_cycle() {
    let machine = config("z3-head");
    let most = [3, 4].map(|k| machine.programmed[k].max.min(-machine.programmed[k].min));
    let [a, b] = most;
    // At 2 degrees a second LinuxCNC's smoothing of the joints, a sixth of their acceleration at constant speed of the
    // tilt times the period squared, moves the tip by some 1e-7 mm, a third of what is allowed.
    let text =
        format!("G21 G90 G61\nT1 M6\nG43\nG1 F120 A{a}\nB{b}\nA-{a}\nB-{b}\nA{a}\nB0\nA0\nM2\n");
    let (config, rows) = rows("z3-head", &text);
    let tilts = |k: usize| rows.iter().map(move |row| row.pose[k].abs()).fold(0.0, f64::max);
    assert!((tilts(3) - a).abs() < 1e-6 && (tilts(4) - b).abs() < 1e-6);
    let moved = rows.iter().map(|row| row.joints[3].abs()).fold(0.0, f64::max);
    let error = tip_error(&config, &rows);
    assert!(moved > 1.0, "the table compensates: {moved}");
    assert!(error < 1e-9 * config.machine.size(), "{error} of {}", config.machine.size());
}

/// A program of every machine: LinuxCNC's smoothing moves each joint by a sixth of its acceleration times the period
/// squared.
#[test]
fn tips_follow_the_programs_in_every_servo_cycle() {
    for (machine, program) in
        [("tricept", "dish.ngc"), ("exechon", "pocket.ngc"), ("z3-head", "inclined-holes.ngc")]
    {
        let file = test_support::shipped::folder(machine).join("programs").join(program);
        let (config, rows) = rows(machine, &fs::read_to_string(file).unwrap());
        let most = config.joints.iter().map(|joint| joint.max_acceleration).fold(0.0, f64::max);
        let error = tip_error(&config, &rows);
        // Several joints together, at most five here.
        assert!(error < 5.0 * most * PERIOD * PERIOD / 6.0, "{machine}: {error}");
    }
}
