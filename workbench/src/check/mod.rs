// SPDX-License-Identifier: GPL-2.0-or-later
//! What a user should know of a machine before it moves.

pub mod between;
pub mod cautions;
mod drives;
mod homing;
pub mod homing_ways;
pub mod mobility;
pub mod report;
mod wiring;
