// SPDX-License-Identifier: GPL-2.0-or-later
//! The identity kinematics, in which each joint is a letter, and the switch to and from them.

use super::Module;
use super::forward::joints_of;
use kinematics::{Cause, Fault, Jacobian, Joints, Letter, Load, MAX_JOINTS, Pose, World};

/// Kinematics in force.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Machine,
    Identity,
}

impl Kind {
    /// The kinematics with which LinuxCNC starts.
    pub(super) fn first(load: &Load) -> Self {
        if load.is_identity_first() { Self::Identity } else { Self::Machine }
    }

    /// The kinematics of a number that there may be.
    fn numbered(number: i32, load: &Load) -> Option<Self> {
        match number {
            0 => Some(Self::first(load)),
            1 if load.is_identity_first() => Some(Self::Machine),
            1 => Some(Self::Identity),
            _ => None,
        }
    }

    /// Its number.
    fn number(self, load: &Load) -> usize {
        usize::from(self != Self::first(load))
    }
}

/// What a switch of the kinematics leads to.
#[derive(Clone, Copy)]
pub struct Asked {
    kind: Kind,
    /// The pose to which the identity kinematics have moved the joints, if they have.
    pose: Option<Pose>,
}

impl Module {
    /// Changes the kinematics: 0 the machine, 1 identity, or the other way round. Where it is refused, nothing changes.
    pub fn switch(&mut self, number: i32) -> Result<(), Fault> {
        let asked = self.asked(number);
        let asked = self.switch_granted(asked)?;
        self.switch_to(asked);
        Ok(())
    }

    /// What a switch leads to. Nothing changes.
    ///
    /// In doubt about the pose there is none: after the switch back LinuxCNC's planner would go on from what
    /// it had in the identity kinematics, because it refuses a pose of NaN.
    pub fn asked(&self, number: i32) -> Result<Asked, Fault> {
        let kind = self.kind_of(number)?;
        if let Some(cause) = self.crossing.doubt() {
            return Err(cause.into());
        }
        let is_back = kind == Kind::Machine && kind != self.kind;
        let pose = if is_back { self.pose_after_identity()? } else { None };
        Ok(Asked { kind, pose })
    }

    /// Records why a switch is refused, if it is.
    pub fn switch_granted(&mut self, asked: Result<Asked, Fault>) -> Result<Asked, Fault> {
        if let Err(fault) = &asked {
            self.report_unmonitored(fault);
        }
        self.recorded(asked)
    }

    /// Switches.
    pub fn switch_to(&mut self, asked: Asked) {
        let Asked { kind, pose } = asked;
        match kind {
            _ if kind == self.kind => {}
            Kind::Identity => self.identity_joints = None,
            Kind::Machine => {
                if let Some(pose) = pose {
                    self.seeds.track(pose);
                }
                self.pose_is_unknown = true;
            }
        }
        self.kind = kind;
        self.was_switched = true;
        self.pins.show_type(kind.number(&self.load));
    }

    /// The pose to which the identity kinematics have moved the joints, if they have.
    ///
    /// LinuxCNC does not look whether the first forward after a switch succeeds, and would go on
    /// from the pose before. Where no pose was ever known, as before homing, there is none to start
    /// from, and nothing is refused here.
    fn pose_after_identity(&self) -> Result<Option<Pose>, Fault> {
        let (Some(last), Some(joints)) = (self.seeds.last(), &self.identity_joints) else {
            return Ok(None);
        };
        let (machine, solver) = (&self.frozen()?.machine, self.pins.solver());
        let joints = self.correction.taken_from(joints);
        Ok(Some(machine.forward(&joints, &last, &self.tool.of_machine(), &solver)?.pose))
    }

    /// The kinematics of a number, if the module has them.
    pub fn kind_numbered(&self, number: i32) -> Option<Kind> {
        self.kind_of(number).ok()
    }

    fn kind_of(&self, number: i32) -> Result<Kind, Fault> {
        match Kind::numbered(number, &self.load) {
            Some(Kind::Identity) if !self.load.has_identity() => {
                Err(Cause::IdentityImpossible.into())
            }
            Some(kind) => Ok(kind),
            None => Err(Fault::with_value(Cause::KinematicsTypeUnknown, f64::from(number))),
        }
    }

    /// Identity kinematics: pose (degrees) of the joints, shown on the pins.
    pub fn identity_forward(&mut self, joints: &[f64], pose: &mut [f64; 6]) -> Result<(), Fault> {
        let joints = &joints_of(joints);
        self.begin_forward();
        let result = self.identity_pose(joints);
        let given = Pose::from_degrees(*pose);
        self.pins.fwd_kins_fail.set(result.is_err());
        *pose = self.recorded(result)?;
        self.identity_joints = Some(*joints);
        self.pins.show_pose(*pose);
        self.track_machine(joints, &given);
        Ok(())
    }

    /// Follows the joints with the machine's pose, so that it is known after the switch back.
    ///
    /// Joints that close no platform leave it where it was. After homing, joints at the reference pose begin
    /// anew, or in a drop-in at LinuxCNC's seed `given`, which is `[TRAJ]HOME` then.
    #[inline(never)]
    fn track_machine(&mut self, joints: &Joints, given: &Pose) {
        let joints = self.correction.taken_from(joints);
        let (tool, solver) = (self.tool.of_machine(), self.pins.solver());
        self.forget_before_pause(&joints, given, &tool);
        let start = match self.seeds.last() {
            Some(last) => last,
            None => {
                let first = self.reference().unwrap_or(*given);
                let is_homed = self.is_at(&first, &joints, &tool);
                if is_homed {
                    self.crossing.end_doubt();
                } else if self.reference().is_none() {
                    return;
                }
                first
            }
        };
        let found =
            self.frozen().and_then(|own| own.machine.forward(&joints, &start, &tool, &solver));
        if let Ok(found) = found {
            self.seeds.track(found.pose);
        }
    }

    /// The same with the joints of extra axes, which pass through.
    pub fn identity_forward_of(
        &mut self,
        joints: &[f64],
        extra: &[f64],
        world: &mut World,
    ) -> Result<(), Fault> {
        let mut pose = [0.0; 6];
        self.identity_forward(joints, &mut pose)?;
        for (to, value) in world.iter_mut().zip(pose) {
            *to = value;
        }
        self.write_extra(extra, world);
        Ok(())
    }

    /// Each joint at its letter's place, 0 at those that no joint moves.
    fn identity_pose(&self, joints: &Joints) -> Result<[f64; 6], Fault> {
        let mut world = [0.0; 6];
        if let Some(i) = joints.iter().position(|v| !v.is_finite()) {
            return Err(Fault::of_joint(Cause::JointNotFinite, self.layout(), i, joints[i]));
        }
        for (letter, value) in self.layout().joint_letters().into_iter().flatten().zip(joints) {
            if let Some(place) = world.get_mut(letter.index()) {
                *place = *value;
            }
        }
        Ok(world)
    }

    /// Identity kinematics: joint j is the pose's (degrees) j-th letter.
    pub fn identity_inverse(&mut self, pose: &[f64; 6], joints: &mut [f64]) -> Result<(), Fault> {
        if !pose.iter().all(|v| v.is_finite()) {
            return self.recorded(Err(Cause::PoseNotFinite.into()));
        }
        let held = self.refuse_held(pose);
        self.recorded(held)?;
        let letters = self.layout().joint_letters().into_iter().flatten();
        let mut commanded = [0.0; MAX_JOINTS];
        for ((joint, kept), letter) in joints.iter_mut().zip(&mut commanded).zip(letters) {
            *joint = pose.get(letter.index()).copied().unwrap_or(0.0);
            *kept = *joint;
        }
        if self.calls.takes_command() {
            self.identity_joints = Some(commanded);
        }
        Ok(())
    }

    /// Refuses a value for a letter that no joint moves: nothing would bring it back to 0.
    fn refuse_held(&self, pose: &[f64; 6]) -> Result<(), Fault> {
        // Before a geometry is known rounding is that of one machine unit.
        let size = self.frozen.as_ref().map_or(1.0, |frozen| frozen.machine.size());
        for (letter, value) in Letter::ALL.into_iter().zip(pose) {
            if self.layout().is_held(letter) {
                letter.check_held(*value, size)?;
            }
        }
        Ok(())
    }

    /// ∂q/∂(x … c) of the identity kinematics.
    pub fn identity_jacobian(&self) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for (i, letter) in self.layout().joint_letters().into_iter().flatten().enumerate() {
            if let Some(place) = jacobian.get_mut((i, letter.index())) {
                *place = 1.0;
            }
        }
        jacobian
    }
}
