// SPDX-License-Identifier: GPL-2.0-or-later
//! Geometry of the legs at a pose: lengths, ends, directions and angles, distances between
//! legs, and positions of points of the platform.
//!
//! Paper 003 requires these of a design. It gives no convention for the direction of a rod; here
//! it points from base to platform, elevation = asin u_z above the XY plane, azimuth =
//! atan2(u_y, u_x) about Z.

use kinematics::{Fault, Nearest, Pose, Segment, Vector3};
use machine::read::legs::platform_anchor;
use machine::read::mechanism::Mechanism;

/// The machine and the points to evaluate at every pose.
pub struct View<'a> {
    config: &'a Mechanism,
    /// Points of the platform, in its frame, machine units.
    points: Vec<Vector3<f64>>,
    /// Diameter of the rods, machine units.
    diameter: f64,
}

/// A machine's legs at one pose. Lengths in machine units, angles in degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct Rods {
    /// The legs.
    pub rods: Vec<Rod>,
    /// Angles between legs, in the order of [`Mechanism::pairs`].
    pub between: Vec<f64>,
    /// The two nearest legs, and the gap between them: the distance of their center
    /// lines minus a diameter. `None` if all legs share an anchor.
    pub nearest: Option<Nearest>,
    /// The points, in the base frame.
    pub points: Vec<Vector3<f64>>,
}

/// One leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rod {
    /// Ends of the leg, in the base frame; the base end moves with carriage or arm.
    pub ends: Segment,
    /// Distance from joint to joint.
    pub length: f64,
    /// Elevation above the XY plane.
    pub elevation: f64,
    /// Azimuth about Z, from X.
    pub azimuth: f64,
    /// Angle from the direction at home, in the base frame.
    pub base_cone: f64,
    /// Angle from the direction at home, in the platform frame.
    pub platform_cone: f64,
    /// Angle between rod and guide, at most 90; `None` for other legs.
    pub guide: Option<f64>,
}

impl<'a> View<'a> {
    pub fn new(config: &'a Mechanism, points: Vec<Vector3<f64>>, diameter: f64) -> Self {
        Self { config, points, diameter }
    }

    /// Computes the legs at a pose.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn at(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Rods, Fault> {
        let at = self.config.machine.at(pose, tool)?;
        let cones = at.cones();
        let legs = &at.segments()[..self.config.legs()];
        let directions: Vec<_> = legs.iter().map(|leg| leg.span().normalize()).collect();
        let rod = |i: usize| Rod {
            ends: legs[i],
            length: legs[i].span().norm(),
            elevation: directions[i].z.clamp(-1.0, 1.0).asin().to_degrees(),
            azimuth: directions[i].y.atan2(directions[i].x).to_degrees(),
            base_cone: cones.base[i],
            platform_cone: cones.platform[i],
            guide: self.guide(i).map(|guide| lines_angle(&guide, &directions[i])),
        };
        let between = self.config.pairs();
        let between = between.iter().map(|[i, j]| angle(&directions[*i], &directions[*j]));
        let anchor = platform_anchor(&self.config.geometry.legs()[0], &legs[0], &at.rotation());
        let in_base = |point: &Vector3<f64>| legs[0].platform + at.rotation() * (point - anchor);
        let nearest = at.nearest();
        Ok(Rods {
            rods: (0..directions.len()).map(rod).collect(),
            between: between.collect(),
            nearest: nearest.map(|n| Nearest { distance: n.distance - self.diameter, ..n }),
            points: self.points.iter().map(in_base).collect(),
        })
    }

    fn guide(&self, leg: usize) -> Option<Vector3<f64>> {
        self.config.geometry.legs()[leg].kind.guide().map(Vector3::from)
    }

    /// Returns the names of the numbers of [`Rods::values`].
    pub fn names(&self) -> Vec<String> {
        let mut names = vec![];
        for i in 0..self.config.legs() {
            for end in ["base", "platform"] {
                names.extend(["x", "y", "z"].map(|axis| format!("{end}_{i}_{axis}")));
            }
            let own = ["length", "elevation", "azimuth", "base_cone", "platform_cone"];
            names.extend(own.map(|name| format!("{name}_{i}")));
            names.extend(self.guide(i).map(|_| format!("guide_angle_{i}")));
        }
        names.extend(self.config.pairs().iter().map(|[i, j]| format!("between_{i}_{j}")));
        names.extend(["gap", "gap_leg", "gap_other_leg"].map(String::from));
        for k in 0..self.points.len() {
            names.extend(["x", "y", "z"].map(|axis| format!("point_{k}_{axis}")));
        }
        names
    }
}

impl Rods {
    /// Returns all numbers in the order of [`View::names`]; `None` if there is no pair of legs.
    pub fn values(&self) -> Vec<Option<f64>> {
        let mut values: Vec<Option<f64>> = vec![];
        for rod in &self.rods {
            let ends = rod.ends.base.iter().chain(rod.ends.platform.iter());
            values.extend(ends.copied().map(Some));
            let own = [rod.length, rod.elevation, rod.azimuth, rod.base_cone, rod.platform_cone];
            values.extend(own.map(Some));
            values.extend(rod.guide.map(Some));
        }
        values.extend(self.between.iter().copied().map(Some));
        values.push(self.nearest.map(|n| n.distance));
        values.extend([0, 1].map(|k| self.nearest.map(|n| n.pair[k] as f64)));
        values.extend(self.points.iter().flat_map(|p| [p.x, p.y, p.z]).map(Some));
        values
    }
}

fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b)).to_degrees()
}

/// Returns the angle between lines, regardless of their direction.
fn lines_angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b).abs()).to_degrees()
}
