// SPDX-License-Identifier: GPL-2.0-or-later
//! The ellipsoids of displacements and of turns under a load.

use crate::draw::plot::{DrawError, Plot};
use crate::draw::sheet::{Area, FONT, Frame, STYLES, drawn, path_axes};
use crate::study::stiffness::{Ellipsoid, Stiffness};
use kinematics::Letter;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

/// A part of a stiffness as it is drawn: what a load does, whichever way it points.
struct Loaded {
    file: &'static str,
    what: &'static str,
    unit: &'static str,
    /// Amount in that unit times stiffness, N and mm.
    load: f64,
    stiffness: &'static str,
    /// Stiffness in that unit for one in N and mm.
    scale: f64,
}

const LOADED: [Loaded; 2] = [
    Loaded {
        file: "ellipsoid-translation.svg",
        what: "Displacement of the tip under a force of 1 kN, whichever way it points",
        unit: "um",
        load: 1e6,
        stiffness: "N/um",
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

/// Points of an outline.
const OUTLINE: usize = 180;

/// Of the three principal axes: shades and dashes that print apart, and apart from the outline.
const AXES: [(RGBColor, (u32, u32)); 3] = [STYLES[2], STYLES[1], STYLES[3]];

/// The ellipsoids of displacements under a force and of turns under a moment, where there are any,
/// seen along the machine's axes.
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
    drawn(|root| {
        let root = root.titled(loaded.what, (FONT, 20))?;
        let panels = root.split_evenly((2, 2));
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
            let bold = BLACK.stroke_width(2);
            chart.draw_series([PathElement::new(outline, bold)])?;
            for k in 0..3 {
                let half = loaded.load / ellipsoid.stiffness[k];
                let [x, y] = plane.map(|i| ellipsoid.axes[(i, k)] * half);
                let (colour, (dash, gap)) = AXES[k];
                let line = [(-x, -y), (x, y)];
                let style = colour.stroke_width(2);
                chart.draw_series([DashedPathElement::new(line, dash, gap, style)])?;
            }
        }
        named_axes(&panels[3], loaded, ellipsoid)
    })
}

/// What the lines are, in a panel of their own.
fn named_axes(panel: &Area, loaded: &Loaded, ellipsoid: &Ellipsoid) -> Result<(), DrawError> {
    let put = |row: i32, words: &str| {
        let at = (120, 60 + 40 * row);
        let label = Text::new(words.to_string(), (at.0, at.1 - 8), (FONT, 16).into_font());
        panel.draw(&label)?;
        Ok::<_, DrawError>([(at.0 - 60, at.1), (at.0 - 14, at.1)])
    };
    let line = put(0, "outline of the ellipsoid")?;
    panel.draw(&PathElement::new(line, BLACK.stroke_width(2)))?;
    for (k, (colour, (dash, gap))) in AXES.into_iter().enumerate() {
        let axis = ellipsoid.axes.column(k).map(|part| format!("{:.2}", part + 0.0));
        let stiffness = ellipsoid.stiffness[k];
        let value = match stiffness.is_finite() {
            true => format!("{:.3} {}", stiffness * loaded.scale, loaded.stiffness),
            false => "rigid".into(),
        };
        let words = format!("along {} {} {}: {value}", axis[0], axis[1], axis[2]);
        let line = put(1 + k as i32, &words)?;
        let style = colour.stroke_width(2);
        panel.draw(&DashedPathElement::new(line, dash, gap, style))?;
    }
    Ok(())
}
