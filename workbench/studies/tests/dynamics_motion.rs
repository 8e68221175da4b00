// SPDX-License-Identifier: GPL-2.0-or-later
//! The platform's motion over time and under random forces, against closed forms, the matrices at a pose and
//! independent values.

use crate::dynamics::{GENERAL, STRUTS, SYMMETRIC, TOOL, close, hexapod, model, with_tool};
use crate::stiffness::between_anchors;
use kinematics::{Matrix3, Pose, Vector3};
use machine::proof::axis_box;
use machine::read::mechanism::Mechanism;
use machine::rows::rate_map;
use nalgebra::{DMatrix, DVector, Matrix6xX};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use serde::Deserialize;
use std::convert::Infallible;
use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::sync::LazyLock;
use studies::dynamics::capacity::Capacity;
use studies::dynamics::chart::Chart;
use studies::dynamics::drives::Drives;
use studies::dynamics::layer::{Layer, Stock};
use studies::dynamics::linear::{Ellipse, Linear};
use studies::dynamics::loads::{Held, Moving, Wrench, loads};
use studies::dynamics::milling::Milling;
use studies::dynamics::model::Model;
use studies::dynamics::noise::{Noise, Spectrum};
use studies::dynamics::record::Record;
use studies::dynamics::rotation::{Acceleration, Motion};
use studies::dynamics::run::{Ended, Follower, Force, Times, standing};
use studies::dynamics::simulation::Simulation;
use studies::dynamics::structure::Structure;
use studies::dynamics::strut::StrutMass;
use studies::study::file::Study;
use studies::study::springs::Spring;
use test_support::drawn_constraints;
use test_support::generated;
use test_support::shipped::{CONSTRAINED, MACHINES, cases, config, machine_of};

#[derive(Deserialize)]
struct File {
    random_force: Golden,
}

#[derive(Deserialize)]
struct Golden {
    sigma_n_corner_hz: [f64; 4],
    ou_step_50us_decay_gain: [f64; 2],
    a_home_sym_tip_covariance_mm2: [[f64; 3]; 3],
    a_home_sym_ellipse_um_um_deg: [f64; 3],
    a_home_sym_tip_rms_um: [f64; 3],
    a_home_sym_strut_force_rms_n: Vec<f64>,
    a_home_sym_tip_rms_um_held_0p1ms: [f64; 3],
    a_home_sym_relative_sd_of_variance_10s: [f64; 3],
    a_home_sym_psd_x_50hz_mm2_per_hz: f64,
    a_pose4_gen_tip_covariance_mm2: [[f64; 3]; 3],
    a_pose4_gen_tip_rms_um: [f64; 3],
    a_pose4_gen_ellipse_um_um_deg: [f64; 3],
    a_pose4_gen_strut_force_rms_n: Vec<f64>,
    a_pose4_gen_tip_rms_um_held_0p1ms: [f64; 3],
    a_pose4_gen_relative_sd_of_variance_10s: [f64; 3],
    a_pose4_gen_psd_x_50hz_mm2_per_hz: f64,
    a_pose4_softest_direction_deg: f64,
    a_pose4_isotropic_corner_hz_long_axis_deg_ratio: Vec<[f64; 3]>,
    one_mass_m_c_k_corner_sigma_rms_um: [f64; 6],
    #[serde(rename = "top_1_I_kg_m2_omega0_rad_s")]
    top_1: [f64; 6],
    top_1_omega_at_1s: [f64; 3],
    top_1_period_s: f64,
    #[serde(rename = "top_2_I_kg_m2_omega0_rad_s")]
    top_2: [f64; 6],
    top_2_omega_at_1s: [f64; 3],
    top_2_period_s: f64,
    #[serde(rename = "milling_N_D_ap_fz")]
    milling: [f64; 4],
    #[serde(rename = "milling_Kc_trc_n_mm2")]
    milling_cutting: [f64; 3],
    #[serde(rename = "milling_Ke_trc_n_mm")]
    milling_edge: [f64; 3],
    milling_tooth_hz: f64,
    milling_slot_mean_n: [f64; 3],
    milling_slot_harmonic_1_amplitude_n: [f64; 3],
    milling_slot_harmonic_2_amplitude_n: [f64; 3],
    milling_half_down_mean_n: [f64; 3],
    milling_half_down_harmonic_1_amplitude_n: [f64; 3],
    milling_half_down_harmonic_2_amplitude_n: [f64; 3],
    milling_tenth_down_mean_n: [f64; 3],
    milling_tenth_down_harmonic_1_amplitude_n: [f64; 3],
    milling_tenth_down_harmonic_2_amplitude_n: [f64; 3],
}

static GOLDEN: LazyLock<Golden> = LazyLock::new(|| {
    let file: File = toml::from_str(include_str!("cutting_dynamics.toml")).unwrap();
    file.random_force
});

const POSE_4: [f64; 6] = [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0];
const HOME: [f64; 6] = [0.0, 0.0, 250.0, 0.0, 0.0, 0.0];

fn sigma() -> Vector3<f64> {
    let [x, y, z, _] = GOLDEN.sigma_n_corner_hz;
    Vector3::new(x, y, z)
}

fn corner() -> Spectrum {
    Spectrum::Corner { corner: GOLDEN.sigma_n_corner_hz[3] }
}

/// Simulates a torque-free top for some seconds.
fn spun(inertia: Vector3<f64>, spin: Vector3<f64>, seconds: f64, steps: u32) -> Motion {
    let zero = Vector3::zeros();
    let mut motion = Motion {
        place: zero,
        velocity: zero,
        rotation: Matrix3::identity(),
        spin,
        table: zero,
        table_velocity: zero,
    };
    for _ in 0..steps {
        let rates = |motion: &Motion, _: f64| {
            let momentum = inertia.component_mul(&motion.spin);
            let spin = -motion.spin.cross(&momentum).component_div(&inertia);
            Ok::<_, Infallible>(Acceleration { place: zero, spin, table: zero })
        };
        motion = motion.after(seconds / f64::from(steps), rates).unwrap();
    }
    motion
}

#[test]
fn a_free_top_turns_as_elliptic_functions_say_and_keeps_energy_and_momentum() {
    for (given, expected) in
        [(GOLDEN.top_1, GOLDEN.top_1_omega_at_1s), (GOLDEN.top_2, GOLDEN.top_2_omega_at_1s)]
    {
        let inertia = Vector3::from_column_slice(&given[..3]);
        let spin = Vector3::from_column_slice(&given[3..]);
        let end = spun(inertia, spin, 1.0, 1000);
        // Fourth order: 9 rad/s in steps of 1 ms leave an error of 1e-11.
        assert!((end.spin - Vector3::from(expected)).amax() < 1e-7, "{}", end.spin);
        let momentum = inertia.component_mul(&spin);
        let left = end.rotation * inertia.component_mul(&end.spin) - momentum;
        assert!(left.norm() < 1e-7 * momentum.norm(), "{left}");
        let energy = |spin: &Vector3<f64>| spin.dot(&inertia.component_mul(spin));
        close(&[energy(&end.spin)], &[energy(&spin)], 1e-7);
    }
}

#[test]
fn the_spin_of_a_free_top_comes_back_after_the_period_of_the_elliptic_integral() {
    for (given, period) in
        [(GOLDEN.top_1, GOLDEN.top_1_period_s), (GOLDEN.top_2, GOLDEN.top_2_period_s)]
    {
        let inertia = Vector3::from_column_slice(&given[..3]);
        let spin = Vector3::from_column_slice(&given[3..]);
        let end = spun(inertia, spin, period, 4000);
        assert!((end.spin - spin).amax() < 1e-7, "{}", end.spin);
        // The period is not shorter: after half a period one component has the opposite sign.
        let half = spun(inertia, spin, period / 2.0, 4000).spin;
        assert!((half - spin).amax() > 1.0, "{half}");
    }
}

#[test]
fn halving_the_step_divides_the_error_of_a_top_by_sixteen() {
    let inertia = Vector3::new(0.40, 0.45, 0.60);
    let expected = Vector3::from(GOLDEN.top_1_omega_at_1s);
    let spin = Vector3::new(2.0, 0.0, 9.0);
    let error = |steps| (spun(inertia, spin, 1.0, steps).spin - expected).norm();
    let ratio = error(50) / error(100);
    // Sixteen, except for the effect of higher orders.
    assert!((14.0..19.0).contains(&ratio), "{ratio}");
}

/// Returns a machine with all properties that a simulation supports.
fn shaken(machine: &str, geometric: bool, screw: &str) -> (Mechanism, Model) {
    let config = config(machine);
    let model = heavy(&config, geometric, screw);
    (config, model)
}

/// Returns all machines with constraints of the platform: the shipped ones, and random ones of which some have leads.
fn constrained() -> Vec<Mechanism> {
    let drawn = drawn_constraints::ALL.map(drawn_constraints::config);
    CONSTRAINED.into_iter().map(config).chain(drawn).collect()
}

/// Returns a model in which every part has mass.
fn heavy(config: &Mechanism, geometric: bool, screw: &str) -> Model {
    let legs = format!(
        "[legs]\nstiffness_n_per_um = 10\ndamping_n_s_per_mm = 0.8\nscrew = \"{screw}\"\n\
         axial_mass_kg = 1.5\nacross_mass_kg = 2.0\n"
    );
    let table = "[table]\nstiffness_n_per_um = 50\nmass_kg = 80\ndamping_ratio = 0.02\n";
    let platform = format!("[platform]\n{GENERAL}geometric_stiffness = {geometric}\n");
    let study = Study::parse(&format!("{platform}{legs}{table}")).unwrap();
    Model::of(config, &study).unwrap()
}

/// Returns accelerations in the coordinates of a chart, without the terms that are due to speeds.
fn accelerations(
    simulation: &mut Simulation,
    chart: &Chart,
    motion: &Motion,
    drives: &Drives,
    centre_of_mass: &Vector3<f64>,
) -> DVector<f64> {
    let still = Drives::default();
    let found = simulation.rates(motion, [drives, &still], &Vector3::zeros()).unwrap();
    let turning = motion.rotation * found.spin;
    let lever = motion.rotation * (chart.centre() - centre_of_mass);
    chart.rates(&(found.place + turning.cross(&lever)), &turning)
}

#[test]
fn the_matrices_are_the_differences_of_the_simulation() {
    for (machine, screw) in [
        ("hexapod", "self-locking"),
        ("hexapod", "backdrivable"),
        ("lab-hexapod", "backdrivable"),
        ("six-rod-lathe", "backdrivable"),
        ("four-rod-lathe", "backdrivable"),
        ("pyramid", "backdrivable"),
        ("linear-delta", "backdrivable"),
        ("rotary-delta", "backdrivable"),
        ("tripod", "backdrivable"),
    ] {
        let (config, model) = shaken(machine, true, screw);
        let mut pose = config.home;
        // Away from symmetry if the machine has the degrees of freedom.
        let letters = config.machine.layout().coordinates().len();
        if letters == 6 {
            pose[3..].copy_from_slice(&[3.0, -4.0, 2.0]);
        } else if machine == "pyramid" {
            pose[3..5].copy_from_slice(&[3.0, -4.0]);
        }
        compare(&config, &model, &Pose::from_degrees(pose), &config.spindle, screw);
    }
}

#[test]
fn with_constraints_the_matrices_are_the_differences_of_the_simulation() {
    for config in constrained() {
        for screw in ["backdrivable", "self-locking"] {
            let (pose, tool) = inside(&config);
            compare(&config, &heavy(&config, true, screw), &pose, &tool, screw);
        }
    }
}

/// Returns a pose between the limits of a machine's axes, and a tool vector across and along its axis.
fn inside(config: &Mechanism) -> (Pose, Vector3<f64>) {
    let pose = axis_box::range(config).at([0.65, 0.4, 0.55, 0.6, 0.35, 0.45]);
    (Pose::from_degrees(pose), config.spindle + Vector3::new(12.0, -7.0, 80.0))
}

/// Compares the matrices at a pose with differences of a simulation's accelerations.
fn compare(config: &Mechanism, model: &Model, pose: &Pose, tool: &Vector3<f64>, screw: &str) {
    let machine = config.file.display();
    let structure = Structure::at(config, model, pose, tool).unwrap();
    let at = config.machine.at(pose, tool).unwrap();
    let chart = Chart::of(config, &at, tool);
    let count = chart.count();
    let block = |matrix: &DMatrix<f64>| matrix.view((0, 0), (count, count)).into_owned();
    let mass = block(&structure.mass).cholesky().unwrap();
    let mut simulation = Simulation::new(config, model, pose, tool).unwrap().unwrap();
    let drives = simulation.drives(pose, tool).unwrap();
    let body = model.body.centre;
    let tip = -tool / config.units_per_mm;
    for (matrix, is_speed) in [(&structure.stiffness, false), (&structure.damping, true)] {
        let expected = -mass.solve(&block(matrix));
        for k in 0..count {
            let step = if chart.is_angle(k) { 1e-5 } else { 1e-2 };
            let mut side = |by: f64| {
                let (place, speed) = if is_speed { (0.0, 1e2 * by) } else { (by, 0.0) };
                let moved = chart.moved(pose, k, place, &tip, config.units_per_mm);
                let moved_at = simulation.drives(&moved, tool).unwrap();
                let mut motion = simulation.resting(&moved, &moved_at).unwrap();
                motion.velocity = chart.displacement(&body).column(k) * speed;
                motion.spin = motion.rotation.tr_mul(&(chart.turns().column(k) * speed));
                let here = Chart::of(config, &config.machine.at(&moved, tool).unwrap(), tool);
                accelerations(&mut simulation, &here, &motion, &drives, &body)
            };
            let width = if is_speed { 2e2 * step } else { 2.0 * step };
            let found = (side(step) - side(-step)) / width;
            let off = (&found - expected.column(k)).amax();
            // Third derivatives times the squared step, and rounding of lengths divided by the step.
            let size = expected.column(k).amax();
            assert!(off < 1e-6 * size, "{machine} {screw} {k} {is_speed} {off} {size}");
        }
    }
}

/// Simulates a machine for some time without forces; returns its initial energy, and the final one plus the losses in
/// the dampers.
fn left_alone(legs: &str, seconds: f64, step: f64) -> [f64; 2] {
    let config = config("hexapod");
    let model = model(&config, GENERAL, legs);
    let pose = with_tool(POSE_4, &TOOL);
    let mut simulation = Simulation::new(&config, &model, &pose, &TOOL).unwrap().unwrap();
    let drives = simulation.drives(&pose, &TOOL).unwrap();
    let mut motion = simulation.resting(&pose, &drives).unwrap();
    // An amplitude of some millimeters, far beyond the linear range.
    motion.velocity = Vector3::new(300.0, -500.0, 400.0);
    motion.spin = Vector3::new(1.0, -2.0, 3.0);
    energies(&mut simulation, &drives, motion, seconds, step)
}

/// Simulates a motion with the drives at rest; returns its initial energy, and the final one plus the losses.
fn energies(
    simulation: &mut Simulation,
    drives: &Drives,
    mut motion: Motion,
    seconds: f64,
    step: f64,
) -> [f64; 2] {
    let start = simulation.energy(&motion, drives).unwrap();
    let still = Drives::default();
    let mut lost = 0.0;
    for _ in 0..(seconds / step / 2.0) as usize {
        // Simpson's rule over two steps.
        let mut part = simulation.loss(&motion, drives).unwrap();
        for weight in [4.0, 1.0] {
            motion = motion
                .after(step, |motion, _| {
                    simulation.rates(motion, [drives, &still], &Vector3::zeros())
                })
                .unwrap();
            part += weight * simulation.loss(&motion, drives).unwrap();
        }
        lost += part * step / 3.0;
    }
    [start, simulation.energy(&motion, drives).unwrap() + lost]
}

/// Returns a motion of a machine along its constraints: the commanded coordinates change at 300 mm/s and 1 rad/s.
fn along_constraints(
    simulation: &Simulation,
    model: &Model,
    chart: &Chart,
    (pose, drives): (&Pose, &Drives),
) -> Motion {
    let signs = [1.0, -0.8, 0.6, -0.9, 0.7, 0.5];
    let rates = DVector::from_fn(chart.count(), |k, _| {
        signs[k] * if chart.is_angle(k) { 1.0 } else { 300.0 }
    });
    let mut motion = simulation.resting(pose, drives).unwrap();
    motion.velocity = chart.displacement(&model.body.centre) * &rates;
    motion.spin = motion.rotation.tr_mul(&(chart.turns() * rates));
    motion
}

#[test]
fn reactions_of_constraints_do_no_work() {
    for config in constrained() {
        let (pose, tool) = inside(&config);
        for screw in ["backdrivable", "self-locking"] {
            let mut model = heavy(&config, false, screw);
            // Energies do not count the table, which does not move here.
            model.table.iter_mut().for_each(|axis| axis.damping = 0.0);
            let mut simulation = Simulation::new(&config, &model, &pose, &tool).unwrap().unwrap();
            let drives = simulation.drives(&pose, &tool).unwrap();
            let chart = Chart::of(&config, &config.machine.at(&pose, &tool).unwrap(), &tool);
            let motion = along_constraints(&simulation, &model, &chart, (&pose, &drives));
            let size = model.body.mass * motion.velocity.norm_squared() / 2.0;
            let [start, end] = energies(&mut simulation, &drives, motion, 0.1, 2e-5);
            // As for machines without constraints, below.
            assert!((start - end).abs() < 1e-7 * size, "{}: {start} {end}", config.file.display());
        }
    }
}

#[test]
fn drives_of_a_moving_platform_with_constraints_bear_its_inertia() {
    for config in constrained() {
        let (pose, tool) = inside(&config);
        let (mut model, force) =
            (heavy(&config, false, "backdrivable"), Vector3::new(40.0, -70.0, 90.0));
        // The simulation also has the forces by which legs with mass rotate.
        model.legs.iter_mut().for_each(|leg| (leg.axial, leg.across) = (0.0, 0.0));
        let mut simulation = Simulation::new(&config, &model, &pose, &tool).unwrap().unwrap();
        let drives = simulation.drives(&pose, &tool).unwrap();
        let chart = Chart::of(&config, &config.machine.at(&pose, &tool).unwrap(), &tool);
        let motion = along_constraints(&simulation, &model, &chart, (&pose, &drives));
        let found = simulation.rates(&motion, [&drives, &Drives::default()], &force).unwrap();
        // The same motion as rates of X Y Z A B C of the tip, also of those that follow.
        let omega = motion.rotation * motion.spin;
        let turning = motion.rotation * found.spin;
        let lever = motion.rotation * (-tool - model.body.centre);
        let velocity = motion.velocity + omega.cross(&lever);
        let linear = found.place + turning.cross(&lever) + omega.cross(&omega.cross(&lever));
        let full = config.machine.full_pose(&pose, &tool).unwrap();
        let map = rate_map(&full).try_inverse().unwrap();
        let whole = chart.whole();
        let angular = map * (turning - whole.turning(&whole.rates(&velocity, &omega)));
        let six = |a: Vector3<f64>, b: Vector3<f64>| [a.x, a.y, a.z, b.x, b.y, b.z];
        let moving = Moving {
            rate: six(velocity, map * omega),
            acceleration: six(linear, angular),
            ..Moving::still(pose, tool)
        };
        let wrench = Wrench { force, ..Wrench::default() };
        let loads = loads(&config, &model, &moving, &wrench).unwrap().unwrap();
        close(&loads.legs, &simulation.forces, 1e-9);
    }
}

#[test]
fn energy_falls_by_the_work_of_the_dampers_whoever_takes_the_torque_of_the_thread() {
    // Kinetic energy at the start, as reference for the error.
    let size = 0.025 * (300.0_f64.powi(2) + 500.0_f64.powi(2) + 400.0_f64.powi(2)) / 2.0;
    for screw in ["self-locking", "backdrivable"] {
        for damping in [0.8, 4.0, 1e-9] {
            let legs = format!(
                "stiffness_n_per_um = 10\ndamping_n_s_per_mm = {damping}\nscrew = \"{screw}\"\n"
            );
            let [start, end] = left_alone(&legs, 0.1, 2e-5);
            // Fourth order: (ω h)⁴ at 250 Hz, and rounding of lengths times the weight.
            assert!((start - end).abs() < 1e-7 * size, "{screw} {damping}: {start} {end}");
            // Struts that rotate: the forces of their rotation do the work that changes their energy.
            let [start, end] =
                left_alone(&format!("{legs}axial_mass_kg = 3\nacross_mass_kg = 4\n"), 0.1, 2e-5);
            assert!((start - end).abs() < 1e-7 * size, "{screw} {damping}: {start} {end}");
        }
    }
}

/// Returns the kinetic energy of a strut as point masses: those of its housing at fixed distances from the base joint,
/// and others at fixed distances behind the platform joint.
fn of_points(
    housing: &[[f64; 2]],
    moved: &[[f64; 2]],
    span: &Vector3<f64>,
    rate: &Vector3<f64>,
) -> f64 {
    let length = span.norm();
    let along = span / length;
    let longer = along.dot(rate);
    let turning = (rate - along * longer) / length;
    let fixed = housing.iter().map(|[mass, at]| mass * (turning * *at).norm_squared());
    let others = moved
        .iter()
        .map(|[mass, behind]| mass * (along * longer + turning * (length - behind)).norm_squared());
    fixed.chain(others).sum::<f64>() / 2.0
}

#[test]
fn a_strut_of_point_masses_asks_the_forces_of_lagrange() {
    // A housing and a spindle with its nut at the platform joint; and a mass 200 mm behind it without a housing.
    let rod: Vec<[f64; 2]> = (0..50).map(|k| [2e-5, 8.0 * f64::from(k)]).collect();
    for (housing, moved) in [(&rod[..], &[[0.002, 0.0]][..]), (&[][..], &[[0.003, 200.0]][..])] {
        let span = Vector3::new(300.0, -200.0, 700.0);
        let rate = Vector3::new(400.0, 900.0, -300.0);
        let change = Vector3::new(-700.0, 200.0, 500.0);
        let length = span.norm();
        let axial: f64 = moved.iter().map(|[mass, _]| mass).sum();
        let turned: f64 = housing.iter().map(|[mass, at]| mass * at * at).sum::<f64>()
            + moved.iter().map(|[mass, at]| mass * (length - *at) * (length - *at)).sum::<f64>();
        let strut = StrutMass::new(axial, turned / (length * length), length);
        // Later, when it is longer and has turned.
        for seconds in [0.0, 0.2, -0.3] {
            let state = |time: f64| {
                let place = span + rate * time + change * (time * time / 2.0);
                (place, rate + change * time)
            };
            let energy =
                |span: &Vector3<f64>, rate: &Vector3<f64>| of_points(housing, moved, span, rate);
            let slope = |of: &dyn Fn(&Vector3<f64>) -> f64, step: f64| {
                Vector3::from_fn(|k, _| {
                    let mut by = Vector3::zeros();
                    by[k] = step;
                    (of(&by) - of(&-by)) / (2.0 * step)
                })
            };
            let momentum = |time: f64| {
                let (span, rate) = state(time);
                slope(&|by| energy(&span, &(rate + by)), 1.0)
            };
            let (span, rate) = state(seconds);
            let step = 1e-5;
            let force = (momentum(seconds + step) - momentum(seconds - step)) / (2.0 * step)
                - slope(&|by| energy(&(span + by), &rate), 1e-2);
            let found = strut.matrix(&span) * change + strut.rotation(&span, &rate);
            // Differences: rounding of 1e-16 over steps of 1e-5 of the values, and truncation of their squares.
            assert!((found - force).norm() < 1e-6 * force.norm(), "{found} {force}");
            // The rotation matters, unless the strut happens not to change its length.
            assert!(seconds != 0.0 || strut.rotation(&span, &rate).norm() > 0.01 * force.norm());
            let own = strut.energy(&span, &rate);
            close(&[own], &[energy(&span, &rate)], 1e-12);
        }
    }
}

#[test]
fn half_the_step_that_is_taken_changes_little_of_a_motion() {
    let config = config("hexapod");
    let model = model(&config, GENERAL, STRUTS);
    let pose = with_tool(POSE_4, &TOOL);
    let structure = Structure::at(&config, &model, &pose, &TOOL).unwrap();
    let step = Times::of(&structure, 0.0).unwrap().step;
    let fastest = structure.shapes().unwrap().omegas[5] / TAU;
    close(&[step * fastest], &[1.0 / 40.0], 1e-12);
    let end = |step: f64, steps: usize| {
        let mut simulation = Simulation::new(&config, &model, &pose, &TOOL).unwrap().unwrap();
        let drives = simulation.drives(&pose, &TOOL).unwrap();
        let mut motion = simulation.resting(&pose, &drives).unwrap();
        motion.velocity = Vector3::new(20.0, -30.0, 10.0);
        motion.spin = Vector3::new(0.1, 0.2, -0.1);
        let still = Drives::default();
        for _ in 0..steps {
            let rates = |motion: &Motion, _: f64| {
                simulation.rates(motion, [&drives, &still], &Vector3::zeros())
            };
            motion = motion.after(step, rates).unwrap();
        }
        simulation.tip(&motion) - drives.tip
    };
    // Ten periods of the fastest mode: an error of (2π/40)⁴/120 of a turn in each.
    let (whole, half) = (end(step, 400), end(step / 2.0, 800));
    assert!((whole - half).norm() < 1e-3 * half.norm(), "{whole} {half}");
}

#[test]
fn a_random_force_shakes_the_tip_and_loads_the_struts_as_in_an_independent_calculation() {
    let golden = &GOLDEN;
    for (platform, pose, rms, legs, held, spread, density) in [
        (
            SYMMETRIC,
            HOME,
            golden.a_home_sym_tip_rms_um,
            &golden.a_home_sym_strut_force_rms_n,
            golden.a_home_sym_tip_rms_um_held_0p1ms,
            golden.a_home_sym_relative_sd_of_variance_10s,
            golden.a_home_sym_psd_x_50hz_mm2_per_hz,
        ),
        (
            GENERAL,
            POSE_4,
            golden.a_pose4_gen_tip_rms_um,
            &golden.a_pose4_gen_strut_force_rms_n,
            golden.a_pose4_gen_tip_rms_um_held_0p1ms,
            golden.a_pose4_gen_relative_sd_of_variance_10s,
            golden.a_pose4_gen_psd_x_50hz_mm2_per_hz,
        ),
    ] {
        let structure = hexapod(platform, STRUTS, pose);
        let linear = Linear::of(&structure, &[1e4; 6], &sigma(), &corner()).unwrap();
        let linear = linear.with_dampers(&structure, &[0.8; 6]).unwrap();
        let covariance = linear.covariance().unwrap();
        let root = |tip: Matrix3<f64>| -> Vec<f64> {
            tip.diagonal().iter().map(|variance| 1e3 * variance.sqrt()).collect()
        };
        // Two computations in double precision with matrices whose condition number is 1e6.
        close(&root(linear.of_tip(&covariance)), &rms, 1e-8);
        close(&linear.of_legs(&covariance), legs, 1e-8);
        close(&root(linear.of_tip(&linear.held(1e-4).unwrap())), &held, 1e-8);
        let found: Vec<f64> =
            (0..3).map(|axis| linear.spread(&covariance, axis, 10.0).unwrap()).collect();
        close(&found, &spread, 1e-7);
        let found = structure.spectrum(&sigma(), &corner(), 50.0).unwrap()[(0, 0)];
        close(&[found], &[density], 1e-9);
    }
}

#[test]
fn the_covariance_has_the_ellipse_of_the_figures() {
    let structure = hexapod(GENERAL, STRUTS, POSE_4);
    let linear = Linear::of(&structure, &[1e4; 6], &sigma(), &corner()).unwrap();
    let tip = linear.of_tip(&linear.covariance().unwrap());
    let expected = Matrix3::from(GOLDEN.a_pose4_gen_tip_covariance_mm2);
    assert!((tip - expected).amax() < 1e-8 * expected.amax(), "{tip} {expected}");
    let [long, short, direction] = GOLDEN.a_pose4_gen_ellipse_um_um_deg;
    let found = Ellipse::of(&(tip * 1e6));
    close(&found.axes, &[long, short], 1e-8);
    close(&[found.direction], &[direction], 1e-8);
    // The scatter of the symmetric platform is isotropic: a circle has no direction.
    let structure = hexapod(SYMMETRIC, STRUTS, HOME);
    let linear = Linear::of(&structure, &[1e4; 6], &sigma(), &corner()).unwrap();
    let tip = linear.of_tip(&linear.covariance().unwrap());
    let expected = Matrix3::from(GOLDEN.a_home_sym_tip_covariance_mm2);
    assert!((tip - expected).amax() < 1e-8 * expected.amax(), "{tip} {expected}");
    let [long, short, _] = GOLDEN.a_home_sym_ellipse_um_um_deg;
    close(&Ellipse::of(&(tip * 1e6)).axes, &[long, short], 1e-8);
}

#[test]
fn the_long_axis_of_the_trace_depends_on_the_corner_of_an_isotropic_force() {
    let structure = hexapod(GENERAL, STRUTS, POSE_4);
    let softest = structure.receptance(0.0).unwrap().map(|h| h.re);
    close(&[Ellipse::of(&softest).direction], &[GOLDEN.a_pose4_softest_direction_deg], 1e-8);
    for [corner, direction, ratio] in &GOLDEN.a_pose4_isotropic_corner_hz_long_axis_deg_ratio {
        let (sigma, spectrum) = (Vector3::repeat(30.0), Spectrum::Corner { corner: *corner });
        let linear = Linear::of(&structure, &[1e4; 6], &sigma, &spectrum).unwrap();
        let found = Ellipse::of(&linear.of_tip(&linear.covariance().unwrap()));
        // The direction of an almost circular ellipse loses a digit.
        close(&[found.direction, found.axes[0] / found.axes[1]], &[*direction, *ratio], 1e-7);
    }
}

/// Returns a structure of one mass that moves along X.
fn one_mass(mass: f64, damping: f64, stiffness: f64) -> Structure {
    let single = |value| DMatrix::from_element(1, 1, value);
    let mut tip = Matrix6xX::zeros(1);
    tip[(0, 0)] = 1.0;
    Structure {
        mass: single(mass),
        damping: single(damping),
        stiffness: single(stiffness),
        tip,
        elongation: single(1.0),
        bearing: vec![0.0],
    }
}

#[test]
fn one_mass_under_a_random_force_has_the_closed_variance() {
    let [mass, damping, stiffness, corner, force, rms] = GOLDEN.one_mass_m_c_k_corner_sigma_rms_um;
    let structure = one_mass(mass, damping, stiffness);
    let sigma = Vector3::new(force, 0.0, 0.0);
    let linear =
        Linear::of(&structure, &[stiffness], &sigma, &Spectrum::Corner { corner }).unwrap();
    // A zero force along Y and Z leaves variances of 0.
    let tip = linear.of_tip(&linear.covariance().unwrap());
    close(&[1e3 * tip[(0, 0)].sqrt()], &[rms], 1e-10);
    let a = TAU * corner;
    let closed = force * force * (damping + mass * a)
        / (stiffness * damping * (mass * a * a + damping * a + stiffness));
    close(&[tip[(0, 0)]], &[closed], 1e-10);
}

/// Integrates the one-sided spectrum of the tip: the trapezoidal rule in u with f = s sinh u, which for an
/// integrand without poles nearer to the real line than a damping ratio has an error of e^(-2π ζ/h).
fn integrated(structure: &Structure, spectrum: &Spectrum) -> Matrix3<f64> {
    let (scale, h) = (50.0, 0.003);
    let mut sum = Matrix3::zeros();
    for k in 0..5000 {
        let u = h * f64::from(k);
        let density = structure.spectrum(&sigma(), spectrum, scale * u.sinh()).unwrap();
        sum += density * (scale * u.cosh() * h * if k == 0 { 0.5 } else { 1.0 });
    }
    sum
}

#[test]
fn the_covariance_is_the_integral_of_the_spectrum_for_both_kinds_of_force() {
    for spectrum in [corner(), Spectrum::Band { middle: 60.0, quality: 8.0 }] {
        let structure = hexapod(GENERAL, STRUTS, POSE_4);
        let linear = Linear::of(&structure, &[1e4; 6], &sigma(), &spectrum).unwrap();
        let found = linear.of_tip(&linear.covariance().unwrap());
        let expected = integrated(&structure, &spectrum);
        let off = (found - expected).amax();
        assert!(off < 1e-8 * expected.amax(), "{spectrum:?} {found} {expected}");
    }
}

#[test]
fn a_sampled_force_has_its_variance_and_decays_as_it_should() {
    let step = 5e-5;
    let count = cases(200_000);
    let [decay, gain] = GOLDEN.ou_step_50us_decay_gain;
    close(&[decay * decay + gain * gain], &[1.0], 1e-12);
    for spectrum in [corner(), Spectrum::Band { middle: 400.0, quality: 2.0 }] {
        let mut noise = Noise::new(sigma(), &spectrum, step, 5);
        let (mut sum, mut next) = (Vector3::zeros(), Vector3::<f64>::zeros());
        let mut last = noise.force();
        for _ in 0..count {
            noise.step();
            let now = noise.force();
            sum += now.component_mul(&now);
            next += now.component_mul(&last);
            last = now;
        }
        let variance = sigma().component_mul(&sigma()) * count as f64;
        // Number of independent values in the record: one per decay time, 1/(2π 150 Hz); four standard deviations.
        let slack = 4.0 * (2.0 / (count as f64 * step * 2.0 * PI * 75.0)).sqrt();
        for k in 0..3 {
            assert!((sum[k] / variance[k] - 1.0).abs() < slack, "{spectrum:?} {k}");
        }
        if spectrum == corner() {
            close(&[next.x / sum.x], &[decay], 0.003);
        }
    }
}

#[test]
fn many_runs_of_the_simulation_scatter_as_the_linear_theory_says() {
    let config = config("hexapod");
    let legs = STRUTS.replace("0.8", "4");
    let model = model(&config, &format!("{GENERAL}geometric_stiffness = true\n"), &legs);
    let pose = with_tool(POSE_4, &TOOL);
    let structure = Structure::at(&config, &model, &pose, &TOOL).unwrap();
    let linear = Linear::of(&structure, &[1e4; 6], &sigma(), &corner()).unwrap();
    let covariance = linear.covariance().unwrap();
    let (step, seconds, runs) = (2e-4, 0.25, cases(200));
    let times = Times { step, warm_up: Times::of(&structure, 0.0).unwrap().warm_up };
    let mut all = Record::default();
    for seed in 0..runs {
        let noise = Noise::new(sigma(), &corner(), step, seed as u64);
        let force = Force::Noise(noise);
        let record =
            standing(&config, &model, (&pose, &TOOL), force, (&times, seconds), |_| ()).unwrap();
        all.tip.extend(record.tip);
    }
    let found = all.covariance();
    let expected = linear.of_tip(&linear.held(step).unwrap());
    for axis in 0..3 {
        let spread = linear.spread(&covariance, axis, seconds * runs as f64).unwrap();
        let off = found[(axis, axis)] / expected[(axis, axis)] - 1.0;
        // Four standard deviations, and nonlinear effects.
        assert!(off.abs() < 4.0 * spread + 0.005, "{axis} {off} {spread}");
    }
}

#[test]
fn a_record_shows_the_spectrum_of_what_it_recorded() {
    // A 3 um tone at 40 Hz in a record of 4 s, and a 1 um tone at 90 Hz along Y.
    let step = 1e-3;
    let tone = |k: i32| {
        let time = f64::from(k) * step;
        Vector3::new(3.0 * (TAU * 40.0 * time).sin(), (TAU * 90.0 * time).cos(), 0.0)
    };
    let record = Record { step, tip: (0..4000).map(tone).collect(), ..Record::default() };
    let near = |hz: f64| (0..200).map(|k| hz - 10.0 + 0.1 * f64::from(k)).collect::<Vec<_>>();
    let power = |hz: f64, axis: usize| -> f64 {
        record.spectrum(&near(hz)).iter().map(|density| density[axis] * 0.1).sum()
    };
    // The window's side lobes beyond 10 Hz.
    close(&[power(40.0, 0), power(90.0, 1)], &[4.5, 0.5], 1e-3);
    assert!(power(40.0, 1) < 1e-6 && power(90.0, 2) == 0.0);
    // The crest lies between samples, of which there are 25 and 11 per period.
    close(record.peaks().as_slice(), &[3.0, 1.0, 0.0], 0.01);
}

fn cutter(arc: [f64; 2], lag: f64) -> Milling {
    let [teeth, _, depth, feed] = GOLDEN.milling;
    Milling {
        teeth: teeth as u16,
        speed: 125.0,
        feed,
        depth,
        arc,
        cutting: GOLDEN.milling_cutting,
        edge: GOLDEN.milling_edge,
        lag,
    }
}

/// Computes ∫ force e^(-i k N φ) dφ over the arc of one tooth, as amplitude of the harmonic; by Simpson's rule.
fn harmonic(cutter: &Milling, k: u32) -> [f64; 3] {
    let one = Milling { teeth: 1, ..*cutter };
    let (count, [entry, exit]) = (20_000, cutter.arc);
    let width = (exit - entry) / f64::from(count);
    let (mut cos, mut sin) = (Vector3::zeros(), Vector3::zeros());
    for n in 0..=count {
        let angle = (entry + width * f64::from(n)).clamp(entry, exit);
        let weight = if n == 0 || n == count { 1.0 } else { f64::from(2 + 2 * (n % 2)) };
        let force = one.force(angle) * (weight * width / 3.0);
        let phase = f64::from(k * u32::from(cutter.teeth)) * angle;
        (cos, sin) = (cos + force * phase.cos(), sin + force * phase.sin());
    }
    let share = f64::from(cutter.teeth) / TAU * if k == 0 { 1.0 } else { 2.0 };
    std::array::from_fn(|axis| match k {
        0 => cos[axis] * share,
        _ => cos[axis].hypot(sin[axis]) * share,
    })
}

#[test]
fn a_milling_force_has_the_closed_mean_and_harmonics() {
    let golden = &GOLDEN;
    let tenth = (2.0_f64 * 0.1 - 1.0).acos();
    for (arc, harmonics) in [
        (
            [0.0, PI],
            [
                golden.milling_slot_mean_n,
                golden.milling_slot_harmonic_1_amplitude_n,
                golden.milling_slot_harmonic_2_amplitude_n,
            ],
        ),
        (
            [PI / 2.0, PI],
            [
                golden.milling_half_down_mean_n,
                golden.milling_half_down_harmonic_1_amplitude_n,
                golden.milling_half_down_harmonic_2_amplitude_n,
            ],
        ),
        (
            [tenth, PI],
            [
                golden.milling_tenth_down_mean_n,
                golden.milling_tenth_down_harmonic_1_amplitude_n,
                golden.milling_tenth_down_harmonic_2_amplitude_n,
            ],
        ),
    ] {
        let cutter = cutter(arc, 0.0);
        for (k, expected) in (0..).zip(harmonics) {
            close(&harmonic(&cutter, k), &expected, 1e-9);
        }
        close(&[cutter.tooth_frequency()], &[golden.milling_tooth_hz], 1e-12);
        // A helix delays the force of each slice, and does not change the mean.
        let helical = Milling { lag: 0.7, ..cutter };
        let count = 3600;
        let mean = |cutter: &Milling| -> Vector3<f64> {
            let all = (0..count).map(|k| cutter.force(TAU * f64::from(k) / f64::from(count)));
            all.sum::<Vector3<f64>>() / f64::from(count)
        };
        // The corners of the arc lie between sample angles, a tenth of a degree apart.
        let off = (mean(&helical) - mean(&cutter)).norm();
        assert!(off < 0.01 * mean(&cutter).norm(), "{off}");
    }
}

/// Returns the cutter of the golden values, with edge forces or without, in a block from X0 Y-10 to X20 Y10, 1 mm deep
/// at Z0.
fn layer(teeth: u16, edge: bool, helix: f64, step: f64) -> Layer {
    let [_, diameter, _, feed] = GOLDEN.milling;
    let ([kt, kr, ka], [kte, kre, kae]) = (GOLDEN.milling_cutting, GOLDEN.milling_edge);
    let mut text = format!(
        "[cutting]\nteeth = {teeth}\nentry_deg = 0\nexit_deg = 180\nkt_n_per_mm2 = {kt}\nkr_n_per_mm2 = {kr}\n\
         ka_n_per_mm2 = {ka}\n[milling]\nspeed_rpm = 7500\nfeed_mm = {feed}\ndiameter_mm = {diameter}\n\
         helix_deg = {helix}\nseconds = 1\n[stock]\nlow_mm = [0, -10]\nhigh_mm = [20, 10]\ntop_mm = 1\ncell_mm = 0.05\n"
    );
    if edge {
        let keys =
            format!("kte_n_per_mm = {kte}\nkre_n_per_mm = {kre}\nkae_n_per_mm = {kae}\n[stock]");
        text = text.replace("[stock]", &keys);
    }
    let study = Study::parse(&text).unwrap();
    let (cutting, milling) = (study.cutting.unwrap(), study.milling.unwrap());
    Layer::new(&cutting, &milling, &study.stock.unwrap(), step).unwrap()
}

/// Seconds per step: 200 in a tooth period of two teeth.
const LAYER_STEP: f64 = 2e-5;

/// Moves a cutter along a line at 10 mm/s; returns the mean force over the last `turns` turns.
fn cut(layer: &mut Layer, from: [f64; 3], to: [f64; 3], turns: usize) -> Vector3<f64> {
    let (from, to) = (Vector3::from(from), Vector3::from(to));
    let steps = ((to - from).norm() / 10.0 / LAYER_STEP).round() as usize;
    let last = turns * 400;
    let mut mean = Vector3::zeros();
    for k in 0..steps {
        let tip = from + (to - from) * (k as f64 / steps as f64);
        let force = layer.force(k as f64 * LAYER_STEP, &tip);
        if k >= steps - last {
            mean += force / last as f64;
        }
    }
    mean
}

#[test]
fn a_layer_has_the_mean_force_of_the_arc_that_it_fills() {
    // 10 mm/s at 7500/min and two teeth are 0.04 mm per tooth.
    let near = |found: Vector3<f64>, expected: [f64; 3], share: f64| {
        let expected = Vector3::from(expected);
        assert!((found - expected).norm() < share * expected.norm(), "{found} {expected}");
    };
    for helix in [0.0, 30.0] {
        let mut slot = layer(2, true, helix, LAYER_STEP);
        assert_eq!(cut(&mut slot, [-5.0, 0.0, 0.0], [-3.0, 0.0, 0.0], 5), Vector3::zeros());
        // A tooth enters and leaves at one of 200 steps, or within 0.75 of a cell of 0.05 mm beyond 2.5 mm.
        near(
            cut(&mut slot, [-3.0, 0.0, 0.0], [6.0, 0.0, 0.0], 20),
            GOLDEN.milling_slot_mean_n,
            0.01,
        );
    }
    // Back along a lane beside the slot, a radius away: the wall is on the side where a tooth leaves. The force is that of
    // half immersion, down milling, turned by half a turn.
    let mut slot = layer(2, true, 0.0, LAYER_STEP);
    cut(&mut slot, [-3.0, 0.0, 0.0], [23.0, 0.0, 0.0], 1);
    let back = cut(&mut slot, [23.0, 2.5, 0.0], [10.0, 2.5, 0.0], 20);
    let [x, y, z] = GOLDEN.milling_half_down_mean_n;
    let back = Vector3::new(-back.x, -back.y, back.z);
    // The wall of the slot is a cell too near or too far: 0.05/2.5 of the arc.
    near(back, [x, y, z], 0.05);
    // The same lane again finds no layer, and a level below a layer of twice the depth.
    assert_eq!(cut(&mut slot, [23.0, 2.5, 0.0], [12.0, 2.5, 0.0], 20), Vector3::zeros());
    let mut deep = layer(2, true, 0.0, LAYER_STEP);
    let twice = cut(&mut deep, [-3.0, 0.0, -1.0], [6.0, 0.0, -1.0], 20);
    near(twice / 2.0, GOLDEN.milling_slot_mean_n, 0.01);
}

#[test]
fn the_work_of_a_tooth_is_its_coefficient_times_the_volume_it_removes() {
    // One tooth without edge forces: its tangential force times its path is the energy per volume, K_t. Diagonally over a
    // corner of the block, where the arc changes all the time.
    let mut own = layer(1, false, 0.0, LAYER_STEP);
    let before = own.stock.volume(0.0);
    let (from, to) = (Vector3::new(-4.0, -13.0, 0.3), Vector3::new(14.0, -2.0, 0.3));
    let steps = ((to - from).norm() / 10.0 / LAYER_STEP) as usize;
    let mut work = 0.0;
    for k in 0..steps {
        let time = k as f64 * LAYER_STEP;
        let force = own.force(time, &(from + (to - from) * (k as f64 / steps as f64)));
        let (sin, cos) = (TAU * 125.0 * time).sin_cos();
        // The tooth moves along (cos, -sin); the force on the tool opposes it.
        work -= (force.x * cos - force.y * sin) * TAU * 125.0 * 2.5 * LAYER_STEP;
    }
    let removed = before - own.stock.volume(0.0);
    close(&[own.stock.removed()], &[removed], 1e-9);
    // The block is 20 x 20 x 1 mm, of which 0.7 mm are cut.
    assert!(removed > 30.0, "{removed}");
    // The wall is up to a cell off, of 0.05 mm in a cut 2.5 to 5 mm wide; a path of 12 um per step.
    close(&[work / GOLDEN.milling_cutting[0]], &[removed], 0.02);
}

#[test]
fn a_machine_that_moves_through_a_layer_yields_by_its_force() {
    let config = config("hexapod");
    let legs = STRUTS.replace("0.8", "4");
    let model = model(&config, &format!("{SYMMETRIC}geometric_stiffness = true\n"), &legs);
    let pose = with_tool(HOME, &TOOL);
    let structure = Structure::at(&config, &model, &pose, &TOOL).unwrap();
    let tip = Vector3::from_column_slice(&HOME[..3]) - TOOL;
    let at = |x: f64| {
        let mut place = pose;
        place.position.x += x;
        place
    };
    let mut own = layer(2, true, 0.0, config.period / 50.0);
    own.stock = Stock::from(&studies::study::forcing::Stock {
        low_mm: [tip.x - 1.0, tip.y - 5.0],
        high_mm: [tip.x + 10.0, tip.y + 5.0],
        top_mm: tip.z + 1.0,
        cell_mm: 0.05,
    });
    let mut follower =
        Follower::new(&config, &model, Force::Layer(Box::new(own.clone())), config.period / 50.0);
    assert_eq!(follower.steps(), 50);
    let cycles = (0.6 / config.period) as usize;
    for k in 0..cycles {
        // From 4 mm before the block, 2 mm into it.
        follower.see(&at(-4.0 + 10.0 * config.period * k as f64), &TOOL).unwrap();
    }
    let record = follower.finish().unwrap();
    // The last 40 tooth periods of 4 ms. A record has one moment per servo cycle, of which 4 make a period: enough for the
    // mean, in which harmonics of the fourth order and more (5 %) appear as well.
    let last = &record.tip[record.tip.len() - 162..record.tip.len() - 2];
    let mean = last.iter().sum::<Vector3<f64>>() / last.len() as f64;
    let still = structure.receptance(0.0).unwrap().map(|h| h.re);
    let expected = still * Vector3::from(GOLDEN.milling_slot_mean_n);
    assert!((mean - expected).norm() < 0.1 * expected.norm(), "{mean} {expected}");
    // Inclined by two degrees.
    let mut inclined = Follower::new(&config, &model, Force::Layer(Box::new(own)), config.period);
    let mut place = pose;
    place.angles.x += 2.0_f64.to_radians();
    let ended = (0..4).find_map(|_| inclined.see(&place, &TOOL).err());
    assert!(
        matches!(ended, Some(Ended::Inclined(angle)) if (angle - 2.0).abs() < 0.01),
        "{ended:?}"
    );
}

#[test]
fn a_stock_that_is_none_is_refused() {
    let text = "[stock]\nlow_mm = [0, -10]\nhigh_mm = [20, 10]\ntop_mm = 1\ncell_mm = 0.05\n";
    assert!(Study::parse(text).is_ok());
    for (from, to, words) in [
        ("high_mm = [20, 10]", "high_mm = [20, -10]", "low_mm = -10, high_mm = -10: expected"),
        ("cell_mm = 0.05", "cell_mm = 0.001", "400000000 cells: expected at most 25000000"),
        ("cell_mm = 0.05", "cell_mm = 0", "0: expected more than 0"),
        ("top_mm = 1", "top_mm = inf", "finite height"),
    ] {
        let message = Study::parse(&text.replace(from, to)).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
    let study = Study::parse(&format!(
        "{}[cutting]\nteeth = 2\nentry_deg = 0\nexit_deg = 180\nkt_n_per_mm2 = 1\nkr_n_per_mm2 = 0\n[milling]\n\
         speed_rpm = 1\nfeed_mm = 1\ndiameter_mm = 5\nseconds = 1\n",
        text.replace("0.05", "0.3")
    ))
    .unwrap();
    let (cutting, milling) = (study.cutting.unwrap(), study.milling.unwrap());
    let message =
        Layer::new(&cutting, &milling, &study.stock.unwrap(), 1e-4).unwrap_err().to_string();
    assert!(
        message.contains("cell_mm = 0.3: expected at most") && message.contains("0.25 mm"),
        "{message}"
    );
}

#[test]
fn a_slow_force_along_one_axis_moves_the_tip_in_a_narrow_band() {
    // Figure 9 and conclusion 6 of paper 004, with the shipped study.
    let text =
        std::fs::read_to_string(test_support::shipped::root().join("configs/hexapod/band.toml"));
    let study = Study::parse(&text.unwrap()).unwrap();
    let config = config("hexapod");
    let model = Model::of(&config, &study).unwrap();
    let pose = Pose::from_degrees(POSE_4);
    let tool = Vector3::zeros();
    let structure = Structure::at(&config, &model, &pose, &tool).unwrap();
    let force = study.force.unwrap();
    assert_eq!([force.sigma_n[0], force.sigma_n[2]], [0.0; 2]);
    let stiffness = [1e4; 6];
    let linear =
        Linear::of(&structure, &stiffness, &force.sigma_n.into(), &force.band.into()).unwrap();
    let covariance = linear.covariance().unwrap();
    // A slow force displaces the tip by C f, and turns it.
    let matrix = between_anchors(&config, &pose);
    let mut load = nalgebra::Vector6::zeros();
    load[1] = force.sigma_n[1];
    let moved = matrix.lu().solve(&load).unwrap();
    let (place, turn) = (moved.fixed_rows::<3>(0), moved.fixed_rows::<3>(3));
    // The thread's torque contributes up to 0.4 %, and resonances at 45 times the frequency of the force 0.2 %.
    let near = |found: Matrix3<f64>, expected: Matrix3<f64>| {
        assert!((found - expected).norm() < 0.012 * expected.norm(), "{found} {expected}");
    };
    near(linear.of_tip(&covariance), place * place.transpose());
    near(linear.of_turns(&covariance), turn * turn.transpose());
    let ellipse = Ellipse::of(&linear.of_tip(&covariance));
    // Two standard deviations are 4 um; across, the band is a hundredth of that.
    close(&[2.0 * ellipse.axes[0]], &[4e-3], 0.01);
    assert!(ellipse.axes[1] < 0.01 * ellipse.axes[0], "{ellipse:?}");
}

#[test]
fn a_cut_shakes_the_tip_by_its_harmonics_times_the_receptance() {
    let config = config("hexapod");
    let legs = STRUTS.replace("0.8", "4");
    let model = model(&config, &format!("{SYMMETRIC}geometric_stiffness = true\n"), &legs);
    let pose = with_tool(HOME, &TOOL);
    let structure = Structure::at(&config, &model, &pose, &TOOL).unwrap();
    let cutter = cutter([0.0, PI], 0.0);
    let turn = 1.0 / cutter.tooth_frequency();
    let times = Times { warm_up: 0.6, ..Times::of(&structure, cutter.reach()).unwrap() };
    close(&[times.step], &[turn / 200.0], 1e-12);
    let force = Force::Milling(cutter, Matrix3::identity());
    let record =
        standing(&config, &model, (&pose, &TOOL), force, (&times, 10.0 * turn), |_| ()).unwrap();
    let mean = structure.receptance(0.0).unwrap().map(|h| h.re)
        * Vector3::from(GOLDEN.milling_slot_mean_n);
    // A tooth enters and leaves at one of 200 steps.
    assert!((record.mean() - mean).norm() < 0.005 * mean.norm(), "{} {mean}", record.mean());
}

#[test]
fn drives_bear_what_virtual_work_asks_of_them_on_every_machine() {
    let mut rng = Pcg64::seed_from_u64(3);
    for config in MACHINES.into_iter().map(config).chain(constrained()) {
        let machine = config.file.display();
        let model = heavy(&config, false, "backdrivable");
        let range = axis_box::range(&config);
        let tool = config.spindle;
        let wrench = Wrench {
            force: Vector3::new(120.0, -80.0, 200.0),
            moment: Vector3::new(1e3, -2e3, 3e3),
        };
        let mut compared = 0;
        for _ in 0..20 {
            let pose = Pose::from_degrees(range.at(std::array::from_fn(|_| rng.random())));
            let Ok(at) = config.machine.at(&pose, &tool) else { continue };
            let Some(found) = loads(&config, &model, &Moving::still(pose, tool), &wrench).unwrap()
            else {
                continue;
            };
            let chart = Chart::of(&config, &at, &tool);
            let tip = -tool / config.units_per_mm;
            for k in 0..chart.count() {
                let step = if chart.is_angle(k) { 1e-6 } else { 1e-3 };
                let joints = |by: f64| {
                    let moved = chart.moved(&pose, k, by, &tip, config.units_per_mm);
                    config.machine.inverse(&moved, &tool)
                };
                let (Ok(more), Ok(less)) = (joints(step), joints(-step)) else { continue };
                let unit = |i: usize| match config.groups()[0].unit {
                    "degrees" if i < config.legs() => 1.0_f64.to_radians(),
                    _ => 1.0 / config.units_per_mm,
                };
                let mut done: f64 = (0..config.legs())
                    .map(|i| found.drives[i] * (more[i] - less[i]) * unit(i) / (2.0 * step))
                    .sum();
                let weight = model.gravity * model.body.mass;
                done += weight.dot(&chart.displacement(&model.body.centre).column(k));
                done += wrench.force.dot(&chart.displacement(&tip).column(k));
                done += wrench.moment.dot(&chart.turns().column(k));
                // Finite differences of joint values: rounding of 1e-13 over the step.
                let size = 500.0 * if chart.is_angle(k) { 300.0 } else { 1.0 };
                assert!(done.abs() < 1e-5 * size, "{machine} {k} {done}");
            }
            compared += 1;
        }
        assert!(compared > 3, "{machine} {compared}");
    }
}

#[test]
fn four_rods_that_hold_three_coordinates_share_their_load_with_the_least_energy() {
    let (config, mut model) = shaken("pyramid", false, "backdrivable");
    assert!(config.machine.layout().is_redundant());
    let pose = Pose::from_degrees([10.0, -20.0, 250.0, 6.0, -4.0, 0.0]);
    let wrench =
        Wrench { force: Vector3::new(120.0, -80.0, 200.0), moment: Vector3::new(1e3, -2e3, 3e3) };
    for stiffness in [1e4, 3e4] {
        model.legs[0].spring = Spring::Whole(stiffness);
        let held = Held::at(&config, &model, &pose, &config.spindle).unwrap().unwrap();
        let found = held.loads(&Moving::still(pose, config.spindle), &wrench);
        let springs: Vec<f64> = held.springs().collect();
        // The motion of the carriages without the platform: the complement of the joint rates of all coordinates.
        let at = config.machine.at(&pose, &config.spindle).unwrap();
        let chart = Chart::of(&config, &at, &config.spindle);
        let tip = -config.spindle;
        let rates = DMatrix::from_fn(4, chart.count(), |i, k| {
            let step = if chart.is_angle(k) { 1e-6 } else { 1e-3 };
            let joint = |by: f64| {
                let moved = chart.moved(&pose, k, by, &tip, 1.0);
                config.machine.inverse(&moved, &config.spindle).unwrap()[i]
            };
            (joint(step) - joint(-step)) / (2.0 * step)
        });
        assert_eq!(rates.shape(), (4, 3));
        let apart = (&rates * rates.transpose()).symmetric_eigen();
        let free = apart.eigenvectors.column(apart.eigenvalues.imin());
        // Internal forces along it balance and do no work. Adding them must not lower the total energy:
        // Σ f n/k = 0.
        let parts: Vec<f64> = (0..4)
            .map(|i| {
                let gain = found.drives[i] / found.legs[i];
                found.legs[i] * free[i] / gain / springs[i]
            })
            .collect();
        let size = parts.iter().map(|part| part.abs()).fold(0.0, f64::max);
        let sum: f64 = parts.iter().sum();
        // Finite differences of joint values: rounding of 1e-13 over the step.
        assert!(size > 0.0 && sum.abs() < 1e-5 * size, "{sum} {parts:?}");
    }
}

#[test]
fn the_struts_of_a_symmetric_pose_share_weight_and_thrust() {
    let config = config("hexapod");
    let model = model(&config, SYMMETRIC, STRUTS);
    let pose = with_tool(HOME, &TOOL);
    let wrench = Wrench { force: Vector3::new(0.0, 0.0, 500.0), ..Wrench::default() };
    let found = loads(&config, &model, &Moving::still(pose, TOOL), &wrench).unwrap().unwrap();
    let at = config.machine.at(&pose, &TOOL).unwrap();
    let along = at.segments()[0].span().normalize();
    // Six struts with equal inclination: 6 f nz + 500 - 25 · 9.81 = 0.
    let expected = (25.0 * 9.81 - 500.0) / (6.0 * along.z);
    close(&found.drives, &[expected; 6], 1e-10);
    // The same platform under the same force, after it has settled.
    let force = Force::Steady(wrench.force);
    let legs = STRUTS.replace("0.8", "20");
    let model = crate::dynamics::model(&config, SYMMETRIC, &legs);
    let times = Times { step: 1e-4, warm_up: 1.0 };
    let record = standing(&config, &model, (&pose, &TOOL), force, (&times, 0.01), |_| ()).unwrap();
    // Tolerance for the displacement of the loaded platform, 10 um of 1000 mm.
    close(&record.forces, &[expected; 6], 1e-4);
}

#[test]
fn drives_of_a_moving_platform_bear_its_inertia() {
    let config = config("hexapod");
    let model = model(&config, GENERAL, STRUTS);
    let pose = with_tool(POSE_4, &TOOL);
    let mut simulation = Simulation::new(&config, &model, &pose, &TOOL).unwrap().unwrap();
    let drives = simulation.drives(&pose, &TOOL).unwrap();
    let mut motion = simulation.resting(&pose, &drives).unwrap();
    motion.place += Vector3::new(0.05, -0.03, 0.04);
    motion.velocity = Vector3::new(100.0, -150.0, 60.0);
    motion.spin = Vector3::new(0.5, -1.0, 0.8);
    let force = Vector3::new(40.0, -70.0, 90.0);
    let found = simulation.rates(&motion, [&drives, &Drives::default()], &force).unwrap();
    // The same motion as rates of X Y Z A B C of the tip.
    let omega = motion.rotation * motion.spin;
    let turning = motion.rotation * found.spin;
    let lever = motion.rotation * (-TOOL - model.body.centre);
    let velocity = motion.velocity + omega.cross(&lever);
    let linear = found.place + turning.cross(&lever) + omega.cross(&omega.cross(&lever));
    let moved = Pose { position: simulation.tip(&motion) + TOOL, angles: pose.angles };
    let chart = Chart::of(&config, &config.machine.at(&moved, &TOOL).unwrap(), &TOOL);
    let map = rate_map(&moved).try_inverse().unwrap();
    let angles = map * omega;
    let rates = chart.rates(&velocity, &omega);
    let angular = map * (turning - chart.turning(&rates));
    let six = |a: Vector3<f64>, b: Vector3<f64>| [a.x, a.y, a.z, b.x, b.y, b.z];
    let moving = Moving {
        rate: six(velocity, angles),
        acceleration: six(linear, angular),
        ..Moving::still(moved, TOOL)
    };
    let wrench = Wrench { force, ..Wrench::default() };
    let loads = loads(&config, &model, &moving, &wrench).unwrap().unwrap();
    close(&loads.legs, &simulation.forces, 1e-9);
}

#[test]
fn a_motor_feels_the_force_of_its_drive_through_the_lead() {
    let hexapod = config("hexapod");
    let of = |config: &Mechanism, text: &str| {
        Capacity::of(config, &Study::parse(text).unwrap()).unwrap()
    };
    let text = "[legs]\nmax_force_n = 2000\nmotor_torque_n_m = 4\nscrew_efficiency = 0.9\n";
    let drives = of(&hexapod, text);
    assert_eq!(drives.len(), 6);
    // 2000 N at a lead of 10 mm are 3.18 N m, divided by 0.9.
    let torque = drives[0].motor.unwrap().torque_of(-2000.0);
    close(&[torque], &[2000.0 * 10.0 / TAU / 0.9], 1e-12);
    close(&[drives[0].share(-1000.0).unwrap()], &[0.5], 1e-12);
    // With 2 N m the motor is the limiting one.
    let weak = of(&hexapod, &text.replace("_m = 4", "_m = 2"));
    close(&[weak[0].share(1000.0).unwrap()], &[torque / 2.0 / 2000.0], 1e-12);
    assert_eq!(of(&hexapod, "")[0].share(1e9), None);
    // The lead of a carriage's screw is not in the INI file.
    let text = "[legs]\nmotor_torque_n_m = 4\n";
    let error = Capacity::of(&config("linear-delta"), &Study::parse(text).unwrap()).unwrap_err();
    assert!(error.to_string().contains("no screw_lead_mm in [legs]"), "{error}");
    let arms = of(&config("rotary-delta"), "[legs]\nmax_torque_n_m = [10, 20, 40]\n");
    close(&[arms[1].share(5e3).unwrap()], &[0.25], 1e-12);
    let table = "[table]\nmotor_torque_n_m = 2\nscrew_lead_mm = 5\n";
    let axes = of(&config("pyramid"), table);
    close(&[axes[4].share(1000.0).unwrap()], &[5000.0 / TAU / 2000.0], 1e-12);
}

/// Leads are in machine units, and all forces of a study in N and mm.
#[test]
fn a_motor_feels_the_lead_in_mm_on_machines_in_inches_too() {
    let mut inches = 0;
    for seed in generated::ALL {
        let drawn = generated::generated(seed);
        let legs = drawn.mechanisms[0].geometry.legs().iter();
        let leads = legs.map(|leg| leg.kind.screw().lead / drawn.unit);
        let leads: Vec<f64> = leads.collect();
        let config = machine_of(Path::new("drawn.ini"), &drawn.text);
        let study = Study::parse("[legs]\nmotor_torque_n_m = 4\nscrew_lead_mm = 7\n").unwrap();
        let drives = Capacity::of(config.first(), &study).unwrap();
        for (drive, lead) in drives.iter().zip(leads).filter(|(_, lead)| *lead != 0.0) {
            let torque = drive.motor.unwrap().torque_of(1000.0);
            close(&[torque], &[1000.0 * lead.abs() / TAU], 1e-12);
            inches += usize::from(drawn.unit != 1.0);
        }
    }
    assert!(inches > 0);
}
