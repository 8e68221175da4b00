// SPDX-License-Identifier: GPL-2.0-or-later
//! How near two mechanisms on one base come to each other.
//!
//! A mechanism is the centre lines of its legs, and its platform: the lines between every two of its
//! platform anchors, which hold the edges of the polygon that the anchors span and its diagonals. What
//! stands out beyond the anchors, a tool or a turret, is not seen.

use crate::at::At;
use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, both, difference, dot, pair, wide};
use crate::layout::MAX_LEGS;
use crate::segment::Segment;
use nalgebra::Vector3;

/// A part of a mechanism that another mechanism may meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// A leg, counted from 0 in its mechanism.
    Leg(usize),
    /// The platform.
    Platform,
}

/// The parts of two mechanisms that are nearest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Of their centre lines, machine units.
    pub distance: f64,
    /// Of the one and of the other.
    pub bodies: [Body; 2],
}

/// Most lines of a mechanism.
const LINES: usize = MAX_LEGS * (MAX_LEGS + 1) / 2;

struct Lines {
    each: [(Body, Segment); LINES],
    count: usize,
    /// Twice their middles, and their lengths.
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
    /// Of two mechanisms, each at a pose.
    pub fn between(one: &At<'_>, other: &At<'_>) -> Self {
        Self::within(one, other, f64::INFINITY)
    }

    /// The same where it is less than `most`; else `most`, in less time.
    pub fn within(one: &At<'_>, other: &At<'_>, most: f64) -> Self {
        let mut least = Self { distance: most, bodies: [Body::Platform; 2] };
        let theirs = Lines::of(other);
        each_body(one, |body, mine| {
            let (middle, length) = (wide(&(mine.base + mine.platform)), both(mine.span().norm()));
            for i in (0..LINES).step_by(2).take_while(|i| *i < theirs.count) {
                // Twice the way between the middles, less what the halves reach.
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

    /// The fault where they are too near, with the numbers of legs as a module counts them: those of
    /// the other mechanism from `first_leg` on.
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
