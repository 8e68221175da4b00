// SPDX-License-Identifier: GPL-2.0-or-later
//! Extra axes in LinuxCNC itself, in virtual time.

use kinematics::{Limit, Pose};
use linuxcnc::process::Options;
use linuxcnc::row::{Ending, Row};
use program::loads::Loads;
use program::motion;
use program::preflight::judge;
use program::replay::replay;
use program::report::{Preflight, Rule};
use program::verdict;
use test_support::control::{run, run_text, standing};
use test_support::shipped::{config, folder, whole};

const LATHE: &str = "lathe-counter-spindle";

/// Returns the values of C and W.
fn values(row: &Row) -> [f64; 2] {
    [row.extra.positions[0], row.extra.positions[1]]
}

#[test]
fn the_work_turns_with_the_feed_of_the_helix_in_every_cycle() {
    let (outcome, rows) = run(LATHE, &folder(LATHE).join("programs/helix.ngc"));
    assert_eq!(outcome.ending, Ending::Finished, "{:?}", outcome.messages);
    let config = config(LATHE);
    // The position of the platform by the joints: LinuxCNC smooths their commands, including that of C, which
    // are then two cycles behind the pose. Work zero at Z 1000, the groove from Z-10 on, 12 a turn.
    let turned = |row: &Row| {
        let (seed, tool) = (Pose::from_degrees(row.pose), row.tool.into());
        let found = config.machine.forward(&row.joints, &seed, &tool, &config.solver).unwrap();
        (1000.0 - 10.0 - found.pose.position.z) / 12.0 * 360.0
    };
    let helix: Vec<&Row> = rows.iter().filter(|row| values(row)[0] > 0.0).collect();
    assert!(helix.len() > 15_000, "{} cycles: eight seconds there and back", helix.len());
    for row in &helix {
        // Forward stops if rods are accurate to 1e-9 mm, and 1 mm is 30 degrees.
        let gap = (values(row)[0] - turned(row)).abs();
        assert!(gap < 1e-7, "cycle {}: C is off by {gap} degrees", row.cycle);
        assert_eq!(row.pose[5], 0.0, "C is none of the tool");
    }
    let most = helix.iter().map(|row| values(row)[0]).fold(0.0, f64::max);
    // G61 treats a move as finished slightly before its end.
    assert!((most - 1440.0).abs() < 1e-3, "{most}");
}

#[test]
fn the_counter_spindle_comes_and_goes_while_the_platform_stands() {
    let (outcome, rows) = run(LATHE, &folder(LATHE).join("programs/both-sides.ngc"));
    assert_eq!(outcome.ending, Ending::Finished, "{:?}", outcome.messages);
    let first = rows.first().expect("cycles");
    assert_eq!(values(first), [0.0, 800.0]);
    let least = rows.iter().map(|row| values(row)[1]).fold(f64::INFINITY, f64::min);
    assert_eq!(least, 150.0);
    assert_eq!(rows.last().map(values), Some([0.0, 800.0]));
}

/// If only the counter-spindle moves, `pkm replay` includes the time that its axis needs.
#[test]
fn a_block_of_an_extra_axis_alone_takes_its_time() {
    let config = config(LATHE);
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    std::fs::write(file.path(), "G21 G90 G94\nG1 Z950 F3000\nG0 W500\nG1 W400\nM2\n").unwrap();
    let moves = motion::moves(&config.clone().into(), file.path(), None).unwrap();
    let home = config.extra[1].joint.home;
    // At [TRAJ]MAX_LINEAR_VELOCITY, which is less than the axis speed.
    let rapid = (500.0 - home).abs() / config.max_velocity[0];
    let found = replay(&config, &moves, 0.001).unwrap();
    // 50 mm of Z and 100 mm of W at 50 mm/s are added.
    assert!((found.time - rapid - 3.0).abs() < 0.002, "{} {rapid}", found.time);
    assert_eq!(found.moves, 3);
}

#[test]
fn preflight_judges_their_ranges_speeds_and_limits() {
    let config = config(LATHE);
    let judged = |text: &str| {
        let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
        std::fs::write(&file, text).unwrap();
        judge(&config.clone().into(), file.path(), &Options::default(), &mut |_| ()).unwrap().found
    };
    let good = judged("G21 G90 G61\nG0 W300 C90\nG1 F3000 C-45 W800\nM2\n");
    assert!(good.breaks.is_empty(), "{:?}", good.breaks);
    let used = |part: &str| {
        let range = good.ranges.iter().find(|range| range.part == part);
        range.unwrap_or_else(|| panic!("no {part}: {:?}", good.ranges)).used
    };
    // LinuxCNC treats a move as finished slightly before its end, and reverses there.
    let near = |used: [f64; 2], ends: [f64; 2]| {
        used.iter().zip(ends).all(|(used, end)| (used - end).abs() < 1e-4)
    };
    assert!(near(used("axis C"), [-45.0, 90.0]), "{:?}", used("axis C"));
    assert!(near(used("axis W"), [300.0, 800.0]), "{:?}", used("axis W"));
    let beyond = judged("G21 G90\nG0 W950\nM2\n");
    let reported: Vec<&str> = beyond.breaks.iter().map(|found| found.text.as_str()).collect();
    assert!(reported.iter().any(|text| text.contains("exceed W's positive limit")), "{reported:?}");
    // The move itself shows it as well, where it crosses the limit, with the value of W.
    let [low, high] = config.extra[1].range();
    let crossed = &beyond.breaks[0];
    assert_eq!((crossed.limit, crossed.part.as_str()), (Rule::Limit(Limit::JointRange), "axis W"));
    assert_eq!(
        crossed.text,
        format!("axis W violates its limit of {low} to {high} mm on this move by 50.0000 mm")
    );
    let (letter, value) = crossed.words[5];
    assert!(letter == 'W' && (value - high).abs() < 1e-9, "{:?}", crossed.words);
    let letters: String = crossed.words.iter().map(|(letter, _)| letter).collect();
    assert_eq!(letters, "XYZBCW");
    let margin = |found: &Preflight| {
        let of = found.margins.iter().find(|margin| margin.limit == Limit::JointRange).unwrap();
        (of.part.clone(), of.value)
    };
    let (part, value) = margin(&beyond);
    assert!(part == "axis W" && (value + 50.0).abs() < 1e-9, "{part} {value}");
    let near = judged("G21 G90 G61\nG0 W890\nM2\n");
    let (part, value) = margin(&near);
    assert!(
        near.fits() && part == "axis W" && (value - high + 890.0).abs() < 1e-9,
        "{part} {value}"
    );
    // LinuxCNC refuses the move before anything moves, although a part of it is within the limit.
    assert!(beyond.is_whole && beyond.runnable == 0.0, "{}", beyond.runnable);
    // A blend at which C reverses needs 1.5 times the acceleration of the axis.
    let helix = std::fs::read_to_string(folder(LATHE).join("programs/helix.ngc")).unwrap();
    let turning_back = judged(&helix.replace("G61\n", ""));
    let reported: Vec<&str> = turning_back.breaks.iter().map(|found| found.part.as_str()).collect();
    assert!(reported.contains(&"the acceleration of axis C"), "{reported:?}");
}

/// A block of one axis runs up to its limit and LinuxCNC stops at the error behind it: the ranges end there.
#[test]
fn ranges_up_to_a_stop_are_marked_and_the_path_ends_with_it() {
    let config = config(LATHE);
    let whole = config.clone().into();
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    // An arc whose radius is too small for its end stops the interpreter, with and without limits. M66 makes it wait for the
    // motion.
    let text = "G21 G90 G61\nG1 F3000 W700\nG1 W600\nM66 P0 L0\nG18 G2 X-50 Z950 R1\nG1 W300\nM2\n";
    std::fs::write(&file, text).unwrap();
    let verdict =
        verdict::judge(&whole, file.path(), &Options::default(), false, &mut |_| ()).unwrap();
    let used = verdict.found.ranges.iter().find(|range| range.part == "axis W").unwrap().used;
    assert!((used[0] - 600.0).abs() < 1e-4 && !verdict.found.is_whole, "{used:?}");
    let text = verdict.text();
    for line in text.lines().filter(|line| line.contains(" to spare: ") || line.contains(" of ")) {
        let is_of_time = line.contains("joint speed") || line.contains("joint acceleration");
        let how_far = if is_of_time { "(up to the stop)" } else { "(up to line 3)" };
        assert!(line.contains(how_far), "{line}");
    }
    assert!(text.contains("% of the path (up to line 3) before LinuxCNC stops it"), "{text}");
}

#[test]
fn a_replay_reports_an_extra_axis_beyond_its_limit() {
    let config = config(LATHE);
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    std::fs::write(file.path(), "G21 G90 G94\nG0 W900\nG0 W950\nM2\n").unwrap();
    let moves = motion::moves(&config.clone().into(), file.path(), None).unwrap();
    let found = replay(&config, &moves, 0.001).unwrap().violations(&config);
    assert_eq!(found, ["line 3: axis W reaches 950.000 mm, above 900"]);
}

#[test]
fn moves_in_which_the_work_turns_or_goes_along_with_the_tool_are_marked() {
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    let lines = ["G0 C90", "G0 W300", "G1 F500 Z990", "G1 Z980 W310", "G1 W320", "G1 C0", "G1 X-1"];
    std::fs::write(&file, format!("G21 G90\n{}\nM2\n", lines.join("\n"))).unwrap();
    let moves = motion::moves(&whole(LATHE), file.path(), None).unwrap();
    let marked: Vec<u32> = moves.iter().filter(|step| step.extra).map(|step| step.line).collect();
    assert_eq!(marked, [2, 5, 7]);
    let end = moves.last().expect("moves").end;
    // Lengths are in inches.
    let gaps = end.iter().zip([-1.0, 450.0, 980.0, 0.0, 0.0, 0.0]).map(|(a, b)| (a - b).abs());
    assert!(gaps.fold(0.0, f64::max) < 1e-9, "{end:?}");
}

#[test]
fn letters_that_are_no_axis_of_the_machine_are_refused() {
    let options = Options::default();
    let refused = run_text(LATHE, "G21 G90\nG0 U10\nM2\n", &options).unwrap();
    assert_eq!(refused.ending, Ending::Stopped);
    let reported = refused.messages.first().expect("a reason").text.to_lowercase();
    assert!(reported.contains('u'), "{reported}");
}

/// LinuxCNC compares the following error of every joint with its limit, those of extra axes too.
#[test]
fn the_following_error_of_an_extra_axis_is_judged() {
    let config = whole(LATHE);
    let legs = config.guarded_joints();
    for n in 0..config.first().extra.len() {
        let mut loads = Loads::new(&config);
        for cycle in 0..20 {
            let mut row = Row { cycle, ..standing(config.first()) };
            row.extra.allowed.fill(0.5);
            row.extra.errors[n] = if cycle == 7 { -0.75 } else { 0.25 };
            loads.see(&row);
        }
        let following = loads.finish().following;
        for (joint, peak) in following.peaks.iter().enumerate() {
            let is_it = joint == legs + n;
            let expected = if is_it { [0.75, 0.5] } else { [0.0, f64::INFINITY] };
            assert_eq!([peak.value, peak.limit], expected, "{}", peak.joint);
            assert_eq!(following.beyond[joint].is_some(), is_it, "{}", peak.joint);
        }
    }
}
