// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether every pose of a cell is one that the machine can take: proved, not sampled.
//!
//! A cell holds the poses X = C + Δ, |Δ_k| ≤ h_k. On the straight way from C to X in the
//! coordinates X Y Z A B C, run through in unit time, a platform anchor at distance e from the
//! control point has |p'| ≤ V and |p''| ≤ A:
//!
//! ```text
//! V = ‖(h_x, h_y, h_z)‖ + e Ω,   A = e Ω²,   Ω = h_a + h_b + h_c (radians)
//! ```
//!
//! as R = Rz Ry Rx turns by the sum of its three turns at most. From V and A follow bounds of
//! the second derivatives of every joint value and of every cosine of a cone angle, and with
//! Taylor's formula their range over the cell: value in the middle, plus or minus
//! Σ |gradient_k| h_k + bound/2. Gradients and values in the middle are the core's own.
//!
//! The bounds of one leg are in `bounds`, those of the limits in `spans`,
//! and that of how the legs hold the platform in `regular`.

use crate::proof::reach::{Middle, Reach, Stop};
use crate::proof::spans::{Course, Span};
use kinematics::{Fault, Limit, Limits, Part};
use std::ops::ControlFlow;

/// Poses about a middle one, machine units and degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The pose in the middle.
    pub middle: [f64; 6],
    /// Half of the extent along every coordinate.
    pub half: [f64; 6],
}

impl Cell {
    /// From one corner to the opposite one.
    pub fn between(low: &[f64; 6], high: &[f64; 6]) -> Self {
        Self {
            middle: std::array::from_fn(|k| (low[k] + high[k]) / 2.0),
            half: std::array::from_fn(|k| (high[k] - low[k]) / 2.0),
        }
    }

    /// Both halves along one coordinate.
    pub fn halves(&self, k: usize) -> [Self; 2] {
        let mut halves = [*self; 2];
        for (part, sign) in halves.iter_mut().zip([-1.0, 1.0]) {
            part.half[k] /= 2.0;
            part.middle[k] += sign * part.half[k];
        }
        halves
    }
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Every pose of it can be taken.
    Inside,
    /// The pose in its middle cannot.
    Outside(Stop),
    /// Too large to tell; halved along this coordinate it is most likely to tell.
    Open(usize),
}

/// What is proved of a way.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Joint values. Where all second derivatives are finite, every pose has joint values.
    pub joints: Vec<Course>,
    /// All limits that are set, of the pose alone and without its axes.
    pub spans: Vec<Span>,
    /// Whether the legs are proved to hold the platform everywhere.
    pub holds: bool,
}

/// What is not proved of a cell.
struct Unproved {
    /// The coordinate to halve it along.
    along: usize,
    /// Whether all limits are proved but how well the legs hold the platform.
    but_conditioning: bool,
}

impl Reach<'_> {
    /// What is known of a cell.
    pub fn judge(&self, cell: &Cell) -> Verdict {
        let mut at = self.nowhere();
        let middle = match self.middle(&mut at, &cell.middle) {
            Ok(middle) => middle,
            Err(fault) => return Verdict::Outside(Stop::Fault(fault)),
        };
        // What is proved of the cell holds in its middle, too.
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

    /// Whether every pose of a cell is proved to be inside.
    fn holds(&self, cell: &Cell, middle: &Middle) -> Result<(), Unproved> {
        let spread = self.spread((0..6).map(|k| along_one(k, cell.half[k])));
        let along = || greatest(&self.extents(&spread));
        let unproved = || Unproved { along: along(), but_conditioning: false };
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
        let along = greatest(&regularity.shares);
        is_kept.then_some(()).ok_or(Unproved { along, but_conditioning: true })
    }

    /// What the joints and legs do on the straight way from `middle - step` to `middle + step`.
    ///
    /// # Errors
    /// The pose in the middle has no joint values.
    pub fn way(&self, middle: &[f64; 6], step: &[f64; 6]) -> Result<Way, Fault> {
        self.way_within(middle, &[*step])
    }

    /// The same on any way through the poses that are the middle plus a sum of steps, each times a
    /// number from -1 to 1.
    ///
    /// # Errors
    /// The pose in the middle has no joint values.
    pub fn way_within(&self, middle: &[f64; 6], steps: &[[f64; 6]]) -> Result<Way, Fault> {
        let mut at = self.nowhere();
        let middle = self.middle(&mut at, middle)?;
        let spread = self.spread(steps.iter().copied());
        let seconds: Option<Vec<_>> =
            (0..self.config.legs()).map(|i| self.second_derivatives(i, &middle, &spread)).collect();
        let mut spans = vec![];
        let _ = self.spans(&middle, &spread, seconds.as_deref(), f64::INFINITY, |span| {
            spans.push(span);
            ControlFlow::<()>::Continue(())
        });
        let regularity = seconds.as_ref().map(|seconds| self.regularity(&middle, &spread, seconds));
        let holds = regularity.as_ref().is_some_and(|regularity| regularity.is_regular);
        let value = middle.at.smallest_singular_value();
        let least = match regularity {
            Some(regularity) if regularity.is_regular && regularity.share > 0.0 => {
                regularity.share * value
            }
            // Of rows of which nothing is known but that they are there.
            Some(_) => 0.0,
            None => f64::NEG_INFINITY,
        };
        let range = [self.limits.conditioning, f64::INFINITY];
        let ends = [least, f64::INFINITY];
        spans.push(Span::of(Limit::Conditioning, Part::Whole, value, ends, range));
        let joint = |i| self.joint_course(i, &middle, &spread, seconds.as_deref());
        Ok(Way { joints: (0..self.config.joints.len()).map(joint).collect(), spans, holds })
    }
}

/// A step along one coordinate.
fn along_one(k: usize, half: f64) -> [f64; 6] {
    std::array::from_fn(|m| if m == k { half } else { 0.0 })
}

fn greatest(values: &[f64]) -> usize {
    (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0)
}
