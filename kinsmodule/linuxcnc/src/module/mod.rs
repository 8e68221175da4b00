// SPDX-License-Identifier: GPL-2.0-or-later
//! The state between calls, and what LinuxCNC asks of the machine's kinematics.

mod contradiction;
mod correction;
mod extra;
mod forward;
mod freezing;
mod identity;
mod monitor;
mod report;
mod seeds;
mod tool_offset;

pub use identity::Kind;

use crate::calls::Calls;
use crate::crossing::Crossing;
use crate::guard::Guard;
use crate::hal::nanoseconds;
use crate::pins::{Pins, Place};
use crate::start::Start;
use crate::tool::Tool;
use contradiction::Contradiction;
use correction::Correction;
use extra::Carrying;
use freezing::Frozen;
use kinematics::{Cause, Fault, Jacobian, Joints, Layout, Load, Machine, Pose, Vector3};
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
    /// A geometry is frozen, without extra axes and with the work in base.
    is_plain: bool,
    carrying: Carrying,
    apply_was: bool,
    /// Once `.apply` was used, no call freezes by itself.
    apply_used: bool,
    /// Whether `.machine-on` was ever true: only then does false mean that it is off.
    machine_was_on: bool,
    kind: Kind,
    /// Joints commanded last in identity kinematics, where there was a call.
    identity_joints: Option<Joints>,
    /// The kinematics were switched back to the machine, and forward has found no pose of the
    /// joints since: what LinuxCNC takes for the pose may be one from before the switch, far from
    /// where the joints are.
    pose_is_unknown: bool,
    /// The kinematics were switched in this cycle: LinuxCNC goes on from the pose that forward finds next.
    was_switched: bool,
    /// Forward was refused, and no pose has been asked for since: LinuxCNC may hand the NaN of the
    /// refusal over to inverse.
    refused: bool,
    /// The last call of forward has found a pose, even if it was in doubt.
    has_found: bool,
    /// A joint's feedback that is no number, in the last forward.
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
    /// Calls of forward before one that looks at all pins of the geometry, where no monitor runs.
    until_watched: u32,
    /// Of the cycles in which the monitor shows what only people read, which one this is.
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
            is_plain: false,
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

    pub fn kind(&self) -> Kind {
        self.kind
    }

    pub fn layout(&self) -> &Layout {
        &self.load.layout
    }

    /// The frozen machine.
    pub fn machine(&self) -> Option<&Machine> {
        Some(&self.frozen.as_ref()?.machine).filter(|_| self.kind == Kind::Machine)
    }

    /// The tool offset in effect.
    pub fn tool(&self) -> Vector3<f64> {
        self.tool.offset()
    }

    /// Returns whether the next inverse is for the commanded pose, not for the end point of a queued move.
    pub fn awaits_command(&self) -> bool {
        self.calls.awaits_command()
    }

    /// After the monitor: the pose that was commanded in its cycle.
    pub fn commanded(&self) -> Option<Pose> {
        self.calls.commanded_before().copied()
    }

    /// The last good pose that forward found.
    pub fn last_pose(&self) -> Option<Pose> {
        self.seeds.last()
    }

    pub fn load(&self) -> &Load {
        &self.load
    }

    /// Joints of a pose in degrees, written to `joints`; left alone after an error.
    ///
    /// Changes nothing that a later call would depend on, so that LinuxCNC may ask for end
    /// points of queued moves at any time; the first call of all freezes the geometry.
    #[inline(always)]
    pub fn inverse(&mut self, degrees: &[f64; 6], joints: &mut [f64]) -> Result<(), Fault> {
        let timed = self.is_monitored && self.calls.awaits_command();
        let begin = nanoseconds_if(timed);
        let pose = Pose::from_degrees(*degrees);
        let result = match self.prepared(|| !is_zero(degrees)) {
            Ok(()) if self.pose_is_unknown => Err(Cause::PoseUnknown.into()),
            Ok(()) => self.joints_of(degrees, &pose, joints),
            Err(fault) => Err(fault),
        };
        self.calls.note_inverse(&pose);
        if timed {
            self.guard.timed_inverse(nanoseconds().wrapping_sub(begin));
        }
        self.answered(result)
    }

    /// The end of a call of inverse.
    #[inline(always)]
    fn answered(&mut self, result: Result<(), Fault>) -> Result<(), Fault> {
        let Err(fault) = result else {
            self.refused = false;
            return Ok(());
        };
        if !(self.refused && is_consequence(fault.cause)) {
            self.record(&fault);
        }
        Err(fault)
    }

    #[inline(always)]
    fn joints_of(&self, degrees: &[f64; 6], pose: &Pose, joints: &mut [f64]) -> Result<(), Fault> {
        let (frozen, tool) = (self.frozen()?, self.tool.of_machine());
        let request = self.requested_tool(frozen.given.spindle_offset);
        if self.tool.has(&request) {
            frozen.machine.inverse_inlined(degrees, pose, &tool, joints)?;
            return self.add_to(joints);
        }
        let tool = self.tool_instead_of(frozen, request)?;
        let found = frozen.machine.inverse(&{ *pose }, &tool)?;
        for (joint, value) in joints.iter_mut().zip(found) {
            *joint = value;
        }
        self.add_to(joints)
    }

    /// Adds to joint values of the kinematics what LinuxCNC's have beside them.
    #[inline(always)]
    fn add_to(&self, joints: &mut [f64]) -> Result<(), Fault> {
        self.correction.add(joints);
        if self.contradiction.is_on() { self.contradicted_joints(joints) } else { Ok(()) }
    }

    /// Pose of the joints for the tool frame: no state changes, no fault is recorded.
    pub fn pose_of(&self, joints: &Joints) -> Result<Pose, Fault> {
        let machine = &self.frozen()?.machine;
        let seed = self.seeds.last().or(self.reference()).ok_or(Cause::SeedMissing)?;
        let tool = self.carrying.chain.machine_tool(&self.tool_in_effect()?);
        let joints = self.correction.taken_from(joints);
        Ok(machine.forward(&joints, &seed, &tool, &self.pins.solver())?.pose)
    }

    /// ∂q/∂(x … c), joint units per machine unit and per degree, row by row.
    pub fn jacobian(&self, pose: &Pose) -> Result<Jacobian, Fault> {
        let tool = self.tool_in_effect()?;
        self.frozen()?.machine.at(pose, &tool)?.pose_jacobian()
    }
}

/// The clock, read only where it is needed: calls take some tens of nanoseconds.
fn nanoseconds_if(wanted: bool) -> i64 {
    if wanted { nanoseconds() } else { 0 }
}

/// Whether a refusal of inverse may follow from one of forward, whose cause is then the one to
/// report.
fn is_consequence(cause: Cause) -> bool {
    matches!(cause, Cause::PoseNotFinite | Cause::PoseUnknown)
}

fn is_zero(values: &[f64]) -> bool {
    values.iter().all(|v| *v == 0.0)
}
