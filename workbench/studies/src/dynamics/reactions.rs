// SPDX-License-Identifier: GPL-2.0-or-later
//! Accelerations of a platform whose constraints are rigid: M a = Q + Cᵀλ with C a = γ.
//!
//! C are the rows of the constraints about the center of mass, machine axes, and γ what their second derivative g'' = C a - γ
//! has without accelerations. Redundant constraints share a reaction. Integration accumulates rounding in the values g, so
//! that γ also has the terms of a critically damped return to 0.

use crate::dynamics::rotation::Motion;
use kinematics::{ConstraintGeometry, Vector3};
use machine::read::mechanism::Mechanism;
use machine::rows::RANK_TOLERANCE;
use nalgebra::{DMatrix, DVector, Matrix6, RowVector6, Vector6};

/// A constraint at a moment.
struct Row {
    /// Per velocity of the center of mass and angular velocity.
    row: RowVector6<f64>,
    /// Its value, mm.
    value: f64,
    /// Second derivative without accelerations.
    curved: f64,
}

/// The constraints of a platform, mm.
pub struct Reactions {
    constraints: Vec<ConstraintGeometry>,
    /// Center of mass in the platform frame.
    centre: Vector3<f64>,
    /// Makes values of directions lengths.
    radius: f64,
    /// Rate of the return to 0, 1/s.
    rate: f64,
}

impl Reactions {
    /// Creates the constraints of a machine; `None` without any. `rate` is that at which errors of integration decay.
    pub fn new(config: &Mechanism, centre: &Vector3<f64>, rate: f64) -> Option<Self> {
        let mm = |point: [f64; 3]| point.map(|value| value / config.units_per_mm);
        let constraint = |given: &ConstraintGeometry| match *given {
            ConstraintGeometry::PointInPlane { platform, base, normal } => {
                ConstraintGeometry::PointInPlane { platform: mm(platform), base: mm(base), normal }
            }
            ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
                let (platform, base) = (mm(platform), mm(base));
                ConstraintGeometry::PlaneThroughPoint { platform, normal, base }
            }
            square @ ConstraintGeometry::Square { .. } => square,
        };
        let constraints: Vec<_> = config.geometry.constraints().iter().map(constraint).collect();
        let radius = config.machine.radius() / config.units_per_mm;
        (!constraints.is_empty()).then_some(Self { constraints, centre: *centre, radius, rate })
    }

    fn row(&self, given: &ConstraintGeometry, motion: &Motion, omega: &Vector3<f64>) -> Row {
        let unit = |direction: [f64; 3]| Vector3::from(direction).normalize();
        let arm = |point: [f64; 3]| motion.rotation * (Vector3::from(point) - self.centre);
        let row = |force: Vector3<f64>, moment: Vector3<f64>| {
            RowVector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
        };
        match *given {
            ConstraintGeometry::PointInPlane { platform, base, normal } => {
                let (normal, arm) = (unit(normal), arm(platform));
                Row {
                    row: row(normal, arm.cross(&normal)),
                    value: normal.dot(&(motion.place + arm - Vector3::from(base))),
                    curved: normal.dot(&omega.cross(&omega.cross(&arm))),
                }
            }
            ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
                let normal = motion.rotation * unit(normal);
                let (turned, to) = (omega.cross(&normal), Vector3::from(base) - motion.place);
                Row {
                    row: row(-normal, normal.cross(&to)),
                    value: normal.dot(&(to - arm(platform))),
                    curved: omega.dot(&turned.cross(&to)) - 2.0 * turned.dot(&motion.velocity),
                }
            }
            ConstraintGeometry::Square { platform_axis, base_axis } => {
                let axis = motion.rotation * unit(platform_axis) * self.radius;
                let base = unit(base_axis);
                Row {
                    row: row(Vector3::zeros(), axis.cross(&base)),
                    value: axis.dot(&base),
                    curved: omega.dot(&omega.cross(&axis).cross(&base)),
                }
            }
        }
    }

    /// Computes linear and angular acceleration, machine axes, under a wrench about the center of mass.
    pub fn accelerated(
        &self,
        motion: &Motion,
        omega: &Vector3<f64>,
        mass: &Matrix6<f64>,
        wrench: &Vector6<f64>,
    ) -> Vector6<f64> {
        let [v, w] = [motion.velocity, *omega];
        let velocity = Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z);
        let factors = mass.cholesky().expect("mass and inertia of a body are positive");
        let free = factors.solve(wrench);
        let count = self.constraints.len();
        let (mut rows, mut asked) = (DMatrix::zeros(count, 6), DVector::zeros(count));
        for (i, given) in self.constraints.iter().enumerate() {
            let Row { row, value, curved } = self.row(given, motion, omega);
            rows.row_mut(i).copy_from(&row);
            let returning = self.rate * (2.0 * (row * velocity)[0] + self.rate * value);
            asked[i] = -curved - returning - (row * free)[0];
        }
        let inverse = factors.inverse();
        let yields = &rows * inverse * rows.transpose();
        let most = yields.diagonal().max();
        let reactions = yields.pseudo_inverse(RANK_TOLERANCE * most).map(|yields| yields * asked);
        // Unreachable: the tolerance is positive.
        let reactions = reactions.unwrap_or_else(|_| DVector::from_element(count, f64::NAN));
        let change = inverse * rows.tr_mul(&reactions);
        free + Vector6::from_column_slice(change.as_slice())
    }
}
