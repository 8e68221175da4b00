// SPDX-License-Identifier: GPL-2.0-or-later
//! The planner's cycles against what is known in closed form; `tests/live/truth.py` compares them with
//! LinuxCNC itself.

use crate::shipped::{MACHINES, config, folder};
use pkm::program::interpreter::{self, Move, MoveKind, Path, PathMode};
use pkm::program::loads::loads;
use pkm::program::planner::{Cycle, run};
use pkm::read::machine::MachineConfig;
use std::fs;

/// The axes' acceleration and speed of the hexapod in X.
const ACCELERATION: f64 = 1000.0;
const FASTEST: f64 = 200.0;

fn rapid(x: f64, y: f64, mode: PathMode) -> Move {
    let path = Path { mode, ..Path::default() };
    let (kind, end) = (MoveKind::Rapid, [x, y, 250.0, 0.0, 0.0, 0.0]);
    Move { kind, line: 1, end, feed: 0.0, angular_feed: 0.0, tool: [0.0; 3], path }
}

fn cycles(config: &MachineConfig, moves: &[Move]) -> Vec<Cycle> {
    let mut all = vec![];
    run(config, moves, |cycle| all.push(*cycle));
    all
}

fn distance(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

fn fastest(config: &MachineConfig, moves: &[Move]) -> f64 {
    let all = cycles(config, moves);
    let way = |pair: &[Cycle]| distance(&pair[0].pose, &pair[1].pose);
    all.windows(2).map(way).fold(0.0, f64::max) / config.period
}

#[test]
fn a_short_rapid_reaches_the_peak_of_a_triangle_and_a_long_one_its_speed() {
    let config = config("hexapod");
    let blend = PathMode::Blend { tolerance: 0.0, merging: 0.0 };
    // Blending leaves half of the acceleration to the next move, also where there is none.
    for (mode, acceleration) in [(PathMode::Exact, ACCELERATION), (blend, ACCELERATION / 2.0)] {
        for length in [0.5, 4.0, 20.0] {
            let peak = fastest(&config, &[rapid(length, 0.0, mode)]);
            let expected = (acceleration * length).sqrt().min(FASTEST);
            // Cycles are steps: the peak is missed by what two of them change.
            let step = 2.0 * acceleration * config.period;
            assert!((peak - expected).abs() <= step, "{mode:?} {length}: {peak} {expected}");
        }
        let peak = fastest(&config, &[rapid(100.0, 0.0, mode)]);
        assert!((peak - FASTEST).abs() < 1e-6, "{peak}");
    }
}

#[test]
fn a_blended_corner_keeps_its_tolerance_and_an_exact_one_is_reached() {
    let config = config("hexapod");
    let corner = [40.0, 0.0, 250.0, 0.0, 0.0, 0.0];
    let nearest = |mode| {
        let moves = [rapid(40.0, 0.0, mode), rapid(40.0, 40.0, mode)];
        let all = cycles(&config, &moves);
        all.iter().map(|cycle| distance(&cycle.pose, &corner)).fold(f64::INFINITY, f64::min)
    };
    let blended = nearest(PathMode::Blend { tolerance: 0.1, merging: 0.0 });
    // Cycles are up to some hundredths apart there: none needs to be the nearest place.
    assert!(blended > 0.01 && blended < 0.1 + 0.005, "{blended}");
    assert!(nearest(PathMode::Exact) < 1e-9);
}

#[test]
fn every_program_ends_where_its_last_move_ends_and_is_never_faster_than_the_path_may_be() {
    for machine in MACHINES {
        let config = config(machine);
        for program in fs::read_dir(folder(machine).join("programs")).unwrap() {
            let program = program.unwrap().path();
            let moves = interpreter::moves(&config, &program, None).unwrap();
            let all = cycles(&config, &moves);
            let (last, end) = (all[all.len() - 1].pose, moves[moves.len() - 1].end);
            // Displacements of some ten thousand cycles are added up.
            let off = last.iter().zip(end).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-6 * config.machine.size(), "{}: {off}", program.display());
            for pair in all.windows(2) {
                let speed = distance(&pair[0].pose, &pair[1].pose) / config.period;
                // Two moves that overlap are together at most as fast as both limits along their sum.
                let most = config.max_linear_velocity * 2.0_f64.sqrt();
                assert!(speed <= most * (1.0 + 1e-9), "{}: {speed}", program.display());
            }
        }
    }
}

#[test]
fn joints_are_as_fast_as_their_values_change_at_constant_feed() {
    let config = config("tripod");
    let mut end = config.home;
    end[2] += 0.5;
    let path = Path::default();
    let (kind, tool) = (MoveKind::Feed, [0.0; 3]);
    let step = Move { kind, line: 3, end, feed: 0.3, angular_feed: 0.0, tool, path };
    let found = loads(&config, &[step]);
    let joints = |z: f64| {
        let mut pose = config.home;
        pose[2] += z;
        let pose = kinematics::Pose::from_degrees(pose);
        config.machine.inverse(&pose, &config.spindle).unwrap()
    };
    // The struts' rate grows along the way; the program brakes from 0.3 in/s in 5.7e-3 in.
    let braking = 0.3_f64.powi(2) / 2.0 / config.axes[2].max_acceleration;
    let end = 0.5 - braking;
    for (joint, peak) in found.speed.peaks.iter().enumerate() {
        let rate = (joints(end)[joint] - joints(end - 1e-4)[joint]) / 1e-4 * 0.3;
        // A cycle before or after: 3e-4 in of half an inch.
        assert!((peak.value / rate - 1.0).abs() < 1e-3, "{joint}: {} {rate}", peak.value);
        assert_eq!(peak.line, 3);
    }
}
