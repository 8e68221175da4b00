// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC itself, run without hardware in virtual time: what it makes of a program, servo cycle by
//! servo cycle, many times faster than the machine.
//!
//! - Input: a machine's INI file and HAL files, and a program.
//! - Output: the moves that the task asks motion for, a row for every servo cycle, LinuxCNC's messages.
//! - Uses: `machine`.
//!
//! The unmodified `milltask` and the modules of the configuration run in one process. The library of
//! `workbench/linuxcnc/virtual`, installed beside the module, stands in for HAL, RTAPI, the clock and the tool
//! changer; the drives and the spindle are those of hal/pkmkins_sim.tcl. Nothing of the machine that may
//! run on this computer is touched, and the kernel lets a run write its own folder alone (`confined`).
//!
//! [`scratch`] makes the folder of a run; [`process`] starts and ends it; [`stream`] reads what it tells.

mod confined;
pub mod process;
mod pulse;
pub mod refusal;
pub mod row;
pub mod scratch;
pub mod stream;
pub mod trace;
