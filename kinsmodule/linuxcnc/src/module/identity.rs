// SPDX-License-Identifier: GPL-2.0-or-later
//! The identity kinematics, in which each joint equals a letter, and the switch to and from them.

use super::extra::write_extra;
use super::{Module, joints_of};
use kinematics::{Cause, Fault, Joints, Layout, Letter, Load, MAX_JOINTS, Pose, World};

/// Kinematics in force.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Machine,
    Identity,
}

impl Kind {
    /// Returns the kinematics with which LinuxCNC starts.
    pub(super) fn first(load: &Load) -> Self {
        if load.is_identity_first() { Self::Identity } else { Self::Machine }
    }

    /// Returns the kinematics with a number, if they exist.
    fn numbered(number: i32, load: &Load) -> Option<Self> {
        match number {
            0 => Some(Self::first(load)),
            1 if load.is_identity_first() => Some(Self::Machine),
            1 => Some(Self::Identity),
            _ => None,
        }
    }

    fn number(self, load: &Load) -> usize {
        usize::from(self != Self::first(load))
    }
}

/// The result of a switch of the kinematics.
#[derive(Clone, Copy)]
pub struct Asked {
    kind: Kind,
    /// The pose to which the joints have moved in the identity kinematics, if they have.
    pose: Option<Pose>,
}

/// Returns the pose in which each letter equals its joint, and is 0 if no joint moves it.
pub fn pose_of(layout: &Layout, joints: &[f64]) -> Result<[f64; 6], Fault> {
    if let Some((i, value)) = joints.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        return Err(Fault::of_joint(Cause::JointNotFinite, layout, i, *value));
    }
    let mut pose = [0.0; 6];
    for (letter, value) in layout.joint_letters().into_iter().flatten().zip(joints) {
        pose.get_mut(letter.index()).into_iter().for_each(|place| *place = *value);
    }
    Ok(pose)
}

/// Returns the joints of LinuxCNC's pose, each the value of its letter.
pub fn joints_of_letters(load: &Load, world: &World, size: f64) -> Result<Joints, Fault> {
    let (layout, extra) = (&load.layout, &load.extra);
    // The others of U V W are unused.
    let mut own = world.iter().enumerate().filter(|(place, _)| *place < 6 || extra.has(*place));
    if !own.all(|(_, value)| value.is_finite()) {
        return Err(Cause::PoseNotFinite.into());
    }
    // Nothing would reset a value to 0 for a letter that no joint moves.
    for (letter, value) in Letter::ALL.into_iter().zip(world) {
        if layout.is_held(letter) && !extra.has(letter.index()) {
            letter.check_held(*value, size)?;
        }
    }
    let mut joints = [0.0; MAX_JOINTS];
    let letters = layout.joint_letters().into_iter().flatten();
    for (joint, letter) in joints.iter_mut().zip(letters) {
        *joint = world.get(letter.index()).copied().unwrap_or(0.0);
    }
    Ok(joints)
}

/// Returns the derivatives of the joints of legs and table by LinuxCNC's letters: 1 for the letter of each.
pub fn rows_of_letters(layout: &Layout) -> [World; MAX_JOINTS] {
    let mut rows = [World::default(); MAX_JOINTS];
    let letters = layout.joint_letters().into_iter().flatten();
    for (row, letter) in rows.iter_mut().zip(letters) {
        row.get_mut(letter.index()).into_iter().for_each(|rate| *rate = 1.0);
    }
    rows
}

impl Module {
    /// Returns the result of a switch to the kinematics with a number: 0 the machine, 1 identity, or the
    /// reverse. Changes nothing; a refusal is recorded.
    pub fn grant_switch(&mut self, number: i32) -> Result<Asked, Fault> {
        let asked = self.asked(number);
        if let Err(fault) = &asked {
            self.report_unmonitored(fault);
        }
        self.recorded(asked)
    }

    /// Returns the result of a switch, or refuses if the pose is in doubt: after the switch back LinuxCNC's planner would
    /// continue from its pose in the identity kinematics, because it refuses a pose of NaN.
    fn asked(&self, number: i32) -> Result<Asked, Fault> {
        let kind = self.kind_of(number)?;
        if let Some(cause) = self.crossing.doubt() {
            return Err(cause.into());
        }
        let is_back = kind == Kind::Machine && kind != self.kind;
        let pose = if is_back { self.pose_after_identity()? } else { None };
        Ok(Asked { kind, pose })
    }

    /// Switches the kinematics.
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

    /// Returns the pose to which the joints have moved in the identity kinematics, if they have.
    ///
    /// LinuxCNC does not check whether the first forward after a switch succeeds, and would continue
    /// from the pose before. If no pose was ever known, as before homing, there is none to start
    /// from, and nothing is refused here.
    fn pose_after_identity(&self) -> Result<Option<Pose>, Fault> {
        let (Some(last), Some(joints)) = (self.seeds.last(), &self.identity_joints) else {
            return Ok(None);
        };
        let (machine, solver) = (&self.frozen()?.machine, self.pins.solver());
        let joints = self.correction.taken_from(joints);
        Ok(Some(machine.forward(&joints, &last, &self.tool.of_machine(), &solver)?.pose))
    }

    /// Returns the kinematics of a number.
    pub fn kind_of(&self, number: i32) -> Result<Kind, Fault> {
        match Kind::numbered(number, &self.load) {
            Some(Kind::Identity) if !self.load.has_identity() => {
                Err(Cause::IdentityImpossible.into())
            }
            Some(kind) => Ok(kind),
            None => Err(Fault::with_value(Cause::KinematicsTypeUnknown, f64::from(number))),
        }
    }

    /// Replaces the seed in `world` with LinuxCNC's pose in which each letter equals its joint, and is 0 if no
    /// joint moves it.
    pub(super) fn identity_forward(
        &mut self,
        joints: &[f64],
        extra: &[f64],
        world: &mut World,
    ) -> Result<(), Fault> {
        let pose = pose_of(self.layout(), joints);
        self.pins.fwd_kins_fail.set(pose.is_err());
        let pose = match pose {
            Ok(pose) => pose,
            Err(fault) => return self.recorded(Err(fault)),
        };
        self.identity_joints = Some(joints_of(joints));
        self.pins.show_pose(pose);
        self.track_machine(joints, &self.seed_in(world, &self.tool.offset()));
        world.iter_mut().zip(pose).for_each(|(to, value)| *to = value);
        write_extra(&self.load, extra, world);
        Ok(())
    }

    /// Follows the joints with the machine's pose, so that it is known after the switch back.
    ///
    /// Joints for which no pose exists leave it unchanged. After homing, joints at the reference pose start
    /// anew, or in a drop-in at LinuxCNC's seed `given`, which is `[TRAJ]HOME` then.
    fn track_machine(&mut self, joints: &[f64], given: &Pose) {
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

    /// Returns the joints of LinuxCNC's pose, each the value of its letter.
    pub(super) fn identity_inverse(&mut self, world: &World) -> Result<Joints, Fault> {
        // Before a geometry is known the rounding tolerance is that of one machine unit.
        let size = self.frozen.as_ref().map_or(1.0, |frozen| frozen.machine.size());
        let joints = joints_of_letters(&self.load, world, size)?;
        if self.calls.takes_command() {
            self.identity_joints = Some(joints);
        }
        Ok(joints)
    }
}
