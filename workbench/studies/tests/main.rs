// SPDX-License-Identifier: GPL-2.0-or-later
//! All tests of the crate from outside in one program, which is linked once.

mod cut;
mod dynamics;
mod dynamics_motion;
mod rods;
mod sensitivity;
mod stability;
mod stiffness;
mod workspace;
