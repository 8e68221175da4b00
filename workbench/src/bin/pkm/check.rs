// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm check`.

use super::{Failure, MachineFile, Verdict};
use indicatif::{ProgressBar, ProgressStyle};
use pkm::check::{Report, axis_lines, check};
use pkm::diagnostic::rendered;
use std::io::Write;

/// Steps of the progress bar.
const STEPS: u64 = 100;

/// Checks that a machine's INI file fits together
///
/// Reads the file as LinuxCNC does, builds the machine as the module would, and tells: joints
/// and mobility, geometry hash, HOME of joints and axes against the kinematics, homing order
/// against the cones, joint ranges, how well the legs hold the platform at home and at worst. At
/// the end stand [AXIS_*] limits in which, without a tool, every pose is proved to be within reach,
/// joint limits and cones, with legs that hold the platform. They stay within the axis limits that the file
/// gives already; where it gives none, the machine sets the end.
///
/// Exit status: 0 where all is well (warnings may be told), 1 where something does not fit, 2
/// where the file describes no machine.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let file = &arguments.machine.machine;
    // Hidden where standard error is no terminal.
    let bar = ProgressBar::new(STEPS).with_message("looking for a box of poses");
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {percent} %") {
        bar.set_style(style);
    }
    let report = check(file, |share| bar.set_position((share * STEPS as f64) as u64))?;
    bar.finish_and_clear();
    let verdict = if report.fits() { Verdict::Fits } else { Verdict::Misfit };
    // A reader that has gone away does not change the verdict.
    match write(&report) {
        Ok(()) => Ok(verdict),
        Err(error) => match Failure::from(error) {
            Failure::Unread => Ok(verdict),
            failure => Err(failure),
        },
    }
}

fn write(report: &Report) -> std::io::Result<()> {
    let config = &report.config;
    let mut out = anstream::stdout().lock();
    writeln!(out, "{}", config.file.display())?;
    for (name, value) in &report.facts {
        writeln!(out, "  {name:<14} {value}")?;
    }
    for finding in &report.findings {
        writeln!(out, "\n{}", rendered(finding.severity, &finding.problem))?;
    }
    if let Some(limits) = &report.suggestion {
        let text = match report.is_whole {
            true => {
                "Proved: without a tool the machine can take every pose within its axis limits:"
            }
            false => "Proved: without a tool the machine can take every pose within these limits:",
        };
        write!(out, "\n{text}\n\n{}", axis_lines(config, limits))?;
    }
    writeln!(out, "\n{}", verdict(report))?;
    out.flush()
}

fn verdict(report: &Report) -> &'static str {
    match (report.fits(), report.findings.is_empty()) {
        (true, true) => "The machine fits together.",
        (true, false) => "The machine fits together; look at the warnings.",
        (false, _) => "The machine does not fit together.",
    }
}
