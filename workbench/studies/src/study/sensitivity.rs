// SPDX-License-Identifier: GPL-2.0-or-later
//! The effect of joint errors on the pose, and the distance to singular poses.
//!
//! Let J be the Jacobian of the joints with respect to the pose, and g the change of a leg's length per joint
//! unit. Forward kinematics minimize the errors of the legs' lengths, so small joint errors dq
//! move the pose by `dX = (g J)⁺ g dq`, which is J⁻¹ dq if there are as many legs as coordinates.
//! On a machine with constraints of the platform, J is the Jacobian over the commanded coordinates, which the dependent ones
//! follow. A pose is singular if J loses rank (the legs do not constrain the platform, *parallel*) or if
//! a rod is perpendicular to the motion of its lower end (*serial*).
//!
//! Paper 001 uses the ratios of rates along one path, l̇ⱼ/ẋᵢ, as partial derivatives. They are the
//! outer product of two vectors, of rank 1 for every machine and pose, and become infinite where
//! a coordinate of the path reverses; see [`ratios`].

use kinematics::{At, Cause, Fault, Joints, MAX_JOINTS, Pose, Vector3};
use machine::files;
use machine::proof::axis_box::AxisBox;
use machine::read::columns::coordinates;
use machine::read::mechanism::Mechanism;
use machine::rows::{self, Rows};
use nalgebra::{Matrix2, Matrix6, SMatrix, SVector};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Pose coordinates by joints: X Y Z in machine units, A B C in degrees, per joint unit.
pub type Gain = SMatrix<f64, 6, MAX_JOINTS>;

/// Default length that converts an angle to a length, mm (paper 001's m).
pub const LENGTH_MM: f64 = 100.0;

/// Steps of a search along a ray, and halvings that refine a result.
const RAY_STEPS: usize = 60;
const HALVINGS: usize = 60;

/// Conditioning below which a minimum along a ray is singular: the search locates the V-shaped minimum of a
/// crossing to 1e-12 of the ray, and the minimum near a singular pose that is not crossed is far larger.
const SINGULAR: f64 = 1e-8;

/// Errors of a pose, and its conditioning.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    /// Pose changes per joint error, those of dependent coordinates included.
    pub gain: Gain,
    /// The pose with its dependent coordinates.
    pub pose: Pose,
    /// Largest and smallest singular value of J with angles times the length, and its determinant
    /// (its magnitude; the product of the singular values if there are more legs than coordinates).
    pub singular_values: [f64; 2],
    /// See `singular_values`.
    pub determinant: f64,
}

/// Returns the Jacobian of the joints, per machine unit and degree, with 0 in columns that no joint moves.
///
/// # Errors
/// As [`kinematics::Machine::inverse`].
pub(crate) fn jacobian(config: &Mechanism, at: &At) -> Result<Rows, Fault> {
    Ok(rows::moved_columns(config, at.pose_jacobian()?))
}

impl Sensitivity {
    /// Computes the sensitivity at a pose; `None` if it is singular. `length` (machine units) converts angles
    /// to lengths.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn at(
        config: &Mechanism,
        pose: &Pose,
        tool: &Vector3<f64>,
        length: f64,
    ) -> Result<Option<Self>, Fault> {
        let at = config.machine.at(pose, tool)?;
        let jacobian = jacobian(config, &at)?;
        let scaled = scaled(&jacobian, length);
        let moved = rows::moved(config).len();
        let weights = weights(config, &at);
        let Some(inverse) = rows::inverse(&(weights * scaled), moved) else { return Ok(None) };
        let mut gain = inverse * weights;
        for k in 3..6 {
            gain.row_mut(k).scale_mut(1_f64.to_degrees() / length);
        }
        if config.machine.layout().constraints() > 0 {
            gain = in_degrees(rows::follow_on_work(
                &config.geometry,
                config.machine.radius(),
                &at,
                tool,
            )) * gain;
        }
        let values = rows::singular_values(&scaled, moved);
        Ok(Some(Self {
            gain,
            pose: rows::with_dependent(&config.machine, pose, tool)?,
            singular_values: [values[0], values[moved - 1]],
            determinant: values.iter().product(),
        }))
    }

    /// Returns the largest error of each coordinate if no joint error exceeds its `bound`.
    pub fn worst(&self, bound: &[f64]) -> [f64; 6] {
        std::array::from_fn(|i| {
            bound.iter().enumerate().map(|(j, b)| self.gain[(i, j)].abs() * b).sum()
        })
    }

    /// Returns the covariance of the pose for independent errors of these standard deviations.
    pub(crate) fn covariance(&self, sigma: &[f64]) -> SMatrix<f64, 6, 6> {
        let mut scaled = self.gain;
        for j in 0..MAX_JOINTS {
            scaled.column_mut(j).scale_mut(sigma.get(j).copied().unwrap_or(0.0));
        }
        scaled * scaled.transpose()
    }

    /// Returns the standard deviation of each coordinate.
    pub fn sigma(&self, sigma: &[f64]) -> [f64; 6] {
        let covariance = self.covariance(sigma);
        std::array::from_fn(|i| covariance[(i, i)].sqrt())
    }
}

/// Returns the standard deviations of the direction of the spindle axis, which is Z of the platform: angles in degrees in
/// two perpendicular directions, the largest first, for independent errors of the joints.
pub fn axis_sigma(found: &Sensitivity, sigma: &[f64]) -> [f64; 2] {
    let (rotation, turns) = (found.pose.rotation(), rows::rate_map(&found.pose));
    let mut covariance = Matrix2::zeros();
    for (j, sigma) in sigma.iter().enumerate() {
        let angles = Vector3::from_fn(|k, _| found.gain[(3 + k, j)]);
        let moved = rotation.tr_mul(&(turns * angles)).cross(&Vector3::z()).xy() * *sigma;
        covariance += moved * moved.transpose();
    }
    let values = covariance.symmetric_eigenvalues();
    // Rounding may make the smaller one negative.
    [values.max(), values.min().max(0.0)].map(f64::sqrt)
}

/// Converts rates per machine unit and radian to rates per machine unit and degree.
fn in_degrees(rates: Matrix6<f64>) -> Matrix6<f64> {
    let unit = |k: usize| if k < 3 { 1.0 } else { 1_f64.to_degrees() };
    Matrix6::from_fn(|i, k| rates[(i, k)] * unit(i) / unit(k))
}

fn scaled(jacobian: &Rows, length: f64) -> Rows {
    let mut scaled = *jacobian;
    for k in 3..6 {
        scaled.column_mut(k).scale_mut(1_f64.to_degrees() / length);
    }
    scaled
}

fn weights(config: &Mechanism, at: &At) -> SMatrix<f64, MAX_JOINTS, MAX_JOINTS> {
    let gains = rows::gains(config, at);
    let value = |i: usize| gains.get(i).copied().unwrap_or(0.0);
    SMatrix::from_diagonal(&SVector::<f64, MAX_JOINTS>::from_fn(|i, _| value(i)))
}

/// The effect of random joint errors on the pose, by the core's forward kinematics.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    pub count: usize,
    /// Standard deviation of each coordinate: X Y Z in machine units, A B C in degrees.
    pub sigma: [f64; 6],
    /// Root mean square of the angle by which the spindle axis is off, degrees.
    pub axis: f64,
}

/// Draws independent normal errors of the joints, and solves forward kinematics for each draw;
/// uses the same random numbers in every run.
///
/// # Errors
/// The pose, or one of those with an error, has no joint values or no forward solution.
pub fn monte_carlo(
    config: &Mechanism,
    pose: &Pose,
    tool: &Vector3<f64>,
    sigma: &[f64],
    count: usize,
) -> Result<Drawn, Fault> {
    let joints = config.machine.inverse(pose, tool)?;
    // With more legs than coordinates, joints with errors contradict each other by design.
    let solver = kinematics::Solver { residual_limit: config.machine.size(), ..config.solver };
    let mut rng = Pcg64::seed_from_u64(0);
    let (mut sum, mut square, mut axis) = ([0.0; 6], [0.0; 6], 0.0);
    let whole = rows::with_dependent(&config.machine, pose, tool)?;
    let (asked, straight) = (whole.to_degrees(), whole.rotation().column(2).into_owned());
    for _ in 0..count {
        let mut off = joints;
        for (joint, sigma) in off.iter_mut().zip(sigma) {
            *joint += sigma * rng.sample::<f64, _>(StandardNormal);
        }
        let found = config.machine.forward(&off, pose, tool, &solver)?.pose;
        let found = rows::with_dependent(&config.machine, &found, tool)?;
        axis += found.rotation().column(2).cross(&straight).norm_squared();
        let found = found.to_degrees();
        for k in 0..6 {
            sum[k] += found[k] - asked[k];
            square[k] += (found[k] - asked[k]).powi(2);
        }
    }
    let n = count as f64;
    let sigma = std::array::from_fn(|k| ((square[k] - sum[k] * sum[k] / n) / (n - 1.0)).sqrt());
    Ok(Drawn { count, sigma, axis: (axis / n).sqrt().to_degrees() })
}

/// Kind of a singular pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The legs do not constrain the platform.
    Parallel,
    /// A rod is so nearly perpendicular to the motion of its lower end that the core refuses any pose
    /// beyond.
    Serial,
    /// The constraints cease to determine the dependent coordinates.
    Constraint,
}

/// A singular pose near a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Singular {
    pub kind: Kind,
    pub pose: [f64; 6],
    /// Relative distance: 0 in the middle of the region, 1 on its border, above 1 outside.
    pub reach: f64,
}

/// Result of a search for singular poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Near {
    /// Number of rays searched.
    pub rays: usize,
    /// The nearest pose of each kind found.
    pub nearest: Vec<Singular>,
    /// The smallest conditioning inside the region.
    pub least: f64,
}

/// Searches `rays` random rays from the middle of a region to `factor` times its border; a
/// search reports only what the rays meet, and proves nothing about the rest.
pub fn near(
    config: &Mechanism,
    region: &AxisBox,
    tool: &Vector3<f64>,
    rays: usize,
    factor: f64,
) -> Near {
    let mut rng = Pcg64::seed_from_u64(0);
    let mut near = Near { rays, nearest: vec![], least: f64::INFINITY };
    for _ in 0..rays {
        let ray = Ray::random(region, &mut rng);
        let hold = |reach: f64| ray.hold(config, tool, reach);
        near.look_along(&ray, hold, factor);
    }
    near
}

impl Near {
    fn look_along(&mut self, ray: &Ray, hold: impl Fn(f64) -> Result<f64, Kind>, factor: f64) {
        let step = factor / RAY_STEPS as f64;
        let mut values: Vec<f64> = vec![];
        for k in 0..=RAY_STEPS {
            let reach = step * k as f64;
            let value = match hold(reach) {
                Ok(value) => value,
                Err(kind) => {
                    self.note(kind, ray, last(&hold, reach - step, reach));
                    break;
                }
            };
            if reach <= 1.0 {
                self.least = self.least.min(value);
            }
            values.push(value);
        }
        for (k, three) in values.windows(3).enumerate() {
            if three[1] <= three[0] && three[1] <= three[2] {
                let (reach, value) = lowest(&hold, step * k as f64, step * (k + 2) as f64);
                if value < SINGULAR {
                    self.note(Kind::Parallel, ray, reach);
                    return;
                }
            }
        }
    }

    fn note(&mut self, kind: Kind, ray: &Ray, reach: f64) {
        let found = Singular { kind, pose: ray.at(reach), reach };
        match self.nearest.iter_mut().find(|known| known.kind == kind) {
            Some(known) if known.reach <= reach => (),
            Some(known) => *known = found,
            None => self.nearest.push(found),
        }
    }
}

/// Returns the last reach that has a value, between one with and one without.
fn last(hold: &impl Fn(f64) -> Result<f64, Kind>, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..HALVINGS {
        let middle = (low + high) / 2.0;
        match hold(middle) {
            Ok(_) => low = middle,
            Err(_) => high = middle,
        }
    }
    low
}

/// Returns position and value of a minimum, by golden-section search.
fn lowest(hold: &impl Fn(f64) -> Result<f64, Kind>, mut low: f64, mut high: f64) -> (f64, f64) {
    let value = |reach| hold(reach).unwrap_or(f64::INFINITY);
    let share = (5.0_f64.sqrt() - 1.0) / 2.0;
    for _ in 0..HALVINGS {
        let (left, right) = (high - share * (high - low), low + share * (high - low));
        match value(left) < value(right) {
            true => high = right,
            false => low = left,
        }
    }
    ((low + high) / 2.0, value((low + high) / 2.0))
}

/// A ray from the middle of a region.
struct Ray {
    middle: [f64; 6],
    /// Vector from the middle to the border.
    to_border: [f64; 6],
}

impl Ray {
    fn random(region: &AxisBox, rng: &mut Pcg64) -> Self {
        let direction: [f64; 6] = std::array::from_fn(|_| 2.0 * rng.random::<f64>() - 1.0);
        let half = |k: usize| (region.high[k] - region.low[k]) / 2.0;
        let longest = (0..6)
            .filter(|k| half(*k) > 0.0)
            .map(|k| direction[k].abs())
            .fold(f64::MIN_POSITIVE, f64::max);
        Self {
            middle: std::array::from_fn(|k| (region.high[k] + region.low[k]) / 2.0),
            to_border: std::array::from_fn(|k| half(k) * direction[k] / longest),
        }
    }

    fn at(&self, reach: f64) -> [f64; 6] {
        std::array::from_fn(|k| self.middle[k] + reach * self.to_border[k])
    }

    /// Returns the conditioning; an error if there are no joint values.
    fn hold(&self, config: &Mechanism, tool: &Vector3<f64>, reach: f64) -> Result<f64, Kind> {
        config
            .machine
            .at(&Pose::from_degrees(self.at(reach)), tool)
            .map(|at| at.smallest_singular_value())
            .map_err(|fault| match fault.cause {
                Cause::ConstraintSingular => Kind::Constraint,
                _ => Kind::Serial,
            })
    }
}

/// Returns the ratios of rates along a path, q̇ⱼ/ẋᵢ, one row per joint: the table that paper 001 calls a
/// matrix of partial derivatives. For every machine it has rank 1, and it does not describe other
/// directions than that of the path.
pub fn ratios(joint_rates: &[f64], pose_rates: &[f64]) -> Vec<Vec<f64>> {
    joint_rates.iter().map(|q| pose_rates.iter().map(|x| q / x).collect()).collect()
}

/// Results at one pose of a motion.
#[derive(Clone, Debug)]
pub struct Point {
    /// Seconds.
    pub time: f64,
    /// x y z in machine units, a b c in degrees.
    pub pose: [f64; 6],
    /// Rates of the pose, per second.
    pub rate: [f64; 6],
    pub joints: Joints,
    /// Joint units per second.
    pub rates: Joints,
    /// Standard deviations of the coordinates.
    pub sigma: [f64; 6],
    /// Smallest singular value of J, angles times the length.
    pub hold: f64,
}

/// Early end of a motion: a time in seconds, and the reason.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum End {
    #[error("at {0:.3} s: {1}")]
    Reach(f64, Fault),
    #[error(
        "at {0:.3} s: singular pose: the legs do not constrain the platform; change the law of motion"
    )]
    Singular(f64),
}

/// Computes one pose of a motion, with its rate.
///
/// # Errors
/// See [`End`].
pub fn along(
    config: &Mechanism,
    time: f64,
    (pose, rate): (&[f64; 6], &[f64; 6]),
    tool: &Vector3<f64>,
    sigma: &[f64],
    length: f64,
) -> Result<Point, End> {
    let at = Pose::from_degrees(*pose);
    let ended = |fault: Fault| End::Reach(time, fault);
    let here = config.machine.at(&at, tool).map_err(ended)?;
    let rates = here.rates(rate).map_err(ended)?;
    let found = Sensitivity::at(config, &at, tool, length).map_err(ended)?;
    let found = found.ok_or(End::Singular(time))?;
    Ok(Point {
        time,
        pose: *pose,
        rate: *rate,
        joints: *here.joints(),
        rates,
        sigma: found.sigma(sigma),
        hold: found.singular_values[1],
    })
}

/// Formats points of a motion as CSV.
pub fn csv(config: &Mechanism, points: &[Point]) -> String {
    let count = config.joints.len();
    let named = |what: &str| coordinates().iter().map(|c| format!("{what}_{c}")).collect();
    let joints = |what: &str| (0..count).map(|i| format!("{what}_{i}")).collect::<Vec<_>>();
    let names = [
        vec!["time".to_string()],
        coordinates(),
        joints("joint"),
        joints("rate"),
        named("sigma"),
        vec!["hold".to_string()],
    ];
    let row = |point: &Point| {
        std::iter::once(point.time)
            .chain(point.pose)
            .chain(point.joints.into_iter().take(count))
            .chain(point.rates.into_iter().take(count))
            .chain(point.sigma)
            .chain([point.hold])
    };
    files::csv(&names.concat(), points.iter().map(row))
}
