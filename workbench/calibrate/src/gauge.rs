// SPDX-License-Identifier: GPL-2.0-or-later
//! Gauges that the operator reads: dial gauge, ball bar, feeler gauge; and their readings as input of the
//! estimator.
//!
//! | gauge | value read | measured |
//! | --- | --- | --- |
//! | dial | displacement of its point, pressed in by a plane | the face, with the tool shorter by this value |
//! | feeler | gap between tool and plane, along the plane's normal | the face, higher by this value |
//! | bar | distance of the tool's ball from a fixed ball | the distance |
//!
//! A plane is X and Y of its frame, with Z out of the workpiece: a plate's face, or an edge.

use super::log;
use super::model::Frame;
use super::reading::{Instrument, Measured, Reading, Zero};
use kinematics::{Fault, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use serde::Deserialize;
use std::fmt;

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A dial gauge in the spindle against a plane.
    Dial,
    /// A ball bar between a fixed ball and the ball of the tool; its whole length is read.
    Bar,
    /// A feeler gauge between the tool and a plane.
    Feeler,
}

impl Kind {
    const ALL: [Self; 3] = [Self::Dial, Self::Bar, Self::Feeler];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Dial => "dial",
            Self::Bar => "bar",
            Self::Feeler => "feeler",
        }
    }

    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// Unit of a gauge's readings.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Micrometer.
    Um,
    /// Millimeter.
    Mm,
    /// Thousandth of an inch.
    Thou,
    Inch,
}

impl Scale {
    pub(crate) const ALL: [Self; 4] = [Self::Um, Self::Mm, Self::Thou, Self::Inch];

    pub fn name(self) -> &'static str {
        match self {
            Self::Um => "um",
            Self::Mm => "mm",
            Self::Thou => "thou",
            Self::Inch => "inch",
        }
    }

    /// Returns the unit of this name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scale| scale.name() == name)
    }

    /// Returns its length in millimeters.
    pub(crate) fn in_mm(self) -> f64 {
        match self {
            Self::Um => 1e-3,
            Self::Mm => 1.0,
            Self::Thou => 0.0254,
            Self::Inch => 25.4,
        }
    }
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A gauge mounted in the spindle.
#[derive(Clone, Debug, PartialEq)]
pub struct Gauge {
    pub kind: Kind,
    /// Unit of its readings.
    pub scale: Scale,
    /// Standard deviation of one reading, in that unit.
    pub deviation: f64,
    /// Smallest and largest possible reading, in that unit.
    pub range: [f64; 2],
    /// Standard deviation of its zero, machine units: for a dial the position of its point, for a feeler and a bar
    /// their length.
    pub zero: f64,
    /// Radius of its end, machine units; 0 for a bar.
    pub radius: f64,
    /// Tool vector with the gauge at zero, spindle offset included, machine units.
    pub tool: Vector3<f64>,
}

/// An object that a gauge measures against.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    pub name: String,
    /// Approximate frame: of a plane with Z out of the workpiece, of a ball at its center.
    pub frame: Frame,
}

impl Gauge {
    /// Converts a length from machine units to the unit of the readings.
    pub(crate) fn shown(&self, config: &Mechanism, length: f64) -> f64 {
        length / (self.scale.in_mm() * config.units_per_mm)
    }

    /// Converts a reading to machine units.
    pub(crate) fn length(&self, config: &Mechanism, reading: f64) -> f64 {
        reading * self.scale.in_mm() * config.units_per_mm
    }

    /// Returns the direction in the platform frame in which the point of contact moves as the reading increases, or
    /// as the tool gets longer: the platform axis nearest to the plane's normal
    /// while the platform is level. `None` for a bar.
    pub(crate) fn axis(&self, object: &Object) -> Option<Vector3<f64>> {
        (self.kind != Kind::Bar).then(|| nearest_axis(&normal(object)))
    }

    /// Converts a reading at a pose to input of the estimator. `at` is the tip as LinuxCNC displays it, machine
    /// units and degrees.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub(crate) fn reading(
        &self,
        config: &Mechanism,
        object: &Object,
        at: [f64; 6],
        shown: f64,
    ) -> Result<Reading, Fault> {
        let pose = log::shown(config, at, &self.tool);
        let joints = config.machine.inverse(&pose, &self.tool)?;
        let length = self.length(config, shown);
        let axis = self.axis(object);
        let (measured, pressed) = match self.kind {
            Kind::Bar => (Measured::Distance(length), Vector3::zeros()),
            Kind::Feeler => (Measured::Face(self.radius + length), Vector3::zeros()),
            Kind::Dial => (Measured::Face(self.radius), axis.unwrap_or_default() * length),
        };
        // A dial with its point pressed in is equivalent to a shorter tool on the same platform.
        let tool = self.tool - pressed;
        let rotation = config.machine.full_pose(&pose, &self.tool)?.rotation();
        let position = pose.position - self.tool + rotation * pressed + tool;
        Ok(Reading {
            name: String::new(),
            group: 0,
            joints,
            pose: Pose { position, ..pose },
            tool,
            frame: 0,
            measured,
            instrument: Instrument {
                weight: 1.0,
                zero: (self.zero > 0.0).then_some(Zero { number: 0, axis }),
            },
        })
    }

    /// Returns the reading of the machine as drawn at a pose, with the object at its assumed position, in
    /// the unit of the readings. `None` if there is no finite reading.
    pub(crate) fn expected(
        &self,
        config: &Mechanism,
        object: &Object,
        at: [f64; 6],
    ) -> Option<f64> {
        let pose = log::shown(config, at, &self.tool);
        let away = object.frame.seen(&(pose.position - self.tool));
        let length = match self.kind {
            Kind::Bar => away.norm(),
            Kind::Feeler => away.z - self.radius,
            Kind::Dial => {
                let full = config.machine.full_pose(&pose, &self.tool).ok()?;
                let axis = full.rotation() * self.axis(object)?;
                (self.radius - away.z) / axis.dot(&normal(object))
            }
        };
        length.is_finite().then(|| self.shown(config, length))
    }

    /// Returns the derivative of the estimator's residual with respect to a reading, machine units per unit of the
    /// reading; NaN if the pose, with the tool vector `tool`, cannot be reached.
    pub(crate) fn slope(
        &self,
        config: &Mechanism,
        object: &Object,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> f64 {
        let rate = match self.axis(object) {
            Some(axis) if self.kind == Kind::Dial => {
                let full = config.machine.full_pose(pose, tool);
                full.map_or(f64::NAN, |full| (full.rotation() * axis).dot(&normal(object)))
            }
            _ => -1.0,
        };
        self.length(config, rate)
    }
}

/// Returns Z of the frame in base: out of the workpiece.
pub(crate) fn normal(object: &Object) -> Vector3<f64> {
    object.frame.rotation.column(2).into()
}

/// Returns the signed axis nearest to a direction.
fn nearest_axis(direction: &Vector3<f64>) -> Vector3<f64> {
    let largest = direction.iamax();
    Vector3::from_fn(|k, _| if k == largest { direction[k].signum() } else { 0.0 })
}
