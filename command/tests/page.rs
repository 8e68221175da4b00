// SPDX-License-Identifier: GPL-2.0-or-later
//! The page of `pkm preflight` about a program.

use crate::commands::Bench;
use std::fs;

#[test]
fn a_program_that_breaks_its_limits_is_red_and_names_every_break() {
    let bench = Bench::new()
        .spoilt("MAX_LIMIT = 375", "MAX_LIMIT = 330")
        .with("good.ngc", "G21 G90\nG1 X10 F3000\nM2\n")
        .with("bad.ngc", "G21 G90\nG0 X-75 Y75 Z70\nG1 X75 F3000\nG1 X0 Y0 Z20\nY200\nM2\n");
    let read = |name: &str| fs::read_to_string(bench.0.path().join(name)).unwrap();
    bench.answer("preflight linear-delta.ini good.ngc --report good.html", "");
    let good = read("good.html");
    assert!(
        good.contains("\u{2713} </span>The program fits the machine")
            && good.contains("class=\"verdict fits\"")
    );
    assert!(
        !good.contains("beyond a limit</text>")
            && !good.contains("#B40000")
            && !good.contains("violated (")
    );

    let reported = bench.answer("preflight linear-delta.ini bad.ngc --report bad.html", "");
    let bad = read("bad.html");
    assert!(bad.contains("\u{2717} </span>The program does not fit the machine"), "{reported}");
    assert!(bad.contains("beyond a limit") && bad.contains("class=\"verdict misfit\""));
    // As many as the command reports, each with its line, in the list and in the plots.
    let places: Vec<&str> =
        reported.lines().filter_map(|l| l.strip_prefix("error: line ")).collect();
    assert!(places.len() > 3, "{reported}");
    for (number, place) in places.iter().enumerate() {
        let (line, text) = place.split_once(": ").unwrap();
        assert!(
            bad.contains(&format!("<b>line {line}</b> <code>")) && bad.contains(text),
            "{place}"
        );
        let name = text.split_once(": ").unwrap().0;
        let row = bad.split("<tr").find(|row| row.contains(&format!("\"row\">{name}<small>")));
        let row = row.unwrap();
        let numbers = row.split_once("violated (").unwrap().1.split_once(')').unwrap().0;
        assert!(numbers.split(", ").any(|own| own == (number + 1).to_string()), "{row}");
        assert!(row.contains("<td>line "), "{line}: {row}");
    }
    assert!(bad.contains("1: line 3") && bad.contains("<code>Y200</code>"));
    let drawings = bad.matches("<svg role=\"img\"").count();
    // Each has its name and its description for accessibility.
    assert_eq!(bad.matches("</title><desc>").count(), drawings);
    assert_eq!(drawings, 4);
}
