// SPDX-License-Identifier: GPL-2.0-or-later
//! SVG pictures of studies; lines and marks differ in shape, not in colour alone.

use crate::machine::MachineConfig;
use crate::plots::{
    Area, FONT, Frame, Line, Plot, STYLES, TIME, drawn, drawn_lines, legend, path_axes, project,
    text, thin, thin_low,
};
use crate::rods::Rods;
use crate::sensitivity::{Point, Sensitivity};
use crate::stiffness::{Ellipsoid, Map, Stiffness};
use crate::workspace::{Body, Ray, Slice};
use kinematics::Letter;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Name and abscissae of a sequence of poses: the time, or the number of the pose.
pub struct Course {
    /// What the abscissa is.
    pub name: &'static str,
    /// One for each pose.
    pub at: Vec<f64>,
}

impl Course {
    /// By time, in seconds.
    pub fn in_time(at: Vec<f64>) -> Self {
        Self { name: TIME, at }
    }

    /// By number, from 0.
    pub fn by_number(count: usize) -> Self {
        Self { name: "number of the pose", at: (0..count).map(|k| k as f64).collect() }
    }
}

/// Pictures of the legs along a sequence of poses.
///
/// # Errors
/// A sentence of the drawing library.
pub fn of_rods(
    config: &MachineConfig,
    course: &Course,
    rods: &[Rods],
) -> Result<Vec<Plot>, String> {
    let mut plots = vec![];
    for (file, caption, y, value) in ANGLES {
        let lines: Vec<Line> = (0..config.legs())
            .filter(|i| rods.first().is_some_and(|first| value(first, *i).is_some()))
            .map(|i| {
                let points = rods.iter().map(|rods| value(rods, i).unwrap_or(f64::NAN));
                let points = course.at.iter().copied().zip(without_turns(points));
                Line { name: config.joints[i].name.clone(), points: thin(points) }
            })
            .collect();
        if !lines.is_empty() {
            plots.push(lines_over(course, file, caption, y, &lines)?);
        }
    }
    plots.push(between(course, rods)?);
    plots.extend(gaps(config, course, rods)?);
    plots.extend(traces(config, course, rods)?);
    Ok(plots)
}

/// One angle of a leg.
type Angle = fn(&Rods, usize) -> Option<f64>;

/// Pictures of angles: file, caption, ordinate, value.
const ANGLES: [(&str, &str, &str, Angle); 5] = [
    ("rods-elevation.svg", "Legs above the XY plane", "elevation in degrees", |r, i| {
        Some(r.rods[i].elevation)
    }),
    ("rods-azimuth.svg", "Legs about Z, from X", "azimuth in degrees", |r, i| {
        Some(r.rods[i].azimuth)
    }),
    ("base-cones.svg", "Legs from their direction at home, at the base", "angle in degrees", {
        |r, i| Some(r.rods[i].base_cone)
    }),
    (
        "platform-cones.svg",
        "Legs from their direction at home, at the platform",
        "angle in degrees",
        |r, i| Some(r.rods[i].platform_cone),
    ),
    ("guide-angles.svg", "Rods to their guides", "angle in degrees", |r, i| r.rods[i].guide),
];

/// Angles in degrees, each within half a turn of the one before.
fn without_turns(angles: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    angles.scan(None, |last: &mut Option<f64>, angle| {
        let turns = last.map_or(0.0, |last| ((angle - last) / 360.0).round());
        *last = Some(angle - 360.0 * turns);
        *last
    })
}

fn lines_over(
    course: &Course,
    file: &str,
    caption: &str,
    y: &str,
    lines: &[Line],
) -> Result<Plot, String> {
    let frame = Frame { title: caption, x: course.name, y, limits: vec![] };
    let svg = drawn_lines(&frame, lines)?;
    Ok(Plot { file: file.into(), caption: caption.into(), svg })
}

fn between(course: &Course, rods: &[Rods]) -> Result<Plot, String> {
    let line =
        |name: &str, pick: fn(f64, f64) -> f64| Line {
            name: name.into(),
            points: thin(course.at.iter().copied().zip(
                rods.iter().map(|rods| rods.between.iter().copied().reduce(pick).unwrap_or(0.0)),
            )),
        };
    let lines = [line("greatest", f64::max), line("least", f64::min)];
    lines_over(course, "between.svg", "Angles between two legs", "angle in degrees", &lines)
}

fn gaps(config: &MachineConfig, course: &Course, rods: &[Rods]) -> Result<Option<Plot>, String> {
    let gaps = rods.iter().map(|rods| rods.nearest.map_or(f64::NAN, |n| n.distance));
    let points = thin_low(course.at.iter().copied().zip(gaps));
    if points.is_empty() {
        return Ok(None);
    }
    let lines = [Line { name: "nearest pair".into(), points }];
    let y = format!("gap in {}", config.length_unit());
    lines_over(course, "gaps.svg", "Least gap between two legs", &y, &lines).map(Some)
}

fn traces(config: &MachineConfig, course: &Course, rods: &[Rods]) -> Result<Vec<Plot>, String> {
    let count = rods.first().map_or(0, |rods| rods.points.len());
    let trace = |k: usize| {
        let line = |axis: usize| Line {
            name: ["X", "Y", "Z"][axis].into(),
            points: thin(course.at.iter().copied().zip(rods.iter().map(|r| r.points[k][axis]))),
        };
        let caption = format!("Point {k} of the platform, in base");
        let y = format!("position in {}", config.length_unit());
        lines_over(course, &format!("point-{k}.svg"), &caption, &y, &[0, 1, 2].map(line))
    };
    (0..count).map(trace).collect()
}

/// Pictures of a workspace: the body, and every slice with what limits it where.
///
/// # Errors
/// A sentence of the drawing library.
pub fn of_workspace(unit: &str, body: &Body, slices: &[Slice]) -> Result<Vec<Plot>, String> {
    let mut plots = vec![Plot {
        file: "workspace.svg".into(),
        caption: "The workspace around the place where the rays begin (isometric)".into(),
        svg: wire_frame(unit, body)?,
    }];
    for slice in slices {
        let name = slice.plane.name.to_lowercase().replace(',', "_");
        plots.push(Plot {
            file: format!("slice-{name}.svg"),
            caption: format!("Slice {} of the workspace, by what limits it", slice.plane.name),
            svg: sliced(unit, slice)?,
        });
    }
    Ok(plots)
}

/// Lines of the body that are drawn: every so many rings, and as many meridians.
const WIRES: usize = 12;

fn wire_frame(unit: &str, body: &Body) -> Result<String, String> {
    let end = |ray: &Ray| {
        let place = body.from + ray.direction * ray.exit();
        project([place.x, place.y, place.z])
    };
    let stride = (body.rings.len() / WIRES).max(1);
    let closed = |rays: &Vec<Ray>| rays.iter().chain(rays.first()).map(end).collect::<Vec<_>>();
    let rings: Vec<Vec<_>> = body.rings.iter().step_by(stride).map(closed).collect();
    let meridian =
        |k: usize| -> Vec<_> { body.rings.iter().map(|ring| end(&ring[k % ring.len()])).collect() };
    let stride = (body.around / WIRES).max(1);
    let meridians: Vec<Vec<_>> = (0..body.around).step_by(stride).map(meridian).collect();
    let points: Vec<_> = rings.iter().chain(&meridians).flatten().copied().collect();
    drawn(|root| {
        let frame = Frame {
            title: "Workspace, isometric: X right and down, Y right and up, Z up",
            x: &format!("(X + Y) cos 30° in {unit}"),
            y: &format!("Z + (Y - X)/2 in {unit}"),
            limits: vec![],
        };
        let mut chart = path_axes(root, &frame, &points)?;
        let styles = [("one elevation", &rings, STYLES[0]), ("one azimuth", &meridians, STYLES[2])];
        for (name, lines, (colour, (dash, gap))) in styles {
            let style = colour.stroke_width(1);
            let drawn =
                lines.iter().map(|line| DashedPathElement::new(line.clone(), dash, gap, style));
            chart.draw_series(drawn).map_err(text)?.label(name).legend(move |(x, y)| {
                DashedPathElement::new([(x, y), (x + 34, y)], dash, gap, style)
            });
        }
        legend(&mut chart)
    })
}

/// A mark of its own for each kind of limit.
const MARKS: [&str; 13] = ["o", "v", "^", "-", "x", "+", "#", "=", "~", "*", "%", "/", "|"];

fn sliced(unit: &str, slice: &Slice) -> Result<String, String> {
    let outline = slice.outline();
    let place = slice.plane.axes.map(|axis| axis.dot(&slice.from));
    let points: Vec<(f64, f64)> = outline.iter().map(|([x, y], _)| (*x, *y)).collect();
    let name = |k: usize| {
        let axis = slice.plane.axes[k];
        let letter = ["X", "Y", "Z"].into_iter().zip(axis.iter()).find(|(_, part)| **part == 1.0);
        let side = ["across", "up"][k];
        format!("{} in {unit}", letter.map_or(side, |(letter, _)| letter))
    };
    drawn(|root| {
        let title =
            format!("Slice {}: the limit met at each place of the border", slice.plane.name);
        let frame = Frame { title: &title, x: &name(0), y: &name(1), limits: vec![] };
        // Room for the legend beside the outline.
        let right = points.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
        let left = points.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
        let middle = points.iter().map(|p| p.1).sum::<f64>() / points.len() as f64;
        let high = points.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
        let low = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let room = MARK_ROOM * (right - left).max(ASPECT * (high - low));
        let roomy = points.iter().copied().chain([(right + 0.45 * (right - left), middle)]);
        let mut chart = path_axes(root, &frame, &roomy.collect::<Vec<_>>())?;
        let mut kinds: Vec<_> =
            outline.iter().map(|(_, border)| (border.rank(), border.kind())).collect();
        kinds.sort();
        kinds.dedup();
        for (kind, (rank, kind_name)) in kinds.into_iter().enumerate() {
            let own: Vec<(f64, f64)> = outline
                .iter()
                .filter(|(_, border)| border.rank() == rank)
                .map(|([x, y], _)| (*x, *y))
                .collect();
            let (colour, _) = STYLES[kind % STYLES.len()];
            let dots = own.iter().map(|at| Circle::new(*at, 1, colour.filled()));
            chart.draw_series(dots).map_err(text)?;
            let style = (FONT, 17).into_font().color(&colour);
            let centred = style.pos(Pos::new(HPos::Center, VPos::Center));
            let sign = centred.clone();
            chart
                .draw_series(
                    apart(&own, room)
                        .into_iter()
                        .map(|at| Text::new(MARKS[kind], at, sign.clone())),
                )
                .map_err(text)?
                .label(kind_name)
                .legend(move |(x, y)| Text::new(MARKS[kind], (x + 17, y), centred.clone()));
        }
        let bold = BLACK.stroke_width(2);
        chart
            .draw_series([Cross::new((place[0], place[1]), 6, bold)])
            .map_err(text)?
            .label("rays begin")
            .legend(move |(x, y)| Cross::new((x + 17, y), 6, bold));
        legend(&mut chart)
    })
}

/// Points that leave room for their marks.
fn apart(points: &[(f64, f64)], room: f64) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = vec![];
    for point in points {
        let is_free = |other: &(f64, f64)| (point.0 - other.0).hypot(point.1 - other.1) >= room;
        if kept.iter().all(is_free) {
            kept.push(*point);
        }
    }
    kept
}

/// Room for a mark, as a share of a sheet's width that the outline fills.
const MARK_ROOM: f64 = 0.03;
/// Width of a sheet over its height.
const ASPECT: f64 = 1.6;

/// Levels of a map.
const LEVELS: usize = 8;

/// Maps of the smallest stiffness of translation and of rotation in one plane.
///
/// # Errors
/// A sentence of the drawing library.
pub fn of_stiffness(length: &str, map: &Map) -> Result<[Plot; 2], String> {
    let letters = map.plane.map(|k| Letter::ALL[k].name());
    let plane: String = letters.iter().collect();
    let of = |k: usize, what: &str, unit: &str, scale: f64| -> Result<Plot, String> {
        let values: Vec<f64> = map.least.iter().map(|least| least[k] * scale).collect();
        let caption = format!("Smallest stiffness of {what} in the plane {plane}, in {unit}");
        let frame = Frame {
            title: &caption,
            x: &format!("{} in {}", letters[0], length),
            y: &format!("{} in {}", letters[1], length),
            limits: vec![],
        };
        let svg = contoured(&frame, &map.sides, &values)?;
        let file = format!("stiffness-{what}-{}.svg", plane.to_lowercase());
        Ok(Plot { file, caption: caption.clone(), svg })
    };
    Ok([of(0, "translation", "N/um", 1e-3)?, of(1, "rotation", "kN m/rad", 1e-6)?])
}

/// A part of a stiffness as it is drawn: what a load does, whichever way it points.
struct Loaded {
    file: &'static str,
    what: &'static str,
    unit: &'static str,
    /// Amount in that unit times stiffness, N and mm.
    load: f64,
    stiffness: &'static str,
    /// Stiffness in that unit for one in N and mm.
    scale: f64,
}

const LOADED: [Loaded; 2] = [
    Loaded {
        file: "ellipsoid-translation.svg",
        what: "Displacement of the tip under a force of 1 kN, whichever way it points",
        unit: "um",
        load: 1e6,
        stiffness: "N/um",
        scale: 1e-3,
    },
    Loaded {
        file: "ellipsoid-rotation.svg",
        what: "Turn of the platform under a moment of 1 kN m, about whichever axis",
        unit: "mrad",
        load: 1e9,
        stiffness: "kN m/rad",
        scale: 1e-6,
    },
];

/// The ellipsoids of displacements under a force and of turns under a moment, where there are any,
/// seen along the machine's axes.
///
/// # Errors
/// A sentence of the drawing library.
pub fn of_ellipsoids(found: &Stiffness) -> Result<Vec<Plot>, String> {
    let both = LOADED.iter().zip([found.translation(), found.rotation()]);
    let yielding = both.filter(|(_, ellipsoid)| ellipsoid.stiffness[0].is_finite());
    yielding
        .map(|(loaded, ellipsoid)| {
            let svg = seen_along_axes(loaded, &ellipsoid)?;
            Ok(Plot { file: loaded.file.into(), caption: loaded.what.into(), svg })
        })
        .collect()
}

fn seen_along_axes(loaded: &Loaded, ellipsoid: &Ellipsoid) -> Result<String, String> {
    let most = loaded.load / ellipsoid.stiffness[0];
    let corners = [(-most, -most), (most, most)];
    drawn(|root| {
        let root = root.titled(loaded.what, (FONT, 20)).map_err(text)?;
        let panels = root.split_evenly((2, 2));
        for (panel, plane) in panels.iter().zip([[0, 1], [0, 2], [1, 2]]) {
            let [across, up] = plane.map(|k| Letter::ALL[k].name());
            let frame = Frame {
                title: "",
                x: &format!("{across} in {}", loaded.unit),
                y: &format!("{up} in {}", loaded.unit),
                limits: vec![],
            };
            let mut chart = path_axes(panel, &frame, &corners)?;
            let outline = ellipsoid.outline(plane, loaded.load, OUTLINE);
            let bold = BLACK.stroke_width(2);
            chart.draw_series([PathElement::new(outline, bold)]).map_err(text)?;
            for k in 0..3 {
                let half = loaded.load / ellipsoid.stiffness[k];
                let [x, y] = plane.map(|i| ellipsoid.axes[(i, k)] * half);
                let (colour, (dash, gap)) = AXES[k];
                let line = [(-x, -y), (x, y)];
                let style = colour.stroke_width(2);
                chart
                    .draw_series([DashedPathElement::new(line, dash, gap, style)])
                    .map_err(text)?;
            }
        }
        named_axes(&panels[3], loaded, ellipsoid)
    })
}

/// Points of an outline.
const OUTLINE: usize = 180;

/// Of the three principal axes: shades and dashes that print apart, and apart from the outline.
const AXES: [(RGBColor, (u32, u32)); 3] = [STYLES[2], STYLES[1], STYLES[3]];

/// What the lines are, in a panel of their own.
fn named_axes(panel: &Area, loaded: &Loaded, ellipsoid: &Ellipsoid) -> Result<(), String> {
    let put = |row: i32, words: &str| {
        let at = (120, 60 + 40 * row);
        let label = Text::new(words.to_string(), (at.0, at.1 - 8), (FONT, 16).into_font());
        panel.draw(&label).map_err(text)?;
        Ok::<_, String>([(at.0 - 60, at.1), (at.0 - 14, at.1)])
    };
    let line = put(0, "outline of the ellipsoid")?;
    panel.draw(&PathElement::new(line, BLACK.stroke_width(2))).map_err(text)?;
    for (k, (colour, (dash, gap))) in AXES.into_iter().enumerate() {
        let axis = ellipsoid.axes.column(k).map(|part| format!("{:.2}", part + 0.0));
        let stiffness = ellipsoid.stiffness[k];
        let value = match stiffness.is_finite() {
            true => format!("{:.3} {}", stiffness * loaded.scale, loaded.stiffness),
            false => "rigid".into(),
        };
        let words = format!("along {} {} {}: {value}", axis[0], axis[1], axis[2]);
        let line = put(1 + k as i32, &words)?;
        let style = colour.stroke_width(2);
        panel.draw(&DashedPathElement::new(line, dash, gap, style)).map_err(text)?;
    }
    Ok(())
}

fn contoured(frame: &Frame, sides: &[Vec<f64>; 2], values: &[f64]) -> Result<String, String> {
    let [across, up] = sides;
    let corners = |side: &[f64]| (side[0], side[side.len() - 1]);
    let ((left, right), (low, high)) = (corners(across), corners(up));
    drawn(|root| {
        let mut chart = path_axes(root, frame, &[(left, low), (right, high)])?;
        let border = [(left, low), (right, low), (right, high), (left, high), (left, low)];
        chart
            .draw_series([PathElement::new(border, BLACK.mix(0.4).stroke_width(1))])
            .map_err(text)?;
        for level in levels(values) {
            let pieces = isoline(sides, values, level);
            let middle = pieces.get(pieces.len() / 3).map(|[from, _]| *from);
            let pieces = pieces.iter().map(|ends| PathElement::new(*ends, BLACK.stroke_width(1)));
            chart.draw_series(pieces).map_err(text)?;
            let clear = middle.map(|at| Circle::new(at, 10, WHITE.filled()));
            chart.draw_series(clear).map_err(text)?;
            let style = (FONT, 14).into_font().color(&BLACK);
            let style = style.pos(Pos::new(HPos::Center, VPos::Center));
            let label = middle.map(|at| Text::new(format!("{}", rounded(level)), at, style));
            chart.draw_series(label).map_err(text)?;
        }
        Ok(())
    })
}

/// Round values within the range of the map.
fn levels(values: &[f64]) -> Vec<f64> {
    let real = values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = real.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    let rough = (high - low) / LEVELS as f64;
    if !(rough > 1e-9 * high.abs()) {
        return vec![];
    }
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| *step >= rough);
    let step = step.unwrap_or(10.0 * power);
    let first = (low / step).ceil() as i64;
    (first..).map(|k| k as f64 * step).take_while(|level| *level <= high).collect()
}

/// Without the digits of rounding.
fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// Pieces of an isoline: where the value, linear on the triangles between four places of the grid
/// and their middle, is the level. Nothing where a corner is NaN.
fn isoline([across, up]: &[Vec<f64>; 2], values: &[f64], level: f64) -> Vec<[(f64, f64); 2]> {
    let mut pieces = vec![];
    for j in 1..up.len() {
        for i in 1..across.len() {
            let corner = |di: usize, dj: usize| {
                let (i, j) = (i - di, j - dj);
                ((across[i], up[j]), values[j * across.len() + i] - level)
            };
            let around = [corner(1, 1), corner(0, 1), corner(0, 0), corner(1, 0)];
            let mean =
                |pick: fn(&((f64, f64), f64)) -> f64| around.iter().map(pick).sum::<f64>() / 4.0;
            let middle = ((mean(|c| c.0.0), mean(|c| c.0.1)), mean(|c| c.1));
            for k in 0..4 {
                pieces.extend(crossing(&[around[k], around[(k + 1) % 4], middle]));
            }
        }
    }
    pieces
}

/// The line on which a value linear over a triangle is 0.
fn crossing(triangle: &[((f64, f64), f64); 3]) -> Option<[(f64, f64); 2]> {
    let ends: Vec<(f64, f64)> = (0..3)
        .filter_map(|k| {
            let ((a, va), (b, vb)) = (triangle[k], triangle[(k + 1) % 3]);
            let share = va / (va - vb);
            let between = (va > 0.0) != (vb > 0.0);
            between.then_some((a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1)))
        })
        .collect();
    let whole = triangle.iter().all(|(_, value)| value.is_finite());
    match ends[..] {
        [a, b] if whole => Some([a, b]),
        _ => None,
    }
}

/// How the smallest stiffness changes with the size of the platform.
///
/// # Errors
/// A sentence of the drawing library.
pub fn of_platform_sizes(sizes: &[(f64, [f64; 2])]) -> Result<Plot, String> {
    let whole = sizes.iter().find(|(factor, _)| *factor == 1.0).map_or([1.0; 2], |own| own.1);
    let line = |k: usize, name: &str| Line {
        name: name.into(),
        points: sizes.iter().map(|(factor, least)| (*factor, least[k] / whole[k])).collect(),
    };
    let lines = [line(0, "translation"), line(1, "rotation")];
    let caption = "Smallest stiffness by the size of the platform";
    let frame = Frame {
        title: caption,
        x: "size of the platform, share of this one",
        y: "stiffness, share of this machine's",
        limits: vec![],
    };
    let svg = drawn_lines(&frame, &lines)?;
    Ok(Plot { file: "platform-sizes.svg".into(), caption: caption.into(), svg })
}

/// Pictures of what errors of the joints do: bars at one pose, and lines along a motion.
///
/// # Errors
/// A sentence of the drawing library.
pub fn of_sensitivity(
    config: &MachineConfig,
    found: &Sensitivity,
    sigma: &[f64],
    points: &[Point],
) -> Result<Vec<Plot>, String> {
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
        let svg = bars(&Frame { title: &caption, x: "", y: &y, limits: vec![] }, &groups)?;
        plots.push(Plot { file: format!("sensitivity-{part}.svg"), caption, svg });
    }
    if !points.is_empty() {
        plots.extend(of_motion(config, points)?);
    }
    Ok(plots)
}

/// What a line shows of a point of a motion.
type Value<'a> = Box<dyn Fn(&Point) -> f64 + 'a>;

fn of_motion(config: &MachineConfig, points: &[Point]) -> Result<Vec<Plot>, String> {
    let unit = config.length_unit();
    let course = Course::in_time(points.iter().map(|point| point.time).collect());
    let draw = |file: &str, caption: &str, y: &str, lines: Vec<(String, Value)>| {
        let line = |(name, value): (String, Value)| Line {
            name,
            points: thin(points.iter().map(|point| (point.time, value(point)))),
        };
        let lines: Vec<Line> = lines.into_iter().map(line).collect();
        lines_over(&course, file, caption, y, &lines)
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
    let hold: Vec<(String, Value)> =
        vec![("smallest singular value".into(), Box::new(|point: &Point| point.hold))];
    plots.push(draw("motion-hold.svg", "How well the legs hold the platform", "no unit", hold)?);
    Ok(plots)
}

/// Bars in groups, each bar with the number of its joint.
fn bars(frame: &Frame, groups: &[(char, Vec<f64>)]) -> Result<String, String> {
    let all = || groups.iter().flat_map(|(_, values)| values.iter().copied());
    let most = all().fold(0.0, |most: f64, value| most.max(value.abs())).max(f64::MIN_POSITIVE);
    let count = groups[0].1.len();
    drawn(|root| {
        let width = groups.len() as f64;
        let mut chart = ChartBuilder::on(root)
            .caption(frame.title, (FONT, 22))
            .margin(12)
            .x_label_area_size(20)
            .y_label_area_size(84)
            .build_cartesian_2d(0.0..width, -1.25 * most..1.25 * most)
            .map_err(text)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_labels(0)
            .y_desc(frame.y)
            .label_style((FONT, 14))
            .axis_desc_style((FONT, 16))
            .light_line_style(WHITE)
            .draw()
            .map_err(text)?;
        let style = |size: i32| {
            let style = (FONT, size).into_font().color(&BLACK);
            style.pos(Pos::new(HPos::Center, VPos::Center))
        };
        for (g, (name, values)) in groups.iter().enumerate() {
            let left = |j: usize| g as f64 + 0.1 + 0.8 * j as f64 / count as f64;
            for (j, value) in values.iter().enumerate() {
                let corners = [(left(j), 0.0), (left(j) + 0.64 / count as f64, *value)];
                let grey = RGBColor(190, 190, 190);
                let filled = Rectangle::new(corners, grey.filled());
                let outline = Rectangle::new(corners, BLACK.stroke_width(1));
                chart.draw_series([filled, outline]).map_err(text)?;
                let beyond = value + most * 0.05 * if *value < 0.0 { -1.0 } else { 1.0 };
                let at = (left(j) + 0.32 / count as f64, beyond);
                chart.draw_series([Text::new(j.to_string(), at, style(14))]).map_err(text)?;
            }
            let at = (g as f64 + 0.5, -1.17 * most);
            chart.draw_series([Text::new(name.to_string(), at, style(20))]).map_err(text)?;
        }
        let zero = [(0.0, 0.0), (width, 0.0)];
        chart.draw_series([PathElement::new(zero, BLACK.stroke_width(1))]).map_err(text)?;
        Ok(())
    })
}
