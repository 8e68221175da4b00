// SPDX-License-Identifier: GPL-2.0-or-later
//! Position of the tip of every tool at home: this shows a length with the wrong sign.

use crate::findings::Report;
use kinematics::{At, Vector3};
use machine::limits;
use machine::read::direction::ToolDirection;
use machine::read::mechanism::Mechanism;
use machine::read::tools::Tool;

/// Largest number of tools that are named individually.
const NAMED: usize = 8;

/// Share of the distance to the platform joints above which a tip counts as above or below them.
const ALONG: f64 = 0.7;

/// Reports the positions of the tips relative to the center of the platform joints.
pub(super) fn check(report: &mut Report, config: &Mechanism, at: &At, tools: &[Tool]) {
    if config.chain.is_bare() {
        let text = "not judged: an axis carries the tool, or the tools are fixed in base";
        return report.fact("tool tips", text);
    }
    let rows = match tools {
        [] => vec![format!("without a tool {}", place(config, at, &Vector3::zeros()))],
        tools => tools.iter().take(NAMED).map(|tool| row(config, at, tool)).collect::<Vec<_>>(),
    };
    for (n, text) in rows.into_iter().enumerate() {
        report.fact(if n == 0 { "tool tips" } else { "" }, text);
    }
    if tools.len() > NAMED {
        report.fact("", format!("and {} more tools", tools.len() - NAMED));
    }
    report.fact("", advice(config, tools));
}

fn row(config: &Mechanism, at: &At, tool: &Tool) -> String {
    format!("{} {}", tool.name(), place(config, at, &tool.offset))
}

/// Describes the vector from the center of the platform joints to the tip, in base; home is level, so the platform's
/// axes are those of base.
fn place(config: &Mechanism, at: &At, offset: &Vector3<f64>) -> String {
    let legs = config.geometry.legs();
    let middle = legs.iter().map(|leg| Vector3::from(leg.platform)).sum::<Vector3<f64>>()
        / legs.len() as f64;
    let way = -(offset + config.spindle) - middle;
    let (length, unit) = (way.norm(), config.length_unit());
    if length < limits::MEETING * config.machine.size() {
        return "at the platform joints".into();
    }
    let segments = &at.segments()[..config.legs()];
    let to_base =
        segments.iter().map(|leg| leg.base - leg.platform).sum::<Vector3<f64>>().dot(&way);
    let towards = match to_base > 0.0 {
        true => "towards the base",
        false => "away from the base",
    };
    let [x, y, z] = <[f64; 3]>::from(way.map(|part| limits::shown(part).parse().unwrap_or(part)));
    match way.z.abs() > ALONG * length {
        true => {
            let side = if way.z < 0.0 { "below" } else { "above" };
            format!("{} {unit} {side} the platform joints, {towards}", limits::shown(way.z.abs()))
        }
        false => format!("at X{x} Y{y} Z{z} from the platform joints, {towards}"),
    }
}

/// Returns what the user should do.
fn advice(config: &Mechanism, tools: &[Tool]) -> String {
    if let Some(direction) = config.tool_direction {
        return format!(
            "TOOL_DIRECTION = {}: tools of {} length are {} the platform's reference point",
            direction.name(),
            direction.sign(),
            direction.side()
        );
    }
    let mut along = tools.iter().map(|tool| tool.offset + config.spindle);
    let directions: Vec<Option<ToolDirection>> = along
        .by_ref()
        .filter(|tool| tool.z.abs() > ALONG * tool.norm() && tool.norm() > 0.0)
        .map(|tool| ToolDirection::of_length(tool.z))
        .collect();
    match directions.first() {
        Some(Some(first)) if directions.iter().all(|other| *other == Some(*first)) => format!(
            "if a tip is on the wrong side, its sign is wrong; set TOOL_DIRECTION = {} to confirm these and to \
             refuse others (man pkmkins, SIGN OF TOOL LENGTHS)",
            first.name()
        ),
        _ => "if a tip is on the wrong side, its sign is wrong (man pkmkins, SIGN OF TOOL LENGTHS)"
            .into(),
    }
}
