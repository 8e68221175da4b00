// SPDX-License-Identifier: GPL-2.0-or-later
//! Good and bad INI files: tests/cases/ini/run.py checks a start of LinuxCNC with the same list.

use machine::read::error::MachineError;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use test_support::edits::{Edit, apply};
use test_support::shipped;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cases {
    base: PathBuf,
    case: Vec<Case>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    /// Another base file than the list's.
    base: Option<PathBuf>,
    expect: Option<String>,
    /// Whether the geometry is that of the base file.
    same: Option<bool>,
    #[serde(default)]
    edit: Vec<Edit>,
    #[serde(default)]
    names: Vec<String>,
}

#[test]
fn every_case_is_read_or_refused_as_the_list_says() {
    let text = std::fs::read_to_string(shipped::root().join("tests/cases/ini/cases.toml")).unwrap();
    let cases: Cases = toml::from_str(&text).unwrap();
    let base = |case: &Case| shipped::root().join(case.base.as_ref().unwrap_or(&cases.base));
    let failures: Vec<String> =
        cases.case.iter().filter_map(|case| judge(case, &base(case))).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Describes an unexpected outcome, if any.
fn judge(case: &Case, base: &Path) -> Option<String> {
    let read = read(case, base);
    let kind = match &read {
        Ok(_) => "ok",
        Err(MachineError::Ini(_)) => "error",
        Err(MachineError::Geometry(..)) => "bad geometry",
    };
    let message = read.as_ref().map_or_else(ToString::to_string, |_| String::new());
    let usual = if case.names.is_empty() { "ok" } else { "error" };
    let expected = case.expect.as_deref().unwrap_or(usual);
    if kind != expected {
        return Some(format!("{}: expected {expected}, got {kind} {message}", case.name));
    }
    if let Some(missing) = case.names.iter().find(|name| !message.contains(*name)) {
        return Some(format!("{}: {missing:?} is not named in {message}", case.name));
    }
    let (same, config) = (case.same?, read.ok()?);
    let is_same = config.first().hash == test_support::shipped::first_of(base).hash;
    (same != is_same).then(|| format!("{}: same geometry as the base file's: {is_same}", case.name))
}

/// Reads the base file with the edits of the case.
fn read(case: &Case, base: &Path) -> Result<MachineConfig, MachineError> {
    let text = std::fs::read_to_string(base).unwrap();
    let mut lines: Vec<String> = text.lines().map(Into::into).collect();
    for edit in &case.edit {
        apply(&mut lines, edit);
    }
    let text = lines.join("\n");
    // As LinuxCNC's start reads it; other tools refuse a machine with constraints as not judged.
    let lenient = text.contains("constraints=").then_some(Lenient::Constraints);
    MachineConfig::leniently(&Ini::parse(base, &text)?, lenient)
}

#[test]
fn tilt_and_pyramids_are_read_leg_by_leg_and_no_limit_where_absent_or_0() {
    let base = shipped::root().join("configs/hexapod/hexapod.ini");
    let text = std::fs::read_to_string(&base).unwrap();
    let config = |text: &str| test_support::shipped::machine_of(&base, text).mechanism(1).unwrap();
    let plain = config(&text);
    assert_eq!(plain.tilt_limit, Some(30.0));
    let of = |config: &Mechanism, end: usize| -> Vec<_> {
        config.angles.iter().map(|leg| leg.pyramids[end]).collect()
    };
    assert_eq!([0, 1].map(|end| of(&plain, end)), [vec![None; 6], vec![None; 6]]);
    let limited = text
        .replace("TILT_LIMIT = 30\n", "TILT_LIMIT = 20\n")
        .replace("[LEG_2]\n", "[LEG_2]\nBASE_PYRAMID = 50 40\n")
        .replace("[LEG_5]\n", "[LEG_5]\nPLATFORM_PYRAMID = 35.5 25\n");
    let found = config(&limited);
    assert_eq!(found.tilt_limit, Some(20.0));
    let only = |leg: usize, turns| (0..6).map(|i| (i == leg).then_some(turns)).collect::<Vec<_>>();
    assert_eq!(of(&found, 0), only(2, [50.0, 40.0]));
    assert_eq!(of(&found, 1), only(5, [35.5, 25.0]));
    for none in ["", "TILT_LIMIT = 0\n"] {
        assert_eq!(config(&limited.replace("TILT_LIMIT = 20\n", none)).tilt_limit, None);
    }
}
