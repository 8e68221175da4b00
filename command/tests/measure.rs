// SPDX-License-Identifier: GPL-2.0-or-later
//! Calibration by manually entered readings, on machines with known true geometry.

use crate::shop::{Shop, dial};
use calibrate::fit::fit;
use calibrate::model::Tolerance;
use calibrate::study::{self, Given, Wishes};
use statrs::distribution::{Binomial, DiscreteCDF};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use test_support::shipped::{self, cases};

/// Simulates random machines: returns root mean squares of the tip's error before, after and as stated, the number
/// of machines below the bound of 95 %, and the number with an unlikely chi-square.
fn monte_carlo(shop: &mut Shop, runs: usize) -> ([f64; 3], usize, usize) {
    let mut squares = [0.0; 3];
    let (mut held, mut odd) = (0, 0);
    for run in 0..runs {
        shop.build(100 + run as u64);
        let table = shop.table(1, 2.0);
        let Given { model, readings, noise, .. } = shop.given(&table);
        let found = fit(&model, &readings, noise).unwrap();
        let calibrated = model.machine(&found.changes).unwrap();
        let (before, after) = (shop.error(&shop.config.machine), shop.error(&calibrated));
        let [_, stated] = study::shape(&shop.config, &model, &readings, &found).unwrap();
        for (sum, value) in squares.iter_mut().zip([before, after, stated.expected]) {
            *sum += value * value / runs as f64;
        }
        held += usize::from(after <= stated.below);
        odd += usize::from(!found.outliers.is_empty());
    }
    (squares.map(f64::sqrt), held, odd)
}

#[test]
fn thirty_dial_readings_make_the_tip_as_sure_as_they_say() {
    // For each: machine, gauge, tolerance in machine units, and the remaining share of the tip's error.
    let shops = [
        ("lab-hexapod", dial([0.0, 0.0, 580.0], 120.0, false, "mm"), 0.1, 0.4),
        ("linear-delta", dial([0.0, 0.0, 10.0], 100.0, false, "mm"), 0.1, 0.4),
        ("linear-delta", dial([0.0, 0.0, 10.0], 60.0, true, "mm"), 0.1, 0.7),
        ("rotary-delta", dial([0.0, 0.0, -15.0], 4.0, false, "inch"), 0.004, 0.7),
    ];
    for (machine, gauge, tolerance, share) in shops {
        let mut shop = Shop::new(machine, &gauge, tolerance);
        let runs = cases(25);
        let ([before, after, stated], held, odd) = monte_carlo(&mut shop, runs);
        println!(
            "{machine}: tip rms {before:.5} before, {after:.5} after, {stated:.5} stated; {held} of {runs} below the \
             bound of 95 %, {odd} with a reading left out"
        );
        assert_eq!(shop.proposal.stops.len(), 30);
        assert!(after < share * before, "{machine}: {before} {after}");
        // Exceeded once in a thousand times.
        let law = Binomial::new(0.95, runs as u64).unwrap();
        assert!(held as u64 >= law.inverse_cdf(1e-3), "{machine}: {held} of {runs}");
        // A reading is left out once in a thousand tables.
        assert!(odd <= 1 + runs / 100, "{machine}: {odd}");
    }
}

/// Returns the output of the command in a folder, with its exit code.
fn answer(folder: &Path, arguments: &[&str]) -> (String, i32) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    command.args(arguments).current_dir(folder).env("NO_COLOR", "1");
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout) + &text(&output.stderr), output.status.code().unwrap())
}

const LAB: &str = "lab-hexapod";

pub(crate) fn lab() -> Shop {
    Shop::new(LAB, &dial([0.0, 0.0, 580.0], 120.0, false, "mm"), 0.1)
}

/// Returns the output for a table with a request for a new file.
fn calibrated(folder: &Path, table: &str, more: &[&str]) -> (String, i32) {
    fs::write(folder.join("dial.csv"), table).unwrap();
    let _ = fs::remove_file(folder.join("new.ini"));
    let machine = shipped::ini(LAB);
    let base = ["calibrate", machine.to_str().unwrap(), "dial.csv", "--write", "new.ini"];
    answer(folder, &[&base, more].concat())
}

/// Returns a table with one cell of a line (from 1) changed.
fn with_cell(table: &str, line: usize, column: usize, new: impl Fn(&str) -> String) -> String {
    let change = |(n, text): (usize, &str)| {
        if n != line {
            return text.to_string();
        }
        let mut cells: Vec<String> = text.split(',').map(Into::into).collect();
        cells[column] = new(&cells[column]);
        cells.join(",")
    };
    (1..).zip(table.lines()).map(change).collect::<Vec<_>>().join("\n")
}

/// Multiplies all readings by a factor.
fn scaled(table: &str, factor: f64) -> String {
    let first = first_row(table);
    (first..first + 30).fold(table.to_string(), |table, line| {
        with_cell(&table, line, 9, |word| format!("{:.4}", word.parse::<f64>().unwrap() * factor))
    })
}

/// Returns the line of the first pose.
fn first_row(table: &str) -> usize {
    table.lines().position(|line| line.starts_with("1,")).unwrap() + 1
}

fn cell(table: &str, line: usize, column: usize) -> String {
    table.lines().nth(line - 1).unwrap().split(',').nth(column).unwrap().into()
}

#[test]
fn two_runs_become_a_file_and_say_how_they_scatter() {
    let folder = tempfile::tempdir().unwrap();
    let mut shop = lab();
    let table = shop.table(2, 2.0);
    let plots = ["--tolerance", "0.1", "--plots", "plots"];
    let (text, code) = calibrated(folder.path(), &table, &plots);
    assert_eq!(code, 0, "{text}");
    // Filled and outlined: seven values of six legs.
    let picture = fs::read_to_string(folder.path().join("plots/changes.svg")).unwrap();
    assert!(picture.matches("<rect").count() >= 2 * 42, "{picture}");
    for part in [
        "60 readings",
        "30 poses twice: deviation ",
        "agreement      chi-square",
        "tip's motion   rms 0.0",
        "not covered    the scale of the drives",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let new = test_support::shipped::first_of(&folder.path().join("new.ini"));
    let (before, after) = (shop.error(&shop.config.machine), shop.error(&new.machine));
    assert!(after < 0.5 * before, "{before} {after}");
    // A gauge with four times its stated scatter.
    let (text, code) = calibrated(folder.path(), &shop.table(2, 8.0), &["--tolerance", "0.1"]);
    assert_eq!(code, 1, "{text}");
    assert!(
        text.contains("more than the stated deviation of 2 um: using the larger one"),
        "{text}"
    );
    let warm = (first_row(&table)..first_row(&table) + 30).fold(table.clone(), |table, line| {
        with_cell(&table, line, 10, |word| format!("{}", word.parse::<f64>().unwrap() + 9.0))
    });
    let (text, code) = calibrated(folder.path(), &warm, &["--tolerance", "0.1"]);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("the second run differs by +"), "{text}");
    // The first column copied into the second.
    let copied = (first_row(&table)..first_row(&table) + 30)
        .fold(table.clone(), |typed, line| with_cell(&typed, line, 10, |_| cell(&table, line, 9)));
    let (text, code) = calibrated(folder.path(), &copied, &["--tolerance", "0.1"]);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("both runs have the same reading in every row"), "{text}");
    // A mistake in one of two runs is refused, whatever the scatter that it adds.
    let row = first_row(&table) + 6;
    let in_mm =
        with_cell(&table, row, 10, |word| format!("{:.4}", word.parse::<f64>().unwrap() / 1e3));
    let (text, code) = calibrated(folder.path(), &in_mm, &["--tolerance", "0.1"]);
    assert_eq!(code, 2, "{text}");
    let place = format!("dial.csv:{row}: ");
    assert!(text.contains(&place) && text.contains("of pose 7 in column again does not"), "{text}");
    assert!(!folder.path().join("new.ini").exists());
    // One run, of a gauge that is less accurate than stated: chi-square shows it.
    let (text, code) = calibrated(folder.path(), &shop.table(1, 60.0), &["--tolerance", "0.01"]);
    assert!(code != 0 && (text.contains("fit worse") || text.contains("contradict")), "{text}");
    // The table's expected values as readings: no gauge is that accurate.
    let table = shop.table(1, 2.0);
    let expected = (first_row(&table)..first_row(&table) + 30)
        .fold(table.clone(), |typed, line| with_cell(&typed, line, 9, |_| cell(&table, line, 8)));
    let (text, code) = calibrated(folder.path(), &expected, &["--tolerance", "0.1"]);
    assert_eq!(code, 1, "{text}");
    assert!(
        text.contains("closer to the expected ones than the stated deviation of 2 um allows"),
        "{text}"
    );
}

#[test]
fn readings_count_once_and_are_never_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let table = lab().table(1, 2.0);
    for name in ["dial.csv", "copy.csv"] {
        fs::write(folder.path().join(name), &table).unwrap();
    }
    let machine = shipped::ini(LAB);
    let calibrate = |more: &[&str]| {
        let base = ["calibrate", machine.to_str().unwrap(), "dial.csv", "--tolerance", "0.1"];
        answer(folder.path(), &[&base, more].concat())
    };
    let (reported, code) = calibrate(&["copy.csv"]);
    assert!(
        reported.contains("copy.csv: the same readings as dial.csv") && code == 2,
        "{reported}"
    );
    let (reported, code) = calibrate(&["--accept", "--write", "dial.csv"]);
    assert!(reported.contains("was read as input") && code == 2, "{reported}");
    assert_eq!(fs::read_to_string(folder.path().join("dial.csv")).unwrap(), table);
}

#[test]
fn large_changes_are_not_written_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let table = lab().table(1, 2.0);
    let small = ["--tolerance", "0.1", "--threshold", "0.01"];
    let (text, code) = calibrated(folder.path(), &table, &small);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("more than 0.01 mm (--threshold)"), "{text}");
    assert!(text.contains("new.ini is not written; add --accept to write it anyway"), "{text}");
    assert!(!folder.path().join("new.ini").exists());
    let (text, code) = calibrated(folder.path(), &table, &[&small[..], &["--accept"]].concat());
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("written: new.ini") && folder.path().join("new.ini").exists(), "{text}");
    let (text, code) = calibrated(folder.path(), &table, &["--threshold", "nan"]);
    assert_eq!((text.as_str(), code), ("pkm: --threshold NaN: expected more than 0\n", 2));
}

#[test]
fn typos_are_reported_with_their_line_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let table = lab().table(1, 2.0);
    let first = first_row(&table);
    let lines: Vec<&str> = table.lines().collect();
    let number = |line: usize| cell(&table, line, 9).parse::<f64>().unwrap();
    let typed = |line: usize, word: &str| with_cell(&table, line, 9, |_| word.into());
    let exchanged = |a: usize, b: usize, column: usize| {
        let (x, y) = (cell(&table, a, column), cell(&table, b, column));
        with_cell(&with_cell(&table, a, column, |_| y.clone()), b, column, |_| x.clone())
    };
    let row = |n: usize| first + n - 1;
    // The most different readings, so that exchanging them is detectable.
    let by_size = {
        let mut rows: Vec<usize> = (first..first + 30).collect();
        rows.sort_by(|a, b| number(*a).total_cmp(&number(*b)));
        rows
    };
    let (least, most) = (by_size[0].min(by_size[29]), by_size[0].max(by_size[29]));
    let without = |line: usize| [&lines[..line - 1], &lines[line..]].concat().join("\n");
    let twice = [&lines[..row(5)], &lines[row(5) - 1..]].concat().join("\n");
    let swapped = {
        let mut lines = lines.clone();
        lines.swap(row(5) - 1, row(6) - 1);
        lines.join("\n")
    };
    let at = |line: usize, text: &str| format!("dial.csv:{line}: {text}");
    let cases: Vec<(String, String)> = vec![
        (scaled(&table, 1e-3), "if they are in mm, convert them to um".into()),
        (scaled(&table, 1.0 / 25.4), "if they are in thou, convert".into()),
        (
            scaled(&table, 1e3),
            " um is outside the range of the gauge, 0 to 2000 um: measure it again".into(),
        ),
        (
            typed(row(7), "512000"),
            at(row(7), "512000 um is outside the range of the gauge, 0 to 2000 um"),
        ),
        (typed(row(7), &format!("{:.4}", number(row(7)) / 1e3)), at(row(7), "")),
        (typed(row(9), &format!("{:.4}", number(row(9)) / 25.4)), at(row(9), "")),
        (
            exchanged(least, most, 9),
            format!("the readings of lines {least} and {most} would fit if exchanged"),
        ),
        (typed(row(3), "nan"), at(row(3), "\"nan\" is not a number")),
        (typed(row(3), "inf"), at(row(3), "\"inf\" is not a number")),
        (typed(row(3), "about 500"), at(row(3), "\"about 500\" is not a number")),
        (
            typed(row(3), "49,5,"),
            at(row(3), "13 cells, more than there are columns: a decimal comma?"),
        ),
        (typed(row(4), ""), at(row(4), "reading of pose 4 is empty: enter it")),
        (without(row(8)), at(row(8), "pose 8 is missing, 9 follows pose 7")),
        (without(row(30)), at(row(29), "the table ends with pose 29 of 30: rows are missing")),
        (twice, at(row(6), "pose 5 appears twice")),
        (swapped, at(row(5), "pose 5 is missing, 6 follows pose 4")),
        (
            with_cell(&table, row(2), 0, |_| "31".into()),
            at(row(2), "pose \"31\": the program has poses 1 to 30"),
        ),
        (
            with_cell(&table, row(2), 2, |_| "1.5".into()),
            at(row(2), "pose 2 is not that of the program"),
        ),
        (exchanged(row(2), row(3), 4), at(row(2), "pose 2 is not that of the program")),
        (
            with_cell(&table, row(2), 1, |_| "edge".into()),
            at(row(2), "object \"edge\": expected plate"),
        ),
        (
            with_cell(&table, row(2), 10, |_| "500".into()),
            at(
                row(2),
                &format!("the second run has a reading in one of lines {} and {}", row(1), row(2)),
            ),
        ),
        (
            table.replace("# unit um", "# unit cm"),
            "dial.csv:5: unit cm: expected um, mm, thou or inch".into(),
        ),
        (table.replace("# unit um", "# unit mm"), at(row(1), "pose 1 is not that of the program")),
        (table.replace("# unit um\n", ""), "expected a line \"# unit um\"".into()),
        (table.replace("# deviation 2\n", ""), "expected a line \"# deviation NUMBER\"".into()),
        (table.replace("# deviation 2\n", "# deviation -2\n"), "deviation -2: expected".into()),
        (
            table.replace("# gauge dial", "# gauge clock"),
            "gauge clock: expected dial, bar or feeler".into(),
        ),
        (
            table.replace("# range 0 2000", "# range 9 1"),
            "range 9 1: expected the smallest reading".into(),
        ),
        (
            table.replace("# geometry 0x", "# geometry 0x1"),
            "expected a line \"# geometry HASH\"".into(),
        ),
        (
            table.replace("# object plate", "# object plate x"),
            "expected \"# object NAME X Y Z A B C\"".into(),
        ),
        (table.replace("# tool 0 0 60", "# tool 0 0 61"), at(row(1), "pose 1 is not that of")),
        (table.replace("# radius 0", "# radius 0.5"), at(row(1), "pose 1 is not that of")),
        (table.replace("# gauge dial", "# gauge feeler"), at(row(1), "pose 1 is not that of")),
        (table.replace("pose,object,x", "pose;object;x"), "no column \"pose\"".into()),
        (table.replace(",reading,", ",value,"), "no column \"reading\"".into()),
    ];
    for (text, expected) in cases {
        let (reported, code) = calibrated(folder.path(), &text, &["--tolerance", "0.1"]);
        assert_eq!(code, 2, "{expected}: {reported}");
        assert!(reported.contains(&expected), "{expected}: {reported}");
        assert!(!folder.path().join("new.ini").exists(), "{expected}");
    }
    // For any deviation of the machine: the other readings show it.
    let in_mm = typed(row(7), &format!("{:.4}", number(row(7)) / 1e3));
    let (reported, code) = calibrated(folder.path(), &in_mm, &["--tolerance", "100"]);
    assert_eq!(code, 2, "{reported}");
    assert!(reported.contains(&at(row(7), "")) && reported.contains(" mm would fit"), "{reported}");
    // A spreadsheet's changes to a table are no mistake, nor is a missing reading.
    let quoted: Vec<String> =
        lines
            .iter()
            .map(|line| {
                if line.starts_with('#') {
                    format!("\"{line}\",,,,,,,,,,")
                } else {
                    line.to_string()
                }
            })
            .collect();
    let (reported, code) = calibrated(folder.path(), &quoted.join("\r\n"), &["--tolerance", "0.1"]);
    assert_eq!(code, 0, "{reported}");
    let (reported, code) = calibrated(folder.path(), &typed(row(12), "-"), &["--tolerance", "0.1"]);
    assert_eq!(code, 0, "{reported}");
    assert!(reported.contains("29 readings"), "{reported}");
}

#[test]
fn bars_and_feelers_calibrate_beside_a_dial() {
    let bar = "unit = \"mm\"\ngauge = \"bar\"\nreading = \"mm\"\ndeviation = 0.002\nrange = [149, 151]\nzero = 0.01\n\
               tool = [0, 0, 60]\nclearance = 5\nfeed = 300\n[[object]]\nname = \"socket\"\nplace = [0, 0, 450]\n\
               cone = 30\n";
    let feeler = dial([0.0, 0.0, 580.0], 100.0, false, "mm")
        .replace("\"dial\"", "\"feeler\"")
        .replace("[0, 2000]", "[20, 1000]")
        .replace("deviation = 2.0", "deviation = 10.0\nradius = 3");
    let mut files: Vec<PathBuf> = vec![];
    let folder = tempfile::tempdir().unwrap();
    let mut last = None;
    for (name, gauge) in [
        ("dial", dial([0.0, 0.0, 580.0], 120.0, false, "mm")),
        ("bar", bar.into()),
        ("feeler", feeler),
    ] {
        let mut shop = Shop::new(LAB, &gauge, 0.1);
        shop.build(5);
        let file = folder.path().join(format!("{name}.csv"));
        let deviation = shop.setup.gauge.deviation;
        fs::write(&file, shop.table(1, deviation)).unwrap();
        files.push(file);
        last = Some(shop);
    }
    let shop = last.unwrap();
    let left = |files: &[PathBuf]| {
        let tolerance = Tolerance::of_lengths(0.1);
        let wishes = Wishes { tolerance, noise: None, plate: None };
        let given = study::read(&shop.config, files, &wishes).unwrap();
        study::look_for_mistakes(&shop.config, &given, files).unwrap();
        let found = fit(&given.model, &given.readings, given.noise).unwrap();
        assert!(found.outliers.is_empty(), "{files:?} {:?}", found.outliers);
        let [_, stated] =
            study::shape(&shop.config, &given.model, &given.readings, &found).unwrap();
        let after = shop.error(&given.model.machine(&found.changes).unwrap());
        println!("{files:?}: {after:.5}, stated {stated:?}");
        // Three times the expected value: the largest of a few.
        assert!(after < 3.0 * stated.expected, "{after} {stated:?}");
        stated.expected
    };
    let alone = left(&files[..1]);
    assert!(left(&files[1..2]) > 0.0 && left(&files[2..]) > 0.0);
    let together = left(&files);
    assert!(together < 0.8 * alone, "{alone} {together}");
}

#[test]
fn a_proposal_is_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let good = dial([0.0, 0.0, 580.0], 120.0, false, "mm");
    let machine = shipped::ini(LAB);
    let measure = |gauge: &str| {
        fs::write(path("gauge.toml"), gauge).unwrap();
        answer(folder.path(), &["measure", machine.to_str().unwrap(), "gauge.toml", "-o", "dial"])
    };
    for (from, to, expected) in [
        ("deviation = 2.0", "deviation = 0", "gauge.toml: deviation = 0: expected more than 0"),
        ("range = [0, 2000]", "range = [5, 1]", "range = [5, 1]: expected the smallest reading"),
        (
            "range = [0, 2000]",
            "range = [0, 9]\nexpected = 20",
            "expected = 20: expected more than 0",
        ),
        (
            "size = [120, 120]",
            "size = [120, 120]\nangles = [180, 0, 0]",
            "object plate: its face points away from the platform",
        ),
        ("size = [120, 120]", "", "object 1 (plate): size = [X, Y]"),
        ("\"dial\"", "\"clock\"", "unknown variant `clock`"),
        (
            "place = [0, 0, 580]",
            "place = [0, 0, 5800]",
            "object plate: no pose is within the machine's limits; without a tilt, axis Z is at",
        ),
        ("tool = [0, 0, 60]", "tool = [0, 0, 1e6]", "axis Z is at"),
        ("tool = [0, 0, 60]", "tool = [0, 0, 1e300]", "check unit, place and tool"),
        (
            "tool = [0, 0, 60]",
            "tool = [0, 0, -60]",
            "tool: expected the other sign of Z: with [PKM]TOOL_DIRECTION = down the tip is below",
        ),
        (
            "size = [120, 120]",
            "size = [120, 120]\n[[object]]\nname = \"far\"\nplace = [900, 0, 580]\nsize = [50, 50]",
            "object far: no pose is within the machine's limits",
        ),
        ("tool =", "count = 0\ntool =", "count = 0: expected 1 to 500"),
        ("name = \"plate\"", "name = \"a plate\"", "name: expected letters"),
    ] {
        assert!(good.contains(from), "{from}");
        let (reported, code) = measure(&good.replace(from, to));
        assert_eq!(code, 2, "{reported}");
        assert!(reported.contains(expected), "{expected}: {reported}");
        assert!(!path("dial.ngc").exists() && !path("dial.csv").exists());
    }
    let (reported, code) = measure(&good);
    assert_eq!(code, 0, "{reported}");
    let table = fs::read_to_string(path("dial.csv")).unwrap();
    let program = fs::read_to_string(path("dial.ngc")).unwrap();
    assert_eq!(program.matches("\nM0\n").count(), 30);
    assert!(program.contains("(MSG,pose 30 of 30 at plate: enter the reading of the dial in um)"));
    let (reported, code) = measure(&good);
    assert_eq!(code, 2, "{reported}");
    assert!(reported.contains("dial.ngc: exists already and may contain readings"), "{reported}");
    assert_eq!(table, fs::read_to_string(path("dial.csv")).unwrap());
    // No reading is entered yet.
    let (reported, code) =
        answer(folder.path(), &["calibrate", machine.to_str().unwrap(), "dial.csv"]);
    assert_eq!(code, 2, "{reported}");
    assert!(reported.contains("reading of pose 1 is empty"), "{reported}");
}
