// SPDX-License-Identifier: GPL-2.0-or-later
//! Scale of the drives: the travel of all joints per commanded travel, from home on.
//!
//! No calibration changes it. A machine whose drives travel too far by one share, and whose lengths are larger by that
//! share, gives the same readings on planes, and nearly the same on a ball of unknown position: it only cuts larger.
//! So we compute whether the readings determine the scale, as one more parameter of the linear model at the best fit.
//! If they do, all bounds include it. If not, they exclude it, and the report says what its error adds.

use super::at_tool;
use super::fit::{Fit, Misfit, covariance, residuals};
use super::model::{Model, Quantity};
use super::reading::{Changed, Reading};
use super::shape;
use kinematics::Fault;
use machine::read::mechanism::Mechanism;

/// Deviation of the scale before readings: a wrong belt pitch or gear is farther off, and is noticed.
const BEFORE: f64 = 0.01;

/// Deviation below which readings determine the scale: a tenth of a millimeter per meter. The drawing's tolerances
/// alone determine it to about five times that.
const DETERMINED: f64 = 1e-4;

/// Number of deviations that a scale without error exceeds once in 16000 cases.
const FAR: f64 = 4.0;

/// The scale of the drives, as a deviation from 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveScale {
    pub change: f64,
    /// Standard deviation of the change.
    pub deviation: f64,
    /// Root mean square error of the tip's motion over the workspace per unit of change, in machine units, if the
    /// geometry is calibrated without it.
    pub motion: f64,
}

impl DriveScale {
    /// Returns whether the readings fit another scale clearly better.
    pub fn is_off(&self) -> bool {
        self.change.abs() > FAR * self.deviation
    }

    /// Returns whether the readings determine the scale and agree with it, so that bounds include it.
    pub fn is_covered(&self) -> bool {
        self.deviation < DETERMINED && !self.is_off()
    }
}

/// Adds the scale to a model and its fit of these readings, without those left out.
///
/// # Errors
/// See [`Misfit`].
pub(crate) fn with_scale(
    config: &Mechanism,
    model: &Model,
    readings: &[Reading],
    found: &Fit,
) -> Result<(Model, Fit, DriveScale), Misfit> {
    let unreachable = |fault: Fault| Misfit::Unreachable("the workspace".into(), fault);
    let home = config.machine.inverse(&config.home_pose(), &config.spindle).map_err(unreachable)?;
    let model = model.clone().with_scale(home, BEFORE);
    let mut found = Fit { changes: [&found.changes[..], &[0.0]].concat(), ..found.clone() };
    let all: Vec<&Reading> = readings.iter().collect();
    found.jacobian = residuals(&model, &all, &found.changes)?.1;
    found.covariance = covariance(&model, &found.jacobian, found.noise);
    let place = model.number(Quantity::Scale).expect("it was added");
    let column = found.covariance.column(place).clone_owned();
    let variance = column[place];
    // One step of Newton's method: at the best fit only the scale's derivative is not 0.
    let slope = found.jacobian.column(place).dot(&found.residuals) / found.noise.powi(2);
    let tool = readings.first().map_or(config.spindle, |reading| reading.tool);
    let poses = at_tool::whole_workspace(config, &tool);
    if poses.is_empty() {
        return Err(Misfit::NoWorkspace(tool.z - config.spindle.z));
    }
    let changed = Changed::new(&model, &found.changes).map_err(unreachable)?;
    let rates = shape::rates(&model, &changed, &poses, &tool).map_err(unreachable)?;
    let motion = (rates * &column).norm() / variance / (poses.len().max(1) as f64).sqrt();
    let scale = DriveScale { change: -variance * slope, deviation: variance.sqrt(), motion };
    // The geometry is calibrated at scale 1: bounds are around it, not around the best fit.
    let step = &column * (scale.change / variance);
    found.covariance += &step * step.transpose();
    Ok((model, found, scale))
}
