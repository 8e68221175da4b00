// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC itself, run without hardware in virtual time.

pub mod row;
