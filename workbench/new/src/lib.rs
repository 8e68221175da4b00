// SPDX-License-Identifier: GPL-2.0-or-later
//! Creates a complete LinuxCNC configuration from an integrator's data of a machine.
//!
//! - Input: a kind of machine and its values. Output: a folder that LinuxCNC starts from.
//! - Uses: `machine` and `check`.
//!
//! [`kinds`] is the table of machines, [`parameters`] that of their values; [`values`] has the given
//! values, and [`questions`] asks for them. [`anchors`] computes legs from radii, [`table`] reads them from a file,
//! [`constraints`] has their passive joints, `wrist` axes that carry the tool.
//! [`ini`] writes a machine's file, which is read back like any other: [`home`] and [`limits`] apply the kinematics to
//! the machine read. [`make`](mod@make) puts all of it into a folder. [`migrate`] does the same with an older
//! configuration, whose values ([`carried`]) replace those that are chosen here.

pub mod anchors;
pub mod carried;
pub mod constraints;
pub mod home;
pub mod ini;
pub mod kinds;
pub mod limits;
pub mod make;
pub mod migrate;
pub mod panel;
pub mod parameters;
pub mod program;
pub mod questions;
pub mod table;
pub mod values;
mod wrist;
