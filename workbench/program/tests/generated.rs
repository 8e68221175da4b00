// SPDX-License-Identifier: GPL-2.0-or-later
//! Generated machines: travel, and programs in virtual time, compared with the equations of their legs.

use kinematics::{Limit, Vector3};
use linuxcnc::process::{Options, run};
use linuxcnc::row::{Ending, Row};
use machine::read::machine::MachineConfig;
use program::preflight::judge;
use program::report::{Rule, Time};
use program::travel::{Stand, travel};
use rand::Rng;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use test_support::generated::{ALL, Generated, LETTERS, generated};

/// Number of poses sampled along a path.
const LOOKS: u32 = 100;

/// Share of a limit's range that may be rounding.
const ROUNDED: f64 = 1e-9;

/// Tolerance for joints in virtual time, relative to the machine's size: they pass through text of 15 digits and
/// LinuxCNC's cubic smoothing.
const SAME: f64 = 1e-10;

fn read(drawn: &Generated) -> (tempfile::TempDir, MachineConfig) {
    let folder = tempfile::tempdir().unwrap();
    let config = MachineConfig::read(&drawn.write(folder.path())).unwrap();
    (folder, config)
}

/// Returns the least share of range left of all mechanisms at a pose of LinuxCNC.
fn room(drawn: &Generated, world: &[f64; 9], tools: &[Vector3<f64>]) -> f64 {
    let rooms = drawn.mechanisms.iter().enumerate().map(|(n, built)| {
        let (pose, tool) = drawn.platform(n, world, &tools[n]);
        built.room(&pose, &tool, drawn.tilt_limit)
    });
    let extra = drawn.extra.iter().map(|extra| {
        let (value, joint) = (world[place(extra.axis.letter)], &extra.joint);
        (value - joint.min).min(joint.max - value) / (joint.max - joint.min)
    });
    rooms.chain(extra).fold(f64::INFINITY, f64::min)
}

fn place(letter: char) -> usize {
    LETTERS.iter().position(|own| *own == letter).unwrap()
}

#[test]
fn travel_ends_at_the_limit_that_it_names_and_at_none_before() {
    let mut ended = [0; 3];
    for seed in ALL {
        let mut drawn = generated(seed);
        let (_folder, config) = read(&drawn);
        for n in 0..4 {
            let tools = drawn.tools(n % 3);
            let world = if n == 0 { drawn.home } else { drawn.world(0.6) };
            if room(&drawn, &world, &tools) < ROUNDED {
                continue;
            }
            let stand = Stand { world, tools: [tools[0], *tools.last().unwrap()] };
            if n == 0 {
                assert_eq!(stand, Stand::home(&config), "{}", drawn.name);
            }
            let found = travel(&config, &stand).unwrap();
            let letters: String =
                LETTERS.iter().filter(|l| drawn.letters().contains(**l)).collect();
            assert_eq!(found.iter().map(|way| way.letter).collect::<String>(), letters);
            let own = drawn.mechanisms.iter().flat_map(|built| &built.axes);
            let axes: Vec<_> = own.chain(drawn.extra.iter().map(|extra| &extra.axis)).collect();
            for way in &found {
                let message = |side: &str| format!("{} {n} {side}: {way:?}", drawn.name);
                let axis = axes.iter().find(|axis| axis.letter == way.letter).unwrap();
                let unit =
                    if "ABC".contains(way.letter) { "degrees" } else { config.length_unit() };
                assert_eq!(way.unit, unit, "{}", message(""));
                let k = place(way.letter);
                for (side, sign, end) in [(&way.minus, -1.0, axis.min), (&way.plus, 1.0, axis.max)]
                {
                    let left = side.left.unwrap();
                    let at = |left: f64| {
                        let mut world = world;
                        world[k] += sign * left;
                        room(&drawn, &world, &tools)
                    };
                    for look in 0..LOOKS {
                        let share = f64::from(look) / f64::from(LOOKS);
                        assert!(at(share * left) > -ROUNDED, "{} at {share}", message("before"));
                    }
                    let stop = side.stop.as_ref().unwrap();
                    let to_axis = sign * (end - world[k]);
                    if stop.starts_with("axis ") && stop.contains("axis range") {
                        assert!(
                            stop.starts_with(&format!("axis {}:", way.letter)),
                            "{}",
                            message("")
                        );
                        assert!((left - to_axis).abs() < 1e-9 * axis.max.abs().max(1.0));
                        ended[0] += 1;
                        continue;
                    }
                    assert!(left < to_axis, "{}", message("beyond its axis"));
                    if stop.contains("joint range") || stop.contains("tilt") {
                        // Travel resolves a 10,000th of the machine's size, or of a turn.
                        let resolved = if k < 6 && k > 2 { 0.05 } else { 0.1 * drawn.unit };
                        assert!(at(left + resolved) < ROUNDED, "{}", message("behind"));
                        ended[1] += 1;
                    } else {
                        ended[2] += 1;
                    }
                }
            }
        }
    }
    println!("{ended:?}");
    assert!(ended[0] > 200 && ended[1] > 20, "{ended:?}");
}

/// Returns a program of straight moves with two tools, and the poses at their ends with the tool of each.
fn program(drawn: &mut Generated) -> (String, Vec<([f64; 9], usize)>) {
    let units = if drawn.unit == 1.0 { "G21" } else { "G20" };
    let mut text = format!("{units} G90 G94 G61\n");
    let share = [0.4, 0.95][drawn.rng.random_range(0..2)];
    let mut poses = vec![];
    for tool in [1, 2] {
        let _ = writeln!(text, "T{tool} M6 G43");
        for world in [drawn.world(share), drawn.world(share), drawn.home] {
            let _ = writeln!(text, "G1{} F{}", drawn.words(&world, tool), 1500.0 * drawn.unit);
            poses.push((world, tool));
        }
    }
    (text + "M2\n", poses)
}

#[test]
fn programs_are_judged_and_run_as_the_equations_have_it() {
    let [mut fitting, mut left] = [0; 2];
    for seed in ALL {
        let mut drawn = generated(seed);
        let (folder, config) = read(&drawn);
        let (text, poses) = program(&mut drawn);
        let file = folder.path().join("program.ngc");
        std::fs::write(&file, &text).unwrap();
        let mut last: Vec<Row> = vec![];
        let mut fastest = vec![0.0_f64; config.guarded_joints()];
        let judged = judge(&config, &file, &Options::default(), &mut |row| {
            if let Some(before) = last.last().filter(|before| before.flags.on) {
                for (n, most) in fastest.iter_mut().enumerate() {
                    *most = most.max((row.joints[n] - before.joints[n]).abs() / config.period);
                }
            }
            last.push(*row);
            if last.len() > 8 {
                last.remove(0);
            }
        });
        let found = judged.unwrap_or_else(|error| panic!("{}: {error}\n{text}", drawn.name)).found;
        let message = format!("{}: {:?}", drawn.name, found.breaks);
        assert!(found.time.is_whole() || !found.fits(), "{message}");
        let tools = drawn.tools(2);
        let mut least = f64::INFINITY;
        let mut from = drawn.home;
        for (to, tool) in &poses {
            for look in 0..=LOOKS {
                let share = f64::from(look) / f64::from(LOOKS);
                let world = std::array::from_fn(|k| from[k] + share * (to[k] - from[k]));
                least = least.min(room(&drawn, &world, &drawn.tools(*tool)));
            }
            from = *to;
        }
        let is_known = |rule: Rule| matches!(rule, Rule::Limit(Limit::Tilt | Limit::JointRange));
        let is_told = found.breaks.iter().any(|message| is_known(message.limit));
        if found.fits() {
            assert!(least > -ROUNDED, "{} fits, and leaves a limit by {least}", drawn.name);
            fitting += 1;
        }
        if least < -ROUNDED {
            assert!(!found.fits(), "{message}");
            left += 1;
        }
        if let (Time::Judged(timing), true) = (&found.time, found.fits()) {
            // A speed is the difference of two commands; cycles during the tool change, at rest, do not count.
            for (peak, fastest) in timing.speeds.iter().zip(&fastest) {
                let share = peak.value / fastest;
                assert!((0.999..1.001).contains(&share), "{}: {peak:?} {fastest}", drawn.name);
            }
            for extra in &drawn.extra {
                let part = format!("axis {}", extra.axis.letter);
                let range = found.ranges.iter().find(|range| range.part == part).unwrap();
                let used = range.used;
                let (joint, axis) = (&extra.joint, &extra.axis);
                assert_eq!(range.allowed, [joint.min.max(axis.min), joint.max.min(axis.max)]);
                let values = poses.iter().map(|(world, _)| world[place(extra.axis.letter)]);
                let ends = values.fold([extra.joint.home; 2], |[a, b], v| [a.min(v), b.max(v)]);
                // With G61, a move counts as done slightly before its end.
                let off = [0, 1].map(|end| (used[end] - ends[end]).abs());
                assert!(off[0].max(off[1]) < 1e-3, "{}: {used:?} {ends:?}", drawn.name);
            }
        }
        // A violation is reported if a piece of a move cannot be proved: a millionth of the size.
        assert!(!is_told || least < 1e-4, "{least}: {message}");
        // If every pose is reachable, LinuxCNC ends at the program's end.
        let end = last.last().unwrap();
        let stood = last.iter().all(|row| row.extra.world == end.extra.world);
        if !found.fits() || !stood {
            continue;
        }
        let world = end.extra.world;
        for (k, value) in world.iter().enumerate() {
            assert!((value - drawn.home[k]).abs() < 1e-6, "{}: {world:?}", drawn.name);
        }
        let at = [Vector3::from(end.tool), Vector3::from(end.second.tool)];
        for (own, known) in at.iter().zip(&tools) {
            assert!((own - known).norm() < 1e-9, "{}: {own} {known}", drawn.name);
        }
        let joints = drawn.joints(&world, &at).unwrap();
        let (legs, extra) = joints.split_at(config.guarded_joints());
        let found = end.joints.iter().take(legs.len()).chain(&end.extra.positions);
        let size = config.first().machine.size().max(360.0);
        for (n, (wanted, own)) in legs.iter().chain(extra).zip(found).enumerate() {
            let off = (own - wanted).abs();
            assert!(off < SAME * size, "{}: joint {n} is off by {off}", drawn.name);
        }
    }
    println!("{fitting} fit, {left} leave a limit");
    assert!(fitting > 4 && left > 3, "{fitting} {left}");
}

/// Checks that a single letter moves at the programmed feed, the axis' speed or the machine's speed, which are in units
/// per minute or second, and that cycles have the period of the file.
#[test]
fn a_letter_alone_takes_the_time_of_its_feed_and_acceleration() {
    let mut timed = 0;
    for seed in 0..12 {
        let drawn = generated(seed);
        let (folder, config) = read(&drawn);
        let units = if drawn.unit == 1.0 { "G21" } else { "G20" };
        let mut text = format!("{units} G90 G94 G61\n");
        let own = drawn.mechanisms.iter().flat_map(|built| &built.axes);
        let axes: Vec<_> = own.chain(drawn.extra.iter().map(|extra| &extra.axis)).collect();
        let mut moves = vec![];
        for (n, axis) in axes.iter().enumerate() {
            let is_angle = "ABC".contains(axis.letter);
            let of = usize::from(is_angle);
            let most = drawn.velocity[of].min(axis.velocity);
            // LinuxCNC uses the machine's acceleration for some moves, and not for others.
            let brakes = [axis.acceleration, drawn.acceleration[of].min(axis.acceleration)];
            // Every other letter moves slower than its axis allows.
            let speed = if n % 2 == 0 { 0.3 * most } else { 2.0 * most };
            let from = drawn.home[place(axis.letter)];
            let to = from + 0.3 * (axis.max - from);
            let mut world = drawn.home;
            world[place(axis.letter)] = to;
            // Joints near their limits, or far from an axis that turns the work or the tool, may be too fast for
            // their drives.
            let carries =
                drawn.extra.iter().any(|e| e.axis.letter == axis.letter && !e.carries.is_empty());
            if (is_angle && carries) || room(&drawn, &world, &drawn.tools(0)) < 0.15 {
                continue;
            }
            let _ = writeln!(
                text,
                "G1 {}{to:.9} F{:.9}\nG1 {}{from:.9}",
                axis.letter,
                speed * 60.0,
                axis.letter
            );
            let (way, speed) = (to - from, speed.min(most));
            let seconds = brakes.map(|brake| match speed * speed / brake < way {
                true => way / speed + speed / brake,
                false => 2.0 * (way / brake).sqrt(),
            });
            moves.push((place(axis.letter), seconds));
        }
        let file = folder.path().join("letters.ngc");
        std::fs::write(&file, text + "M2\n").unwrap();
        let (mut before, mut cycles) = (None::<Row>, [0_u32; 9]);
        let outcome = run(&config, &file, &Options::default(), |row| {
            if let Some(before) = before {
                for k in 0..9 {
                    cycles[k] += u32::from(row.extra.world[k] != before.extra.world[k]);
                }
            }
            before = Some(*row);
            ControlFlow::Continue(())
        });
        let outcome = outcome.unwrap();
        assert_eq!(outcome.ending, Ending::Finished, "{}: {:?}", drawn.name, outcome.messages);
        timed += moves.len();
        for (k, seconds) in moves {
            // There and back. LinuxCNC is never faster than a trapezoidal profile; it begins to brake slightly earlier,
            // and rounds its parts to whole cycles.
            let found = f64::from(cycles[k]) * config.period / 2.0;
            let least = 0.99 * seconds[0] - 4.0 * config.period;
            let most = 1.1 * seconds[1] + 4.0 * config.period;
            let message = format!("{} {}: {found} s, not {seconds:?}", drawn.name, LETTERS[k]);
            assert!(found > least && found < most, "{message}");
        }
    }
    assert!(timed > 40, "{timed}");
}
