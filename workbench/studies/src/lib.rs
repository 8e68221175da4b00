// SPDX-License-Identifier: GPL-2.0-or-later
//! What a machine can do, computed from its geometry and a study file.
//!
//! - Input: a description of `machine`, a study file with masses, springs and forces, and for [`cut`] a program.
//! - Output: [`study`], workspace, stiffness, sensitivity and rods; [`dynamics`], modes, response and forces of the
//!   drives; [`stability`], the depth of cut at which chatter starts; [`cut`], forces, deflection and vibration
//!   while a program cuts.
//! - Uses: `machine`, `program` and `linuxcnc`.

pub mod cut;
pub mod dense;
pub mod dynamics;
pub mod stability;
pub mod study;
