// SPDX-License-Identifier: GPL-2.0-or-later
//! External tests of the built `pkmkins.so`: loaded as LinuxCNC loads it, with a
//! stub HAL, next to LinuxCNC's own modules in the same process.
//!
//! [`module::Module`] is one loaded module with its pins; [`machines`] has hexapods,
//! [`parallel`] any machine, [`subjects`] one of each kind with its workspace; [`carrying`] adds axes that
//! carry something, [`pair`] a second mechanism, and a [`control`] is any of these from LinuxCNC's view;
//! [`controller`] makes the calls of LinuxCNC's motion controller; [`random`] has repeatable random numbers;
//! [`nut`] checks where genhexkins' arcsin is usable as a reference; [`tracker`] the required result of forward;
//! [`outside`] calls the module outside real time; [`limit`] the time of the arithmetic alone; [`guarded`] sets every limit; [`tolerances`] every
//! number that a test compares with.

pub mod carrying;
pub mod control;
pub mod controller;
pub mod geometry;
pub mod guarded;
pub mod limit;
pub mod machines;
pub mod module;
pub mod nut;
pub mod outside;
pub mod pair;
pub mod parallel;
pub mod random;
pub mod sequence;
pub mod sequences;
pub mod stub;
pub mod subjects;
pub mod tolerances;
pub mod tracker;
pub mod truth;
