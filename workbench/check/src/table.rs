// SPDX-License-Identifier: GPL-2.0-or-later
//! The tool table as LinuxCNC reads it.

use crate::findings::Report;
use crate::wiring::at_key;
use machine::limits;
use machine::read::diagnostic::Severity;
use machine::read::ini::IniError;
use machine::read::mechanism::Mechanism;
use machine::read::tools::{self, Tool};
use std::collections::HashMap;

/// Largest ratio of a tool's length to the machine's size (its largest length from an origin), above which its unit is
/// doubted: a choice, because small machines have tools as long as their radius.
const LONG: f64 = 2.0;

/// Returns the tools of the table, and reports their mistakes; none if it cannot be read.
pub(super) fn read(report: &mut Report, config: &Mechanism) -> Vec<Tool> {
    let whole = |text: &str| at_key(&config.ini, "EMCIO", "TOOL_TABLE", text);
    let tools = match tools::read(config) {
        Ok(tools) => tools,
        Err(error) => {
            let text = format!("{error}; LinuxCNC needs this file, with at least a line T1 P1 Z0");
            report.finding(Severity::Warning, whole(&text));
            return vec![];
        }
    };
    // Another program manages the tools if DB_PROGRAM names one, and both mechanisms share a table.
    let is_kept =
        config.program.tool_table.is_some() && config.ini.first("EMCIO", "DB_PROGRAM").is_none();
    if is_kept && tools.is_empty() && !config.place.is_second {
        let text = "the file has no tool, so LinuxCNC stops every program that uses one: add a line, at least T1 P1 Z0";
        report.finding(Severity::Warning, whole(text));
    }
    let is_random = config.program.random_tools;
    if let Some(tool) =
        tools.get(POCKETS).filter(|_| is_kept && !is_random && !config.place.is_second)
    {
        let text = format!(
            "LinuxCNC has room for {POCKETS} tools, and drops T{} and the {} lines after it: remove tools",
            tool.number,
            tools.len() - POCKETS - 1
        );
        report.finding(Severity::Error, tool.refuse_line(config, &text));
    }
    let mut lines = HashMap::new();
    for (k, tool) in tools.iter().enumerate() {
        if let Some(error) = dropped(config, tool).filter(|_| is_kept) {
            report.finding(Severity::Error, error);
        }
        let before = lines.insert(tool.number, tool.line);
        for error in of_tool(config, tool, k, before) {
            report.finding(Severity::Warning, error);
        }
    }
    tools
}

/// LinuxCNC's largest number of tools besides the one in the spindle (CANON_POCKETS_MAX of emctool.h).
const POCKETS: usize = 1000;

/// Reports a line that LinuxCNC drops as a whole.
fn dropped(config: &Mechanism, tool: &Tool) -> Option<IniError> {
    let word = tool.dropped_by.as_ref().filter(|_| !config.place.is_second)?;
    let text = format!(
        "LinuxCNC drops this line because of the word {word}, and does not find T{}: use words of T P X Y Z A B C U V W \
         D I J Q, and comments after ;",
        tool.number
    );
    Some(tool.refuse_line(config, &text))
}

/// Returns the mistakes of a tool after `count` others; `before` is the line of the last one with the same number.
fn of_tool(config: &Mechanism, tool: &Tool, count: usize, before: Option<usize>) -> Vec<IniError> {
    let mut found = vec![];
    if let Some(line) = before {
        let text = format!(
            "T{} is already in line {line}, and LinuxCNC uses only one: remove the other",
            tool.number
        );
        found.push(tool.refuse_length(config, &text));
    }
    let (size, unit) = (config.machine.size(), config.length_unit());
    if tool.offset.norm() > LONG * size {
        let text = format!(
            "the tool is more than twice as long as the largest anchor distance, {} {unit}: expected {unit}, as for \
             all lengths",
            limits::shown(size)
        );
        found.push(tool.refuse_length(config, &text));
    }
    // The rest is reported once, for a table that two mechanisms share.
    if config.place.is_second {
        return found;
    }
    if !tool.has_pocket {
        let text = format!(
            "LinuxCNC keeps only the last of all tools without a pocket: add, for example, P{} after T{}",
            count + 1,
            tool.number
        );
        found.push(tool.refuse_length(config, &text));
    }
    if tool.turns.iter().any(|angle| *angle != 0.0) {
        let [a, b, c] = tool.turns;
        let text = format!(
            "with this tool G43 rotates the platform by A{a} B{b} C{c}, but lengths are along its axis: remove these words"
        );
        found.push(tool.refuse_line(config, &text));
    }
    if tool.diameter < 0.0 {
        let text = format!(
            "a negative diameter swaps G41 and G42: expected {}, unless it is the difference to the tool for which \
             programs are made",
            -tool.diameter
        );
        found.push(tool.refuse_diameter(config, &text));
    }
    if tool.number < 0 {
        let text = format!("no program can select it: expected T{}", -tool.number);
        found.push(tool.refuse_length(config, &text));
    }
    found
}
