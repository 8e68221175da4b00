// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNCs whose commands to motion are laid out in an unknown way are refused: tests/milltask.cc differs in one field.

use std::env;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn library() -> PathBuf {
    let installed = || "/usr/lib/linuxcnc/modules/libpkmkins-virtual.so".into();
    env::var_os("PKM_VIRTUAL_LIBRARY").map_or_else(installed, PathBuf::from)
}

fn compile(folder: &Path, options: &[&str]) -> PathBuf {
    // The library acts in a program of this name only.
    let program = folder.join("pkm-control");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/milltask.cc");
    let mut compiler = Command::new("g++");
    compiler.args(["-std=c++17", "-rdynamic", "-o"]).arg(&program).args(options).arg(source);
    assert!(compiler.status().expect("g++").success());
    program
}

/// Returns why the library ends the program, as its last record says.
fn reason(program: &Path, fault: &str) -> String {
    // While the library measures, it suppresses standard output and standard error.
    let mut control = Command::new("sh")
        .args(["-c", "exec \"$0\" 3>&1 >/dev/null"])
        .arg(program)
        .env("LD_PRELOAD", library())
        .env("PKMKINS_VIRTUAL_FOLDER", program.parent().unwrap())
        .env("PKMKINS_VIRTUAL_STREAM", "3")
        .env("FAULT", fault)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    // The configuration has no steps.
    control.stdin.take().unwrap().write_all(b"done\n").unwrap();
    String::from_utf8_lossy(&control.wait_with_output().unwrap().stdout).into_owned()
}

#[test]
fn a_field_at_an_unknown_place_is_refused_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let program = compile(folder.path(), &[]);
    // With all fields known, the next thing is missing.
    let text = reason(&program, "");
    assert!(text.contains("this LinuxCNC has no pin motion.tooloffset.x"), "{text}");
    for (fault, named) in [
        ("vel", "vel"),
        ("ini_maxvel", "ini_maxvel"),
        ("pos", "pos"),
        ("minLimit", "limits of axes"),
        ("tag", "the tag of a move"),
        ("css_factor", "css_factor"),
        ("xoffset", "the status of a spindle"),
        ("state", "the state of a spindle"),
        // Motion sets the speed to zero.
        ("limit", "the status of a spindle"),
        ("orient_state", "the orientation of a spindle"),
        ("code", "the code of a command"),
        ("number", "the code of a command"),
    ] {
        let text = reason(&program, fault);
        let expected =
            format!("this LinuxCNC passes commands to motion in an unknown way ({named})");
        assert!(text.contains(&expected), "{fault}: {text}");
    }
}

#[test]
fn a_milltask_without_a_function_is_refused_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let program = compile(folder.path(), &["-DWITHOUT_TAG"]);
    let text = reason(&program, "");
    assert!(text.contains("in an unknown way (_Z16emcTrajUpdateTagRK8StateTag)"), "{text}");
}
