// SPDX-License-Identifier: GPL-2.0-or-later
//! All external tests of the crate in one program, which is linked once.

mod check;
mod drives;
mod generated;
mod homing;
mod mobility;
