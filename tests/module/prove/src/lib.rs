// SPDX-License-Identifier: GPL-2.0-or-later
//! Proofs about the built `pkmkins.so`, based only on the file.
//!
//! [`built`] reads the file, [`walk`] follows every path through a function, [`graph`]
//! follows the calls of an entry point, [`contract`] has the guarantees, and
//! [`checks`] compares the two. The file must have its symbols, as `make module`
//! leaves it.
//!
//! In addition the module is run: [`cases`] are expensive calls found by search, and
//! [`callgrind`] counts their instructions.

pub mod built;
pub mod callgrind;
pub mod cases;
pub mod checks;
pub mod contract;
pub mod graph;
pub mod monitored;
pub mod walk;
