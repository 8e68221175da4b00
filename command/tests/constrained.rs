// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines whose passive joints couple coordinates, from the user's view: programs that fit, and programs that violate
//! each kind of limit.

use crate::commands::Bench;
use test_support::shipped::{CONSTRAINED, folder, ini};

#[test]
fn shipped_programs_fit() {
    let bench = Bench::new();
    for machine in CONSTRAINED {
        let programs = folder(machine).join("programs");
        let words = format!("preflight {} {}", ini(machine).display(), programs.display());
        let reported = bench.answer(&words, "");
        assert!(reported.ends_with("exit 0\n"), "{machine}: {reported}");
        assert_eq!(reported.matches("  fits  ").count(), 3, "{reported}");
    }
}

/// LinuxCNC's interpreter refuses such a block before anything moves.
#[test]
fn letters_of_coordinates_that_follow_are_named_with_those_that_they_follow_from() {
    let bench = Bench::new();
    for (machine, block, expected) in [
        ("tricept", "G1 X20 A5 F600", "on this machine A follows from X Y Z; "),
        ("exechon", "G1 B-2 F60", "on this machine B follows from X Y Z; "),
        ("z3-head", "G1 A5 C1 F60", "on this machine C follows from Z A B; "),
    ] {
        let words = format!("preflight {} -", ini(machine).display());
        let reported = bench.answer(&words, &format!("G21 G90\n{block}\nM2\n"));
        assert!(reported.contains(expected), "{machine}: {reported}");
        assert!(reported.ends_with("exit 2\n"), "{machine}: {reported}");
    }
}

/// A path whose ends are reached, and whose middle is not, is refused by the proof of the whole move.
#[test]
fn limits_between_the_ends_of_a_move_are_found() {
    let bench = Bench::new();
    let narrowed = std::fs::read_to_string(ini("tricept")).unwrap();
    // Strut 0 is at Y: in the middle of a move along X it is shorter than at the ends.
    let at_ends =
        bench.answer(&format!("joints {} --pose 200 150 -900 0 0 0", ini("tricept").display()), "");
    let value = |text: &str| -> f64 {
        let line = text.lines().find_map(|line| line.strip_prefix("joint_0 = "));
        line.unwrap().parse().unwrap()
    };
    let in_middle =
        bench.answer(&format!("joints {} --pose 0 150 -900 0 0 0", ini("tricept").display()), "");
    let least = 0.5 * (value(&at_ends) + value(&in_middle));
    let narrowed = narrowed.replacen("MIN_LIMIT = 650", &format!("MIN_LIMIT = {least}"), 1);
    let bench = bench.with("tricept.ini", &narrowed).with("tricept.tbl", "T1 P1 Z0 D1\n");
    let reported =
        bench.answer("preflight tricept.ini -", "G21 G90\nG0 X200 Y150\nG1 X-200 F3000\nM2\n");
    assert!(reported.contains("line 3: joint range: strut 0 violates its limit"), "{reported}");
}

#[test]
fn travel_and_replay_know_the_coordinates_that_follow() {
    let bench = Bench::new();
    for machine in CONSTRAINED {
        let words = format!("travel {}", ini(machine).display());
        let reported = bench.answer(&words, "");
        assert!(reported.ends_with("exit 0\n"), "{machine}: {reported}");
        let program = std::fs::read_dir(folder(machine).join("programs")).unwrap();
        let program = program.map(|entry| entry.unwrap().path()).min().unwrap();
        let words =
            format!("replay {} {} --period 0.05", ini(machine).display(), program.display());
        let reported = bench.answer(&words, "");
        assert!(reported.ends_with("exit 0\n"), "{machine}: {}", &reported[reported.len() - 300..]);
    }
}

/// The proofs do not know that a wrist moves the coordinates that follow: nothing may be promised.
#[test]
fn with_a_wrist_only_home_is_judged() {
    let text = std::fs::read_to_string(ini("tricept")).unwrap();
    let text = text
        .replacen("coordinates=XYZ constraints=3", "coordinates=XYZ axes=A constraints=3", 1)
        .replacen("JOINTS = 3", "JOINTS = 4", 1)
        .replacen("COORDINATES = XYZ", "COORDINATES = XYZA", 1)
        + "\n[CHAIN_A]\nCARRIES = TOOL\nAXIS = 1 0 0\nPOINT = 0 0 -80\n"
        + "\n[AXIS_A]\nTYPE = ANGULAR\nMIN_LIMIT = -60\nMAX_LIMIT = 60\nMAX_VELOCITY = 60\nMAX_ACCELERATION = 150\n"
        + "\n[JOINT_3]\nTYPE = ANGULAR\nHOME = 0\nMIN_LIMIT = -60\nMAX_LIMIT = 60\nMAX_VELOCITY = 60\n\
           MAX_ACCELERATION = 150\nFERROR = 2\nMIN_FERROR = 0.5\nHOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\nHOME_SEQUENCE = 0\n";
    let bench = Bench::new().with("wrist.ini", &text).with("tricept.tbl", "T1 P1 Z0 D1\n");
    let checked = bench.answer("check wrist.ini", "");
    assert!(checked.contains("not judged: poses other than home"), "{checked}");
    for words in
        ["preflight wrist.ini -", "travel wrist.ini", "workspace wrist.ini", "scene wrist.ini"]
    {
        let reported = bench.answer(words, "G21 G90\nG1 A5 F60\nM2\n");
        assert!(
            reported.contains("not judged: this tool does not support axes that carry"),
            "{words}: {reported}"
        );
    }
}
