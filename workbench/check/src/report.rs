// SPDX-License-Identifier: GPL-2.0-or-later
//! Check whether a machine's INI file describes a machine that fits together, with the facts that were read.

use crate::direction;
use crate::display;
use crate::drives;
use crate::findings::Report;
use crate::homes;
use crate::homing_paths;
use crate::mobility::Structure;
use crate::motion;
use crate::odd;
use crate::order;
use crate::programs;
use crate::screws;
use crate::searches;
use crate::size;
use crate::speeds;
use crate::startup;
use crate::table;
use crate::tips;
use crate::tool_change;
use crate::typos;
use crate::usual;
use crate::wiring;
use crate::workspace;
use machine::read::diagnostic::Severity;
use machine::read::error::MachineError;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use machine::read::tools::Tool;

/// Checks a machine, or one of two mechanisms; `progress` receives the completed share of the work.
///
/// # Errors
/// The file describes no machine.
pub fn check(
    whole: &MachineConfig,
    config: &Mechanism,
    progress: impl FnMut(f64),
) -> Result<Report, MachineError> {
    let mut report = Report::new(config);
    structure(&mut report, config)?;
    for error in config.refused_boxes.iter().flat_map(MachineError::in_file) {
        report.finding(Severity::Error, error.clone());
    }
    let tools = table::read(&mut report, config);
    understood(&mut report, config, &tools)?;
    motion::check(&mut report, config)?;
    usual::check(&mut report, config)?;
    searches::check(&mut report, config)?;
    homes::check(&mut report, config)?;
    let (fact, error) = homing_paths::summary(&config.ini, config)?;
    report.fact("homing", fact);
    if let Some(error) = error {
        report.finding(Severity::Warning, error);
    }
    // Both mechanisms use the same module and file.
    if !config.place.is_second {
        speeds::check(&mut report, config);
        startup::check(&mut report, config);
        tool_change::check(&mut report, whole);
        display::check(&mut report, config);
        for (severity, error) in wiring::check(&config.ini)? {
            report.finding(severity, error);
        }
        for (severity, error) in programs::check(&config.ini) {
            report.finding(severity, error);
        }
        for (severity, error) in drives::check(&config.ini)? {
            report.finding(severity, error);
        }
        for error in typos::check(&config.ini) {
            report.finding(Severity::Warning, error);
        }
    }
    for (severity, error) in direction::check(config, &tools) {
        report.finding(severity, error);
    }
    workspace::check(&mut report, &config.ini, config, tools, progress);
    Ok(report)
}

fn structure(report: &mut Report, config: &Mechanism) -> Result<(), MachineError> {
    let structure = Structure::of(config)
        .map_err(|fault| MachineError::of_geometry(&config.ini, &config.place, fault))?;
    let groups = config.groups();
    let legs: Vec<String> =
        groups.iter().map(|g| format!("{} {}", g.joints.len(), g.kind.plural())).collect();
    let extra: Vec<&str> = config.extra.iter().map(|axis| axis.joint.name.as_str()).collect();
    report
        .fact("joints", [legs, extra.into_iter().map(String::from).collect()].concat().join(", "));
    report.fact("mobility", structure.mobility());
    report.fact("count", structure.loops());
    let hash = format!(
        "{:#010x} (compare with pin pkmkins.geometry-hash; {} on the panel)",
        config.hash, config.hash
    );
    report.fact("geometry hash", hash);
    Ok(())
}

/// Reports the facts about machine and tools, so that the user can detect a mistake.
fn understood(report: &mut Report, config: &Mechanism, tools: &[Tool]) -> Result<(), MachineError> {
    let at = config.machine.at(&config.home_pose(), &config.spindle);
    let at = at.map_err(|fault| MachineError::of_geometry(&config.ini, &config.place, fault))?;
    size::check(report, config, &at);
    odd::check(report, config, &at);
    odd::keys(report, config);
    order::check(report, config, &at);
    screws::check(report, config, &at);
    tips::check(report, config, &at, tools);
    Ok(())
}
