// SPDX-License-Identifier: GPL-2.0-or-later
//! The pose from which forward starts: one rule, for machines with a monitor and for drop-ins.
//!
//! LinuxCNC passes a seed with every call. After a refusal that is `[TRAJ]HOME`, after a switch of the
//! kinematics it contains joint values, and a motion from `[TRAJ]HOME` is not the motion that the machine has
//! made. So the module keeps the pose itself. A pose is accepted only if it is connected with the last good
//! pose, or with the reference pose if none is known, or if a search in proved boxes has found it.
//!
//! | event | effect |
//! | --- | --- |
//! | success | The pose found becomes the last good pose, of its kind of call and of all calls. |
//! | refusal | Nothing is forgotten. The next call starts from the newest good pose of any kind of call. The commanded pose is compared with it meanwhile. |
//! | a kind of call is left out | It starts from the newest good pose of the other kind: the machine has moved since. |
//! | LinuxCNC passes another seed | Ignored while a pose is known. |
//! | kinematics switch | Nothing is forgotten: the identity kinematics track the machine's pose. Refused in doubt. |
//! | machine off, sagging | Nothing is forgotten: LinuxCNC continues to call forward, which follows the joints. |
//! | missed cycles | Nothing is forgotten: forward follows the straight line of the joints. |
//! | tool change | The poses move with the tool, as the joints stay. |
//! | homing | The poses are forgotten, in the identity kinematics too: the joints have been moved and set unseen. |
//! | freezing a geometry | Everything is forgotten. |
//!
//! If no pose is known, forward starts from the pose that boxes or three spheres give without a seed,
//! otherwise from the reference pose, and in a drop-in without one from LinuxCNC's seed, which is `[TRAJ]HOME`
//! then. A doubt about the pose ([`crate::crossing`]) survives all but three events: the commanded
//! motion comes back, `.fault-reset` rises while forward finds a pose and none is commanded, or the machine is
//! homed to its reference pose.

use super::{Kind, Module, is_zero};
use crate::control::{AllJoints, MOST_JOINTS};
use crate::hal::nanoseconds;
use kinematics::{Cause, Fault, Joints, Pose, Solution, Vector3, World};

/// Number of kinds of forward calls that LinuxCNC makes (feedback, command), distinguished by the address of
/// their pose.
const CALLERS: usize = 2;

/// Distance from the reference pose, as a fraction of the machine's size, within which the joints count as at it:
/// above following errors and the resolution of switches, far below the distance of two poses with the same joints.
const AT_REFERENCE: f64 = 1e-3;

/// Nanoseconds without a call of forward after which joints may have been homed, if no monitor counts
/// cycles: LinuxCNC pauses 100 ms before a joint's final move, and no servo thread pauses for so long.
const HOMING_PAUSE: i64 = 50_000_000;

/// Last good pose of one kind of forward call.
#[derive(Clone, Copy)]
struct Caller {
    /// Address of the pose that LinuxCNC keeps for this kind of call.
    address: usize,
    pose: Pose,
    /// Whether another kind of call has succeeded since.
    is_behind: bool,
}

/// Poses that forward has found.
pub(super) struct Seeds {
    /// Poses of those that succeeded in this cycle or the last one.
    callers: [Option<Caller>; CALLERS],
    /// Newest good pose of any kind of call.
    last: Option<Pose>,
}

impl Seeds {
    pub(super) const fn new() -> Self {
        Self { callers: [None; CALLERS], last: None }
    }

    /// Returns the newest good pose of any kind of call.
    pub(super) fn last(&self) -> Option<Pose> {
        self.last
    }

    /// Returns the pose that forward found for this caller in its last call, if it succeeded.
    pub(super) fn of(&self, address: usize) -> Option<&Pose> {
        self.callers.iter().flatten().find(|c| c.address == address).map(|c| &c.pose)
    }

    /// Returns the pose from which the next call of this caller starts, if one is known.
    fn start(&self, address: usize) -> Option<&Pose> {
        self.of(address).or(self.last.as_ref())
    }

    /// Drops the poses: the joints may be anywhere.
    pub(super) fn forget(&mut self) {
        *self = Self::new();
    }

    /// Records a good pose.
    pub(super) fn remember(&mut self, address: usize, pose: &Pose) {
        self.last = Some(*pose);
        let mut free = 0;
        for (i, kept) in self.callers.iter_mut().enumerate() {
            match kept {
                Some(caller) if caller.address != address && !caller.is_behind => {
                    caller.is_behind = true;
                }
                // The caller's own, or of a kind not called in the last cycle: the machine has moved since.
                _ => (*kept, free) = (None, i),
            }
        }
        // Two kinds are called in turn; a third one would replace the first.
        if let Some(caller) = self.callers.get_mut(free) {
            *caller = Some(Caller { address, pose: *pose, is_behind: false });
        }
    }

    /// Records that a call was refused: the caller continues from the newest good pose of all.
    pub(super) fn refuse(&mut self, address: usize) {
        for caller in &mut self.callers {
            if caller.is_some_and(|c| c.address == address) {
                *caller = None;
            }
        }
    }

    /// Records the machine's pose while the identity kinematics are in force.
    pub(super) fn track(&mut self, pose: Pose) {
        *self = Self { callers: [None; CALLERS], last: Some(pose) };
    }

    /// Moves the poses with the tool: the joints stay. Forgets a pose whose shift is unknown.
    pub(super) fn change_tool(&mut self, shift: impl Fn(&Pose) -> Option<Vector3<f64>>) {
        let moved = |pose: Pose| Some(Pose { position: pose.position - shift(&pose)?, ..pose });
        self.last = self.last.and_then(moved);
        for caller in &mut self.callers {
            *caller = caller.take().and_then(|c| Some(Caller { pose: moved(c.pose)?, ..c }));
        }
    }
}

/// The values that the module wrote for LinuxCNC's feedback call, which LinuxCNC passes back as the seed of the
/// next one.
///
/// LinuxCNC replaces them with `[TRAJ]HOME` after a refusal, and after joints were homed. A seed that differs
/// although the last call succeeded shows that joints were homed.
pub(super) struct Handed {
    /// Address of the feedback pose: the first that LinuxCNC ever passes.
    address: Option<usize>,
    /// The values written there, if the last call succeeded.
    written: Option<World>,
    /// The clock at the last refused call of a drop-in, nanoseconds.
    refused_at: Option<i64>,
    /// The commanded joints that forward has refused last, with the machine on, and whether inverse has
    /// returned them.
    standing: Option<(AllJoints, bool)>,
}

impl Handed {
    pub(super) const fn new() -> Self {
        Self { address: None, written: None, refused_at: None, standing: None }
    }

    /// Returns whether a call is for the joints' feedback.
    pub(super) fn is_feedback(&self, address: usize) -> bool {
        self.address.is_none_or(|own| own == address)
    }
}

impl Module {
    /// Compares the seed of a forward call with the values that the module wrote; returns whether joints were homed
    /// in between.
    pub fn was_homed_before(&mut self, world: &World) -> bool {
        let address = &raw const *world as usize;
        *self.handed.address.get_or_insert(address) == address
            && self.handed.written.as_ref().is_some_and(|written| written != world)
    }

    /// Keeps the values that a forward call has written.
    pub fn note_handed(&mut self, world: &World, is_good: bool) {
        let address = &raw const *world as usize;
        if *self.handed.address.get_or_insert(address) == address {
            self.handed.written = is_good.then_some(*world);
        }
    }

    /// Keeps the commanded joints of joint mode that forward has refused.
    ///
    /// LinuxCNC's planner refuses the NaN that forward writes for them and keeps the pose from before joint
    /// mode. On entering MDI it asks inverse for that pose, to which all joints would jump. A refusal at that
    /// moment is no better, because LinuxCNC's empty interpolators then command 0 to every joint for a cycle.
    pub fn note_command(&mut self, joints: &[f64], address: usize, is_good: bool) {
        let is_feedback = self.handed.is_feedback(address);
        if is_good {
            if self.handed.standing.is_some() && (!is_feedback || self.is_off()) {
                self.handed.standing = None;
            }
        } else if !is_feedback
            && self.pins.machine_on()
            && self.kind == Kind::Machine
            && joints.iter().all(|joint| joint.is_finite())
        {
            let mut all = [0.0; MOST_JOINTS];
            all.iter_mut().zip(joints).for_each(|(joint, value)| *joint = *value);
            self.handed.standing = Some((all, false));
        }
    }

    /// Returns whether inverse has no pose to continue from, because forward has refused the commanded joints.
    pub fn is_standing(&self) -> bool {
        self.handed.standing.is_some() && self.kind == Kind::Machine
    }

    /// Returns the refused joints for the first call for a commanded pose, so that they stay at rest.
    ///
    /// # Errors
    /// `PoseUnknown` for every other call: LinuxCNC then switches the machine off, or refuses the move.
    pub fn stand(&mut self) -> Result<AllJoints, Fault> {
        let is_commanded = self.calls.takes_command();
        match &mut self.handed.standing {
            Some((joints, is_made)) if is_commanded && !*is_made => {
                *is_made = true;
                Ok(*joints)
            }
            _ => self.recorded(Err(Cause::PoseUnknown.into())),
        }
    }

    /// Drops the poses after joints were homed.
    pub fn forget_poses(&mut self) {
        self.seeds.forget();
        self.start.stop_searching();
    }

    /// Records that forward was refused: LinuxCNC may pass its NaN to inverse.
    pub fn note_refusal(&mut self, address: usize) {
        self.seeds.refuse(address);
        self.refused = true;
        self.pins.fwd_kins_fail.set(true);
    }

    /// Counts a call of forward, whatever its result, and drops the poses if LinuxCNC had stopped calling
    /// it, as it does while a joint is not homed.
    pub(super) fn begin_forward(&mut self) {
        if self.start.resumes() {
            self.forget_poses();
        }
        self.calls.note_forward();
    }

    /// Drops the poses of a drop-in that was refused before a pause, and is now at LinuxCNC's `[TRAJ]HOME`.
    ///
    /// Without a monitor that counts the cycles, homing after a refusal has no other sign.
    pub(super) fn forget_before_pause(
        &mut self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
    ) {
        let Some(refused_at) = self.handed.refused_at else { return };
        let pause = nanoseconds().wrapping_sub(refused_at);
        if pause > HOMING_PAUSE && self.is_at(seed, joints, tool) {
            self.forget_poses();
        }
    }

    /// Keeps the time of a refused call of a drop-in.
    pub(super) fn note_time_of_refusal(&mut self, is_refused: bool) {
        if is_refused || self.handed.refused_at.is_some() {
            let is_timed = is_refused && !self.is_monitored;
            self.handed.refused_at = is_timed.then(nanoseconds);
        }
    }

    /// Returns the pose that forward starts from. `given` computes LinuxCNC's seed.
    pub(super) fn start_for(
        &mut self,
        (joints, address): (&Joints, usize),
        given: impl Fn(&Self) -> Pose,
        tool: &Vector3<f64>,
    ) -> Result<Pose, Fault> {
        if self.handed.refused_at.is_some() {
            self.forget_before_pause(joints, &given(self), tool);
        }
        match self.seeds.start(address) {
            Some(pose) => Ok(*pose),
            None => self.first_start(joints, &given(self), tool),
        }
    }

    /// Returns the pose to start from if none is known.
    fn first_start(
        &mut self,
        joints: &Joints,
        given: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Pose, Fault> {
        let given = Some(*given).filter(Pose::is_finite);
        let is_set = !is_zero(joints);
        if is_set && self.start.has_boxes() {
            let Some(frozen) = &self.frozen else { return Err(Cause::NoGeometry.into()) };
            let found = self.start.seed(&frozen.machine, joints, tool, &self.pins.solver())?;
            self.crossing.end_doubt();
            return Ok(found);
        }
        let reference = self.reference();
        let start = reference.or(given).ok_or(Cause::SeedMissing)?;
        if self.is_at(&start, joints, tool) {
            self.crossing.end_doubt();
        }
        let machine = &self.frozen()?.machine;
        // A drop-in has no reference pose: LinuxCNC's seed corresponds to HOME of its joints.
        let beside = reference.filter(|_| is_set);
        let found = beside.and_then(|side| machine.pose_beside(joints, &side, &self.pins.solver()));
        Ok(found.unwrap_or(start))
    }

    /// Returns whether the joints are at a pose.
    pub(super) fn is_at(&self, pose: &Pose, joints: &Joints, tool: &Vector3<f64>) -> bool {
        let Some(frozen) = &self.frozen else { return false };
        let machine = &frozen.machine;
        let expected = machine.inverse(pose, tool);
        expected.is_ok_and(|own| machine.travel(&own, joints) <= AT_REFERENCE * machine.size())
    }

    /// Runs forward while no pose has fixed the folds of nut corrections, as in a drop-in, which has no
    /// reference pose.
    ///
    /// The first pose known replaces it. That is the seed, `[TRAJ]HOME`, which is the same after
    /// every start, unlike the pose of the homed joints. Zeros are not a seed; then it is the pose found.
    /// Inverse never fixes the folds: LinuxCNC may call it for the end point of a move that is not
    /// made.
    pub(super) fn solve_first(
        &mut self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Solution, Fault> {
        let solver = self.pins.solver();
        let machine = &mut self.frozen.as_mut().ok_or(Cause::NoGeometry)?.machine;
        let is_known = !is_zero(&seed.to_degrees());
        let mut folded = is_known.then(|| machine.fold_at(seed, tool).ok()).flatten();
        let solution = match machine.forward(joints, seed, tool, &solver) {
            Ok(solution) => solution,
            Err(fault) => {
                machine.unfold();
                return Err(fault);
            }
        };
        if folded.is_none() {
            folded = machine.fold_at(&solution.pose, tool).ok();
        }
        if let Some(doubt) = folded.flatten() {
            self.reports.add(self.place.counted(&doubt));
            self.report_unmonitored(&doubt);
        }
        Ok(solution)
    }
}
