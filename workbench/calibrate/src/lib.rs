// SPDX-License-Identifier: GPL-2.0-or-later
//! Calibration: the geometry that explains what a machine measured of itself.
//!
//! - Input: a description of `machine`, and readings of gauges, touches of a plate or logs.
//! - Output: the geometry with bounds, a new INI file, and programs that take readings.
//! - Uses: `machine`.
//!
//! The joints of every reading are known, the tip's true place is what the machine's true
//! geometry H makes of them. H is sought so that the readings come true: damped least squares on
//! the readings, in units of their noise, beside the drawing's values in units of its tolerance.
//!
//! At fixed joints q = f(X, H) a change of geometry moves the pose by dX = −(∂f/∂X)⁻¹ ∂f/∂H dH; for
//! a strut ∂f/∂H is (−n, n R, −1) over base anchor, platform anchor and offset, so that *nominal
//! minus read* is what is added to H (paper 004, Novikov et al. 2011, equations 3 to 6, prints the
//! opposite sign, and an inverse that does not exist: see [`observe`]).
//!
//! Files: [`model`] what may change, [`reading`] what was measured, [`fit`] least squares and what
//! is not believed, [`observe`] what the data does not tell, [`at_tool`] how sure the tip is,
//! [`plan`] where to measure next, [`plate`], [`log`], `points` and `table` what is read,
//! [`rewrite`] the new INI file; [`gauge`] what people read, [`sheet`] the table that they type it into,
//! [`slips`] what goes wrong with that, [`setup`] and [`propose`] where it is read, [`program`] the program
//! that goes there, [`probing`] the one that probes a plate, [`shape`] how true the motion is.

pub mod at_tool;
pub mod fit;
pub mod gauge;
mod heading;
mod least_squares;
pub mod log;
pub mod model;
pub mod observe;
pub mod plan;
pub mod plate;
mod points;
pub mod probing;
pub mod program;
pub mod propose;
pub mod reading;
pub mod rewrite;
pub mod setup;
pub mod shape;
pub mod sheet;
pub mod slips;
pub mod study;
mod table;
