// SPDX-License-Identifier: GPL-2.0-or-later
//! Sequences of calls, as LinuxCNC's motion controller makes them, of a machine whose rigid platform
//! follows its joints also where the module is refused, not called, or switched.
//!
//! [`system`] is the machine, [`setups`] the machines, [`judge`] says what each answer has to be, and
//! [`run`] the controller with everything that happens to it.

pub mod judge;
pub mod run;
pub mod setups;
pub mod system;
