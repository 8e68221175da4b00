// SPDX-License-Identifier: GPL-2.0-or-later
//! How a machine vibrates: the platform as a rigid body on the springs and dampers of its legs.
//!
//! Units are N, mm, s, t and radians: a tonne at 1 mm/s² takes 1 N. Sources: paper 004 (Novikov et
//! al. 2011), equations 9 to 14, about the centre of mass; any book on vibrations for the rest.
//!
//! [`model`] takes masses, springs and dampers from a study; [`chart`] are the coordinates of the
//! platform at a pose; [`structure`] has the matrices, [`response`] what follows from them.

pub mod chart;
pub mod mode;
pub mod model;
pub mod response;
pub mod structure;
