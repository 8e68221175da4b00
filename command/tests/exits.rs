// SPDX-License-Identifier: GPL-2.0-or-later
//! Exit statuses: the worst of several programs decides, in whatever order they come.

use crate::commands::Bench;

const GOOD: &str = "G21 G90 G94\nG1 X5 Y-5 F600\nM2\n";
const BAD: &str = "G21 G90 G94\nG1 Z900 F600\nM2\n";

#[test]
fn the_worst_of_several_programs_decides_wherever_it_stands() {
    let bench = Bench::new().with("good.ngc", GOOD).with("bad.ngc", BAD).with("still.ngc", "M2\n");
    let bench = bench.with("all/good.nc", GOOD);
    for (programs, status) in [
        ("good.ngc", 0),
        ("good.ngc good.ngc", 0),
        ("all", 0),
        ("bad.ngc good.ngc", 1),
        ("good.ngc bad.ngc", 1),
        ("good.ngc bad.ngc good.ngc", 1),
        ("none.ngc good.ngc", 2),
        ("good.ngc still.ngc bad.ngc", 2),
        ("bad.ngc good.ngc none.ngc", 2),
    ] {
        for options in ["", " --format json", " --quiet"] {
            let answer =
                bench.answer(&format!("preflight linear-delta.ini {programs}{options}"), "");
            assert!(answer.ends_with(&format!("exit {status}\n")), "{programs}{options}: {answer}");
        }
    }
}

#[test]
fn a_program_that_is_not_judged_ends_with_2_and_the_reason_and_leaves_no_trace() {
    let bench = Bench::new().with("short.ngc", "G21 G90 G94\nG1 X1 F600\nM2\n");
    // One of two mechanisms alone is not run.
    let machine = test_support::shipped::ini("lathe-mirrored");
    let command = format!("preflight {} short.ngc --mechanism 1", machine.display());
    for options in ["", " --format json", " --quiet"] {
        let answer = bench.answer(&format!("{command} --trace rows.csv{options}"), "");
        assert!(answer.ends_with("exit 2\n"), "{options}: {answer}");
        let reason = "LinuxCNC runs both mechanisms of the machine or none";
        assert!(answer.contains(reason), "{options}: {answer}");
        assert!(!bench.0.path().join("rows.csv").exists(), "{options}");
    }
}
