// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm cut` from the user's view.

use crate::commands::Bench;
use serde_json::Value;
use std::fs;
use std::process::Command;
use test_support::CUT as STUDY;
use test_support::shipped::folder;

/// The fifth line is four times as fast.
pub const PROGRAM: &str = "G21 G90 G64\nS6000 M3\nG0 X-20 Y0 Z50\nG1 X20 F600\nG1 X-20 F2400\nG1 X20 F600\n\
    M5\nM2\n";

fn float(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

fn bench(study: &str, program: &str) -> Bench {
    Bench::new().with("study.toml", study).with("part.ngc", program)
}

fn json(answer: &str) -> Value {
    let end = answer.rfind("exit ").unwrap_or_else(|| panic!("{answer}"));
    serde_json::Deserializer::from_str(&answer[..end]).into_iter().next().unwrap().unwrap()
}

const WORDS: &str = "cut linear-delta.ini part.ngc --study study.toml";

#[test]
fn the_worst_line_is_the_planted_one_and_its_chip_is_feed_over_teeth_and_turns() {
    let bench = bench(STUDY, PROGRAM);
    let answer = bench.answer(&format!("{WORDS} --format json --report page.html"), "");
    assert!(answer.ends_with("exit 0\n"), "{answer}");
    let found = json(&answer);
    assert_eq!((&found["version"], &found["fits"]), (&1.into(), &true.into()));
    assert_eq!((&found["chip_mm"]["line"], &found["force_n"]["line"]), (&5.into(), &5.into()));
    assert_eq!(found["worst_lines"][0]["line"], 5);
    let line = |n: u64| found["lines"].as_array().unwrap().iter().find(|l| l["line"] == n).unwrap();
    for (number, feed) in [(4, 600.0), (5, 2400.0), (6, 600.0)] {
        // LinuxCNC reaches the feed to rounding: its poses of 50 mm over steps of 10 um.
        let expected = feed / (2.0 * 6000.0);
        let chip = float(&line(number)["chip_mm"]);
        assert!((chip / expected - 1.0).abs() < 1e-8, "{number} {chip} {expected}");
    }
    // 40 mm at 10, 40 and 10 mm/s, and the time for accelerating.
    let cutting = float(&found["cutting_seconds"]);
    assert!((9.0..9.5).contains(&cutting), "{cutting}");
    assert!(float(&found["seconds"]) > cutting);
    let page = fs::read_to_string(bench.0.path().join("page.html")).unwrap();
    assert!(page.contains("The machine can cut the program") && page.matches("<svg ").count() == 3);
    let text = bench.answer(WORDS, "");
    for word in ["chip load     0.2000 mm, line 5", "not known:", "The position of the stock"] {
        assert!(text.contains(word), "{word}: {text}");
    }
}

#[test]
fn a_feed_per_turn_cuts_as_long_as_the_same_feed_per_minute() {
    let per_turn =
        PROGRAM.replace("G0 X-20", "G95 G0 X-20").replace("F600", "F0.1").replace("F2400", "F0.4");
    let found =
        |program: &str| json(&bench(STUDY, program).answer(&format!("{WORDS} --format json"), ""));
    let (minute, turn) = (found(PROGRAM), found(&per_turn));
    for key in ["cutting_seconds", "seconds"] {
        let [minute, turn] = [&minute, &turn].map(|answer| float(&answer[key]));
        // LinuxCNC's feed per turn is 0.2 % faster.
        assert!((turn / minute - 1.0).abs() < 0.01, "{key} {minute} {turn}");
    }
    // 2400 mm/min of two teeth at 6000 1/min.
    assert!((float(&turn["chip_mm"]["value"]) / 0.2 - 1.0).abs() < 1e-8, "{}", turn["chip_mm"]);
    let answer = bench(STUDY, &per_turn).answer(&format!("{WORDS} --rpm 12000"), "");
    assert!(answer.ends_with("exit 2\n"), "{answer}");
    assert!(answer.contains("--rpm 12000: part.ngc: line 4: the feed is one per turn"), "{answer}");
}

#[test]
fn every_pass_of_a_loop_is_reported_at_its_time() {
    // Three passes there and back, each faster than the one before.
    let program = "G21 G90 G64\nS6000 M3\nG0 X-20 Y0 Z50\n#1 = 0\no1 repeat [3]\n#1 = [#1 + 600]\n\
                   G1 X20 F#1\nG1 X-20\no1 endrepeat\nM5\nM2\n";
    let bench = bench(STUDY, program);
    let found = json(&bench.answer(&format!("{WORDS} --format json --report page.html"), ""));
    let course = &found["course"];
    assert_eq!(course["over"], "seconds");
    assert_eq!(course["end"], found["seconds"]);
    let positions = course["positions"].as_array().unwrap();
    let lines: Vec<&Value> = positions.iter().map(|position| &position["line"]).collect();
    assert_eq!(lines, [7, 8, 7, 8, 7, 8]);
    let ends: Vec<f64> = positions.iter().map(|position| float(&position["at"])).collect();
    let chip = |from: f64, to: f64| {
        let all = course["stretches"].as_array().unwrap().iter();
        let own = all.filter(|stretch| (from..to).contains(&float(&stretch["at"])));
        own.map(|stretch| float(&stretch["chip_mm"])).fold(0.0, f64::max)
    };
    for (pass, feed) in [600.0, 1200.0, 1800.0].into_iter().enumerate() {
        let [there, back] = [ends[2 * pass], ends[2 * pass + 1]];
        // 40 mm at the feed, and at most 0.2 s for speeding up and braking.
        let seconds = 40.0 / (feed / 60.0);
        assert!((seconds..seconds + 0.2).contains(&(back - there)), "{ends:?}");
        // Well inside the move: LinuxCNC reaches the feed to rounding.
        let chip = chip(there + 0.3, back - 0.3);
        assert!((chip / (feed / 12_000.0) - 1.0).abs() < 1e-8, "{pass} {chip}");
        // Without edge forces the vibration at a pose is proportional to the chip.
        let vibration = |pass: usize| float(&positions[2 * pass]["vibration_um"]);
        let ratio = vibration(pass) / vibration(0) / (feed / 600.0);
        assert!((ratio - 1.0).abs() < 1e-6, "{pass} {ratio}");
    }
    let worst = &found["chip_mm"];
    assert!((ends[3]..ends[5]).contains(&float(&worst["at_s"])), "{worst} {ends:?}");
    let drives = found["drives"].as_array().unwrap();
    assert!(drives.iter().all(|drive| float(&drive["at_s"]) <= float(&found["seconds"])));
    let page = fs::read_to_string(bench.0.path().join("page.html")).unwrap();
    assert!(page.contains("time in s") && !page.contains("line of the program"));
}

#[test]
fn a_drive_beyond_its_force_and_an_unstable_cut_are_refused_by_exit_code() {
    let weak = STUDY.replace("max_force_n = 500", "max_force_n = [500, 500, 3]");
    let answer = bench(&weak, PROGRAM).answer(WORDS, "");
    assert!(answer.ends_with("exit 1\n") && answer.contains("carriage 2 needs"), "{answer}");
    let deep = STUDY.replace("depth_mm = 0.1", "depth_mm = 20");
    let answer = bench(&deep.replace("= 500", "= 1e6"), PROGRAM).answer(WORDS, "");
    assert!(answer.ends_with("exit 1\n") && answer.contains("the cut chatters beyond"), "{answer}");
}

#[test]
fn the_limit_depth_is_that_of_pkm_stability() {
    let bench = bench(STUDY, PROGRAM);
    let found = json(&bench.answer(&format!("{WORDS} --format json"), ""));
    let words =
        "stability program linear-delta.ini part.ngc --study study.toml --deepest 2 --format json";
    let expected = json(&bench.answer(words, ""));
    assert_eq!(found["stability"]["stable_to_mm"], expected["worst"]["stable_to_mm"]);
    assert_eq!(found["stability"]["line"], expected["worst"]["line"]);
}

#[test]
fn steps_of_the_drives_give_the_resolution_of_the_tip() {
    let steps = |bench: Bench| {
        (0..3).fold(bench, |bench, joint| {
            let head = format!("[JOINT_{joint}]\n");
            bench.spoilt(&head, &format!("{head}SCALE = 1000\n"))
        })
    };
    let found = json(&steps(bench(STUDY, PROGRAM)).answer(&format!("{WORDS} --format json"), ""));
    let error: Vec<f64> = found["resolution_um"].as_array().unwrap().iter().map(float).collect();
    // Half a step is 0.5 um, also of the height if all carriages move together.
    assert!(error[2] >= 0.5 - 1e-9 && error.iter().all(|e| (0.1..10.0).contains(e)), "{error:?}");
}

#[test]
fn where_linuxcnc_cannot_run_nothing_is_judged() {
    let bench = bench(STUDY, PROGRAM);
    let output = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .args(WORDS.split(' '))
        .current_dir(bench.0.path())
        .env("PKM_VIRTUAL_LIBRARY", "/no/library")
        .output()
        .unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    assert!(String::from_utf8_lossy(&output.stderr).contains("/no/library"));
}

#[test]
fn what_was_not_looked_at_throughout_is_not_judged() {
    let no_limits = STUDY.replace("max_force_n = 500\n", "");
    for (study, option, word) in [
        (STUDY, "--places 2", "1 feed moves: use --places 3 to examine all"),
        (&no_limits, "", "The ratings of some drives"),
    ] {
        let answer = bench(study, PROGRAM).answer(&format!("{WORDS} {option}"), "");
        assert!(answer.ends_with("exit 2\n") && answer.contains(word), "{word}: {answer}");
        assert!(answer.contains("not everything was examined"), "{answer}");
    }
}

#[test]
fn bad_input_is_refused_with_its_key_and_nothing_is_written() {
    let dumb = PROGRAM.replace("S6000 M3", "");
    let swapped =
        PROGRAM.replace("G21 G90 G64\nS6000 M3\nG0", "G21 G90 G64\n\nG0").replace("M5", "S9");
    let rapid = "G21 S10\nG0 X5\nM2\n";
    let without = |key: &str| {
        STUDY.lines().filter(|line| !line.starts_with(key)).map(|l| format!("{l}\n")).collect()
    };
    let with = |from: &str, to: &str| {
        assert!(STUDY.contains(from), "{from}");
        STUDY.replacen(from, to, 1)
    };
    let cases: [(String, &str, &str); 17] = [
        (
            STUDY.into(),
            &dumb,
            "part.ngc: line 4: the tool cuts without a spindle speed; add an S word",
        ),
        (STUDY.into(), &swapped, "line 4: the tool cuts without a spindle speed"),
        (STUDY.into(), rapid, "part.ngc: the program has no feed moves"),
        (with("mass_kg = 2", "mass_kg = -2"), PROGRAM, "mass_kg = -2"),
        (with("[0, 0, 0.01]]", "[0, 0, 0.5]]"), PROGRAM, "not a physical inertia"),
        (
            with("damping_ratio = 0.05", "damping_ratio = -0.05"),
            PROGRAM,
            "more than 0 and less than 1",
        ),
        (with("kt_n_per_mm2 = 700", "kt_n_per_mm2 = 0"), PROGRAM, "0: expected more than 0"),
        (
            with("entry_deg = 0", "entry_deg = -10"),
            PROGRAM,
            "-10: expected an angle of 0 to 180 degrees",
        ),
        (
            with("exit_deg = 180", "exit_deg = 190"),
            PROGRAM,
            "190: expected an angle of 0 to 180 degrees",
        ),
        (with("depth_mm = 0.1", "depth_mm = 0"), PROGRAM, "0: expected more than 0"),
        (with("max_force_n = 500", "max_force_n = -500"), PROGRAM, "-500: expected more than 0"),
        (with("max_force_n = 500", "max_force = 500"), PROGRAM, "unknown field `max_force`"),
        (without("depth_mm"), PROGRAM, "study.toml: the study has no depth_mm in [cutting]"),
        (without("kt_n_per_mm2"), PROGRAM, "missing field `kt_n_per_mm2`"),
        (without("mass_kg"), PROGRAM, "missing field `mass_kg`"),
        (without("damping_ratio"), PROGRAM, "the study has no damping_n_s_per_mm in [legs]"),
        (
            STUDY.split("[cutting]").next().unwrap().into(),
            PROGRAM,
            "the study has neither [cutting] (a milling cutter) nor [turning]",
        ),
    ];
    for (study, program, word) in cases {
        let bench = bench(&study, program);
        let files = bench.files();
        let answer = bench.answer(&format!("{WORDS} --report page.html"), "");
        assert!(answer.ends_with("exit 2\n") && answer.contains(word), "{word}: {answer}");
        assert_eq!(bench.files(), files, "{word}");
    }
    for (option, word) in
        [("--rpm 0", "above 0"), ("--deepest 0", "depth above 0"), ("--places 0", "0")]
    {
        let answer = bench(STUDY, PROGRAM).answer(&format!("{WORDS} {option}"), "");
        assert!(answer.ends_with("exit 2\n") && answer.contains(word), "{word}: {answer}");
    }
}

#[test]
fn the_shipped_study_gives_the_figures_that_its_page_shows() {
    let hexapod = folder("hexapod");
    let words = format!(
        "cut {} {} --study {}",
        hexapod.join("hexapod.ini").display(),
        hexapod.join("programs/five-axis-surface.ngc").display(),
        hexapod.join("cut.toml").display()
    );
    let answer = Bench::new().answer(&words, "");
    assert!(answer.ends_with("exit 0\n"), "{answer}");
    let page = fs::read_to_string(folder("../docs/studies/cut.md")).unwrap();
    for line in
        answer.lines().skip(1).take(7).chain(answer.lines().filter(|l| l.contains("strut 5 ")))
    {
        assert!(page.contains(line.trim_end()), "{line}");
    }
}

/// The study of a lathe tool instead of a cutter: 1500 N/mm² on 0.1 mm of depth.
fn turning() -> String {
    let (machine, _) = STUDY.split_once("[cutting]").unwrap();
    format!(
        "{machine}[turning]\nkf_n_per_mm2 = 1500\nthicker = [0, 0, -1]\nforce = [0.3, -1, 0.4]\ndepth_mm = 0.1\n"
    )
}

#[test]
fn turning_has_the_force_of_depth_and_feed_per_revolution_and_shakes_nothing() {
    let bench = bench(&turning(), PROGRAM);
    let answer = bench.answer(&format!("{WORDS} --format json --report page.html"), "");
    let found = json(&answer);
    assert_eq!((&found["is_turning"], &found["vibration_um"]), (&true.into(), &Value::Null));
    let line = |n: u64| found["lines"].as_array().unwrap().iter().find(|l| l["line"] == n).unwrap();
    for (number, feed) in [(4, 600.0), (5, 2400.0)] {
        let expected = feed / 6000.0;
        let [chip, force] = ["chip_mm", "force_n"].map(|key| float(&line(number)[key]));
        // LinuxCNC reaches the feed to rounding: its poses of 50 mm over steps of 10 um.
        assert!((chip / expected - 1.0).abs() < 1e-8, "{number} {chip}");
        assert!((force / (1500.0 * 0.1 * expected) - 1.0).abs() < 1e-8, "{number} {force}");
    }
    let words =
        "stability program linear-delta.ini part.ngc --study study.toml --deepest 2 --format json";
    let expected = json(&bench.answer(words, ""));
    assert_eq!(found["stability"]["stable_to_mm"], expected["worst"]["stable_to_mm"]);
    assert_eq!(found["stability"]["margin"], expected["margin"]);
    let page = fs::read_to_string(bench.0.path().join("page.html")).unwrap();
    assert!(!page.contains(">vibration<"), "the plots have a line without points");
    let text = bench.answer(WORDS, "");
    assert!(
        text.contains("with the study's depth.") && !text.contains("under the teeth"),
        "{text}"
    );
}

#[test]
fn feeds_against_a_thicker_chip_are_named_and_refused_if_there_are_no_others() {
    let along = |thicker: &str| turning().replace("[0, 0, -1]", thicker);
    let mixed = bench(&along("[1, 0, 0]"), PROGRAM).answer(WORDS, "");
    assert!(
        mixed.contains("warning: line 5: the feed is against [turning] thicker, 1 such moves"),
        "{mixed}"
    );
    let program = PROGRAM.replace("G1 X-20 F2400\nG1 X20 F600\n", "");
    let bench = bench(&along("[-1, 0, 0]"), &program);
    for command in [WORDS, "stability program linear-delta.ini part.ngc --study study.toml"] {
        let answer = bench.answer(command, "");
        assert!(answer.ends_with("exit 2\n"), "{answer}");
        assert!(
            answer.contains("part.ngc: line 4: the feed is against [turning] thicker, as in every")
        );
    }
}

#[test]
fn each_of_two_mechanisms_is_judged_at_the_speed_of_the_blocks_that_move_both() {
    // The second one moves twice as far: the feed is that of X Y Z.
    let program = "G21 G90 G94 G64\nS2000 M3\nG1 Z980 W2640 F1200\nM5\nM2\n";
    let file = folder("lathe-mirrored").join("lathe-mirrored.ini");
    let [machine, table] =
        ["ini", "tbl"].map(|ending| fs::read_to_string(file.with_extension(ending)).unwrap());
    let with_axis = with_spindle_angle(&machine);
    for (mechanism, feed, thicker) in [(1, 1200.0, "[0, 0, -1]"), (2, 2400.0, "[0, 0, 1]")] {
        for machine in [&machine, &with_axis] {
            let made = bench(&turning().replace("[0, 0, -1]", thicker), program);
            let bench = made.with("lathe.ini", machine).with("lathe-mirrored.tbl", &table);
            let words = format!(
                "cut lathe.ini part.ngc --study study.toml --mechanism {mechanism} --format json"
            );
            let answer = bench.answer(&words, "");
            let found = json(&answer);
            assert!(found["not_judged"].is_null(), "{answer}");
            // LinuxCNC reaches the feed to rounding: its poses of some meters over steps of 20 um.
            let chip = float(&found["chip_mm"]["value"]);
            assert!((chip / (feed / 2000.0) - 1.0).abs() < 1e-6, "{mechanism} {chip}");
        }
        let turned = program.replace("F1200", "A90 F1200");
        let made = bench(&turning(), &turned).with("lathe.ini", &with_axis);
        let bench = made.with("lathe-mirrored.tbl", &table);
        let words = format!("cut lathe.ini part.ngc --study study.toml --mechanism {mechanism}");
        let answer = bench.answer(&words, "");
        assert!(answer.contains("part.ngc: line 3: an extra axis moves in the cut"), "{answer}");
        assert!(answer.ends_with("exit 2\n"), "{answer}");
    }
}

/// Returns the machine with two mechanisms and the extra axis A.
fn with_spindle_angle(machine: &str) -> String {
    let axis = "TYPE = ANGULAR\nMIN_LIMIT = -999\nMAX_LIMIT = 999\nMAX_VELOCITY = 90\nMAX_ACCELERATION = 900\n";
    let mut text = machine.to_string();
    for (from, to) in [
        (" second=slider", " axes=A second=slider"),
        ("JOINTS = 8\n", "JOINTS = 9\n"),
        ("COORDINATES = XYZBCUVW\n", "COORDINATES = XYZABCUVW\n"),
        (
            "[AXIS_X]\n",
            &format!("[JOINT_8]\n{axis}HOME = 0\nHOME_SEQUENCE = 0\n[AXIS_A]\n{axis}[AXIS_X]\n"),
        ),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    text
}

#[test]
fn a_rapid_through_the_stock_is_reported_with_its_line() {
    let tables = "[milling]\nspeed_rpm = 6000\nfeed_mm = 0.05\ndiameter_mm = 10\nseconds = 1\n\
                  [stock]\nlow_mm = [-10, -10]\nhigh_mm = [30, 10]\ntop_mm = 51\ncell_mm = 0.5\n";
    let program = PROGRAM.replace("M5", "G0 Y8\nM5");
    let bench = bench(&format!("{STUDY}{tables}"), &program);
    let words = "warning: line 7: a rapid move goes through the material of [stock]";
    let answer = bench.answer(&format!("{WORDS} --report page.html"), "");
    assert!(answer.contains(words) && answer.matches("warning:").count() == 1, "{answer}");
    let page = fs::read_to_string(bench.0.path().join("page.html")).unwrap();
    assert!(page.contains("line 7: a rapid move goes through the material"));
    let found = json(&bench.answer(&format!("{WORDS} --format json"), ""));
    assert_eq!(found["warnings"].as_array().unwrap().len(), 1);
    assert_eq!(found["rapids_not_judged"], Value::Null);
}

#[test]
fn a_study_of_turning_without_a_depth_or_with_a_cutter_is_refused() {
    let without = turning().replace("depth_mm = 0.1\n", "");
    let answer = bench(&without, PROGRAM).answer(WORDS, "");
    assert!(
        answer.ends_with("exit 2\n") && answer.contains("no depth_mm in [turning]"),
        "{answer}"
    );
    let (_, cutter) = STUDY.split_once("[cutting]").unwrap();
    let both = format!("{}[cutting]{cutter}", turning());
    let answer = bench(&both, PROGRAM).answer(WORDS, "");
    assert!(
        answer.ends_with("exit 2\n") && answer.contains("both [cutting] and [turning]"),
        "{answer}"
    );
}
