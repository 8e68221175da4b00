// SPDX-License-Identifier: GPL-2.0-or-later
//! The survey of a path before it is followed.
//!
//! Inverse and forward must succeed at every surveyed pose, within the limits of the joints. The largest rates
//! and second derivatives of the joints bound the speed of the motion.

use super::path::Path;
use super::{Change, Cycle, Moving};
use kinematics::{Cause, Fault, Jacobian, Joints, MAX_JOINTS, Pose, Solver, Vector3};
use libm::sqrt;

/// Parts into which the path is divided for the survey: rates change little from one to
/// the next, even 3° from the dead point of a rod.
const PARTS: u32 = 64;

const PLACES_PER_CYCLE: u32 = 4;

/// Linear solves that forward may take per pose, so that a cycle's work stays a small part of
/// it: six are enough for every path of the tests. A path that needs four times as many comes too
/// near to a singular pose.
const SOLVES_PER_PLACE: u32 = 24;

/// Fraction of the machine's size within which a pose found again counts as the same.
const SAME_POSE: f64 = 1e-9;

/// Fraction of the acceleration limit for the second derivative of a joint at constant speed.
const SECOND_DERIVATIVE_SHARE: f64 = 0.05;

/// The survey's results for a joint, per fraction of the path.
#[derive(Clone, Copy, Default)]
struct JointRates {
    rate: f64,
    largest_rate: f64,
    second_derivative: f64,
    largest_second_derivative: f64,
    /// Largest change of the second derivative from one part of the path to the next.
    largest_change: f64,
}

impl JointRates {
    /// Adds the rate at the next pose.
    fn with(self, place: u32, rate: f64) -> Self {
        let second_derivative = if place > 0 { (rate - self.rate) * f64::from(PARTS) } else { 0.0 };
        let change = if place > 1 { second_derivative - self.second_derivative } else { 0.0 };
        Self {
            rate,
            largest_rate: self.largest_rate.max(rate.abs()),
            second_derivative,
            largest_second_derivative: self.largest_second_derivative.max(second_derivative.abs()),
            largest_change: self.largest_change.max(change.abs()),
        }
    }

    /// Bounds the second derivative: the values found are the mean of each part, and within
    /// a part it changes about as much as between neighbors.
    fn second_derivative_bound(&self) -> f64 {
        self.largest_second_derivative + self.largest_change
    }

    /// Bounds the rate, between the poses too.
    fn rate_bound(&self) -> f64 {
        self.largest_rate + self.second_derivative_bound() / f64::from(PARTS)
    }
}

/// An active survey.
#[derive(Clone, Copy)]
pub(super) struct Survey {
    pub(super) path: Path,
    next: u32,
    rates: [JointRates; MAX_JOINTS],
}

impl Survey {
    pub(super) fn new(path: Path) -> Self {
        Self { path, next: 0, rates: [JointRates::default(); MAX_JOINTS] }
    }

    /// Continues for one cycle: surveys, or starts the motion at the end of the path.
    pub(super) fn continued(mut self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        self.path.refuse_other_pose(cycle, pose)?;
        for _ in 0..PLACES_PER_CYCLE {
            if self.next > PARTS {
                return Ok(Change::Moving(self.motion(cycle)));
            }
            self.visit(cycle)?;
            self.next += 1;
        }
        Ok(Change::Surveying(self))
    }

    /// Adds the rates at the next pose, if the machine can reach it.
    fn visit(&mut self, cycle: &Cycle<'_>) -> Result<(), Fault> {
        let Path { travel, from, to, turns, .. } = &self.path;
        let part = 1.0 / f64::from(PARTS);
        let share = f64::from(self.next) * part;
        let (pose, tool) = (self.path.pose_at(share), &self.path.tool_at(share));
        let mut before = self.path.pose_at(share - part);
        if *turns {
            // The platform as it was, with the present tool.
            let last = self.path.tool_at(share - part);
            let shift = cycle.machine.tool_shift(&pose, &last, &(tool - last)).map_err(blocked)?;
            before.position -= shift;
        }
        refuse_unreachable(&pose, &before, tool, cycle)?;
        let at = cycle.machine.at(&pose, tool).map_err(blocked)?;
        let rates = match turns {
            true => at.tool_rates(&(to - from)).map_err(blocked)?,
            false => {
                let jacobian = at.inverse_jacobian().map_err(blocked)?;
                core::array::from_fn(|i| rate_along(&jacobian, i, travel))
            }
        };
        for (i, joint) in self.rates.iter_mut().enumerate() {
            let rate = rates.get(i).copied().unwrap_or(f64::NAN);
            if !rate.is_finite() {
                let layout = cycle.machine.layout();
                return Err(Fault::of_joint(Cause::ToolOutOfReach, layout, i, rate));
            }
            *joint = joint.with(self.next, rate);
        }
        Ok(())
    }

    /// Starts the motion along the surveyed path, which takes at least a cycle.
    fn motion(&self, cycle: &Cycle<'_>) -> Moving {
        let mut step = 1.0_f64;
        for (joint, limits) in self.rates.iter().zip(&cycle.limits) {
            let (rate, second) = (joint.rate_bound(), joint.second_derivative_bound());
            step = step
                .min(limits.stoppable_speed(cycle.seconds) / rate * cycle.seconds)
                .min(sqrt(SECOND_DERIVATIVE_SHARE * limits.acceleration / second) * cycle.seconds);
        }
        Moving { path: self.path, share: 0.0, step }
    }
}

/// Refuses a pose whose joints are beyond their limits, or which forward does not find again.
/// Forward starts from `before`, one part of the path back.
fn refuse_unreachable(
    pose: &Pose,
    before: &Pose,
    tool: &Vector3<f64>,
    cycle: &Cycle<'_>,
) -> Result<(), Fault> {
    let joints = cycle.machine.inverse(pose, tool).map_err(blocked)?;
    within(&joints, cycle)?;
    let limit_iterations = cycle.solver.limit_iterations.min(SOLVES_PER_PLACE);
    let solver = Solver { limit_iterations, ..cycle.solver };
    let found = cycle.machine.forward(&joints, before, tool, &solver).map_err(blocked)?;
    // Another pose would mean that a singular one lies between this pose and the last.
    let miss = found.pose.distance(pose, cycle.machine.radius());
    if !(miss <= SAME_POSE * cycle.machine.size()) {
        return Err(Cause::ToolOutOfReach.into());
    }
    Ok(())
}

fn blocked(fault: Fault) -> Fault {
    Fault { cause: Cause::ToolOutOfReach, ..fault }
}

/// Refuses joints beyond their limits.
fn within(joints: &Joints, cycle: &Cycle<'_>) -> Result<(), Fault> {
    let layout = cycle.machine.layout();
    for (i, (joint, limits)) in joints.iter().zip(&cycle.limits).enumerate().take(layout.joints()) {
        if !(*joint >= limits.least && *joint <= limits.most) {
            return Err(Fault::of_joint(Cause::ToolOutOfReach, layout, i, *joint));
        }
    }
    Ok(())
}

/// Returns the rate of joint `i` while the platform translates without rotation.
fn rate_along(jacobian: &Jacobian, i: usize, travel: &Vector3<f64>) -> f64 {
    let of = |axis| jacobian.get((i, axis)).map_or(0.0, |rate: &f64| *rate);
    of(0) * travel.x + of(1) * travel.y + of(2) * travel.z
}
