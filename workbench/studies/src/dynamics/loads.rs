// SPDX-License-Identifier: GPL-2.0-or-later
//! Forces and torques of the drives by virtual work: wrench at the tool tip, weight and inertia.
//!
//! Gᵀ f = Pcᵀ m (a - g) + Ωᵀ (I α + ω × I ω) + Σ Pᵀ μ P η'' - Sᵀ W with the rows G of the legs; if legs
//! exceed coordinates, f are the forces of unpreloaded springs. With constraints of the platform, P, Ω, G and S are those
//! of motions that they allow, in which their reactions do no work, and a, α and ω those of all coordinates. The load of a drive is f times the change of
//! its leg's length per joint unit, plus the force for its own mass; the lead converts it to motor torque.

use crate::dynamics::chart::Chart;
use crate::dynamics::model::Model;
use crate::dynamics::structure::{LegAt, leg_mass, legs, stiffness, tip};
use kinematics::{Fault, Joints, MAX_JOINTS, Matrix3, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Load on the tool tip, machine axes: N and N mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    pub force: Vector3<f64>,
    /// Moment about the tip.
    pub moment: Vector3<f64>,
}

/// Motion of a machine at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving {
    pub pose: Pose,
    /// Tool vector of the machine, machine units.
    pub tool: Vector3<f64>,
    /// Rates of X Y Z A B C, machine units and radians per second; with constraints of the platform, those of
    /// [`kinematics::Machine::full_pose`].
    pub rate: [f64; 6],
    /// Derivatives of the rates.
    pub acceleration: [f64; 6],
    /// Second derivatives of the joint values, joint units (degrees for an arm) per second squared.
    pub joints: Joints,
}

impl Moving {
    /// Creates a machine at rest.
    pub fn still(pose: Pose, tool: Vector3<f64>) -> Self {
        let (rate, acceleration, joints) = ([0.0; 6], [0.0; 6], [0.0; MAX_JOINTS]);
        Self { pose, tool, rate, acceleration, joints }
    }
}

/// Loads of the drives: legs, then table axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Loads {
    /// Along every leg, N, positive if it pushes the platform.
    pub legs: Vec<f64>,
    /// Of every drive towards increasing joint values: N, or N mm for an arm.
    pub drives: Vec<f64>,
}

/// Computes the forces of the drives; `None` at a singular pose.
///
/// # Errors
/// As [`kinematics::Machine::at`].
pub fn loads(
    config: &Mechanism,
    model: &Model,
    moving: &Moving,
    wrench: &Wrench,
) -> Result<Option<Loads>, Fault> {
    let held = Held::at(config, model, &moving.pose, &moving.tool)?;
    Ok(held.map(|held| held.loads(moving, wrench)))
}

/// A machine at a pose, prepared for any motion and load there.
pub struct Held<'a> {
    config: &'a Mechanism,
    model: &'a Model,
    chart: Chart,
    /// The chart of all coordinates that change.
    whole: Chart,
    legs: Vec<LegAt>,
    /// The tool tip in the platform frame, mm.
    tip: Vector3<f64>,
    rotation: Matrix3<f64>,
    /// Contribution of the legs' masses to that of the platform.
    carried: DMatrix<f64>,
    /// Factors of the stiffness of the legs.
    factors: Cholesky<f64, Dyn>,
}

impl<'a> Held<'a> {
    /// Prepares a machine at a pose; `None` if it is singular.
    ///
    /// # Errors
    /// As [`kinematics::Machine::at`].
    pub fn at(
        config: &'a Mechanism,
        model: &'a Model,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Option<Self>, Fault> {
        let at = config.machine.at(pose, tool)?;
        let chart = Chart::of(config, &at, tool);
        let legs = legs(config, &at, tool, model.screw)?;
        let (count, whole) = (chart.count(), chart.whole());
        let mut carried = DMatrix::zeros(whole.count(), whole.count());
        for (leg, own) in legs.iter().zip(&model.legs) {
            carried += leg_mass(&whole, leg, own);
        }
        let Some(factors) = stiffness(&legs, model, count).cholesky() else { return Ok(None) };
        let (tip, rotation) = (tip(config, tool), at.rotation());
        Ok(Some(Self { config, model, chart, whole, legs, tip, rotation, carried, factors }))
    }

    /// Computes the forces of the drives for a motion through this pose with this tool.
    pub fn loads(&self, moving: &Moving, wrench: &Wrench) -> Loads {
        let (chart, body) = (&self.whole, &self.model.body);
        let motion = self.motion(moving);
        let moved = chart.displacement(&body.centre);
        let turns = chart.turns();
        let speed = &turns * &motion.rate;
        let turning = &turns * &motion.acceleration + chart.turning(&motion.rate);
        let linear = &moved * &motion.acceleration + chart.bend(&body.centre, &motion.rate);
        let inertia = self.rotation * body.inertia * self.rotation.transpose();
        let force: Vector3<f64> = (linear - self.model.gravity) * body.mass;
        let moment: Vector3<f64> = inertia * turning + speed.cross(&(inertia * speed));
        let mut asked = moved.tr_mul(&force) + turns.tr_mul(&moment);
        asked += &self.carried * &motion.acceleration;
        asked -= chart.displacement(&self.tip).tr_mul(&wrench.force);
        asked -= turns.tr_mul(&wrench.moment);
        let yielded = self.factors.solve(&self.chart.reduced(asked));
        let along: Vec<f64> = self
            .legs
            .iter()
            .zip(self.springs())
            .map(|(leg, spring)| spring * (&leg.row * &yielded)[0])
            .collect();
        let drives = drives(self.config, self.model, moving, wrench, &self.legs, &along);
        Loads { legs: along, drives }
    }

    /// Returns the stiffness along every leg, N/mm.
    pub fn springs(&self) -> impl Iterator<Item = f64> + '_ {
        self.legs.iter().zip(&self.model.legs).map(|(leg, own)| own.spring.along(leg.gain))
    }
}

/// Motion of the platform's coordinates, mm and radians.
struct PlatformMotion {
    rate: DVector<f64>,
    acceleration: DVector<f64>,
}

impl Held<'_> {
    /// Converts the motion of the tool tip: the machine's center is at the tip minus R times their distance.
    fn motion(&self, moving: &Moving) -> PlatformMotion {
        let (chart, per_mm) = (&self.whole, self.config.units_per_mm);
        let [x, y, z, a, b, c] = moving.rate;
        let omega = chart.rate_map() * Vector3::new(a, b, c);
        let lever = self.rotation * (chart.centre() - self.tip);
        let rate = chart.rates(&(Vector3::new(x, y, z) / per_mm + omega.cross(&lever)), &omega);
        let [x, y, z, a, b, c] = moving.acceleration;
        let angular = chart.rate_map() * Vector3::new(a, b, c);
        let turning = angular + chart.turning(&rate);
        let linear = Vector3::new(x, y, z) / per_mm
            + turning.cross(&lever)
            + omega.cross(&omega.cross(&lever));
        PlatformMotion { acceleration: chart.rates(&linear, &angular), rate }
    }
}

fn drives(
    config: &Mechanism,
    model: &Model,
    moving: &Moving,
    wrench: &Wrench,
    legs: &[LegAt],
    along: &[f64],
) -> Vec<f64> {
    let of_leg = legs.iter().zip(along).enumerate().map(|(i, (leg, force))| {
        let acceleration = match config.geometry.legs()[i].kind.is_angular() {
            true => moving.joints[i].to_radians(),
            false => moving.joints[i] / config.units_per_mm,
        };
        force * leg.signed_gain + model.legs[i].drive.unwrap_or(0.0) * acceleration
    });
    let of_table = model.table.iter().enumerate().map(|(k, axis)| {
        let acceleration = moving.joints[legs.len() + k] / config.units_per_mm;
        axis.mass * acceleration - wrench.force[axis.axis]
    });
    of_leg.chain(of_table).collect()
}
