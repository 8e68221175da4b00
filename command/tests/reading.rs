// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs that mean something else to a reader that is not the control: LinuxCNC alone reads them.

use crate::shipped;
use std::ops::ControlFlow;
use std::path::Path;
use workbench::control::process::Options;
use workbench::program::findings::Preflight;
use workbench::program::preflight::judge;
use workbench::read::machine::MachineConfig;

/// What is known of a program on a machine as it is shipped, its INI file edited.
fn judged(machine: &str, edit: impl Fn(String) -> String, text: &str) -> Preflight {
    let folder = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(shipped::folder(machine)).unwrap().flatten() {
        if entry.path().is_file() {
            std::fs::copy(entry.path(), folder.path().join(entry.file_name())).unwrap();
        }
    }
    let ini = folder.path().join(format!("{machine}.ini"));
    std::fs::write(&ini, edit(std::fs::read_to_string(&ini).unwrap())).unwrap();
    let program = folder.path().join("p.ngc");
    std::fs::write(&program, text).unwrap();
    let config = MachineConfig::read(&ini).unwrap();
    run(&config, &program)
}

fn run(config: &MachineConfig, program: &Path) -> Preflight {
    judge(config, program, &Options::default(), &mut |_| ControlFlow::Continue(())).unwrap().found
}

/// Lines of the limits that a program leaves on the hexapod, each once.
fn lines(text: &str) -> Vec<u32> {
    lines_of("hexapod", |ini| ini, text)
}

fn lines_of(machine: &str, edit: impl Fn(String) -> String, text: &str) -> Vec<u32> {
    let found = judged(machine, edit, &format!("{text}\nM2\n"));
    let mut lines: Vec<u32> = found.breaks.iter().map(|told| told.line).collect();
    lines.sort_unstable();
    lines.dedup();
    lines
}

#[test]
fn what_hangs_on_the_state_of_the_task_is_what_the_task_has() {
    assert_eq!(lines("G21 G90\no1 if [#<_task> EQ 1]\nG0 X160\no1 endif"), [3]);
    assert_eq!(lines("G21 G90\no1 if [#<_task> EQ 0]\nG0 X160\no1 endif"), [0; 0]);
    let pocket = "T1 M6\no1 if [#<_current_pocket> EQ 1]\nG0 X160\no1 endif";
    assert_eq!(lines(&format!("G21 G90\n{pocket}")), [4]);
    // Tool 1 is in the spindle from here on, whatever was there before.
    assert_eq!(lines("G21 G90\nT1 M6\nG0 X[120 + 40 * #<_current_tool>]"), [3]);
}

#[test]
fn lines_with_a_slash_are_judged_both_ways() {
    assert_eq!(lines("G21 G90\n/G0 X160"), [2]);
    assert_eq!(lines("G21 G90\n/G91\nG0 X100\nG0 X60"), [4]);
    // Only without the line it is too far.
    assert_eq!(lines("G21 G91\nG0 X100\n/G0 X-100\nG0 X60"), [4]);
    assert_eq!(lines("G21 G90\n/G0 X10\nG0 X20"), [0; 0]);
}

#[test]
fn the_position_after_a_tool_change_is_the_machines() {
    let tool = "G21 G90 G54\nT1 M6 G43\n";
    for (block, expected) in [
        ("G0 X10 Y10 Z300\nG91 G0 Z60\nG90", [0; 0].as_slice()),
        ("G0 X10 Z300\nG91 G0 Z110\nG90", &[4]),
        ("G10 L20 P1 X5\nG0 X150", &[]),
        ("G10 L20 P1 X-5\nG0 X150", &[4]),
        ("G92 Z50\nG0 Z60", &[]),
        ("G92 Z50\nG0 Z210", &[4]),
        ("#1=#5420\nG0 X[#1 + 100]", &[]),
        ("G17 F600\nG2 I20", &[]),
        ("F600 G0 X120\nG17 G2 I20", &[4]),
    ] {
        assert_eq!(lines(&format!("{tool}{block}")), expected, "{block}");
    }
    // Without a word of Z it stays where it is.
    let one_block = "G21 G90\nT1 M6 G43\nG0 Z320\nT2 M6 G43\nG1 F600 X5";
    assert_eq!(lines(one_block), [0; 0]);
}

#[test]
fn moves_that_the_control_adds_are_judged() {
    let at = |place: &str| {
        let line = format!("[EMCIO]\nTOOL_CHANGE_POSITION = {place}");
        move |ini: String| ini.replace("[EMCIO]", &line)
    };
    let change = "G21 G90\nG0 X10 Z200\nT1 M6";
    assert_eq!(lines_of("hexapod", at("100 100 120 -24 20 0"), change), [3]);
    assert_eq!(lines_of("hexapod", at("10 10 300"), change), [0; 0]);
    // LinuxCNC's own message names the line of the move before.
    assert_eq!(lines_of("hexapod", at("10 10 410"), change), [2, 3]);
    // The next move starts there.
    let next = format!("{change}\nG91 G0 Z110");
    assert_eq!(lines_of("hexapod", at("10 10 300"), &next), [4]);
}

#[test]
fn where_the_control_leaves_the_path_is_seen() {
    // Without a tolerance corners are rounded as far as the speed asks for.
    let corner = "G0 X0 Y0\nG1 F6000 X40\nY40\nX0";
    let found = judged("hexapod", |ini| ini, &format!("G21 G90 G64\n{corner}\nM2\n"));
    assert!(found.breaks.is_empty() && found.off_path.is_empty(), "{:?}", found.breaks);
    let exact = judged("hexapod", |ini| ini, &format!("G21 G90 G61\n{corner}\nM2\n"));
    assert!(exact.breaks.is_empty() && exact.off_path.is_empty(), "{:?}", exact.off_path);
    // A helix of many turns that naive CAM detection takes for a plunge.
    let helix = "G0 X1 Y0 Z300\nG1 F600\nG3 X1 Y0 Z280 I-0.01 J0 P15";
    let found = judged("hexapod", |ini| ini, &format!("G21 G90 G64 P0.1 Q0.1\n{helix}\nM2\n"));
    assert!(found.breaks.iter().any(|told| told.line == 4), "{:?}", found.breaks);
    assert_eq!(lines(&format!("G21 G90 G61\n{helix}")), [0; 0]);
    // A tap runs on until the spindle has stopped.
    let tap = "G0 X0 Y0 Z110\nM3 S600\nG33.1 Z100.5 K1\nM5";
    assert_eq!(lines(&format!("G21 G90\n{tap}")), [4]);
}

#[test]
fn startup_code_that_uses_the_position_has_the_machines() {
    let startup = |code: &str| {
        let line = format!("\nRS274NGC_STARTUP_CODE = {code}\n");
        move |ini: String| {
            let begin = ini.find("\nRS274NGC_STARTUP_CODE").unwrap();
            let end = begin + 1 + ini[begin + 1..].find('\n').unwrap() + 1;
            format!("{}{line}{}", &ini[..begin], &ini[end..])
        }
    };
    for (code, program, expected) in [
        ("G21 G90 G92 Z50", "G1 F2000 X20 Z200", [0; 0].as_slice()),
        ("G21 G90 G10 L20 P1 Z0", "G1 F2000 X20 Z10", &[]),
        ("G21 G90 G28.1", "G28", &[]),
    ] {
        assert_eq!(lines_of("hexapod", startup(code), program), expected, "{code}");
    }
}

#[test]
fn all_limits_are_listed_beyond_the_first_stop() {
    let found = lines("G21 G90\nG0 X160\nG0 X0\nG0 Z90\nG0 Z250\nG0 B26\nG0 B0");
    assert_eq!(found, [2, 4, 6]);
}

#[test]
fn axes_that_move_nothing_of_the_tool_are_judged_alone() {
    assert_eq!(lines_of("lathe-counter-spindle", |ini| ini, "G21 G90\nG0 C90\nG0 C0"), [0; 0]);
    assert_eq!(lines_of("lathe-counter-spindle", |ini| ini, "G21 G90\nG0 C999999"), [2]);
}
