// SPDX-License-Identifier: GPL-2.0-or-later
//! Confidence region of the tip, from the covariance of the parameters.

use super::model::{Model, Quantity, unit};
use super::reading::{Changed, Posed};
use kinematics::{Fault, Letter, Limit, Margin, Part, Pose, Vector3};
use machine::limits;
use machine::read::mechanism::Mechanism;
use nalgebra::{DMatrix, Matrix3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Number of poses that represent the workspace.
const SAMPLES: usize = 60;

pub const CONFIDENCE: f64 = 0.95;

/// Region that contains the tip with probability [`CONFIDENCE`].
#[derive(Clone, Debug, PartialEq)]
pub struct Ellipsoid {
    pub pose: Pose,
    /// Half axes, longest first, machine units.
    pub half_axes: [f64; 3],
    /// Direction of the longest axis, in base.
    pub direction: Vector3<f64>,
}

/// Returns the rates of the tip with respect to the parameters at fixed joints, relative to frame 0 if its
/// position is a parameter as well: a common motion of base and frame is no error of the workpiece.
pub fn rates(model: &Model, posed: &Posed) -> DMatrix<f64> {
    let mut rates = posed.rates.rows(0, 3).into_owned();
    let away = posed.tip - model.frames.first().map_or(Vector3::zeros(), |frame| frame.origin);
    for (k, parameter) in model.parameters.iter().enumerate() {
        if let Quantity::Frame(0, axis) = parameter.quantity {
            let d = unit(axis % 3);
            rates.set_column(k, &if axis < 3 { -d } else { -d.cross(&away) });
        }
    }
    rates
}

/// Computes the confidence region of the tip, for parameters with this covariance.
///
/// # Errors
/// As [`kinematics::Machine::inverse`].
pub(crate) fn ellipsoid(
    changed: &Changed,
    model: &Model,
    covariance: &DMatrix<f64>,
    pose: &Pose,
    tool: &Vector3<f64>,
) -> Result<Ellipsoid, Fault> {
    let rates = rates(model, &changed.at(*pose, tool)?);
    let spread = &rates * covariance * rates.transpose();
    let spread = Matrix3::from_fn(|i, k| spread[(i, k)]);
    let eigen = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let reach = ChiSquared::new(3.0).map_or(f64::NAN, |law| law.inverse_cdf(CONFIDENCE));
    let half_axes = order.map(|k| (eigen.eigenvalues[k].max(0.0) * reach).sqrt());
    Ok(Ellipsoid { pose: *pose, half_axes, direction: eigen.eigenvectors.column(order[0]).into() })
}

/// Returns the largest region over poses.
///
/// # Errors
/// As [`ellipsoid`].
pub(crate) fn largest(
    changed: &Changed,
    model: &Model,
    covariance: &DMatrix<f64>,
    poses: &[Pose],
    tool: &Vector3<f64>,
) -> Result<Option<Ellipsoid>, Fault> {
    let all = poses.iter().map(|pose| ellipsoid(changed, model, covariance, pose, tool));
    let all = all.collect::<Result<Vec<_>, _>>()?;
    Ok(all.into_iter().max_by(|a, b| a.half_axes[0].total_cmp(&b.half_axes[0])))
}

/// Returns legal poses within the axis limits: sixty at most, the same in every run.
pub fn workspace(config: &Mechanism, tool: &Vector3<f64>) -> Vec<Pose> {
    poses(config, tool, SAMPLES, 0)
}

/// Returns enough poses for a mean over the workspace, because errors grow towards its corners.
pub(crate) fn whole_workspace(config: &Mechanism, tool: &Vector3<f64>) -> Vec<Pose> {
    poses(config, tool, 5 * SAMPLES, 0)
}

/// Returns random legal poses within the axis limits.
pub fn poses(config: &Mechanism, tool: &Vector3<f64>, count: usize, seed: u64) -> Vec<Pose> {
    let mut random = Pcg64::seed_from_u64(seed);
    let letters = config.machine.layout().coordinates().as_slice();
    let mut draw = || {
        let mut pose = config.home;
        for letter in letters {
            let axis = &config.axes[letter.index()];
            if axis.min.is_finite() && axis.max.is_finite() {
                pose[letter.index()] = random.random_range(axis.min..=axis.max);
            }
        }
        // LinuxCNC compares the axis limits with the position, tool offset included.
        Pose::from_degrees(pose)
    };
    // A machine with one legal pose in a hundred within its axis limits still yields enough.
    (0..100 * count)
        .map(|_| draw())
        .filter(|pose| is_legal(config, pose, tool))
        .take(count)
        .collect()
}

/// Why no program can move the machine to a pose.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Refused {
    /// A limit of the machine, or of an axis.
    Limit(Margin),
    /// No joint values exist.
    Fault(Fault),
}

impl Refused {
    /// Describes the refusal in a sentence.
    pub(crate) fn sentence(&self, config: &Mechanism) -> String {
        match self {
            Self::Limit(margin) => limits::sentence(config, margin),
            Self::Fault(fault) => fault.to_string(),
        }
    }
}

/// Checks whether LinuxCNC lets a program move the machine to a pose. The axis limits apply too: LinuxCNC compares
/// them with the position, tool offset included.
///
/// # Errors
/// Returns the violated limit, or the fault.
pub(crate) fn programmable(
    config: &Mechanism,
    pose: &Pose,
    tool: &Vector3<f64>,
) -> Result<(), Refused> {
    let layout = config.machine.layout();
    let values = pose.to_degrees();
    let moved = Letter::ALL.into_iter().filter(|letter| !layout.is_held(*letter));
    let mut axes = moved.map(|letter| {
        let (axis, value) = (&config.axes[letter.index()], values[letter.index()]);
        Margin { limit: Limit::Axis, part: Part::Axis(letter), value, range: [axis.min, axis.max] }
    });
    match axes.find(|margin| !margin.is_kept()) {
        Some(margin) => Err(Refused::Limit(margin)),
        None => legal(config, pose, tool),
    }
}

/// Returns whether a pose is within the machine's limits, axis limits excluded.
pub(crate) fn is_legal(config: &Mechanism, pose: &Pose, tool: &Vector3<f64>) -> bool {
    legal(config, pose, tool).is_ok()
}

fn legal(config: &Mechanism, pose: &Pose, tool: &Vector3<f64>) -> Result<(), Refused> {
    let at = config.machine.at(pose, tool).map_err(Refused::Fault)?;
    at.check(&limits::beyond_axes(config)).map_err(Refused::Limit)
}
