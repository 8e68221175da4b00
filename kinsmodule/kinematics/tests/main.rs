// SPDX-License-Identifier: GPL-2.0-or-later
//! All integration tests of the core in one program: building it takes half the processor time of a
//! program for each file.

mod ahead;
mod bad_input;
mod boxes;
mod branches;
mod carried;
mod certified;
mod chain;
mod common;
mod constraints;
mod dead_points;
mod forward;
mod held;
mod jacobian;
mod least_squares;
mod legs;
mod limits;
mod nut;
mod properties;
mod side;
mod spheres;
mod tracking;
mod watch;
