// SPDX-License-Identifier: GPL-2.0-or-later
//! How a machine vibrates: the platform as a rigid body on the springs and dampers of its legs.
//!
//! Units are N, mm, s, t and radians: a tonne at 1 mm/s² takes 1 N. Sources: paper 004 (Novikov et
//! al. 2011), equations 9 to 14, about the center of mass; any book on vibrations for the rest.
//!
//! [`model`] reads masses, springs and dampers from a study; [`chart`] are the coordinates of the
//! platform at a pose; [`structure`] has the matrices, [`shapes`] their modes, [`response`]
//! poles and receptance. [`noise`] and
//! [`milling`] are forces, that of a [`layer`] depends on the motion; [`linear`] is the linear theory of noise, [`simulation`] the response in time to
//! any force and to the [`drives`] of a program, on [`rotation`]s; a [`run`] combines
//! these, and a [`record`] contains the results.
//! Legs with mass are [`strut`]s; constraints of the platform have [`reactions`]. [`loads`] are the forces of the drives, and [`capacity`] their limits.

pub mod capacity;
pub mod chart;
pub mod drives;
pub mod layer;
pub mod linear;
pub mod loads;
pub mod milling;
pub mod mode;
pub mod model;
pub mod noise;
pub mod reactions;
pub mod record;
pub mod response;
pub mod rotation;
pub mod run;
pub mod shapes;
pub mod simulation;
pub mod structure;
pub mod strut;
