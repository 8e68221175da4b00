// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stability` from the user's view.

use crate::commands::Bench;
use serde_json::Value;
use std::fs;
use std::path::Path;
use test_support::shipped;
use test_support::stability::{close, rows};

fn example(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/studies/examples");
    fs::read_to_string(folder.join(name)).unwrap()
}

/// Returns the study of the links for which golden/stability.toml has independent results.
fn two_links() -> String {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/cases");
    fs::read_to_string(cases.join("two-links.toml")).unwrap()
}

/// Checks that the output ends with this exit code and contains these words.
#[track_caller]
fn assert_output(answer: &str, exit: u8, words: &[&str]) {
    assert!(answer.ends_with(&format!("exit {exit}\n")), "{answer}");
    for word in words {
        assert!(answer.contains(word), "{word}: {answer}");
    }
}

/// Returns the JSON of an output that ends with exit code 0; standard error follows it.
#[track_caller]
fn json(answer: &str) -> Value {
    let end = answer.rfind("exit 0\n").unwrap_or_else(|| panic!("{answer}"));
    let mut values = serde_json::Deserializer::from_str(&answer[..end]).into_iter::<Value>();
    values.next().unwrap().unwrap()
}

fn float(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn two_adjustments_of_the_links_stand_side_by_side() {
    let bench = Bench::new().with("links.toml", &two_links());
    let words = "stability lag --study links.toml --overhang 500 300 --format json";
    let found = json(&bench.answer(words, ""));
    let expected = rows("dpartition", "overhang_l_delta_k1_omega_K_T_3ms");
    for (found, expected) in
        found["adjustments"].as_array().unwrap().iter().zip([&expected[2], &expected[1]])
    {
        assert_eq!(float(&found["overhang_mm"]), expected[0]);
        close(float(&found["limit"]["omega_rad_per_s"]), expected[3], 1e-9);
        close(float(&found["limit"]["stiffness_n_per_mm"]), expected[4], 1e-9);
        assert_eq!(found["is_confirmed_by_counts"], true);
    }
    let answer = bench.answer("stability lag --study links.toml --overhang 500 300", "");
    assert_output(
        &answer,
        0,
        &["overhang 500 mm", "1779.166 N/mm", "overhang 300 mm", "3092.124 N/mm"],
    );
    assert_output(&answer, 0, &["Damping and cutting coefficients come from the study"]);
}

#[test]
fn the_lag_of_two_links_is_answered_drawn_and_written() {
    let bench = Bench::new().with("links.toml", &two_links());
    let words = "stability lag --study links.toml --plots drawn --csv out.csv --format json --stiffness 2000";
    let found = json(&bench.answer(words, ""));
    // Masses as the paper prints them prompt the question.
    assert!(found["warnings"][0].as_str().unwrap().contains("mass_kg = 2270"));
    let found = &found["adjustments"][0];
    close(float(&found["limit"]["stiffness_n_per_mm"]), 4884.6998776274595, 1e-9);
    assert_eq!(found["limit"]["unstable_below_and_above"], serde_json::json!([0, 2]));
    close(float(&found["worst_lag"]["time_constant_ms"]), 7.291788103150239, 1e-9);
    let count = |folder: &str| fs::read_dir(bench.0.path().join(folder)).unwrap().count();
    // Three partitions, four parts of the response, and the hodographs of the response, the links and the open loop.
    assert_eq!(count("drawn"), 10);
    let links = fs::read_to_string(bench.0.path().join("drawn/links-hodograph.svg")).unwrap();
    assert!(links.contains("spindle and cantilever") && links.contains("table and workpiece"));
    let open = fs::read_to_string(bench.0.path().join("drawn/open-loop-hodograph.svg")).unwrap();
    assert!(open.contains("Open loop") && open.contains("encloses -1"), "{open}");
    let partition = fs::read_to_string(bench.0.path().join("drawn/lag-partition.svg")).unwrap();
    assert!(partition.contains("K 4885 N/mm at 138.10 rad/s"));
    // The first row is W at rest, as in the independent values.
    let table = fs::read_to_string(bench.0.path().join("out.csv")).unwrap();
    let cells: Vec<&str> = table.lines().nth(1).unwrap().split(',').collect();
    let rest = &rows("dpartition", "response_K_2000_T_3ms_omega_re_im_abs_arg_reP_imP")[0];
    assert_eq!((cells[0], cells[1]), ("as given", "0"));
    close(cells[2].parse().unwrap(), rest[1], 1e-12);
    let beyond = bench.answer("stability lag --study links.toml --stiffness 6000", "");
    assert_output(&beyond, 1, &["unstable roots         2", "settling time          never"]);
}

/// Returns a measured response as in `a_measured_response_…` of the workbench: mass (t), damping (N s/mm) and stiffness
/// (N/mm) of paper 002's links.
fn response() -> String {
    let links = [[2.27e-3, 0.441454, 38_900.0], [8.65e-3, 1.217793, 93_000.0]];
    let row = |k: u32| {
        let hz = 20.0 + 0.5 * f64::from(k);
        let omega = std::f64::consts::TAU * hz;
        let (mut re, mut im) = (0.0, 0.0);
        for [mass, damping, stiffness] in links {
            let (a, b) = (stiffness - mass * omega * omega, damping * omega);
            re += a / (a * a + b * b);
            im -= b / (a * a + b * b);
        }
        format!("{hz},{:e},{:e}\n", 1e3 * re, 1e3 * im)
    };
    format!("hz,re_um_per_n,im_um_per_n\n{}", (0..4000).map(row).collect::<String>())
}

const MEASURED: &str =
    "[lag]\ntime_constant_ms = 0.27855\n[[measured]]\nname = \"tool\"\nfile = \"frf.csv\"\n";

#[test]
fn a_measured_response_is_answered_drawn_and_written() {
    let bench = Bench::new().with("study.toml", MEASURED).with("frf.csv", &response());
    let lag = "stability lag --study study.toml";
    let found =
        json(&bench.answer(&format!("{lag} --plots drawn --csv out.csv --format json"), ""));
    let own = &found["adjustments"][0];
    // Lines between samples, as in the workbench, at 2.5 times their distance: 6 times the error.
    close(float(&own["limit"]["stiffness_n_per_mm"]), 3589.986, 6e-4);
    assert_eq!(own["is_confirmed_by_counts"], true);
    assert!(own["real_root_passes_0_at_n_per_mm"].is_null() && own["at"]["settling_s"].is_null());
    // Two partitions: there is no first link.
    assert_eq!(fs::read_dir(bench.0.path().join("drawn")).unwrap().count(), 9);
    let table = fs::read_to_string(bench.0.path().join("out.csv")).unwrap();
    assert!(table.lines().next().unwrap().ends_with("tool_abs_mm_per_n,tool_phase_deg"));
    assert_output(
        &bench.answer(lag, ""),
        0,
        &[
            "unknown from a measured response",
            "from 20.0 to 2019.5 Hz; resonances beyond are not covered",
        ],
    );
    assert_eq!(own["examined_hz"], serde_json::json!([20.0, 2019.5]));
    // A file in mm/N whose header says um/N, and one that begins above a quarter of the slowest resonance.
    let small = response().replace("um_per_n", "m_per_n");
    let bench = bench.with("frf.csv", &small);
    assert_output(&bench.answer(lag, ""), 0, &["warning: [[measured]] tool: frf.csv gives up to"]);
    let text = response();
    let late: String = text.lines().skip(401).map(|line| format!("{line}\n")).collect();
    let bench = bench.with("frf.csv", &format!("{}\n{late}", text.lines().next().unwrap()));
    let narrow = json(&bench.answer(&format!("{lag} --format json"), ""));
    let narrow = &narrow["adjustments"][0]["at"];
    assert!(narrow["oscillation_index"].is_null() && narrow["bandwidth_rad_per_s"].is_null());
    assert_output(&bench.answer(lag, ""), 0, &["unknown: the measured range is too narrow"]);
    let bench = bench.with("frf.csv", &text);
    let beyond = bench.answer(&format!("{lag} --stiffness 4000"), "");
    assert_output(&beyond, 1, &["unstable roots         2", "settling time          never"]);
    // Up to 420 Hz nothing is decided.
    let short: String = response().lines().take(800).map(|line| format!("{line}\n")).collect();
    let bench = bench.with("frf.csv", &short);
    assert_output(
        &bench.answer(lag, ""),
        2,
        &[
            "none at the measured",
            "NOT confirmed: measure a wider",
            "unstable roots         not judged",
        ],
    );
    let beyond = bench.answer(&format!("{lag} --stiffness 100000 --format json"), "");
    assert_output(&beyond, 2, &[]);
    assert!(beyond.replace(' ', "").contains("\"fits\":null"), "{beyond}");
}

#[test]
fn a_table_that_cannot_be_written_leaves_no_pictures() {
    let bench = Bench::new().with("links.toml", &two_links()).with("study.toml", DELTA);
    let files = bench.files();
    for command in [
        "stability lag --study links.toml",
        "stability pose linear-delta.ini --study study.toml --columns 5",
    ] {
        let answer = bench.answer(&format!("{command} --plots drawn --csv absent/out.csv"), "");
        assert_output(&answer, 2, &["absent/out.csv: No such file"]);
        assert_eq!(bench.files(), files, "{command}");
    }
}

#[test]
fn joints_of_a_spindle_have_their_share() {
    let text = example("spindle-joints.toml");
    let bench = Bench::new().with("study.toml", &text);
    let words = "stability spindle --study study.toml --format json";
    let found = json(&bench.answer(words, ""));
    let own = &found["adjustments"][0];
    let rigid = bench.with("study.toml", text.split("[[spindle.joints]]").next().unwrap());
    let rigid = json(&rigid.answer(words, ""));
    let compliance = |found: &Value| float(&found["adjustments"][0]["compliance_um_per_n"]);
    // 1 and 1 nm/N, 0.5 and 1 urad/(N m) at 54 and 34 mm from the end; a static result of the workbench, 1e-6 each.
    let added = 0.001 + 0.001 + 5e-7 * 54.0 * 54.0 + 1e-6 * 34.0 * 34.0;
    close(compliance(&found), compliance(&rigid) + added, 3e-6);
    close(float(&own["share_of_joints"]), added / compliance(&found), 1e-5);
}

#[test]
fn a_spindle_is_answered_for_two_overhangs() {
    let bench = Bench::new().with("spindle.toml", &example("spindle.toml"));
    let found = json(
        &bench.answer("stability spindle --study spindle.toml --overhang 32 90 --format json", ""),
    );
    let [short, long] = [0, 1].map(|k| &found["adjustments"][k]);
    assert!(float(&long["compliance_um_per_n"]) > float(&short["compliance_um_per_n"]));
    assert!(float(&long["modes"][0]["hz"]) < float(&short["modes"][0]["hz"]));
    let share = float(&short["share_of_modes"]);
    assert!((0.5..1.0).contains(&share), "{share}");
    assert_output(
        &bench.answer("stability spindle --study spindle.toml", ""),
        0,
        &["overhang 70 mm", "decrement"],
    );
    // The same spindle as the links of a loop.
    let lag = bench.answer("stability lag --study spindle.toml --overhang 32 90 --format json", "");
    let [short, long] =
        [0, 1].map(|k| float(&json(&lag)["adjustments"][k]["limit"]["stiffness_n_per_mm"]));
    assert!(long < short);
}

/// Masses, springs and a cutter for the linear delta.
pub const DELTA: &str = "[platform]\nmass_kg = 2\ncentre_mm = [0, 0, 0]\n[legs]\n\
                     stiffness_n_per_um = 2\ndamping_ratio = 0.03\n[cutting]\nteeth = 2\n\
                     entry_deg = 0\nexit_deg = 180\nkt_n_per_mm2 = 600\nkr_n_per_mm2 = 200\n";

#[test]
fn a_pose_is_answered_drawn_and_written() {
    let bench = Bench::new().with("study.toml", DELTA);
    let words = "stability pose linear-delta.ini --study study.toml --columns 9 --speeds 6000 12000 --rpm 7000 \
                 --plots drawn --csv map.csv --format json";
    let found = json(&bench.answer(words, ""));
    assert_eq!(found["modes"].as_array().unwrap().len(), 3);
    let floor = float(&found["floor"]["depth_mm"]);
    let worst = float(&found["worst"]["stable_to_mm"]);
    assert!(worst > 0.3 * floor && float(&found["best"]["stable_to_mm"]) >= worst);
    let semi = float(&found["at"][0]["semi_discretisation"]);
    // Semi-discretization with 60 steps and more.
    assert!((semi - 1.0).abs() < 0.01, "{semi}");
    assert!(found["map"].as_array().unwrap().len() >= 9);
    assert_eq!(fs::read_dir(bench.0.path().join("drawn")).unwrap().count(), 3);
    let table = fs::read_to_string(bench.0.path().join("map.csv")).unwrap();
    assert!(table.starts_with("rpm,zero_order_mm,unstable_from_mm") && table.lines().count() > 9);
    let deep = "stability pose linear-delta.ini --study study.toml --columns 3 --speeds 7000 7100 --rpm 7000";
    assert_output(
        &bench.answer(&format!("{deep} --depth 50"), ""),
        1,
        &["at --depth the largest multiplier"],
    );
    assert_output(&bench.answer(&format!("{deep} --depth 0.001"), ""), 0, &["zero order", "best"]);
}

#[test]
fn a_map_is_drawn_within_the_limits() {
    let bench = Bench::new().with("study.toml", DELTA);
    let words =
        "stability map linear-delta.ini --study study.toml --grid 7 --csv map.csv --plots drawn";
    assert_output(&bench.answer(words, ""), 0, &["limit depth by zero order", "least", "poses in"]);
    let table = fs::read_to_string(bench.0.path().join("map.csv")).unwrap();
    assert!(table.lines().count() > 10, "{table}");
    assert!(bench.0.path().join("drawn/limit-depth-xy.svg").is_file());
}

#[test]
fn where_every_depth_is_stable_is_reported_and_drawn() {
    let bench = Bench::new().with("study.toml", DELTA);
    let read = |name: &str| fs::read_to_string(bench.0.path().join(name)).unwrap();
    // So fast that no lobe is left.
    let words = "stability map linear-delta.ini --study study.toml --grid 3 --rpm 1e6 --plots fast";
    let answer = bench.answer(words, "");
    assert_output(&answer, 0, &["  every depth is stable at "]);
    assert!(!answer.contains("inf ") && !answer.contains("least  "), "{answer}");
    assert!(read("fast/limit-depth-xy.svg").contains("every depth"));
    let pose = "stability pose linear-delta.ini --study study.toml --columns 3";
    let found = bench.answer(&format!("{pose} --speeds 1e6 2e6 --plots fast --format json"), "");
    assert_eq!(json(&found)["without_unstable_rpm"], serde_json::json!([[1e6, 2e6]]));
    assert!(read("fast/lobes.svg").contains("Zero order: every depth is stable at these spindle"));
    let map = read("fast/stable-depths.svg");
    assert!(map.contains("At these spindle speeds every depth up to "), "{map}");
    assert!(map.contains("zero order: every depth is stable"), "{map}");
    // Lobes far above the plot.
    let words = format!("{pose} --speeds 7000 7100 --deepest 0.01 --plots low");
    let reported =
        "every depth up to 0.010 mm is stable at the sampled speeds 7000.0 to 7100.0 1/min";
    assert_output(&bench.answer(&words, ""), 0, &[reported]);
    assert!(read("low/lobes.svg").contains("Zero order: every depth up to 0.01 mm is stable"));
    assert!(read("low/stable-depths.svg").contains("zero order: above the plot"));
    // Lobes in the plot, and no bar.
    bench.answer(&format!("{pose} --speeds 7000 7100 --plots high"), "");
    let lobes = read("high/lobes.svg");
    assert!(lobes.contains("lobes") && !lobes.contains("every depth"), "{lobes}");
}

#[test]
fn a_program_is_judged_at_its_spindle_speeds() {
    let study = format!("{DELTA}depth_mm = 0.01\n");
    let cut = "G21 G90 G64\nS9000 M3\nG0 Z20\nG1 X10 F600\nS6000\nG1 Y20\nG1 Z15\nM2\n";
    let bench = Bench::new().with("study.toml", &study).with("cut.ngc", cut);
    let words = "stability program linear-delta.ini cut.ngc --study study.toml --speeds 6000 12000 \
                 --deepest 3 --csv depths.csv --plots drawn --format json";
    let found = json(&bench.answer(words, ""));
    assert_eq!((&found["places"], &found["feed_moves"]), (&3.into(), &3.into()));
    let table = fs::read_to_string(bench.0.path().join("depths.csv")).unwrap();
    let speeds: Vec<&str> =
        table.lines().skip(1).map(|line| line.split(',').nth(7).unwrap()).collect();
    assert_eq!(speeds, ["9000", "6000", "6000"]);
    let depths: Vec<f64> = table
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(8).unwrap().parse().unwrap())
        .collect();
    let least = depths.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(float(&found["worst"]["stable_to_mm"]), least);
    close(float(&found["margin"]), least / 0.01, 1e-12);
    assert!(float(&found["best_stable_to_mm"]) >= least);
    // A move that was not tested may be the one with chatter.
    let few =
        "stability program linear-delta.ini cut.ngc --study study.toml --deepest 3 --places 2";
    assert_output(
        &bench.answer(few, ""),
        2,
        &["stable everywhere", "1 feed moves; use --places 3"],
    );
    // Deeper than the limit at some line.
    let bench = bench.with("study.toml", &format!("{DELTA}depth_mm = 2.5\n"));
    let answer = bench
        .answer("stability program linear-delta.ini cut.ngc --study study.toml --deepest 3", "");
    assert_output(&answer, 1, &["at line", "unstable, margin", "best speed"]);
}

#[test]
fn what_cannot_be_judged_is_refused_with_its_key_and_nothing_is_written() {
    let links = two_links();
    let changed = |from: &str, to: &str| {
        assert!(links.contains(from), "{from}");
        links.replacen(from, to, 1)
    };
    let delta = |from: &str, to: &str| {
        assert!(DELTA.contains(from), "{from}");
        DELTA.replacen(from, to, 1)
    };
    let turning = |key: &str| {
        let legs = DELTA.split("[cutting]").next().unwrap();
        format!("{legs}[turning]\n{key}\nthicker = [0, -1, 0]\nforce = [0, 1, 0]\n")
    };
    let shaft = |from: &str, to: &str| {
        let text = example("spindle.toml");
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    };
    let spindle = "stability spindle --study study.toml";
    let lag = "stability lag --study study.toml --plots drawn --csv out.csv";
    let pose = "stability pose linear-delta.ini --study study.toml --plots drawn --csv out.csv";
    let program = "stability program linear-delta.ini cut.ngc --study study.toml --plots drawn";
    for (command, text, words) in [
        (lag, changed("mass_kg = 2270", "mass_kg = -2270"), &["-2270", "mass_kg"][..]),
        (lag, changed("mass_kg = 2270\n", ""), &["missing field `mass_kg`"]),
        (lag, changed("mass_kg = 2270", "mass = 2270"), &["unknown field `mass`", "mass_kg"]),
        (lag, changed("damping_n_s_per_mm = 13.96\n", ""), &["missing field `damping_n_s_per_mm`"]),
        (lag, changed("damping_n_s_per_mm = 13.96", "damping_n_s_per_mm = 0"), &["more than 0"]),
        (lag, changed("stiffness_n_per_um = 93", "stiffness_n_per_um = nan"), &["more than 0"]),
        (lag, changed("time_constant_ms = 3.0", "time_constant_ms = -3"), &["expected 0 or more"]),
        (lag, changed("time_constant_ms = 3.0", "lag_s = 0.003"), &["unknown field `lag_s`"]),
        (lag, changed("angle_deg = 60", "angle_deg = 200"), &["200", "0 to 180 degrees"]),
        (lag, changed("[lag]\ntime_constant_ms = 3.0\n", ""), &["time_constant_ms in [lag]"]),
        (lag, "[lag]\ntime_constant_ms = 3\n".into(), &["[[links]]", "[spindle]"]),
        ("stability lag --study study.toml --overhang 0", links.clone(), &["number above 0"]),
        (
            "stability lag --study study.toml --overhang 300",
            links.split("[overhang]").next().unwrap().into(),
            &["--overhang needs [overhang]"],
        ),
        ("stability spindle --study study.toml", links.clone(), &["no [spindle]"]),
        (
            lag,
            example("paper-002.toml").replace("0.27855\n", "278.55\n"),
            &["time_constant_ms = 278.55: expected at most 1.916", "is it in us?"],
        ),
        (lag, MEASURED.into(), &["frf.csv: No such file"]),
        (
            lag,
            MEASURED.replace("frf.csv", "cut.ngc"),
            &["cut.ngc: line 1: found the columns", "hz,re_um_per_n"],
        ),
        (lag, MEASURED.replace("file", "path"), &["unknown field `path`", "file"]),
        (spindle, shaft("bore_mm = 35", "bore_mm = 70"), &["bore_mm = 70", "diameter of 60 mm"]),
        (
            spindle,
            example("spindle-joints.toml").replace("at_mm = 352", "at_mm = 500"),
            &["[[spindle.joints]] at_mm = 500", "length of the shaft, 386 mm"],
        ),
        (pose, delta("kt_n_per_mm2 = 600", "kt_n_per_mm2 = 0"), &["0: expected more than 0"]),
        (pose, delta("kt_n_per_mm2 = 600\n", ""), &["missing field `kt_n_per_mm2`"]),
        (pose, delta("kt_n_per_mm2 = 600", "kt = 600"), &["unknown field `kt`", "kt_n_per_mm2"]),
        (pose, delta("kr_n_per_mm2 = 200", "kr_n_per_mm2 = -1"), &["-1: expected 0 or more"]),
        (pose, delta("teeth = 2", "teeth = 0"), &["teeth = 0"]),
        (pose, delta("exit_deg = 180", "exit_deg = 190"), &["190", "0 to 180 degrees"]),
        (pose, delta("exit_deg = 180", "exit_deg = 0"), &["entry_deg = 0, exit_deg = 0"]),
        (pose, delta("mass_kg = 2", "mass_kg = -2"), &["-2", "more than 0"]),
        (pose, delta("damping_ratio = 0.03\n", ""), &["damping"]),
        (pose, delta("damping_ratio = 0.03", "damping_ratio = -0.03"), &["-0.03", "more than 0"]),
        (pose, delta("entry_deg = 0", "entry_deg = -10"), &["-10", "0 to 180 degrees"]),
        (
            pose,
            delta("[legs]", "inertia_kg_m2 = [[1, 0, 0], [0, 1, 0], [0, 0, 3]]\n[legs]"),
            &["inertia_kg_m2", "not a physical inertia"],
        ),
        (pose, turning("kf_n_per_mm2 = 0"), &["0: expected more than 0"]),
        (pose, turning("kf = 1000"), &["unknown field `kf`", "kf_n_per_mm2"]),
        (spindle, shaft("diameter_mm = 60", "diameter_mm = -60"), &["-60", "more than 0"]),
        (spindle, shaft("damping_ratio = 0.02", "damping_ratio = -1"), &["-1"]),
        (spindle, shaft("diameter_mm = 60", "diameter = 60"), &["unknown field `diameter`"]),
        (pose, DELTA.split("[cutting]").next().unwrap().into(), &["[cutting]", "[turning]"]),
        (
            "stability pose linear-delta.ini --study study.toml --feed 0 0 1",
            DELTA.into(),
            &["along the spindle axis"],
        ),
        (
            "stability pose linear-delta.ini --study study.toml --speeds 5000 3000",
            DELTA.into(),
            &["the lower speed first"],
        ),
        (
            "stability pose linear-delta.ini --study study.toml --rpm 1 --plots drawn",
            DELTA.into(),
            &["1 1/min: the fastest mode", "expected at least"],
        ),
        (
            "stability pose linear-delta.ini --study study.toml --deepest 1e30",
            DELTA.into(),
            &["--deepest", "at most 1000 mm"],
        ),
        (
            "stability map linear-delta.ini --study study.toml --rpm 1",
            DELTA.into(),
            &["the fastest mode"],
        ),
        (
            "stability pose linear-delta.ini --study study.toml --pose 900 0 0 0 0 0",
            DELTA.into(),
            &["X900"],
        ),
        (program, DELTA.into(), &["cut.ngc: line 2: the tool cuts without a spindle speed"]),
    ] {
        let bench = Bench::new()
            .with("study.toml", &text)
            .with("cut.ngc", "G21 G90\nG1 X10 F600 (S100)\nM2\n");
        let files = bench.files();
        let answer = bench.answer(command, "");
        assert_output(&answer, 2, words);
        assert_eq!(bench.files(), files, "{command} {text}");
    }
}

#[test]
fn a_cut_whose_spindle_speed_is_not_known_is_refused_with_its_line_and_nothing_is_written() {
    let study = format!("{DELTA}depth_mm = 0.01\n");
    let stop = ("stop.ngc", "o<stop> sub\nM5\no<stop> endsub\nM2\n");
    for (program, words) in [
        ("G1 X1 F60\nS9 M3\nM2\n", "line 1: the tool cuts without a spindle speed"),
        ("S0 M3\nG1 X1 F60\nM2\n", "line 2: the tool cuts without a spindle speed"),
        ("S9000\nG1 X1 F60\nM2\n", "line 2: the tool cuts with the spindle stopped"),
        ("S9000 M3\nG1 X1 F60\nM5\nG1 X2\nM2\n", "line 4: the tool cuts with the spindle stopped"),
        ("S9000 M3\nG1 X1 F60\nG1 X2 M5\nM2\n", "line 3: the tool cuts with the spindle stopped"),
        (
            "S9000 M3\nG1 X1 F60\nM19 R0\nG1 X2\nM2\n",
            "line 4: the tool cuts with the spindle stopped",
        ),
        (
            "S9000 M3\nG1 X1 F60\no<stop> call\nG1 X2\nM2\n",
            "line 4: the tool cuts with the spindle",
        ),
        ("S9000 M3\nG96 D9000 S200\nG1 X1 F60\nM2\n", "line 3: with G96 the spindle speed depends"),
        ("G0 X1\nS9 M3\nM2\n", "no feed moves"),
    ] {
        let bench = Bench::new().with("study.toml", &study).with("part.ngc", program);
        let (head, bench) = ("[RS274NGC]\n", bench.with(stop.0, stop.1));
        let place = bench.0.path().display().to_string();
        let bench = bench.spoilt(head, &format!("{head}SUBROUTINE_PATH = {place}\n"));
        let files = bench.files();
        for command in [
            "stability program linear-delta.ini part.ngc --study study.toml --places 1 --csv out.csv --plots drawn",
            "cut linear-delta.ini part.ngc --study study.toml --report page.html",
        ] {
            let answer = bench.answer(command, "");
            assert_output(&answer, 2, &["part.ngc: ", words]);
            assert_eq!(bench.files(), files, "{command}");
        }
    }
}

/// The workpiece rotates, or moves together with the tool: the feed of the tool is not the cutting feed.
#[test]
fn a_cut_in_which_an_extra_axis_moves_is_refused_with_its_line() {
    let study = format!("{DELTA}depth_mm = 0.01\n");
    let joint = "TYPE = ANGULAR\nMIN_LIMIT = -999\nMAX_LIMIT = 999\nMAX_VELOCITY = 90\n\
                 MAX_ACCELERATION = 900\nHOME_SEQUENCE = 0\n";
    let axes =
        format!("[JOINT_3]\n{joint}[JOINT_4]\n{joint}[AXIS_C]\n{joint}[AXIS_W]\n{joint}[HAL]\n");
    for (program, words) in [
        ("G1 X1 F60\nG1 X2 C90\n", "line 3: an extra axis moves in the cut"),
        ("G1 X1 F60\nG1 C90\n", "line 3: an extra axis moves in the cut"),
        ("G1 X1 F60\nG1 X2 W5\n", "line 3: an extra axis moves in the cut"),
        ("G1 X1 F60\nG1 W5\nG0 X0 C90 W0\nG1 X1\n", "1 positions on 2 feed moves"),
    ] {
        let program = format!("S9000 M3\n{program}M2\n");
        let bench = Bench::new().with("study.toml", &study).with("part.ngc", &program);
        let bench = bench
            .spoilt("coordinates=XYZ", "coordinates=XYZ axes=CW")
            .spoilt("JOINTS = 3", "JOINTS = 5")
            .spoilt("COORDINATES = XYZ\n", "COORDINATES = XYZCW\n")
            .spoilt("[HAL]\n", &axes);
        let answer = bench.answer(
            "stability program linear-delta.ini part.ngc --study study.toml --places 1",
            "",
        );
        assert_output(&answer, 2, &[words]);
    }
}

#[test]
fn a_line_that_cuts_at_several_speeds_is_judged_at_each_and_has_no_single_chip() {
    let study = format!("{DELTA}depth_mm = 0.01\n");
    let program = "G21 G90 G64\nM3\n#1=0\no1 while [#1 lt 3]\n#1=[#1+1]\nS[6000+1000*#1]\nG1 X#1 F600\n\
                   o1 endwhile\nM2\n";
    let bench = Bench::new().with("study.toml", &study).with("part.ngc", program);
    let words = "stability program linear-delta.ini part.ngc --study study.toml --csv out.csv";
    assert_output(&bench.answer(words, ""), 0, &["3 positions on 3 feed moves"]);
    let table = fs::read_to_string(bench.0.path().join("out.csv")).unwrap();
    let speeds: Vec<&str> =
        table.lines().skip(1).map(|line| line.split(',').nth(7).unwrap()).collect();
    assert_eq!(speeds, ["7000", "8000", "9000"]);
    let answer = bench.answer("cut linear-delta.ini part.ngc --study study.toml", "");
    assert_output(&answer, 2, &["line 7: it cuts at several spindle speeds; set one with --rpm"]);
}

#[test]
fn the_examples_of_the_page_are_what_the_commands_answer() {
    let folder = shipped::folder("hexapod");
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/studies/stability.md");
    let page = fs::read_to_string(page).unwrap().replace('\n', " ");
    let mut bench = Bench::new().with("paper.toml", &example("paper-002.toml"));
    for file in ["hexapod.ini", "hexapod.tbl", "cutting.toml"] {
        bench = bench.with(file, &fs::read_to_string(folder.join(file)).unwrap());
    }
    let words = "stability pose hexapod.ini --study cutting.toml --pose -80 60 350 10 -20 0 --feed 1 0 0 \
                 --rpm 6000 --columns 5 --format json";
    let found = json(&bench.answer(words, ""));
    let modes = found["modes"].as_array().unwrap();
    let single = &found["at"][0];
    let says = |text: String| assert!(page.contains(&text), "{text}");
    says(format!("from {:.4} to {:.4} Hz", float(&modes[0]["hz"]), float(&modes[5]["hz"])));
    says(format!(
        "{:.4} mm over all speeds, {:.4} mm at 6,000 rpm",
        float(&found["floor"]["depth_mm"]),
        float(&single["zero_order_mm"])
    ));
    assert_eq!(single["unstable"][0]["loss"], "two tooth periods");
    says(format!("unstable from {:.4} mm on", float(&single["unstable"][0]["from_mm"])));
    let lag = json(
        &bench.answer("stability lag --study paper.toml --overhang 500 300 --format json", ""),
    );
    for one in lag["adjustments"].as_array().unwrap() {
        let [limit, chip] = [&one["limit"], &one["chip"]];
        says(format!(
            "| {} mm | {:.3} N/mm | {:.4} rad/s | {:.4} mm, {:.4} mm |",
            float(&one["overhang_mm"]),
            float(&limit["stiffness_n_per_mm"]),
            float(&limit["omega_rad_per_s"]),
            float(&chip["limit_width_mm"]),
            float(&chip["limit_depth_mm"])
        ));
    }
}
