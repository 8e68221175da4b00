// SPDX-License-Identifier: GPL-2.0-or-later
//! Figures printed in the papers that commands reproduce according to docs/studies/sources.md.

use crate::commands::Bench;
use std::fs;
use test_support::shipped::folder;

fn answer(words: &str, input: &str) -> String {
    let root = folder("..").display().to_string();
    let words = words.replace("configs/", &format!("{root}/configs/"));
    let answer = Bench::new().answer(&words.replace("docs/", &format!("{root}/docs/")), input);
    assert!(answer.ends_with("exit 0\n"), "{answer}");
    answer
}

/// Checks that the page has a command.
fn of_page(words: &'static str) -> &'static str {
    let page = fs::read_to_string(folder("../docs/studies/sources.md")).unwrap();
    assert!(page.contains(&format!("`pkm {words}`")), "{words}");
    words
}

#[test]
fn ratios_of_paper_001_come_out_at_its_time() {
    let words = of_page(
        "sensitivity configs/lab-hexapod/lab-hexapod.ini --study docs/studies/examples/paper-001.toml --law --ratios 2.8",
    );
    let found = answer(&format!("{words} --draws 10 --rays 10"), "");
    assert!(found.contains("ratios of rates at 2.8 s"), "{found}");
    let rows: Vec<Vec<f64>> = found
        .lines()
        .rev()
        .filter(|line| line.starts_with("  strut"))
        .take(6)
        .map(|line| line.split_whitespace().skip(2).map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 6);
    for row in rows {
        // Four decimals of values from 0.07 up.
        assert!((row[0] / row[1] - 1.7948).abs() < 2e-3, "{row:?}");
        assert!((row[2] / row[0] + 6.581).abs() < 6e-3, "{row:?}");
    }
}

#[test]
fn struts_of_the_lab_hexapod_have_the_slopes_of_paper_001() {
    let words = of_page("rods configs/lab-hexapod/lab-hexapod.ini");
    let found = answer(words, "x,y,z,a,b,c\n0,0,640,0,0,0\n");
    let [head, row] = [0, 1].map(|k| found.lines().nth(k).unwrap().split(',').collect::<Vec<_>>());
    for (leg, slope) in [65.0, 65.0, 67.0, 67.0, 67.0, 67.0].into_iter().enumerate() {
        let place = head.iter().position(|name| *name == format!("elevation_{leg}")).unwrap();
        let found: f64 = row[place].parse().unwrap();
        // Printed in whole degrees.
        assert!((found - slope).abs() < 0.5, "{found}");
    }
}

#[test]
fn figures_of_papers_002_and_004_stand_in_what_the_commands_say() {
    for (words, reported) in [
        ("stability lag --study docs/studies/examples/paper-002.toml", "4884.700 N/mm"),
        (
            "cut configs/hexapod/hexapod.ini configs/hexapod/programs/five-axis-surface.ngc \
             --study configs/hexapod/cut.toml",
            "chip load     0.0400 mm",
        ),
    ] {
        let found = answer(of_page(words), "");
        assert!(found.contains(reported), "{found}");
    }
}

#[test]
fn paths_of_papers_000_and_003_are_written_and_drawn() {
    for words in [
        "path configs/four-rod-lathe/four-rod-lathe.ini configs/four-rod-lathe/paths/stepped-shaft.toml \
         --csv job.csv --plots plots",
        "path configs/pyramid/pyramid.ini configs/pyramid/paths/two-pencils.toml --plots plots",
        "path configs/pyramid/pyramid.ini configs/pyramid/paths/cycloid.toml --csv cycloid.csv",
    ] {
        answer(&format!("{} -o out.ngc", of_page(words)), "");
    }
}
