// SPDX-License-Identifier: GPL-2.0-or-later
//! The studies as commands: outputs, and input that is refused without any output file.

use crate::commands::Bench;
use std::fs;

const LEGS: &str = "[legs]\nstiffness_n_per_um = 10\njoint_sigma_um = 5\nrod_diameter_mm = 8\n";

/// Checks that the output ends with this exit code and contains these words.
fn assert_output(answer: &str, exit: u8, words: &[&str]) {
    assert!(answer.ends_with(&format!("exit {exit}\n")), "{answer}");
    for word in words {
        assert!(answer.contains(word), "{word}: {answer}");
    }
}

#[test]
fn a_study_that_is_wrong_is_refused_with_its_line_and_nothing_is_written() {
    for (text, words) in [
        ("[legs]\nstiffness_n_per_um = -10\n", ["line 2", "expected more than 0"]),
        ("[legs]\nstiffness = 10\n", ["line 2", "stiffness_n_per_um"]),
        ("[legs]\nscrew = \"stuck\"\n", ["line 2", "`backdrivable` or `self-locking`"]),
        ("[legs]\nstiffness_n_per_um = [10, 10]\n", ["expected one number, or 3", "found 2"]),
        ("[rods]\n", ["line 1", "unknown field `rods`"]),
        ("", ["has no stiffness_n_per_um", "[legs]"]),
    ] {
        let bench = Bench::new().with("study.toml", text);
        let files = bench.files();
        let answer =
            bench.answer("stiffness linear-delta.ini --study study.toml --plots drawn", "");
        assert_output(&answer, 2, &[&words[..], &["study.toml"]].concat());
        assert_eq!(bench.files(), files, "{text}");
    }
    let bench = Bench::new();
    let answer = bench.answer("stiffness linear-delta.ini --study none.toml", "");
    assert_output(&answer, 2, &["none.toml: No such file"]);
}

#[test]
fn stiffness_prints_matrix_and_axes_and_draws_its_maps() {
    let bench = Bench::new().with("study.toml", LEGS);
    let words =
        "stiffness linear-delta.ini --study study.toml --grid 9 --plots drawn --csv map.csv";
    let answer = bench.answer(words, "");
    // The rods' parallelograms constrain A B C.
    assert_output(&answer, 0, &["Guides constrain some coordinates", "N/um", "rigid"]);
    // Three maps of each kind, and along each of three axes, sizes of the platform, and one ellipsoid: nothing rotates.
    assert_eq!(fs::read_dir(bench.0.path().join("drawn")).unwrap().count(), 17);
    assert_output(&answer, 0, &["stiffness along X Y Z in N/um"]);
    let map = fs::read_to_string(bench.0.path().join("map.csv")).unwrap();
    assert!(map.starts_with("x,y,z,translation_n_per_um") && map.lines().count() > 100);
    assert!(map.lines().next().unwrap().ends_with(",about_z_n_m_per_rad"));
}

#[test]
fn rods_follow_poses_and_programs() {
    let bench =
        Bench::new().with("study.toml", LEGS).with("line.ngc", "G21 G90\nG1 X10 F6000\nM2\n");
    let poses = "x,y,z,a,b,c\n0,0,50,0,0,0\n900,0,0,0,0,0\n";
    let answer = bench.answer("rods linear-delta.ini --point 0 0 -10", poses);
    assert_output(&answer, 1, &["time,line,x,", ",guide_angle_0,", "point_0_z", "pkm: line 3: "]);
    let words = "rods linear-delta.ini line.ngc --period 0.05 --study study.toml --plots drawn";
    assert_output(&bench.answer(words, ""), 0, &["gap_leg"]);
    assert!(fs::read_dir(bench.0.path().join("drawn")).unwrap().count() >= 6);
    assert_output(&bench.answer("rods linear-delta.ini", "x,y,z,a,b,c\n"), 2, &["no pose"]);
    assert_output(
        &bench.answer("rods linear-delta.ini none.ngc", ""),
        2,
        &["none.ngc: No such file"],
    );
}

#[test]
fn sensitivity_prints_errors_and_singular_poses_and_follows_a_law() {
    let law = "[law]\nperiod_s = 4\nradius_mm = 10\ngrowth_mm = 20\nrise_mm = 1\nbend_mm = 1\n";
    let bench = Bench::new().with("study.toml", &format!("{LEGS}{law}"));
    let words = "sensitivity linear-delta.ini --study study.toml --draws 500 --rays 100 --law \
                 --ratios 1 --csv law.csv --plots drawn";
    let answer = bench.answer(words, "");
    assert_output(&answer, 0, &["covariance", "500 samples", "parallel", "no partial derivatives"]);
    let law = fs::read_to_string(bench.0.path().join("law.csv")).unwrap();
    assert_eq!(law.lines().count(), 502);
    assert!(fs::read_dir(bench.0.path().join("drawn")).unwrap().count() >= 6);
    for (words, reported) in [
        ("sensitivity linear-delta.ini --law", "no section [law]"),
        ("sensitivity linear-delta.ini --csv x.csv", "need a motion"),
        ("sensitivity linear-delta.ini --length 0", "--length 0: expected more than 0"),
        ("sensitivity linear-delta.ini --draws 1", "expected 2 or more"),
        ("sensitivity linear-delta.ini --pose 1 2 3", "found 3 numbers"),
        ("sensitivity linear-delta.ini --pose 900 0 0 0 0 0", "X900.0000 Y0.0000 Z0.0000"),
    ] {
        assert_output(&bench.answer(words, ""), 2, &[reported]);
    }
}

#[test]
fn a_workspace_is_reported_drawn_and_written() {
    let bench = Bench::new().with("study.toml", LEGS);
    let words = "workspace linear-delta.ini --study study.toml --bands 12 --grid 20 --threads 2 \
                 --plane xz --plane 1,1,0 --csv ends.csv --mesh body.obj --plots drawn";
    let answer = bench.answer(words, "");
    assert_output(&answer, 0, &["volume", "% apart", "+X", "1,1,0", "positions,", "threads: 2"]);
    assert_eq!(fs::read_dir(bench.0.path().join("drawn")).unwrap().count(), 3);
    let mesh = fs::read_to_string(bench.0.path().join("body.obj")).unwrap();
    assert!(mesh.starts_with("# workspace, lengths in mm\nv "));
    assert!(fs::read_to_string(bench.0.path().join("ends.csv")).unwrap().lines().count() > 200);
}

#[test]
fn a_workspace_that_is_empty_or_cannot_be_written_leaves_nothing_behind() {
    let bench = Bench::new().with("file", "").with("study.toml", "[limits]\nconditioning = 0.9\n");
    let files = bench.files();
    for (words, reported) in [
        ("--from 0 0 900 --csv x.csv", "is not in the workspace"),
        ("--study study.toml --mesh x.obj", "conditioning; give a point inside"),
        ("--tilt 95", "expected 0 or more, and less than 90"),
        ("--plane zx", "expected xy, xz, yz or a normal"),
        ("--bands 4 --grid 4 --csv none/x.csv", "none/x.csv: No such file"),
        ("--bands 4 --grid 4 --plots file/drawn", "file/drawn: Not a directory"),
        ("--orientation 1 0 0", "is not in the workspace"),
    ] {
        assert_output(
            &bench.answer(&format!("workspace linear-delta.ini {words}"), ""),
            2,
            &[reported],
        );
        assert_eq!(bench.files(), files, "{words}");
    }
}
