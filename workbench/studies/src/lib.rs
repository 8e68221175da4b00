// SPDX-License-Identifier: GPL-2.0-or-later
//! What a machine can do: its workspace and stiffness (`study`), how it moves under load (`dynamics`), whether it
//! cuts without chatter (`stability`), and what a program leaves on the workpiece (`cut`).

pub mod cut;
pub mod dense;
pub mod dynamics;
pub mod stability;
pub mod study;
