// SPDX-License-Identifier: GPL-2.0-or-later
//! A curve of two one-parametric families as paper 000 draws it: the net of both families with its
//! points, their surfaces over x and y with the curve and its projection; and what it asks of the joints.

use crate::curve::base::{Form, Part};
use crate::curve::carriages::Place;
use crate::curve::job::Job;
use crate::curve::route::Route;
use crate::curve::table::Row;
use crate::draw::contour::isoline;
use crate::draw::lines::{Line, drawn_lines, first_up, lines};
use crate::draw::motion;
use crate::draw::plot::{DrawError, Plot};
use crate::draw::sample::Sample;
use crate::draw::sheet::{Frame, STYLES, drawn, legend, padded, path_axes, project};
use crate::read::machine::MachineConfig;
use kinematics::MAX_LEGS;
use plotters::prelude::*;

/// Curves of each family.
const CURVES: usize = 9;
/// Places of the grid on which curves of a family are found, each way.
const GRID: usize = 100;
/// Room around the curve, as a share of its extent.
const ROOM: f64 = 0.25;

type Piece = [(f64, f64); 2];

/// One parameter, the curves of both families there, and the curve's points.
struct Level {
    t: f64,
    families: [Vec<Piece>; 2],
    points: Vec<(f64, f64)>,
}

/// All pictures of a route.
///
/// # Errors
/// As [`DrawError`].
pub fn of_route(config: &MachineConfig, route: &Route) -> Result<Vec<Plot>, DrawError> {
    let mut plots = vec![];
    let levels = levels(route);
    if !levels.is_empty() {
        plots.push(net(route, &levels)?);
        plots.push(surfaces(route, &levels)?);
    }
    plots.extend(split(config, route)?);
    plots.extend(joints(config, route)?);
    Ok(plots)
}

fn place(row: &Row) -> (f64, f64) {
    (row.node.pose[0], row.node.pose[1])
}

fn path(route: &Route) -> Vec<(f64, f64)> {
    route.rows.iter().map(place).collect()
}

/// Evenly spaced parameters of families; none of a free-form curve.
fn levels(route: &Route) -> Vec<Level> {
    let Some(part) = route.curve.parts.first() else { return vec![] };
    let ts = route.rows.iter().map(|row| row.node.t);
    let (low, high) = ts.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
    let points = path(route);
    let sides = [0, 1].map(|k| {
        let range = padded(points.iter().map(|p| if k == 0 { p.0 } else { p.1 }));
        let room = ROOM * (range.end - range.start);
        let (from, to) = (range.start - room, range.end + room);
        (0..=GRID).map(|n| from + (to - from) * n as f64 / GRID as f64).collect::<Vec<f64>>()
    });
    let level = |n: usize| {
        let t = low + (high - low) * n as f64 / (CURVES - 1) as f64;
        let points = crossings(route, t);
        Some(Level { t, families: curves(part, &sides, t)?, points })
    };
    (0..CURVES).filter_map(level).collect()
}

/// Points of the curve with a parameter, to a share of a piece.
fn crossings(route: &Route, t: f64) -> Vec<(f64, f64)> {
    let between = |rows: &[Row]| {
        let (a, b) = (rows[0].node.t, rows[1].node.t);
        let share = (t - a) / (b - a);
        let (p, q) = (place(&rows[0]), place(&rows[1]));
        (0.0..=1.0)
            .contains(&share)
            .then_some((p.0 + share * (q.0 - p.0), p.1 + share * (q.1 - p.1)))
    };
    route.rows.windows(2).filter_map(between).collect()
}

/// Where the functions of both families are 0.
fn curves(part: &Part, sides: &[Vec<f64>; 2], t: f64) -> Option<[Vec<Piece>; 2]> {
    let [across, up] = sides;
    let ends = |side: &[f64]| [side[0], side[side.len() - 1]];
    match &part.form {
        Form::Explicit(explicit) => {
            let [x, y] = explicit.point(t)?;
            let ([left, right], [low, high]) = (ends(across), ends(up));
            Some([vec![[(x, low), (x, high)]], vec![[(left, y), (right, y)]]])
        }
        Form::Implicit(families, _) => {
            let values = |k: usize| -> Vec<f64> {
                let row = |y: &f64| across.iter().map(|x| families.value(k, [*x, *y, t])).collect();
                up.iter().flat_map(|y| -> Vec<f64> { row(y) }).collect()
            };
            Some([0, 1].map(|k| isoline(sides, &values(k), 0.0)))
        }
        Form::Spline(..) | Form::Ellipse(_) => None,
    }
}

const NAMES: [&str; 2] = ["family alpha", "family beta"];

fn net(route: &Route, levels: &[Level]) -> Result<Plot, DrawError> {
    let caption = "Curves of both families, the points where they meet, and the curve through them";
    let path = path(route);
    let ends = levels.iter().flat_map(|level| level.families.iter().flatten().flatten());
    let all: Vec<(f64, f64)> = path.iter().chain(ends).copied().collect();
    let frame = Frame { title: "Net of both families", x: "X in mm", y: "Y in mm", limits: vec![] };
    let svg = drawn(|root| {
        let mut chart = path_axes(root, &frame, &all)?;
        for (k, name) in NAMES.iter().enumerate() {
            let style = STYLES[1 + k].0.stroke_width(1);
            let pieces = levels.iter().flat_map(|level| &level.families[k]);
            chart
                .draw_series(pieces.map(|ends| PathElement::new(*ends, style)))?
                .label(*name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 34, y)], style));
        }
        chart
            .draw_series(LineSeries::new(path, BLACK.stroke_width(2)))?
            .label("curve")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 34, y)], BLACK.stroke_width(2)));
        let points = levels.iter().flat_map(|level| &level.points);
        chart
            .draw_series(points.map(|at| Circle::new(*at, 4, BLACK.filled())))?
            .label("points at even t")
            .legend(|(x, y)| Circle::new((x + 17, y), 4, BLACK.filled()));
        legend(&mut chart)
    })?;
    Ok(Plot { file: "families-net.svg".into(), caption: caption.into(), svg })
}

fn surfaces(route: &Route, levels: &[Level]) -> Result<Plot, DrawError> {
    let caption = "Surfaces of both families over X and Y, the curve in which they meet, and its \
                   projection";
    let (path, low) = (path(route), levels[0].t);
    let high = levels[levels.len() - 1].t;
    let extent = |pick: fn(&(f64, f64)) -> f64| {
        let range = padded(path.iter().map(pick));
        range.end - range.start
    };
    // t gets the height of the curve's larger side.
    let scale = extent(|p| p.0).max(extent(|p| p.1)) / (high - low);
    let lifted = |(x, y): (f64, f64), t: f64| project([x, y, (t - low) * scale]);
    let raised: Vec<(f64, f64)> =
        route.rows.iter().map(|row| lifted(place(row), row.node.t)).collect();
    let shadow: Vec<(f64, f64)> = path.iter().map(|at| lifted(*at, low)).collect();
    let surface = |k: usize| -> Vec<Piece> {
        let of = |level: &Level| -> Vec<Piece> {
            level.families[k].iter().map(|ends| ends.map(|at| lifted(at, level.t))).collect()
        };
        levels.iter().flat_map(of).collect()
    };
    let surfaces = [surface(0), surface(1)];
    let ends = surfaces.iter().flatten().flatten();
    let all: Vec<(f64, f64)> = raised.iter().chain(&shadow).chain(ends).copied().collect();
    let frame = Frame {
        title: "Surfaces of both families, isometric: X right and down, Y right and up, t up",
        x: "(X + Y) cos 30° in mm",
        y: "t, scaled, + (Y - X)/2",
        limits: vec![],
    };
    let svg = drawn(|root| {
        let mut chart = path_axes(root, &frame, &all)?;
        for (k, name) in NAMES.iter().enumerate() {
            let style = STYLES[1 + k].0.mix(0.6).stroke_width(1);
            chart
                .draw_series(surfaces[k].iter().map(|ends| PathElement::new(*ends, style)))?
                .label(*name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 34, y)], style));
        }
        let thin = BLACK.stroke_width(1);
        chart
            .draw_series(LineSeries::new(raised, BLACK.stroke_width(3)))?
            .label("curve over X, Y and t")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 34, y)], BLACK.stroke_width(3)));
        chart
            .draw_series(LineSeries::new(shadow, thin))?
            .label("its projection")
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 34, y)], thin));
        legend(&mut chart)
    })?;
    Ok(Plot { file: "families-surfaces.svg".into(), caption: caption.into(), svg })
}

/// What table and platform share, over the arc length.
fn split(config: &MachineConfig, route: &Route) -> Result<[Plot; 2], DrawError> {
    let line = |name: &str, value: &dyn Fn(&Row) -> f64| Line {
        name: name.into(),
        points: route.rows.iter().map(|row| (row.node.s, value(row))).collect(),
    };
    let unit = config.length_unit();
    let plot = |file: &str, caption: &str, y: &str, lines: &[Line]| -> Result<Plot, DrawError> {
        let frame = Frame { title: caption, x: "arc length in mm", y, limits: vec![] };
        let svg = drawn_lines(&frame, lines)?;
        Ok(Plot { file: file.into(), caption: caption.into(), svg })
    };
    let centre = [("X (table)", 0), ("Y (table)", 1), ("Z (platform)", 2)]
        .map(|(name, k)| line(name, &move |row: &Row| row.centre[k]));
    let tilts =
        [("A", 3), ("B", 4)].map(|(name, k)| line(name, &move |row: &Row| row.node.pose[k]));
    Ok([
        plot("split.svg", "Centre of the platform", &format!("position in {unit}"), &centre)?,
        plot("split-tilts.svg", "Tilts of the platform", "angle in degrees", &tilts)?,
    ])
}

fn joints(config: &MachineConfig, route: &Route) -> Result<Vec<Plot>, DrawError> {
    let mut plots = vec![];
    for group in config.groups() {
        let (name, unit) = (group.kind.plural(), group.unit);
        let stem = name.replace(' ', "-");
        let mut add = |file: String, caption: String, y: String, lines: Vec<Line>| {
            let frame = Frame { title: &caption, x: "arc length in mm", y: &y, limits: vec![] };
            let svg = drawn_lines(&frame, &lines)?;
            plots.push(Plot { file, caption, svg });
            Ok::<(), DrawError>(())
        };
        let values = route.rows.iter().map(|row| (row.node.s, &row.joints));
        let caption = format!("{} along the curve", first_up(name));
        let y = format!("{} in {unit}", group.kind.quantity());
        add(format!("{stem}.svg"), caption, y, lines(config, &group, values))?;
        let rates = route.rows.iter().filter_map(|row| Some((row.node.s, row.rates.as_ref()?)));
        if rates.clone().next().is_some() {
            let caption = format!("Speeds of {name} at the programmed speed");
            let y = format!("speed in {unit}/s");
            add(format!("{stem}-speeds.svg"), caption, y, lines(config, &group, rates))?;
        }
    }
    Ok(plots)
}

/// The path of the tool for laws of the joints, with these.
///
/// # Errors
/// As [`DrawError`].
pub fn of_carriages(config: &MachineConfig, places: &[Place]) -> Result<Vec<Plot>, DrawError> {
    let sample = |place: &Place| Sample {
        time: place.t,
        in_world: true,
        pose: place.pose,
        joints: place.joints,
        motors: place.joints,
        passed: 0.0,
        forward: place.pose,
        corrections: [0.0; MAX_LEGS],
        tool: [0.0; 3],
        iterations: 0.0,
        residual: place.residual,
    };
    let samples: Vec<Sample> = places.iter().map(sample).collect();
    motion::all(config, &samples)
}

/// The joints over the length of every operation (paper 003, table 2).
///
/// # Errors
/// As [`DrawError`].
pub fn of_job(config: &MachineConfig, job: &Job) -> Result<Vec<Plot>, DrawError> {
    let mut plots = vec![];
    for (n, done) in job.done.iter().enumerate() {
        for group in config.groups() {
            let (name, unit) = (group.kind.plural(), config.length_unit());
            let changes = done.along.iter().map(|along| (along.length, &along.change));
            let caption = format!("Operation {}, {}: change of {name}", n + 1, done.name);
            let frame = Frame {
                title: &caption,
                x: &format!("length of the path in {unit}"),
                y: &format!("change of {} in {}", group.kind.quantity(), group.unit),
                limits: vec![],
            };
            let svg = drawn_lines(&frame, &lines(config, &group, changes))?;
            let stem = name.replace(' ', "-");
            let file = format!("{:02}-{}-{stem}.svg", n + 1, done.name);
            plots.push(Plot { file, caption: caption.clone(), svg });
        }
    }
    Ok(plots)
}
