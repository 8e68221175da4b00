// SPDX-License-Identifier: GPL-2.0-or-later
//! Studies of a machine: the stiffness, errors and workspace of a design.

pub mod body;
pub mod cutting;
pub mod file;
pub mod forcing;
mod law;
pub mod map;
pub mod masses;
pub mod measured;
pub mod number;
pub mod rods;
pub mod sensitivity;
pub mod slice;
pub mod spindle;
pub mod springs;
pub mod stiffness;
pub mod workspace;
