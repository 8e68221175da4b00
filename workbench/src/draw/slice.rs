// SPDX-License-Identifier: GPL-2.0-or-later
//! A slice of a workspace, with what limits it where.

use crate::draw::plot::DrawError;
use crate::draw::sheet::{FONT, Frame, STYLES, drawn, legend, path_axes};
use crate::study::slice::Slice;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A mark of its own for each kind of limit.
const MARKS: [&str; 13] = ["o", "v", "^", "-", "x", "+", "#", "=", "~", "*", "%", "/", "|"];

/// Room for a mark, as a share of a sheet's width that the outline fills.
const MARK_ROOM: f64 = 0.03;

/// Width of a sheet over its height.
const ASPECT: f64 = 1.6;

pub(super) fn sliced(unit: &str, slice: &Slice) -> Result<String, DrawError> {
    let outline = slice.outline();
    let place = slice.plane.axes.map(|axis| axis.dot(&slice.from));
    let points: Vec<(f64, f64)> = outline.iter().map(|([x, y], _)| (*x, *y)).collect();
    let name = |k: usize| {
        let axis = slice.plane.axes[k];
        let letter = ["X", "Y", "Z"].into_iter().zip(axis.iter()).find(|(_, part)| **part == 1.0);
        let side = ["across", "up"][k];
        format!("{} in {unit}", letter.map_or(side, |(letter, _)| letter))
    };
    drawn(|root| {
        let title =
            format!("Slice {}: the limit met at each place of the border", slice.plane.name);
        let frame = Frame { title: &title, x: &name(0), y: &name(1), limits: vec![] };
        // Room for the legend beside the outline.
        let right = points.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
        let left = points.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
        let middle = points.iter().map(|p| p.1).sum::<f64>() / points.len() as f64;
        let high = points.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
        let low = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let room = MARK_ROOM * (right - left).max(ASPECT * (high - low));
        let roomy = points.iter().copied().chain([(right + 0.45 * (right - left), middle)]);
        let mut chart = path_axes(root, &frame, &roomy.collect::<Vec<_>>())?;
        let mut kinds: Vec<_> =
            outline.iter().map(|(_, border)| (border.rank(), border.kind())).collect();
        kinds.sort();
        kinds.dedup();
        for (kind, (rank, kind_name)) in kinds.into_iter().enumerate() {
            let own: Vec<(f64, f64)> = outline
                .iter()
                .filter(|(_, border)| border.rank() == rank)
                .map(|([x, y], _)| (*x, *y))
                .collect();
            let (colour, _) = STYLES[kind % STYLES.len()];
            let dots = own.iter().map(|at| Circle::new(*at, 1, colour.filled()));
            chart.draw_series(dots)?;
            let style = (FONT, 17).into_font().color(&colour);
            let centred = style.pos(Pos::new(HPos::Center, VPos::Center));
            let sign = centred.clone();
            chart
                .draw_series(
                    apart(&own, room)
                        .into_iter()
                        .map(|at| Text::new(MARKS[kind], at, sign.clone())),
                )?
                .label(kind_name)
                .legend(move |(x, y)| Text::new(MARKS[kind], (x + 17, y), centred.clone()));
        }
        let bold = BLACK.stroke_width(2);
        chart
            .draw_series([Cross::new((place[0], place[1]), 6, bold)])?
            .label("rays begin")
            .legend(move |(x, y)| Cross::new((x + 17, y), 6, bold));
        legend(&mut chart)
    })
}

/// Points that leave room for their marks.
fn apart(points: &[(f64, f64)], room: f64) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = vec![];
    for point in points {
        let is_free = |other: &(f64, f64)| (point.0 - other.0).hypot(point.1 - other.1) >= room;
        if kept.iter().all(is_free) {
            kept.push(*point);
        }
    }
    kept
}
