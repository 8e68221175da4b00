// SPDX-License-Identifier: GPL-2.0-or-later
//! When a geometry is frozen: at `.apply`, or at the first call of a drop-in.

use super::Module;
use super::contradiction::Contradiction;
use super::extra::Carrying;
use super::seeds::{Handed, Seeds};
use crate::calls::Calls;
use crate::crossing::Crossing;
use crate::pins::Given;
use crate::start::Start;
use kinematics::{Cause, ChainGeometry, Fault, Machine, Pose};

/// Number of forward calls per check of all pins of the geometry if no monitor does that: the check takes
/// about as long as forward itself, and only users read its result.
const WATCHED_EVERY: u32 = 16;

/// The geometry in use.
pub(super) struct Frozen {
    pub(super) machine: Machine,
    pub(super) given: Given,
}

/// The checked values of the pins.
struct Offered {
    frozen: Frozen,
    carrying: Carrying,
    boxes: Start,
    hash: u32,
}

impl Module {
    /// Handles the pins that request something, and freezes the geometry if that is needed before a
    /// kinematics call; `drop_in` returns whether the call may do so without `.apply`.
    #[inline(always)]
    pub(super) fn prepared(&mut self, drop_in: impl Fn() -> bool) -> Result<(), Fault> {
        if !self.is_monitored {
            self.watch_reset();
        }
        self.machine_was_on |= self.pins.machine_on();
        self.watch_apply();
        if self.frozen.is_none() && !self.apply_used && drop_in() {
            let result = self.freeze();
            if let Err(fault) = &result {
                self.report_unmonitored(fault);
            }
            return result;
        }
        Ok(())
    }

    /// Handles a rising edge of `.apply`. One of two mechanisms does not: both are frozen
    /// together, see [`crate::control`].
    pub(super) fn watch_apply(&mut self) {
        let apply = self.pins.apply();
        let rising = apply && !self.apply_was;
        if rising && self.is_of_pair {
            return;
        }
        self.apply_was = apply;
        if rising {
            self.take_offered();
        }
    }

    /// Freezes the values of the pins, if the machine is off.
    pub fn take_offered(&mut self) {
        self.note_offered();
        let result =
            if self.pins.machine_on() { Err(Cause::ApplyWhileOn.into()) } else { self.freeze() };
        if let Err(fault) = result {
            self.refuse_offered(&fault);
        }
    }

    /// Marks the rising edge of `.apply` as handled.
    pub fn note_offered(&mut self) {
        (self.apply_was, self.apply_used) = (true, true);
    }

    fn refuse_offered(&mut self, fault: &Fault) {
        self.record(fault);
        self.report_unmonitored(fault);
    }

    /// Returns whether `.apply` has risen and nothing was frozen since.
    pub fn is_offered(&self) -> bool {
        self.pins.apply() && !self.apply_was
    }

    /// Checks whether the geometry of the pins can be frozen, without freezing it. A refusal is recorded.
    pub fn checks_offered(&mut self) -> bool {
        let checked = self.offered().map(|_| ());
        self.pins.geometry_ok.set(checked.is_ok());
        if let Err(fault) = &checked {
            self.refuse_offered(fault);
        }
        checked.is_ok()
    }

    /// Returns the values of the pins, checked.
    fn offered(&self) -> Result<Offered, Fault> {
        let (given, chain) = (self.pins.given(&self.load), self.pins.chain(&self.load));
        let hash = chain.hash(&self.load.extra, given.geometry.hash());
        ChainGeometry::check_holder(chain.holder)?;
        let machine = given.checked()?;
        let carrying = Carrying::freeze(chain, &self.load, machine.size())?;
        let boxes = Start::read(self.pins, &self.load, hash)?;
        Ok(Offered { frozen: Frozen { machine, given }, carrying, boxes, hash })
    }

    /// Freezes the geometry of the pins, or leaves the last good one in force.
    fn freeze(&mut self) -> Result<(), Fault> {
        let offered = self.offered();
        self.pins.geometry_ok.set(offered.is_ok());
        let Offered { frozen: Frozen { machine, given }, carrying, boxes, hash } = offered?;
        self.pins.geometry_hash.set(hash);
        self.pins.show_kinematics_hash(given.hash(&self.load, hash));
        self.pins.geometry_changed.set(false);
        self.start = boxes;
        self.tool.set_bare(carrying.chain.is_bare());
        self.carrying = carrying;
        let tool = self.requested_tool(given.spindle_offset);
        if machine.check_tool(&tool).is_ok() {
            self.tool.take(tool);
        }
        self.guard.forget();
        // The poses commanded before belong to another machine.
        self.calls = Calls::default();
        self.crossing = Crossing::new();
        self.frozen = Some(Frozen { machine, given });
        self.pins.show_tool(&self.tool.offset());
        (self.seeds, self.handed) = (Seeds::new(), Handed::new());
        self.contradiction = Contradiction::NONE;
        self.until_watched = 0;
        self.pins.max_iterations.set(0);
        Ok(())
    }

    pub(super) fn frozen(&self) -> Result<&Frozen, Fault> {
        self.frozen.as_ref().ok_or(Cause::NoGeometry.into())
    }

    /// Updates the pins that otherwise the monitor updates: in one of [`WATCHED_EVERY`] calls of forward, including the
    /// first after a geometry was frozen.
    pub(super) fn watch_seldom(&mut self) {
        if self.until_watched > 0 {
            self.until_watched -= 1;
            return;
        }
        self.until_watched = WATCHED_EVERY - 1;
        self.watch_geometry();
        self.show_assembly();
    }

    /// Shows whether the pins differ from the frozen values.
    pub(super) fn watch_geometry(&self) {
        // NaN on a pin counts as a change: a frozen geometry contains none.
        let changed = self.frozen.as_ref().is_some_and(|frozen| {
            self.pins.given(&self.load) != frozen.given || !self.has_chain_of_pins()
        });
        self.pins.geometry_changed.set(changed);
    }

    pub(super) fn reference(&self) -> Option<Pose> {
        let home = self.frozen.as_ref()?.given.geometry.home?;
        Some(Pose::from_degrees(home))
    }
}
