// SPDX-License-Identifier: GPL-2.0-or-later
//! Distance between two mechanisms on one base.
//!
//! A mechanism is represented by the center lines of its legs and by the lines between every two
//! platform anchors, which include the edges and diagonals of the anchors' polygon. Parts that
//! protrude beyond the anchors, such as a tool or a turret, are not included.

use crate::at::At;
use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, both, difference, dot, pair, wide};
use crate::layout::MAX_LEGS;
use crate::segment::Segment;
use nalgebra::Vector3;

/// A part of a mechanism that could collide with the other mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// A leg, counted from 0 in its mechanism.
    Leg(usize),
    /// The platform.
    Platform,
}

/// The nearest parts of two mechanisms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Distance of their center lines, machine units.
    pub distance: f64,
    /// The part of the first and of the second mechanism.
    pub bodies: [Body; 2],
}

/// Largest number of lines of a mechanism.
const LINES: usize = MAX_LEGS * (MAX_LEGS + 1) / 2;

struct Lines {
    each: [(Body, Segment); LINES],
    count: usize,
    /// Twice their midpoints, and their lengths.
    middle: Lanes3<LINES>,
    length: [f64; LINES],
}

impl Lines {
    fn of(at: &At<'_>) -> Self {
        let nothing = Segment { base: Vector3::zeros(), platform: Vector3::zeros() };
        let each = [(Body::Platform, nothing); LINES];
        let mut lines = Self { each, count: 0, middle: Lanes3::ZERO, length: [0.0; LINES] };
        each_body(at, |body, line| {
            let i = lines.count.min(LINES - 1);
            lines.each[i] = (body, *line);
            lines.middle.set(i, line.base + line.platform);
            lines.length[i] = line.span().norm();
            lines.count += 1;
        });
        lines
    }
}

impl Gap {
    /// Computes the gap between two mechanisms, each at a pose.
    pub fn between(one: &At<'_>, other: &At<'_>) -> Self {
        Self::within(one, other, f64::INFINITY)
    }

    /// Like [`Gap::between`] if the gap is less than `most`; otherwise returns `most` sooner.
    pub fn within(one: &At<'_>, other: &At<'_>, most: f64) -> Self {
        let mut least = Self { distance: most, bodies: [Body::Platform; 2] };
        let theirs = Lines::of(other);
        each_body(one, |body, mine| {
            let (middle, length) = (wide(&(mine.base + mine.platform)), both(mine.span().norm()));
            for i in (0..LINES).step_by(2).take_while(|i| *i < theirs.count) {
                // Twice the distance of the midpoints, less the half lengths.
                let way = difference(&middle, &theirs.middle.pair(i));
                let reach = length + pair(&theirs.length, i) + both(2.0 * least.distance);
                let are_beyond = dot(&way, &way).simd_gt(reach * reach);
                if are_beyond.all() {
                    continue;
                }
                let two = theirs.each.iter().take(theirs.count).skip(i).take(2);
                for (of_other, line) in two {
                    let distance = mine.distance(line);
                    if !(distance >= least.distance) {
                        least = Self { distance, bodies: [body, *of_other] };
                    }
                }
            }
        });
        least
    }

    /// Returns the fault of a gap that is too small, with leg numbers as the module counts them: those of
    /// the second mechanism start at `first_leg`.
    pub fn fault(&self, first_leg: usize) -> Fault {
        let (cause, value) = (Cause::MechanismsNear, self.distance);
        match self.bodies {
            [Body::Leg(i), Body::Leg(j)] => Fault::of_legs(cause, [i, first_leg + j], value),
            [Body::Leg(i), Body::Platform] => Fault::of_leg(cause, i, value),
            [Body::Platform, Body::Leg(j)] => Fault::of_leg(cause, first_leg + j, value),
            [Body::Platform, Body::Platform] => Fault::with_value(cause, value),
        }
    }
}

/// Visits the lines of a mechanism.
fn each_body(at: &At<'_>, mut see: impl FnMut(Body, &Segment)) {
    let legs = at.segments().get(..at.layout().legs()).unwrap_or_default();
    for (i, leg) in legs.iter().enumerate() {
        see(Body::Leg(i), leg);
        for later in legs.iter().skip(i + 1) {
            let edge = Segment { base: leg.platform, platform: later.platform };
            see(Body::Platform, &edge);
        }
    }
}
