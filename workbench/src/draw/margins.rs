// SPDX-License-Identifier: GPL-2.0-or-later
//! Margins to the limits along a program, and its joints.

use crate::draw::lines::{Line, MOST_POINTS, apart, drawn_lines, first_up, lines, thin_low};
use crate::draw::plot::{DrawError, Plot};
use crate::draw::sheet::{Frame, TIME, drawn, legend, path_axes, project};
use crate::program::findings::Sample;
use crate::read::machine::MachineConfig;
use plotters::prelude::*;

/// Plots of the samples that a check of a program has looked at.
///
/// # Errors
/// As [`DrawError`].
pub fn of_samples(config: &MachineConfig, samples: &[Sample]) -> Result<Vec<Plot>, DrawError> {
    if samples.is_empty() {
        return Ok(vec![]);
    }
    let mut plots = vec![
        Plot {
            file: "path-by-margin.svg".into(),
            caption: "Path of the control point (isometric), by its margin to the limits of joint \
                      ranges, cones, conditioning and rod distance"
                .into(),
            svg: path_by_margin(samples, config.length_unit())?,
        },
        Plot {
            file: "margin.svg".into(),
            caption: "Least margin to joint ranges, cones, conditioning and rod distance".into(),
            svg: margins(samples)?,
        },
    ];
    for group in config.groups() {
        let name = group.kind.plural();
        let stem = name.replace(' ', "-");
        let values = samples.iter().map(|sample| (sample.time, &sample.joints));
        let frame = Frame {
            title: &first_up(name),
            x: TIME,
            y: &format!("{} in {}", group.kind.quantity(), group.unit),
            limits: vec![],
        };
        plots.push(Plot {
            file: format!("{stem}.svg"),
            caption: format!("{} during the program", first_up(name)),
            svg: drawn_lines(&frame, &lines(config, &group, values))?,
        });
        let speeds = samples.iter().map(|sample| (sample.time, &sample.speeds));
        let frame = Frame {
            title: &format!("Speeds of {name}"),
            x: TIME,
            y: "share of the limit",
            limits: vec![("limit".into(), 1.0)],
        };
        plots.push(Plot {
            file: format!("{stem}-speeds.svg"),
            caption: format!("Speeds of {name} at the programmed feed, as shares of their limits"),
            svg: drawn_lines(&frame, &lines(config, &group, speeds))?,
        });
    }
    Ok(plots)
}

fn margins(samples: &[Sample]) -> Result<String, DrawError> {
    let frame = Frame {
        title: "Least margin",
        x: TIME,
        y: "share of the limit's range",
        limits: vec![("limit".into(), 0.0)],
    };
    let points = thin_low(samples.iter().map(|sample| (sample.time, sample.margin)));
    drawn_lines(&frame, &[Line { name: "margin".into(), points }])
}

fn path_by_margin(samples: &[Sample], unit: &str) -> Result<String, DrawError> {
    // Dark where it is near; grey prints apart.
    let shades = [
        ("beyond or below 2 %", 0.02, RGBColor(180, 0, 0)),
        ("below 10 %", 0.1, RGBColor(230, 120, 0)),
        ("more", f64::INFINITY, RGBColor(120, 160, 200)),
    ];
    let point = |sample: &Sample| project([sample.pose[0], sample.pose[1], sample.pose[2]]);
    let stride = samples.len().div_ceil(20 * MOST_POINTS).max(1);
    drawn(|root| {
        let points: Vec<(f64, f64)> = samples.iter().map(point).collect();
        let frame = Frame {
            title: "Margins along the path: X right and down, Y right and up, Z up",
            x: &format!("(X + Y) cos 30° in {unit}"),
            y: &format!("Z + (Y - X)/2 in {unit}"),
            limits: vec![],
        };
        let mut chart = path_axes(root, &frame, &points)?;
        let line = LineSeries::new(apart(&points), BLACK.mix(0.3).stroke_width(1));
        chart.draw_series(line)?;
        let mut from = f64::NEG_INFINITY;
        for (name, to, colour) in shades {
            let inside = |sample: &&Sample| (from..to).contains(&sample.margin);
            let near = samples.iter().step_by(stride).filter(inside).map(point);
            chart
                .draw_series(near.map(|at| Circle::new(at, 2, colour.filled())))?
                .label(name)
                .legend(move |(x, y)| Circle::new((x + 17, y), 4, colour.filled()));
            from = to;
        }
        legend(&mut chart)
    })
}
