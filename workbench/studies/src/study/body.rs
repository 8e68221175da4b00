// SPDX-License-Identifier: GPL-2.0-or-later
//! The body of a workspace: rays in all directions, its volume and surface, and a count on a grid.

use crate::study::workspace::{Border, Ray, Workspace};
use kinematics::Vector3;
use machine::files;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Sampling density of a workspace.
pub struct Effort<'a> {
    /// Rays from pole to pole; twice as many around the equator.
    pub bands: usize,
    /// Length of a step along a ray, machine units.
    pub step: f64,
    /// Points of the grid along its longest side.
    pub grid: usize,
    /// Receives the share of the work done.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

impl Effort<'_> {
    /// Applies `f` to every item, in order, on all threads of the pool; reports progress from `from` to `to`.
    pub(super) fn each<T: Sync, U: Send>(
        &self,
        items: &[T],
        (from, to): (f64, f64),
        f: impl Fn(&T) -> U + Sync,
    ) -> Vec<U> {
        let done = AtomicUsize::new(0);
        let one = |item: &T| {
            let result = f(item);
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            (self.progress)(from + (to - from) * count as f64 / items.len() as f64);
            result
        };
        items.par_iter().map(one).collect()
    }
}

/// The body visible along rays in all directions.
#[derive(Clone, Debug)]
pub struct Body {
    /// Origin of the rays.
    pub from: Vector3<f64>,
    /// Rings of rays from below (elevation −90) to above (90); the first and the last ring have
    /// one ray, the others as many as `around`, from azimuth 0. On a planar machine, one ring in its plane.
    pub rings: Vec<Vec<Ray>>,
    /// Number of rays of a ring.
    pub around: usize,
}

impl Body {
    /// Samples the body from a point inside.
    ///
    /// # Errors
    /// Returns the limit that the point itself violates.
    pub fn seen(
        workspace: &Workspace,
        from: Vector3<f64>,
        effort: &Effort,
    ) -> Result<Self, Border> {
        workspace.check(&from)?;
        let look = |direction: &Vector3<f64>| workspace.ray(&from, direction, effort.step);
        if let [across, up] = workspace.axes()[..] {
            // As many rays as of a body.
            let around = 2 * effort.bands * effort.bands;
            let direction = |k: usize| {
                let mut direction = Vector3::zeros();
                (direction[up], direction[across]) =
                    (2.0 * PI * k as f64 / around as f64).sin_cos();
                direction
            };
            let directions: Vec<_> = (0..around).map(direction).collect();
            let rings = vec![effort.each(&directions, (0.0, 0.5), look)];
            return Ok(Self { from, rings, around });
        }
        let around = 2 * effort.bands;
        let elevation = |ring: usize| PI * (ring as f64 / effort.bands as f64 - 0.5);
        let mut directions = vec![];
        for ring in 0..=effort.bands {
            let (sin, cos) = elevation(ring).sin_cos();
            let pole = ring == 0 || ring == effort.bands;
            for k in 0..if pole { 1 } else { around } {
                let (y, x) = (2.0 * PI * k as f64 / around as f64).sin_cos();
                let level = if pole { 0.0 } else { cos };
                directions.push(Vector3::new(level * x, level * y, sin));
            }
        }
        let mut rays = effort.each(&directions, (0.0, 0.5), look).into_iter();
        let ring = |ring: usize| {
            let pole = ring == 0 || ring == effort.bands;
            rays.by_ref().take(if pole { 1 } else { around }).collect()
        };
        Ok(Self { from, rings: (0..=effort.bands).map(ring).collect(), around })
    }

    /// Returns whether all rays are in a plane.
    pub fn is_plane(&self) -> bool {
        self.rings.len() == 1
    }

    /// Returns the number of dimensions.
    fn dimensions(&self) -> i32 {
        if self.is_plane() { 2 } else { 3 }
    }

    /// Returns the angle of all directions.
    fn whole_angle(&self) -> f64 {
        if self.is_plane() { 2.0 * PI } else { 4.0 * PI }
    }

    /// Returns all rays, each with the solid angle it represents, or its angle in a plane.
    pub fn rays(&self) -> impl Iterator<Item = (f64, &Ray)> {
        let band = PI / (self.rings.len() - 1).max(1) as f64;
        self.rings.iter().enumerate().flat_map(move |(ring, rays)| {
            let middle = band * ring as f64 - PI / 2.0;
            let edge = |side: f64| (middle + side * band / 2.0).clamp(-PI / 2.0, PI / 2.0).sin();
            let height = if self.is_plane() { 1.0 } else { edge(1.0) - edge(-1.0) };
            let angle = 2.0 * PI * height / rays.len() as f64;
            rays.iter().map(move |ray| (angle, ray))
        })
    }

    /// Returns the volume of all segments of the rays, or their area in a plane.
    pub fn volume(&self) -> f64 {
        let n = self.dimensions();
        let piece = |[from, to]: &[f64; 2]| (to.powi(n) - from.powi(n)) / f64::from(n);
        self.rays().map(|(angle, ray)| angle * ray.inside.iter().map(piece).sum::<f64>()).sum()
    }

    pub fn looked(&self) -> usize {
        self.rays().map(|(_, ray)| ray.looked).sum()
    }

    /// Returns the share of the directions that each limit ends, largest first.
    pub fn shares(&self) -> Vec<(Border, f64)> {
        let mut shares: Vec<(Border, f64)> = vec![];
        for (angle, ray) in self.rays() {
            let share = angle / self.whole_angle();
            match shares.iter_mut().find(|(limit, _)| *limit == ray.limit) {
                Some((_, sum)) => *sum += share,
                None => shares.push((ray.limit, share)),
            }
        }
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        shares
    }

    /// Returns the corners of an axis-parallel box around all segments.
    pub fn corners(&self) -> [Vector3<f64>; 2] {
        let ends = self.rays().flat_map(|(_, ray)| {
            let end = ray.inside.last().map_or(0.0, |piece| piece[1]);
            [self.from + ray.direction * end, self.from + ray.direction * ray.exit()]
        });
        ends.fold([self.from, self.from], |[low, high], end| [low.inf(&end), high.sup(&end)])
    }

    /// Returns the center of volume of the first segments of the rays.
    pub fn middle(&self) -> Vector3<f64> {
        let n = self.dimensions();
        let piece = |(angle, ray): (f64, &Ray)| {
            let of = |power: i32| angle * ray.exit().powi(power) / f64::from(power);
            (of(n), ray.direction * of(n + 1))
        };
        let pieces = self.rays().map(piece);
        let (volume, moment) =
            pieces.fold((0.0, Vector3::zeros()), |sum, (v, m)| (sum.0 + v, sum.1 + m));
        self.from + moment / volume
    }

    /// Returns the points of the surface around the origin of the rays, and its triangles,
    /// counterclockwise seen from outside; in a plane, triangles from the origin of the rays to its outline.
    pub fn mesh(&self) -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
        if self.is_plane() {
            let ends = self.rays().map(|(_, ray)| self.from + ray.direction * ray.exit());
            let triangle = |k: usize| [0, 1 + k, 1 + (k + 1) % self.around];
            return (
                std::iter::once(self.from).chain(ends).collect(),
                (0..self.around).map(triangle).collect(),
            );
        }
        let points = self.rays().map(|(_, ray)| self.from + ray.direction * ray.exit()).collect();
        let last = self.rings.len() - 1;
        let point = |ring: usize, k: usize| match ring {
            0 => 0,
            _ if ring == last => 1 + (last - 1) * self.around,
            _ => 1 + (ring - 1) * self.around + k % self.around,
        };
        let mut triangles = vec![];
        for ring in 0..last {
            for k in 0..self.around {
                let (a, b) = (point(ring, k), point(ring, k + 1));
                let (c, d) = (point(ring + 1, k), point(ring + 1, k + 1));
                let halves = [[a, b, d], [a, d, c]];
                triangles.extend(halves.iter().filter(|[a, b, c]| a != b && b != c && c != a));
            }
        }
        (points, triangles)
    }
}

/// Returns the volume of a closed surface.
pub fn mesh_volume((points, triangles): &(Vec<Vector3<f64>>, Vec<[usize; 3]>)) -> f64 {
    let corner = |[a, b, c]: &[usize; 3]| points[*a].dot(&points[*b].cross(&points[*c])) / 6.0;
    triangles.iter().map(corner).sum()
}

/// Formats the surface as a Wavefront OBJ file.
pub fn obj(unit: &str, (points, triangles): &(Vec<Vector3<f64>>, Vec<[usize; 3]>)) -> String {
    let mut text = format!("# workspace, lengths in {unit}\n");
    for point in points {
        text.push_str(&format!("v {} {} {}\n", point.x, point.y, point.z));
    }
    for [a, b, c] in triangles {
        text.push_str(&format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    }
    text
}

/// A volume, or an area in a plane, counted on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counted {
    /// Volume or area of the cells whose centers are within the limits.
    pub volume: f64,
    pub points: usize,
}

/// Counts the cells of a grid over a box that contains the body.
pub fn counted(workspace: &Workspace, corners: &[Vector3<f64>; 2], effort: &Effort) -> Counted {
    // Between two rays the body may extend a little further.
    let margin = Vector3::repeat(0.02 * (corners[1] - corners[0]).max());
    let (low, high) = (corners[0] - margin, corners[1] + margin);
    let axes = workspace.axes();
    let cell = (high - low).max() / effort.grid as f64;
    let is_moved = |k: usize| axes.contains(&k);
    let side = |k: usize| if is_moved(k) { ((high - low)[k] / cell).ceil() as usize } else { 1 };
    let count = Vector3::new(side(0), side(1), side(2));
    let columns: Vec<[usize; 2]> =
        (0..count.x).flat_map(|i| (0..count.y).map(move |j| [i, j])).collect();
    let middle = |k: usize, n: usize| match is_moved(k) {
        true => low[k] + (n as f64 + 0.5) * cell,
        false => corners[0][k],
    };
    let inside = |[i, j]: &[usize; 2]| {
        let at = |n: usize| Vector3::new(middle(0, *i), middle(1, *j), middle(2, n));
        let mut probe = workspace.probe();
        (0..count.z).filter(|n| probe.check(&at(*n)).is_ok()).count()
    };
    let cells: usize = effort.each(&columns, (0.5, 1.0), inside).into_iter().sum();
    let volume = cells as f64 * cell.powi(axes.len() as i32);
    Counted { volume, points: columns.len() * count.z }
}

/// Formats the ends of the rays as CSV.
pub fn csv(body: &Body) -> String {
    let header = ["direction_x", "direction_y", "direction_z", "distance", "x", "y", "z", "limit"];
    let crossings = |(_, ray)| Ray::crossings(ray).map(move |crossing| (ray, crossing));
    let row = |(ray, (distance, limit)): (&Ray, (f64, Border))| {
        let (direction, place) = (ray.direction, body.from + ray.direction * distance);
        let numbers = [direction.x, direction.y, direction.z, distance, place.x, place.y, place.z];
        numbers.map(|x| x.to_string()).into_iter().chain([limit.to_string()])
    };
    files::csv(&header, body.rays().flat_map(crossings).map(row))
}
