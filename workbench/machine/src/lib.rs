// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as its files describe it, and what is proved about it: a library of its own, so that proofs and
//! what studies ask of large matrices, which calculate much, are built at a higher level than the rooms above.

pub mod files;
pub mod limits;
pub mod proof;
pub mod read;
pub mod rows;
pub mod scene;
