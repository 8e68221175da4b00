// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines with two mechanisms: read, run in LinuxCNC in virtual time, and checked.

use check::between;
use check::report::check;
use kinematics::{Cause, Gap, Limit, Pose, Vector3};
use linuxcnc::process::{self, Options};
use linuxcnc::row::{Ending, MessageKind, Outcome, Row};
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use program::mechanism_moves::moves_of;
use program::motion;
use program::preflight::preflight;
use program::replay::replay;
use program::report::{Preflight, Rule};
use std::ops::ControlFlow;
use std::path::Path;
use test_support::control::run;
use test_support::shipped::{config, folder, ini, machine_of, whole};

const LATHE: &str = "lathe-mirrored";

/// Delay of LinuxCNC's joints relative to the commanded pose, in cycles.
const LAG: usize = 2;

fn second() -> Mechanism {
    whole(LATHE).mechanism(2).unwrap()
}

/// Returns a program of these lines, which begins with both at home.
fn program(lines: &[&str]) -> tempfile::NamedTempFile {
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    let text = format!("G21 G90 G61 M52 P1\nF2400\n{}\nM2\n", lines.join("\n"));
    std::fs::write(&file, text).unwrap();
    file
}

fn run_file(config: &MachineConfig, file: &Path) -> (Outcome, Vec<Row>) {
    let mut rows = vec![];
    let outcome = process::run(config, file, &Options::default(), |row| {
        rows.push(*row);
        ControlFlow::Continue(())
    });
    (outcome.unwrap(), rows)
}

fn followed(config: &MachineConfig, file: &Path) -> Preflight {
    let moves = motion::moves(config, file, None).unwrap();
    preflight(&config.mechanisms, &moves).unwrap()
}

/// Returns the first or second mechanism as the only one of a separate control, with these extra axes, whose
/// sections are those of the lathe with a counter-spindle.
fn half(is_second: bool, axes: &str) -> MachineConfig {
    let section = |text: &str, name: &str| {
        let begin = text.find(&format!("[{name}]\n")).unwrap();
        let length = text[begin + 1..].find("\n[").map_or(text.len() - begin, |end| end + 2);
        text[begin..begin + length].to_string()
    };
    let whole = std::fs::read_to_string(ini(LATHE)).unwrap();
    let names = ["EMC", "DISPLAY", "EMCMOT", "RS274NGC", "TASK", "EMCIO", "HAL", "TRAJ", "PKM"];
    let home = if is_second { "HOME = 0 450 2600" } else { "HOME = 0 450 1000" };
    let mut text = names.map(|name| section(&whole, name)).concat();
    text = text.replace("HOME = 0 450 1000 0 0 0 0 450 2600", home);
    text = text.replace("COORDINATES = XYZBCUVW", &format!("COORDINATES = XYZB{axes}"));
    text = text.replace("MECHANISM_CLEARANCE = 150\n", "");
    text += "[KINS]\nKINEMATICS = pkmkins legs=slider:4 coordinates=XYZB";
    if !axes.is_empty() {
        text += &format!(" axes={axes}");
    }
    text += &format!("\nJOINTS = {}\n", 4 + axes.len());
    let first = if is_second { 4 } else { 0 };
    for n in 0..4 {
        for name in ["LEG", "JOINT"] {
            let from = section(&whole, &format!("{name}_{}", first + n));
            text += &from.replace(&format!("[{name}_{}]", first + n), &format!("[{name}_{n}]"));
        }
    }
    let letters = if is_second { ["U", "V", "W", "C"] } else { ["X", "Y", "Z", "B"] };
    for (own, letter) in letters.into_iter().zip(["X", "Y", "Z", "B"]) {
        let from = section(&whole, &format!("AXIS_{own}"));
        text += &from.replace(&format!("[AXIS_{own}]"), &format!("[AXIS_{letter}]"));
    }
    let slide = std::fs::read_to_string(ini("lathe-counter-spindle")).unwrap();
    for (n, letter) in axes.chars().enumerate() {
        let joint = section(&slide, "JOINT_5").replace("JOINT_5", &format!("JOINT_{}", 4 + n));
        text += &(joint + &section(&slide, "AXIS_W").replace("AXIS_W", &format!("AXIS_{letter}")));
    }
    machine_of(&ini(LATHE), &text)
}

#[test]
fn the_second_is_read_as_an_ordinary_machine_in_its_own_coordinates() {
    let (first, second) = (config(LATHE), second());
    assert_eq!(second.home, [0.0, 450.0, 2600.0, 0.0, 0.0, 0.0]);
    assert_eq!((second.place.first_leg, second.place.first_joint), (4, 4));
    assert_eq!(second.joints[0].name, "carriage 4");
    assert_eq!([second.axes[0].max, second.axes[2].min, second.axes[4].max], [120.0, 2200.0, 20.0]);
    assert!(first.axes[5].max.is_infinite(), "C is the second one's");
    let alone = half(true, "").mechanism(1).unwrap();
    assert_eq!(alone.geometry, second.geometry);
    assert_eq!((alone.axes, alone.home), (second.axes.clone(), second.home));
    assert_eq!(alone.angles, second.angles);
}

#[test]
fn both_move_in_every_cycle_as_the_program_says() {
    let (outcome, rows) = run(LATHE, &folder(LATHE).join("programs/long-part.ngc"));
    assert_eq!(outcome.ending, Ending::Finished, "{:?}", outcome.messages);
    let (first, second) = (config(LATHE), second());
    let mut moved = [0; 3];
    let mut worst = 0.0_f64;
    for pair in rows.windows(LAG + 1) {
        let [now, then] = [&pair[LAG], &pair[0]];
        let steady = pair
            .windows(2)
            .all(|two| two[0].tool == two[1].tool && two[0].second.tool == two[1].second.tool);
        if !steady || !now.flags.on {
            continue;
        }
        let joints = [0, 4]
            .map(|from| std::array::from_fn(|i| if i < 4 { now.joints[from + i] } else { 0.0 }));
        for (i, config, pose, tool) in
            [(0, &first, then.pose, then.tool), (1, &second, then.second.pose, then.second.tool)]
        {
            let (seed, tool) = (Pose::from_degrees(pose), tool.into());
            let found = config.machine.forward(&joints[i], &seed, &tool, &config.solver).unwrap();
            worst = worst.max(found.pose.distance(&seed, config.machine.radius()));
        }
        let moves = [pair[1].pose != then.pose, pair[1].second.pose != then.second.pose];
        (0..2).filter(|i| moves[*i]).for_each(|i| moved[i] += 1);
        moved[2] += usize::from(moves[0] && moves[1]);
    }
    println!("{} cycles, both moving in {}; joints within {worst:.4} mm", rows.len(), moved[2]);
    // LinuxCNC smooths the joints' commands over some cycles: by 0.1 mm where 60 mm/s reverse.
    assert!(worst < 0.1, "{worst}");
    assert!(moved[2] > 40_000 && moved[2] * 10 > moved[0] * 9, "{moved:?} cycles");
}

/// W moves to the first mechanism, which is at the end of its own path.
const MEETING: [&str; 3] = ["G1 Z1350 W2600", "G1 W2250", "G1 W2600"];

#[test]
fn the_guard_stops_both_before_they_meet() {
    let file = program(&MEETING);
    let (outcome, rows) = run_file(&whole(LATHE), file.path());
    assert_eq!(outcome.ending, Ending::Stopped);
    let errors: Vec<&str> = outcome
        .messages
        .iter()
        .filter(|m| m.kind == MessageKind::Error)
        .map(|m| m.text.as_str())
        .collect();
    let code = format!("[code {}]", Cause::MechanismsNear.code());
    assert!(errors[0].contains("legs 1 and 4: ") && errors[0].contains(&code), "{errors:?}");
    // By an independent method: carriages 1 and 4 are on one rail, and their rods lean away from each other.
    let least = rows.iter().map(|row| row.joints[4] - row.joints[1]).fold(f64::INFINITY, f64::min);
    println!("stopped {:.3} mm before the limit", least - 150.0);
    // Braking from 40 mm/s takes 2 mm; the guard assumes half of the acceleration, and ten cycles.
    assert!((150.0..160.0).contains(&least), "{least}");
    assert_eq!(rows.last().map(|row| row.flags.held), Some(true));
}

#[test]
fn a_machine_that_stands_too_near_may_move_away() {
    // At the limit by the guard's own stop, then away in another program: the clearance is increased instead.
    let text = std::fs::read_to_string(ini(LATHE)).unwrap();
    let wide = text.replace("MECHANISM_CLEARANCE = 150", "MECHANISM_CLEARANCE = 600");
    let config = machine_of(&ini(LATHE), &wide);
    let file = program(&["G1 W2700 Z950", "G1 W2800 Z900"]);
    let (outcome, _) = run_file(&config, file.path());
    assert_eq!(outcome.ending, Ending::Finished, "{:?}", outcome.messages);
}

#[test]
fn preflight_names_line_and_pair_where_they_meet() {
    let config = whole(LATHE);
    let found = followed(&config, program(&MEETING).path());
    let [message] = found.breaks.as_slice() else { panic!("{:?}", found.breaks) };
    assert_eq!((message.limit, message.line), (Rule::Mechanisms, 4));
    assert!(
        message
            .text
            .starts_with("the distance between leg 1 and leg 4 violates its limit of 150 mm"),
        "{}",
        message.text
    );
    let fits = followed(&config, &folder(LATHE).join("programs/two-short-parts.ngc"));
    assert!(fits.fits(), "{:?}", fits.breaks);
    let margin = fits.margins.iter().find(|margin| margin.limit == Rule::Mechanisms).unwrap();
    assert!(
        margin.value > 90.0 && margin.part == "the distance between leg 3 and leg 6",
        "{margin:?}"
    );
}

#[test]
fn the_least_distance_is_that_of_a_search_along_the_program() {
    let config = whole(LATHE);
    let second = second();
    let moves =
        motion::moves(&config, &folder(LATHE).join("programs/long-part.ngc"), None).unwrap();
    let found = preflight(&config.mechanisms, &moves).unwrap();
    let message =
        found.margins.iter().find(|margin| margin.limit == Rule::Mechanisms).unwrap().value;
    let mut least = f64::INFINITY;
    let (mut from, mut beside_from) = (config.first().home, second.home);
    for step in &moves {
        let beside = step.second.expect("both");
        for n in 0..=200 {
            let at = |from: &[f64; 6], to: &[f64; 6]| {
                let share = f64::from(n) / 200.0;
                Pose::from_degrees(std::array::from_fn(|k| from[k] + share * (to[k] - from[k])))
            };
            let one = config
                .first()
                .machine
                .at(&at(&from, &step.end), &(config.first().spindle + Vector3::from(step.tool)));
            let other = second
                .machine
                .at(&at(&beside_from, &beside.end), &(second.spindle + Vector3::from(beside.tool)));
            let (one, other) = (one.unwrap(), other.unwrap());
            let gap = Gap::between(&one, &other);
            least = least.min(gap.distance - 150.0);
            // With an upper bound for the distance.
            assert_eq!(Gap::within(&one, &other, 1.001 * gap.distance), gap);
            let most = 0.999 * gap.distance;
            assert_eq!(Gap::within(&one, &other, most).distance, most);
        }
        (from, beside_from) = (step.end, beside.end);
    }
    // A lower bound, reported within a hundredth of the distance.
    assert!(message <= least && message > least - 0.01 * (150.0 + least), "{message} {least}");
}

#[test]
fn limits_of_the_second_are_reported_with_its_own_letters_and_numbers() {
    let config = whole(LATHE);
    let found = followed(&config, program(&["G1 W3050", "G1 W2600 C25"]).path());
    let message: Vec<(&str, u32)> =
        found.breaks.iter().map(|b| (b.part.as_str(), b.line)).collect();
    assert!(message.contains(&("axis W", 3)) && message.contains(&("axis C", 4)), "{message:?}");
    assert!(found.breaks.iter().all(|message| message.of_second));
    let narrow = std::fs::read_to_string(ini(LATHE)).unwrap();
    let at = narrow.find("[JOINT_5]").unwrap();
    let narrow = narrow[..at].to_string()
        + &narrow[at..].replacen("MAX_LIMIT = 3700", "MAX_LIMIT = 3200", 1);
    let config = machine_of(&ini(LATHE), &narrow);
    let found = followed(&config, program(&["G1 W2750"]).path());
    let [message] = found.breaks.as_slice() else { panic!("{:?}", found.breaks) };
    assert_eq!(
        (message.limit, message.part.as_str()),
        (Rule::Limit(Limit::JointRange), "carriage 5")
    );
}

#[test]
fn each_makes_the_moves_of_a_program_in_the_same_time() {
    let config = whole(LATHE);
    let file = folder(LATHE).join("programs/long-part.ngc");
    let seconds = [config.first(), &second()].map(|mechanism| {
        let moves = moves_of(mechanism, &config, &file).unwrap().0;
        replay(mechanism, &moves, 0.001).unwrap().time
    });
    assert!((seconds[0] - seconds[1]).abs() < 0.002, "{seconds:?}");
    // Without acceleration; LinuxCNC takes 73 s.
    assert!(seconds[0] > 60.0 && seconds[0] < 73.0, "{seconds:?}");
}

/// Blocks in which one mechanism does not move take the same time for it.
#[test]
fn one_that_stands_waits_for_the_other() {
    let config = whole(LATHE);
    let file = program(&["G1 W2700", "G1 Z900", "G0 U-60 C5", "G1 X10 U0 W2600 C0", "G1 B3"]);
    let found = [config.first(), &second()].map(|mechanism| {
        let moves = moves_of(mechanism, &config, file.path()).unwrap().0;
        replay(mechanism, &moves, 0.001).unwrap()
    });
    let [first, second] = found.each_ref().map(|replay| (replay.time, replay.poses));
    assert!((first.0 - second.0).abs() < 1e-9 && first.1 == second.1, "{first:?} {second:?}");
    assert_eq!(found.each_ref().map(|replay| replay.moves), [3, 3]);
    // 100 mm in each direction at 40 mm/s, the rapid, 100 mm of W, and a rotation.
    assert!(first.0 > 3.0 * 100.0 / 40.0, "{first:?}");
}

/// A tool offset that changes at a tilt moves the platform along a line: the position on it where the two are too near
/// is found, although the next block moves them apart.
#[test]
fn the_way_of_a_tool_change_at_a_tilt_is_followed_between_them() {
    let (config, second) = (whole(LATHE), second());
    let file = program(&["G1 Z1350 W2600 C20", "G43.1 U300", "G1 W3100"]);
    let found = followed(&config, file.path());
    let between = |message: &&program::report::Break| message.limit == Rule::Mechanisms;
    let message = found.breaks.iter().find(between).unwrap_or_else(|| panic!("{:?}", found.breaks));
    assert_eq!(message.part, "the distance between leg 1 and leg 4");
    let tilted = Pose::from_degrees([0.0, 450.0, 2600.0, 0.0, 20.0, 0.0]);
    let one = Pose::from_degrees([0.0, 450.0, 1350.0, 0.0, 0.0, 0.0]);
    let one = config.first().machine.at(&one, &config.first().spindle).unwrap();
    let distances = [0.0, 300.0].map(|x| {
        let tool = second.spindle + Vector3::new(x, 0.0, 0.0);
        Gap::between(&one, &second.machine.at(&tilted, &tool).unwrap()).distance
    });
    assert!(distances[0] > 200.0 && distances[1] < 130.0, "{distances:?}");
    let by =
        format!("as the tool offset changes before this move by {:.4} mm", 150.0 - distances[1]);
    assert!(message.line == 5 && message.text.contains(&by), "{}, not {by}", message.text);
    // A change that moves them apart is not reported.
    let away =
        followed(&config, program(&["G1 Z1350 W2600 C20", "G43.1 U-100", "G1 W3000"]).path());
    assert!(
        !away.breaks.iter().any(|message| message.limit == Rule::Mechanisms),
        "{:?}",
        away.breaks
    );
}

#[test]
fn check_looks_at_both_and_at_what_is_between_them() {
    let config = whole(LATHE);
    for mechanism in &config.mechanisms {
        assert!(check(&config, mechanism, |_| ()).unwrap().fits());
    }
    let found = between::check(&config).unwrap().expect("two mechanisms");
    assert!(found.fits() && found.findings.is_empty(), "{:?}", found.findings);
    assert!(
        found.facts[0].1.contains("the distance between leg 1 and leg 4 is 591.181 mm at home"),
        "{:?}",
        found.facts
    );
    let text = std::fs::read_to_string(ini(LATHE)).unwrap();
    let checked = |text: &str| {
        let config = machine_of(&ini(LATHE), text);
        between::check(&config).unwrap().expect("two mechanisms")
    };
    // Without a clearance nothing prevents them from meeting.
    let none = checked(&text.replace("MECHANISM_CLEARANCE = 150\n", ""));
    assert!(!none.fits() && none.findings[0].problem.key == "MECHANISM_CLEARANCE");
    // A clearance that home violates.
    let wide = checked(&text.replace("MECHANISM_CLEARANCE = 150", "MECHANISM_CLEARANCE = 600"));
    let message = &wide.findings[0].problem;
    assert!(
        !wide.fits() && message.section == "TRAJ" && message.expected.contains("leg 1 and leg 4"),
        "{message:?}"
    );
    assert!(between::check(&whole("four-rod-lathe")).unwrap().is_none());
}

#[test]
fn half_of_the_machine_is_not_run() {
    let refused =
        process::run(&second().into(), program(&["G1 Z2500"]).path(), &Options::default(), |_| {
            ControlFlow::Continue(())
        });
    assert!(refused.unwrap_err().to_string().contains("both mechanisms"));
}

/// Two sliding headstocks need two letters more than one control has left. Each control has one of the
/// mechanisms and its headstock's slide, in separate processes and folders.
#[test]
fn two_controls_run_the_two_halves_with_their_headstocks_at_once() {
    let halves = [half(false, "W"), half(true, "W")];
    let files = [
        program(&["G1 Z1100 W600", "G1 X-60 Z900 B5", "G1 X0 Z1000 B0 W800"]),
        program(&["G1 Z2500 W700", "G1 X-60 Z2700 B-5", "G1 X0 Z2600 B0 W800"]),
    ];
    let alone = [0, 1].map(|i| run_file(&halves[i], files[i].path()));
    let together = std::thread::scope(|scope| {
        let both = [0, 1].map(|i| {
            let (config, file) = (&halves[i], files[i].path());
            scope.spawn(move || run_file(config, file))
        });
        both.map(|one| one.join().unwrap())
    });
    for (one, alone) in together.iter().zip(&alone) {
        assert_eq!(one.0.ending, Ending::Finished, "{:?}", one.0.messages);
        assert!(one == alone, "one control does not see the other");
        let slide = one.1.iter().map(|row| row.extra.positions[0]).fold(f64::INFINITY, f64::min);
        assert!(slide < 701.0, "the headstock slides: {slide}");
    }
    // Two controls lack a check of both, and a program for both.
    assert!(halves.iter().all(|half| half.mechanisms.len() == 1));
}
