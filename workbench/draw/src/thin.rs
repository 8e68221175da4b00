// SPDX-License-Identifier: GPL-2.0-or-later
//! Reduction of a line to the points that are visible on a sheet; peaks are kept.

use crate::sheet::{SIZE, padded, span};

/// Number of columns to which a line is reduced: the width of a strip in pixels.
const COLUMNS: usize = 680;

/// Reduces a band to few points; every column keeps the lowest and the highest value.
pub(super) fn envelope(values: &[(f64, [f64; 2])]) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = vec![];
    for column in columns(values) {
        let all = column.iter().flat_map(|(_, ends)| *ends).filter(|value| value.is_finite());
        let (low, high) = span(all);
        let at = column[0].0;
        // Starts with the value nearer to the line so far.
        let last = points.last().map_or(low, |last| last.1);
        let ends = if (last - low).abs() > (last - high).abs() { [high, low] } else { [low, high] };
        points.push((at, ends[0]));
        if low < high {
            points.push((column[column.len() - 1].0, ends[1]));
        }
    }
    without_level_points(points)
}

/// Reduces a line to few points; every column keeps its highest value.
pub(super) fn highest(values: &[(f64, f64)]) -> Vec<(f64, f64)> {
    // Keeps the first of equal values.
    let higher = |a: (f64, f64), b: (f64, f64)| if b.1 > a.1 { b } else { a };
    let highest = |column: &[(f64, f64)]| column.iter().copied().reduce(higher).unwrap_or_default();
    without_level_points(columns(values).map(highest).collect())
}

/// Reduces a line to few points; every column keeps its lowest value.
pub(super) fn lowest(values: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let turned: Vec<(f64, f64)> = values.iter().map(|(at, value)| (*at, -value)).collect();
    highest(&turned).into_iter().map(|(at, value)| (at, -value)).collect()
}

fn columns<T>(values: &[T]) -> std::slice::Chunks<'_, T> {
    values.chunks(values.len().div_ceil(COLUMNS).max(1))
}

/// Removes points inside constant stretches.
fn without_level_points(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = vec![];
    for point in points {
        if let [.., a, b] = kept[..]
            && a.1 == b.1
            && b.1 == point.1
        {
            kept.pop();
        }
        kept.push(point);
    }
    kept
}

/// Reduces a line to few points, as [`envelope`]; values that are not finite are omitted.
pub(super) fn thin(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<_> =
        points.filter(|p| p.1.is_finite()).map(|(at, value)| (at, [value; 2])).collect();
    envelope(&points)
}

/// Reduces a line, as [`lowest`]; values that are not finite are omitted.
pub(super) fn thin_low(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    lowest(&points.filter(|point| point.1.is_finite()).collect::<Vec<_>>())
}

/// Returns the indices of points at least `pixels` apart, and of the last point.
pub(super) fn places_apart(points: &[(f64, f64)], pixels: f64) -> Vec<usize> {
    let (x, y) = (padded(points.iter().map(|p| p.0)), padded(points.iter().map(|p| p.1)));
    let least = pixels * (x.end - x.start).max(y.end - y.start) / f64::from(SIZE.0);
    let mut kept: Vec<usize> = vec![];
    for (place, point) in points.iter().enumerate() {
        let is_apart =
            |last: &usize| (point.0 - points[*last].0).hypot(point.1 - points[*last].1) > least;
        if kept.last().is_none_or(is_apart) {
            kept.push(place);
        }
    }
    kept.extend(points.len().checked_sub(1).filter(|last| kept.last() != Some(last)));
    kept
}

/// Largest distance of an omitted point from the drawn line, pixels: sheets have whole pixels, and many points
/// on a gentle slope would form stairs.
const BESIDE: f64 = 0.6;

/// Returns the indices of the points, in pixels, that a line needs: all others are within [`BESIDE`] of it (Ramer,
/// Douglas and Peucker).
pub(super) fn bends(points: &[(f64, f64)]) -> Vec<usize> {
    let mut is_kept = vec![false; points.len()];
    let mut spans = vec![(0, points.len().saturating_sub(1))];
    while let Some((from, to)) = spans.pop() {
        for kept in [from, to] {
            if let Some(kept) = is_kept.get_mut(kept) {
                *kept = true;
            }
        }
        let between = (from + 1..to).map(|k| (distance(points[k], points[from], points[to]), k));
        if let Some((off, bend)) = between.max_by(|a, b| a.0.total_cmp(&b.0))
            && off > BESIDE
        {
            spans.extend([(from, bend), (bend, to)]);
        }
    }
    (0..points.len()).filter(|k| is_kept[*k]).collect()
}

/// Returns the distance of a point from the segment between two others.
fn distance(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (line, own) = ((to.0 - from.0, to.1 - from.1), (point.0 - from.0, point.1 - from.1));
    let square = line.0 * line.0 + line.1 * line.1;
    let share = if square > 0.0 { (own.0 * line.0 + own.1 * line.1) / square } else { 0.0 };
    let share = share.clamp(0.0, 1.0);
    (own.0 - share * line.0).hypot(own.1 - share * line.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thin_line_keeps_its_lowest_and_its_highest_value() {
        let value = |k: u32| match k {
            77_777 => 9.0,
            88_888 => -7.0,
            _ => f64::from(k).sin(),
        };
        let values: Vec<(f64, f64)> = (0..100_000).map(|k| (f64::from(k), value(k))).collect();
        let both: Vec<_> = values.iter().map(|(at, value)| (*at, [*value; 2])).collect();
        let line = envelope(&both);
        assert!(line.len() <= 2 * COLUMNS);
        assert_eq!(span(line.iter().map(|p| p.1)), (-7.0, 9.0));
        assert!(line.is_sorted_by(|a, b| a.0 <= b.0));
        assert!(highest(&values).contains(&(77_777.0, 9.0)));
        assert!(lowest(&values).contains(&(88_888.0, -7.0)));
    }

    #[test]
    fn a_level_line_has_two_points() {
        let values: Vec<_> = (0..5000).map(|k| (f64::from(k), 3.0)).collect();
        let line = highest(&values);
        assert!(line.len() == 2 && line[0].0 == 0.0 && line[1].0 > 4990.0, "{line:?}");
    }

    #[test]
    fn thinning_keeps_peaks() {
        let spike = |k: u32| (f64::from(k), if k == 7777 { -5.0 } else { 1.0 });
        let points = thin((0..10_000).map(spike));
        assert!(points.len() <= 2 * COLUMNS, "{}", points.len());
        // In its column.
        let near = |p: &(f64, f64)| p.1 == -5.0 && (p.0 - 7777.0).abs() < 1e4 / COLUMNS as f64;
        assert!(points.iter().any(near));
    }

    #[test]
    fn a_line_needs_its_bends_alone() {
        let corner = |k: u32| (f64::from(k), if k < 70 { 3.0 } else { f64::from(k) - 67.0 });
        let points: Vec<_> = (0..=100).map(corner).collect();
        assert_eq!(bends(&points), [0, 70, 100]);
        // A closed line, and no points.
        let square = [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0), (0.0, 0.0)];
        assert_eq!(bends(&square), [0, 1, 2, 3, 4]);
        assert!(bends(&[]).is_empty());
    }

    #[test]
    fn a_path_keeps_its_bends_and_loses_what_a_pixel_hides() {
        let circle = |k: u32| (f64::from(k) * 1e-5 * std::f64::consts::TAU).sin_cos();
        let points: Vec<_> = (0..=50_000).map(circle).collect();
        let kept = places_apart(&points, 1.0);
        assert!((500..2000).contains(&kept.len()), "{}", kept.len());
        assert_eq!(kept.last(), Some(&50_000));
    }
}
