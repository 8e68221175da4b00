// SPDX-License-Identifier: GPL-2.0-or-later
//! The body of a workspace with the machine and the axis limits, colored by the violated limit.

use crate::key::{Key, Sign, keyed_on};
use crate::lines::first_up;
use crate::machine::{Drawn, LEG, at_pose, axis_box};
use crate::plot::{DrawError, Plot};
use crate::slice::{Kinds, sliced};
use crate::space::{Part, Space, edges, side};
use crate::style::{area_color, limit_style};
use kinematics::Vector3;
use machine::read::mechanism::Mechanism;
use plotters::prelude::*;
use studies::study::body::Body;
use studies::study::slice::Slice;
use studies::study::workspace::{Border, Ray};

/// Most sides of the body from pole to pole.
const SIDES: usize = 60;

/// Opacity of the body, through which the machine is visible.
const OPACITY: f64 = 0.8;

const SIZE: (u32, u32) = (960, 720);

/// Draws pictures of a workspace: the body, and every slice with the violated limits along its border.
///
/// # Errors
/// As [`DrawError`].
pub fn of_workspace(
    config: &Mechanism,
    body: &Body,
    slices: &[Slice],
    tilt: Option<f64>,
) -> Result<Vec<Plot>, DrawError> {
    let reachable = match tilt {
        Some(tilt) => format!("reachable with a tilt of {tilt} degrees in every direction"),
        None => "reachable positions".into(),
    };
    let outlines: Vec<Border> =
        slices.iter().flat_map(|slice| slice.outline()).map(|(_, border)| border).collect();
    let kinds = Kinds::of(body.rays().map(|(_, ray)| &ray.limit).chain(&outlines));
    let mut plots = vec![];
    // In a plane its slice shows all of it.
    if !body.is_plane() {
        plots.push(Plot {
            file: "workspace.svg".into(),
            caption: "The workspace around the start of the rays, with the machine at home".into(),
            svg: solid(config, body, &kinds, &reachable)?,
        });
    }
    for slice in slices {
        let name = slice.plane.name.to_lowercase().replace(',', "_");
        plots.push(Plot {
            file: format!("slice-{name}.svg"),
            caption: format!("Slice {} of the workspace, by what limits it", slice.plane.name),
            svg: sliced(config, slice, &kinds, &reachable)?,
        });
    }
    Ok(plots)
}

fn solid(
    config: &Mechanism,
    body: &Body,
    kinds: &Kinds,
    reachable: &str,
) -> Result<String, DrawError> {
    let mut parts = sides(body, kinds);
    let Drawn { parts: machine, mut places } = at_pose(config, &config.home_pose());
    parts.extend(machine);
    places.extend(body.rays().map(|(_, ray)| end(body, ray)));
    let seen = body.rays().map(|(_, ray)| &ray.limit);
    let mut keys = kinds.keys(seen, |number| Sign::Area(area_color(number)));
    keys.push(Key::new(Sign::Line(LEG.stroke_width(4)), "machine, at home"));
    if let Some(corners) = axis_box(config) {
        parts.extend(edges(&corners, limit_style()));
        places.extend(corners);
        keys.push(Key::new(Sign::Line(limit_style()), "limits of the axes"));
    }
    let unit = config.length_unit();
    keyed_on(SIZE, &keys, |area| {
        let title = format!("{}, by limit", first_up(reachable));
        Space::around(&title, unit, &places).draw(area, parts).map(drop)
    })
}

fn end(body: &Body, ray: &Ray) -> Vector3<f64> {
    body.from + ray.direction * ray.exit()
}

/// Returns the sides of the body that face the viewer, few enough for a page.
fn sides(body: &Body, kinds: &Kinds) -> Vec<Part> {
    let last = body.rings.len() - 1;
    let stride = last.div_ceil(SIDES);
    let rings: Vec<usize> = (0..last).step_by(stride).chain([last]).collect();
    let turns: Vec<usize> = (0..body.around).step_by(stride).chain([body.around]).collect();
    let ray = |ring: usize, k: usize| &body.rings[ring][k % body.rings[ring].len()];
    let between =
        rings.windows(2).flat_map(|rings| turns.windows(2).map(move |turns| (rings, turns)));
    let of = |(rings, turns): (&[usize], &[usize])| {
        let rays = [
            ray(rings[0], turns[0]),
            ray(rings[0], turns[1]),
            ray(rings[1], turns[1]),
            ray(rings[1], turns[0]),
        ];
        // At a pole two of them coincide.
        let own = if rings[0] == 0 { rays[2] } else { rays[0] };
        side(rays.map(|ray| end(body, ray)).to_vec(), area_color(kinds.number(&own.limit)), OPACITY)
    };
    between.filter_map(of).collect()
}
