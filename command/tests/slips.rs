// SPDX-License-Identifier: GPL-2.0-or-later
//! Slips that integrators make: none may end in "fits together" without a word.

use rayon::prelude::*;
use serde::Deserialize;
use std::fs;
use std::path::Path;
use std::process::Command;
use test_support::edits::{Edit, apply};
use test_support::shipped::{cases_of, copied};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    #[serde(default = "hexapod")]
    base: String,
    #[serde(default)]
    edit: Vec<Edit>,
    table: Option<Vec<String>>,
    /// Whether every HOME is made of the wrong machine.
    #[serde(default)]
    homed: bool,
    /// Whether an editor has marked the file, which then begins with a section.
    #[serde(default)]
    marked: bool,
    /// Whether the base keeps its boxes.
    #[serde(default)]
    boxes: bool,
    /// Whether the base keeps the limits of its angles.
    #[serde(default)]
    wide: bool,
    #[serde(default)]
    expect: Expect,
    #[serde(default)]
    names: Vec<String>,
    /// Where the answer has to point, if not at a line of the INI file.
    place: Option<String>,
    /// Why no check can know.
    why: Option<String>,
}

fn hexapod() -> String {
    "hexapod".into()
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Expect {
    #[default]
    Told,
    Shown,
    Silent,
}

/// What the command answers, on both ways out, and its exit status.
fn answer(folder: &Path, file: &str, more: &[&str]) -> (String, i32) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    // The start has cases of its own.
    command.args(["check", "--no-start"]).arg(file).args(more).current_dir(folder);
    let output = command.env("NO_COLOR", "1").output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout) + &text(&output.stderr), output.status.code().unwrap())
}

fn without_boxes(lines: &mut Vec<String>) {
    let mut is_box = false;
    lines.retain(|line| {
        if line.starts_with('[') {
            is_box = line.starts_with("[BOX_");
        }
        !is_box
    });
    lines.iter_mut().for_each(|line| *line = line.replace(" boxes=1", ""));
}

/// Limits in place of those of A, B and C: what is proved within wide ones takes check several times as
/// long, and is the same whatever the slip.
const NARROW_DEG: i32 = 5;

/// The base with narrow limits of its angles.
fn with_narrow_angles(lines: &mut [String]) {
    let mut is_angle = false;
    for line in lines {
        if line.starts_with('[') {
            is_angle = ["[AXIS_A]", "[AXIS_B]", "[AXIS_C]"].contains(&line.as_str());
        }
        for (key, end) in [("MIN_LIMIT", -NARROW_DEG), ("MAX_LIMIT", NARROW_DEG)] {
            if is_angle && line.starts_with(key) {
                *line = format!("{key} = {end}");
            }
        }
    }
}

/// The folder of the base with the slip in it.
fn slipped(case: &Case) -> tempfile::TempDir {
    let slipped = copied(&case.base);
    let file = slipped.path().join(format!("{}.ini", case.base));
    let text = fs::read_to_string(&file).unwrap();
    let mut lines: Vec<String> = text.lines().map(Into::into).collect();
    if !case.boxes {
        without_boxes(&mut lines);
    }
    if !case.wide {
        with_narrow_angles(&mut lines);
    }
    case.edit.iter().for_each(|edit| apply(&mut lines, edit));
    let mut text = lines.join("\n") + "\n";
    if case.marked {
        text = format!("\u{feff}{}", &text[text.find("\n[").unwrap() + 1..]);
    }
    fs::write(&file, text).unwrap();
    if let Some(table) = &case.table {
        fs::write(file.with_extension("tbl"), table.join("\n") + "\n").unwrap();
    }
    slipped
}

/// What is wrong with what is said of a slip, if anything.
fn judge(case: &Case) -> Option<String> {
    let folder = slipped(case);
    let file = format!("{}.ini", case.base);
    if case.homed {
        answer(folder.path(), &file, &["--fix", "--write"]);
    }
    let (text, code) = answer(folder.path(), &file, &[]);
    let wrong = |what: &str| Some(format!("{}: {what}\n{text}", case.name));
    let is_told = code != 0 || text.contains("see the warnings");
    if is_told != (case.expect == Expect::Told) {
        return wrong(&format!("expected {:?}, exit status {code}", case.expect));
    }
    if let Some(missing) = case.names.iter().find(|name| !text.contains(*name)) {
        return wrong(&format!("{missing:?} is not said"));
    }
    if case.expect != Expect::Told {
        return case.why.is_none().then(|| format!("{}: no reason", case.name));
    }
    let place = case.place.clone().unwrap_or_else(|| format!("{file}:"));
    let points = text.lines().any(|line| {
        let behind = line.split_once("--> ").and_then(|(_, at)| at.split_once(&place));
        behind.is_some_and(|(_, at)| {
            place == file || at.starts_with(|c: char| c.is_ascii_digit() || c == ':')
        })
    });
    if points { None } else { wrong(&format!("nothing points at {place}")) }
}

#[test]
fn no_slip_ends_in_fits_without_a_word() {
    let cases: Vec<Case> = cases_of("slips/slips.toml");
    let told = cases.iter().filter(|case| case.expect == Expect::Told).count();
    assert!(told >= 40, "{told}");
    let failures: Vec<String> = cases.par_iter().filter_map(judge).collect();
    assert!(
        failures.is_empty(),
        "{} of {}:\n{}",
        failures.len(),
        cases.len(),
        failures.join("\n\n")
    );
}
