// SPDX-License-Identifier: GPL-2.0-or-later
//! A move in the queue: its shape, its ends, and the speeds that hold on it.

use kinematics::Vector3;

/// Moves below this length in all of X Y Z, or A B C, do not move these (LinuxCNC's CART_FUZZ).
pub(super) const FUZZ: f64 = 1e-6;

/// Share of the acceleration that circles leave for changes of speed.
pub(super) const ALONG_CIRCLES: f64 = 0.5;

/// How a segment ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    Stop,
    /// As stop, where the corner is not passed tangentially.
    Exact,
    Tangent,
    /// The next one begins while this one brakes.
    Overlap,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    Line,
    /// With the directions in its plane: tangents at both ends, and to the centre at the start.
    Circle {
        radius: f64,
        /// The radius that bounds the speed: LinuxCNC adds the square of a helix's height over it.
        effective: f64,
        first: Vector3<f64>,
        inward: Vector3<f64>,
        last: Vector3<f64>,
    },
    /// An arc that rounds a corner, behind what it consumes of the line before: where it begins, along the
    /// line and across to the next one.
    Rounding {
        line: f64,
        begin: Vector3<f64>,
        along: Vector3<f64>,
        across: Vector3<f64>,
        radius: f64,
    },
}

/// A motion in the queue.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub(super) number: usize,
    pub(super) tool: [f64; 3],
    pub(super) rapid: bool,
    pub(super) stands: bool,
    pub(super) shape: Shape,
    /// Moves rotary axes.
    pub(super) turns: bool,
    pub(super) places: Vec<[f64; 6]>,
    /// Of an arc: length up to each place.
    pub(super) along: Vec<f64>,
    /// Unit tangents.
    pub(super) start: Vector3<f64>,
    pub(super) finish: Vector3<f64>,
    /// Length: of X Y Z, or of A B C where those stand still.
    pub(super) target: f64,
    /// Length before it was cut by roundings.
    pub(super) nominal: f64,
    pub(super) requested: f64,
    pub(super) most: f64,
    /// `[TRAJ]MAX_LINEAR_VELOCITY`, which bounds motion but not the speeds planned for corners.
    pub(super) limit: f64,
    pub(super) acceleration: f64,
    /// Share of the acceleration for changes of speed.
    pub(super) tangential: f64,
    pub(super) tolerance: f64,
    pub(super) end: End,
    pub(super) overlaps_before: bool,
    pub(super) final_speed: f64,
    pub(super) kink_speed: Option<f64>,
    pub(super) kink: f64,
    pub(super) kink_before: f64,
    pub(super) finalized: bool,
    pub(super) at_peak: bool,
    pub(super) active: bool,
    pub(super) ramps: bool,
    pub(super) progress: f64,
    pub(super) speed: f64,
    pub(super) cycle: f64,
    pub(super) overlap_speed: f64,
    pub(super) overlapping: bool,
    pub(super) brakes_to_end: bool,
    pub(super) splitting: bool,
    pub(super) remove: bool,
    pub(super) split_speed: f64,
}

impl Segment {
    pub(super) fn place(&self) -> [f64; 6] {
        match self.shape {
            Shape::Line => mix(&self.places[0], &self.places[1], self.progress / self.target),
            Shape::Circle { .. } => self.on_circle(),
            Shape::Rounding { line, begin, along, across, radius } => {
                let angle = ((self.progress - line) / radius).max(0.0);
                let way = along * (radius * angle.sin() - (line - self.progress).max(0.0))
                    + across * (radius * (1.0 - angle.cos()));
                let xyz = begin + way;
                std::array::from_fn(|k| if k < 3 { xyz[k] } else { self.places[0][k] })
            }
        }
    }

    /// Between the places of an arc a cubic, so that speeds do not jump there.
    fn on_circle(&self) -> [f64; 6] {
        let last = self.places.len() - 1;
        let at = self.progress / self.target * self.along[last];
        let next = self.along.partition_point(|length| *length < at).clamp(1, last);
        let (from, to) = (self.along[next - 1], self.along[next]);
        let t = if to > from { (at - from) / (to - from) } else { 1.0 };
        if last < 2 {
            return mix(&self.places[0], &self.places[1], t);
        }
        let beyond = |a: usize, b: usize, c: usize| -> [f64; 6] {
            let [a, b, c] = [a, b, c].map(|n| &self.places[n]);
            std::array::from_fn(|k| 3.0 * (a[k] - b[k]) + c[k])
        };
        let before = if next > 1 { self.places[next - 2] } else { beyond(0, 1, 2) };
        let after =
            if next < last { self.places[next + 1] } else { beyond(last, last - 1, last - 2) };
        let (a, b) = (&self.places[next - 1], &self.places[next]);
        std::array::from_fn(|k| {
            let (slope, end) = ((b[k] - before[k]) / 2.0, (after[k] - a[k]) / 2.0);
            let way = b[k] - a[k];
            let (square, cube) = (3.0 * way - 2.0 * slope - end, slope + end - 2.0 * way);
            a[k] + t * (slope + t * (square + t * cube))
        })
    }

    /// Direction of the acceleration at the start and at the end, as blending takes it.
    pub(super) fn pulls(&self) -> (Vector3<f64>, Vector3<f64>) {
        let Shape::Circle { radius, first, inward, last, .. } = self.shape else {
            return (self.start, self.finish);
        };
        let across = (0.5 * self.requested).powi(2) / radius;
        ((first * self.whole_acceleration() + inward * across).normalize(), last)
    }

    pub(super) fn to_go(&self) -> f64 {
        self.target - self.progress
    }

    /// Requested speed as far as it is allowed.
    pub(super) fn target_speed(&self) -> f64 {
        self.planned_speed().min(self.limit)
    }

    pub(super) fn planned_speed(&self) -> f64 {
        self.requested.min(self.most)
    }

    fn whole_acceleration(&self) -> f64 {
        let kept = 1.0 - self.kink.max(self.kink_before);
        let halved = self.overlaps_before || self.end == End::Overlap;
        self.acceleration * kept * if halved { 0.5 } else { 1.0 }
    }

    pub(super) fn tangential_acceleration(&self) -> f64 {
        let share = if self.shape == Shape::Line { 1.0 } else { self.tangential };
        self.whole_acceleration() * share
    }

    /// Peak of a triangle of speed over the segment, which may still lose half of it.
    pub(super) fn triangle_speed(&self) -> f64 {
        let length = if self.finalized { self.target } else { self.target / 2.0 };
        (self.tangential_acceleration() * length).sqrt()
    }

    pub(super) fn clamp(&mut self) {
        self.most = self.most.min(self.target / self.cycle);
    }

    pub(super) fn finalize(&mut self) {
        if self.finalized {
            return;
        }
        self.clamp();
        if let Shape::Circle { effective: radius, .. } = self.shape {
            let acceleration = self.whole_acceleration();
            let across = (1.0 - ALONG_CIRCLES * ALONG_CIRCLES).sqrt() * acceleration;
            let wanted = self.most * self.most / radius;
            if wanted > across {
                self.most = (across * radius).sqrt();
                self.tangential = ALONG_CIRCLES;
            } else {
                self.tangential = (1.0 - (wanted / acceleration).powi(2)).sqrt();
            }
        }
        self.finalized = true;
    }
}

/// Joins two segments.
pub(super) fn join(before: &mut Segment, next: &mut Segment, end: End) {
    next.overlaps_before = end == End::Overlap;
    before.end = end;
}

pub(super) fn slow_at_kink(before: &mut Segment, next: &mut Segment, speed: f64, share: f64) {
    before.kink_speed = Some(speed);
    before.kink = before.kink.max(share);
    next.kink_before = next.kink_before.max(share);
}

pub(super) fn forget_kink(before: &mut Segment, next: &mut Segment) {
    before.kink_speed = None;
    (before.kink, next.kink_before) = (0.0, 0.0);
}

fn mix(from: &[f64; 6], to: &[f64; 6], share: f64) -> [f64; 6] {
    std::array::from_fn(|k| from[k] + share * (to[k] - from[k]))
}

pub(super) fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

pub(super) fn between(from: &[f64; 6], to: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|k| to[k] - from[k])
}

/// Lengths of X Y Z up to each place.
pub(super) fn lengths(places: &[[f64; 6]]) -> Vec<f64> {
    let mut sum = 0.0;
    let step = |pair: &[[f64; 6]]| {
        sum += norm(&between(&pair[0], &pair[1])[..3]);
        sum
    };
    std::iter::once(0.0).chain(places.windows(2).map(step).collect::<Vec<_>>()).collect()
}
