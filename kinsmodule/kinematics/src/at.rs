// SPDX-License-Identifier: GPL-2.0-or-later
//! The machine at a pose.

use crate::fault::Fault;
use crate::jacobian::Jacobian;
use crate::layout::{Joints, Layout, MAX_LEGS, PerLeg};
use crate::legs_at::{LegsAt, once};
use crate::pose::Pose;
use crate::segment::Segment;
use crate::trig::DEGREES;
use crate::watch::{Cones, Nearest, Turns, Watch};
use core::cell::Cell;
use libm::{atan2, hypot};
use nalgebra::{Matrix3, Vector3};

/// A machine at a pose that its legs reach, made by [`crate::Machine::at`].
///
/// Joints and legs are computed immediately, everything else once on first use.
pub struct At<'a> {
    legs: Lanes<'a>,
    watch: &'a Watch,
    pose: Pose,
    joints: Joints,
    segments: [Segment; MAX_LEGS],
    cones: Cell<Option<Cones>>,
    turns: Cell<Option<[Turns; 2]>>,
    nearest: Cell<Option<Option<Nearest>>>,
}

/// The legs by number of lanes.
#[allow(clippy::large_enum_variant, reason = "without an allocator there is no box")]
pub(crate) enum Lanes<'a> {
    Four(LegsAt<'a, 4>),
    Six(LegsAt<'a, 6>),
    Eight(LegsAt<'a, 8>),
}

/// Calls the same method for either number of legs.
macro_rules! each {
    ($at:expr, $legs:ident => $call:expr) => {
        match &$at.legs {
            Lanes::Four($legs) => $call,
            Lanes::Six($legs) => $call,
            Lanes::Eight($legs) => $call,
        }
    };
}

impl<'a> At<'a> {
    /// Creates a machine without a pose; call [`At::move_to`] before use.
    pub(crate) fn nowhere(legs: Lanes<'a>, watch: &'a Watch) -> Self {
        Self {
            legs,
            watch,
            pose: Pose { position: Vector3::zeros(), angles: Vector3::zeros() },
            joints: Joints::default(),
            segments: [Segment { base: Vector3::zeros(), platform: Vector3::zeros() }; MAX_LEGS],
            cones: Cell::new(None),
            turns: Cell::new(None),
            nearest: Cell::new(None),
        }
    }

    /// Moves to another pose in the same memory; `tool` as in [`crate::Machine::inverse`]. After an
    /// error no pose is set.
    ///
    /// # Errors
    /// As [`crate::Machine::inverse`].
    pub fn move_to(&mut self, pose: &Pose, tool: &Vector3<f64>) -> Result<(), Fault> {
        match &mut self.legs {
            Lanes::Four(legs) => legs.move_to(pose, tool),
            Lanes::Six(legs) => legs.move_to(pose, tool),
            Lanes::Eight(legs) => legs.move_to(pose, tool),
        }?;
        self.pose = *pose;
        self.joints = each!(self, legs => legs.all_joints())?;
        each!(self, legs => legs.write_segments(&mut self.segments));
        self.cones.set(None);
        self.turns.set(None);
        self.nearest.set(None);
        Ok(())
    }

    /// Returns the pose.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Returns the pose of the control point in base, with the coordinates that constraints determine; the pose itself
    /// without constraints.
    pub fn full_pose(&self) -> Pose {
        each!(self, legs => legs.full_pose()).unwrap_or(self.pose)
    }

    /// Returns the numbers and letters of the machine.
    pub fn layout(&self) -> &Layout {
        each!(self, legs => &legs.machine.layout)
    }

    /// Returns [`crate::Machine::radius`].
    pub(crate) fn radius(&self) -> f64 {
        each!(self, legs => legs.machine.radius)
    }

    /// Returns the joint values, as [`crate::Machine::inverse`] does.
    pub fn joints(&self) -> &Joints {
        &self.joints
    }

    /// Returns the legs: from the moving base anchor to the platform anchor, in base coordinates.
    pub fn segments(&self) -> &[Segment; MAX_LEGS] {
        &self.segments
    }

    /// Returns the orientation of the platform: base from platform.
    pub fn rotation(&self) -> Matrix3<f64> {
        each!(self, legs => legs.placement.place.rotation)
    }

    /// Returns the length corrections for nut rotation, machine units; zeros without a lead.
    pub fn corrections(&self) -> PerLeg {
        each!(self, legs => legs.corrections())
    }

    /// Computes the inverse Jacobian: joint rates per unit twist, one row for each joint.
    ///
    /// Row i is `[uᵢᵀ (ρᵢ × uᵢ)ᵀ]` over uᵢ · ∂cᵢ/∂q + ∂dᵢ/∂q (see the module `leg`), for
    /// a strut plus the exact gradient of the nut correction, so that q̇ = J (v; ω), linear
    /// part first. Frames: v and ω in base axes; reference point = control point (tool
    /// tip). Units: columns 0–2 joint units per machine unit, 3–5 joint units per radian.
    /// Held coordinates are included: the columns are the derivatives of the equations. So are motions that constraints
    /// prevent; then the rows of a table that compensates a dependent coordinate are those for a constant pose.
    ///
    /// # Errors
    /// [`crate::Cause::DeadPoint`] if a joint value is so large that its leg's length is lost in rounding.
    /// Source: paper 004 and LinuxCNC's genhexkins for struts without the nut term, paper
    /// 003 equations 14 to 17 (corrected) for rods.
    pub fn inverse_jacobian(&self) -> Result<Jacobian, Fault> {
        each!(self, legs => legs.inverse_jacobian())
    }

    /// Computes the inverse Jacobian in pose coordinates: ∂q / ∂(x, y, z, a, b, c), one row for each joint.
    ///
    /// Units: joint units per machine unit and per **degree**.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`]; [`crate::Cause::TiltNearRightAngle`] where A, B and C are
    /// active and cos B < 1e-6.
    pub fn pose_jacobian(&self) -> Result<Jacobian, Fault> {
        each!(self, legs => legs.pose_jacobian())
    }

    /// Computes the constraint rows `[uᵢᵀ (ρᵢ × uᵢ)ᵀ/r]`, one for each leg, then one for each independent constraint of
    /// the platform, without nut corrections:
    /// speeds of the platform anchors along their legs per motion (v, r ω) of the platform about
    /// the solver's reference point, r = [`crate::Machine::radius`]. Columns of coordinates that the
    /// legs do not move are 0; for one or two active angles the columns refer to those angles.
    pub fn constraint_rows(&self) -> [[f64; 6]; MAX_LEGS] {
        let mut rows = [[0.0; 6]; MAX_LEGS];
        each!(self, legs => {
            for (k, column) in legs.constraint_columns().iter().enumerate() {
                for (row, value) in rows.iter_mut().zip(column) {
                    row[k] = *value;
                }
            }
        });
        rows
    }

    /// Computes for each joint the largest rate for a unit velocity of the control point without rotation.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`].
    pub fn speed_ratios(&self) -> Result<Joints, Fault> {
        each!(self, legs => legs.speed_ratios())
    }

    /// Computes joint rates while the pose changes at `rate` per second: X, Y, Z in machine units,
    /// A, B, C in **degrees**.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`].
    pub fn rates(&self, rate: &[f64; 6]) -> Result<Joints, Fault> {
        each!(self, legs => legs.rates(rate))
    }

    /// Computes joint rates while the tool vector changes at `change` per second and the pose stays, machine units.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`]; [`crate::Cause::ConstraintSingular`].
    pub fn tool_rates(&self, change: &Vector3<f64>) -> Result<Joints, Fault> {
        each!(self, legs => legs.tool_rates(change))
    }

    /// Computes the angular velocity of the platform while the pose changes at `rate` per second, angles in degrees, and
    /// the tool vector at `change`.
    ///
    /// # Errors
    /// [`crate::Cause::ConstraintSingular`].
    pub(crate) fn turning(
        &self,
        rate: &[f64; 6],
        change: &Vector3<f64>,
    ) -> Result<Vector3<f64>, Fault> {
        each!(self, legs => legs.turning(rate, change))
    }

    /// Computes the smallest singular value of the [constraint rows](At::constraint_rows) over the active
    /// coordinates: the least speed of the platform anchors along their legs for a unit motion
    /// (v, r ω). Dimensionless; 0 at a singular pose.
    pub fn smallest_singular_value(&self) -> f64 {
        each!(self, legs => legs.smallest_singular_value())
    }

    /// Returns whether the smallest singular value is certainly above `least`, without computing it.
    pub(crate) fn is_surely_above(&self, least: f64) -> bool {
        each!(self, legs => legs.is_surely_above(least))
    }

    /// Returns the sign of det J over the active coordinates: 1, −1, or 0 if J is singular or not
    /// square. Distinguishes some assembly modes, but not all. Information, not a guard.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`].
    pub fn assembly(&self) -> Result<i32, Fault> {
        each!(self, legs => legs.assembly())
    }

    /// Returns how far a leg is from its dead point: |cos| of the angle between a rod and the motion of
    /// its lower end, see [`crate::LEAST_DRIVE`]; `None` for a leg without a dead point.
    pub fn drive(&self, leg: usize) -> Option<f64> {
        each!(self, legs => legs.drive(leg))
    }

    /// Computes the angle between the tool axis (the platform's Z) and Z of base, degrees.
    pub fn tilt(&self) -> f64 {
        let rotation = self.rotation();
        atan2(hypot(rotation[(0, 2)], rotation[(1, 2)]), rotation[(2, 2)]) * DEGREES
    }

    /// Computes the angles between the legs and their directions at the reference pose; zeros if the
    /// machine has no reference pose.
    pub fn cones(&self) -> Cones {
        once(&self.cones, || self.watch.cones(&self.rotation(), &self.segments))
    }

    /// Computes the rotations of the legs in their cardan joints at base and platform, see [`Watch::turns`].
    pub fn turns(&self) -> [Turns; 2] {
        once(&self.turns, || self.watch.turns(&self.rotation(), &self.segments))
    }

    /// Returns whether the tilt, [`At::cones`] and [`At::turns`] at base and platform are certainly within
    /// these degrees (0: no limit), without computing them.
    pub(crate) fn surely_keeps(
        &self,
        tilt: f64,
        cones: [&PerLeg; 2],
        pyramids: [&[[f64; 2]; MAX_LEGS]; 2],
    ) -> bool {
        self.watch.keeps((&self.rotation(), &self.segments), tilt, cones, pyramids)
    }

    /// Returns the two nearest legs among those that share no anchor.
    pub fn nearest(&self) -> Option<Nearest> {
        once(&self.nearest, || self.watch.nearest(&self.segments))
    }

    /// Like [`At::nearest`] if they are nearer than `most`; otherwise returns any pair or `None`.
    pub(crate) fn nearest_within(&self, most: f64) -> Option<Nearest> {
        self.watch.nearest_within(&self.segments, most)
    }
}
