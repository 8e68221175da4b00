// SPDX-License-Identifier: GPL-2.0-or-later
//! Sequences of calls, as LinuxCNC's motion controller makes them, for a machine whose rigid platform
//! follows its joints even if the module refuses, is not called, or is switched.
//!
//! [`system`] is the machine, [`setups`] the machines, [`judge`] has the requirements on each result, and
//! [`run`] the controller with all its events.

pub mod judge;
pub mod run;
pub mod setups;
pub mod system;
