// SPDX-License-Identifier: GPL-2.0-or-later
//! The tool offset that the kinematics use.

use super::freezing::Frozen;
use super::{Kind, Module};
use crate::hal::print_error;
use crate::tool::{Cycle, NOTICEABLE, shift};
use kinematics::{Cause, Fault, Pose, Vector3, text};

/// Cycles for which pins may differ from the offset that LinuxCNC passes: it sets its own pins later in a cycle,
/// and pins netted to them through another component are later still.
const LATE_CYCLES: u32 = 1000;

/// The tool offset that LinuxCNC passes, if it does.
pub(super) struct SentTool {
    offset: Option<Vector3<f64>>,
    /// Number of cycles for which the pins have differed from it.
    differing: u32,
}

impl SentTool {
    pub(super) const fn new() -> Self {
        Self { offset: None, differing: 0 }
    }

    /// Counts a cycle; returns whether the pins have just differed for too long, once.
    fn is_contradicted_by(&mut self, pins: &Vector3<f64>) -> bool {
        match self.offset {
            _ if self.differing > LATE_CYCLES => return false,
            Some(offset) if offset != *pins => self.differing += 1,
            _ => self.differing = 0,
        }
        self.differing > LATE_CYCLES
    }
}

impl Module {
    /// Accepts a request that replaces the pins from now on.
    pub fn request_tool(&mut self, offset: [f64; 3]) {
        self.sent_tool.offset = Some(offset.into());
    }

    /// Returns the requested tool vector o, with the spindle offset in force.
    #[inline(always)]
    pub(super) fn requested_tool(&self, spindle_offset: f64) -> Vector3<f64> {
        let mut tool = self.sent_tool.offset.unwrap_or_else(|| self.pins.tool());
        tool.z += spindle_offset;
        tool
    }

    /// Reports once that pins which are not read differ from the request.
    pub(super) fn watch_tool_pins(&mut self) {
        if self.sent_tool.offset.is_some() && self.sent_tool.is_contradicted_by(&self.pins.tool()) {
            print_error(&text![
                "pkmkins: the tool-offset pins differ from the tool offset that LinuxCNC passes, and are \
                 ignored; net them to motion.tooloffset"
            ]);
        }
    }

    /// Returns the tool offset to compute with.
    ///
    /// A request takes effect at once with the machine off, in the identity kinematics, in which no joint
    /// depends on it, and before any pose is known.
    /// Otherwise the monitor brings it into effect. Without a monitor it takes effect if it
    /// moves no joint: while the platform is level.
    #[inline(always)]
    pub(super) fn tool_in_effect(&self) -> Result<Vector3<f64>, Fault> {
        let (frozen, tool) = (self.frozen()?, self.tool.offset());
        let request = self.requested_tool(frozen.given.spindle_offset);
        if self.tool.has(&request) {
            return Ok(tool);
        }
        frozen.machine.check_tool(&request)?;
        if self.is_off() || self.kind == Kind::Identity {
            return Ok(request);
        }
        let Some(pose) = self.seeds.last() else {
            return Ok(request);
        };
        if self.is_monitored {
            return self.tool.refusal(&request).map_or(Ok(tool), Err);
        }
        let jump = match frozen.machine.layout().constraints() {
            0 => self.shift_of(&pose, &tool, &(request - tool)).norm(),
            _ => self.carrying.travel(&frozen.machine, &tool, &request).unwrap_or_else(|| {
                frozen.machine.tool_travel(&pose, &tool, &request).unwrap_or(f64::INFINITY)
            }),
        };
        if jump <= NOTICEABLE * frozen.machine.size() {
            return Ok(request);
        }
        Err(Fault::with_value(Cause::ToolChangedTilted, jump))
    }

    /// Returns the shift of the platform for a change of the offset; at the pose commanded last if an axis
    /// carries something.
    fn shift_of(&self, pose: &Pose, tool: &Vector3<f64>, change: &Vector3<f64>) -> Vector3<f64> {
        match self.carrying.chain.is_empty() {
            true => shift(pose, change),
            false => self.carrying.tool_shift(tool) * change,
        }
    }

    /// Returns whether the machine is known to be off: in a HAL file that does not
    /// connect `.machine-on` this is never known.
    pub(super) fn is_off(&self) -> bool {
        (self.machine_was_on || self.is_monitored) && !self.pins.machine_on()
    }

    /// Moves the tool offset toward the requested one. Shows the one that belongs to the pose
    /// and joints of this cycle: LinuxCNC's request changes after forward and inverse.
    pub(super) fn advance_tool(&mut self, commanded: Option<Pose>, seconds: f64) {
        let of_this_cycle = self.tool.offset();
        self.was_switched = false;
        if let Ok(tool) = self.tool_in_effect() {
            self.retool(tool);
        }
        if let Err(fault) = self.tool_advanced(commanded, seconds) {
            self.record(&fault);
        }
        self.pins.show_tool(&of_this_cycle);
        self.pins.tool_busy.set(self.tool.is_busy());
    }

    fn tool_advanced(&mut self, commanded: Option<Pose>, seconds: f64) -> Result<(), Fault> {
        let Some(Frozen { machine, given }) = &self.frozen else {
            return Ok(());
        };
        let request = self.requested_tool(given.spindle_offset);
        if self.tool.is_at(&request) || (commanded.is_none() && self.is_between_points()) {
            return Ok(());
        }
        let carrying = &mut self.carrying;
        if let Some(pose) = &commanded {
            carrying.see_shift(pose, &self.tool.offset());
        }
        let (limits, solver) = (self.pins.limits(&self.load), self.pins.solver());
        let has_moved = (!carrying.chain.is_empty()).then_some(carrying.has_moved);
        let travel = carrying.travel(machine, &self.tool.offset(), &request);
        let shift = &carrying.shift;
        self.tool.advance(&Cycle {
            machine,
            limits,
            solver,
            request,
            commanded,
            has_moved,
            shift,
            travel,
            seconds,
        })
    }

    /// Returns whether a cycle without a commanded pose is one between two points of a slower trajectory
    /// period, in world mode.
    fn is_between_points(&self) -> bool {
        let is_joint_mode = self.calls.is_for_commanded_joints();
        self.kind == Kind::Machine && !self.is_off() && !is_joint_mode
    }

    /// Sets the tool offset. The joints stay, so that the poses move.
    fn retool(&mut self, tool: Vector3<f64>) {
        if tool == self.tool.offset() {
            return;
        }
        let before = self.tool.of_machine();
        self.tool.take(tool);
        let change = self.tool.of_machine() - before;
        let constrained = self.frozen.as_ref().map(|frozen| &frozen.machine);
        let constrained = constrained.filter(|machine| machine.layout().constraints() > 0);
        self.seeds.change_tool(|pose| match constrained {
            None => Some(shift(pose, &change)),
            Some(machine) => machine.tool_shift(pose, &before, &change).ok(),
        });
    }

    /// Sets the tool offset that forward must use.
    pub(super) fn retool_for_forward(&mut self) -> Result<(), Fault> {
        let request = self.requested_tool(self.frozen()?.given.spindle_offset);
        if self.tool.has(&request) {
            return Ok(());
        }
        let usable = self.frozen()?.machine.check_tool(&request).is_ok();
        // LinuxCNC continues from the pose that it gets now: in joint mode, on entering teleop mode, and after
        // a switch of the kinematics. The change then ends at once, and no joint moves.
        let is_of_command = self.was_switched || self.calls.is_for_commanded_joints();
        let sets_command = self.pose_is_unknown || (self.is_monitored && is_of_command);
        if sets_command && usable {
            self.retool(request);
        } else if let Ok(tool) = self.tool_in_effect() {
            // A refused tool change must not stop the display: the old offset stays in effect.
            self.retool(tool);
        }
        Ok(())
    }
}
