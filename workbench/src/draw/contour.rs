// SPDX-License-Identifier: GPL-2.0-or-later
//! Lines of equal value of a map.

use crate::draw::plot::DrawError;
use crate::draw::sheet::{FONT, Frame, drawn, path_axes};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Levels of a map.
const LEVELS: usize = 8;

pub(super) fn contoured(
    frame: &Frame,
    sides: &[Vec<f64>; 2],
    values: &[f64],
) -> Result<String, DrawError> {
    let [across, up] = sides;
    let corners = |side: &[f64]| (side[0], side[side.len() - 1]);
    let ((left, right), (low, high)) = (corners(across), corners(up));
    drawn(|root| {
        let mut chart = path_axes(root, frame, &[(left, low), (right, high)])?;
        let border = [(left, low), (right, low), (right, high), (left, high), (left, low)];
        chart.draw_series([PathElement::new(border, BLACK.mix(0.4).stroke_width(1))])?;
        for level in levels(values) {
            let pieces = isoline(sides, values, level);
            let middle = pieces.get(pieces.len() / 3).map(|[from, _]| *from);
            let pieces = pieces.iter().map(|ends| PathElement::new(*ends, BLACK.stroke_width(1)));
            chart.draw_series(pieces)?;
            let clear = middle.map(|at| Circle::new(at, 10, WHITE.filled()));
            chart.draw_series(clear)?;
            let style = (FONT, 14).into_font().color(&BLACK);
            let style = style.pos(Pos::new(HPos::Center, VPos::Center));
            let label = middle.map(|at| Text::new(format!("{}", rounded(level)), at, style));
            chart.draw_series(label)?;
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
