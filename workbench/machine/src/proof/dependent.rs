// SPDX-License-Identifier: GPL-2.0-or-later
//! Encloses the coordinates that constraints of the platform determine, over a cell of commanded coordinates.
//!
//! With the center z₀ of the cell in all six coordinates, the tangent T of the solutions there, and M the inverse of the
//! derivatives F_y of the constraints by the dependent coordinates, let z = z₀ + T s + e: s is a point of the cell, and e
//! is in a box E of dependent coordinates. F'(z₀) T = 0, so that e − M F(z) is at most |M F(z₀)| + |M| Q/2, where Q
//! bounds the second derivatives of F. If that is at most E (Krawczyk), and ‖1 − M F_y‖ < 1 in the norm of E, then the
//! cell has exactly one solution in the box for each s, and it depends continuously on s. The machine's poses are
//! then z₀ plus a sum of steps, and bounded like those of a machine without constraints.
//!
//! **Which solution.** The core returns the one at the end of the continuous path along the straight line from home. Let
//! cells without a gap between them contain these lines, and let the solution in each be the core's at its center and at
//! its point nearest to home. Let V be the poses whose lines are regular, and grow a cube about home until it touches a
//! pose outside V. Inside the cube the core's solution is continuous, and the part of a cell there is convex and
//! contains the cell's nearest point: there the core's solution is that of the cell. But that one is regular at the pose
//! touched, a contradiction. So the solution in every cell is the core's.
//!
//! **Bounds** of the second derivative of an equation for two motions (v, ω) of the control point and the platform, ω the
//! sum of the rates of A, B and C: an arm a fixed in the platform contributes |a| ω₁ ω₂, a plane through a point at a
//! distance d from the control point d ω₁ ω₂ + ω₁ v₂ + v₁ ω₂.
//!
//! **Another commanded point**: axes that carry the tool command the position w of a tip, at P − R o from the control point
//! P, where o moves with the axes. Then P is unknown too, and E has its coordinates. For each of X, Y and Z that the legs
//! move, P − R o − w = 0 joins the constraints, with a second derivative of at most |o| ω² + 2 ω |o'| + |o''| + |w''|.

use crate::proof::reach::{Middle, RADIANS, Reach, Spread};
use crate::read::mechanism::Mechanism;
use kinematics::{Cause, ConstraintGeometry, Fault, Letter, Matrix3, Pose, Vector3};
use nalgebra::{Matrix6, Vector6};

/// Rounding of the core's solution and of the equations, as a share of the machine's size: the core solves to 1e-14.
const ROUNDING: f64 = 1e-12;

/// Trials of a box E, and the factor by which each is larger than the bound that it must contain.
const TRIALS: usize = 12;
const GROWTH: f64 = 1.1;

/// Share of the whole box by which its entries are larger if the position of the platform follows.
const ROOM: f64 = 0.05;

/// Largest ‖1 − M F_y‖: less than 1, whatever rounding does.
const CONTRACTION: f64 = 0.95;

/// Smallest part of the lines from home to a move, as a share of them, that is halved: at a constraint singularity no
/// part is small enough.
const SHORTEST: f64 = 1e-5;

/// An independent constraint, its points about the platform's origin.
struct Equation {
    given: ConstraintGeometry,
}

/// Motion of the control point and rotation of the platform, as lengths of the vectors.
#[derive(Clone, Copy)]
struct Motion {
    shift: f64,
    turn: f64,
}

/// The platform at the center of a cell.
pub(super) struct Place {
    /// All coordinates of the control point in base, machine units and degrees.
    pub(super) full: [f64; 6],
    pub(super) rotation: Matrix3<f64>,
    /// Rotation axes of A, B and C, in base.
    pub(super) axes: [Vector3<f64>; 3],
}

/// Poses of a cell in all coordinates.
#[derive(Clone, Debug)]
pub(super) struct Enclosed {
    /// Steps in machine units and degrees: one for each step of the cell, then one for each dependent coordinate.
    pub(super) steps: Vec<[f64; 6]>,
}

/// Motion of the commanded coordinates over a cell: its center plus a sum of steps, each multiplied by a number from −1
/// to 1.
pub(super) struct Commanded {
    /// Machine units and degrees.
    pub(super) steps: Vec<[f64; 6]>,
    /// Bounds of their second derivatives on straight paths from the center, machine units and radians.
    pub(super) bend: [f64; 6],
    /// The point of the platform whose position is commanded; `None` for the control point.
    pub(super) arm: Option<Arm>,
}

/// Vector from a commanded point to the control point, in the frame of the platform.
pub(super) struct Arm {
    pub(super) at: Vector3<f64>,
    /// Its change by every step.
    pub(super) rates: Vec<Vector3<f64>>,
    /// Bound of its second derivative on straight paths from the center.
    pub(super) bend: f64,
    /// Position of the commanded point at the center.
    pub(super) point: Vector3<f64>,
}

impl Commanded {
    /// Returns the motion of a cell in the platform's own coordinates.
    fn platform(steps: &[[f64; 6]]) -> Self {
        Self { steps: steps.to_vec(), bend: [0.0; 6], arm: None }
    }
}

impl Arm {
    /// Bounds its rate.
    pub(super) fn rate(&self) -> f64 {
        self.rates.iter().map(|rate| rate.norm()).sum::<f64>() + self.bend
    }

    /// Bounds its length.
    pub(super) fn length(&self) -> f64 {
        self.at.norm() + self.rate()
    }

    /// Bounds the second derivative of its end for two rotations of the platform, of which it changes with the second.
    pub(super) fn bend_by(&self, one: f64, other: f64) -> f64 {
        (self.length() * other + self.rate()) * one
    }
}

/// The constraints of a machine with a tool.
pub(super) struct Dependent {
    equations: Vec<Equation>,
    /// Coordinates that they determine.
    pub(super) dependent: [bool; 6],
    tool: Vector3<f64>,
    size: f64,
    radius: f64,
    /// Commanded coordinates at the platform's home with this tool, from which the core follows the solution.
    start: [f64; 6],
}

impl Equation {
    /// Computes the value with the control point at `t`.
    fn value(&self, rotation: &Matrix3<f64>, t: &Vector3<f64>, tool: &Vector3<f64>) -> f64 {
        let of = |vector: [f64; 3]| Vector3::from(vector);
        match self.given {
            ConstraintGeometry::PointInPlane { platform, base, normal } => of(normal)
                .normalize()
                .dot(&(t - tool + rotation * (tool + of(platform)) - of(base))),
            ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
                let normal = of(normal).normalize();
                (rotation * normal).dot(&(of(base) - t + tool)) - normal.dot(&(tool + of(platform)))
            }
            ConstraintGeometry::Square { platform_axis, base_axis } => {
                (rotation * of(platform_axis).normalize()).dot(&of(base_axis).normalize())
            }
        }
    }

    /// Returns the unit of the value: a length, or 1 for perpendicular directions.
    fn unit(&self, size: f64) -> f64 {
        if matches!(self.given, ConstraintGeometry::Square { .. }) { 1.0 } else { size }
    }

    /// Computes the gradient by the control point's position and by rotations of the platform about it, in base.
    fn gradient(
        &self,
        rotation: &Matrix3<f64>,
        t: &Vector3<f64>,
        tool: &Vector3<f64>,
    ) -> [Vector3<f64>; 2] {
        let of = |vector: [f64; 3]| Vector3::from(vector);
        match self.given {
            ConstraintGeometry::PointInPlane { platform, normal, .. } => {
                let normal = of(normal).normalize();
                [normal, (rotation * (tool + of(platform))).cross(&normal)]
            }
            ConstraintGeometry::PlaneThroughPoint { normal, base, .. } => {
                let normal = rotation * of(normal).normalize();
                [-normal, normal.cross(&(of(base) - t + tool))]
            }
            ConstraintGeometry::Square { platform_axis, base_axis } => {
                let axis = rotation * of(platform_axis).normalize();
                [Vector3::zeros(), axis.cross(&of(base_axis).normalize())]
            }
        }
    }

    /// Bounds the second derivative for two motions, in a cell about `t` that moves by up to `shift`.
    fn bend(
        &self,
        t: &Vector3<f64>,
        tool: &Vector3<f64>,
        shift: f64,
        [one, other]: [Motion; 2],
    ) -> f64 {
        let of = |vector: [f64; 3]| Vector3::from(vector);
        match self.given {
            ConstraintGeometry::PointInPlane { platform, .. } => {
                (tool + of(platform)).norm() * one.turn * other.turn
            }
            ConstraintGeometry::PlaneThroughPoint { base, .. } => {
                let far = (of(base) - t + tool).norm() + shift;
                far * one.turn * other.turn + one.turn * other.shift + one.shift * other.turn
            }
            ConstraintGeometry::Square { .. } => one.turn * other.turn,
        }
    }
}

impl Motion {
    /// Bounds the motion by a sum of steps, machine units and radians, each multiplied by a number from −1 to 1.
    fn of<'a>(steps: impl IntoIterator<Item = &'a [f64; 6]>) -> Self {
        let add = |sum: Self, step: &[f64; 6]| Self {
            shift: sum.shift + Vector3::new(step[0], step[1], step[2]).norm(),
            turn: sum.turn + step[3..].iter().map(|angle| angle.abs()).sum::<f64>(),
        };
        steps.into_iter().fold(Self { shift: 0.0, turn: 0.0 }, add)
    }
}

impl Place {
    /// Returns the platform at these coordinates.
    pub(super) fn new(pose: &Pose) -> Self {
        let ((sb, cb), (sc, cc)) = (pose.angles.y.sin_cos(), pose.angles.z.sin_cos());
        Self {
            full: pose.to_degrees(),
            rotation: pose.rotation(),
            axes: [
                Vector3::new(cc * cb, sc * cb, -sb),
                Vector3::new(-sc, cc, 0.0),
                Vector3::new(0.0, 0.0, 1.0),
            ],
        }
    }

    fn point(&self) -> Vector3<f64> {
        Vector3::new(self.full[0], self.full[1], self.full[2])
    }
}

/// Converts angles of a step.
fn with_unit(step: &[f64; 6], of_angles: f64) -> [f64; 6] {
    std::array::from_fn(|k| if k < 3 { step[k] } else { step[k] * of_angles })
}

impl Dependent {
    /// Returns the constraints of a machine with this tool; `None` if it has none.
    ///
    /// # Errors
    /// The machine has no pose at home.
    pub(super) fn of(config: &Mechanism, tool: Vector3<f64>) -> Result<Option<Self>, Fault> {
        let layout = config.machine.layout();
        if layout.constraints() == 0 {
            return Ok(None);
        }
        let home = config.machine.full_pose(&config.home_pose(), &Vector3::zeros())?;
        // The platform stays there whatever the tool is.
        let shift = tool - home.rotation() * tool;
        let dependent = Letter::ALL.map(|letter| layout.is_dependent(letter));
        let mut start = config.home;
        (0..3).filter(|k| !dependent[*k]).for_each(|k| start[k] += shift[k]);
        let all = config.geometry.constraints().iter();
        let solved = all.enumerate().filter(|(i, _)| !config.machine.is_constraint_redundant(*i));
        Ok(Some(Self {
            equations: solved.map(|(_, given)| Equation { given: *given }).collect(),
            dependent,
            tool,
            size: config.machine.size(),
            radius: config.machine.radius(),
            start,
        }))
    }

    /// Returns the number of independent constraints.
    pub(super) fn count(&self) -> usize {
        self.equations.len()
    }

    /// Encloses the poses of a cell: its center plus a sum of steps in commanded coordinates, machine units and degrees.
    /// `None` if the cell is too large, or near a constraint singularity.
    pub(super) fn enclose(&self, place: &Place, steps: &[[f64; 6]]) -> Option<Enclosed> {
        self.enclose_commanded(place, &Commanded::platform(steps))
    }

    /// Encloses the poses of a cell whose commanded coordinates may be those of a moving point of the platform.
    pub(super) fn enclose_commanded(&self, place: &Place, by: &Commanded) -> Option<Enclosed> {
        let (t, tool) = (place.point(), &self.tool);
        // The equations, and below them the commanded coordinates themselves.
        let mut rows = Matrix6::zeros();
        let mut values = Vector6::zeros();
        for (i, equation) in self.equations.iter().enumerate() {
            let [force, moment] = equation.gradient(&place.rotation, &t, tool);
            for k in 0..3 {
                rows[(i, k)] = force[k];
                rows[(i, k + 3)] = moment.dot(&place.axes[k]);
            }
            let rounding = ROUNDING * equation.unit(self.size);
            values[i] = equation.value(&place.rotation, &t, tool).abs() + rounding;
        }
        let commanded: Vec<usize> = (0..6).filter(|k| !self.dependent[*k]).collect();
        let arm = by.arm.as_ref();
        let to_base = arm.map(|arm| place.rotation * arm.at);
        for (n, k) in commanded.iter().enumerate() {
            let row = self.count() + n;
            rows[(row, *k)] = 1.0;
            if let (Some(arm), Some(to_base), 0..3) = (arm, to_base, *k) {
                for (m, axis) in place.axes.iter().enumerate() {
                    rows[(row, m + 3)] = -axis.cross(&to_base)[*k];
                }
                values[row] = (t[*k] - to_base[*k] - arm.point[*k]).abs() + ROUNDING * self.size;
            }
        }
        let inverse = rows.try_inverse()?;
        let tangent = |(n, step): (usize, &[f64; 6])| -> [f64; 6] {
            let step = with_unit(step, RADIANS);
            let turned = arm.map_or(Vector3::zeros(), |arm| place.rotation * arm.rates[n]);
            let mut right = Vector6::zeros();
            for (n, k) in commanded.iter().enumerate() {
                right[self.count() + n] = step[*k] + if *k < 3 { turned[*k] } else { 0.0 };
            }
            (inverse * right).into()
        };
        let tangents: Vec<[f64; 6]> = by.steps.iter().enumerate().map(tangent).collect();
        // With an arm, the position of the platform follows, too.
        let follows = |k: usize| self.dependent[k] || (k < 3 && arm.is_some());
        let used = if arm.is_some() { 6 } else { self.count() };
        let product = |bounds: &Vector6<f64>| -> [f64; 6] {
            std::array::from_fn(|k| match follows(k) {
                true => (0..used).map(|i| inverse[(k, i)].abs() * bounds[i]).sum(),
                false => 0.0,
            })
        };
        let mut within = [0.0; 6];
        for _ in 0..TRIALS {
            let motion = Motion::of(tangents.iter().chain([&within]));
            let bend = |one: Motion| {
                let bend = |i: usize| match i.checked_sub(self.count()) {
                    None => self.equations[i].bend(&t, tool, motion.shift, [one, motion]),
                    Some(n) if commanded[n] < 3 => {
                        arm.map_or(0.0, |arm| arm.bend_by(one.turn, motion.turn))
                    }
                    Some(_) => 0.0,
                };
                Vector6::from_fn(|i, _| if i < used { bend(i) } else { 0.0 })
            };
            let mut bent = bend(motion);
            for (n, k) in commanded.iter().enumerate() {
                bent[self.count() + n] += match (arm, k) {
                    (Some(arm), 0..3) => by.bend[*k] + arm.bend + arm.rate() * motion.turn,
                    _ => by.bend[*k],
                };
            }
            let needed = product(&(bent / 2.0 + values));
            if !needed.iter().all(|value| value.is_finite()) {
                return None;
            }
            if (0..6).all(|k| needed[k] <= within[k]) {
                let change = product(&bend(Motion::of([&within])));
                (0..6).all(|k| change[k] <= CONTRACTION * within[k]).then_some(())?;
                let box_ = (0..6)
                    .filter(|k| follows(*k))
                    .map(|k| std::array::from_fn(|m| if m == k { within[k] } else { 0.0 }));
                let steps = tangents.iter().copied().chain(box_);
                let steps = steps.map(|step| with_unit(&step, 1.0 / RADIANS)).collect();
                return Some(Enclosed { steps });
            }
            within = needed.map(|value| GROWTH * value);
            if arm.is_some() {
                // An entry that is of second order in the others would not contract.
                let most = Motion::of([&needed]);
                let size = self.size;
                let room = [most.shift + size * most.turn, most.shift / size + most.turn]
                    .map(|m| m * ROOM);
                for k in (0..6).filter(|k| follows(*k)) {
                    within[k] += room[usize::from(k >= 3)];
                }
            }
        }
        None
    }

    /// Returns the rows of the constraints about a point of the platform, moments per radius, their changes along steps,
    /// machine units and radians, and bounds of the rest of the changes.
    pub(super) fn rows(&self, place: &Place, about: &Vector3<f64>, steps: &[[f64; 6]]) -> Rows {
        let (t, motion) = (place.point(), Motion::of(steps));
        let lever = place.rotation * (self.tool + about);
        // Of the point: it moves with the control point, and rotates about it.
        let speed = motion.shift + lever.norm() * motion.turn;
        let center = t - self.tool + lever;
        let per_radius = 1.0 / self.radius;
        let mut rows = Rows { at: vec![], changes: vec![], rest: vec![] };
        for equation in &self.equations {
            let of = |vector: [f64; 3]| Vector3::from(vector);
            let unit = |vector: [f64; 3]| place.rotation * of(vector).normalize();
            let (row, change, rest): (_, Change, _) = match equation.given {
                ConstraintGeometry::PointInPlane { platform, normal, .. } => {
                    let (arm, normal) =
                        (place.rotation * (of(platform) - about), of(normal).normalize());
                    (
                        [normal, arm.cross(&normal)],
                        Box::new(move |_: &Vector3<f64>, turn: &Vector3<f64>| {
                            [Vector3::zeros(), turn.cross(&arm).cross(&normal)]
                        }),
                        [0.0, arm.norm() * motion.turn * motion.turn],
                    )
                }
                ConstraintGeometry::PlaneThroughPoint { normal, base, .. } => {
                    let (normal, to) = (unit(normal), of(base) - center);
                    let far = to.norm() + speed;
                    let bent = lever.norm() * motion.turn * motion.turn;
                    (
                        [-normal, normal.cross(&to)],
                        Box::new(move |v: &Vector3<f64>, turn: &Vector3<f64>| {
                            let turned = turn.cross(&normal);
                            let moved = v + turn.cross(&lever);
                            [-turned, turned.cross(&to) - normal.cross(&moved)]
                        }),
                        [
                            motion.turn * motion.turn,
                            far * motion.turn * motion.turn + 2.0 * motion.turn * speed + bent,
                        ],
                    )
                }
                ConstraintGeometry::Square { platform_axis, base_axis } => {
                    let (axis, base) = (unit(platform_axis), of(base_axis).normalize());
                    let (axis, radius) = (axis * self.radius, self.radius);
                    (
                        [Vector3::zeros(), axis.cross(&base)],
                        Box::new(move |_: &Vector3<f64>, turn: &Vector3<f64>| {
                            [Vector3::zeros(), turn.cross(&axis).cross(&base)]
                        }),
                        [0.0, radius * motion.turn * motion.turn],
                    )
                }
            };
            let joined = |[force, moment]: [Vector3<f64>; 2]| {
                let part = |k: usize| if k < 3 { force[k] } else { moment[k - 3] * per_radius };
                Vector6::from_fn(|k, _| part(k))
            };
            let along = |step: &[f64; 6]| {
                let turn: Vector3<f64> = (0..3).map(|k| place.axes[k] * step[k + 3]).sum();
                joined(change(&Vector3::new(step[0], step[1], step[2]), &turn))
            };
            rows.at.push(joined(row));
            rows.changes.push(steps.iter().map(along).collect());
            rows.rest.push([rest[0] / 2.0, rest[1] * per_radius / 2.0]);
        }
        rows
    }
}

/// Largest difference of a row from the core's, as a share of it: both are exact but for rounding.
const SAME: f64 = 1e-9;

/// Change of a row, force and moment, while the control point moves and the platform turns.
type Change = Box<dyn Fn(&Vector3<f64>, &Vector3<f64>) -> [Vector3<f64>; 2]>;

/// Rows of the constraints at the center of a cell.
pub(super) struct Rows {
    at: Vec<Vector6<f64>>,
    /// By constraint and step.
    pub(super) changes: Vec<Vec<Vector6<f64>>>,
    /// Bounds of the rest of the changes of every linear and every angular entry.
    pub(super) rest: Vec<[f64; 2]>,
}

impl Rows {
    /// Scales them as the core's rows; `None` if these are others.
    pub(super) fn scaled(mut self, of_core: impl Fn(usize) -> Vector6<f64>) -> Option<Self> {
        for (i, row) in self.at.iter_mut().enumerate() {
            let expected = of_core(i);
            let scale = expected.norm() / row.norm();
            *row *= scale;
            ((*row - expected).norm() <= SAME * expected.norm()).then_some(())?;
            self.changes[i].iter_mut().for_each(|change| *change *= scale);
            self.rest[i] = self.rest[i].map(|rest| rest * scale);
        }
        Some(self)
    }
}

impl Reach<'_> {
    /// Returns the platform at one of LinuxCNC's poses.
    pub(super) fn place(&self, pose: &[f64; 6]) -> Result<Place, Fault> {
        let pose = Pose::from_degrees(*pose);
        Ok(Place::new(&self.config.machine.full_pose(&pose, &self.tool)?))
    }

    /// Returns whether the solution in a cell with this half width is the core's at the cell's point nearest to home, and
    /// the core follows it from home.
    pub(super) fn is_connected(
        &self,
        middle: &Middle,
        [center, half]: [&[f64; 6]; 2],
        spread: &Spread,
    ) -> bool {
        let (Some(dependent), Some(place)) = (&self.dependent, &middle.place) else { return true };
        // Boxes about home then contain the lines from there.
        let apart = (0..3).map(|k| (dependent.start[k] - self.config.home[k]).abs());
        if apart.fold(0.0, f64::max) > ROUNDING * dependent.size {
            return false;
        }
        let nearest: [f64; 6] = std::array::from_fn(|k| {
            dependent.start[k].clamp(center[k] - half[k], center[k] + half[k])
        });
        let factor = |k: usize| match half[k] > 0.0 {
            true => (nearest[k] - center[k]) / half[k],
            false => 0.0,
        };
        let factors: [f64; 6] = std::array::from_fn(factor);
        let slack = ROUNDING * dependent.size;
        let is_near = |found: Place| {
            (0..6).all(|k| {
                let unit = if k < 3 { 1.0 } else { 1.0 / RADIANS };
                let (tangents, others) = spread.steps.split_at(6);
                let steps = tangents.iter().zip(&factors).map(|(step, factor)| factor * step[k]);
                let room: f64 = others.iter().map(|step| step[k].abs()).sum();
                let off = found.full[k] - place.full[k] - steps.sum::<f64>() * unit;
                off.abs() <= (room + slack) * unit
            })
        };
        self.place(&nearest).is_ok_and(is_near)
    }

    /// Proves that the lines from home to all poses of a path are regular: then the dependent coordinates change
    /// continuously along it, and are those that the core computes. `path` encloses the part of the path about a share of
    /// it, as far as a half width: a center plus a sum of steps, machine units and degrees; `None` if the part is too
    /// large.
    ///
    /// # Errors
    /// The share of the path at which that is not proved, and why.
    pub fn refuse_unconnected(
        &self,
        path: impl Fn(f64, f64) -> Result<Option<([f64; 6], Vec<[f64; 6]>)>, Fault>,
    ) -> Result<(), (f64, Fault)> {
        let Some(dependent) = &self.dependent else { return Ok(()) };
        let start = dependent.start;
        self.refuse_singular(|[[t, ht], [s, hs]]| {
            let Some((middle, own)) = path(s, hs)? else { return Ok(None) };
            let way: [f64; 6] = std::array::from_fn(|k| middle[k] - start[k]);
            let place = self.place(&std::array::from_fn(|k| start[k] + t * way[k]))?;
            let scaled = |step: &[f64; 6], by: f64| step.map(|value| by * value);
            let steps: Vec<[f64; 6]> = std::iter::once(scaled(&way, ht))
                .chain(own.iter().map(|step| scaled(step, t + ht)))
                .collect();
            Ok(Some((place, Commanded::platform(&steps))))
        })
    }

    /// Proves that the solutions over a rectangle, shares of lines from home and of a path, are regular. `piece` returns a
    /// part of the rectangle, about two shares with their half widths: the platform at its center, and its commanded
    /// coordinates, the first step along the lines; `None` if the part is too large.
    ///
    /// # Errors
    /// The share of the path at which that is not proved, and why.
    pub(super) fn refuse_singular(
        &self,
        piece: impl Fn([[f64; 2]; 2]) -> Result<Option<(Place, Commanded)>, Fault>,
    ) -> Result<(), (f64, Fault)> {
        let Some(dependent) = &self.dependent else { return Ok(()) };
        // In shares of the lines and of the path.
        let mut open = vec![[[0.0, 1.0]; 2]];
        while let Some([line, part]) = open.pop() {
            let [(t, ht), (s, hs)] =
                [line, part].map(|[low, high]| ((low + high) / 2.0, (high - low) / 2.0));
            let singular = || (s, Fault::from(Cause::ConstraintSingular));
            let found = piece([[t, ht], [s, hs]]).map_err(|fault| (s, fault))?;
            let is_longer = match &found {
                None if hs <= SHORTEST => return Err(singular()),
                None => false,
                Some((place, by)) => {
                    if dependent.enclose_commanded(place, by).is_some() {
                        continue;
                    }
                    let extent = |steps: &[[f64; 6]]| {
                        let steps: Vec<_> =
                            steps.iter().map(|step| with_unit(step, RADIANS)).collect();
                        let motion = Motion::of(&steps);
                        motion.shift + dependent.radius * motion.turn
                    };
                    let moved = by.arm.as_ref().map_or(0.0, Arm::rate);
                    let (along, across) = (extent(&by.steps[..1]), extent(&by.steps[1..]) + moved);
                    if along.max(across) <= SHORTEST * dependent.size {
                        return Err(singular());
                    }
                    along >= across
                }
            };
            // The earlier half of the path is examined first.
            open.extend(match is_longer {
                true => [[[t, line[1]], part], [[line[0], t], part]],
                false => [[line, [s, part[1]]], [line, [part[0], s]]],
            });
        }
        Ok(())
    }
}
