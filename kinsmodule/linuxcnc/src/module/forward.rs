// SPDX-License-Identifier: GPL-2.0-or-later
//! Joints to pose: what is refused, and what is shown of the answer.

use super::freezing::Frozen;
use super::{Module, is_zero, nanoseconds_if};
use crate::crossing::{Comparison, Crossing};
use crate::hal::nanoseconds;
use kinematics::{Cause, Fault, Joints, Pose, Solution};

impl Module {
    /// Writes the pose of the joints, in degrees, over the seed in `pose`, which may hold NaN.
    /// `address` is that of LinuxCNC's pose and distinguishes the kinds of call.
    #[inline(always)]
    pub fn forward(
        &mut self,
        joints: &Joints,
        pose: &mut [f64; 6],
        address: usize,
    ) -> Result<(), Fault> {
        let timed = self.is_monitored && !self.calls.awaits_command();
        let begin = nanoseconds_if(timed);
        self.calls.note_forward();
        let result = self.pose_at(joints, pose, address);
        if timed {
            self.guard.timed_forward(nanoseconds().wrapping_sub(begin));
        }
        result
    }

    fn pose_at(
        &mut self,
        joints: &Joints,
        pose: &mut [f64; 6],
        address: usize,
    ) -> Result<(), Fault> {
        self.forget_before_homing();
        let seed = &Pose::from_degrees(*pose);
        let prepared = self.prepared(|| !(is_zero(joints) && is_blank(&seed.to_degrees())));
        // LinuxCNC calls with all joints 0 until it knows them: a failure is no fault then.
        let unhomed = self.seeds.last().is_none() && is_zero(joints);
        let mut solution = Solution::NONE;
        let mut result = prepared.and_then(|()| self.solve(joints, seed, address, &mut solution));
        if unhomed && result.as_ref().is_err_and(|fault| is_of_joints(fault.cause)) {
            return Err(Cause::NotHomed.into());
        }
        if result.is_ok() {
            // A pose that is refused below is the pose of the joints nevertheless.
            self.seeds.remember(address, solution.pose);
            self.pose_is_unknown = false;
            result = self.refuse_beyond_singular(joints, &solution.pose);
        }
        self.refused = result.is_err();
        self.lost = result.err().filter(|fault| fault.cause == Cause::JointNotFinite);
        self.pins.fwd_kins_fail.set(self.refused);
        self.show_start();
        if result.is_ok() {
            *pose = solution.pose.to_degrees();
            self.show(&solution, *pose);
        }
        if !self.is_monitored {
            self.watch_geometry();
            self.show_assembly();
        }
        if let Err(fault) = result
            && fault.cause == Cause::Searching
        {
            return Err(fault);
        }
        self.recorded(result)
    }

    // A frame of its own: a call that freezes a geometry needs none of it.
    #[inline(never)]
    fn solve(
        &mut self,
        joints: &Joints,
        seed: &Pose,
        address: usize,
        solution: &mut Solution,
    ) -> Result<(), Fault> {
        let joints = &self.correction.taken_from(joints);
        self.retool_for_forward()?;
        let tool = self.tool.of_machine();
        let seed = match self.searched(joints, &tool) {
            Some(found) => Some(found?),
            None => self.seed_for(seed, address),
        };
        let Some(seed) = seed else { return Err(Cause::SeedMissing.into()) };
        let machine = &self.frozen()?.machine;
        if machine.is_literal() {
            return self.solve_first(joints, &seed, &tool, solution);
        }
        machine.forward_into(joints, &seed, &tool, &self.pins.solver(), solution)
    }

    /// Refuses the pose found while the commanded motion is beyond a singular pose.
    ///
    /// It goes on refusing where there is no commanded pose, until the machine is off.
    fn refuse_beyond_singular(&mut self, joints: &Joints, found: &Pose) -> Result<(), Fault> {
        let Some(commanded) = self.calls.commanded_before() else {
            if !self.crossing.has_passed() {
                return Ok(());
            }
            if self.is_off() {
                self.crossing = Crossing::new();
                return Ok(());
            }
            return Err(Cause::SingularPassed.into());
        };
        if self.crossing.is_known_before(commanded, &self.tool.of_machine()) {
            return Ok(());
        }
        self.compare_with_commanded(joints, found, &{ *commanded })
    }

    // Seldom called: a frame and copies of its own.
    #[inline(never)]
    fn compare_with_commanded(
        &mut self,
        joints: &Joints,
        found: &Pose,
        commanded: &Pose,
    ) -> Result<(), Fault> {
        let Some(Frozen { machine, .. }) = &self.frozen else { return Ok(()) };
        let joints = &self.correction.taken_from(joints);
        let (tool, solver) = (&self.tool.of_machine(), &self.pins.solver());
        let comparison = Comparison { machine, tool, solver, joints, found, commanded };
        self.crossing.update(&comparison);
        if self.crossing.has_passed() { Err(comparison.refusal()) } else { Ok(()) }
    }

    fn show_start(&self) {
        if self.start.has_boxes() {
            self.pins.show_searching(self.start.is_searching());
        }
    }

    fn show(&self, solution: &Solution, pose: [f64; 6]) {
        let pins = self.pins;
        pins.last_iterations.set(solution.iterations);
        pins.max_iterations.set(pins.max_iterations.get().max(solution.iterations));
        pins.residual.set(solution.residual);
        pins.show_pose(pose);
        pins.show_tool(&self.tool.offset());
        pins.show_corrections(&self.load, &solution.corrections);
    }
}

/// Whether a refusal may come from joints and seed alone, as before homing.
fn is_of_joints(cause: Cause) -> bool {
    use Cause::{
        CriterionInvalid, LimitIterationsInvalid, ResidualLimitInvalid, ToolNotFinite, ToolTooLong,
    };
    !matches!(
        cause,
        CriterionInvalid
            | LimitIterationsInvalid
            | ResidualLimitInvalid
            | ToolNotFinite
            | ToolTooLong
    )
}

/// A seed without information: zeros, or the NaN that a refusal left.
pub(super) fn is_blank(seed: &[f64; 6]) -> bool {
    is_zero(seed) || seed.iter().all(|v| v.is_nan())
}
