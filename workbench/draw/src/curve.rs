// SPDX-License-Identifier: GPL-2.0-or-later
//! A curve of two one-parametric families as in the figures of paper 000: the net of both families with its
//! points, their surfaces over x and y with the curve and its projection; and the required motion of the joints.

use crate::contour::isoline;
use crate::key::{Key, Sign, keyed};
use crate::lines::{Line, first_up, lines};
use crate::motion;
use crate::plot::{DrawError, Plot};
use crate::sample::Sample;
use crate::sheet::{Frame, padded, path_axes, span};
use crate::space::{Space, Up};
use crate::strips::{Strip, Strips, drawn_apart, drawn_strips};
use crate::style::{BLUE, GRAY, VERMILLION, limit_style};
use kinematics::{Letter, MAX_EXTRA, MAX_LEGS, Vector3};
use machine::read::joints::Joint;
use machine::read::mechanism::Mechanism;
use paths::base::{Form, Part};
use paths::carriages::CarriagePose;
use paths::job::Job;
use paths::route::Route;
use paths::table::Row;
use plotters::prelude::*;

const CURVES: usize = 9;
/// Grid points in each direction, for computing the curves of a family.
const GRID: usize = 100;
/// Margin around the curve, as a share of its extent.
const ROOM: f64 = 0.25;

type Piece = [(f64, f64); 2];

/// A parameter value, the curves of both families, and the points of the curve there.
struct Level {
    t: f64,
    families: [Vec<Piece>; 2],
    points: Vec<(f64, f64)>,
}

/// Draws all pictures of a route.
///
/// # Errors
/// As [`DrawError`].
pub fn of_route(config: &Mechanism, route: &Route) -> Result<Vec<Plot>, DrawError> {
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

/// Returns evenly spaced parameter values of families; none for a free-form curve.
fn levels(route: &Route) -> Vec<Level> {
    let Some(part) = route.curve.parts.first() else { return vec![] };
    let ts = route.rows.iter().map(|row| row.node.t);
    let (low, high) = ts.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
    let points = path(route);
    let ends = [span(points.iter().map(|p| p.0)), span(points.iter().map(|p| p.1))];
    let most = ends.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
    let sides = ends.map(|(start, end)| {
        // A straight curve also gets a margin.
        let room = ROOM * (end - start).max(most / 2.0);
        let (from, to) = (start - room, end + room);
        (0..=GRID).map(|n| from + (to - from) * n as f64 / GRID as f64).collect::<Vec<f64>>()
    });
    let level = |n: usize| {
        let t = low + (high - low) * n as f64 / (CURVES - 1) as f64;
        let points = crossings(route, t);
        Some(Level { t, families: curves(part, &sides, t)?, points })
    };
    (0..CURVES).filter_map(level).collect()
}

/// Returns the points of the curve at a parameter value, interpolated within a piece.
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

/// Returns the curves on which the functions of both families are 0.
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

/// Returns the names of both families, as the file of the path gives them.
fn names(route: &Route) -> [&'static str; 2] {
    let is_explicit =
        matches!(route.curve.parts.first(), Some(Part { form: Form::Explicit(_), .. }));
    match (is_explicit, route.curve.is_level) {
        (true, _) => ["lines x = x(t)", "lines y = y(t)"],
        (_, true) => ["curve F = 0", "lines x = t"],
        _ => ["family alpha", "family beta"],
    }
}

/// Returns the name of the arc length: that of a plane curve does not count its height.
fn arc_length(route: &Route) -> &'static str {
    let is_flat = |part: &Part| matches!(part.form, Form::Explicit(_) | Form::Implicit(..));
    match route.curve.parts.iter().all(is_flat) {
        true => "arc length in X and Y, in mm",
        false => "arc length in mm",
    }
}

const FAMILIES: [RGBColor; 2] = [BLUE, VERMILLION];

fn net(route: &Route, levels: &[Level]) -> Result<Plot, DrawError> {
    let caption = "Curves of both families, the points where they meet, and the curve through them";
    let path = path(route);
    let ends = levels.iter().flat_map(|level| level.families.iter().flatten().flatten());
    let all: Vec<(f64, f64)> = path.iter().chain(ends).copied().collect();
    let frame = Frame { title: "Net of both families", x: "X in mm", y: "Y in mm", limits: vec![] };
    let [alpha, beta] = names(route);
    let keys = [
        Key::new(Sign::Line(FAMILIES[0].stroke_width(1)), alpha),
        Key::new(Sign::Line(FAMILIES[1].stroke_width(1)), beta),
        Key::new(Sign::Line(limit_style()), "curve"),
        Key::new(Sign::Dot, "points at even t"),
    ];
    let svg = keyed(&keys, |area| {
        let mut chart = path_axes(area, &frame, &all)?;
        for (k, color) in FAMILIES.iter().enumerate() {
            let style = color.stroke_width(1);
            let pieces = levels.iter().flat_map(|level| &level.families[k]);
            chart.draw_series(pieces.map(|ends| PathElement::new(*ends, style)))?;
        }
        chart.draw_series([PathElement::new(path, limit_style())])?;
        let points = levels.iter().flat_map(|level| &level.points);
        chart.draw_series(points.map(|at| Circle::new(*at, 4, BLACK.filled())))?;
        Ok(())
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
    // The range of t is as high as the curve's larger side.
    let scale = extent(|p| p.0).max(extent(|p| p.1)) / (high - low);
    let lifted = |(x, y): (f64, f64), t: f64| Vector3::new(x, y, (t - low) * scale);
    let raised: Vec<Vector3<f64>> =
        route.rows.iter().map(|row| lifted(place(row), row.node.t)).collect();
    let shadow: Vec<Vector3<f64>> = path.iter().map(|at| lifted(*at, low)).collect();
    let surface = |k: usize| -> Vec<[Vector3<f64>; 2]> {
        let of = |level: &Level| -> Vec<[Vector3<f64>; 2]> {
            level.families[k].iter().map(|ends| ends.map(|at| lifted(at, level.t))).collect()
        };
        levels.iter().flat_map(of).collect()
    };
    let surfaces = [surface(0), surface(1)];
    let ends = surfaces.iter().flatten().flatten();
    let all: Vec<Vector3<f64>> = raised.iter().chain(&shadow).chain(ends).copied().collect();
    let thin = GRAY.stroke_width(1);
    let [alpha, beta] = names(route);
    let keys = [
        Key::new(Sign::Line(FAMILIES[0].stroke_width(1)), alpha),
        Key::new(Sign::Line(FAMILIES[1].stroke_width(1)), beta),
        Key::new(Sign::Line(limit_style()), "curve over X, Y and t"),
        Key::new(Sign::Line(thin), "its projection"),
    ];
    let svg = keyed(&keys, |area| {
        let name = if route.curve.is_level { "t in mm" } else { "t, no unit" };
        let up = Up { name, from: low, scale };
        let title = "Surfaces of both families over X, Y and t";
        let view = Space::around(title, "mm", &all).up(up).draw(area, vec![])?;
        for (surface, color) in surfaces.iter().zip(FAMILIES) {
            let style = color.stroke_width(1);
            surface.iter().try_for_each(|ends| area.draw(&view.path(ends, style)))?;
        }
        area.draw(&view.path(&shadow, thin))?;
        area.draw(&view.path(&raised, limit_style()))?;
        Ok(())
    })?;
    Ok(Plot { file: "families-surfaces.svg".into(), caption: caption.into(), svg })
}

/// Draws the motion that table and platform share, over the arc length, with the part that moves in each direction.
fn split(config: &Mechanism, route: &Route) -> Result<[Plot; 2], DrawError> {
    let line = |name: &str, value: &dyn Fn(&Row) -> f64| Line {
        name: name.into(),
        points: route.rows.iter().map(|row| (row.node.s, value(row))).collect(),
    };
    let unit = config.length_unit();
    let plot = |file: &str, caption: &str, y: &str, lines: Vec<Line>| -> Result<Plot, DrawError> {
        let svg = drawn_apart(caption, arc_length(route), y, lines)?;
        Ok(Plot { file: file.into(), caption: caption.into(), svg })
    };
    let table = config.machine.layout().table();
    let centre = [Letter::X, Letter::Y, Letter::Z].map(|letter| {
        let carrier = if table.contains(letter) { "table" } else { "platform" };
        let name = format!("{} ({carrier})", letter.name());
        line(&name, &move |row: &Row| row.centre[letter.index()])
    });
    let tilts =
        [("A", 3), ("B", 4)].map(|(name, k)| line(name, &move |row: &Row| row.node.pose[k]));
    Ok([
        plot("split.svg", "Center of the platform", &format!("position in {unit}"), centre.into())?,
        plot("split-tilts.svg", "Tilts of the platform", "angle in degrees", tilts.into())?,
    ])
}

fn joints(config: &Mechanism, route: &Route) -> Result<Vec<Plot>, DrawError> {
    let mut plots = vec![];
    for group in config.groups() {
        let (name, unit) = (group.kind.plural(), group.unit);
        let stem = name.replace(' ', "-");
        let mut add = |file: String, caption: String, y: String, strips: Vec<Strip>| {
            let sheet = Strips::new(&caption, arc_length(route), &y, &strips);
            let svg = drawn_strips(&sheet, &strips)?;
            plots.push(Plot { file, caption, svg });
            Ok::<(), DrawError>(())
        };
        let with = |lines: Vec<Line>, limits: &dyn Fn(&Joint) -> [f64; 2]| -> Vec<Strip> {
            let limits = group.joints.iter().map(|i| limits(&config.joints[*i]));
            let finite = limits.map(|own| own.into_iter().filter(|end| end.is_finite()).collect());
            lines.into_iter().zip(finite).map(|(line, own)| Strip::of(line, own)).collect()
        };
        let values = route.rows.iter().map(|row| (row.node.s, &row.joints));
        let caption = format!("{} along the curve", first_up(name));
        let y = format!("{} in {unit}", group.kind.quantity());
        let strips = with(lines(config, &group, values), &Joint::range);
        add(format!("{stem}.svg"), caption, y, strips)?;
        let rates = route.rows.iter().filter_map(|row| Some((row.node.s, row.rates.as_ref()?)));
        if rates.clone().next().is_some() {
            let caption = format!("Speeds of {name} at the programmed speed");
            let y = format!("speed in {unit}/s");
            let most = |joint: &Joint| [-joint.speed(), joint.speed()];
            let strips = with(lines(config, &group, rates), &most);
            add(format!("{stem}-speeds.svg"), caption, y, strips)?;
        }
    }
    Ok(plots)
}

/// Draws the path of the tool for laws of the joints, and the joints.
///
/// # Errors
/// As [`DrawError`].
pub fn of_carriages(config: &Mechanism, places: &[CarriagePose]) -> Result<Vec<Plot>, DrawError> {
    let sample = |place: &CarriagePose| Sample {
        time: place.t,
        in_world: true,
        pose: place.pose,
        joints: place.joints,
        motors: place.joints,
        extra: [0.0; MAX_EXTRA],
        passed: 0.0,
        forward: place.pose,
        corrections: [0.0; MAX_LEGS],
        tool: [0.0; 3],
        on_work: None,
        iterations: 0.0,
        residual: place.residual,
    };
    let samples: Vec<Sample> = places.iter().map(sample).collect();
    motion::all(config, &samples)
}

/// Draws the joints over the length of every operation (paper 003, table 2).
///
/// # Errors
/// As [`DrawError`].
pub fn of_job(config: &Mechanism, job: &Job) -> Result<Vec<Plot>, DrawError> {
    let mut plots = vec![];
    for (n, done) in job.done.iter().enumerate() {
        for group in config.groups() {
            let (name, unit) = (group.kind.plural(), config.length_unit());
            let changes = done.along.iter().map(|along| (along.length, &along.change));
            let caption = format!("Operation {}, {}: change of {name}", n + 1, done.name);
            let x = format!("length of the path in {unit}");
            let y = format!("change of {} in {}", group.kind.quantity(), group.unit);
            let svg = drawn_apart(&caption, &x, &y, lines(config, &group, changes))?;
            let stem = name.replace(' ', "-");
            let file = format!("{:02}-{}-{stem}.svg", n + 1, done.name);
            plots.push(Plot { file, caption: caption.clone(), svg });
        }
    }
    Ok(plots)
}
