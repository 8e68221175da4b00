// SPDX-License-Identifier: GPL-2.0-or-later
//! Proof, without sampling, that every pose of a cell is inside the machine's limits.
//!
//! A cell consists of the poses X = C + Δ, |Δ_k| ≤ h_k. On the straight path from C to X in the
//! coordinates X Y Z A B C, traversed in unit time, a platform anchor at distance e from the
//! control point has |p'| ≤ V and |p''| ≤ A:
//!
//! ```text
//! V = ‖(h_x, h_y, h_z)‖ + e Ω,   A = e Ω²,   Ω = h_a + h_b + h_c (radians)
//! ```
//!
//! because R = Rz Ry Rx rotates by at most the sum of its three angles. V and A imply bounds of
//! the second derivatives of every joint value and of every cosine of a cone angle, and
//! Taylor's formula gives their range over the cell: value at the center, plus or minus
//! Σ |gradient_k| h_k + bound/2. Gradients and values at the center are the core's.
//!
//! The bounds of one leg are in `bounds`, those of the limits in `spans`,
//! and those of the conditioning in `regular`.

use crate::proof::reach::{Middle, Reach, Stop};
use crate::proof::spans::{Course, Span};
use kinematics::{Fault, Limit, Limits, Part};
use std::ops::ControlFlow;

/// Poses about a central one, machine units and degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The central pose.
    pub middle: [f64; 6],
    /// Half width along every coordinate.
    pub half: [f64; 6],
}

impl Cell {
    /// Creates a cell from opposite corners.
    pub fn between(low: &[f64; 6], high: &[f64; 6]) -> Self {
        Self {
            middle: std::array::from_fn(|k| (low[k] + high[k]) / 2.0),
            half: std::array::from_fn(|k| (high[k] - low[k]) / 2.0),
        }
    }

    /// Returns both halves along one coordinate.
    pub fn halves(&self, k: usize) -> [Self; 2] {
        let mut halves = [*self; 2];
        for (part, sign) in halves.iter_mut().zip([-1.0, 1.0]) {
            part.half[k] /= 2.0;
            part.middle[k] += sign * part.half[k];
        }
        halves
    }
}

/// Result for a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// All its poses are inside the limits.
    Inside,
    /// Its central pose is outside the limits.
    Outside(Stop),
    /// Too large to decide; halving it along this coordinate helps most.
    Open(usize),
}

/// Proved bounds along a path.
#[derive(Clone, Debug, PartialEq)]
pub struct PathBounds {
    /// Joint values. If all second derivatives are finite, every pose has joint values.
    pub joints: Vec<Course>,
    /// All configured limits of the pose alone except its axes.
    pub spans: Vec<Span>,
    /// Whether the coordinates that constraints determine are proved to follow; true without constraints.
    pub is_determined: bool,
}

/// An unproved cell.
struct Unproved {
    /// The coordinate along which to halve it.
    along: usize,
    /// Whether all limits except the conditioning are proved.
    but_conditioning: bool,
}

impl Reach<'_> {
    /// Judges a cell.
    pub fn judge(&self, cell: &Cell) -> Verdict {
        let mut at = self.nowhere();
        let middle = match self.middle(&mut at, &cell.middle) {
            Ok(middle) => middle,
            Err(fault) => return Verdict::Outside(Stop::Fault(fault)),
        };
        // A proof for the cell includes its center.
        match self.holds(cell, &middle) {
            Ok(()) => Verdict::Inside,
            Err(Unproved { along, but_conditioning }) => {
                let rest = match but_conditioning {
                    true => Limits { conditioning: self.limits.conditioning, ..Limits::NONE },
                    false => self.limits,
                };
                match middle.at.check(&rest) {
                    Ok(()) => Verdict::Open(along),
                    Err(margin) => Verdict::Outside(Stop::Limit(margin)),
                }
            }
        }
    }

    /// Returns whether every pose of a cell is proved to be inside.
    fn holds(&self, cell: &Cell, middle: &Middle) -> Result<(), Unproved> {
        let steps: [[f64; 6]; 6] = std::array::from_fn(|k| along_one(k, cell.half[k]));
        let along = || greatest(&self.extents(&self.spread(steps)));
        let unproved = || Unproved { along: along(), but_conditioning: false };
        let spread = self.spread_within(middle, &steps).ok_or_else(unproved)?;
        let seconds: Option<Vec<_>> =
            (0..self.config.legs()).map(|i| self.second_derivatives(i, middle, &spread)).collect();
        let seconds = seconds.ok_or_else(unproved)?;
        let kept = |span: Span| match span.room() >= 0.0 {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        };
        if self.spans(middle, &spread, Some(&seconds), self.limits.clearance, kept).is_break() {
            return Err(unproved());
        }
        let regularity = self.regularity(middle, &spread, &seconds);
        let least = self.limits.conditioning;
        let is_kept = regularity.is_regular
            && (regularity.share / regularity.inverse >= least
                || regularity.share * middle.at.smallest_singular_value() >= least);
        // Only those along coordinates can be halved.
        let along = greatest(&regularity.shares[..6]);
        is_kept.then_some(()).ok_or(Unproved { along, but_conditioning: true })?;
        let is_connected = self.is_connected(middle, [&cell.middle, &cell.half], &spread);
        is_connected.then_some(()).ok_or_else(unproved)
    }

    /// Bounds joints and limits on the straight path from `middle - step` to `middle + step`.
    ///
    /// # Errors
    /// The central pose has no joint values.
    pub fn path_bounds(&self, middle: &[f64; 6], step: &[f64; 6]) -> Result<PathBounds, Fault> {
        self.bounds_within(middle, Some(&[*step]))
    }

    /// Bounds joints and limits on any path through poses that are the center plus a sum of steps, each multiplied
    /// by a number from -1 to 1; `None` if only the center is known.
    ///
    /// # Errors
    /// The central pose has no joint values.
    pub fn bounds_within(
        &self,
        middle: &[f64; 6],
        steps: Option<&[[f64; 6]]>,
    ) -> Result<PathBounds, Fault> {
        let mut at = self.nowhere();
        let middle = self.middle(&mut at, middle)?;
        let enclosed = steps.and_then(|steps| self.spread_within(&middle, steps));
        let is_determined = enclosed.is_some();
        let steps = steps.unwrap_or_default();
        let spread = enclosed.unwrap_or_else(|| self.spread(steps.iter().copied()));
        let seconds = (0..self.config.legs())
            .map(|i| is_determined.then(|| self.second_derivatives(i, &middle, &spread)).flatten());
        let seconds: Option<Vec<_>> = seconds.collect();
        let mut spans = vec![];
        let _ = self.spans(&middle, &spread, seconds.as_deref(), f64::INFINITY, |span| {
            spans.push(span);
            ControlFlow::<()>::Continue(())
        });
        let regularity = seconds.as_ref().map(|seconds| self.regularity(&middle, &spread, seconds));
        let value = middle.at.smallest_singular_value();
        let least = match regularity {
            Some(regularity) if regularity.is_regular && regularity.share > 0.0 => {
                regularity.share * value
            }
            // Rows that are only known to exist.
            Some(_) => 0.0,
            None => f64::NEG_INFINITY,
        };
        let range = [self.limits.conditioning, f64::INFINITY];
        let ends = [least, f64::INFINITY];
        spans.push(Span::of(Limit::Conditioning, Part::Whole, value, ends, range));
        let joint = |i| {
            let course = self.joint_course(i, &middle, &spread, seconds.as_deref());
            let second_derivative = match is_determined {
                true => course.second_derivative,
                false => f64::INFINITY,
            };
            Course { second_derivative, ..course }
        };
        if !is_determined {
            // The steps are only those of the commanded coordinates.
            spans.iter_mut().for_each(|span| span.ends = [f64::NEG_INFINITY, f64::INFINITY]);
        }
        let joints = (0..self.config.joints.len()).map(joint).collect();
        Ok(PathBounds { joints, spans, is_determined })
    }
}

/// Returns a step along one coordinate.
fn along_one(k: usize, half: f64) -> [f64; 6] {
    std::array::from_fn(|m| if m == k { half } else { 0.0 })
}

fn greatest(values: &[f64]) -> usize {
    (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0)
}
