// SPDX-License-Identifier: GPL-2.0-or-later
//! Pictures and pages.

pub mod plots;
pub mod report;
pub mod study_plots;
