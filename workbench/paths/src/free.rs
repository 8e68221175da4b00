// SPDX-License-Identifier: GPL-2.0-or-later
//! Free-form curves from files: control points as CSV, and paths of SVG and DXF drawings.

use crate::base::Part;
use crate::dxf::{self, DxfError};
use crate::element::{Element, parts, spans};
use crate::file::CurveKeys;
use crate::spline::{Spline, SplineError};
use crate::svg::{self, SvgError};
use machine::files::{AtFile, read, read_text};
use std::io;
use std::path::Path;

/// Default degree of a spline.
const DEGREE: usize = 3;

/// Why a free-form curve cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum FreeError {
    #[error("{file}: {error}")]
    Csv { file: String, error: csv::Error },
    #[error("{file}: row {row}: {text}")]
    Row {
        file: String,
        /// Row number, from 1.
        row: usize,
        text: String,
    },
    #[error("{file}: {error}")]
    Spline { file: String, error: SplineError },
    #[error("{file}: {error}")]
    Svg { file: String, error: SvgError },
    #[error("{file}: {error}")]
    Dxf { file: String, error: DxfError },
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
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

/// A free-form curve.
#[derive(Clone, Debug)]
pub struct Free {
    pub parts: Vec<Part>,
    /// Whether it is a planar drawing, whose height a law gives.
    pub is_plane: bool,
}

/// Refuses keys that belong to a file that is not given.
///
/// # Errors
/// Returns [`FreeError::Keys`] with the first of them.
pub fn check_keys(keys: &CurveKeys) -> Result<(), FreeError> {
    let (points, svg, dxf) = (keys.points.is_some(), keys.svg.is_some(), keys.dxf.is_some());
    let all = [
        ("degree", keys.degree.is_some(), "points", points),
        ("knots", keys.knots.is_some(), "points", points),
        ("svg_unit_mm", keys.svg_unit_mm.is_some(), "svg", svg),
        ("dxf_layer", keys.dxf_layer.is_some(), "dxf", dxf),
        ("dxf_handles", keys.dxf_handles.is_some(), "dxf", dxf),
        ("dxf_unit_mm", keys.dxf_unit_mm.is_some(), "dxf", dxf),
        ("dxf_join_mm", keys.dxf_join_mm.is_some(), "dxf", dxf),
    ];
    match all.iter().find(|(_, is_given, _, has_file)| *is_given && !has_file) {
        Some((key, _, file, _)) => Err(FreeError::Keys(format!(
            "[curve] {key} is only valid with {file}, which is missing"
        ))),
        None => Ok(()),
    }
}

/// Reads the curve of a file.
///
/// # Errors
/// See [`FreeError`].
pub fn free(keys: &CurveKeys, folder: &Path) -> Result<Free, FreeError> {
    match (&keys.points, &keys.svg, &keys.dxf) {
        (Some(file), None, None) => {
            Ok(Free { parts: of_points(keys, &folder.join(file))?, is_plane: false })
        }
        (None, Some(file), None) => Ok(of_drawing(of_svg(keys, &folder.join(file))?)),
        (None, None, Some(file)) => Ok(of_drawing(of_dxf(keys, &folder.join(file))?)),
        _ => Err(FreeError::Keys("[curve]: expected exactly one of points, svg and dxf".into())),
    }
}

fn of_drawing(elements: Vec<Element>) -> Free {
    let is_plane = elements.iter().all(Element::is_plane);
    Free { parts: parts(elements), is_plane }
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

fn of_svg(keys: &CurveKeys, file: &Path) -> Result<Vec<Element>, FreeError> {
    let text = read_text(file)?;
    let elements = svg::elements(&text, keys.svg_unit_mm.map(|unit| unit.0));
    elements.map_err(|error| FreeError::Svg { file: file.display().to_string(), error })
}

fn of_dxf(keys: &CurveKeys, file: &Path) -> Result<Vec<Element>, FreeError> {
    let bytes = read(file)?;
    let elements = dxf::elements(&bytes, keys);
    elements.map_err(|error| FreeError::Dxf { file: file.display().to_string(), error })
}
