// SPDX-License-Identifier: GPL-2.0-or-later
//! Typical mistakes of integrators: for none of them may the result be "fits together" without a finding.

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
    /// Whether every HOME is computed from the wrong machine.
    #[serde(default)]
    homed: bool,
    /// Whether an editor has written a byte order mark; the file then begins with a section.
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
    /// Expected location in the output, if not a line of the INI file.
    place: Option<String>,
    /// Why no check can detect it.
    why: Option<String>,
}

fn hexapod() -> String {
    "hexapod".into()
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Expect {
    #[default]
    Reported,
    Shown,
    Silent,
}

/// Returns the output of the command, on both streams, and its exit status.
fn answer(folder: &Path, file: &str, more: &[&str]) -> (String, i32) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    // The start has its own cases.
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

/// Limits instead of those of A, B and C: proofs within wide ones take check several times as
/// long, and are the same for every mistake.
const NARROW_DEG: i32 = 5;

/// Sets narrow limits of the base's angles.
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

/// Returns the folder of the base with the mistake in it.
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

/// Describes a wrong report about a mistake, if any.
fn judge(case: &Case) -> Option<String> {
    let folder = slipped(case);
    let file = format!("{}.ini", case.base);
    if case.homed {
        answer(folder.path(), &file, &["--fix", "--write"]);
    }
    // A panel of other limits would be a finding, whatever the mistake is.
    let mut panel = Command::new(env!("CARGO_BIN_EXE_pkm"));
    panel.args(["panel", &file]).current_dir(folder.path()).output().unwrap();
    let (text, code) = answer(folder.path(), &file, &[]);
    let wrong = |what: &str| Some(format!("{}: {what}\n{text}", case.name));
    let is_told = code != 0 || text.contains("see the warnings");
    if is_told != (case.expect == Expect::Reported) {
        return wrong(&format!("expected {:?}, exit status {code}", case.expect));
    }
    if let Some(missing) = case.names.iter().find(|name| !text.contains(*name)) {
        return wrong(&format!("{missing:?} is not said"));
    }
    if case.expect != Expect::Reported {
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
    let reported = cases.iter().filter(|case| case.expect == Expect::Reported).count();
    assert!(reported >= 40, "{reported}");
    let failures: Vec<String> = cases.par_iter().filter_map(judge).collect();
    assert!(
        failures.is_empty(),
        "{} of {}:\n{}",
        failures.len(),
        cases.len(),
        failures.join("\n\n")
    );
}
