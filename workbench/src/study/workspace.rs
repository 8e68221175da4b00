// SPDX-License-Identifier: GPL-2.0-or-later
//! Where a machine can put its tool: the positions that it reaches in one orientation, or in every
//! one of a set, and what limits them.
//!
//! Everything is seen along rays from one place inside. A ray is followed in steps and every
//! crossing of a limit is halved down to rounding; what is thinner than a step can be missed. The
//! volume is the sum of the rays' pieces by their solid angles, islands and holes included, and
//! once more, independently, a count on a grid.

use crate::limits;
use crate::read::machine::{JointKind, MachineConfig};
use crate::study::file;
use kinematics::{
    Cause, Fault, LegKind, Letter, Limit, Limits, Margin, Matrix3, Part, Pose, Vector3,
};
use std::f64::consts::PI;
use std::fmt;

/// Halvings of a step: down to the rounding of a position.
const HALVINGS: usize = 48;

/// What a position breaks first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// The limit.
    pub limit: Limit,
    /// Of what.
    pub part: Part,
    /// Whether it is the lower end of the range that is left.
    pub is_low: bool,
}

impl Border {
    /// That nothing is reached beyond.
    const UNREACHED: Self = Self { limit: Limit::Reach, part: Part::Whole, is_low: true };

    fn of_fault(fault: &Fault) -> Self {
        let part = fault.number().map_or(Part::Whole, |leg| Part::Leg(leg.into()));
        let limit = match fault.cause {
            Cause::DeadPoint => Limit::DeadPoint,
            _ => Limit::Reach,
        };
        Self { limit, part, is_low: true }
    }

    fn of_margin(margin: &Margin) -> Self {
        let Margin { limit, part, value, range } = *margin;
        Self { limit, part, is_low: value < range[0] }
    }

    /// Name of its kind.
    pub const fn kind(&self) -> &'static str {
        match (self.limit, self.is_low) {
            (Limit::Reach, _) => "out of reach",
            (Limit::JointRange, true) => "joint at its lowest",
            (Limit::JointRange, false) => "joint at its highest",
            (limit, _) => limit.name(),
        }
    }

    /// Kinds of borders in one order.
    pub fn rank(&self) -> (usize, bool) {
        (self.limit.index(), self.limit == Limit::JointRange && !self.is_low)
    }
}

impl fmt::Display for Border {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.kind())?;
        match self.part {
            Part::Joint(i) => write!(f, " (joint {i})"),
            Part::Leg(i) => write!(f, " (leg {i})"),
            Part::Legs([i, j]) => write!(f, " ({i} and {j})"),
            Part::Axis(letter) => write!(f, " ({})", letter.name()),
            Part::Whole => Ok(()),
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
    limits: Limits,
    tool: Vector3<f64>,
    /// A B C in degrees.
    orientations: Vec<[f64; 3]>,
    /// Of the study, which may name axes that the machine's file does not.
    pyramids: [Vec<Pyramid>; 2],
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
    pub limit: Border,
    /// What stands at the ends of the other pieces, one each for their beginning and their end.
    pub others: Vec<[Border; 2]>,
    /// Positions looked at.
    pub looked: usize,
}

impl Ray {
    /// End of the first piece.
    pub fn exit(&self) -> f64 {
        self.inside[0][1]
    }

    /// Distance and limit of every crossing.
    pub fn crossings(&self) -> impl Iterator<Item = (f64, Border)> + '_ {
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
        let at = config.machine.at(&config.home_pose(), &tool)?;
        let legs = &at.segments()[..config.legs()];
        let home: Vec<_> = legs.iter().map(|leg| leg.span().normalize()).collect();
        let diameter = study.legs.rod_diameter_mm.map_or(0.0, |d| d.0 * config.units_per_mm);
        let mut limits = limits::beyond_axes(config);
        limits.clearance = limits.clearance.max(diameter);
        limits.conditioning = study.limits.conditioning.map_or(limits.conditioning, |c| c.0);
        Ok(Self {
            config,
            limits,
            tool,
            orientations,
            pyramids: [
                pyramids(config, &study.limits, End::Base, &home)?,
                pyramids(config, &study.limits, End::Platform, &home)?,
            ],
        })
    }

    /// Whether a position keeps the limits in every orientation.
    ///
    /// # Errors
    /// The first limit that it breaks.
    pub fn check(&self, position: &Vector3<f64>) -> Result<(), Border> {
        self.orientations.iter().try_for_each(|angles| self.check_one(position, angles))
    }

    fn check_one(&self, position: &Vector3<f64>, angles: &[f64; 3]) -> Result<(), Border> {
        let [a, b, c] = *angles;
        let pose = Pose::from_degrees([position.x, position.y, position.z, a, b, c]);
        let machine = &self.config.machine;
        // Most positions are beyond the range of a joint, which takes the least time to see.
        let joints = machine.inverse(&pose, &self.tool).map_err(|f| Border::of_fault(&f))?;
        limits::check_joints(self.config, &joints, &self.limits)
            .map_err(|margin| Border::of_margin(&margin))?;
        let at = machine.at(&pose, &self.tool).map_err(|f| Border::of_fault(&f))?;
        limits::check(&at, &self.limits).map_err(|margin| Border::of_margin(&margin))?;
        let ends = [Limit::BasePyramid, Limit::PlatformPyramid];
        for (limit, (pyramids, turn)) in
            ends.into_iter().zip(self.pyramids.iter().zip([Matrix3::identity(), at.rotation()]))
        {
            let outside = pyramids
                .iter()
                .zip(at.segments())
                .position(|(pyramid, leg)| !pyramid.holds(&turn.tr_mul(&leg.span().normalize())));
            if let Some(i) = outside {
                return Err(Border { limit, part: Part::Leg(i), is_low: false });
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
        let end = (self.extent(), Border::UNREACHED);
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
    at: &impl Fn(f64) -> Result<(), Border>,
    (mut low, mut high): (f64, f64),
    leaves: bool,
    outside: Option<Border>,
) -> (f64, Border) {
    let mut limit = outside.unwrap_or(Border::UNREACHED);
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
