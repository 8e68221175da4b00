// SPDX-License-Identifier: GPL-2.0-or-later
//! Style of the pictures: colors, dashes, fonts.
//!
//! The colors are those of Okabe and Ito (Color Universal Design, 2008), which are distinguishable for color-blind
//! readers, without the yellow that is weak on paper; maps use viridis. Lines also differ in dashes,
//! and shades in brightness, so that a monochrome print contains the same information.

use kinematics::MAX_LEGS;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

pub(super) const FONT: &str = "sans-serif";
/// Font sizes of titles, of names, of ticks and keys.
pub(super) const TITLE: i32 = 20;
pub(super) const NAME: i32 = 16;
pub(super) const SMALL: i32 = 14;

pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const VERMILLION: RGBColor = RGBColor(213, 94, 0);
pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(super) const PURPLE: RGBColor = RGBColor(204, 121, 167);
pub(super) const ORANGE: RGBColor = RGBColor(230, 159, 0);
pub(super) const SKY: RGBColor = RGBColor(86, 180, 233);
pub(super) const GRAY: RGBColor = RGBColor(110, 110, 110);
pub(super) const PALE: RGBColor = RGBColor(205, 205, 205);
/// Color of limit violations: darker than all others.
pub(super) const RED: RGBColor = RGBColor(180, 0, 0);

/// Colors and (dash, gap) in pixels of lines in one plot; the first is not dashed. Wide black lines are
/// reserved for limits.
pub(super) const STYLES: [(RGBColor, (u32, u32)); MAX_LEGS] = [
    (BLUE, (1, 0)),
    (VERMILLION, (12, 4)),
    (GREEN, (3, 4)),
    (PURPLE, (24, 5)),
    (ORANGE, (7, 6)),
    (GRAY, (16, 12)),
    (SKY, (5, 2)),
    (RGBColor(60, 60, 60), (2, 8)),
];

/// Width of lines that [`dashed`] dashes.
const DASHED: u32 = 2;

const LIMIT: u32 = 3;

pub(super) fn line_style(number: usize) -> ShapeStyle {
    STYLES[number % STYLES.len()].0.stroke_width(DASHED)
}

/// Returns the color of an area that belongs to a line's number: lighter.
pub(super) fn area_color(number: usize) -> RGBColor {
    let RGBColor(r, g, b) = STYLES[number % STYLES.len()].0;
    let light = |part: u8| part + (255 - part) / 5 * 2;
    RGBColor(light(r), light(g), light(b))
}

pub(super) fn limit_style() -> ShapeStyle {
    BLACK.stroke_width(LIMIT)
}

/// Dashes lines by an attribute: separate line elements per dash would multiply the size.
pub(super) fn dashed(svg: String) -> String {
    STYLES.iter().skip(1).fold(svg, |svg, (RGBColor(r, g, b), (dash, gap))| {
        let stroke = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\" stroke-width=\"{DASHED}\"");
        svg.replace(&stroke, &format!("{stroke} stroke-dasharray=\"{dash} {gap}\""))
    })
}

pub(super) fn letters(size: i32) -> TextStyle<'static> {
    (FONT, size).into_font().color(&BLACK)
}

/// Returns a font of a size, aligned relative to a position.
pub(super) fn letters_at(size: i32, across: HPos, up: VPos) -> TextStyle<'static> {
    letters(size).pos(Pos::new(across, up))
}

/// Returns the font of marks: pages put a white border around bold text, so that it is legible on lines.
pub(super) fn mark_letters(across: HPos, up: VPos) -> TextStyle<'static> {
    let font = (FONT, SMALL).into_font().style(FontStyle::Bold);
    font.color(&RED).pos(Pos::new(across, up))
}

/// Returns the largest width of a text: letters of common fonts are narrower than this share of their size.
pub(super) fn width_of(text: &str, size: i32) -> u32 {
    (0.56 * f64::from(size) * text.chars().count() as f64).ceil() as u32
}

/// Returns viridis, half white, at a share of 0 to 1: black letters and lines are legible on all of it.
pub(super) fn shade(share: f64) -> RGBColor {
    let of_ten = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let low = (of_ten as usize).min(VIRIDIS.len() - 2);
    let mix = |k: usize| {
        let (from, to) = (VIRIDIS[low][k], VIRIDIS[low + 1][k]);
        (255.0 + from + (to - from) * (of_ten - low as f64)) / 2.0
    };
    RGBColor(mix(0) as u8, mix(1) as u8, mix(2) as u8)
}

/// Red, green and blue at nine evenly spaced points of viridis (Smith and van der Walt, 2015).
const VIRIDIS: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 44.0, 122.0],
    [59.0, 81.0, 139.0],
    [44.0, 113.0, 142.0],
    [33.0, 144.0, 141.0],
    [39.0, 173.0, 129.0],
    [92.0, 200.0, 99.0],
    [170.0, 220.0, 50.0],
    [253.0, 231.0, 37.0],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the relative luminance, as in monochrome prints (ITU-R BT.709).
    fn brightness(RGBColor(r, g, b): RGBColor) -> f64 {
        (0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)) / 255.0
    }

    #[test]
    fn a_map_printed_in_black_is_brighter_where_its_value_is_higher() {
        let steps: Vec<f64> = (0..=40).map(|k| brightness(shade(f64::from(k) / 40.0))).collect();
        // A step of an eight-bit color.
        assert!(steps.is_sorted_by(|a, b| b - a > -1.0 / 255.0), "{steps:?}");
        assert!(steps[0] > 0.5, "black is read on its darkest shade");
    }

    #[test]
    fn no_two_lines_have_the_same_dashes_or_the_same_color() {
        for (k, (color, dashes)) in STYLES.iter().enumerate() {
            assert!(STYLES[..k].iter().all(|(c, d)| c != color && d != dashes), "{k}");
        }
    }
}
