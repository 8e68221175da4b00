// SPDX-License-Identifier: GPL-2.0-or-later
//! `--format json` of every subcommand, compared with docs/reference/json.md.

use crate::command_line::subcommands;
use crate::commands::Bench;
use crate::{calibrate_command, cut, stability};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use test_support::CUT;
use test_support::shipped::configs;

/// A subcommand with its words; standard input; its exit code.
type Case = (&'static str, &'static str, &'static str, u8);

const ROWS: &str = "x,y,z,a,b,c\n10,-20,50,0,0,0\n900,0,90,0,0,0\n";
const FAR: &str = "G1 X0 Y200 Z60 F3000\nM52 P0\nM2\n";
const LAW: &str = "[law]\nperiod_s = 1\nradius_mm = 5\ngrowth_mm = 0\nrise_mm = 0\nbend_mm = 0\n\
    amplitude_deg = [0, 0, 0]\n";
const LINE: &str = "[curve]\nx_mm = \"10*t\"\ny_mm = \"5*t*(1-t)\"\nt = [0, 1]\n[laws]\nz_mm = 0\n\
    speed_mm_per_s = 10\n[tolerance]\nchord_mm = 0.01\nangle_deg = 0.1\n[program]\n\
    zero_mm = [0, 0, 60]\nclear_z_mm = 10\n";
const HOLES: &str = "[tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [0, 0, 60]\nclear_z_mm = 10\n\
    [[operation]]\nkind = \"drill\"\npoints = \"down\"\nat_mm = [2, 1, 0]\n\
    depth_mm = 2\nclear_mm = 3\nfeed_mm_per_min = 300\n";
const LAWS: &str =
    "[carriages]\nt_s = [0, 1]\nlaws_mm_or_deg = [\"260 + t\", \"260 + t\", \"260 + t\"]\n";

/// Every subcommand, several times if necessary: each field must occur in one of the outputs.
const CASES: &[Case] = &[
    (
        "new",
        "linear-delta --base-radius 130 --platform-radius 30 --rod 240 --carriage 0 400 made",
        "",
        0,
    ),
    (
        "new",
        "five-bar --axis-distance 200 --arm 200 --rod 300 --angle -30 120 --boxes no plane",
        "",
        0,
    ),
    ("workspace", "plane/plane.ini --bands 12 --grid 20", "", 0),
    ("migrate", "OLDER --out migrated", "", 0),
    ("check", "linear-delta.ini", "", 0),
    ("check", "lean.ini", "", 1),
    ("check", "PAIR", "", 0),
    ("check", "lean.ini --fix", "", 0),
    ("homing", "linear-delta.ini", "", 0),
    ("homing", "low.ini", "", 1),
    ("preflight", "linear-delta.ini far.ngc bad.ngc", "", 2),
    ("preflight", "linear-delta.ini line.ngc", "", 0),
    ("filter", "line.ngc --machine linear-delta.ini", "", 0),
    ("filter", "far.ngc --machine linear-delta.ini", "", 1),
    ("joints", "linear-delta.ini --pose 10 -20 50 0 0 0", "", 0),
    ("joints", "linear-delta.ini", ROWS, 1),
    ("pose", "linear-delta.ini --joints 260 260 260", "", 0),
    ("run", "linear-delta.ini line.ngc --trace trace.csv", "", 0),
    ("run", "linear-delta.ini far.ngc", "", 1),
    ("replay", "linear-delta.ini line.ngc --period 0.05", "", 0),
    ("path", "linear-delta.ini line.toml -o line-made.ngc", "", 0),
    ("path", "linear-delta.ini holes.toml", "", 0),
    ("path", "linear-delta.ini laws.toml", "", 0),
    ("scene", "linear-delta.ini", "", 0),
    ("export", "linear-delta.ini --mjcf model", "", 0),
    ("view", "linear-delta.ini line.ngc", "", 0),
    ("panel", "linear-delta.ini --output-dir panel", "", 0),
    ("travel", "linear-delta.ini --pose X10", "", 0),
    ("rods", "linear-delta.ini line.ngc", "", 0),
    (
        "sensitivity",
        "linear-delta.ini --study law.toml --draws 100 --rays 300 --law --ratios 0.5",
        "",
        0,
    ),
    ("stiffness", "linear-delta.ini --study study.toml", "", 0),
    (
        "stability pose",
        "linear-delta.ini --study stable.toml --columns 3 --speeds 7000 7100 --rpm 7000 --depth 0.001",
        "",
        0,
    ),
    ("stability map", "linear-delta.ini --study stable.toml --grid 3", "", 0),
    ("stability program", "linear-delta.ini part.ngc --study study.toml --deepest 2", "", 0),
    ("stability lag", "--study PAPER --overhang 300", "", 0),
    ("stability spindle", "--study SPINDLE", "", 0),
    ("dynamics", "linear-delta.ini --study noise.toml --shake noise", "", 0),
    ("cut", "linear-delta.ini part.ngc --study study.toml", "", 0),
    ("workspace", "linear-delta.ini --bands 8 --grid 8", "", 0),
    ("workspace", "PAIR --bands 8 --grid 8", "", 0),
    ("boxes", "linear-delta.ini", "", 0),
    ("random", "linear-delta.ini --seconds 5", "", 0),
    ("frames", "linear-delta.ini", "", 0),
    ("measure", "HEXAPOD DIAL -o dial", "", 0),
    ("measure", "HEXAPOD PROBE -o probe", "", 0),
    ("calibrate", "HEXAPOD log --plate PLATE", "", 0),
    ("man", "pages", "", 0),
    ("completions", "bash", "", 0),
];

fn bench() -> Bench {
    let bench = Bench::new()
        .with("line.ngc", "G21 G90\nG1 X10 F6000\n(MSG,half)\nG1 X0\nM2\n")
        .with("far.ngc", FAR)
        .with("bad.ngc", "G1 G2 X3\nM2\n")
        .with("line.toml", LINE)
        .with("holes.toml", HOLES)
        .with("laws.toml", LAWS)
        .with("law.toml", LAW)
        .with("stable.toml", stability::DELTA)
        .with("study.toml", CUT)
        .with("part.ngc", cut::PROGRAM)
        .with(
            "noise.toml",
            &format!("{}[force]\nsigma_n = [3, 3, 1]\ncorner_hz = 150\nseconds = 0.2\n", CUT),
        )
        .with("log", &calibrate_command::log());
    let file = std::fs::read_to_string(bench.0.path().join("linear-delta.ini")).unwrap();
    let low = file.replacen("HOME_SEQUENCE = -1", "HOME_SEQUENCE = 0", 1).replacen(
        "HOME_OFFSET = 370",
        "HOME_OFFSET = 150",
        1,
    );
    bench
        .with("low.ini", &low)
        .with("lean.ini", &file.replacen("HOME = 0 0 90", "HOME = 0 0 80", 1))
}

/// Returns the value on standard output; standard error follows it.
fn json(answer: &str) -> Value {
    let mut values = serde_json::Deserializer::from_str(answer).into_iter::<Value>();
    values
        .next()
        .unwrap_or_else(|| panic!("{answer}"))
        .unwrap_or_else(|error| panic!("{error}: {answer}"))
}

/// Adds the paths of all values below a value: `a.b`, and `a[].b` in a list. True for those with nothing below.
fn places(value: &Value, at: &str, found: &mut BTreeMap<String, bool>) {
    let mut see = |place: String, value: &Value| {
        let is_end = !matches!(value, Value::Object(_) | Value::Array(_));
        found.entry(place.clone()).and_modify(|end| *end &= is_end).or_insert(is_end);
        places(value, &place, found);
    };
    match value {
        Value::Object(map) => map.iter().for_each(|(name, value)| {
            see(if at.is_empty() { name.clone() } else { format!("{at}.{name}") }, value);
        }),
        // Rows of numbers count as a single value.
        Value::Array(list) => list
            .iter()
            .filter(|value| value.is_object())
            .for_each(|value| places(value, &format!("{at}[]"), found)),
        _ => {}
    }
}

/// Returns the sections of the page by their subcommand, each with the paths that its table documents.
fn documented() -> BTreeMap<String, BTreeSet<String>> {
    let page = include_str!("../../docs/reference/json.md");
    let mut sections: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut name = String::new();
    for line in page.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            name = heading.strip_prefix("pkm ").unwrap_or(heading).into();
        } else if let Some(row) = line.strip_prefix("| `") {
            let cell = row.split(" | ").next().unwrap();
            let own = sections.entry(name.clone()).or_default();
            own.extend(
                cell.split('`')
                    .filter(|word| !word.trim_matches([',', ' ', '|']).is_empty())
                    .map(String::from),
            );
        }
    }
    sections
}

fn words(text: &str) -> String {
    let folder = configs().join("..").canonicalize().unwrap();
    let file = |name: &str| folder.join(name).display().to_string();
    text.replace("HEXAPOD", &file("configs/hexapod/hexapod.ini"))
        .replace("PAIR", &file("configs/lathe-mirrored/lathe-mirrored.ini"))
        .replace("OLDER", &file("tests/cases/older/rotary-delta/picker.ini"))
        .replace("PAPER", &file("docs/studies/examples/paper-002.toml"))
        .replace("SPINDLE", &file("docs/studies/examples/spindle.toml"))
        .replace("PLATE", &file("configs/hexapod/calibration/plate.toml"))
        .replace("DIAL", &file("configs/hexapod/calibration/dial.toml"))
        .replace("PROBE", &file("configs/hexapod/calibration/probe.toml"))
}

/// Returns all paths in the outputs of a subcommand.
fn reported() -> BTreeMap<String, BTreeMap<String, bool>> {
    let (bench, mut wrong) = (bench(), vec![]);
    let mut all: BTreeMap<String, BTreeMap<String, bool>> = BTreeMap::new();
    for (command, arguments, input, code) in CASES {
        let answer = bench.answer(&format!("{command} {} --format json", words(arguments)), input);
        if !answer.ends_with(&format!("exit {code}\n")) {
            wrong.push(format!("{command} {arguments}: {answer}"));
        }
        let value = json(&answer);
        let objects = value.as_array().cloned().unwrap_or_else(|| vec![value]);
        for object in objects {
            assert_eq!(object["version"], 1, "{command}: {object}");
            let own = object["command"].as_str().unwrap();
            assert!(own.starts_with(command), "{command}: {own}");
            assert!(object.get("fits").is_some(), "{command}: {object}");
            places(&object, "", all.entry((*command).into()).or_default());
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    all
}

#[test]
fn every_subcommand_answers_in_json_as_the_page_says() {
    let (message, documented) = (reported(), documented());
    if let Ok(file) = std::env::var("PRINT_JSON") {
        let mut text = String::new();
        for (command, places) in &message {
            text += &format!("## pkm {command}\n\n");
            places.keys().for_each(|place| text += &format!("| `{place}` | |\n"));
        }
        std::fs::write(file, text).unwrap();
    }
    let common = &documented["Fields of all"];
    for (command, places) in &message {
        let own = documented.get(command).unwrap_or_else(|| panic!("no section of pkm {command}"));
        let known = |place: &str| {
            let below =
                |name: &String| name.strip_suffix(".*").is_some_and(|name| place.starts_with(name));
            common.contains(place) || own.contains(place) || own.iter().any(below)
        };
        for (place, is_end) in places {
            assert!(!is_end || known(place), "pkm {command}: {place} is not documented");
        }
        for place in own.iter().filter(|place| !place.ends_with(".*")) {
            assert!(
                places.contains_key(place),
                "pkm {command}: {place} is documented and never written"
            );
        }
    }
}

#[test]
fn no_subcommand_is_forgotten() {
    let bench = Bench::new();
    let of = |words: &str| subcommands(&bench.answer(words, ""));
    let mut all: Vec<String> =
        of("--help").into_iter().filter(|name| name != "stability").collect();
    all.extend(of("stability --help").iter().map(|name| format!("stability {name}")));
    assert!(all.len() > 25, "{all:?}");
    for name in all {
        assert!(CASES.iter().any(|(command, ..)| *command == name), "{name}");
    }
}

#[test]
fn what_cannot_be_judged_is_one_object_as_well() {
    let bench = Bench::new().with("mill.ini", "[KINS]\nKINEMATICS = trivkins\nJOINTS = 3\n");
    for words in [
        "check mill.ini",
        "rods none.ini",
        "replay linear-delta.ini none.ngc",
        "joints linear-delta.ini --pose 1 2",
    ] {
        let answer = bench.answer(&format!("{words} --format json"), "");
        let value = json(&answer);
        assert_eq!((&value["fits"], &value["version"]), (&Value::Null, &1.into()), "{answer}");
        let message = value["errors"][0].as_str().unwrap();
        assert!(answer.matches(message.lines().next().unwrap()).count() >= 2, "{answer}");
        assert!(answer.ends_with("exit 2\n"), "{answer}");
    }
}
