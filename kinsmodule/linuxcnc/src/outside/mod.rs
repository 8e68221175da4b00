// SPDX-License-Identifier: GPL-2.0-or-later
//! The kinematics outside real time, as the draft of LinuxCNC's pull request 4374 calls them: functions of a parameter
//! block, in a process that opens the module without starting it. Nothing here runs in the servo thread.
//!
//! | file | contents |
//! | --- | --- |
//! | [`interface`] | the draft's structures, and the functions that it calls |
//! | [`description`] | the one description that a copy of the module has |
//! | [`table`] | the table of parameters: the pins from which the kinematics are computed |
//! | [`block`] | the kinematics of a parameter block |
//!
//! The draft passes `coordinates` and `sparm` alone, so the other load parameters may stand in `sparm`. Its values are
//! those of the pins now, while the module computes with frozen ones: `kinematics-hash` must be the hash of the block,
//! or every call refuses. So a block with other load parameters, with pins changed since, or before a geometry is
//! frozen is never taken for the machine.

mod block;
mod description;
mod interface;
mod table;

pub use table::{Table, TableValue};
