// SPDX-License-Identifier: GPL-2.0-or-later
//! Range in which genhexkins' nut-rotation correction can serve as a reference.
//!
//! genhexkins uses the arcsin of the torsion's sine: it folds at ±90° and has
//! no limit for a strut along a joint axis. Its correction and the
//! continuous one agree only on one side of the fold.

use crate::geometry::{cross, dot, minus, plus, rotation, turned, unit};
use crate::machines::Hexapod;
use crate::module::Pose;

/// A strut's torsion φ about its axis, as sine and cosine, and its distance from
/// the directions of the joint axes (smaller of the two sin²).
#[derive(Clone, Copy, Debug)]
pub struct Torsion {
    /// sin φ, the argument of genhexkins' arcsin.
    pub sine: f64,
    /// cos φ: its sign is the side of the fold.
    pub cosine: f64,
    /// Smaller of 1 − (A1·n)² and 1 − (B·n)².
    pub clearance: f64,
}

/// Returns the torsion of strut `leg` at a pose.
pub fn torsion(machine: &Hexapod, pose: &Pose, leg: usize) -> Torsion {
    let r = rotation(pose);
    let o = [0.0, 0.0, machine.spindle_offset + machine.tool_offset];
    // P = t − o + R o: the platform's origin, as the tool offsets move it.
    let origin = plus(minus([pose[0], pose[1], pose[2]], o), turned(&r, o));
    let anchor = plus(origin, turned(&r, machine.platform[leg]));
    let n = unit(minus(anchor, machine.base[leg]));
    let a1 = unit(machine.base_axis[leg]);
    let b = turned(&r, unit(machine.platform_axis[leg]));
    let (alpha, beta) = (dot(a1, n), dot(b, n));
    let (s, c) = (dot(n, cross(a1, b)), dot(a1, b) - alpha * beta);
    let length = s.hypot(c);
    Torsion {
        sine: s / length,
        cosine: c / length,
        clearance: (1.0 - alpha * alpha).min(1.0 - beta * beta),
    }
}
