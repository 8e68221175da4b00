// SPDX-License-Identifier: GPL-2.0-or-later
//! The pose from which forward starts.

use super::{Module, is_zero};
use crate::tool::shift;
use kinematics::{Cause, Fault, Joints, Pose, Solution, Vector3};

/// Kinds of forward calls that LinuxCNC makes (feedback, command), distinguished by where they keep
/// their pose.
const CALLERS: usize = 2;

/// Last good pose of one kind of forward call.
#[derive(Clone, Copy)]
struct Caller {
    /// Address of the pose that LinuxCNC keeps for this kind of call.
    address: usize,
    pose: Pose,
    /// LinuxCNC's seed is no pose, as the kinematics were switched, or is the pose of another tool.
    seed_is_stale: bool,
}

/// Poses that forward has found.
pub(super) struct Seeds {
    callers: [Option<Caller>; CALLERS],
    /// Last good pose of any kind of call.
    last: Option<Pose>,
    /// The kinematics were switched back to the machine: a caller not yet known holds
    /// joint values as its seed.
    switched_back: bool,
}

impl Seeds {
    pub(super) const fn new() -> Self {
        Self { callers: [None; CALLERS], last: None, switched_back: false }
    }

    /// Last good pose of any kind of call.
    pub(super) fn last(&self) -> Option<Pose> {
        self.last
    }

    /// Whether what LinuxCNC hands over at this address is the pose that forward has found for it last.
    #[inline(always)]
    pub(super) fn is_current(&self, address: usize) -> bool {
        self.callers.iter().flatten().any(|c| c.address == address && !c.seed_is_stale)
    }

    fn is_known(&self, address: usize) -> bool {
        self.callers.iter().flatten().any(|c| c.address == address)
    }

    /// Drops the poses: the joints may be anywhere.
    pub(super) fn forget(&mut self) {
        (self.callers, self.last) = ([None; CALLERS], None);
    }

    /// Where it is called: a pose that is passed in memory is written in threes and read in pairs.
    #[inline(always)]
    pub(super) fn remember(&mut self, address: usize, pose: Pose) {
        self.last = Some(pose);
        let entry = Caller { address, pose, seed_is_stale: false };
        let known = self.callers.iter_mut().flatten().find(|c| c.address == address);
        if let Some(caller) = known {
            *caller = entry;
            return;
        }
        // The newest stands first; a third kind of call would push out the oldest.
        self.callers.rotate_right(1);
        self.callers[0] = Some(entry);
    }

    /// The kinematics are switched back to the machine, whose joints were moved to `pose` meanwhile,
    /// or not at all.
    pub(super) fn switch_back(&mut self, pose: Option<Pose>) {
        self.switched_back = true;
        self.last = pose.or(self.last);
        for caller in self.callers.iter_mut().flatten() {
            caller.pose = pose.unwrap_or(caller.pose);
            caller.seed_is_stale = true;
        }
    }

    /// The tool offset changes. The joints stay, so that the poses move.
    pub(super) fn change_tool(&mut self, change: &Vector3<f64>) {
        if let Some(pose) = &mut self.last {
            pose.position -= shift(pose, change);
        }
        for Caller { pose, seed_is_stale, .. } in self.callers.iter_mut().flatten() {
            pose.position -= shift(pose, change);
            *seed_is_stale = true;
        }
    }
}

impl Module {
    /// Drops what was known of the pose when joints had to be homed in between.
    pub(super) fn forget_before_homing(&mut self) {
        if self.start.resumes() {
            self.seeds.forget();
        }
    }

    /// The pose to start from where none is known, if the joints alone determine it: by boxes, or on the
    /// side of the reference pose. By that side, or the last pose's, also for a caller not yet known, who
    /// hands over [TRAJ]HOME.
    pub(super) fn searched(
        &mut self,
        (joints, address): (&Joints, usize),
        tool: &Vector3<f64>,
    ) -> Option<Result<Pose, Fault>> {
        if is_zero(joints) || !self.start.needs_no_seed() {
            return None;
        }
        let (machine, solver) = (&self.frozen.as_ref()?.machine, self.pins.solver());
        let last = self.seeds.last();
        if self.start.has_boxes() {
            let search = || self.start.seed(machine, joints, tool, &solver);
            return last.is_none().then(search);
        }
        if last.is_some() && self.seeds.is_known(address) {
            return None;
        }
        machine.pose_beside(joints, &last.or(self.reference())?, &solver).map(Ok)
    }

    /// The pose to start from: LinuxCNC's seed where it is a pose of this machine and tool; `None` where
    /// neither it nor an earlier one is. By reference: pieces of a copy would not line up.
    pub(super) fn seed_for<'a>(&'a self, seed: &'a Pose, address: usize) -> Option<&'a Pose> {
        let caller = self.seeds.callers.iter().flatten().find(|c| c.address == address);
        let stale = caller.map_or(self.seeds.switched_back, |c| c.seed_is_stale);
        let known = caller.map(|c| &c.pose).or(self.seeds.last.as_ref());
        // Then a caller not yet known hands over [TRAJ]HOME, not a pose that it was given.
        let is_new = caller.is_none() && self.start.has_boxes();
        // After a switch a seed may hold joint values.
        let is_none = stale || !seed.is_finite();
        match known {
            Some(pose) if is_new || is_none => Some(pose),
            None if is_none => None,
            _ => Some(seed),
        }
    }

    /// The pose to start from where none is known: the reference pose, else what LinuxCNC says.
    #[cold]
    pub(super) fn reference_or(&self, seed: Pose) -> Result<Pose, Fault> {
        let seed = Some(seed).filter(Pose::is_finite);
        self.reference().or(seed).ok_or(Cause::SeedMissing.into())
    }

    /// Forward while no pose has fixed the folds of nut corrections, as in a drop-in, which has no
    /// reference pose.
    ///
    /// The first pose known takes its place. That is the seed, `[TRAJ]HOME`, which is the same after
    /// every start; joints that were homed are not. Zeros are no seed; then it is the pose found.
    /// Inverse never fixes the folds: LinuxCNC may ask it for the end point of a move that is not
    /// made.
    #[cold]
    #[inline(never)]
    pub(super) fn solve_first(
        &mut self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
        solution: &mut Solution,
    ) -> Result<(), Fault> {
        let solver = self.pins.solver();
        let machine = &mut self.frozen.as_mut().ok_or(Cause::NoGeometry)?.machine;
        let is_known = !is_zero(&seed.to_degrees());
        let mut folded = is_known.then(|| machine.fold_at(seed, tool).ok()).flatten();
        if let Err(fault) = machine.forward_into(joints, seed, tool, &solver, solution) {
            machine.unfold();
            return Err(fault);
        }
        if folded.is_none() {
            folded = machine.fold_at(&solution.pose, tool).ok();
        }
        if let Some(doubt) = folded.flatten() {
            self.reports.add(self.place.counted(&doubt));
            self.report_unmonitored(&doubt);
        }
        Ok(())
    }
}
