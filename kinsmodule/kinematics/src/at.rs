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
/// Joints and legs are computed at once, everything else when it is asked for first, and once.
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

/// Calls the same method on whichever legs there are.
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
    /// To be moved to a pose.
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

    /// Takes another pose in the same memory; `tool` as in [`crate::Machine::inverse`]. After an
    /// error it is at no pose.
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

    /// The pose.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Numbers and letters of the machine.
    pub fn layout(&self) -> &Layout {
        each!(self, legs => &legs.machine.layout)
    }

    /// [`crate::Machine::radius`].
    pub(crate) fn radius(&self) -> f64 {
        each!(self, legs => legs.machine.radius)
    }

    /// Joint values, as [`crate::Machine::inverse`].
    pub fn joints(&self) -> &Joints {
        &self.joints
    }

    /// The legs: from moving base anchor to platform anchor, in base.
    pub fn segments(&self) -> &[Segment; MAX_LEGS] {
        &self.segments
    }

    /// Orientation of the platform: base from platform.
    pub fn rotation(&self) -> Matrix3<f64> {
        each!(self, legs => legs.placement.place.rotation)
    }

    /// Length corrections by nut rotation, machine units; zeros without a lead.
    pub fn corrections(&self) -> PerLeg {
        each!(self, legs => legs.corrections())
    }

    /// Inverse Jacobian: joint rates per unit twist, one row a joint.
    ///
    /// Row i is `[uᵢᵀ (ρᵢ × uᵢ)ᵀ]` over uᵢ · ∂cᵢ/∂q + ∂dᵢ/∂q (see the module `leg`), for
    /// a strut plus the exact gradient of the nut correction, so that q̇ = J (v; ω), linear
    /// part first. Frames: v and ω in base axes; reference point = control point (tool
    /// tip). Units: columns 0–2 joint units per machine unit, 3–5 joint units per radian.
    /// Held coordinates are not left out: the columns are the derivatives of the equations.
    ///
    /// # Errors
    /// [`crate::Cause::DeadPoint`] so far away that a joint value swallows its leg.
    /// Source: paper 004 and LinuxCNC's genhexkins for struts without the nut term, paper
    /// 003 equations 14 to 17 (corrected) for rods.
    pub fn inverse_jacobian(&self) -> Result<Jacobian, Fault> {
        each!(self, legs => legs.inverse_jacobian())
    }

    /// Inverse Jacobian in pose coordinates: ∂q / ∂(x, y, z, a, b, c), one row a joint.
    ///
    /// Units: joint units per machine unit and per **degree**.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`]; [`crate::Cause::TiltNearRightAngle`] where A, B and C are
    /// active and cos B < 1e-6.
    pub fn pose_jacobian(&self) -> Result<Jacobian, Fault> {
        each!(self, legs => legs.pose_jacobian())
    }

    /// Constraint rows `[uᵢᵀ (ρᵢ × uᵢ)ᵀ/r]` of the legs, one row a leg, without nut corrections:
    /// speeds of the platform anchors along their legs per motion (v, r ω) of the platform about
    /// the solver's reference point, r = [`crate::Machine::radius`]; columns of coordinates that the
    /// legs do not move are 0, and for one or two active angles they are those of the angles.
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

    /// Per joint the largest rate for a unit velocity of the control point that does not turn.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`].
    pub fn speed_ratios(&self) -> Result<Joints, Fault> {
        each!(self, legs => legs.speed_ratios())
    }

    /// Joint rates while the pose changes at `rate` per second: X, Y, Z in machine units, A, B, C
    /// in **degrees**.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`].
    pub fn rates(&self, rate: &[f64; 6]) -> Result<Joints, Fault> {
        each!(self, legs => legs.rates(rate))
    }

    /// Smallest singular value of the [constraint rows](At::constraint_rows) over the active
    /// coordinates: the speed of the platform anchors along their legs, at least, for a unit motion
    /// (v, r ω). No dimension; 0 where the legs do not hold the platform.
    pub fn smallest_singular_value(&self) -> f64 {
        each!(self, legs => legs.smallest_singular_value())
    }

    /// Whether the smallest singular value is surely above `least`, in less work than it takes
    /// itself.
    pub(crate) fn is_surely_above(&self, least: f64) -> bool {
        each!(self, legs => legs.is_surely_above(least))
    }

    /// Sign of det J over the active coordinates (1, −1, or 0 where it is singular or not
    /// square): tells apart ways of assembling the machine, but not all of them.
    /// Information, not a guard.
    ///
    /// # Errors
    /// As [`At::inverse_jacobian`].
    pub fn assembly(&self) -> Result<i32, Fault> {
        each!(self, legs => legs.assembly())
    }

    /// How far a leg is from its dead point: |cos| of the angle between a rod and the motion of its
    /// lower end, see [`crate::LEAST_DRIVE`]; `None` for a leg without one.
    pub fn drive(&self, leg: usize) -> Option<f64> {
        each!(self, legs => legs.drive(leg))
    }

    /// Angle between the tool axis, which is the platform's Z, and Z of base, degrees.
    pub fn tilt(&self) -> f64 {
        let rotation = self.rotation();
        atan2(hypot(rotation[(0, 2)], rotation[(1, 2)]), rotation[(2, 2)]) * DEGREES
    }

    /// Angles by which the legs have left their direction at the reference pose; zeros where the
    /// machine has none.
    pub fn cones(&self) -> Cones {
        once(&self.cones, || self.watch.cones(&self.rotation(), &self.segments))
    }

    /// Turns of the legs in their cardan joints at base and platform, see [`Watch::turns`].
    pub fn turns(&self) -> [Turns; 2] {
        once(&self.turns, || self.watch.turns(&self.rotation(), &self.segments))
    }

    /// Whether the tilt, and [`At::cones`] and [`At::turns`] at base and platform, are surely within these
    /// degrees (0: no limit), in less work than they take.
    pub(crate) fn surely_keeps(
        &self,
        tilt: f64,
        cones: [&PerLeg; 2],
        pyramids: [&[[f64; 2]; MAX_LEGS]; 2],
    ) -> bool {
        self.watch.keeps((&self.rotation(), &self.segments), tilt, cones, pyramids)
    }

    /// The two legs that are nearest to each other, of those that share no anchor.
    pub fn nearest(&self) -> Option<Nearest> {
        once(&self.nearest, || self.watch.nearest(&self.segments))
    }

    /// The same where they are nearer than `most`; else any two, or none.
    pub(crate) fn nearest_within(&self, most: f64) -> Option<Nearest> {
        self.watch.nearest_within(&self.segments, most)
    }
}
