// SPDX-License-Identifier: GPL-2.0-or-later
//! Forward kinematics: from joints to the one pose that is connected with the seed.
//!
//! The *correct* pose is the end of the unique continuous path from the seed along the
//! straight line in joint space, as long as the Jacobian stays regular. Forward returns that
//! pose or fails. Near the seed one certified ball proves it; for a far seed a chain of such balls
//! does. See the module `certificate`.

mod contradiction;
mod converge;
mod residual;
mod solver;
mod track;

pub use solver::{Certificate, MAX_ITERATIONS, MAX_SUB_STEPS, Method, Solution, Solver};

use crate::coupling::{Couplings, Settled};
use crate::fault::{Cause, Fault};
use crate::layout::Joints;
use crate::leg::LEAST_DRIVE;
use crate::letters::Letter;
use crate::mechanism::{Chart, Mechanism};
use crate::placed::Place;
use crate::pose::{Pose, Trigonometry, angles_near};
use crate::pseudo_inverse::PseudoInverse;
use crate::target::Target;
use converge::{Ball, End, LEAST_SHARE};
use nalgebra::Vector3;
use residual::{Measured, Stance, newton_step, norm};
use solver::Effort;

/// Position error at which iteration stops, as a share of the size.
const POSE_TOLERANCE: f64 = 1e-12;

/// Distance of two solutions for the same commanded coordinates that count as one, as a share of the size: far above
/// rounding, also near a constraint singularity.
const SAME_POSE: f64 = 1e-7;

impl<const N: usize> Mechanism<N> {
    pub fn forward(
        &self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
        solver: &Solver,
    ) -> Result<Solution, Fault> {
        solver.check()?;
        let mut seed = if self.holds { self.held(seed, false)? } else { *seed };
        seed.check().map_err(|fault| match fault.cause {
            Cause::PoseNotFinite => Cause::SeedMissing.into(),
            _ => fault,
        })?;
        self.check_tool(tool)?;
        self.refuse_table_not_finite(joints)?;
        let mut target = Target::of(self.lanes_of(joints));
        self.aim(&mut target)?;
        let mut trig = seed.trigonometry();
        let mut rotation = trig.rotation();
        let mut centre = self.of_legs(self.point(&seed.position, &rotation, tool));
        let mut settled = None;
        if let Some(couplings) = self.couplings() {
            let found = couplings.settle(&seed, tool)?;
            (rotation, centre) = (found.place.rotation, found.place.centre);
            if couplings.has_angles() {
                seed.angles = found.place.angles;
                trig = seed.trigonometry();
            }
            settled = Some((couplings, found));
        }
        // A closure: copying the struct would stall on store forwarding.
        let start = || Place { centre, rotation, angles: seed.angles };
        let redundant = self.layout.is_redundant();
        let mut effort = Effort {
            spent: 0,
            sub_steps: 1,
            limit: solver.limit_iterations,
            tolerance: POSE_TOLERANCE * self.size,
            accepted: match redundant {
                false => self.criterion(solver),
                // The residual of contradicting legs is checked at the end.
                true => f64::INFINITY,
            },
        };
        let mut end = End { place: start(), at: Measured::ZERO };
        let certificate = match solver.method {
            Method::Certified | Method::General => {
                let mut ahead = Stance::new(start());
                self.search(&target, &mut ahead, &mut effort, &mut end)
            }
            Method::PlainNewton => self.plain_newton(&target, start(), &mut effort, &mut end),
        };
        let certificate =
            certificate.map_err(|fault| self.explained(fault, &target, &start(), solver))?;
        let residual = self.off(&target, &end.at);
        if redundant && !(residual <= self.residual_limit(solver)) {
            return Err(self.inconsistent(&target, &start(), residual));
        }
        let corrections = match &self.nut {
            Some(nut) => nut.corrections(&end.at.torsion),
            None => [0.0; N],
        };
        let (pose, full) = match &settled {
            None => {
                let pose = self.pose_at(&end.place, joints, tool, &seed, &trig);
                (pose, pose)
            }
            Some((couplings, from)) => {
                let found = (*couplings, from);
                self.commanded(found, &end.place, joints, tool, (&seed, &trig))?
            }
        };
        // A pose that inverse would refuse must not become the next seed.
        pose.check()?;
        Ok(Solution {
            pose,
            full,
            iterations: effort.spent,
            sub_steps: effort.sub_steps,
            residual,
            corrections: self.per_leg(&corrections),
            certificate,
        })
    }

    /// Replaces a refusal of the search by its underlying reason.
    fn explained(&self, fault: Fault, target: &Target<N>, start: &Place, solver: &Solver) -> Fault {
        let redundant = self.layout.is_redundant();
        match fault.cause {
            // These joints are the seed's own.
            Cause::OutOfReach => Fault { cause: Cause::SeedOutOfReach, ..fault },
            // Least squares converge more slowly the more the legs contradict each other.
            Cause::NotConverged if redundant && fault.value > self.residual_limit(solver) => {
                self.inconsistent(target, start, fault.value)
            }
            _ => fault,
        }
    }

    fn criterion(&self, solver: &Solver) -> f64 {
        solver.criterion(self.size)
    }

    pub fn largest_residual(&self, solver: &Solver) -> f64 {
        match (self.layout.is_redundant(), self.moving) {
            (true, _) => self.residual_limit(solver),
            (false, true) => self.criterion(solver) / LEAST_DRIVE,
            (false, false) => self.criterion(solver),
        }
    }

    /// Computes the pose from the platform's pose, with the table at its joint values.
    #[inline(always)]
    fn pose_at(
        &self,
        place: &Place,
        joints: &Joints,
        tool: &Vector3<f64>,
        seed: &Pose,
        trig: &Trigonometry,
    ) -> Pose {
        let mut point = place.centre;
        for (i, letter) in self.layout.table().as_slice().iter().enumerate() {
            let value = joints.get(self.count() + i).copied().unwrap_or(f64::NAN);
            point[letter.index().min(2)] = value;
        }
        let r = &place.rotation;
        let mut pose = Pose {
            position: point + tool - r * (tool + self.reference),
            angles: match self.chart {
                Chart::Group => angles_near(r, seed, trig),
                Chart::Angles | Chart::Level => place.angles,
            },
        };
        for letter in [Letter::X, Letter::Y, Letter::Z] {
            if self.holds && self.layout.is_held(letter) {
                pose.position[letter.index().min(2)] = 0.0;
            }
        }
        pose
    }

    /// Computes the pose with its commanded coordinates alone, and with all, and checks that the former lead back to the
    /// platform's: a joint path may pass a constraint singularity, beyond which they belong to another pose. Near the seed
    /// the proof of its dependent coordinates covers this pose, too.
    #[inline(never)]
    fn commanded(
        &self,
        (couplings, from): (&Couplings, &Settled),
        place: &Place,
        joints: &Joints,
        tool: &Vector3<f64>,
        (seed, trig): (&Pose, &Trigonometry),
    ) -> Result<(Pose, Pose), Fault> {
        let r = &place.rotation;
        let angles = if couplings.has_angles() { angles_near(r, seed, trig) } else { seed.angles };
        let own = place.centre + tool - r * (tool + self.reference);
        let mut pose = Pose { position: own, angles };
        let turned = Place { angles, ..*place };
        let full = couplings.pose(&turned, tool);
        let is_beside = couplings.is_beside(from, &turned, tool);
        for letter in Letter::ALL.into_iter().filter(|letter| self.layout.is_dependent(*letter)) {
            match letter.index() {
                k @ 0..3 => pose.position[k] = 0.0,
                k => pose.angles[k.min(5) - 3] = 0.0,
            }
        }
        for (i, letter) in self.layout.table().as_slice().iter().enumerate() {
            let value = joints.get(self.count() + i).copied().unwrap_or(f64::NAN);
            let k = letter.index().min(2);
            // The table compensates the platform's own motion, whose dependent part is computed from the pose.
            pose.position[k] = value + own[k];
        }
        if is_beside {
            return Ok((pose, full));
        }
        let back = couplings.settle(&pose, tool)?.place;
        let turned_off = (back.rotation - r).norm() * self.radius;
        let off = (back.centre - place.centre).norm() + turned_off;
        if !(off <= SAME_POSE * self.size) {
            return Err(Fault::with_value(Cause::ConstraintPassed, off));
        }
        Ok((pose, full))
    }

    #[inline(always)]
    fn refuse_table_not_finite(&self, joints: &Joints) -> Result<(), Fault> {
        if self.layout.joints() == self.count() {
            return Ok(());
        }
        let table = joints.iter().enumerate().take(self.layout.joints()).skip(self.count());
        for (i, joint) in table {
            if !joint.is_finite() {
                return Err(Fault::of_joint(Cause::JointNotFinite, &self.layout, i, *joint));
            }
        }
        Ok(())
    }

    /// Uses one certified ball if it reaches the target, certified tracking otherwise; `ahead` is at
    /// the start of the search.
    fn search(
        &self,
        target: &Target<N>,
        ahead: &mut Stance<N>,
        effort: &mut Effort,
        end: &mut End<N>,
    ) -> Result<Certificate, Fault> {
        // Start of the search, if `ahead` is moved away from it.
        let mut start = None;
        let mut motion = None;
        if self.moving {
            motion = self.motion(&self.target(&self.joints_at(&ahead.place)?)?, target);
            start = Some(ahead.place);
            ahead.place = self.taken_along(&ahead.place, motion.as_ref());
        }
        effort.spend()?;
        let share = match self.settle(target, ahead) {
            Ok(()) => {
                let first =
                    self.first_step(&ahead.at, &ahead.inverse, 0.0, target, motion.as_ref());
                if first.is_certified() {
                    return self.near(target, &Ball { about: ahead, first }, effort, end);
                }
                first.share_to_try()
            }
            // Anchors that move far from the seed's platform may not form a machine.
            Err(_) if self.moving => LEAST_SHARE,
            Err(fault) => return Err(fault),
        };
        ahead.place = self.track(target, start.unwrap_or(ahead.place), share, effort)?;
        effort.spend()?;
        self.settle(target, ahead)?;
        let first = self.first_step(&ahead.at, &ahead.inverse, 0.0, target, None);
        if !first.is_certified() {
            return Err(Fault::with_value(Cause::NotCertified, first.h()));
        }
        self.near(target, &Ball { about: ahead, first }, effort, end)
    }

    /// Runs Newton's method with the exact Jacobian and without proof.
    fn plain_newton(
        &self,
        target: &Target<N>,
        start: Place,
        effort: &mut Effort,
        end: &mut End<N>,
    ) -> Result<Certificate, Fault> {
        let motion = if self.moving {
            self.motion(&self.target(&self.joints_at(&start)?)?, target)
        } else {
            None
        };
        let mut inverse = PseudoInverse::ZERO;
        end.place = self.taken_along(&start, motion.as_ref());
        loop {
            self.measure(target, &end.place, &mut end.at)?;
            self.factor(&end.at, &end.place, &mut inverse)?;
            let step = newton_step(&inverse, &end.at.residual);
            let error = match self.layout.is_redundant() {
                false => inverse.inverse_norm() * norm(&end.at.residual),
                true => norm(&step),
            };
            if effort.is_converged(error, &end.at.residual) {
                return Ok(Certificate::None);
            }
            effort.spend()?;
            end.place = self.moved(&end.place, &step);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::tests::machine;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    #[test]
    fn a_refusal_of_the_search_reports_the_cause_behind_it() {
        let mut rng = Pcg64::seed_from_u64(27);
        let solver = Solver { residual_limit: 0.25, ..Solver::default() };
        for (coordinates, redundant) in [(b"XYZABC".as_slice(), false), (b"XYZAB", true)] {
            let (machine, start) = machine(&mut rng, coordinates, false).expect("a machine");
            let joints = machine.joints_at(&start).expect("joints");
            let target = machine.target(&joints).expect("a target");
            let reported = |fault| machine.explained(fault, &target, &start, &solver);
            // These joints are the seed's own.
            let fault = Fault::of_leg(Cause::OutOfReach, 2, 1.5);
            assert_eq!(reported(fault), Fault::of_leg(Cause::SeedOutOfReach, 2, 1.5));
            // Redundant legs contradict each other if they are off by more than the limit.
            for (off, inconsistent) in [(0.26, redundant), (0.25, false), (0.24, false)] {
                let fault = Fault::with_value(Cause::NotConverged, off);
                let expected = if inconsistent { Cause::JointsInconsistent } else { fault.cause };
                let found = reported(fault);
                assert_eq!((found.cause, found.value), (expected, off));
            }
            let fault = Fault::with_value(Cause::PathStalled, 9.0);
            assert_eq!(reported(fault), fault);
        }
    }
}
