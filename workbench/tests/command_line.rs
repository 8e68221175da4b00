// SPDX-License-Identifier: GPL-2.0-or-later
//! What holds for every subcommand: where input comes from and how answers are told.

use crate::commands::Bench;

/// A file of rows, and what is left of an answer without its exit code.
const ROWS: &str = "x,y,z,a,b,c\n10,-20,50,0,0,0\n0,0,90,0,0,0\n";

const PROGRAM: &str = "G21 G90\nG1 X10 F6000\nM2\n";

#[test]
fn rows_come_from_a_file_or_from_standard_input() {
    let bench = Bench::new().with("rows.csv", ROWS).with("short.csv", "x,y,z,a,b,c\n1,2\n");
    let piped = bench.answer("joints linear-delta.ini", ROWS);
    assert!(
        piped.starts_with("joint_0,joint_1,joint_2\n") && piped.ends_with("exit 0\n"),
        "{piped}"
    );
    assert_eq!(bench.answer("joints linear-delta.ini --rows -", ROWS), piped);
    assert_eq!(bench.answer("joints linear-delta.ini --rows rows.csv", ""), piped);
    let rods = bench.answer("rods linear-delta.ini", ROWS);
    assert_eq!(bench.answer("rods linear-delta.ini --rows rows.csv", ""), rods);
    let joints = bench.with("joints.csv", piped.strip_suffix("exit 0\n").unwrap());
    let poses = joints.answer("pose linear-delta.ini --rows joints.csv", "");
    assert!(poses.starts_with("x,y,z,a,b,c\n") && poses.ends_with("exit 0\n"), "{poses}");
    for (words, told) in [
        ("joints linear-delta.ini --rows none.csv", "none.csv: No such file or directory"),
        (
            "joints linear-delta.ini --rows short.csv",
            "short.csv:2: 2 cells; expected 6, as many as the header names",
        ),
        ("joints linear-delta.ini --rows rows.csv --pose 0 0 50 0 0 0", "--pose and --rows"),
        ("pose linear-delta.ini --rows rows.csv --joints 1 2 3", "cannot be used with"),
        ("pose linear-delta.ini --joints 1 2", "--joints: found 2 numbers; expected joint_0"),
    ] {
        let answer = joints.answer(words, "");
        assert!(answer.contains(told) && answer.ends_with("exit 2\n"), "{answer}");
    }
}

#[test]
fn a_pose_is_six_numbers_or_words() {
    let bench = Bench::new();
    let numbers = bench.answer("joints linear-delta.ini --pose 10 -20 90 0 0 0", "");
    assert!(numbers.ends_with("exit 0\n"), "{numbers}");
    // Z90 is that of home.
    assert_eq!(bench.answer("joints linear-delta.ini --pose x10 Y-20", ""), numbers);
    assert_eq!(
        bench.answer("travel linear-delta.ini --pose 10 -20 90 0 0 0", ""),
        bench.answer("travel linear-delta.ini --pose X10 Y-20", "")
    );
    for words in ["--pose 10 nan 90 0 0 0", "--pose X10 5", "--pose 1 2 3", "--pose X10 other.ini"]
    {
        let answer = bench.answer(&format!("joints linear-delta.ini {words}"), "");
        assert!(answer.starts_with("pkm: --pose") && answer.ends_with("exit 2\n"), "{answer}");
    }
}

#[test]
fn a_program_comes_from_standard_input() {
    let bench = Bench::new().with("line.ngc", PROGRAM);
    let before = bench.files();
    for command in ["replay linear-delta.ini", "rods linear-delta.ini", "run linear-delta.ini"] {
        let named = bench.answer(&format!("{command} line.ngc"), "").replace("line.ngc", "");
        let piped = bench.answer(&format!("{command} -"), PROGRAM);
        assert!(piped.ends_with("exit 0\n"), "{piped}");
        // The same rows, and the same time; the name of the file is another one.
        let tail =
            |text: &str| text.rsplit_once(": ").map_or(text.into(), |(_, tail)| tail.to_string());
        assert_eq!(tail(&piped), tail(&named));
    }
    let wrong = bench.answer("preflight linear-delta.ini -", "G1 G2 X3\nM2\n");
    assert!(wrong.contains("standard-input.ngc") && wrong.ends_with("exit 2\n"), "{wrong}");
    assert_eq!(bench.files(), before);
}
