// SPDX-License-Identifier: GPL-2.0-or-later
//! Slices of a workspace, sampled along rays in a plane.

use crate::study::body::Effort;
use crate::study::workspace::{Border, Ray, Workspace};
use kinematics::Vector3;
use std::f64::consts::PI;

/// A plane through the origin of the rays.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    pub name: String,
    /// Unit vectors in horizontal and vertical direction of the drawing.
    pub axes: [Vector3<f64>; 2],
}

impl Plane {
    /// Parses `xy`, `xz`, `yz`, or the three components of a normal, separated by commas.
    pub fn parse(text: &str) -> Option<Self> {
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let axes = match text.to_ascii_lowercase().as_str() {
            "xy" => [x, y],
            "xz" => [x, z],
            "yz" => [y, z],
            _ => {
                let words: Vec<f64> =
                    text.split(',').map(|w| w.trim().parse()).collect::<Result<_, _>>().ok()?;
                let [a, b, c] = words[..] else { return None };
                let normal = Vector3::new(a, b, c).try_normalize(0.0)?;
                // The first axis is level, the second as steep as the plane allows.
                let across = z.cross(&normal).try_normalize(1e-9).unwrap_or(x);
                [across, normal.cross(&across)]
            }
        };
        Some(Self { name: text.to_ascii_uppercase(), axes })
    }
}

/// A slice of a workspace.
#[derive(Clone, Debug)]
pub struct Slice {
    pub plane: Plane,
    /// Origin of the rays.
    pub from: Vector3<f64>,
    /// Rays, evenly around.
    pub rays: Vec<Ray>,
}

impl Slice {
    /// Samples a slice from a point inside, along `rays` rays.
    pub fn seen(
        workspace: &Workspace,
        plane: Plane,
        from: Vector3<f64>,
        rays: usize,
        effort: &Effort,
    ) -> Self {
        let direction = |k: usize| {
            let (sin, cos) = (2.0 * PI * k as f64 / rays as f64).sin_cos();
            plane.axes[0] * cos + plane.axes[1] * sin
        };
        let directions: Vec<_> = (0..rays).map(direction).collect();
        let look = |direction: &Vector3<f64>| workspace.ray(&from, direction, effort.step);
        let rays = effort.each(&directions, (1.0, 1.0), look);
        Self { plane, from, rays }
    }

    pub fn area(&self) -> f64 {
        let angle = 2.0 * PI / self.rays.len() as f64;
        let piece = |[from, to]: &[f64; 2]| (to * to - from * from) / 2.0;
        self.rays.iter().flat_map(|ray| &ray.inside).map(piece).sum::<f64>() * angle
    }

    /// Returns the crossings in coordinates of the plane, from the machine's origin, with their limit.
    pub fn outline(&self) -> Vec<([f64; 2], Border)> {
        let point = |ray: &Ray, distance: f64| {
            let place = self.from + ray.direction * distance;
            self.plane.axes.map(|axis| axis.dot(&place))
        };
        let crossings = |ray: &Ray| -> Vec<_> {
            ray.crossings().map(|(distance, limit)| (point(ray, distance), limit)).collect()
        };
        self.rays.iter().flat_map(crossings).collect()
    }

    /// Returns the angles between which the slice is visible from the machine's origin (projected on the plane),
    /// in degrees from the plane's first axis; `None` if the origin lies inside it.
    pub fn sector(&self) -> Option<[f64; 2]> {
        let from = self.plane.axes.map(|axis| axis.dot(&self.from));
        let towards = from[1].atan2(from[0]);
        let beside = |[x, y]: [f64; 2]| {
            let angle = y.atan2(x) - towards;
            angle - 2.0 * PI * (angle / (2.0 * PI)).round()
        };
        let angles: Vec<f64> = self.outline().iter().map(|(point, _)| beside(*point)).collect();
        let low = angles.iter().copied().fold(f64::INFINITY, f64::min);
        let high = angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let seen = high - low < PI && from.iter().any(|value| *value != 0.0);
        seen.then(|| [low, high].map(|angle| (angle + towards).to_degrees()))
    }
}
