// SPDX-License-Identifier: GPL-2.0-or-later
//! All tests of the crate from outside in one program, which is linked once.

mod boxes;
mod cell;
mod configs;
mod generated;
mod golden;
mod ini_cases;
mod inivar;
mod lathe_loops;
mod pins;
