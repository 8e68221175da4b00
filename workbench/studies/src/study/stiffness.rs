// SPDX-License-Identifier: GPL-2.0-or-later
//! Stiffness of the tool: 6 × 6 matrices at the tool tip, and their ellipsoids.
//!
//! `K = Gᵀ K_θ G` (paper 004 equation 9) with rows G of the legs about the tool tip, so forces
//! in N and moments in N·mm are K times displacements in mm and rotations in radians, in machine axes.
//! The rows are those of the joints, with the correction for nut rotation: with the motor locked, an
//! axial force f transmits the torque f · lead / 2π of its thread through both cardan joints. If
//! friction locks the thread ([`Screw::SelfLocking`]), they are those of the lengths alone.
//!
//! Coordinates fixed by guides or joints of the platform count as rigid: they do not contribute to the
//! compliance, and K is not computed. So do the passive joints and passive legs behind constraints: they carry load
//! without yielding, and the dependent coordinates follow the yielding of the legs.

use crate::study::file::Screw;
use crate::study::springs::Springs;
use kinematics::{
    ConstraintGeometry, Fault, Geometry, LegGeometry, MAX_JOINTS, Machine, Matrix3, Pose, Vector3,
};
use machine::read::mechanism::Mechanism;
use machine::rows::{self, Rows, joint_rows, length_rows};
use nalgebra::{Matrix6, SMatrix, SVector};
use std::f64::consts::PI;

/// Stiffness at a pose, in N, mm and rad, about the tool tip, in machine axes.
#[derive(Clone, Debug)]
pub struct Stiffness {
    /// Displacement and rotation per force and moment, 1/N·mm and 1/N·mm².
    pub compliance: Matrix6<f64>,
    /// Inverse of the compliance, if joints move all six coordinates.
    pub matrix: Option<Matrix6<f64>>,
}

/// Principal axes of a part of a compliance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Stiffness along each axis, smallest first: N/mm, or N·mm/rad; infinite if rigid.
    pub stiffness: [f64; 3],
    /// Unit vectors of the axes, columns in the same order.
    pub axes: Matrix3<f64>,
}

impl Stiffness {
    /// Computes the stiffness at a pose; `None` if it is singular.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn at(
        config: &Mechanism,
        pose: &Pose,
        tool: &Vector3<f64>,
        springs: &Springs,
    ) -> Result<Option<Self>, Fault> {
        let at = config.machine.at(pose, tool)?;
        let rows = match springs.screw {
            Screw::Backdrivable => joint_rows(config, &at)?,
            Screw::SelfLocking => length_rows(config, &at, tool),
        };
        let gains = rows::gains_in_mm(config, &at);
        let n_per_mm: Vec<f64> =
            springs.all.iter().zip(gains).map(|(spring, gain)| spring.along(gain)).collect();
        let whole = (
            rows::with_dependent(&config.machine, pose, tool)?,
            rows::follow_on_work(&config.geometry, config.machine.radius(), &at, tool),
        );
        Ok(Self::of_rows(config, &whole, &rows, &n_per_mm))
    }

    fn of_rows(
        config: &Mechanism,
        (pose, follow): &(Pose, Matrix6<f64>),
        rows: &Rows,
        n_per_mm: &[f64],
    ) -> Option<Self> {
        let moved = rows::moved(config).len();
        // Angles times a length of the machine: rows of one unit, for the rank test.
        let radius = config.machine.radius();
        let scale = |k: usize| if k < 3 { 1.0 } else { 1.0 / radius };
        let root = SVector::<f64, MAX_JOINTS>::from_fn(|i, _| {
            n_per_mm.get(i).copied().unwrap_or(0.0).sqrt()
        });
        let weighted = Rows::from_fn(|i, k| root[i] * rows[(i, k)] * scale(k));
        let inverse = rows::inverse(&weighted, moved)?;
        // In pose coordinates: machine units and radians per force in N times machine units.
        let of_pose = inverse * inverse.transpose();
        let map = rows::rate_map(pose);
        let mut to_twist = SMatrix::<f64, 6, 6>::identity();
        to_twist.fixed_view_mut::<3, 3>(3, 3).copy_from(&map);
        // Lengths in mm: the rows of angles are lengths per radian.
        let per_mm = config.units_per_mm;
        let unit = Matrix6::from_diagonal(&SVector::<f64, 6>::from_fn(|k, _| {
            if k < 3 { 1.0 } else { per_mm / radius }
        }));
        let length = |k: usize| if k < 3 { per_mm } else { 1.0 };
        let follow = Matrix6::from_fn(|i, k| follow[(i, k)] * length(k) / length(i));
        let to_tip = to_twist * follow * unit;
        let compliance = to_tip * of_pose * to_tip.transpose();
        let matrix = (moved == 6).then(|| compliance.try_inverse()).flatten();
        Some(Self { compliance, matrix })
    }

    /// Returns the axes of displacement per force at the tip, which is free to rotate.
    pub fn translation(&self) -> Ellipsoid {
        Ellipsoid::of(&self.compliance.fixed_view::<3, 3>(0, 0).into_owned())
    }

    /// Returns the axes of rotation per moment, with the tip free to translate.
    pub fn rotation(&self) -> Ellipsoid {
        Ellipsoid::of(&self.compliance.fixed_view::<3, 3>(3, 3).into_owned())
    }
}

/// Compliances below this share of the largest are rounding, in rigid directions.
const RIGID: f64 = 1e-12;

impl Ellipsoid {
    fn of(compliance: &Matrix3<f64>) -> Self {
        let eigen = compliance.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let most = eigen.eigenvalues[order[0]];
        let stiffness = order.map(|k| match eigen.eigenvalues[k] {
            value if value > RIGID * most => 1.0 / value,
            _ => f64::INFINITY,
        });
        let columns = order.map(|k| eigen.eigenvectors.column(k).into_owned());
        Self { stiffness, axes: Matrix3::from_columns(&columns) }
    }
}

impl Ellipsoid {
    /// Returns the outline of the displacements due to loads of one magnitude in all directions, projected on a
    /// plane of two axes: `count` points, and the first one again.
    pub fn outline(&self, plane: [usize; 2], load: f64, count: usize) -> Vec<(f64, f64)> {
        let yields = Matrix3::from_diagonal(&Vector3::from(self.stiffness.map(|k| load / k)));
        // C² of the compliance: the farthest of all C u along w is C² w/|C w|.
        let square = self.axes * yields * yields * self.axes.transpose();
        let point = |k: usize| {
            let (up, across) = (2.0 * PI * k as f64 / count as f64).sin_cos();
            let mut along = Vector3::zeros();
            (along[plane[0]], along[plane[1]]) = (across, up);
            let far = square * along;
            let reach = along.dot(&far).sqrt();
            match reach > 0.0 {
                true => (far[plane[0]] / reach, far[plane[1]] / reach),
                false => (0.0, 0.0),
            }
        };
        (0..=count).map(point).collect()
    }
}

/// Returns the machine with its platform anchors, and the platform's points of constraints, `factor` times as far from the
/// axis of the control point.
///
/// # Errors
/// The core refuses the scaled machine.
pub fn with_platform(config: &Mechanism, factor: f64) -> Result<Mechanism, Fault> {
    let mut legs = config.geometry.legs().to_vec();
    for LegGeometry { platform, .. } in &mut legs {
        (platform[0], platform[1]) = (platform[0] * factor, platform[1] * factor);
    }
    let layout = config.machine.layout();
    let mut constraints = config.geometry.constraints().to_vec();
    for constraint in &mut constraints {
        if let ConstraintGeometry::PointInPlane { platform, .. }
        | ConstraintGeometry::PlaneThroughPoint { platform, .. } = constraint
        {
            (platform[0], platform[1]) = (platform[0] * factor, platform[1] * factor);
        }
    }
    let geometry = Geometry::of_layout(*layout, |i| legs[i]);
    let mut geometry = geometry.with_constraints(|i| constraints[i]);
    (geometry.centre, geometry.home) = (config.geometry.centre, config.geometry.home);
    let machine = Machine::freeze(&geometry, &config.offsets)?;
    Ok(Mechanism { machine, geometry, ..config.clone() })
}

impl Stiffness {
    /// Returns the smallest stiffness of translation (N/mm) and of rotation (N·mm/rad).
    pub fn least(&self) -> [f64; 2] {
        [self.translation().stiffness[0], self.rotation().stiffness[0]]
    }

    /// Returns force per displacement along X, Y and Z (N/mm), and moment per rotation about them (N·mm/rad): each
    /// under that load alone; infinite if rigid.
    pub fn along(&self) -> [f64; 6] {
        let most =
            |first: usize| (first..first + 3).map(|k| self.compliance[(k, k)]).fold(0.0, f64::max);
        let most = [most(0), most(3)];
        std::array::from_fn(|k| match self.compliance[(k, k)] {
            value if value > RIGID * most[k / 3] => 1.0 / value,
            _ => f64::INFINITY,
        })
    }
}
