// SPDX-License-Identifier: GPL-2.0-or-later
//! All tests of the crate from outside in one program, which is linked once.

mod migrate;
mod panel;
mod questions;
