// SPDX-License-Identifier: GPL-2.0-or-later
//! The path of a program in the room of its machine, by how near it comes to the limits.

use crate::draw::lines::places_apart;
use crate::draw::over::{Mark, RED, label, write};
use crate::draw::plot::DrawError;
use crate::draw::sheet::{Area, Chart, Frame, drawn, legend_at, path_axes, project, span};
use crate::program::course::Thinned;
use crate::read::machine::MachineConfig;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Most points of a path.
const MOST_POINTS: usize = 5000;

/// Most stretches of a path that are drawn in a colour of their own.
const MOST_STRETCHES: usize = 300;

/// Rooms are computed to this share of a limit's range; a program may go to the limit itself.
const ROUNDING: f64 = 1e-6;

/// Less of a limit's range than this is near.
pub(super) const NEAR: f64 = 0.1;

/// Breaks nearer to each other than this share of a view become one.
const ONE_MARK: f64 = 0.02;

/// How near a part of a path comes to the limits, the worst last. Widths differ as well: a print
/// without colours shows them.
const SHADES: [(&str, RGBColor, u32); 3] = [
    ("away from limits", RGBColor(0, 90, 160), 2),
    ("near a limit", RGBColor(215, 115, 0), 4),
    ("beyond a limit", RED, 7),
];

fn shade(room: f64) -> usize {
    match room {
        room if room >= NEAR => 0,
        room if room >= -ROUNDING => 1,
        _ => 2,
    }
}

/// The path twice: in the box of the axis limits, and closer.
pub(super) fn in_its_room(
    config: &MachineConfig,
    course: &Thinned,
    marks: &[Mark],
) -> Result<String, DrawError> {
    let path = Path::new(course);
    let edges = edges(config, course);
    let unit = config.length_unit();
    drawn(|root| {
        let areas = root.split_evenly((1, 2));
        let corners: Vec<(f64, f64)> = edges.iter().flatten().copied().collect();
        let around = [&path.points[..], &corners].concat();
        let mut chart = view(&areas[0], "In the machine", unit, &around)?;
        let thin = BLACK.stroke_width(1);
        for (k, edge) in edges.iter().enumerate() {
            let series = chart.draw_series(LineSeries::new(*edge, thin))?;
            if k == 0 {
                series
                    .label("limits of the axes")
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 34, y)], thin));
            }
        }
        path.draw(&mut chart)?;
        draw_marks(&mut chart, marks, &around)?;
        // The corners below an isometric box are empty.
        legend_at(&mut chart, SeriesLabelPosition::LowerRight)?;
        let marked = marks.iter().map(|mark| place(&mark.pose));
        let around: Vec<(f64, f64)> = path.points.iter().copied().chain(marked).collect();
        let mut chart = view(&areas[1], "Closer", unit, &around)?;
        path.draw(&mut chart)?;
        draw_marks(&mut chart, marks, &around)
    })
}

fn view<'a, 'b>(
    area: &'a Area<'b>,
    title: &str,
    unit: &str,
    around: &[(f64, f64)],
) -> Result<Chart<'a, 'b>, DrawError> {
    let frame = Frame {
        title,
        x: &format!("to the right: X and Y, in {unit}"),
        y: &format!("up: Z, in {unit}"),
        limits: vec![],
    };
    path_axes(area, &frame, around)
}

fn place(pose: &[f64; 6]) -> (f64, f64) {
    project([pose[0], pose[1], pose[2]])
}

/// The path on the sheet, and the stretches that are near or beyond limits.
struct Path {
    points: Vec<(f64, f64)>,
    /// Places in the points, both included, with their shades.
    stretches: Vec<([usize; 2], usize)>,
}

impl Path {
    fn new(course: &Thinned) -> Self {
        let all: Vec<(f64, f64)> = course.samples.iter().map(|s| place(&s.pose)).collect();
        let mut pixels = 1.0;
        let mut kept = places_apart(&all, pixels);
        while kept.len() > MOST_POINTS {
            pixels *= 1.5;
            kept = places_apart(&all, pixels);
        }
        let points = kept.iter().map(|place| all[*place]).collect();
        // What lies between two points counts with the first.
        let worst = |k: usize| {
            let to = kept.get(k + 1).map_or(all.len(), |next| *next);
            let between = &course.samples[kept[k]..to];
            between.iter().map(|sample| shade(sample.room())).max().unwrap_or_default()
        };
        let shades: Vec<usize> = (0..kept.len()).map(worst).collect();
        let last = shades.len().saturating_sub(1);
        let stretches = [1, 2].into_iter().flat_map(|shade| {
            let own = stretches(&shades, shade);
            // A point alone is no line.
            own.into_iter().map(move |[from, to]| ([from, (to + 1).min(last)], shade))
        });
        Self { points, stretches: stretches.collect() }
    }

    fn draw(&self, chart: &mut Chart) -> Result<(), DrawError> {
        let last = self.points.len().saturating_sub(1);
        let whole = ([0, last], 0);
        for shade in 0..SHADES.len() {
            let (name, colour, width) = SHADES[shade];
            let style = colour.stroke_width(width);
            let own = self.stretches.iter().chain([&whole]).filter(|(_, own)| *own == shade);
            for (k, ([from, to], _)) in own.enumerate() {
                let points = self.points[*from..=*to].iter().copied();
                let series = chart.draw_series(LineSeries::new(points, style))?;
                if k == 0 {
                    series
                        .label(name)
                        .legend(move |(x, y)| PathElement::new([(x, y), (x + 34, y)], style));
                }
            }
        }
        Ok(())
    }
}

/// First and last place of every stretch of a shade. Gaps are bridged, the shortest first, until
/// there are few enough.
fn stretches(shades: &[usize], shade: usize) -> Vec<[usize; 2]> {
    let mut found: Vec<[usize; 2]> = vec![];
    for (place, _) in shades.iter().enumerate().filter(|(_, own)| **own == shade) {
        match found.last_mut() {
            Some([_, to]) if *to + 1 == place => *to = place,
            _ => found.push([place, place]),
        }
    }
    let mut gap = 2;
    while found.len() > MOST_STRETCHES {
        found = found
            .chunk_by(|a, b| b[0] - a[1] <= gap)
            .map(|of| [of[0][0], of[of.len() - 1][1]])
            .collect();
        gap *= 2;
    }
    found
}

/// Edges of the box of the limits of X, Y and Z; where one has none, the path ends the box.
fn edges(config: &MachineConfig, course: &Thinned) -> Vec<[(f64, f64); 2]> {
    let ends: [[f64; 2]; 3] = std::array::from_fn(|k| {
        let (low, high) = span(course.samples.iter().flat_map(|sample| sample.poses[k]));
        let axis = config.axes[k];
        let or = |limit: f64, value: f64| if limit.is_finite() { limit } else { value };
        [or(axis.min, low), or(axis.max, high)]
    });
    let corner = |k: usize| project(std::array::from_fn(|axis| ends[axis][k >> axis & 1]));
    let beside = |k: usize| (0..3).map(move |axis| (k, k | 1 << axis)).filter(|(a, b)| a != b);
    (0..8).flat_map(beside).map(|(a, b)| [corner(a), corner(b)]).collect()
}

fn draw_marks(chart: &mut Chart, marks: &[Mark], around: &[(f64, f64)]) -> Result<(), DrawError> {
    let wide = [|p: &(f64, f64)| p.0, |p: &(f64, f64)| p.1].map(|of| {
        let (low, high) = span(around.iter().map(of));
        high - low
    });
    let near = ONE_MARK * wide[0].max(wide[1]);
    let mut groups: Vec<((f64, f64), Vec<usize>)> = vec![];
    for (number, mark) in marks.iter().enumerate() {
        let at = place(&mark.pose);
        let same = |group: &&mut ((f64, f64), Vec<usize>)| {
            (group.0.0 - at.0).hypot(group.0.1 - at.1) < near
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.1.push(number),
            None => groups.push((at, vec![number])),
        }
    }
    let (low, high) = span(around.iter().map(|p| p.0));
    for (at, numbers) in groups {
        chart.draw_series([Cross::new(at, 8, RED.stroke_width(3))])?;
        let right = at.0 > (low + high) / 2.0;
        let (side, shift) = if right { (HPos::Right, -13) } else { (HPos::Left, 13) };
        write(chart, at, &label(marks, &numbers), Pos::new(side, VPos::Bottom), (shift, -4))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_stretch_is_never_lost() {
        // Every second point is bad: too many stretches.
        let shades: Vec<usize> = (0..4000).map(|k| if k % 2 == 0 { 2 } else { 0 }).collect();
        assert_eq!(stretches(&shades, 2), [[0, 3998]]);
        let single: Vec<usize> = (0..4000).map(|k| usize::from(k == 1234)).collect();
        assert_eq!(stretches(&single, 1), [[1234, 1234]]);
        assert_eq!(stretches(&single, 2), [[0; 2]; 0]);
    }

    #[test]
    fn what_is_not_a_number_is_beyond_a_limit() {
        let rooms = [0.5, 0.1, 0.05, 0.0, -1e-9, -1e-3, f64::NEG_INFINITY, f64::NAN];
        assert_eq!(rooms.map(shade), [0, 0, 1, 1, 1, 2, 2, 2]);
    }
}
