// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm view` from the user's view. tests/page opens the page in a browser.

use std::path::Path;
use std::process::{Command, Output};
use test_support::shipped::ini;

fn view(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pkm"))
        .current_dir(folder)
        .arg("view")
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn the_page_of_a_machine_is_one_file_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let hexapod = ini("hexapod");
    assert_eq!(view(folder.path(), &[hexapod.to_str().unwrap()]).status.code(), Some(0));
    let page = std::fs::read_to_string(folder.path().join("hexapod.html")).unwrap();
    assert!(page.len() < 2_000_000, "{}", page.len());
    for foreign in [" src=", "rel=\"stylesheet\"", "@import", "import("] {
        assert!(
            !page.split("<script type=\"module\">").next().unwrap().contains(foreign),
            "{foreign}"
        );
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn an_unreadable_program_is_reported_and_the_page_shows_the_machine() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("broken.ngc"), "G1 X10 F100\nG1 X[1+\nM2\n").unwrap();
    let out = view(
        folder.path(),
        &[ini("hexapod").to_str().unwrap(), "broken.ngc", "--html", "page.html"],
    );
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("broken.ngc"));
    assert!(folder.path().join("page.html").is_file());
}

#[test]
fn what_cannot_be_written_or_drawn_is_refused_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let hexapod = ini("hexapod");
    let file = hexapod.to_str().unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["--html", "nowhere/page.html"], "nowhere"),
        (&["--picture", "p.png", "--browser", "/nowhere/browser"], "/nowhere/browser"),
        (&["--picture", "p.png", "--browser", "/bin/false"], "drew 0 of 1 frames"),
        (&["--picture", "p.png", "--size", "63", "100"], "an even number"),
        (&["--video", "v.mp4"], "PROGRAM.ngc"),
        (&["--from", "below"], "3D, front, side, top"),
    ];
    for (arguments, reported) in cases {
        let out = view(folder.path(), &[&[file], arguments].concat());
        let stderr = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(2), "{arguments:?} {stderr}");
        assert!(stderr.contains(reported), "{arguments:?}: {stderr}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{arguments:?}");
    }
}
