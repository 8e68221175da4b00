// SPDX-License-Identifier: GPL-2.0-or-later
//! All integration tests of the crate in one binary, which is linked once.

mod calibrate;
mod constrained;
mod scale;
mod shop;
mod two_runs;
