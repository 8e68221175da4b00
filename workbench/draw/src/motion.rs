// SPDX-License-Identifier: GPL-2.0-or-later
//! The joints of a motion: values, changes along the path, speeds and corrections.

use crate::lines::{Line, first_up, lines};
use crate::plot::{DrawError, Plot};
use crate::sample::Sample;
use crate::sheet::TIME;
use crate::strips::{Strip, Strips, drawn_apart, drawn_strips};
use crate::tool_path::{isometric, tool_path};
use kinematics::MAX_JOINTS;
use machine::read::joints::{Group, JointKind};
use machine::read::mechanism::Mechanism;
use program::joint_curves::{Along, along};

/// Draws all plots of a trace.
///
/// # Errors
/// As [`DrawError`].
pub fn all(config: &Mechanism, samples: &[Sample]) -> Result<Vec<Plot>, DrawError> {
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
        caption: "Path of the control point in space, with the tool axis at some places".into(),
        svg: isometric(&world, unit)?,
    });
    Ok(plots)
}

fn has_lead(config: &Mechanism) -> bool {
    config.geometry.legs().iter().any(|leg| leg.kind.screw().lead != 0.0)
}

/// Draws values, changes along the path and speeds of joints of one kind.
fn of_group(
    config: &Mechanism,
    group: &Group,
    world: &[&Sample],
    path: &[Along],
) -> Result<[Plot; 3], DrawError> {
    let name = group.kind.plural();
    let stem = name.replace(' ', "-");
    Ok([
        Plot {
            file: format!("{stem}.svg"),
            caption: format!("{} during the program, with their limits", first_up(name)),
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
            caption: format!("Speeds of {name}, with their limits"),
            svg: speeds(config, group, world)?,
        },
    ])
}

fn values(config: &Mechanism, group: &Group, world: &[&Sample]) -> Result<String, DrawError> {
    let lines = lines(config, group, world.iter().map(|s| (time(world, s), &s.joints)));
    let limits = |i: &usize| config.joints[*i].range().to_vec();
    let Group { kind, unit, .. } = group;
    let y = format!("{} in {unit}", kind.quantity());
    with_limits(&first_up(kind.plural()), &y, lines, group.joints.iter().map(limits))
}

/// Draws lines over time, each with its limits.
fn with_limits(
    title: &str,
    y: &str,
    lines: Vec<Line>,
    limits: impl Iterator<Item = Vec<f64>>,
) -> Result<String, DrawError> {
    let finite = |limits: Vec<f64>| limits.into_iter().filter(|limit| limit.is_finite()).collect();
    let strips: Vec<Strip> =
        lines.into_iter().zip(limits.map(finite)).map(|(line, own)| Strip::of(line, own)).collect();
    drawn_strips(&Strips::new(title, TIME, y, &strips), &strips)
}

fn changes(config: &Mechanism, group: &Group, path: &[Along]) -> Result<String, DrawError> {
    let title = format!("{}: change since the program's start", first_up(group.kind.plural()));
    let x = format!("length of the path in {}", config.length_unit());
    let y = format!("change of {} in {}", group.kind.quantity(), group.unit);
    let values = path.iter().map(|a| (a.length, &a.change));
    drawn_apart(&title, &x, &y, lines(config, group, values))
}

fn corrections(config: &Mechanism, world: &[&Sample], unit: &str) -> Result<String, DrawError> {
    let groups = config.groups();
    let struts = groups.iter().filter(|group| group.kind == JointKind::Strut);
    let values = world.iter().map(|s| (time(world, s), &s.corrections));
    let lines: Vec<Line> = struts.flat_map(|group| lines(config, group, values.clone())).collect();
    drawn_apart("Nut corrections", TIME, &format!("correction in {unit}"), lines)
}

fn speeds(config: &Mechanism, group: &Group, world: &[&Sample]) -> Result<String, DrawError> {
    let Group { kind, unit, .. } = group;
    let speeds: Vec<_> = world
        .windows(2)
        .map(|w| {
            let speed = |i: usize| (w[1].joints[i] - w[0].joints[i]) / config.period;
            (time(world, w[1]), std::array::from_fn::<f64, MAX_JOINTS, _>(speed))
        })
        .collect();
    let lines = lines(config, group, speeds.iter().map(|(t, v)| (*t, v)));
    let most = group.joints.iter().map(|i| config.joints[*i].speed());
    let title = format!("Speeds of {}", kind.plural());
    with_limits(&title, &format!("speed in {unit}/s"), lines, most.map(|most| vec![-most, most]))
}

/// Returns the seconds since the program's start.
fn time(world: &[&Sample], sample: &Sample) -> f64 {
    sample.time - world[0].time
}
