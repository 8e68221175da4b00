// SPDX-License-Identifier: GPL-2.0-or-later
//! The joints of a motion: values, changes along the path, speeds and corrections.

use crate::draw::lines::{Line, drawn_lines, first_up, lines};
use crate::draw::plot::{DrawError, Plot};
use crate::draw::sample::Sample;
use crate::draw::sheet::{Frame, TIME, span};
use crate::draw::tool_path::{isometric, tool_path};
use crate::program::path::{Along, along};
use crate::read::joints::{Group, JointKind};
use crate::read::machine::MachineConfig;
use kinematics::{LegKind, MAX_JOINTS};

/// All plots of a trace.
///
/// # Errors
/// As [`DrawError`].
pub fn all(config: &MachineConfig, samples: &[Sample]) -> Result<Vec<Plot>, DrawError> {
    let world: Vec<&Sample> = samples.iter().filter(|s| s.in_world).collect();
    let unit = config.length_unit();
    let path = along(world.iter().map(|s| (s.pose, s.joints)));
    let mut plots = vec![];
    for group in config.groups() {
        plots.extend(of_group(config, &group, &world, &path)?);
    }
    if has_lead(config) {
        plots.push(Plot {
            file: "corrections.svg".into(),
            caption: "Length corrections for the nuts that turn as the platform tilts".into(),
            svg: corrections(config, &world, unit)?,
        });
    }
    plots.push(Plot {
        file: "tool-path.svg".into(),
        caption: "Path of the control point in the planes it moves in".into(),
        svg: tool_path(&world, unit)?,
    });
    plots.push(Plot {
        file: "tool-path-3d.svg".into(),
        caption: "Path of the control point (isometric) with the tool axis at some places".into(),
        svg: isometric(&world, unit)?,
    });
    Ok(plots)
}

fn has_lead(config: &MachineConfig) -> bool {
    let lead = |kind| matches!(kind, LegKind::Strut(strut) if strut.lead != 0.0);
    config.geometry.legs().iter().any(|leg| lead(leg.kind))
}

/// Values, changes along the path and speeds of joints of one kind.
fn of_group(
    config: &MachineConfig,
    group: &Group,
    world: &[&Sample],
    path: &[Along],
) -> Result<[Plot; 3], DrawError> {
    let name = group.kind.plural();
    let stem = name.replace(' ', "-");
    Ok([
        Plot {
            file: format!("{stem}.svg"),
            caption: format!("{} during the program; limits where they are near", first_up(name)),
            svg: values(config, group, world)?,
        },
        Plot {
            file: format!("{stem}-path.svg"),
            caption: format!(
                "Change of {name} since the program's start, against the length of the path of \
                 the control point; a turn in place is a vertical line"
            ),
            svg: changes(config, group, path)?,
        },
        Plot {
            file: format!("{stem}-speeds.svg"),
            caption: format!("Speeds of {name}; the lowest limit stands above the plot"),
            svg: speeds(config, group, world)?,
        },
    ])
}

fn values(config: &MachineConfig, group: &Group, world: &[&Sample]) -> Result<String, DrawError> {
    let joints = || group.joints.iter().map(|i| &config.joints[*i]);
    let low = joints().fold(f64::NEG_INFINITY, |low, j| low.max(j.min));
    let high = joints().fold(f64::INFINITY, |high, j| high.min(j.max));
    let lines = lines(config, group, world.iter().map(|s| (time(world, s), &s.joints)));
    let Group { kind, unit, .. } = group;
    let frame = Frame {
        title: &format!("{} (limits {low} to {high} {unit})", first_up(kind.plural())),
        x: TIME,
        y: &format!("{} in {unit}", kind.quantity()),
        limits: near(&lines, &[(format!("lowest {low}"), low), (format!("highest {high}"), high)]),
    };
    drawn_lines(&frame, &lines)
}

/// Limits no farther from the lines than these reach: others would only flatten them.
fn near(lines: &[Line], limits: &[(String, f64)]) -> Vec<(String, f64)> {
    let (low, high) = span(lines.iter().flat_map(|l| l.points.iter().map(|p| p.1)));
    let reach = low - (high - low)..=high + (high - low);
    limits.iter().filter(|(_, value)| reach.contains(value)).cloned().collect()
}

fn changes(config: &MachineConfig, group: &Group, path: &[Along]) -> Result<String, DrawError> {
    let frame = Frame {
        title: &format!("{}: change since the program's start", first_up(group.kind.plural())),
        x: &format!("length of the path in {}", config.length_unit()),
        y: &format!("change of {} in {}", group.kind.quantity(), group.unit),
        limits: vec![],
    };
    drawn_lines(&frame, &lines(config, group, path.iter().map(|a| (a.length, &a.change))))
}

fn corrections(config: &MachineConfig, world: &[&Sample], unit: &str) -> Result<String, DrawError> {
    let frame = Frame {
        title: "Nut corrections",
        x: TIME,
        y: &format!("correction in {unit}"),
        limits: vec![],
    };
    let groups = config.groups();
    let struts = groups.iter().filter(|group| group.kind == JointKind::Strut);
    let values = world.iter().map(|s| (time(world, s), &s.corrections));
    let lines: Vec<Line> = struts.flat_map(|group| lines(config, group, values.clone())).collect();
    drawn_lines(&frame, &lines)
}

fn speeds(config: &MachineConfig, group: &Group, world: &[&Sample]) -> Result<String, DrawError> {
    let limits = group.joints.iter().map(|i| config.joints[*i].max_velocity);
    let limit = limits.fold(f64::INFINITY, f64::min);
    let Group { kind, unit, .. } = group;
    let frame = Frame {
        title: &format!("Speeds of {} (limit {limit} {unit}/s)", kind.plural()),
        x: TIME,
        y: &format!("speed in {unit}/s"),
        limits: vec![],
    };
    let speeds: Vec<_> = world
        .windows(2)
        .map(|w| {
            let speed = |i: usize| (w[1].joints[i] - w[0].joints[i]) / config.period;
            (time(world, w[1]), std::array::from_fn::<f64, MAX_JOINTS, _>(speed))
        })
        .collect();
    drawn_lines(&frame, &lines(config, group, speeds.iter().map(|(t, v)| (*t, v))))
}

/// Seconds since the program's start.
fn time(world: &[&Sample], sample: &Sample) -> f64 {
    sample.time - world[0].time
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_far_from_the_lines_are_left_out() {
        let line = Line { name: String::new(), points: vec![(0.0, 10.0), (1.0, 14.0)] };
        let limits = [(String::from("low"), 5.9), (String::from("high"), 17.9)];
        assert_eq!(near(&[line], &limits), limits[1..]);
    }
}
