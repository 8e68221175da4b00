// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines with constraints of the platform: pictures, panel and studies, and refusals of what is not judged.

use serde_json::Value;
use std::process::Command;
use test_support::constrained::{CONSTRAINED, constrained_ini};

/// Runs pkm on a machine; returns exit code, standard output and standard error.
fn pkm(subcommand: &str, machine: &str, words: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    let out = command.arg(subcommand).arg(constrained_ini(machine)).args(words).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (out.status.code().unwrap(), text(&out.stdout), text(&out.stderr))
}

fn fitting(subcommand: &str, machine: &str, words: &[&str]) -> String {
    let (code, text, error) = pkm(subcommand, machine, words);
    assert_eq!(code, 0, "pkm {subcommand} {machine}: {error}");
    text
}

fn json(subcommand: &str, machine: &str, words: &[&str]) -> Value {
    serde_json::from_str(&fitting(subcommand, machine, &[words, &["--format", "json"]].concat()))
        .unwrap()
}

#[test]
fn pictures_have_the_passive_parts() {
    let shown = |machine: &str| {
        let drawing = fitting("frames", machine, &[]);
        ["axis of a passive joint", "passive leg"].map(|text| drawing.contains(text))
    };
    assert_eq!(CONSTRAINED.map(shown), [[true, true], [true, false], [true, false]]);
    for machine in CONSTRAINED {
        let page = tempfile::tempdir().unwrap();
        let html = page.path().join("page.html");
        fitting("view", machine, &["--html", html.to_str().unwrap()]);
        assert!(html.metadata().unwrap().len() > 500_000);
        let scene: Value = serde_json::from_str(&fitting("scene", machine, &[])).unwrap();
        assert!(!scene["passive"].as_array().unwrap().is_empty());
        assert_eq!(
            scene["home"]["dependent"].as_array().unwrap().len(),
            scene["dependent"].as_str().unwrap().len()
        );
    }
}

#[test]
fn the_panel_shows_the_dependent_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    fitting("panel", "z3-head", &["--output-dir", folder.path().to_str().unwrap()]);
    let wiring = std::fs::read_to_string(folder.path().join("z3-head-panel.tcl")).unwrap();
    for letter in ["x", "y", "c"] {
        assert!(wiring.contains(&format!("pkmkins.dependent.{letter} dependent-{letter}\n")));
    }
    assert!(!wiring.contains("dependent.a"));
}

#[test]
fn studies_include_the_dependent_coordinates() {
    let quick = ["--draws", "500", "--rays", "20"];
    let found = json("sensitivity", "tricept", &quick);
    let sigma: Vec<f64> = serde_json::from_value(found["sigma_by_covariance"].clone()).unwrap();
    assert!(sigma.iter().filter(|value| **value > 0.0).count() >= 5, "{sigma:?}");
    let (code, _, error) = pkm("workspace", "tricept", &["--orientation", "0", "10", "0"]);
    assert_eq!(code, 2);
    assert!(error.contains("on this machine"), "{error}");
    let bound = json("workspace", "z3-head", &["--bands", "4", "--grid", "8"]);
    assert!(bound.is_object());
    let study = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(study.path(), "[legs]\nstiffness_n_per_um = 20\n").unwrap();
    let file = study.path().to_str().unwrap();
    let text = fitting("stiffness", "tricept", &["--study", file]);
    assert!(text.contains("N/um"), "{text}");
}

#[test]
fn what_is_not_judged_is_refused() {
    let program = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    std::fs::write(program.path(), "G21 G90\nG1 X10 F1000\nM2\n").unwrap();
    let file = program.path().to_str().unwrap();
    for (subcommand, words) in [
        ("view", vec![file, "--html", "/dev/null"]),
        ("sensitivity", vec!["--along", file]),
        ("measure", vec!["/dev/null"]),
        ("calibrate", vec!["/dev/null"]),
    ] {
        let (code, _, error) = pkm(subcommand, "tricept", &words);
        assert_eq!(code, 2, "{subcommand}: {error}");
        assert!(error.contains("not judged"), "{subcommand}: {error}");
    }
}
