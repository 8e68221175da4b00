// SPDX-License-Identifier: GPL-2.0-or-later
//! Rows of generated machines and their file, with a value of its own in every place; the lines of messages.

use kinematics::MAX_JOINTS;
use linuxcnc::row::{Beside, Extra, Message, MessageKind, Row, Thread};
use linuxcnc::trace::Trace;
use machine::read::machine::MachineConfig;
use std::collections::BTreeMap;
use std::fs;
use test_support::generated::{Generated, generated};

/// Numbers from `first` on.
fn from<const N: usize>(first: usize) -> [f64; N] {
    std::array::from_fn(|k| (first + k) as f64)
}

fn row() -> Row {
    Row {
        cycle: 4000,
        line: 7,
        pose: from(100),
        tool: from(200),
        second: Beside { pose: from(300), tool: from(400) },
        joints: from::<MAX_JOINTS>(500),
        errors: from::<MAX_JOINTS>(600),
        extra: Extra {
            positions: from(700),
            errors: from(800),
            world: from(900),
            ..Extra::default()
        },
        feed: 0.5,
        ..Row::default()
    }
}

/// Returns the expected columns of the file, by name.
fn columns(drawn: &Generated) -> BTreeMap<String, f64> {
    let row = row();
    let mut all: BTreeMap<String, f64> = BTreeMap::new();
    all.insert("time".into(), 4000.0 * f64::from(drawn.period) * 1e-9);
    all.insert("line".into(), 7.0);
    all.insert("feed".into(), 0.5);
    let mut set = |letter: char, value: f64| all.insert(letter.to_ascii_lowercase().into(), value);
    // All letters of one moment: the joints of extra axes lag LinuxCNC's pose.
    let letters = if drawn.mechanisms.len() > 1 { "XYZABCUVW" } else { "XYZABC" };
    letters.chars().zip(row.extra.world).for_each(|(letter, value)| _ = set(letter, value));
    let count: usize = drawn.mechanisms.iter().map(|built| built.joints.len()).sum();
    let joints = row.joints.iter().zip(row.errors).take(count);
    let extra = row.extra.positions.iter().zip(row.extra.errors).take(drawn.extra.len());
    for (n, (value, error)) in joints.chain(extra).enumerate() {
        all.insert(format!("joint_{n}"), *value);
        all.insert(format!("joint_{n}_error"), error);
    }
    "xyz".chars().zip(row.tool).for_each(|(l, value)| _ = all.insert(format!("tool_{l}"), value));
    if drawn.mechanisms.len() > 1 {
        let tool = "uvw".chars().zip(row.second.tool);
        tool.for_each(|(l, value)| _ = all.insert(format!("tool_{l}"), value));
    }
    all
}

#[test]
fn every_column_of_the_file_has_its_value_with_its_own_period() {
    for seed in 0..11 {
        let drawn = generated(seed);
        let folder = tempfile::tempdir().unwrap();
        let config = MachineConfig::read(&drawn.write(folder.path())).unwrap();
        let file = folder.path().join("rows.csv");
        let mut trace = Trace::new(&config, &file).unwrap();
        assert!(trace.see(&row()).is_continue());
        trace.finish(true).unwrap();
        let text = fs::read_to_string(&file).unwrap();
        let (names, values) = text.trim_end().split_once('\n').unwrap();
        let values = values.split(',').map(|value| value.parse().unwrap());
        let found: BTreeMap<String, f64> = names.split(',').map(Into::into).zip(values).collect();
        let mut expected = columns(&drawn);
        // The file has seconds to the last digit, but the test multiplies in another order.
        let [own, time] = [&found, &expected].map(|all| all["time"]);
        assert!((own - time).abs() < 1e-12, "{}: {own} s instead of {time} s", drawn.name);
        expected.insert("time".into(), own);
        assert_eq!(found, expected, "{}", drawn.name);
    }
}

#[test]
fn a_run_that_was_not_judged_leaves_no_file() {
    let config = test_support::shipped::whole("hexapod");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rows.csv");
    let mut trace = Trace::new(&config, &file).unwrap();
    assert!(trace.see(&row()).is_continue());
    trace.finish(false).unwrap();
    assert!(!file.exists());
}

#[test]
fn each_mechanism_has_its_own_pose_and_tool() {
    let config = test_support::shipped::whole("lathe-mirrored");
    let [first, second] = [0, 1].map(|n| row().of(&config.mechanisms[n]));
    assert_eq!(first, Beside { pose: from(100), tool: from(200) });
    assert_eq!(second, Beside { pose: from(300), tool: from(400) });
}

#[test]
fn a_thread_needs_its_pitch_in_every_turn() {
    // 90 turns per minute are one and a half per second.
    assert_eq!(Thread { pitch: 2.0, turning: 90.0, fastest: 1.0 }.needed(), 3.0);
}

#[test]
fn a_message_is_at_the_line_that_it_names_or_that_moves_or_that_is_read() {
    let message = |text: &str, line, read| Message {
        kind: MessageKind::Error,
        text: text.into(),
        line,
        file: 0,
        read,
        seconds: 0.0,
    };
    assert_eq!(message("Linear move on line 12 would exceed a limit", 5, 9).place(), 12);
    assert_eq!(message("joint 2 following error", 5, 9).place(), 5);
    assert_eq!(message("Unknown word", 0, 9).place(), 9);
}
