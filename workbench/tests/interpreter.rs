// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC's interpreter, asked for moves: units, offsets, arcs, tools and errors.

use pkm::program::interpreter::{Move, MoveKind, moves};
use pkm::program::replay::duration;
use pkm::read::machine::MachineConfig;
use std::path::Path;

/// Inch and back: some roundings of values near 100.
const ROUNDING_MM: f64 = 1e-12;

fn config(tools: &Path) -> MachineConfig {
    let ini = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hexapod/hexapod.ini");
    let mut config = MachineConfig::read(&ini).unwrap();
    config.program.tool_table = Some(tools.into());
    config.program.parameter_file = None;
    config
}

/// Moves of a program, without the one that puts the machine to its home.
fn run(text: &str, offset: Option<[f64; 6]>) -> Result<Vec<Move>, String> {
    let folder = tempfile::tempdir().unwrap();
    let (program, tools) = (folder.path().join("p.ngc"), folder.path().join("t.tbl"));
    std::fs::write(&program, text).unwrap();
    std::fs::write(&tools, "T1 P1 Z25.5 D6\nT7 P3 X1.5 Z40 D3\n").unwrap();
    let config = config(&tools);
    let mut moves = moves(&config, &program, offset).map_err(|e| e.to_string())?;
    assert_eq!((moves[0].line, moves[0].end), (0, config.home));
    moves.remove(0);
    Ok(moves)
}

fn assert_end(step: &Move, end: [f64; 6]) {
    for (got, expected) in step.end.iter().zip(end) {
        assert!((got - expected).abs() < ROUNDING_MM, "line {}: {:?}", step.line, step.end);
    }
}

#[test]
fn inch_and_millimetre_words_become_machine_units() {
    let steps = run("G20 G0 X1 Z2\nG1 Y-1 F10\nG21 G1 X10\nM2\n", None).unwrap();
    let [a, b, c] = steps.as_slice() else { panic!("{steps:?}") };
    assert_eq!((a.kind, b.kind, b.line), (MoveKind::Rapid, MoveKind::Feed, 2));
    assert_end(a, [25.4, 0.0, 50.8, 0.0, 0.0, 0.0]);
    assert_end(b, [25.4, -25.4, 50.8, 0.0, 0.0, 0.0]);
    assert_end(c, [10.0, -25.4, 50.8, 0.0, 0.0, 0.0]);
    assert!((b.feed - 254.0 / 60.0).abs() < ROUNDING_MM);
}

#[test]
fn work_offset_moves_the_program_and_partial_moves_start_at_home() {
    let steps = run("G0 Z10\nM2\n", Some([5.0, 6.0, 220.0, 0.0, 0.0, 3.0])).unwrap();
    assert_end(&steps[0], [0.0, 0.0, 230.0, 0.0, 0.0, 0.0]);
}

#[test]
fn tool_length_is_part_of_the_commanded_position_and_is_named() {
    let text = "G0 X0 Y0 Z100\nT7 M6\nG43\nG0 Z100\nG43 H1\nG0 Z90\nG49\nG0 X3 Z100\nM2\n";
    let steps = run(text, None).unwrap();
    let [none, seven, one, off] = steps.as_slice() else { panic!("{steps:?}") };
    assert_eq!(none.tool, [0.0; 3]);
    assert_end(seven, [0.0, 0.0, 140.0, 0.0, 0.0, 0.0]);
    assert_eq!(seven.tool, [1.5, 0.0, 40.0]);
    assert_end(one, [0.0, 0.0, 115.5, 0.0, 0.0, 0.0]);
    assert_eq!(one.tool, [0.0, 0.0, 25.5]);
    assert_end(off, [3.0, 0.0, 100.0, 0.0, 0.0, 0.0]);
}

#[test]
fn arcs_stay_within_a_ten_thousandth_of_a_millimetre() {
    let steps = run("G0 X50 Y0 Z200\nG2 X-50 Y0 I-50 J0 B10 F600\nM2\n", None).unwrap();
    assert!(steps.len() > 300, "{}", steps.len());
    for pair in steps.windows(2) {
        let middle = [0, 1].map(|i| (pair[0].end[i] + pair[1].end[i]) / 2.0);
        assert!(50.0 - middle[0].hypot(middle[1]) < 1.01e-4, "{middle:?}");
    }
    let last = steps.last().unwrap();
    assert!((last.end[0] + 50.0).abs() < 1e-9 && (last.end[4] - 10.0).abs() < 1e-9, "{last:?}");
}

#[test]
fn errors_carry_file_line_reason_and_block() {
    let error = run("G0 X0\nG1 X10\nM2\n", None).unwrap_err();
    assert!(error.contains("p.ngc:2:") && error.contains("G1 X10"), "{error}");
    assert!(error.contains("feed rate"), "{error}");
    let error = run("G0 X0\nM61 Q7\nG43\nG0 X1\nM2\n", None).unwrap_err();
    assert!(error.contains("p.ngc:2: M61"), "{error}");
    let error = run("T99 M6\n", None).unwrap_err();
    assert!(error.contains("p.ngc:1:") && error.contains("99"), "{error}");
}

#[test]
fn feed_counts_along_xyz_where_they_move_and_in_degrees_elsewhere() {
    let text = "G0 X0 Y0 Z250 A0\nG1 X3 Y4 A1 F60\nA2 F30\nG20 G1 A3 F60\nG93 G1 X0 F2\nM2\n";
    let steps = run(text, None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    let seconds: Vec<f64> =
        steps.windows(2).map(|pair| duration(&config, &pair[0].end, &pair[1])).collect();
    for (got, expected) in seconds.iter().zip([5.0, 2.0, 1.0, 30.0]) {
        assert!((got - expected).abs() < 1e-9, "{seconds:?}");
    }
}

#[test]
fn axis_limits_slow_down_what_the_feed_would_allow() {
    let steps = run("G0 X0 Y0 Z250 A0\nG1 X100 A30 F60000\nM2\n", None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    let slowest = 30.0 / config.axes[3].max_velocity;
    assert!((duration(&config, &steps[0].end, &steps[1]) - slowest).abs() < 1e-9);
}

#[test]
fn an_inch_machine_gets_inches_whatever_the_program_speaks() {
    let folder = tempfile::tempdir().unwrap();
    let (program, tools) = (folder.path().join("p.ngc"), folder.path().join("t.tbl"));
    std::fs::write(&program, "G0 X1\nG21\nG1 X50.8 F254\nT1 M6\nG43\nG0 Z25.4\nM2\n").unwrap();
    std::fs::write(&tools, "T1 P1 Z2 D0.25\n").unwrap();
    let mut config = config(&tools);
    config.units_per_mm = 1.0 / 25.4;
    config.program.startup_code = None;
    config.home = [0.0, 0.0, 10.0, 0.0, 0.0, 0.0];
    let steps = moves(&config, &program, Some([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])).unwrap();
    let [home, inch, metric, tool] = steps.as_slice() else { panic!("{steps:?}") };
    assert_end(home, config.home);
    assert_end(inch, [1.0, 0.0, 10.0, 0.0, 0.0, 0.0]);
    assert_end(metric, [2.0, 0.0, 10.0, 0.0, 0.0, 0.0]);
    assert!((metric.feed - 10.0 / 60.0).abs() < ROUNDING_MM);
    assert_end(tool, [2.0, 0.0, 3.0, 0.0, 0.0, 0.0]);
    assert!((tool.tool[2] - 2.0).abs() < ROUNDING_MM);
}
