// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs along curves: one-parametric families (paper 000), laws of height, tilt and speed, and free-form
//! curves from splines, DXF and SVG drawings.
//!
//! - Input: a file that describes a path, and the machine that follows it.
//! - Output: a program of straight moves with a proved distance from the curve, and the required motion of the joints.
//! - Uses: `machine`, `program` and `studies`.

mod arcs;
pub mod base;
pub mod carriages;
pub mod dxf;
pub mod element;
pub mod ellipse;
pub mod expression;
pub mod file;
pub mod free;
pub mod gcode;
mod grammar;
pub mod implicit;
pub mod job;
pub mod join;
pub mod laws;
pub mod length;
pub mod milling;
pub mod motion;
pub mod operation;
pub mod pen;
pub mod piece;
pub mod pieces;
mod planes;
pub mod route;
pub mod route_error;
pub mod spline;
mod straight;
pub mod svg;
pub mod table;
pub mod trace;
pub mod turning;
pub mod whole;
