// SPDX-License-Identifier: GPL-2.0-or-later
//! Findings of `pkm check` in a machine's file.

use check::findings::Report;
use check::report::check;
use check::world;
use machine::read::diagnostic::Severity;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use std::path::Path;
use test_support::shipped::{ini, with_programs};

/// Returns the report on the hexapod after a change of its file, without its box, with HOME of its joints from the
/// kinematics.
fn hexapod(change: impl Fn(&str) -> String) -> Report {
    let text = change(&std::fs::read_to_string(ini("hexapod")).unwrap());
    let (before, rest) = text.split_once("[BOX_0]").unwrap();
    let after = &rest[rest.find("[JOINT_0]").unwrap()..];
    let text = format!("{before}{after}").replace(" boxes=1", "");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hexapod.ini");
    let config = test_support::shipped::machine_of(&file, &text);
    let first = config.first();
    let joints = first.machine.inverse(&first.home_pose(), &first.spindle).unwrap();
    let homed = (0..6).fold(text, |text, i| {
        let heading = format!("[JOINT_{i}]\nTYPE = LINEAR\nHOME = ");
        let (before, after) = text.split_once(&heading).unwrap();
        let after = &after[after.find('\n').unwrap()..];
        format!("{before}{heading}{}{after}", joints[i])
    });
    std::fs::write(&file, homed).unwrap();
    for name in ["hexapod.tbl", "hexapod-panel.tcl", "hexapod-panel.xml"] {
        let shipped = ini("hexapod").with_file_name(name);
        std::fs::copy(shipped, folder.path().join(name)).unwrap();
    }
    with_programs("hexapod", folder.path());
    let config = MachineConfig::read(&file).unwrap();
    check(&config, config.first(), |_| ()).unwrap()
}

fn without_clearance(text: &str) -> String {
    text.replace("ROD_CLEARANCE = 60\n", "")
}

/// Exchanges the platform anchors of legs 0 and 1.
fn crossed(text: &str) -> String {
    let anchors = [
        "PLATFORM = 141.42135623730948 -141.42135623730954 150.0",
        "PLATFORM = 141.4213562373095 141.42135623730948 150.0",
    ];
    let swapped = text.replace(anchors[0], "FIRST").replace(anchors[1], anchors[0]);
    swapped.replace("FIRST", anchors[1])
}

fn reported(report: &Report, severity: Severity) -> Vec<String> {
    let found = report.findings.iter().filter(|finding| finding.severity == severity);
    found.map(|finding| finding.problem.message()).collect()
}

fn facts(report: &Report) -> String {
    report.facts.iter().map(|(name, value)| format!("{name}: {value}\n")).collect()
}

#[test]
fn struts_that_cross_at_home_do_not_fit() {
    for change in [crossed as fn(&str) -> String, |text| crossed(&without_clearance(text))] {
        let report = hexapod(change);
        let errors = reported(&report, Severity::Error);
        let is_told = |text: &String| text.contains("[TRAJ]HOME") && text.contains("legs 0 and 1");
        assert!(errors.iter().any(is_told), "{errors:?}");
        assert!(facts(&report).contains("nearest legs: the center lines of legs 0 and 1 are"));
    }
}

#[test]
fn struts_that_cross_away_from_home_do_not_fit_unless_a_clearance_keeps_them_apart() {
    let beside = |text: &str| {
        crossed(text).replace("BASE = 540.9184627218782 -144", "BASE = 560.9184627218782 -144")
    };
    let report = hexapod(|text| beside(&without_clearance(text)));
    let errors = reported(&report, Severity::Error);
    assert_eq!(errors.len(), 1, "{errors:?}");
    assert!(errors[0].contains("legs 0 and 1") && errors[0].contains("meet"), "{errors:?}");
    let kept = hexapod(|text| beside(&text.replace("ROD_CLEARANCE = 60", "ROD_CLEARANCE = 3")));
    assert_eq!(reported(&kept, Severity::Error), [""; 0]);
    assert!(kept.suggestion.is_some());
}

#[test]
fn legs_without_a_clearance_are_a_warning_and_the_nearest_are_always_reported() {
    let report = hexapod(without_clearance);
    let warnings = reported(&report, Severity::Warning);
    assert!(warnings.len() == 1 && warnings[0].contains("ROD_CLEARANCE"), "{warnings:?}");
    for report in [report, hexapod(str::to_string)] {
        assert!(report.fits());
        let facts = facts(&report);
        assert!(facts.contains("nearest legs: the center lines of legs 1 and 2 are 103.528 mm"));
        assert!(facts.contains("the smallest sampled within the axis limits"), "{facts}");
    }
}

#[test]
fn a_file_with_blanks_in_its_name_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("my first part.ngc");
    std::fs::write(&program, "M2\n").unwrap();
    let opening = |name: &Path| {
        let report = hexapod(|text| {
            let (before, after) = text.split_once("OPEN_FILE = ").unwrap();
            format!("{before}OPEN_FILE = {}{}", name.display(), &after[after.find('\n').unwrap()..])
        });
        reported(&report, Severity::Warning).into_iter().any(|text| text.contains("OPEN_FILE"))
    };
    assert!(!opening(&program));
    assert!(opening(&folder.path().join("my second part.ngc")));
}

#[test]
fn a_tool_without_a_length_is_proved_as_no_tool_is() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("four-rod-lathe.ini");
    std::fs::copy(ini("four-rod-lathe"), &file).unwrap();
    std::fs::write(file.with_extension("tbl"), "T1 P1 Z0\n").unwrap();
    let config = MachineConfig::read(&file).unwrap();
    let report = check(&config, config.first(), |_| ()).unwrap();
    assert!(report.is_whole, "the case is about limits that are proved as a whole");
    let answer = report.facts.iter().find(|(name, _)| name.starts_with("T1")).unwrap();
    assert!(answer.1.ends_with("; proved for the limits below"), "{answer:?}");
}

/// G30 and a tool change position with angles, each with one coordinate beyond its limit, or with none.
#[test]
fn every_coordinate_of_a_tool_change_is_judged_from_the_parameters_of_g30() {
    let copy = test_support::shipped::copied("hexapod");
    let file = copy.path().join("hexapod.ini");
    let text = std::fs::read_to_string(&file).unwrap();
    for (z, tilt, expected) in [(250.0, 5.0, [0, 0]), (5000.0, 80.0, [1, 1])] {
        let keys =
            format!("[EMCIO]\nTOOL_CHANGE_AT_G30 = 1\nTOOL_CHANGE_POSITION = 0 0 250 0 {tilt} 0\n");
        std::fs::write(&file, text.replace("[EMCIO]\n", &keys)).unwrap();
        let config = MachineConfig::read(&file).unwrap();
        // G28 is legal only if G30 is not.
        let parameters = format!("5161\t0\n5163\t{}\n5181\t0\n5183\t{z}\n", 5250.0 - z);
        std::fs::write(config.program.parameter_file.as_ref().unwrap(), parameters).unwrap();
        let report = check(&config, config.first(), |_| ()).unwrap();
        let errors = reported(&report, Severity::Error);
        let found = ["first moves to the pose of G30", "tool change moves there"]
            .map(|way| errors.iter().filter(|error| error.contains(way)).count());
        assert_eq!(found, expected, "{errors:?}");
    }
}

/// Returns the report on a machine with a tool change position.
fn at_tool_change(machine: &str, position: &str) -> Report {
    let copy = test_support::shipped::copied(machine);
    let file = copy.path().join(format!("{machine}.ini"));
    let keys = format!("[EMCIO]\nTOOL_CHANGE_POSITION = {position}\n");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replacen("[EMCIO]\n", &keys, 1)).unwrap();
    let config = MachineConfig::read(&file).unwrap();
    check(&config, config.first(), |_| ()).unwrap()
}

/// LinuxCNC reads 3, 6 or 9 numbers. The last one of each count is beyond its limit.
#[test]
fn the_last_number_of_a_tool_change_position_is_judged_in_each_of_its_lengths() {
    let config = test_support::shipped::whole("lathe-mirrored");
    let home = world::home(&config);
    for (count, last) in [(3, 'Z'), (6, 'C'), (9, 'W')] {
        let (_, place, axis) =
            world::coordinates(&config).into_iter().find(|(letter, ..)| *letter == last).unwrap();
        assert_eq!(place + 1, count);
        let mut words = home[..count].to_vec();
        words[place] = axis.max + 1.0;
        let words: Vec<String> = words.iter().map(f64::to_string).collect();
        let report = at_tool_change("lathe-mirrored", &words.join(" "));
        let errors = reported(&report, Severity::Error);
        let expected = format!("every tool change moves there, where {last} ");
        assert!(errors.iter().any(|text| text.contains(&expected)), "{last}: {errors:?}");
        let warnings = reported(&report, Severity::Warning);
        assert!(!warnings.iter().any(|text| text.contains("of these values")), "{warnings:?}");
    }
}

/// Checks the numbers in facts about a mechanism whose legs begin with number 6.
#[test]
fn facts_name_the_legs_of_a_second_mechanism_by_their_numbers() {
    let whole = test_support::shipped::whole("hexapod");
    let mut second = whole.first().clone();
    second.place.first_leg = 6;
    second.place.is_second = true;
    let report = check(&whole, &second, |_| ()).unwrap();
    let facts = facts(&report);
    for expected in [
        "order of legs: 6 7 8 9 10 11, ",
        "per turn: strut 6 (10), 7 (10), 8 (10), 9 (10), 10 (10), 11 (10);",
        "nearest legs: the center lines of legs 7 and 8 are 103.528 mm",
    ] {
        assert!(facts.contains(expected), "{expected} is not in {facts}");
    }
}

#[test]
fn a_point_beside_its_plane_shows_in_the_coordinates_that_follow_and_in_the_remedy() {
    let file = ini("tricept");
    let text = std::fs::read_to_string(&file).unwrap();
    // The passive leg passes through the point, 900 mm above the platform: -atan(9 / 900) about X.
    for (base, a) in [("BASE = 0 0 0", "0.000"), ("BASE = 0 9 0", "-0.573")] {
        let read = Ini::parse(&file, &text.replacen("BASE = 0 0 0", base, 1)).unwrap();
        let config = MachineConfig::leniently(&read, Some(Lenient::Constraints)).unwrap();
        let report = check(&config, config.first(), |_| ()).unwrap();
        let follows = format!(
            "follows: at home, from the constraints: A {a} degrees, B 0.000 degrees, C 0.000 degrees\n"
        );
        assert!(facts(&report).contains(&follows), "{}", facts(&report));
        let remedy = reported(&report, Severity::Error);
        let is_named =
            remedy.iter().any(|text| text.contains("correct [CONSTRAINT_N], [TRAJ]HOME"));
        assert_eq!(is_named, a != "0.000", "{remedy:?}");
    }
}
