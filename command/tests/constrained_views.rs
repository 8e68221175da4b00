// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines with constraints of the platform: pictures, panel and studies, and refusals of what is not judged.

use serde_json::Value;
use std::process::Command;
use test_support::CUT as STUDY;
use test_support::shipped::{CONSTRAINED, ini};

/// Runs pkm on a machine; returns exit code, standard output and standard error.
fn pkm(subcommand: &str, machine: &str, words: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    let out = command.arg(subcommand).arg(ini(machine)).args(words).output().unwrap();
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
    assert_eq!(CONSTRAINED.map(shown), [[true, false], [true, true], [true, false]]);
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
fn models_vibration_and_cuts_include_the_constraints() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let file = folder.path().join(name);
        std::fs::write(&file, text).unwrap();
        file.to_str().unwrap().to_owned()
    };
    let table =
        "[table]\nmass_kg = 80\nstiffness_n_per_um = 50\ndamping_ratio = 0.05\nmax_force_n = 500\n";
    let study = file("study.toml", &format!("{table}{STUDY}"));
    let program = file("part.ngc", "G21 G90 G94\nM3 S6000\nG1 X5 Y3 F600\nG1 X0 Y0\nM2\n");
    for machine in CONSTRAINED {
        let model = folder.path().join(machine);
        let written = fitting("export", machine, &["--mjcf", model.to_str().unwrap()]);
        assert!(written.contains("README.md"), "{written}");
        let readme = std::fs::read_to_string(model.join("README.md")).unwrap();
        assert!(readme.contains("`constraint_0_body`"), "{readme}");
        let states = fitting("joints", machine, &["--passive", "--pose", "X1"]);
        assert!(states.contains("constraint_1_2 = "), "{states}");
        let modes = json("dynamics", machine, &["--study", &study]);
        // As many as legs and table axes: constraints do not yield.
        let axes = if machine == "z3-head" { 5 } else { 3 };
        assert_eq!(modes["modes"].as_array().unwrap().len(), axes, "{machine}");
        let cut = json("cut", machine, &[&program, "--study", &study]);
        assert_eq!(cut["drives"].as_array().unwrap().len(), axes, "{machine}");
        let followed = json("dynamics", machine, &["--study", &study, "--program", &program]);
        assert!(followed["motion"].is_object(), "{machine}");
    }
}

#[test]
fn programs_are_shown_and_followed() {
    let folder = tempfile::tempdir().unwrap();
    let named = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (program, page, table) = (named("p.ngc"), named("p.html"), named("p.csv"));
    std::fs::write(&program, "G21 G90 G61\nG1 X60 Y-40 F3000\nM2\n").unwrap();
    fitting("view", "tricept", &[&program, "--html", &page]);
    let quick = ["--draws", "10", "--rays", "2"];
    fitting(
        "sensitivity",
        "tricept",
        &[&quick[..], &["--along", &program, "--csv", &table]].concat(),
    );
    let table = std::fs::read_to_string(table).unwrap();
    let mut rows = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = rows.next().unwrap();
    let place = |name: &str| names.iter().position(|own| *own == name).unwrap();
    let number = |row: &[&str], name: &str| row[place(name)].parse::<f64>().unwrap();
    let rows: Vec<_> = rows.collect();
    let mut fastest: f64 = 0.0;
    for pair in rows.windows(2) {
        for joint in 0..3 {
            let [before, after] = [0, 1].map(|k| number(&pair[k], &format!("joint_{joint}")));
            let rate = number(&pair[1], &format!("rate_{joint}"));
            fastest = fastest.max(rate.abs());
            // The mean rate of a cycle of 1 ms differs by half the change of the rate: 400 mm/s² along the path, and the
            // bend of 50 mm/s over struts of 800 mm.
            let mean = (after - before) / 1e-3;
            assert!((mean - rate).abs() < 0.3, "{rate} {mean}");
        }
    }
    assert!(fastest > 10.0, "{fastest}");
}

#[test]
fn what_is_not_judged_is_refused() {
    for (machine, subcommand, words, expected) in [
        ("exechon", "measure", vec!["/dev/null"], "CONSTRAINT_2 follows from the others"),
        ("exechon", "calibrate", vec!["/dev/null"], "CONSTRAINT_2 follows from the others"),
        ("tricept", "workspace", vec!["--tilt", "20"], "on this machine A and B follow from X Y Z"),
        ("linear-delta", "workspace", vec!["--tilt", "20"], "the joints move neither A nor B"),
    ] {
        let (code, _, error) = pkm(subcommand, machine, &words);
        assert_eq!(code, 2, "{subcommand}: {error}");
        assert!(error.contains(expected), "{subcommand}: {error}");
    }
}
