// SPDX-License-Identifier: GPL-2.0-or-later
//! Shaded maps with contour lines.

use crate::plot::DrawError;
use crate::sheet::{
    Area, Chart, Frame, SIZE, drawn_on, path_axes, round_steps, span, tick, width_for,
};
use crate::style::{GRAY, GREEN, SMALL, TITLE, letters_at, shade, width_of};
use kinematics::Letter;
use machine::read::mechanism::Mechanism;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use studies::study::map;

const LEVELS: usize = 8;

/// Width of the scale next to a map, pixels.
const SCALE: u32 = 110;

const SHADES: usize = 32;

/// Least distance of labels from the border and from each other, as a share of the map's side.
const APART: f64 = 0.06;

/// Draws a shaded map with contour lines, and its scale next to it; white where there is no value. Infinite values have
/// a color of their own, which `unlimited` explains in lines below the scale.
pub(super) fn contoured(
    frame: &Frame,
    unit: &str,
    sides: &[Vec<f64>; 2],
    values: &[f64],
    unlimited: &[&str],
) -> Result<String, DrawError> {
    let map = Map { sides, values, range: span(values.iter().copied().filter(|v| v.is_finite())) };
    let corners = [0, 1].map(|end| map.corner(end));
    let width = width_for([corners[1].0 - corners[0].0, corners[1].1 - corners[0].1]);
    // The title is as wide as a narrow map or wider.
    let width = width.max(width_of(frame.title, TITLE));
    drawn_on((width + SCALE, SIZE.1), |root| {
        let (plot, scale) = root.split_horizontally(width);
        let mut chart = path_axes(&plot, frame, &corners)?;
        map.draw_shades(&mut chart)?;
        let [(left, low), (right, high)] = corners;
        let border = [(left, low), (right, low), (right, high), (left, high), (left, low)];
        chart.draw_series([PathElement::new(border, GRAY.stroke_width(1))])?;
        let levels = map.levels();
        map.draw_lines(&mut chart, &levels)?;
        map.draw_scale(&scale, unit, &levels)?;
        map.draw_unlimited(&scale, unlimited)
    })
}

/// Returns the plane of a map in words, with the values of the other coordinates that the machine moves.
pub(super) fn plane_of<const N: usize>(config: &Mechanism, map: &map::Map<N>) -> String {
    let plane: String = map.plane.map(|k| Letter::ALL[k].name()).into_iter().collect();
    let layout = config.machine.layout();
    let others = (Letter::ALL.into_iter())
        .filter(|letter| !layout.is_held(*letter) && !map.plane.contains(&letter.index()))
        .map(|letter| format!(" {}{}", letter.name(), tick(&map.pose[letter.index()])));
    match others.collect::<String>() {
        others if others.is_empty() => format!("plane {plane}"),
        others => format!("plane {plane} at{others}"),
    }
}

struct Map<'a> {
    sides: &'a [Vec<f64>; 2],
    values: &'a [f64],
    range: (f64, f64),
}

impl Map<'_> {
    fn corner(&self, end: usize) -> (f64, f64) {
        let [across, up] = self.sides;
        let of = |side: &[f64]| if end == 0 { side[0] } else { side[side.len() - 1] };
        (of(across), of(up))
    }

    /// Returns the color of a value; in a map with a single value the middle one.
    fn color(&self, value: f64) -> Option<RGBColor> {
        if value == f64::INFINITY {
            return Some(GREEN);
        }
        let (low, high) = self.range;
        let share = if high > low { (value - low) / (high - low) } else { 0.5 };
        let steps = (SHADES - 1) as f64;
        value.is_finite().then(|| shade((share * steps).round() / steps))
    }

    /// Draws the shades: every grid point fills half the distance to its neighbors; neighbors in a row with the same
    /// shade form one rectangle.
    fn draw_shades(&self, chart: &mut Chart) -> Result<(), DrawError> {
        let [across, up] = self.sides;
        for (j, row) in self.values.chunks(across.len()).enumerate() {
            let colors: Vec<Option<RGBColor>> =
                row.iter().map(|value| self.color(*value)).collect();
            let mut from = 0;
            for cells in colors.chunk_by(|a, b| a == b) {
                let to = from + cells.len();
                if let Some(color) = cells[0] {
                    let corners =
                        [(edge(across, from), edge(up, j)), (over(across, to), over(up, j + 1))];
                    chart.draw_series([Rectangle::new(corners, color.filled())])?;
                }
                from = to;
            }
        }
        Ok(())
    }

    /// Returns round values within the range of the map.
    fn levels(&self) -> Vec<f64> {
        round_steps([self.range.0, self.range.1], LEVELS)
    }

    fn draw_lines(&self, chart: &mut Chart, levels: &[f64]) -> Result<(), DrawError> {
        let mut labels: Vec<((f64, f64), f64)> = vec![];
        for level in levels {
            let pieces = isoline(self.sides, self.values, *level);
            let lines = pieces.iter().map(|ends| PathElement::new(*ends, BLACK.stroke_width(1)));
            chart.draw_series(lines)?;
            let middle = pieces.len() / 2;
            // From the middle of the line outwards, to find a free position.
            let mut places: Vec<(usize, (f64, f64))> =
                pieces.iter().enumerate().map(|(k, ends)| (k.abs_diff(middle), ends[0])).collect();
            places.sort_by_key(|place| place.0);
            let free =
                places.into_iter().map(|place| place.1).find(|at| self.is_free(*at, &labels));
            labels.extend(free.map(|at| (at, *level)));
        }
        for (at, level) in labels {
            let text = tick(&level);
            let half = width_of(&text, SMALL) as i32 / 2 + 1;
            let clear = Rectangle::new([(-half, -8), (half, 8)], WHITE.mix(0.75).filled());
            let style = letters_at(SMALL, HPos::Center, VPos::Center);
            let label = EmptyElement::at(at) + clear + Text::new(text, (0, 0), style);
            chart.draw_series([label])?;
        }
        Ok(())
    }

    fn is_free(&self, at: (f64, f64), labels: &[((f64, f64), f64)]) -> bool {
        let [low, high] = [0, 1].map(|end| self.corner(end));
        let room = APART * (high.0 - low.0).max(high.1 - low.1);
        let inside = |value: f64, low: f64, high: f64| low + room <= value && value <= high - room;
        let is_apart = |(other, _): &((f64, f64), f64)| {
            (at.0 - other.0).abs() > 2.0 * room || (at.1 - other.1).abs() > room
        };
        inside(at.0, low.0, high.0) && inside(at.1, low.1, high.1) && labels.iter().all(is_apart)
    }

    /// Draws the shades with their values.
    fn draw_scale(&self, area: &Area, unit: &str, levels: &[f64]) -> Result<(), DrawError> {
        let (top, bottom) = (70, SIZE.1 as i32 - 60);
        let style = letters_at(SMALL, HPos::Left, VPos::Center);
        area.draw(&Text::new(unit.to_string(), (0, top - 20), style.clone()))?;
        let (low, high) = self.range;
        if !(low < high) {
            return Ok(());
        }
        let place = |share: f64| bottom - (share * f64::from(bottom - top)).round() as i32;
        for step in 0..SHADES {
            let [from, to] = [step, step + 1].map(|k| place(k as f64 / SHADES as f64));
            let color = shade(step as f64 / (SHADES - 1) as f64);
            area.draw(&Rectangle::new([(0, to), (22, from)], color.filled()))?;
        }
        area.draw(&Rectangle::new([(0, top), (22, bottom)], GRAY.stroke_width(1)))?;
        for level in levels {
            let y = place((level - low) / (high - low));
            area.draw(&PathElement::new([(0, y), (28, y)], BLACK.stroke_width(1)))?;
            area.draw(&Text::new(tick(level), (32, y), style.clone()))?;
        }
        Ok(())
    }

    /// Draws the color of infinite values, if there are any, with its meaning.
    fn draw_unlimited(&self, area: &Area, meaning: &[&str]) -> Result<(), DrawError> {
        if !self.values.contains(&f64::INFINITY) {
            return Ok(());
        }
        let top = SIZE.1 as i32 - 42;
        let corners = [(0, top), (22, top + 16)];
        area.draw(&Rectangle::new(corners, GREEN.filled()))?;
        area.draw(&Rectangle::new(corners, GRAY.stroke_width(1)))?;
        let style = letters_at(SMALL, HPos::Left, VPos::Center);
        for (k, line) in meaning.iter().enumerate() {
            area.draw(&Text::new(*line, (28, top + 8 + 16 * k as i32), style.clone()))?;
        }
        Ok(())
    }
}

/// Returns a position slightly beyond an edge, so that no gap is visible next to the adjacent cell.
fn over(side: &[f64], k: usize) -> f64 {
    let end = side[side.len() - 1];
    (edge(side, k) + 0.2 * (side[1] - side[0])).min(end)
}

/// Returns the midpoint between two grid points of a side; at its ends the end points.
fn edge(side: &[f64], k: usize) -> f64 {
    match k {
        0 => side[0],
        k if k >= side.len() => side[side.len() - 1],
        k => (side[k - 1] + side[k]) / 2.0,
    }
}

/// Returns the pieces of an isoline: where the value, linear on the triangles between four grid points
/// and their center, equals the level. None where a corner is NaN.
pub(super) fn isoline(
    [across, up]: &[Vec<f64>; 2],
    values: &[f64],
    level: f64,
) -> Vec<[(f64, f64); 2]> {
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

/// Returns the line on which a linear function over a triangle is 0.
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
