// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs that a reader other than the control interprets differently: only LinuxCNC reads them.

use linuxcnc::process::Options;
use program::preflight::judge;
use program::report::Preflight;
use rayon::prelude::*;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::fs;
use test_support::edits::{Edit, apply};
use test_support::shipped::{cases_of, copied};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    #[serde(default = "hexapod")]
    machine: String,
    #[serde(default)]
    edit: Vec<Edit>,
    /// Program without its M2.
    program: String,
    /// Lines in which a limit is violated, with block delete on.
    lines: BTreeSet<u32>,
    /// The same lines with block delete off.
    #[serde(default)]
    kept: BTreeSet<u32>,
}

fn hexapod() -> String {
    "hexapod".into()
}

/// Judges the program of a case on a shipped machine, whose INI file is edited.
fn judged(case: &Case) -> Preflight {
    let folder = copied(&case.machine);
    let ini = folder.path().join(format!("{}.ini", case.machine));
    let mut lines: Vec<String> =
        fs::read_to_string(&ini).unwrap().lines().map(Into::into).collect();
    case.edit.iter().for_each(|edit| apply(&mut lines, edit));
    fs::write(&ini, lines.join("\n") + "\n").unwrap();
    let program = folder.path().join("p.ngc");
    fs::write(&program, format!("{}\nM2\n", case.program)).unwrap();
    let config = test_support::shipped::first_of(&ini);
    judge(&config.clone().into(), &program, &Options::default(), &mut |_| ()).unwrap().found
}

#[test]
fn the_limits_that_the_control_leaves_are_found_in_their_lines() {
    let wrong: Vec<String> = cases_of::<Case>("reading/reading.toml")
        .par_iter()
        .filter_map(|case| {
            let found = judged(case);
            let lines: BTreeSet<u32> = found.breaks.iter().map(|found| found.line).collect();
            let is_right = lines == &case.lines | &case.kept && found.off_path.is_empty();
            (!is_right).then(|| format!("{}: {lines:?}, {:?}", case.name, found.off_path))
        })
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}
