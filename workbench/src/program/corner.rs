// SPDX-License-Identifier: GPL-2.0-or-later
//! Corners between two moves: an arc that rounds them, or two moves that overlap.

use crate::program::segment::{ALONG_CIRCLES, End, Segment, Shape, between, join, norm};
use kinematics::Vector3;
use std::f64::consts::{FRAC_PI_2, PI};

pub(super) struct Rounding {
    pub(super) segment: Segment,
    /// The line before has become a part of it.
    pub(super) consumes: bool,
}

impl Rounding {
    /// Shortens the lines by what the arc takes.
    pub(super) fn cut(self, before: &mut Segment, next: &mut Segment) -> Self {
        if !self.consumes {
            before.places[1] = self.segment.places[0];
            measure(before);
            join(before, next, End::Tangent);
        }
        next.places[0] = self.segment.places[1];
        measure(next);
        next.overlaps_before = false;
        self
    }
}

/// Length of a line that has been cut.
fn measure(line: &mut Segment) {
    line.target = norm(&between(&line.places[0], &line.places[1])[..3]);
}

pub(super) fn rounding_arc(
    before: &Segment,
    next: &Segment,
    radius: f64,
    cut: f64,
    theta: f64,
    consumed: Option<f64>,
) -> Segment {
    let corner = Vector3::new(next.places[0][0], next.places[0][1], next.places[0][2]);
    let place = |xyz: Vector3<f64>| -> [f64; 6] {
        std::array::from_fn(|k| if k < 3 { xyz[k] } else { next.places[0][k] })
    };
    let line = consumed.unwrap_or(0.0);
    let begin = corner - before.finish * cut;
    let across = (next.start - before.finish * before.finish.dot(&next.start)).normalize();
    let target = radius * (PI - 2.0 * theta) + line;
    Segment {
        shape: Shape::Rounding { line, begin, along: before.finish, across, radius },
        places: vec![place(begin), place(corner + next.start * cut)],
        target,
        nominal: target,
        tangential: ALONG_CIRCLES,
        end: End::Tangent,
        overlaps_before: false,
        kink_speed: None,
        kink: 0.0,
        kink_before: 0.0,
        finalized: false,
        at_peak: false,
        progress: consumed.map_or(0.0, |_| before.progress),
        speed: consumed.map_or(0.0, |_| before.speed),
        active: false,
        finish: next.start,
        final_speed: 0.0,
        ..before.clone()
    }
}

/// Half the angle between two moves: a quarter turn where they go straight on.
pub(super) fn half_angle(before: &Vector3<f64>, next: &Vector3<f64>) -> f64 {
    (-before.dot(next)).clamp(-1.0, 1.0).acos() / 2.0
}

/// Speeds at which two moves begin to overlap.
pub(super) fn overlap_speeds(before: &Segment, next: &Segment) -> (f64, f64) {
    let pair = [before, next];
    let accelerations = pair.map(Segment::tangential_acceleration);
    let reached = pair.map(|segment| segment.triangle_speed().min(segment.target_speed()));
    let longest = (before.target / reached[0]).min(next.target / reached[1]);
    let wanted = (reached[0] / accelerations[0]).max(reached[1] / accelerations[1]);
    let seconds = longest.min(wanted);
    let mut speeds = [0, 1].map(|k| reached[k].min(seconds * accelerations[k]));
    let cosine = half_angle(&before.pulls().1, &next.pulls().0).cos();
    // LinuxCNC's bound against division by nearly nothing: a thousandth of a radian.
    if before.tolerance > 0.0 && cosine > (FRAC_PI_2 - 1e-3).cos() {
        let allowed = 2.0 * (accelerations[0] * before.tolerance / cosine).sqrt();
        speeds = speeds.map(|speed| speed.min(allowed));
    }
    (speeds[0], speeds[1])
}

/// Speed in the triangle that the largest velocities of two lines span: its height.
pub(super) fn altitude(before: &Segment, next: &Segment, turn: f64) -> f64 {
    let clipped = turn.min(PI * 0.49).cos();
    let first = before.most.min(next.most / clipped);
    let second = next.most.min(before.most / clipped);
    let base = (next.start * second - before.finish * first).norm();
    first * second * turn.sin() / base
}
