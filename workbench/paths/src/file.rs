// SPDX-License-Identifier: GPL-2.0-or-later
//! The path file: a TOML file with units in the keys, so that a value without its unit is an
//! unknown key.

use crate::operation::Operation;
use machine::files::{AtFile, Locate, read_text};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use studies::study::number::Positive;

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PathFile {
    /// Folder of the file, to which names of other files are relative.
    #[serde(skip)]
    pub folder: PathBuf,
    /// Named numbers for all expressions.
    pub parameters: BTreeMap<String, f64>,
    pub curve: Option<CurveKeys>,
    /// Laws of coordinates and speed along the curve.
    pub laws: LawKeys,
    /// Parameters of the drives.
    pub split: SplitKeys,
    /// Largest deviation of a program from the curve.
    pub tolerance: Option<Tolerance>,
    pub program: ProgramKeys,
    /// Laws of the joints, in place of a curve: the path of the tool is the result.
    pub carriages: Option<CarriageKeys>,
    /// Typical paths, in place of a curve.
    pub operation: Vec<Operation>,
}

/// `[curve]`: families, or a free-form curve from a file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CurveKeys {
    /// x = f(t).
    pub x_mm: Option<Formula>,
    /// y = g(t).
    pub y_mm: Option<Formula>,
    /// α(x, y, t), which is 0 on the curve.
    pub alpha: Option<Formula>,
    /// β(x, y, t), which is 0 on the curve.
    pub beta: Option<Formula>,
    /// F(x, y), which is 0 on the curve.
    pub f: Option<Formula>,
    /// x and y at the start, which select the branch.
    pub start_mm: Option<[f64; 2]>,
    /// First and last t.
    pub t: Option<[Formula; 2]>,
    /// Smallest and largest t along the curve; by default those of the range.
    pub t_bounds: Option<[Formula; 2]>,
    /// Behavior at a turning point of t.
    pub follow: Follow,
    /// The curve ends after this length in x and y.
    pub length_mm: Option<Positive>,
    /// A CSV file with the columns x, y, z and perhaps weight: control points of a spline.
    pub points: Option<PathBuf>,
    pub degree: Option<usize>,
    pub knots: Option<Vec<f64>>,
    /// An SVG file: its paths.
    pub svg: Option<PathBuf>,
    /// Size of the drawing's unit, if its width, height and viewBox do not determine it.
    pub svg_unit_mm: Option<Positive>,
    /// A DXF file: its entities.
    pub dxf: Option<PathBuf>,
    /// The layer from which entities are read.
    pub dxf_layer: Option<String>,
    /// The entities to read, by their handles.
    pub dxf_handles: Option<Vec<String>>,
    /// Size of the drawing's unit; overrides $INSUNITS.
    pub dxf_unit_mm: Option<Positive>,
    /// Largest distance between ends of entities that are joined.
    pub dxf_join_mm: Option<Positive>,
}

/// Behavior at a turning point of t.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Follow {
    /// The curve continues, and t reverses.
    #[default]
    Arc,
    /// The curve ends.
    T,
}

/// `[laws]`, of t, s (arc length, mm), u (its share), x, y and z.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LawKeys {
    /// Height.
    pub z_mm: Option<Formula>,
    /// Tilt A.
    pub a_deg: Option<Formula>,
    pub b_deg: Option<Formula>,
    pub c_deg: Option<Formula>,
    /// A vector along the tool axis, in place of the angles.
    pub normal: Option<[Formula; 3]>,
    /// Speed of the tool tip, by t, s and u.
    pub speed_mm_per_s: Option<Formula>,
    /// Angular speed where the tip is at rest.
    pub turn_deg_per_s: Option<Positive>,
}

/// `[split]`: the parameter of each drive as a function of t.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SplitKeys {
    pub t_x: Option<Formula>,
    pub t_y: Option<Formula>,
    pub t_z: Option<Formula>,
    pub t_a: Option<Formula>,
    pub t_b: Option<Formula>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// Largest distance of the programmed path from the curve.
    pub chord_mm: Positive,
    /// Largest error of an angle.
    #[serde(default = "Tolerance::angle")]
    pub angle_deg: Positive,
}

impl Tolerance {
    fn angle() -> Positive {
        Positive(0.01)
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CarriageKeys {
    /// First and last second.
    pub t_s: [f64; 2],
    /// One law of t for every joint: lengths in mm, angles of arms in degrees.
    pub laws_mm_or_deg: Vec<Formula>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProgramKeys {
    /// Title of the program, in its first line.
    pub title: Option<String>,
    /// T number of the tool; if missing, the spindle is empty.
    pub tool: Option<u32>,
    pub spindle_rpm: Option<Positive>,
    /// X Y Z of the workpiece zero in the machine.
    pub zero_mm: [f64; 3],
    /// Lines only, or also arcs within the same tolerance.
    pub moves: Moves,
    pub feed: Feed,
    /// P of G64, the tolerance within which LinuxCNC may round corners; by default chord_mm.
    pub blend_mm: Option<Positive>,
    /// Height from which the tool descends to the start, and to which it retracts at the end.
    pub clear_z_mm: Option<f64>,
    /// X from which a tool approaches from the side, and to which it retracts at the end.
    pub clear_x_mm: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Moves {
    /// G1.
    #[default]
    Lines,
    /// G2 and G3 if an arc is within the tolerance, else G1.
    Arcs,
}

/// Format of feeds.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Feed {
    /// G94: F in mm per minute, in degrees per minute where the tip is at rest.
    #[default]
    PerMinute,
    /// G93: F is the inverse of the move's duration in minutes.
    InverseTime,
}

/// An expression, or a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula(pub String);

impl<'de> Deserialize<'de> for Formula {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FormulaVisitor)
    }
}

struct FormulaVisitor;

impl Visitor<'_> for FormulaVisitor {
    type Value = Formula;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or an expression as text")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Formula, E> {
        match value.is_finite() {
            true => Ok(Formula(format!("{value:?}"))),
            false => Err(E::custom(format!("{value}: expected a finite number"))),
        }
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Formula, E> {
        self.visit_f64(value as f64)
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Formula, E> {
        Ok(Formula(value.into()))
    }
}

/// Why a path file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PathFileError {
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
    #[error(transparent)]
    Malformed(#[from] AtFile<toml::de::Error>),
}

impl PathFile {
    /// Reads a path file.
    ///
    /// # Errors
    /// See [`PathFileError`].
    pub fn read(file: &Path) -> Result<Self, PathFileError> {
        let text = read_text(file)?;
        let folder = file.parent().unwrap_or(Path::new("")).into();
        Ok(Self { folder, ..Self::parse(&text).at(file)? })
    }

    /// Parses a path file.
    ///
    /// # Errors
    /// See [`PathFile::read`].
    pub fn parse(text: &str) -> Result<Self, toml::de::Error> {
        toml::from_str(text)
    }
}
