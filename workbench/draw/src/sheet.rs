// SPDX-License-Identifier: GPL-2.0-or-later
//! A sheet: its size and its axes.

use crate::plot::DrawError;
use crate::style::{FONT, NAME, SMALL, TITLE, dashed};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

pub(super) type Chart<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
pub(super) const SIZE: (u32, u32) = (960, 600);
pub(super) const TIME: &str = "time in s";

/// Margin of a plot, pixels.
pub(super) const MARGIN: u32 = 12;

/// Pixels for ticks and axis name below a plot, and to its left.
const BELOW: u32 = 44;

const LEFT: u32 = 80;

/// Pixels to its right, for half of a tick's label.
const RIGHT: u32 = 28;

/// Pixels around a plot with a caption, horizontally and vertically.
pub(super) const AROUND: (u32, u32) = (LEFT + MARGIN + RIGHT, BELOW + CAPTION + 2 * MARGIN);

/// Least distance of ticks, pixels.
const TICK: (u32, u32) = (54, 30);

/// Height of the caption above a plot, pixels.
pub(super) const CAPTION: u32 = 26;

/// Title, axes and limits of a plot.
pub(super) struct Frame<'a> {
    pub title: &'a str,
    pub x: &'a str,
    pub y: &'a str,
    /// Horizontal lines, named.
    pub limits: Vec<(String, f64)>,
}

/// Draws a sheet of the default size.
pub(super) fn drawn(
    draw: impl FnOnce(&Area) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    drawn_on(SIZE, draw)
}

/// Draws a sheet of a size in pixels.
pub(super) fn drawn_on(
    size: (u32, u32),
    draw: impl FnOnce(&Area) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        draw(&root)?;
        root.present()?;
    }
    Ok(dashed(svg))
}

pub(super) fn axes<'a, 'b>(
    area: &'a Area<'b>,
    frame: &Frame,
    x: Range<f64>,
    y: Range<f64>,
) -> Result<Chart<'a, 'b>, DrawError> {
    let mut builder = ChartBuilder::on(area);
    if !frame.title.is_empty() {
        builder.caption(frame.title, (FONT, TITLE));
    }
    let mut chart = builder
        .margin(MARGIN)
        .margin_right(RIGHT)
        .x_label_area_size(BELOW)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(x, y)?;
    let (width, height) = chart.plotting_area().dim_in_pixel();
    chart
        .configure_mesh()
        .x_labels((width / TICK.0).clamp(2, 20) as usize)
        .y_labels((height / TICK.1).clamp(2, 20) as usize)
        .x_desc(frame.x)
        .y_desc(frame.y)
        .label_style((FONT, SMALL))
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .axis_desc_style((FONT, NAME))
        .light_line_style(WHITE)
        .draw()?;
    Ok(chart)
}

/// Formats a tick: without digits due to rounding, and without "-0".
pub(super) fn tick(value: &f64) -> String {
    format!("{}", (value * 1e6).round() / 1e6 + 0.0)
}

pub(super) fn path_axes<'a, 'b>(
    area: &'a Area<'b>,
    frame: &Frame,
    points: &[(f64, f64)],
) -> Result<Chart<'a, 'b>, DrawError> {
    let (width, height) = area.dim_in_pixel();
    let caption = if frame.title.is_empty() { 0 } else { CAPTION };
    let (width, height) = (width - LEFT - MARGIN - RIGHT, height - BELOW - caption - 2 * MARGIN);
    let (x, y) = (padded(points.iter().map(|p| p.0)), padded(points.iter().map(|p| p.1)));
    let scale = ((x.end - x.start) / f64::from(width)).max((y.end - y.start) / f64::from(height));
    let around = |range: Range<f64>, pixels: u32| {
        let (middle, half) = ((range.start + range.end) / 2.0, scale * f64::from(pixels) / 2.0);
        middle - half..middle + half
    };
    axes(area, frame, around(x, width), around(y, height))
}

/// Returns the width in pixels of an area as high as a sheet that [`path_axes`] fills with these sides.
pub(super) fn width_for([wide, high]: [f64; 2]) -> u32 {
    let height = SIZE.1 - BELOW - CAPTION - 2 * MARGIN;
    let width = (f64::from(height) * wide / high).clamp(240.0, 720.0) as u32;
    width + LEFT + MARGIN + RIGHT
}

/// Returns the lowest and highest value.
pub(super) fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

/// Returns the range of the values with a margin; a constant gets one unit around it.
pub(super) fn padded(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = span(values);
    let span = high - low;
    let margin = if span > 1e-9 * high.abs() { 0.06 * span } else { 1.0 };
    low - margin..high + margin
}

/// Returns round values within a range, about `steps` steps apart.
pub(super) fn round_steps([low, high]: [f64; 2], steps: usize) -> Vec<f64> {
    let rough = (high - low) / steps as f64;
    if !(rough > 1e-9 * high.abs().max(low.abs())) {
        return vec![];
    }
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| *step >= rough);
    let step = step.unwrap_or(10.0 * power);
    let first = (low / step).ceil() as i64;
    (first..).map(|k| k as f64 * step).take_while(|level| *level <= high).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_drawn_round_in_every_part_of_a_sheet() {
        let circle: Vec<(f64, f64)> = (0..100).map(|k| f64::from(k).sin_cos()).collect();
        let frame = Frame { title: "Circle", x: "X", y: "Y", limits: vec![] };
        for grid in [(1, 1), (1, 2), (2, 2)] {
            drawn(|root| {
                let part = &root.split_evenly(grid)[0];
                let chart = path_axes(part, &frame, &circle)?;
                let (x, y) = (chart.x_range(), chart.y_range());
                let (width, height) = chart.plotting_area().dim_in_pixel();
                let scale = (x.end - x.start) / f64::from(width) / (y.end - y.start);
                // One pixel of 200, the rounding of the caption's height.
                assert!((scale * f64::from(height) - 1.0).abs() < 6e-3, "{grid:?} {scale}");
                Ok(())
            })
            .unwrap();
        }
    }

    #[test]
    fn the_label_of_the_last_tick_is_whole() {
        let frame = Frame { title: "Depths", x: "1/min", y: "mm", limits: vec![] };
        let svg = drawn(|root| axes(root, &frame, 3000.0..18000.0, 0.0..1.0).map(drop)).unwrap();
        let end = svg.find("\n18000\n").expect("a tick at the end");
        let tag = &svg[svg[..end].rfind("<text").unwrap()..end];
        let number = |name: &str| -> f64 {
            let rest = tag.split(&format!(" {name}=\"")).nth(1).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        // Five digits, each 0.6 of the font size wide, half of them to the right of the middle.
        let right = number("x") + 5.0 * 0.6 * number("font-size") / 2.0;
        assert!(tag.contains("middle") && right < f64::from(SIZE.0), "{tag}");
    }

    #[test]
    fn a_flat_line_has_room() {
        assert_eq!(padded([0.0, 0.0].into_iter()), -1.0..1.0);
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!([tick(&-0.0), tick(&0.300_000_000_4), tick(&1400.0)], ["0", "0.3", "1400"]);
    }

    #[test]
    fn steps_are_round_and_within_their_range() {
        assert_eq!(round_steps([-130.0, 260.0], 4), [-100.0, 0.0, 100.0, 200.0]);
        assert!(round_steps([3.0, 3.0], 4).is_empty());
    }
}
