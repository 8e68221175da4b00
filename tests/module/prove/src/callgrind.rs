// SPDX-License-Identifier: GPL-2.0-or-later
//! Instructions counted by valgrind's callgrind, per call.
//!
//! Callgrind counts while one of the module's functions runs, except LinuxCNC's `rtapi_print_msg`.
//! The measured program writes the count into valgrind's log before and
//! after each call. (If callgrind dumps its counts after each call, the result is the same, but
//! it takes a hundred times as long.)

use std::arch::asm;
use std::path::Path;
use std::process::Command;

/// The client request that runs a monitor command (valgrind.h).
const MONITOR_COMMAND: u64 = 0x1202;

/// The client request that makes callgrind start to trace instructions (callgrind.h).
const START_INSTRUMENTATION: u64 = 0x4354_0004;

/// Functions during which callgrind counts: the entry points of the module.
const COUNTED: [&str; 5] = [
    "kinematicsForward",
    "kinematicsInverse",
    "kinematicsJacobian",
    "*pkmkins*abi*monitor*",
    // Called by the others, this stops the count.
    "rtapi_print_msg",
];

/// Sends a request to valgrind; does nothing without valgrind.
fn request(number: u64, argument: u64) {
    let request = [number, argument, 0, 0, 0, 0];
    // SAFETY: valgrind.h's sequence for amd64: four rotations whose composition is the identity,
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

/// Starts callgrind, because the preparation before would take ten times as long under it.
pub fn begin() {
    request(START_INSTRUMENTATION, 0);
}

/// Counts the module's instructions in `call`; calls are numbered in order.
pub fn counted<T>(call: impl FnOnce() -> T) -> T {
    request(MONITOR_COMMAND, c"status internal".as_ptr() as u64);
    let result = call();
    request(MONITOR_COMMAND, c"status internal".as_ptr() as u64);
    result
}

/// Runs this program again under callgrind with these arguments; returns the counts of all calls.
/// # Errors
/// A message for the user.
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

/// Returns the differences between every second count of a log and the one before.
fn parsed(log: &str) -> Vec<u64> {
    let counts: Vec<u64> = log
        .lines()
        .filter_map(|line| line.strip_prefix("events-1: "))
        .filter_map(|count| count.trim().parse().ok())
        .collect();
    counts.chunks_exact(2).map(|pair| pair[1] - pair[0]).collect()
}
