// SPDX-License-Identifier: GPL-2.0-or-later
//! Effects of joint errors: bars at one pose, and lines along a motion.

use crate::course::{Course, lines_over, strips_over};
use crate::lines::Line;
use crate::plot::{DrawError, Plot};
use crate::sheet::{Frame, drawn, tick};
use crate::strips::Strip;
use crate::style::{FONT, NAME, PALE, SMALL, TITLE, area_color, letters_at};
use crate::thin::thin;
use kinematics::Letter;
use machine::read::mechanism::Mechanism;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
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
        let groups: Vec<(char, Vec<f64>)> = Letter::ALL[from..from + 3]
            .iter()
            .filter(|letter| !config.machine.layout().is_held(**letter))
            .map(|letter| {
                let gain = |(j, s): (usize, &f64)| found.gain[(letter.index(), j)] * s;
                (letter.name(), sigma.iter().enumerate().map(gain).collect())
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

/// Draws bars in groups, each bar with the number of its joint.
fn bars(frame: &Frame, groups: &[(char, Vec<f64>)]) -> Result<String, DrawError> {
    let all = || groups.iter().flat_map(|(_, values)| values.iter().copied());
    let most = all().fold(0.0, |most: f64, value| most.max(value.abs())).max(f64::MIN_POSITIVE);
    let count = groups[0].1.len();
    drawn(|root| {
        let width = groups.len() as f64;
        let mut chart = ChartBuilder::on(root)
            .caption(frame.title, (FONT, TITLE))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(96)
            .build_cartesian_2d(0.0..width, -1.15 * most..1.3 * most)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_labels(0)
            .x_desc(frame.x)
            .y_desc(frame.y)
            .y_label_formatter(&tick)
            .label_style((FONT, SMALL))
            .axis_desc_style((FONT, NAME))
            .light_line_style(WHITE)
            .draw()?;
        let number = letters_at(SMALL, HPos::Center, VPos::Center);
        for (g, (name, values)) in groups.iter().enumerate() {
            let left = |j: usize| g as f64 + 0.1 + 0.8 * j as f64 / count as f64;
            for (j, value) in values.iter().enumerate() {
                let corners = [(left(j), 0.0), (left(j) + 0.64 / count as f64, *value)];
                let filled = Rectangle::new(corners, area_color(0).filled());
                let outline = Rectangle::new(corners, BLACK.stroke_width(1));
                chart.draw_series([filled, outline])?;
                let beyond = value + most * 0.04 * if *value < 0.0 { -1.0 } else { 1.0 };
                let at = (left(j) + 0.32 / count as f64, beyond);
                chart.draw_series([Text::new(j.to_string(), at, number.clone())])?;
            }
            let head = letters_at(TITLE, HPos::Center, VPos::Top);
            chart.draw_series([Text::new(
                name.to_string(),
                (g as f64 + 0.5, 1.28 * most),
                head,
            )])?;
            if g > 0 {
                let edge = [(g as f64, -1.15 * most), (g as f64, 1.3 * most)];
                chart.draw_series([PathElement::new(edge, PALE.stroke_width(1))])?;
            }
        }
        let zero = [(0.0, 0.0), (width, 0.0)];
        chart.draw_series([PathElement::new(zero, BLACK.stroke_width(1))])?;
        Ok(())
    })
}
