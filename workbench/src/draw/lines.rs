// SPDX-License-Identifier: GPL-2.0-or-later
//! Lines over time or over the length of a path, and how few points they need.

use crate::draw::plot::DrawError;
use crate::draw::sheet::{Chart, Frame, LEGEND_ROOM, SIZE, STYLES, axes, drawn, legend, padded};
use crate::read::joints::Group;
use crate::read::machine::MachineConfig;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

/// One named line of a plot.
pub(super) struct Line {
    pub(super) name: String,
    pub points: Vec<(f64, f64)>,
}

/// Marks of a dashed line are placed by pixels; more points than pixels only cost size.
const MOST_POINTS: usize = 1500;

pub(super) fn drawn_lines(frame: &Frame, lines: &[Line]) -> Result<String, DrawError> {
    drawn(|root| {
        let values = lines.iter().flat_map(|l| l.points.iter().map(|p| p.1));
        let y = padded(values.chain(frame.limits.iter().map(|limit| limit.1)));
        let end = lines[0].points.last().map(|p| p.0).filter(|end| *end > 0.0).unwrap_or(1.0);
        let mut chart = axes(root, frame, 0.0..end * LEGEND_ROOM, y)?;
        for (name, value) in &frame.limits {
            let ends = [(0.0, *value), (end, *value)];
            chart
                .draw_series(LineSeries::new(ends, BLACK.stroke_width(3)))?
                .label(name)
                .legend(|(x, y)| PathElement::new([(x, y), (x + 34, y)], BLACK.stroke_width(3)));
        }
        draw_lines(&mut chart, lines)?;
        legend(&mut chart)
    })
}

pub(super) fn draw_lines(chart: &mut Chart, lines: &[Line]) -> Result<(), DrawError> {
    for (line, (colour, (dash, gap))) in lines.iter().zip(STYLES) {
        let style = colour.stroke_width(2);
        let sample = move |(x, y)| DashedPathElement::new([(x, y), (x + 34, y)], dash, gap, style);
        let series =
            chart.draw_series(DashedLineSeries::new(line.points.clone(), dash, gap, style));
        series?.label(&line.name).legend(sample);
    }
    Ok(())
}

/// One line for each joint of a group, from (abscissa, values of all joints).
pub(super) fn lines<'a, const N: usize>(
    config: &MachineConfig,
    group: &Group,
    rows: impl Iterator<Item = (f64, &'a [f64; N])> + Clone,
) -> Vec<Line> {
    let line = |i: &usize| Line {
        name: config.joints[*i].name.clone(),
        points: thin(rows.clone().map(|(x, values)| (x, values[*i]))),
    };
    group.joints.iter().map(line).collect()
}

pub(super) fn first_up(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or(String::new(), |c| c.to_uppercase().chain(characters).collect())
}

/// Few enough points; every group keeps its point of largest amount, so that peaks stay.
pub(super) fn thin(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = points.collect();
    let group = points.len().div_ceil(MOST_POINTS).max(1);
    let peak = |group: &[(f64, f64)]| {
        group.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or_default()
    };
    points.chunks(group).map(peak).collect()
}

/// As [`thin`], keeping the lowest points.
pub(super) fn thin_low(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = points.filter(|point| point.1.is_finite()).collect();
    let group = points.len().div_ceil(MOST_POINTS).max(1);
    let least = |group: &[(f64, f64)]| {
        group.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
    };
    points.chunks(group).map(least).collect()
}

/// The points that lie apart by about a pixel, and the last one.
pub(super) fn apart(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    places_apart(points, 1.0).into_iter().map(|place| points[place]).collect()
}

/// Where in a list the points are that lie apart by about so many pixels, and the last one.
pub(super) fn places_apart(points: &[(f64, f64)], pixels: f64) -> Vec<usize> {
    let (x, y) = (padded(points.iter().map(|p| p.0)), padded(points.iter().map(|p| p.1)));
    let least = pixels * (x.end - x.start).max(y.end - y.start) / f64::from(SIZE.0);
    let mut kept: Vec<usize> = vec![];
    for (place, point) in points.iter().enumerate() {
        let far =
            |last: &usize| (point.0 - points[*last].0).hypot(point.1 - points[*last].1) > least;
        if kept.last().is_none_or(far) {
            kept.push(place);
        }
    }
    kept.extend(points.len().checked_sub(1).filter(|last| kept.last() != Some(last)));
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_peaks() {
        let spike = |k: u32| (f64::from(k), if k == 7777 { -5.0 } else { 1.0 });
        let points = thin((0..10_000).map(spike));
        assert!(points.len() <= MOST_POINTS, "{}", points.len());
        assert!(points.contains(&(7777.0, -5.0)));
    }

    #[test]
    fn a_path_keeps_its_bends_and_loses_what_a_pixel_hides() {
        let circle = |k: u32| (f64::from(k) * 1e-5 * std::f64::consts::TAU).sin_cos();
        let points: Vec<_> = (0..=50_000).map(circle).collect();
        let kept = apart(&points);
        assert!((500..2000).contains(&kept.len()), "{}", kept.len());
        assert_eq!(kept.last(), points.last());
    }
}
