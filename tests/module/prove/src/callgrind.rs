// SPDX-License-Identifier: GPL-2.0-or-later
//! Instructions counted by valgrind's callgrind, call by call.
//!
//! Callgrind counts while one of the module's functions runs, LinuxCNC's `rtapi_print_msg`
//! aside. The program that is measured has the count written into valgrind's log before and
//! after each call. (To have callgrind dump its counts after each call gives the same and
//! takes a hundred times as long.)

use std::arch::asm;
use std::path::Path;
use std::process::Command;

/// The client request that runs a monitor command (valgrind.h).
const MONITOR_COMMAND: u64 = 0x1202;

/// The client request from which on callgrind looks at instructions (callgrind.h).
const START_INSTRUMENTATION: u64 = 0x4354_0004;

/// Functions while which is counted: the entry points of the module.
const COUNTED: [&str; 5] = [
    "kinematicsForward",
    "kinematicsInverse",
    "kinematicsJacobian",
    "*pkmkins*abi*monitor*",
    // Inside the others this stops the count.
    "rtapi_print_msg",
];

/// Asks valgrind for something; does nothing outside.
fn request(number: u64, argument: u64) {
    let request = [number, argument, 0, 0, 0, 0];
    // SAFETY: valgrind.h's sequence for amd64: four rotations that together change nothing,
    // and an exchange of a register with itself. The request is only read.
    unsafe {
        asm!(
            "rol rdi, 3", "rol rdi, 13", "rol rdi, 61", "rol rdi, 51", "xchg rbx, rbx",
            in("rax") request.as_ptr(),
            inout("rdx") 0_u64 => _,
            inout("rdi") 0_u64 => _,
        );
    }
}

/// Lets callgrind begin: what is read and made before would take it ten times as long.
pub fn begin() {
    request(START_INSTRUMENTATION, 0);
}

/// Counts what the module does in `call`; calls are numbered as they come.
pub fn counted<T>(call: impl FnOnce() -> T) -> T {
    request(MONITOR_COMMAND, c"status internal".as_ptr() as u64);
    let result = call();
    request(MONITOR_COMMAND, c"status internal".as_ptr() as u64);
    result
}

/// Runs this program again under callgrind with these arguments; the counts of all calls.
/// # Errors
/// Words for whoever runs it.
pub fn run(arguments: &[&str], folder: &Path) -> Result<Vec<u64>, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let log = folder.join("log");
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--instr-atstart=no", "--collect-atstart=no"])
        .args(COUNTED.map(|name| format!("--toggle-collect={name}")))
        .arg(format!("--callgrind-out-file={}", folder.join("callgrind").display()))
        .arg(format!("--log-file={}", log.display()))
        .arg(program)
        .args(arguments)
        .output()
        .map_err(|e| format!("valgrind does not start ({e}): install it"))?;
    if !run.status.success() {
        return Err(String::from_utf8_lossy(&run.stderr).into_owned());
    }
    let text = std::fs::read_to_string(log).map_err(|e| e.to_string())?;
    Ok(parsed(&text))
}

/// The differences between every second count of a log and the one before.
fn parsed(log: &str) -> Vec<u64> {
    let counts: Vec<u64> = log
        .lines()
        .filter_map(|line| line.strip_prefix("events-1: "))
        .filter_map(|count| count.trim().parse().ok())
        .collect();
    counts.chunks_exact(2).map(|pair| pair[1] - pair[0]).collect()
}
