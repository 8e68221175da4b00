// SPDX-License-Identifier: GPL-2.0-or-later
//! `cargo xtask TASK [ARGUMENT...]`: runs a function of `tasks.sh`, in bash and in the root of the repository.
//! `cargo xtask help` lists them.

use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode};

const TASKS: &str = include_str!("../tasks.sh");

/// Returns the lines of `tasks.sh` that describe a task: its name, its arguments, and its effect.
fn described() -> impl Iterator<Item = (&'static str, &'static str)> {
    TASKS.lines().filter_map(|line| line.strip_prefix("## ")?.split_once(": "))
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let task = arguments.first().map_or("help", String::as_str);
    if task == "help" {
        described().for_each(|(usage, about)| println!("cargo xtask {usage:<24} {about}"));
        return ExitCode::SUCCESS;
    }
    if !described().any(|(usage, _)| usage.split(' ').next() == Some(task)) {
        eprintln!("xtask: there is no task {task}: see cargo xtask help and make help");
        return ExitCode::from(2);
    }
    let error = Command::new("bash")
        .args(["-euo", "pipefail", "xtask/tasks.sh"])
        .args(arguments)
        // Replaces the switches of a make that runs this.
        .env("MAKEFLAGS", "--no-print-directory")
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(".."))
        .exec();
    eprintln!("xtask: bash: {error}");
    ExitCode::from(2)
}
