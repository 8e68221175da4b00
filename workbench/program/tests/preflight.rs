// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs checked over their whole length, compared with single poses.

use kinematics::{At, Limit, MAX_EXTRA, MAX_JOINTS, Pose, Vector3};
use machine::limits;
use machine::proof::axis_box::range;
use machine::proof::reach::Reach;
use machine::read::mechanism::Mechanism;
use program::motion::{self, LINUXCNC_PROGRAMS, Move, MoveKind, Spindle, extra_home};
use program::preflight::preflight;
use program::report::Preflight;
use program::work_offset::{self, Offset};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use test_support::shipped::{MACHINES, cases, config, folder, unchained, whole};

/// Checks all moves of a program. Moves of [`rapid`] leave the extra axes at home.
pub fn follow(config: &Mechanism, moves: &[Move]) -> Preflight {
    let is_rapid = |step: &Move| step.extra_end == [0.0; MAX_EXTRA];
    let home = extra_home(config);
    let at_home = |step: &Move| Move { extra_end: home, ..*step };
    let moves: Vec<Move> =
        moves.iter().map(|step| if is_rapid(step) { at_home(step) } else { *step }).collect();
    preflight(std::slice::from_ref(config), &moves).unwrap()
}

pub fn rapid(line: u32, end: [f64; 6]) -> Move {
    Move {
        kind: MoveKind::Rapid,
        line,
        end,
        feed: 0.0,
        angular_feed: 0.0,
        tool: [0.0; 3],
        file: 0,
        extra: false,
        second: None,
        lasts: None,
        extra_end: [0.0; MAX_EXTRA],
        spindle: Spindle::Unknown,
        is_per_turn: false,
    }
}

fn between(from: &[f64; 6], to: &[f64; 6], share: f64) -> [f64; 6] {
    std::array::from_fn(|k| from[k] + share * (to[k] - from[k]))
}

#[test]
fn every_shipped_program_fits_its_machine() {
    for machine in MACHINES {
        let config = whole(machine);
        let programs = fs::read_dir(folder(machine).join("programs")).unwrap();
        for program in programs.map(|entry| entry.unwrap().path()) {
            let moves = motion::moves(&config, &program, None).unwrap();
            let found = preflight(&config.mechanisms, &moves).unwrap();
            assert!(found.fits(), "{}: {:?}", program.display(), found.breaks);
            assert_eq!(found.runnable, 1.0, "{}", program.display());
            let lines = &found.feeds_without_spindle;
            assert!(lines.is_empty(), "{}: {lines:?}", program.display());
        }
    }
}

#[test]
fn a_turn_counts_in_the_share_that_runs() {
    let mut config = config("hexapod");
    config.programmed[3].max = 10.0;
    let home = config.start;
    let turned = |x: f64, a: f64| [home[0] + x, home[1], home[2], a, home[4], home[5]];
    // The same rotation to A20, twice its limit: alone, and after legal moves.
    let alone = follow(&config, &[rapid(1, turned(0.0, 20.0))]);
    let behind = follow(&config, &[rapid(1, turned(10.0, 0.0)), rapid(2, turned(10.0, 20.0))]);
    for (found, line) in [(&alone, 1), (&behind, 2)] {
        assert_eq!((found.breaks[0].limit, found.breaks[0].line), (Limit::Axis.into(), line));
    }
    assert!((alone.runnable - 0.5).abs() < 1e-9, "{}", alone.runnable);
    let turn = 20.0_f64.to_radians() * config.machine.size() / 2.0;
    let expected = (10.0 + turn / 2.0) / (10.0 + turn);
    assert!((behind.runnable - expected).abs() < 1e-9, "{} for {expected}", behind.runnable);
}

/// The violated limit may not be the one that is nearer at the start.
#[test]
fn every_violated_axis_limit_is_reported_with_its_first_place_and_count() {
    let mut config = config("hexapod");
    for (axis, [low, high]) in config.programmed.iter_mut().zip([[-48.0, 56.0], [-20.0, 20.0]]) {
        (axis.min, axis.max) = (low, high);
    }
    let at = |x, y| [x, y, 250.0, 0.0, 0.0, 0.0];
    let ends = [at(-47.9, 0.0), at(57.0, 30.0), at(0.0, 0.0), at(0.0, -25.0), at(58.0, 0.0)];
    let moves: Vec<Move> = (1..).zip(ends).map(|(line, end)| rapid(line, end)).collect();
    let found = follow(&config, &moves);
    let [y, x] = found.breaks.as_slice() else { panic!("{:?}", found.breaks) };
    assert_eq!((y.part.as_str(), y.line, y.moves), ("axis Y", 2, 2));
    assert!((y.pose[1] - 20.0).abs() < 1e-9, "{y:?}");
    assert_eq!((x.part.as_str(), x.line, x.moves), ("axis X", 2, 2));
    assert!((x.pose[0] - 56.0).abs() < 1e-9, "{x:?}");
    let used = |part: &str| found.ranges.iter().find(|range| range.part == part).unwrap();
    assert_eq!((used("axis X").used, used("axis X").allowed), ([-47.9, 58.0], [-48.0, 56.0]));
    assert_eq!(used("axis Y").used, [-25.0, 30.0]);
    assert_eq!(found.ranges.len(), 12);
    // Ends of the range of a strut are at ends of moves here; it is reported to first order over pieces
    // that are cut to a hundredth of the range, some 10 mm.
    let reach = Reach::new(&config).unwrap();
    let struts = ends.iter().chain([&config.home]).map(|end| reach.joints(end).unwrap()[0]);
    let (low, high) = struts.fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
    let [least, most] = used("strut 0").used;
    assert!((least - low).abs() < 1.0 && (most - high).abs() < 1.0, "{least} {low} {most} {high}");
}

#[test]
fn a_move_with_good_ends_breaks_in_its_middle() {
    let mut rng = Pcg64::seed_from_u64(51);
    for machine in unchained() {
        let mut config = config(machine);
        let whole = range(&config);
        let values = |config: &Mechanism, pose: &[f64; 6]| {
            Reach::new(config).unwrap().joints(pose).unwrap_or([f64::NAN; MAX_JOINTS])
        };
        // A joint that is farther out at the center than at both ends, by a share of its range.
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
                // The path there must keep the limit.
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
        let first = found.breaks.iter().find(|message| message.limit == Limit::JointRange);
        let Some(message) = first else { panic!("{machine}: {found:?}") };
        assert_eq!(message.line, 2, "{machine}: {message:?}");
        let there = values(&config, &message.pose)[joint];
        // A piece is 1e-6 of the size; joints move at most some ten times as far as the pose.
        assert!((there - limit).abs() < 1e-4 * config.machine.size(), "{machine}: {there}");
    }
}

/// Returns the machine with limits near the values of these moves: the extremes of a few poses of
/// it, or slightly beyond them.
fn narrowed(rng: &mut Pcg64, machine: &str, ends: &[[f64; 6]; 2]) -> Mechanism {
    let mut config = config(machine);
    let room = [0.0, 1e-6, 1e-4, 1e-2][rng.random_range(0..4)];
    let way = [config.home, ends[0], ends[1]];
    let poses: Vec<[f64; 6]> = way
        .windows(2)
        .flat_map(|w| (0..=8).map(|n| between(&w[0], &w[1], f64::from(n) / 8.0)))
        .collect();
    let machine = config.machine.clone();
    let seen: Vec<At> = poses
        .iter()
        .filter_map(|pose| machine.at(&Pose::from_degrees(*pose), &config.spindle).ok())
        .collect();
    let least = |of: &dyn Fn(&At) -> f64| seen.iter().map(of).fold(f64::INFINITY, f64::min);
    let distance = least(&|at| at.nearest().map_or(f64::INFINITY, |nearest| nearest.distance));
    let hold = least(&|at| at.smallest_singular_value()).min(1.0);
    let legs = 0..config.legs();
    let base: Vec<f64> = legs.clone().map(|i| -least(&|at| -at.cones().base[i])).collect();
    let platform: Vec<f64> = legs.map(|i| -least(&|at| -at.cones().platform[i])).collect();
    let tilt = -least(&|at| -at.tilt());
    let ranges: Vec<[f64; 2]> = (0..config.joints.len())
        .map(|i| [least(&|at| at.joints()[i]), -least(&|at| -at.joints()[i])])
        .collect();
    for (joint, [low, high]) in config.joints.iter_mut().zip(ranges) {
        let range = (joint.max - joint.min) * room;
        (joint.min, joint.max) = (low - range, high + range);
    }
    let widened = |angle: f64| Some(angle * (1.0 + room) + 1e-3);
    for ((leg, base), platform) in config.angles.iter_mut().zip(base).zip(platform) {
        leg.cones = [base, platform].map(widened);
    }
    config.tilt_limit = widened(tilt);
    // Machines whose legs all meet have no distance.
    config.clearance = distance.is_finite().then_some(distance * (1.0 - room));
    config.conditioning_limit = hold * (1.0 - room);
    config
}

/// Returns the margin of the single pose at a share of the move from `from`, as a share of the
/// range of the nearest limit: negative beyond it.
fn margin(config: &Mechanism, reach: &Reach, from: &[f64; 6], step: &Move, share: f64) -> f64 {
    let pose = between(from, &step.end, share);
    let Ok(at) = reach.at(&pose) else { return -1.0 };
    let mut least = f64::INFINITY;
    limits::each(&at, &limits::beyond_axes(config), |margin| {
        least = least.min(margin.room() / margin.scale());
    });
    least
}

/// Searches for a pose of a move beyond a limit: anywhere, and then nearer and nearer to the least margin
/// found. Returns the number of sampled poses, and whether one was beyond.
fn hunted(
    rng: &mut Pcg64,
    config: &Mechanism,
    reach: &Reach,
    from: &[f64; 6],
    step: &Move,
) -> (usize, bool) {
    const ANYWHERE: usize = 60;
    const NEARER: usize = 60;
    let (mut place, mut least) = (0.5, f64::INFINITY);
    let mut width = 1.0;
    for n in 0..ANYWHERE + NEARER {
        let near = if n < ANYWHERE { 0.5 } else { place };
        let share = (near + width * (rng.random::<f64>() - 0.5)).clamp(0.0, 1.0);
        let found = margin(config, reach, from, step, share);
        if found < least {
            (place, least) = (share, found);
        } else if n >= ANYWHERE {
            width *= 0.9;
        }
    }
    (ANYWHERE + NEARER, least < 0.0)
}

/// Tests a machine with two moves and limits near them: returns whether they fit by preflight, the number of sampled
/// poses, and whether one was beyond a limit.
fn trial(machine: &str, seed: u64) -> (bool, usize, bool) {
    let mut rng = Pcg64::seed_from_u64(seed);
    let whole = range(&config(machine));
    let ends = [(); 2].map(|()| whole.at(std::array::from_fn(|_| rng.random())));
    let config = narrowed(&mut rng, machine, &ends);
    let moves = [rapid(1, ends[0]), rapid(2, ends[1])];
    let found = follow(&config, &moves);
    let fits = found.fits();
    let reach = Reach::new(&config).unwrap();
    let (mut poses, mut seen) = (0, false);
    for (from, step) in [config.home, ends[0]].iter().zip(&moves) {
        let (looked_at, beyond) = hunted(&mut rng, &config, &reach, from, step);
        poses += looked_at;
        seen |= beyond;
    }
    assert!(!(fits && seen), "{machine}, seed {seed}: {ends:?}");
    (fits, poses, seen)
}

#[test]
fn no_pose_between_leaves_a_limit_that_is_said_to_be_kept() {
    let trials: Vec<(&str, u64)> =
        (0..cases(500)).map(|n| (MACHINES[n % MACHINES.len()], n as u64)).collect();
    let found: Vec<_> = trials.par_iter().map(|(machine, seed)| trial(machine, *seed)).collect();
    let fitting = found.iter().filter(|(fits, ..)| *fits).count();
    let looked_at: usize = found.iter().filter(|(fits, ..)| *fits).map(|(_, poses, _)| poses).sum();
    let broken = found.iter().filter(|(.., seen)| *seen).count();
    let alarms = found.iter().filter(|(fits, _, seen)| !fits && !seen).count();
    println!(
        "{fitting} fit ({looked_at} poses), {broken} broken, {alarms} reported but not sampled"
    );
    assert!(looked_at >= 20_000 && broken > 100, "{looked_at} {broken}");
}

/// Limits of the rods' distance and of the conditioning halfway between the ends of a move and
/// its center.
#[test]
fn rods_too_near_and_poses_near_a_singularity_are_reported_with_place_and_amount() {
    let mut config = config("hexapod");
    let far = [120.0, 0.0, 220.0, 0.0, 0.0, 0.0];
    let near = [0.0, 0.0, 220.0, 20.0, 0.0, 15.0];
    let moves = [rapid(1, far), rapid(2, near), rapid(3, far)];
    let reach = Reach::new(&config).unwrap();
    let seen = |pose: &[f64; 6]| {
        let at = reach.at(pose).unwrap();
        (at.nearest().unwrap(), at.smallest_singular_value())
    };
    let ((away, good), (gap, bad)) = (seen(&far), seen(&near));
    let (limit, hold) = ((away.distance + gap.distance) / 2.0, (good + bad) / 2.0);
    assert!(away.distance > limit + 0.3 && good > hold + 0.01, "{away:?} {gap:?} {good} {bad}");
    drop(reach);
    (config.clearance, config.conditioning_limit) = (Some(limit), hold);
    let found = follow(&config, &moves);
    let message = |limit| found.breaks.iter().find(|message| message.limit == limit).unwrap();
    let (rods, held) = (message(Limit::Clearance), message(Limit::Conditioning));
    assert_eq!((rods.line, held.line), (2, 2));
    let [i, j] = gap.pair;
    assert!(rods.text.contains(&format!("legs {i} and {j}")), "{}", rods.text);
    let amount = format!("by {:.4} mm", limit - gap.distance);
    assert!(rods.text.contains(&amount), "{} {amount}", rods.text);
    assert!(held.text.contains(&format!("conditioning {bad:.4}")), "{} {bad}", held.text);
    let reach = Reach::new(&config).unwrap();
    // Accurate to a millionth of the size; neither changes faster than the pose.
    let least = reach.at(&rods.pose).unwrap().nearest().unwrap().distance;
    assert!((least - limit).abs() < 1e-2, "{least} {limit}");
    let there = reach.conditioning(&held.pose);
    assert!((there - hold).abs() < 1e-4, "{there} {hold}");
}

#[test]
fn a_singular_pose_between_is_never_missed() {
    let mut rng = Pcg64::seed_from_u64(53);
    for machine in ["hexapod", "lab-hexapod"] {
        let mut config = config(machine);
        let whole = range(&config);
        for joint in &mut config.joints {
            (joint.min, joint.max) = (-1e9, 1e9);
        }
        config.angles.iter_mut().for_each(|leg| leg.cones = [None; 2]);
        (config.conditioning_limit, config.clearance) = (1e-9, Some(1e-9));
        config.axes[3..].iter_mut().for_each(|axis| (axis.min, axis.max) = (-180.0, 180.0));
        // Only reach and singular poses can be violated.
        let side = |pose: &[f64; 6]| {
            config
                .machine
                .at(&Pose::from_degrees(*pose), &config.spindle)
                .and_then(|at| at.assembly())
                .unwrap_or(0)
        };
        let mut crossed = 0;
        for _ in 0..400 {
            let mut end = whole.at(std::array::from_fn(|_| rng.random()));
            end[3..].iter_mut().for_each(|angle| *angle = rng.random_range(-120.0..120.0));
            let found = follow(&config, &[rapid(1, config.home), rapid(2, end)]);
            // The determinant has the other sign there, so it is 0 between.
            if side(&end) != side(&config.home) {
                assert!(!found.fits(), "{machine}: {end:?}");
                crossed += 1;
            }
        }
        assert!(crossed > 20, "{machine}: {crossed}");
    }
}

#[test]
fn a_rapid_down_to_the_machines_own_zero_is_reported() {
    let delta = config("linear-delta");
    let at = |z: f64| [0.0, 0.0, z, 0.0, 0.0, 0.0];
    let cut = |line, z| Move { kind: MoveKind::Feed, ..rapid(line, at(z)) };
    // Reported from home and from the work; not a feed to Z0, a rapid to just above it or a rapid along it.
    let moves = [
        rapid(1, at(0.0)),
        rapid(2, at(40.0)),
        cut(3, 0.0),
        rapid(4, at(40.0)),
        rapid(5, at(0.001)),
        rapid(6, at(30.0)),
        rapid(7, at(0.0)),
        rapid(8, [10.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    ];
    assert_eq!(follow(&delta, &moves).rapids_to_zero, [(0, 1), (0, 7)]);
    // If home is at Z0, a rapid to it is intended.
    let pentapod = config("pentapod");
    let moves = [rapid(1, at(20.0)), rapid(2, at(0.0))];
    assert_eq!(follow(&pentapod, &moves).rapids_to_zero, []);
}

#[test]
fn a_feed_with_a_new_tool_and_a_standing_spindle_is_reported_once() {
    let hexapod = config("hexapod");
    let step = |line: u32, kind, spindle, length| {
        let end = [0.0, 0.0, 220.0 - f64::from(line), 0.0, 0.0, 0.0];
        Move { kind, spindle, tool: [0.0, 0.0, length], ..rapid(line, end) }
    };
    let (turning, standing) = (Spindle::Turning(6000.0), Spindle::Standing(6000.0));
    let turned =
        Move { end: [0.0, 0.0, 214.0, 0.0, 0.0, 5.0], ..step(7, MoveKind::Feed, standing, 65.0) };
    let moves = [
        // A program that does not turn the spindle may do without one.
        step(1, MoveKind::Feed, Spindle::Standing(0.0), 40.0),
        step(2, MoveKind::Feed, turning, 40.0),
        // With the same tool after M5, and without a tool.
        step(3, MoveKind::Feed, standing, 40.0),
        step(4, MoveKind::Feed, standing, 0.0),
        step(5, MoveKind::Rapid, standing, 65.0),
        step(6, MoveKind::Probe, standing, 65.0),
        turned,
        step(8, MoveKind::Feed, standing, 65.0),
        step(9, MoveKind::Feed, standing, 65.0),
        step(10, MoveKind::Feed, turning, 40.0),
        step(11, MoveKind::Feed, Spindle::Unknown, 65.0),
        step(12, MoveKind::Feed, standing, 65.0),
    ];
    assert_eq!(follow(&hexapod, &moves).feeds_without_spindle, [(0, 8), (0, 12)]);
}

#[test]
fn a_tool_offset_at_a_tilt_is_reported_and_followed() {
    let mut config = config("hexapod");
    let tilted = [0.0, 0.0, 220.0, 20.0, 0.0, 0.0];
    let longer = |line, z| Move { tool: [0.0, 0.0, z], ..rapid(line, tilted) };
    let level = [0.0, 0.0, 220.0, 0.0, 0.0, 0.0];
    let found = follow(&config, &[longer(1, 0.0), longer(2, 60.0), rapid(3, level)]);
    assert!(found.fits(), "{:?}", found.breaks);
    assert_eq!(found.tilted_tool_changes, [(0, 2), (0, 3)]);
    let found =
        follow(&config, &[rapid(1, level), Move { tool: [0.0, 0.0, 60.0], ..rapid(2, level) }]);
    assert!(found.tilted_tool_changes.is_empty());
    // The path due to the offset ends where the pose with the new tool has its joints.
    let joints = |z| {
        let tool = config.spindle + Vector3::new(0.0, 0.0, z);
        Reach::with_tool(&config, tool).unwrap().joints(&tilted).unwrap()
    };
    let (before, after) = (joints(0.0), joints(60.0));
    // A strut that becomes longer from home to the tilted pose, and due to the tool.
    let joint = (0..6).find(|i| after[*i] > before[*i] + 10.0).unwrap();
    config.joints[joint].max = (before[joint] + after[joint]) / 2.0;
    let found = follow(&config, &[longer(1, 0.0), longer(2, 60.0)]);
    assert!(
        found.breaks.iter().any(|message| message.limit == Limit::JointRange),
        "{:?}",
        found.breaks
    );
    config.joints[joint].max = after[joint] + 1e-3;
    let found = follow(&config, &[longer(1, 0.0), longer(2, 60.0)]);
    assert!(found.fits(), "{:?}", found.breaks);
}

#[test]
fn a_long_program_is_followed_quickly() {
    let program = Path::new(LINUXCNC_PROGRAMS).join("3D_Chips.ngc");
    let config = config("hexapod");
    let offset = Offset { shift: [0.0, 0.0, 140.0], turn: 0.0 };
    let moves = motion::moves(&config.clone().into(), &program, Some(&offset.block())).unwrap();
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

/// Checks, as `pkm` does, moves of a program with an offset found for it.
fn refitted(config: &Mechanism, program: &Path, offset: &Offset) -> Preflight {
    follow(config, &motion::moves(&config.clone().into(), program, Some(&offset.block())).unwrap())
}

#[test]
fn an_offset_that_is_found_makes_the_program_fit() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("slot.ngc");
    // In another, rotated coordinate system, with its own offset, and with G92.
    let text = "G21 G90\nG55\nG0 X0 Y0 Z0\nG92 X1 Y2 Z3\nG1 X190 F3000\nG1 Y22\nG92.1\nM2\n";
    fs::write(&program, text).unwrap();
    let ini = folder.path().join("linear-delta.ini");
    let text = fs::read_to_string(&config("linear-delta").file).unwrap();
    let line = |line: &str| match line.starts_with("RS274NGC_STARTUP_CODE") {
        true => "RS274NGC_STARTUP_CODE = G10 L2 P2 X-90 Y-30 Z50 R10 G55\n".into(),
        false => format!("{line}\n"),
    };
    fs::write(&ini, text.lines().map(line).collect::<String>()).unwrap();
    let mut config = test_support::shipped::first_of(&ini);
    let facts = Arc::make_mut(&mut config.facts);
    (facts.program.tool_table, facts.program.parameter_file) = (None, None);
    let moves = motion::moves(&config.clone().into(), &program, None).unwrap();
    assert!(!follow(&config, &moves).fits() && follow(&config, &moves).poses.may_turn(&config));
    // 189 mm long while X and Y have 160 each: no shift is sufficient, the diagonal is.
    assert_eq!(
        work_offset::shift(&config, &follow(&config, &moves).poses, &mut |_| true).unwrap(),
        None
    );
    let offset =
        work_offset::turn(&config, &follow(&config, &moves).poses, &mut |_| true).unwrap().unwrap();
    assert!(offset.turn != 0.0, "{offset:?}");
    let found = refitted(&config, &program, &offset);
    assert!(found.fits(), "{offset:?} {:?}", found.breaks);
    // A tilted platform would not rotate with the workpiece.
    let hexapod = test_support::shipped::config("hexapod");
    let tilted = follow(&hexapod, &[rapid(1, [0.0, 0.0, 220.0, 5.0, 0.0, 0.0])]).poses;
    assert!(!tilted.may_turn(&hexapod));
}

/// Programs of random positions that do not fit: any offset found for them is correct.
#[test]
fn random_programs_fit_where_they_are_put() {
    let mut rng = Pcg64::seed_from_u64(54);
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("random.ngc");
    let (mut shifted, mut turned) = (0, 0);
    for machine in ["linear-delta", "lab-hexapod", "tripod"] {
        let config = config(machine);
        let whole = range(&config);
        let middle = whole.at([0.5; 6]);
        for n in 0..cases(4) {
            // Away from the center, or longer than X in every second case.
            let (away, long) = if n % 2 == 0 { (0.5, 0.6) } else { (0.0, 1.1) };
            let units = if config.units_per_mm == 1.0 { "G21" } else { "G20" };
            let mut text = format!("{units} G90 G64\n");
            for turn in 0..6 {
                let wide = |k: usize| whole.high[k] - whole.low[k];
                let end = if turn % 2 == 0 { -0.5 } else { 0.5 };
                let x = middle[0] + (away + end * long * rng.random_range(0.9..1.0)) * wide(0);
                let y = middle[1] + 0.1 * (rng.random::<f64>() - 0.5) * wide(1);
                text += &format!("G1 X{x:.4} Y{y:.4} Z{:.4} F600\n", middle[2]);
            }
            text += "M2\n";
            fs::write(&program, &text).unwrap();
            let moves = motion::moves(&config.clone().into(), &program, None).unwrap();
            if follow(&config, &moves).fits() {
                continue;
            }
            let (offset, count) =
                match work_offset::shift(&config, &follow(&config, &moves).poses, &mut |_| true)
                    .unwrap()
                {
                    Some(offset) => (Some(offset), &mut shifted),
                    None => (
                        work_offset::turn(&config, &follow(&config, &moves).poses, &mut |_| true)
                            .unwrap(),
                        &mut turned,
                    ),
                };
            let Some(offset) = offset else { continue };
            *count += 1;
            let found = refitted(&config, &program, &offset);
            assert!(found.fits(), "{text} {offset:?} {found:?}");
        }
    }
    println!("{shifted} fit shifted, {turned} turned");
    assert!(shifted > 0 && turned > 0, "{shifted} {turned}");
}

/// Counts pieces, not seconds.
#[test]
fn the_effort_grows_with_the_length_of_the_path() {
    let config = config("hexapod");
    let round = |turns: u32| -> Vec<Move> {
        let at = |n: u32| {
            let turn = f64::from(n) * 0.1;
            // Slightly smaller in every turn, so that no part of the path repeats.
            let radius = 60.0 - 1e-3 * f64::from(n);
            [radius * turn.cos(), radius * turn.sin(), 220.0, 10.0 * turn.sin(), 0.0, 0.0]
        };
        (0..63 * turns).map(|n| rapid(n, at(n))).collect()
    };
    let [short, long] = [2, 20].map(|turns| follow(&config, &round(turns)));
    assert!(short.fits() && long.fits());
    let path = long.length / short.length;
    let effort = long.pieces as f64 / short.pieces as f64;
    assert!(path > 5.0 && effort < 1.1 * path, "{effort} {path}");
    // The same path in ten times as many moves needs no more pieces than moves.
    let fine: Vec<Move> = round(2)
        .windows(2)
        .flat_map(|w| {
            (1..=10).map(|n| rapid(1, between(&w[0].end, &w[1].end, f64::from(n) / 10.0)))
        })
        .collect();
    let fine_pieces = follow(&config, &fine).pieces;
    assert!(fine_pieces <= short.pieces + 2 * fine.len(), "{fine_pieces} {}", short.pieces);
}
