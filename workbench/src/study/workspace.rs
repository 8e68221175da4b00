// SPDX-License-Identifier: GPL-2.0-or-later
//! Where a machine can put its tool: the positions that it reaches in one orientation, or in every
//! one of a set, and what limits them.
//!
//! Everything is seen along rays from one place inside. A ray is followed in steps and every
//! crossing of a limit is halved down to rounding; what is thinner than a step can be missed. The
//! volume is the sum of the rays' pieces by their solid angles, islands and holes included, and
//! once more, independently, a count on a grid.

use crate::limits::least_distance;
use crate::read::machine::{JointKind, MachineConfig};
use crate::study::file;
use crate::study::stance::Stance;
use kinematics::{Fault, LegKind, Letter, Pose, Segment, Vector3, Watch};
use std::f64::consts::PI;
use std::fmt;

/// Halvings of a step: down to the rounding of a position.
const HALVINGS: usize = 48;

/// What a position breaks first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// There are no joint values: a rod too short, a strut without length.
    Reach(Option<usize>),
    /// A joint at its lowest value.
    JointLow(usize),
    /// A joint at its highest value.
    JointHigh(usize),
    /// A leg leans too much at its base joint.
    BaseCone(usize),
    /// A leg leans too much at its platform joint.
    PlatformCone(usize),
    /// A leg turns too far about an axis of its base joint.
    BasePyramid(usize),
    /// A leg turns too far about an axis of its platform joint.
    PlatformPyramid(usize),
    /// Two legs come too near.
    Gap([usize; 2]),
    /// The legs hold the platform too badly.
    Conditioning,
}

impl Limit {
    /// Kinds in the order of [`Limit::kind`].
    pub const KINDS: [&'static str; 9] = [
        "out of reach",
        "joint at its lowest",
        "joint at its highest",
        "base cone",
        "platform cone",
        "base pyramid",
        "platform pyramid",
        "gap of legs",
        "conditioning",
    ];

    /// Number of its kind.
    pub const fn kind(self) -> usize {
        match self {
            Self::Reach(_) => 0,
            Self::JointLow(_) => 1,
            Self::JointHigh(_) => 2,
            Self::BaseCone(_) => 3,
            Self::PlatformCone(_) => 4,
            Self::BasePyramid(_) => 5,
            Self::PlatformPyramid(_) => 6,
            Self::Gap(_) => 7,
            Self::Conditioning => 8,
        }
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(Self::KINDS[self.kind()])?;
        match self {
            Self::JointLow(i) | Self::JointHigh(i) => write!(f, " (joint {i})"),
            Self::Reach(Some(i))
            | Self::BaseCone(i)
            | Self::PlatformCone(i)
            | Self::BasePyramid(i)
            | Self::PlatformPyramid(i) => {
                write!(f, " (leg {i})")
            }
            Self::Gap([i, j]) => write!(f, " ({i} and {j})"),
            Self::Reach(None) | Self::Conditioning => Ok(()),
        }
    }
}

/// Why there is no workspace to look at.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoWorkspace {
    /// A machine without X, Y or Z.
    #[error("no joint moves {0}: there is no space to look at")]
    Held(char),
    /// Home is out of reach.
    #[error(transparent)]
    Home(#[from] Fault),
    /// Axes of another machine.
    #[error("{key}: expected {expected} axes; found {found}")]
    Axes {
        /// The key of the study.
        key: String,
        /// One a leg.
        expected: usize,
        /// How many the study has.
        found: usize,
    },
    /// A leg whose turns are limited about nobody knows what.
    #[error("{end}_pyramid_deg: leg {leg} has no axis; name {end}_axes")]
    NoAxis {
        /// Base or platform.
        end: &'static str,
        /// The leg.
        leg: usize,
    },
}

/// The limits of a machine, and the orientations in which a position has to keep them.
pub struct Workspace<'a> {
    config: &'a MachineConfig,
    watch: Watch,
    tool: Vector3<f64>,
    /// A B C in degrees.
    orientations: Vec<[f64; 3]>,
    home: Vec<Vector3<f64>>,
    base_pyramids: Vec<Pyramid>,
    platform_pyramids: Vec<Pyramid>,
    /// Least distance of the centre lines.
    gap: f64,
    conditioning: Option<f64>,
}

/// A cardan joint: how far a leg may turn about its fixed axis and across it, both seen from what
/// the axis is fixed in.
struct Pyramid {
    axis: Vector3<f64>,
    home: Vector3<f64>,
    /// Degrees.
    most: [f64; 2],
}

impl Pyramid {
    /// Turns of the leg about the fixed axis and about the moving one, degrees.
    fn turns(&self, leg: &Vector3<f64>) -> [f64; 2] {
        let about = self.axis.dot(&self.home.cross(leg)).atan2(leg.dot(&self.home));
        let across = leg.dot(&self.axis).clamp(-1.0, 1.0).asin();
        [about.to_degrees(), across.to_degrees()]
    }

    fn holds(&self, leg: &Vector3<f64>) -> bool {
        self.turns(leg).iter().zip(self.most).all(|(turn, most)| turn.abs() <= most)
    }
}

/// What is seen along a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct Ray {
    /// Unit vector.
    pub direction: Vector3<f64>,
    /// Pieces within the limits, from and to, machine units; the first one begins at 0.
    pub inside: Vec<[f64; 2]>,
    /// What ends the first piece.
    pub limit: Limit,
    /// What stands at the ends of the other pieces, one each for their beginning and their end.
    pub others: Vec<[Limit; 2]>,
    /// Positions looked at.
    pub looked: usize,
}

impl Ray {
    /// End of the first piece.
    pub fn exit(&self) -> f64 {
        self.inside[0][1]
    }

    /// Distance and limit of every crossing.
    pub fn crossings(&self) -> impl Iterator<Item = (f64, Limit)> + '_ {
        let first = (self.exit(), self.limit);
        let others = self.inside[1..].iter().zip(&self.others);
        let others = others.flat_map(|(ends, limits)| ends.iter().copied().zip(*limits));
        std::iter::once(first).chain(others)
    }
}

impl<'a> Workspace<'a> {
    /// Of a machine, in one orientation or several, with the limits of its INI file and those of a
    /// study.
    ///
    /// # Errors
    /// See [`NoWorkspace`].
    pub fn new(
        config: &'a MachineConfig,
        tool: Vector3<f64>,
        orientations: Vec<[f64; 3]>,
        study: &file::Study,
    ) -> Result<Self, NoWorkspace> {
        let layout = config.machine.layout();
        if let Some(held) = Letter::ALL[..3].iter().find(|letter| layout.is_held(**letter)) {
            return Err(NoWorkspace::Held(held.name()));
        }
        let stance = Stance::new(config, config.home_pose(), tool)?;
        let home: Vec<_> = (0..config.legs()).map(|i| stance.direction(i)).collect();
        let diameter = study.legs.rod_diameter_mm.map_or(0.0, |d| d.0 * config.units_per_mm);
        let gap = diameter.max(least_distance(config));
        Ok(Self {
            config,
            watch: config.machine.watch().clone(),
            tool,
            orientations,
            base_pyramids: pyramids(config, &study.limits, End::Base, &home)?,
            platform_pyramids: pyramids(config, &study.limits, End::Platform, &home)?,
            home,
            gap,
            conditioning: study.limits.conditioning.map(|c| c.0),
        })
    }

    /// Whether a position keeps the limits in every orientation.
    ///
    /// # Errors
    /// The first limit that it breaks.
    pub fn check(&self, position: &Vector3<f64>) -> Result<(), Limit> {
        self.orientations.iter().try_for_each(|angles| self.check_one(position, angles))
    }

    fn check_one(&self, position: &Vector3<f64>, angles: &[f64; 3]) -> Result<(), Limit> {
        let [a, b, c] = *angles;
        let pose = Pose::from_degrees([position.x, position.y, position.z, a, b, c]);
        let machine = &self.config.machine;
        let of_reach = |fault: Fault| Limit::Reach(fault.number().map(usize::from));
        let joints = machine.inverse(&pose, &self.tool).map_err(of_reach)?;
        for (i, (joint, value)) in self.config.joints.iter().zip(joints).enumerate() {
            if !(value >= joint.min) {
                return Err(Limit::JointLow(i));
            }
            if !(value <= joint.max) {
                return Err(Limit::JointHigh(i));
            }
        }
        let legs = machine.segments(&pose, &self.tool).map_err(of_reach)?;
        self.check_joints(&pose, &legs)?;
        if let Some(nearest) = self.watch.nearest(&legs)
            && !(nearest.distance >= self.gap)
        {
            return Err(Limit::Gap(nearest.pair));
        }
        match self.conditioning {
            Some(least) => match machine.conditioning(&pose, &self.tool) {
                Ok(value) if value >= least => Ok(()),
                _ => Err(Limit::Conditioning),
            },
            None => Ok(()),
        }
    }

    fn check_joints(&self, pose: &Pose, legs: &[Segment]) -> Result<(), Limit> {
        let rotation = pose.rotation();
        for (i, home) in self.home.iter().enumerate() {
            let leg = (legs[i].platform - legs[i].base).normalize();
            if !(leg.dot(home) >= least_cosine(self.config.base_cone[i])) {
                return Err(Limit::BaseCone(i));
            }
            if !(leg.dot(&(rotation * home)) >= least_cosine(self.config.platform_cone[i])) {
                return Err(Limit::PlatformCone(i));
            }
            if !self.base_pyramids.get(i).is_none_or(|pyramid| pyramid.holds(&leg)) {
                return Err(Limit::BasePyramid(i));
            }
            let seen = rotation.tr_mul(&leg);
            if !self.platform_pyramids.get(i).is_none_or(|pyramid| pyramid.holds(&seen)) {
                return Err(Limit::PlatformPyramid(i));
            }
        }
        Ok(())
    }

    /// No position within the limits is farther than this from another one, by the machine's size.
    pub fn extent(&self) -> f64 {
        let joints = self.config.joints.iter().filter(|joint| joint.kind != JointKind::Arm);
        let travel = joints.map(|j| (j.max - j.min).max(j.max.abs()).max(j.min.abs()));
        2.0 * self.config.machine.size() + travel.fold(0.0, f64::max)
    }

    /// A ray from a place inside, followed in steps of a length to the end of the extent.
    pub fn ray(&self, from: &Vector3<f64>, direction: &Vector3<f64>, step: f64) -> Ray {
        let at = |distance: f64| self.check(&(from + direction * distance));
        let steps = (self.extent() / step).ceil() as usize;
        let mut looked = 0;
        let mut crossings = vec![];
        let mut before = Ok(());
        for k in 1..=steps {
            let now = at(step * k as f64);
            looked += 1;
            if now.is_ok() != before.is_ok() {
                looked += HALVINGS;
                let ends = (step * (k - 1) as f64, step * k as f64);
                crossings.push(crossing(&at, ends, before.is_ok(), now.or(before).err()));
            }
            before = now;
        }
        let of = |k: usize| crossings.get(k).copied();
        let end = (self.extent(), Limit::Reach(None));
        let (exit, limit) = of(0).unwrap_or(end);
        let mut ray =
            Ray { direction: *direction, inside: vec![[0.0, exit]], limit, others: vec![], looked };
        for k in (1..crossings.len()).step_by(2) {
            let (from, to) = (crossings[k], of(k + 1).unwrap_or(end));
            ray.inside.push([from.0, to.0]);
            ray.others.push([from.1, to.1]);
        }
        ray
    }
}

/// Where the limits are crossed between two places, and what is broken on the outer side.
fn crossing(
    at: &impl Fn(f64) -> Result<(), Limit>,
    (mut low, mut high): (f64, f64),
    leaves: bool,
    outside: Option<Limit>,
) -> (f64, Limit) {
    let mut limit = outside.unwrap_or(Limit::Reach(None));
    for _ in 0..HALVINGS {
        let middle = (low + high) / 2.0;
        let found = at(middle);
        if let Err(broken) = found {
            limit = broken;
        }
        match found.is_ok() == leaves {
            true => low = middle,
            false => high = middle,
        }
    }
    (if leaves { low } else { high }, limit)
}

fn least_cosine(cone: Option<f64>) -> f64 {
    cone.map_or(-2.0, |degrees| degrees.to_radians().cos())
}

/// The two ends of a leg.
#[derive(Clone, Copy)]
enum End {
    Base,
    Platform,
}

fn pyramids(
    config: &MachineConfig,
    limits: &file::Limits,
    end: End,
    home: &[Vector3<f64>],
) -> Result<Vec<Pyramid>, NoWorkspace> {
    let (name, most, axes) = match end {
        End::Base => ("base", limits.base_pyramid_deg, &limits.base_axes),
        End::Platform => ("platform", limits.platform_pyramid_deg, &limits.platform_axes),
    };
    let given = axes.as_deref().unwrap_or(&[]);
    if !given.is_empty() && given.len() != home.len() {
        let (expected, found) = (home.len(), given.len());
        return Err(NoWorkspace::Axes { key: format!("{name}_axes"), expected, found });
    }
    let Some(most) = most else { return Ok(vec![]) };
    let axis = |i: usize| -> Result<Vector3<f64>, NoWorkspace> {
        let strut = match (config.geometry.legs()[i].kind, end) {
            (LegKind::Strut(strut), End::Base) => Some(strut.base_axis),
            (LegKind::Strut(strut), End::Platform) => Some(strut.platform_axis),
            _ => None,
        };
        let axis = Vector3::from(given.get(i).copied().or(strut).unwrap_or_default());
        match axis.norm() > 0.0 {
            true => Ok(axis.normalize()),
            false => Err(NoWorkspace::NoAxis { end: name, leg: i }),
        }
    };
    // The platform is level at home: there both ends see the leg alike.
    let pyramid = |(i, home): (usize, &Vector3<f64>)| {
        axis(i).map(|axis| Pyramid { axis, home: *home, most: most.map(|m| m.0) })
    };
    home.iter().enumerate().map(pyramid).collect()
}

/// Level, and tilted by an angle in `directions` directions about Z, without a turn about the
/// tool: A B C in degrees; those that the machine can take.
pub fn tilts(config: &MachineConfig, tilt: f64, directions: usize) -> Vec<[f64; 3]> {
    let held = |letter| config.machine.layout().is_held(letter);
    let mut all = vec![[0.0; 3]];
    for k in 0..directions {
        let azimuth = 2.0 * PI * k as f64 / directions as f64;
        let (sin, cos) = tilt.to_radians().sin_cos();
        let z = Vector3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos);
        let (a, b) = (-z.y.asin().to_degrees(), z.x.atan2(z.z).to_degrees());
        // Rounding of the sine.
        let moves = |letter, angle: f64| angle.abs() < 1e-9 || !held(letter);
        if moves(Letter::A, a) && moves(Letter::B, b) {
            all.push([
                if held(Letter::A) { 0.0 } else { a },
                if held(Letter::B) { 0.0 } else { b },
                0.0,
            ]);
        }
    }
    all
}
