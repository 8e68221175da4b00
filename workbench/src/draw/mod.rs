// SPDX-License-Identifier: GPL-2.0-or-later
//! Pictures and pages: one file a picture, or a few that belong together.
//!
//! Every picture is drawn on a `sheet`; `lines` go over time or over a path, with limits and marks
//! where they stand on a page (`over`), `contour` lines over a plane.

mod contour;
pub mod course;
pub mod curve;
pub mod cut;
pub mod dynamics;
pub mod ellipsoid;
mod lines;
mod machine_path;
pub mod margins;
pub mod motion;
pub mod over;
pub mod page;
mod partition;
pub mod plot;
pub mod rods;
pub mod sample;
pub mod sensitivity;
mod sheet;
mod slice;
pub mod stability;
pub mod stiffness;
mod tool_path;
pub mod workspace;
