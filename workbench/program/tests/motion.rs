// SPDX-License-Identifier: GPL-2.0-or-later
//! The moves that LinuxCNC commands to motion: units, offsets, arcs, tools, files, the spindle and errors.

use linuxcnc::process::Options;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use program::motion::{Move, MoveKind, Spindle, moves};
use program::preflight::judge;
use program::replay::duration;
use program::report::Rule;
use program::work_offset::Offset;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use test_support::control::bounded;
use test_support::shipped;

/// Rounding of homing, where forward is accurate to some roundings of the machine's size, and of inch and back.
const ROUNDING_MM: f64 = 1e-9;

fn config(tools: &Path) -> Mechanism {
    let ini = shipped::ini("hexapod");
    let mut config = test_support::shipped::first_of(&ini);
    let program = &mut Arc::make_mut(&mut config.facts).program;
    (program.tool_table, program.parameter_file) = (Some(tools.into()), None);
    config
}

/// Returns the moves of a program, without the move to the machine's home.
fn run(text: &str, block: Option<&str>) -> Result<Vec<Move>, String> {
    let folder = tempfile::tempdir().unwrap();
    let (program, tools) = (folder.path().join("p.ngc"), folder.path().join("t.tbl"));
    std::fs::write(&program, text).unwrap();
    std::fs::write(&tools, "T1 P1 Z25.5 D6\nT7 P3 X1.5 Z40 D3\n").unwrap();
    let config = config(&tools);
    let mut moves = moves(&config.clone().into(), &program, block).map_err(|e| e.to_string())?;
    assert_eq!(moves[0].line, 0);
    assert_end(&moves[0], config.start);
    moves.remove(0);
    Ok(moves)
}

fn assert_end(step: &Move, end: [f64; 6]) {
    for (got, expected) in step.end.iter().zip(end) {
        assert!((got - expected).abs() < ROUNDING_MM, "line {}: {:?}", step.line, step.end);
    }
}

#[test]
fn inch_and_millimeter_words_become_machine_units() {
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
    let steps = run("G0 Z10\nM2\n", Some("G10 L2 P1 X5 Y6 Z220 A0 B0 C3")).unwrap();
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
fn arcs_stay_within_a_ten_thousandth_of_a_millimeter() {
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
fn errors_carry_file_line_and_reason() {
    let error = run("G0 X0\nG1 X10\nM2\n", None).unwrap_err();
    assert!(error.contains("p.ngc:2:") && error.contains("feed rate"), "{error}");
    let error = run("T99 M6\n", None).unwrap_err();
    assert!(error.contains("p.ngc:1:") && error.contains("99"), "{error}");
    // After moves that LinuxCNC has read but not executed.
    let error = run("F600\nG1 X1\nX2\nX3\nG1 X10 Q\nM2\n", None).unwrap_err();
    assert!(error.contains("p.ngc:5:"), "{error}");
}

#[test]
fn m61_puts_its_tool_into_the_spindle() {
    let steps = run("G0 X1\nM61 Q7\nG43\nG0 X2\nM2\n", None).unwrap();
    assert_eq!(steps.last().unwrap().tool, [1.5, 0.0, 40.0]);
}

#[test]
fn feed_counts_along_xyz_where_they_move_and_in_degrees_elsewhere() {
    let text =
        "G0 X0 Y0 Z251 A0\nG0 Z250\nG1 X3 Y4 A1 F60\nA2 F30\nG20 G1 A3 F60\nG93 G1 X0 F2\nM2\n";
    let steps = run(text, None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    let seconds: Vec<f64> =
        steps[1..].windows(2).map(|pair| duration(&config, &pair[0].end, &pair[1])).collect();
    for (got, expected) in seconds.iter().zip([5.0, 2.0, 1.0, 30.0]) {
        assert!((got - expected).abs() < 1e-9, "{seconds:?}");
    }
}

#[test]
fn axis_limits_slow_down_what_the_feed_would_allow() {
    let steps = run("G0 X0 Y0 Z251 A0\nG1 X100 A30 F60000\nM2\n", None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    let slowest = 30.0 / config.axes[3].max_velocity;
    assert!((duration(&config, &steps[0].end, &steps[1]) - slowest).abs() < 1e-9);
}

#[test]
fn an_inch_machine_gets_inches_from_programs_in_any_unit() {
    let steps = run_on("tripod", "G20 G0 X1\nG21\nG1 X50.8 F254\nM2\n").unwrap();
    let [_, inch, metric] = steps.as_slice() else { panic!("{steps:?}") };
    let home = test_support::shipped::config("tripod").home;
    assert_end(inch, [1.0, home[1], home[2], 0.0, 0.0, 0.0]);
    assert_end(metric, [2.0, home[1], home[2], 0.0, 0.0, 0.0]);
    assert!((metric.feed - 10.0 / 60.0).abs() < ROUNDING_MM);
}

/// Returns the moves of a program on a shipped machine, with its tool table.
fn run_on(machine: &str, text: &str) -> Result<Vec<Move>, String> {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("p.ngc");
    std::fs::write(&program, text).unwrap();
    let mut config = test_support::shipped::config(machine);
    Arc::make_mut(&mut config.facts).program.parameter_file = None;
    moves(&config.clone().into(), &program, None).map_err(|error| error.to_string())
}

/// A reader other than the control knows neither the position nor the tool after a change.
#[test]
fn a_tool_change_after_other_units_or_offsets_leaves_the_machine_where_it_is() {
    let home = config(Path::new("")).home;
    let end = |x: f64, y: f64| [x, y, home[2], 0.0, 0.0, 0.0];
    let steps = run("G20\nT1 M6\nG0 X1 Y1\nM2\n", None).unwrap();
    assert_end(&steps[0], end(25.4, 25.4));
    let steps = run("G20\nT1 M6\nG43\nG0 X1 Y1\nG0 Y2\nG0 Z10\nM2\n", None).unwrap();
    let [first, second, third] = steps.as_slice() else { panic!("{steps:?}") };
    assert_end(first, end(25.4, 25.4));
    assert_end(second, end(25.4, 50.8));
    assert_end(third, [25.4, 50.8, 254.0 + 25.5, 0.0, 0.0, 0.0]);
    // The current position of an axis, but programmed.
    let steps = run("G0 X2 Y3\nG20\nT1 M6\nG0 X2\nM2\n", None).unwrap();
    assert_end(&steps[1], end(50.8, 3.0));
    let steps = run("G10 L2 P2 Z30\nG55\nT1 M6\nG0 X1\nM2\n", None).unwrap();
    assert_end(steps.last().unwrap(), end(1.0, 0.0));
    let home = test_support::shipped::config("tripod").home;
    let steps = run_on("tripod", "G21\nT1 M6\nG0 X127 Y63.5\nM2\n").unwrap();
    assert_end(steps.last().unwrap(), [5.0, 2.5, home[2], 0.0, 0.0, 0.0]);
}

#[test]
fn words_of_axes_that_the_machine_has_not_are_refused() {
    for word in ["A0", "B1", "C1"] {
        let error = run_on("tripod", &format!("G20\nG0 {word} Z3\nM2\n")).unwrap_err();
        let letter = &word[..1].to_lowercase();
        assert!(error.contains(&format!("Bad character '{letter}' used")), "{error}");
    }
}

#[test]
fn motion_without_a_feed_is_refused_and_motion_of_the_spindle_needs_none() {
    for (text, reported) in [
        ("G20\nG1 X1\nM2\n", "Cannot do g1 with zero feed rate"),
        ("G20\nG2 X1 I0.5\nM2\n", "Cannot make arc with zero feed rate"),
        ("G20\nG38.2 X1\nM2\n", "Cannot probe with zero feed rate"),
    ] {
        let error = run(text, None).unwrap_err();
        assert!(error.contains(reported) && error.contains("p.ngc:2:"), "{error}");
    }
    for block in ["G33 X1 K1", "G76 P1 Z200 I-1 J0.1 K0.5"] {
        let steps = run(&format!("G21\nM3 S60\n{block}\nM2\n"), None).unwrap();
        let threads = steps.iter().filter(|step| step.kind == MoveKind::Feed);
        assert!(threads.clone().count() > 0 && threads.clone().all(|step| step.feed.is_infinite()));
    }
}

#[test]
fn feed_per_turn_is_multiplied_by_the_speed_of_the_spindle() {
    let steps = run("M3 S600\nG95 G1 X10 F0.1\nG94 X20 F60\nM2\n", None).unwrap();
    let feeds: Vec<f64> = steps.iter().map(|step| step.feed).collect();
    // 0.1 mm per turn, 10 turns per second; then 60 mm per minute.
    assert!(feeds.len() == 2 && feeds.iter().all(|feed| (feed - 1.0).abs() < 1e-12), "{feeds:?}");
}

#[test]
fn lathe_cycles_have_the_line_of_their_block() {
    let contour = "o100 sub\nG0 X5\nG1 Z220\nX10\no100 endsub\n";
    let text = format!("G18 G7 F100\nG0 X20 Z230\n{contour}G71 Q100 X20 Z230 D1\nM2\n");
    let steps = run(&text, None).unwrap();
    assert!(steps.len() > 3, "{steps:?}");
    assert!(steps.iter().all(|step| (1..=8).contains(&step.line)), "{steps:?}");
}

#[test]
fn a_parameter_file_out_of_order_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (program, file) = (folder.path().join("p.ngc"), folder.path().join("p.var"));
    std::fs::write(&program, "G0 X1\nM2\n").unwrap();
    std::fs::write(&file, "5161\t0.0\n5221\t1.0\n5220\t1\n").unwrap();
    let mut config = config(folder.path());
    let facts = Arc::make_mut(&mut config.facts);
    (facts.program.tool_table, facts.program.parameter_file) = (None, Some(file));
    let error = moves(&config.clone().into(), &program, None).unwrap_err().to_string();
    assert!(error.contains("Parameter file out of order"), "{error}");
}

#[test]
fn without_a_parameter_file_offsets_are_those_that_linuxcnc_keeps_beside_the_machine() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(test_support::shipped::ini("hexapod")).unwrap();
    let program = folder.path().join("p.ngc");
    std::fs::write(&program, "G21 G54 G0 X1\nM2\n").unwrap();
    std::fs::write(folder.path().join("rs274ngc.var"), "5220\t1\n5221\t7\n").unwrap();
    for line in ["", "PARAMETER_FILE =", "PARAMETER_FILE = own.var"] {
        let ini = folder.path().join("hexapod.ini");
        std::fs::write(&ini, text.replace("PARAMETER_FILE = hexapod.var", line)).unwrap();
        let mut config = test_support::shipped::first_of(&ini);
        Arc::make_mut(&mut config.facts).program.tool_table = None;
        let steps = moves(&config.clone().into(), &program, None).unwrap();
        let expected = if line.ends_with("own.var") { 1.0 } else { 8.0 };
        let off = steps.last().unwrap().end[0] - expected;
        assert!(off.abs() <= ROUNDING_MM, "{line:?}: {steps:?}");
    }
}

#[test]
fn loops_without_an_end_end() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("p.ngc");
    let mut config = config(folder.path());
    Arc::make_mut(&mut config.facts).program.tool_table = None;
    let options = Options { most_moves: 1000, most_work: 3.0, ..Options::default() };
    let options = bounded(options);
    let reported = |body: &str| {
        std::fs::write(&program, format!("F100\nO1 while [1]\n{body}\nO1 endwhile\nM2\n")).unwrap();
        let judged = judge(&config.clone().into(), &program, &options, &mut |_| ());
        match judged {
            Ok(judged) => format!("{:?}", judged.found.time),
            Err(error) => error.to_string(),
        }
    };
    for body in ["G1 X1\nX0", "G91 G1 X0.001"] {
        let text = reported(body);
        assert!(text.contains("more than 1000 moves"), "{text}");
    }
    let text = reported("#1=[#1+1]");
    assert!(text.contains("without a move"), "{text}");
}

/// A program that calls `away`, in a file of its own, and the machine that finds it; both files are in the folder.
struct TwoFiles {
    _folder: tempfile::TempDir,
    config: MachineConfig,
    files: [PathBuf; 2],
}

fn two_files(main: &str, away: &str) -> TwoFiles {
    let folder = tempfile::tempdir().unwrap();
    let text =
        std::fs::read_to_string(test_support::shipped::folder("hexapod").join("hexapod.ini"))
            .unwrap();
    let ini = folder.path().join("hexapod.ini");
    let path = folder.path().display();
    let head = format!("[RS274NGC]\nSUBROUTINE_PATH = {path}");
    std::fs::write(&ini, text.replacen("[RS274NGC]", &head, 1)).unwrap();
    let mut config = test_support::shipped::first_of(&ini);
    let facts = Arc::make_mut(&mut config.facts);
    (facts.program.tool_table, facts.program.parameter_file) = (None, None);
    let program = folder.path().join("p.ngc");
    std::fs::write(&program, format!("{main}\nM2\n")).unwrap();
    let file = folder.path().join("away.ngc");
    std::fs::write(&file, format!("o<away> sub\n{away}\no<away> endsub\nM2\n")).unwrap();
    TwoFiles { _folder: folder, config: config.into(), files: [program, file] }
}

/// Returns X, line and file of the moves of a program that calls `away`, in a file of its own.
fn places_in_two_files(main: &str, away: &str) -> Vec<(f64, u32, usize)> {
    let TwoFiles { config, files, .. } = &two_files(main, away);
    let steps = moves(config, &files[0], None).unwrap();
    let judged = judge(config, &files[0], &Options::default(), &mut |_| ());
    assert_eq!(judged.unwrap().files, *files);
    steps[1..].iter().map(|step: &Move| (step.end[0].round(), step.line, step.file)).collect()
}

#[test]
fn lines_of_subroutines_belong_to_their_files() {
    // The same line number in both files.
    let main = "M3 S60\nG0 X2\no<away> call\nG0 X4\nG33.1 Z240 K1";
    let places = places_in_two_files(main, "G0 X3\nG33.1 Z240 K1\nG38.3 X2 F100");
    // A tap returns to its start.
    let expected = [
        (2.0, 2, 0),
        (3.0, 2, 1),
        (3.0, 3, 1),
        (3.0, 3, 1),
        (2.0, 4, 1),
        (4.0, 4, 0),
        (4.0, 5, 0),
        (4.0, 5, 0),
    ];
    assert_eq!(places, expected);
}

#[test]
fn stops_belong_to_the_file_of_their_line() {
    let stop = |main: &str, away: &str| {
        let TwoFiles { config, files, .. } = &two_files(main, away);
        let judged = judge(config, &files[0], &Options::default(), &mut |_| ()).unwrap();
        let stops = judged.found.breaks.into_iter().filter(|found| found.limit == Rule::Control);
        stops.map(|found| (found.line, found.file)).collect::<Vec<_>>()
    };
    let fine = "G0 X2\nG1 F600 X0";
    // The motion refuses a move, or the interpreter a block, while the file of the subroutine is executed.
    assert_eq!(stop("G21 G90\no<away> call\nG1 X500 F600", fine), [(3, 0)]);
    assert_eq!(stop("G21 G90\no<away> call\nG1 X#<_none> F600", fine), [(3, 0)]);
    assert_eq!(stop("G21 G90\no<away> call", "G0 X2\nG1 X500 F600"), [(3, 1)]);
    // The interpreter has left the subroutine when it reports the error: the line is that of the call.
    let bad = "G0 X2\nX3\nG1 X#<_none> F600";
    assert_eq!(stop("G21 G90\nG0 X5\no<away> call", bad), [(3, 0)]);
}

#[test]
fn moves_that_cutter_compensation_holds_back_belong_to_the_file_of_their_line() {
    // Line 3 of the subroutine is executed while the program's line 3 is read, that line while line 4 is, line 6 with
    // G40.
    let main = "G42.1 D4 F600\no<away> call\nG1 Y20\nG0 X-9\n(rest)\nG1 Y30 X-20\nG40\nG1 X-40";
    let places = places_in_two_files(main, "G1 X10 Y-5\nG1 X30");
    // Arcs around the corners consist of many steps.
    let ends = places.chunk_by(|a, b| (a.1, a.2) == (b.1, b.2)).filter_map(|steps| steps.last());
    let expected =
        [(9.0, 2, 1), (30.0, 3, 1), (32.0, 3, 0), (-8.0, 4, 0), (-19.0, 6, 0), (-40.0, 8, 0)];
    assert_eq!(ends.copied().collect::<Vec<_>>(), expected);
}

/// Returns the deviations of a program from its path, as in the verdict.
fn off_path(text: &str) -> Vec<(u32, String)> {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("p.ngc");
    std::fs::write(&program, text).unwrap();
    let config = config(&test_support::shipped::folder("hexapod").join("hexapod.tbl"));
    let judged = judge(&config.clone().into(), &program, &Options::default(), &mut |_| ());
    let found = judged.unwrap().found;
    found.breaks.into_iter().map(|found| (found.line, found.text)).collect()
}

#[test]
fn a_thread_that_needs_more_than_the_fastest_feed_gets_another_pitch() {
    // The hexapod's axes reach 200 mm/s: 3000 turns per minute of 4 mm.
    let thread = |spindle: &str, block: &str| {
        off_path(&format!("G21 G90 M52 P1\nG0 X60 Z250\n{spindle} M3\n{block}\nM2\n"))
    };
    for (spindle, block, needed) in [
        ("S3300", "G33 Z230 K4", Some("220.000")),
        ("S3000", "G33 Z230 K4", None),
        ("S3300", "G33.1 Z230 K4", Some("220.000")),
        // The way back is ten times as fast as the way in.
        ("S330", "G33.1 Z230 K4 I10", Some("220.000")),
        ("S330", "G33.1 Z230 K4", None),
        // A constant surface speed increases the spindle speed near the axis: 400 m/min are 1273 turns at 50 mm, 6366
        // at 10 mm.
        ("G96 D9000 S400", "G33 X50 Z230 K4", None),
        ("G96 D9000 S400", "G33 X10 Z230 K4", Some("424.413")),
        ("G96 D2000 S400", "G33 X10 Z230 K4", None),
        // A feed per turn alone is not a thread.
        ("S3300", "G95 G1 Z230 F4", None),
    ] {
        let found = thread(spindle, block);
        match needed {
            None => assert_eq!(found, [], "{spindle} {block}"),
            Some(needed) => {
                let [(4, text)] = found.as_slice() else { panic!("{spindle} {block}: {found:?}") };
                assert!(text.contains(&format!("need {needed} mm/s")), "{text}");
            }
        }
    }
}

/// Returns the positions in X, each the end of a separate move, and the state of the spindle there.
fn spindles(text: &str) -> Vec<(f64, Spindle)> {
    let steps = run(text, None).unwrap();
    steps.iter().map(|step| (step.end[0].round(), step.spindle)).collect()
}

#[test]
fn the_spindle_of_a_move_is_that_of_the_blocks_before_it_and_of_its_own_words() {
    use Spindle::{Standing, Surface, Turning};
    let text = "G21 F100\nG1 X1\nS1000\nG1 X2\nM3\nG1 X3\nM5\nG1 X4\nS7 M4 G1 X5\nG1 X6 S8 (S9 M5)\n\
                G96 D3000 S200\nG1 X7\nG97 S60 G1 X8\nS0\nG1 X9\nM2\n";
    let expected = [
        (1.0, Standing(0.0)),
        (2.0, Standing(1000.0)),
        (3.0, Turning(1000.0)),
        (4.0, Standing(1000.0)),
        (5.0, Turning(7.0)),
        (6.0, Turning(8.0)),
        (7.0, Surface),
        (8.0, Turning(60.0)),
        (9.0, Turning(0.0)),
    ];
    assert_eq!(spindles(text), expected);
}

#[test]
fn the_spindle_follows_loops_and_subroutines_as_they_run() {
    use Spindle::{Standing, Turning};
    // The same line moves at another speed each time; the subroutine moves nothing.
    let text = "o1 sub\nM5\no1 endsub\nG21 F100\n#1=0\nM3\no2 while [#1 lt 3]\n#1=[#1+1]\n\
                S[1000*#1]\nG1 X#1\no2 endwhile\no1 call\nG1 X4\nM2\n";
    let expected = [
        (1.0, Turning(1000.0)),
        (2.0, Turning(2000.0)),
        (3.0, Turning(3000.0)),
        (4.0, Standing(3000.0)),
    ];
    assert_eq!(spindles(text), expected);
}

/// Moves with an active work offset O that is neither zero nor level, changed to R(turn) O + shift.
#[test]
fn the_block_of_an_offset_turns_and_shifts_the_active_one() {
    let folder = tempfile::tempdir().unwrap();
    let (program, file) = (folder.path().join("p.ngc"), folder.path().join("p.var"));
    std::fs::write(&program, "G21 G0 X7 Y2 Z10\nM2\n").unwrap();
    std::fs::write(&file, "5220\t1\n5221\t30\n5222\t-20\n5223\t210\n5230\t10\n").unwrap();
    let mut config = config(folder.path());
    let facts = Arc::make_mut(&mut config.facts);
    (facts.program.tool_table, facts.program.parameter_file) = (None, Some(file));
    let turned = |degrees: f64, [x, y]: [f64; 2]| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [x * cos - y * sin, x * sin + y * cos]
    };
    for turn in [0.0, 25.0, -115.0] {
        let offset = Offset { shift: [3.0, -4.0, 5.0], turn };
        let steps = moves(&config.clone().into(), &program, Some(&offset.block())).unwrap();
        let (origin, at) = (turned(turn, [30.0, -20.0]), turned(turn + 10.0, [7.0, 2.0]));
        let [x, y] = [origin[0] + at[0] + 3.0, origin[1] + at[1] - 4.0];
        assert_end(steps.last().unwrap(), [x, y, 225.0, 0.0, 0.0, 0.0]);
    }
}
