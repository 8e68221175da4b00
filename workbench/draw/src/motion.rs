// SPDX-License-Identifier: GPL-2.0-or-later
//! The joints of a motion: values, changes along the path, speeds and corrections.

use crate::lines::{Line, first_up, lines};
use crate::plot::{DrawError, Plot};
use crate::sample::Sample;
use crate::sheet::TIME;
use crate::strips::{Strip, Strips, drawn_apart, drawn_strips};
use crate::tool_path::{isometric, tool_path};
use kinematics::{MAX_EXTRA, MAX_JOINTS};
use machine::read::joints::{Group, JointKind};
use machine::read::mechanism::Mechanism;
use program::joint_curves::{Along, along};
use program::timeline::AllJoints;

const JOINTS: usize = MAX_JOINTS + MAX_EXTRA;

/// Draws all plots of a trace.
///
/// # Errors
/// As [`DrawError`].
pub fn all(config: &Mechanism, samples: &[Sample]) -> Result<Vec<Plot>, DrawError> {
    let world: Vec<&Sample> = samples.iter().filter(|s| s.in_world).collect();
    let unit = config.length_unit();
    let rows: Vec<Row> = world.iter().map(|s| (time(&world, s), s.commands(config))).collect();
    let path = along(world.iter().zip(&rows).map(|(s, row)| (s.pose, row.1)));
    let mut plots = vec![];
    let all = config.all_groups();
    for group in all.iter().filter(|group| is_drawn(group, &rows)) {
        let is_only = all.iter().filter(|other| other.kind == group.kind).count() == 1;
        let name = match (is_only, group.unit) {
            (true, _) => group.kind.plural().into(),
            (false, "degrees") => format!("rotary {}", group.kind.plural()),
            (false, _) => format!("linear {}", group.kind.plural()),
        };
        plots.extend(of_group(config, (&name, group), &rows, &path)?);
    }
    if has_lead(config) {
        plots.push(Plot {
            file: "corrections.svg".into(),
            caption: "Length corrections for the nuts that turn as the platform tilts".into(),
            svg: corrections(config, &world, unit)?,
        });
    }
    let point = if config.chain.is_empty() { "control point" } else { "tip on the work" };
    plots.push(Plot {
        file: "tool-path.svg".into(),
        caption: format!("Path of the {point} in the planes it moves in"),
        svg: tool_path(&world, unit)?,
    });
    plots.push(Plot {
        file: "tool-path-3d.svg".into(),
        caption: format!("Path of the {point} in space, with the tool axis at some places"),
        svg: isometric(&world, unit)?,
    });
    Ok(plots)
}

/// Time, and commands of all joints.
type Row = (f64, AllJoints);

/// Returns whether a group is drawn: extra axes only if one of them moves, because many programs leave them at rest.
fn is_drawn(group: &Group, rows: &[Row]) -> bool {
    let moves = |i: &usize| rows.iter().any(|row| row.1[*i] != rows[0].1[*i]);
    group.kind != JointKind::Extra || group.joints.iter().any(moves)
}

fn has_lead(config: &Mechanism) -> bool {
    config.geometry.legs().iter().any(|leg| leg.kind.screw().lead != 0.0)
}

/// Draws values, changes along the path and speeds of joints of one kind.
fn of_group(
    config: &Mechanism,
    named: (&str, &Group),
    rows: &[Row],
    path: &[Along<JOINTS>],
) -> Result<[Plot; 3], DrawError> {
    let (name, _) = named;
    let stem = name.replace(' ', "-");
    Ok([
        Plot {
            file: format!("{stem}.svg"),
            caption: format!("{} during the program, with their limits", first_up(name)),
            svg: values(config, named, rows)?,
        },
        Plot {
            file: format!("{stem}-path.svg"),
            caption: format!(
                "Change of {name} since the program's start, against the length of the path of \
                 the control point; a turn in place is a vertical line"
            ),
            svg: changes(config, named, path)?,
        },
        Plot {
            file: format!("{stem}-speeds.svg"),
            caption: format!("Speeds of {name}, with their limits"),
            svg: speeds(config, named, rows)?,
        },
    ])
}

fn values(
    config: &Mechanism,
    (name, group): (&str, &Group),
    rows: &[Row],
) -> Result<String, DrawError> {
    let lines = lines(config, group, rows.iter().map(|(t, values)| (*t, values)));
    let limits = |i: &usize| config.range_of(*i).to_vec();
    let y = format!("{} in {}", group.kind.quantity(), group.unit);
    with_limits(&first_up(name), &y, lines, group.joints.iter().map(limits))
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

fn changes(
    config: &Mechanism,
    (name, group): (&str, &Group),
    path: &[Along<JOINTS>],
) -> Result<String, DrawError> {
    let title = format!("{}: change since the program's start", first_up(name));
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

fn speeds(
    config: &Mechanism,
    (name, group): (&str, &Group),
    rows: &[Row],
) -> Result<String, DrawError> {
    let speeds = rates(rows);
    let lines = lines(config, group, speeds.iter().map(|(t, values)| (*t, values)));
    let most = group.joints.iter().map(|i| config.joint(*i).speed());
    let y = format!("speed in {}/s", group.unit);
    with_limits(&format!("Speeds of {name}"), &y, lines, most.map(|most| vec![-most, most]))
}

/// Returns the mean speeds between rows, each at the later one.
fn rates(rows: &[Row]) -> Vec<Row> {
    let rate = |w: &[Row]| {
        let [(before, from), (now, to)] = [w[0], w[1]];
        (now, std::array::from_fn(|i| (to[i] - from[i]) / (now - before)))
    };
    rows.windows(2).map(rate).collect()
}

/// Returns the seconds since the program's start.
fn time(world: &[&Sample], sample: &Sample) -> f64 {
    sample.time - world[0].time
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_those_of_the_time_between_the_poses() {
        let rows = [(0.0, 1.0), (0.5, 3.0), (0.75, 3.0)].map(|(t, value)| (t, [value; JOINTS]));
        assert_eq!(rates(&rows), [(0.5, [4.0; JOINTS]), (0.75, [0.0; JOINTS])]);
    }
}
