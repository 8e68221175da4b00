// SPDX-License-Identifier: GPL-2.0-or-later
//! Every check detects the fault that it is for, and reports nothing without a fault.

use prove::built::Built;
use prove::checks::{Check, checks};
use prove::contract::Contract;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

const CONTRACT: &str = include_str!("../planted/contract.toml");

/// A temporary file of the test, which is deleted when the test ends.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Scratch {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!("pkmkins-planted-{}-{number}.so", std::process::id());
        Scratch(std::env::temp_dir().join(name))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("planted").join(name)
}

fn checked(command: &mut Command, file: &Scratch, contract: &str) -> Vec<Check> {
    let output = command.arg("-o").arg(&file.0).output().expect("the compiler starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let data = std::fs::read(&file.0).expect("the library was made");
    let contract = Contract::parse(contract).expect("a contract");
    checks(&Built::read(&data).expect("a library"), &contract)
}

/// Runs the checks of clean.c with these options of the compiler.
fn of_c(options: &[&str], contract: &str) -> Vec<Check> {
    let mut command = Command::new("gcc");
    command.args(["-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-Wl,-z,lazy"]);
    // gcc would split functions in two, which the module's compiler does not.
    command.arg("-fno-reorder-blocks-and-partition");
    checked(command.args(options).arg(source("clean.c")), &Scratch::new(), contract)
}

/// Runs the checks of panics.rs with these options of the compiler.
fn of_rust(options: &[&str]) -> Vec<Check> {
    let mut command = Command::new(std::env::var_os("RUSTC").unwrap_or("rustc".into()));
    command.args(["--crate-type=cdylib", "--edition=2024", "-Copt-level=3", "-Cpanic=abort"]);
    command.args(["-Clto=fat", "-Crelro-level=partial"]).args(options).arg(source("panics.rs"));
    checked(&mut command, &Scratch::new(), CONTRACT)
}

fn failed(checks: &[Check]) -> Vec<&str> {
    checks.iter().filter(|c| !c.complaints.is_empty()).map(|c| c.name.as_str()).collect()
}

fn assert_clean(checks: &[Check]) {
    let complaints: Vec<&String> = checks.iter().flat_map(|c| &c.complaints).collect();
    assert!(complaints.is_empty(), "{complaints:?}");
}

/// Asserts that the planted fault fails these checks and no other, and that the complaints name it.
fn assert_caught(checks: &[Check], expected: &[&str], name: &str) {
    assert_eq!(failed(checks), expected, "{checks:?}");
    for check in checks.iter().filter(|c| !c.complaints.is_empty()) {
        assert!(check.complaints.iter().any(|c| c.contains(name)), "{check:?}");
    }
}

#[test]
fn a_library_that_keeps_its_contract_passes() {
    assert_clean(&of_c(&[], CONTRACT));
    assert_clean(&of_c(&["-O1", "-fcf-protection=full"], CONTRACT));
    assert_clean(&of_c(&["-fno-plt"], CONTRACT));
    assert_clean(&of_rust(&[]));
}

fn stack_of_run(checks: &[Check]) -> u64 {
    assert_clean(checks);
    let check = checks.iter().find(|c| c.name == "stack of run").expect("it is an entry");
    check.found.trim_end_matches(" bytes").parse().expect("a number")
}

#[test]
fn frames_opened_page_by_page_are_measured() {
    // 1000 values of eight bytes, plus calls and saved registers.
    let plain = stack_of_run(&of_c(&["-fno-stack-clash-protection"], CONTRACT));
    assert!((8000..8300).contains(&plain), "{plain}");
    assert_eq!(stack_of_run(&of_c(&["-fstack-clash-protection"], CONTRACT)), plain);
}

#[test]
fn aligned_frames_are_measured() {
    let plain = stack_of_run(&of_rust(&["--cfg", "wide"]));
    assert!((8000..8300).contains(&plain), "{plain}");
    // The loss by alignment, and sizes of this frame and its neighbor rounded up to 64.
    let aligned = stack_of_run(&of_rust(&["--cfg", "wide", "--cfg", "aligned"]));
    assert!((plain + 56..plain + 56 + 2 * 64).contains(&aligned), "{aligned} {plain}");
}

#[test]
fn a_panic_is_caught() {
    let checks = of_rust(&["--cfg", "planted"]);
    let failed = failed(&checks);
    assert!(failed.contains(&"panic machinery"), "{failed:?}");
    assert!(failed.contains(&"imported symbols"), "{failed:?}");
    let complaints = format!("{checks:?}");
    assert!(complaints.contains("panic_bounds_check"), "{complaints}");
    assert!(complaints.contains("pkmkins_has_a_panic_path is called"), "{complaints}");
}

/// The calls of libc's start files depend on its release, so they are not tested; one fault has one location.
#[test]
fn imports_are_caught_by_name_and_by_when_they_are_called() {
    let checks = of_c(&["-DIMPORT_MALLOC"], CONTRACT);
    let three = ["imported symbols", "allocators", "imports called in the servo thread"];
    assert_caught(&checks, &three, "malloc");
    let checks = of_c(&["-DIMPORT_ABORT"], CONTRACT);
    let three = ["imported symbols", "panic machinery", "imports called in the servo thread"];
    assert_caught(&checks, &three, "abort");
    let checks = of_c(&["-DPIN_AT_RUN"], CONTRACT);
    assert_caught(&checks, &["imports called in the servo thread"], "make_pin");
}

#[test]
fn an_import_that_one_version_of_linuxcnc_lacks_is_caught() {
    let older = CONTRACT.replace("[\"make_pin\", \"print\"]", "[\"print\"]");
    let check = ["symbols that LinuxCNC 2 lacks"];
    assert_caught(&of_c(&[], &older), &check, "LinuxCNC 2 has no make_pin");
}

#[test]
fn an_allowance_without_a_reason_or_without_use_is_caught() {
    let silent = CONTRACT.replace("\"prints\"", "\"\"");
    assert_caught(&of_c(&[], &silent), &["imported symbols"], "print is allowed without a reason");
    let idle = format!("{CONTRACT}\n[[import]]\nname = \"sin\"\nwhen = \"run\"\nreason = \"x\"\n");
    assert_caught(&of_c(&[], &idle), &["imported symbols"], "sin is no longer imported");
}

#[test]
fn an_export_too_many_or_too_few_is_caught() {
    assert_caught(&of_c(&["-DEXTRA_EXPORT"], CONTRACT), &["exported symbols"], "also");
    let more = CONTRACT.replace("data = []", "data = [\"licence\"]");
    assert_caught(&of_c(&[], &more), &["exported symbols"], "licence is promised");
}

#[test]
fn a_function_handed_out_is_caught() {
    let more = CONTRACT.replace("data = []", "data = [\"handed\"]");
    assert_caught(&of_c(&["-DHANDED_OUT"], &more), &["entry points"], "square");
}

#[test]
fn recursion_is_caught() {
    assert_caught(&of_c(&["-DRECURSION"], CONTRACT), &["recursive functions"], "again");
}

#[test]
fn a_call_through_a_pointer_is_caught() {
    let more = CONTRACT.replace("data = []", "data = [\"given\"]");
    assert_caught(&of_c(&["-DPOINTER_CALL"], &more), &["paths and callees"], "through a pointer");
}

#[test]
fn a_large_or_growing_frame_is_caught() {
    assert_caught(&of_c(&["-DBIG_FRAME"], CONTRACT), &["stack of run"], "run > many");
    assert_caught(&of_c(&["-DGROWING_FRAME"], CONTRACT), &["paths and callees"], "stack pointer");
}

#[test]
fn traps_and_system_calls_are_caught() {
    for (option, name) in [("-DTRAP", "trap in run"), ("-DSYSTEM_CALL", "system call in run")] {
        assert_caught(&of_c(&[option], CONTRACT), &["traps, system calls"], name);
    }
}

#[test]
fn memory_and_links_that_are_not_safe_are_caught() {
    for (options, check, name) in [
        (&["-Wl,-z,execstack"][..], "executable stack", "executable stack"),
        (&["-DTEXT_RELOCATION", "-Wl,-z,notext"], "text relocations", "changes code"),
        (&["-Wl,-z,now"], "symbols looked up", "outside real time"),
        (&["-nodefaultlibs", "-Wl,-N"], "writable and executable memory", "written and executed"),
    ] {
        assert_caught(&of_c(options, CONTRACT), &[check], name);
    }
}

#[test]
fn a_file_without_symbols_is_refused() {
    let file = Scratch::new();
    let mut command = Command::new("gcc");
    command.args(["-O2", "-shared", "-fPIC", "-s"]).arg(source("clean.c"));
    assert!(command.arg("-o").arg(&file.0).status().expect("gcc starts").success());
    let data = std::fs::read(&file.0).expect("the library was made");
    assert!(Built::read(&data).err().expect("nothing to go by").contains("make module"));
}
