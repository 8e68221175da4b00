// SPDX-License-Identifier: GPL-2.0-or-later
//! Workspace: the positions that a machine reaches in one orientation, or in every one of a set of
//! orientations, and the limits that bound it.
//!
//! It is sampled along rays from one point inside. A ray is followed in steps, and every
//! crossing of a limit is bisected down to rounding; parts thinner than a step can be missed. The
//! volume is the sum of the rays' segments times their solid angles, islands and holes included;
//! a count on a grid computes it again, independently. On a planar machine all rays are in its plane,
//! and both compute the area.

use crate::study::file;
use kinematics::{
    At, Cause, Fault, Gap, Letter, Limit, Limits, Machine, Margin, Part, Pose, Vector3,
};
use machine::limits;
use machine::read::joints::JointKind;
use machine::read::mechanism::Mechanism;
use std::f64::consts::PI;
use std::fmt;

/// Halvings of a step: down to the rounding of a position.
const HALVINGS: usize = 48;

/// The limit that a position violates first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    pub limit: Limit,
    pub part: Part,
    /// Whether the lower end of the range is violated.
    pub is_low: bool,
    /// Whether it is the distance to another mechanism, which is not one of the machine's own limits.
    pub is_between: bool,
}

impl Border {
    /// The border beyond which no pose is reachable.
    const UNREACHED: Self =
        Self { limit: Limit::Reach, part: Part::Whole, is_low: true, is_between: false };

    /// Another mechanism is too near.
    const BETWEEN: Self =
        Self { limit: Limit::Clearance, part: Part::Whole, is_low: true, is_between: true };

    fn of_fault(fault: &Fault) -> Self {
        let part = fault.number().map_or(Part::Whole, |leg| Part::Leg(leg.into()));
        let limit = match fault.cause {
            Cause::DeadPoint => Limit::DeadPoint,
            _ => Limit::Reach,
        };
        Self { limit, part, ..Self::UNREACHED }
    }

    fn of_margin(margin: &Margin) -> Self {
        let Margin { limit, part, value, range } = *margin;
        let is_low = value < range[0] && !limits::is_either_way(limit);
        Self { limit, part, is_low, is_between: false }
    }

    pub const fn kind(&self) -> &'static str {
        match (self.limit, self.is_low) {
            _ if self.is_between => "the other mechanism too near",
            (Limit::Reach, _) => "out of reach",
            (Limit::JointRange, true) => "joint at its lowest",
            (Limit::JointRange, false) => "joint at its highest",
            (limit, _) => limit.name(),
        }
    }

    /// Returns the rank of a border's kind in a fixed order.
    pub fn rank(&self) -> (usize, bool) {
        if self.is_between {
            return (Limit::ALL.len(), false);
        }
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

/// Why there is no workspace.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoWorkspace {
    #[error("the joints move none or one of X, Y and Z, so there is no workspace")]
    Held,
    #[error(transparent)]
    Home(#[from] Fault),
    #[error("{key}: expected {expected} axes; found {found}")]
    Axes { key: String, expected: usize, found: usize },
    #[error("{end}_pyramid_deg: leg {leg} has no axis; add {end}_axes")]
    NoAxis { end: &'static str, leg: usize },
    #[error(
        "{end}_axes: leg {leg} has a pyramid about another axis in the INI file; use that axis, or \
         remove {end}_axes"
    )]
    OtherAxis { end: &'static str, leg: usize },
}

/// The limits of a machine, and the orientations in which a position must satisfy them.
pub struct Workspace<'a> {
    config: &'a Mechanism,
    /// The machine with the joint axes of the study.
    machine: Machine,
    limits: Limits,
    tool: Vector3<f64>,
    /// A B C in radians.
    orientations: Vec<Vector3<f64>>,
    other: Option<Other<'a>>,
}

/// Another mechanism on the same base, and its poses.
struct Other<'a> {
    config: &'a Mechanism,
    poses: Vec<Pose>,
    /// Smallest permitted distance.
    clearance: f64,
}

/// Poses of the other one of two mechanisms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stand {
    Home,
    /// At home, and in every corner of its axis limits that it reaches, one after another.
    Anywhere,
}

/// A machine that moves from position to position without allocating.
pub struct Probe<'a> {
    workspace: &'a Workspace<'a>,
    at: At<'a>,
    /// The other mechanism at each of its poses, with the corners of its bounding box.
    others: Vec<(At<'a>, [Vector3<f64>; 2])>,
}

/// Result of following a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct Ray {
    /// Unit vector.
    pub direction: Vector3<f64>,
    /// Segments within the limits, from and to, machine units; the first one begins at 0.
    pub inside: Vec<[f64; 2]>,
    /// Limit at the end of the first segment.
    pub limit: Border,
    /// Limits at the ends of the other segments, one each for their beginning and their end.
    pub others: Vec<[Border; 2]>,
    pub looked: usize,
}

impl Ray {
    /// Returns the end of the first segment.
    pub fn exit(&self) -> f64 {
        self.inside[0][1]
    }

    /// Returns distance and limit of every crossing.
    pub fn crossings(&self) -> impl Iterator<Item = (f64, Border)> + '_ {
        let first = (self.exit(), self.limit);
        let others = self.inside[1..].iter().zip(&self.others);
        let others = others.flat_map(|(ends, limits)| ends.iter().copied().zip(*limits));
        std::iter::once(first).chain(others)
    }
}

impl<'a> Workspace<'a> {
    /// Creates the workspace of a machine, in one or several orientations, with the limits of its INI file and
    /// those of a study.
    ///
    /// # Errors
    /// See [`NoWorkspace`].
    pub fn new(
        config: &'a Mechanism,
        tool: Vector3<f64>,
        orientations: Vec<[f64; 3]>,
        study: &file::Study,
    ) -> Result<Self, NoWorkspace> {
        if lengths(config).len() < 2 {
            return Err(NoWorkspace::Held);
        }
        config.machine.inverse(&config.home_pose(), &tool)?;
        let diameter = study.legs.rod_diameter_mm.map_or(0.0, |d| d.0 * config.units_per_mm);
        let mut limits = limits::beyond_axes(config);
        limits.clearance = limits.clearance.max(diameter);
        limits.conditioning = study.limits.conditioning.map_or(limits.conditioning, |c| c.0);
        let base = pyramid(config, &study.limits, End::Base, &mut limits.base_pyramid)?;
        let platform = pyramid(config, &study.limits, End::Platform, &mut limits.platform_pyramid)?;
        // Another fault depends on the position, and bounds the workspace.
        let home = config.home;
        for [a, b, c] in &orientations {
            let pose = Pose::from_degrees([home[0], home[1], home[2], *a, *b, *c]);
            match config.machine.inverse(&pose, &tool) {
                Err(fault) if fault.cause == Cause::DependentGiven => return Err(fault.into()),
                _ => (),
            }
        }
        let radians = |[a, b, c]: [f64; 3]| Pose::from_degrees([0.0, 0.0, 0.0, a, b, c]).angles;
        Ok(Self {
            config,
            machine: config.machine.clone().with_joint_axes([base, platform]),
            limits,
            tool,
            orientations: orientations.into_iter().map(radians).collect(),
            other: None,
        })
    }

    /// Adds the distance `[PKM]MECHANISM_CLEARANCE` from the other of two mechanisms, of which `first` is the
    /// first, at each of its possible poses, without a tool.
    ///
    /// # Errors
    /// The other mechanism cannot be at home.
    pub fn beside(
        mut self,
        first: &Mechanism,
        other: &'a Mechanism,
        stand: Stand,
    ) -> Result<Self, NoWorkspace> {
        other.machine.inverse(&other.home_pose(), &other.spindle)?;
        let mut poses = vec![other.home_pose()];
        if stand == Stand::Anywhere {
            poses.extend(corners(other).into_iter().map(Pose::from_degrees));
            poses.retain(|pose| other.machine.inverse(pose, &other.spindle).is_ok());
        }
        let clearance = limits::least_distance_between(first);
        self.other = Some(Other { config: other, poses, clearance });
        Ok(self)
    }

    /// Returns which of X, Y and Z the machine moves, as indices: all of them, or two on a planar machine.
    pub fn axes(&self) -> Vec<usize> {
        lengths(self.config)
    }

    /// Returns every plane of two of these axes.
    pub fn planes(&self) -> Vec<[usize; 2]> {
        let axes = self.axes();
        let is_moved = |plane: &[usize; 2]| plane.iter().all(|k| axes.contains(k));
        [[0, 1], [0, 2], [1, 2]].into_iter().filter(is_moved).collect()
    }

    /// Checks whether a position satisfies the limits in every orientation.
    ///
    /// # Errors
    /// Returns the first limit that it violates.
    pub fn check(&self, position: &Vector3<f64>) -> Result<(), Border> {
        self.probe().check(position)
    }

    /// Creates a probe, for checks of many positions.
    pub(crate) fn probe(&self) -> Probe<'_> {
        let others = self.other.iter().flat_map(|other| {
            let at = |pose| other.config.machine.at(pose, &other.config.spindle).ok();
            other.poses.iter().filter_map(at)
        });
        let corners = others.clone().map(|at| corners_of(&at));
        let others = others.zip(corners).collect();
        Probe { workspace: self, at: self.machine.nowhere(), others }
    }

    /// Returns home, or, if home is not within the limits, the first corner of the axis limits that is.
    pub fn place_inside(&self) -> Option<Vector3<f64>> {
        let corners = corners(self.config).into_iter();
        let places = corners.map(|[x, y, z, ..]| Vector3::new(x, y, z));
        let mut all = std::iter::once(self.config.home_pose().position).chain(places);
        all.find(|place| self.check(place).is_ok())
    }

    /// Returns a bound of the distance between two positions within the limits, from the machine's size.
    pub fn extent(&self) -> f64 {
        let joints = self.config.joints.iter().filter(|joint| joint.kind != JointKind::Arm);
        let travel = joints.map(|j| (j.max - j.min).max(j.max.abs()).max(j.min.abs()));
        2.0 * self.config.machine.size() + travel.fold(0.0, f64::max)
    }

    /// Follows a ray from a point inside in steps of a length to the end of the extent.
    pub fn ray(&self, from: &Vector3<f64>, direction: &Vector3<f64>, step: f64) -> Ray {
        let mut probe = self.probe();
        let mut at = |distance: f64| probe.check(&(from + direction * distance));
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
                crossings.push(crossing(&mut at, ends, before.is_ok(), now.or(before).err()));
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

impl Probe<'_> {
    /// Checks a position as [`Workspace::check`] does.
    ///
    /// # Errors
    /// See [`Workspace::check`].
    pub(crate) fn check(&mut self, position: &Vector3<f64>) -> Result<(), Border> {
        let Self { workspace, at, others } = self;
        workspace.orientations.iter().try_for_each(|angles| {
            let pose = Pose { position: *position, angles: *angles };
            at.move_to(&pose, &workspace.tool).map_err(|fault| Border::of_fault(&fault))?;
            at.check(&workspace.limits).map_err(|margin| Border::of_margin(&margin))?;
            let Some(Other { clearance, .. }) = workspace.other else { return Ok(()) };
            let own = corners_of(at);
            let near = |(_, other): &&(At, [Vector3<f64>; 2])| {
                let apart = (own[0] - other[1]).sup(&(other[0] - own[1]));
                !(apart.max() >= clearance)
            };
            let is_near =
                |(other, _): &(At, _)| !(Gap::within(at, other, clearance).distance >= clearance);
            match others.iter().filter(near).any(is_near) {
                true => Err(Border::BETWEEN),
                false => Ok(()),
            }
        })
    }
}

/// Returns which of X, Y and Z a machine moves, as indices.
pub fn lengths(config: &Mechanism) -> Vec<usize> {
    let layout = config.machine.layout();
    (0..3).filter(|k| !layout.is_held(Letter::ALL[*k])).collect()
}

/// Returns the corners of a bounding box of the legs, and so of the platform, at a pose.
fn corners_of(at: &At) -> [Vector3<f64>; 2] {
    let legs = at.segments().iter().take(at.layout().legs());
    let ends = legs.flat_map(|leg| [leg.base, leg.platform]);
    ends.fold([f64::INFINITY, f64::NEG_INFINITY].map(Vector3::repeat), |[low, high], end| {
        [low.inf(&end), high.sup(&end)]
    })
}

/// Returns every corner of a machine's axis limits: X Y Z in machine units, A B C in degrees.
fn corners(config: &Mechanism) -> Vec<[f64; 6]> {
    let mut all = vec![config.home];
    for (k, axis) in config.axes.iter().enumerate() {
        let ends = [axis.min, axis.max].into_iter().filter(|end| end.is_finite());
        let is_held = config.machine.layout().is_held(Letter::ALL[k]);
        let ends: Vec<f64> = if is_held { vec![] } else { ends.collect() };
        if !ends.is_empty() {
            let moved = |pose: &[f64; 6]| {
                let pose = *pose;
                ends.clone().into_iter().map(move |end| {
                    let mut pose = pose;
                    pose[k] = end;
                    pose
                })
            };
            all = all.iter().flat_map(moved).collect();
        }
    }
    all
}

/// Bisects a crossing of the limits between two distances; returns it with the limit violated on the outer side.
fn crossing(
    at: &mut impl FnMut(f64) -> Result<(), Border>,
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

/// Tightens the joint limits at one end of the legs to those of a study, and returns the axes
/// that the study gives for them. These axes have priority over those of the file, and legs without an
/// axis in their geometry receive them.
///
/// Paper 004 gives the angles for an axis perpendicular to the leg at home: for such an axis they equal those of
/// the core ([`At::turns`]), which are defined for any axis.
fn pyramid<'s>(
    config: &Mechanism,
    study: &'s file::Limits,
    end: End,
    limits: &mut [[f64; 2]],
) -> Result<&'s [[f64; 3]], NoWorkspace> {
    let (name, most, axes) = match end {
        End::Base => ("base", study.base_pyramid_deg, &study.base_axes),
        End::Platform => ("platform", study.platform_pyramid_deg, &study.platform_axes),
    };
    let (given, expected) = (axes.as_deref().unwrap_or(&[]), config.legs());
    if !given.is_empty() && given.len() != expected {
        let found = given.len();
        return Err(NoWorkspace::Axes { key: format!("{name}_axes"), expected, found });
    }
    let Some(most) = most else { return Ok(&[]) };
    for (leg, (limits, geometry)) in limits.iter_mut().zip(config.geometry.legs()).enumerate() {
        let own = match end {
            End::Base => geometry.kind.screw().base_axis,
            End::Platform => geometry.kind.screw().platform_axis,
        };
        let axis = given.get(leg).unwrap_or(&own);
        if axis == &[0.0; 3] {
            return Err(NoWorkspace::NoAxis { end: name, leg });
        }
        if *limits != [0.0; 2] && !is_along(axis, &own) {
            return Err(NoWorkspace::OtherAxis { end: name, leg });
        }
        for (limit, most) in limits.iter_mut().zip(most) {
            *limit = if *limit == 0.0 { most.0 } else { limit.min(most.0) };
        }
    }
    Ok(given)
}

/// Returns whether two directions agree to the precision of values in files, a millionth.
fn is_along(one: &[f64; 3], other: &[f64; 3]) -> bool {
    let [one, other] = [one, other].map(|axis| Vector3::from(*axis).normalize());
    (one - other).norm() < 1e-6
}

/// Returns the level orientation, and those tilted by an angle in `directions` directions about Z, without
/// rotation about the tool: A B C in degrees; only those that the machine can reach.
pub fn tilts(config: &Mechanism, tilt: f64, directions: usize) -> Vec<[f64; 3]> {
    let held = |letter| config.machine.layout().is_held(letter);
    let mut all = vec![[0.0; 3]];
    for k in 0..directions {
        let azimuth = 2.0 * PI * k as f64 / directions as f64;
        let (sin, cos) = tilt.to_radians().sin_cos();
        let z = Vector3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos);
        let (a, b) = (-z.y.asin().to_degrees(), z.x.atan2(z.z).to_degrees());
        // Tolerance for rounding of the sine.
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
