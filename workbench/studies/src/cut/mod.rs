// SPDX-License-Identifier: GPL-2.0-or-later
//! What a program asks of a machine while it cuts: chip, forces, drives, deflection, stability.
//!
//! [`program`] says which lines cut, with which feed and spindle speed; [`teeth`] is the force of the
//! cutter over a tooth's turn. A [`pass`] takes LinuxCNC's servo cycles and chooses the [`moment`]s
//! that are judged; [`place`]s along the program have what takes longer. A [`report`] is all of it, and [`judge`] the way
//! from a program's moves to its report.

pub mod judge;
pub mod moment;
pub mod pass;
pub mod place;
pub mod program;
pub mod report;
pub mod teeth;
mod words;
