// SPDX-License-Identifier: GPL-2.0-or-later
//! The ellipsoids of displacement and rotation under a load.

use crate::key::{Key, Sign, draw_keys};
use crate::plot::{DrawError, Plot};
use crate::sheet::{Area, Frame, drawn_on, path_axes};
use crate::style::{PALE, TITLE, letters_at, limit_style, line_style};
use kinematics::Letter;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use studies::study::stiffness::{Ellipsoid, Stiffness};

/// A part of a stiffness and its drawing: displacement or rotation under a load in any direction.
struct Loaded {
    file: &'static str,
    what: &'static str,
    unit: &'static str,
    /// Displacement or rotation in that unit times stiffness, N and mm.
    load: f64,
    stiffness: &'static str,
    /// Factor from a stiffness in N and mm to that unit.
    scale: f64,
}

const LOADED: [Loaded; 2] = [
    Loaded {
        file: "ellipsoid-translation.svg",
        what: "Displacement of the tip under a force of 1 kN, whichever way it points",
        unit: "µm",
        load: 1e6,
        stiffness: "N/µm",
        scale: 1e-3,
    },
    Loaded {
        file: "ellipsoid-rotation.svg",
        what: "Turn of the platform under a moment of 1 kN m, about whichever axis",
        unit: "mrad",
        load: 1e9,
        stiffness: "kN m/rad",
        scale: 1e-6,
    },
];

const OUTLINE: usize = 180;

const SIZE: (u32, u32) = (960, 500);

/// Pixels of the title, and of the names of the lines.
const HEAD: u32 = 40;
const FOOT: u32 = 110;

/// Draws the ellipsoids of displacement under a force and of rotation under a moment, if there are any,
/// viewed along the machine's axes.
///
/// # Errors
/// As [`DrawError`].
pub fn of_ellipsoids(found: &Stiffness) -> Result<Vec<Plot>, DrawError> {
    let both = LOADED.iter().zip([found.translation(), found.rotation()]);
    let yielding = both.filter(|(_, ellipsoid)| ellipsoid.stiffness[0].is_finite());
    yielding
        .map(|(loaded, ellipsoid)| {
            let svg = seen_along_axes(loaded, &ellipsoid)?;
            Ok(Plot { file: loaded.file.into(), caption: loaded.what.into(), svg })
        })
        .collect()
}

fn seen_along_axes(loaded: &Loaded, ellipsoid: &Ellipsoid) -> Result<String, DrawError> {
    let most = loaded.load / ellipsoid.stiffness[0];
    let corners = [(-most, -most), (most, most)];
    drawn_on(SIZE, |root| {
        let style = letters_at(TITLE, HPos::Center, VPos::Top);
        root.draw(&Text::new(loaded.what, (SIZE.0 as i32 / 2, 12), style))?;
        let (_, below) = root.split_vertically(HEAD);
        let (planes, foot) = below.split_vertically(SIZE.1 - HEAD - FOOT);
        let panels = planes.split_evenly((1, 3));
        for (panel, plane) in panels.iter().zip([[0, 1], [0, 2], [1, 2]]) {
            let [across, up] = plane.map(|k| Letter::ALL[k].name());
            let frame = Frame {
                title: "",
                x: &format!("{across} in {}", loaded.unit),
                y: &format!("{up} in {}", loaded.unit),
                limits: vec![],
            };
            let mut chart = path_axes(panel, &frame, &corners)?;
            let outline = ellipsoid.outline(plane, loaded.load, OUTLINE);
            let area = outline.clone();
            chart.draw_series([Polygon::new(area, PALE.mix(0.4).filled())])?;
            chart.draw_series([PathElement::new(outline, limit_style())])?;
            for k in 0..3 {
                let half = loaded.load / ellipsoid.stiffness[k];
                let [x, y] = plane.map(|i| ellipsoid.axes[(i, k)] * half);
                chart.draw_series([PathElement::new([(-x, -y), (x, y)], line_style(k))])?;
            }
        }
        name_axes(&foot, loaded, ellipsoid)
    })
}

fn name_axes(area: &Area, loaded: &Loaded, ellipsoid: &Ellipsoid) -> Result<(), DrawError> {
    let axis = |k: usize| {
        let axis = ellipsoid.axes.column(k).map(|part| format!("{:.2}", part + 0.0));
        let stiffness = ellipsoid.stiffness[k];
        let value = match stiffness.is_finite() {
            true => format!("{:.3} {}", stiffness * loaded.scale, loaded.stiffness),
            false => "rigid".into(),
        };
        Key::line(k, &format!("along {} {} {}: {value}", axis[0], axis[1], axis[2]))
    };
    let outline = Key::new(Sign::Line(limit_style()), "outline of the ellipsoid");
    let (left, right) = area.split_horizontally(SIZE.0 / 2);
    draw_keys(&left.margin(0, 0, 90, 0), &[outline, axis(0)], 24)?;
    draw_keys(&right, &[axis(1), axis(2)], 24)
}
