// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm check --fix` and `pkm boxes --write`: proposed, written and unchanged text.

use crate::commands::Bench;
use std::fs;

/// Returns the linear delta after its rods were measured: its HOMEs and its box belong to the old ones.
fn measured() -> Bench {
    let bench = Bench::new();
    let file = bench.0.path().join("linear-delta.ini");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replace("ROD = 269\n", "ROD = 270\n")).unwrap();
    bench
}

fn text(bench: &Bench) -> String {
    fs::read_to_string(bench.0.path().join("linear-delta.ini")).unwrap()
}

fn comments(text: &str) -> Vec<&str> {
    text.lines().filter(|line| line.starts_with('#') || line.starts_with('[')).collect()
}

#[test]
fn a_changed_geometry_is_corrected_at_once_and_only_with_write() {
    let bench = measured();
    let old = text(&bench);
    let reported = bench.answer("check linear-delta.ini", "");
    assert!(reported.ends_with("exit 1\n") && reported.contains("[BOX_0]GEOMETRY"), "{reported}");
    assert!(
        reported.contains("off by 1.142 mm") && reported.contains("pkm boxes --write"),
        "{reported}"
    );
    let proposed = bench.answer("check --fix linear-delta.ini", "");
    assert!(proposed.starts_with("--- linear-delta.ini\n+++ linear-delta.ini\n@@"), "{proposed}");
    assert!(proposed.contains("\n+GEOMETRY = 0xc8345362\n") && proposed.ends_with("exit 0\n"));
    assert_eq!(proposed.matches("\n+HOME = 326.505").count(), 3, "{proposed}");
    assert_eq!(text(&bench), old);
    assert!(bench.answer("check --fix --write linear-delta.ini", "").ends_with("exit 0\n"));
    let new = text(&bench);
    assert_eq!(comments(&new), comments(&old));
    assert!(bench.answer("check linear-delta.ini", "").ends_with("exit 0\n"));
    assert!(bench.answer("boxes linear-delta.ini", "").ends_with("exit 0\n"));
    let again = bench.answer("check --fix linear-delta.ini", "");
    assert_eq!(again, "pkm: linear-delta.ini: nothing to correct automatically\nexit 0\n");
}

#[test]
fn what_is_written_keeps_link_ends_of_lines_and_every_byte() {
    let bench = measured();
    let at = |name: &str| bench.0.path().join(name);
    let old = text(&bench);
    let ends = old.replace('\n', "\r\n");
    fs::write(at("ends.ini"), &ends).unwrap();
    std::os::unix::fs::symlink("ends.ini", at("link.ini")).unwrap();
    assert!(bench.answer("check --fix --write link.ini", "").ends_with("exit 0\n"));
    assert!(fs::symlink_metadata(at("link.ini")).unwrap().is_symlink());
    let new = fs::read_to_string(at("ends.ini")).unwrap();
    assert!(new != ends && new.lines().count() == new.matches("\r\n").count(), "{new}");
    assert_eq!(comments(&new.replace("\r\n", "\n")), comments(&old));

    let mut latin = b"# Gr\xf6\xdfe\n".to_vec();
    latin.extend(old.bytes());
    fs::write(at("latin.ini"), &latin).unwrap();
    for words in ["check --fix --write latin.ini", "boxes --write latin.ini"] {
        let reported = bench.answer(words, "");
        assert!(reported.contains("latin.ini:1") && reported.contains("not UTF-8"), "{reported}");
        assert!(reported.ends_with("exit 2\n"), "{reported}");
        assert_eq!(fs::read(at("latin.ini")).unwrap(), latin);
    }
}

#[test]
fn boxes_are_written_over_those_of_another_geometry_and_where_there_are_none() {
    let bench = measured();
    let old = text(&bench);
    let found = bench.answer("boxes linear-delta.ini", "");
    assert!(found.contains("linear-delta.ini:113: [BOX_0]GEOMETRY") && found.ends_with("exit 1\n"));
    assert_eq!(text(&bench), old);
    assert!(bench.answer("boxes --write linear-delta.ini", "").ends_with("exit 0\n"));
    assert_eq!(comments(&text(&bench)), comments(&old));
    assert!(bench.answer("boxes linear-delta.ini", "").contains("[BOX_0] proved with"));

    let bare = Bench::new();
    let file = bare.0.path().join("linear-delta.ini");
    let whole = text(&bare);
    let (before, rest) = whole.split_once("[BOX_0]").unwrap();
    let after = &rest[rest.find("[JOINT_0]").unwrap()..];
    fs::write(&file, format!("{before}{after}").replace(" boxes=1", "")).unwrap();
    assert!(bare.answer("boxes --write linear-delta.ini", "").ends_with("exit 0\n"));
    assert!(text(&bare).contains("KINEMATICS = pkmkins legs=slider:3 coordinates=XYZ boxes=1\n"));
    assert!(bare.answer("boxes linear-delta.ini", "").contains("[BOX_0] proved with"));
}

#[test]
fn limits_that_are_missing_become_those_that_are_proved() {
    let bench = Bench::new().spoilt("MIN_LIMIT = -80\nMAX_LIMIT = 80\n", "");
    let reported = bench.answer("check linear-delta.ini", "");
    assert!(reported.contains("[AXIS_X]MIN_LIMIT is missing"), "{reported}");
    let proposed = bench.answer("check --fix linear-delta.ini", "");
    assert!(
        proposed.contains("\n+MIN_LIMIT = ") && proposed.contains("\n+MAX_LIMIT = "),
        "{proposed}"
    );
    bench.answer("check --fix --write linear-delta.ini", "");
    let reported = bench.answer("check linear-delta.ini", "");
    assert!(!reported.contains("is missing") && !reported.contains("error"), "{reported}");
}

#[test]
fn writing_is_a_part_of_fixing_alone() {
    let reported = Bench::new().answer("check --write linear-delta.ini", "");
    assert!(reported.contains("--fix") && reported.ends_with("exit 2\n"), "{reported}");
}
