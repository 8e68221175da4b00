// SPDX-License-Identifier: GPL-2.0-or-later
//! The function in the servo thread beside the kinematics calls.

use super::{Kind, Module};
use crate::guard::{Cycle, Programmed, Shown};
use kinematics::{Fault, Pose};

/// Cycles in which all pins that only users read are updated: sixty times a second at 1 kHz.
const SHOWN_IN: u32 = 16;

impl Module {
    /// Runs one cycle: handles `.apply` and `.fault-reset`, moves the tool offset, guards the motion,
    /// updates the pins for users, and reports faults to the operator.
    pub fn monitor(&mut self, seconds: f64, both: Option<Programmed>) {
        self.is_monitored = true;
        self.start.count_cycle();
        self.watch_apply();
        self.watch_reset();
        let commanded = self.calls.end_cycle();
        self.watch_tool_pins();
        self.advance_tool(commanded, seconds);
        self.advance_correction(seconds);
        self.settle_contradiction(commanded.is_some(), seconds);
        self.turn = if self.turn < SHOWN_IN - 1 { self.turn + 1 } else { 0 };
        if self.turn == 0 {
            self.watch_geometry();
        }
        if let Some(fault) = self.guarded(commanded, seconds, both) {
            self.record(&fault);
        }
        self.pins.feed_inhibit.set(self.inhibits_feed());
        self.reports.report_pending();
    }

    /// Runs a cycle of the guard, `period` seconds long.
    fn guarded(
        &mut self,
        commanded: Option<Pose>,
        period: f64,
        both: Option<Programmed>,
    ) -> Option<Fault> {
        let Some(frozen) = self.frozen.as_ref().filter(|_| self.kind == Kind::Machine) else {
            self.guard.idle(self.pins, period);
            self.show_assembly();
            return None;
        };
        let programmed = (!self.load.extra.is_empty()).then(|| self.programmed(period));
        self.guard.run(&Cycle {
            pins: self.pins,
            place: self.place,
            machine: &frozen.machine,
            tool: &self.tool.of_machine(),
            pose: self.seeds.last(),
            commanded,
            lost: self.lost,
            programmed: programmed.filter(|_| !self.carrying.chain.is_empty()),
            path: both.or(programmed),
            period,
            // Two mechanisms update their poses in different cycles.
            shows: match (self.turn + u32::from(self.place.is_second)) % SHOWN_IN {
                1 => Some(Shown::Joints),
                5 => Some(Shown::Cones),
                9 => Some(Shown::Nearest),
                13 => Some(Shown::Conditioning),
                _ => None,
            },
        })
    }

    /// Returns the motion of the mechanism and the extra axes in this cycle, as LinuxCNC moves them.
    pub fn programmed(&self, period: f64) -> Programmed {
        self.carrying.programmed(period, &self.load.extra)
    }

    /// Returns whether this cycle updates the distance of two mechanisms.
    pub fn shows_distance(&self) -> bool {
        self.turn == SHOWN_IN - 1
    }

    /// Returns whether no motion may begin or continue.
    pub fn inhibits_feed(&self) -> bool {
        self.tool.is_busy() || self.is_settling() || self.guard.inhibits_feed()
    }

    /// Returns whether jogs must end.
    pub fn stops_jogs(&self) -> bool {
        self.guard.stops_jogs()
    }

    pub(super) fn show_assembly(&self) {
        let sign = self.seeds.last().and_then(|pose| {
            let machine = &self.frozen.as_ref()?.machine;
            machine.at(&pose, &self.tool.of_machine()).ok()?.assembly().ok()
        });
        self.pins.assembly.set(sign.unwrap_or(0));
    }
}
