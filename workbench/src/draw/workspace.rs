// SPDX-License-Identifier: GPL-2.0-or-later
//! The body of a workspace as wires.

use crate::draw::plot::{DrawError, Plot};
use crate::draw::sheet::{Frame, STYLES, drawn, legend, path_axes, project};
use crate::draw::slice::sliced;
use crate::study::body::Body;
use crate::study::slice::Slice;
use crate::study::workspace::Ray;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

/// Pictures of a workspace: the body, and every slice with what limits it where.
///
/// # Errors
/// As [`DrawError`].
pub fn of_workspace(unit: &str, body: &Body, slices: &[Slice]) -> Result<Vec<Plot>, DrawError> {
    let mut plots = vec![Plot {
        file: "workspace.svg".into(),
        caption: "The workspace around the place where the rays begin (isometric)".into(),
        svg: wire_frame(unit, body)?,
    }];
    for slice in slices {
        let name = slice.plane.name.to_lowercase().replace(',', "_");
        plots.push(Plot {
            file: format!("slice-{name}.svg"),
            caption: format!("Slice {} of the workspace, by what limits it", slice.plane.name),
            svg: sliced(unit, slice)?,
        });
    }
    Ok(plots)
}

/// Lines of the body that are drawn: every so many rings, and as many meridians.
const WIRES: usize = 12;

fn wire_frame(unit: &str, body: &Body) -> Result<String, DrawError> {
    let end = |ray: &Ray| {
        let place = body.from + ray.direction * ray.exit();
        project([place.x, place.y, place.z])
    };
    let stride = (body.rings.len() / WIRES).max(1);
    let closed = |rays: &Vec<Ray>| rays.iter().chain(rays.first()).map(end).collect::<Vec<_>>();
    let rings: Vec<Vec<_>> = body.rings.iter().step_by(stride).map(closed).collect();
    let meridian =
        |k: usize| -> Vec<_> { body.rings.iter().map(|ring| end(&ring[k % ring.len()])).collect() };
    let stride = (body.around / WIRES).max(1);
    let meridians: Vec<Vec<_>> = (0..body.around).step_by(stride).map(meridian).collect();
    let points: Vec<_> = rings.iter().chain(&meridians).flatten().copied().collect();
    drawn(|root| {
        let frame = Frame {
            title: "Workspace, isometric: X right and down, Y right and up, Z up",
            x: &format!("(X + Y) cos 30° in {unit}"),
            y: &format!("Z + (Y - X)/2 in {unit}"),
            limits: vec![],
        };
        let mut chart = path_axes(root, &frame, &points)?;
        let styles = [("one elevation", &rings, STYLES[0]), ("one azimuth", &meridians, STYLES[2])];
        for (name, lines, (colour, (dash, gap))) in styles {
            let style = colour.stroke_width(1);
            let drawn =
                lines.iter().map(|line| DashedPathElement::new(line.clone(), dash, gap, style));
            chart.draw_series(drawn)?.label(name).legend(move |(x, y)| {
                DashedPathElement::new([(x, y), (x + 34, y)], dash, gap, style)
            });
        }
        legend(&mut chart)
    })
}
