// SPDX-License-Identifier: GPL-2.0-or-later
//! All external tests of the crate in one program, which is linked once.

mod boxes;
mod cell;
mod configs;
mod generated;
mod golden;
mod ini_cases;
mod inivar;
mod lathe_loops;
mod passive;
mod pins;
mod wrist;
