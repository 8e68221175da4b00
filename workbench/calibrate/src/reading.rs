// SPDX-License-Identifier: GPL-2.0-or-later
//! Measurements: a reading of the tip at known joints, its residual, and the dependence of the residual on
//! the tip and the measuring frame.

use super::model::{Frame, Model, Quantity, unit};
use kinematics::{Fault, Joints, Letter, Machine, Pose, Solver, Vector3};
use machine::rows::{follow_on_work, rate_map, with_dependent};
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion};

/// The quantity that a reading measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// The probe's ball touched the wall of a bore along Z of the frame: X, Y of the bore's axis in the frame, and
    /// the distance between ball center and axis.
    Bore {
        axis: [f64; 2],
        /// Radius of the bore minus that of the ball.
        radius: f64,
    },
    /// The ball touched a face perpendicular to Z of the frame from above: height of the ball's center.
    Face(f64),
    /// Position of the tip in the frame.
    Position(Vector3<f64>),
    /// Position of the tip, and platform orientation, in the frame.
    Pose(Vector3<f64>, Matrix3<f64>),
    /// Distance of the tip from the frame's origin.
    Distance(f64),
}

impl Measured {
    /// Returns the number of values.
    pub(crate) fn rows(&self) -> usize {
        match self {
            Measured::Bore { .. } | Measured::Face(_) | Measured::Distance(_) => 1,
            Measured::Position(_) => 3,
            Measured::Pose(..) => 6,
        }
    }
}

/// The instrument of a typed number; for probes and trackers the default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instrument {
    /// Ratio of the noise to the instrument's standard deviation.
    pub weight: f64,
    /// The instrument's zero, if it is a parameter.
    pub zero: Option<Zero>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zero {
    pub number: usize,
    /// Direction in which the point of contact moves as the reading increases, in the platform frame; `None` for an
    /// instrument that measures distances.
    pub axis: Option<Vector3<f64>>,
}

impl Default for Instrument {
    fn default() -> Self {
        Self { weight: 1.0, zero: None }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// Name for messages: the reading's place in the input.
    pub name: String,
    /// Readings of one pose have the same group, and are held out together.
    pub group: usize,
    /// Joints at the reading.
    pub joints: Joints,
    /// Pose according to the control.
    pub pose: Pose,
    /// Tool vector, spindle offset included.
    pub tool: Vector3<f64>,
    pub frame: usize,
    pub measured: Measured,
    /// The measuring instrument.
    pub instrument: Instrument,
}

/// Slightly changed machines, for the derivatives with respect to the parameters.
pub struct Beside {
    /// For every parameter of the machine its index, the joint that depends on it (`None` for all joints),
    /// and the index of its pair.
    entries: Vec<(usize, Option<usize>, usize)>,
    /// Pairs of machines with the parameter increased and decreased.
    pairs: Vec<(Machine, Machine)>,
    step: f64,
}

/// Step of the derivatives with respect to the parameters, in sizes of the machine: rounding of 1e-16 over it
/// and its square over the size both stay below 1e-8 of the derivative.
const STEP: f64 = 1e-7;

impl Beside {
    /// Creates the neighbors of the machine with these changes: legs are independent, so the same parameter of all
    /// legs needs one pair. With constraints, which share joints with legs, every parameter needs its own.
    fn new(model: &Model, changes: &[f64]) -> Result<Self, Fault> {
        let step = STEP * model.size();
        let mut kinds: Vec<(usize, usize)> = vec![];
        let is_bound = model.geometry.layout().constraints() > 0;
        let mut entries = vec![];
        for (k, parameter) in model.parameters.iter().enumerate() {
            let (kind, leg) = match parameter.quantity {
                Quantity::Base(leg, axis) => (axis, Some(leg)),
                Quantity::Platform(leg, axis) => (3 + axis, Some(leg)),
                Quantity::Length(leg) => (6, Some(leg)),
                Quantity::Lead => (7, None),
                Quantity::Constraint(..) => (0, None),
                Quantity::Scale | Quantity::Trigger | Quantity::Zero(_) | Quantity::Frame(..) => {
                    continue;
                }
            };
            let known = kinds.iter().position(|(other, _)| *other == kind);
            let pair = known.filter(|_| !is_bound).unwrap_or_else(|| {
                kinds.push((kind, entries.len()));
                kinds.len() - 1
            });
            entries.push((k, leg.filter(|_| !is_bound), pair));
        }
        let moved = |pair: usize, step: f64| {
            let mut changes = changes.to_vec();
            for (k, _, _) in entries.iter().filter(|entry| entry.2 == pair) {
                changes[*k] += step;
            }
            model.machine(&changes)
        };
        let pairs = (0..kinds.len())
            .map(|pair| Ok((moved(pair, step)?, moved(pair, -step)?)))
            .collect::<Result<_, Fault>>()?;
        Ok(Self { entries, pairs, step })
    }

    /// Returns ∂f/∂H at a pose: derivatives of the joints with respect to the parameters of the machine.
    fn joint_rates(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        joints: usize,
        parameters: usize,
    ) -> Result<DMatrix<f64>, Fault> {
        let mut rates = DMatrix::zeros(joints, parameters);
        let by = |(more, less): &(Machine, Machine)| -> Result<Vec<f64>, Fault> {
            let (more, less) = (more.inverse(pose, tool)?, less.inverse(pose, tool)?);
            Ok((0..joints).map(|i| (more[i] - less[i]) / (2.0 * self.step)).collect())
        };
        let by: Vec<Vec<f64>> = self.pairs.iter().map(by).collect::<Result<_, Fault>>()?;
        for (k, leg, pair) in &self.entries {
            let own = leg.map_or(0..joints, |leg| leg..leg + 1);
            own.for_each(|i| rates[(i, *k)] = by[*pair][i]);
        }
        Ok(rates)
    }
}

/// A machine with changes, and the data for derivatives with respect to them.
pub struct Changed<'a> {
    model: &'a Model,
    changes: &'a [f64],
    pub machine: Machine,
    beside: Beside,
}

/// Pose of a reading, and its derivatives with respect to the parameters at fixed joints.
pub struct Posed {
    /// True pose, if these changes are the true ones.
    pub pose: Pose,
    /// The tip, in base.
    pub tip: Vector3<f64>,
    /// Rows x y z (machine units) and the rotation about base axes (radians), columns parameters.
    pub rates: DMatrix<f64>,
}

impl<'a> Changed<'a> {
    /// Creates the machine of a model with these changes.
    ///
    /// # Errors
    /// The changed geometry is not a valid machine.
    pub fn new(model: &'a Model, changes: &'a [f64]) -> Result<Self, Fault> {
        let beside = Beside::new(model, changes)?;
        Ok(Self { model, changes, machine: model.machine(changes)?, beside })
    }

    /// Solves the pose of these joints near `seed`.
    ///
    /// # Errors
    /// As [`Machine::forward`].
    pub(crate) fn posed(
        &self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Posed, Fault> {
        let solver = Solver { residual_limit: self.model.size(), ..Solver::default() };
        let pose = self.machine.forward(joints, seed, tool, &solver)?.pose;
        self.at(pose, tool)
    }

    /// Computes tip and derivatives at a pose.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn at(&self, pose: Pose, tool: &Vector3<f64>) -> Result<Posed, Fault> {
        let layout = self.machine.layout();
        // The position of a table is fixed, not the tip's position above it.
        let letters = [layout.coordinates().as_slice(), layout.table().as_slice()].concat();
        let joints = layout.joints();
        let jacobian = self.machine.at(&pose, tool)?.pose_jacobian()?;
        let active =
            DMatrix::from_fn(joints, letters.len(), |i, k| jacobian[(i, letters[k].index())]);
        let mut by = self.beside.joint_rates(&pose, tool, joints, self.model.parameters.len())?;
        if let Some(k) = self.model.number(Quantity::Scale) {
            // Drives that travel farther are equivalent to joints that must travel less.
            let reached = self.machine.inverse(&pose, tool)?;
            (0..joints).for_each(|i| by[(i, k)] = self.model.home[i] - reached[i]);
        }
        let weighted = self.weighted(&active, &by);
        let normal = weighted.transpose() * &active;
        let solved = normal.lu().solve(&(weighted.transpose() * by));
        let solved =
            solved.unwrap_or_else(|| DMatrix::zeros(letters.len(), self.model.parameters.len()));
        let tip = pose.position - tool;
        if layout.constraints() > 0 {
            return self.with_dependent(&pose, tool, &letters, &-solved);
        }
        Ok(Posed { tip, rates: twist(&pose, &letters, &-solved), pose })
    }

    /// Returns the pose with its dependent coordinates, and their derivatives: they follow the commanded ones, whose rates
    /// are given, and depend on the constraints.
    fn with_dependent(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        letters: &[Letter],
        commanded: &DMatrix<f64>,
    ) -> Result<Posed, Fault> {
        let at = self.machine.at(pose, tool)?;
        let (geometry, _) = self.model.changed(self.changes);
        let follow = follow_on_work(&geometry, self.machine.radius(), &at, tool);
        let mut own = DMatrix::zeros(6, commanded.ncols());
        for (row, letter) in letters.iter().enumerate() {
            let k = letter.index();
            let unit = if k < 3 { 1.0 } else { 1_f64.to_radians() };
            own.set_row(k, &(commanded.row(row) * unit));
        }
        let whole = with_dependent(&self.machine, pose, tool)?;
        let mut rates = to_twist(&whole) * follow * own;
        let beside = &self.beside;
        for (k, _, pair) in &beside.entries {
            let (more, less) = &beside.pairs[*pair];
            let [more, less] = [more, less].map(|machine| with_dependent(machine, pose, tool));
            let change = twist_between(&less?, &more?) / (2.0 * beside.step);
            let mut column = rates.column_mut(*k);
            column += change;
        }
        Ok(Posed { tip: whole.position - tool, rates, pose: whole })
    }

    /// Weights rows as the forward kinematics weight contradicting legs, by their lengths: a
    /// joint's error counts by the square of the rate at which its leg's length follows it.
    fn weighted(&self, rows: &DMatrix<f64>, by: &DMatrix<f64>) -> DMatrix<f64> {
        let joint_by_length = |leg: usize| {
            self.model.number(Quantity::Length(leg)).map_or(1.0, |number| by[(leg, number)])
        };
        DMatrix::from_fn(rows.nrows(), rows.ncols(), |i, k| {
            rows[(i, k)] / joint_by_length(i).powi(2)
        })
    }

    /// Returns the residuals of a reading, and their derivatives with respect to all parameters.
    ///
    /// # Errors
    /// As [`Machine::forward`].
    pub fn residual(
        &self,
        reading: &Reading,
        seed: &Pose,
    ) -> Result<(DVector<f64>, DMatrix<f64>, Pose), Fault> {
        let posed = self.posed(&reading.joints, seed, &reading.tool)?;
        let seen = self.seen(reading, &posed);
        Ok((seen.0, seen.1, posed.pose))
    }

    /// Returns the residuals and derivatives of a reading whose pose is known, as [`Changed::residual`].
    pub(crate) fn seen(&self, reading: &Reading, posed: &Posed) -> (DVector<f64>, DMatrix<f64>) {
        let frame = self.model.frame(reading.frame, self.changes);
        let shifted = self.with_zero(reading, posed);
        let posed = shifted.as_ref().unwrap_or(posed);
        let away = posed.tip - frame.origin;
        let (residual, by_tip) = self.by_tip(reading, posed, &frame);
        let mut jacobian = by_tip.columns(0, 3) * posed.rates.rows(0, 3)
            + by_tip.columns(3, 3) * posed.rates.rows(3, 3);
        for (k, parameter) in self.model.parameters.iter().enumerate() {
            match parameter.quantity {
                Quantity::Frame(number, axis) if number == reading.frame => {
                    // Moving the frame is equivalent to moving the tip in the opposite direction.
                    let (shift, turn) = match axis {
                        0..3 => (unit(axis), Vector3::zeros()),
                        _ => {
                            let turn = self.model.turn_axis(number, axis - 3, self.changes);
                            (turn.cross(&away), turn)
                        }
                    };
                    let column = by_tip.columns(0, 3) * shift + by_tip.columns(3, 3) * turn;
                    jacobian.set_column(k, &-column);
                }
                Quantity::Trigger => jacobian.set_column(k, &by_trigger(&reading.measured)),
                Quantity::Zero(number) => {
                    if let Some(zero) = reading.instrument.zero.filter(|z| z.number == number) {
                        jacobian.set_column(k, &by_zero(&zero, &by_tip, posed));
                    }
                }
                _ => {}
            }
        }
        (residual, jacobian)
    }

    /// Returns the error of a gauge's zero, or 0 for an instrument without one.
    fn zero(&self, reading: &Reading) -> f64 {
        let zero = reading.instrument.zero;
        zero.map_or(0.0, |zero| self.model.zero(zero.number, self.changes))
    }

    /// Returns the pose with the point of contact shifted by the error of the gauge's zero.
    fn with_zero(&self, reading: &Reading, posed: &Posed) -> Option<Posed> {
        let axis = reading.instrument.zero?.axis?;
        let shift = posed.pose.rotation() * axis * self.zero(reading);
        let mut rates = posed.rates.clone();
        let turned = shift.cross_matrix() * posed.rates.rows(3, 3);
        let mut places = rates.rows_mut(0, 3);
        places -= turned;
        Some(Posed { pose: posed.pose, tip: posed.tip + shift, rates })
    }

    /// Returns residuals, and their derivatives with respect to the tip's position and the rotation about it, in base.
    fn by_tip(
        &self,
        reading: &Reading,
        posed: &Posed,
        frame: &Frame,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let local = frame.seen(&posed.tip);
        let trigger = self.model.trigger(self.changes);
        let one = |value: f64, direction: Vector3<f64>| {
            let direction = frame.rotation * direction;
            let row = DMatrix::from_fn(1, 6, |_, k| if k < 3 { direction[k] } else { 0.0 });
            (DVector::from_element(1, value), row)
        };
        match &reading.measured {
            Measured::Bore { axis, radius } => {
                let out = Vector3::new(local.x - axis[0], local.y - axis[1], 0.0);
                let distance = out.norm().max(f64::MIN_POSITIVE);
                one(distance - radius - trigger, out / distance)
            }
            Measured::Face(height) => one(local.z - height + trigger, Vector3::z()),
            Measured::Distance(length) => {
                let distance = local.norm().max(f64::MIN_POSITIVE);
                one(distance - length - self.zero(reading), local / distance)
            }
            Measured::Position(place) => {
                let turned = frame.rotation.transpose();
                let by = DMatrix::from_fn(3, 6, |i, k| if k < 3 { turned[(i, k)] } else { 0.0 });
                (DVector::from_column_slice((local - place).as_slice()), by)
            }
            Measured::Pose(place, rotation) => self.of_pose(posed, frame, place, rotation),
        }
    }

    /// Returns residuals and derivatives of a measured pose. Angles are multiplied by the platform's radius, so they
    /// have the unit of lengths.
    fn of_pose(
        &self,
        posed: &Posed,
        frame: &Frame,
        place: &Vector3<f64>,
        rotation: &Matrix3<f64>,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let (turned, radius) = (frame.rotation.transpose(), self.model.radius());
        let off = turned * posed.pose.rotation() * rotation.transpose();
        // Via the quaternion: the angle of a matrix is an arc cosine, with no resolution below 1e-8.
        let off = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(off));
        let turn = off.scaled_axis();
        let miss = frame.seen(&posed.tip) - place;
        let residual =
            DVector::from_iterator(6, miss.iter().copied().chain((turn * radius).iter().copied()));
        let turned_on = rates_of_vector(&turn) * turned;
        let by = DMatrix::from_fn(6, 6, |i, k| match (i < 3, k < 3) {
            (true, true) => turned[(i, k)],
            (false, false) => turned_on[(i - 3, k - 3)] * radius,
            _ => 0.0,
        });
        (residual, by)
    }
}

/// Returns the derivative of a rotation vector with respect to a further rotation about fixed axes: the inverse of
/// the left Jacobian of the rotation group, its last factor as a series, accurate to 1e-7 up to 40 degrees.
fn rates_of_vector(turn: &Vector3<f64>) -> Matrix3<f64> {
    let square = turn.norm_squared();
    let cross = turn.cross_matrix();
    let second = 1.0 / 12.0 + square / 720.0 + square * square / 30240.0;
    Matrix3::identity() - cross / 2.0 + cross * cross * second
}

fn by_trigger(measured: &Measured) -> DVector<f64> {
    let rate = match measured {
        Measured::Bore { .. } => -1.0,
        Measured::Face(_) => 1.0,
        Measured::Position(_) | Measured::Pose(..) | Measured::Distance(_) => 0.0,
    };
    DVector::from_element(measured.rows(), rate)
}

/// Returns the derivative with respect to a zero: one with an axis moves the point of contact, one without is part of
/// the number.
fn by_zero(zero: &Zero, by_tip: &DMatrix<f64>, posed: &Posed) -> DVector<f64> {
    match zero.axis {
        Some(axis) => by_tip.columns(0, 3) * (posed.pose.rotation() * axis),
        None => DVector::from_element(by_tip.nrows(), -1.0),
    }
}

/// Converts rates of X Y Z and of A B C in radians to rates of the position and of the rotation about base axes.
fn to_twist(pose: &Pose) -> DMatrix<f64> {
    let map = rate_map(pose);
    DMatrix::from_fn(6, 6, |i, k| match (i < 3, k < 3) {
        (true, true) => f64::from(u8::from(i == k)),
        (false, false) => map[(i - 3, k - 3)],
        _ => 0.0,
    })
}

/// Returns the shift and the small rotation about base axes from one pose to another.
fn twist_between(from: &Pose, to: &Pose) -> DVector<f64> {
    let shift = to.position - from.position;
    let turn = to_twist(from).view((3, 3), (3, 3)) * (to.angles - from.angles);
    DVector::from_iterator(6, shift.iter().chain(turn.iter()).copied())
}

/// Converts rates of the letters to rates of the position and of the rotation about base axes.
fn twist(pose: &Pose, letters: &[Letter], rates: &DMatrix<f64>) -> DMatrix<f64> {
    let mut twist = DMatrix::zeros(6, rates.ncols());
    let (sb, cb) = pose.angles.y.sin_cos();
    let (sc, cc) = pose.angles.z.sin_cos();
    // Axes of A, B and C in base: R = Rz(C) Ry(B) Rx(A).
    let axes = [Vector3::new(cc * cb, sc * cb, -sb), Vector3::new(-sc, cc, 0.0), Vector3::z()];
    for (row, letter) in letters.iter().enumerate() {
        match letter.index() {
            k @ 0..=2 => twist.set_row(k, &rates.row(row)),
            k => {
                for i in 0..3 {
                    let more = rates.row(row) * axes[k - 3][i].to_radians();
                    let mut place = twist.row_mut(3 + i);
                    place += more;
                }
            }
        }
    }
    twist
}
