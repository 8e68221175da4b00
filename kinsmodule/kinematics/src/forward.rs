// SPDX-License-Identifier: GPL-2.0-or-later
//! Forward kinematics: joints to the one pose that is connected with the seed.
//!
//! The *right* pose is the end of the unique continuous path from the seed along the
//! straight line in joint space, as long as the Jacobian stays regular. A returned
//! pose is that one, or the call fails. Near the seed one certified ball proves it;
//! far from it a chain of such balls does. See the module `certificate`.

use crate::certificate::{CERTAIN_AT_ALL, CERTIFIED, flatness};
use crate::fault::{Cause, Fault};
use crate::lanes::Lanes3;
use crate::machine::{Machine, Placed};
use crate::nut::Twist;
use crate::pose::{Pose, angles_near, cayley};
use crate::qr::Qr;
use libm::sqrt;
use nalgebra::{Matrix3, Vector3};

/// Most linear solves that `limit_iterations` may allow.
pub const MAX_ITERATIONS: u32 = 288;

/// Most sub-steps of one call.
pub const MAX_SUB_STEPS: u32 = 96;

/// Solves after the first one within a ball.
const MAX_CORRECTIONS: u32 = 8;

/// Trials for the length of one sub-step.
const MAX_TRIALS: u32 = 4;

/// Shortest sub-step, as a share of the joint path.
const SHORTEST_SUB_STEP: f64 = 1e-4;

/// Position error at which iteration stops, as a share of the size.
const POSE_TOLERANCE: f64 = 1e-12;

/// A step longer than this share of the radius spoils the old factorisation.
const CHORD_STEP: f64 = 1e-2;

/// Share of the tolerance that the correction after the next one may be expected to
/// leave: contraction differs from one correction to the next.
const CHORD_MARGIN: f64 = 0.02;

/// Rounding of a residual: no criterion below this share of the size can be met.
const RESIDUAL_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// How forward searches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Certified ball or certified tracking: right or refused.
    Certified,
    /// Newton's method alone, for comparison: may return another assembly of the machine.
    PlainNewton,
}

/// Settings of the solver; all may change between calls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solver {
    /// Largest leg residual accepted, in joint units; effectively not below
    /// 16 · 2⁻⁵² of the machine's size.
    pub convergence_criterion: f64,
    /// Most linear solves, 1 to [`MAX_ITERATIONS`].
    pub limit_iterations: u32,
    /// How to search.
    pub method: Method,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            convergence_criterion: 1e-9,
            limit_iterations: MAX_ITERATIONS,
            method: Method::Certified,
        }
    }
}

/// Proof that came with a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Certificate {
    /// Newton's method alone: nothing is proved.
    None,
    /// L(d) d < 1 of the last ball: legs determine the pose within it.
    Ball(f64),
}

/// A pose that forward found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution<const N: usize> {
    /// The pose, angles next to those of the seed.
    pub pose: Pose,
    /// Linear solves used.
    pub iterations: u32,
    /// Sub-steps of the joint path; 1 = within one ball of the seed.
    pub sub_steps: u32,
    /// Largest leg residual, in joint units.
    pub residual: f64,
    /// Nut-rotation corrections at the pose, machine units; zeros without a lead.
    pub corrections: [f64; N],
    /// The proof.
    pub certificate: Certificate,
}

/// Joints turned into what the solver sees: moving base anchors and target lengths.
struct Target<const N: usize> {
    anchors: Lanes3<N>,
    length: [f64; N],
}

/// Where the platform is: centroid of its anchors and rotation, in base.
#[derive(Clone, Copy)]
struct Place {
    centre: Vector3<f64>,
    rotation: Matrix3<f64>,
}

impl Place {
    /// Moved by a step (v, r ω) of the chart.
    #[inline]
    fn moved(&self, step: &[f64; 6], radius: f64) -> Self {
        let turn = Vector3::new(step[3], step[4], step[5]) / radius;
        Self {
            centre: self.centre + Vector3::new(step[0], step[1], step[2]),
            rotation: cayley(&turn) * self.rotation,
        }
    }
}

/// Residuals at a place, with what the rows need.
struct Measured<const N: usize> {
    placed: Placed<N>,
    twist: Option<Twist<N>>,
    residual: [f64; N],
}

/// Result of the search before it becomes a pose.
struct Found<const N: usize> {
    place: Place,
    residual: f64,
    corrections: [f64; N],
    certificate: Certificate,
}

/// The straight line in joint space from the seed's joints to the target.
struct Path<'a, const N: usize, F: Fn(f64) -> [f64; N]> {
    /// Joints at a share of the path.
    along: &'a F,
    target: &'a Target<N>,
    /// Share already covered.
    done: f64,
    /// Bound of the Newton step back to the path.
    leftover: f64,
}

/// A Newton step and its certificate.
struct Step {
    step: [f64; 6],
    length: f64,
    /// L of the ball of twice its length; infinite where nothing can be said.
    flat: f64,
    /// L η.
    h: f64,
}

/// A certified step along the path.
struct SubStep {
    step: [f64; 6],
    /// Share of the path it covers.
    share: f64,
    /// Whether it leads to the end.
    arrives: bool,
    /// L η of the step.
    h: f64,
}

/// Counts and limits of one call.
struct Effort {
    iterations: u32,
    sub_steps: u32,
    limit: u32,
    /// Pose error at which iteration stops, a length.
    tolerance: f64,
    /// Largest leg residual accepted.
    accepted: f64,
}

impl Effort {
    /// Whether a pose error (a length) and the residuals that go with it are small enough.
    #[inline]
    fn is_converged<const N: usize>(&self, error: f64, residual: &[f64; N]) -> bool {
        error <= self.tolerance && largest(residual) <= self.accepted
    }

    /// Counts one linear solve.
    #[inline]
    fn spend(&mut self) -> Result<(), Fault> {
        if self.iterations >= self.limit {
            return Err(Fault::with_value(Cause::TooManyIterations, f64::from(self.limit)));
        }
        self.iterations += 1;
        Ok(())
    }
}

impl Solver {
    fn check(&self) -> Result<(), Fault> {
        if !(1..=MAX_ITERATIONS).contains(&self.limit_iterations) {
            let value = f64::from(self.limit_iterations);
            return Err(Fault::with_value(Cause::LimitIterationsInvalid, value));
        }
        if !(self.convergence_criterion > 0.0 && self.convergence_criterion.is_finite()) {
            return Err(Fault::with_value(Cause::CriterionInvalid, self.convergence_criterion));
        }
        Ok(())
    }
}

impl<const N: usize> Machine<N> {
    /// Pose of the joint values that is connected with `seed`.
    ///
    /// `joints` in joint units; `tool` as in [`Machine::inverse`]. Angles of the result
    /// are those nearest to the seed's, whole turns kept.
    ///
    /// # Errors
    /// A [`Fault`] of the joint, solver or settings group. With [`Method::Certified`]
    /// a pose is never returned unless it is proved to be the connected one.
    ///
    /// Cost: at most `limit_iterations` linear solves and [`MAX_SUB_STEPS`] sub-steps.
    pub fn forward(
        &self,
        joints: &[f64; N],
        seed: &Pose,
        tool: &Vector3<f64>,
        solver: &Solver,
    ) -> Result<Solution<N>, Fault> {
        solver.check()?;
        if !seed.is_finite() {
            return Err(Cause::SeedMissing.into());
        }
        seed.check()?;
        if !(tool.x.is_finite() && tool.y.is_finite() && tool.z.is_finite()) {
            return Err(Cause::ToolNotFinite.into());
        }
        let target = self.target(joints)?;
        let trig = seed.trigonometry();
        let rotation = trig.rotation();
        let start = Place { centre: self.centre(&seed.position, &rotation, tool), rotation };
        let mut effort = Effort {
            iterations: 0,
            sub_steps: 1,
            limit: solver.limit_iterations,
            tolerance: POSE_TOLERANCE * self.size,
            accepted: solver.convergence_criterion.max(RESIDUAL_ROUNDING * self.size),
        };
        let found = match solver.method {
            Method::Certified => self.search(joints, &target, start, &mut effort)?,
            Method::PlainNewton => self.plain_newton(&target, start, &mut effort)?,
        };
        let r = &found.place.rotation;
        let pose = Pose {
            position: found.place.centre + tool - r * (tool + self.centroid),
            angles: angles_near(r, seed, &trig),
        };
        // What inverse would refuse must not become the next seed either.
        pose.check()?;
        Ok(Solution {
            pose,
            iterations: effort.iterations,
            sub_steps: effort.sub_steps,
            residual: found.residual,
            corrections: found.corrections,
            certificate: found.certificate,
        })
    }

    /// Moving base anchors and target lengths of the joints: from here on no leg kind exists.
    #[inline]
    fn target(&self, joints: &[f64; N]) -> Result<Target<N>, Fault> {
        let mut target = Target { anchors: self.base, length: [0.0; N] };
        for (i, joint) in joints.iter().enumerate() {
            if !joint.is_finite() {
                return Err(Fault::of_leg(Cause::JointNotFinite, i, *joint));
            }
            let drive = self.legs[i]
                .drive(joint + self.offset[i])
                .map_err(|cause| Fault::of_leg(cause, i, *joint))?;
            target.anchors.set(i, self.base.get(i) + drive.displacement);
            target.length[i] = drive.length;
        }
        Ok(target)
    }

    /// Residual of every leg, length + correction − target length.
    #[inline]
    fn measured(&self, target: &Target<N>, place: &Place) -> Result<Measured<N>, Fault> {
        let placed = self.placed(&target.anchors, &place.centre, &place.rotation)?;
        let mut residual = placed.length;
        let mut twist = None;
        if let Some(nut) = &self.nut {
            let at = nut.twist(&placed.directions(), &place.rotation)?;
            for (r, c) in residual.iter_mut().zip(nut.corrections(&at)) {
                *r += c;
            }
            twist = Some(at);
        }
        for i in 0..N {
            residual[i] -= target.length[i];
        }
        Ok(Measured { placed, twist, residual })
    }

    #[inline]
    fn factored(&self, at: &Measured<N>) -> Result<Qr<N>, Fault> {
        let columns = self.rows(&at.placed, &at.placed.directions(), at.twist.as_ref());
        Qr::new(&self.scaled(columns)).ok_or(Cause::Singular.into())
    }

    /// L of the ball of radius `rho` about a measured place.
    #[inline]
    fn flat(&self, at: &Measured<N>, qr: &Qr<N>, rho: f64) -> Result<f64, Fault> {
        flatness(self, &at.placed, at.twist.as_ref(), qr, rho)
    }

    /// One certified ball if that reaches the target, certified tracking otherwise.
    #[inline]
    fn search(
        &self,
        joints: &[f64; N],
        target: &Target<N>,
        start: Place,
        effort: &mut Effort,
    ) -> Result<Found<N>, Fault> {
        let at = self.measured(target, &start)?;
        let qr = self.factored(&at)?;
        effort.spend()?;
        let first = self.first_step(&at, &qr, 0.0);
        if first.h <= CERTIFIED {
            return self.near(target, &start, &at, &qr, &first, effort);
        }
        self.refuse_nearly_singular(&at, &qr)?;
        let (place, at, qr) = self.track(joints, target, start, first.h, effort)?;
        effort.spend()?;
        let first = self.first_step(&at, &qr, 0.0);
        if !(first.h <= CERTIFIED) {
            return Err(Fault::with_value(Cause::NotCertified, first.h));
        }
        self.near(target, &place, &at, &qr, &first, effort)
    }

    /// Newton's step from a measured place, and how flat the ball is that it needs; the
    /// ball reaches at least twice `leftover` far.
    #[inline]
    fn first_step(&self, at: &Measured<N>, qr: &Qr<N>, leftover: f64) -> Step {
        let step = newton_step(qr, &at.residual);
        let length = norm(&step);
        let reach = length.max(leftover);
        let flat = self.flat(at, qr, 2.0 * reach).unwrap_or(f64::INFINITY);
        Step { step, length, flat, h: flat * reach }
    }

    /// Converges within the ball about `centre`, whose first step is known.
    #[inline]
    fn near(
        &self,
        target: &Target<N>,
        centre: &Place,
        at: &Measured<N>,
        qr: &Qr<N>,
        first: &Step,
        effort: &mut Effort,
    ) -> Result<Found<N>, Fault> {
        let mut place = centre.moved(&first.step, self.radius);
        let mut length = first.length;
        let mut contraction = 1.0;
        let mut travelled = length;
        let mut current = self.measured(target, &place)?;
        let mut renewed = None;
        let mut converged = false;
        for _ in 0..=MAX_CORRECTIONS {
            let used = renewed.as_ref().unwrap_or(qr);
            let error = (length * contraction).min(used.inverse_norm() * norm(&current.residual));
            converged = effort.is_converged(error, &current.residual);
            if converged {
                break;
            }
            // The first correction tells how well the factorisation still serves.
            let known = contraction < 1.0;
            if length > CHORD_STEP * self.radius
                || (known && length * contraction * contraction > CHORD_MARGIN * effort.tolerance)
            {
                renewed = Some(self.factored(&current)?);
            }
            effort.spend()?;
            let correction = newton_step(renewed.as_ref().unwrap_or(qr), &current.residual);
            let shorter = norm(&correction);
            contraction = shorter / length;
            length = shorter;
            travelled += length;
            place = place.moved(&correction, self.radius);
            current = self.measured(target, &place)?;
        }
        if !converged {
            return Err(Fault::with_value(Cause::NotConverged, largest(&current.residual)));
        }
        let reach = self.reach(at, qr, first, travelled);
        if !(reach < 1.0) {
            return Err(Fault::with_value(Cause::NotCertified, reach));
        }
        if !(first.flat * self.size * CERTAIN_AT_ALL < 1.0) {
            self.refuse_nearly_singular(at, qr)?;
        }
        Ok(self.found(place, &current, Certificate::Ball(reach)))
    }

    /// L(d) d of the distance travelled; the ball of the first step serves if it is as large.
    #[inline]
    fn reach(&self, at: &Measured<N>, qr: &Qr<N>, first: &Step, travelled: f64) -> f64 {
        if travelled <= 2.0 * first.length {
            return first.flat * travelled;
        }
        self.flat(at, qr, travelled).unwrap_or(f64::INFINITY) * travelled
    }

    /// Follows the straight joint path from the seed to `target` by certified
    /// sub-steps, one Newton step each, to within one ball of its end.
    ///
    /// A sub-step starts from a pose Y that is off the path by what the last one left
    /// unconverged: at most 0.16/L of that step's ball (Newton-Kantorovich with
    /// h ≤ 0.4), which is at most 0.26/L of the ball about Y. So the path's point is
    /// the one that the ball about Y determines. Because h ≤ 0.4 holds for the step back
    /// to the path as well as for the one ahead, it holds for every point of the joint
    /// path between, and the path of the platform stays in that ball.
    fn track(
        &self,
        joints: &[f64; N],
        target: &Target<N>,
        start: Place,
        h_whole: f64,
        effort: &mut Effort,
    ) -> Result<(Place, Measured<N>, Qr<N>), Fault> {
        let from = self.joints_of(&start)?;
        let mut place = start;
        let mut done = 0.0;
        let mut share = shrunk(1.0, h_whole);
        effort.sub_steps = 0;
        while effort.sub_steps < MAX_SUB_STEPS {
            effort.sub_steps += 1;
            let along = |t: f64| core::array::from_fn(|i| from[i] + t * (joints[i] - from[i]));
            let here = self.measured(&self.target(&along(done))?, &place)?;
            let qr = self.factored(&here)?;
            let leftover = qr.inverse_norm() * norm(&here.residual);
            let path = Path { along: &along, target, done, leftover };
            let taken = self.sub_step(&path, &place, &qr, share, effort)?;
            place = place.moved(&taken.step, self.radius);
            done += taken.share;
            if taken.arrives {
                let at = self.measured(target, &place)?;
                let qr = self.factored(&at)?;
                return Ok((place, at, qr));
            }
            share = taken.share * 0.95 * (CERTIFIED / taken.h).min(4.0);
        }
        Err(Fault::with_value(Cause::TooManySubSteps, f64::from(MAX_SUB_STEPS)))
    }

    /// Chooses the share of the path that one certified Newton step may cover.
    fn sub_step(
        &self,
        path: &Path<'_, N, impl Fn(f64) -> [f64; N]>,
        place: &Place,
        qr: &Qr<N>,
        mut share: f64,
        effort: &mut Effort,
    ) -> Result<SubStep, Fault> {
        for _ in 0..MAX_TRIALS {
            let rest = 1.0 - path.done;
            let arrives = share >= rest;
            if !(arrives || share >= SHORTEST_SUB_STEP) {
                break;
            }
            // The end is the target itself, not a sum of shares.
            let ahead = if arrives {
                self.measured(path.target, place)?
            } else {
                self.measured(&self.target(&(path.along)(path.done + share))?, place)?
            };
            effort.spend()?;
            let Step { step, h, .. } = self.first_step(&ahead, qr, path.leftover);
            share = share.min(rest);
            if h <= CERTIFIED {
                return Ok(SubStep { step, share, arrives, h });
            }
            share = shrunk(share, h);
        }
        Err(Fault::with_value(Cause::PathStalled, path.done))
    }

    /// Joint values of a place.
    fn joints_of(&self, place: &Place) -> Result<[f64; N], Fault> {
        let none = Vector3::zeros();
        let position = place.centre - place.rotation * self.centroid;
        self.joints_at(&position, &place.rotation, &none)
    }

    fn refuse_nearly_singular(&self, at: &Measured<N>, qr: &Qr<N>) -> Result<(), Fault> {
        if self.flat(at, qr, 0.0)? * self.size * CERTAIN_AT_ALL < 1.0 {
            return Ok(());
        }
        Err(Cause::NearlySingular.into())
    }

    fn found(&self, place: Place, at: &Measured<N>, certificate: Certificate) -> Found<N> {
        let corrections = match (&self.nut, &at.twist) {
            (Some(nut), Some(twist)) => nut.corrections(twist),
            _ => [0.0; N],
        };
        Found { place, residual: largest(&at.residual), corrections, certificate }
    }

    /// Newton's method with the exact Jacobian and no proof.
    fn plain_newton(
        &self,
        target: &Target<N>,
        start: Place,
        effort: &mut Effort,
    ) -> Result<Found<N>, Fault> {
        let mut place = start;
        loop {
            let at = self.measured(target, &place)?;
            let qr = self.factored(&at)?;
            if effort.is_converged(qr.inverse_norm() * norm(&at.residual), &at.residual) {
                return Ok(self.found(place, &at, Certificate::None));
            }
            effort.spend()?;
            place = place.moved(&newton_step(&qr, &at.residual), self.radius);
        }
    }
}

/// A share of the path that should meet the certificate, after one with `h` did not.
fn shrunk(share: f64, h: f64) -> f64 {
    share * (0.9 * CERTIFIED / h).clamp(0.02, 0.9)
}

#[inline]
fn newton_step<const N: usize>(qr: &Qr<N>, residual: &[f64; N]) -> [f64; 6] {
    qr.solve(residual).map(|x| -x)
}

#[inline]
fn norm<const M: usize>(v: &[f64; M]) -> f64 {
    let mut sum = 0.0;
    for x in v {
        sum += x * x;
    }
    sqrt(sum)
}

#[inline]
fn largest<const N: usize>(v: &[f64; N]) -> f64 {
    v.iter().fold(0.0, |m: f64, x| if x.abs() <= m { m } else { x.abs() })
}
