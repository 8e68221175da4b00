// SPDX-License-Identifier: GPL-2.0-or-later
//! Partitions of a plane of two parameters by the number of unstable roots: the boundary curves,
//! sampled evenly on the sphere, and the regions between them.

use crate::stability::lag::Lag;
use nalgebra::{Complex, ComplexField};
use rayon::prelude::*;

/// Largest chordal distance of neighboring points.
pub const CHORD: f64 = 0.01;

/// Halvings of an interval: the least number, so that no resonance is skipped, and
/// the largest.
const HALVINGS: [usize; 2] = [6, 40];

/// Evenly spaced frequencies of a curve with measured responses, which is not refined.
const EVEN: usize = 2000;

/// Upper end of the curve, in multiples of the highest resonance.
const BEYOND: f64 = 1e3;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Angular frequency of the root on the imaginary axis, rad/s.
    pub omega: f64,
    /// Position in the plane.
    pub at: [f64; 2],
}

/// Returns the distance on the sphere onto which the plane is projected; all infinite points are one point.
pub fn chordal(a: Complex<f64>, b: Complex<f64>) -> f64 {
    2.0 * (a - b).modulus() / ((1.0 + a.norm_sqr()) * (1.0 + b.norm_sqr())).sqrt()
}

impl Lag {
    /// Returns the boundary `K(iω)` of the D-partition for ω from 0 up, real and imaginary part in N/mm;
    /// for ω below 0 it is the mirror image. Neighbors are nearer than [`CHORD`] on the sphere
    /// whose equator is `|K| = reference`, unless responses are measured.
    pub fn curve(&self, reference: f64) -> Vec<Point> {
        if !self.measured.is_empty() {
            let point = |omega: f64| {
                let place = self.boundary(omega);
                Point { omega, at: [place.re, place.im] }
            };
            return self.grid(EVEN).into_iter().map(point).collect();
        }
        let mut ends: Vec<f64> = self.terms.iter().map(|term| term.omega()).collect();
        let highest = ends.iter().copied().fold(0.0, f64::max);
        ends.extend(self.crossings().iter().map(|found| found.omega));
        ends.extend([0.0, BEYOND * highest]);
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        let at = |omega: f64| (omega, self.boundary(omega) / reference);
        let mut points = vec![at(ends[0])];
        for pair in ends.windows(2) {
            halved(&at, at(pair[0]), at(pair[1]), 0, &mut points);
        }
        let point = |(omega, place): (f64, Complex<f64>)| Point {
            omega,
            at: [place.re * reference, place.im * reference],
        };
        points.into_iter().map(point).collect()
    }
}

type Sample = (f64, Complex<f64>);

/// Appends the points after the first one, up to the last.
fn halved(
    at: &impl Fn(f64) -> Sample,
    first: Sample,
    last: Sample,
    depth: usize,
    points: &mut Vec<Sample>,
) {
    let is_near = chordal(first.1, last.1) <= CHORD;
    if depth >= HALVINGS[1] || (depth >= HALVINGS[0] && is_near) {
        points.push(last);
        return;
    }
    let middle = at(first.0 + (last.0 - first.0) / 2.0);
    halved(at, first, middle, depth + 1, points);
    halved(at, middle, last, depth + 1, points);
}

/// A connected part of a plane with the same number of unstable roots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Number of unstable roots.
    pub unstable: usize,
    /// A point inside, far from the border.
    pub at: [f64; 2],
}

/// A window of a plane: lowest and highest values in horizontal and vertical direction.
pub type Window = [[f64; 2]; 2];

/// Cells of a window in horizontal and vertical direction.
const CELLS: [usize; 2] = [96, 60];

/// Least number of cells of a region: a smaller one has no room for its number.
const LEAST_CELLS: usize = 12;

/// Returns the regions in a window, found by counting roots in each of its cells.
pub fn regions(window: &Window, unstable: impl Fn([f64; 2]) -> usize + Sync) -> Vec<Region> {
    let [across, up] = CELLS;
    let place = |cell: usize| {
        let share = [(cell % across) as f64 / across as f64, (cell / across) as f64 / up as f64];
        let half = [0.5 / across as f64, 0.5 / up as f64];
        std::array::from_fn(|k| window[k][0] + (window[k][1] - window[k][0]) * (share[k] + half[k]))
    };
    let counts: Vec<usize> =
        (0..across * up).into_par_iter().map(|cell| unstable(place(cell))).collect();
    let mut is_seen = vec![false; counts.len()];
    let mut found = vec![];
    for start in 0..counts.len() {
        if !is_seen[start] {
            let cells = connected(&counts, start, &mut is_seen);
            if cells.len() >= LEAST_CELLS {
                found.push(Region { unstable: counts[start], at: place(innermost(&cells)) });
            }
        }
    }
    found
}

fn neighbors(cell: usize) -> impl Iterator<Item = usize> {
    let [across, up] = CELLS;
    let (x, y) = (cell % across, cell / across);
    [
        (x > 0).then(|| cell - 1),
        (x + 1 < across).then(|| cell + 1),
        (y > 0).then(|| cell - across),
        (y + 1 < up).then(|| cell + across),
    ]
    .into_iter()
    .flatten()
}

fn connected(counts: &[usize], start: usize, is_seen: &mut [bool]) -> Vec<usize> {
    let mut cells = vec![start];
    is_seen[start] = true;
    let mut next = 0;
    while next < cells.len() {
        for other in neighbors(cells[next]) {
            if !is_seen[other] && counts[other] == counts[start] {
                is_seen[other] = true;
                cells.push(other);
            }
        }
        next += 1;
    }
    cells
}

/// Returns the cell farthest from the cells outside the region, by removing layer after layer. The border of
/// the window counts as outside, so that labels keep away from it.
fn innermost(cells: &[usize]) -> usize {
    let mut left: std::collections::BTreeSet<usize> = cells.iter().copied().collect();
    let mut last = cells[0];
    while !left.is_empty() {
        let is_border = |cell: &&usize| {
            let inside = neighbors(**cell).filter(|other| left.contains(other)).count();
            inside < 4
        };
        let border: Vec<usize> = left.iter().filter(is_border).copied().collect();
        last = border[border.len() / 2];
        border.iter().for_each(|cell| {
            left.remove(cell);
        });
    }
    last
}
