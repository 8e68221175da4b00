// SPDX-License-Identifier: GPL-2.0-or-later
//! Where the legs are at a pose: lengths, ends, directions and angles, how near they come to
//! each other, and where points of the platform are.
//!
//! Paper 003 asks for these of a design. It gives no convention for the direction of a rod; here
//! it points from base to platform, elevation = asin u_z above the XY plane, azimuth =
//! atan2(u_y, u_x) about Z.

use crate::read::machine::MachineConfig;
use crate::study::stance::Stance;
use kinematics::{Fault, LegKind, MAX_LEGS, Nearest, Pose, Segment, Vector3, Watch};

/// What is asked of a machine at every pose.
pub struct View<'a> {
    config: &'a MachineConfig,
    watch: Watch,
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
    /// Angles between legs, in the order of [`pairs`].
    pub between: Vec<f64>,
    /// The two legs that are nearest, and the gap between them: the distance of their centre
    /// lines without a diameter. `None` where all legs share an anchor.
    pub nearest: Option<Nearest>,
    /// The points, in base.
    pub points: Vec<Vector3<f64>>,
}

/// One leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rod {
    /// Its ends, in base; that at the base moves with carriage or arm.
    pub ends: Segment,
    /// From joint to joint.
    pub length: f64,
    /// Above the XY plane.
    pub elevation: f64,
    /// About Z, from X.
    pub azimuth: f64,
    /// From its direction at home, seen in base.
    pub base_cone: f64,
    /// From its direction at home, seen in the platform.
    pub platform_cone: f64,
    /// Between rod and guide, at most 90; `None` for other legs.
    pub guide: Option<f64>,
}

/// All pairs of legs, lower number first.
pub fn pairs(legs: usize) -> Vec<[usize; 2]> {
    (0..legs).flat_map(|i| (i + 1..legs).map(move |j| [i, j])).collect()
}

impl<'a> View<'a> {
    /// Of this machine.
    pub fn new(config: &'a MachineConfig, points: Vec<Vector3<f64>>, diameter: f64) -> Self {
        let watch = config.machine.watch().clone();
        Self { config, watch, points, diameter }
    }

    /// The legs at a pose.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn at(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Rods, Fault> {
        let stance = Stance::new(self.config, *pose, *tool)?;
        let cones = self.config.cone_angles(pose, tool)?;
        let directions: Vec<_> = (0..stance.legs.len()).map(|i| stance.direction(i)).collect();
        let rod = |i: usize| Rod {
            ends: stance.legs[i],
            length: (stance.legs[i].platform - stance.legs[i].base).norm(),
            elevation: directions[i].z.clamp(-1.0, 1.0).asin().to_degrees(),
            azimuth: directions[i].y.atan2(directions[i].x).to_degrees(),
            base_cone: cones.base[i],
            platform_cone: cones.platform[i],
            guide: self.guide(i).map(|guide| lines_angle(&guide, &directions[i])),
        };
        let between = pairs(directions.len());
        let between = between.iter().map(|[i, j]| angle(&directions[*i], &directions[*j]));
        Ok(Rods {
            rods: (0..directions.len()).map(rod).collect(),
            between: between.collect(),
            nearest: self.nearest(&stance.legs),
            points: self.points.iter().map(|point| stance.in_base(point)).collect(),
        })
    }

    fn guide(&self, leg: usize) -> Option<Vector3<f64>> {
        match self.config.geometry.legs()[leg].kind {
            LegKind::Slider(slider) => Some(Vector3::from(slider.guide)),
            _ => None,
        }
    }

    fn nearest(&self, legs: &[Segment]) -> Option<Nearest> {
        let all: [Segment; MAX_LEGS] = std::array::from_fn(|i| legs[i.min(legs.len() - 1)]);
        let nearest = self.watch.nearest(&all)?;
        Some(Nearest { distance: nearest.distance - self.diameter, ..nearest })
    }

    /// Names of the numbers of [`Rods::values`].
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
        names.extend(pairs(self.config.legs()).iter().map(|[i, j]| format!("between_{i}_{j}")));
        names.extend(["gap", "gap_leg", "gap_other_leg"].map(String::from));
        for k in 0..self.points.len() {
            names.extend(["x", "y", "z"].map(|axis| format!("point_{k}_{axis}")));
        }
        names
    }
}

impl Rods {
    /// All numbers in the order of [`View::names`]; `None` where there is no pair of legs.
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

/// Between lines, whichever way they point.
fn lines_angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b).abs()).to_degrees()
}
