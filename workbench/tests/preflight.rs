// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs followed over their whole length, against what is found by looking at single poses.

use crate::shipped::{MACHINES, config, folder};
use kinematics::{MAX_JOINTS, Pose, Vector3};
use pkm::axis_box::range;
use pkm::cell::Reach;
use pkm::interpreter::{self, LINUXCNC_PROGRAMS, Move, MoveKind};
use pkm::machine::MachineConfig;
use pkm::preflight::{Limit, Preflight, preflight};
use pkm::replay::duration;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fs;
use std::path::Path;
use std::time::Instant;

fn follow(config: &MachineConfig, moves: &[Move]) -> Preflight {
    preflight(config, moves, false, |_| ()).unwrap()
}

fn rapid(line: u32, end: [f64; 6]) -> Move {
    Move { kind: MoveKind::Rapid, line, end, feed: 0.0, angular_feed: 0.0, tool: [0.0; 3] }
}

fn between(from: &[f64; 6], to: &[f64; 6], share: f64) -> [f64; 6] {
    std::array::from_fn(|k| from[k] + share * (to[k] - from[k]))
}

#[test]
fn every_shipped_program_fits_its_machine() {
    for machine in MACHINES {
        let config = config(machine);
        let programs = fs::read_dir(folder(machine).join("programs")).unwrap();
        for program in programs.map(|entry| entry.unwrap().path()) {
            let moves = interpreter::moves(&config, &program, None).unwrap();
            let found = follow(&config, &moves);
            assert!(found.fits(), "{}: {:?}", program.display(), found.breaks);
            assert!(found.feed_factor >= 1.0 && found.runnable == 1.0, "{}", found.feed_factor);
        }
    }
}

#[test]
fn a_move_with_good_ends_breaks_in_its_middle() {
    let mut rng = Pcg64::seed_from_u64(51);
    for machine in MACHINES {
        let mut config = config(machine);
        let whole = range(&config);
        let values = |config: &MachineConfig, pose: &[f64; 6]| {
            Reach::new(config).unwrap().joints(pose).unwrap_or([f64::NAN; MAX_JOINTS])
        };
        // A joint that is farther out in the middle than at both ends, by a share of its range.
        let (from, to, joint, side, limit) = (0..100_000)
            .find_map(|_| {
                let [from, to] = [(); 2].map(|()| whole.at(std::array::from_fn(|_| rng.random())));
                let at = [0.0, 0.5, 1.0].map(|t| values(&config, &between(&from, &to, t)));
                let joint = rng.random_range(0..config.joints.len());
                let [start, middle, end] = at.map(|values| values[joint]);
                let range = config.joints[joint].max - config.joints[joint].min;
                let side = if middle > start { 1.0 } else { -1.0 };
                let out = f64::max(side * start, side * end);
                let limit = (middle + side * out) / 2.0;
                // The way there has to keep the limit.
                let mut there = (0..=16).map(|n| between(&config.home, &from, f64::from(n) / 16.0));
                let found = side * middle - out > 0.01 * range
                    && there
                        .all(|pose| side * (limit - values(&config, &pose)[joint]) > 1e-3 * range);
                found.then_some((from, to, joint, side, limit))
            })
            .unwrap_or_else(|| panic!("{machine}: no move found"));
        let limits = &mut config.joints[joint];
        *(if side > 0.0 { &mut limits.max } else { &mut limits.min }) = limit;
        let found = follow(&config, &[rapid(1, from), rapid(2, to), rapid(3, from)]);
        let first = found.breaks.iter().find(|told| told.limit == Limit::Joint);
        let Some(told) = first else { panic!("{machine}: {found:?}") };
        assert_eq!(told.line, 2, "{machine}: {told:?}");
        let there = values(&config, &told.pose)[joint];
        // A piece is 1e-6 of the size; joints go at most some ten times as far as the pose.
        assert!((there - limit).abs() < 1e-4 * config.machine.size(), "{machine}: {there}");
    }
}

/// The machine with limits that moves like this one come near to: the extremes of a few poses of
/// it, or a bit beyond them.
fn narrowed(rng: &mut Pcg64, machine: &str, ends: &[[f64; 6]; 2]) -> MachineConfig {
    let mut config = config(machine);
    let room = [0.0, 1e-6, 1e-4, 1e-2][rng.random_range(0..4)];
    let way = [config.home, ends[0], ends[1]];
    let poses: Vec<[f64; 6]> = way
        .windows(2)
        .flat_map(|w| (0..=8).map(|n| between(&w[0], &w[1], f64::from(n) / 8.0)))
        .collect();
    let reach = Reach::new(&config).unwrap();
    let joints: Vec<_> = poses.iter().filter_map(|pose| reach.joints(pose).ok()).collect();
    let cones: Vec<_> = poses
        .iter()
        .filter_map(|pose| reach.way(pose, &[0.0; 6]).ok())
        .map(|way| [way.base, way.platform].map(|c| c.iter().map(|c| c.middle).collect::<Vec<_>>()))
        .collect();
    for (i, joint) in config.joints.iter_mut().enumerate() {
        let range = (joint.max - joint.min) * room;
        joint.min = joints.iter().map(|j| j[i]).fold(f64::INFINITY, f64::min) - range;
        joint.max = joints.iter().map(|j| j[i]).fold(f64::NEG_INFINITY, f64::max) + range;
        joint.max_velocity *= rng.random_range(0.2..2.0);
        joint.max_acceleration = f64::INFINITY;
    }
    for (which, limits) in
        [&mut config.base_cone, &mut config.platform_cone].into_iter().enumerate()
    {
        for (i, cone) in limits.iter_mut().enumerate() {
            let least = cones.iter().map(|c| c[which][i]).fold(1.0, f64::min);
            *cone = Some(least.clamp(-1.0, 1.0).acos().to_degrees() * (1.0 + room) + 1e-3);
        }
    }
    config
}

/// Whether a pose on the move from `from` leaves a limit, looked at by itself.
fn leaves(config: &MachineConfig, reach: &Reach, from: &[f64; 6], step: &Move, share: f64) -> bool {
    let pose = between(from, &step.end, share);
    if reach.check(&pose).is_err() {
        return true;
    }
    // Difference quotients: their own error is some 1e-7 of the speeds.
    const H: f64 = 1e-5;
    let time = 2.0 * H * duration(config, from, step);
    let [before, after] = [-H, H].map(|h| reach.joints(&between(from, &step.end, share + h)));
    let (Ok(before), Ok(after)) = (before, after) else { return true };
    config
        .joints
        .iter()
        .enumerate()
        .any(|(i, joint)| (after[i] - before[i]).abs() / time > joint.max_velocity * (1.0 + 1e-5))
}

#[test]
fn no_pose_between_leaves_a_limit_that_is_said_to_be_kept() {
    // Poses a move; with the moves that fit they are more than 1e5 in all.
    const POSES: usize = 150;
    let mut rng = Pcg64::seed_from_u64(52);
    let (mut looked_at, mut fitting, mut broken, mut alarms) = (0, 0, 0, 0);
    for machine in MACHINES {
        let whole = range(&config(machine));
        for _ in 0..150 {
            let ends = [(); 2].map(|()| whole.at(std::array::from_fn(|_| rng.random())));
            let config = narrowed(&mut rng, machine, &ends);
            let moves = [rapid(1, ends[0]), rapid(2, ends[1])];
            let found = follow(&config, &moves);
            let reach = Reach::new(&config).unwrap();
            let mut seen = false;
            for (from, step) in [config.home, ends[0]].iter().zip(&moves) {
                for _ in 0..POSES {
                    // Away from the ends, which the difference quotients need.
                    seen |= leaves(&config, &reach, from, step, rng.random_range(1e-4..1.0 - 1e-4));
                }
            }
            assert!(!(found.fits() && seen), "{machine}: {ends:?}");
            looked_at += if found.fits() { 2 * POSES } else { 0 };
            fitting += usize::from(found.fits());
            broken += usize::from(seen);
            alarms += usize::from(!found.fits() && !seen);
        }
    }
    println!("{fitting} fit ({looked_at} poses), {broken} broken, {alarms} told but not seen");
    assert!(looked_at >= 100_000 && broken > 100, "{looked_at} {broken}");
}

#[test]
fn a_singular_pose_between_is_never_missed() {
    let mut rng = Pcg64::seed_from_u64(53);
    for machine in ["hexapod", "lab-hexapod"] {
        let mut config = config(machine);
        let whole = range(&config);
        for joint in &mut config.joints {
            (joint.min, joint.max) = (-1e9, 1e9);
            (joint.max_velocity, joint.max_acceleration) = (f64::INFINITY, f64::INFINITY);
        }
        config.base_cone.fill(None);
        config.platform_cone.fill(None);
        config.axes[3..].iter_mut().for_each(|axis| (axis.min, axis.max) = (-180.0, 180.0));
        // Only reach and singular poses are left to break.
        let side = |pose: &[f64; 6]| {
            config.machine.assembly(&Pose::from_degrees(*pose), &config.spindle).unwrap_or(0)
        };
        let mut crossed = 0;
        for _ in 0..400 {
            let mut end = whole.at(std::array::from_fn(|_| rng.random()));
            end[3..].iter_mut().for_each(|angle| *angle = rng.random_range(-120.0..120.0));
            let found = follow(&config, &[rapid(1, config.home), rapid(2, end)]);
            // The determinant has another sign there: it is 0 between.
            if side(&end) != side(&config.home) {
                assert!(!found.fits(), "{machine}: {end:?}");
                crossed += 1;
            }
        }
        assert!(crossed > 20, "{machine}: {crossed}");
    }
}

#[test]
fn a_tool_offset_at_a_tilt_is_told_and_followed() {
    let mut config = config("hexapod");
    let tilted = [0.0, 0.0, 220.0, 20.0, 0.0, 0.0];
    let longer = |line, z| Move { tool: [0.0, 0.0, z], ..rapid(line, tilted) };
    let level = [0.0, 0.0, 220.0, 0.0, 0.0, 0.0];
    let found = follow(&config, &[longer(1, 0.0), longer(2, 60.0), rapid(3, level)]);
    assert!(found.fits(), "{:?}", found.breaks);
    assert_eq!(found.tilted_tool_changes, [2, 3]);
    let found =
        follow(&config, &[rapid(1, level), Move { tool: [0.0, 0.0, 60.0], ..rapid(2, level) }]);
    assert!(found.tilted_tool_changes.is_empty());
    // The offset's way ends where the pose with the new tool has its joints.
    let joints = |z| {
        let tool = config.spindle + Vector3::new(0.0, 0.0, z);
        Reach::with_tool(&config, tool).unwrap().joints(&tilted).unwrap()
    };
    let (before, after) = (joints(0.0), joints(60.0));
    // A strut that grows from home to the tilted pose, and by the tool.
    let joint = (0..6).find(|i| after[*i] > before[*i] + 10.0).unwrap();
    config.joints[joint].max = (before[joint] + after[joint]) / 2.0;
    let found = follow(&config, &[longer(1, 0.0), longer(2, 60.0)]);
    assert!(found.breaks.iter().any(|told| told.limit == Limit::Joint), "{:?}", found.breaks);
    config.joints[joint].max = after[joint] + 1e-3;
    let found = follow(&config, &[longer(1, 0.0), longer(2, 60.0)]);
    assert!(found.fits(), "{:?}", found.breaks);
}

#[test]
fn a_long_program_is_followed_quickly() {
    let program = Path::new(LINUXCNC_PROGRAMS).join("3D_Chips.ngc");
    let config = config("hexapod");
    let moves = interpreter::shifted_moves(&config, &program, [0.0, 0.0, 140.0]).unwrap();
    let start = Instant::now();
    let found = follow(&config, &moves);
    let time = start.elapsed().as_secs_f64();
    let lines = moves.last().unwrap().line;
    println!(
        "{lines} lines, {} pieces, {:.0} lines per second",
        found.pieces,
        f64::from(lines) / time
    );
    assert!(found.fits(), "{:?}", found.breaks);
}
