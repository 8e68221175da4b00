// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs: what LinuxCNC makes of them, and whether they fit a machine.

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
