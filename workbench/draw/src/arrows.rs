// SPDX-License-Identifier: GPL-2.0-or-later
//! Arrows in the plane of the drawing, and symbols for arrows perpendicular to it.

use crate::plot::DrawError;
use crate::sheet::Area;
use plotters::prelude::*;

/// Width of an arrow's line.
pub(super) const WIDTH: u32 = 3;

/// Length of an arrow's head and half its width, in widths of the arrow.
const HEAD: [f64; 2] = [3.6, 1.5];

pub(super) const SIGN: i32 = 8;

/// Draws an arrow from one pixel to another.
pub(super) fn arrow(
    area: &Area,
    from: (i32, i32),
    to: (i32, i32),
    color: RGBColor,
    width: u32,
) -> Result<(), DrawError> {
    let [head, side] = HEAD.map(|share| share * f64::from(width));
    let (x, y) = (f64::from(to.0 - from.0), f64::from(to.1 - from.1));
    let length = x.hypot(y).max(1.0);
    let back = |along: f64, aside: f64| {
        let (x, y) = (x / length, y / length);
        let place = (-x * along - y * aside, -y * along + x * aside);
        (to.0 + place.0.round() as i32, to.1 + place.1.round() as i32)
    };
    // The line ends inside the head, which at its tip is as narrow as the line.
    let line = [from, back(0.7 * head, 0.0)];
    area.draw(&PathElement::new(line, color.stroke_width(width)))?;
    let head = vec![to, back(head, side), back(head, -side)];
    area.draw(&Polygon::new(head, color.filled()))?;
    Ok(())
}

/// Draws the symbol of an arrow towards the viewer (its tip) or away (its feathers).
pub(super) fn along_sight(
    area: &Area,
    at: (i32, i32),
    is_towards: bool,
    color: RGBColor,
) -> Result<(), DrawError> {
    area.draw(&Circle::new(at, SIGN, WHITE.filled()))?;
    area.draw(&Circle::new(at, SIGN, color.stroke_width(WIDTH)))?;
    match is_towards {
        true => area.draw(&Circle::new(at, 3, color.filled()))?,
        false => area.draw(&Cross::new(at, 4, color.stroke_width(WIDTH)))?,
    }
    Ok(())
}
