// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine with one tool: its limits at a pose, and how its legs change from there.

use crate::limits::beyond_axes;
use crate::proof::dependent::{Dependent, Place};
use crate::read::legs::{drive_rate, platform_anchor};
use crate::read::mechanism::Mechanism;
use kinematics::{
    At, Fault, Jacobian, Joints, LegGeometry, Letter, Limits, Margin, Matrix3, Pose, Segment,
    Vector3,
};
use std::f64::consts::PI;

pub(super) const RADIANS: f64 = PI / 180.0;

/// Rounding of values computed at the center, as a share of the size: far above f64's 1e-16
/// times the numbers of operations, far below the accuracy of any setup.
pub(super) const ROUNDING: f64 = 1e-9;

/// Weight of a table axis that compensates the platform's motion: its joint is exact in a cell of any size.
const TABLE_SHARE: f64 = 0.05;

/// The reason why a pose is not legal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// The pose has no joint values.
    Fault(Fault),
    /// A violated limit.
    Limit(Margin),
}

/// A machine with one tool, for judging cells.
pub struct Reach<'a> {
    pub(super) config: &'a Mechanism,
    /// Tool vector, spindle offset included.
    pub(super) tool: Vector3<f64>,
    /// Limits of the pose except those of the axes.
    pub(super) limits: Limits,
    /// Coordinates that the legs move.
    pub(super) active: [bool; 6],
    /// Arms of the platform anchors from the control point in two parts: one whose motion along constant or table
    /// coordinates does not reach the legs, and the rest.
    pub(super) arms: Vec<[Vector3<f64>; 2]>,
    /// Directions of the legs at home, in base and in the frame of the platform.
    pub(super) home: Vec<[Vector3<f64>; 2]>,
    /// Pairs of legs, lower number first, that share no anchor.
    pub(super) pairs: Vec<[usize; 2]>,
    /// Reference point of the conditioning on the platform.
    pub(super) about: Vector3<f64>,
    /// Whether any strut has a lead.
    pub(super) is_geared: bool,
    /// Constraints of the platform: bounds are then over all its coordinates.
    pub(super) dependent: Option<Dependent>,
}

/// Displacements within a cell: its poses are the center plus a sum of `steps`, each
/// multiplied by a number from -1 to 1. Machine units and radians.
pub(super) struct Spread {
    pub(super) steps: Vec<[f64; 6]>,
    pub(super) shift: f64,
    pub(super) turn: f64,
    /// Changes of the commanded coordinates by every step, if constraints determine others.
    pub(super) commanded: Option<Vec<[f64; 6]>>,
}

impl Spread {
    /// Returns the first-order change by all steps of a value with this gradient.
    pub(super) fn slope(&self, gradient: &[f64; 6]) -> f64 {
        let change = |step: &[f64; 6]| (0..6).map(|k| gradient[k] * step[k]).sum::<f64>();
        self.steps.iter().map(|step| change(step).abs()).sum()
    }

    /// Bounds the first and second derivative of an anchor's position.
    pub(super) fn of_anchor(&self, arm: f64) -> (f64, f64) {
        (self.shift + arm * self.turn, arm * self.turn * self.turn)
    }
}

/// Derivatives by every coordinate, of a platform anchor and of its motion along its ring.
type Motions = ([Vector3<f64>; 6], [Vector3<f64>; 6]);

/// The center of a cell.
pub(super) struct Middle<'a> {
    pub(super) at: &'a At<'a>,
    pub(super) gradient: Jacobian,
    pub(super) rotation: Matrix3<f64>,
    /// Rotation axes of A, B and C, in base.
    pub(super) axes: [Vector3<f64>; 3],
    /// The platform, if constraints determine coordinates.
    pub(super) place: Option<Place>,
    pub(super) legs: Vec<LegMiddle>,
}

/// A leg at the center.
pub(super) struct LegMiddle {
    pub(super) segment: Segment,
    /// Unit vector along the leg.
    pub(super) n: Vector3<f64>,
    pub(super) length: f64,
    /// Derivatives of the platform anchor by every coordinate, per machine unit or radian.
    pub(super) motions: [Vector3<f64>; 6],
    /// The part of them that is the motion along its ring.
    pub(super) slides: [Vector3<f64>; 6],
    /// Derivatives of the vector along the leg.
    pub(super) changes: [Vector3<f64>; 6],
}

impl<'a> Reach<'a> {
    /// Creates it for this machine without a tool.
    ///
    /// # Errors
    /// The pose at home is not legal.
    pub fn new(config: &'a Mechanism) -> Result<Self, Fault> {
        Self::with_tool(config, config.spindle)
    }

    /// Creates it for this machine with a tool vector, spindle offset included. Poses are the machine's own: those of
    /// the platform, if an axis carries the tool or the workpiece is on the platform.
    ///
    /// # Errors
    /// The pose at home is not legal.
    pub fn with_tool(config: &'a Mechanism, tool: Vector3<f64>) -> Result<Self, Fault> {
        let tool = config.chain.machine_tool(&tool);
        let dependent = Dependent::of(config, tool)?;
        let is_active = |letter| config.machine.layout().coordinates().contains(letter);
        let active = Letter::ALL.map(|letter| dependent.is_some() || is_active(letter));
        // As the core measures the angles of the legs' joints.
        let home = config.machine.at(&config.home_pose(), &Vector3::zeros())?;
        let centre = Vector3::from(config.geometry.centre);
        let arms = |leg: &LegGeometry| {
            let anchor = Vector3::from(leg.platform);
            match active[..3] {
                [true, true, true] => [tool + anchor, Vector3::zeros()],
                _ => [tool + centre, anchor - centre],
            }
        };
        let legs = config.geometry.legs();
        let anchors = legs.iter().map(|leg| Vector3::from(leg.platform));
        Ok(Self {
            config,
            tool,
            limits: beyond_axes(config),
            active,
            arms: legs.iter().map(arms).collect(),
            home: home.segments()[..legs.len()]
                .iter()
                .map(|leg| leg.span().normalize())
                .map(|in_base| [in_base, home.rotation().tr_mul(&in_base)])
                .collect(),
            pairs: pairs(config),
            about: match active[..3] {
                [true, true, true] => anchors.sum::<Vector3<f64>>() / legs.len() as f64,
                _ => centre,
            },
            is_geared: legs.iter().any(|leg| leg.kind.screw().lead != 0.0),
            dependent,
        })
    }

    /// Returns the joint values of a pose, within limits or not.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn joints(&self, pose: &[f64; 6]) -> Result<Joints, Fault> {
        self.config.machine.inverse(&Pose::from_degrees(*pose), &self.tool)
    }

    /// Returns the conditioning; 0 if the pose has no joint values.
    pub fn conditioning(&self, pose: &[f64; 6]) -> f64 {
        self.at(pose).map_or(0.0, |at| at.smallest_singular_value())
    }

    /// Returns the machine at a pose.
    ///
    /// # Errors
    /// As [`kinematics::Machine::at`].
    pub fn at(&self, pose: &[f64; 6]) -> Result<At<'a>, Fault> {
        self.config.machine.at(&Pose::from_degrees(*pose), &self.tool)
    }

    /// Checks a pose against all limits.
    ///
    /// # Errors
    /// The reason why the pose is not legal.
    pub fn check(&self, pose: &[f64; 6]) -> Result<(), Stop> {
        let mut at = self.nowhere();
        self.move_to(&mut at, pose).map_err(Stop::Fault)?;
        at.check(&self.limits).map_err(Stop::Limit)
    }

    /// Returns memory for many poses, not yet at any: the struct is too large to be returned each time.
    pub fn nowhere(&self) -> At<'a> {
        self.config.machine.nowhere()
    }

    /// Moves to a pose, as [`Self::at`], in existing memory.
    ///
    /// # Errors
    /// As [`kinematics::Machine::at`].
    pub fn move_to(&self, at: &mut At<'a>, pose: &[f64; 6]) -> Result<(), Fault> {
        at.move_to(&Pose::from_degrees(*pose), &self.tool)
    }

    pub(super) fn middle<'b>(
        &self,
        at: &'b mut At<'a>,
        pose: &[f64; 6],
    ) -> Result<Middle<'b>, Fault> {
        self.move_to(at, pose)?;
        let at: &'b At<'b> = at;
        let platform = Place::new(&at.full_pose());
        let mut gradient = match self.dependent {
            None => at.pose_jacobian()?,
            Some(_) => at.inverse_jacobian()?,
        };
        if self.dependent.is_some() {
            let per_degree = Matrix3::from_columns(&platform.axes) * RADIANS;
            let angular = gradient.fixed_columns::<3>(3) * per_degree;
            gradient.fixed_columns_mut::<3>(3).copy_from(&angular);
        }
        let mut middle = Middle {
            gradient,
            rotation: at.rotation(),
            axes: platform.axes,
            place: self.dependent.is_some().then_some(platform),
            at,
            legs: vec![],
        };
        middle.legs = (0..self.config.legs()).map(|i| self.leg(i, &middle)).collect();
        Ok(middle)
    }

    fn leg(&self, i: usize, middle: &Middle) -> LegMiddle {
        let segment = middle.at.segments()[i];
        let (motions, slides) = self.motions(i, &segment, middle);
        let length = segment.span().norm();
        let changes = self.span_changes(i, &segment, &motions, middle);
        LegMiddle { segment, n: segment.span() / length, length, motions, slides, changes }
    }

    /// Returns the derivatives of the platform anchor of leg `i` by every coordinate, per machine unit or radian,
    /// and the part of them along its ring.
    fn motions(&self, i: usize, segment: &Segment, middle: &Middle) -> Motions {
        let leg = &self.config.geometry.legs()[i];
        let [shared, own] = self.arms[i].map(|arm| middle.rotation * arm);
        let ring = Ring::of(leg, segment, &middle.rotation);
        let own = own + ring.as_ref().map_or(Vector3::zeros(), |ring| ring.outward * ring.radius);
        let (mut motions, mut slides) = ([Vector3::zeros(); 6], [Vector3::zeros(); 6]);
        for k in 0..6 {
            let (along, axis) = match k {
                0..3 => (Vector3::ith(k, if self.active[k] { 1.0 } else { 0.0 }), Vector3::zeros()),
                _ => (Vector3::zeros(), middle.axes[k - 3]),
            };
            motions[k] = along + axis.cross(&own) + self.of_legs(axis.cross(&shared));
            if let Some(ring) = &ring {
                // The platform's point at the base anchor moves the ring back by r/rho of its displacement.
                let at_base = motions[k] - axis.cross(&segment.span());
                slides[k] = ring.along * (-ring.along.dot(&at_base) * ring.radius / ring.rho);
                motions[k] += slides[k];
            }
        }
        (motions, slides)
    }

    /// Returns the vector from the platform's center of rotation to the base anchor of leg `i`, in base.
    pub(super) fn to_base(&self, i: usize, middle: &Middle) -> Vector3<f64> {
        let segment = &middle.legs[i].segment;
        let leg = &self.config.geometry.legs()[i];
        let ring = Ring::of(leg, segment, &middle.rotation);
        let outward = ring.map_or(Vector3::zeros(), |ring| ring.outward * ring.radius);
        let [shared, own] = self.arms[i].map(|arm| middle.rotation * arm);
        shared + own + outward - segment.span()
    }

    /// Returns the vector from a point of the platform to the platform anchor of leg `i`, in base.
    pub(super) fn lever_from(
        &self,
        point: &Vector3<f64>,
        i: usize,
        middle: &Middle,
    ) -> Vector3<f64> {
        let leg = &self.config.geometry.legs()[i];
        let segment = middle.at.segments()[i];
        middle.rotation * (platform_anchor(leg, &segment, &middle.rotation) - point)
    }

    /// Returns the derivatives of the vector along leg `i` by every coordinate, per machine unit or radian.
    fn span_changes(
        &self,
        i: usize,
        segment: &Segment,
        motions: &[Vector3<f64>; 6],
        middle: &Middle,
    ) -> [Vector3<f64>; 6] {
        let leg = &self.config.geometry.legs()[i];
        let Some(per_joint) = drive_rate(leg, segment) else { return *motions };
        std::array::from_fn(|k| {
            let unit = if k < 3 { 1.0 } else { 1.0 / RADIANS };
            motions[k] - per_joint * (middle.gradient[(i, k)] * unit)
        })
    }

    /// Returns the part of a platform's motion that the legs make.
    fn of_legs(&self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|k, _| if self.active[k] { v[k] } else { 0.0 })
    }

    /// Returns the displacements of steps in machine units and degrees.
    pub(super) fn spread(&self, steps: impl IntoIterator<Item = [f64; 6]>) -> Spread {
        let radians =
            |s: [f64; 6]| std::array::from_fn(|k| if k < 3 { s[k] } else { s[k] * RADIANS });
        let steps: Vec<[f64; 6]> = steps.into_iter().map(radians).collect();
        let half = |k: usize| steps.iter().map(|step| step[k].abs()).sum::<f64>();
        let squares = (0..3).filter(|k| self.active[*k]).map(|k| half(k) * half(k));
        let shift = squares.sum::<f64>().sqrt();
        Spread { shift, turn: (3..6).map(half).sum(), steps, commanded: None }
    }

    /// Returns the displacements of steps of commanded coordinates, with those that constraints determine; `None` if these
    /// are not enclosed.
    pub(super) fn spread_within(&self, middle: &Middle, steps: &[[f64; 6]]) -> Option<Spread> {
        let (Some(dependent), Some(place)) = (&self.dependent, &middle.place) else {
            return Some(self.spread(steps.iter().copied()));
        };
        let enclosed = dependent.enclose(place, steps)?;
        let mut commanded = steps.to_vec();
        commanded.resize(enclosed.steps.len(), [0.0; 6]);
        Some(Spread { commanded: Some(commanded), ..self.spread(enclosed.steps) })
    }

    /// Estimates the displacement of the legs' ends by every step, for comparisons.
    pub(super) fn extents(&self, spread: &Spread) -> Vec<f64> {
        let table = self.config.machine.layout().table();
        let unit = |k: usize| match k {
            // Such a table axis moves no leg.
            0..3 if self.dependent.is_some() && table.contains(Letter::ALL[k]) => TABLE_SHARE,
            0..3 => 1.0,
            _ => self.config.machine.size() / 2.0,
        };
        let extent = |step: &[f64; 6]| (0..6).map(|k| step[k].abs() * unit(k)).sum();
        spread.steps.iter().map(extent).collect()
    }
}

/// A ring at its strut.
pub(super) struct Ring {
    pub(super) radius: f64,
    /// Distance from its axis to the base anchor.
    pub(super) rho: f64,
    /// Unit vectors in base: from the axis toward the base anchor, and along the circle there.
    outward: Vector3<f64>,
    along: Vector3<f64>,
}

impl Ring {
    /// Returns the ring of a leg; `None` if the leg ends at a point.
    pub(super) fn of(
        leg: &LegGeometry,
        segment: &Segment,
        rotation: &Matrix3<f64>,
    ) -> Option<Self> {
        let radius = leg.kind.ring_radius();
        (radius > 0.0).then_some(())?;
        let axis: Vector3<f64> = rotation.column(2).into();
        let span = segment.span();
        let beside = axis * axis.dot(&span) - span;
        let outward = beside.try_normalize(0.0)?;
        let along = axis.cross(&outward);
        Some(Self { radius, rho: radius + beside.norm(), outward, along })
    }
}

/// Returns the pairs of legs, lower number first, that share no anchor.
pub fn pairs(config: &Mechanism) -> Vec<[usize; 2]> {
    let pairs = (0..config.legs()).flat_map(|i| (i + 1..config.legs()).map(move |j| [i, j]));
    pairs.filter(|pair| config.machine.watch().is_watched(*pair)).collect()
}
