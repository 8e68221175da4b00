// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC's position for a tool change: `[EMCIO]TOOL_CHANGE_POSITION`, TOOL_CHANGE_QUILL_UP and TOOL_CHANGE_AT_G30.

use crate::findings::Report;
use crate::world;
use kinematics::World;
use machine::read::diagnostic::Severity;
use machine::read::ini::{Entry, decimal};
use machine::read::machine::MachineConfig;
use std::fs;

const SECTION: &str = "EMCIO";

/// First program parameter of the pose of G30.
const G30: usize = 5181;

/// Checks all of it.
pub(super) fn check(report: &mut Report, config: &MachineConfig) {
    let mut start = world::home(config);
    // In LinuxCNC's order.
    if let Some(entry) = is_on(config, "TOOL_CHANGE_QUILL_UP") {
        start[2] = 0.0;
        let way = "every tool change first moves Z to 0";
        reached(report, config, entry, &start, way, "remove the line, or let Z reach 0");
    }
    if let Some(entry) = is_on(config, "TOOL_CHANGE_AT_G30") {
        start = stored(config);
        let way = "every tool change first moves to the pose of G30 (parameters 5181 to 5189)";
        reached(
            report,
            config,
            entry,
            &start,
            way,
            "run G30.1 at a pose within all limits first, or remove the line",
        );
    }
    position(report, config, start);
}

fn is_on<'a>(config: &'a MachineConfig, key: &str) -> Option<&'a Entry> {
    config.ini.first(SECTION, key).filter(|entry| entry.value.trim().parse() != Ok(0))
}

fn position(report: &mut Report, config: &MachineConfig, start: World) {
    let Some(entry) = config.ini.first(SECTION, "TOOL_CHANGE_POSITION") else { return };
    let words: Vec<&str> = entry.value.split_whitespace().collect();
    // Numbers up to the first word that is not one, as LinuxCNC reads them.
    let numbers: Vec<f64> = words.iter().map_while(|word| decimal(word)).collect();
    let expected = "expected 3, 6 or 9 numbers separated by spaces: X Y Z A B C U V W";
    let count = match numbers.len() {
        0..3 => {
            let text = format!("LinuxCNC cannot be switched on with this value: {expected}");
            return report.finding(Severity::Error, config.ini.refuse(entry, &text));
        }
        9.. => 9,
        6.. => 6,
        _ => 3,
    };
    if words.len() != count {
        let text = format!("LinuxCNC reads {count} of these values: {expected}");
        report.finding(Severity::Warning, config.ini.refuse(entry, &text));
    }
    let mut at = start;
    at[..count].copy_from_slice(&numbers[..count]);
    reached(
        report,
        config,
        entry,
        &at,
        "every tool change moves there",
        "expected a pose within all limits",
    );
}

fn reached(
    report: &mut Report,
    config: &MachineConfig,
    entry: &Entry,
    at: &World,
    way: &str,
    out: &str,
) {
    if let Some(what) = world::violated(config, at) {
        let text = format!("{way}, where {what}: {out}");
        report.finding(Severity::Error, config.ini.refuse(entry, &text));
    }
}

/// Returns the pose of G30; LinuxCNC's default is 0 for values missing in the file of parameters.
fn stored(config: &MachineConfig) -> World {
    let file = config.program.parameter_file.as_deref();
    let text = file.and_then(|file| fs::read_to_string(file).ok()).unwrap_or_default();
    let value = |number: usize| {
        let mut lines = text.lines().map(str::split_whitespace);
        let mut words = lines
            .find(|words| words.clone().next().is_some_and(|word| word.parse() == Ok(number)))?;
        words.nth(1)?.parse().ok()
    };
    std::array::from_fn(|k| value(G30 + k).unwrap_or(0.0))
}
