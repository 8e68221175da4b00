// SPDX-License-Identifier: GPL-2.0-or-later
//! The state between calls, and the functions for LinuxCNC's kinematics calls.

mod contradiction;
mod correction;
pub mod extra;
mod forward;
mod freezing;
pub mod identity;
mod monitor;
mod report;
mod seeds;
mod tool_offset;

pub use identity::Kind;

use crate::calls::Calls;
use crate::crossing::Crossing;
use crate::guard::Guard;
use crate::hal::nanoseconds;
use crate::orient::{Orientation, Request, oriented};
use crate::pins::{Pins, Place};
use crate::start::Start;
use crate::tool::Tool;
use contradiction::Contradiction;
use correction::Correction;
use extra::Carrying;
use freezing::Frozen;
use kinematics::{
    Cause, Chain, Fault, Joints, Layout, Load, MAX_JOINTS, Machine, Matrix3, Pose, Vector3, World,
};
use report::Reports;
use seeds::{Handed, Seeds};
use tool_offset::SentTool;

/// State between calls, of one mechanism.
pub struct Module {
    pub pins: &'static Pins,
    load: Load,
    /// Which mechanism it is.
    place: Place,
    /// Whether there are two.
    is_of_pair: bool,
    /// Whether the monitor runs. It then reports the faults and moves the tool offset.
    is_monitored: bool,
    frozen: Option<Frozen>,
    carrying: Carrying,
    apply_was: bool,
    /// Once `.apply` was used, no kinematics call freezes the geometry.
    apply_used: bool,
    /// Whether `.machine-on` was ever true: only then does false mean that the machine is off.
    machine_was_on: bool,
    kind: Kind,
    /// Joints commanded last in identity kinematics, if there was a call.
    identity_joints: Option<Joints>,
    /// The kinematics were switched back to the machine, and forward has found no pose of the
    /// joints since: LinuxCNC's pose may be one from before the switch, far from
    /// the present joints.
    pose_is_unknown: bool,
    /// The kinematics were switched in this cycle: LinuxCNC continues from the pose that forward finds next.
    was_switched: bool,
    /// Forward was refused, and no pose has been requested since: LinuxCNC may pass the NaN of the
    /// refusal to inverse.
    refused: bool,
    /// The last call of forward has found a pose, even if it was in doubt.
    has_found: bool,
    /// A NaN or infinite joint feedback in the last forward.
    lost: Option<Fault>,
    tool: Tool,
    sent_tool: SentTool,
    correction: Correction,
    contradiction: Contradiction,
    calls: Calls,
    seeds: Seeds,
    handed: Handed,
    /// The start without a seed.
    start: Start,
    crossing: Crossing,
    guard: Guard,
    reports: Reports,
    reset_was: bool,
    /// Calls of forward before one that checks all pins of the geometry, if no monitor runs.
    until_watched: u32,
    /// Index of this cycle among those over which the monitor spreads updates for users.
    turn: u32,
}

impl Module {
    pub fn new(pins: &'static Pins, load: Load, place: Place) -> Self {
        Self {
            pins,
            is_of_pair: place.is_second || load.second().is_some(),
            load,
            place,
            is_monitored: false,
            frozen: None,
            carrying: Carrying::new(load.extra),
            apply_was: false,
            apply_used: false,
            machine_was_on: false,
            kind: Kind::first(&load),
            identity_joints: None,
            pose_is_unknown: false,
            was_switched: false,
            refused: false,
            has_found: false,
            lost: None,
            tool: Tool::new(),
            sent_tool: SentTool::new(),
            correction: Correction::NONE,
            contradiction: Contradiction::NONE,
            calls: Calls::default(),
            seeds: Seeds::new(),
            handed: Handed::new(),
            start: Start::new(),
            crossing: Crossing::new(),
            guard: Guard::new(),
            reports: Reports::new(place.is_second),
            reset_was: false,
            until_watched: 0,
            turn: 0,
        }
    }

    pub fn layout(&self) -> &Layout {
        &self.load.layout
    }

    pub fn machine(&self) -> Option<&Machine> {
        Some(&self.frozen.as_ref()?.machine).filter(|_| self.kind == Kind::Machine)
    }

    /// Returns the tool offset in effect.
    pub fn tool(&self) -> Vector3<f64> {
        self.tool.offset()
    }

    /// Returns whether the next inverse is for the commanded pose, not for the end point of a queued move.
    pub fn awaits_command(&self) -> bool {
        self.calls.awaits_command()
    }

    /// Returns, after the monitor, the pose that was commanded in its cycle.
    pub fn commanded(&self) -> Option<Pose> {
        self.calls.commanded_before().copied()
    }

    /// Returns the last good pose that forward found.
    pub fn last_pose(&self) -> Option<Pose> {
        self.seeds.last()
    }

    pub fn chain(&self) -> &Chain {
        &self.carrying.chain
    }

    pub fn load(&self) -> &Load {
        &self.load
    }

    /// Returns the joints of legs and table at a pose of LinuxCNC.
    ///
    /// Changes nothing that affects a later call, so that LinuxCNC may ask for end
    /// points of queued moves at any time; the very first call freezes the geometry.
    pub fn inverse(&mut self, world: &World) -> Result<Joints, Fault> {
        match self.kind {
            Kind::Identity => self.identity_inverse(world).inspect_err(|fault| self.record(fault)),
            Kind::Machine => self.machine_inverse(world),
        }
    }

    /// Converts LinuxCNC's pose to the machine's, with a tool offset.
    #[inline(always)]
    fn pose_of(&self, world: &World, tool: &Vector3<f64>) -> Result<Pose, Fault> {
        self.carrying.pose_of(self.frozen.as_ref().map(|frozen| &frozen.machine), world, tool)
    }

    fn machine_inverse(&mut self, world: &World) -> Result<Joints, Fault> {
        let timed = self.is_monitored && self.calls.awaits_command();
        let begin = nanoseconds_if(timed);
        let prepared = self.prepared(|| !is_zero(world));
        let tool = self.tool_in_effect();
        let pose = self.pose_of(world, &tool.unwrap_or(self.tool.offset()));
        let result = match (prepared, tool, pose) {
            (Ok(()), ..) if self.pose_is_unknown => Err(Cause::PoseUnknown.into()),
            (Ok(()), Ok(tool), Ok(pose)) => self.joints_at(&pose, &tool),
            (Err(fault), ..) | (_, Err(fault), _) | (.., Err(fault)) => Err(fault),
        };
        if self.calls.awaits_command() {
            self.carrying.note(world);
        }
        self.calls.note_inverse(&pose.unwrap_or(NO_POSE));
        if timed {
            self.guard.timed_inverse(nanoseconds().wrapping_sub(begin));
        }
        match &result {
            Ok(_) => self.refused = false,
            // The NaN of a refused forward: report its cause.
            Err(Fault { cause: Cause::PoseNotFinite | Cause::PoseUnknown, .. }) if self.refused => {
            }
            Err(fault) => self.record(fault),
        }
        result
    }

    /// Returns the joints of the machine's pose, with the additions of LinuxCNC's joints to those of the kinematics.
    #[inline(always)]
    fn joints_at(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Joints, Fault> {
        let tool = self.carrying.chain.machine_tool(tool);
        let mut result = self.frozen()?.machine.inverse(pose, &tool);
        if let Ok(joints) = &mut result {
            self.correction.add(joints);
            if self.contradiction.is_on() {
                self.contradicted_joints(joints)?;
            }
        }
        result
    }

    /// Returns ∂q/∂(x … w) of legs and table, joint units per machine unit and per degree, row by row.
    pub fn jacobian(&self, world: &World) -> Result<[World; MAX_JOINTS], Fault> {
        if self.kind == Kind::Identity {
            return Ok(identity::rows_of_letters(self.layout()));
        }
        let tool = self.tool_in_effect()?;
        extra::pose_rows(&self.frozen()?.machine, &self.carrying.chain, world, &tool)
    }

    /// Returns the orientations of tool and workpiece in base: no state changes, no fault is recorded.
    ///
    /// In identity kinematics no joint rotates a tool, whatever the letters of the pose are.
    pub fn frames(&self, joints: &[f64], axes: &[f64]) -> Result<[Matrix3<f64>; 2], Fault> {
        if self.kind == Kind::Identity {
            return Ok([Matrix3::identity(); 2]);
        }
        let machine = &self.frozen()?.machine;
        let seed = self.seeds.last().or(self.reference()).ok_or(Cause::SeedMissing)?;
        let tool = self.carrying.chain.machine_tool(&self.tool_in_effect()?);
        let joints = self.correction.taken_from(joints);
        let platform = machine.forward(&joints, &seed, &tool, &self.pins.solver())?.full;
        let mut world = [0.0; 9];
        extra::write_extra(&self.load, axes, &mut world);
        Ok(self.carrying.chain.frames(&platform, &world))
    }

    /// Returns the joints of legs and table at which the tool has a requested orientation, with the directions that are free
    /// and the spin that remains; `None` if it cannot have it, or not by a motion without a singular pose.
    pub fn oriented(
        &self,
        joints: &[f64],
        axes: &[f64],
        request: &Request,
    ) -> Result<Option<(Joints, Orientation)>, Fault> {
        let machine = &self.frozen()?.machine;
        if self.kind == Kind::Identity {
            return Err(Cause::KinematicsTypeUnknown.into());
        }
        // The orientation follows from the other coordinates.
        if self.layout().constraints() > 0 {
            return Ok(None);
        }
        let (chain, tool) = (&self.carrying.chain, self.tool_in_effect()?);
        let (own_tool, solver) = (chain.machine_tool(&tool), self.pins.solver());
        let seed = self.seeds.last().or(self.reference()).ok_or(Cause::SeedMissing)?;
        let own = self.correction.taken_from(joints);
        let pose = machine.forward(&own, &seed, &own_tool, &solver)?.pose;
        let mut world = [0.0; 9];
        extra::write_extra(&self.load, axes, &mut world);
        chain.to_world(&pose.to_degrees(), &mut world, &tool)?;
        let Some(found) = oriented((self.layout(), chain), &pose, &world, request) else {
            return Ok(None);
        };
        let there = Pose::from_degrees(chain.to_machine(&found.world, &tool)?);
        let Ok(mut joints) = machine.inverse(&there, &own_tool) else { return Ok(None) };
        // Another assembly of the same joints is no answer.
        let Ok(back) = machine.forward(&joints, &pose, &own_tool, &solver) else { return Ok(None) };
        if back.pose.distance(&there, machine.radius()) > ORIENTED * machine.size() {
            return Ok(None);
        }
        self.correction.add(&mut joints);
        Ok(Some((joints, found)))
    }

    /// Returns whether a joint rotates the workpiece: that of an axis which carries it, or the platform's.
    pub fn turns_work(&self) -> bool {
        self.kind == Kind::Machine && !self.carrying.chain.is_empty()
    }
}

/// Largest distance between a pose and the one that forward finds for its joints, in sizes of the machine.
const ORIENTED: f64 = 1e-9;

/// The pose of a call that has none.
const NO_POSE: Pose = Pose {
    position: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
    angles: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
};

/// Copies joint values; 0 beyond the last one.
fn joints_of(given: &[f64]) -> Joints {
    let mut joints = [0.0; MAX_JOINTS];
    joints.iter_mut().zip(given).for_each(|(joint, value)| *joint = *value);
    joints
}

/// Reads the clock only if needed: calls take some tens of nanoseconds.
fn nanoseconds_if(wanted: bool) -> i64 {
    if wanted { nanoseconds() } else { 0 }
}

fn is_zero(values: &[f64]) -> bool {
    values.iter().all(|v| *v == 0.0)
}
