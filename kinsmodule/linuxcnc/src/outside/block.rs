// SPDX-License-Identifier: GPL-2.0-or-later
//! The kinematics of a parameter block. The machine is checked and made in every call, so that callers in several
//! threads share nothing that changes.

use super::description::Description;
use super::interface::{KinsParams, KinsScratch};
use super::table::Values;
use crate::module::extra::{
    check_extra, pose_rows, write_extra, write_extra_joints, write_extra_rows,
};
use crate::module::identity::{joints_of_letters, pose_of, rows_of_letters};
use crate::pins::Source;
use kinematics::{
    Cause, Chain, ChainGeometry, Fault, Joints, Load, MAX_JOINTS, Machine, Matrix3, Pose, Solver,
    Vector3, World,
};

/// The machine of a block.
pub struct Block<'a> {
    load: &'a Load,
    machine: Machine,
    chain: Chain,
    home: Option<Pose>,
    tool: Vector3<f64>,
    solver: Solver,
}

/// LinuxCNC's joints as those of the machine and of the extra axes.
struct Parts<'a> {
    own: Joints,
    extra: &'a [f64],
}

impl<'a> Parts<'a> {
    fn of(load: &Load, joints: &'a [f64]) -> Result<Self, Fault> {
        let split = joints.split_at_checked(load.first_extra_joint());
        let (legs, extra) = split.unwrap_or((joints, &[]));
        check_extra(load, extra)?;
        let mut own = [0.0; MAX_JOINTS];
        own.iter_mut().zip(legs).for_each(|(to, value)| *to = *value);
        Ok(Self { own, extra })
    }
}

impl<'a> Block<'a> {
    /// Refuses a block with [`Cause::NoGeometry`] if it is not that of the machine in force.
    pub fn check(description: &Description, block: &KinsParams) -> Result<(), Fault> {
        let (load, pins, values) = (&description.load, &description.pins, Values(&block.geometry));
        let (own, chain) = (pins.given(load, &values), pins.chain(load, &values));
        let hash = own.hash(load, chain.hash(&load.extra, own.geometry.hash()));
        if values.get(&pins.kinematics_hash) == hash {
            Ok(())
        } else {
            Err(Cause::NoGeometry.into())
        }
    }

    /// Makes the machine of a block that [`Self::check`] accepts, or returns why it is refused: as when the module freezes
    /// a geometry.
    pub fn of(description: &'a Description, given: &KinsParams) -> Result<Self, Fault> {
        let (load, pins, values) = (&description.load, &description.pins, Values(&given.geometry));
        let (own, chain) = (pins.given(load, &values), pins.chain(load, &values));
        ChainGeometry::check_holder(chain.holder)?;
        let machine = own.checked()?;
        // Without a reference pose the module fixes the folds of the nut corrections at the first pose.
        if machine.is_literal() {
            return Err(Cause::FoldUndefined.into());
        }
        let chain = Chain::freeze(&chain, &load.extra, &load.layout, machine.size())?;
        let [x, y, z, ..] = given.tool;
        let tool = Vector3::new(x, y, z + own.spindle_offset);
        machine.check_tool(&tool)?;
        let home = own.geometry.home.map(Pose::from_degrees);
        Ok(Self { load, machine, chain, home, tool, solver: pins.solver(&values) })
    }

    /// Returns LinuxCNC's pose as the machine's.
    fn pose_of(&self, world: &World) -> Result<Pose, Fault> {
        self.machine.pose_of_world(&self.chain, world, &self.tool).map(Pose::from_degrees)
    }

    /// Writes the joints of a pose; a refusal leaves them unchanged.
    pub fn inverse(&self, world: &World, joints: &mut [f64]) -> Result<(), Fault> {
        let pose = self.pose_of(world)?;
        let own = self.machine.inverse(&pose, &self.chain.machine_tool(&self.tool))?;
        write_joints(self.load, &own, world, joints);
        Ok(())
    }

    /// Replaces the seed in `world` with the pose of the joints; a refusal leaves it.
    ///
    /// The search starts at the seed, or if it leads nowhere at the last pose of this caller, or at the reference pose.
    pub fn forward(
        &self,
        joints: &[f64],
        world: &mut World,
        scratch: &mut KinsScratch,
    ) -> Result<(), Fault> {
        let Parts { own, extra } = Parts::of(self.load, joints)?;
        let last = scratch.last_pose();
        // All zeros, as in a fresh pose, is no seed unless nothing else is known.
        let given = self.pose_of(world).ok();
        let (seed, blank) = match is_blank(world) {
            true => (None, given),
            false => (given, None),
        };
        // The caller's seed is in degrees: the last pose itself continues as the module does, bit by bit.
        let seed = match last.filter(|last| self.is_at(last, world)) {
            Some(last) => Some(last),
            None => seed,
        };
        let mut result = Err(Fault::from(Cause::SeedMissing));
        for start in [seed, last, self.start_at_home(&own), blank].into_iter().flatten() {
            result = self.pose_from(&own, &start);
            if result.is_ok() {
                break;
            }
        }
        let pose = result?;
        let mut found = *world;
        write_extra(self.load, extra, &mut found);
        self.machine.write_world(&self.chain, &pose.to_degrees(), &mut found, &self.tool)?;
        *world = found;
        scratch.keep_pose(&pose);
        Ok(())
    }

    /// Returns the pose from which the module searches if it knows the reference pose alone.
    fn start_at_home(&self, joints: &Joints) -> Option<Pose> {
        let home = self.home?;
        Some(self.machine.pose_beside(joints, &home, &self.solver).unwrap_or(home))
    }

    fn pose_from(&self, joints: &Joints, start: &Pose) -> Result<Pose, Fault> {
        let tool = self.chain.machine_tool(&self.tool);
        Ok(self.machine.forward(joints, start, &tool, &self.solver)?.pose)
    }

    /// Returns whether LinuxCNC's pose is this pose of the machine, rounded to degrees.
    fn is_at(&self, pose: &Pose, world: &World) -> bool {
        let mut rounded = *world;
        let written =
            self.machine.write_world(&self.chain, &pose.to_degrees(), &mut rounded, &self.tool);
        written.is_ok() && rounded == *world
    }

    /// Writes the derivatives of all joints by LinuxCNC's letters.
    pub fn jacobian(&self, world: &World, rows: &mut [World]) -> Result<(), Fault> {
        let own = pose_rows(&self.machine, &self.chain, world, &self.tool)?;
        write_rows(self.load, &own, rows);
        Ok(())
    }

    /// Returns the orientations of tool and workpiece in base. The search starts at the reference pose: a caller has
    /// no other here.
    pub fn frames(&self, joints: &[f64]) -> Result<[Matrix3<f64>; 2], Fault> {
        let Parts { own, extra } = Parts::of(self.load, joints)?;
        let start = self.start_at_home(&own).ok_or(Cause::SeedMissing)?;
        let pose = self.pose_from(&own, &start)?;
        let mut world = [0.0; 9];
        write_extra(self.load, extra, &mut world);
        let platform = match self.load.layout.constraints() {
            0 => pose,
            _ => self.machine.full_pose(&pose, &self.chain.machine_tool(&self.tool))?,
        };
        Ok(self.chain.frames(&platform, &world))
    }

    /// Returns whether a joint rotates the workpiece.
    pub fn turns_work(&self) -> bool {
        !self.chain.is_empty()
    }

    /// Returns the machine's size.
    pub fn size(&self) -> f64 {
        self.machine.size()
    }
}

/// Writes the joints of a pose in the identity kinematics of a machine of `size`.
pub fn identity_inverse(
    load: &Load,
    size: f64,
    world: &World,
    joints: &mut [f64],
) -> Result<(), Fault> {
    let own = joints_of_letters(load, world, size)?;
    write_joints(load, &own, world, joints);
    Ok(())
}

/// Writes the pose of the joints in the identity kinematics.
pub fn identity_forward(load: &Load, joints: &[f64], world: &mut World) -> Result<(), Fault> {
    let Parts { own, extra } = Parts::of(load, joints)?;
    let pose = pose_of(&load.layout, &own)?;
    world.iter_mut().zip(pose).for_each(|(to, value)| *to = value);
    write_extra(load, extra, world);
    Ok(())
}

/// Writes the derivatives of all joints in the identity kinematics.
pub fn identity_jacobian(load: &Load, rows: &mut [World]) {
    write_rows(load, &rows_of_letters(&load.layout), rows);
}

fn write_joints(load: &Load, own: &Joints, world: &World, joints: &mut [f64]) {
    let legs = joints.iter_mut().zip(own).take(load.layout.joints());
    legs.for_each(|(joint, value)| *joint = *value);
    write_extra_joints(load, world, joints);
}

fn write_rows(load: &Load, own: &[World; MAX_JOINTS], rows: &mut [World]) {
    rows.fill([0.0; 9]);
    rows.iter_mut().zip(own).for_each(|(row, own)| *row = *own);
    write_extra_rows(load, rows);
}

fn is_blank(world: &World) -> bool {
    world.iter().all(|value| *value == 0.0)
}
