// SPDX-License-Identifier: GPL-2.0-or-later
//! Commands of docs/studies/papers.md, with the outputs that the page shows.

use crate::commands::Bench;
use std::collections::BTreeMap;
use std::fs;
use test_support::shipped::{folder, ini};

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

/// A row of the page that names a command.
struct Row {
    paper: String,
    place: String,
    printed: String,
    /// Words of the command, without `pkm`.
    words: String,
    /// Texts that its output contains.
    outputs: Vec<String>,
    difference: String,
}

/// Returns the rows of the page's tables that name a command.
fn rows() -> Vec<Row> {
    let page = fs::read_to_string(folder("../docs/studies/papers.md")).unwrap();
    let (mut paper, mut rows) = (String::new(), vec![]);
    for line in page.lines() {
        if let Some(title) = line.strip_prefix("## ") {
            paper = title.into();
        }
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let ["", place, printed, command, output, difference, ""] = cells[..] else { continue };
        let Some(words) = code(command).find_map(|words| words.strip_prefix("pkm ")) else {
            continue;
        };
        let outputs: Vec<String> = code(output).map(String::from).collect();
        assert!(!outputs.is_empty(), "no output: {line}");
        assert!(![place, printed, difference].contains(&""), "an empty cell: {line}");
        let [place, printed, difference] = [place, printed, difference].map(String::from);
        rows.push(Row {
            paper: paper.clone(),
            place,
            printed,
            words: words.into(),
            outputs,
            difference,
        });
    }
    rows
}

/// Runs every row; `cargo xtask papers` shows what it prints.
#[test]
fn every_command_of_the_page_answers_as_the_page_shows() {
    let rows = rows();
    assert!(rows.len() >= 17, "{} commands: the rows are not found", rows.len());
    let mut answers = BTreeMap::new();
    let mut wrong = vec![];
    for Row { paper, place, printed, words, outputs, difference } in &rows {
        let found = answers
            .entry(words)
            .or_insert_with(|| answer(words).split_whitespace().collect::<Vec<_>>().join(" "));
        println!("{paper}, {place}\n  printed     {printed}");
        for output in outputs {
            let is_there = found.contains(output);
            println!("  ours        {output}{}", if is_there { "" } else { ": NOT in the output" });
            if !is_there {
                wrong.push(format!("pkm {words}: {output}: {found}"));
            }
        }
        println!("  difference  {difference}");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Ratios of columns in the rows of paper 001's table, which all rows share: X over Y, then Z, A, B, C over X. The paper
/// converts angles with 100 mm.
const RATIOS: [f64; 5] = [1.7948, -6.581, -1.300, -0.7575, -0.5163];

#[test]
fn ratios_of_paper_001_come_out_at_its_time() {
    let rows = rows();
    let words = &rows.iter().find(|row| row.words.contains("--ratios 2.8")).unwrap().words;
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

/// Returns a section of an INI file, with its header.
fn section<'a>(text: &'a str, name: &str) -> &'a str {
    let from = text.find(&format!("\n[{name}]\n")).expect("the section") + 1;
    let end = text[from..].find("\n[").map_or(text.len(), |end| from + end + 1);
    &text[from..end]
}

/// The page names this machine: no shipped configuration has both.
#[test]
fn the_first_layout_of_paper_003_is_two_turrets_with_the_counter_spindle() {
    let text = |name: &str| fs::read_to_string(ini(name)).expect("a configuration");
    let (turrets, other) = (text("lathe-two-turrets"), text("lathe-counter-spindle"));
    let joint = section(&other, "JOINT_5").replace("[JOINT_5]", "[JOINT_6]");
    let mut both = turrets.clone();
    for (from, to) in [
        ("coordinates=XYZB axes=CA ", "coordinates=XYZB axes=CAW "),
        ("JOINTS = 6\n", "JOINTS = 7\n"),
        ("COORDINATES = XYZABC\n", "COORDINATES = XYZABCW\n"),
        ("HOME = 0 450 1000 0 0 0\n", "HOME = 0 450 1000 0 0 0 0 0 800\n"),
        ("[AXIS_X]\n", &format!("{joint}[AXIS_X]\n")),
    ] {
        assert!(both.contains(from), "{from}");
        both = both.replacen(from, to, 1);
    }
    both += &format!("\n{}", section(&other, "AXIS_W"));
    // The turrets turn, and the counter-spindle comes and goes.
    let program = "G21 G90 G94 M52 P1\nG0 A-90 W400\nG0 W800 A0\nM2\n";
    let table =
        fs::read_to_string(ini("lathe-two-turrets").with_extension("tbl")).expect("a table");
    let bench = Bench::new().with("both.ini", &both).with("part.ngc", program);
    let bench = bench.with("lathe-two-turrets.tbl", &table);
    let answer = bench.answer("preflight both.ini part.ngc", "");
    assert!(answer.ends_with("The program fits the machine.\nexit 0\n"), "{answer}");
    for words in ["axis A             -90.000 to 0.000", "axis W             400.000 to 800.000"] {
        assert!(answer.contains(words), "{answer}");
    }
}
