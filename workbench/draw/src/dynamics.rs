// SPDX-License-Identifier: GPL-2.0-or-later
//! Vibration of a machine: responses, maps, the trace of the tool tip and its spectrum.

use crate::contour::{contoured, plane_of};
use crate::key::{Key, Sign, keyed};
use crate::lines::{Line, without_stairs};
use crate::plot::{DrawError, Plot};
use crate::sheet::{Frame, TIME, path_axes};
use crate::strips::{Strip, Strips, drawn_apart, drawn_strips};
use crate::style::{PALE, line_style};
use crate::thin::thin;
use kinematics::{Letter, Matrix3, Vector3};
use machine::read::mechanism::Mechanism;
use nalgebra::Complex;
use plotters::prelude::*;
use std::f64::consts::TAU;
use studies::dynamics::linear::Ellipse;
use studies::dynamics::record::Record;
use studies::study::map::Map;

/// um per mm.
const UM: f64 = 1e3;

/// Number of points of an ellipse.
const OUTLINE: usize = 180;

/// Names of the lines along X, Y and Z.
const AXES: [&str; 3] = ["X", "Y", "Z"];

/// Draws the amplitude of the tip along X, Y and Z under a force of 1 N along the same axis, by frequency.
///
/// # Errors
/// As [`DrawError`].
pub fn of_response(rows: &[(f64, Matrix3<Complex<f64>>)]) -> Result<Plot, DrawError> {
    let line = |k: usize| Line {
        name: AXES[k].into(),
        points: rows.iter().map(|(hz, h)| (*hz, amount(&h[(k, k)]) * UM)).collect(),
    };
    let caption = "Displacement of the tip per force along the same axis";
    let lines = vec![line(0), line(1), line(2)];
    let svg = drawn_apart(caption, "frequency in Hz", "displacement per force in µm/N", lines)?;
    Ok(Plot { file: "response.svg".into(), caption: caption.into(), svg })
}

fn amount(value: &Complex<f64>) -> f64 {
    value.re.hypot(value.im)
}

/// Draws maps of the lowest natural frequency and of the largest amplitude in one plane.
///
/// # Errors
/// As [`DrawError`].
pub fn of_map(config: &Mechanism, map: &Map<2>) -> Result<[Plot; 2], DrawError> {
    let letters = map.plane.map(|k| Letter::ALL[k].name());
    let (plane, length) = (plane_of(config, map), config.length_unit());
    let of =
        |k: usize, what: &str, file: &str, unit: &str, scale: f64| -> Result<Plot, DrawError> {
            let values: Vec<f64> = map.values.iter().map(|values| values[k] * scale).collect();
            let caption = format!("{what} in {unit}, {plane}");
            let frame = Frame {
                title: &caption,
                x: &format!("{} in {length}", letters[0]),
                y: &format!("{} in {length}", letters[1]),
                limits: vec![],
            };
            let svg = contoured(&frame, unit, &map.sides, &values, &["unlimited"])?;
            let file = format!("{file}-{}.svg", letters.iter().collect::<String>().to_lowercase());
            Ok(Plot { file, caption: caption.clone(), svg })
        };
    let swing = "Largest displacement of the tip per force at a natural frequency";
    Ok([
        of(0, "Lowest natural frequency", "frequency", "Hz", 1.0)?,
        of(1, swing, "swing", "µm/N", UM)?,
    ])
}

/// Draws the path of the tip in X and Y, the ellipse of its standard deviations, and that of the linear theory
/// if there is one.
///
/// # Errors
/// As [`DrawError`].
pub fn of_trace(record: &Record, linear: Option<&Matrix3<f64>>) -> Result<Plot, DrawError> {
    let mean = record.mean();
    let points: Vec<(f64, f64)> = record.tip.iter().map(|tip| (tip.x * UM, tip.y * UM)).collect();
    let own = outline(&record.covariance(), &mean);
    let expected = linear.map(|covariance| outline(covariance, &Vector3::zeros()));
    let caption = "Displacement of the tip from its command, seen from above";
    let frame = Frame { title: caption, x: "X in µm", y: "Y in µm", limits: vec![] };
    let trace = PALE.stroke_width(1);
    let ellipses = [Some((own, "standard deviation")), expected.map(|e| (e, "linear theory"))];
    let ellipses: Vec<_> = ellipses.into_iter().flatten().collect();
    let names = ellipses.iter().enumerate().map(|(k, (_, name))| Key::line(k, name));
    let keys: Vec<Key> =
        std::iter::once(Key::new(Sign::Line(trace), "trace")).chain(names).collect();
    let svg = keyed(&keys, |area| {
        let mut chart = path_axes(area, &frame, &points)?;
        let path = without_stairs(&chart, &points);
        chart.draw_series([PathElement::new(path, trace)])?;
        for (k, (line, _)) in ellipses.iter().enumerate() {
            chart.draw_series([PathElement::new(line.clone(), line_style(k))])?;
        }
        Ok(())
    })?;
    Ok(Plot { file: "trace.svg".into(), caption: caption.into(), svg })
}

/// Returns the ellipse of one standard deviation in X and Y, um.
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

/// Draws the displacement of the tip from its command over time.
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
    let lines = vec![line(0), line(1), line(2)];
    let svg = drawn_apart(caption, TIME, "displacement in µm", lines)?;
    Ok(Plot { file: "deviation.svg".into(), caption: caption.into(), svg })
}

/// Draws roots of the spectral densities of the tip at frequencies in Hz, and those of the linear theory if
/// there are any; mm²/Hz.
///
/// # Errors
/// As [`DrawError`].
pub fn of_spectrum(
    frequencies: &[f64],
    found: &[Vector3<f64>],
    linear: &[Vector3<f64>],
) -> Result<Plot, DrawError> {
    let line = |values: &[Vector3<f64>], k: usize, name: &str| Line {
        name: name.into(),
        points: frequencies.iter().zip(values).map(|(hz, v)| (*hz, v[k].sqrt() * UM)).collect(),
    };
    let strip = |k: usize| {
        let theory = (!linear.is_empty()).then(|| line(linear, k, "linear theory"));
        let lines = std::iter::once(line(found, k, "motion in time")).chain(theory).collect();
        Strip::new(AXES[k], lines, vec![])
    };
    let strips = [0, 1, 2].map(strip);
    let caption = "Spectrum of the displacement of the tip";
    let y = "root of the density in µm/√Hz";
    let svg = drawn_strips(&Strips::new(caption, "frequency in Hz", y, &strips), &strips)?;
    Ok(Plot { file: "spectrum.svg".into(), caption: caption.into(), svg })
}
