// SPDX-License-Identifier: GPL-2.0-or-later
//! Free-form curves from files: control points as CSV, and paths of an SVG drawing.

use crate::curve::base::{Form, Part};
use crate::curve::file::CurveKeys;
use crate::curve::spline::{Spline, SplineError};
use crate::curve::svg::{self, SvgError};
use crate::files::{AtFile, Locate};
use std::io;
use std::path::Path;
use std::sync::Arc;

/// Degree of a spline whose file names none.
const DEGREE: usize = 3;

/// A free-form curve that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum FreeError {
    /// A row of a CSV file, or the file.
    #[error("{file}: {error}")]
    Csv {
        /// The file.
        file: String,
        /// What is wrong with it.
        error: csv::Error,
    },
    /// A value that is no number.
    #[error("{file}: row {row}: {text}")]
    Row {
        /// The file.
        file: String,
        /// Its row, from 1.
        row: usize,
        /// What is wrong with it.
        text: String,
    },
    /// Points that make no spline.
    #[error("{file}: {error}")]
    Spline {
        /// The file.
        file: String,
        /// What is wrong with it.
        error: SplineError,
    },
    /// A drawing.
    #[error("{file}: {error}")]
    Svg {
        /// The file.
        file: String,
        /// What is wrong with it.
        error: SvgError,
    },
    /// No file that can be read.
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
    /// Keys that do not fit together.
    #[error("{0}")]
    Keys(String),
}

/// One row of control points, mm.
#[derive(serde::Deserialize)]
struct Row {
    x: f64,
    y: f64,
    z: f64,
    weight: Option<f64>,
}

/// The parts of a curve that a file holds.
///
/// # Errors
/// See [`FreeError`].
pub fn parts(keys: &CurveKeys, folder: &Path) -> Result<Vec<Part>, FreeError> {
    match (&keys.points, &keys.svg) {
        (Some(file), None) => of_points(keys, &folder.join(file)),
        (None, Some(file)) => of_svg(keys, &folder.join(file)),
        _ => Err(FreeError::Keys("[curve]: expected points or svg, and not both".into())),
    }
}

fn of_points(keys: &CurveKeys, file: &Path) -> Result<Vec<Part>, FreeError> {
    let name = file.display().to_string();
    let csv = |error| FreeError::Csv { file: name.clone(), error };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(file).map_err(csv)?;
    let rows: Vec<Row> = reader.deserialize().collect::<Result<_, _>>().map_err(csv)?;
    let is_finite = |row: &Row| row.x.is_finite() && row.y.is_finite() && row.z.is_finite();
    if let Some(row) = rows.iter().position(|row| !is_finite(row)) {
        let text = "expected finite numbers".into();
        return Err(FreeError::Row { file: name, row: row + 2, text });
    }
    let points: Vec<[f64; 3]> = rows.iter().map(|row| [row.x, row.y, row.z]).collect();
    let weights: Vec<f64> = rows.iter().map(|row| row.weight.unwrap_or(1.0)).collect();
    let degree = keys.degree.unwrap_or(DEGREE);
    let spline = Spline::new(degree, &points, Some(&weights), keys.knots.clone());
    let spline = spline.map_err(|error| FreeError::Spline { file: name, error })?;
    Ok(spans(spline))
}

fn of_svg(keys: &CurveKeys, file: &Path) -> Result<Vec<Part>, FreeError> {
    let missing = "[curve] svg_unit_mm: missing; a drawing in mm has 1, one in pixels 25.4/96";
    let scale = keys.svg_unit_mm.ok_or_else(|| FreeError::Keys(missing.into()))?;
    let text = std::fs::read_to_string(file).at(file)?;
    let splines = svg::splines(&text, scale.0);
    let splines =
        splines.map_err(|error| FreeError::Svg { file: file.display().to_string(), error })?;
    Ok(splines.into_iter().flat_map(spans).collect())
}

fn spans(spline: Spline) -> Vec<Part> {
    let spans = spline.spans();
    let spline = Arc::new(spline);
    let part = |(span, range)| Part { form: Form::Spline(spline.clone(), span), range };
    spans.into_iter().map(part).collect()
}
