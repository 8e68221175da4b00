// SPDX-License-Identifier: GPL-2.0-or-later
//! Comparison of the INI reader with LinuxCNC's own: `inivar`, and the start script's handling of included files.

use machine::read::ini::Ini;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use test_support::shipped::configs;

/// Number of random files, and of keys read from each.
const FILES: usize = 60;
const SECTIONS: [&str; 3] = ["A", "B", "LEG_0"];
const KEYS: [&str; 3] = ["K", "KK", "L"];

/// Valid and invalid lines with special treatment in LinuxCNC.
const LINES: &[&str] = &[
    "[A]",
    "[B]",
    "  [A] ",
    "[LEG_0]",
    "[ A ]",
    "[A]x",
    "[A",
    "K = 1",
    "K=2 ; note",
    " L\t=\t3 ",
    "KK = a=b",
    "K = \"q\"",
    "K =",
    "K",
    "",
    "  ",
    "# K = 5",
    " ; L = 6",
    "K = 1 \\",
    "  2",
    "L = x \\",
    "\\",
    "K = a\\ ",
    "K = b\r",
    "L = c\\\r",
    "# note \\",
    "k = small",
    "K= # note",
    "=K",
    "K;=7",
    "#INCLUDE part.inc",
    "#INCLUDE",
    "#INCLUDE none.inc",
    "#INCLUDED",
    "K = a\\tb",
];

fn inivar(file: &Path, section: &str, key: &str) -> Option<String> {
    let output = Command::new("inivar")
        .args(["-sec", section, "-var", key, "-ini"])
        .arg(file)
        .output()
        .expect("inivar is part of linuxcnc-uspace");
    let text = String::from_utf8(output.stdout).unwrap();
    output
        .status
        .success()
        .then(|| text.trim_end_matches('\n').to_string())
        .filter(|t| !t.is_empty())
}

/// Returns the file that LinuxCNC's start script passes on: itself, or a copy with its included files.
fn expanded(file: &Path) -> PathBuf {
    let script = "eval \"$(sed -n '/^function handle_includes/,/^}/p' $(command -v linuxcnc))\"; \
                  GREP=grep; handle_includes \"$1\" 2>/dev/null";
    let output = Command::new("bash").args(["-c", script, "-"]).arg(file).output().unwrap();
    let name = String::from_utf8(output.stdout).unwrap();
    PathBuf::from(name.trim_end())
}

/// Compares every key and returns the number of values.
fn compare(file: &Path, ini: &Ini, sections: &[&str], keys: &[&str]) -> usize {
    let theirs = expanded(file);
    let mut values = 0;
    for section in sections {
        for key in keys {
            let (own, other) = (ini.as_inivar(section, key), inivar(&theirs, section, key));
            let text = fs::read_to_string(file).unwrap();
            assert_eq!(own, other.as_deref(), "[{section}]{key} of\n{text}");
            values += usize::from(own.is_some());
        }
    }
    values
}

#[test]
fn drawn_files_are_read_as_linuxcnc_reads_them_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("part.inc"), "L = included\n[B]\n K = 4\n").unwrap();
    let mut rng = Pcg64::seed_from_u64(5);
    let (mut read, mut refused, mut values) = (0, 0, 0);
    while read < FILES {
        let lines: Vec<&str> =
            (0..rng.random_range(3..12)).map(|_| LINES[rng.random_range(0..LINES.len())]).collect();
        let file = folder.path().join("drawn.ini");
        fs::write(&file, format!("[A]\n{}\n", lines.join("\n"))).unwrap();
        match Ini::read(&file) {
            Ok(ini) => {
                values += compare(&file, &ini, &SECTIONS, &KEYS);
                read += 1;
            }
            Err(_) => refused += 1,
        }
    }
    // Neither all nor no files are refused, and the files do contain values.
    assert!(refused > FILES / 4 && values > FILES, "{refused} {values}");
}

#[test]
fn shipped_files_are_read_as_linuxcnc_reads_them() {
    for entry in fs::read_dir(configs()).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_str().unwrap().to_string();
        let file = folder.join(format!("{name}.ini"));
        let ini = Ini::read(&file).unwrap();
        let sections = ["KINS", "TRAJ", "JOINT_0", "AXIS_X", "PKM"];
        let keys = ["KINEMATICS", "HOME", "MAX_LIMIT", "SCREW_LEAD", "COORDINATES"];
        assert!(compare(&file, &ini, &sections, &keys) >= 5, "{name}");
    }
}

#[test]
fn long_lines_are_cut_where_linuxcnc_cuts_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("long.ini");
    for (length, fits) in [(255, true), (256, false)] {
        let text = format!("[A]\nK = {:x<1$}\nL = 1\n", "", length - 4);
        fs::write(&file, text).unwrap();
        assert_eq!(Ini::read(&file).is_ok(), fits);
        // " = " and the key take four bytes of the line.
        assert_eq!(inivar(&file, "A", "K").unwrap().len(), 251);
    }
}
