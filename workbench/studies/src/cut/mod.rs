// SPDX-License-Identifier: GPL-2.0-or-later
//! Demands of a program on a machine while it cuts: chip, forces, drives, deflection, stability.
//!
//! [`program`] determines which lines cut, with which feed and spindle speed; [`teeth`] is the force of the
//! cutter over one tooth pitch. A [`pass`] processes LinuxCNC's servo cycles and chooses the [`moment`]s
//! to assess, with tool and work in their [`stance`]; expensive quantities are computed at [`place`]s along the program. The [`course`] follows them over time.
//! A [`report`] contains all results, and [`judge`] leads from a program's moves to its report.

pub mod course;
pub mod judge;
pub mod moment;
pub mod pass;
pub mod place;
pub mod program;
pub mod rapids;
pub mod report;
pub mod stance;
pub mod teeth;
pub mod words;
