// SPDX-License-Identifier: GPL-2.0-or-later
//! The path of a program in the machine, colored by its distance to the limits.

use crate::key::{Key, Sign, draw_keys_across};
use crate::machine::{Drawn, LEG, at_pose};
use crate::over::{Mark, label};
use crate::plot::DrawError;
use crate::sheet::{Area, drawn_on, span};
use crate::space::{Space, View, edges, project};
use crate::style::{BLUE, ORANGE, RED, SMALL, mark_letters, width_of};
use crate::thin::places_apart;
use kinematics::Vector3;
use machine::read::mechanism::Mechanism;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use program::timeline::Thinned;

const MOST_POINTS: usize = 5000;

/// Most stretches of a path with a separate color.
const MOST_STRETCHES: usize = 300;

/// Tolerance of distances to limits, as a share of a limit's range: computed distances round, and a program may
/// reach the limit.
const ROUNDING: f64 = 1e-6;

/// Share of a limit's range below which the distance to the limit is small.
pub(super) const NEAR: f64 = 0.1;

/// Distance in pixels below which violations share one mark.
const ONE_MARK: i32 = 12;

/// Styles of a path by its distance to the limits, the worst last. Widths differ too, for prints
/// without colors.
const SHADES: [(&str, RGBColor, u32); 3] =
    [("away from limits", BLUE, 2), ("near a limit", ORANGE, 4), ("beyond a limit", RED, 7)];

fn shade(room: f64) -> usize {
    match room {
        room if room >= NEAR => 0,
        room if room >= -ROUNDING => 1,
        _ => 2,
    }
}

/// Half the size of a cross, pixels.
const CROSS: i32 = 8;

const SIZE: (u32, u32) = (960, 600);

const KEYS: u32 = 36;

/// Draws the path twice: in the machine with the limits of the axes, and enlarged.
pub(super) fn in_its_room(
    config: &Mechanism,
    course: &Thinned,
    marks: &[Mark],
) -> Result<String, DrawError> {
    let path = Path::new(course);
    let limits = limits(config, course);
    let unit = config.length_unit();
    let thin = BLACK.stroke_width(1);
    let keys: Vec<Key> = std::iter::once(Key::new(Sign::Line(thin), "limits of the axes"))
        .chain(path.keys())
        .chain([Key::new(Sign::Line(LEG.stroke_width(4)), "machine, at home")])
        .collect();
    drawn_on(SIZE, |root| {
        let (views, foot) = root.split_vertically(SIZE.1 - KEYS);
        draw_keys_across(&foot, &keys, (24, KEYS as i32 / 2))?;
        let areas = views.split_evenly((1, 2));
        let Drawn { mut parts, mut places } = at_pose(config, &config.home_pose());
        parts.extend(edges(&limits, thin));
        places.extend(limits);
        places.extend(&path.points);
        let view = Space::around("In the machine", unit, &places).draw(&areas[0], parts)?;
        path.draw(&areas[0], &view)?;
        draw_marks(&areas[0], &view, marks)?;
        let marked = marks.iter().map(|mark| place(&mark.pose));
        let around: Vec<Vector3<f64>> = path.points.iter().copied().chain(marked).collect();
        let view = Space::around("Closer", unit, &around).draw(&areas[1], vec![])?;
        path.draw(&areas[1], &view)?;
        draw_marks(&areas[1], &view, marks)
    })
}

fn place(pose: &[f64; 6]) -> Vector3<f64> {
    Vector3::new(pose[0], pose[1], pose[2])
}

/// The path on the sheet, and the stretches near or beyond limits.
struct Path {
    points: Vec<Vector3<f64>>,
    /// Index ranges of the points, both ends included, with their shades.
    stretches: Vec<([usize; 2], usize)>,
}

impl Path {
    fn new(course: &Thinned) -> Self {
        let all: Vec<Vector3<f64>> = course.samples.iter().map(|s| place(&s.pose)).collect();
        let flat: Vec<(f64, f64)> = all.iter().map(project).collect();
        let mut pixels = 1.0;
        let mut kept = places_apart(&flat, pixels);
        while kept.len() > MOST_POINTS {
            pixels *= 1.5;
            kept = places_apart(&flat, pixels);
        }
        let points = kept.iter().map(|place| all[*place]).collect();
        // Samples between two points count with the first.
        let worst = |k: usize| {
            let to = kept.get(k + 1).map_or(all.len(), |next| *next);
            let between = &course.samples[kept[k]..to];
            between.iter().map(|sample| shade(sample.room())).max().unwrap_or_default()
        };
        let shades: Vec<usize> = (0..kept.len()).map(worst).collect();
        let last = shades.len().saturating_sub(1);
        let stretches = [1, 2].into_iter().flat_map(|shade| {
            let own = stretches(&shades, shade);
            // A single point is no line: include the next one.
            own.into_iter().map(move |[from, to]| ([from, (to + 1).min(last)], shade))
        });
        Self { points, stretches: stretches.collect() }
    }

    /// Returns the keys of its colors.
    fn keys(&self) -> impl Iterator<Item = Key> {
        let is_seen = |shade: &usize| *shade == 0 || self.stretches.iter().any(|s| s.1 == *shade);
        let shades = (0..SHADES.len()).filter(is_seen).map(|shade| SHADES[shade]);
        shades.map(|(name, color, width)| Key::new(Sign::Line(color.stroke_width(width)), name))
    }

    fn draw(&self, area: &Area, view: &View) -> Result<(), DrawError> {
        let last = self.points.len().saturating_sub(1);
        let whole = ([0, last], 0);
        for (shade, (_, color, width)) in SHADES.into_iter().enumerate() {
            let own = self.stretches.iter().chain([&whole]).filter(|(_, own)| *own == shade);
            for ([from, to], _) in own {
                area.draw(&view.path(&self.points[*from..=*to], color.stroke_width(width)))?;
            }
        }
        Ok(())
    }
}

/// Returns the first and last index of every stretch of a shade. Gaps are bridged, the shortest first, until
/// there are few enough.
fn stretches(shades: &[usize], shade: usize) -> Vec<[usize; 2]> {
    let mut found: Vec<[usize; 2]> = vec![];
    for (place, _) in shades.iter().enumerate().filter(|(_, own)| **own == shade) {
        match found.last_mut() {
            Some([_, to]) if *to + 1 == place => *to = place,
            _ => found.push([place, place]),
        }
    }
    let mut gap = 2;
    while found.len() > MOST_STRETCHES {
        found = found
            .chunk_by(|a, b| b[0] - a[1] <= gap)
            .map(|of| [of[0][0], of[of.len() - 1][1]])
            .collect();
        gap *= 2;
    }
    found
}

/// Returns the limits of X, Y and Z; for an axis without a limit, the end of the path.
fn limits(config: &Mechanism, course: &Thinned) -> [Vector3<f64>; 2] {
    let ends: [[f64; 2]; 3] = std::array::from_fn(|k| {
        let (low, high) = span(course.samples.iter().flat_map(|sample| sample.poses[k]));
        let axis = config.axes[k];
        let or = |limit: f64, value: f64| if limit.is_finite() { limit } else { value };
        [or(axis.min, low), or(axis.max, high)]
    });
    [0, 1].map(|end| Vector3::from_fn(|k, _| ends[k][end]))
}

/// Draws crosses with labels; violations near each other share one. A label without room
/// is omitted, because the page lists all of them.
fn draw_marks(area: &Area, view: &View, marks: &[Mark]) -> Result<(), DrawError> {
    let mut groups: Vec<((i32, i32), Vec<usize>)> = vec![];
    for (number, mark) in marks.iter().enumerate() {
        let at = view.pixel(&place(&mark.pose));
        let same = |group: &&mut ((i32, i32), Vec<usize>)| {
            (group.0.0 - at.0).abs().max((group.0.1 - at.1).abs()) < ONE_MARK
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.1.push(number),
            None => groups.push((at, vec![number])),
        }
    }
    let cross = |((x, y), _): &((i32, i32), _)| [x - CROSS, x + CROSS, y - CROSS, y + CROSS];
    let mut taken: Vec<[i32; 4]> = groups.iter().map(cross).collect();
    for (at, numbers) in groups {
        area.draw(&Cross::new(at, CROSS, RED.stroke_width(3)))?;
        let label = label(marks, &numbers);
        if let Some(corner) = free_corner(area, at, &label, &mut taken) {
            let style = mark_letters(HPos::Left, VPos::Center);
            area.draw(&Text::new(label, corner, style))?;
        }
    }
    Ok(())
}

/// Returns the left end of a label next to a position, where it overlaps no other.
fn free_corner(
    area: &Area,
    (x, y): (i32, i32),
    label: &str,
    taken: &mut Vec<[i32; 4]>,
) -> Option<(i32, i32)> {
    let (wide, (most, _)) = (width_of(label, SMALL) as i32, area.dim_in_pixel());
    let sides = [-10, 10, -28, 28, -46, 46, -64, 64];
    let places = sides.into_iter().flat_map(|dy| [(x + 13, y + dy), (x - 13 - wide, y + dy)]);
    for (left, middle) in places {
        let own = [left, left + wide, middle - 9, middle + 9];
        let is_apart =
            |t: &[i32; 4]| own[1] <= t[0] || t[1] <= own[0] || own[3] <= t[2] || t[3] <= own[2];
        if left >= 0 && own[1] <= most as i32 && own[2] >= 40 && taken.iter().all(is_apart) {
            taken.push(own);
            return Some((left, middle));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_stretch_is_never_lost() {
        // Every second point is bad: too many stretches.
        let shades: Vec<usize> = (0..4000).map(|k| if k % 2 == 0 { 2 } else { 0 }).collect();
        assert_eq!(stretches(&shades, 2), [[0, 3998]]);
        let single: Vec<usize> = (0..4000).map(|k| usize::from(k == 1234)).collect();
        assert_eq!(stretches(&single, 1), [[1234, 1234]]);
        assert_eq!(stretches(&single, 2), [[0; 2]; 0]);
    }

    #[test]
    fn what_is_not_a_number_is_beyond_a_limit() {
        let rooms = [0.5, 0.1, 0.05, 0.0, -1e-9, -1e-3, f64::NEG_INFINITY, f64::NAN];
        assert_eq!(rooms.map(shade), [0, 0, 1, 1, 1, 2, 2, 2]);
    }
}
