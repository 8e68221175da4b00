// SPDX-License-Identifier: GPL-2.0-or-later
//! How near two mechanisms on one base come to each other.
//!
//! A mechanism is the centre lines of its legs, and its platform: the lines between every two of its
//! platform anchors, which hold the edges of the polygon that the anchors span and its diagonals. What
//! stands out beyond the anchors, a tool or a turret, is not seen.

use crate::at::At;
use crate::fault::{Cause, Fault};
use crate::segment::Segment;

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

impl Gap {
    /// Of two mechanisms, each at a pose.
    pub fn between(one: &At<'_>, other: &At<'_>) -> Self {
        let mut least = Self { distance: f64::INFINITY, bodies: [Body::Platform; 2] };
        each_body(one, |body, mine| {
            let (middle, half) = (mine.base + mine.platform, mine.span().norm());
            each_body(other, |of_other, theirs| {
                // Twice the way between the middles, less what the halves reach.
                let way = (middle - theirs.base - theirs.platform).norm_squared();
                let reach = half + theirs.span().norm() + 2.0 * least.distance;
                if way > reach * reach {
                    return;
                }
                let distance = mine.distance(theirs);
                if !(distance >= least.distance) {
                    least = Self { distance, bodies: [body, of_other] };
                }
            });
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
