// SPDX-License-Identifier: GPL-2.0-or-later
//! Pictures and pages: one file per picture, or for a few related ones.
//!
//! - Input: results of the other crates. Output: SVG and PNG pictures, HTML pages.
//! - Uses: `machine`, `program`, `studies` and `paths`.
//!
//! Every picture is drawn on a `sheet`, in the common `style`, with its key next to it. `lines` compares lines in one
//! plot, `strips` stacks plots over time or a path, with the marks of a page (`over`), `contour`
//! draws maps over a plane, and `space` draws bodies; `frames`
//! draws a machine in two views.

mod arrows;
pub mod bars;
pub mod changes;
mod contour;
pub mod course;
pub mod curve;
pub mod cut;
pub mod dynamics;
pub mod ellipsoid;
pub mod frames;
mod key;
mod lines;
mod machine;
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
mod space;
pub mod stability;
pub mod stiffness;
mod strips;
mod style;
mod thin;
mod tool_path;
pub mod workspace;
