// SPDX-License-Identifier: GPL-2.0-or-later
//! Moves of typical paths, in one of the planes of G17, G18 and G19.

use crate::planes::PLANES;
use serde::Deserialize;
use studies::study::number::Positive;

/// G17, G18 or G19.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Plane {
    /// G17.
    #[default]
    Xy,
    /// G18: the first axis is Z.
    Zx,
    /// G19.
    Yz,
}

/// A tool change at a position away from the workpiece; the first one of a job is made at the machine's
/// position. Without a tool the machine only moves there.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Change {
    pub park_mm: [f64; 3],
    /// T number.
    pub tool: Option<u32>,
    /// Speed of the spindle; 0 stops it, `None` leaves it unchanged.
    pub spindle_rpm: Option<f64>,
}

/// One move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// G0 of these coordinates.
    Rapid([Option<f64>; 6]),
    /// G1 of these coordinates.
    Cut([Option<f64>; 6], f64),
    /// G2 or G3 in a plane to a point about a center.
    Turn {
        /// Plane: 0 to 2 for G17, G18, G19.
        plane: usize,
        /// End point: first and second axis of the plane.
        end: [f64; 2],
        /// Level at the end; `None` if it is unchanged.
        level: Option<f64>,
        centre: [f64; 2],
        /// Whether it is G3.
        is_left: bool,
        /// Number of whole turns; 0 for an arc whose ends differ.
        turns: u32,
        /// Feed per minute.
        feed: f64,
    },
    Tool(Change),
}

/// A writer of moves in a plane.
pub(super) struct Pen {
    plane: usize,
    pub(super) feed: f64,
    /// The moves so far.
    pub(super) all: Vec<Step>,
}

impl Pen {
    /// Creates a pen in a plane, at a feed per minute.
    pub(super) fn new(plane: Plane, feed: Positive) -> Self {
        Self { plane: plane as usize, feed: feed.0, all: vec![] }
    }

    fn place(&self, at: [Option<f64>; 3]) -> [Option<f64>; 6] {
        let mut place = [None; 6];
        for (axis, value) in PLANES[self.plane].into_iter().zip(at) {
            place[axis] = value;
        }
        place
    }

    /// Adds G0 to a level.
    pub(super) fn level(&mut self, w: f64) {
        self.all.push(Step::Rapid(self.place([None, None, Some(w)])));
    }

    /// Adds G0 to a position above the plane.
    pub(super) fn over(&mut self, u: f64, v: f64) {
        self.all.push(Step::Rapid(self.place([Some(u), Some(v), None])));
    }

    /// Adds G1 to a level.
    pub(super) fn sink(&mut self, w: f64) {
        self.all.push(Step::Cut(self.place([None, None, Some(w)]), self.feed));
    }

    /// Adds G1 to a position.
    pub(super) fn cut(&mut self, u: f64, v: f64) {
        self.all.push(Step::Cut(self.place([Some(u), Some(v), None]), self.feed));
    }

    /// Adds G1 to a position and a level.
    pub(super) fn cut_to(&mut self, at: [f64; 3]) {
        self.all.push(Step::Cut(self.place(at.map(Some)), self.feed));
    }

    /// Adds G2 or G3 to a position and a level.
    pub(super) fn turn(
        &mut self,
        [u, v, w]: [f64; 3],
        centre: [f64; 2],
        is_left: bool,
        turns: u32,
    ) {
        let (plane, feed, end, level) = (self.plane, self.feed, [u, v], Some(w));
        self.all.push(Step::Turn { plane, end, level, centre, is_left, turns, feed });
    }

    /// Adds the moves to a position and down to a level.
    pub(super) fn enter(&mut self, clear: f64, [u, v]: [f64; 2], level: f64) {
        self.level(clear);
        self.over(u, v);
        self.sink(level);
    }

    /// Adds points of a curve at even steps of its angle; its second derivative is at most `bent`.
    pub(super) fn along(
        &mut self,
        angle: f64,
        bent: f64,
        chord: f64,
        at: impl Fn(f64) -> [f64; 3],
    ) {
        let steps = (angle / (8.0 * chord / bent).sqrt()).ceil();
        for n in 1..=steps as usize {
            self.cut_to(at(angle * n as f64 / steps));
        }
    }
}
