// SPDX-License-Identifier: GPL-2.0-or-later
//! All tests of the crate from outside in one program, which is linked once.

mod check;
mod drives;
mod generated;
mod homing;
mod mobility;
