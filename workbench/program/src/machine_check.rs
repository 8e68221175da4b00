// SPDX-License-Identifier: GPL-2.0-or-later
//! Check of a whole machine: each mechanism, its start in virtual time, and both mechanisms together.

use crate::machine_start::{Start, start};
use check::between;
use check::findings::{Finding, Report};
use check::report::check;
use machine::files::AtFile;
use machine::read::diagnostic::Severity;
use machine::read::error::MachineError;
use machine::read::machine::MachineConfig;
use std::io;

/// Reports about a machine.
#[derive(Debug)]
pub struct Whole {
    /// Report on each mechanism.
    pub mechanisms: Vec<Report>,
    /// Report on two mechanisms together.
    pub between: Option<Report>,
}

impl Whole {
    fn reports(&self) -> impl Iterator<Item = &Report> {
        self.mechanisms.iter().chain(&self.between)
    }

    /// Returns whether there are no findings of a misfit.
    pub fn fits(&self) -> bool {
        self.reports().all(Report::fits)
    }

    /// Returns all findings.
    pub fn findings(&self) -> Vec<&Finding> {
        self.reports().flat_map(|report| &report.findings).collect()
    }
}

/// Checks a machine, with a start in virtual time if `starts` is set. `show` receives the current task and its
/// completed share, if known.
///
/// # Errors
/// The file describes no machine, or a file of the start cannot be written.
pub fn checked<E: From<MachineError> + From<AtFile<io::Error>>>(
    config: &MachineConfig,
    starts: bool,
    mut show: impl FnMut(&'static str, Option<f64>),
) -> Result<Whole, E> {
    let mut mechanisms = vec![];
    for mechanism in &config.mechanisms {
        let looking = "searching for pose boxes";
        show(looking, None);
        let mut report = check(config, mechanism, |share| show(looking, Some(share)))?;
        // Both mechanisms are a single machine for LinuxCNC.
        if !mechanism.place.is_second {
            let started = if !starts {
                Start::not_tried("--no-start")
            } else if !report.fits() {
                Start::not_tried("correct the errors first")
            } else {
                show("starting the machine in virtual time", None);
                start(config)?
            };
            report.fact("start", started.fact);
            if let Some(error) = started.error {
                report.finding(Severity::Error, error);
            }
        }
        mechanisms.push(report);
    }
    Ok(Whole { mechanisms, between: between::check(config)? })
}
