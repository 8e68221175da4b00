// SPDX-License-Identifier: GPL-2.0-or-later
//! Motion of the carriages along paths: the curves of the publications are pictures, these
//! are the figures that hold for any dimensions.

use kinematics::{Joints, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use program::joint_curves::{Along, along};
use program::motion::{Move, moves};
use test_support::shipped::{config, folder};

/// The sum of a thousand steps, each with a rounding of a carriage position near 1500 mm.
const SUM_MM: f64 = 1e-9;

const LATHES: [&str; 2] = ["four-rod-lathe", "six-rod-lathe"];

/// Returns the poses by forward, each seeded by the previous one, and their joints.
fn followed(config: &Mechanism, poses: &[[f64; 6]]) -> Vec<([f64; 6], Joints)> {
    let (tool, machine) = (Vector3::zeros(), &config.machine);
    let mut seed = Pose::from_degrees(poses[0]);
    let step = |pose: &[f64; 6]| {
        let joints = machine.inverse(&Pose::from_degrees(*pose), &tool).unwrap();
        seed = machine.forward(&joints, &seed, &tool, &config.solver).unwrap().pose;
        (seed.to_degrees(), machine.inverse(&seed, &tool).unwrap())
    };
    poses.iter().map(step).collect()
}

/// Returns the end points of the arcs of one line of a program, with the point before them.
fn arc(moves: &[Move], line: u32) -> Vec<[f64; 6]> {
    let first = moves.iter().position(|step| step.line == line).unwrap();
    let ends = moves[first - 1..].iter().take_while(|step| step.line <= line);
    ends.map(|step| step.end).collect()
}

fn end(path: &[Along]) -> &Along {
    path.last().unwrap()
}

#[test]
fn carriages_come_back_over_every_circle_of_the_lathe() {
    let config = config("four-rod-lathe");
    let program = folder("four-rod-lathe").join("programs/circles.ngc");
    let moves = moves(&config.clone().into(), &program, None).unwrap();
    let text = std::fs::read_to_string(&program).unwrap();
    let is_circle = |line: &str| line.starts_with("G2 ") || line.starts_with("G3 ");
    let circles: Vec<u32> =
        (1..).zip(text.lines()).filter(|(_, line)| is_circle(line)).map(|(n, _)| n).collect();
    assert_eq!(circles.len(), 6);
    for line in circles {
        let path = along(followed(&config, &arc(&moves, line)));
        let length = end(&path).length;
        // A thousand chords within 1e-4 mm of a circle of radius 20.
        assert!((length - 40.0 * std::f64::consts::PI).abs() < 1e-2, "line {line}: {length}");
        for i in 0..config.joints.len() {
            let travel = path.iter().fold(0.0, |most: f64, at| most.max(at.change[i].abs()));
            assert!(travel > 5.0, "line {line}: carriage {i} moves {travel}");
            let change = end(&path).change[i];
            assert!(change.abs() < SUM_MM, "line {line}: carriage {i} ends {change} away");
        }
    }
}

#[test]
fn a_move_along_the_guides_moves_all_carriages_of_a_lathe_alike_and_no_other_move_does() {
    for machine in LATHES {
        let config = config(machine);
        for axis in 0..3 {
            let pose = |share: f64| {
                let mut pose = config.home;
                pose[axis] += 20.0 * share;
                pose[4] = 8.0;
                pose
            };
            let poses: Vec<[f64; 6]> = (0..=100).map(|k| pose(f64::from(k) / 100.0)).collect();
            let path = along(followed(&config, &poses));
            let is_alike = |at: &Along| {
                at.change[..config.legs()].iter().all(|c| (c - at.length).abs() < SUM_MM)
            };
            assert_eq!(path.iter().all(is_alike), axis == 2, "{machine} {axis}");
        }
    }
}

#[test]
fn the_level_cycloid_moves_the_pyramid_carriages_alike_and_the_table_along_x_alone() {
    let config = config("pyramid");
    let h = 16.0;
    let pose = |k: i32| {
        let t = f64::from(k).to_radians();
        [h * (t - t.sin()), 0.0, 250.0 + h * (1.0 - t.cos()), 0.0, 0.0, 0.0]
    };
    let path = along(followed(&config, &(0..=360).map(pose).collect::<Vec<_>>()));
    let Along { length, change } = end(&path);
    // An arch is 8 h long; chords of one degree are shorter by a share of 1e-5.
    assert!((length / (8.0 * h) - 1.0).abs() < 2e-5, "{length}");
    assert!((change[4] - std::f64::consts::TAU * h).abs() < SUM_MM && change[5].abs() < SUM_MM);
    for at in &path {
        let carriages = &at.change[..4];
        assert!(carriages.iter().all(|c| (c - carriages[0]).abs() < SUM_MM), "{carriages:?}");
    }
    let top = path.iter().map(|at| at.change[0]).fold(0.0, f64::max);
    assert!(top > 2.0 * h && change[0].abs() < SUM_MM, "{top} {}", change[0]);
}
