// SPDX-License-Identifier: GPL-2.0-or-later
//! Good and bad INI files: the list that hal/pkmkins.tcl is held to as well.

use pkm::read::ini::Ini;
use pkm::read::machine::{MachineConfig, MachineError};
use serde::Deserialize;
use std::path::{Path, PathBuf};

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
    /// Another base file than that of the list.
    base: Option<PathBuf>,
    expect: String,
    /// Whether the geometry is that of the base file.
    same: Option<bool>,
    #[serde(default)]
    edit: Vec<Edit>,
    #[serde(default)]
    names: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Edit {
    section: String,
    key: Option<String>,
    #[serde(default)]
    lines: Vec<String>,
    #[serde(default)]
    append: Vec<String>,
    #[serde(default)]
    remove: bool,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn is_key(line: &str, key: &str) -> bool {
    line.split_once('=').is_some_and(|(name, _)| name.trim() == key)
}

/// First line of the section and first line after it.
fn bounds(lines: &[String], section: &str) -> Option<(usize, usize)> {
    let start = lines.iter().position(|line| line.trim() == format!("[{section}]"))?;
    let length = lines[start + 1..].iter().position(|line| line.starts_with('['));
    Some((start, length.map_or(lines.len(), |length| start + 1 + length)))
}

fn apply(lines: &mut Vec<String>, edit: &Edit) {
    let (start, end) = bounds(lines, &edit.section).unwrap_or_else(|| {
        lines.push(format!("[{}]", edit.section));
        (lines.len() - 1, lines.len())
    });
    if edit.remove {
        lines.drain(start..end);
        return;
    }
    let Some(key) = &edit.key else {
        lines.splice(end..end, edit.append.iter().cloned());
        return;
    };
    let mut body: Vec<String> = lines[start + 1..end].to_vec();
    let place = body.iter().position(|line| is_key(line, key)).unwrap_or(body.len());
    body.retain(|line| !is_key(line, key));
    body.splice(place..place, edit.lines.iter().cloned());
    lines.splice(start + 1..end, body);
}

#[test]
fn every_case_is_read_or_refused_as_the_list_says() {
    let text = std::fs::read_to_string(root().join("tests/cases/ini/cases.toml")).unwrap();
    let cases: Cases = toml::from_str(&text).unwrap();
    let base = |case: &Case| root().join(case.base.as_ref().unwrap_or(&cases.base));
    let failures: Vec<String> =
        cases.case.iter().filter_map(|case| judge(case, &base(case))).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// What is wrong with the outcome, if anything.
fn judge(case: &Case, base: &Path) -> Option<String> {
    let read = read(case, base);
    let kind = match &read {
        Ok(_) => "ok",
        Err(MachineError::Ini(_)) => "error",
        Err(MachineError::Geometry(..)) => "bad geometry",
    };
    let message = read.as_ref().map_or_else(ToString::to_string, |_| String::new());
    if kind != case.expect {
        return Some(format!("{}: expected {}, got {kind} {message}", case.name, case.expect));
    }
    if let Some(missing) = case.names.iter().find(|name| !message.contains(*name)) {
        return Some(format!("{}: {missing:?} is not named in {message}", case.name));
    }
    let (same, config) = (case.same?, read.ok()?);
    let is_same = config.geometry.hash() == MachineConfig::read(base).unwrap().geometry.hash();
    (same != is_same).then(|| format!("{}: same geometry as the base file's: {is_same}", case.name))
}

/// The base file with the edits of the case.
fn read(case: &Case, base: &Path) -> Result<MachineConfig, MachineError> {
    let text = std::fs::read_to_string(base).unwrap();
    let mut lines: Vec<String> = text.lines().map(Into::into).collect();
    for edit in &case.edit {
        apply(&mut lines, edit);
    }
    MachineConfig::from_ini(&Ini::parse(base, &lines.join("\n"))?)
}
