// SPDX-License-Identifier: GPL-2.0-or-later
//! Calibration: the geometry that best explains a machine's measurements.
//!
//! - Input: a description of `machine`, and readings of gauges, touches of a plate or logs.
//! - Output: the geometry with bounds, a new INI file, and programs that take readings.
//! - Uses: `machine`.
//!
//! The joints of every reading are known, and the tip's true position follows from them and the machine's true
//! geometry H. The estimate of H is a damped least-squares fit to
//! the readings, in units of their noise, and the drawing's values, in units of its tolerance.
//!
//! At fixed joints q = f(X, H) a change of geometry moves the pose by dX = −(∂f/∂X)⁻¹ ∂f/∂H dH; for
//! a strut ∂f/∂H is (−n, n R, −1) for base anchor, platform anchor and offset, so *nominal
//! minus read* is added to H (paper 004, Novikov et al. 2011, equations 3 to 6, prints the
//! opposite sign, and an inverse that does not exist: see [`observe`]).
//!
//! Modules: [`model`] the parameters, [`reading`] the measurements, [`fit`] least squares and
//! outliers, [`observe`] the changes that the data does not determine, [`at_tool`] the uncertainty of the tip,
//! [`plan`] the next poses to measure, [`plate`], [`log`], `points` and `table` input files,
//! [`rewrite`] the new INI file; [`gauge`] gauges that the operator reads, [`sheet`] the table for the readings,
//! [`mistakes`] and `runs` typing mistakes in it, [`setup`] and [`propose`] the poses to read at, [`program`] the
//! program that moves there, [`probing`] the program that probes a plate, [`shape`] the accuracy of the motion,
//! [`scale`] the scale of the drives.

pub mod at_tool;
pub mod constraint;
pub mod fit;
pub mod gauge;
mod heading;
mod least_squares;
pub mod log;
pub mod mistakes;
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
mod runs;
pub mod scale;
pub mod setup;
pub mod shape;
pub mod sheet;
pub mod study;
mod table;
