// SPDX-License-Identifier: GPL-2.0-or-later
//! Proofs about the built `pkmkins.so`, made from the file alone.
//!
//! [`built`] reads the file, [`walk`] follows every path through a function, [`graph`]
//! what the functions of an entry point call, [`contract`] is what was promised, and
//! [`checks`] compares the two. The file has to have its symbols, as `cargo xtask module`
//! leaves it.
//!
//! Beside them what running it shows: [`cases`] are calls searched for to be dear, and
//! [`callgrind`] counts their instructions.

pub mod built;
pub mod callgrind;
pub mod cases;
pub mod checks;
pub mod contract;
pub mod graph;
pub mod monitored;
pub mod walk;
