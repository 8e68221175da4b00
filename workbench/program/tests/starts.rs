// SPDX-License-Identifier: GPL-2.0-or-later
//! Mistakes that LinuxCNC refuses at its start: all of them are reported, and a machine that starts is not refused.

use check::report::check;
use machine::read::diagnostic::Severity;
use machine::read::machine::MachineConfig;
use program::machine_start::start;
use rayon::prelude::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use test_support::edits::{Edit, apply};
use test_support::shipped::{MACHINES, cases_of, copied, whole};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    #[serde(default = "linear_delta")]
    base: String,
    #[serde(default)]
    edit: Vec<Edit>,
    /// Files next to the INI file.
    #[serde(default)]
    files: BTreeMap<String, String>,
    /// Text of an error, and its location: the file with its line, or the key. If there are none, LinuxCNC starts,
    /// homes, moves and changes a tool.
    #[serde(default)]
    names: Vec<String>,
}

fn linear_delta() -> String {
    "linear-delta".into()
}

/// Returns the errors of the machine, and the result of its start.
fn answer(case: &Case) -> (Vec<String>, String) {
    let copy = copied(&case.base);
    let file = copy.path().join(format!("{}.ini", case.base));
    let mut lines: Vec<String> =
        fs::read_to_string(&file).unwrap().lines().map(Into::into).collect();
    case.edit.iter().for_each(|edit| apply(&mut lines, edit));
    fs::write(&file, lines.join("\n") + "\n").unwrap();
    for (name, text) in &case.files {
        fs::write(copy.path().join(name), text).unwrap();
    }
    let config = match MachineConfig::read(&file) {
        Ok(config) => config,
        Err(error) => return (vec![error.to_string()], "not read".into()),
    };
    let report = match check(&config, config.first(), |_| ()) {
        Ok(report) => report,
        Err(error) => return (vec![error.to_string()], "not judged".into()),
    };
    let is_error = |severity| severity == Severity::Error;
    let found = report.findings.iter().filter(|finding| is_error(finding.severity));
    let mut errors: Vec<String> = found.map(|finding| finding.problem.to_string()).collect();
    let started = start(&config).unwrap();
    errors.extend(started.error.map(|error| error.to_string()));
    (errors, started.fact)
}

fn judge(case: &Case) -> Option<String> {
    let (errors, fact) = answer(case);
    let wrong = |what: &str| Some(format!("{}: {what}\n{errors:#?}\n{fact}", case.name));
    let starts = case.names.is_empty();
    if starts != errors.is_empty() || (starts && !fact.starts_with("switched on")) {
        return wrong("another verdict");
    }
    let missing = case.names.iter().find(|name| !errors.iter().any(|error| error.contains(*name)));
    missing.and_then(|name| wrong(&format!("{name:?} is not said")))
}

#[test]
fn what_linuxcnc_refuses_at_its_start_does_not_fit_together() {
    let cases: Vec<Case> = cases_of("starts/starts.toml");
    assert!(cases.iter().filter(|case| !case.names.is_empty()).count() >= 60);
    let failures: Vec<String> = cases.par_iter().filter_map(judge).collect();
    let count = cases.len();
    assert!(failures.is_empty(), "{} of {count}:\n{}", failures.len(), failures.join("\n\n"));
}

#[test]
fn every_shipped_machine_starts() {
    let failures: Vec<_> = MACHINES
        .into_par_iter()
        .map(|machine| (machine, start(&whole(machine)).unwrap()))
        .filter(|(_, start)| start.error.is_some() || !start.fact.starts_with("switched on"))
        .collect();
    assert!(failures.is_empty(), "{failures:?}");
}
