// SPDX-License-Identifier: GPL-2.0-or-later
//! Stability in the cut.
//!
//! `lag`, `partition`, `two` and `response` treat masses on springs under a force that lags behind
//! (paper 002).

pub mod chip;
mod grid;
pub mod lag;
pub mod partition;
pub mod response;
mod root;
mod two;
