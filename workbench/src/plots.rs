// SPDX-License-Identifier: GPL-2.0-or-later
//! SVG plots of traces, made to be read in black and white as well: lines differ in
//! dashes, not in colour alone.

use crate::machine::{JOINTS, MachineConfig};
use crate::trace::Sample;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use std::ops::Range;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

const SIZE: (u32, u32) = (960, 600);
const FONT: &str = "sans-serif";
/// Marks of a dashed line are placed by pixels; more points than pixels only cost size.
const MOST_POINTS: usize = 1500;
/// Tool axes drawn along the path.
const NEEDLES: usize = 60;
/// Plots over time are this much longer than the data: the legend covers nothing.
const LEGEND_ROOM: f64 = 1.2;
/// Isometric view: X to the right and down, Y to the right and up, Z up.
const COS_30: f64 = 0.866_025_403_784_438_6;

/// Dark shades that print apart, and (dash, gap) in pixels.
const STYLES: [(RGBColor, (u32, u32)); JOINTS] = [
    (RGBColor(0, 0, 0), (40, 1)),
    (RGBColor(0, 90, 160), (12, 5)),
    (RGBColor(180, 40, 20), (5, 4)),
    (RGBColor(0, 120, 70), (2, 4)),
    (RGBColor(120, 60, 140), (18, 4)),
    (RGBColor(150, 100, 0), (9, 9)),
];

/// One named line of a plot.
struct Line {
    name: String,
    points: Vec<(f64, f64)>,
}

/// What stands around the lines.
struct Frame<'a> {
    title: &'a str,
    x: &'a str,
    y: &'a str,
    /// Horizontal lines, named.
    limits: Vec<(String, f64)>,
}

/// A plot: its file name and its SVG text.
#[derive(Clone, Debug)]
pub struct Plot {
    /// File name, ending in .svg.
    pub file: &'static str,
    /// What it shows, one line.
    pub caption: &'static str,
    /// The drawing.
    pub svg: String,
}

/// All plots of a trace.
///
/// # Errors
/// A sentence of the drawing library.
pub fn all(config: &MachineConfig, samples: &[Sample]) -> Result<Vec<Plot>, String> {
    let world: Vec<&Sample> = samples.iter().filter(|s| s.in_world).collect();
    let unit = config.length_unit();
    Ok(vec![
        Plot {
            file: "struts.svg",
            caption: "Strut lengths during the program, between the limits of the INI file",
            svg: struts(config, &world, unit)?,
        },
        Plot {
            file: "corrections.svg",
            caption: "Length corrections for the nuts that turn as the platform tilts",
            svg: corrections(&world, unit)?,
        },
        Plot {
            file: "speeds.svg",
            caption: "Joint speeds; the lowest limit of the INI file stands above the plot",
            svg: speeds(config, &world, unit)?,
        },
        Plot {
            file: "tool-path.svg",
            caption: "Path of the control point seen from above and from the side",
            svg: tool_path(&world, unit)?,
        },
        Plot {
            file: "tool-path-3d.svg",
            caption: "Path of the control point (isometric) with the tool axis at some places",
            svg: isometric(&world, unit)?,
        },
    ])
}

fn struts(config: &MachineConfig, world: &[&Sample], unit: &str) -> Result<String, String> {
    let low = config.joints.iter().fold(f64::NEG_INFINITY, |low, j| low.max(j.min));
    let high = config.joints.iter().fold(f64::INFINITY, |high, j| high.min(j.max));
    let frame = Frame {
        title: "Strut lengths",
        x: "time in s",
        y: &format!("length in {unit}"),
        limits: vec![(format!("shortest {low}"), low), (format!("longest {high}"), high)],
    };
    over_time(&frame, &joint_lines(world, "strut", |s, i| s.joints[i]))
}

fn corrections(world: &[&Sample], unit: &str) -> Result<String, String> {
    let frame = Frame {
        title: "Nut corrections",
        x: "time in s",
        y: &format!("correction in {unit}"),
        limits: vec![],
    };
    over_time(&frame, &joint_lines(world, "strut", |s, i| s.corrections[i]))
}

fn speeds(config: &MachineConfig, world: &[&Sample], unit: &str) -> Result<String, String> {
    let limit = config.joints.iter().fold(f64::INFINITY, |limit, j| limit.min(j.max_velocity));
    let frame = Frame {
        title: &format!("Joint speeds (limit {limit} {unit}/s)"),
        x: "time in s",
        y: &format!("speed in {unit}/s"),
        limits: vec![],
    };
    let line = |i: usize| Line {
        name: format!("strut {i}"),
        points: thin(world.windows(2).map(|w| {
            (w[1].time - world[0].time, (w[1].joints[i] - w[0].joints[i]) / config.period)
        })),
    };
    over_time(&frame, &(0..JOINTS).map(line).collect::<Vec<_>>())
}

fn joint_lines(world: &[&Sample], name: &str, value: fn(&Sample, usize) -> f64) -> Vec<Line> {
    let line = |i| Line {
        name: format!("{name} {i}"),
        points: thin(world.iter().map(|s| (s.time - world[0].time, value(s, i)))),
    };
    (0..JOINTS).map(line).collect()
}

/// Few enough points; every group keeps its point of largest amount, so that peaks stay.
fn thin(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = points.collect();
    let group = points.len().div_ceil(MOST_POINTS).max(1);
    let peak = |group: &[(f64, f64)]| {
        group.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or_default()
    };
    points.chunks(group).map(peak).collect()
}

fn over_time(frame: &Frame, lines: &[Line]) -> Result<String, String> {
    drawn(|root| {
        let values = lines.iter().flat_map(|l| l.points.iter().map(|p| p.1));
        let y = padded(values.chain(frame.limits.iter().map(|limit| limit.1)));
        let end = lines[0].points.last().map_or(1.0, |p| p.0);
        let mut chart = axes(root, frame, 0.0..end * LEGEND_ROOM, y)?;
        for (name, value) in &frame.limits {
            let ends = [(0.0, *value), (end, *value)];
            chart
                .draw_series(LineSeries::new(ends, BLACK.stroke_width(3)))
                .map_err(text)?
                .label(name)
                .legend(|(x, y)| PathElement::new([(x, y), (x + 34, y)], BLACK.stroke_width(3)));
        }
        draw_lines(&mut chart, lines)?;
        legend(&mut chart)
    })
}

fn tool_path(world: &[&Sample], unit: &str) -> Result<String, String> {
    drawn(|root| {
        let halves = root.split_evenly((1, 2));
        let views = [("Seen from above", 0, 1, "Y"), ("Seen from the front", 0, 2, "Z")];
        for (area, (title, h, v, name)) in halves.iter().zip(views) {
            let points: Vec<(f64, f64)> = world.iter().map(|s| (s.pose[h], s.pose[v])).collect();
            let frame = Frame {
                title,
                x: &format!("X in {unit}"),
                y: &format!("{name} in {unit}"),
                limits: vec![],
            };
            let mut chart = path_axes(area, &frame, &points)?;
            chart.draw_series(LineSeries::new(apart(&points), BLACK)).map_err(text)?;
        }
        Ok(())
    })
}

fn isometric(world: &[&Sample], unit: &str) -> Result<String, String> {
    drawn(|root| {
        let points: Vec<(f64, f64)> =
            world.iter().map(|s| project([s.pose[0], s.pose[1], s.pose[2]])).collect();
        let (x, y) = (padded(points.iter().map(|p| p.0)), padded(points.iter().map(|p| p.1)));
        let length = 0.08 * (x.end - x.start).max(y.end - y.start);
        let step = (world.len() / NEEDLES).max(1);
        let needles: Vec<_> = world.iter().step_by(step).map(|s| needle(s, length)).collect();
        let ends: Vec<(f64, f64)> = points.iter().chain(needles.as_flattened()).copied().collect();
        let frame = Frame {
            title: "Tool path, isometric: X right and down, Y right and up, Z up",
            x: &format!("(X + Y) cos 30° in {unit}"),
            y: &format!("Z + (Y - X)/2 in {unit}"),
            limits: vec![],
        };
        let mut chart = path_axes(root, &frame, &ends)?;
        chart
            .draw_series(LineSeries::new(apart(&points), BLACK.stroke_width(2)))
            .map_err(text)?
            .label("control point")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 34, y)], BLACK.stroke_width(2)));
        let thin = STYLES[2].0.stroke_width(1);
        chart
            .draw_series(needles.iter().map(|ends| PathElement::new(*ends, thin)))
            .map_err(text)?
            .label("tool axis")
            .legend(move |(x, y)| PathElement::new([(x, y + 6), (x + 12, y - 6)], thin));
        legend(&mut chart)
    })
}

/// From the control point along the tool axis, tip to holder.
fn needle(sample: &Sample, length: f64) -> [(f64, f64); 2] {
    let pose = kinematics::Pose::from_degrees(sample.pose);
    let end = pose.position + pose.rotation().column(2) * length;
    [project(pose.position.into()), project(end.into())]
}

fn project([x, y, z]: [f64; 3]) -> (f64, f64) {
    ((x + y) * COS_30, z + (y - x) * 0.5)
}

/// The points that lie apart by about a pixel, and the last one.
fn apart(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let (x, y) = (padded(points.iter().map(|p| p.0)), padded(points.iter().map(|p| p.1)));
    let pixel = (x.end - x.start).max(y.end - y.start) / f64::from(SIZE.0);
    let mut kept: Vec<(f64, f64)> = vec![];
    for point in points {
        let far = |last: &(f64, f64)| (point.0 - last.0).hypot(point.1 - last.1) > pixel;
        if kept.last().is_none_or(far) {
            kept.push(*point);
        }
    }
    kept.extend(points.last());
    kept
}

/// Both axes at one scale.
fn path_axes<'a, 'b>(
    area: &'a Area<'b>,
    frame: &Frame,
    points: &[(f64, f64)],
) -> Result<Chart<'a, 'b>, String> {
    let (width, height) = area.dim_in_pixel();
    let (x, y) = (padded(points.iter().map(|p| p.0)), padded(points.iter().map(|p| p.1)));
    let scale = ((x.end - x.start) / f64::from(width)).max((y.end - y.start) / f64::from(height));
    let around = |range: Range<f64>, pixels: u32| {
        let (middle, half) = ((range.start + range.end) / 2.0, scale * f64::from(pixels) / 2.0);
        middle - half..middle + half
    };
    axes(area, frame, around(x, width), around(y, height))
}

fn axes<'a, 'b>(
    area: &'a Area<'b>,
    frame: &Frame,
    x: Range<f64>,
    y: Range<f64>,
) -> Result<Chart<'a, 'b>, String> {
    let mut chart = ChartBuilder::on(area)
        .caption(frame.title, (FONT, 22))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y)
        .map_err(text)?;
    chart
        .configure_mesh()
        .x_desc(frame.x)
        .y_desc(frame.y)
        .label_style((FONT, 14))
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .axis_desc_style((FONT, 16))
        .light_line_style(WHITE)
        .draw()
        .map_err(text)?;
    Ok(chart)
}

/// Ticks are round numbers: without the digits of their rounding, and without "-0".
fn tick(value: &f64) -> String {
    format!("{}", (value * 1e6).round() / 1e6 + 0.0)
}

fn draw_lines(chart: &mut Chart, lines: &[Line]) -> Result<(), String> {
    for (line, (colour, (dash, gap))) in lines.iter().zip(STYLES) {
        let style = colour.stroke_width(2);
        let sample = move |(x, y)| DashedPathElement::new([(x, y), (x + 34, y)], dash, gap, style);
        let series =
            chart.draw_series(DashedLineSeries::new(line.points.clone(), dash, gap, style));
        series.map_err(text)?.label(&line.name).legend(sample);
    }
    Ok(())
}

fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>) -> Result<(), String> {
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK)
        .legend_area_size(44)
        .label_font((FONT, 14))
        .position(SeriesLabelPosition::UpperRight)
        .draw()
        .map_err(text)
}

/// The range of the values with a margin; a flat line gets one unit around it.
fn padded(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    let span = high - low;
    let margin = if span > 1e-9 * high.abs() { 0.06 * span } else { 1.0 };
    low - margin..high + margin
}

fn drawn(draw: impl FnOnce(&Area) -> Result<(), String>) -> Result<String, String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        draw(&root)?;
        root.present().map_err(text)?;
    }
    Ok(svg)
}

fn text(error: impl std::fmt::Display) -> String {
    format!("the plot cannot be drawn: {error}")
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

    #[test]
    fn a_flat_line_has_room() {
        assert_eq!(padded([0.0, 0.0].into_iter()), -1.0..1.0);
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!([tick(&-0.0), tick(&0.300_000_000_4), tick(&1400.0)], ["0", "0.3", "1400"]);
    }
}
