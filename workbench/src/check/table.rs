// SPDX-License-Identifier: GPL-2.0-or-later
//! The tool table as LinuxCNC takes it.

use crate::check::findings::Report;
use crate::check::wiring::at_key;
use crate::limits;
use crate::read::diagnostic::Severity;
use crate::read::ini::IniError;
use crate::read::machine::MachineConfig;
use crate::read::tools::{self, Tool};

/// By how many times the machine's size (its largest length from an origin) a tool may be long, before its unit is doubted: a
/// choice, for small machines have tools as long as their radius.
const LONG: f64 = 2.0;

/// The tools of the table, and what is wrong with them; none where it cannot be read.
pub(super) fn read(report: &mut Report, config: &MachineConfig) -> Vec<Tool> {
    let whole = |text: &str| at_key(&config.ini, "EMCIO", "TOOL_TABLE", text);
    let tools = match tools::read(config) {
        Ok(tools) => tools,
        Err(error) => {
            let text = format!("{error}; LinuxCNC needs it, if only with a line T1 P1 Z0");
            report.finding(Severity::Warning, whole(&text));
            return vec![];
        }
    };
    // Another program keeps the tools where DB_PROGRAM names one, and both mechanisms are in one table.
    let is_kept =
        config.program.tool_table.is_some() && config.ini.first("EMCIO", "DB_PROGRAM").is_none();
    if is_kept && tools.is_empty() && !config.place.is_second {
        let text = "there is no tool in it, and LinuxCNC ends every program that asks for one: expected a line, if only T1 P1 Z0";
        report.finding(Severity::Warning, whole(text));
    }
    for (k, tool) in tools.iter().enumerate() {
        for error in of_tool(config, tool, &tools[..k]) {
            report.finding(Severity::Warning, error);
        }
    }
    tools
}

/// What is wrong with a tool that stands behind others.
fn of_tool(config: &MachineConfig, tool: &Tool, before: &[Tool]) -> Vec<IniError> {
    let mut found = vec![];
    if let Some(other) = before.iter().find(|other| other.number == tool.number) {
        let text = format!(
            "T{} stands in line {} already: LinuxCNC takes one of them",
            tool.number, other.line
        );
        found.push(tool.refuse_length(config, &text));
    }
    let (size, unit) = (config.machine.size(), config.length_unit());
    if tool.offset.norm() > LONG * size {
        let text = format!(
            "no anchor is farther than {} {unit} from the origin of its frame, and the tool is more than twice as long: \
             expected {unit} as for all lengths",
            limits::shown(size)
        );
        found.push(tool.refuse_length(config, &text));
    }
    // What follows is said once, of a table that two mechanisms have.
    if config.place.is_second {
        return found;
    }
    if !tool.has_pocket {
        let text = format!(
            "LinuxCNC has one place for all tools without a pocket, and knows only the last of them: expected P{} \
             behind T{}, say",
            before.len() + 1,
            tool.number
        );
        found.push(tool.refuse_length(config, &text));
    }
    if tool.diameter < 0.0 {
        let text = format!(
            "LinuxCNC takes G41 for G42 with it, and the other way round: expected {}, unless it is what the tool lacks to \
             the one that programs are made for",
            -tool.diameter
        );
        found.push(tool.refuse_diameter(config, &text));
    }
    if tool.number < 0 {
        let text = format!("no program can ask for it: expected T{}", -tool.number);
        found.push(tool.refuse_length(config, &text));
    }
    found
}
