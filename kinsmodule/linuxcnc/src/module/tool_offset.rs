// SPDX-License-Identifier: GPL-2.0-or-later
//! Which tool offset the kinematics use.

use super::Module;
use super::freezing::Frozen;
use crate::tool::{Cycle, NOTICEABLE, shift};
use kinematics::{Cause, Fault, Pose, Vector3};

impl Module {
    /// The tool offset to compute with.
    ///
    /// A request takes effect at once with the machine off and before any pose is known.
    /// Otherwise the monitor brings it into effect. Without a monitor it takes effect where it
    /// moves no joint: while the platform is level.
    #[inline(always)]
    pub(super) fn tool_in_effect(&self) -> Result<Vector3<f64>, Fault> {
        let (frozen, tool) = (self.frozen()?, self.tool.offset());
        let request = self.pins.tool(frozen.given.spindle_offset);
        if self.tool.has(&request) {
            return Ok(tool);
        }
        self.tool_instead_of(frozen, request)
    }

    /// The tool offset to compute with where it is not the one requested.
    #[inline(never)]
    pub(super) fn tool_instead_of(
        &self,
        frozen: &Frozen,
        request: Vector3<f64>,
    ) -> Result<Vector3<f64>, Fault> {
        let tool = self.tool.offset();
        frozen.machine.check_tool(&request)?;
        if self.is_off() {
            return Ok(request);
        }
        let Some(pose) = self.seeds.last() else {
            return Ok(request);
        };
        if self.is_monitored {
            return self.tool.refusal(&request).map_or(Ok(tool), Err);
        }
        let jump = self.shift_of(&pose, &tool, &(request - tool)).norm();
        if jump <= NOTICEABLE * frozen.machine.size() {
            return Ok(request);
        }
        Err(Fault::with_value(Cause::ToolChangedTilted, jump))
    }

    /// How far the platform shifts for a change of the offset; at the pose commanded last where an axis
    /// carries something.
    fn shift_of(&self, pose: &Pose, tool: &Vector3<f64>, change: &Vector3<f64>) -> Vector3<f64> {
        match self.carrying.chain.is_empty() {
            true => shift(pose, change),
            false => self.carrying.tool_shift(tool) * change,
        }
    }

    /// Whether the machine is off, as far as this can be known: a HAL file that does not
    /// connect `.machine-on` never says so.
    pub(super) fn is_off(&self) -> bool {
        (self.machine_was_on || self.is_monitored) && !self.pins.machine_on()
    }

    /// Brings the tool offset nearer to the one requested. Shows the one that belongs to the pose
    /// and joints of this cycle: LinuxCNC's request changes after forward and inverse.
    // A frame of its own: a cycle that freezes a geometry needs none of it.
    #[inline(never)]
    pub(super) fn advance_tool(&mut self, commanded: Option<Pose>, seconds: f64) {
        let of_this_cycle = self.tool.offset();
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
        let request = self.pins.tool(given.spindle_offset);
        if self.tool.is_at(&request) {
            return Ok(());
        }
        let carrying = &mut self.carrying;
        if let Some(pose) = &commanded {
            carrying.see_shift(pose, &self.tool.offset());
        }
        let (limits, solver) = (self.pins.limits(&self.load), self.pins.solver());
        let has_moved = (!carrying.chain.is_empty()).then_some(carrying.has_moved);
        let shift = &carrying.shift;
        self.tool.advance(&Cycle {
            machine,
            limits,
            solver,
            request,
            commanded,
            has_moved,
            shift,
            seconds,
        })
    }

    /// Takes a tool offset. The joints stay, so that the poses move.
    fn retool(&mut self, tool: Vector3<f64>) {
        if tool == self.tool.offset() {
            return;
        }
        let before = self.tool.of_machine();
        self.tool.take(tool);
        self.seeds.change_tool(&(self.tool.of_machine() - before));
    }

    /// Takes the tool offset that forward has to use.
    #[inline(always)]
    pub(super) fn retool_for_forward(&mut self) -> Result<(), Fault> {
        let request = self.pins.tool(self.frozen()?.given.spindle_offset);
        if self.tool.has(&request) {
            return Ok(());
        }
        self.retool_if_asked(request)
    }

    #[inline(never)]
    fn retool_if_asked(&mut self, request: Vector3<f64>) -> Result<(), Fault> {
        let usable = self.frozen()?.machine.check_tool(&request).is_ok();
        let of_command = self.calls.is_for_commanded_joints();
        if self.is_monitored && of_command && usable {
            self.retool(request);
        } else if let Ok(tool) = self.tool_in_effect() {
            // A refused tool change must not stop the display: the old offset stays in effect.
            self.retool(tool);
        }
        Ok(())
    }
}
