// SPDX-License-Identifier: GPL-2.0-or-later
//! Legal part of the axis limits: conditioning, joint ranges, and the proved box.

use crate::findings::{Report, TiltBox};
use crate::nearest;
use crate::seen::{self, DRAWN, Seen};
use crate::suggestion::shown_pose;
use crate::wiring::at_key;
use kinematics::{Letter, Limit, Margin};
use machine::limits;
use machine::proof::axis_box::{self, AxisBox};
use machine::proof::reach::{Reach, Stop};
use machine::read::diagnostic::Severity;
use machine::read::ini::Ini;
use machine::read::mechanism::Mechanism;
use machine::read::tools::Tool;

/// Tilts of the table, as shares of the largest one within the axis limits.
const TILTS: [f64; 5] = [0.0, 0.125, 0.25, 0.5, 1.0];

/// Share of the tilt limit for which a proof is attempted.
const TILT_SHARE: f64 = 0.98;

/// Share of the poses in the axis limits below which most of them are out of reach.
pub(super) const MOST: f64 = 0.5;

/// Reports conditioning, joint ranges and the box inside the workspace.
pub(super) fn check(
    report: &mut Report,
    ini: &Ini,
    config: &Mechanism,
    table: Vec<Tool>,
    progress: impl FnMut(f64),
) {
    let within = axis_box::range(config);
    nearest::at_home(report, config);
    unlimited(report, ini, config);
    let reach = match Reach::new(config) {
        Ok(reach) => reach,
        Err(fault) => return home_outside(report, ini, config, Stop::Fault(fault)),
    };
    match reach.check(&config.home) {
        Ok(()) => {
            let value = reach.conditioning(&config.home);
            report.fact(
                "conditioning",
                format!(
                    "{value:.4} at home (0: singular); pkmkins stops the machine at {}, slows it from \
                     twice that",
                    config.conditioning_limit
                ),
            );
        }
        // Reported already, with the value.
        Err(Stop::Limit(Margin { limit: Limit::JointRange, .. })) => return,
        Err(stop) => return home_outside(report, ini, config, stop),
    }
    let seen = Seen::of(config, &reach, &within);
    joint_ranges(report, config, &seen);
    worst_conditioning(report, ini, config, &seen);
    axis_limits(report, ini, config, &seen);
    nearest::seen(report, ini, config, &seen);
    let (tilts, tilted) = tilts(config, &reach, &within);
    report.tilts = tilts;
    match axis_box::find(config, &within, tilted.as_ref(), progress) {
        Ok(found) => {
            report.is_whole = found == within;
            let found = found.rounded();
            with_tools(report, config, table, &within, &found);
            report.suggestion = Some(found);
        }
        Err(stop) => home_outside(report, ini, config, stop),
    }
}

/// Reports the useful part of the axis limits.
fn axis_limits(report: &mut Report, ini: &Ini, config: &Mechanism, seen: &Seen) {
    let share = seen.taken as f64 / DRAWN as f64;
    report.taken = Some(share);
    let percent = 100.0 * share;
    let text = format!(
        "the machine reaches {percent:.1} % of the poses sampled in them; use pkm preflight to check that a program \
         stays in those"
    );
    report.fact("axis limits", text);
    if share >= MOST {
        return;
    }
    let most = seen.refused.iter().max_by_key(|(_, count)| **count);
    let of = most.map_or(String::new(), |(limit, _)| format!(", mostly by the {}", limit.name()));
    let (severity, found) = match seen.taken {
        0 => (Severity::Error, format!("none of {DRAWN} poses sampled from the axis limits: they")),
        _ => (
            Severity::Warning,
            format!("only {percent:.1} % of the poses in the axis limits: most"),
        ),
    };
    let text = format!(
        "the machine reaches {found} are refused{of}; check signs and units, or use the proved limits \
         at the end (pkm check --fix writes them)"
    );
    report.finding(severity, first_axis(ini, config, &text));
}

fn first_axis(ini: &Ini, config: &Mechanism, text: &str) -> machine::read::ini::IniError {
    let letter = Letter::ALL.into_iter().find(|l| !config.machine.layout().is_held(*l));
    let section = config.place.axis_section(letter.unwrap_or(Letter::X));
    at_key(ini, &section, "MIN_LIMIT", text)
}

/// Reports coordinates without limits, which LinuxCNC moves until something else stops the machine.
fn unlimited(report: &mut Report, ini: &Ini, config: &Mechanism) {
    for letter in Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l)) {
        let axis = &config.programmed[letter.index()];
        for (end, key) in [(axis.min, "MIN_LIMIT"), (axis.max, "MAX_LIMIT")] {
            if end.is_infinite() {
                let section = config.place.axis_section(letter);
                let text = "expected a number: without it LinuxCNC checks no pose of this axis before it \
                            moves; use the limits below (pkm check --fix writes them)";
                report.finding(Severity::Warning, at_key(ini, &section, key, text));
            }
        }
    }
}

/// Reports the legal part of the axis limits for the tools of the table, and whether the suggested limits are proved
/// with them, if tools affect which poses are legal: on a machine that tilts.
fn with_tools(
    report: &mut Report,
    config: &Mechanism,
    table: Vec<Tool>,
    within: &AxisBox,
    suggested: &AxisBox,
) {
    if !Letter::ALL.iter().any(|l| l.is_angle() && !config.machine.layout().is_held(*l)) {
        return;
    }
    for tool in spread(table) {
        let Ok(reach) = Reach::with_tool(config, config.spindle + tool.offset) else { continue };
        let share = 100.0 * seen::taken(config, &reach, within);
        // The limits are proved without a tool length, by a longer proof than is made here.
        let is_proved =
            tool.offset.norm() == 0.0 || axis_box::holds_with(config, &tool.offset, suggested);
        let proof = if is_proved { "proved" } else { "not proved" };
        let text =
            format!("{share:.1} % of the poses in the axis limits; {proof} for the limits below");
        report.fact(&tool.name(), text);
        if share < 100.0 * MOST {
            let text = format!(
                "with this tool the machine reaches only {share:.1} % of the poses in the axis limits: check \
                 its length, unit and sign"
            );
            report.finding(Severity::Warning, tool.refuse_length(config, &text));
        }
        if is_proved {
            report.proved_tools.push(tool);
        }
    }
}

/// Largest number of tools that are sampled individually.
const LOOKED_AT: usize = 16;

/// Returns the shortest, the longest and some tools between them, evenly by index; all if there are few.
fn spread(mut table: Vec<Tool>) -> Vec<Tool> {
    let count = table.len();
    if count <= LOOKED_AT {
        return table;
    }
    table.sort_by(|a, b| a.offset.norm().total_cmp(&b.offset.norm()));
    (0..LOOKED_AT).map(|k| table[k * (count - 1) / (LOOKED_AT - 1)].clone()).collect()
}

/// Returns the gain in X Y Z by a smaller tilt, from none to the largest within the axis limits, and the box of that within
/// the limits of X Y Z, which end no box of the gain.
fn tilts(config: &Mechanism, reach: &Reach, within: &AxisBox) -> (Vec<TiltBox>, Option<AxisBox>) {
    let ends = within.low[3..5].iter().chain(&within.high[3..5]);
    let most = ends.map(|angle| angle.abs()).fold(0.0, f64::max).min(tilt_of_both(config, within));
    if most == 0.0 {
        return (vec![], None);
    }
    let reached = axis_box::reached(config, reach, within);
    let (mut inner, mut steepest, mut outer) = (None, None, None);
    let mut found: Vec<_> = TILTS
        .into_iter()
        .rev()
        .map(|share| {
            let tilt = share * most;
            inner = axis_box::at_tilt(config, within, tilt, inner.as_ref());
            if share == 1.0 {
                steepest = inner;
            }
            outer = inner.map(|inner| axis_box::grown(config, &reached, &inner, outer.as_ref()));
            let ends = outer.map(|part| axis_box::ends(config, reach, &part, &reached));
            TiltBox { tilt, limits: outer, ends: ends.unwrap_or_default() }
        })
        .collect();
    found.reverse();
    (found, steepest)
}

/// Returns the largest angle that A and B may have together, slightly below the end, where a proof has no room.
fn tilt_of_both(config: &Mechanism, within: &AxisBox) -> f64 {
    let Some(limit) = config.tilt_limit else { return f64::INFINITY };
    let both = (3..5).all(|k| within.high[k] > within.low[k]);
    // The tool axis tilts by acos(cos A cos B).
    let most = if both { limit.to_radians().cos().sqrt().acos().to_degrees() } else { limit };
    (most * TILT_SHARE * 10.0).floor() / 10.0
}

fn worst_conditioning(report: &mut Report, ini: &Ini, config: &Mechanism, seen: &Seen) {
    let Some((value, pose)) = seen.worst else { return };
    let place = shown_pose(config, &pose);
    let text = format!("{value:.4}, the smallest found within the axis limits, at {place}");
    report.more("conditioning", text);
    if value < config.conditioning_limit {
        let text = format!(
            "the machine is near a singularity at {place}: conditioning {value:.4}, and pkmkins stops \
             the machine at {}; keep programs away, or use the limits below",
            config.conditioning_limit
        );
        report.finding(Severity::Warning, at_key(ini, "KINS", "KINEMATICS", &text));
    }
}

fn home_outside(report: &mut Report, ini: &Ini, config: &Mechanism, stop: Stop) {
    let way = match stop {
        Stop::Limit(Margin { limit: Limit::Clearance, .. }) => {
            "check whether the anchors of these legs are exchanged, or move [TRAJ]HOME"
        }
        Stop::Limit(Margin { limit: Limit::Conditioning, .. }) => {
            "move [TRAJ]HOME away from the singularity, or check for anchors or guides entered twice"
        }
        _ => "move [TRAJ]HOME, or widen the limit",
    };
    let text = format!("the machine cannot be there: {}; {way}", shown_stop(config, stop));
    report.finding(Severity::Error, at_key(ini, "TRAJ", "HOME", &text));
}

fn shown_stop(config: &Mechanism, stop: Stop) -> String {
    match stop {
        Stop::Fault(fault) => fault.to_string(),
        Stop::Limit(margin) => limits::sentence(config, &margin),
    }
}

/// Reports the joint ranges that the poses within the axis limits require.
fn joint_ranges(report: &mut Report, config: &Mechanism, seen: &Seen) {
    for (joint, (low, high)) in config.joints.iter().zip(&seen.joints) {
        let unit = config.unit(joint.kind);
        let text = format!(
            "{low:.3} to {high:.3} {unit} in sampled poses of the axis limits; MIN_LIMIT {}, MAX_LIMIT {}",
            joint.min, joint.max
        );
        report.fact(&joint.name, text);
    }
}
