// SPDX-License-Identifier: GPL-2.0-or-later
//! Tools of the table against the direction of tools, `TOOL_DIRECTION`.

use machine::read::diagnostic::Severity;
use machine::read::direction::ToolDirection;
use machine::read::ini::IniError;
use machine::read::mechanism::Mechanism;
use machine::read::tools::Tool;

/// Returns every tool whose length contradicts the direction in the file. If the spindle offset compensates
/// it, the length can be the difference to a longer tool that was used for measuring lengths.
pub(super) fn check(config: &Mechanism, tools: &[Tool]) -> Vec<(Severity, IniError)> {
    let Some(direction) = config.tool_direction else { return vec![] };
    let is_wrong = |tool: &&Tool| direction.contradicts(tool.offset.z);
    let finding = |tool: &Tool| {
        let severity = match direction.contradicts(tool.offset.z + config.spindle.z) {
            true => Severity::Error,
            false => Severity::Warning,
        };
        (severity, tool.refuse_length(config, &text(config, tool, direction, severity)))
    };
    tools.iter().filter(is_wrong).map(finding).collect()
}

fn text(config: &Mechanism, tool: &Tool, direction: ToolDirection, severity: Severity) -> String {
    let (length, rule) = (-tool.offset.z, direction.rule(config.place.machine_section()));
    match severity {
        Severity::Error => format!(
            "expected {length}: {rule}; if this tool points {}, set TOOL_DIRECTION = {}",
            direction.other().name(),
            direction.other().name()
        ),
        Severity::Warning => format!(
            "{rule}: expected {length}, unless the length is the difference to the tool that \
             SPINDLE_OFFSET = {} was measured with",
            config.spindle.z
        ),
    }
}
