// SPDX-License-Identifier: GPL-2.0-or-later
//! The setup file of `pkm measure`: the gauge and the objects to measure.

use super::gauge::{Gauge, Kind, Object, Scale};
use super::model::Frame;
use super::plate::Unit;
use kinematics::{Matrix3, Pose, Vector3};
use machine::files::{AtFile, Locate, read_text};
use machine::read::mechanism::Mechanism;
use serde::Deserialize;
use std::io;
use std::path::Path;

/// A gauge and its objects as described in the TOML file: lengths in its `unit`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    unit: Unit,
    gauge: Kind,
    reading: Scale,
    deviation: f64,
    range: [f64; 2],
    expected: Option<f64>,
    #[serde(default)]
    zero: f64,
    #[serde(default)]
    radius: f64,
    tool: [f64; 3],
    #[serde(default = "count")]
    count: usize,
    #[serde(default = "tilt")]
    tilt: f64,
    clearance: f64,
    feed: f64,
    object: Vec<FileObject>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileObject {
    name: String,
    place: [f64; 3],
    #[serde(default)]
    angles: [f64; 3],
    #[serde(default)]
    size: [f64; 2],
    #[serde(default = "cone")]
    cone: f64,
}

fn count() -> usize {
    30
}

fn tilt() -> f64 {
    15.0
}

fn cone() -> f64 {
    60.0
}

/// Most poses of a program.
const MOST: usize = 500;

/// The gauge and the objects to measure, in machine units and degrees.
#[derive(Clone, Debug)]
pub struct Setup {
    pub gauge: Gauge,
    /// Reading of the machine as drawn, in the gauge's unit.
    pub expected: f64,
    /// The objects to measure against.
    pub objects: Vec<Object>,
    /// Range of the poses: for a plane its size along X and Y, for a ball the half angle of the cone about Z
    /// in which the bar points, degrees.
    pub extents: Vec<Extent>,
    /// Number of poses.
    pub count: usize,
    /// Largest A, B and C.
    pub tilt: f64,
    /// Distance by which the tool is retracted between two poses.
    pub clearance: f64,
    /// Feed towards the object, per minute.
    pub feed: f64,
}

/// The range in which an object may be touched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    Plane([f64; 2]),
    /// Half angle of a cone, degrees.
    Cone(f64),
}

#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
    #[error(transparent)]
    Malformed(#[from] AtFile<toml::de::Error>),
    #[error(transparent)]
    Bad(#[from] AtFile<BadSetup>),
}

/// An invalid value of the file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct BadSetup(String);

impl Setup {
    /// Reads a file.
    ///
    /// # Errors
    /// See [`SetupError`].
    pub fn read(config: &Mechanism, file: &Path) -> Result<Self, SetupError> {
        let text = read_text(file)?;
        let given: File = toml::from_str(&text).at(file)?;
        check(&given).at(file)?;
        let setup = given.in_machine(config);
        setup.check_direction(config).at(file)?;
        setup.check_sides().at(file)?;
        Ok(setup)
    }

    /// Refuses a gauge that points in a direction in which no tool of the machine points.
    fn check_direction(&self, config: &Mechanism) -> Result<(), BadSetup> {
        match config.tool_direction.filter(|it| it.contradicts(self.gauge.tool.z)) {
            None => Ok(()),
            Some(direction) => Err(BadSetup(format!(
                "tool: expected the other sign of Z: {}",
                direction.rule(config.place.machine_section())
            ))),
        }
    }

    /// Refuses planes that the gauge would approach from behind, through the plane.
    fn check_sides(&self) -> Result<(), BadSetup> {
        let planes = self.objects.iter().zip(&self.extents);
        let planes = planes.filter(|(_, extent)| matches!(extent, Extent::Plane(_)));
        for (object, _) in planes {
            if looks_away(&object.frame.rotation, &self.gauge.tool) {
                return Err(BadSetup(format!("object {}: {LOOKS_AWAY}", object.name)));
            }
        }
        Ok(())
    }
}

/// Explanation for a face that points away from the platform.
pub(super) const LOOKS_AWAY: &str = "its face points away from the platform, so the tool would go \
     through it: use angles that rotate +Z towards the platform ([0, 0, 0] below a tool that points down, \
     [180, 0, 0] above one that points up), and the sign of the tool table for tool";

/// Returns whether the face of a frame, its +Z, points in the direction of the tool.
pub(super) fn looks_away(rotation: &Matrix3<f64>, tool: &Vector3<f64>) -> bool {
    // A dial gauge at an edge is perpendicular to the normal of its face.
    const ACROSS: f64 = 0.5;
    rotation.column(2).dot(tool) < -ACROSS * tool.norm()
}

/// Refuses invalid values.
fn check(given: &File) -> Result<(), BadSetup> {
    let bad = |text: String| Err(BadSetup(text));
    let positive =
        [("deviation", given.deviation), ("clearance", given.clearance), ("feed", given.feed)];
    for (key, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return bad(format!("{key} = {value}: expected more than 0"));
        }
    }
    for (key, value) in [("zero", given.zero), ("radius", given.radius), ("tilt", given.tilt)] {
        if !(value >= 0.0 && value.is_finite()) {
            return bad(format!("{key} = {value}: expected 0 or more"));
        }
    }
    if given.tilt > 90.0 {
        return bad(format!("tilt = {}: expected at most 90 degrees", given.tilt));
    }
    let [low, high] = given.range;
    if !(low < high && low.is_finite() && high.is_finite()) {
        return bad(format!(
            "range = [{low}, {high}]: expected the smallest reading, then the largest"
        ));
    }
    let expected = given.expected();
    if !(low < expected && expected < high && expected > 0.0) {
        return bad(format!(
            "expected = {expected}: expected more than 0 and within range = [{low}, {high}]"
        ));
    }
    if !(1..=MOST).contains(&given.count) {
        return bad(format!("count = {}: expected 1 to {MOST}", given.count));
    }
    if !given.tool.iter().all(|x| x.is_finite()) {
        return bad("tool: expected three numbers".into());
    }
    if given.object.is_empty() {
        return bad("expected an [[object]] to measure".into());
    }
    for (k, object) in given.object.iter().enumerate() {
        object.check(given.gauge).map_err(|BadSetup(text)| {
            BadSetup(format!("object {} ({}): {text}", k + 1, object.name))
        })?;
        if given.object[..k].iter().any(|other| other.name == object.name) {
            return bad(format!("object {} is given twice", object.name));
        }
    }
    Ok(())
}

impl FileObject {
    fn check(&self, gauge: Kind) -> Result<(), BadSetup> {
        let is_word = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if self.name.is_empty() || !self.name.chars().all(is_word) {
            return Err(BadSetup("name: expected letters, digits, - _ or .".into()));
        }
        if !self.place.iter().chain(&self.angles).all(|x| x.is_finite()) {
            return Err(BadSetup("place, angles: expected three numbers".into()));
        }
        if gauge != Kind::Bar && !self.size.iter().all(|x| *x > 0.0 && x.is_finite()) {
            return Err(BadSetup("size = [X, Y]: expected the size of the plane".into()));
        }
        if !(self.cone > 0.0 && self.cone <= 90.0) {
            return Err(BadSetup(format!(
                "cone = {}: expected more than 0 and at most 90",
                self.cone
            )));
        }
        Ok(())
    }
}

impl File {
    /// Returns the expected reading: by default the middle of the range.
    fn expected(&self) -> f64 {
        self.expected.unwrap_or((self.range[0] + self.range[1]) / 2.0)
    }

    fn in_machine(self, config: &Mechanism) -> Setup {
        let scale = config.units_per_mm * if self.unit == Unit::Mm { 1.0 } else { 25.4 };
        let expected = self.expected();
        let lengths = |values: [f64; 3]| Vector3::from(values) * scale;
        let object = |object: &FileObject| {
            let [a, b, c] = object.angles;
            let rotation = Pose::from_degrees([0.0, 0.0, 0.0, a, b, c]).rotation();
            // LinuxCNC displays the tip without the spindle's offset.
            let frame = Frame { origin: lengths(object.place) - config.spindle, rotation };
            Object { name: object.name.clone(), frame }
        };
        let extent = |object: &FileObject| match self.gauge {
            Kind::Bar => Extent::Cone(object.cone),
            Kind::Dial | Kind::Feeler => Extent::Plane(object.size.map(|x| x * scale)),
        };
        Setup {
            expected,
            objects: self.object.iter().map(object).collect(),
            extents: self.object.iter().map(extent).collect(),
            count: self.count,
            tilt: self.tilt,
            clearance: self.clearance * scale,
            feed: self.feed * scale,
            gauge: Gauge {
                kind: self.gauge,
                scale: self.reading,
                deviation: self.deviation,
                range: self.range,
                zero: self.zero * scale,
                radius: self.radius * scale,
                tool: lengths(self.tool) + config.spindle,
            },
        }
    }
}
