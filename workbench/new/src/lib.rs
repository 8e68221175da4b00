// SPDX-License-Identifier: GPL-2.0-or-later
//! A complete LinuxCNC configuration from what a builder knows of a machine.
//!
//! - Input: a kind of machine and its values. Output: a folder that LinuxCNC starts from.
//! - Uses: `machine` and `check`.
//!
//! [`kinds`] is the table of machines, [`parameters`] that of what is asked of them; [`values`] holds what was
//! given, and [`questions`] asks for it. [`anchors`] makes legs of radii, [`table`] reads them from a file. [`ini`]
//! writes a machine's file, which is read back as any other: [`home`] and [`limits`] ask the kinematics of
//! what was read. [`make`](mod@make) puts all of it into a folder. [`migrate`] makes the same of an older configuration: its values
//! ([`carried`]) take the place of those that are chosen here.

pub mod anchors;
pub mod carried;
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
