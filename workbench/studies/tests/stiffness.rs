// SPDX-License-Identifier: GPL-2.0-or-later
//! Stiffness at the tool tip, against independent values, the formulas of paper 004, finite differences
//! of the core, and symmetry.

use kinematics::{LegKind, Matrix3, Pose, Solver, Vector3};
use machine::proof::axis_box;
use machine::read::mechanism::Mechanism;
use machine::rows::{length_rows, rate_map};
use nalgebra::Matrix6;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;
use studies::study::file::{Screw, Study};
use studies::study::map::Map;
use studies::study::sensitivity::Sensitivity;
use studies::study::springs::{Spring, Springs};
use studies::study::stiffness::{Stiffness, with_platform};
use test_support::shipped::{MACHINES, config};

/// N/mm.
const STRUT: f64 = 1e4;
const NO_TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

fn springs(config: &Mechanism, screw: Screw) -> Springs {
    Springs { all: vec![Spring::Whole(STRUT); config.joints.len()], screw }
}

fn at(config: &Mechanism, pose: &Pose, tool: &Vector3<f64>) -> Stiffness {
    Stiffness::at(config, pose, tool, &springs(config, Screw::default())).unwrap().unwrap()
}

fn self_locking(config: &Mechanism, pose: &Pose, tool: &Vector3<f64>) -> Stiffness {
    Stiffness::at(config, pose, tool, &springs(config, Screw::SelfLocking)).unwrap().unwrap()
}

fn close(found: f64, expected: f64) {
    // Values of 13 digits; rounding of an inverse with a condition number of 1e5.
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

#[test]
fn with_self_locking_screws_the_hexapod_at_home_is_as_stiff_as_in_an_independent_calculation() {
    let config = config("hexapod");
    let home = config.home_pose();
    let matrix = self_locking(&config, &home, &NO_TOOL).matrix.unwrap();
    let diagonal = [
        5428.243196703,
        5428.243196703,
        49143.51360659,
        6.107245172758e8,
        6.107245172758e8,
        2.133066555990e8,
    ];
    for (k, expected) in diagonal.into_iter().enumerate() {
        close(matrix[(k, k)], expected);
    }
    close(matrix[(0, 4)], -833367.6097677);
    // A tool that ends 100 mm below the control point.
    let tip = self_locking(&config, &home, &Vector3::new(0.0, 0.0, 100.0)).translation();
    for (found, expected) in
        tip.stiffness.into_iter().zip([5258.847770271, 5258.847770271, 49143.51360659])
    {
        close(found, expected);
    }
}

/// Returns the pose with a tool for which the platform is where it is at `pose` without a tool.
fn with_tool(pose: &Pose, tool: &Vector3<f64>) -> Pose {
    // With a tool o the control point is given as tip + o, see the core's `inverse`.
    Pose { position: pose.position - pose.rotation() * tool + tool, ..*pose }
}

#[test]
fn a_tip_yields_as_in_an_independent_calculation_with_screws_of_either_kind() {
    let config = config("hexapod");
    let tool = Vector3::new(0.0, 0.0, 100.0);
    // mm/N along X, Y and Z, from the statics of a strut (forces, and couples of both cardan
    // joints), with the torque of the thread and without.
    for (pose, backdrivable, locked) in [
        (
            [0.0, 0.0, 250.0, 0.0, 0.0, 0.0],
            [0.00019016096975118447, 0.00019016096975118453, 2.036044044880279e-05],
            [0.00019015572301846428, 0.00019015572301846434, 2.034856538759598e-05],
        ),
        (
            [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0],
            [0.00016014871213989752, 0.00021041519275989188, 8.399067715397473e-05],
            [0.00016079534757564828, 0.00021018447302189255, 8.410687641196593e-05],
        ),
        (
            [50.0, 100.0, 120.0, -15.0, 12.0, 8.0],
            [0.00032511249362467647, 0.0002882953540833658, 6.851788433951195e-05],
            [0.00032424722814952553, 0.0002898266002946303, 6.800420819709515e-05],
        ),
    ] {
        let pose = with_tool(&Pose::from_degrees(pose), &tool);
        for (found, expected) in [
            (at(&config, &pose, &tool), backdrivable),
            (self_locking(&config, &pose, &tool), locked),
        ] {
            (0..3).for_each(|k| close(found.compliance[(k, k)], expected[k]));
        }
    }
}

#[test]
fn the_matrix_is_the_curvature_of_the_energy_that_held_motors_leave_in_the_struts() {
    let config = config("hexapod");
    for pose in [[-80.0, 60.0, 350.0, 10.0, -20.0, 0.0], [50.0, 100.0, 120.0, -15.0, 12.0, 8.0]] {
        let pose = Pose::from_degrees(pose);
        let held = config.machine.inverse(&pose, &NO_TOOL).unwrap();
        let map = rate_map(&pose).try_inverse().unwrap();
        // Energy of a platform displaced and rotated slightly, to first order in the rotation.
        let energy = |twist: &nalgebra::Vector6<f64>| {
            let turned = map * twist.fixed_rows::<3>(3);
            let pose = Pose {
                position: pose.position + twist.fixed_rows::<3>(0),
                angles: pose.angles + turned,
            };
            let joints = config.machine.inverse(&pose, &NO_TOOL).unwrap();
            (0..6).map(|i| STRUT * (joints[i] - held[i]).powi(2) / 2.0).sum::<f64>()
        };
        let matrix = at(&config, &pose, &NO_TOOL).matrix.unwrap();
        let step = |k: usize, sign: f64| {
            let mut twist = nalgebra::Vector6::zeros();
            twist[k] = sign * if k < 3 { 1e-3 } else { 1e-5 };
            twist
        };
        for i in 0..6 {
            for k in 0..6 {
                let of = |a, b| energy(&(step(i, a) + step(k, b)));
                let found = (of(1.0, 1.0) - of(1.0, -1.0) - of(-1.0, 1.0) + of(-1.0, -1.0))
                    / (4.0 * step(i, 1.0)[i] * step(k, 1.0)[k]);
                let size = (matrix[(i, i)] * matrix[(k, k)]).sqrt();
                // Rounding of lengths, 1e-13 of elongations of 1e-3; the nut rotation's term is 1e-3.
                assert!((found - matrix[(i, k)]).abs() < 1e-6 * size, "{i} {k} {found}");
            }
        }
    }
}

#[test]
fn outlines_of_the_ellipsoids_are_the_farthest_that_a_load_moves_the_tip() {
    let config = config("hexapod");
    let pose = Pose::from_degrees([60.0, -40.0, 300.0, 12.0, -9.0, 15.0]);
    let found = at(&config, &pose, &Vector3::new(0.0, 0.0, 80.0));
    let load = 1e6;
    for (ellipsoid, first) in [(found.translation(), 0), (found.rotation(), 3)] {
        let compliance = found.compliance.fixed_view::<3, 3>(first, first).into_owned();
        for plane in [[0, 1], [0, 2], [1, 2]] {
            let outline = ellipsoid.outline(plane, load, 12);
            assert_eq!(outline.len(), 13);
            for (k, point) in outline.into_iter().enumerate() {
                let (up, across) = (k as f64 * std::f64::consts::PI / 6.0).sin_cos();
                let mut along = Vector3::zeros();
                (along[plane[0]], along[plane[1]]) = (across, up);
                // Of all C u with unit u, the farthest along w is that with u = C w/|C w|.
                let moved = compliance * (compliance * along).normalize() * load;
                let miss = (moved[plane[0]] - point.0).hypot(moved[plane[1]] - point.1);
                // Rounding of eigenvectors.
                assert!(miss < 1e-12 * load * compliance.abs().max(), "{plane:?} {k} {miss}");
            }
        }
    }
}

fn cross(r: &Vector3<f64>) -> Matrix3<f64> {
    r.cross_matrix()
}

#[test]
fn the_tip_is_reached_by_the_blocks_of_paper_004_as_well() {
    let config = config("hexapod");
    let pose = Pose::from_degrees([60.0, -40.0, 300.0, 12.0, -9.0, 15.0]);
    let tool = Vector3::new(5.0, -8.0, 100.0);
    let matrix = at(&config, &pose, &NO_TOOL).matrix.unwrap();
    let block = |i, j| matrix.fixed_view::<3, 3>(i, j).into_owned();
    let (kp, kc, kk) = (block(0, 0), block(0, 3), block(3, 3));
    let inverse = |m: Matrix3<f64>| m.try_inverse().unwrap();
    let c11 = inverse(kp - kc * inverse(kk) * kc.transpose());
    let c22 = inverse(kk - kc.transpose() * inverse(kp) * kc);
    let c12 = -inverse(kp) * kc * c22;
    // The platform is in the same place: only the reference point changes.
    let x = cross(&(pose.rotation() * -tool));
    let expected = c11 + c12 * x + x.transpose() * c12.transpose() + x.transpose() * c22 * x;
    let found = at(&config, &with_tool(&pose, &tool), &tool)
        .compliance
        .fixed_view::<3, 3>(0, 0)
        .into_owned();
    assert!((found - expected).abs().max() < 1e-9 * expected.abs().max(), "{found} {expected}");
}

#[test]
fn a_force_moves_the_tool_as_forward_kinematics_of_the_yielding_struts_say() {
    // Without a lead, so that a joint value is the strut's length; forces of struts by duality, W = Gᵀ f.
    let config = config("lab-hexapod");
    let pose = Pose::from_degrees([30.0, -20.0, 680.0, 6.0, -7.0, 9.0]);
    let stiffness = at(&config, &pose, &NO_TOOL);
    let at = config.machine.at(&pose, &NO_TOOL).unwrap();
    let rows = length_rows(&config, &at, &NO_TOOL);
    let joints = config.machine.inverse(&pose, &NO_TOOL).unwrap();
    let map = rate_map(&pose);
    let mut to_twist = Matrix6::identity();
    to_twist.fixed_view_mut::<3, 3>(3, 3).copy_from(&map);
    for k in 0..6 {
        let mut wrench = nalgebra::Vector6::zeros();
        // Large enough to deform struts by micrometers.
        wrench[k] = if k < 3 { 10.0 } else { 1e3 };
        let g = rows.fixed_rows::<6>(0) * to_twist.try_inverse().unwrap();
        let forces = g.transpose().try_inverse().unwrap() * wrench;
        let side = |sign: f64| {
            let mut off = joints;
            (0..6).for_each(|j| off[j] += sign * forces[j] / STRUT);
            config.machine.forward(&off, &pose, &NO_TOOL, &Solver::default()).unwrap().pose
        };
        let (more, less) = (side(1.0), side(-1.0));
        let moved = (more.position - less.position) / 2.0;
        let turned = map * ((more.angles - less.angles) / 2.0);
        let expected = stiffness.compliance * wrench;
        let scale = expected.fixed_rows::<3>(0).norm() + 100.0 * expected.fixed_rows::<3>(3).norm();
        for i in 0..3 {
            // Curvature: micrometres squared over the size, 1e-8 of the displacement.
            assert!((moved[i] - expected[i]).abs() < 1e-6 * scale, "{k} {i}");
            assert!(100.0 * (turned[i] - expected[i + 3]).abs() < 1e-6 * scale, "{k} {i}");
        }
    }
}

#[test]
fn a_compliance_is_symmetric_and_nowhere_negative_on_any_machine() {
    for machine in MACHINES {
        let config = config(machine);
        let range = axis_box::range(&config);
        let mut rng = Pcg64::seed_from_u64(4);
        for _ in 0..20 {
            let pose = Pose::from_degrees(range.at(std::array::from_fn(|_| rng.random())));
            let springs = springs(&config, Screw::default());
            let Ok(Some(found)) = Stiffness::at(&config, &pose, &config.spindle, &springs) else {
                continue;
            };
            let c = found.compliance;
            assert!((c - c.transpose()).abs().max() <= 1e-12 * c.abs().max(), "{machine}");
            let least = c.symmetric_eigenvalues().min();
            assert!(least > -1e-12 * c.abs().max(), "{machine} {least}");
            let twice = vec![Spring::Whole(2.0 * STRUT); config.joints.len()];
            let twice = Springs { all: twice, ..springs };
            let stiffer = Stiffness::at(&config, &pose, &config.spindle, &twice).unwrap().unwrap();
            close(stiffer.least()[0], 2.0 * found.least()[0]);
        }
    }
}

#[test]
fn a_symmetric_machine_has_symmetric_maps() {
    let config = config("hexapod");
    let home = config.home_pose();
    let (low, high) = ([-100.0; 6], [100.0; 6]);
    // A mirrored right-hand thread is left-hand: the map is symmetric only without thread torque.
    let map = Map::over(&home, [0, 1], [&low, &high], 9, |pose| {
        Some(self_locking(&config, pose, &NO_TOOL).least())
    });
    for j in 0..9 {
        for i in 0..9 {
            let (here, mirrored) = (map.values[j * 9 + i], map.values[(8 - j) * 9 + i]);
            close(here[0], mirrored[0]);
            close(here[1], mirrored[1]);
        }
    }
    // Rotated by a third of a turn.
    let place = |angle: f64| {
        let mut pose = home;
        pose.position += Vector3::new(angle.cos(), angle.sin(), 0.0) * 80.0;
        at(&config, &pose, &NO_TOOL).least()
    };
    let third = 2.0 * std::f64::consts::PI / 3.0;
    let [one, other] = [0.3, 0.3 + third].map(place);
    close(one[0], other[0]);
    close(one[1], other[1]);
}

/// Returns the stiffness of struts as springs of `STRUT` between the anchors of the INI file, about a tip without tool
/// length: K = Σ k [u; ρ × u][u; ρ × u]ᵀ.
pub fn between_anchors(config: &Mechanism, pose: &Pose) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    for leg in config.geometry.legs() {
        let arm = pose.rotation() * Vector3::from(leg.platform);
        let along = (pose.position + arm - Vector3::from(leg.base)).normalize();
        let moment = arm.cross(&along);
        let row = nalgebra::Vector6::from_iterator(along.iter().chain(&moment).copied());
        matrix += row * row.transpose() * STRUT;
    }
    matrix
}

#[test]
fn stiffness_along_an_axis_is_the_load_over_the_displacement_that_it_causes() {
    let config = config("hexapod");
    let pose = Pose::from_degrees([-80.0, 60.0, 350.0, 10.0, -20.0, 0.0]);
    let found = self_locking(&config, &pose, &NO_TOOL).along();
    let matrix = between_anchors(&config, &pose);
    for (k, stiffness) in found.into_iter().enumerate() {
        let mut load = nalgebra::Vector6::zeros();
        load[k] = 1.0;
        let displacement = matrix.lu().solve(&load).unwrap();
        // Rounding: the condition number of stiffnesses of lengths and angles is about 1e6.
        assert!((stiffness * displacement[k] - 1.0).abs() < 1e-9, "{k}: {stiffness}");
    }
    // Guides hold the angles of a linear delta.
    let delta = test_support::shipped::config("linear-delta");
    let rigid = at(&delta, &delta.home_pose(), &delta.spindle).along();
    assert!(rigid[..3].iter().all(|value| value.is_finite()), "{rigid:?}");
    assert!(rigid[3..].iter().all(|value| value.is_infinite()), "{rigid:?}");
}

#[test]
fn a_larger_platform_resists_turns_more() {
    // A result of paper 004.
    let config = config("hexapod");
    let home = config.home_pose();
    let least = |factor: f64| {
        let config = with_platform(&config, factor).unwrap();
        at(&config, &home, &NO_TOOL).least()[1]
    };
    assert!(least(0.5) < least(1.0) && least(1.0) < least(1.5));
}

#[test]
fn at_a_singular_pose_there_is_no_stiffness() {
    let config = config("tripod");
    // All three struts in the plane of the base.
    let pose = Pose::from_degrees([0.0; 6]);
    let springs = springs(&config, Screw::default());
    let found = Stiffness::at(&config, &pose, &config.spindle, &springs);
    assert!(matches!(found, Ok(None) | Err(_)), "{found:?}");
}

#[test]
fn rods_and_drives_of_one_study_yield_one_after_the_other() {
    for (machine, drive, is_arm) in [
        ("linear-delta", "drive_stiffness_n_per_um = 5", false),
        ("six-rod-lathe", "drive_stiffness_n_per_um = 5", false),
        ("rotary-delta", "drive_stiffness_n_m_per_rad = 5e3", true),
    ] {
        let config = config(machine);
        let pose = config.home_pose();
        let study = |legs: &str| Study::parse(&format!("[legs]\n{legs}\n")).unwrap();
        let compliance = |legs: &str| {
            let springs = Springs::of(&config, &study(legs)).unwrap();
            let found = Stiffness::at(&config, &pose, &config.spindle, &springs).unwrap().unwrap();
            found.compliance.fixed_view::<3, 3>(0, 0).into_owned()
        };
        let both = compliance(&format!("rod_stiffness_n_per_um = 20\n{drive}"));
        let rods = compliance("stiffness_n_per_um = 20");
        // A drive that yields by 1/k under a unit force moves the tip by its gain, which relates both its force
        // and its motion to those of the tip.
        let radius = config.machine.radius();
        let gain = Sensitivity::at(&config, &pose, &config.spindle, radius).unwrap().unwrap().gain;
        // Gain in machine units per degree, or without unit.
        let unit = if is_arm { 1.0_f64.to_degrees() / config.units_per_mm } else { 1.0 };
        let column = |i: usize| Vector3::from_fn(|k, _| gain[(k, i)] * unit);
        // 5 N/um, or 5 kN m/rad, in N and mm.
        let k = if is_arm { 5e6 } else { 5e3 };
        let drives: Matrix3<f64> =
            (0..config.legs()).map(|i| column(i) * column(i).transpose() / k).sum();
        let off = (both - rods - drives).amax();
        // Rounding of an inverse with a condition number of 1e5.
        assert!(drives.amax() > 0.0 && off < 1e-9 * both.amax(), "{machine} {off}");
        assert!(Springs::of(&config, &study("rod_stiffness_n_per_um = 20")).is_err());
        let twice = format!("stiffness_n_per_um = 1\nrod_stiffness_n_per_um = 20\n{drive}");
        let message = Springs::of(&config, &study(&twice)).unwrap_err().to_string();
        assert!(message.contains("remove one of them"), "{message}");
    }
}

#[test]
fn the_row_of_a_joint_is_the_wrench_of_a_strut_in_balance_with_the_torque_of_its_thread() {
    let config = config("hexapod");
    let pose = Pose::from_degrees([-80.0, 60.0, 350.0, 10.0, -20.0, 0.0]);
    let at = config.machine.at(&pose, &NO_TOOL).unwrap();
    let rows = at.inverse_jacobian().unwrap();
    let rotation = at.rotation();
    for (i, (leg, segment)) in config.geometry.legs().iter().zip(at.segments()).enumerate() {
        let LegKind::Strut(strut) = leg.kind else { panic!("{i} is no strut") };
        let span = segment.span();
        let (along, length) = (span.normalize(), span.norm());
        // A cardan joint transmits a moment perpendicular to both its axes: the fixed one, and the one perpendicular
        // to it and to the strut. Its component along the strut is the thread's torque under 1 N.
        let borne = |fixed: Vector3<f64>| {
            let square = fixed.cross(&fixed.cross(&along)).normalize();
            square * (-strut.lead / TAU / square.dot(&along))
        };
        let above = borne(Vector3::from(strut.base_axis).normalize());
        let below = borne(rotation * Vector3::from(strut.platform_axis).normalize());
        // Moments about the base joint: a force across the strut balances the difference of the two.
        let force = along + (above - below).cross(&along) / length;
        let arm = rotation * Vector3::from(leg.platform);
        let moment = arm.cross(&force) + below;
        for k in 0..3 {
            // Rounding with a lever of 250 mm.
            assert!((rows[(i, k)] - force[k]).abs() < 1e-10, "{i} {k} {}", rows[(i, k)]);
            assert!((rows[(i, k + 3)] - moment[k]).abs() < 1e-10 * 250.0, "{i} {k} {moment}");
        }
    }
}
