// SPDX-License-Identifier: GPL-2.0-or-later
//! The machine's positions over a program, stored as few points.
//!
//! A point is kept if the straight line from the last kept point would deviate from a cycle between them by more
//! than a tolerance. When there are too many points, the tolerance is doubled, and the existing points
//! are thinned with it, so a day takes as much memory as a minute. Times of lines are kept up to a maximum number.

use linuxcnc::row::Row;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;

/// Most points: a browser draws all of them in every frame.
pub const MOST_POINTS: usize = 20_000;

/// Most stretches of lines whose start time is kept; after them the last line remains.
const MOST_LINES: usize = 1_000_000;

/// Initial tolerance of a length, as a share of the machine's size, and of an angle in degrees: invisible in a
/// picture.
const OF_SIZE: f64 = 2e-5;
const OF_ANGLE: f64 = 2e-3;

/// Number of values of a mechanism: its pose (x y z in machine units, a b c in degrees) and the effective tool
/// vector.
pub const VALUES: usize = 9;

/// The state at a time of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Seconds since the program was started.
    pub at: f64,
    /// [`VALUES`] of each mechanism, then the values of the extra axes in joint order.
    pub values: Vec<f64>,
}

/// The motion of a program over time.
#[derive(Clone, Debug)]
pub struct Track {
    period: f64,
    tolerance: Vec<f64>,
    /// Factor by which the tolerance has grown.
    coarseness: f64,
    thinner: Thinner,
    /// Time of the first cycle of every line, and the line.
    lines: Vec<(f64, u32)>,
    end: f64,
}

impl Track {
    /// Creates an empty track.
    pub fn new(config: &MachineConfig) -> Self {
        let length = OF_SIZE * config.first().machine.size();
        let of = |is_angle| if is_angle { OF_ANGLE } else { length };
        let of_one = (0..VALUES).map(|k| of((3..6).contains(&k)));
        let of_extra = config.first().extra.iter().map(|extra| of(extra.is_rotary()));
        let tolerance: Vec<f64> =
            config.mechanisms.iter().flat_map(|_| of_one.clone()).chain(of_extra).collect();
        Self {
            period: config.period,
            thinner: Thinner::new(&tolerance),
            tolerance,
            coarseness: 1.0,
            lines: vec![],
            end: 0.0,
        }
    }

    /// Adds a servo cycle.
    pub fn see(&mut self, config: &MachineConfig, row: &Row) {
        let at = row.cycle as f64 * self.period;
        let of = |one: &Mechanism| row.machine(one).0.into_iter().chain(row.of(one).tool);
        let mut values: Vec<f64> = config.mechanisms.iter().flat_map(of).collect();
        values.extend(config.first().extra_of(&row.extra.world));
        self.take(at, row.line, values);
    }

    /// Adds a state: its time in seconds, the line, and the values of a [`Point`].
    pub fn take(&mut self, at: f64, line: u32, values: Vec<f64>) {
        let is_new = self.lines.last().is_none_or(|(_, last)| *last != line);
        if is_new && self.lines.len() < MOST_LINES {
            self.lines.push((at, line));
        }
        self.end = at;
        // A pose outside the range of the carrying axes is not finite, and is not drawn.
        if values.iter().any(|value| !value.is_finite()) {
            return;
        }
        self.thinner.take(Point { at, values });
        if self.thinner.points.len() > MOST_POINTS {
            self.coarsen();
        }
    }

    fn coarsen(&mut self) {
        self.coarseness *= 2.0;
        let tolerance: Vec<f64> =
            self.tolerance.iter().map(|value| value * self.coarseness).collect();
        let all = std::mem::replace(&mut self.thinner, Thinner::new(&tolerance)).finish();
        all.into_iter().for_each(|point| self.thinner.take(point));
    }

    /// Returns the points, in order; empty if nothing was recorded.
    pub fn points(&self) -> Vec<Point> {
        self.thinner.clone().finish()
    }

    /// Returns the time of the first cycle of every stretch of a line, and the line.
    pub fn lines(&self) -> &[(f64, u32)] {
        &self.lines
    }

    /// Returns the end time of the program, seconds.
    pub fn end(&self) -> f64 {
        self.end
    }
}

/// A filter that keeps the points that a polyline needs.
#[derive(Clone, Debug)]
struct Thinner {
    tolerance: Vec<f64>,
    points: Vec<Point>,
    /// The last point added, and the permitted slopes of lines from the last kept point.
    last: Option<Point>,
    slopes: Vec<[f64; 2]>,
}

impl Thinner {
    fn new(tolerance: &[f64]) -> Self {
        let slopes = vec![ANY; tolerance.len()];
        Self { tolerance: tolerance.to_vec(), points: vec![], last: None, slopes }
    }

    fn take(&mut self, point: Point) {
        let Some(pivot) = self.points.last() else {
            self.points.push(point);
            return;
        };
        if let Some(last) = self.last.take()
            && !self.reaches(pivot, &point)
        {
            self.points.push(last);
            self.slopes.fill(ANY);
        }
        self.narrow(&point);
        self.last = Some(point);
    }

    /// Returns whether a line to the point passes all points between within the tolerance.
    fn reaches(&self, pivot: &Point, point: &Point) -> bool {
        let values = pivot.values.iter().zip(&point.values).zip(&self.slopes);
        values.into_iter().all(|((from, to), [low, high])| {
            let slope = (to - from) / (point.at - pivot.at);
            *low <= slope && slope <= *high
        })
    }

    fn narrow(&mut self, point: &Point) {
        let Some(pivot) = self.points.last() else { return };
        let step = point.at - pivot.at;
        for (k, [low, high]) in self.slopes.iter_mut().enumerate() {
            let (change, tolerance) = (point.values[k] - pivot.values[k], self.tolerance[k]);
            *low = low.max((change - tolerance) / step);
            *high = high.min((change + tolerance) / step);
        }
    }

    fn finish(mut self) -> Vec<Point> {
        self.points.extend(self.last.take());
        self.points
    }
}

const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

#[cfg(test)]
mod tests {
    use super::*;

    fn thinned(values: impl Iterator<Item = f64>, tolerance: f64) -> Vec<Point> {
        let mut thinner = Thinner::new(&[tolerance]);
        for (i, value) in values.enumerate() {
            thinner.take(Point { at: i as f64, values: vec![value] });
        }
        thinner.finish()
    }

    #[test]
    fn a_straight_way_needs_its_ends_and_a_corner_one_more() {
        let at = |points: Vec<Point>| points.iter().map(|point| point.at).collect::<Vec<_>>();
        assert_eq!(at(thinned((0..100).map(|i| 0.5 * f64::from(i)), 1e-9)), [0.0, 99.0]);
        let corner = (0..100).map(|i| f64::from((i - 40_i32).abs()));
        assert_eq!(at(thinned(corner, 1e-9)), [0.0, 40.0, 99.0]);
    }

    #[test]
    fn every_cycle_is_within_the_tolerance_of_the_lines() {
        let value = |i: f64| (i / 50.0).sin() + 0.3 * (i / 40.0).cos();
        let points = thinned((0..2000).map(|i| value(f64::from(i))), 1e-3);
        assert!(points.len() < 1000, "{} points", points.len());
        for i in 0..2000 {
            let t = f64::from(i);
            let next = points.iter().position(|point| point.at >= t).unwrap();
            let (a, b) = (&points[next.saturating_sub(1)], &points[next]);
            let share = if a.at == b.at { 0.0 } else { (t - a.at) / (b.at - a.at) };
            let on_line = a.values[0] + share * (b.values[0] - a.values[0]);
            assert!((on_line - value(t)).abs() <= 1e-3 + 1e-12, "at {t}");
        }
    }
}
