// SPDX-License-Identifier: GPL-2.0-or-later
//! Matrices of mass, damping and stiffness at a pose.
//!
//! Coordinates are those of the [`Chart`], then the joints whose drives have mass, then the table
//! axes. With P the displacements of points, Ω the rotations, r the row of a leg and n its direction:
//!
//! ```text
//! M = m PcᵀPc + Ωᵀ R I Rᵀ Ω + Σ Pᵀ(μa nnᵀ + μt (1 - nnᵀ))P       K = Σ k r rᵀ       C = Σ c r rᵀ
//! Kg = -Σ f {Pᵀ (1 - nnᵀ)/l P + n·∂²p} - m g·∂²pc
//! ```
//!
//! f are the forces by which the legs support the weight, positive if a leg pushes: those of least
//! energy if legs exceed coordinates, f = -k r K⁻¹ Pcᵀ m g. Constraints of the platform are rigid. Kg is exact for legs with rigid
//! joints; the elasticity of a drive adds a term of the order (f/k)².

use crate::dynamics::chart::Chart;
use crate::dynamics::model::{Body, Leg, Model};
use crate::dynamics::shapes::Shapes;
use crate::study::file::Screw;
use crate::study::springs::Spring;
use kinematics::{At, Fault, Pose, Vector3};
use machine::read::legs::{drive_rate, platform_anchor};
use machine::read::mechanism::Mechanism;
use machine::rows::{self, joint_rows, length_rows};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Matrix6xX, RowDVector};

/// Step of the differences of rows, radians or share of the radius: the truncation error is its square,
/// the rounding error that of rows divided by it.
pub(crate) const STEP: f64 = 1e-5;

/// A machine at a pose as a vibrating system; N, mm, s, t, radians.
#[derive(Clone, Debug)]
pub struct Structure {
    pub mass: DMatrix<f64>,
    pub damping: DMatrix<f64>,
    pub stiffness: DMatrix<f64>,
    /// Displacement and rotation of the tool tip relative to the work per coordinate, machine axes.
    pub tip: Matrix6xX<f64>,
    /// Change of length of every leg per coordinate.
    pub elongation: DMatrix<f64>,
    /// Forces by which the legs support the weight, N, positive if a leg pushes.
    pub bearing: Vec<f64>,
}

/// A leg at a pose: mm.
#[derive(Clone, Debug)]
pub struct LegAt {
    /// Platform anchor in the platform frame.
    pub anchor: Vector3<f64>,
    /// Unit vector towards the platform, machine frame.
    pub along: Vector3<f64>,
    /// From the moving base anchor to the platform anchor.
    pub length: f64,
    /// Change of its length per coordinate of the chart, including the nut's rotation if that transmits force.
    pub row: RowDVector<f64>,
    /// Magnitude of the change of its length per mm or radian of its joint.
    pub gain: f64,
    /// The change with its sign: displacement of the platform anchor along the leg.
    pub signed_gain: f64,
}

/// Returns the tool tip in the platform frame, mm, from the tool vector in machine units.
pub fn tip(config: &Mechanism, tool: &Vector3<f64>) -> Vector3<f64> {
    -tool / config.units_per_mm
}

/// Computes the legs of a machine at a pose.
///
/// # Errors
/// As [`At::inverse_jacobian`].
pub fn legs(
    config: &Mechanism,
    at: &At,
    tool: &Vector3<f64>,
    screw: Screw,
) -> Result<Vec<LegAt>, Fault> {
    let chart = Chart::of(config, at, tool);
    let per_mm = config.units_per_mm;
    let rows = match screw {
        Screw::Backdrivable => joint_rows(config, at)?,
        Screw::SelfLocking => length_rows(config, at, tool),
    };
    let rows = chart.rows(&rows, &tip(config, tool), per_mm);
    let gains = rows::gains_in_mm(config, at);
    let legs = config.geometry.legs().iter().zip(at.segments()).enumerate();
    let leg = legs.map(|(i, (leg, segment))| {
        let span = segment.span() / per_mm;
        let gain = gains[i];
        let sign = drive_rate(leg, segment).map_or(1.0, |rate| rate.dot(&span).signum());
        // Rows of joints are positive for increasing joint values, rows of lengths towards the platform.
        let turned = if screw == Screw::Backdrivable { sign } else { 1.0 };
        LegAt {
            anchor: platform_anchor(leg, segment, &at.rotation()) / per_mm,
            along: span.normalize(),
            length: span.norm(),
            row: rows.row(i) * turned,
            gain,
            signed_gain: gain * sign,
        }
    });
    Ok(leg.collect())
}

impl Structure {
    /// Computes the structure at a pose. `tool` is that of the pose, as for [`kinematics::Machine::at`].
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn at(
        config: &Mechanism,
        model: &Model,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Self, Fault> {
        let at = config.machine.at(pose, tool)?;
        let mut chart = Chart::of(config, &at, tool);
        let legs = legs(config, &at, tool, model.screw)?;
        let mut platform = Platform::new(&chart, model, &at.rotation(), &legs);
        if model.is_geometric {
            chart = chart.with_bends(config, pose, tool)?;
            let bends = match model.screw {
                Screw::Backdrivable => nut_curvatures(config, &at, tool)?,
                Screw::SelfLocking => vec![],
            };
            let geometric =
                geometric(&chart, &legs, &platform.bearing, &bends, &model.body, &model.gravity);
            let count = chart.count();
            let mut part = platform.stiffness.view_mut((0, 0), (count, count));
            part += geometric;
        }
        if let Some(ratio) = model.ratio {
            platform.damp(ratio);
        }
        let tip = tip(config, tool);
        Ok(platform.with_table(model, &chart.displacement(&tip), &chart.turns()))
    }
}

/// The platform on its legs, without a table.
struct Platform {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    elongation: DMatrix<f64>,
    bearing: Vec<f64>,
}

impl Platform {
    fn new(chart: &Chart, model: &Model, rotation: &Matrix3<f64>, legs: &[LegAt]) -> Self {
        let heavy: Vec<usize> =
            (0..legs.len()).filter(|i| model.legs[*i].drive.is_some()).collect();
        let (own, count) = (chart.count(), chart.count() + heavy.len());
        let mut mass = DMatrix::zeros(count, count);
        mass.view_mut((0, 0), (own, own)).copy_from(&body_mass(chart, &model.body, rotation));
        let mut damping = DMatrix::zeros(count, count);
        let mut stiffness = DMatrix::zeros(count, count);
        let mut elongation = DMatrix::zeros(legs.len(), count);
        for (i, (at, leg)) in legs.iter().zip(&model.legs).enumerate() {
            let mut part = mass.view_mut((0, 0), (own, own));
            part += leg_mass(chart, at, leg);
            let mut row = RowDVector::zeros(count);
            row.columns_mut(0, own).copy_from(&at.row);
            let mut k = leg.spring.along(at.gain);
            if let (Some(drive), Spring::Series { rod, drive: hold }) = (leg.drive, leg.spring) {
                let place = own + heavy.iter().take_while(|other| **other < i).count();
                row[place] = -at.gain;
                k = rod;
                mass[(place, place)] = drive;
                stiffness[(place, place)] += hold;
            }
            let square = row.tr_mul(&row);
            stiffness += &square * k;
            damping += square * leg.damping;
            elongation.row_mut(i).copy_from(&row);
        }
        let bearing = bearing(chart, model, legs);
        Self { mass, damping, stiffness, elongation, bearing }
    }

    /// Adds dampers that give every mode the same ratio: C = M Φ diag(2ζω) ΦᵀM. Does nothing at a singular
    /// pose, which has no modes.
    fn damp(&mut self, ratio: f64) {
        let Some(shapes) = Shapes::of(&self.mass, &self.stiffness) else { return };
        let rates = DMatrix::from_diagonal(&DVector::from_iterator(
            shapes.omegas.len(),
            shapes.omegas.iter().map(|omega| 2.0 * ratio * omega),
        ));
        let moved = &self.mass * &shapes.vectors;
        self.damping = &moved * rates * moved.transpose();
    }

    fn with_table(self, model: &Model, tip: &Matrix3xX<f64>, turns: &Matrix3xX<f64>) -> Structure {
        let (own, all) = (self.mass.nrows(), self.mass.nrows() + model.table.len());
        let grown = |matrix: &DMatrix<f64>, value: &dyn Fn(usize) -> f64| {
            let mut grown = DMatrix::zeros(all, all);
            grown.view_mut((0, 0), (own, own)).copy_from(matrix);
            (own..all).for_each(|i| grown[(i, i)] = value(i - own));
            grown
        };
        let mut of_tip = Matrix6xX::zeros(all);
        of_tip.view_mut((0, 0), (3, tip.ncols())).copy_from(tip);
        of_tip.view_mut((3, 0), (3, tip.ncols())).copy_from(turns);
        for (i, axis) in model.table.iter().enumerate() {
            of_tip[(axis.axis, own + i)] = 1.0;
        }
        Structure {
            mass: grown(&self.mass, &|i| model.table[i].mass),
            damping: grown(&self.damping, &|i| model.table[i].damping),
            stiffness: grown(&self.stiffness, &|i| model.table[i].stiffness),
            tip: of_tip,
            elongation: self.elongation.resize_horizontally(all, 0.0),
            bearing: self.bearing,
        }
    }
}

/// Computes the mass matrix of the platform over the coordinates of a chart.
pub fn body_mass(chart: &Chart, body: &Body, rotation: &Matrix3<f64>) -> DMatrix<f64> {
    let (moved, turned) = (chart.displacement(&body.centre), chart.turns());
    let inertia = rotation * body.inertia * rotation.transpose();
    moved.tr_mul(&moved) * body.mass + turned.tr_mul(&(inertia * &turned))
}

/// Computes the contribution of a leg to the mass matrix.
pub(crate) fn leg_mass(chart: &Chart, at: &LegAt, leg: &Leg) -> DMatrix<f64> {
    let moved = chart.displacement(&at.anchor);
    let along = at.along * at.along.transpose();
    let mass = along * leg.axial + (Matrix3::identity() - along) * leg.across;
    moved.tr_mul(&(mass * &moved))
}

/// Computes the stiffness of legs with massless drives, over the coordinates of a chart.
pub(crate) fn stiffness(legs: &[LegAt], model: &Model, count: usize) -> DMatrix<f64> {
    let mut stiffness = DMatrix::zeros(count, count);
    for (leg, own) in legs.iter().zip(&model.legs) {
        stiffness += leg.row.tr_mul(&leg.row) * own.spring.along(leg.gain);
    }
    stiffness
}

/// Computes the forces by which the legs support the weight; zeros at a singular pose.
fn bearing(chart: &Chart, model: &Model, legs: &[LegAt]) -> Vec<f64> {
    let weight = chart.displacement(&model.body.centre).tr_mul(&model.gravity) * model.body.mass;
    let k = |i: usize| model.legs[i].spring.along(legs[i].gain);
    let sag =
        stiffness(legs, model, chart.count()).cholesky().map(|factors| factors.solve(&weight));
    let force =
        |(i, leg): (usize, &LegAt)| sag.as_ref().map_or(0.0, |sag| -k(i) * (&leg.row * sag)[0]);
    legs.iter().enumerate().map(force).collect()
}

/// Computes the stiffness due to the weight and the forces by which the legs support it; `bends` are second
/// derivatives of the joints' contribution to the legs' lengths, or empty.
pub fn geometric(
    chart: &Chart,
    legs: &[LegAt],
    forces: &[f64],
    bends: &[DMatrix<f64>],
    body: &Body,
    gravity: &Vector3<f64>,
) -> DMatrix<f64> {
    let count = chart.count();
    let curved = |point: &Vector3<f64>, along: &Vector3<f64>| {
        DMatrix::from_fn(count, count, |i, k| along.dot(&chart.curvature(point, i, k)))
    };
    let mut stiffness = curved(&body.centre, gravity) * -body.mass;
    for (i, (leg, force)) in legs.iter().zip(forces).enumerate() {
        let moved = chart.displacement(&leg.anchor);
        let across = Matrix3::identity() - leg.along * leg.along.transpose();
        let mut bend = moved.tr_mul(&(across * &moved)) / leg.length;
        bend += curved(&leg.anchor, &leg.along);
        if let Some(of_nut) = bends.get(i) {
            bend += of_nut;
        }
        stiffness -= bend * *force;
    }
    stiffness
}

/// Returns whether a leg is a strut whose nut rotates.
pub(crate) fn has_lead(config: &Mechanism, leg: usize) -> bool {
    config.geometry.legs()[leg].kind.screw().lead != 0.0
}

/// Computes the second derivatives of the nut corrections, by central differences of their rows.
fn nut_curvatures(
    config: &Mechanism,
    at: &At,
    tool: &Vector3<f64>,
) -> Result<Vec<DMatrix<f64>>, Fault> {
    let chart = Chart::of(config, at, tool);
    let (tip, per_mm) = (tip(config, tool), config.units_per_mm);
    let radius = config.machine.radius() / per_mm;
    let count = chart.count();
    let mut bends = vec![DMatrix::zeros(count, count); config.legs()];
    let turns = |i: usize| has_lead(config, i);
    if !(0..config.legs()).any(turns) {
        return Ok(bends);
    }
    for k in 0..count {
        let step = STEP * if chart.is_angle(k) { 1.0 } else { radius };
        let side = |by: f64| -> Result<DMatrix<f64>, Fault> {
            let pose = chart.moved(at.pose(), k, by, &tip, per_mm);
            let at = config.machine.at(&pose, tool)?;
            let rows = joint_rows(config, &at)? - length_rows(config, &at, tool);
            Ok(Chart::of(config, &at, tool).rows(&rows, &tip, per_mm))
        };
        let change: DMatrix<f64> = (side(step)? - side(-step)?) / (2.0 * step);
        for (i, bend) in bends.iter_mut().enumerate().filter(|(i, _)| turns(*i)) {
            // Half from either side of the diagonal.
            let half = change.row(i) / 2.0;
            let mut row = bend.row_mut(k);
            row += &half;
            let mut column = bend.column_mut(k);
            column += half.transpose();
        }
    }
    Ok(bends)
}
