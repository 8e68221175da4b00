// SPDX-License-Identifier: GPL-2.0-or-later
//! Homing from any pose at switch-off.

use check::homing_paths::{Group, Homing, sequences};
use check::report::check;
use machine::read::mechanism::Mechanism;
use test_support::shipped::{ini, with_programs};

/// Returns a shipped machine with a changed file, in its own folder with its tool table.
pub fn changed(name: &str, change: impl Fn(String) -> String) -> (tempfile::TempDir, Mechanism) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(format!("{name}.ini"));
    std::fs::write(&file, change(std::fs::read_to_string(ini(name)).unwrap())).unwrap();
    std::fs::copy(ini(name).with_extension("tbl"), file.with_extension("tbl")).unwrap();
    with_programs(name, folder.path());
    let config = test_support::shipped::first_of(&file);
    (folder, config)
}

/// Puts every joint into a separate sequence.
fn one_by_one(text: String) -> String {
    let mut number = 0;
    let lines = text.lines().map(|line| match line.starts_with("HOME_SEQUENCE") {
        true => {
            number += 1;
            format!("HOME_SEQUENCE = {number}\n")
        }
        false => format!("{line}\n"),
    });
    lines.collect()
}

#[test]
fn shipped_machines_that_search_switches_keep_their_limits_from_every_place_drawn() {
    for name in ["lab-hexapod", "linear-delta", "triaglide", "four-rod-lathe"] {
        let config = test_support::shipped::first_of(&ini(name));
        let homing = Homing::new(&config).unwrap().unwrap();
        assert!(homing.moves(), "{name}");
        let outcome = homing.judge(&homing.order());
        assert!(outcome.starts == 200 && outcome.broken == 0, "{name}: {outcome:?}");
    }
}

#[test]
fn the_way_ends_at_home() {
    for name in ["lab-hexapod", "linear-delta", "triaglide"] {
        let config = test_support::shipped::first_of(&ini(name));
        let homing = Homing::new(&config).unwrap().unwrap();
        let track = homing.track(&homing.order());
        let pose = track.last().unwrap().pose.unwrap();
        let away = pose.iter().zip(config.home).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(away < 1e-6, "{name} ends at {pose:?}");
        assert!(track.windows(2).all(|pair| pair[0].at < pair[1].at), "{name}");
    }
}

#[test]
fn struts_that_home_one_by_one_break_limits_and_the_order_computed_does_not() {
    let (_folder, config) = changed("lab-hexapod", one_by_one);
    let homing = Homing::new(&config).unwrap().unwrap();
    assert_eq!(homing.order().len(), 6);
    let outcome = homing.judge(&homing.order());
    assert!(outcome.broken > 0 && outcome.first.is_some(), "{outcome:?}");
    let order = homing.safe_order().unwrap();
    assert_eq!(homing.judge(&order).broken, 0);
    assert_eq!(sequences(&order), [-1; 6]);
    let report = check(&config.clone().into(), &config, |_| ()).unwrap();
    let reported: Vec<String> = report.findings.iter().map(|f| f.problem.message()).collect();
    assert!(
        reported.iter().any(|text| text.contains("HOME_SEQUENCE") && text.contains("-1 -1 -1")),
        "{reported:?}"
    );
}

#[test]
fn an_order_is_written_as_home_sequence_of_every_joint() {
    let group = |joints: &[usize]| Group { joints: joints.into(), waits: true };
    assert_eq!(sequences(&[group(&[1, 2]), group(&[0])]), [-2, -1, -1]);
}

#[test]
fn joints_that_know_their_place_move_nothing() {
    let config = test_support::shipped::first_of(&ini("hexapod"));
    assert!(!Homing::new(&config).unwrap().unwrap().moves());
    // HOME_OFFSET is the current position of each, and HOME is elsewhere.
    let known = |text: String| {
        text.replace("HOME_ABSOLUTE_ENCODER = 2\nHOME_OFFSET = 0", "HOME_OFFSET = 950")
    };
    let (_folder, config) = changed("hexapod", known);
    assert!(Homing::new(&config).unwrap().unwrap().moves());
}

/// Returns the findings of a report about a key, each with its section.
fn found(config: &Mechanism, key: &str) -> Vec<(String, String)> {
    let report = check(&config.clone().into(), config, |_| ()).unwrap();
    let found = report.findings.into_iter().filter(|finding| finding.problem.key == key);
    found.map(|finding| (finding.problem.section.clone(), finding.problem.message())).collect()
}

/// A negative number makes the joints of its sequence end together, and selects the same sequence: carriages that
/// search a switch far away would tilt the rods too much one after the other.
#[test]
fn joints_of_one_sequence_home_together_whatever_their_signs() {
    let mixed = |text: String| {
        let mut sign = 1;
        let text = text.replace("HOME_OFFSET = 370", "HOME_OFFSET = 150");
        let lines = text.lines().map(|line| match line.starts_with("HOME_SEQUENCE") {
            true => {
                sign = -sign;
                format!("HOME_SEQUENCE = {sign}\n")
            }
            false => format!("{line}\n"),
        });
        lines.collect()
    };
    let (_folder, config) = changed("linear-delta", mixed);
    assert_eq!(found(&config, "HOME_SEQUENCE"), []);
}

/// Moves the switch of each joint in turn behind either end of its range.
#[test]
fn a_switch_beyond_either_end_of_any_joint_is_reported_with_its_distance() {
    let shipped = test_support::shipped::config("linear-delta");
    for (i, joint) in shipped.joints.iter().enumerate() {
        for switch in [joint.min - 5.0, joint.max + 5.0] {
            let moved = |text: String| {
                let head = format!("[JOINT_{i}]\n");
                let (before, own) = text.split_once(&head).unwrap();
                let (section, rest) = own.split_once("\n[").unwrap();
                let kept = section.lines().filter(|line| !line.starts_with("HOME_OFFSET"));
                let kept: Vec<&str> = kept.collect();
                format!("{before}{head}HOME_OFFSET = {switch}\n{}\n[{rest}", kept.join("\n"))
            };
            let (_folder, config) = changed("linear-delta", moved);
            let found = found(&config, "HOME_OFFSET");
            let [(section, text)] = &found[..] else { panic!("{switch}: {found:?}") };
            assert_eq!(*section, format!("JOINT_{i}"));
            assert!(text.contains("the switch is 5.000 mm outside"), "{text}");
        }
    }
}
