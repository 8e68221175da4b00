// SPDX-License-Identifier: GPL-2.0-or-later
//! Commands of docs/studies/papers.md, with the outputs that the page shows.

use crate::commands::Bench;
use std::collections::BTreeMap;
use std::fs;
use test_support::shipped::folder;

/// Returns the output of a command in the root of the source tree, whose files it writes into a folder of its own.
fn answer(words: &str) -> String {
    let root = folder("..").display().to_string();
    let words = words.replace("configs/", &format!("{root}/configs/"));
    let answer = Bench::new().answer(&words.replace("docs/", &format!("{root}/docs/")), "");
    assert!(answer.ends_with("exit 0\n"), "pkm {words}: {answer}");
    answer
}

/// Returns the texts in code style of a cell.
fn code(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}

/// Returns the commands of the page's tables, each with the texts that its output contains.
fn commands() -> BTreeMap<String, Vec<String>> {
    let page = fs::read_to_string(folder("../docs/studies/papers.md")).unwrap();
    let mut all = BTreeMap::<String, Vec<String>>::new();
    for line in page.lines().filter(|line| line.starts_with("| ")) {
        let cells: Vec<&str> = line.split('|').collect();
        let [_, _, _, command, output, _, _] = cells[..] else { continue };
        let Some(words) = code(command).find_map(|words| words.strip_prefix("pkm ")) else {
            continue;
        };
        let outputs = all.entry(words.into()).or_default();
        let before = outputs.len();
        outputs.extend(code(output).map(String::from));
        assert!(outputs.len() > before, "no output: {line}");
    }
    all
}

#[test]
fn every_command_of_the_page_answers_as_the_page_shows() {
    let commands = commands();
    assert!(commands.len() >= 17, "{} commands: the rows are not found", commands.len());
    for (words, outputs) in commands {
        let found = answer(&words).split_whitespace().collect::<Vec<_>>().join(" ");
        for output in outputs {
            assert!(found.contains(&output), "pkm {words}: {output}: {found}");
        }
    }
}

/// Ratios of columns in the rows of paper 001's table, which all rows share: X over Y, then Z, A, B, C over X. The paper
/// converts angles with 100 mm.
const RATIOS: [f64; 5] = [1.7948, -6.581, -1.300, -0.7575, -0.5163];

#[test]
fn ratios_of_paper_001_come_out_at_its_time() {
    let commands = commands();
    let words = commands.keys().find(|words| words.contains("--ratios 2.8")).unwrap();
    let found = answer(&format!("{words} --draws 10 --rays 10"));
    assert!(found.contains("ratios of rates at 2.8 s"), "{found}");
    assert!(found.contains("in joint units per mm for X Y Z, per degree for A B C"), "{found}");
    let rows: Vec<Vec<f64>> = found
        .lines()
        .rev()
        .filter(|line| line.starts_with("  strut"))
        .take(6)
        .map(|line| line.split_whitespace().skip(2).map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 6);
    for row in rows {
        let angle = 100.0 * std::f64::consts::PI / 180.0;
        let [x, y, z, a, b, c] = row[..] else { panic!("{row:?}") };
        let ratios = [x / y, z / x, a / angle / x, b / angle / x, c / angle / x];
        for (ratio, printed) in ratios.into_iter().zip(RATIOS) {
            // Three to four digits are printed, and the amplitudes have three: 1e-3. Four decimals of values from 0.21
            // up add 3e-4.
            assert!((ratio / printed - 1.0).abs() < 1.5e-3, "{row:?}: {ratio} {printed}");
        }
    }
}
