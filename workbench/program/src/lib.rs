// SPDX-License-Identifier: GPL-2.0-or-later
//! What a program requires of a machine, and the verdict whether it fits.
//!
//! - Input: a description of `machine`, a program, and LinuxCNC's run of it from `linuxcnc`: the moves as
//!   commanded to motion, and a row for every servo cycle.
//! - Output: [`report`], limits and peaks with their lines; [`verdict`] and its sentences; remaining [`travel`];
//!   joint values of [`replay`].
//! - Uses: `machine`, `linuxcnc` and `check`.

mod follow_move;
pub mod joint_curves;
pub mod loads;
pub mod machine_check;
pub mod machine_start;
pub mod mechanism_moves;
pub mod motion;
pub mod move_sequence;
pub mod preflight;
pub mod progress;
pub mod random_program;
pub mod replay;
pub mod report;
pub mod servo_cycles;
pub mod timeline;
pub mod travel;
pub mod two_mechanisms;
pub mod verdict;
mod verdict_text;
pub mod work_offset;
