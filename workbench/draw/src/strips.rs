// SPDX-License-Identifier: GPL-2.0-or-later
//! One strip per joint, coordinate or limit, stacked over a common axis: lines that
//! would cross in one plot are separate, and comparable at every position.
//!
//! All strips have the same scale if that shows each of them; otherwise scales differ, and the axis name says so.

use crate::key::{Key, Sign, draw_keys_across};
use crate::lines::{Line, draw_line};
use crate::over::{Flag, LABELS, Mark, flags, write_flags};
use crate::plot::DrawError;
use crate::sheet::{Area, Chart, SIZE, drawn_on, padded, span, tick};
use crate::style::{FONT, NAME, RED, SMALL, STYLES, TITLE, letters_at, limit_style, width_of};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use std::ops::Range;

/// Pixels to the left of the strips, for the name of their axis and its ticks.
const LEFT: u32 = 96;
/// Pixels to their right, for their names.
const RIGHT: u32 = 190;
/// Pixels between two strips, which the ticks of both need.
const GAP: u32 = 16;
/// Pixels for the title, the key, and the ticks and name of the common axis.
const HEAD: u32 = 40;
const KEYS: u32 = 26;
const FOOT: u32 = 48;

/// Smallest shares of a strip's height that a common scale must give: to the tallest strip, and to each
/// strip that is not constant.
const LEAST_SHARE: [f64; 2] = [0.3, 0.05];

/// Most points drawn as dots: more would look like a line.
const DOTS: usize = 40;

/// Distance below which marks are merged, as a share of the axis.
const ONE_MARK: f64 = 0.02;

/// The lines and limits of one strip.
pub(super) struct Strip {
    pub(super) name: String,
    pub(super) lines: Vec<Line>,
    pub(super) limits: Vec<f64>,
    /// Range drawn: values beyond are drawn at its ends, because a single jump would hide all others. The label next to
    /// the strip has the true values.
    pub(super) shown: [f64; 2],
}

impl Strip {
    pub(super) fn new(name: &str, lines: Vec<Line>, limits: Vec<f64>) -> Self {
        Self { name: name.into(), lines, limits, shown: [f64::NEG_INFINITY, f64::INFINITY] }
    }

    /// Creates a strip of one line, with the line's name.
    pub(super) fn of(line: Line, limits: Vec<f64>) -> Self {
        Self::new(&line.name.clone(), vec![line], limits)
    }

    fn all(&self) -> impl Iterator<Item = f64> {
        self.lines.iter().flat_map(|l| l.points.iter().map(|p| p.1)).filter(|v| !v.is_nan())
    }

    fn values(&self) -> impl Iterator<Item = f64> {
        self.all().map(|value| self.drawn_at(value)).filter(|value| value.is_finite())
    }

    fn drawn_at(&self, value: f64) -> f64 {
        value.clamp(self.shown[0], self.shown[1])
    }

    /// Returns the limits that are drawn: all, or those no farther from the lines than the lines' extent.
    fn drawn(&self, all: bool) -> Vec<f64> {
        let (low, high) = span(self.values());
        let reach = low - (high - low)..=high + (high - low);
        self.limits.iter().copied().filter(|limit| all || reach.contains(limit)).collect()
    }

    /// Returns the range of values and limits.
    fn range(&self, all: bool) -> Range<f64> {
        padded(self.values().chain(self.drawn(all)))
    }
}

/// Common properties of all strips of a sheet.
pub(super) struct Strips<'a> {
    pub(super) title: &'a str,
    pub(super) x: &'a str,
    pub(super) y: &'a str,
    /// End of the common axis, which begins at 0.
    pub(super) end: f64,
    /// Whether limits far from the lines are drawn too.
    pub(super) all_limits: bool,
    pub(super) marks: &'a [Mark],
    /// Whether each point is drawn: values between the points are meaningless.
    pub(super) dots: bool,
}

impl<'a> Strips<'a> {
    /// Creates a sheet without marks, up to the end of the lines, with only the limits near them.
    pub(super) fn new(title: &'a str, x: &'a str, y: &'a str, strips: &[Strip]) -> Self {
        let lines = strips.iter().flat_map(|strip| &strip.lines);
        let end = lines.filter_map(|line| line.points.last()).map(|p| p.0).fold(0.0, f64::max);
        Self { title, x, y, end, all_limits: false, marks: &[], dots: false }
    }
}

/// Draws one strip per line.
pub(super) fn drawn_apart(
    title: &str,
    x: &str,
    y: &str,
    lines: Vec<Line>,
) -> Result<String, DrawError> {
    let strips: Vec<Strip> = lines.into_iter().map(|line| Strip::of(line, vec![])).collect();
    drawn_strips(&Strips::new(title, x, y, &strips), &strips)
}

pub(super) fn drawn_strips(sheet: &Strips, strips: &[Strip]) -> Result<String, DrawError> {
    let end = if sheet.end > 0.0 { sheet.end } else { 1.0 };
    let flags = flags(sheet.marks, ONE_MARK * end);
    let keys = keys(sheet, strips);
    let title = if sheet.title.is_empty() { 12 } else { HEAD };
    let labels = if flags.is_empty() { 0 } else { LABELS };
    let head = title + if keys.is_empty() { 0 } else { KEYS } + labels;
    let height = height(strips.len());
    let size = (SIZE.0, head + strips.len() as u32 * (height + GAP) - GAP + FOOT);
    drawn_on(size, |root| {
        if !sheet.title.is_empty() {
            let style = letters_at(TITLE, HPos::Center, VPos::Top);
            root.draw(&Text::new(sheet.title.to_string(), (size.0 as i32 / 2, 12), style))?;
        }
        draw_keys_across(root, &keys, (LEFT as i32, (title + KEYS / 2) as i32))?;
        let across = |at: f64| {
            let wide = f64::from(size.0 - LEFT - RIGHT);
            LEFT as i32 + (at / end * wide).round() as i32
        };
        let places: Vec<(i32, &Flag)> = flags.iter().map(|flag| (across(flag.at), flag)).collect();
        write_flags(root, &places, head as i32, (size.0 - 8) as i32)?;
        let (ranges, is_common) = ranges(sheet, strips);
        let what = if is_common { "" } else { ", scales differ" };
        let middle = head as i32 + (size.1 - head - FOOT) as i32 / 2;
        let style =
            letters_at(NAME, HPos::Center, VPos::Center).transform(FontTransform::Rotate270);
        root.draw(&Text::new(format!("{}{what}", sheet.y), (14, middle), style))?;
        for (k, (strip, range)) in strips.iter().zip(ranges).enumerate() {
            let top = (head + k as u32 * (height + GAP)) as i32;
            let is_last = k + 1 == strips.len();
            let bottom = top + (height + if is_last { FOOT } else { GAP }) as i32;
            let area = root.clone().shrink((0, top), (size.0, (bottom - top) as u32));
            let mut chart = strip_axes(&area, sheet, end, range, is_last)?;
            draw_strip(&mut chart, strip, sheet, end)?;
            let lines = flags.iter().map(|flag| mark_line(&chart, flag.at));
            let lines: Vec<_> = lines.collect();
            chart.draw_series(lines)?;
            describe(&area, strip, height as i32)?;
        }
        Ok(())
    })
}

/// Returns the height of a strip in pixels: with few strips they are taller.
fn height(strips: usize) -> u32 {
    (560 / strips.max(1) as u32).clamp(92, 400)
}

fn keys(sheet: &Strips, strips: &[Strip]) -> Vec<Key> {
    let mut keys = vec![];
    let drawn: Vec<f64> = strips.iter().flat_map(|strip| strip.drawn(sheet.all_limits)).collect();
    if !drawn.is_empty() {
        let is_one = drawn.iter().all(|limit| *limit == drawn[0]);
        keys.push(Key::new(Sign::Line(limit_style()), if is_one { "limit" } else { "limits" }));
    }
    // A single line is named next to its strip.
    if let Some(most) =
        strips.iter().max_by_key(|strip| strip.lines.len()).filter(|s| s.lines.len() > 1)
    {
        keys.extend(most.lines.iter().enumerate().map(|(k, line)| Key::line(k, &line.name)));
    }
    keys
}

fn ranges(sheet: &Strips, strips: &[Strip]) -> (Vec<Range<f64>>, bool) {
    let own: Vec<Range<f64>> = strips.iter().map(|strip| strip.range(sheet.all_limits)).collect();
    let (low, high) = span(own.iter().flat_map(|range| [range.start, range.end]));
    // Constant lines do not count: their height is 0.
    let heights: Vec<f64> = strips
        .iter()
        .map(|strip| span(strip.values().chain(strip.drawn(sheet.all_limits))))
        .map(|(low, high)| high - low)
        .filter(|height| *height > 1e-9 * (high - low))
        .collect();
    let (least, most) = span(heights.into_iter());
    let shows = most >= LEAST_SHARE[0] * (high - low) && least >= LEAST_SHARE[1] * (high - low);
    match shows || strips.len() == 1 {
        true => (vec![low..high; strips.len()], true),
        false => (own, false),
    }
}

fn strip_axes<'a, 'b>(
    area: &'a Area<'b>,
    sheet: &Strips,
    end: f64,
    y: Range<f64>,
    is_last: bool,
) -> Result<Chart<'a, 'b>, DrawError> {
    let mut chart = ChartBuilder::on(area)
        .margin_left(20)
        .margin_right(RIGHT)
        .margin_bottom(if is_last { 0 } else { GAP })
        .x_label_area_size(if is_last { FOOT } else { 0 })
        .y_label_area_size(LEFT - 20)
        .build_cartesian_2d(0.0..end, y)?;
    let (_, height) = chart.plotting_area().dim_in_pixel();
    let mut mesh = chart.configure_mesh();
    mesh.y_labels((height / 18).clamp(5, 12) as usize)
        .label_style((FONT, SMALL))
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .axis_desc_style((FONT, NAME))
        .light_line_style(WHITE);
    if is_last {
        mesh.x_desc(sheet.x);
    }
    mesh.draw()?;
    Ok(chart)
}

fn draw_strip(chart: &mut Chart, strip: &Strip, sheet: &Strips, end: f64) -> Result<(), DrawError> {
    let limits = strip.drawn(sheet.all_limits);
    let lines = limits.iter().map(|limit| [(0.0, *limit), (end, *limit)]);
    chart.draw_series(lines.map(|ends| PathElement::new(ends, limit_style())))?;
    for (k, line) in strip.lines.iter().enumerate() {
        let points = line.points.iter().map(|(at, value)| (*at, strip.drawn_at(*value))).collect();
        let line = Line { name: String::new(), points };
        draw_line(chart, &line, k)?;
        if sheet.dots && line.points.len() <= DOTS {
            let points = line.points.iter().filter(|point| point.1.is_finite());
            chart.draw_series(points.map(|at| Circle::new(*at, 3, STYLES[k].0.filled())))?;
        }
    }
    Ok(())
}

fn mark_line(chart: &Chart, at: f64) -> PathElement<(f64, f64)> {
    let y = chart.y_range();
    PathElement::new([(at, y.start), (at, y.end)], RED.stroke_width(1))
}

/// Writes name and range of a strip, to its right.
fn describe(area: &Area, strip: &Strip, height: i32) -> Result<(), DrawError> {
    let x = (SIZE.0 - RIGHT + 14) as i32;
    let (low, high) = span(strip.all());
    let mut words = vec![];
    let range = |low: f64, high: f64| match rounded(low, high) {
        [low, high] if low == high => low,
        [low, high] => format!("{low} to {high}"),
    };
    if low <= high {
        words.push(range(low, high));
    }
    let (least, most) = span(strip.limits.iter().copied());
    if least < most {
        words.push(format!("limits {}", range(least, most)));
    } else if least == most {
        words.push(format!("limit {}", tick(&least)));
    }
    let top = (height - 20 * (words.len() as i32 + 1)) / 2 + 10;
    let name = wrapped(&strip.name);
    let style = letters_at(NAME, HPos::Left, VPos::Center);
    area.draw(&Text::new(name, (x, top), style))?;
    for (k, text) in words.into_iter().enumerate() {
        let style = letters_at(SMALL, HPos::Left, VPos::Center);
        area.draw(&Text::new(text, (x, top + 20 * (k as i32 + 1)), style))?;
    }
    Ok(())
}

/// Wraps a name to the width of its column.
fn wrapped(name: &str) -> String {
    let room = RIGHT - 16;
    if width_of(name, NAME) <= room {
        return name.to_string();
    }
    let most = (f64::from(room) / (0.56 * f64::from(NAME))) as usize;
    name.chars().take(most.saturating_sub(1)).chain(['…']).collect()
}

/// Formats two values with enough digits to distinguish them.
fn rounded(low: f64, high: f64) -> [String; 2] {
    if low == f64::NEG_INFINITY && high.is_finite() {
        return ["-∞".into(), rounded(high, high)[1].clone()];
    }
    let size = low.abs().max(high.abs()).max(f64::MIN_POSITIVE);
    let least = (high - low).max(1e-4 * size);
    let digits = (2.0 - least.log10().floor()).clamp(0.0, 9.0) as usize;
    [low, high].map(|value| {
        let text = format!("{value:.digits$}");
        let text = if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.')
        } else {
            &text
        };
        if text == "-0" { "0".into() } else { text.into() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strip(name: &str, low: f64, high: f64, limits: &[f64]) -> Strip {
        let points = vec![(0.0, low), (1.0, high)];
        Strip::of(Line { name: name.into(), points }, limits.to_vec())
    }

    fn sheet(all_limits: bool) -> Strips<'static> {
        Strips {
            title: "Legs",
            x: "time in s",
            y: "mm",
            end: 1.0,
            all_limits,
            marks: &[],
            dots: false,
        }
    }

    #[test]
    fn strips_share_a_scale_where_it_shows_each_of_them() {
        let near = [strip("a", 0.0, 10.0, &[]), strip("b", 5.0, 12.0, &[])];
        assert!(ranges(&sheet(false), &near).1);
        let far = [strip("a", 0.0, 10.0, &[]), strip("b", 500.0, 512.0, &[])];
        let (ranges, is_common) = ranges(&sheet(false), &far);
        assert!(!is_common && ranges[1].start > 400.0);
        let svg = drawn_strips(&sheet(false), &far).unwrap();
        assert!(svg.contains("mm, scales differ"), "{svg}");
    }

    #[test]
    fn limits_far_from_the_lines_are_named_and_not_drawn() {
        let far = [strip("a", 10.0, 14.0, &[5.9, 17.9])];
        assert_eq!(far[0].drawn(false), [17.9]);
        assert_eq!(far[0].drawn(true), [5.9, 17.9]);
        let limit = |svg: &str| svg.matches("stroke=\"#000000\" stroke-width=\"3\"").count();
        // One in the strip and one in the key.
        let svg = drawn_strips(&sheet(false), &far).unwrap();
        assert!(limit(&svg) == 2 && svg.contains("limits 5.9 to 17.9"), "{svg}");
    }

    #[test]
    fn a_leap_is_named_and_hides_nothing() {
        let leap = Strip { shown: [-0.3, 1.0], ..strip("a", 0.5, -40.0, &[0.0]) };
        assert_eq!(leap.values().collect::<Vec<_>>(), [0.5, -0.3]);
        let svg = drawn_strips(&sheet(true), &[leap]).unwrap();
        assert!(svg.contains("-40 to 0.5") && !svg.contains("\n-40\n"), "{svg}");
    }

    #[test]
    fn values_are_written_with_the_digits_that_tell_them_apart() {
        assert_eq!(rounded(930.3001, 1069.778), ["930", "1070"]);
        assert_eq!(rounded(0.00261, 0.00266), ["0.00261", "0.00266"]);
        assert_eq!(rounded(-0.0001, 12.0), ["0", "12"]);
        assert_eq!(rounded(72.0, 72.0), ["72", "72"]);
        assert_eq!(rounded(f64::NEG_INFINITY, 0.25), ["-∞", "0.25"]);
    }
}
