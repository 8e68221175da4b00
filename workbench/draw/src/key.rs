// SPDX-License-Identifier: GPL-2.0-or-later
//! The key of a picture, placed where it covers nothing.

use crate::arrows::{WIDTH, along_sight, arrow};
use crate::plot::DrawError;
use crate::sheet::{Area, CAPTION, MARGIN, SIZE, drawn_on};
use crate::style::{GRAY, NAME, SMALL, letters_at, limit_style, line_style, width_of};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

const SIGN: u32 = 32;

/// Distance between lines of a key, pixels.
const STEP: i32 = 22;

/// Symbol of a key.
#[derive(Clone)]
pub(super) enum Sign {
    Line(ShapeStyle),
    Area(RGBColor),
    Dot,
    Cross,
    Letter(String),
    Ball(RGBColor),
    Arrow(RGBColor),
    /// An arrow along the viewing direction: towards the viewer (true), or away.
    Sight(bool),
}

/// A line of a key: the symbol and its meaning.
pub(super) struct Key {
    pub(super) sign: Sign,
    pub(super) name: String,
}

impl Key {
    pub(super) fn new(sign: Sign, name: &str) -> Self {
        Self { sign, name: name.into() }
    }

    pub(super) fn line(number: usize, name: &str) -> Self {
        Self::new(Sign::Line(line_style(number)), name)
    }

    /// Returns the width in pixels.
    pub(super) fn width(&self) -> u32 {
        SIGN + 10 + width_of(&self.name, SMALL)
    }

    /// Draws the line with the middle of its left end at a position.
    pub(super) fn draw(&self, area: &Area, (x, y): (i32, i32)) -> Result<(), DrawError> {
        let end = x + SIGN as i32;
        let middle = (x + end) / 2;
        match &self.sign {
            Sign::Line(style) => area.draw(&PathElement::new([(x, y), (end, y)], *style))?,
            Sign::Area(color) => {
                let corners = [(x, y - 6), (end, y + 6)];
                area.draw(&Rectangle::new(corners, color.filled()))?;
                area.draw(&Rectangle::new(corners, GRAY.stroke_width(1)))?;
            }
            Sign::Dot => area.draw(&Circle::new((middle, y), 4, BLACK.filled()))?,
            Sign::Ball(color) => area.draw(&Circle::new((middle, y), 5, color.filled()))?,
            Sign::Arrow(color) => arrow(area, (x, y), (end, y), *color, WIDTH)?,
            Sign::Sight(is_towards) => along_sight(area, (middle, y), *is_towards, GRAY)?,
            Sign::Cross => area.draw(&Cross::new((middle, y), 6, limit_style()))?,
            Sign::Letter(letter) => {
                let style = letters_at(NAME, HPos::Center, VPos::Center);
                area.draw(&Text::new(letter.clone(), (middle, y), style))?;
            }
        }
        let style = letters_at(SMALL, HPos::Left, VPos::Center);
        area.draw(&Text::new(self.name.clone(), (end + 8, y), style))?;
        Ok(())
    }
}

/// Draws a sheet with its key in a separate column.
pub(super) fn keyed(
    keys: &[Key],
    draw: impl FnOnce(&Area) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    keyed_on(SIZE, keys, draw)
}

/// Draws a sheet of a size in pixels, as [`keyed`].
pub(super) fn keyed_on(
    size: (u32, u32),
    keys: &[Key],
    draw: impl FnOnce(&Area) -> Result<(), DrawError>,
) -> Result<String, DrawError> {
    drawn_on(size, |root| {
        let Some(widest) = keys.iter().map(Key::width).max() else { return draw(root) };
        let (plot, column) = root.split_horizontally(size.0 - widest - MARGIN);
        draw(&plot)?;
        draw_keys(&column, keys, (CAPTION + 2 * MARGIN) as i32)
    })
}

/// Draws keys below each other, the first at a height.
pub(super) fn draw_keys(area: &Area, keys: &[Key], top: i32) -> Result<(), DrawError> {
    let places = (0..).map(|k| (0, top + k * STEP));
    keys.iter().zip(places).try_for_each(|(key, place)| key.draw(area, place))
}

/// Draws keys next to each other, the first at a position.
pub(super) fn draw_keys_across(
    area: &Area,
    keys: &[Key],
    (mut x, y): (i32, i32),
) -> Result<(), DrawError> {
    for key in keys {
        key.draw(area, (x, y))?;
        x += key.width() as i32 + 28;
    }
    Ok(())
}
