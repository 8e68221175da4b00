// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as its files describe it, its limits, and proofs about it.
//!
//! - Input: the machine's INI file and the files that it names.
//! - Output: [`read`], the checked description with the core's frozen geometry, or an error with excerpt, column
//!   and a fix; [`limits`], every limit at a pose; [`passive`], the
//!   parts that constraints are drawn as; [`proof`], limits over moves and cells of poses; [`rows`],
//!   the machine's Jacobian rows over its coordinates; [`scene`], the machine as JSON; [`mod@space`], the space that it
//!   occupies; [`files`], atomic writes; [`digits`], numbers without rounding errors.
//! - Uses: the core and the table of keys. All other crates of the workbench depend on this one.

pub mod digits;
pub mod files;
pub mod limits;
pub mod passive;
pub mod proof;
pub mod read;
pub mod rows;
pub mod scene;
pub mod space;
