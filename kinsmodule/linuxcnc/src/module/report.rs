// SPDX-License-Identifier: GPL-2.0-or-later
//! Reports to the operator: each fault once, until no fault has occurred for some time.

use super::Module;
use crate::hal::print_error;
use kinematics::{Cause, Fault, MachinePart, text};

/// Cycles without a fault after which the same fault is reported again.
const QUIET_CYCLES: u32 = 1000;

/// Largest number of different faults reported before a quiet period.
const MOST_REPORTED: usize = 4;

/// Faults to report, and those already reported.
pub(super) struct Reports {
    /// The last fault, until the monitor reports it.
    pending: Option<Fault>,
    /// Faults reported since the last quiet period; when it is full, nothing more is reported until then.
    reported: [Option<(Cause, Option<MachinePart>)>; MOST_REPORTED],
    /// Cycles since the last fault.
    quiet: u32,
    is_of_second: bool,
}

impl Reports {
    pub(super) const fn new(is_of_second: bool) -> Self {
        Self { pending: None, reported: [None; MOST_REPORTED], quiet: 0, is_of_second }
    }

    /// Passes a fault to the monitor.
    pub(super) fn add(&mut self, fault: Fault) {
        self.pending = Some(fault);
    }

    /// Allows all faults to be reported again.
    fn allow_repeats(&mut self) {
        self.reported = [None; MOST_REPORTED];
    }

    /// Reports a pending fault, once a cycle of the monitor.
    pub(super) fn report_pending(&mut self) {
        if let Some(fault) = self.pending.take() {
            self.quiet = 0;
            self.report(&fault);
            return;
        }
        self.quiet = self.quiet.saturating_add(1);
        if self.quiet >= QUIET_CYCLES {
            self.allow_repeats();
        }
    }

    /// Reports a fault unless it was reported already, or too many others were.
    fn report(&mut self, fault: &Fault) {
        let key = Some((fault.cause, fault.part));
        if self.reported.contains(&key) {
            return;
        }
        if let Some(free) = self.reported.iter_mut().find(|place| place.is_none()) {
            *free = key;
            let mut message = text!["pkmkins: "];
            // The number of a leg or joint already identifies its mechanism.
            if self.is_of_second && fault.part.is_none() {
                message.push("second mechanism: ");
            }
            fault.write_message(&mut message);
            print_error(&message);
        }
    }
}

impl Module {
    /// Records the fault of a refused call.
    pub(super) fn recorded<T>(&mut self, result: Result<T, Fault>) -> Result<T, Fault> {
        if let Err(fault) = &result {
            self.record(fault);
        }
        result
    }

    /// Shows a fault on the pins, and leaves the report to the monitor.
    // If it is inlined into inverse, `cargo xtask prove` cannot follow its jump table.
    #[inline(never)]
    pub fn record(&mut self, fault: &Fault) {
        let fault = self.place.counted(fault);
        self.pins.show_fault(&fault);
        self.reports.add(fault);
    }

    /// Handles a rising edge of `.fault-reset`.
    ///
    /// The operator confirms the pose found with it. If the last call has found none, a later pose is
    /// still in doubt. In world mode the pose that LinuxCNC commands is not the one found, and LinuxCNC would continue
    /// from it, so the doubt stays until the machine is off or in joint mode.
    pub(super) fn watch_reset(&mut self) {
        let reset = self.pins.fault_reset();
        if reset && !self.reset_was {
            self.pins.clear_fault();
            if self.has_found && !self.calls.has_commanded() {
                self.crossing.end_doubt();
            }
            self.reports.allow_repeats();
        }
        self.reset_was = reset;
    }

    /// Reports a refused geometry or kinematics type at once if no monitor runs: nothing else
    /// would report it, and it does not happen during motion.
    pub(super) fn report_unmonitored(&mut self, fault: &Fault) {
        if !self.is_monitored {
            self.reports.report(&self.place.counted(fault));
        }
    }
}
