// SPDX-License-Identifier: GPL-2.0-or-later
//! The force of a milling cutter on its tool, with its teeth and the varying chip thickness.
//!
//! X along the feed, Z along the tool axis, Y = Z × X. A tooth at the angle φ from Y, clockwise seen
//! from +Z, cuts a chip of thickness h = f sin φ between entry and exit, with forces along, into and across
//! its path F = a (K h + Ke); on the tool (-Ft cos φ - Fr sin φ, Ft sin φ - Fr cos φ, Fa). A helix is a
//! stack of slices, each lagging the one below.

use crate::study::cutting::Cutting;
use crate::study::forcing;
use kinematics::{Matrix3, Vector3};
use std::f64::consts::TAU;

/// A cutter and its cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Milling {
    /// Number of teeth, evenly spaced.
    pub teeth: u16,
    /// Turns per second.
    pub speed: f64,
    /// mm per tooth.
    pub feed: f64,
    /// Depth of cut along the tool axis, mm.
    pub depth: f64,
    /// Where a tooth enters and leaves, radians.
    pub arc: [f64; 2],
    /// Tangential, radial and axial coefficients, N/mm².
    pub cutting: [f64; 3],
    /// Edge coefficients, N/mm.
    pub edge: [f64; 3],
    /// Angle by which the top of the cut lags its bottom, radians; 0 for straight teeth.
    pub lag: f64,
}

impl Milling {
    /// Reads the tables `[cutting]` and `[milling]` of a study, at a depth of cut in mm.
    pub fn of(cutter: &Cutting, run: &forcing::Milling, depth: f64) -> Self {
        let helix = run.helix_deg.map_or(0.0, |angle| angle.0).to_radians();
        Self {
            teeth: cutter.teeth,
            speed: run.speed_rpm.0 / 60.0,
            feed: run.feed_mm.0,
            depth,
            arc: cutter.arc(),
            cutting: cutter.coefficients,
            edge: [run.kte_n_per_mm, run.kre_n_per_mm, run.kae_n_per_mm].map(|edge| edge.0),
            lag: 2.0 * depth * helix.tan() / run.diameter_mm.0,
        }
    }
}

/// Harmonics of the tooth frequency in a simulation: with 40 steps in the shortest of them, a tooth
/// enters and leaves within a two-hundredth of a tooth period.
const HARMONICS: f64 = 5.0;

/// Slices of a helix: their angles differ by a hundredth of its lag.
const SLICES: usize = 100;

impl Milling {
    /// Computes the force on the tool, N, with the first tooth at an angle; feed, across, along the tool axis.
    pub fn force(&self, angle: f64) -> Vector3<f64> {
        let slices = if self.lag == 0.0 { 1 } else { SLICES };
        let mut sum = Vector3::zeros();
        for slice in 0..slices {
            let lag = self.lag * (slice as f64 + 0.5) / slices as f64;
            for tooth in 0..self.teeth {
                let pitch = TAU * f64::from(tooth) / f64::from(self.teeth);
                sum += self.of_edge((angle + pitch - lag).rem_euclid(TAU)) / slices as f64;
            }
        }
        sum
    }

    /// Computes the force of one straight tooth.
    fn of_edge(&self, angle: f64) -> Vector3<f64> {
        let [entry, exit] = self.arc;
        if !(entry <= angle && angle <= exit) {
            return Vector3::zeros();
        }
        let force =
            |k: usize| self.depth * (self.cutting[k] * self.feed * angle.sin() + self.edge[k]);
        on_tool([0, 1, 2].map(force), angle)
    }

    /// Computes the force on the tool at a time in seconds, in machine axes; `frame` is spanned by feed and
    /// tool axis.
    pub fn at(&self, time: f64, frame: &Matrix3<f64>) -> Vector3<f64> {
        frame * self.force(TAU * self.speed * time)
    }

    /// Returns teeth per second, Hz.
    pub fn tooth_frequency(&self) -> f64 {
        self.speed * f64::from(self.teeth)
    }

    /// Returns the highest relevant frequency, Hz.
    pub fn reach(&self) -> f64 {
        HARMONICS * self.tooth_frequency()
    }
}

/// Converts the forces of a tooth at an angle (along, into and across its path) to feed, across, along the
/// tool axis.
pub fn on_tool([along, into, axial]: [f64; 3], angle: f64) -> Vector3<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector3::new(-along * cos - into * sin, along * sin - into * cos, axial)
}

/// Smallest sine of the angle between feed and tool axis: below it the direction across is undefined.
const ACROSS: f64 = 1e-6;

/// Computes feed, across and tool axis as columns, from a direction of the feed and the tool axis in machine
/// axes; `None` if the feed is along the tool.
pub fn frame(feed: &Vector3<f64>, axis: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let level = feed - axis * axis.dot(feed);
    let x = level.try_normalize(ACROSS * feed.norm())?;
    Some(Matrix3::from_columns(&[x, axis.cross(&x), *axis]))
}
