// SPDX-License-Identifier: GPL-2.0-or-later
//! Lines in one plot, for comparison.

use crate::key::{Key, Sign, keyed};
use crate::plot::DrawError;
use crate::sheet::{Chart, Frame, axes, padded};
use crate::style::{limit_style, line_style};
use crate::thin::{bends, thin};
use machine::read::joints::Group;
use machine::read::mechanism::Mechanism;
use plotters::prelude::*;

/// One named line of a plot.
pub(super) struct Line {
    pub(super) name: String,
    pub points: Vec<(f64, f64)>,
}

pub(super) fn drawn_lines(frame: &Frame, lines: &[Line]) -> Result<String, DrawError> {
    let limits = frame.limits.iter().map(|(name, _)| Key::new(Sign::Line(limit_style()), name));
    let names = lines.iter().enumerate().map(|(k, line)| Key::line(k, &line.name));
    let keys: Vec<Key> = limits.chain(names).collect();
    keyed(&keys, |area| {
        let values = lines.iter().flat_map(|l| l.points.iter().map(|p| p.1)).filter(finite);
        let y = padded(values.chain(frame.limits.iter().map(|limit| limit.1)));
        let ends = lines.iter().filter_map(|line| line.points.last()).map(|p| p.0);
        let end = Some(ends.fold(0.0, f64::max)).filter(|end| *end > 0.0).unwrap_or(1.0);
        let mut chart = axes(area, frame, 0.0..end, y)?;
        for (_, value) in &frame.limits {
            let ends = [(0.0, *value), (end, *value)];
            chart.draw_series([PathElement::new(ends, limit_style())])?;
        }
        lines.iter().enumerate().try_for_each(|(k, line)| draw_line(&mut chart, line, k))
    })
}

fn finite(value: &f64) -> bool {
    value.is_finite()
}

/// Draws a line in the style of a number, with gaps where its values are not finite.
pub(super) fn draw_line(chart: &mut Chart, line: &Line, number: usize) -> Result<(), DrawError> {
    let parts = line.points.split(|point| !point.1.is_finite()).filter(|part| !part.is_empty());
    for part in parts {
        let path = without_stairs(chart, part);
        chart.draw_series([PathElement::new(path, line_style(number))])?;
    }
    Ok(())
}

/// Returns the points of a line that are visible in a chart.
pub(super) fn without_stairs(chart: &Chart, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let (width, height) = chart.plotting_area().dim_in_pixel();
    let (x, y) = (chart.x_range(), chart.y_range());
    let scale = (f64::from(width) / (x.end - x.start), f64::from(height) / (y.end - y.start));
    let pixels: Vec<(f64, f64)> = points.iter().map(|p| (p.0 * scale.0, p.1 * scale.1)).collect();
    bends(&pixels).into_iter().map(|place| points[place]).collect()
}

/// Returns one line for each joint of a group, from (abscissa, values of all joints).
pub(super) fn lines<'a, const N: usize>(
    config: &Mechanism,
    group: &Group,
    rows: impl Iterator<Item = (f64, &'a [f64; N])> + Clone,
) -> Vec<Line> {
    let line = |i: &usize| Line {
        name: config.joint(*i).name.clone(),
        points: thin(rows.clone().map(|(x, values)| (x, values[*i]))),
    };
    group.joints.iter().map(line).collect()
}

pub(super) fn first_up(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or(String::new(), |c| c.to_uppercase().chain(characters).collect())
}
