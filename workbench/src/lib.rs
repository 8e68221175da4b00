// SPDX-License-Identifier: GPL-2.0-or-later
//! Host side of pkmkins: the machine as its INI file describes it, programs replayed
//! through the kinematics, and studies. Pictures of all of it are drawn by `draw`.

pub mod calibrate;
pub mod check;
pub mod control;
pub mod curve;
pub mod cut;
pub mod dynamics;
pub mod new;
pub mod panel;
pub mod program;
pub mod rows;
pub mod scene;
pub mod stability;
pub mod study;
pub mod view;

pub use machine::{dense, files, limits, proof, read};
