// SPDX-License-Identifier: GPL-2.0-or-later
//! Partitions of a plane by the number of unstable roots: curves hatched on the side with fewer of
//! them, and their number in every region.

use crate::key::{Key, Sign, keyed};
use crate::plot::DrawError;
use crate::sheet::{Chart, Frame, SIZE, axes};
use crate::style::{BLUE, NAME, PALE, letters_at};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use studies::stability::partition::{Point, Window, regions};

/// Distance of the strokes of the hatching, and their length, pixels.
const HATCH: [f64; 2] = [11.0, 8.0];

/// Width of a curve; it differs from that of dashed lines, so curves are not dashed.
const WIDTH: u32 = 2;

/// Distance of letters that do not touch, pixels.
const ENOUGH: f64 = 30.0;

/// Distance from a curve at which roots are counted, pixels.
const BESIDE: f64 = 2.0;

/// Contents of a picture of a partition.
pub(super) struct Partition<'a> {
    pub(super) frame: Frame<'a>,
    pub(super) window: Window,
    /// Boundaries, straight lines included.
    pub(super) curves: Vec<Vec<[f64; 2]>>,
    /// Marked points, with their labels.
    pub(super) marks: Vec<([f64; 2], String)>,
}

pub(super) fn places(points: &[Point]) -> Vec<[f64; 2]> {
    points.iter().map(|point| point.at).collect()
}

pub(super) fn partitioned(
    partition: &Partition,
    unstable: impl Fn([f64; 2]) -> usize + Sync,
) -> Result<String, DrawError> {
    let [across, up] = partition.window;
    // Approximate size of a pixel: the frame takes a tenth of the sheet.
    let pixel = [
        (across[1] - across[0]) / (0.9 * f64::from(SIZE.0)),
        (up[1] - up[0]) / (0.85 * f64::from(SIZE.1)),
    ];
    // Letters next to the points: curves that cross there leave no room for more.
    let marks: Vec<([f64; 2], Key)> = partition
        .marks
        .iter()
        .zip('a'..)
        .map(|((at, text), letter)| (*at, Key::new(Sign::Letter(letter.into()), text)))
        .collect();
    let numbers = Key::new(Sign::Letter("2".into()), "unstable roots");
    let line = Key::new(Sign::Line(BLUE.stroke_width(WIDTH)), "hatched where fewer");
    let named = marks.iter().map(|(_, key)| Key::new(key.sign.clone(), &key.name));
    let keys: Vec<Key> = [numbers, line].into_iter().chain(named).collect();
    keyed(&keys, |area| {
        let mut chart = axes(area, &partition.frame, across[0]..across[1], up[0]..up[1])?;
        let line = |from: [f64; 2], to: [f64; 2], style| {
            clipped(from, to, &partition.window)
                .map(|ends| PathElement::new(ends.map(|[x, y]| (x, y)), style))
        };
        let thin = PALE.stroke_width(1);
        let zeros = [
            line([across[0], 0.0], [across[1], 0.0], thin),
            line([0.0, up[0]], [0.0, up[1]], thin),
        ];
        chart.draw_series(zeros.into_iter().flatten())?;
        for curve in &partition.curves {
            let style = BLUE.stroke_width(WIDTH);
            let pieces = visible(curve, &partition.window, &pixel);
            chart.draw_series(pieces.into_iter().map(|piece| PathElement::new(piece, style)))?;
            let strokes = hatched(curve, &pixel, &partition.window, &unstable);
            let style = BLUE.stroke_width(1);
            chart.draw_series(strokes.into_iter().filter_map(|[a, b]| line(a, b, style)))?;
        }
        label(&mut chart, partition, &marks, &pixel, &unstable)
    })
}

/// Returns the visible pieces of a curve, without points within a pixel.
fn visible(curve: &[[f64; 2]], window: &Window, pixel: &[f64; 2]) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = vec![];
    for pair in curve.windows(2) {
        let Some([from, to]) = clipped(pair[0], pair[1], window) else { continue };
        let ([x, y], end) = (from, (to[0], to[1]));
        match pieces.last_mut().and_then(|piece| piece.last().copied().map(|last| (piece, last))) {
            Some((piece, last)) if last == (x, y) => piece.push(end),
            _ => pieces.push(vec![(x, y), end]),
        }
    }
    let near = |a: &(f64, f64), b: &(f64, f64)| {
        ((a.0 - b.0) / pixel[0]).hypot((a.1 - b.1) / pixel[1]) < 1.0
    };
    for piece in &mut pieces {
        let last = piece[piece.len() - 1];
        piece.dedup_by(|later, kept| near(later, kept));
        if piece[piece.len() - 1] != last {
            piece.push(last);
        }
    }
    pieces
}

fn label(
    chart: &mut Chart,
    partition: &Partition,
    marks: &[([f64; 2], Key)],
    pixel: &[f64; 2],
    unstable: &(impl Fn([f64; 2]) -> usize + Sync),
) -> Result<(), DrawError> {
    let numbers = letters_at(24, HPos::Center, VPos::Center);
    let mut taken: Vec<[f64; 2]> = vec![];
    for region in regions(&partition.window, unstable) {
        let place = (region.at[0], region.at[1]);
        chart.draw_series([Circle::new(place, 15, WHITE.filled())])?;
        let text = region.unstable.to_string();
        chart.draw_series([Text::new(text, place, numbers.clone())])?;
        taken.push(region.at);
    }
    for (at, key) in marks {
        let Sign::Letter(letter) = &key.sign else { continue };
        let [x, y] = free_side(*at, pixel, &mut taken);
        let dot = EmptyElement::at((at[0], at[1]))
            + Circle::new((0, 0), 4, BLACK.filled())
            + Text::new(letter.clone(), (x, -y), letters_at(NAME, HPos::Center, VPos::Center));
        chart.draw_series([dot])?;
    }
    Ok(())
}

/// Returns the position of a mark's letter: pixels to the right and up, as far from other letters as
/// possible.
fn free_side(at: [f64; 2], pixel: &[f64; 2], taken: &mut Vec<[f64; 2]>) -> [i32; 2] {
    let place = |side: &[i32; 2]| [0, 1].map(|k| at[k] + f64::from(side[k]) * pixel[k]);
    let room = |side: &[i32; 2]| {
        let own = place(side);
        let away = |other: &[f64; 2]| {
            ((own[0] - other[0]) / pixel[0]).hypot((own[1] - other[1]) / pixel[1])
        };
        taken.iter().map(away).fold(ENOUGH, f64::min)
    };
    let sides = [[11, 12], [-11, 12], [11, -13], [-11, -13]];
    let best = sides.into_iter().reduce(|a, b| if room(&b) > room(&a) { b } else { a });
    let best = best.unwrap_or(sides[0]);
    taken.push(place(&best));
    best
}

/// Returns strokes at even distances along a curve, on the side with fewer unstable roots.
fn hatched(
    curve: &[[f64; 2]],
    pixel: &[f64; 2],
    window: &Window,
    unstable: &impl Fn([f64; 2]) -> usize,
) -> Vec<[[f64; 2]; 2]> {
    let mut strokes = vec![];
    let mut left = HATCH[0] / 2.0;
    for pair in curve.windows(2) {
        let Some([from, to]) = clipped(pair[0], pair[1], window) else { continue };
        let step = [(to[0] - from[0]) / pixel[0], (to[1] - from[1]) / pixel[1]];
        let length = step[0].hypot(step[1]);
        if !(length > 0.0) {
            continue;
        }
        let mut along = left;
        while along < length {
            let share = along / length;
            let at = [0, 1].map(|k| from[k] + (to[k] - from[k]) * share);
            let normal = [-step[1] / length, step[0] / length];
            let beside = |pixels: f64| [0, 1].map(|k| at[k] + normal[k] * pixels * pixel[k]);
            let counts = [BESIDE, -BESIDE].map(|pixels| unstable(beside(pixels)));
            let side = (counts[1] as f64 - counts[0] as f64).signum();
            if counts[0] != counts[1] {
                strokes.push([at, beside(side * HATCH[1])]);
            }
            along += HATCH[0];
        }
        left = along - length;
    }
    strokes
}

/// Returns the part of a straight line inside a window (Liang and Barsky).
fn clipped(from: [f64; 2], to: [f64; 2], window: &Window) -> Option<[[f64; 2]; 2]> {
    let mut share = [0.0_f64, 1.0_f64];
    for k in 0..2 {
        let step = to[k] - from[k];
        for (sign, bound) in [(-1.0, window[k][0]), (1.0, window[k][1])] {
            let (out, room) = (sign * step, sign * (bound - from[k]));
            if out > 0.0 {
                share[1] = share[1].min(room / out);
            } else if out < 0.0 {
                share[0] = share[0].max(room / out);
            } else if !(room >= 0.0) {
                return None;
            }
        }
    }
    let at = |share: f64| [0, 1].map(|k| from[k] + (to[k] - from[k]) * share);
    (share[0] <= share[1]).then(|| share.map(at))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_at_the_window() {
        let window = [[0.0, 2.0], [0.0, 1.0]];
        let cut = |from, to| clipped(from, to, &window);
        assert_eq!(cut([-1.0, 0.5], [3.0, 0.5]), Some([[0.0, 0.5], [2.0, 0.5]]));
        assert_eq!(cut([0.5, 0.5], [0.5, 9.5]), Some([[0.5, 0.5], [0.5, 1.0]]));
        assert_eq!(cut([-1.0, 2.0], [3.0, 2.0]), None);
        assert_eq!(cut([f64::NAN, 0.0], [1.0, 1.0]), None);
    }

    #[test]
    fn strokes_stand_on_the_side_with_fewer_unstable_roots() {
        let window = [[0.0, 100.0], [0.0, 100.0]];
        let curve = [[0.0, 50.0], [100.0, 50.0]];
        let below = |[_, y]: [f64; 2]| usize::from(y > 50.0);
        let strokes = hatched(&curve, &[1.0, 1.0], &window, &below);
        assert_eq!(strokes.len(), 9);
        assert!(strokes.iter().all(|[at, end]| at[1] == 50.0 && end[1] == 42.0));
        assert!(hatched(&curve, &[1.0, 1.0], &window, &|_| 0).is_empty());
    }
}
