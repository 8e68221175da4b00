// SPDX-License-Identifier: GPL-2.0-or-later
//! Pictures of chatter stability: partitions, responses, stable depths over spindle speeds.

use crate::contour::contoured;
use crate::key::{Key, Sign, keyed};
use crate::lines::{Line, drawn_lines, without_stairs};
use crate::partition::{Partition, partitioned, places};
use crate::plot::{DrawError, Plot};
use crate::sheet::{Chart, Frame, axes, path_axes, tick};
use crate::style::{GRAY, GREEN, limit_style, line_style};
use nalgebra::{Complex, ComplexField};
use plotters::prelude::*;
use std::f64::consts::TAU;
use studies::stability::bands::{Band, Loss};
use studies::stability::count::Counter;
use studies::stability::lag::{Crossing, Lag};
use studies::stability::lobes::LobePoint;
use studies::stability::map::{Column, StableMap};
use studies::stability::response::{Response, unwrapped};
use studies::stability::system::Adjustment;

/// Upper end of windows, in multiples of the limit cutting stiffness.
const BEYOND: f64 = 4.0;

/// Number of points of a boundary by two parameters.
const POINTS: usize = 20_000;

/// Halvings of a step of frequency: down to rounding.
const HALVINGS: usize = 48;

/// Draws the D-partition by the cutting stiffness, and those by lag and, unless responses are measured, by the first
/// link's stiffness.
///
/// # Errors
/// As [`DrawError`].
pub fn of_partitions(adjustment: &Adjustment, stem: &str) -> Result<Vec<Plot>, DrawError> {
    let lag = &adjustment.lag;
    let known = Known::of(lag);
    let mut plots = vec![by_stiffness(lag, &known, &adjustment.name(), stem)?];
    if lag.lag > 0.0 {
        plots.push(by_lag(lag, &known, &adjustment.name(), stem)?);
        if lag.measured.is_empty() {
            plots.push(by_first_link(lag, &known, adjustment, stem)?);
        }
    }
    Ok(plots)
}

/// Results that all partitions of a loop need.
struct Known<'a> {
    counter: Counter<'a>,
    limit: Option<Crossing>,
    /// The limit, or the stiffness at rest if there is no limit.
    reference: f64,
}

impl<'a> Known<'a> {
    fn of(lag: &'a Lag) -> Self {
        let counter = lag.counter();
        let limit = counter.limit().crossing;
        let reference = limit.map_or(lag.at_rest().abs(), |limit| limit.stiffness);
        Self { counter, limit, reference }
    }
}

fn by_stiffness(lag: &Lag, known: &Known, name: &str, stem: &str) -> Result<Plot, DrawError> {
    let most = BEYOND * known.reference;
    let upper = lag.curve(known.reference);
    let mut curve: Vec<[f64; 2]> =
        upper.iter().rev().map(|point| [point.at[0], -point.at[1]]).collect();
    curve.extend(places(&upper));
    let crossings = known.counter.crossings().iter();
    let crossings = crossings.filter(|found| found.stiffness.abs() < most);
    let marks = crossings.map(|found| {
        let text = format!("K {:.0} N/mm at {:.2} rad/s", found.stiffness, found.omega);
        ([found.stiffness, 0.0], text)
    });
    let caption = format!("Unstable roots by the cutting stiffness K, {name}");
    let frame = Frame {
        title: &caption,
        x: "real part of K in N/mm",
        y: "imaginary part of K in N/mm",
        limits: vec![],
    };
    let window = [[-most, most], [-0.8 * most, 0.8 * most]];
    let partition = Partition { frame, window, curves: vec![curve], marks: marks.collect() };
    let count = |[re, im]: [f64; 2]| known.counter.unstable(Complex::new(re, im));
    let svg = partitioned(&partition, count)?;
    Ok(Plot { file: format!("{stem}-partition.svg"), caption: caption.clone(), svg })
}

/// Returns the frequencies for boundaries by two parameters.
fn omegas(lag: &Lag) -> Vec<f64> {
    if !lag.measured.is_empty() {
        return lag.grid(POINTS);
    }
    let highest = 20.0 * lag.terms.iter().map(|term| term.omega()).fold(0.0, f64::max);
    (1..=POINTS).map(|k| highest * (k as f64 / POINTS as f64).powi(2)).collect()
}

fn by_lag(lag: &Lag, known: &Known, name: &str, stem: &str) -> Result<Plot, DrawError> {
    let worst = lag.worst_lag();
    let most = BEYOND * worst.map_or(known.reference, |(_, found)| found.stiffness);
    let longest = 3.0 * worst.map_or(lag.lag, |(time, _)| time).max(lag.lag);
    let window = [[0.0, 1e3 * longest], [0.0, most]];
    let is_near = |place: &&[f64; 2]| place[0] >= 0.0 && place[1] > 0.0;
    let all: Vec<[f64; 2]> = omegas(lag)
        .into_iter()
        .map(|omega| lag.lag_and_stiffness(omega).at)
        .map(|[time, stiffness]| [1e3 * time, stiffness])
        .collect();
    let curves = all.split(|place| !is_near(&place)).filter(|curve| curve.len() > 1);
    let own = known.limit.filter(|limit| limit.stiffness < most);
    let marks = own.map(|limit| ([1e3 * lag.lag, limit.stiffness], name.to_string()));
    let caption = format!("Unstable roots by lag and cutting stiffness, {name}");
    let frame = Frame {
        title: &caption,
        x: "lag T in ms",
        y: "cutting stiffness K in N/mm",
        limits: vec![],
    };
    let partition = Partition {
        frame,
        window,
        curves: curves.map(<[_]>::to_vec).collect(),
        marks: marks.into_iter().collect(),
    };
    let count = |[time, stiffness]: [f64; 2]| {
        known.counter.unstable_with(1e-3 * time, Complex::new(stiffness, 0.0))
    };
    let svg = partitioned(&partition, count)?;
    Ok(Plot { file: format!("{stem}-partition-lag.svg"), caption: caption.clone(), svg })
}

fn by_first_link(
    lag: &Lag,
    known: &Known,
    adjustment: &Adjustment,
    stem: &str,
) -> Result<Plot, DrawError> {
    let first = lag.terms[0];
    let own = first.square / first.gain;
    let most = BEYOND * known.reference;
    let window = [[0.0, 3.0 * own], [0.0, most]];
    let pairs = by_omega(lag);
    let mut curves = vec![];
    for branch in 0..2 {
        let inside = |points: &Vec<[f64; 2]>| {
            let place = points.get(branch).copied();
            place.filter(|[link, cut]| *link > 0.0 && *cut > 0.0 && *cut < 1e3 * most)
        };
        let places: Vec<Option<[f64; 2]>> = pairs.iter().map(inside).collect();
        let parts = places.split(|place| place.is_none()).filter(|part| part.len() > 1);
        curves.extend(parts.map(|part| part.iter().flatten().copied().collect()));
    }
    let marks = known.limit.map(|limit| ([own, limit.stiffness], adjustment.name()));
    let caption = format!(
        "Unstable roots by the stiffness of {} and K, {}",
        adjustment.names[0],
        adjustment.name()
    );
    let frame = Frame {
        title: &caption,
        x: "stiffness of the first link in N/mm",
        y: "cutting stiffness K in N/mm",
        limits: vec![],
    };
    let partition = Partition { frame, window, curves, marks: marks.into_iter().collect() };
    let count =
        |[link, stiffness]: [f64; 2]| lag.with_first(link).unstable(Complex::new(stiffness, 0.0));
    let svg = partitioned(&partition, count)?;
    Ok(Plot { file: format!("{stem}-partition-link.svg"), caption: caption.clone(), svg })
}

/// Returns both points of the boundary by the first link at each frequency, the one with the smaller 1/K first. The
/// frequency at which the two meet and end is bisected, so both curves reach it.
fn by_omega(lag: &Lag) -> Vec<Vec<[f64; 2]>> {
    let at = |omega: f64| {
        let mut points: Vec<[f64; 2]> =
            lag.link_and_stiffness(omega).iter().map(|point| point.at).collect();
        points.sort_by(|a, b| (1.0 / a[1]).total_cmp(&(1.0 / b[1])));
        points
    };
    let omegas = omegas(lag);
    let mut found = vec![];
    for pair in omegas.windows(2) {
        let (from, to) = (at(pair[0]), at(pair[1]));
        let (begins, ends) = (from.is_empty() && !to.is_empty(), !from.is_empty() && to.is_empty());
        found.push(from);
        if begins || ends {
            let (mut real, mut none) = if ends { (pair[0], pair[1]) } else { (pair[1], pair[0]) };
            for _ in 0..HALVINGS {
                let middle = (real + none) / 2.0;
                *(if at(middle).is_empty() { &mut none } else { &mut real }) = middle;
            }
            found.push(at(real));
        }
    }
    found
}

/// The responses of an adjustment while it cuts.
pub struct Cutting {
    /// Name of the adjustment.
    pub name: String,
    /// Cutting stiffness, N/mm.
    pub stiffness: f64,
    pub responses: Vec<Response>,
}

impl Cutting {
    fn name(&self) -> String {
        format!("{}, K {:.0} N/mm", self.name, self.stiffness)
    }
}

/// Draws real and imaginary part, amplitude, phase and hodograph of the tool's response relative to the work, and the
/// hodographs of each link and of the open loop, for one or several adjustments. `links` are the names of the links.
///
/// # Errors
/// As [`DrawError`].
pub fn of_responses(cuts: &[Cutting], links: &[String]) -> Result<Vec<Plot>, DrawError> {
    // um/N; frequencies up to the last amplitude above 2 % of the largest.
    let all = cuts.iter().flat_map(|cut| &cut.responses);
    let most = all.map(|r| r.cutting.modulus());
    let most = most.fold(0.0, f64::max);
    let seen = |all: &[Response]| -> f64 {
        let high = all.iter().filter(|r| r.cutting.modulus() > 0.02 * most);
        high.map(|r| r.omega).fold(0.0, f64::max)
    };
    let end = cuts.iter().map(|cut| seen(&cut.responses)).fold(0.0, f64::max);
    let mut plots = vec![];
    for (k, name) in PARTS.iter().enumerate() {
        let of = |cut: &Cutting| {
            let all = cut.responses.iter().filter(|r| r.omega <= end);
            let all: Vec<Response> = all.cloned().collect();
            let omegas = all.iter().map(|response| response.omega);
            Line { name: cut.name(), points: omegas.zip(part(k, &all)).collect() }
        };
        let lines: Vec<Line> = cuts.iter().map(of).collect();
        let caption = format!("Response of the tool relative to the work, cutting: {name}");
        let unit = if k == 3 { "degrees" } else { "µm/N" };
        let y = format!("{name} in {unit}");
        let frame = Frame { title: &caption, x: "frequency in rad/s", y: &y, limits: vec![] };
        let svg = drawn_lines(&frame, &lines)?;
        let file = format!("response-{}.svg", name.replace(' ', "-"));
        plots.push(Plot { file, caption: caption.clone(), svg });
    }
    let um = |value: Complex<f64>| (1e3 * value.re, 1e3 * value.im);
    let of_all = |place: &dyn Fn(&Response) -> (f64, f64)| -> Vec<Line> {
        let line = |cut: &Cutting| Line {
            name: cut.name(),
            points: cut.responses.iter().map(place).collect(),
        };
        cuts.iter().map(line).collect()
    };
    let of_link = |(k, name): (usize, &String)| {
        let lines = of_all(&|response| um(response.terms[k]));
        let named = |(cut, line): (&Cutting, Line)| match cuts.len() {
            1 => Line { name: name.clone(), ..line },
            _ => Line { name: format!("{name}, {}", cut.name), ..line },
        };
        cuts.iter().zip(lines).map(named).collect::<Vec<_>>()
    };
    let links = links.iter().enumerate().flat_map(of_link).collect();
    let whole = of_all(&|response| um(response.cutting));
    let open = of_all(&|response| (response.open.re, response.open.im));
    let (response, unit) =
        ("Response of the tool relative to the work, cutting: hodograph", " in µm/N");
    plots.push(hodograph("response-hodograph.svg", response, unit, whole, 0.0)?);
    let caption = "Each link alone, without cutting: hodograph";
    plots.push(hodograph("links-hodograph.svg", caption, unit, links, 0.0)?);
    let caption = "Open loop K G/(1 + iωT): hodograph, unstable if it encloses -1";
    plots.push(hodograph("open-loop-hodograph.svg", caption, ", no unit", open, -1.0)?);
    Ok(plots)
}

/// Quantities of a response with separate pictures.
const PARTS: [&str; 4] = ["real part", "imaginary part", "amplitude", "phase"];

/// Returns the k-th quantity: um/N, or degrees without jumps.
fn part(k: usize, all: &[Response]) -> Vec<f64> {
    let values = all.iter().map(|response| response.cutting);
    match k {
        0 => values.map(|w| 1e3 * w.re).collect(),
        1 => values.map(|w| 1e3 * w.im).collect(),
        2 => values.map(|w| 1e3 * w.modulus()).collect(),
        _ => {
            let angles = unwrapped(values.map(|w| w.argument()));
            angles.into_iter().map(f64::to_degrees).collect()
        }
    }
}

/// Draws curves over frequency in the complex plane, with a cross at a real number.
fn hodograph(
    file: &str,
    caption: &str,
    unit: &str,
    lines: Vec<Line>,
    cross: f64,
) -> Result<Plot, DrawError> {
    let all: Vec<(f64, f64)> =
        lines.iter().flat_map(|line| line.points.iter().copied()).chain([(cross, 0.0)]).collect();
    let [x, y] = ["real part", "imaginary part"].map(|name| format!("{name}{unit}"));
    let frame = Frame { title: caption, x: &x, y: &y, limits: vec![] };
    let names = lines.iter().enumerate().map(|(k, line)| Key::line(k, &line.name));
    let mark = if cross == 0.0 { "zero".into() } else { cross.to_string() };
    let keys: Vec<Key> = names.chain([Key::new(Sign::Cross, &mark)]).collect();
    let svg = keyed(&keys, |area| {
        let mut chart = path_axes(area, &frame, &all)?;
        for (k, line) in lines.iter().enumerate() {
            let path = without_stairs(&chart, &line.points);
            chart.draw_series([PathElement::new(path, line_style(k))])?;
        }
        chart.draw_series([Cross::new((cross, 0.0), 6, limit_style())])?;
        Ok(())
    })?;
    Ok(Plot { file: file.into(), caption: caption.into(), svg })
}

/// Draws the limit cutting stiffness over the overhang, mm and N/mm.
///
/// # Errors
/// As [`DrawError`].
pub fn of_overhangs(limits: &[(f64, f64)]) -> Result<Plot, DrawError> {
    let caption = "Limit cutting stiffness by overhang";
    let frame = Frame { title: caption, x: "overhang in mm", y: "limit in N/mm", limits: vec![] };
    let line = Line { name: "limit".into(), points: limits.to_vec() };
    let svg = drawn_lines(&frame, &[line])?;
    Ok(Plot { file: "overhang.svg".into(), caption: caption.into(), svg })
}

/// Types of stability loss, with a shade and a name.
const LOSSES: [(Loss, RGBColor, &str); 3] = [
    (Loss::Hopf, RGBColor(250, 200, 160), "unstable"),
    (Loss::Doubling, RGBColor(190, 140, 180), "unstable, two tooth periods"),
    (Loss::Fold, GRAY, "unstable, deflection grows"),
];

/// Shade of stable depths.
const STABLE: RGBColor = RGBColor(224, 243, 238);

/// Returns the style of stable depths, through which the grid of the plot is visible.
fn stable_style() -> ShapeStyle {
    GREEN.mix(0.12).filled()
}

/// Returns a depth with at most three digits behind the point.
fn short(depth: f64) -> String {
    tick(&((depth * 1e3).round() / 1e3))
}

/// Height of the bar over speeds without an unstable depth, as a share of the plot.
const BAR: f64 = 0.025;

/// Draws a bar along the upper end of a plot over ranges of speeds.
fn draw_bars(chart: &mut Chart, ranges: &[[f64; 2]], most: f64) -> Result<(), DrawError> {
    let bar = |[low, high]: &[f64; 2]| {
        Rectangle::new([(*low, (1.0 - BAR) * most), (*high, most)], GREEN.filled())
    };
    chart.draw_series(ranges.iter().map(bar))?;
    Ok(())
}

/// Returns the ranges of speeds at which a limit (1/min, mm) is infinite.
fn unlimited(limits: &[(f64, f64)]) -> Vec<[f64; 2]> {
    let runs = limits.chunk_by(|a, b| a.1.is_infinite() == b.1.is_infinite());
    let runs = runs.filter(|run| run[0].1.is_infinite());
    runs.map(|run| [run[0].0, run[run.len() - 1].0]).collect()
}

/// Draws unstable depths over spindle speeds, darker if the vibration has a period of two tooth periods, and a bar over
/// speeds without an unstable depth; the line is the zero-order limit (1/min, mm; infinite if every depth is stable).
///
/// # Errors
/// As [`DrawError`].
pub fn of_stable_map(map: &StableMap, zero_order: &[(f64, f64)]) -> Result<Plot, DrawError> {
    let ranges = map.without_unstable();
    let all = format!("every depth up to {} mm is stable", short(map.most));
    let caption = match map.columns.iter().all(|column| column.bands.is_empty()) {
        true => format!("At these spindle speeds {all}"),
        false => "Stable depths by spindle speed".into(),
    };
    let frame =
        Frame { title: &caption, x: "spindle speed in 1/min", y: "depth in mm", limits: vec![] };
    let [first, last] = [&map.columns[0], &map.columns[map.columns.len() - 1]].map(|c| c.rpm);
    let has = |loss: Loss| map.columns.iter().any(|c| c.bands.iter().any(|band| band.loss == loss));
    let shades = LOSSES.iter().filter(|(loss, ..)| has(*loss));
    let shades = shades.map(|(_, color, name)| Key::new(Sign::Area(*color), name));
    let stable = [Key::new(Sign::Area(STABLE), "stable")];
    let bar = (!ranges.is_empty()).then(|| Key::new(Sign::Area(GREEN), &all));
    let is_drawn = zero_order.iter().any(|point| point.1 <= map.most);
    let is_stable = zero_order.iter().all(|point| point.1.is_infinite());
    let name = match (is_drawn, is_stable) {
        (true, _) => "zero order",
        (_, true) => "zero order: every depth is stable",
        _ => "zero order: above the plot",
    };
    let line = [Key::new(Sign::Line(limit_style()), name)];
    let keys: Vec<Key> = stable.into_iter().chain(bar).chain(shades).chain(line).collect();
    let svg = keyed(&keys, |area| {
        let mut chart = axes(area, &frame, first..last, 0.0..map.most)?;
        let corners = [(first, 0.0), (last, map.most)];
        chart.draw_series([Rectangle::new(corners, stable_style())])?;
        let cells = map.columns.windows(2).flat_map(|pair| cells(&pair[0], &pair[1]));
        chart.draw_series(cells.map(|(corners, color)| Polygon::new(corners, color.filled())))?;
        draw_bars(&mut chart, &ranges, map.most)?;
        let inside = zero_order.split(|point| !(point.1 <= map.most)).filter(|part| part.len() > 1);
        chart.draw_series(inside.map(|part| PathElement::new(part.to_vec(), limit_style())))?;
        Ok(())
    })?;
    Ok(Plot { file: "stable-depths.svg".into(), caption: caption.clone(), svg })
}

/// Returns the unstable areas between two columns: bands of both columns are connected if they match, others
/// reach half way.
fn cells(left: &Column, right: &Column) -> Vec<(Vec<(f64, f64)>, RGBColor)> {
    let color =
        |band: &Band| LOSSES.iter().find(|(loss, ..)| *loss == band.loss).map_or(GRAY, |l| l.1);
    let same = |(a, b): (&Band, &Band)| a.loss == b.loss;
    let cell = |from: (f64, &Band), to: (f64, &Band)| {
        let corners =
            vec![(from.0, from.1.low), (to.0, to.1.low), (to.0, to.1.high), (from.0, from.1.high)];
        (corners, color(from.1))
    };
    let pairs = left.bands.iter().zip(&right.bands);
    if left.bands.len() == right.bands.len() && pairs.clone().all(same) {
        return pairs.map(|(a, b)| cell((left.rpm, a), (right.rpm, b))).collect();
    }
    let middle = (left.rpm + right.rpm) / 2.0;
    let half = |column: &Column| -> Vec<_> {
        column.bands.iter().map(|band| cell((column.rpm, band), (middle, band))).collect()
    };
    [half(left), half(right)].concat()
}

/// Draws stability lobes of the zero-order approximation up to a depth in mm, above the stable depths below their limit
/// over the spindle speeds of the plot (1/min, mm; infinite if every depth is stable).
///
/// # Errors
/// As [`DrawError`].
pub fn of_lobes(
    lobes: &[Vec<LobePoint>],
    limit: &[(f64, f64)],
    most: f64,
) -> Result<Plot, DrawError> {
    let ranges = unlimited(limit);
    let is_stable = limit.iter().all(|point| point.1.is_infinite());
    let caption = match limit.iter().any(|point| point.1 < most) {
        true => "Stability lobes, zero order".into(),
        false if is_stable => "Zero order: every depth is stable at these spindle speeds".into(),
        false => format!("Zero order: every depth up to {} mm is stable", short(most)),
    };
    let frame =
        Frame { title: &caption, x: "spindle speed in 1/min", y: "depth in mm", limits: vec![] };
    let [low, high] = [limit[0].0, limit[limit.len() - 1].0];
    let is_seen =
        |point: &LobePoint| (low..=high).contains(&point.rpm) && point.limit.depth <= most;
    let bar = (!ranges.is_empty()).then(|| Key::new(Sign::Area(GREEN), "every depth is stable"));
    let stable = [Key::new(Sign::Area(STABLE), "stable")];
    let lines = lobes.iter().flatten().any(&is_seen).then(|| Key::line(0, "lobes"));
    let keys: Vec<Key> = stable.into_iter().chain(bar).chain(lines).collect();
    let svg = keyed(&keys, |area| {
        let mut chart = axes(area, &frame, low..high, 0.0..most)?;
        let top = limit.iter().map(|point| (point.0, point.1.min(most)));
        let corners: Vec<(f64, f64)> =
            [(low, 0.0)].into_iter().chain(top).chain([(high, 0.0)]).collect();
        chart.draw_series([Polygon::new(corners, stable_style())])?;
        draw_bars(&mut chart, &ranges, most)?;
        for lobe in lobes {
            for part in lobe.split(|point| !is_seen(point)).filter(|part| part.len() > 1) {
                let points: Vec<(f64, f64)> =
                    part.iter().map(|point| (point.rpm, point.limit.depth)).collect();
                chart.draw_series([PathElement::new(points, line_style(0))])?;
            }
        }
        Ok(())
    })?;
    Ok(Plot { file: "lobes.svg".into(), caption: caption.clone(), svg })
}

/// Draws receptances of the tool tip along the feed and its normal, um/N over Hz.
///
/// # Errors
/// As [`DrawError`].
pub fn of_tip(lines: [Vec<(f64, f64)>; 2]) -> Result<Plot, DrawError> {
    let caption = "Amplitude of the tool tip under a force of 1 N";
    let frame =
        Frame { title: caption, x: "frequency in Hz", y: "amplitude in µm/N", limits: vec![] };
    let [feed, normal] = lines.map(|points| {
        points.into_iter().map(|(omega, amplitude)| (omega / TAU, 1e3 * amplitude)).collect()
    });
    let lines = [
        Line { name: "along the feed".into(), points: feed },
        Line { name: "across it".into(), points: normal },
    ];
    let svg = drawn_lines(&frame, &lines)?;
    Ok(Plot { file: "tip-response.svg".into(), caption: caption.into(), svg })
}

/// Draws a map of limit depths (mm; infinite if every depth is stable) over a plane of two coordinates.
///
/// # Errors
/// As [`DrawError`].
pub fn of_depths(
    letters: [char; 2],
    unit: &str,
    sides: &[Vec<f64>; 2],
    depths: &[f64],
    what: &str,
) -> Result<Plot, DrawError> {
    let plane: String = letters.iter().collect();
    let caption = format!("Limit depth in mm in the plane {plane}, {what}");
    let frame = Frame {
        title: &caption,
        x: &format!("{} in {unit}", letters[0]),
        y: &format!("{} in {unit}", letters[1]),
        limits: vec![],
    };
    let svg = contoured(&frame, "mm", sides, depths, &["every depth", "is stable"])?;
    let file = format!("limit-depth-{}.svg", plane.to_lowercase());
    Ok(Plot { file, caption: caption.clone(), svg })
}

/// Draws limit depths (mm) along a program, in order; the largest depth examined limits them.
///
/// # Errors
/// As [`DrawError`].
pub fn of_path(depths: &[f64], deepest: f64) -> Result<Plot, DrawError> {
    let caption = "Depth up to which the program is stable";
    let frame = Frame {
        title: caption,
        x: "number of the position along the program",
        y: "depth in mm",
        limits: match depths.iter().any(|depth| *depth >= deepest) {
            true => vec![("largest depth examined".into(), deepest)],
            false => vec![],
        },
    };
    let points = depths.iter().enumerate().map(|(k, depth)| (k as f64, *depth)).collect();
    let svg = drawn_lines(&frame, &[Line { name: "limit".into(), points }])?;
    Ok(Plot { file: "program-depths.svg".into(), caption: caption.into(), svg })
}
