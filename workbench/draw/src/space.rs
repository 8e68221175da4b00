// SPDX-License-Identifier: GPL-2.0-or-later
//! Objects in space, viewed from the front, the right and above: X runs to the right and down, Y to the
//! right and up, Z up, all at the same scale. Walls with round values are behind them.

use crate::plot::DrawError;
use crate::sheet::{Area, round_steps, span, tick};
use crate::style::{GRAY, NAME, PALE, SMALL, TITLE, letters_at};
use crate::thin::bends;
use kinematics::Vector3;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

/// Cosine of 30 degrees, the angle between the images of X or Y and the horizontal.
const COS_30: f64 = 0.866_025_403_784_438_6;

/// Direction towards the viewer, not normalized.
const EYE: Vector3<f64> = Vector3::new(1.0, -1.0, 1.0);

/// Direction of the light source, not normalized; it differs from the viewer's, so that sides differ.
const LIGHT: Vector3<f64> = Vector3::new(0.25, -0.6, 1.0);

/// Brightness of a side in the dark, as a share of that of a lit side.
const DARK: f64 = 0.55;

/// Pieces of a line, so that an object can be behind one part and in front of another.
const PIECES: usize = 10;

/// Most round values along the longest side.
const STEPS: usize = 8;

/// Pixels around the walls: title, ticks and names.
const ROOM: [i32; 2] = [76, 58];

/// Projects a point on the sheet: horizontal and vertical coordinate, in units of the object.
pub(super) fn project(place: &Vector3<f64>) -> (f64, f64) {
    ((place.x + place.y) * COS_30, place.z + (place.y - place.x) * 0.5)
}

/// A part that is drawn behind all parts nearer to the viewer.
pub(super) struct Part {
    corners: Vec<Vector3<f64>>,
    kind: Kind,
}

enum Kind {
    Side(RGBAColor),
    Line(ShapeStyle),
    Ball(RGBColor, i32),
}

/// Creates a flat side, shaded by its angle to the light; `None` if only its back is visible.
pub(super) fn side(corners: Vec<Vector3<f64>>, color: RGBColor, opacity: f64) -> Option<Part> {
    let normal = normal(&corners)?;
    if normal.dot(&EYE) <= 0.0 {
        return None;
    }
    let lit = DARK + (1.0 - DARK) * normal.dot(&LIGHT.normalize()).max(0.0);
    let RGBColor(r, g, b) = color;
    let shaded = [r, g, b].map(|part| (f64::from(part) * lit) as u8);
    let color = RGBColor(shaded[0], shaded[1], shaded[2]).mix(opacity);
    Some(Part { corners, kind: Kind::Side(color) })
}

/// Creates a side visible from both sides, in one shade.
pub(super) fn plate(corners: Vec<Vector3<f64>>, color: RGBColor, opacity: f64) -> Part {
    Part { corners, kind: Kind::Side(color.mix(opacity)) }
}

/// Creates a line, in pieces.
pub(super) fn line(from: Vector3<f64>, to: Vector3<f64>, style: ShapeStyle) -> Vec<Part> {
    let at = |k: usize| from + (to - from) * (k as f64 / PIECES as f64);
    let piece = |k: usize| Part { corners: vec![at(k), at(k + 1)], kind: Kind::Line(style) };
    (0..PIECES).map(piece).collect()
}

/// Creates a ball with a radius in pixels.
pub(super) fn ball(at: Vector3<f64>, color: RGBColor, pixels: i32) -> Part {
    Part { corners: vec![at], kind: Kind::Ball(color, pixels) }
}

/// Creates a line through points, without further division.
pub(super) fn course(places: &[Vector3<f64>], style: ShapeStyle) -> Vec<Part> {
    let piece = |ends: &[Vector3<f64>]| Part { corners: ends.to_vec(), kind: Kind::Line(style) };
    places.windows(2).map(piece).collect()
}

pub(super) fn edges([low, high]: &[Vector3<f64>; 2], style: ShapeStyle) -> Vec<Part> {
    let corner = |k: usize| {
        Vector3::from_fn(|axis, _| if k >> axis & 1 == 0 { low[axis] } else { high[axis] })
    };
    let beside = |k: usize| (0..3).map(move |axis| (k, k | 1 << axis)).filter(|(a, b)| a != b);
    (0..8).flat_map(beside).flat_map(|(a, b)| line(corner(a), corner(b), style)).collect()
}

/// Returns the unit normal of a nearly flat polygon (Newell's sum).
fn normal(corners: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    let next = corners.iter().cycle().skip(1);
    let sum: Vector3<f64> = corners.iter().zip(next).map(|(a, b)| a.cross(b)).sum();
    sum.try_normalize(0.0)
}

/// A quantity on the vertical axis in place of Z, at another scale.
#[derive(Clone, Copy)]
pub(super) struct Up<'a> {
    pub(super) name: &'a str,
    /// Its value at Z = 0.
    pub(super) from: f64,
    /// Z per unit of it.
    pub(super) scale: f64,
}

/// A box of space shown in a picture.
pub(super) struct Space<'a> {
    title: &'a str,
    unit: &'a str,
    up: Option<Up<'a>>,
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl<'a> Space<'a> {
    /// Creates a box around points, with a margin.
    pub(super) fn around(title: &'a str, unit: &'a str, places: &[Vector3<f64>]) -> Self {
        let ends = [0, 1, 2].map(|k| span(places.iter().map(|place| place[k])));
        let most = ends.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
        let least = if most > 0.0 { 0.08 * most } else { 1.0 };
        let room = |k: usize| {
            let (low, high) = ends[k];
            (0.04 * (high - low)).max((least - (high - low)) / 2.0)
        };
        let low = Vector3::from_fn(|k, _| ends[k].0 - room(k));
        let high = Vector3::from_fn(|k, _| ends[k].1 + room(k));
        Self { title, unit, up: None, low, high }
    }

    /// Sets another quantity than Z for the vertical axis.
    pub(super) fn up(self, up: Up<'a>) -> Self {
        Self { up: Some(up), ..self }
    }

    fn corner(&self, x: usize, y: usize, z: usize) -> Vector3<f64> {
        let of = |k: usize, end: usize| if end == 0 { self.low[k] } else { self.high[k] };
        Vector3::new(of(0, x), of(1, y), of(2, z))
    }

    /// Draws walls and parts, the farthest first; returns the projection.
    pub(super) fn draw(&self, area: &Area, mut parts: Vec<Part>) -> Result<View, DrawError> {
        let view = self.view(area);
        if !self.title.is_empty() {
            let (width, _) = area.dim_in_pixel();
            let style = letters_at(TITLE, HPos::Center, VPos::Top);
            area.draw(&Text::new(self.title.to_string(), (width as i32 / 2, 10), style))?;
        }
        self.draw_walls(area, &view)?;
        let depth = |part: &Part| {
            part.corners.iter().sum::<Vector3<f64>>().dot(&EYE) / part.corners.len() as f64
        };
        parts.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        for Part { corners, kind } in &parts {
            let places: Vec<(i32, i32)> = corners.iter().map(|place| view.pixel(place)).collect();
            match kind {
                Kind::Side(color) => area.draw(&Polygon::new(places, color.filled()))?,
                Kind::Line(style) => area.draw(&PathElement::new(places, *style))?,
                Kind::Ball(color, pixels) => {
                    area.draw(&Circle::new(places[0], *pixels, color.filled()))?;
                }
            }
        }
        Ok(view)
    }

    fn view(&self, area: &Area) -> View {
        let corners = (0..8).map(|k| project(&self.corner(k & 1, k >> 1 & 1, k >> 2)));
        let corners: Vec<(f64, f64)> = corners.collect();
        let (across, up) = (span(corners.iter().map(|p| p.0)), span(corners.iter().map(|p| p.1)));
        let (width, height) = area.dim_in_pixel();
        let title = if self.title.is_empty() { 0 } else { 26 };
        let room = [width as i32 - 2 * ROOM[0], height as i32 - ROOM[1] - 24 - title];
        let scale =
            [f64::from(room[0]) / (across.1 - across.0), f64::from(room[1]) / (up.1 - up.0)];
        let scale = scale[0].min(scale[1]);
        let middle = ((across.0 + across.1) / 2.0, (up.0 + up.1) / 2.0);
        let at = (f64::from(width) / 2.0, f64::from(title + 12) + f64::from(room[1]) / 2.0);
        View { scale, offset: (at.0 - middle.0 * scale, at.1 + middle.1 * scale) }
    }

    /// Draws the floor and both rear walls, with round values along their front edges.
    fn draw_walls(&self, area: &Area, view: &View) -> Result<(), DrawError> {
        let thin = PALE.stroke_width(1);
        let path = |ends: [Vector3<f64>; 2], style: ShapeStyle| {
            area.draw(&PathElement::new(ends.map(|place| view.pixel(&place)), style))
        };
        // One step for all lengths, so the grid is square.
        let sides = self.high - self.low;
        let step = round_steps([0.0, sides.max()], STEPS).get(1).copied().unwrap_or(1.0);
        for axis in 0..3 {
            let other = self.up.filter(|_| axis == 2);
            let (from, scale) = other.map_or((0.0, 1.0), |up| (up.from, up.scale));
            let [low, high] = [self.low, self.high].map(|end| from + end[axis] / scale);
            let own = other.and_then(|_| round_steps([0.0, high - low], STEPS).get(1).copied());
            let step = own.unwrap_or(step);
            let first = (low / step).ceil() as i64;
            for value in (first..).map(|k| k as f64 * step).take_while(|value| *value <= high) {
                let [floor, wall] = self.grid(axis, (value - from) * scale);
                path(floor, thin)?;
                path(wall, thin)?;
                self.draw_tick(area, view, axis, ((value - from) * scale, value))?;
            }
            self.draw_name(area, view, axis)?;
        }
        let edge = GRAY.stroke_width(1);
        let edges = [
            [(0, 0, 0), (1, 0, 0)],
            [(1, 0, 0), (1, 1, 0)],
            [(0, 0, 0), (0, 1, 0)],
            [(0, 1, 0), (1, 1, 0)],
            [(0, 0, 0), (0, 0, 1)],
            [(0, 1, 0), (0, 1, 1)],
            [(1, 1, 0), (1, 1, 1)],
            [(0, 0, 1), (0, 1, 1)],
            [(0, 1, 1), (1, 1, 1)],
        ];
        edges
            .into_iter()
            .try_for_each(|ends| path(ends.map(|(x, y, z)| self.corner(x, y, z)), edge))?;
        Ok(())
    }

    /// Returns the lines of a value on two of the walls.
    fn grid(&self, axis: usize, value: f64) -> [[Vector3<f64>; 2]; 2] {
        let at = |x: usize, y: usize, z: usize| {
            let mut corner = self.corner(x, y, z);
            corner[axis] = value;
            corner
        };
        match axis {
            0 => [[at(0, 0, 0), at(0, 1, 0)], [at(0, 1, 0), at(0, 1, 1)]],
            1 => [[at(0, 0, 0), at(1, 0, 0)], [at(0, 0, 0), at(0, 0, 1)]],
            _ => [[at(0, 0, 0), at(0, 1, 0)], [at(0, 1, 0), at(1, 1, 0)]],
        }
    }

    /// Draws a value next to its front edge, at its coordinate.
    fn draw_tick(
        &self,
        area: &Area,
        view: &View,
        axis: usize,
        (coordinate, value): (f64, f64),
    ) -> Result<(), DrawError> {
        let mut place = self.corner(usize::from(axis == 1), 0, 0);
        place[axis] = coordinate;
        let (x, y) = view.pixel(&place);
        let (at, across) = match axis {
            0 => ((x - 5, y + 8), HPos::Right),
            1 => ((x + 5, y + 8), HPos::Left),
            _ => ((x - 6, y), HPos::Right),
        };
        // The corner that X and Z share shows only the value of Z.
        let is_corner = axis == 0 && (coordinate - self.low.x) * view.scale < 20.0;
        if !is_corner {
            area.draw(&Text::new(tick(&value), at, letters_at(SMALL, across, VPos::Center)))?;
        }
        Ok(())
    }

    fn draw_name(&self, area: &Area, view: &View, axis: usize) -> Result<(), DrawError> {
        let middle = (self.low + self.high) / 2.0;
        let mut place = self.corner(usize::from(axis == 1), 0, 0);
        place[axis] = middle[axis];
        let (x, y) = view.pixel(&place);
        let (at, across) = match axis {
            0 => ((x - 26, y + 36), HPos::Right),
            1 => ((x + 26, y + 36), HPos::Left),
            _ => ((x + 12, view.pixel(&self.corner(0, 0, 1)).1 - 16), HPos::Right),
        };
        let name = match self.up.filter(|_| axis == 2) {
            Some(up) => up.name.to_string(),
            None => format!("{} in {}", ["X", "Y", "Z"][axis], self.unit),
        };
        let style = letters_at(NAME, across, VPos::Center);
        area.draw(&Text::new(name, at, style))?;
        Ok(())
    }
}

/// The projection of points to pixels.
pub(super) struct View {
    scale: f64,
    offset: (f64, f64),
}

impl View {
    pub(super) fn pixel(&self, place: &Vector3<f64>) -> (i32, i32) {
        let (x, y) = self.place(place);
        (x.round() as i32, y.round() as i32)
    }

    fn place(&self, place: &Vector3<f64>) -> (f64, f64) {
        let (across, up) = project(place);
        (self.offset.0 + across * self.scale, self.offset.1 - up * self.scale)
    }

    /// Draws a line through points in front of everything, in one element.
    pub(super) fn path(
        &self,
        places: &[Vector3<f64>],
        style: ShapeStyle,
    ) -> PathElement<(i32, i32)> {
        let flat: Vec<(f64, f64)> = places.iter().map(|place| self.place(place)).collect();
        let kept = bends(&flat).into_iter();
        let pixels: Vec<(i32, i32)> = kept.map(|place| self.pixel(&places[place])).collect();
        PathElement::new(pixels, style)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_closed_body_only_the_sides_towards_the_eye_are_drawn() {
        let corner = |k: usize| Vector3::from_fn(|axis, _| (k >> axis & 1) as f64);
        // Counterclockwise from outside: -x +x -y +y -z +z.
        let faces =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let seen = faces.map(|face| side(face.map(corner).to_vec(), PALE, 1.0).is_some());
        assert_eq!(seen, [false, true, true, false, false, true]);
    }

    #[test]
    fn a_line_before_a_side_is_drawn_after_it() {
        let flat = |y: f64| {
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            plate(corners.map(|[x, z]| Vector3::new(x, y, z)).to_vec(), PALE, 1.0)
        };
        let style = GRAY.stroke_width(5);
        let across = |y: f64| line(Vector3::new(0.5, y, 0.0), Vector3::new(0.5, y, 1.0), style);
        let places = [Vector3::zeros(), Vector3::repeat(1.0)];
        let order = |y: f64| {
            let space = Space::around("", "mm", &places);
            let parts = [vec![flat(0.5)], across(y)].into_iter().flatten().collect();
            let svg = crate::sheet::drawn(|root| space.draw(root, parts).map(drop)).unwrap();
            svg.find("<polygon").unwrap() < svg.find("stroke-width=\"5\"").unwrap()
        };
        assert!(order(-1.0) && !order(2.0));
    }
}
