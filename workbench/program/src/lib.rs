// SPDX-License-Identifier: GPL-2.0-or-later
//! What a program asks of a machine, and the verdict whether it fits.
//!
//! - Input: a description of `machine`, a program, and LinuxCNC's run of it from `linuxcnc`: the moves as motion is
//!   asked for them, and a row for every servo cycle.
//! - Output: [`findings`], limits and peaks with their lines; [`verdict`] and its sentences; [`travel`] left;
//!   joint values of [`replay`].
//! - Uses: `machine`, `linuxcnc` and `check`.

pub mod beside;
pub mod both;
pub mod course;
pub mod cycles;
pub mod done;
pub mod findings;
pub mod flight;
mod follow;
pub mod loads;
pub mod motion;
pub mod offset;
pub mod path;
pub mod preflight;
pub mod random_program;
pub mod replay;
pub mod start;
pub mod travel;
pub mod verdict;
pub mod whole;
mod words;
