// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm migrate`: LinuxCNC's samples and layouts of older files become consistent machines, which run their first
//! program in LinuxCNC in virtual time. `pkm check` suggests it; `pkm preflight` warns about output of posts for other
//! machines.

use crate::commands::Bench;
use std::fs;
use std::path::{Path, PathBuf};

const SAMPLES: &str = "/usr/share/doc/linuxcnc/examples/sample-configs/sim";

/// LinuxCNC's samples of its five modules.
const OF_LINUXCNC: [(&str, &str); 5] = [
    ("axis/ldelta.ini", "lineardeltakins"),
    ("axis/rdelta.ini", "rotarydeltakins"),
    ("tklinuxcnc/tripod.ini", "tripodkins"),
    ("axis/pentapod/pentapod.ini", "pentakins"),
    ("axis/vismach/hexapod-sim/hexapod.ini", "genhexkins"),
];

fn older() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/cases/older")
}

/// Migrates, checks and runs a file, and returns the output of the migration.
fn assert_migrated(bench: &Bench, file: &Path) -> String {
    let name = file.file_stem().unwrap().to_str().unwrap();
    let (file, made) = (file.display(), format!("{name}-new"));
    let reported = bench.answer(&format!("migrate {file} --out {made}"), "");
    assert!(reported.ends_with("exit 0\n"), "{file}: {reported}");
    let ini = format!("{made}/{name}.ini");
    let checked = bench.answer(&format!("check {ini}"), "");
    assert!(checked.ends_with("exit 0\n"), "{file}: {checked}");
    assert!(checked.contains("every pose within its axis limits"), "{file}: {checked}");
    let ran = bench.answer(&format!("preflight {ini} {made}/programs/first.ngc"), "");
    assert!(ran.ends_with("\nThe program fits the machine.\nexit 0\n"), "{file}: {ran}");
    reported
}

#[test]
fn the_samples_of_linuxcnc_become_machines_that_run() {
    let bench = Bench::new();
    for (sample, module) in OF_LINUXCNC {
        let file = Path::new(SAMPLES).join(sample);
        let checked = bench.answer(&format!("check {}", file.display()), "");
        let way_out = format!("pkm migrate {} makes one of it", file.display());
        assert!(checked.contains(&way_out) && checked.contains(module), "{checked}");
        assert!(checked.ends_with("exit 2\n"), "{checked}");
        let reported = assert_migrated(&bench, &file);
        assert!(
            reported.contains(&format!("is made, of a configuration for {module}.")),
            "{reported}"
        );
    }
}

#[test]
fn older_layouts_become_machines_that_run() {
    let bench = Bench::new();
    let mut count = 0;
    for folder in fs::read_dir(older()).unwrap() {
        let files = fs::read_dir(folder.unwrap().path()).unwrap().map(|file| file.unwrap().path());
        for file in files.filter(|file| file.extension().is_some_and(|end| end == "ini")) {
            assert_migrated(&bench, &file);
            count += 1;
        }
    }
    assert_eq!(count, 8);
}

#[test]
fn check_names_the_command_for_files_from_before_joints_and_axes_and_for_no_others() {
    let bench = Bench::new();
    let old = older().join("delta-27/delta.ini");
    let reported = bench.answer(&format!("check {}", old.display()), "");
    assert!(reported.contains("from before LinuxCNC had joints and axes"), "{reported}");
    assert!(reported.contains("pkm migrate") && reported.ends_with("exit 2\n"), "{reported}");
    let bench = bench.with("mill.ini", "[KINS]\nKINEMATICS = trivkins\nJOINTS = 3\n");
    let reported = bench.answer("check mill.ini", "");
    assert!(!reported.contains("migrate") && reported.contains("expected pkmkins"), "{reported}");
}

#[test]
fn what_is_refused_leaves_no_folder() {
    let bench = Bench::new().with("old/mill.ini", "[KINS]\nKINEMATICS = trivkins\nJOINTS = 3\n");
    let reported = bench.answer("migrate old/mill.ini", "");
    assert!(reported.contains("old/mill.ini:2") && reported.ends_with("exit 2\n"), "{reported}");
    assert!(!bench.0.path().join("mill-pkmkins").exists());
    let file = older().join("delta-27/delta.ini");
    let reported = bench.answer(&format!("migrate {} --out old", file.display()), "");
    assert!(
        reported.contains("old exists already") && reported.ends_with("exit 2\n"),
        "{reported}"
    );
    // No such machine: its home is out of reach.
    let words = format!("migrate {} --home 0 0 900 --out far", file.display());
    let reported = bench.answer(&words, "");
    assert!(reported.contains("at the given home") && reported.ends_with("exit 1\n"), "{reported}");
    assert!(!bench.0.path().join("far").exists());
}

#[test]
fn a_post_for_a_machine_whose_zero_is_the_top_gets_a_warning() {
    let header = "G21 G90 G94 G17 G54\nG0 Z40\n";
    for (words, line) in [
        ("G53 G0 Z0\n", Some(3)),
        // The post's retract after a work offset, which G53 ignores.
        ("G10 L20 P1 Z10\nG53 G0 Z0\n", Some(4)),
        ("G91 G28 Z0\nG90\n", Some(3)),
        ("o<retract> sub\nG53 G0 Z0\no<retract> endsub\no<retract> call\n", Some(4)),
        ("G53 G0 Z90\n", None),
        ("G1 Z0 F600\nG0 Z40\n", None),
    ] {
        let bench = Bench::new().with("part.ngc", &format!("{header}{words}G0 Z50\nM2\n"));
        let reported = bench.answer("preflight linear-delta.ini part.ngc", "");
        let warning = "a rapid goes down to Z0 of the machine";
        match line {
            Some(line) => {
                assert!(
                    reported.contains(&format!("warning: line {line}: {warning}")),
                    "{words}{reported}"
                );
                assert!(reported.contains("Let the post write G53 G0 Z90"), "{words}{reported}");
                assert!(reported.ends_with("see the warnings.\nexit 0\n"), "{words}{reported}");
            }
            None => assert!(!reported.contains(warning), "{words}{reported}"),
        }
    }
}
