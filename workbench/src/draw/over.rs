// SPDX-License-Identifier: GPL-2.0-or-later
//! Lines over the one axis that all plots of a page share, with limits and marks, and few enough
//! points for a page.
//!
//! Lines are dashed by an attribute: dashes drawn one by one take many times the size.

use crate::draw::lines::Line;
use crate::draw::plot::DrawError;
use crate::draw::sheet::{Chart, FONT, Frame, STYLES, axes, drawn, legend, padded, span};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Columns that a line is thinned to: a wide plot has as many pixels.
const COLUMNS: usize = 800;

/// The axis is this much longer than the data: the legend covers nothing.
const LEGEND_ROOM: f64 = 1.28;

/// Marks that are nearer than this share of the axis become one.
const ONE_MARK: f64 = 0.02;

/// Heights of labels, so that neighbours do not cover each other.
const LEVELS: usize = 3;

/// Most breaks that one label names.
const MOST_NAMED: usize = 3;

pub(super) const RED: RGBColor = RGBColor(180, 0, 0);

/// A place where a limit breaks.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// The line, behind the name of its file where that is not the program.
    pub place: String,
    /// What the line says.
    pub block: String,
    /// What breaks: a sentence.
    pub text: String,
    /// Where on the common axis; none where the program does not come there.
    pub at: Option<f64>,
    /// X Y Z A B C there, machine units and degrees.
    pub pose: [f64; 6],
}

/// What stands around the lines.
pub(super) struct Over<'a> {
    pub(super) x: &'a str,
    pub(super) end: f64,
    pub(super) y: &'a str,
    /// Horizontal lines.
    pub(super) limits: &'a [f64],
    pub(super) marks: &'a [Mark],
}

/// Lines in a plot, with the marks; a single limit bears their crosses.
pub(super) fn drawn_over(over: &Over, lines: &[Line]) -> Result<String, DrawError> {
    let end = if over.end > 0.0 { over.end } else { 1.0 };
    let values = lines.iter().flat_map(|l| l.points.iter().map(|p| p.1)).filter(|v| v.is_finite());
    let y = padded(values.chain(over.limits.iter().copied()));
    let flags = flags(over.marks, ONE_MARK * end);
    // Labels stand above the lines.
    let room = if flags.is_empty() { 0.0 } else { 0.2 * (y.end - y.start) };
    let frame = Frame { title: "", x: over.x, y: over.y, limits: vec![] };
    let svg = drawn(|root| {
        let range = y.start..y.end + room;
        let mut chart = axes(root, &frame, 0.0..end * LEGEND_ROOM, range)?;
        draw_limits(&mut chart, over.limits, end)?;
        for (line, style) in lines.iter().zip(STYLES.iter().cycle()) {
            draw_line(&mut chart, line, style.0)?;
        }
        draw_flags(&mut chart, &flags, [y.start, y.end, y.end + room], end)?;
        if let [limit] = over.limits {
            let cross = |flag: &Flag| Cross::new((flag.at, *limit), 7, RED.stroke_width(3));
            chart.draw_series(flags.iter().map(cross))?;
        }
        legend(&mut chart)
    })?;
    Ok(dashed(svg))
}

fn draw_limits(chart: &mut Chart, limits: &[f64], end: f64) -> Result<(), DrawError> {
    let style = BLACK.stroke_width(3);
    for (k, value) in limits.iter().enumerate() {
        let series = chart.draw_series(LineSeries::new([(0.0, *value), (end, *value)], style))?;
        if k == 0 {
            let name = if limits.len() > 1 { "limits" } else { "limit" };
            series.label(name).legend(move |(x, y)| PathElement::new([(x, y), (x + 34, y)], style));
        }
    }
    Ok(())
}

/// A line, with gaps where its values are not finite.
fn draw_line(chart: &mut Chart, line: &Line, colour: RGBColor) -> Result<(), DrawError> {
    let style = colour.stroke_width(2);
    let parts = line.points.split(|point| !point.1.is_finite()).filter(|part| !part.is_empty());
    for (k, part) in parts.enumerate() {
        let series = chart.draw_series(LineSeries::new(part.to_vec(), style))?;
        if k == 0 {
            series
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 34, y)], style));
        }
    }
    Ok(())
}

/// Marks at one place, with what is written beside them.
struct Flag {
    at: f64,
    label: String,
}

fn flags(marks: &[Mark], near: f64) -> Vec<Flag> {
    let mut places: Vec<(f64, usize)> =
        marks.iter().enumerate().filter_map(|(k, mark)| Some((mark.at?, k))).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let groups = places.chunk_by(|a, b| b.0 - a.0 < near);
    let flag = |group: &[(f64, usize)]| {
        let numbers: Vec<usize> = group.iter().map(|place| place.1).collect();
        Flag { at: group[0].0, label: label(marks, &numbers) }
    };
    groups.map(flag).collect()
}

/// Numbers of breaks as in the table, with their lines.
pub(super) fn label(marks: &[Mark], numbers: &[usize]) -> String {
    let mut numbers = numbers.to_vec();
    numbers.sort_unstable();
    let lines = numbers.chunk_by(|a, b| marks[*a].place == marks[*b].place);
    let words = lines.map(|group| {
        let names: Vec<String> =
            group.iter().take(MOST_NAMED).map(|k| (k + 1).to_string()).collect();
        let more = if group.len() > MOST_NAMED { " …" } else { "" };
        format!("{}{more}: {}", names.join(", "), marks[group[0]].place)
    });
    let words: Vec<String> = words.collect();
    let more = if words.len() > MOST_NAMED { "; …" } else { "" };
    words[..words.len().min(MOST_NAMED)].join("; ") + more
}

fn draw_flags(
    chart: &mut Chart,
    flags: &[Flag],
    [low, high, top]: [f64; 3],
    end: f64,
) -> Result<(), DrawError> {
    for (k, Flag { at, label }) in flags.iter().enumerate() {
        let level = top - (k % LEVELS) as f64 / LEVELS as f64 * (top - high);
        chart.draw_series([PathElement::new([(*at, low), (*at, level)], RED.stroke_width(1))])?;
        let (side, gap) = if *at > 0.6 * end { (HPos::Right, -6) } else { (HPos::Left, 6) };
        write(chart, (*at, level), label, Pos::new(side, VPos::Top), (gap, 2))?;
    }
    Ok(())
}

/// Writes a label of marks, shifted by pixels from its place.
pub(super) fn write(
    chart: &mut Chart,
    place: (f64, f64),
    label: &str,
    anchor: Pos,
    shift: (i32, i32),
) -> Result<(), DrawError> {
    let style = (FONT, 15).into_font().style(FontStyle::Bold).color(&RED).pos(anchor);
    let text = EmptyElement::at(place) + Text::new(label.to_string(), shift, style);
    chart.draw_series([text])?;
    Ok(())
}

/// Dashes of the lines in the styles of a sheet; the first of them is not dashed.
fn dashed(svg: String) -> String {
    STYLES.iter().skip(1).fold(svg, |svg, (RGBColor(r, g, b), (dash, gap))| {
        let stroke = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\" stroke-width=\"2\"");
        svg.replace(&stroke, &format!("{stroke} stroke-dasharray=\"{dash} {gap}\""))
    })
}

/// Few enough points; every column keeps the lowest and the highest value.
pub(super) fn envelope(values: &[(f64, [f64; 2])]) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = vec![];
    for column in columns(values) {
        let all = column.iter().flat_map(|(_, ends)| *ends).filter(|value| value.is_finite());
        let (low, high) = span(all);
        let at = column[0].0;
        // From the one that is nearer to the line so far.
        let last = points.last().map_or(low, |last| last.1);
        let ends = if (last - low).abs() > (last - high).abs() { [high, low] } else { [low, high] };
        points.push((at, ends[0]));
        if low < high {
            points.push((column[column.len() - 1].0, ends[1]));
        }
    }
    without_level_points(points)
}

/// Few enough points; every column keeps its highest value.
pub(super) fn highest(values: &[(f64, f64)]) -> Vec<(f64, f64)> {
    // Of equal ones the first.
    let higher = |a: (f64, f64), b: (f64, f64)| if b.1 > a.1 { b } else { a };
    let highest = |column: &[(f64, f64)]| column.iter().copied().reduce(higher).unwrap_or_default();
    without_level_points(columns(values).map(highest).collect())
}

/// As [`highest`], of the lowest values.
pub(super) fn lowest(values: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let turned: Vec<(f64, f64)> = values.iter().map(|(at, value)| (*at, -value)).collect();
    highest(&turned).into_iter().map(|(at, value)| (at, -value)).collect()
}

fn columns<T>(values: &[T]) -> std::slice::Chunks<'_, T> {
    values.chunks(values.len().div_ceil(COLUMNS).max(1))
}

/// A level stretch needs its two ends only.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(line: u32, at: f64) -> Mark {
        Mark {
            place: format!("line {line}"),
            block: String::new(),
            text: String::new(),
            at: Some(at),
            pose: [0.0; 6],
        }
    }

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
    fn marks_at_one_place_share_a_label() {
        let marks = [mark(4, 1.0), mark(9, 50.0), mark(4, 1.001), mark(5, 1.002)];
        let flags = flags(&marks, 0.1);
        let labels: Vec<&str> = flags.iter().map(|flag| flag.label.as_str()).collect();
        assert_eq!(labels, ["1, 3: line 4; 4: line 5", "2: line 9"]);
    }

    #[test]
    fn every_line_but_the_first_is_dashed_in_plot_and_legend() {
        let line = |k: usize| Line {
            name: format!("line {k}"),
            points: vec![(0.0, k as f64), (1.0, k as f64 + 1.0)],
        };
        let over = Over { x: "", end: 1.0, y: "", limits: &[0.0], marks: &[mark(3, 0.5)] };
        let svg = drawn_over(&over, &[line(0), line(1), line(2)]).unwrap();
        assert_eq!(svg.matches("stroke-dasharray=\"12 5\"").count(), 2);
        assert_eq!(svg.matches("stroke-dasharray").count(), 4);
    }
}
