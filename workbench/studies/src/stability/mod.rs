// SPDX-License-Identifier: GPL-2.0-or-later
//! Stability in the cut.
//!
//! `lag`, `count`, `partition`, `two` and `response` treat masses on springs under a lagging force
//! (paper 002); `process` and the modules that use it treat cutting of the surface that the previous tooth left.

/// Closing statement of every result: its quality.
pub const WORTH: &str = "Damping and cutting coefficients come from the study: limits are roughly \
                     proportional to damping\nand inverse to the coefficients, so the results are as good \
                     as they are.";

pub mod bands;
pub mod chip;
pub mod count;
pub mod floquet;
mod grid;
pub mod lag;
pub mod lobes;
pub mod map;
pub mod partition;
pub mod path;
pub mod pose;
pub mod process;
pub mod response;
mod root;
pub mod semi;
pub mod spindle;
pub mod system;
mod two;
