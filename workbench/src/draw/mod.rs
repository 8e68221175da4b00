// SPDX-License-Identifier: GPL-2.0-or-later
//! Pictures and pages.

pub mod page;
pub mod plots;
pub mod sample;
pub mod study_plots;
