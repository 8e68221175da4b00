// SPDX-License-Identifier: GPL-2.0-or-later
//! Stability in the cut.
//!
//! `lag`, `partition`, `two` and `response` treat masses on springs under a force that lags behind
//! (paper 002); `process` and what follows it, cutting that meets the surface of the tooth before.

/// What every answer ends with: how good it is.
pub const WORTH: &str = "Damping and cutting coefficients are those of the study: the limits are about \
                     proportional to damping\nand inverse to the coefficients, and the answer is as \
                     good as they are.";

pub mod bands;
pub mod chip;
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
