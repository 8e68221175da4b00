// SPDX-License-Identifier: GPL-2.0-or-later
//! Studies of machines with constraints of the platform.

use kinematics::{Cause, ConstraintGeometry, Letter, Limit, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use machine::rows::{self, follow, joint_rows, length_rows};
use nalgebra::{Matrix3, Matrix6, Rotation3, Vector6};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use studies::study::file::Study;
use studies::study::sensitivity::{Sensitivity, monte_carlo};
use studies::study::springs::Springs;
use studies::study::stiffness::{Stiffness, with_platform};
use studies::study::workspace::{NoWorkspace, Workspace};
use test_support::constrained::{commanded, tool};
use test_support::shipped::{CONSTRAINED, config};

/// Step of central differences, mm and degrees: truncation and rounding are both below 1e-7 per mm.
const STEP: f64 = 1e-3;
const DIFFERENCE: f64 = 1e-7;

/// Returns a pose with coordinate `k` changed.
fn moved(pose: &Pose, k: usize, by: f64) -> Pose {
    let mut values = pose.to_degrees();
    values[k] += by;
    Pose::from_degrees(values)
}

/// Returns the number of machine units or degrees of coordinate `k` per machine unit or radian.
fn degrees(k: usize) -> f64 {
    if k < 3 { 1.0 } else { 1_f64.to_degrees() }
}

#[test]
fn dependent_coordinates_and_joints_follow_as_differences_of_the_inverse() {
    let mut rng = Pcg64::seed_from_u64(60);
    for machine in CONSTRAINED {
        let config = config(machine);
        for _ in 0..30 {
            let (pose, tool) = (commanded(&config, &mut rng), tool(&config, &mut rng));
            let Ok(at) = config.machine.at(&pose, &tool) else { continue };
            let found = follow(&config.geometry, config.machine.radius(), &at, &tool);
            let rows = joint_rows(&config, &at).unwrap();
            let apart = (rows - length_rows(&config, &at, &tool)).amax();
            // Both have no nut; rounding of products of lengths of 1e3.
            assert!(apart < 1e-9, "{machine}: {apart:e}");
            let gains = rows::gains(&config, &at);
            let layout = config.machine.layout();
            for k in (0..6).filter(|k| !layout.is_held(Letter::ALL[*k])) {
                let ends = [STEP, -STEP].map(|by| {
                    let pose = moved(&pose, k, by);
                    let full = config.machine.full_pose(&pose, &tool).unwrap().to_degrees();
                    (full, config.machine.inverse(&pose, &tool).unwrap())
                });
                let per = 2.0 * STEP / degrees(k);
                for i in 0..6 {
                    let rate = (ends[0].0[i] - ends[1].0[i]) / degrees(i) / per;
                    let off = (rate - found[(i, k)]).abs() / degrees(k);
                    assert!(off < DIFFERENCE, "{machine}: {i} by {k}: {rate} {}", found[(i, k)]);
                }
                for i in 0..config.joints.len() {
                    let rate = gains[i] * (ends[0].1[i] - ends[1].1[i]) / per;
                    let off = (rate - rows[(i, k)]).abs() / degrees(k);
                    assert!(off < DIFFERENCE, "{machine}: joint {i} by {k}");
                }
            }
        }
    }
}

#[test]
fn joint_errors_move_every_coordinate_as_forward_does() {
    let mut rng = Pcg64::seed_from_u64(61);
    for machine in CONSTRAINED {
        let config = config(machine);
        let mut compared = 0;
        while compared < 10 {
            let (pose, tool) = (commanded(&config, &mut rng), tool(&config, &mut rng));
            let Ok(Some(found)) = Sensitivity::at(&config, &pose, &tool, 100.0) else { continue };
            let joints = config.machine.inverse(&pose, &tool).unwrap();
            for j in 0..config.joints.len() {
                let ends = [STEP, -STEP].map(|by| {
                    let mut joints = joints;
                    joints[j] += by;
                    let pose = config.machine.forward(&joints, &pose, &tool, &config.solver);
                    rows::with_dependent(&config.machine, &pose.unwrap().pose, &tool)
                        .unwrap()
                        .to_degrees()
                });
                for k in 0..6 {
                    let rate = (ends[0][k] - ends[1][k]) / (2.0 * STEP);
                    // Forward converges to 1e-10 of the size, about 1e-7 mm, over a step of 2e-3 mm.
                    let off = (rate - found.gain[(k, j)]).abs();
                    assert!(off < 1e-4, "{machine}: {k} by {j}: {rate} {}", found.gain[(k, j)]);
                }
            }
            compared += 1;
        }
        let sigma = vec![0.01; config.joints.len()];
        let home = config.home_pose();
        let found = Sensitivity::at(&config, &home, &config.spindle, 100.0).unwrap().unwrap();
        let drawn = monte_carlo(&config, &home, &config.spindle, &sigma, 2000).unwrap();
        for (one, other) in found.sigma(&sigma).iter().zip(drawn.sigma) {
            // The standard error of a deviation from 2000 draws is 1.6 %. To second order, 0.01 mm squared over some
            // 400 mm moves a coordinate that they do not move to first order.
            assert!((one - other).abs() <= 0.08 * one + 1e-6, "{machine}: {one} {other}");
        }
    }
}

/// Returns lengths of struts and values of constraints after a small twist about the tip.
fn equations(
    config: &Mechanism,
    full: &Pose,
    tool: &Vector3<f64>,
    twist: &Vector6<f64>,
) -> Vector6<f64> {
    let rotation: Matrix3<f64> =
        Rotation3::new(twist.fixed_rows::<3>(3).into_owned()) * full.rotation();
    let tip = full.position - tool;
    let origin = tip + twist.fixed_rows::<3>(0) + rotation * tool;
    let v = Vector3::from;
    let legs = config.geometry.legs().iter();
    let lengths = legs.map(|leg| (origin + rotation * v(leg.platform) - v(leg.base)).norm());
    let values = config.geometry.constraints().iter().map(|constraint| match *constraint {
        ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
            (rotation * v(normal)).dot(&(v(base) - origin - rotation * v(platform)))
        }
        ConstraintGeometry::Square { platform_axis, base_axis } => {
            100.0 * (rotation * v(platform_axis)).dot(&v(base_axis))
        }
        ConstraintGeometry::PointInPlane { .. } => panic!("not used here"),
    });
    // The third constraint of the Exechon, which is overconstrained, follows from the first two.
    let is_redundant = config.geometry.constraints().len() == 4;
    let values = values.enumerate().filter(|(i, _)| !(is_redundant && *i == 2));
    Vector6::from_iterator(lengths.chain(values.map(|(_, value)| value)))
}

#[test]
fn the_tip_yields_as_equilibrium_of_struts_and_constraint_reactions_says() {
    let mut rng = Pcg64::seed_from_u64(62);
    let study = Study::parse("[legs]\nstiffness_n_per_um = [10, 20, 40]\n").unwrap();
    for machine in ["tricept", "exechon"] {
        let config = config(machine);
        let springs = Springs::of(&config, &study).unwrap();
        let mut compared = 0;
        while compared < 10 {
            let (pose, tool) = (commanded(&config, &mut rng), tool(&config, &mut rng));
            let Ok(Some(found)) = Stiffness::at(&config, &pose, &tool, &springs) else { continue };
            let full = config.machine.full_pose(&pose, &tool).unwrap();
            let column = |k: usize| {
                let step = if k < 3 { 1e-3 } else { 1e-6 };
                let mut twist = Vector6::zeros();
                twist[k] = step;
                let [one, other] = [twist, -twist].map(|t| equations(&config, &full, &tool, &t));
                (one - other) / (2.0 * step)
            };
            let columns: [Vector6<f64>; 6] = std::array::from_fn(column);
            let derivatives = Matrix6::from_columns(&columns);
            // Reactions of struts and constraints to every unit load, and the extensions that these cause.
            let reactions = derivatives.transpose().try_inverse().unwrap();
            let yields = Vector6::new(1e-4, 5e-5, 2.5e-5, 0.0, 0.0, 0.0);
            let extensions = Matrix6::from_diagonal(&yields) * reactions;
            let expected = derivatives.try_inverse().unwrap() * extensions;
            // Differences are precise to 1e-8, the inverses multiply their errors by about 1e3.
            let apart = (found.compliance - expected).amax() / expected.amax();
            assert!(apart < 1e-4, "{machine}: {apart:e}");
            for block in [(0, 0), (0, 3), (3, 3)] {
                let own = found.compliance.fixed_view::<3, 3>(block.0, block.1);
                let other = expected.fixed_view::<3, 3>(block.0, block.1);
                let apart = (own - other).amax() / other.amax();
                assert!(apart < 1e-4, "{machine}: {block:?} {apart:e}");
            }
            compared += 1;
        }
        // Twice as large a platform keeps its constraints.
        let large = with_platform(&config, 1.25).unwrap();
        let of = |config: &Mechanism| {
            let home = config.home_pose();
            Stiffness::at(config, &home, &config.spindle, &springs).unwrap().unwrap().least()
        };
        assert!(of(&large)[1] > of(&config)[1], "{machine}");
    }
}

#[test]
fn the_workspace_is_bounded_by_the_joints_of_the_whole_pose() {
    let mut rng = Pcg64::seed_from_u64(63);
    for machine in CONSTRAINED {
        let config = config(machine);
        let workspace =
            Workspace::new(&config, config.spindle, vec![[0.0; 3]], &Study::default()).unwrap();
        let (mut inside, mut outside) = (0, 0);
        for _ in 0..300 {
            let mut pose = commanded(&config, &mut rng);
            pose.position *= rng.random_range(1.0..2.0);
            pose.angles = Vector3::zeros();
            let joints = config.machine.inverse(&pose, &config.spindle);
            let keeps = joints.is_ok_and(|joints| {
                config.joints.iter().zip(joints).all(|(j, q)| (j.min..=j.max).contains(&q))
            });
            match workspace.check(&pose.position) {
                Ok(()) => {
                    assert!(keeps, "{machine}: {:?}", pose.to_degrees());
                    inside += 1;
                }
                Err(border) => {
                    // The files have no other limits that matter here.
                    let is_joint = matches!(border.limit, Limit::JointRange | Limit::Reach);
                    assert!(!keeps || !is_joint, "{machine}: {border} {:?}", pose.to_degrees());
                    outside += 1;
                }
            }
        }
        assert!(inside > 20 && outside > 20, "{machine}: {inside} {outside}");
    }
}

#[test]
fn a_workspace_with_dependent_angles_is_refused() {
    let config = config("tricept");
    let study = Study::default();
    let found = Workspace::new(&config, config.spindle, vec![[0.0, 10.0, 0.0]], &study);
    let Err(NoWorkspace::Home(fault)) = found else { panic!("B follows") };
    assert_eq!(fault.cause, Cause::DependentGiven);
}
