// SPDX-License-Identifier: GPL-2.0-or-later
//! Input and output of forward: settings, solution, proof, and the work that one call may use.

use crate::fault::{Cause, Fault};
use crate::lanes::are_within;
use crate::layout::{MAX_LEGS, PerLeg};
use crate::pose::Pose;
use crate::spheres::Meeting;
use nalgebra::Vector3;

/// Largest value of `limit_iterations`, linear solves.
pub const MAX_ITERATIONS: u32 = 288;

/// Largest number of sub-steps in one call.
pub const MAX_SUB_STEPS: u32 = 96;

/// Search method of forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Closed form, certified ball or certified tracking: correct or refused.
    Certified,
    /// The certified method without closed forms, for comparison.
    General,
    /// Newton's method without proof, for comparison: may return another assembly mode.
    PlainNewton,
}

/// Settings of the solver; all may change between calls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solver {
    /// Largest accepted leg residual, in joint units; values below
    /// 16 · 2⁻⁵² of the machine's size have no effect.
    pub convergence_criterion: f64,
    /// Largest number of linear solves, 1 to [`MAX_ITERATIONS`].
    pub limit_iterations: u32,
    /// Largest accepted leg residual if legs exceed coordinates, in machine units;
    /// 0 = 5e-3 of the platform radius.
    pub residual_limit: f64,
    /// Search method.
    pub method: Method,
}

/// Proof that accompanies a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Certificate {
    /// Newton's method alone: no proof.
    None,
    /// L(d) d < 1 of the last ball: the legs determine the pose within it.
    Ball(f64),
    /// The pose is an intersection of three spheres, and the joints lead from the seed to this one of their
    /// two points, see the module `spheres`.
    Spheres,
}

/// A pose that forward found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The pose, with the angles nearest to those of the seed.
    pub pose: Pose,
    /// The same with the coordinates that constraints determine, as [`crate::Machine::full_pose`] returns it.
    pub full: Pose,
    /// Linear solves used.
    pub iterations: u32,
    /// Sub-steps of the joint path; 1 = one ball at the seed was enough.
    pub sub_steps: u32,
    /// Largest leg residual as an error of its joint, in machine units: of a strut's
    /// length, of a carriage's position, of an arm's end along its circle. An upper bound for three
    /// spheres.
    pub residual: f64,
    /// Nut-rotation corrections at the pose, machine units; zeros without a lead.
    pub corrections: PerLeg,
    /// The proof.
    pub certificate: Certificate,
}

/// Rounding of a residual: a criterion below this share of the size cannot be met.
const RESIDUAL_ROUNDING: f64 = 16.0 * f64::EPSILON;

impl Solver {
    /// Returns the largest accepted leg residual for a machine of this size.
    #[inline(always)]
    pub(crate) fn criterion(&self, size: f64) -> f64 {
        self.convergence_criterion.max(RESIDUAL_ROUNDING * size)
    }

    /// Refuses unusable settings.
    #[inline(always)]
    pub(crate) fn check(&self) -> Result<(), Fault> {
        if !(1..=MAX_ITERATIONS).contains(&self.limit_iterations) {
            let value = f64::from(self.limit_iterations);
            return Err(Fault::with_value(Cause::LimitIterationsInvalid, value));
        }
        if !(self.convergence_criterion > 0.0 && self.convergence_criterion.is_finite()) {
            return Err(Fault::with_value(Cause::CriterionInvalid, self.convergence_criterion));
        }
        if !(self.residual_limit >= 0.0 && self.residual_limit.is_finite()) {
            return Err(Fault::with_value(Cause::ResidualLimitInvalid, self.residual_limit));
        }
        Ok(())
    }
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            convergence_criterion: 1e-9,
            limit_iterations: MAX_ITERATIONS,
            residual_limit: 0.0,
            method: Method::Certified,
        }
    }
}

impl Solution {
    /// Creates the solution for the intersection of three spheres.
    #[inline(always)]
    pub(crate) fn of_spheres(Meeting { point, residual }: Meeting) -> Self {
        let pose = Pose { position: point, angles: Vector3::zeros() };
        Self {
            pose,
            full: pose,
            iterations: 1,
            sub_steps: 1,
            residual,
            corrections: [0.0; MAX_LEGS],
            certificate: Certificate::Spheres,
        }
    }
}

/// Work counters and limits of one call.
pub(super) struct Effort {
    /// Linear solves.
    pub(super) spent: u32,
    pub(super) sub_steps: u32,
    pub(super) limit: u32,
    /// Pose error at which the iteration stops, a length.
    pub(super) tolerance: f64,
    /// Largest accepted leg residual.
    pub(super) accepted: f64,
}

impl Effort {
    /// Returns whether a pose error (a length) and the corresponding residuals are small enough.
    #[inline(always)]
    pub(super) fn is_converged<const N: usize>(&self, error: f64, residual: &[f64; N]) -> bool {
        error <= self.tolerance && are_within(residual, self.accepted)
    }

    /// Counts one linear solve.
    pub(super) fn spend(&mut self) -> Result<(), Fault> {
        if self.spent >= self.limit {
            return Err(Fault::with_value(Cause::TooManyIterations, f64::from(self.limit)));
        }
        self.spent += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effort_counts_solves_up_to_its_limit_and_converges_by_error_and_residuals() {
        let mut effort =
            Effort { spent: 0, sub_steps: 1, limit: 2, tolerance: 1e-9, accepted: 1e-6 };
        assert_eq!((effort.spend(), effort.spend()), (Ok(()), Ok(())));
        assert_eq!(effort.spend(), Err(Fault::with_value(Cause::TooManyIterations, 2.0)));
        assert_eq!(effort.spent, 2);
        let residual = [1e-6, -1e-6, 0.0, 0.0];
        assert!(effort.is_converged(1e-9, &residual));
        assert!(!effort.is_converged(1.1e-9, &residual));
        assert!(!effort.is_converged(0.0, &[0.0, -1.1e-6, 0.0, 0.0]));
        assert!(!effort.is_converged(f64::NAN, &residual));
    }
}
