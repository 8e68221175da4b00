// SPDX-License-Identifier: GPL-2.0-or-later
//! The force of a milling cutter on the layer of material that is present at its teeth.
//!
//! The stock is a map of heights over X and Y, which a cylinder with a flat end and a vertical axis lowers. A tooth at
//! the angle φ cuts as deep as the map is above the tip there, and as thick as the tip has moved towards the tooth since
//! the previous tooth passed: h = u·(p(t) - p(t - 1/(N n))), u = (sin φ, cos φ), 0 if the tip has moved away. Vibration
//! thus returns with the next tooth. The forces of a tooth are those of [`milling`](super::milling).

use crate::dynamics::milling::{Milling, on_tool};
use crate::study::cutting::Cutting;
use crate::study::forcing;
use kinematics::Vector3;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::ops::Range;

/// Distance of the place beyond a tooth at which its layer is read, in cells: all cells nearer than half a diagonal may
/// be cut already.
const BEYOND: f64 = 0.75;

/// Movement across after which the stock is cut again, in cells, and down, mm.
const MOVED: [f64; 2] = [0.25, 1e-4];

/// Smallest cosine of the angle between tool and Z for a map of heights: one degree.
pub const UPRIGHT: f64 = 0.999_847;

/// Slices of a helix over the height of the stock.
const SLICES: usize = 100;

/// Most cells across the radius of a cutter that are too few.
const FEW: f64 = 10.0;

/// The cells of a stock are too coarse for a cutter.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "[stock] cell_mm = {cell}: expected at most a twentieth of the cutter's diameter, {most} mm"
)]
pub struct Coarse {
    cell: f64,
    most: f64,
}

impl Coarse {
    /// Rejects a stock whose cells are too coarse for a cutter with this radius in mm.
    ///
    /// # Errors
    /// See [`Coarse`].
    pub fn check(stock: &forcing::Stock, radius: f64) -> Result<(), Self> {
        match stock.cell_mm * FEW <= radius {
            true => Ok(()),
            false => Err(Self { cell: stock.cell_mm, most: radius / FEW }),
        }
    }
}

/// Heights of the material over X and Y, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Stock {
    low: [f64; 2],
    cell: f64,
    count: [usize; 2],
    heights: Vec<f64>,
    /// Sum of the heights that have been removed.
    lowered: f64,
}

impl From<&forcing::Stock> for Stock {
    fn from(stock: &forcing::Stock) -> Self {
        let count = stock.cells();
        let heights = vec![stock.top_mm; count[0] * count[1]];
        Self { low: stock.low_mm, cell: stock.cell_mm, count, heights, lowered: 0.0 }
    }
}

impl Stock {
    /// Returns the height at a place; negative infinity beside the stock.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let [across, up] = [(x, 0), (y, 1)].map(|(at, k)| ((at - self.low[k]) / self.cell).floor());
        let is_inside = |at: f64, k: usize| at >= 0.0 && at < self.count[k] as f64;
        match is_inside(across, 0) && is_inside(up, 1) {
            true => self.heights[up as usize * self.count[0] + across as usize],
            false => f64::NEG_INFINITY,
        }
    }

    /// Returns the volume of the material above a height, mm³.
    pub fn volume(&self, above: f64) -> f64 {
        let sum: f64 = self.heights.iter().map(|height| (height - above).max(0.0)).sum();
        sum * self.cell * self.cell
    }

    /// Returns the volume that has been removed, mm³.
    pub fn removed(&self) -> f64 {
        self.lowered * self.cell * self.cell
    }

    /// Returns the cells along X (0) or Y (1) whose centers are near a tip.
    fn near(&self, tip: &Vector3<f64>, k: usize, reach: f64) -> Range<usize> {
        let of = |at: f64| ((at - self.low[k]) / self.cell - 0.5).clamp(-1.0, self.count[k] as f64);
        // The centers between both ends.
        let first = of(tip[k] - reach).ceil().max(0.0) as usize;
        let last = (of(tip[k] + reach).floor() + 1.0).min(self.count[k] as f64).max(0.0) as usize;
        first..last.max(first)
    }

    /// Returns the ranges of cells whose centers are under a cutter, row by row.
    fn under(&self, tip: &Vector3<f64>, radius: f64) -> impl Iterator<Item = Range<usize>> + use<> {
        let rows = self.near(tip, 1, radius);
        let of_row = |row: usize| {
            let off = self.low[1] + (row as f64 + 0.5) * self.cell - tip.y;
            let cells = self.near(tip, 0, (radius * radius - off * off).max(0.0).sqrt());
            let start = row * self.count[0];
            start + cells.start..start + cells.end
        };
        rows.map(of_row).collect::<Vec<_>>().into_iter()
    }

    /// Lowers the cells under a cutter.
    pub fn cut(&mut self, tip: &Vector3<f64>, radius: f64) {
        for cells in self.under(tip, radius) {
            for height in &mut self.heights[cells] {
                self.lowered += (*height - tip.z).max(0.0);
                *height = height.min(tip.z);
            }
        }
    }

    /// Returns how far the material under a cutter is above its tip, mm; negative if it is below.
    pub fn depth_under(&self, tip: &Vector3<f64>, radius: f64) -> f64 {
        let heights = self.under(tip, radius).flat_map(|cells| &self.heights[cells]);
        heights.copied().fold(f64::NEG_INFINITY, f64::max) - tip.z
    }

    /// Returns the places of a tip along a straight move, at most a cell apart.
    pub fn along(
        &self,
        [from, to]: &[Vector3<f64>; 2],
    ) -> impl Iterator<Item = Vector3<f64>> + use<> {
        let (from, way) = (*from, to - from);
        let count = (way.norm() / self.cell).ceil().max(1.0);
        (0..=count as usize).map(move |k| from + way * (k as f64 / count))
    }
}

/// A cutter in a stock.
#[derive(Clone, Debug)]
pub struct Layer {
    milling: Milling,
    radius: f64,
    pub stock: Stock,
    /// The tip at the last steps, newest first.
    path: VecDeque<Vector3<f64>>,
    /// Steps per tooth.
    steps: f64,
    /// The tip where the stock was cut last.
    last: Option<Vector3<f64>>,
}

impl Layer {
    /// Creates a cutter in a stock, for steps of some seconds.
    ///
    /// # Errors
    /// See [`Coarse`].
    pub fn new(
        cutter: &Cutting,
        run: &forcing::Milling,
        stock: &forcing::Stock,
        step: f64,
    ) -> Result<Self, Coarse> {
        let radius = run.diameter_mm.0 / 2.0;
        Coarse::check(stock, radius)?;
        // At a depth of 1 mm the lag is that per mm.
        let milling = Milling::of(cutter, run, 1.0);
        let steps = 1.0 / (milling.tooth_frequency() * step);
        Ok(Self { milling, radius, stock: stock.into(), path: VecDeque::new(), steps, last: None })
    }

    /// Cuts with the tip at a place in the work, and returns the force on the tool, N; to be called every step.
    pub fn force(&mut self, time: f64, tip: &Vector3<f64>) -> Vector3<f64> {
        self.path.push_front(*tip);
        self.path.truncate(self.steps.ceil() as usize + 1);
        let [near, far] = [self.steps.floor(), self.steps.ceil()]
            .map(|k| self.path[(k as usize).min(self.path.len() - 1)]);
        let moved = tip - (near + (far - near) * self.steps.fract());
        let is_far = |last: &Vector3<f64>| {
            (tip - last).xy().norm() > MOVED[0] * self.stock.cell || last.z - tip.z > MOVED[1]
        };
        if self.last.as_ref().is_none_or(is_far) {
            self.stock.cut(tip, self.radius);
            self.last = Some(*tip);
        }
        let pitch = TAU / f64::from(self.milling.teeth);
        let first = TAU * self.milling.speed * time;
        let teeth = (0..self.milling.teeth).map(|tooth| first + pitch * f64::from(tooth));
        teeth.map(|angle| self.of_tooth(angle, tip, &moved)).sum()
    }

    fn of_tooth(&self, angle: f64, tip: &Vector3<f64>, moved: &Vector3<f64>) -> Vector3<f64> {
        if self.milling.lag == 0.0 {
            return self.of_edge(angle, self.depth(angle, tip, moved), moved);
        }
        let most = self.stock.heights.iter().copied().fold(f64::NEG_INFINITY, f64::max) - tip.z;
        let thick = most.max(0.0) / SLICES as f64;
        let slice = |k: usize| {
            let up = thick * (k as f64 + 0.5);
            let angle = angle - self.milling.lag * up;
            let depth = if self.depth(angle, tip, moved) > up { thick } else { 0.0 };
            self.of_edge(angle, depth, moved)
        };
        (0..SLICES).map(slice).sum()
    }

    /// Returns the height of the material above the tip in front of a tooth.
    ///
    /// Where a tooth moves nearly along the wall beside the cutter, the place beyond it is behind that wall. There the
    /// material must also continue in front of a place on this side of the wall, or nothing is left to cut.
    fn depth(&self, angle: f64, tip: &Vector3<f64>, moved: &Vector3<f64>) -> f64 {
        let (sin, cos) = angle.sin_cos();
        let cell = self.stock.cell;
        let at = |reach: f64, x: f64, y: f64| {
            (self.stock.height(tip.x + reach * sin + x, tip.y + reach * cos + y) - tip.z).max(0.0)
        };
        let beyond = at(self.radius + BEYOND * cell, 0.0, 0.0);
        let ahead = moved.xy().normalize();
        // Within this angle to the wall a cell hides it: cos = R/(R + 2 BEYOND cell).
        let grazing = (4.0 * BEYOND * cell / self.radius).sqrt();
        if ahead.x * sin + ahead.y * cos > grazing {
            return beyond;
        }
        let step = ahead * (grazing * self.radius);
        beyond.min(at(self.radius - BEYOND * cell, step.x, step.y))
    }

    fn of_edge(&self, angle: f64, depth: f64, moved: &Vector3<f64>) -> Vector3<f64> {
        let (sin, cos) = angle.sin_cos();
        let thickness = moved.x * sin + moved.y * cos;
        if !(thickness > 0.0 && depth > 0.0) {
            return Vector3::zeros();
        }
        let Milling { cutting, edge, .. } = &self.milling;
        on_tool([0, 1, 2].map(|k| depth * (cutting[k] * thickness + edge[k])), angle)
    }
}
