// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm cut`: forces of the drives, deflection and chip against other ways to them, one pass that loses
//! no peak, and the command as it is used.

use crate::commands::Bench;
use crate::shipped::{config, folder};
use kinematics::{Joints, MAX_JOINTS, Pose, Vector3};
use linuxcnc::row::{Beside, Extra, Flags, Row};
use machine::read::mechanism::Mechanism;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::process::Command;
use studies::cut::moment::{Moment, Subject, cutter_frame};
use studies::cut::pass::Pass;
use studies::cut::program::Line;
use studies::cut::teeth::Teeth;
use studies::dynamics::capacity::Capacity;
use studies::dynamics::model::Model;
use studies::study::file::Study;
use studies::study::sensitivity::Sensitivity;
use studies::study::springs::Springs;
use studies::study::stiffness::Stiffness;

pub const STUDY: &str = "[platform]\nmass_kg = 2\ncentre_mm = [0, 0, 20]\n\
    inertia_kg_m2 = [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]]\n\
    [legs]\nstiffness_n_per_um = 5\ndamping_ratio = 0.05\nmax_force_n = 500\n\
    [cutting]\nteeth = 2\nentry_deg = 0\nexit_deg = 180\ndepth_mm = 0.1\nkt_n_per_mm2 = 700\n\
    kr_n_per_mm2 = 200\nka_n_per_mm2 = 90\n";

/// The fifth line is four times as fast.
pub const PROGRAM: &str = "G21 G90 G64\nS6000 M3\nG0 X-20 Y0 Z50\nG1 X20 F600\nG1 X-20 F2400\nG1 X20 F600\n\
    M5\nM2\n";

const TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 100.0);

/// Rounding of products of matrices of a condition of a thousand.
const ROUNDED: f64 = 1e-9;

fn subject<'a>(config: &'a Mechanism, text: &str) -> Subject<'a> {
    let study = Study::parse(text).unwrap();
    let cutter = study.cutting.unwrap();
    Subject {
        config,
        model: Model::of(config, &study).unwrap(),
        drives: Capacity::of(config, &study).unwrap(),
        teeth: Teeth::of(&cutter, study.milling.as_ref(), cutter.depth_mm.unwrap()),
    }
}

/// A moment of a cut at rest.
fn cut(pose: [f64; 6]) -> Moment {
    let feed = Vector3::new(3.0, 2.0, 0.5);
    Moment { line: 1, poses: [pose; 3], tool: TOOL, speed: 10.0, feed, rpm: Some(6000.0) }
}

#[track_caller]
fn close(found: f64, expected: f64, size: f64) {
    assert!((found - expected).abs() < ROUNDED * size, "{found} {expected}");
}

#[test]
fn six_struts_of_one_slope_share_the_weight() {
    let config = config("hexapod");
    // A thread that takes its own torque turns nothing.
    let text = STUDY.replace("max_force", "screw = \"self-locking\"\nmax_force");
    let subject = subject(&config, &text);
    let pose = [0.0, 0.0, 300.0, 0.0, 0.0, 0.0];
    let judged = subject.judge(&Moment { rpm: None, ..cut(pose) }).unwrap();
    let at = config.machine.at(&Pose::from_degrees(pose), &TOOL).unwrap();
    let slope = at.segments()[0].span().normalize().z;
    // 6 f nz = m g; all struts hang or stand alike.
    for [low, high] in judged.drives {
        close(low, 2.0 * 9.80665 / (6.0 * slope), 1.0);
        assert_eq!(low, high);
    }
    assert_eq!((judged.chip, judged.force, judged.lag.norm()), (None, 0.0, 0.0));
}

#[test]
fn a_drive_bears_what_virtual_work_asks_of_it_at_every_angle_of_the_cutter() {
    let config = config("hexapod");
    let subject = subject(&config, STUDY);
    let place = [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0];
    let moment = cut(place);
    let weight = subject.judge(&Moment { rpm: None, ..moment }).unwrap();
    let judged = subject.judge(&moment).unwrap();
    let pose = Pose::from_degrees(place);
    let gain =
        Sensitivity::at(&config, &pose, &TOOL, config.machine.radius()).unwrap().unwrap().gain;
    let frame = cutter_frame(&moment.feed, &pose);
    // 10 mm/s, two teeth, a hundred turns a second.
    let chip = 0.05;
    close(judged.chip.unwrap(), chip, 1.0);
    for (i, [low, high]) in judged.drives.iter().enumerate() {
        // A small motion dq of one drive moves the tip by gain dq: f dq + F gain dq = 0.
        let work = |force: Vector3<f64>| -> f64 {
            let force = frame * force;
            weight.drives[i][0] - (0..3).map(|k| force[k] * gain[(k, i)]).sum::<f64>()
        };
        let all: Vec<f64> = subject.teeth.forces(chip).map(work).collect();
        close(*low, all.iter().copied().fold(f64::INFINITY, f64::min), 100.0);
        close(*high, all.iter().copied().fold(f64::NEG_INFINITY, f64::max), 100.0);
        assert!(low < high);
    }
}

#[test]
fn the_tool_yields_by_the_compliance_of_the_stiffness_study() {
    for (machine, place) in [
        ("hexapod", [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0]),
        ("linear-delta", [20.0, -30.0, 40.0, 0.0, 0.0, 0.0]),
        ("pyramid", [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    ] {
        let config = config(machine);
        let table = "[table]\nstiffness_n_per_um = 50\nmass_kg = 80\ndamping_ratio = 0.02\n";
        let text = format!("{STUDY}{table}");
        let place = if machine == "pyramid" { config.home } else { place };
        let subject = subject(&config, &text);
        let moment = Moment { tool: config.spindle, ..cut(place) };
        let judged = subject.judge(&moment).unwrap();
        let springs = Springs::of(&config, &Study::parse(&text).unwrap()).unwrap();
        let pose = Pose::from_degrees(place);
        let found = Stiffness::at(&config, &pose, &config.spindle, &springs).unwrap().unwrap();
        let force = cutter_frame(&moment.feed, &pose) * subject.teeth.mean(judged.chip.unwrap());
        let compliance = found.compliance.fixed_view::<3, 3>(0, 0).into_owned();
        let expected = compliance * force;
        assert!(expected.norm() > 1e-6, "{machine} {expected}");
        let off = (judged.deflection - expected).norm();
        assert!(off < ROUNDED * expected.norm(), "{machine} {} {expected}", judged.deflection);
    }
}

#[test]
fn inertia_moves_the_tool_as_the_force_that_speeds_it_up() {
    let config = config("linear-delta");
    let subject = subject(&config, STUDY);
    // The platform turns nowhere: its inertia is a force -m a on any of its points.
    let (period, acceleration) = (config.period, 3000.0);
    let step = acceleration * period * period / 2.0;
    let pose = |x: f64| [x, 0.0, 50.0, 0.0, 0.0, 0.0];
    let poses = [pose(step), pose(0.0), pose(step)];
    let judged = subject.judge(&Moment { poses, tool: config.spindle, ..cut(pose(0.0)) }).unwrap();
    let springs = Springs::of(&config, &Study::parse(STUDY).unwrap()).unwrap();
    let pose = Pose::from_degrees(pose(0.0));
    let found = Stiffness::at(&config, &pose, &config.spindle, &springs).unwrap().unwrap();
    let compliance = found.compliance.fixed_view::<3, 3>(0, 0).into_owned();
    // 2 kg are 0.002 t.
    let expected = compliance * Vector3::new(-0.002 * acceleration, 0.0, 0.0);
    let off = (judged.lag - expected).norm();
    // The second difference of places of 50 mm that differ by a nanometre and more.
    assert!(off < 1e-6 * expected.norm(), "{} {expected}", judged.lag);
}

#[test]
fn the_harmonics_of_the_teeth_add_up_to_their_force() {
    let cutting = Study::parse(STUDY).unwrap().cutting.unwrap();
    let teeth = Teeth::of(&cutting, None, 0.1);
    let chip = 0.05;
    let mean = teeth.mean(chip);
    // A slot with two teeth has no steps: its force is one of the first two harmonics but for that along
    // the axis, a half sine whose third harmonic is 2 %.
    let parts: Vec<_> = (1..=20).map(|k| teeth.harmonic(chip, k)).collect();
    let largest = teeth.forces(chip).map(|force| (force - mean).norm()).fold(0.0, f64::max);
    let found = Teeth::swing(&parts);
    assert!((found / largest - 1.0).abs() < 1e-2, "{found} {largest}");
    // In the plane of a slot Ft = K h is a sine of twice the angle: h sin, h cos over half a turn.
    let [kt, kr] = [700.0, 200.0].map(|k: f64| k * 0.1 * chip / 2.0);
    let amplitude = parts[0].map(|part| part.re.hypot(part.im));
    for k in [0, 1] {
        close(amplitude[k], kt.hypot(kr), 1.0);
    }
}

fn row(cycle: u64, x: f64) -> Row {
    let joints: Joints = [0.0; MAX_JOINTS];
    Row {
        cycle,
        file: 0,
        number: 0,
        line: 7,
        flags: Flags { on: true, tool_busy: false, held: false },
        pose: [x, 0.0, 50.0, 0.0, 0.0, 0.0],
        joints,
        errors: joints,
        allowed: joints,
        extra: Extra::default(),
        second: Beside::default(),
        tool: [0.0; 3],
        feed: 1.0,
    }
}

#[test]
fn a_peak_of_one_cycle_is_not_lost_in_one_pass() {
    let config = config("linear-delta");
    let subject = subject(&config, STUDY);
    let lines = BTreeMap::from([(7, Line { feed: 1000.0, rpm: 6000.0 })]);
    // 10 mm/s, and once 1 um beside it: an acceleration of 2 m/s² in one cycle.
    let x = |k: u64| 0.01 * k as f64 * config.period / 1e-3 + if k == 777 { 1e-3 } else { 0.0 };
    let found = |bump: u64| {
        let mut pass = Pass::new(&subject, &lines);
        for k in 0..2000 {
            let shift = if k == 777 { bump as f64 * 1e-3 - 1e-3 } else { 0.0 };
            pass.see(&row(k, x(k) + shift)).unwrap();
        }
        pass.finish().unwrap()
    };
    let (calm, jerky) = (found(0), found(1));
    assert!(calm.peaks[3].as_ref().unwrap().value < 1e-9);
    let peak = jerky.peaks[3].as_ref().unwrap();
    assert!(peak.value > 1e-4 && peak.judged.line == 7, "{}", peak.value);
    assert!((peak.judged.pose[0] - x(777)).abs() < 1e-12);
    // Every cycle counts as time, and one of ten is judged.
    assert_eq!((jerky.lines[&7].cycles, jerky.cutting), (1998, 1998));
    assert_eq!(jerky.judged, 200);
}

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
    // 40 mm at 10, 40 and 10 mm/s, and what speeding up takes.
    let cutting = float(&found["cutting_seconds"]);
    assert!((9.0..9.5).contains(&cutting), "{cutting}");
    assert!(float(&found["seconds"]) > cutting);
    let page = fs::read_to_string(bench.0.path().join("page.html")).unwrap();
    assert!(page.contains("The machine can cut the program") && page.matches("<svg ").count() == 3);
    let text = bench.answer(WORDS, "");
    for word in ["chip load     0.2000 mm, line 5", "not known:", "Where the tool is in the work"] {
        assert!(text.contains(word), "{word}: {text}");
    }
}

#[test]
fn a_drive_beyond_its_force_and_an_unstable_cut_are_refused_by_exit_code() {
    let weak = STUDY.replace("max_force_n = 500", "max_force_n = [500, 500, 3]");
    let answer = bench(&weak, PROGRAM).answer(WORDS, "");
    assert!(answer.ends_with("exit 1\n") && answer.contains("carriage 2 has to do"), "{answer}");
    let deep = STUDY.replace("depth_mm = 0.1", "depth_mm = 20");
    let answer = bench(&deep.replace("= 500", "= 1e6"), PROGRAM).answer(WORDS, "");
    assert!(answer.ends_with("exit 1\n") && answer.contains("a cut chatters beyond"), "{answer}");
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
    // Half a step is 0.5 um, of the height too where all carriages go together.
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
        (STUDY, "--places 2", "1 feed moves: --places 3 looks at all"),
        (&no_limits, "", "What some drives can do"),
    ] {
        let answer = bench(study, PROGRAM).answer(&format!("{WORDS} {option}"), "");
        assert!(answer.ends_with("exit 2\n") && answer.contains(word), "{word}: {answer}");
        assert!(answer.contains("not everything was looked at"), "{answer}");
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
            "part.ngc: line 4: the tool cuts without a spindle speed (an S word names one)",
        ),
        (STUDY.into(), &swapped, "line 4: the tool cuts without a spindle speed"),
        (STUDY.into(), rapid, "part.ngc: the program has no feed moves"),
        (with("mass_kg = 2", "mass_kg = -2"), PROGRAM, "mass_kg = -2"),
        (with("[0, 0, 0.01]]", "[0, 0, 0.5]]"), PROGRAM, "no body has it"),
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
        (without("depth_mm"), PROGRAM, "study.toml: the study names no depth_mm of [cutting]"),
        (without("kt_n_per_mm2"), PROGRAM, "missing field `kt_n_per_mm2`"),
        (without("mass_kg"), PROGRAM, "missing field `mass_kg`"),
        (without("damping_ratio"), PROGRAM, "the study names no damping_n_s_per_mm of [legs]"),
        (
            STUDY.split("[cutting]").next().unwrap().into(),
            PROGRAM,
            "the study names no teeth of [cutting]",
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
    let page = fs::read_to_string(folder("../docs/cut.md")).unwrap();
    for line in
        answer.lines().skip(1).take(6).chain(answer.lines().filter(|l| l.contains("strut 5 ")))
    {
        assert!(page.contains(line.trim_end()), "{line}");
    }
}
