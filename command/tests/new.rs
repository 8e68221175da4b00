// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm new`: machines of every kind fit together and run their first program in LinuxCNC in
//! virtual time, and impossible machines are refused with no files remaining.

use crate::commands::Bench;
use kinematics::{Letter, Pose, Vector3};
use machine::proof::reach::Reach;
use machine::read::mechanism::Mechanism;
use new::kinds::KINDS;
use new::panel::Panel;
use new::parameters::{Need, Parameter};
use new::table::columns;
use new::values::{MM_PER_INCH, default};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use snapbox::{assert_data_eq, str};
use std::fs;
use std::path::{Path, PathBuf};
use test_support::constrained::golden;

const FIVE_STRUTS: &str = "\
# Five struts that leave the turn about the tool free.
leg,base_x,base_y,base_z,platform_x,platform_y,platform_z
0,400,0,0,120,60,0
1,120,380,0,-20,130,0
2,-330,240,0,-120,50,0
3,-330,-230,0,-110,-70,0
4,130,-390,0,60,-130,0
";

fn file(bench: &Bench, name: &str) -> PathBuf {
    bench.0.path().join(name)
}

/// Checks the properties of a new machine.
fn assert_made(bench: &Bench, name: &str, words: &str) -> Mechanism {
    let reported = bench.answer(&format!("new {words} --out {name}"), "");
    assert!(reported.ends_with("exit 0\n"), "{words}: {reported}");
    let ini = format!("{name}/{name}.ini");
    let config = test_support::shipped::first_of(&file(bench, &ini));
    assert_homes(&config, words);
    let panel = Panel::new(&config.clone().into(), name);
    for (end, text) in [("xml", panel.widgets), ("tcl", panel.wiring)] {
        let written = fs::read_to_string(file(bench, &format!("{name}/{name}-panel.{end}")));
        assert_eq!(written.unwrap(), text, "{words}");
    }
    for written in [ini.clone(), format!("{name}/{name}.tbl"), format!("{name}/programs/first.ngc")]
    {
        let text = fs::read_to_string(file(bench, &written)).unwrap();
        // LINELEN of LinuxCNC, for INI files and programs alike.
        assert!(text.lines().all(|line| line.len() < 255), "{words}: {written}");
    }
    let checked = bench.answer(&format!("check {ini}"), "");
    assert!(checked.ends_with("exit 0\n"), "{words}: {checked}");
    assert!(checked.contains("every pose within its axis limits"), "{words}: {checked}");
    let reported = bench.answer(&format!("preflight {ini} {name}/programs/first.ngc"), "");
    assert!(reported.ends_with("\nThe program fits the machine.\nexit 0\n"), "{words}: {reported}");
    assert_holds_everywhere(&config);
    config
}

/// Returns the commands for a machine in docs/guide/getting-started.md, in order.
fn documented(name: &str) -> Vec<String> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide/getting-started.md");
    let page = fs::read_to_string(page).unwrap().replace("\\\n        ", "");
    let parts: Vec<&str> = page.split("\n### ").collect();
    let lines = |part: &str| -> Vec<String> {
        let part = part.split("\n## ").next().unwrap();
        part.lines().filter_map(|line| line.strip_prefix("    ")).map(String::from).collect()
    };
    let own = |lines: &Vec<String>| lines[0].ends_with(&format!(" {name}"));
    parts.into_iter().skip(1).map(lines).find(own).unwrap_or_else(|| panic!("no {name}"))
}

/// Creates a machine with the documented commands in an empty folder, comparing their output; the last
/// one starts LinuxCNC, which live tests do.
fn assert_documented(name: &str) -> Mechanism {
    let (place, commands) = (tempfile::tempdir().unwrap(), documented(name));
    let mut folder = place.path().to_path_buf();
    for command in &commands {
        let (first, words) = command.split_once(' ').unwrap();
        match first {
            "cd" => folder.push(words),
            "linuxcnc" => assert_eq!(words, format!("{name}.ini")),
            _ => {
                assert_eq!(first, "pkm", "{command}");
                let mut pkm = std::process::Command::new(env!("CARGO_BIN_EXE_pkm"));
                let done =
                    pkm.args(words.split_whitespace()).current_dir(&folder).output().unwrap();
                assert!(
                    done.status.success(),
                    "{command}: {}",
                    String::from_utf8_lossy(&done.stderr)
                );
            }
        }
    }
    let verbs = ["new ", "", "check ", "frames ", "view ", "preflight ", &format!("{name}.ini")];
    for (command, verb) in commands.iter().zip(verbs) {
        assert!(command.contains(verb), "{command} where {verb} belongs");
    }
    assert_eq!(commands.len(), verbs.len());
    let made =
        ["frames.svg", &format!("{name}.html"), &format!("{name}.tbl"), "programs/first.ngc"];
    for file in made {
        assert!(folder.join(file).is_file(), "{name}: no {file}");
    }
    let config = test_support::shipped::first_of(&folder.join(format!("{name}.ini")));
    assert_homes(&config, name);
    assert_holds_everywhere(&config);
    config
}

/// Checks that HOME of every joint agrees with the kinematics.
fn assert_homes(config: &Mechanism, words: &str) {
    let joints = config.machine.inverse(&config.home_pose(), &config.spindle).unwrap();
    for (joint, wanted) in config.joints.iter().zip(joints) {
        // The file leaves out the digits of rounding errors, a few units in the last place.
        let error = (joint.home - wanted).abs();
        assert!(error <= 1e-14 * wanted.abs(), "{words}: {} {error}", joint.name);
    }
}

/// Checks that random poses within the axis limits satisfy all limits, and that motions to their neighbors at the
/// tool's
/// largest speed along an axis do not exceed the drives' limits.
fn assert_holds_everywhere(config: &Mechanism) {
    let reach = Reach::new(config).unwrap();
    let mut rng = Pcg64::seed_from_u64(7);
    let moved = |k: usize| !config.machine.layout().is_held(kinematics::Letter::ALL[k]);
    for _ in 0..2000 {
        let mut pose = config.home;
        for k in (0..6).filter(|k| moved(*k)) {
            pose[k] = rng.random_range(config.axes[k].min..=config.axes[k].max);
        }
        assert!(reach.check(&pose).is_ok(), "{}: {pose:?}", config.file.display());
        let at =
            |pose: [f64; 6]| config.machine.inverse(&Pose::from_degrees(pose), &config.spindle);
        for k in (0..6).filter(|k| moved(*k)) {
            let mut next = pose;
            let time = 1e-4;
            next[k] += time * config.axes[k].max_velocity;
            let (here, next) = (at(pose).unwrap(), at(next).unwrap());
            for (i, joint) in config.joints.iter().enumerate() {
                let speed = (next[i] - here[i]).abs() / time;
                assert!(speed <= joint.max_velocity, "{}: {speed}", joint.name);
            }
        }
    }
}

/// Returns the command with every required value from the table's examples.
pub fn example(kind: &str) -> String {
    let kind = KINDS.iter().find(|known| known.name == kind).unwrap();
    let needed = kind.parameters().into_iter().filter(|p| p.need != Need::Optional);
    let words = needed.map(|p| format!(" --{} {}", p.name, p.default));
    // Fast, for short programs.
    let turn = if kind.coordinates.contains(['A', 'B', 'C']) { " --turn 30" } else { "" };
    format!("{}{} --feed 12000 --accel 2000{turn}", kind.name, words.collect::<String>())
}

#[test]
fn the_documented_hexapod_with_mixed_hands_and_the_tool_up_is_made_and_runs() {
    let config = assert_documented("my-hexapod");
    assert!(config.home[2] > 0.0);
    let leads: Vec<f64> = config
        .geometry
        .legs()
        .iter()
        .map(|leg| match leg.kind {
            kinematics::LegKind::Strut(strut) => strut.lead,
            _ => 0.0,
        })
        .collect();
    assert_eq!(leads, [5.0, -5.0, 5.0, -5.0, 5.0, -5.0]);
    // At the center of the struts' travel, as near as a round height allows.
    assert!(config.joints.iter().all(|joint| (joint.home - 700.0).abs() < 10.0));
}

#[test]
fn a_name_that_makes_lines_too_long_for_linuxcnc_is_refused() {
    let bench = Bench::new();
    let reported =
        bench.answer(&format!("new {} --out long {}", example("tripod"), "a".repeat(65)), "");
    assert!(
        reported.contains("at most 64 characters") && reported.ends_with("exit 2\n"),
        "{reported}"
    );
}

#[test]
fn the_documented_delta_in_inches_is_made_and_runs() {
    let config = assert_documented("my-delta");
    assert_eq!(config.units_per_mm, 1.0 / 25.4);
    assert!((config.max_velocity[0] - 600.0 / 60.0).abs() < 1e-12);
}

#[test]
fn the_documented_pyramid_in_inches_and_one_of_the_other_kind_are_made_and_run() {
    let config = assert_documented("my-pyramid");
    assert_eq!(config.units_per_mm, 1.0 / 25.4);
    let bench = Bench::new();
    assert_made(&bench, "cross", &format!("{} --boxes no", example("pyramid-cross")));
}

#[test]
fn five_struts_of_a_table_are_made_and_run() {
    let bench = Bench::new().with("five.csv", FIVE_STRUTS);
    let config = assert_made(
        &bench,
        "five",
        "struts --anchors five.csv --strut 450 800 --tool up --feed 12000 --accel 2000 --turn 30",
    );
    assert_eq!(config.legs(), 5);
}

#[test]
fn deltas_and_struts_in_three_coordinates_are_made_and_run() {
    let bench = Bench::new();
    for kind in ["tripod", "rotary-delta", "linear-delta", "triaglide"] {
        assert_made(&bench, kind, &example(kind));
    }
}

#[test]
fn machines_on_rails_and_rings_are_made_and_run() {
    let bench = Bench::new();
    for kind in ["hexaglide", "linapod", "pentapod"] {
        assert_made(&bench, kind, &format!("{} --boxes no", example(kind)));
    }
    let words = format!("{} --boxes no --tilt 8 --out tilted", example("linapod"));
    assert!(bench.answer(&format!("new {words}"), "").ends_with("exit 0\n"));
    let config = test_support::shipped::first_of(&file(&bench, "tilted/tilted.ini"));
    assert!(config.axes[3..].iter().all(|axis| axis.min == -8.0 && axis.max == 8.0));
}

#[test]
fn limits_that_are_asked_for_are_those_of_the_machine_and_its_program_or_refused() {
    let bench = Bench::new();
    let hexapod = example("hexapod");
    let asked = "--limits X -60.123456789 60 --limits A -10 10 --limits B -10 10";
    let config = assert_made(&bench, "asked", &format!("{hexapod} {asked}"));
    let ends = |k: usize| [config.axes[k].min, config.axes[k].max];
    assert_eq!([ends(0), ends(3), ends(4)], [[-60.123456789, 60.0], [-10.0, 10.0], [-10.0, 10.0]]);
    // Those of Y, Z and C are derived around them.
    assert!([1, 2, 5].iter().all(|k| ends(*k)[1] - ends(*k)[0] >= 1.0));
    let files = bench.files();
    let mut reported = String::new();
    for asked in [
        "--limits X -600 60 --limits Y -5 5",
        "--limits Z -5 5",
        "--limits x -5 5",
        "--limits X 5 -5",
        "--limits X -5 5 --limits X -6 6",
    ] {
        reported += &format!("$ {asked}\n{}", bench.answer(&format!("new {hexapod} {asked}"), ""));
    }
    let delta = example("linear-delta");
    let without = bench.answer(&format!("new {delta} --limits B -5 5"), "");
    reported += &format!("$ --limits B -5 5\n{without}");
    assert_data_eq!(
        reported,
        str![[r#"
$ --limits X -600 60 --limits Y -5 5
pkm: --limits X -600 60, Y -5 5: not proved for every pose within: at X-600 Y-5 strut 0 is at 1082.300 mm, beyond its limit of 550 to 850 mm; use smaller limits, other dimensions, or another position with --home
exit 1
$ --limits Z -5 5
pkm: --limits Z -5 5: home is at Z -650: use limits that include it, or another position with --home
exit 2
$ --limits x -5 5
pkm: --limits x -5 5: expected a letter of XYZABC and two decimal numbers, such as X -60 60
exit 2
$ --limits X 5 -5
pkm: --limits X 5 -5: expected the smaller number first
exit 2
$ --limits X -5 5 --limits X -6 6
pkm: --limits X -5 5 X -6 6: expected X once
exit 2
$ --limits B -5 5
pkm: --limits B -5 5: the machine moves XYZ, but not B
exit 2

"#]]
    );
    assert_eq!(bench.files(), files, "nothing is left behind");
}

#[test]
fn arms_that_move_six_coordinates_or_a_plane_are_made_and_run() {
    let bench = Bench::new();
    assert_made(&bench, "rotary-hexapod", &example("rotary-hexapod"));
    // Arms that swing beside the base, under a platform with the tool up.
    let beside = example("rotary-hexapod").replace(" --angle -45 90", " --angle -60 60");
    assert_made(&bench, "servos", &format!("{beside} --tool up --arm-turn 90"));
    let config = assert_made(&bench, "five-bar", &example("five-bar"));
    assert_eq!((config.legs(), config.home[2]), (2, 0.0));
    let planar = bench.answer("workspace five-bar/five-bar.ini --bands 30", "");
    // The proved limits are a part of the area, which is a part of the circle of 500 about an axis.
    let row = planar.lines().find(|line| line.starts_with("  area ")).unwrap();
    let numbers: Vec<f64> = row.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let [boundary, grid, _, apart] = numbers[..] else { panic!("{row}") };
    let sides = [0, 1].map(|k| config.axes[k].max - config.axes[k].min);
    let circle = std::f64::consts::PI * 500.0 * 500.0;
    assert!((sides[0] * sides[1]..circle).contains(&boundary) && grid < circle, "{planar}");
    // Cells along the border: 400 of 10,000.
    assert!(apart < 4.0 && !planar.contains("+Z"), "{planar}");
    let refused = bench.answer("workspace five-bar/five-bar.ini --plane xz", "");
    assert!(refused.contains("--plane xz: the machine moves in the plane xy only"), "{refused}");
    let bench = bench.with("stiff.toml", "[legs]\nstiffness_n_per_um = 10\n");
    let words = "stiffness five-bar/five-bar.ini --study stiff.toml --plots maps --grid 11";
    let stiff = bench.answer(words, "");
    assert!(stiff.contains("rigid") && stiff.ends_with("exit 0\n"), "{stiff}");
    assert!(file(&bench, "maps/stiffness-translation-xy.svg").is_file());
}

#[test]
fn machines_whose_passive_joints_couple_coordinates_are_made_and_run() {
    let bench = Bench::new();
    for (name, kind, more) in [
        ("tricept", "tricept", ""),
        ("exechon", "exechon", ""),
        ("z3-over-a-table", "z3-head", " --table -450 450"),
        ("z3-head", "z3-head", ""),
        ("a3-head", "a3-head", " --table -450 450"),
    ] {
        let config = assert_made(&bench, name, &format!("{}{more}", example(kind)));
        let layout = config.machine.layout();
        let commanded = 6 - layout.constraints().min(3);
        assert_eq!(layout.coordinates().as_slice().len(), commanded, "{name}");
        assert_eq!(layout.table().as_slice().len(), 2 * usize::from(!more.is_empty()), "{name}");
    }
}

/// Their axis limits are proved with the wrist at 0; the first program turns it about the tip.
#[test]
fn a_tricept_and_an_exechon_may_carry_the_tool_on_a_wrist() {
    let bench = Bench::new();
    for kind in ["tricept", "exechon"] {
        let made = bench.answer(&format!("new {} --wrist 120 --out {kind}", example(kind)), "");
        assert!(made.contains("without a tool and with the wrist at 0"), "{made}");
        assert!(made.ends_with("exit 0\n"), "{made}");
        let ini = format!("{kind}/{kind}.ini");
        let config = test_support::shipped::first_of(&file(&bench, &ini));
        let letters: Vec<usize> = config.chain.links().iter().map(|link| link.place).collect();
        assert_eq!((letters, config.extra.len()), (vec![5, 3], 2), "C turns A");
        // The tilting axis is 120 above the spindle nose, which points down.
        assert_eq!(<[f64; 3]>::from(config.chain.links()[1].point), [0.0, 0.0, 120.0]);
        let checked = bench.answer(&format!("check {ini}"), "");
        assert!(checked.ends_with("exit 0\n"), "{checked}");
        let program = format!("{kind}/programs/first.ngc");
        assert!(fs::read_to_string(file(&bench, &program)).unwrap().contains("G1 F900 A20 C45"));
        let judged = bench.answer(&format!("preflight {ini} {program}"), "");
        assert!(judged.ends_with("\nThe program fits the machine.\nexit 0\n"), "{judged}");
    }
}

/// Trial machines are written by themselves, from drawings.
#[test]
fn machines_with_constraints_have_the_joints_of_separately_computed_poses() {
    let golden = golden();
    let bench = Bench::new();
    for (name, words) in [
        ("tricept", "tricept --base-radius 400 --platform-radius 150 --strut 650 1300 --nose 40"),
        (
            "exechon",
            "exechon --base-width 700 --platform-width 300 --base-depth 450 --platform-depth 160 --strut 600 1400",
        ),
        (
            "z3-head",
            "z3-head --base-radius 320 --platform-radius 200 --rod 500 --carriage 20 480 --table -450 450",
        ),
    ] {
        let made = bench.answer(&format!("new {words} --out {name}"), "");
        assert!(made.ends_with("exit 0\n"), "{made}");
        let made = test_support::shipped::first_of(&file(&bench, &format!("{name}/{name}.ini")));
        let layout = *made.machine.layout();
        let rows: Vec<_> = golden.iter().filter(|row| row.machine == name).collect();
        assert!(rows.len() > 3, "{name}: {}", rows.len());
        for row in rows {
            let tool = -Vector3::from(row.tip);
            let mut pose = Pose::from_degrees(row.pose);
            pose.position += tool;
            for letter in Letter::ALL.into_iter().filter(|letter| layout.is_dependent(*letter)) {
                match letter.index() {
                    k @ 0..3 => pose.position[k] = 0.0,
                    k => pose.angles[k - 3] = 0.0,
                }
            }
            let joints = made.machine.inverse(&pose, &tool).unwrap();
            for (made, expected) in joints.iter().zip(&row.joints) {
                // Anchors have nine digits after the point.
                assert!((made - expected).abs() < 1e-7, "{name}: {made} {expected}");
            }
        }
    }
}

#[test]
fn every_kind_is_made_in_inches_and_with_the_tool_on_either_side() {
    let bench = Bench::new();
    for kind in KINDS.iter().filter(|kind| kind.legs != 0) {
        for tool in ["down", "up"] {
            let inches = |p: &Parameter| {
                let words = default(p, 1.0 / MM_PER_INCH).join(" ");
                // The wall of a pentapod is mirrored with its rings.
                let mirrored = ["lower", "lowest", "upper"].contains(&p.name) && tool == "up";
                let words = match words.strip_prefix('-') {
                    Some(positive) if mirrored => positive.into(),
                    None if mirrored => format!("-{words}"),
                    _ => words,
                };
                format!(" --{} {words}", p.name)
            };
            let needed = kind.parameters().into_iter().filter(|p| p.need != Need::Optional);
            let words: String = needed.map(|p| inches(&p)).collect();
            let name = format!("{}-{tool}", kind.name);
            let made = bench.answer(
                &format!(
                    "new {}{words} --unit inch{} --tool {tool} --out {name}",
                    kind.name,
                    if kind.boxes.is_empty() { "" } else { " --boxes no" }
                ),
                "",
            );
            assert!(made.ends_with("exit 0\n"), "{name}: {made}");
            let ini = fs::read_to_string(file(&bench, &format!("{name}/{name}.ini"))).unwrap();
            assert!(ini.contains("LINEAR_UNITS = inch\n"), "{name}");
            for word in ini.split_whitespace().chain(made.split_whitespace()) {
                assert_is_plain(word, &name);
            }
            let config =
                test_support::shipped::first_of(&file(&bench, &format!("{name}/{name}.ini")));
            let sign = if tool == "up" { 1.0 } else { -1.0 };
            // At home the platform is on the side of the tool from the mean of its base joints.
            let at = config.machine.at(&config.home_pose(), &config.spindle).unwrap();
            let legs = &at.segments()[..config.legs()];
            let axis = if kind.is_lathe() { 1 } else { 2 };
            let aside: f64 = legs.iter().map(|leg| leg.span()[axis]).sum();
            let is_beside = ["pentapod", "five-bar"].contains(&kind.name);
            assert!(is_beside || aside * sign > 0.0, "{name}: {aside}");
            let checked = bench.answer(&format!("check --no-start {name}/{name}.ini"), "");
            assert!(checked.ends_with("exit 0\n"), "{name}: {checked}");
        }
    }
}

/// Checks that a word is not a number with the digits of a rounding error.
fn assert_is_plain(word: &str, what: &str) {
    let is_noise = word.contains('.') && (word.contains("0000000") || word.contains("9999999"));
    assert!(!is_noise || word.parse::<f64>().is_err(), "{what}: {word}");
}

#[test]
fn the_page_lists_every_kind_with_its_text() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference/pkm.md");
    let page = fs::read_to_string(page).unwrap();
    let rows: String =
        KINDS.iter().map(|kind| format!("| `{}` | {} |\n", kind.name, kind.text)).collect();
    assert!(page.contains(&format!("| kind | machine |\n| --- | --- |\n{rows}\n")), "{rows}");
}

#[test]
fn lathes_are_made_and_run() {
    let bench = Bench::new();
    for kind in ["four-rod-lathe", "six-rod-lathe"] {
        assert_made(&bench, kind, &format!("{} --boxes no", example(kind)));
    }
}

#[test]
fn a_table_of_anchors_makes_the_machine_that_its_radii_make() {
    let bench = Bench::new();
    let made = assert_made(&bench, "radii", &example("rotary-delta"));
    let names = columns(kinematics::leg::Kind::Crank).join(",");
    let list = |numbers: &[f64]| numbers.iter().map(|x| format!(",{x}")).collect::<String>();
    let mut text = names + "\n";
    for (n, leg) in made.geometry.legs().iter().enumerate() {
        let kinematics::LegKind::Crank(crank) = leg.kind else { panic!("no arm") };
        let side = made.ini.as_inivar(&format!("LEG_{n}"), "SIDE").unwrap();
        let [platform, axis, arm] = [leg.platform, crank.axis, crank.arm].map(|v| list(&v));
        text +=
            &format!("{n}{}{platform}{axis}{arm}{},{side}\n", list(&leg.base), list(&[crank.rod]));
    }
    let bench = bench.with("arms.csv", &text);
    let words = "new rotary-delta --anchors arms.csv --angle -45 90 --out table";
    assert!(bench.answer(words, "").ends_with("exit 0\n"));
    let again = test_support::shipped::first_of(&file(&bench, "table/table.ini"));
    assert_eq!((again.hash, again.home), (made.hash, made.home));
}

#[test]
fn a_folder_that_is_there_is_left_as_it_is() {
    let bench = Bench::new().with("mine/notes.txt", "mine");
    let words = format!("new {} --out mine", example("linear-delta"));
    assert_data_eq!(
        bench.answer(&words, ""),
        str![[r#"
pkm: mine exists already and was not changed: use another name, or --out FOLDER
exit 2

"#]]
    );
    assert_eq!(fs::read_to_string(file(&bench, "mine/notes.txt")).unwrap(), "mine");
    assert_eq!(fs::read_dir(file(&bench, "mine")).unwrap().count(), 1);
}

#[test]
fn a_machine_that_cannot_stand_anywhere_is_refused_with_the_strut_and_a_way_out() {
    let bench = Bench::new();
    let files = bench.files();
    let hexapod = |strut: &str| {
        format!(
            "new hexapod --base-radius 900 --base-half-angle 12 --platform-radius 180 \
             --platform-half-angle 15 --strut {strut} --tool up"
        )
    };
    assert_data_eq!(
        bench.answer(&hexapod("550 750"), ""),
        str![[r#"
pkm: at the best home position found, X0 Y0 Z10, strut 3 would be 755.5 mm long; 550 to 750 is possible: use longer struts, or more similar radii of base and platform
exit 1

"#]]
    );
    assert_data_eq!(
        bench.answer(&format!("{} --home 0 0 1100", hexapod("550 850")), ""),
        str![[r#"
pkm: at the given home, X0 Y0 Z1100, strut 3 would be 1334.4 mm long; 550 to 850 is possible: move home nearer to the base, or use longer struts
exit 1

"#]]
    );
    assert_data_eq!(
        bench.answer(&format!("{} --diameter 300 --home 0 0 450", hexapod("550 950")), ""),
        str![[r#"
pkm: at home the distance between legs [..] is at [..] mm, beyond its limit of 360 mm: change dimensions, or choose another position with --home
exit 1

"#]]
    );
    // As large as its base, with parallel vertical struts: nothing constrains it sideways.
    assert_data_eq!(
        bench.answer(
            "new hexapod --base-radius 400 --base-half-angle 12 --platform-radius 400 \
             --platform-half-angle 48 --strut 550 850",
            ""
        ),
        str![[r#"
pkm: the machine cannot be at any of 86 positions along the line through the middle of its legs; at the last one, X0 Y0 Z-850: the legs do not constrain the platform at the reference pose; check the anchors: the geometry is singular there [code -55]. Check the dimensions, or choose a position with --home
exit 1

"#]]
    );
    assert_eq!(bench.files(), files, "nothing is left behind");
}

#[test]
fn nonsense_is_refused_with_what_was_expected() {
    let bench = Bench::new();
    let files = bench.files();
    let delta = example("linear-delta");
    let mut reported = String::new();
    for words in [
        "new".into(),
        "new linear-delta --rod 270".into(),
        format!("new {delta} --rod 270"),
        "new linear-delta --rod 270 --carriage 400 0".into(),
        "new linear-delta --rod nan --carriage 0 400".into(),
        "new linear-delta --rod -5 --carriage 0 400".into(),
        format!("new {delta} --unit cm"),
        format!("new {delta} --joint-angle 181"),
        format!("new {delta} two-words!"),
        format!("new {delta} --out none/machine"),
        format!("new {} --hands RLR", example("hexapod")),
        format!("new {} --hands RLRLRL", example("hexapod")),
        format!("new {} --tilt 0.1", example("hexapod")),
        "new linear-delta --rod 1e300 --carriage 0 400".into(),
        "new linear-delta --rod 1e-9 --carriage 0 400".into(),
    ] {
        reported += &format!("$ {words}\n{}", bench.answer(&words, ""));
    }
    assert_data_eq!(
        reported,
        str![[r#"
$ new
pkm: no kind of machine given: run pkm new KIND with one of hexapod, tripod, struts, pentapod, linear-delta, rotary-delta, rotary-hexapod, five-bar, triaglide, hexaglide, linapod, pyramid, pyramid-cross, four-rod-lathe, six-rod-lathe, tricept, exechon, z3-head, a3-head
exit 2
$ new linear-delta --rod 270
pkm: linear-delta: values are missing; add them (examples in mm), or run without options on a terminal to be asked:
  --base-radius LENGTH: Distance from the center of the base to the center of a joint, seen from above, such as 163
  --platform-radius LENGTH: Distance from the center of the platform to the center of a joint, such as 33
  --carriage MIN MAX: Travel of a carriage on its rail, measured from the zero of the rail, such as 0 400
exit 2
$ new linear-delta --base-radius 163 --platform-radius 33 --rod 270 --carriage 0 400 --feed 12000 --accel 2000 --rod 270
error: the argument '--rod <LENGTH>' cannot be used multiple times

Usage: pkm new linear-delta [OPTIONS] [NAME]

For more information, try '--help'.
exit 2
$ new linear-delta --rod 270 --carriage 400 0
pkm: --carriage 400 0: expected the smaller number first
exit 2
$ new linear-delta --rod nan --carriage 0 400
pkm: --rod nan: expected a decimal number
exit 2
$ new linear-delta --rod -5 --carriage 0 400
pkm: --rod -5: expected more than 0
exit 2
$ new linear-delta --base-radius 163 --platform-radius 33 --rod 270 --carriage 0 400 --feed 12000 --accel 2000 --unit cm
pkm: --unit cm: expected mm or inch
exit 2
$ new linear-delta --base-radius 163 --platform-radius 33 --rod 270 --carriage 0 400 --feed 12000 --accel 2000 --joint-angle 181
pkm: --joint-angle 181: expected more than 0 and at most 180 degrees
exit 2
$ new linear-delta --base-radius 163 --platform-radius 33 --rod 270 --carriage 0 400 --feed 12000 --accel 2000 two-words!
pkm: "two-words!" is not a valid machine name: use letters, digits, - and _
exit 2
$ new linear-delta --base-radius 163 --platform-radius 33 --rod 270 --carriage 0 400 --feed 12000 --accel 2000 --out none/machine
pkm: none is not a folder: create it, or use another --out
exit 2
$ new hexapod --base-radius 400 --base-half-angle 12 --platform-radius 180 --platform-half-angle 15 --strut 550 850 --feed 12000 --accel 2000 --turn 30 --hands RLR
pkm: --hands RLR: expected one letter, or one for each of 6 struts
exit 2
$ new hexapod --base-radius 400 --base-half-angle 12 --platform-radius 180 --platform-half-angle 15 --strut 550 850 --feed 12000 --accel 2000 --turn 30 --hands RLRLRL
pkm: --hands RLRLRL without --lead: hands only matter if turning the screw changes the strut length; add --lead, or remove --hands
exit 2
$ new hexapod --base-radius 400 --base-half-angle 12 --platform-radius 180 --platform-half-angle 15 --strut 550 850 --feed 12000 --accel 2000 --turn 30 --tilt 0.1
pkm: --tilt 0.1: expected at least 0.5 degrees
exit 2
$ new linear-delta --rod 1e300 --carriage 0 400
pkm: --rod 1e300: expected at most 10000000 in size
exit 2
$ new linear-delta --rod 1e-9 --carriage 0 400
pkm: --rod 1e-9: expected 0.000001 or more
exit 2

"#]]
    );
    assert_eq!(bench.files(), files, "nothing is left behind");
}

#[test]
fn a_table_of_anchors_that_is_none_is_refused_at_its_line() {
    let bench = Bench::new();
    let [first, ..] = ["0,400,0,0,120,60,0"];
    let mut reported = String::new();
    for (from, to) in [
        ("platform_z\n", "\n"),
        (first, "0,400,0,0,120,60"),
        (first, "0,400,0,0,120,60,0,7"),
        (first, "0,400,0,nan,120,60,0"),
        (first, "0,400,0,1e200,120,60,0"),
        (first, "1,400,0,0,120,60,0"),
        ("leg,", "strut,"),
    ] {
        let text = FIVE_STRUTS.replacen(from, to, 1);
        fs::write(file(&bench, "five.csv"), text).unwrap();
        reported += &bench.answer("new struts --anchors five.csv --strut 450 800", "");
    }
    fs::write(file(&bench, "five.csv"), FIVE_STRUTS).unwrap();
    for words in [
        "struts --anchors five.csv --strut 450 800 --coordinates XYZABC",
        "struts --anchors none.csv --strut 450 800",
        "hexapod --anchors five.csv --strut 450 800",
        "hexapod --anchors five.csv --strut 450 800 --base-radius 3",
    ] {
        reported += &bench.answer(&format!("new {words}"), "");
    }
    assert_data_eq!(
        reported,
        str![[r#"
pkm: five.csv:2: expected the heading leg,base_x,base_y,base_z,platform_x,platform_y,platform_z
exit 2
pkm: five.csv:3: expected 7 fields, leg,base_x,base_y,base_z,platform_x,platform_y,platform_z; found 6
exit 2
pkm: five.csv:3: expected 7 fields, leg,base_x,base_y,base_z,platform_x,platform_y,platform_z; found 8
exit 2
pkm: five.csv:3: base_z: expected a decimal number, found "nan"
exit 2
pkm: five.csv:3: base_z: expected at most 10000000 in size, found 1e200
exit 2
pkm: five.csv:3: expected leg 0 next, found "1"
exit 2
pkm: five.csv:2: expected the heading leg,base_x,base_y,base_z,platform_x,platform_y,platform_z
exit 2
pkm: 5 legs cannot move 6 letters (XYZABC): use fewer letters, or more legs
exit 2
pkm: none.csv: No such file or directory (os error 2)
exit 2
pkm: a hexapod has 6 legs, but the table of anchors has 5
exit 2
pkm: --base-radius has no effect with --anchors, whose table contains it: remove one of them
exit 2

"#]]
    );
    assert!(!file(&bench, "struts").exists() && !file(&bench, "hexapod").exists());
}

/// Uses a terminal created by `script`.
#[test]
fn on_a_terminal_everything_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let mut answers = String::from("linear-delta\n");
    let kind = KINDS.iter().find(|kind| kind.name == "linear-delta").unwrap();
    answers += &"\n".repeat(kind.parameters().len());
    let mut child = std::process::Command::new("script")
        .args(["-qec", &format!("{} new", env!("CARGO_BIN_EXE_pkm")), "/dev/null"])
        .current_dir(folder.path())
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    std::io::Write::write_all(child.stdin.as_mut().unwrap(), answers.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let reported = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{reported}");
    assert!(reported.contains("Length of a rod") && reported.contains("Created "), "{reported}");
    assert!(folder.path().join("linear-delta/linear-delta.ini").exists());
}
