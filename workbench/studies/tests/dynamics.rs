// SPDX-License-Identifier: GPL-2.0-or-later
//! Modes, receptance and geometric stiffness, against independent values, closed forms and the
//! stiffness study.

use kinematics::leg::CrankGeometry;
use kinematics::{
    Geometry, LegGeometry, LegKind, Letters, MAX_LEGS, Machine, Matrix3, Pose, Vector3,
};
use machine::proof::axis_box;
use machine::read::mechanism::Mechanism;
use nalgebra::{Complex, DMatrix, RowDVector};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use serde::Deserialize;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::LazyLock;
use studies::dynamics::chart::Chart;
use studies::dynamics::model::{Body, Model};
use studies::dynamics::shapes::squares;
use studies::dynamics::structure::{LegAt, Structure, body_mass, geometric};
use studies::study::file::Study;
use studies::study::springs::Springs;
use studies::study::stiffness::Stiffness;
use test_support::shipped::{CONSTRAINED, MACHINES, config};

/// Tolerance of closed forms and values of 13 digits: rounding of an eigenvalue, 1e-13 of the largest, which is
/// thirty times the smallest.
const CLOSED: f64 = 1e-10;

/// Tool of the independent values, which ends 100 mm below the control point.
pub const TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 100.0);

pub const NO_TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

#[derive(Deserialize)]
struct File {
    structure: Golden,
    nut_rows: NutRows,
}

#[derive(Deserialize)]
struct Golden {
    pose_4: [f64; 6],
    cube_hz: Vec<f64>,
    #[serde(rename = "cube_L_m_I_k")]
    cube: [f64; 4],
    a_home_sym_hz: Vec<f64>,
    a_home_sym_damping_ratio: Vec<f64>,
    a_home_sym_preload_n: f64,
    a_home_sym_hz_with_preload_and_weight: Vec<f64>,
    a_home_sym_hz_struts_1p5_2p0_kg: Vec<f64>,
    a_pose4_gen_hz: Vec<f64>,
    a_pose4_gen_damped_poles_re_im: Vec<[f64; 2]>,
    a_pose4_gen_preload_n: Vec<f64>,
    a_pose4_gen_hz_with_preload_and_weight: Vec<f64>,
    a_pose4_gen_mode_1_tip_direction: [f64; 3],
    a_pose4_gen_mode_1_strut_energy_share: Vec<f64>,
    a_pose4_gen_tip_receptance_hz_xx_yy_zz_xy_re_im: Vec<[f64; 9]>,
    a_map_level_z250_side: Vec<f64>,
    a_map_level_z250_lowest_hz_rows_by_y: Vec<Vec<f64>>,
    #[serde(rename = "pendulum_m_I_l_a_k_g")]
    pendulum: [f64; 6],
    pendulum_hz: Vec<f64>,
    d_home_hz: Vec<f64>,
    d_home_carriages_6kg_hz: Vec<f64>,
    e_home_hz: Vec<f64>,
    #[serde(rename = "delta_Rb_arm_rod_rp_z_krod_kdrive_kg")]
    delta: [f64; 8],
    delta_k_eff_n_per_mm: f64,
    delta_hz: Vec<f64>,
}

/// Values without and with the torque of the thread.
#[derive(Deserialize)]
struct NutRows {
    a_home_gen_hz_without_and_with: [Vec<f64>; 2],
    a_pose_4_gen_hz_without_and_with: [Vec<f64>; 2],
    a_pose_5_gen_hz_without_and_with: [Vec<f64>; 2],
    a_home_tip_compliance_xyz_without_and_with: [[f64; 3]; 2],
    a_pose_4_tip_compliance_xyz_without_and_with: [[f64; 3]; 2],
    a_pose_5_tip_compliance_xyz_without_and_with: [[f64; 3]; 2],
}

const POSE_5: [f64; 6] = [50.0, 100.0, 120.0, -15.0, 12.0, 8.0];

static GOLDEN: LazyLock<File> =
    LazyLock::new(|| toml::from_str(include_str!("cutting_dynamics.toml")).unwrap());

fn golden() -> &'static Golden {
    &GOLDEN.structure
}

/// A platform with its center of mass on its axis, and one without symmetry.
pub const SYMMETRIC: &str = "mass_kg = 25\ncentre_mm = [0, 0, 120]\n\
    inertia_kg_m2 = [[0.45, 0, 0], [0, 0.45, 0], [0, 0, 0.60]]\n";
pub const GENERAL: &str = "mass_kg = 25\ncentre_mm = [6, -4, 120]\n\
    inertia_kg_m2 = [[0.46, 0.02, -0.01], [0.02, 0.43, 0.015], [-0.01, 0.015, 0.60]]\n";

/// Struts of the independent values, which are self-locking.
pub const STRUTS: &str =
    "stiffness_n_per_um = 10\ndamping_n_s_per_mm = 0.8\nscrew = \"self-locking\"\n";

/// Gravity of the independent values, mm/s².
const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9810.0);

pub fn model(config: &Mechanism, platform: &str, legs: &str) -> Model {
    let text = format!("[platform]\n{platform}\n[legs]\n{legs}\n");
    let mut model = Model::of(config, &Study::parse(&text).unwrap()).unwrap();
    model.gravity = GRAVITY;
    model
}

/// Returns the pose with a tool for which the platform is where it is at `pose` without a tool.
pub fn with_tool(pose: [f64; 6], tool: &Vector3<f64>) -> Pose {
    let pose = Pose::from_degrees(pose);
    Pose { position: pose.position - pose.rotation() * tool + tool, ..pose }
}

/// Returns the hexapod with a body of the independent values, and the platform at a pose.
pub fn hexapod(platform: &str, legs: &str, pose: [f64; 6]) -> Structure {
    let config = config("hexapod");
    let model = model(&config, platform, legs);
    Structure::at(&config, &model, &with_tool(pose, &TOOL), &TOOL).unwrap()
}

const HOME: [f64; 6] = [0.0, 0.0, 250.0, 0.0, 0.0, 0.0];

fn hertz(structure: &Structure) -> Vec<f64> {
    structure.shapes().unwrap().omegas.iter().map(|omega| omega / TAU).collect()
}

pub fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let off = (found - expected).abs();
        assert!(off <= tolerance * expected.abs(), "{found} {expected}");
    }
}

#[test]
fn the_hexapod_swings_at_the_frequencies_of_an_independent_calculation() {
    close(&hertz(&hexapod(SYMMETRIC, STRUTS, HOME)), &golden().a_home_sym_hz, CLOSED);
    let pose_4 = golden().pose_4;
    close(&hertz(&hexapod(GENERAL, STRUTS, pose_4)), &golden().a_pose4_gen_hz, CLOSED);
    let heavy = format!("{STRUTS}axial_mass_kg = 1.5\nacross_mass_kg = 2.0\n");
    let heavy = hexapod(SYMMETRIC, &heavy, HOME);
    close(&hertz(&heavy), &golden().a_home_sym_hz_struts_1p5_2p0_kg, CLOSED);
}

#[test]
fn damping_in_proportion_to_stiffness_gives_the_ratios_and_poles_of_the_figures() {
    let home = hexapod(SYMMETRIC, STRUTS, HOME).modes().unwrap();
    let ratios: Vec<f64> = home.iter().map(|mode| mode.zeta).collect();
    close(&ratios, &golden().a_home_sym_damping_ratio, CLOSED);
    let poles = hexapod(GENERAL, STRUTS, golden().pose_4).poles().unwrap();
    let expected = &golden().a_pose4_gen_damped_poles_re_im;
    assert_eq!(poles.len(), expected.len());
    for (found, [re, im]) in poles.iter().zip(expected) {
        let off = (found.re - re).hypot(found.im - im);
        // Eigenvalues of an asymmetric matrix lose some more digits.
        assert!(off < 1e-9 * im, "{found} {re} {im}");
    }
}

#[test]
fn a_damping_ratio_damps_every_mode_alike() {
    let ratio = STRUTS.replace("damping_n_s_per_mm = 0.8", "damping_ratio = 0.03");
    let structure = hexapod(GENERAL, &ratio, golden().pose_4);
    for mode in structure.modes().unwrap() {
        close(&[mode.zeta], &[0.03], CLOSED);
    }
    let omegas = structure.shapes().unwrap().omegas;
    for (pole, omega) in structure.poles().unwrap().iter().zip(omegas) {
        close(&[-pole.re, pole.re.hypot(pole.im)], &[0.03 * omega, omega], 1e-9);
    }
}

#[test]
fn weight_and_the_forces_that_bear_it_change_the_frequencies_as_in_the_figures() {
    let geometric = |platform: &str| format!("{platform}geometric_stiffness = true\n");
    let home = hexapod(&geometric(SYMMETRIC), STRUTS, HOME);
    close(&home.bearing, &[golden().a_home_sym_preload_n; 6], CLOSED);
    close(&hertz(&home), &golden().a_home_sym_hz_with_preload_and_weight, CLOSED);
    let pose = hexapod(&geometric(GENERAL), STRUTS, golden().pose_4);
    close(&pose.bearing, &golden().a_pose4_gen_preload_n, CLOSED);
    close(&hertz(&pose), &golden().a_pose4_gen_hz_with_preload_and_weight, CLOSED);
    let k = &pose.stiffness;
    assert!((k - k.transpose()).amax() <= 1e-9 * k.amax());
}

#[test]
fn the_torque_of_the_thread_changes_the_frequencies_as_the_statics_of_a_strut_say() {
    let nut = &GOLDEN.nut_rows;
    let backdrivable = STRUTS.replace("self-locking", "backdrivable");
    for (pose, [without, with]) in [
        (HOME, &nut.a_home_gen_hz_without_and_with),
        (golden().pose_4, &nut.a_pose_4_gen_hz_without_and_with),
        (POSE_5, &nut.a_pose_5_gen_hz_without_and_with),
    ] {
        close(&hertz(&hexapod(GENERAL, STRUTS, pose)), without, CLOSED);
        close(&hertz(&hexapod(GENERAL, &backdrivable, pose)), with, CLOSED);
    }
}

#[test]
fn the_torque_of_the_thread_changes_the_compliance_of_the_tip_as_the_statics_of_a_strut_say() {
    let nut = &GOLDEN.nut_rows;
    let backdrivable = STRUTS.replace("self-locking", "backdrivable");
    for (pose, both) in [
        (HOME, &nut.a_home_tip_compliance_xyz_without_and_with),
        (golden().pose_4, &nut.a_pose_4_tip_compliance_xyz_without_and_with),
        (POSE_5, &nut.a_pose_5_tip_compliance_xyz_without_and_with),
    ] {
        for (legs, expected) in [STRUTS, &backdrivable].into_iter().zip(both) {
            let found = hexapod(GENERAL, legs, pose).receptance(0.0).unwrap().diagonal();
            close(found.map(|h| h.re).as_slice(), expected, CLOSED);
        }
    }
}

#[test]
fn a_mode_moves_the_tip_and_loads_the_struts_as_in_the_figures() {
    let structure = hexapod(GENERAL, STRUTS, golden().pose_4);
    let tip = structure.modes().unwrap()[0].tip;
    let expected = Vector3::from(golden().a_pose4_gen_mode_1_tip_direction);
    let off = tip.normalize() * tip.dot(&expected).signum() - expected;
    assert!(off.norm() < CLOSED, "{off}");
    let shapes = structure.shapes().unwrap();
    let stretched = &structure.elongation * shapes.vectors.column(0);
    let shares: Vec<f64> =
        stretched.iter().map(|e| 1e4 * e * e / shapes.omegas[0].powi(2)).collect();
    close(&shares, &golden().a_pose4_gen_mode_1_strut_energy_share, CLOSED);
}

#[test]
fn the_receptance_of_the_tip_is_that_of_the_figures_and_symmetric() {
    let structure = hexapod(GENERAL, STRUTS, golden().pose_4);
    for [hz, values @ ..] in &golden().a_pose4_gen_tip_receptance_hz_xx_yy_zz_xy_re_im {
        let found = structure.receptance(TAU * hz).unwrap();
        let size = found.iter().map(|h| h.re.hypot(h.im)).fold(0.0, f64::max);
        for (k, place) in [(0, 0), (1, 1), (2, 2), (0, 1)].into_iter().enumerate() {
            let expected = Complex::new(values[2 * k], values[2 * k + 1]);
            let off = found[place] - expected;
            // The condition number of the dynamic stiffness near a resonance.
            assert!(off.re.hypot(off.im) < 1e-9 * size, "{hz} {place:?} {off}");
        }
        let skew = found - found.transpose();
        assert!(skew.iter().all(|h| h.re.hypot(h.im) < 1e-9 * size), "{hz} {skew}");
    }
}

#[test]
fn a_slow_force_finds_the_compliance_of_the_stiffness_study_on_every_machine() {
    for machine in MACHINES.into_iter().chain(CONSTRAINED) {
        let config = config(machine);
        let table = "[table]\nstiffness_n_per_um = 50\nmass_kg = 80\ndamping_ratio = 0.02\n";
        let legs = "[legs]\nstiffness_n_per_um = 10\ndamping_ratio = 0.02\n";
        let text = format!("[platform]\n{GENERAL}\n{legs}{table}");
        let study = Study::parse(&text).unwrap();
        let model = Model::of(&config, &study).unwrap();
        let springs = Springs::of(&config, &study).unwrap();
        let range = axis_box::range(&config);
        let mut rng = Pcg64::seed_from_u64(7);
        let mut compared = 0;
        for _ in 0..10 {
            let pose = Pose::from_degrees(range.at(std::array::from_fn(|_| rng.random())));
            let tool = config.spindle;
            let Ok(Some(expected)) = Stiffness::at(&config, &pose, &tool, &springs) else {
                continue;
            };
            let structure = Structure::at(&config, &model, &pose, &tool).unwrap();
            let found = structure.receptance(0.0).unwrap().map(|h| h.re);
            let compliance = expected.compliance.fixed_view::<3, 3>(0, 0);
            let off = (found - compliance).amax();
            // Rounding of two inverses with a condition number of 1e5.
            assert!(off < 1e-9 * compliance.amax(), "{machine} {off}");
            assert!((found - found.transpose()).amax() < 1e-9 * compliance.amax());
            compared += 1;
        }
        assert!(compared > 3, "{machine}: {compared}");
    }
}

#[test]
fn the_lowest_frequency_over_a_level_plane_is_that_of_the_figures() {
    let side = &golden().a_map_level_z250_side;
    for (y, row) in side.iter().zip(&golden().a_map_level_z250_lowest_hz_rows_by_y) {
        for (x, expected) in side.iter().zip(row) {
            let found = hertz(&hexapod(GENERAL, STRUTS, [*x, *y, 250.0, 0.0, 0.0, 0.0]));
            close(&found[..1], &[*expected], CLOSED);
        }
    }
}

#[test]
fn the_hexapod_at_home_swings_as_the_quadratic_equation_of_its_symmetry_says() {
    let structure = hexapod(SYMMETRIC, STRUTS, HOME);
    let k = &structure.stiffness;
    let (m, height, across, about) = (0.025, 120.0, 450.0, 600.0);
    // X coupled with B: det(K - ω² M) = 0 of a 2 × 2 matrix.
    let (a, b, d) = (k[(0, 0)], k[(0, 4)], k[(4, 4)]);
    let (ma, mb, md) = (m, m * height, across + m * height * height);
    let (q2, q1, q0) = (ma * md - mb * mb, -(a * md + ma * d - 2.0 * b * mb), a * d - b * b);
    let root = (q1 * q1 - 4.0 * q2 * q0).sqrt();
    let (slow, fast) = (2.0 * q0 / (root - q1), (root - q1) / (2.0 * q2));
    let mut expected =
        vec![slow, slow, fast, fast, k[(2, 2)] / m, k[(5, 5)] / about].into_iter().map(f64::sqrt);
    let mut expected: Vec<f64> = expected.by_ref().map(|omega| omega / TAU).collect();
    expected.sort_by(f64::total_cmp);
    close(&hertz(&structure), &expected, CLOSED);
}

#[test]
fn struts_along_the_edges_of_a_cube_give_the_closed_frequencies() {
    let [side, mass, inertia, k] = golden().cube;
    let ends = [
        ([1, 0, 0], [1, 1, 0]),
        ([1, 0, 0], [1, 0, 1]),
        ([0, 1, 0], [1, 1, 0]),
        ([0, 1, 0], [0, 1, 1]),
        ([0, 0, 1], [1, 0, 1]),
        ([0, 0, 1], [0, 1, 1]),
    ];
    let corner =
        |at: [i32; 3]| Vector3::from(at.map(f64::from)) * side - Vector3::repeat(side / 2.0);
    let chart = level();
    let mut stiffness = DMatrix::zeros(6, 6);
    for (base, platform) in ends {
        let row = leg(&chart, &corner(base), &corner(platform)).row;
        stiffness += row.tr_mul(&row) * k;
    }
    let body = Body { mass, centre: Vector3::zeros(), inertia: Matrix3::identity() * inertia };
    let mass = body_mass(&chart, &body, &Matrix3::identity());
    let (squares, _) = squares(&mass, &stiffness).unwrap();
    let found: Vec<f64> = squares.iter().map(|square| square.sqrt() / TAU).collect();
    close(&found, &golden().cube_hz, CLOSED);
    // Without legs the platform is free.
    let (free, _) = studies::dynamics::shapes::squares(&mass, &DMatrix::zeros(6, 6)).unwrap();
    assert_eq!(free, [0.0; 6]);
}

/// Returns a chart of all six coordinates of a level platform whose frame is the machine's.
fn level() -> Chart {
    let pose = Pose { position: Vector3::zeros(), angles: Vector3::zeros() };
    Chart::new((0..6).collect(), Vector3::zeros(), &pose)
}

/// Returns a strut of a level platform at the origin.
fn leg(chart: &Chart, base: &Vector3<f64>, anchor: &Vector3<f64>) -> LegAt {
    let span = anchor - base;
    let along = span.normalize();
    let row: RowDVector<f64> = along.transpose() * chart.displacement(anchor);
    LegAt { anchor: *anchor, along, length: span.norm(), row, gain: 1.0, signed_gain: 1.0 }
}

#[test]
fn a_body_that_hangs_on_one_strut_swings_as_a_double_pendulum() {
    let [mass, inertia, length, below, k, g] = golden().pendulum;
    let chart = level();
    let legs = [leg(&chart, &Vector3::new(0.0, 0.0, length), &Vector3::zeros())];
    let body = Body {
        mass,
        centre: Vector3::new(0.0, 0.0, -below),
        inertia: Matrix3::identity() * inertia,
    };
    let gravity = Vector3::new(0.0, 0.0, -g);
    let mut stiffness = legs[0].row.tr_mul(&legs[0].row) * k;
    stiffness += geometric(&chart, &legs, &[-mass * g], &[], &body, &gravity);
    let mass = body_mass(&chart, &body, &Matrix3::identity());
    let (squares, _) = squares(&mass, &stiffness).unwrap();
    let found: Vec<f64> = squares[1..].iter().map(|square| square.sqrt() / TAU).collect();
    // The slow roots are next to an axial one that is 5e4 times as large.
    close(&found, &golden().pendulum_hz[1..], 1e-9);
    // The platform rotates freely about the strut.
    assert!(squares[0].abs() < 1e-9 * squares[5], "{}", squares[0]);
}

#[test]
fn rods_and_drives_yield_one_after_the_other_and_carriages_add_their_mass() {
    let config = config("six-rod-lathe");
    let body = "mass_kg = 40\ncentre_mm = [0, 20, 0]\n\
                inertia_kg_m2 = [[0.9, 0, 0], [0, 1.1, 0], [0, 0, 1.3]]\n";
    let legs = "rod_stiffness_n_per_um = 20\ndrive_stiffness_n_per_um = 5\ndamping_ratio = 0.02\n";
    let at = |legs: &str| {
        let model = model(&config, body, legs);
        Structure::at(&config, &model, &config.home_pose(), &NO_TOOL).unwrap()
    };
    close(&hertz(&at(legs)), &golden().d_home_hz, CLOSED);
    let heavy = at(&format!("{legs}drive_mass_kg = 6\n"));
    close(&hertz(&heavy), &golden().d_home_carriages_6kg_hz, CLOSED);
}

#[test]
fn a_platform_on_guides_swings_in_the_coordinates_that_its_legs_move() {
    let config = config("pyramid");
    let body = "mass_kg = 12\ncentre_mm = [0, 0, 120]\n\
                inertia_kg_m2 = [[0.08, 0, 0], [0, 0.09, 0], [0, 0, 0.12]]\n";
    let text = format!(
        "[platform]\n{body}[legs]\nstiffness_n_per_um = 8\ndamping_ratio = 0.02\n\
         [table]\nmass_kg = [90, 60]\nstiffness_n_per_um = 40\ndamping_ratio = 0.03\n"
    );
    let model = Model::of(&config, &Study::parse(&text).unwrap()).unwrap();
    let structure = Structure::at(&config, &model, &config.home_pose(), &NO_TOOL).unwrap();
    let axis = |mass: f64| (4e4 / (mass * 1e-3)).sqrt() / TAU;
    let mut expected = golden().e_home_hz.clone();
    expected.extend([axis(90.0), axis(60.0)]);
    expected.sort_by(f64::total_cmp);
    close(&hertz(&structure), &expected, CLOSED);
    // The table's modes move only the workpiece.
    for (mass, unit) in [(90.0, Vector3::x()), (60.0, Vector3::y())] {
        let modes = structure.modes().unwrap();
        let own = modes.iter().find(|mode| (mode.omega / TAU - axis(mass)).abs() < 1e-6).unwrap();
        close(&[own.tip.dot(&unit).abs(), own.zeta], &[(1e3 / mass).sqrt(), 0.03], CLOSED);
    }
}

#[test]
fn arms_yield_by_their_angle() {
    let [base, arm, rod, platform, z, krod, kdrive, mass] = golden().delta;
    let legs: Vec<LegGeometry> = (0..3)
        .map(|k| {
            let (sin, cos) = (f64::from(k) * TAU / 3.0).sin_cos();
            let crank = CrankGeometry {
                axis: [-sin, cos, 0.0],
                arm: [arm * cos, arm * sin, 0.0],
                rod,
                side: 1,
            };
            LegGeometry {
                base: [base * cos, base * sin, 0.0],
                platform: [platform * cos, platform * sin, 0.0],
                kind: LegKind::Crank(crank),
            }
        })
        .collect();
    let letters = |text: &str| Letters::parse(text.as_bytes()).unwrap();
    let machine = [1, -1].into_iter().find_map(|side| {
        let sided = |leg: &LegGeometry| match leg.kind {
            LegKind::Crank(crank) => {
                LegGeometry { kind: LegKind::Crank(CrankGeometry { side, ..crank }), ..*leg }
            }
            _ => *leg,
        };
        let legs: Vec<LegGeometry> = legs.iter().map(sided).collect();
        let geometry = Geometry::new(&legs, letters("XYZ"), letters("")).unwrap();
        let machine = Machine::freeze(&geometry, &[0.0; MAX_LEGS]).unwrap();
        let pose = Pose::from_degrees([0.0, 0.0, z, 0.0, 0.0, 0.0]);
        // Elbows outwards, as in the independent values.
        let is_outwards =
            machine.at(&pose, &NO_TOOL).is_ok_and(|at| at.segments()[0].base.x > base);
        is_outwards.then_some((machine, geometry))
    });
    let (machine, geometry) = machine.unwrap();
    let mut config = Mechanism { machine, geometry, ..config("rotary-delta") };
    Arc::make_mut(&mut config.facts).units_per_mm = 1.0;
    let legs = format!(
        "rod_stiffness_n_per_um = {}\ndrive_stiffness_n_m_per_rad = {}\ndamping_ratio = 0.02\n",
        krod * 1e-3,
        kdrive * 1e-3
    );
    let model = model(&config, &format!("mass_kg = {mass}\ncentre_mm = [0, 0, 0]\n"), &legs);
    let pose = Pose::from_degrees([0.0, 0.0, z, 0.0, 0.0, 0.0]);
    let structure = Structure::at(&config, &model, &pose, &NO_TOOL).unwrap();
    close(&hertz(&structure), &golden().delta_hz, CLOSED);
    let at = config.machine.at(&pose, &NO_TOOL).unwrap();
    let found = studies::dynamics::structure::legs(&config, &at, &NO_TOOL, model.screw).unwrap();
    let along = model.legs[0].spring.along(found[0].gain);
    close(&[along], &[golden().delta_k_eff_n_per_mm], CLOSED);
}
