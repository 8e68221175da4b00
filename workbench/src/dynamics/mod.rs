// SPDX-License-Identifier: GPL-2.0-or-later
//! Vibration of the machine.

pub mod mode;
