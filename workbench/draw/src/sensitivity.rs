// SPDX-License-Identifier: GPL-2.0-or-later
//! Effects of joint errors: bars at one pose, and lines along a motion.

use crate::bars::{Bar, Group, bars};
use crate::course::{Course, lines_over, strips_over};
use crate::lines::Line;
use crate::plot::{DrawError, Plot};
use crate::sheet::Frame;
use crate::strips::Strip;
use crate::thin::thin;
use kinematics::Letter;
use machine::read::mechanism::Mechanism;
use studies::study::sensitivity::{Point, Sensitivity};

/// Draws the effects of joint errors: bars at one pose, and lines along a motion.
///
/// # Errors
/// As [`DrawError`].
pub fn of_sensitivity(
    config: &Mechanism,
    found: &Sensitivity,
    sigma: &[f64],
    points: &[Point],
) -> Result<Vec<Plot>, DrawError> {
    let unit = config.length_unit();
    let mut plots = vec![];
    for (part, from, unit) in [("position", 0, unit), ("angles", 3, "degrees")] {
        let groups: Vec<Group> = Letter::ALL[from..from + 3]
            .iter()
            .filter(|letter| !config.machine.layout().is_held(**letter))
            .map(|letter| {
                let bar = |(j, s): (usize, &f64)| Bar {
                    number: j,
                    value: found.gain[(letter.index(), j)] * s,
                    half: 0.0,
                };
                let bars = sigma.iter().enumerate().map(bar).collect();
                Group { name: letter.name().into(), bars }
            })
            .collect();
        if groups.is_empty() {
            continue;
        }
        let caption = format!("Share of each joint in the error of the {part}");
        let y = format!("error for one standard deviation, in {unit}");
        let svg = bars(
            &Frame { title: &caption, x: "number of the joint at each bar", y: &y, limits: vec![] },
            &groups,
        )?;
        plots.push(Plot { file: format!("sensitivity-{part}.svg"), caption, svg });
    }
    if !points.is_empty() {
        plots.extend(of_motion(config, points)?);
    }
    Ok(plots)
}

/// Value of a line at a point of a motion.
type Value<'a> = Box<dyn Fn(&Point) -> f64 + 'a>;

fn of_motion(config: &Mechanism, points: &[Point]) -> Result<Vec<Plot>, DrawError> {
    let unit = config.length_unit();
    let course = Course::in_time(points.iter().map(|point| point.time).collect());
    let draw = |file: &str, caption: &str, y: &str, lines: Vec<(String, Value)>| {
        let line = |(name, value): (String, Value)| Line {
            name,
            points: thin(points.iter().map(|point| (point.time, value(point)))),
        };
        let lines: Vec<Line> = lines.into_iter().map(line).collect();
        lines_over(&course, file, caption, y, lines)
    };
    let moved = |from: usize| {
        let letters = Letter::ALL[from..from + 3].iter();
        letters.filter(|letter| !config.machine.layout().is_held(**letter))
    };
    let mut plots = vec![];
    for (part, from, unit) in [("position", 0, unit), ("angles", 3, "degrees")] {
        if moved(from).count() == 0 {
            continue;
        }
        let pose = moved(from).map(|letter| {
            let value: Value = Box::new(|point: &Point| point.pose[letter.index()]);
            (letter.name().to_string(), value)
        });
        let file = format!("motion-{part}.svg");
        plots.push(draw(
            &file,
            &format!("Motion: {part}"),
            &format!("{part} in {unit}"),
            pose.collect(),
        )?);
        let sigma = moved(from).map(|letter| {
            let value: Value = Box::new(|point: &Point| point.sigma[letter.index()]);
            (letter.name().to_string(), value)
        });
        let caption = format!("Standard deviation of the {part} along the motion");
        let file = format!("motion-sigma-{part}.svg");
        plots.push(draw(&file, &caption, &format!("deviation in {unit}"), sigma.collect())?);
    }
    for group in config.groups() {
        let stem = group.kind.plural().replace(' ', "-");
        let joints = |rates: bool| -> Vec<(String, Value)> {
            let line = |i: &usize| {
                let i = *i;
                let value: Value = match rates {
                    true => Box::new(move |point: &Point| point.rates[i]),
                    false => Box::new(move |point: &Point| point.joints[i]),
                };
                (config.joints[i].name.clone(), value)
            };
            group.joints.iter().map(line).collect()
        };
        let caption = format!("Motion: {}", group.kind.plural());
        let y = format!("{} in {}", group.kind.quantity(), group.unit);
        plots.push(draw(&format!("motion-{stem}.svg"), &caption, &y, joints(false))?);
        let caption = format!("Motion: rates of {}", group.kind.plural());
        let y = format!("rate in {}/s", group.unit);
        plots.push(draw(&format!("motion-{stem}-rates.svg"), &caption, &y, joints(true))?);
    }
    let hold = thin(points.iter().map(|point| (point.time, point.hold)));
    let hold = Line { name: "singular value".into(), points: hold };
    let limit = Some(config.conditioning_limit).filter(|limit| *limit > 0.0);
    let caption = "Conditioning (smallest singular value)";
    let y = "smallest singular value, no unit";
    let strips = [Strip::of(hold, limit.into_iter().collect())];
    plots.push(strips_over(&course, "motion-hold.svg", caption, y, &strips)?);
    Ok(plots)
}
