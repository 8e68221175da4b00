// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines whose passive joints couple coordinates, from the user's view: programs that fit, and programs that violate
//! each kind of limit.

use crate::commands::Bench;
use test_support::CUT;
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

/// Moves the platform while the tip stays, with a tool that is mounted at home.
const WITH_WRIST: &str = "G21 G90 G94 G61\nG43 H1\nG1 X60 Y-40 Z-940 F1500\nG1 A30 C40 F900\nG1 X-50 A-25\n\
                          G2 X50 Y-40 I50 J0 A0 F1500\nG1 C-60 A40 F900\nG1 X0 Y0 Z-900 A0 C0\nM2\n";

/// Turns the wrist between the cuts.
const CUT_WITH_WRIST: &str = "G21 G90 G94 G61\nG43 H1\nM3 S8000\nG0 X60 Y-40 Z-940\nG0 A30 C40\nG1 X-50 F1500\n\
                              G0 A-25\nG1 X50\nG0 X0 Y0 Z-900 A0 C0\nM2\n";

/// Returns a bench with the tricept that has a wrist, edited.
fn wrist(edit: impl Fn(String) -> String) -> Bench {
    let ini = test_support::shipped::root().join("tests/cases/ini/constraints/tricept-wrist.ini");
    let text = edit(std::fs::read_to_string(ini).unwrap());
    Bench::new().with("wrist.ini", &text).with("tricept-wrist.tbl", "T1 P1 Z60 D10\n")
}

#[test]
fn a_program_that_uses_a_wrist_is_proved_and_runs_to_its_end() {
    let bench = wrist(|text| text).with("wrist.ngc", WITH_WRIST);
    let reported = bench.answer("preflight wrist.ini wrist.ngc", "");
    assert!(
        reported.contains("\nThe program fits the machine") && reported.ends_with("exit 0\n"),
        "{reported}"
    );
    let reported = bench.answer("run wrist.ini wrist.ngc", "");
    assert!(reported.contains("runs to its end") && reported.ends_with("exit 0\n"), "{reported}");
    for (words, expected) in [
        ("check wrist.ini", "in the coordinates of its legs"),
        ("travel wrist.ini --pose 20 -30 -920 15 0 -20", "A "),
        ("replay wrist.ini wrist.ngc --period 0.5", "joint_4"),
        ("workspace wrist.ini --bands 4 --grid 8", "volume"),
        ("sensitivity wrist.ini", "conditioning"),
        ("frames wrist.ini", "</svg>"),
        ("scene wrist.ini", "\"is_carried\": true"),
        ("view wrist.ini wrist.ngc --html page.html", "exit 0"),
        ("random wrist.ini --seconds 3", "G1"),
    ] {
        let reported = bench.answer(words, "");
        assert!(
            reported.contains(expected) && reported.ends_with("exit 0\n"),
            "{words}: {reported}"
        );
    }
    let bench = bench.with("study.toml", CUT).with("cut.ngc", CUT_WITH_WRIST);
    for (words, expected) in [
        ("export wrist.ini --mjcf model", "exit 0\n"),
        ("cut wrist.ini cut.ngc --study study.toml", "exit 0\n"),
        // On every machine with such an axis.
        ("dynamics wrist.ini --study study.toml --program wrist.ngc", "an axis carries the tool"),
    ] {
        let reported = bench.answer(words, "");
        assert!(reported.contains(expected), "{words}: {reported}");
    }
}

/// A strut that is too long only while the wrist turns about the tip: at the ends of the moves it is not.
#[test]
fn a_limit_that_a_wrist_violates_between_the_ends_of_a_move_is_found_in_its_line() {
    // A strut swings by up to 120 mm sin 45° as the tool tilts to both sides.
    let program = "G21 G90 G61\nG1 A-45 F900\nG1 A45\nG1 C180\nG1 A0\nM2\n";
    let bench = wrist(|text| text).with("wrist.ngc", program);
    let replayed = bench.answer("replay wrist.ini wrist.ngc --period 0.01", "");
    // line and joint_1 of each pose
    let rows: Vec<(u32, f64)> = replayed
        .lines()
        .filter_map(|line| {
            let words: Vec<&str> = line.split(',').collect();
            Some((words.get(1)?.parse().ok()?, words.get(9)?.parse().ok()?))
        })
        .collect();
    let most = |line: u32| {
        rows.iter().filter(|row| row.0 == line).map(|row| row.1).fold(f64::MIN, f64::max)
    };
    let end = rows.iter().rfind(|row| row.0 == 4).unwrap().1;
    let limit = (most(4) + end.max(most(2)).max(most(3))) / 2.0;
    assert!(most(4) > limit + 0.5, "{limit} {}", most(4));
    let narrowed = |text: String| {
        let (before, joint) = text.split_once("[JOINT_1]").unwrap();
        format!(
            "{before}[JOINT_1]{}",
            joint.replacen("MAX_LIMIT = 1300", &format!("MAX_LIMIT = {limit}"), 1)
        )
    };
    let bench = wrist(narrowed).with("wrist.ngc", program);
    let reported = bench.answer("preflight wrist.ini wrist.ngc", "");
    assert!(
        reported.contains("error: line 4: joint range: strut 1 violates its limit"),
        "{reported}"
    );
    assert!(reported.ends_with("exit 1\n"), "{reported}");
    let ran = bench.answer("run wrist.ini wrist.ngc", "");
    assert!(ran.contains("line 4") && !ran.contains("runs to its end"), "{ran}");
}

/// The module refuses such a change, and preflight does not promise that the program waits for it.
#[test]
fn a_tool_change_at_a_tilt_of_a_wrist_does_not_fit_and_the_warning_gives_the_way_out() {
    let program = "G21 G90\nG1 A20 F900\nG43.1 Z40\nG1 A10\nG1 A0\nM2\n";
    let bench = wrist(|text| text).with("wrist.ngc", program);
    let reported = bench.answer("preflight wrist.ini wrist.ngc", "");
    assert!(
        reported.contains("which pkmkins refuses") && reported.contains("[code -14]"),
        "{reported}"
    );
    assert!(!reported.contains("waits while pkmkins moves the joints"), "{reported}");
    assert!(reported.ends_with("exit 1\n"), "{reported}");
}
