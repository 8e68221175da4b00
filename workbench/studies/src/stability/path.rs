// SPDX-License-Identifier: GPL-2.0-or-later
//! Limit depths along a path, and the best spindle speed for the whole path.

use crate::stability::bands::first_limit;
use crate::stability::floquet::{Period, TooSlow, fast_enough};
use crate::stability::lobes::Lobes;
use crate::stability::pose::{NoModes, Setup};
use crate::stability::process::Row;
use kinematics::{Matrix3, Pose, Vector3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A position on a path where the tool cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Index of the move that ends here.
    pub step: usize,
    pub line: u32,
    /// The commanded pose, machine units and degrees.
    pub programmed: [f64; 6],
    /// The machine's own pose.
    pub pose: Pose,
    /// Tool vector on the platform, spindle offset included.
    pub tool: Vector3<f64>,
    /// Orientation of the tool in base.
    pub rotation: Matrix3<f64>,
    /// Feed in machine axes, any length.
    pub feed: Vector3<f64>,
    /// Spindle speed, 1/min.
    pub rpm: f64,
}

/// Stable depths at a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Depth {
    /// The depth below which all depths are stable at the stop's spindle speed; the largest depth sampled
    /// if none is unstable.
    pub stable_to: f64,
    /// The zero-order limit over all speeds, mm; infinite if there is none.
    pub floor: f64,
}

/// A spindle speed for the whole path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Best {
    /// 1/min.
    pub rpm: f64,
    /// The depth below which all depths are stable at every stop.
    pub stable_to: f64,
}

/// Candidates for the best speed that are computed by collocation.
const CANDIDATES: usize = 6;

/// A path with the modes at each of its stops.
pub struct Path<'a> {
    setup: &'a Setup<'a>,
    stops: Vec<(Stop, Vec<Row>)>,
    /// The largest depth sampled, mm.
    most: f64,
}

impl<'a> Path<'a> {
    /// Computes the modes at stops, with the largest depth to sample in mm. A plunge along the spindle axis has no
    /// feed across it, so the worst feed is used.
    ///
    /// # Errors
    /// Returns the index of a stop that the machine cannot reach, or where its modes are undefined.
    pub fn new(setup: &'a Setup<'a>, stops: &[Stop], most: f64) -> Result<Self, (usize, NoModes)> {
        let rows =
            |stop: &Stop| match setup.rows_with(&stop.pose, &stop.tool, &stop.feed, &stop.rotation)
            {
                Err(NoModes::Feed(_)) => {
                    let across = stop.rotation.column(0).into_owned();
                    let rows = setup.rows_with(&stop.pose, &stop.tool, &across, &stop.rotation)?;
                    Ok(setup.at_worst_feed(&rows))
                }
                other => other,
            };
        let stop = |(place, stop): (usize, &Stop)| match rows(stop) {
            Ok(rows) => Ok((*stop, rows)),
            Err(error) => Err((place, error)),
        };
        let stops = stops.par_iter().enumerate().map(stop).collect::<Result<_, _>>()?;
        Ok(Self { setup, stops, most })
    }

    fn stable_to(&self, rows: &[Row], rpm: f64) -> f64 {
        let period = Period::new(rows, &self.setup.process, rpm);
        first_limit(&period, self.most).unwrap_or(self.most)
    }

    /// Refuses spindle speeds that take too long: those of the stops, and `slowest` (1/min).
    ///
    /// # Errors
    /// Returns the index of a stop, and the reason.
    pub fn check(&self, slowest: f64) -> Result<(), (usize, TooSlow)> {
        for (place, (stop, rows)) in self.stops.iter().enumerate() {
            fast_enough(rows, &self.setup.process, stop.rpm.min(slowest))
                .map_err(|error| (place, error))?;
        }
        Ok(())
    }

    /// Returns the depths at every stop, in order; `progress` receives the share done.
    pub fn depths(&self, progress: impl Fn(f64) + Sync) -> Vec<Depth> {
        let done = AtomicUsize::new(0);
        let depth = |(stop, rows): &(Stop, Vec<Row>)| {
            let lobes = Lobes::coarse(rows, &self.setup.process, f64::INFINITY);
            let floor = lobes.floor().map_or(f64::INFINITY, |limit| limit.depth);
            let found = Depth { stable_to: self.stable_to(rows, stop.rpm), floor };
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(done as f64 / self.stops.len() as f64);
            found
        };
        self.stops.par_iter().map(depth).collect()
    }

    /// Returns the speed among `speeds` at which the least depth of all stops is largest: zero order selects the
    /// candidates, collocation decides.
    pub fn best(&self, speeds: &[f64]) -> Option<Best> {
        let slowest = speeds.iter().copied().fold(f64::INFINITY, f64::min);
        let lobes: Vec<Lobes> = self
            .stops
            .par_iter()
            .map(|(_, rows)| Lobes::coarse(rows, &self.setup.process, slowest))
            .collect();
        let least = |rpm: &f64| {
            let limit = |lobes: &Lobes| lobes.limit(*rpm).map_or(self.most, |l| l.depth);
            (lobes.iter().map(limit).fold(self.most, f64::min), *rpm)
        };
        let mut all: Vec<(f64, f64)> = speeds.par_iter().map(least).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best: Option<Best> = None;
        for (_, rpm) in all.into_iter().take(CANDIDATES) {
            let stable_to = self
                .stops
                .par_iter()
                .map(|(_, rows)| self.stable_to(rows, rpm))
                .reduce(|| self.most, f64::min);
            if best.is_none_or(|best| stable_to > best.stable_to) {
                best = Some(Best { rpm, stable_to });
            }
        }
        best
    }
}
