// SPDX-License-Identifier: GPL-2.0-or-later
//! Proofs about pose boxes that hold for every pose in them.

pub mod axis_box;
pub mod between;
mod bounds;
pub mod boxes;
pub mod carried;
pub mod cell;
pub mod choose;
pub mod conditioning;
mod dependent;
pub mod interval;
pub mod jet;
pub mod one_to_one;
pub mod reach;
mod regular;
pub mod spans;
