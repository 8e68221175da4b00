// SPDX-License-Identifier: GPL-2.0-or-later
//! Paths given as curves: one-parametric families (paper 000), laws of height, tilt and speed, and
//! free-form curves.

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
pub mod svg;
pub mod table;
pub mod trace;
pub mod turning;
pub mod whole;
