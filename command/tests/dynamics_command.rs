// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm dynamics` from the user's view: outputs, and input that is refused without any output file.

use crate::commands::Bench;
use std::fs;
use test_support::shipped::folder;

pub const STUDY: &str = "[platform]\nmass_kg = 2\ncentre_mm = [0, 0, 20]\n\
    [legs]\nstiffness_n_per_um = 5\ndamping_ratio = 0.05\n\
    [force]\nsigma_n = [20, 20, 10]\ncorner_hz = 200\nseconds = 0.2\n\
    [cutting]\nteeth = 2\nentry_deg = 0\nexit_deg = 90\ndepth_mm = 1\nkt_n_per_mm2 = 700\nkr_n_per_mm2 = 200\n\
    [milling]\nspeed_rpm = 9000\nfeed_mm = 0.05\ndiameter_mm = 6\nseconds = 0.05\n";

/// Checks that the output ends with this exit code and contains these words.
fn assert_output(answer: &str, exit: u8, words: &[&str]) {
    assert!(answer.ends_with(&format!("exit {exit}\n")), "{answer}");
    for word in words {
        assert!(answer.contains(word), "{word}: {answer}");
    }
}

#[test]
fn modes_responses_maps_and_motions_are_reported_written_and_drawn() {
    let bench = Bench::new().with("study.toml", STUDY);
    let words = "dynamics linear-delta.ini --study study.toml --grid 7 --plots drawn --response h.csv \
                 --map map.csv --shake noise --trace trace.csv --spectrum s.csv";
    let answer = bench.answer(words, "");
    let reported =
        ["modes: Hz", "compliance", "bear the weight", "ellipse in X and Y", "linear theory"];
    assert_output(&answer, 0, &reported);
    // The response, two maps of three planes, trace, deviation and spectrum.
    assert_eq!(fs::read_dir(bench.0.path().join("drawn")).unwrap().count(), 10);
    let read = |name: &str| fs::read_to_string(bench.0.path().join(name)).unwrap();
    assert!(read("h.csv").starts_with("hz,xx_re,xx_im,yy_re,"));
    assert!(read("map.csv").starts_with("x,y,z,lowest_hz,largest_swing_um_per_n\n"));
    assert!(read("map.csv").lines().count() > 60);
    assert!(read("trace.csv").starts_with("time,x_um,y_um,z_um\n0,"));
    let head = "hz,x_um2_per_hz,y_um2_per_hz,z_um2_per_hz,x_linear_um2_per_hz,";
    assert!(read("s.csv").starts_with(head) && read("s.csv").lines().count() > 400);
    let again = bench.answer(words, "");
    assert_eq!(answer, again, "equal seeds give equal motions");
}

#[test]
fn json_has_what_the_text_has() {
    let bench = Bench::new().with("study.toml", STUDY);
    let words = "dynamics linear-delta.ini --study study.toml --format json --shake noise";
    let answer = bench.answer(words, "");
    let (json, end) = answer.rsplit_once("exit ").unwrap();
    assert_eq!(end, "0\n");
    let value: serde_json::Value = serde_json::from_str(json).unwrap();
    assert_eq!(value["modes"].as_array().unwrap().len(), 3);
    let rms = |of: &serde_json::Value| of["rms_um"][0].as_f64().unwrap();
    let (found, linear) = (rms(&value["motion"]), rms(&value["motion"]["linear"]));
    let spread = value["motion"]["linear"]["spread"][0].as_f64().unwrap();
    assert!((found / linear - 1.0).abs() < 4.0 * spread, "{found} {linear} {spread}");
}

#[test]
fn a_cutter_shakes_the_machine_too() {
    let bench = Bench::new().with("study.toml", STUDY);
    let answer = bench.answer("dynamics linear-delta.ini --study study.toml --shake milling", "");
    assert_output(&answer, 0, &["in 0.050 s", "largest forces, N"]);
}

#[test]
fn a_stock_is_cut_at_the_speed_of_the_program_or_nothing_is_judged() {
    let program = "G21 G90 G64\nS18000 M3\nG0 X-8 Y0 Z60\nG0 Z50\nG1 X8 F1200\nM5\nM2\n";
    let stock = "[stock]\nlow_mm = [-4, -10]\nhigh_mm = [4, 10]\ntop_mm = 51\ncell_mm = 0.2\n";
    let study = format!("{STUDY}{stock}");
    let run = |program: &str, machine: &str, study: &str| {
        let bench = Bench::new().with("study.toml", study);
        let bench = bench.with("part.ngc", program);
        bench.answer(
            &format!("dynamics {machine} --study study.toml --shake milling --program part.ngc"),
            "",
        )
    };
    let delta = |program: &str| run(program, "linear-delta.ini", &study);
    let cut = delta(program);
    assert_output(&cut, 0, &["removed, mm3"]);
    let line = cut.lines().find(|line| line.contains("removed, mm3")).unwrap();
    let removed: f64 = line.split_whitespace().last().unwrap().parse().unwrap();
    // A slot of 8 by 6 by 1 mm, with a cell of 0.2 mm at each side.
    assert!((removed / 48.0 - 1.0).abs() < 0.1, "{removed}");
    // Twice as fast, a tooth cuts half as much.
    assert_ne!(cut, delta(&program.replace("S18000", "S36000")));
    for (from, to, word) in [
        ("M3", "", "line 5: the tool cuts with the spindle stopped; add S and M3"),
        ("M5", "S8000\nG1 X9\nM5", "line 7: the tool cuts at 8000 1/min, before at 18000"),
        (
            "G0 Z50",
            "G0 Z55",
            "part.ngc: not judged: the tool does not touch the block in a feed move",
        ),
        ("G1 X8 F1200", "", "part.ngc: the program has no feed moves"),
    ] {
        assert_output(&delta(&program.replacen(from, to, 1)), 2, &[word]);
    }
    let table = folder("hexapod-rotary-table").join("hexapod-rotary-table.ini");
    let program = program.replace("Z60", "Z260").replace("Z50", "Z250");
    let inertia = "inertia_kg_m2 = [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]]\ncentre_mm";
    let study = study.replace("centre_mm", inertia);
    let refused = run(&program, &table.display().to_string(), &study);
    assert_output(&refused, 2, &["[stock] does not turn with an axis that carries the work"]);
}

#[test]
fn the_shipped_study_gives_the_frequencies_that_its_page_shows() {
    let bench = Bench::new();
    let hexapod = folder("hexapod");
    let (ini, study) = (hexapod.join("hexapod.ini"), hexapod.join("dynamics.toml"));
    let words = format!(
        "dynamics {} --study {} --pose -80 60 350 10 -20 0",
        ini.display(),
        study.display()
    );
    let answer = bench.answer(&words, "");
    let page = folder("../docs/studies/dynamics.md");
    let page = fs::read_to_string(page).unwrap();
    let modes: Vec<&str> =
        answer.lines().skip_while(|line| !line.starts_with("modes")).skip(1).take(6).collect();
    assert_eq!(modes.len(), 6);
    for line in modes {
        assert!(page.contains(line.trim()), "{line}");
    }
}

#[test]
fn bad_studies_are_refused_with_their_key_and_nothing_is_written() {
    let with = |from: &str, to: &str| STUDY.replacen(from, to, 1);
    let turning = "inertia_kg_m2 = [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.5]]\n[legs]";
    for (text, words) in [
        (with("mass_kg = 2", "mass_kg = -2"), ["mass_kg = -2", "expected more than 0"]),
        (with("mass_kg = 2\n", ""), ["[platform]", "missing field `mass_kg`"]),
        (with("mass_kg = 2", "mass = 2"), ["unknown field `mass`", "mass_kg"]),
        (
            with("[legs]", "[legs]\naxial_mass_kg = -1"),
            ["axial_mass_kg", "-1: expected more than 0"],
        ),
        (with("[legs]", "[table]\nmass_kg = 0\n[legs]"), ["mass_kg", "0: expected more than 0"]),
        (with("[0, 0, 20]", "[0, nan, 0]"), ["centre_mm", "expected a finite number"]),
        (with("[legs]", turning), ["inertia_kg_m2", "not a physical inertia"]),
        (with("damping_ratio = 0.05\n", ""), ["has no damping_n_s_per_mm", "[legs]"]),
        (with("= 0.05\n", "= -0.05\n"), ["damping_ratio", "expected more than 0 and less than 1"]),
        (with("= 0.05\n", "= 0.05\ndamping_n_s_per_mm = 1\n"), ["both", "remove one of them"]),
        (
            with("damping_ratio = 0.05", "damping_n_s_per_mm = [1, 1]"),
            ["damping_n_s_per_mm", "expected one number, or 3"],
        ),
        (with("stiffness_n_per_um = 5\n", ""), ["has no stiffness_n_per_um", "study.toml"]),
        (
            with("stiffness_n_per_um = 5", "stiffness_n_per_um = 5\ndrive_mass_kg = 1"),
            ["has no rod_stiffness_n_per_um", "[legs]"],
        ),
        (with("[20, 20, 10]", "[0, 0, 0]"), ["sigma_n", "expected a force"]),
        (with("corner_hz = 200\n", ""), ["corner_hz", "band_quality"]),
        (with("corner_hz = 200", "corner_hz = 0"), ["corner_hz = 0", "expected more than 0"]),
        (with("seconds = 0.2", "seconds = inf"), ["seconds = inf", "expected more than 0"]),
        (with("teeth = 2", "teeth = 0"), ["teeth", "at least"]),
        (with("exit_deg = 90", "exit_deg = 200"), ["exit_deg", "0 to 180"]),
        (with("kt_n_per_mm2 = 700", "kt_n_per_mm2 = 0"), ["kt_n_per_mm2", "more than 0"]),
        (with("speed_rpm = 9000\n", ""), ["[milling]", "missing field `speed_rpm`"]),
        (with("diameter_mm = 6", "diameter_mm = 6\nhelix_deg = 90"), ["helix_deg", "less than 90"]),
        (with("seconds = 0.2", "seconds = 1e9"), ["steps", "fewer seconds"]),
        (with("= 0.05\n", "= 1e-12\n"), ["of settling", "more damping"]),
        (with("[platform]", "[platform]\ndown = [0, 0, 0]"), ["down", "expected a direction"]),
        ("[legs]\nstiffness_n_per_um = 5\n".into(), ["has no mass_kg", "[platform]"]),
    ] {
        let bench = Bench::new().with("study.toml", &text);
        let files = bench.files();
        let words_of =
            "dynamics linear-delta.ini --study study.toml --shake noise --plots drawn --map m.csv";
        assert_output(&bench.answer(words_of, ""), 2, &words);
        assert_eq!(bench.files(), files, "{text}");
    }
}

#[test]
fn bad_arguments_are_refused_and_nothing_is_written() {
    let empty = STUDY.split("[force]").next().unwrap();
    let bench = Bench::new().with("study.toml", STUDY).with("empty.toml", empty);
    let bench = bench.with("flat.toml", &STUDY.replace("depth_mm = 1\n", ""));
    let files = bench.files();
    for (words, reported) in [
        ("study.toml --trace t.csv", "--trace: nothing moves"),
        ("study.toml --spectrum s.csv", "--spectrum: nothing moves"),
        ("study.toml --top 0", "--top 0: expected more than 0"),
        ("study.toml --pose 900 0 0 0 0 0", "X900.0000"),
        ("study.toml --pose 1 2", "found 2 numbers"),
        ("empty.toml --shake noise --trace t.csv", "has no sigma_n in [force]"),
        ("empty.toml --shake milling --trace t.csv", "has no teeth in [cutting]"),
        ("flat.toml --shake milling --trace t.csv", "has no depth_mm in [cutting]"),
        ("study.toml --program none.ngc --trace t.csv", "none.ngc: No such file"),
        ("none.toml", "none.toml: No such file"),
        ("study.toml --response none/h.csv", "none/h.csv: No such file"),
        (
            "study.toml --shake noise --spectrum s.csv --plots drawn --trace none/t.csv",
            "none/t.csv: No such file",
        ),
        ("study.toml --shake noise --spectrum s.csv --trace s.csv", "two outputs have this name"),
    ] {
        assert_output(
            &bench.answer(&format!("dynamics linear-delta.ini --study {words}"), ""),
            2,
            &[reported],
        );
        assert_eq!(bench.files(), files, "{words}");
    }
}

#[test]
fn a_feed_along_the_tool_is_refused() {
    let text = STUDY.replace("speed_rpm", "feed = [0, 0, -2]\nspeed_rpm");
    let bench = Bench::new().with("study.toml", &text);
    let answer = bench.answer("dynamics linear-delta.ini --study study.toml --shake milling", "");
    assert_output(&answer, 2, &["feed of [milling] points along the tool axis"]);
}

#[test]
fn a_slow_band_is_sampled_in_short_steps() {
    // The increment of a step is 1e-15 of the force.
    let text = STUDY.replace("corner_hz = 200", "band_hz = 0.01\nband_quality = 5");
    let bench = Bench::new().with("study.toml", &text);
    let answer = bench.answer("dynamics linear-delta.ini --study study.toml --shake noise", "");
    assert_output(&answer, 0, &["linear theory"]);
}

#[test]
fn a_table_needs_its_mass_and_dampers() {
    let bench = Bench::new();
    let ini = folder("pyramid").join("pyramid.ini");
    let turning =
        STUDY.replace("[legs]", "inertia_kg_m2 = [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]\n[legs]");
    let of = |table: &str| {
        fs::write(bench.0.path().join("study.toml"), format!("{turning}{table}")).unwrap();
        bench.answer(&format!("dynamics {} --study study.toml", ini.display()), "")
    };
    assert_output(&of(""), 2, &["has no mass_kg in [table], which this machine needs"]);
    assert_output(&of("[table]\nmass_kg = 9\n"), 2, &["has no stiffness_n_per_um in [table]"]);
    let half = "[table]\nmass_kg = 9\nstiffness_n_per_um = 40\n";
    assert_output(&of(half), 2, &["has no damping_n_s_per_mm in [table]"]);
    assert_output(&of(&format!("{half}damping_ratio = 0.03\n")), 0, &["modes: Hz"]);
    fs::write(bench.0.path().join("study.toml"), STUDY).unwrap();
    let answer = bench.answer(&format!("dynamics {} --study study.toml", ini.display()), "");
    assert_output(&answer, 2, &["has no inertia_kg_m2 in [platform]"]);
}

#[test]
fn a_program_moves_the_machine_by_the_commands_of_linuxcnc() {
    let bench = Bench::new().with("study.toml", STUDY);
    let bench = bench.with("line.ngc", "G21 G90 G64\nG1 X10 F6000\nG1 X0\nM2\n");
    let words = "dynamics linear-delta.ini --study study.toml --program line.ngc --trace t.csv --plots drawn";
    assert_output(&bench.answer(words, ""), 0, &["largest forces, N"]);
    let trace = fs::read_to_string(bench.0.path().join("t.csv")).unwrap();
    let most = |column: usize| -> f64 {
        let cells = trace.lines().skip(1).map(|line| line.split(',').nth(column).unwrap());
        cells.map(|cell| cell.parse::<f64>().unwrap().abs()).fold(0.0, f64::max)
    };
    // Legs of 5 N/um pull 2 kg along X: the tip lags by acceleration over the square of the frequency,
    // and never twice as much as after a sudden start.
    assert!(most(1) > 0.05 && most(1) < 20.0, "{}", most(1));
    assert!(most(2) < most(1), "{}", most(2));
}
