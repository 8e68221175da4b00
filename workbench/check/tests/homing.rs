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
