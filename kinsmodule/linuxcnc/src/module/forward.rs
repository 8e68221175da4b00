// SPDX-License-Identifier: GPL-2.0-or-later
//! Joints to pose: what is refused, and what is shown of the answer.

use super::freezing::Frozen;
use super::{Module, is_zero, nanoseconds_if};
use crate::crossing::Comparison;
use crate::hal::nanoseconds;
use kinematics::{Cause, Fault, Joints, MAX_JOINTS, Pose, Solution, Vector3};

impl Module {
    /// Writes the pose of the joints, in degrees, over the seed in `pose`, which may hold NaN.
    /// `address` is that of LinuxCNC's pose and distinguishes the kinds of call.
    #[inline(always)]
    pub fn forward(
        &mut self,
        joints: &[f64],
        pose: &mut [f64; 6],
        address: usize,
    ) -> Result<(), Fault> {
        let timed = self.is_monitored && !self.calls.awaits_command();
        let begin = nanoseconds_if(timed);
        self.begin_forward();
        let result = match self.meet(joints, pose, address) {
            Some(()) => Ok(()),
            None => self.pose_at(joints, pose, address),
        };
        if timed {
            self.guard.timed_forward(nanoseconds().wrapping_sub(begin));
        }
        result
    }

    /// Forward in the usual case of a machine whose pose is where three spheres meet: the seed is its
    /// last pose, and nothing is asked for or has changed. `None` where the long way has to be gone.
    // A frame of its own, which is gone where the long way is gone.
    #[inline(never)]
    fn meet(&mut self, joints: &[f64], pose: &mut [f64; 6], address: usize) -> Option<()> {
        if !self.frozen.as_ref()?.machine.needs_no_seed() {
            return None;
        }
        self.prepared(|| false).ok()?;
        let Frozen { machine, given } = self.frozen.as_ref()?;
        let tool = self.tool.of_machine();
        let is_usual = !self.correction.is_on()
            && self.tool.has(&self.requested_tool(given.spindle_offset))
            && (self.is_monitored || self.until_watched > 0);
        if !is_usual {
            return None;
        }
        let seed = self.seeds.of(address)?.position;
        let met = machine.meeting(joints.first_chunk()?, &seed, &tool, &self.pins.solver())?;
        let found = Pose { position: met.point, angles: Vector3::zeros() };
        let is_settled = match self.calls.commanded_before() {
            Some(commanded) => self.crossing.is_settled(commanded, &found, &tool),
            None => self.crossing.doubt().is_none(),
        };
        if !is_settled {
            return None;
        }
        self.seeds.remember(address, found);
        (self.pose_is_unknown, self.refused, self.lost) = (false, false, None);
        self.has_found = true;
        self.until_watched = self.until_watched.saturating_sub(1);
        self.pins.fwd_kins_fail.set(false);
        *pose = [met.point.x, met.point.y, met.point.z, 0.0, 0.0, 0.0];
        self.show(1, met.residual, *pose);
        Some(())
    }

    #[inline(never)]
    fn pose_at(
        &mut self,
        joints: &[f64],
        pose: &mut [f64; 6],
        address: usize,
    ) -> Result<(), Fault> {
        let joints = &joints_of(joints);
        let prepared = self.prepared(|| !(is_zero(joints) && is_blank(pose)));
        let was_known = self.seeds.last().is_some();
        // LinuxCNC calls with all joints 0 until it knows them: a failure is no fault then. With the machine
        // on they are homed, and LinuxCNC has to see the refusal.
        let unhomed = !was_known && is_zero(joints) && !self.pins.machine_on();
        let mut solution = Solution::NONE;
        let mut result = prepared.and_then(|()| self.solve(joints, pose, address, &mut solution));
        if unhomed && result.as_ref().is_err_and(|fault| is_of_joints(fault.cause)) {
            return Err(Cause::NotHomed.into());
        }
        self.has_found = result.is_ok();
        if result.is_ok() {
            result = self.refuse_doubtful(joints, &solution.pose);
            // LinuxCNC takes over no pose that is refused.
            self.pose_is_unknown &= result.is_err();
            // Beyond a singular pose the mirror image is followed, to see the motion come back.
            let is_mirrored = result.is_err_and(|fault| fault.cause == Cause::SingularPassed);
            if result.is_ok() || (is_mirrored && was_known) {
                self.seeds.remember(address, solution.pose);
                self.note_contradiction(joints, &solution.pose, address);
            } else {
                self.seeds.refuse(address);
            }
        } else {
            self.seeds.refuse(address);
            self.watch_refused();
        }
        self.note_time_of_refusal(result.is_err());
        self.refused = result.is_err();
        self.lost = result.err().filter(|fault| fault.cause == Cause::JointNotFinite);
        self.pins.fwd_kins_fail.set(self.refused);
        self.show_start();
        if result.is_ok() {
            *pose = solution.pose.to_degrees();
            self.show(solution.iterations, solution.residual, *pose);
            self.pins.show_corrections(&self.load, &solution.corrections);
        }
        if !self.is_monitored {
            self.watch_seldom();
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
        given: &[f64; 6],
        address: usize,
        solution: &mut Solution,
    ) -> Result<(), Fault> {
        let joints = &self.correction.taken_from(joints);
        self.retool_for_forward()?;
        let tool = self.tool.of_machine();
        let seed = self.start_for((joints, address), given, &tool)?;
        let machine = &self.frozen()?.machine;
        if machine.is_literal() {
            return self.solve_first(joints, &seed, &tool, solution);
        }
        machine.forward_into(joints, &seed, &tool, &self.pins.solver(), solution)
    }

    /// Refuses the pose found where it is not connected with the commanded one, and goes on refusing it
    /// where none is commanded.
    #[inline(always)]
    fn refuse_doubtful(&mut self, joints: &Joints, found: &Pose) -> Result<(), Fault> {
        let Some(commanded) = self.calls.commanded_before() else {
            return self.crossing.doubt().map_or(Ok(()), |cause| Err(cause.into()));
        };
        if self.crossing.is_settled(commanded, found, &self.tool.of_machine()) {
            return Ok(());
        }
        self.compare_with_commanded(joints, found, &{ *commanded })
    }

    /// Raises the doubt where the commanded motion passes a singular pose while forward is refused.
    #[inline(never)]
    fn watch_refused(&mut self) {
        let (Some(commanded), Some(last)) = (self.calls.commanded_before(), self.seeds.last())
        else {
            return;
        };
        let Some(Frozen { machine, .. }) = &self.frozen else { return };
        self.crossing.watch_refused(machine, &self.tool.of_machine(), commanded, &last);
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
        self.crossing.doubt().map_or(Ok(()), |cause| Err(comparison.refusal(cause)))
    }

    fn show_start(&self) {
        if self.start.has_boxes() {
            self.pins.show_searching(self.start.is_searching());
        }
    }

    #[inline(always)]
    fn show(&self, iterations: u32, residual: f64, pose: [f64; 6]) {
        let pins = self.pins;
        pins.last_iterations.set(iterations);
        pins.max_iterations.set(pins.max_iterations.get().max(iterations));
        pins.residual.set(residual);
        pins.show_pose(pose);
        pins.show_tool(&self.tool.offset());
    }
}

/// Joint values, 0 beyond the last one.
pub(super) fn joints_of(given: &[f64]) -> Joints {
    let mut joints = [0.0; MAX_JOINTS];
    joints.iter_mut().zip(given).for_each(|(joint, value)| *joint = *value);
    joints
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
