// SPDX-License-Identifier: GPL-2.0-or-later
//! Common behavior of every subcommand: sources of input and formats of output.

use crate::commands::Bench;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use test_support::shipped;

/// A file of rows, and the output without its exit code.
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
    for (words, reported) in [
        ("joints linear-delta.ini --rows none.csv", "none.csv: No such file or directory"),
        (
            "joints linear-delta.ini --rows short.csv",
            "short.csv:2: 2 cells; expected 6, as in the header",
        ),
        ("joints linear-delta.ini --rows rows.csv --pose 0 0 50 0 0 0", "--pose and --rows"),
        ("pose linear-delta.ini --rows rows.csv --joints 1 2 3", "cannot be used with"),
        ("pose linear-delta.ini --joints 1 2", "--joints: found 2 numbers; expected joint_0"),
    ] {
        let answer = joints.answer(words, "");
        assert!(answer.contains(reported) && answer.ends_with("exit 2\n"), "{answer}");
    }
}

#[test]
fn lines_that_are_left_out_are_reported() {
    let bench =
        Bench::new().with("p.ngc", &PROGRAM.replace("M2", "/G1 X5\nM2")).with("q.ngc", PROGRAM);
    let report = "p.ngc: lines that begin with / are skipped";
    assert!(bench.answer("replay linear-delta.ini p.ngc", "").contains(report));
    assert!(!bench.answer("replay linear-delta.ini q.ngc", "").contains(report));
}

#[test]
fn a_pose_is_six_numbers_or_words() {
    let bench = Bench::new();
    let numbers = bench.answer("joints linear-delta.ini --pose 10 -20 90 0 0 0", "");
    assert!(numbers.ends_with("exit 0\n"), "{numbers}");
    // The missing Z90 is the value at home.
    assert_eq!(bench.answer("joints linear-delta.ini --pose x10 Y-20", ""), numbers);
    assert_eq!(
        bench.answer("travel linear-delta.ini --pose 10 -20 90 0 0 0", ""),
        bench.answer("travel linear-delta.ini --pose X10 Y-20", "")
    );
    // As LinuxCNC reads them.
    let plain =
        bench.answer("joints linear-delta.ini --pose -0.2 -0.001 90 0 0 0 --tool -0.5 0 -1", "");
    assert!(plain.ends_with("exit 0\n"), "{plain}");
    assert_eq!(
        bench.answer("joints linear-delta.ini --pose -.2 -1e-3 90. .0 -.0 0 --tool -.5 0 -1.", ""),
        plain
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
        // The same rows, and the same time; only the name of the file differs.
        let tail =
            |text: &str| text.rsplit_once(": ").map_or(text.into(), |(_, tail)| tail.to_string());
        assert_eq!(tail(&piped), tail(&named));
    }
    let wrong = bench.answer("preflight linear-delta.ini -", "G1 G2 X3\nM2\n");
    assert!(wrong.contains("standard-input.ngc") && wrong.ends_with("exit 2\n"), "{wrong}");
    assert_eq!(bench.files(), before);
}

/// Returns the subcommands in a help text; pkm's own has them in groups.
pub fn subcommands(help: &str) -> Vec<String> {
    let list = match (help.split_once("\nMachine:\n"), help.split_once("Commands:\n")) {
        (Some((_, list)), _) => list.split("Options:\n").next(),
        (None, Some((_, list))) => list.split("\n\n").next(),
        (None, None) => None,
    };
    let name = |line: &str| line.strip_prefix("  ")?.split(' ').next().map(String::from);
    let names = list.unwrap_or_default().lines().filter_map(name);
    names.filter(|name| !name.is_empty() && name != "help").collect()
}

/// Examples that take too long for a test or need a browser; kinds of machines, which `new` makes, and older ones.
const SLOW: [&str; 7] = [
    "pkm boxes",
    "stability map",
    "--tilt 15",
    "-80 60 350 10 -20 0 --plots",
    "--video",
    "pkm new",
    "pkm migrate",
];

/// Makes the files that the examples name, in a copy of the hexapod. TOML files are those that the help shows.
fn example_files(bench: &Bench) -> tempfile::TempDir {
    const PROGRAM: &str = "G21 G90\nM52 P1\nS6000 M3\nF600 G1 X10 Y-5\nA5\nX0 Y0 A0\nM2\n";
    let shown = |words: &str| -> String {
        let help = bench.answer(&format!("{words} --help"), "");
        let lines = help.lines().filter_map(|line| line.strip_prefix("    "));
        lines.filter(|line| !line.starts_with(' ')).map(|line| format!("{line}\n")).collect()
    };
    let folder = shipped::copied("hexapod");
    let place = folder.path();
    for (from, to) in [
        ("hexapod/calibration/dial.toml", "dial.toml"),
        ("hexapod/calibration/plate.toml", "plate.toml"),
        ("pyramid/pyramid.ini", "pyramid.ini"),
        ("pyramid/pyramid.tbl", "pyramid.tbl"),
        ("pyramid/paths/cycloid.toml", "cycloid.toml"),
        ("lathe-mirrored/lathe-mirrored.ini", "lathe.ini"),
        ("lathe-mirrored/lathe-mirrored.tbl", "lathe-mirrored.tbl"),
    ] {
        fs::copy(shipped::configs().join(from), place.join(to)).unwrap();
    }
    // The folder is a link to the shipped programs, which stay as they are.
    let names: Vec<_> = fs::read_dir(place.join("programs"))
        .unwrap()
        .map(|file| file.unwrap().file_name())
        .collect();
    fs::remove_file(place.join("programs")).unwrap();
    fs::create_dir(place.join("programs")).unwrap();
    for name in names {
        fs::write(place.join("programs").join(name), PROGRAM).unwrap();
    }
    for (file, text) in [
        ("part.ngc", PROGRAM),
        ("poses.csv", "x,y,z,a,b,c\n0,0,250,0,0,0\n10,0,250,0,0,0\n"),
        ("errors.toml", "[legs]\njoint_sigma_um = 10\n"),
        ("legs.toml", "[legs]\nrod_diameter_mm = 30\n"),
        ("lag.toml", &shown("stability lag")),
        ("spindle.toml", &shown("stability spindle")),
        ("probed.log", &crate::calibrate_command::log()),
    ] {
        fs::write(place.join(file), text).unwrap();
    }
    fs::create_dir_all(place.join(".local/share/bash-completion/completions")).unwrap();
    folder
}

/// Enters readings into the table that `pkm measure` has written.
fn read_gauge(table: &Path) {
    let scatter = [1.3, -2.6, 0.7, 3.1, -0.9, -1.8, 2.2].into_iter().cycle();
    let text = fs::read_to_string(table).unwrap();
    let typed = text.lines().zip(scatter).map(|(line, off)| match line.strip_suffix(",,") {
        Some(line) => format!("{line},{},\n", 1000.0 + off),
        None => format!("{line}\n"),
    });
    fs::write(table, typed.collect::<String>()).unwrap();
}

#[test]
fn every_example_of_the_help_runs_as_printed() {
    let bench = Bench::new();
    let folder = example_files(&bench);
    let programs = Path::new(env!("CARGO_BIN_EXE_pkm")).parent().unwrap().display().to_string();
    let path = format!("{programs}:{}", std::env::var("PATH").unwrap_or_default());
    let mut run = 0;
    let mut all: Vec<String> = vec![String::new()];
    let mut examples = vec![];
    while let Some(words) = all.pop() {
        let help = bench.answer(&format!("{words} --help"), "");
        all.extend(subcommands(&help).iter().map(|name| format!("{words} {name}")));
        let end = help.split("Examples:\n").nth(1).unwrap_or_else(|| panic!("{words}: {help}"));
        assert!(end.contains("\nSee also: "), "{words}: {help}");
        let lines = end.replace(" \\\n     ", "");
        let lines = lines.lines().filter_map(|line| line.strip_prefix("  pkm "));
        examples.extend(lines.map(|line| format!("pkm {line}")));
    }
    // A table of readings is made by one example and used by another.
    examples.sort_by_key(|line| line.starts_with("pkm calibrate"));
    for line in examples {
        if SLOW.iter().any(|part| line.contains(part)) {
            // The named files do not exist: this is the reason for the refusal, not a wrong word.
            let words = line.split(['|', '>']).next().unwrap().replace("my-", "none/my-");
            let answer = bench.answer(words.trim_start_matches("pkm "), "");
            assert!(!answer.contains("For more information, try"), "{line}: {answer}");
            continue;
        }
        let done = Command::new("sh")
            .args(["-c", &line])
            .current_dir(&folder)
            .env("PATH", &path)
            .env("HOME", folder.path())
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&done.stderr);
        // The readings fit no machine in particular, which is a finding.
        let is_found = line.starts_with("pkm calibrate") && done.status.code() == Some(1);
        assert!(done.status.success() || is_found, "{line}: {:?}: {text}", done.status);
        run += 1;
        if line.starts_with("pkm measure") {
            read_gauge(&folder.path().join("dial.csv"));
        }
    }
    assert!(run > 45, "{run}");
}

#[test]
fn quiet_leaves_findings_and_results_alone() {
    let bench =
        Bench::new().with("line.ngc", PROGRAM).with("far.ngc", "G1 X0 Y200 Z60 F3000\nM2\n");
    assert_eq!(bench.answer("check linear-delta.ini --quiet", ""), "exit 0\n");
    let good = bench.answer("preflight -q linear-delta.ini line.ngc", "");
    assert!(good.starts_with("warning: the program has no M52 P1"), "{good}");
    assert!(good.ends_with("exit 0\n") && good.lines().count() == 2, "{good}");
    let far = bench.answer("preflight linear-delta.ini far.ngc -q", "");
    assert!(far.starts_with("error: line 1: ") && far.ends_with("exit 1\n"), "{far}");
    let map = "workspace linear-delta.ini --bands 4 --grid 4";
    assert!(bench.answer(map, "").contains("million a second"));
    assert!(!bench.answer(&format!("{map} --quiet"), "").contains("million a second"));
    let spoilt = Bench::new().spoilt("HOME = 0 0 90", "HOME = 0 0 80");
    let found = spoilt.answer("check linear-delta.ini --quiet", "");
    assert!(found.contains("error: ") && !found.contains("mobility"), "{found}");
}

#[test]
fn colors_follow_the_options() {
    let bench = Bench::new();
    for (words, colored) in [
        ("check none.ini --color always", true),
        ("check none.ini --color=never", false),
        ("check none.ini", false),
        ("check --nonsense --color always", true),
    ] {
        assert_eq!(bench.answer(words, "").contains('\u{1b}'), colored, "{words}");
    }
}

#[test]
fn misspelt_words_are_answered_with_the_right_ones() {
    let bench = Bench::new();
    for (words, tip) in [
        ("preflihgt", "preflight"),
        ("stability progam", "program"),
        ("new hexpod", "hexapod"),
        ("rods linear-delta.ini --studdy x", "--study"),
        ("check linear-delta.ini --format jsn", "json"),
        ("check linear-delta.ini --colour never", "--color"),
    ] {
        let answer = bench.answer(words, "");
        assert!(answer.contains("tip: ") && answer.contains(tip), "{words}: {answer}");
        assert!(answer.ends_with("exit 2\n"), "{words}: {answer}");
    }
}

#[test]
fn a_long_program_is_followed_in_as_many_poses_as_a_table_needs() {
    let bench = Bench::new().with("long.ngc", "G21 G90\nG1 X30 F60\nG1 X0\nM2\n");
    let usual = bench.answer("rods linear-delta.ini long.ngc", "");
    let rows = usual.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())).count();
    assert!((10_000..10_010).contains(&rows), "{rows}");
    assert!(usual.contains("use --period 0.001 for every servo cycle, 6 times as many"), "{rows}");
    let all = bench.answer("rods linear-delta.ini long.ngc --period 0.001 --quiet", "");
    assert!(all.lines().count() > 60_000);
}

#[test]
fn no_output_takes_the_place_of_what_was_read() {
    let bench = Bench::new().with("line.ngc", PROGRAM);
    let text = |name: &str| fs::read_to_string(bench.0.path().join(name)).unwrap();
    let before = ["linear-delta.ini", "line.ngc"].map(text);
    for words in [
        "frames linear-delta.ini -o linear-delta.ini",
        "scene linear-delta.ini -o ./linear-delta.ini",
        "homing linear-delta.ini --csv linear-delta.ini",
        "preflight linear-delta.ini line.ngc --report line.ngc",
        "run linear-delta.ini line.ngc --trace line.ngc",
        "view linear-delta.ini line.ngc --html linear-delta.ini",
    ] {
        let answer = bench.answer(words, "");
        let is_told = answer.contains("was read as input") && answer.ends_with("exit 2\n");
        assert!(is_told, "{words}: {answer}");
        assert_eq!(["linear-delta.ini", "line.ngc"].map(text), before, "{words}");
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_and_leave_nothing() {
    let bench = Bench::new().with("line.ngc", PROGRAM).with("file", "");
    let before = bench.files();
    for (words, reported) in [
        (
            "run linear-delta.ini line.ngc --trace none/t.csv",
            "none/t.csv: No such file or directory",
        ),
        ("view linear-delta.ini --html none/page.html", "none/page.html: No such file"),
        ("scene linear-delta.ini -o file/scene.json", "file/scene.json: Not a directory"),
        ("panel linear-delta.ini --output-dir file/panel", "file/panel: Not a directory"),
        ("homing linear-delta.ini --csv none/h.csv", "none/h.csv: No such file"),
        ("preflight linear-delta.ini line.ngc --report none/r.html", "none/r.html: No such file"),
        (
            "workspace linear-delta.ini --bands 4 --grid 4 --mesh none/b.obj",
            "none/b.obj: No such file",
        ),
    ] {
        for format in ["text", "json"] {
            let answer = bench.answer(&format!("{words} --format {format}"), "");
            assert!(answer.contains(reported) && answer.ends_with("exit 2\n"), "{words}: {answer}");
            assert_eq!(bench.files(), before, "{words}");
        }
    }
}

#[test]
fn subcommands_of_other_packages_are_programs_in_the_path() {
    let bench = Bench::new();
    let answer = bench.answer("design study.toml", "");
    assert!(answer.contains("comes with the Python package pkmkins"), "{answer}");
    assert!(answer.ends_with("exit 2\n"), "{answer}");
    assert!(bench.answer("chek linear-delta.ini", "").contains("'check'"));
}
