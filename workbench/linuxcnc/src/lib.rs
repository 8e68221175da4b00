// SPDX-License-Identifier: GPL-2.0-or-later
//! Unmodified LinuxCNC, run without hardware in virtual time: its motion for a program, servo cycle by
//! servo cycle, many times faster than the machine.
//!
//! - Input: a machine's INI file and HAL files, and a program.
//! - Output: the moves that the task commands, a row for every servo cycle, LinuxCNC's messages.
//! - Uses: `machine`.
//!
//! The unmodified `milltask` and the modules of the configuration run in one process. The library of
//! `workbench/linuxcnc/virtual`, installed beside the module, replaces HAL, RTAPI, the clock and the tool
//! changer; the drives and the spindle are those of hal/pkmkins_sim.tcl. A machine that
//! runs on this computer is not affected, and the kernel lets a run write only its own folder (`confined`).
//!
//! [`scratch`] creates the folder of a run; [`process`] starts and ends it; [`stream`] reads its records.

mod confined;
pub mod process;
mod pulse;
pub mod refusal;
pub mod row;
pub mod scratch;
pub mod stream;
pub mod trace;
