// SPDX-License-Identifier: GPL-2.0-or-later
//! How a machine vibrates: responses, maps, the trace of the tool tip and its spectrum.

use crate::draw::contour::contoured;
use crate::draw::lines::{Line, apart, drawn_lines, thin};
use crate::draw::plot::{DrawError, Plot};
use crate::draw::sheet::{Frame, STYLES, drawn, legend, path_axes};
use crate::dynamics::linear::Ellipse;
use crate::dynamics::record::Record;
use crate::study::map::Map;
use kinematics::{Letter, Matrix3, Vector3};
use nalgebra::Complex;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use std::f64::consts::TAU;

/// um per mm.
const UM: f64 = 1e3;

/// Points of an ellipse.
const OUTLINE: usize = 180;

/// Names of the lines along X, Y and Z.
const AXES: [&str; 3] = ["X", "Y", "Z"];

/// How far the tip swings along X, Y and Z under a force of 1 N along the same axis, by frequency.
///
/// # Errors
/// As [`DrawError`].
pub fn of_response(rows: &[(f64, Matrix3<Complex<f64>>)]) -> Result<Plot, DrawError> {
    let line = |k: usize| Line {
        name: AXES[k].into(),
        points: rows.iter().map(|(hz, h)| (*hz, amount(&h[(k, k)]) * UM)).collect(),
    };
    let caption = "Displacement of the tip per force along the same axis";
    let frame = Frame { title: caption, x: "frequency in Hz", y: "um/N", limits: vec![] };
    let svg = drawn_lines(&frame, &[line(0), line(1), line(2)])?;
    Ok(Plot { file: "response.svg".into(), caption: caption.into(), svg })
}

fn amount(value: &Complex<f64>) -> f64 {
    value.re.hypot(value.im)
}

/// Maps of the lowest natural frequency and of the largest swing in one plane.
///
/// # Errors
/// As [`DrawError`].
pub fn of_map(length: &str, map: &Map) -> Result<[Plot; 2], DrawError> {
    let letters = map.plane.map(|k| Letter::ALL[k].name());
    let plane: String = letters.iter().collect();
    let of =
        |k: usize, what: &str, file: &str, unit: &str, scale: f64| -> Result<Plot, DrawError> {
            let values: Vec<f64> = map.values.iter().map(|values| values[k] * scale).collect();
            let caption = format!("{what} in the plane {plane}, in {unit}");
            let frame = Frame {
                title: &caption,
                x: &format!("{} in {length}", letters[0]),
                y: &format!("{} in {length}", letters[1]),
                limits: vec![],
            };
            let svg = contoured(&frame, &map.sides, &values)?;
            let file = format!("{file}-{}.svg", plane.to_lowercase());
            Ok(Plot { file, caption: caption.clone(), svg })
        };
    let swing = "Largest displacement of the tip per force at a natural frequency";
    Ok([
        of(0, "Lowest natural frequency", "frequency", "Hz", 1.0)?,
        of(1, swing, "swing", "um/N", UM)?,
    ])
}

/// The way of the tip in X and Y, the ellipse of its standard deviations, and that of the linear theory
/// where there is one.
///
/// # Errors
/// As [`DrawError`].
pub fn of_trace(record: &Record, linear: Option<&Matrix3<f64>>) -> Result<Plot, DrawError> {
    let mean = record.mean();
    let points: Vec<(f64, f64)> = record.tip.iter().map(|tip| (tip.x * UM, tip.y * UM)).collect();
    let own = outline(&record.covariance(), &mean);
    let expected = linear.map(|covariance| outline(covariance, &Vector3::zeros()));
    let caption = "Displacement of the tip from its command, seen from above";
    let frame = Frame { title: caption, x: "X in um", y: "Y in um", limits: vec![] };
    let svg = drawn(|root| {
        // Room for the legend beside the trace.
        let right = points.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
        let left = points.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
        let mut seen = points.clone();
        seen.push((right + 0.3 * (right - left), mean.y * UM));
        let mut chart = path_axes(root, &frame, &seen)?;
        let grey = BLACK.mix(0.35);
        chart
            .draw_series(LineSeries::new(apart(&points), grey))?
            .label("trace")
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 34, y)], grey));
        let ellipses = [Some((own, "standard deviation")), expected.map(|e| (e, "linear theory"))];
        for ((line, name), (colour, (dash, gap))) in
            ellipses.into_iter().flatten().zip([STYLES[0], STYLES[2]])
        {
            let style = colour.stroke_width(3);
            chart.draw_series(DashedLineSeries::new(line, dash, gap, style))?.label(name).legend(
                move |(x, y)| DashedPathElement::new([(x, y), (x + 34, y)], dash, gap, style),
            );
        }
        legend(&mut chart)
    })?;
    Ok(Plot { file: "trace.svg".into(), caption: caption.into(), svg })
}

/// Of one standard deviation in X and Y, um.
fn outline(covariance: &Matrix3<f64>, middle: &Vector3<f64>) -> Vec<(f64, f64)> {
    let Ellipse { axes: [long, short], direction } = Ellipse::of(covariance);
    let (sin, cos) = direction.to_radians().sin_cos();
    let point = |k: usize| {
        let (up, across) = (TAU * k as f64 / OUTLINE as f64).sin_cos();
        let (a, b) = (long * across, short * up);
        ((middle.x + a * cos - b * sin) * UM, (middle.y + a * sin + b * cos) * UM)
    };
    (0..=OUTLINE).map(point).collect()
}

/// Displacement of the tip from its command over time.
///
/// # Errors
/// As [`DrawError`].
pub fn of_deviation(record: &Record) -> Result<Plot, DrawError> {
    let line = |k: usize| Line {
        name: AXES[k].into(),
        points: thin(
            record.tip.iter().enumerate().map(|(n, tip)| (n as f64 * record.step, tip[k] * UM)),
        ),
    };
    let caption = "Displacement of the tip from its command";
    let frame = Frame { title: caption, x: "time in s", y: "um", limits: vec![] };
    let svg = drawn_lines(&frame, &[line(0), line(1), line(2)])?;
    Ok(Plot { file: "deviation.svg".into(), caption: caption.into(), svg })
}

/// Roots of the spectral densities of the tip at frequencies in Hz, and those of the linear theory where
/// there are any; mm²/Hz.
///
/// # Errors
/// As [`DrawError`].
pub fn of_spectrum(
    frequencies: &[f64],
    found: &[Vector3<f64>],
    linear: &[Vector3<f64>],
) -> Result<Plot, DrawError> {
    let line = |values: &[Vector3<f64>], k: usize, of: &str| Line {
        name: format!("{}{of}", AXES[k]),
        points: frequencies.iter().zip(values).map(|(hz, v)| (*hz, v[k].sqrt() * UM)).collect(),
    };
    let mut lines: Vec<Line> = (0..3).map(|k| line(found, k, "")).collect();
    if !linear.is_empty() {
        lines.extend((0..3).map(|k| line(linear, k, ", linear theory")));
    }
    let caption = "Spectrum of the displacement of the tip";
    let frame =
        Frame { title: caption, x: "frequency in Hz", y: "um per root of Hz", limits: vec![] };
    let svg = drawn_lines(&frame, &lines)?;
    Ok(Plot { file: "spectrum.svg".into(), caption: caption.into(), svg })
}
