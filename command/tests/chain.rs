// SPDX-License-Identifier: GPL-2.0-or-later
//! Commands on machines whose axes carry workpiece, tool or legs.

use crate::commands::Bench;
use serde_json::Value;
use std::fs;
use test_support::CUT;
use test_support::shipped::{config, ini};

const TABLE: &str = "hexapod-rotary-table";

const TURRETS: &str = "lathe-two-turrets";

/// A cut along X of the work, at two angles of the table.
const PROGRAM: &str = "G21 G90 G64 G17\nS6000 M3\nG0 X-20 Y0 Z250 C0\nG1 X20 F600\nG0 X-20 C90\nG1 X20 F600\nM5\nM2\n";

fn json(answer: &str) -> Value {
    let end = answer.rfind("exit ").unwrap_or_else(|| panic!("{answer}"));
    serde_json::Deserializer::from_str(&answer[..end]).into_iter().next().unwrap().unwrap()
}

#[test]
fn a_cut_on_a_rotary_table_has_the_feed_of_the_work() {
    let bench = Bench::new().with("study.toml", CUT).with("part.ngc", PROGRAM);
    let file = ini(TABLE);
    let words = format!("cut {} part.ngc --study study.toml --format json", file.display());
    let found = json(&bench.answer(&words, ""));
    let line = |n: u64| found["lines"].as_array().unwrap().iter().find(|l| l["line"] == n).unwrap();
    for number in [4, 6] {
        // 600 mm/min, two teeth, 6000 1/min: LinuxCNC reaches the feed to rounding.
        let chip = line(number)["chip_mm"].as_f64().unwrap();
        assert!((chip / 0.05 - 1.0).abs() < 1e-8, "{number}: {chip}");
    }
    // The platform moves along Y of base in the second cut: other struts bear its force.
    let deflection = |n: u64| line(n)["deflection_um"].as_f64().unwrap();
    assert!(deflection(4) > 0.0 && deflection(6) > 0.0, "{found}");
    let words = format!("stability program {} part.ngc --study study.toml", file.display());
    let answer = bench.answer(&words, "");
    assert!(answer.ends_with("exit 0\n"), "{answer}");
}

#[test]
fn a_cut_with_the_work_on_the_platform_is_not_judged() {
    let bench = Bench::new().with("study.toml", CUT).with("part.ngc", PROGRAM);
    let file = ini("lathe-work-on-platform");
    for command in ["cut", "stability program"] {
        let words = format!("{command} {} part.ngc --study study.toml", file.display());
        let answer = bench.answer(&words, "");
        assert!(answer.ends_with("exit 2\n") && answer.contains("not judged"), "{answer}");
    }
    let answer = bench.answer(&format!("calibrate {} any.log", file.display()), "");
    assert!(answer.ends_with("exit 2\n") && answer.contains("tools on the platform"), "{answer}");
}

#[test]
fn a_path_on_a_machine_whose_axis_carries_the_tool_moves_its_carriages_as_replay_does() {
    let path = "[curve]\nx_mm = '20*cos(t)'\ny_mm = '20*sin(t)'\nt = [0, 'pi']\n\
                [laws]\nspeed_mm_per_s = 5\n[tolerance]\nchord_mm = 0.05\n\
                [program]\ntool = 1\nzero_mm = [-150, 560, 1000]\n";
    let bench = Bench::new().with("path.toml", path);
    let file = ini(TURRETS);
    let words = format!("path {} path.toml -o arc.ngc --csv arc.csv", file.display());
    let answer = bench.answer(&words, "");
    assert!(answer.ends_with("exit 0\n"), "{answer}");
    let program = fs::read_to_string(bench.0.path().join("arc.ngc")).unwrap();
    // The turret goes to where the path is computed.
    assert!(program.contains("\nG53 G0 A0\n"), "{program}");
    let rows = |text: &str, names: &[&str]| -> Vec<Vec<f64>> {
        let mut lines = text.lines();
        let header: Vec<&str> = lines.next().unwrap().split(',').collect();
        let places = names.iter().map(|name| header.iter().position(|own| own == name).unwrap());
        let places: Vec<usize> = places.collect();
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            places.iter().map(|place| cells[*place].parse().unwrap()).collect()
        };
        lines.take_while(|line| !line.starts_with("exit")).map(row).collect()
    };
    let names = ["joint_0", "joint_1", "joint_2", "joint_3"];
    let planned = rows(&fs::read_to_string(bench.0.path().join("arc.csv")).unwrap(), &names);
    let replayed = bench.answer(&format!("replay {} arc.ngc --period 0.002", file.display()), "");
    let replayed = rows(&replayed, &names);
    let apart =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    for row in &planned {
        let nearest = replayed.iter().map(|own| apart(own, row)).fold(f64::INFINITY, f64::min);
        // The replay has a pose every 0.01 mm, and a carriage is at most three times as fast as the tip.
        assert!(nearest < 0.03, "{row:?}: {nearest}");
    }
    assert!(planned.len() > 10 && apart(&planned[0], &planned[planned.len() - 1]) > 1.0);
}

#[test]
fn laws_of_carriages_give_the_pose_that_a_program_would_command() {
    let config = config(TURRETS);
    let path = format!(
        "[carriages]\nt_s = [0, 0.01]\nlaws_mm_or_deg = {:?}\n",
        config.joints.iter().map(|joint| joint.home.to_string()).collect::<Vec<_>>()
    );
    let bench = Bench::new().with("path.toml", &path);
    let answer = bench.answer(&format!("path {} path.toml", ini(TURRETS).display()), "");
    assert!(answer.ends_with("exit 0\n"), "{answer}");
    let mut lines = answer.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let cells: Vec<f64> =
        lines.next().unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    for (name, home) in ["x", "y", "z", "b"].into_iter().zip([0, 1, 2, 4].map(|k| config.start[k]))
    {
        let found = cells[header.iter().position(|own| *own == name).unwrap()];
        // The forward solution ends within 1e-9 of the size of the machine.
        assert!((found - home).abs() < 1e-6, "{name}: {found} {home}");
    }
}

#[test]
fn measurements_on_a_rotary_table_are_those_of_the_machine_with_its_table_at_0() {
    let bench = Bench::new();
    let answer = bench.answer(&format!("calibrate {} none.log", ini(TABLE).display()), "");
    assert!(answer.contains("axes C carry work, tool or legs: keep them at 0"), "{answer}");
    assert!(answer.ends_with("exit 2\n") && answer.contains("none.log"), "{answer}");
}

#[test]
fn a_replay_draws_the_tip_on_the_work() {
    // The table turns while the tip rests on the work: the path is a point, and the platform's a quarter of a circle.
    let program = "G21 G90 G64\nG0 X30 Y0 Z250\nG1 C90 F600\nG1 C0\nM2\n";
    let bench = Bench::new().with("turn.ngc", program);
    let words = format!("replay {} turn.ngc --period 0.05 --plots drawn", ini(TABLE).display());
    let answer = bench.answer(&words, "");
    assert!(answer.ends_with("exit 0\n"), "{answer}");
    let drawn = fs::read_to_string(bench.0.path().join("drawn/tool-path-3d.svg")).unwrap();
    assert!(drawn.contains("tip on the work") && !drawn.contains("control point"));
}
