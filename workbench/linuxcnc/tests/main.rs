// SPDX-License-Identifier: GPL-2.0-or-later
//! All integration tests of the crate in one program, which is linked once.

mod control;
mod layout;
mod rows;
