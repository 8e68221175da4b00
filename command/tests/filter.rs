// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm filter`, as run by a user interface of LinuxCNC.

use std::path::Path;
use std::process::{Command, Output};
use test_support::shipped::folder;

fn filtered(machine: Option<&Path>, program: &Path) -> Output {
    // As AXIS does: by a shell, with the name in quotes.
    let mut command = Command::new("sh");
    command.arg("-c").arg(format!("{} filter '{}'", env!("CARGO_BIN_EXE_pkm"), program.display()));
    command.env_remove("INI_FILE_NAME").env("AXIS_PROGRESS_BAR", "1");
    if let Some(machine) = machine {
        command.env("INI_FILE_NAME", machine);
    }
    command.output().unwrap()
}

fn reported(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_program_that_fits_comes_out_as_it_is_with_the_progress_of_the_check() {
    let machine = folder("linear-delta").join("linear-delta.ini");
    let program = folder("linear-delta").join("programs/plate-layer.ngc");
    let output = filtered(Some(&machine), &program);
    assert_eq!(output.status.code(), Some(0), "{}", reported(&output));
    assert_eq!(output.stdout, std::fs::read(&program).unwrap());
    let percents: Vec<u32> = reported(&output)
        .lines()
        .map(|line| line.strip_prefix("FILTER_PROGRESS=").unwrap().parse().unwrap())
        .collect();
    assert!(percents.len() > 3 && percents.iter().all(|percent| *percent <= 100), "{percents:?}");
}

#[test]
fn a_program_that_does_not_fit_is_held_back_with_its_lines_and_reasons() {
    let place = tempfile::tempdir().unwrap();
    let program = place.path().join("it's far.ngc");
    std::fs::write(&program, "G21 G90 M52 P1\nG0 X0 Y0\nG1 F600 X5000\nM2\n").unwrap();
    let machine = folder("linear-delta").join("linear-delta.ini");
    let output = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .arg("filter")
        .arg(&program)
        .env("INI_FILE_NAME", &machine)
        .output()
        .unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0));
    let text = reported(&output);
    assert!(text.contains("it's far.ngc does not fit the machine"), "{text}");
    assert!(
        text.contains("line 3: axis range: axis X") && text.contains("G1 F600 X5000"),
        "{text}"
    );
}

#[test]
fn without_a_machine_or_with_a_program_that_does_not_parse_nothing_comes_out() {
    let place = tempfile::tempdir().unwrap();
    let program = place.path().join("bad.ngc");
    std::fs::write(&program, "G0 X0\nG1 XX\n").unwrap();
    let output = filtered(None, &program);
    assert!(reported(&output).contains("INI_FILE_NAME"), "{}", reported(&output));
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    let machine = folder("linear-delta").join("linear-delta.ini");
    let output = filtered(Some(&machine), &program);
    assert!(reported(&output).contains("bad.ngc"), "{}", reported(&output));
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    let output = filtered(Some(&machine), &place.path().join("none.ngc"));
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
}

#[test]
fn a_program_that_is_not_judged_is_held_back() {
    let place = tempfile::tempdir().unwrap();
    let machine = place.path().join("linear-delta.ini");
    let [ini, tools] =
        ["ini", "tbl"].map(|end| folder("linear-delta").join(format!("linear-delta.{end}")));
    let text = std::fs::read_to_string(ini).unwrap();
    // A key that only another version of LinuxCNC has.
    std::fs::write(&machine, text.replace("[TRAJ]\n", "[TRAJ]\nPLANNER_TYPE = 1\n")).unwrap();
    std::fs::copy(tools, place.path().join("linear-delta.tbl")).unwrap();
    let program = place.path().join("fits.ngc");
    std::fs::write(&program, "G21 G90\nG1 F600 X1\nM2\n").unwrap();
    let filter = |options: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
        command.arg("filter").args(options).arg(&program).env("INI_FILE_NAME", &machine);
        command.output().unwrap()
    };
    let held = filter(&[]);
    assert_eq!((held.status.code(), held.stdout.len()), (Some(2), 0), "{}", reported(&held));
    assert!(reported(&held).contains("PLANNER_TYPE"), "{}", reported(&held));
    // The option of earlier versions does not accept a program that LinuxCNC did not run.
    let held = filter(&["--path-is-enough"]);
    assert_eq!((held.status.code(), held.stdout.len()), (Some(2), 0), "{}", reported(&held));
}
