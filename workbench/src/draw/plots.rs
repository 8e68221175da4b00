// SPDX-License-Identifier: GPL-2.0-or-later
//! SVG plots of traces, made to be read in black and white as well: lines differ in
//! dashes, not in colour alone.

use crate::draw::sample::Sample;
use crate::program::path::{Along, along};
use crate::program::preflight::Place;
use crate::read::machine::{Group, JointKind, MachineConfig};
use kinematics::{LegKind, Letter, MAX_JOINTS, MAX_LEGS};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use std::ops::Range;

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type Chart<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

pub(crate) const SIZE: (u32, u32) = (960, 600);
pub(crate) const TIME: &str = "time in s";
pub(crate) const FONT: &str = "sans-serif";
/// Marks of a dashed line are placed by pixels; more points than pixels only cost size.
const MOST_POINTS: usize = 1500;
/// Tool axes drawn along the path.
const NEEDLES: usize = 60;
/// Plots of joints are this much longer than the data: the legend covers nothing.
pub(crate) const LEGEND_ROOM: f64 = 1.2;
/// A path does not move along a coordinate that changes by less than this share of the others.
const LEAST_EXTENT: f64 = 1e-6;
/// Isometric view: X to the right and down, Y to the right and up, Z up.
const COS_30: f64 = 0.866_025_403_784_438_6;

/// Pixels around a plot.
const MARGIN: u32 = 12;
/// Pixels for ticks and description below a plot, and to its left.
const BELOW: u32 = 44;
const LEFT: u32 = 64;
/// Pixels that the caption takes above a plot.
const CAPTION: u32 = 28;

/// Dark shades that print apart, and (dash, gap) in pixels.
pub(crate) const STYLES: [(RGBColor, (u32, u32)); MAX_LEGS] = [
    (RGBColor(0, 0, 0), (40, 1)),
    (RGBColor(0, 90, 160), (12, 5)),
    (RGBColor(180, 40, 20), (5, 4)),
    (RGBColor(0, 120, 70), (2, 4)),
    (RGBColor(120, 60, 140), (30, 6)),
    (RGBColor(150, 100, 0), (9, 9)),
    (RGBColor(90, 90, 90), (18, 16)),
    (RGBColor(0, 110, 120), (3, 9)),
];

/// One named line of a plot.
pub(crate) struct Line {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

/// What stands around the lines.
pub(crate) struct Frame<'a> {
    pub title: &'a str,
    pub x: &'a str,
    pub y: &'a str,
    /// Horizontal lines, named.
    pub limits: Vec<(String, f64)>,
}

/// A plot: its file name and its SVG text.
#[derive(Clone, Debug)]
pub struct Plot {
    /// File name, ending in .svg.
    pub file: String,
    /// What it shows, one line.
    pub caption: String,
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

/// Plots of the places that a check of a program has looked at.
///
/// # Errors
/// A sentence of the drawing library.
pub fn of_places(config: &MachineConfig, places: &[Place]) -> Result<Vec<Plot>, String> {
    if places.is_empty() {
        return Ok(vec![]);
    }
    let mut plots = vec![
        Plot {
            file: "path-by-margin.svg".into(),
            caption: "Path of the control point (isometric), by its margin to the limits of joint \
                      ranges, cones, conditioning and rod distance"
                .into(),
            svg: path_by_margin(places, config.length_unit())?,
        },
        Plot {
            file: "margin.svg".into(),
            caption: "Least margin to joint ranges, cones, conditioning and rod distance".into(),
            svg: margins(places)?,
        },
    ];
    for group in config.groups() {
        let name = group.kind.plural();
        let stem = name.replace(' ', "-");
        let values = places.iter().map(|place| (place.time, &place.joints));
        let frame = Frame {
            title: &first_up(name),
            x: TIME,
            y: &format!("{} in {}", group.kind.quantity(), group.unit),
            limits: vec![],
        };
        plots.push(Plot {
            file: format!("{stem}.svg"),
            caption: format!("{} during the program", first_up(name)),
            svg: drawn_lines(&frame, &lines(config, &group, values))?,
        });
        let speeds = places.iter().map(|place| (place.time, &place.speeds));
        let frame = Frame {
            title: &format!("Speeds of {name}"),
            x: TIME,
            y: "share of the limit",
            limits: vec![("limit".into(), 1.0)],
        };
        plots.push(Plot {
            file: format!("{stem}-speeds.svg"),
            caption: format!("Speeds of {name} at the programmed feed, as shares of their limits"),
            svg: drawn_lines(&frame, &lines(config, &group, speeds))?,
        });
    }
    Ok(plots)
}

fn margins(places: &[Place]) -> Result<String, String> {
    let frame = Frame {
        title: "Least margin",
        x: TIME,
        y: "share of the limit's range",
        limits: vec![("limit".into(), 0.0)],
    };
    let points = thin_low(places.iter().map(|place| (place.time, place.margin)));
    drawn_lines(&frame, &[Line { name: "margin".into(), points }])
}

/// As [`thin`], keeping the lowest points.
pub(crate) fn thin_low(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = points.filter(|point| point.1.is_finite()).collect();
    let group = points.len().div_ceil(MOST_POINTS).max(1);
    let least = |group: &[(f64, f64)]| {
        group.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
    };
    points.chunks(group).map(least).collect()
}

fn path_by_margin(places: &[Place], unit: &str) -> Result<String, String> {
    // Dark where it is near; grey prints apart.
    let shades = [
        ("beyond or below 2 %", 0.02, RGBColor(180, 0, 0)),
        ("below 10 %", 0.1, RGBColor(230, 120, 0)),
        ("more", f64::INFINITY, RGBColor(120, 160, 200)),
    ];
    let point = |place: &Place| project([place.pose[0], place.pose[1], place.pose[2]]);
    let stride = places.len().div_ceil(20 * MOST_POINTS).max(1);
    drawn(|root| {
        let points: Vec<(f64, f64)> = places.iter().map(point).collect();
        let frame = Frame {
            title: "Margins along the path: X right and down, Y right and up, Z up",
            x: &format!("(X + Y) cos 30° in {unit}"),
            y: &format!("Z + (Y - X)/2 in {unit}"),
            limits: vec![],
        };
        let mut chart = path_axes(root, &frame, &points)?;
        let line = LineSeries::new(apart(&points), BLACK.mix(0.3).stroke_width(1));
        chart.draw_series(line).map_err(text)?;
        let mut from = f64::NEG_INFINITY;
        for (name, to, colour) in shades {
            let inside = |place: &&Place| (from..to).contains(&place.margin);
            let near = places.iter().step_by(stride).filter(inside).map(point);
            chart
                .draw_series(near.map(|at| Circle::new(at, 2, colour.filled())))
                .map_err(text)?
                .label(name)
                .legend(move |(x, y)| Circle::new((x + 17, y), 4, colour.filled()));
            from = to;
        }
        legend(&mut chart)
    })
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
) -> Result<[Plot; 3], String> {
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

fn first_up(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or(String::new(), |c| c.to_uppercase().chain(characters).collect())
}

fn values(config: &MachineConfig, group: &Group, world: &[&Sample]) -> Result<String, String> {
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

fn changes(config: &MachineConfig, group: &Group, path: &[Along]) -> Result<String, String> {
    let frame = Frame {
        title: &format!("{}: change since the program's start", first_up(group.kind.plural())),
        x: &format!("length of the path in {}", config.length_unit()),
        y: &format!("change of {} in {}", group.kind.quantity(), group.unit),
        limits: vec![],
    };
    drawn_lines(&frame, &lines(config, group, path.iter().map(|a| (a.length, &a.change))))
}

fn corrections(config: &MachineConfig, world: &[&Sample], unit: &str) -> Result<String, String> {
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

fn speeds(config: &MachineConfig, group: &Group, world: &[&Sample]) -> Result<String, String> {
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

/// One line for each joint of a group, from (abscissa, values of all joints).
fn lines<'a, const N: usize>(
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

/// Few enough points; every group keeps its point of largest amount, so that peaks stay.
pub(crate) fn thin(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = points.collect();
    let group = points.len().div_ceil(MOST_POINTS).max(1);
    let peak = |group: &[(f64, f64)]| {
        group.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or_default()
    };
    points.chunks(group).map(peak).collect()
}

pub(crate) fn drawn_lines(frame: &Frame, lines: &[Line]) -> Result<String, String> {
    drawn(|root| {
        let values = lines.iter().flat_map(|l| l.points.iter().map(|p| p.1));
        let y = padded(values.chain(frame.limits.iter().map(|limit| limit.1)));
        let end = lines[0].points.last().map(|p| p.0).filter(|end| *end > 0.0).unwrap_or(1.0);
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
    let views = views(world);
    let grid = [(1, 1), (1, 1), (1, 2), (2, 2)][views.len()];
    drawn(|root| {
        for (area, View { title, across, up }) in root.split_evenly(grid).iter().zip(views) {
            let point = |s: &&Sample| (s.pose[across.index()], s.pose[up.index()]);
            let points: Vec<(f64, f64)> = world.iter().map(point).collect();
            let frame = Frame {
                title,
                x: &format!("{} in {unit}", across.name()),
                y: &format!("{} in {unit}", up.name()),
                limits: vec![],
            };
            let mut chart = path_axes(area, &frame, &points)?;
            chart.draw_series(LineSeries::new(apart(&points), BLACK)).map_err(text)?;
        }
        Ok(())
    })
}

/// A look at the path along one of the axes.
#[derive(Clone, Copy)]
struct View {
    title: &'static str,
    across: Letter,
    up: Letter,
}

const VIEWS: [View; 3] = [
    View { title: "Seen from above", across: Letter::X, up: Letter::Y },
    View { title: "Seen from the front", across: Letter::X, up: Letter::Z },
    View { title: "Seen from the side", across: Letter::Y, up: Letter::Z },
];

/// The views in which the path is more than a line; where it is one in all, those in which
/// it is not a point.
fn views(world: &[&Sample]) -> Vec<View> {
    let extent = |letter: Letter| {
        let (low, high) = span(world.iter().map(|s| s.pose[letter.index()]));
        high - low
    };
    let most = Letter::ALL.into_iter().take(3).map(extent).fold(0.0, f64::max);
    let moves = |letter| extent(letter) > LEAST_EXTENT * most;
    let plane: Vec<View> =
        VIEWS.into_iter().filter(|view| moves(view.across) && moves(view.up)).collect();
    if !plane.is_empty() {
        return plane;
    }
    VIEWS.into_iter().filter(|view| most == 0.0 || moves(view.across) || moves(view.up)).collect()
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

pub(crate) fn project([x, y, z]: [f64; 3]) -> (f64, f64) {
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
pub(crate) fn path_axes<'a, 'b>(
    area: &'a Area<'b>,
    frame: &Frame,
    points: &[(f64, f64)],
) -> Result<Chart<'a, 'b>, String> {
    let (width, height) = area.dim_in_pixel();
    let (width, height) = (width - LEFT - 2 * MARGIN, height - BELOW - CAPTION - 2 * MARGIN);
    let (x, y) = (padded(points.iter().map(|p| p.0)), padded(points.iter().map(|p| p.1)));
    let scale = ((x.end - x.start) / f64::from(width)).max((y.end - y.start) / f64::from(height));
    let around = |range: Range<f64>, pixels: u32| {
        let (middle, half) = ((range.start + range.end) / 2.0, scale * f64::from(pixels) / 2.0);
        middle - half..middle + half
    };
    axes(area, frame, around(x, width), around(y, height))
}

pub(crate) fn axes<'a, 'b>(
    area: &'a Area<'b>,
    frame: &Frame,
    x: Range<f64>,
    y: Range<f64>,
) -> Result<Chart<'a, 'b>, String> {
    let mut chart = ChartBuilder::on(area)
        .caption(frame.title, (FONT, 22))
        .margin(MARGIN)
        .x_label_area_size(BELOW)
        .y_label_area_size(LEFT)
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

pub(crate) fn draw_lines(chart: &mut Chart, lines: &[Line]) -> Result<(), String> {
    for (line, (colour, (dash, gap))) in lines.iter().zip(STYLES) {
        let style = colour.stroke_width(2);
        let sample = move |(x, y)| DashedPathElement::new([(x, y), (x + 34, y)], dash, gap, style);
        let series =
            chart.draw_series(DashedLineSeries::new(line.points.clone(), dash, gap, style));
        series.map_err(text)?.label(&line.name).legend(sample);
    }
    Ok(())
}

pub(crate) fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>) -> Result<(), String> {
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

/// Lowest and highest value.
fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

/// The range of the values with a margin; a flat line gets one unit around it.
pub(crate) fn padded(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = span(values);
    let span = high - low;
    let margin = if span > 1e-9 * high.abs() { 0.06 * span } else { 1.0 };
    low - margin..high + margin
}

pub(crate) fn drawn(draw: impl FnOnce(&Area) -> Result<(), String>) -> Result<String, String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(text)?;
        draw(&root)?;
        root.present().map_err(text)?;
    }
    Ok(svg)
}

pub(crate) fn text(error: impl std::fmt::Display) -> String {
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
                // One pixel of 200, that of the caption's height.
                assert!((scale * f64::from(height) - 1.0).abs() < 6e-3, "{grid:?} {scale}");
                Ok(())
            })
            .unwrap();
        }
    }

    /// A path over these coordinates, each with a law of its own.
    fn path(letters: &[Letter]) -> Vec<Sample> {
        let sample = |k: u32| {
            let mut pose = [5.0; 6];
            for letter in letters {
                pose[letter.index()] = (f64::from(k) * (1.0 + letter.index() as f64)).sin();
            }
            Sample {
                time: f64::from(k),
                in_world: true,
                pose,
                joints: [0.0; MAX_JOINTS],
                motors: [0.0; MAX_JOINTS],
                forward: pose,
                corrections: [0.0; MAX_LEGS],
                tool: [0.0; 3],
                iterations: 1.0,
                residual: 0.0,
            }
        };
        (0..100).map(sample).collect()
    }

    #[test]
    fn a_path_is_seen_in_the_planes_it_moves_in() {
        use Letter::{B, X, Y, Z};
        for (letters, titles) in [
            (&[X, Z][..], &["Seen from the front"][..]),
            (&[Y, Z, B], &["Seen from the side"]),
            (&[X, Y, Z], &["Seen from above", "Seen from the front", "Seen from the side"]),
            (&[Z], &["Seen from the front", "Seen from the side"]),
            (&[B], &["Seen from above", "Seen from the front", "Seen from the side"]),
        ] {
            let samples = path(letters);
            let found = views(&samples.iter().collect::<Vec<_>>());
            assert_eq!(found.iter().map(|view| view.title).collect::<Vec<_>>(), titles);
        }
    }

    #[test]
    fn limits_far_from_the_lines_are_left_out() {
        let line = Line { name: String::new(), points: vec![(0.0, 10.0), (1.0, 14.0)] };
        let limits = [(String::from("low"), 5.9), (String::from("high"), 17.9)];
        assert_eq!(near(&[line], &limits), limits[1..]);
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
