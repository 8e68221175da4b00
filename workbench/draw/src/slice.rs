// SPDX-License-Identifier: GPL-2.0-or-later
//! A slice of a workspace: the reachable area, its border by the violated limit, and the limits of
//! the axes.

use crate::key::{Key, Sign, keyed};
use crate::lines::without_stairs;
use crate::plot::DrawError;
use crate::sheet::{Chart, Frame, path_axes};
use crate::style::{BLUE, limit_style, line_style};
use machine::read::mechanism::Mechanism;
use plotters::prelude::*;
use studies::study::slice::Slice;
use studies::study::workspace::{Border, Ray};

/// Opacity of the area inside.
const INSIDE: f64 = 0.14;

pub(super) fn sliced(
    config: &Mechanism,
    slice: &Slice,
    kinds: &Kinds,
    reachable: &str,
) -> Result<String, DrawError> {
    let outline = slice.outline();
    let sheet = Sheet { slice, kinds };
    let limits = axis_limits(config, slice);
    let seen = outline.iter().map(|(_, border)| border);
    let mut keys = kinds.keys(seen, |number| Sign::Line(line_style(number)));
    keys.push(Key::new(Sign::Area(RGBColor(219, 235, 244)), "within all limits"));
    if limits.is_some() {
        keys.push(Key::new(Sign::Line(limit_style()), "limits of the axes"));
    }
    keys.push(Key::new(Sign::Cross, "rays begin"));
    let unit = config.length_unit();
    let title = format!("Slice {}: {reachable}, by limit", slice.plane.name);
    let frame =
        Frame { title: &title, x: &sheet.name(0, unit), y: &sheet.name(1, unit), limits: vec![] };
    let around: Vec<(f64, f64)> =
        outline.iter().map(|([x, y], _)| (*x, *y)).chain(limits.into_iter().flatten()).collect();
    keyed(&keys, |area| {
        let mut chart = path_axes(area, &frame, &around)?;
        chart.draw_series(
            sheet.areas().into_iter().map(|a| Polygon::new(a, BLUE.mix(INSIDE).filled())),
        )?;
        if let Some(corners) = limits {
            let closed = [&corners[..], &corners[..1]].concat();
            chart.draw_series([PathElement::new(closed, limit_style())])?;
        }
        sheet.draw_border(&mut chart)?;
        let place = slice.plane.axes.map(|axis| axis.dot(&slice.from));
        chart.draw_series([Cross::new((place[0], place[1]), 6, limit_style())])?;
        Ok(())
    })
}

struct Sheet<'a> {
    slice: &'a Slice,
    kinds: &'a Kinds,
}

impl Sheet<'_> {
    /// Returns the name of an axis of the plane.
    fn name(&self, k: usize, unit: &str) -> String {
        let axis = self.slice.plane.axes[k];
        let letter = ["X", "Y", "Z"].into_iter().zip(axis.iter()).find(|(_, part)| **part == 1.0);
        let side = ["across", "up"][k];
        format!("{} in {unit}", letter.map_or(side, |(letter, _)| letter))
    }

    fn point(&self, ray: &Ray, distance: f64) -> (f64, f64) {
        let place = self.slice.from + ray.direction * distance;
        let [x, y] = self.slice.plane.axes.map(|axis| axis.dot(&place));
        (x, y)
    }

    /// Returns neighboring rays, all around.
    fn pairs(&self) -> impl Iterator<Item = (&Ray, &Ray)> {
        let rays = &self.slice.rays;
        rays.iter().zip(rays.iter().cycle().skip(1))
    }

    /// Returns the areas inside: around the origin of the rays, and segments beyond a gap.
    fn areas(&self) -> Vec<Vec<(f64, f64)>> {
        let around = self.slice.rays.iter().map(|ray| self.point(ray, ray.exit())).collect();
        let beyond = self.pairs().flat_map(|(ray, next)| {
            let both = ray.inside.iter().zip(&next.inside).skip(1);
            both.map(move |(own, other)| {
                let ends = [(ray, own[0]), (ray, own[1]), (next, other[1]), (next, other[0])];
                ends.map(|(ray, distance)| self.point(ray, distance)).to_vec()
            })
        });
        std::iter::once(around).chain(beyond).collect()
    }

    /// Returns the border as lines, each of one kind; the line around the origin is closed.
    fn border(&self) -> Vec<(usize, Vec<(f64, f64)>)> {
        let mut lines: Vec<(usize, Vec<(f64, f64)>)> = vec![];
        let most = self.pairs().map(|(a, b)| a.inside.len().min(b.inside.len())).max().unwrap_or(1);
        for end in 0..2 * most - 1 {
            for (ray, next) in self.pairs() {
                let (Some(own), Some(other)) =
                    (ray.crossings().nth(end), next.crossings().nth(end))
                else {
                    continue;
                };
                let (from, to) = (self.point(ray, own.0), self.point(next, other.0));
                let kind = self.kinds.number(&own.1);
                match lines.last_mut() {
                    Some((last, line)) if *last == kind && line.last() == Some(&from) => {
                        line.push(to)
                    }
                    _ => lines.push((kind, vec![from, to])),
                }
            }
        }
        lines
    }

    fn draw_border(&self, chart: &mut Chart) -> Result<(), DrawError> {
        for (kind, line) in self.border() {
            let path = without_stairs(chart, &line);
            chart.draw_series([PathElement::new(path, line_style(kind))])?;
        }
        Ok(())
    }
}

/// Returns the corners of the axis limits in the plane, if it is spanned by two limited axes.
fn axis_limits(config: &Mechanism, slice: &Slice) -> Option<[(f64, f64); 4]> {
    let range = |k: usize| {
        let axis = slice.plane.axes[k].iter().position(|part| *part == 1.0)?;
        let ends = [config.axes[axis].min, config.axes[axis].max];
        ends.iter().all(|end| end.is_finite()).then_some(ends)
    };
    let ([left, right], [low, high]) = (range(0)?, range(1)?);
    Some([(left, low), (right, low), (right, high), (left, high)])
}

/// The kinds of limits in the pictures of a workspace, with the same colors in all of them.
pub(super) struct Kinds(Vec<(usize, bool)>);

impl Kinds {
    pub(super) fn of<'a>(borders: impl Iterator<Item = &'a Border>) -> Self {
        let mut kinds: Vec<_> = borders.map(Border::rank).collect();
        kinds.sort_unstable();
        kinds.dedup();
        Self(kinds)
    }

    /// Returns the index of a border's kind, which determines its color.
    pub(super) fn number(&self, border: &Border) -> usize {
        self.0.iter().position(|rank| *rank == border.rank()).unwrap_or(0)
    }

    /// Returns the keys for the colors of one picture.
    pub(super) fn keys<'a>(
        &self,
        seen: impl Iterator<Item = &'a Border>,
        sign: impl Fn(usize) -> Sign,
    ) -> Vec<Key> {
        let mut kinds: Vec<_> = seen.map(|border| (self.number(border), border.kind())).collect();
        kinds.sort_unstable();
        kinds.dedup();
        kinds.into_iter().map(|(number, name)| Key::new(sign(number), name)).collect()
    }
}
