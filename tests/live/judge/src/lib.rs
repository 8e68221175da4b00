// SPDX-License-Identifier: GPL-2.0-or-later
//! Checks the recording of a running LinuxCNC: every servo cycle against the host library and
//! the limits of the machine.

pub mod page;
pub mod trace;
