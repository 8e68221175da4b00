// SPDX-License-Identifier: GPL-2.0-or-later
//! The checked, frozen machine.

use crate::at::{self, At};
use crate::fault::Fault;
use crate::forward::{Method, Solution, Solver};
use crate::freeze::Frozen;
use crate::geometry::Geometry;
use crate::layout::{Joints, Layout, MAX_JOINTS, PerLeg};
use crate::letters::Letter;
use crate::mechanism::Mechanism;
use crate::nut::Nut;
use crate::pose::Pose;
use crate::spheres::{Spheres, Which};
use crate::watch::Watch;
use nalgebra::Vector3;

/// A parallel machine, made by [`Machine::freeze`], which checks it.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    pub(crate) lanes: Lanes,
    watch: Watch,
}

/// The machine by number of lanes.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "without an allocator there is no box")]
pub(crate) enum Lanes {
    /// With the spheres if three legs move X, Y and Z alone.
    Four(Mechanism<4>, Option<Spheres>),
    Six(Mechanism<6>),
    Eight(Mechanism<8>),
}

/// Calls the same method for either number of lanes.
macro_rules! each {
    ($machine:expr, $mechanism:ident => $call:expr) => {
        each!(&$machine.lanes; $mechanism => $call)
    };
    ($lanes:expr; $mechanism:ident => $call:expr) => {
        match $lanes {
            Lanes::Four($mechanism, _) => $call,
            Lanes::Six($mechanism) => $call,
            Lanes::Eight($mechanism) => $call,
        }
    };
}
pub(crate) use each;

impl Machine {
    /// Checks a geometry and computes its constants.
    ///
    /// `offset` is in joint units, one per leg (0 if the joint value is the native
    /// value). The work is bounded: no loop depends on the values.
    ///
    /// # Errors
    /// A [`Fault`] with a cause of the geometry group, naming the leg.
    pub fn freeze(geometry: &Geometry, offset: &PerLeg) -> Result<Self, Fault> {
        let frozen = Frozen { geometry, offset };
        let lanes = match geometry.layout().legs() {
            // With constraints, there are six equations.
            0..=6 if geometry.layout().constraints() > 0 => Lanes::Six(frozen.mechanism()?),
            0..=4 => {
                let mechanism = frozen.mechanism()?;
                let spheres = Spheres::of(&mechanism);
                Lanes::Four(mechanism, spheres)
            }
            5..=6 => Lanes::Six(frozen.mechanism()?),
            _ => Lanes::Eight(frozen.mechanism()?),
        };
        let mut machine = Self { lanes, watch: Watch::of(geometry, None) };
        if let Some(home) = geometry.home.map(Pose::from_degrees) {
            let (legs, rotation) = each!(machine, m => m.spans_at(&home))?;
            machine.watch = Watch::of(geometry, Some((&legs, &rotation)));
        }
        Ok(machine)
    }

    /// Returns the machine at a pose; `tool` as in [`Machine::inverse`].
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn at(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<At<'_>, Fault> {
        let mut at = self.nowhere();
        at.move_to(pose, tool)?;
        Ok(at)
    }

    /// Returns a machine without a pose, to be moved to one pose after the other in the same memory, see
    /// [`At::move_to`]; its values are undefined until then.
    pub fn nowhere(&self) -> At<'_> {
        let legs = match &self.lanes {
            Lanes::Four(m, _) => at::Lanes::Four(m.nowhere()),
            Lanes::Six(m) => at::Lanes::Six(m.nowhere()),
            Lanes::Eight(m) => at::Lanes::Eight(m.nowhere()),
        };
        At::nowhere(legs, &self.watch)
    }

    /// Replaces the fixed axes of the joints at base and platform, one for each leg: [`At::turns`] are
    /// measured about them. An empty list keeps the geometry's axes.
    /// Nothing else changes, in particular no corrections.
    pub fn with_joint_axes(mut self, axes: [&[[f64; 3]]; 2]) -> Self {
        self.watch.set_axes(axes);
        self
    }

    /// Returns the constants of the legs that are needed to monitor them.
    pub fn watch(&self) -> &Watch {
        &self.watch
    }

    /// Returns whether nut corrections are the literal arcsin, as for a geometry frozen without a
    /// reference pose, until [`Machine::fold_at`].
    pub fn is_literal(&self) -> bool {
        each!(self, m => m.nut.as_ref().is_some_and(Nut::is_literal))
    }

    /// Fixes the folds of nut corrections at a pose, as a reference pose does: there, and up to
    /// a quarter turn of each strut from there, nothing changes; beyond, corrections continue where
    /// the arcsin reverses. A later call fixes them again.
    ///
    /// If a strut is so near to a quarter turn that rounding determines its direction,
    /// the first one is returned as [`crate::Cause::FoldUndefined`]; the folds are fixed nevertheless.
    ///
    /// # Errors
    /// As [`Machine::inverse`], except for held coordinates; then nothing changes.
    pub fn fold_at(&mut self, pose: &Pose, tool: &Vector3<f64>) -> Result<Option<Fault>, Fault> {
        each!(&mut self.lanes; m => m.fold_at(pose, tool))
    }

    /// Reverts [`Machine::fold_at`].
    pub fn unfold(&mut self) {
        each!(&mut self.lanes; m => if let Some(nut) = &mut m.nut { nut.unfold() });
    }

    /// Returns whether a constraint of the platform depends on those before it, so that it is not solved.
    pub fn is_constraint_redundant(&self, constraint: usize) -> bool {
        each!(self, m => m.couplings()).is_some_and(|all| all.is_redundant(constraint))
    }

    /// Returns numbers and letters of the machine.
    pub fn layout(&self) -> &Layout {
        each!(self, m => &m.layout)
    }

    /// Returns the largest length of the geometry (distance of an anchor from the origin of its frame,
    /// rod, arm), the reference of relative tolerances. Machine units.
    pub fn size(&self) -> f64 {
        each!(self, m => m.size)
    }

    /// Returns the root mean square distance of the platform anchors from their centroid, which converts
    /// an angle to a length in pose distances. Machine units. (The size if all
    /// anchors are one point and no angle is active.)
    pub fn radius(&self) -> f64 {
        each!(self, m => m.radius)
    }

    /// Computes the joint values of a pose, in joint units (struts and sliders: length, cranks: degrees).
    ///
    /// `tool` is the vector o in machine units: tool offsets x and y, and the sum of
    /// spindle and tool offset in z. It changes no joint at A = B = C = 0: legs and table
    /// position the point D = t − o + R (o + center).
    ///
    /// # Errors
    /// A [`Fault`] of the pose group; no partial result is returned.
    #[inline(always)]
    pub fn inverse(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Joints, Fault> {
        let Some(three) = self.joints_of_three(pose, tool) else {
            return each!(self, m => m.inverse(pose, tool));
        };
        let mut joints = [0.0; MAX_JOINTS];
        joints.iter_mut().zip(three).for_each(|(joint, value)| *joint = value);
        Ok(joints)
    }

    /// Returns the joint values of three legs that move X, Y and Z, in closed form; `None` if undecided.
    #[inline(always)]
    pub fn joints_of_three(&self, pose: &Pose, tool: &Vector3<f64>) -> Option<[f64; 3]> {
        self.spheres()?.joints(&pose.position, &pose.angles, tool)
    }

    /// Computes the pose of the control point in base for one of LinuxCNC's poses: with the coordinates that constraints
    /// determine, and without a table's motion. Without constraints and table it is the same pose.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn full_pose(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Pose, Fault> {
        each!(self, m => m.full_pose(pose, tool))
    }

    /// Computes how far the platform moves if the tool vector changes and one of LinuxCNC's poses stays: the shift of the
    /// reference point, and its rotation times the radius.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn tool_travel(
        &self,
        pose: &Pose,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
    ) -> Result<f64, Fault> {
        each!(self, m => m.tool_travel(pose, from, to))
    }

    /// Computes how much one of LinuxCNC's poses decreases if the tool vector changes by `change` and the joints stay:
    /// (R − 1) Δo, 0 in coordinates that are always 0.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn tool_shift(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        change: &Vector3<f64>,
    ) -> Result<Vector3<f64>, Fault> {
        let mut shift = self.full_pose(pose, tool)?.rotation() * change - change;
        for letter in [Letter::X, Letter::Y, Letter::Z] {
            if self.layout().is_held(letter) {
                shift[letter.index().min(2)] = 0.0;
            }
        }
        Ok(shift)
    }

    /// Checks a tool vector.
    ///
    /// # Errors
    /// [`crate::Cause::ToolNotFinite`], [`crate::Cause::ToolTooLong`].
    pub fn check_tool(&self, tool: &Vector3<f64>) -> Result<(), Fault> {
        each!(self, m => m.check_tool(tool))
    }

    /// Computes the pose of the joint values that is connected with `seed`.
    ///
    /// `joints` in joint units; `tool` as in [`Machine::inverse`]. Angles of the result
    /// are those nearest to the seed's, including whole turns; held coordinates are 0, and those of
    /// the seed are ignored.
    ///
    /// # Errors
    /// A [`Fault`] of the joint, solver or settings group. With
    /// [`crate::Method::Certified`] a pose is returned only if it is proved to be the
    /// connected one.
    ///
    /// Cost: at most `limit_iterations` linear solves and [`crate::MAX_SUB_STEPS`] sub-steps.
    pub fn forward(
        &self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
        solver: &Solver,
    ) -> Result<Solution, Fault> {
        if solver.method == Method::Certified
            && let Some(spheres) = self.spheres()
            && let Some(joints) = joints.first_chunk()
            && solver.check().is_ok()
            && let near = Which::Near(&seed.position)
            && let Some(met) = spheres.meeting(joints, near, tool, solver.criterion(self.size()))
        {
            return Ok(Solution::of_spheres(met));
        }
        each!(self, m => m.forward(joints, seed, tool, solver))
    }

    #[inline(always)]
    fn spheres(&self) -> Option<&Spheres> {
        match &self.lanes {
            Lanes::Four(_, spheres) => spheres.as_ref(),
            Lanes::Six(_) | Lanes::Eight(_) => None,
        }
    }

    /// Returns the pose of joint values on the same side of the singular poses as `reference`, for three
    /// legs that move X, Y and Z and nothing else: any motion from there that passes no singular pose
    /// leads to this pose and to no other. `None` for other machines, near a singular pose, at a dead
    /// point and out of reach, which forward refuses.
    pub fn pose_beside(&self, joints: &Joints, reference: &Pose, solver: &Solver) -> Option<Pose> {
        let spheres = self.spheres()?;
        let which = Which::Side(spheres.side(&reference.position)?);
        let accepted = solver.criterion(self.size());
        let met = spheres.meeting(joints.first_chunk()?, which, &Vector3::zeros(), accepted)?;
        Some(Pose { position: met.point, angles: Vector3::zeros() })
    }

    /// Returns the largest [`Solution::residual`] that forward may return with these settings, machine
    /// units: the residual limit if legs exceed coordinates, otherwise the joint error that corresponds to
    /// the convergence criterion of the legs' lengths.
    pub fn largest_residual(&self, solver: &Solver) -> f64 {
        each!(self, m => m.largest_residual(solver))
    }
}
