// SPDX-License-Identifier: GPL-2.0-or-later
//! All integration tests of the crate in one binary, which is linked once.

mod constrained;
mod cut;
mod dynamics;
mod dynamics_motion;
mod rods;
mod sensitivity;
mod stability;
mod stiffness;
mod workspace;
