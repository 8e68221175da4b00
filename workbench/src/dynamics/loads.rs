// SPDX-License-Identifier: GPL-2.0-or-later
//! Forces and torques of the drives by virtual work: wrench at the tool tip, weight and inertia.
//!
//! Gᵀ f = Pcᵀ m (a - g) + Ωᵀ (I α + ω × I ω) + Σ Pᵀ μ P η'' - Sᵀ W with the rows G of the legs; where legs
//! exceed coordinates, f are those of springs that nothing has tightened. A drive feels f times the change of
//! its leg's length per joint unit, and what its own mass takes; a motor feels that through the lead.

use crate::dynamics::chart::Chart;
use crate::dynamics::model::Model;
use crate::dynamics::structure::{LegAt, leg_mass, legs, stiffness, tip};
use crate::read::machine::MachineConfig;
use kinematics::{Fault, Joints, LegKind, MAX_JOINTS, Pose, Vector3};
use nalgebra::DVector;

/// What acts on the tool tip, machine axes: N and N mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force on the tool.
    pub force: Vector3<f64>,
    /// Moment about the tip.
    pub moment: Vector3<f64>,
}

/// How a machine moves at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving {
    /// The pose.
    pub pose: Pose,
    /// Tool vector of the machine, machine units.
    pub tool: Vector3<f64>,
    /// Rates of X Y Z A B C, machine units and radians per second.
    pub rate: [f64; 6],
    /// Their rates.
    pub acceleration: [f64; 6],
    /// Second derivatives of the joint values, joint units (degrees of an arm) per second squared.
    pub joints: Joints,
}

impl Moving {
    /// At rest.
    pub fn still(pose: Pose, tool: Vector3<f64>) -> Self {
        let (rate, acceleration, joints) = ([0.0; 6], [0.0; 6], [0.0; MAX_JOINTS]);
        Self { pose, tool, rate, acceleration, joints }
    }
}

/// What every drive has to do, legs, then table axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Loads {
    /// Along every leg, N, positive where it pushes the platform.
    pub legs: Vec<f64>,
    /// Of every drive towards growing joint values: N, or N mm of an arm.
    pub drives: Vec<f64>,
}

/// Forces of the drives; `None` where the legs do not hold the platform.
///
/// # Errors
/// As [`kinematics::Machine::at`].
pub fn loads(
    config: &MachineConfig,
    model: &Model,
    moving: &Moving,
    wrench: &Wrench,
) -> Result<Option<Loads>, Fault> {
    let at = config.machine.at(&moving.pose, &moving.tool)?;
    let chart = Chart::of(config, &at);
    let legs = legs(config, &at, &moving.tool, model.screw)?;
    let tip = tip(config, &moving.tool);
    let motion = PlatformMotion::of(config, &chart, &tip, moving);
    let rotation = at.rotation();
    let body = &model.body;
    let moved = chart.displacement(&body.centre);
    let speed = chart.turns() * &motion.rate;
    let turning = chart.turns() * &motion.acceleration + chart.turning(&motion.rate);
    let linear = &moved * &motion.acceleration + chart.bend(&body.centre, &motion.rate);
    let inertia = rotation * body.inertia * rotation.transpose();
    let force: Vector3<f64> = (linear - model.gravity) * body.mass;
    let moment: Vector3<f64> = inertia * turning + speed.cross(&(inertia * speed));
    let mut asked = moved.tr_mul(&force) + chart.turns().tr_mul(&moment);
    for (leg, own) in legs.iter().zip(&model.legs) {
        asked += leg_mass(&chart, leg, own) * &motion.acceleration;
    }
    asked -= chart.displacement(&tip).tr_mul(&wrench.force);
    asked -= chart.turns().tr_mul(&wrench.moment);
    let Some(factors) = stiffness(&legs, model, chart.count()).cholesky() else { return Ok(None) };
    let yielded = factors.solve(&asked);
    let along: Vec<f64> = legs
        .iter()
        .zip(&model.legs)
        .map(|(leg, own)| own.spring.along(leg.gain) * (&leg.row * &yielded)[0])
        .collect();
    let drives = drives(config, model, moving, wrench, &legs, &along);
    Ok(Some(Loads { legs: along, drives }))
}

/// The platform's coordinates in motion, mm and radians.
struct PlatformMotion {
    rate: DVector<f64>,
    acceleration: DVector<f64>,
}

impl PlatformMotion {
    /// From those of the tool tip: the machine's centre stands at the tip less R of what lies between.
    fn of(config: &MachineConfig, chart: &Chart, tip: &Vector3<f64>, moving: &Moving) -> Self {
        let per_mm = config.units_per_mm;
        let [x, y, z, a, b, c] = moving.rate;
        let omega = crate::rows::rate_map(&moving.pose) * Vector3::new(a, b, c);
        let lever = moving.pose.rotation() * (chart.centre() - tip);
        let rate = chart.rates(&(Vector3::new(x, y, z) / per_mm + omega.cross(&lever)), &omega);
        let [x, y, z, a, b, c] = moving.acceleration;
        let angular = crate::rows::rate_map(&moving.pose) * Vector3::new(a, b, c);
        let turning = angular + chart.turning(&rate);
        let linear = Vector3::new(x, y, z) / per_mm
            + turning.cross(&lever)
            + omega.cross(&omega.cross(&lever));
        Self { acceleration: chart.rates(&linear, &angular), rate }
    }
}

fn drives(
    config: &MachineConfig,
    model: &Model,
    moving: &Moving,
    wrench: &Wrench,
    legs: &[LegAt],
    along: &[f64],
) -> Vec<f64> {
    let of_leg = legs.iter().zip(along).enumerate().map(|(i, (leg, force))| {
        let acceleration = match config.geometry.legs()[i].kind {
            LegKind::Crank(_) => moving.joints[i].to_radians(),
            LegKind::Strut(_) | LegKind::Slider(_) => moving.joints[i] / config.units_per_mm,
        };
        force * leg.signed_gain + model.legs[i].drive.unwrap_or(0.0) * acceleration
    });
    let of_table = model.table.iter().enumerate().map(|(k, axis)| {
        let acceleration = moving.joints[legs.len() + k] / config.units_per_mm;
        axis.mass * acceleration - wrench.force[axis.axis]
    });
    of_leg.chain(of_table).collect()
}
