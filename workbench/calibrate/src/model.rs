// SPDX-License-Identifier: GPL-2.0-or-later
//! The parameters of a machine and of its measuring frames, the drawing's
//! values with their tolerances, and the machine that results from a set of changes.

use super::constraint::{self, ConstraintPart};
use kinematics::leg::StrutGeometry;
use kinematics::{
    Fault, Geometry, Joints, LegGeometry, LegKind, MAX_LEGS, Machine, PerLeg, Vector3,
};
use nalgebra::{Matrix3, Rotation3};

/// A parameter's quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A coordinate of a leg's base anchor.
    Base(usize, usize),
    /// A coordinate of a leg's platform anchor.
    Platform(usize, usize),
    /// A length of the leg: OFFSET of a strut, ROD of the others.
    Length(usize),
    /// A part of a constraint of the platform.
    Constraint(usize, ConstraintPart),
    /// The screw lead of all struts.
    Lead,
    /// Travel of all joints from home, per commanded travel, minus 1.
    Scale,
    /// Distance that the probe travels after the touch before it trips.
    Trigger,
    /// Error of a gauge's zero, by number.
    Zero(usize),
    /// Position (0 to 2) or rotation (3 to 5, radians) of a measuring frame, in base.
    Frame(usize, usize),
}

impl Quantity {
    /// Returns whether the machine's INI file contains it.
    pub fn is_of_machine(self) -> bool {
        !matches!(self, Quantity::Trigger | Quantity::Zero(_) | Quantity::Frame(..))
    }
}

/// A parameter, and its permitted deviation from the drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    pub quantity: Quantity,
    /// Standard deviation of the built value from the drawn one, in the parameter's unit.
    pub deviation: f64,
}

/// A measuring frame: a plate, a tracker, the base of a ball-bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Origin of the frame, in base.
    pub origin: Vector3<f64>,
    /// Rotation from frame to base.
    pub rotation: Matrix3<f64>,
}

impl Frame {
    /// The machine's own frame.
    pub const BASE: Self = Self {
        origin: Vector3::new(0.0, 0.0, 0.0),
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    };

    /// Converts a point from base to the frame.
    pub fn seen(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (point - self.origin)
    }
}

/// Deviation of a machine from its drawing: standard deviations, machine units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Deviation of a coordinate of an anchor.
    pub anchor: f64,
    /// Deviation of a strut's offset or a rod's length.
    pub length: f64,
    /// Deviation of the lead, as a share of it; 0 keeps the lead fixed.
    pub lead: f64,
    /// Deviation of the distance by which the probe trips late; 0 omits this parameter.
    pub trigger: f64,
}

impl Tolerance {
    /// Creates the same tolerance for all lengths, without lead and trigger.
    pub fn of_lengths(tolerance: f64) -> Self {
        Self { anchor: tolerance, length: tolerance, lead: 0.0, trigger: 0.0 }
    }
}

/// A machine as drawn, and its parameters.
#[derive(Clone, Debug)]
pub struct Model {
    /// The geometry as drawn.
    pub geometry: Geometry,
    /// Joint offsets as drawn.
    pub offsets: PerLeg,
    /// Measuring frames, at their approximate poses.
    pub frames: Vec<Frame>,
    /// The parameters, and their deviations.
    pub parameters: Vec<Parameter>,
    /// Joints at home, from which the drives' scale counts.
    pub(crate) home: Joints,
    /// Largest length of the machine.
    size: f64,
    /// Radius of the platform.
    radius: f64,
}

impl Model {
    /// Creates a model with seven parameters per leg (five for a leg on a ring), those of constraints, those of `tolerance`
    /// that are not 0, and no frames.
    ///
    /// # Errors
    /// The drawing is not a valid machine.
    pub fn new(geometry: Geometry, offsets: PerLeg, tolerance: &Tolerance) -> Result<Self, Fault> {
        let drawn = Machine::freeze(&geometry, &offsets)?;
        let (size, radius) = (drawn.size(), drawn.radius());
        let mut parameters = vec![];
        let mut add = |quantity, deviation| parameters.push(Parameter { quantity, deviation });
        for leg in 0..geometry.legs().len() {
            (0..3).for_each(|axis| add(Quantity::Base(leg, axis), tolerance.anchor));
            // The axis of its ring is the tool axis: only the height is a parameter.
            let of_ring = matches!(geometry.legs()[leg].kind, LegKind::Ring(_));
            let moved = if of_ring { 2..3 } else { 0..3 };
            moved.for_each(|axis| add(Quantity::Platform(leg, axis), tolerance.anchor));
            add(Quantity::Length(leg), tolerance.length);
        }
        for quantity in constraint::parameters(&geometry, size) {
            add(quantity, tolerance.anchor);
        }
        let leads = geometry.legs().iter().map(|leg| leg.kind.screw().lead.abs());
        let lead = leads.fold(0.0, f64::max);
        if tolerance.lead * lead > 0.0 {
            add(Quantity::Lead, tolerance.lead * lead);
        }
        if tolerance.trigger > 0.0 {
            add(Quantity::Trigger, tolerance.trigger);
        }
        let home = Joints::default();
        Ok(Self { geometry, offsets, frames: vec![], parameters, home, size, radius })
    }

    /// Adds a frame with a fixed pose.
    pub fn with_frame(mut self, frame: Frame) -> Self {
        self.frames.push(frame);
        self
    }

    /// Adds a frame whose pose is known approximately: within a tenth of the machine's size, and
    /// of a radian.
    pub fn with_unknown_frame(mut self, frame: Frame) -> Self {
        let k = self.frames.len();
        self.frames.push(frame);
        for axis in 0..6 {
            let deviation = if axis < 3 { 0.1 * self.size } else { 0.1 };
            self.parameters.push(Parameter { quantity: Quantity::Frame(k, axis), deviation });
        }
        self
    }

    /// Adds a gauge whose zero has this standard deviation, machine units; 0 keeps it fixed.
    pub(crate) fn with_zero(mut self, number: usize, deviation: f64) -> Self {
        if deviation > 0.0 {
            self.parameters.push(Parameter { quantity: Quantity::Zero(number), deviation });
        }
        self
    }

    /// Adds the scale of the drives, homed at these joints, with this standard deviation.
    pub(crate) fn with_scale(mut self, home: Joints, deviation: f64) -> Self {
        self.home = home;
        self.parameters.push(Parameter { quantity: Quantity::Scale, deviation });
        self
    }

    /// Returns the largest length of the machine.
    pub(crate) fn size(&self) -> f64 {
        self.size
    }

    /// Returns the radius of the platform as drawn: the weight of angles relative to lengths must not depend on the
    /// parameters.
    pub(crate) fn radius(&self) -> f64 {
        self.radius
    }

    /// Returns the index of a parameter, if the model has it.
    pub fn number(&self, quantity: Quantity) -> Option<usize> {
        self.parameters.iter().position(|parameter| parameter.quantity == quantity)
    }

    /// Returns the geometry and joint offsets with these changes.
    pub(crate) fn changed(&self, changes: &[f64]) -> (Geometry, PerLeg) {
        let mut legs = [None; MAX_LEGS];
        for (leg, given) in legs.iter_mut().zip(self.geometry.legs()) {
            *leg = Some(*given);
        }
        let mut offsets = self.offsets;
        for (parameter, change) in self.parameters.iter().zip(changes) {
            match parameter.quantity {
                Quantity::Base(i, axis) => of(&mut legs[i]).base[axis] += change,
                Quantity::Platform(i, axis) => of(&mut legs[i]).platform[axis] += change,
                // Legs without a rod change by their offset.
                Quantity::Length(i) => {
                    *of(&mut legs[i]).kind.rod().unwrap_or(&mut offsets[i]) += change;
                }
                Quantity::Lead => legs.iter_mut().flatten().for_each(|leg| turn_more(leg, *change)),
                // The derivatives at scale 1 are all that is used.
                Quantity::Scale => {}
                // After the legs, which they may share joints with.
                Quantity::Constraint(..) => {}
                Quantity::Trigger | Quantity::Zero(_) | Quantity::Frame(..) => {}
            }
        }
        let layout = *self.geometry.layout();
        let mut geometry = Geometry::of_layout(layout, |i| *of(&mut legs[i].clone()));
        geometry.centre = self.geometry.centre;
        geometry.home = self.geometry.home;
        let given = self.parameters.iter().map(|parameter| parameter.quantity);
        let given: Vec<_> = given.zip(changes.iter().copied()).collect();
        let legs = geometry;
        let sizes = (self.size, self.radius);
        geometry = geometry
            .with_constraints(|i| constraint::changed(&self.geometry, &legs, i, sizes, &given));
        (geometry, offsets)
    }

    /// Returns the machine with these changes.
    ///
    /// # Errors
    /// The changed geometry is not a valid machine.
    pub fn machine(&self, changes: &[f64]) -> Result<Machine, Fault> {
        let (geometry, offsets) = self.changed(changes);
        Machine::freeze(&geometry, &offsets)
    }

    /// Returns a frame with these changes.
    pub fn frame(&self, k: usize, changes: &[f64]) -> Frame {
        let mut change = [0.0; 6];
        for (parameter, value) in self.parameters.iter().zip(changes) {
            if let Quantity::Frame(frame, axis) = parameter.quantity
                && frame == k
            {
                change[axis] = *value;
            }
        }
        let [x, y, z, a, b, c] = change;
        Frame {
            origin: self.frames[k].origin + Vector3::new(x, y, z),
            rotation: Rotation3::new(Vector3::new(a, b, c)).into_inner() * self.frames[k].rotation,
        }
    }

    /// Returns the axis about which a frame turns, in base, as its parameter `axis` (0 to 2 of the rotation)
    /// increases: rotation vectors add up as rotations only if they are small.
    pub(crate) fn turn_axis(&self, k: usize, axis: usize, changes: &[f64]) -> Vector3<f64> {
        let part = |i: usize| self.number(Quantity::Frame(k, i)).map_or(0.0, |n| changes[n]);
        let turn = Vector3::new(part(3), part(4), part(5));
        let d = unit(axis);
        // The left Jacobian of the rotation group, with its (1 − cos θ)/θ² and (θ − sin θ)/θ³ as series,
        // which need no special case at 0: accurate to 1e-9 for a third of a radian.
        let square = turn.norm_squared();
        let first = 1.0 / 2.0 - square / 24.0 + square * square / 720.0;
        let second = 1.0 / 6.0 - square / 120.0 + square * square / 5040.0;
        d + first * turn.cross(&d) + second * turn.cross(&turn.cross(&d))
    }

    /// Returns the error of a gauge's zero.
    pub(crate) fn zero(&self, number: usize, changes: &[f64]) -> f64 {
        self.number(Quantity::Zero(number)).map_or(0.0, |k| changes[k])
    }

    /// Returns the distance by which the probe trips late.
    pub(crate) fn trigger(&self, changes: &[f64]) -> f64 {
        self.number(Quantity::Trigger).map_or(0.0, |k| changes[k])
    }
}

/// Returns a leg of the machine.
fn of(leg: &mut Option<LegGeometry>) -> &mut LegGeometry {
    leg.as_mut().expect("places are made of the legs that there are")
}

/// Increases the magnitude of a lead; its hand is unchanged, and a strut without a lead keeps none.
fn turn_more(leg: &mut LegGeometry, change: f64) {
    if let LegKind::Strut(StrutGeometry { lead, .. }) = &mut leg.kind
        && *lead != 0.0
    {
        *lead += change * lead.signum();
    }
}

/// Returns the unit vector of an axis.
pub(super) fn unit(axis: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)))
}
