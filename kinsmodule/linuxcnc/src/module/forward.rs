// SPDX-License-Identifier: GPL-2.0-or-later
//! Joints to pose: which calls are refused, and what is shown of the result.

use super::extra::{check_extra, write_extra};
use super::freezing::Frozen;
use super::{Kind, Module, NO_POSE, is_zero, nanoseconds_if};
use crate::crossing::Comparison;
use crate::hal::nanoseconds;
use kinematics::{Cause, Fault, Pose, Solution, Vector3, World};

impl Module {
    /// Replaces the seed in `world`, which may contain NaN, with LinuxCNC's pose of the joints; a refusal leaves
    /// it. `address` is that of LinuxCNC's pose and distinguishes the kinds of call.
    pub fn forward(
        &mut self,
        joints: &[f64],
        extra: &[f64],
        world: &mut World,
        address: usize,
    ) -> Result<(), Fault> {
        let timed = self.is_monitored && !self.calls.awaits_command();
        let begin = nanoseconds_if(timed);
        self.begin_forward();
        let result = match (check_extra(&self.load, extra), self.kind) {
            (Err(fault), _) => {
                self.has_found = false;
                self.note_refusal(address);
                self.recorded(Err(fault))
            }
            (Ok(()), Kind::Identity) => self.identity_forward(joints, extra, world),
            (Ok(()), Kind::Machine) => self.machine_forward(joints, extra, world, address),
        };
        if timed {
            self.guard.timed_forward(nanoseconds().wrapping_sub(begin));
        }
        result
    }

    fn machine_forward(
        &mut self,
        joints: &[f64],
        extra: &[f64],
        world: &mut World,
        address: usize,
    ) -> Result<(), Fault> {
        let prepared = self.prepared(|| !(is_zero(joints) && is_blank(world)));
        let was_known = self.seeds.last().is_some();
        // LinuxCNC calls with all joints 0 until they are homed: a failure is not a fault then. With the machine
        // on they are homed, and LinuxCNC must get the refusal.
        let unhomed = !was_known && is_zero(joints) && !self.pins.machine_on();
        let mut result = match prepared {
            Ok(()) => self.solve(joints, world, address),
            Err(fault) => Err(fault),
        };
        if unhomed && result.as_ref().is_err_and(|fault| is_of_joints(fault.cause)) {
            return Err(Cause::NotHomed.into());
        }
        self.has_found = result.is_ok();
        if let Ok(Solution { pose, .. }) = &result {
            let doubtful = self.refuse_doubtful(joints, pose);
            // LinuxCNC does not accept a refused pose.
            self.pose_is_unknown &= doubtful.is_err();
            // Beyond a singular pose the mirror image is followed, to detect that the motion comes back.
            let is_mirrored = doubtful.is_err_and(|fault| fault.cause == Cause::SingularPassed);
            if doubtful.is_ok() || (is_mirrored && was_known) {
                self.seeds.remember(address, pose);
                self.note_contradiction(joints, pose, address);
            } else {
                self.seeds.refuse(address);
            }
            if let Err(fault) = doubtful {
                result = Err(fault);
            }
        } else {
            self.seeds.refuse(address);
            self.watch_refused();
        }
        let fault = result.as_ref().err().copied();
        self.note_time_of_refusal(fault.is_some());
        self.refused = fault.is_some();
        self.lost = fault.filter(|fault| fault.cause == Cause::JointNotFinite);
        self.pins.fwd_kins_fail.set(self.refused);
        if self.start.has_boxes() {
            self.pins.show_searching(self.start.is_searching());
        }
        let answer = result.as_ref().map_err(|fault| *fault).map(|solution| {
            let pose = solution.pose.to_degrees();
            self.show(solution, pose);
            pose
        });
        if !self.is_monitored {
            self.watch_seldom();
        }
        let written = answer.and_then(|pose| {
            let seed = *world;
            write_extra(&self.load, extra, world);
            let (chain, tool) = (&self.carrying.chain, &self.tool.offset());
            let machine = &self.frozen()?.machine;
            machine.write_world(chain, &pose, world, tool).inspect_err(|_| {
                *world = seed;
                self.note_refusal(address);
            })
        });
        match written {
            Err(fault) if fault.cause == Cause::Searching => Err(fault),
            written => self.recorded(written),
        }
    }

    fn solve(&mut self, joints: &[f64], seed: &World, address: usize) -> Result<Solution, Fault> {
        // The seed is from before a change of the tool.
        let (joints, before) = (&self.correction.taken_from(joints), self.tool.offset());
        self.retool_for_forward()?;
        let tool = self.tool.of_machine();
        let seed = self.start_for((joints, address), |own| own.seed_in(seed, &before), &tool)?;
        let machine = &self.frozen()?.machine;
        if machine.is_literal() {
            return self.solve_first(joints, &seed, &tool);
        }
        machine.forward(joints, &seed, &tool, &self.pins.solver())
    }

    /// Converts LinuxCNC's seed to the machine's pose, with a tool offset; NaN if that is impossible.
    pub(super) fn seed_in(&self, world: &World, tool: &Vector3<f64>) -> Pose {
        self.pose_of(world, tool).unwrap_or(NO_POSE)
    }

    /// Refuses the pose found if it is not connected with the commanded one, and continues to refuse it
    /// while none is commanded.
    fn refuse_doubtful(&mut self, joints: &[f64], found: &Pose) -> Result<(), Fault> {
        let (Some(commanded), Some(Frozen { machine, .. })) =
            (self.calls.commanded_before(), &self.frozen)
        else {
            return self.crossing.doubt().map_or(Ok(()), |cause| Err(cause.into()));
        };
        let tool = &self.tool.of_machine();
        if self.crossing.is_settled(commanded, found, tool) {
            return Ok(());
        }
        let (joints, solver) = (&self.correction.taken_from(joints), &self.pins.solver());
        let comparison = Comparison { machine, tool, solver, joints, found, commanded };
        self.crossing.update(&comparison);
        self.crossing.doubt().map_or(Ok(()), |cause| Err(comparison.refusal(cause)))
    }

    /// Raises the doubt if the commanded motion passes a singular pose while forward is refused.
    fn watch_refused(&mut self) {
        let (Some(commanded), Some(last)) = (self.calls.commanded_before(), self.seeds.last())
        else {
            return;
        };
        let Some(Frozen { machine, .. }) = &self.frozen else { return };
        self.crossing.watch_refused(machine, &self.tool.of_machine(), commanded, &last);
    }

    fn show(&self, solution: &Solution, pose: [f64; 6]) {
        let pins = self.pins;
        pins.last_iterations.set(solution.iterations);
        pins.max_iterations.set(pins.max_iterations.get().max(solution.iterations));
        pins.residual.set(solution.residual);
        pins.show_pose(pose);
        if self.load.layout.constraints() > 0 {
            pins.show_dependent(&self.load, &solution.full);
        }
        pins.show_tool(&self.tool.offset());
        pins.show_corrections(&self.load, &solution.corrections);
    }
}

/// Returns whether a refusal may come from joints and seed alone, as before homing.
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

/// Returns whether a seed has no information: zeros, or the NaN of a refusal.
fn is_blank(seed: &World) -> bool {
    seed.iter().all(|value| *value == 0.0 || value.is_nan())
}
