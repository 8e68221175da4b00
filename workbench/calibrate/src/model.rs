// SPDX-License-Identifier: GPL-2.0-or-later
//! What may change: the parameters of a machine and of its measuring frames, the drawing's
//! values with their tolerances, and the machine that a set of changes makes.

use kinematics::leg::StrutGeometry;
use kinematics::{Fault, Geometry, LegGeometry, LegKind, MAX_LEGS, Machine, PerLeg, Vector3};
use nalgebra::{Matrix3, Rotation3};

/// What a parameter is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A coordinate of a leg's base anchor.
    Base(usize, usize),
    /// A coordinate of a leg's platform anchor.
    Platform(usize, usize),
    /// What a leg's length depends on: OFFSET of a strut, ROD of the others.
    Length(usize),
    /// The screw lead of all struts.
    Lead,
    /// How much later than on touching the probe trips, along its way.
    Trigger,
    /// What a gauge shows too much: its zero, by number.
    Zero(usize),
    /// Place (0 to 2) or rotation (3 to 5, radians) of a measuring frame, in base.
    Frame(usize, usize),
}

impl Quantity {
    /// Whether the machine's INI file holds it.
    pub fn is_of_machine(self) -> bool {
        !matches!(self, Quantity::Trigger | Quantity::Zero(_) | Quantity::Frame(..))
    }
}

/// A parameter, and how far from the drawing it may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Where it stands.
    pub quantity: Quantity,
    /// Standard deviation of what was built from what was drawn, in the parameter's unit.
    pub deviation: f64,
}

/// A measuring frame: a plate, a tracker, the base of a ball-bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Its origin in base.
    pub origin: Vector3<f64>,
    /// Base from frame.
    pub rotation: Matrix3<f64>,
}

impl Frame {
    /// The machine's own.
    pub const BASE: Self = Self {
        origin: Vector3::new(0.0, 0.0, 0.0),
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    };

    /// A point of base, in the frame.
    pub fn seen(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (point - self.origin)
    }
}

/// How far a machine may be from its drawing: standard deviations, machine units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Of a coordinate of an anchor.
    pub anchor: f64,
    /// Of a strut's offset or a rod's length.
    pub length: f64,
    /// Of the lead, as a share of it; 0 leaves it alone.
    pub lead: f64,
    /// Of the way by which the probe trips late; 0 leaves it out.
    pub trigger: f64,
}

impl Tolerance {
    /// This one for everything that has a length, lead and trigger left alone.
    pub fn of_lengths(tolerance: f64) -> Self {
        Self { anchor: tolerance, length: tolerance, lead: 0.0, trigger: 0.0 }
    }
}

/// A machine as drawn, and what of it may change.
#[derive(Clone, Debug)]
pub struct Model {
    /// As drawn.
    pub geometry: Geometry,
    /// Joint offsets as drawn.
    pub offsets: PerLeg,
    /// Measuring frames, about where they are.
    pub frames: Vec<Frame>,
    /// What may change, and how far.
    pub parameters: Vec<Parameter>,
    /// Largest length of the machine.
    size: f64,
    /// Radius of the platform.
    radius: f64,
}

impl Model {
    /// Seven parameters a leg, five of one on a ring, and those of `tolerance` that are not 0; of the
    /// frames none.
    ///
    /// # Errors
    /// The drawing makes no machine.
    pub fn new(geometry: Geometry, offsets: PerLeg, tolerance: &Tolerance) -> Result<Self, Fault> {
        let drawn = Machine::freeze(&geometry, &offsets)?;
        let (size, radius) = (drawn.size(), drawn.radius());
        let mut parameters = vec![];
        let mut add = |quantity, deviation| parameters.push(Parameter { quantity, deviation });
        for leg in 0..geometry.legs().len() {
            (0..3).for_each(|axis| add(Quantity::Base(leg, axis), tolerance.anchor));
            // The axis of its ring is the tool axis: only the height may be another.
            let of_ring = matches!(geometry.legs()[leg].kind, LegKind::Ring(_));
            let moved = if of_ring { 2..3 } else { 0..3 };
            moved.for_each(|axis| add(Quantity::Platform(leg, axis), tolerance.anchor));
            add(Quantity::Length(leg), tolerance.length);
        }
        let leads = geometry.legs().iter().map(|leg| leg.kind.screw().lead.abs());
        let lead = leads.fold(0.0, f64::max);
        if tolerance.lead * lead > 0.0 {
            add(Quantity::Lead, tolerance.lead * lead);
        }
        if tolerance.trigger > 0.0 {
            add(Quantity::Trigger, tolerance.trigger);
        }
        Ok(Self { geometry, offsets, frames: vec![], parameters, size, radius })
    }

    /// A frame that stays where it is.
    pub fn with_frame(mut self, frame: Frame) -> Self {
        self.frames.push(frame);
        self
    }

    /// A frame whose place is known to be about there: within a tenth of the machine's size, and
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

    /// Another gauge, whose zero is known to this standard deviation, machine units; 0 leaves it alone.
    pub(crate) fn with_zero(mut self, number: usize, deviation: f64) -> Self {
        if deviation > 0.0 {
            self.parameters.push(Parameter { quantity: Quantity::Zero(number), deviation });
        }
        self
    }

    /// Largest length of the machine.
    pub(crate) fn size(&self) -> f64 {
        self.size
    }

    /// Radius of the platform as drawn: what weighs angles against lengths must not follow the
    /// parameters.
    pub(crate) fn radius(&self) -> f64 {
        self.radius
    }

    /// Number of a parameter, if it may change.
    pub fn number(&self, quantity: Quantity) -> Option<usize> {
        self.parameters.iter().position(|parameter| parameter.quantity == quantity)
    }

    /// The geometry and joint offsets with these changes.
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
                // What has no rod is longer by its offset.
                Quantity::Length(i) => {
                    *of(&mut legs[i]).kind.rod().unwrap_or(&mut offsets[i]) += change;
                }
                Quantity::Lead => legs.iter_mut().flatten().for_each(|leg| turn_more(leg, *change)),
                Quantity::Trigger | Quantity::Zero(_) | Quantity::Frame(..) => {}
            }
        }
        let layout = *self.geometry.layout();
        let mut geometry = Geometry::of_layout(layout, |i| *of(&mut legs[i].clone()));
        geometry.centre = self.geometry.centre;
        geometry.home = self.geometry.home;
        (geometry, offsets)
    }

    /// The machine with these changes.
    ///
    /// # Errors
    /// They make no machine.
    pub fn machine(&self, changes: &[f64]) -> Result<Machine, Fault> {
        let (geometry, offsets) = self.changed(changes);
        Machine::freeze(&geometry, &offsets)
    }

    /// A frame with these changes.
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

    /// Axis about which a frame turns, in base, when its parameter `axis` (0 to 2 of the rotation)
    /// grows: rotation vectors add up as turns only where they are small.
    pub(crate) fn turn_axis(&self, k: usize, axis: usize, changes: &[f64]) -> Vector3<f64> {
        let part = |i: usize| self.number(Quantity::Frame(k, i)).map_or(0.0, |n| changes[n]);
        let turn = Vector3::new(part(3), part(4), part(5));
        let d = unit(axis);
        // The left Jacobian of the rotation group, its (1 − cos θ)/θ² and (θ − sin θ)/θ³ as series,
        // which need no case of their own at 0: good to 1e-9 for a third of a radian.
        let square = turn.norm_squared();
        let first = 1.0 / 2.0 - square / 24.0 + square * square / 720.0;
        let second = 1.0 / 6.0 - square / 120.0 + square * square / 5040.0;
        d + first * turn.cross(&d) + second * turn.cross(&turn.cross(&d))
    }

    /// What a gauge shows too much.
    pub(crate) fn zero(&self, number: usize, changes: &[f64]) -> f64 {
        self.number(Quantity::Zero(number)).map_or(0.0, |k| changes[k])
    }

    /// How late the probe trips.
    pub(crate) fn trigger(&self, changes: &[f64]) -> f64 {
        self.number(Quantity::Trigger).map_or(0.0, |k| changes[k])
    }
}

/// A leg that the machine has.
fn of(leg: &mut Option<LegGeometry>) -> &mut LegGeometry {
    leg.as_mut().expect("places are made of the legs that there are")
}

/// A lead keeps its hand, and a strut without one stays so.
fn turn_more(leg: &mut LegGeometry, change: f64) {
    if let LegKind::Strut(StrutGeometry { lead, .. }) = &mut leg.kind
        && *lead != 0.0
    {
        *lead += change * lead.signum();
    }
}

/// Unit vector of an axis.
pub(super) fn unit(axis: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)))
}
