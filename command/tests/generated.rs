// SPDX-License-Identifier: GPL-2.0-or-later
//! Files of the configurations that are not in git, because pkm generates them.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use test_support::shipped::{copied, folder, root};

/// Returns the file with their checksums.
pub fn sums() -> PathBuf {
    root().join("tests/cases/generated.sha256")
}

#[test]
fn generated_files_have_the_sums_that_were_reviewed() {
    let script = root().join("tools/generate.sh");
    assert!(Command::new(script).arg(env!("CARGO_BIN_EXE_pkm")).status().unwrap().success());
    let check = Command::new("sha256sum")
        .args(["--check", "--quiet", "tests/cases/generated.sha256"])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(
        check.status.success(),
        "{}where that is meant: sha256sum $(git ls-files --others --ignored --exclude-standard configs) \
         > tests/cases/generated.sha256",
        String::from_utf8_lossy(&check.stdout)
    );
}

#[test]
fn check_names_the_command_that_writes_a_missing_one() {
    let copy = copied("linapod");
    let place = |name: &str| copy.path().join(name);
    for name in ["linapod-panel.xml", "linapod-panel.tcl", "programs"] {
        fs::remove_file(place(name)).unwrap();
    }
    fs::create_dir(place("paths")).unwrap();
    fs::copy(folder("linapod").join("paths/bowl.toml"), place("paths/bowl.toml")).unwrap();
    let check = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .args(["check", "--no-start", "linapod.ini"])
        .current_dir(copy.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&check.stdout) + String::from_utf8_lossy(&check.stderr);
    for command in [
        "PYVCP = linapod-panel.xml",
        "POSTGUI_HALFILE = linapod-panel.tcl",
        "run pkm panel linapod.ini to write it",
        "run pkm path linapod.ini paths/bowl.toml --output programs/bowl.ngc to write it",
    ] {
        assert!(said.contains(command), "{command}: {said}");
    }
    assert_eq!(check.status.code(), Some(1), "{said}");
}
