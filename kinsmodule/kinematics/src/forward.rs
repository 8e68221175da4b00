// SPDX-License-Identifier: GPL-2.0-or-later
//! Forward kinematics: joints to the one pose that is connected with the seed.
//!
//! The *right* pose is the end of the unique continuous path from the seed along the
//! straight line in joint space, as long as the Jacobian stays regular. A returned
//! pose is that one, or the call fails. Near the seed one certified ball proves it;
//! far from it a chain of such balls does. See the module `certificate`.

use crate::certificate::{CERTAIN_AT_ALL, CERTIFIED, Motion, bow, drift, flatness};
use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, are_above, are_finite, are_within, inner, pair, put};
use crate::layout::{Joints, Letter, MAX_LEGS, PerLeg};
use crate::leg::LEAST_DRIVE;
use crate::machine::{Chart, Displacement, Mechanism, Place, Placed};
use crate::nut::Twist;
use crate::pose::{Pose, Trigonometry, angles_near, cayley_change};
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

/// Share of the tolerance that the correction after the next one may be expected to leave: beyond
/// it another factorisation keeps a servo step to three solves.
const CHORD_MARGIN: f64 = 0.03;

/// Steps that the secant updates of one factorisation remember.
const SECANTS: usize = 4;

/// Rounding of a residual: no criterion below this share of the size can be met.
const RESIDUAL_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Default of the residual limit as a share of the platform radius: a following error of
/// 1 mm of one carriage leaves 0.25 mm on the four rods of paper 000's machine, and a
/// platform of 120 mm then allows 0.6 mm.
const RESIDUAL_SHARE: f64 = 5e-3;

/// How many times less than all others the legs without a contradicting one have to be off
/// the seed: creeping away, a joint reaches the limit with others as far off as its own.
const STANDS_OUT: f64 = 2.0;

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
    /// Largest leg residual accepted where legs exceed coordinates, in machine units;
    /// 0 = 5e-3 of the platform radius.
    pub residual_limit: f64,
    /// How to search.
    pub method: Method,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            convergence_criterion: 1e-9,
            limit_iterations: MAX_ITERATIONS,
            residual_limit: 0.0,
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
pub struct Solution {
    /// The pose, angles next to those of the seed.
    pub pose: Pose,
    /// Linear solves used.
    pub iterations: u32,
    /// Sub-steps of the joint path; 1 = within one ball of the seed.
    pub sub_steps: u32,
    /// Largest leg residual as an error of its joint, in machine units: of a strut's
    /// length, of a carriage's place, of an arm's end along its circle.
    pub residual: f64,
    /// Nut-rotation corrections at the pose, machine units; zeros without a lead.
    pub corrections: PerLeg,
    /// The proof.
    pub certificate: Certificate,
}

/// Joints turned into what the solver sees: moving base anchors and target lengths.
pub(crate) struct Target<const N: usize> {
    pub anchors: Lanes3<N>,
    length: [f64; N],
    joints: [f64; N],
}

impl<const N: usize> Target<N> {
    /// To be filled in by [`Mechanism::aim`].
    #[inline(always)]
    fn of(joints: [f64; N]) -> Self {
        Self { anchors: Lanes3::ZERO, length: [0.0; N], joints }
    }
}

/// Residuals at a place, with what the rows need.
#[derive(Clone, Copy)]
pub(crate) struct Measured<const N: usize> {
    pub placed: Placed<N>,
    /// Means something on machines with a nut only.
    twist: Twist<N>,
    residual: [f64; N],
}

impl<const N: usize> Measured<N> {
    const ZERO: Self = Self { placed: Placed::ZERO, twist: Twist::ZERO, residual: [0.0; N] };
}

/// Where a search has come to.
struct End<const N: usize> {
    place: Place,
    at: Measured<N>,
}

/// A factored place, about which the chart is laid.
struct Stance<const N: usize> {
    place: Place,
    at: Measured<N>,
    qr: Qr<N>,
}

impl<const N: usize> Stance<N> {
    /// To be measured and factored.
    #[inline(always)]
    fn new(place: Place) -> Self {
        Self { place, at: Measured::ZERO, qr: Qr::ZERO }
    }
}

/// Broyden's updates of a factorisation by the steps made with it: what they save is a
/// second factorisation.
struct Secants {
    steps: [[f64; 6]; SECANTS],
    /// Inverse squared lengths of the steps.
    weights: [f64; SECANTS],
    count: usize,
}

impl Secants {
    const NONE: Self = Self { steps: [[0.0; 6]; SECANTS], weights: [0.0; SECANTS], count: 0 };

    #[inline(always)]
    fn remember(&mut self, step: &[f64; 6], square: f64) {
        let (steps, weights) = (&mut self.steps, &mut self.weights);
        if square > 0.0
            && let (Some(place), Some(weight)) =
                (steps.get_mut(self.count), weights.get_mut(self.count))
        {
            (*place, *weight) = (*step, 1.0 / square);
            self.count += 1;
        }
    }

    /// The updated step, from that of the old factorisation (Kelley's form of Broyden's
    /// method: only the steps are kept).
    #[inline(always)]
    fn updated(&self, mut step: [f64; 6]) -> [f64; 6] {
        let mut gain = 0.0;
        for k in 0..SECANTS {
            if k >= self.count {
                break;
            }
            gain = inner(&self.steps[k], &step) * self.weights[k];
            match self.steps.get(k + 1) {
                Some(next) if k + 1 < self.count => step = along(&step, gain, next),
                _ => {}
            }
        }
        // A larger gain is no update of a factorisation that still serves.
        if !(gain.abs() < 0.5) {
            return step;
        }
        let by = 1.0 / (1.0 - gain);
        step.map(|value| value * by)
    }
}

/// Steps within a ball.
struct Walk {
    /// Where they have led to in the chart at hand.
    x: [f64; 6],
    /// Covered in charts that were left.
    covered: f64,
    /// Length of the last step.
    length: f64,
    /// Its share of the step before.
    contraction: f64,
    corrections: u32,
    /// Whether the factorisation at hand was made for the next step.
    renewed: bool,
    secants: Secants,
}

impl Walk {
    #[inline(always)]
    fn begun(first: &Step) -> Self {
        let mut secants = Secants::NONE;
        secants.remember(&first.step, first.length * first.length);
        Self {
            x: first.step,
            covered: 0.0,
            length: first.length,
            contraction: 1.0,
            corrections: 0,
            renewed: false,
            secants,
        }
    }

    /// One more step, from that of the factorisation at hand.
    #[inline(always)]
    fn correct(&mut self, step: [f64; 6]) {
        let step = self.secants.updated(step);
        let square = inner(&step, &step);
        self.secants.remember(&step, square);
        let length = sqrt(square);
        self.contraction = length / self.length;
        self.length = length;
        self.x = along(&self.x, 1.0, &step);
        self.renewed = false;
    }

    /// Goes on in a chart about the place that it has led to.
    fn renew(&mut self) {
        self.covered += norm(&self.x);
        self.x = [0.0; 6];
        self.secants = Secants::NONE;
        self.renewed = true;
    }
}

/// The straight line in joint space from the seed's joints to the target.
struct Path<'a, const N: usize, F: Fn(f64) -> [f64; N]> {
    /// Joints at a share of the path.
    along: &'a F,
    /// Where the sub-step starts.
    here: &'a Target<N>,
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

/// A factored place with its Newton step, which is certified.
struct Ball<'a, const N: usize> {
    about: &'a Stance<N>,
    first: Step,
}

/// A certified step along the path.
struct SubStep {
    /// Where it leads.
    place: Place,
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
    #[inline(always)]
    fn is_converged<const N: usize>(&self, error: f64, residual: &[f64; N]) -> bool {
        error <= self.tolerance && are_within(residual, self.accepted)
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
        if !(self.residual_limit >= 0.0 && self.residual_limit.is_finite()) {
            return Err(Fault::with_value(Cause::ResidualLimitInvalid, self.residual_limit));
        }
        Ok(())
    }
}

impl Solution {
    /// To be written by [`crate::Machine::forward_into`].
    pub const NONE: Self = Self {
        pose: Pose {
            position: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
            angles: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
        },
        iterations: 0,
        sub_steps: 0,
        residual: f64::NAN,
        corrections: [0.0; MAX_LEGS],
        certificate: Certificate::None,
    };
}

impl<const N: usize> Mechanism<N> {
    #[inline]
    pub fn forward(
        &self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
        solver: &Solver,
        solution: &mut Solution,
    ) -> Result<(), Fault> {
        solver.check()?;
        let seed = &if self.holds { self.held(seed, false)? } else { *seed };
        seed.check().map_err(|fault| match fault.cause {
            Cause::PoseNotFinite => Cause::SeedMissing.into(),
            _ => fault,
        })?;
        self.check_tool(tool)?;
        self.refuse_table_not_finite(joints)?;
        let mut target = Target::of(self.lanes_of(joints));
        self.aim(&mut target)?;
        let trig = seed.trigonometry();
        let rotation = trig.rotation();
        let centre = self.of_legs(self.point(&seed.position, &rotation, tool));
        let start = Place { centre, rotation, angles: seed.angles };
        let redundant = self.layout.is_redundant();
        let mut effort = Effort {
            iterations: 0,
            sub_steps: 1,
            limit: solver.limit_iterations,
            tolerance: POSE_TOLERANCE * self.size,
            accepted: match redundant {
                false => self.criterion(solver),
                // Legs that contradict each other leave what they leave: judged at the end.
                true => f64::INFINITY,
            },
        };
        let mut end = End { place: start, at: Measured::ZERO };
        let certificate = match solver.method {
            Method::Certified => self.search(&target, start, &mut effort, &mut end),
            Method::PlainNewton => self.plain_newton(&target, start, &mut effort, &mut end),
        };
        let certificate =
            certificate.map_err(|fault| self.explained(fault, &target, &start, solver))?;
        let residual = self.off(&target, &end.at);
        if redundant && !(residual <= self.residual_limit(solver)) {
            let leg = self.contradicting(&target, &start);
            return Err(Fault { cause: Cause::JointsInconsistent, leg, value: residual });
        }
        let corrections = match &self.nut {
            Some(nut) => nut.corrections(&end.at.twist),
            None => [0.0; N],
        };
        let pose = self.pose_at(&end.place, joints, tool, seed, &trig);
        // What inverse would refuse must not become the next seed either.
        pose.check()?;
        *solution = Solution {
            pose,
            iterations: effort.iterations,
            sub_steps: effort.sub_steps,
            residual,
            corrections: self.per_leg(&corrections),
            certificate,
        };
        Ok(())
    }

    /// The reason behind a refusal of the search.
    #[cold]
    fn explained(&self, fault: Fault, target: &Target<N>, start: &Place, solver: &Solver) -> Fault {
        let redundant = self.layout.is_redundant();
        match fault.cause {
            // Only the seed's own joints are asked for.
            Cause::OutOfReach => Fault { cause: Cause::SeedOutOfReach, ..fault },
            // Least squares converge the worse the more the legs contradict each other.
            Cause::NotConverged if redundant && fault.value > self.residual_limit(solver) => {
                let leg = self.contradicting(target, start);
                Fault { cause: Cause::JointsInconsistent, leg, value: fault.value }
            }
            _ => fault,
        }
    }

    fn criterion(&self, solver: &Solver) -> f64 {
        solver.convergence_criterion.max(RESIDUAL_ROUNDING * self.size)
    }

    fn residual_limit(&self, solver: &Solver) -> f64 {
        match solver.residual_limit {
            0.0 => RESIDUAL_SHARE * self.radius,
            given => given,
        }
    }

    pub fn largest_residual(&self, solver: &Solver) -> f64 {
        match (self.layout.is_redundant(), self.moving) {
            (true, _) => self.residual_limit(solver),
            (false, true) => self.criterion(solver) / LEAST_DRIVE,
            (false, false) => self.criterion(solver),
        }
    }

    /// Joint values of the legs; lanes beyond the last leg repeat the first one.
    #[inline(always)]
    fn lanes_of(&self, joints: &Joints) -> [f64; N] {
        let mut lanes = *joints.first_chunk::<N>().unwrap_or(&[f64::NAN; N]);
        for lane in lanes.iter_mut().skip(self.count()) {
            *lane = joints[0];
        }
        lanes
    }

    /// The pose of a place of the platform, with the table where its joints are.
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

    fn refuse_table_not_finite(&self, joints: &Joints) -> Result<(), Fault> {
        let table = joints.iter().enumerate().take(self.layout.joints()).skip(self.count());
        for (i, joint) in table {
            if !joint.is_finite() {
                return Err(Fault::of_leg(Cause::JointNotFinite, i, *joint));
            }
        }
        Ok(())
    }

    /// Moving base anchors and target lengths of the joints: from here on no leg kind exists.
    pub(crate) fn target(&self, joints: &[f64; N]) -> Result<Target<N>, Fault> {
        let mut target = Target::of(*joints);
        self.aim(&mut target)?;
        Ok(target)
    }

    /// Fills a target in for its joints.
    #[inline(always)]
    fn aim(&self, target: &mut Target<N>) -> Result<(), Fault> {
        target.anchors = self.base;
        for i in (0..N).step_by(2) {
            put(&mut target.length, i, pair(&target.joints, i) + pair(&self.offset, i));
        }
        if !self.moving && are_above(&target.length, 0.0) && are_finite(&target.length) {
            return Ok(());
        }
        self.drive(target)
    }

    /// The same leg by leg, each as its kind has it; names the one that refuses.
    fn drive(&self, target: &mut Target<N>) -> Result<(), Fault> {
        for i in 0..N {
            let joint = target.joints[i];
            if !joint.is_finite() {
                return Err(Fault::of_leg(Cause::JointNotFinite, i, joint));
            }
            let drive = self.legs[i]
                .drive(joint + self.offset[i])
                .map_err(|cause| Fault::of_leg(cause, i, joint))?;
            target.anchors.set(i, self.base.get(i) + drive.displacement);
            target.length[i] = drive.length;
        }
        Ok(())
    }

    /// How the legs move between two targets; `None` where all are struts.
    #[inline]
    fn motion(&self, from: &Target<N>, to: &Target<N>) -> Option<Motion<N>> {
        if !self.moving {
            return None;
        }
        let chord = |i: usize| to.anchors.get(i) - from.anchors.get(i);
        let mut shift = Vector3::zeros();
        // With nut corrections the platform stays: they would change along the way.
        if self.nut.is_none() {
            for i in 0..self.count() {
                shift += chord(i);
            }
            shift = self.of_legs(shift / self.count() as f64);
        }
        let mut motion = Motion { shift, travel: [0.0; N], second: [0.0; N], turn: [0.0; N] };
        for i in 0..N {
            let bend = self.legs[i].bend(to.joints[i] - from.joints[i]);
            motion.travel[i] = (chord(i) - shift).norm() + bend.anchor / 2.0;
            motion.second[i] = bend.anchor + bend.length;
            motion.turn[i] = bend.turn;
        }
        Some(motion)
    }

    /// A place taken along by a motion of the base anchors.
    fn taken_along(&self, place: &Place, motion: Option<&Motion<N>>) -> Place {
        let shift = motion.map_or(Vector3::zeros(), |motion| motion.shift);
        Place { centre: place.centre + shift, ..*place }
    }

    /// What the point `x` = (v, r ω) of the chart about a place is away from it.
    #[inline(always)]
    fn displacement(&self, place: &Place, x: &[f64; 6]) -> Displacement {
        let change = match self.chart {
            Chart::Group => cayley_change(&self.turn(x)),
            Chart::Angles => {
                let rotation = self.turned(place, x).rotation();
                rotation * place.rotation.transpose() - Matrix3::identity()
            }
            Chart::Level => Matrix3::zeros(),
        };
        Displacement { shift: Vector3::new(x[0], x[1], x[2]), change }
    }

    /// Turn of a point of the chart, in radians.
    #[inline(always)]
    fn turn(&self, x: &[f64; 6]) -> Vector3<f64> {
        Vector3::new(x[3], x[4], x[5]) * (1.0 / self.radius)
    }

    /// Pose of the reference point at a point of the chart of angles.
    fn turned(&self, place: &Place, x: &[f64; 6]) -> Pose {
        Pose { position: place.centre, angles: place.angles + self.turn(x) }
    }

    /// The place at a point of the chart about another one.
    #[inline(always)]
    fn moved(&self, place: &Place, x: &[f64; 6]) -> Place {
        let Displacement { shift, change } = self.displacement(place, x);
        let centre = place.centre + shift;
        match self.chart {
            Chart::Angles => {
                let pose = self.turned(place, x);
                Place { centre, rotation: pose.rotation(), angles: pose.angles }
            }
            Chart::Group | Chart::Level => {
                let rotation = place.rotation + change * place.rotation;
                Place { centre, rotation, angles: place.angles }
            }
        }
    }

    /// Residual of every leg, length + correction − target length.
    #[inline(always)]
    fn measure(
        &self,
        target: &Target<N>,
        place: &Place,
        at: &mut Measured<N>,
    ) -> Result<(), Fault> {
        self.place(&target.anchors, place, &mut at.placed);
        if let Some(nut) = &self.nut {
            at.twist = nut.twist(&at.placed.directions(), &place.rotation);
        }
        self.compare(target, at)
    }

    /// The same at a point of the chart about a place: less work than from scratch.
    #[inline(always)]
    fn measure_from(
        &self,
        about: &Stance<N>,
        x: &[f64; 6],
        target: &Target<N>,
        at: &mut Measured<N>,
    ) -> Result<(), Fault> {
        let by = self.displacement(&about.place, x);
        about.at.placed.moved(&by, &mut at.placed);
        if let Some(nut) = &self.nut {
            nut.twist_from(&about.at.twist, &at.placed.directions(), &by.change, &mut at.twist);
        }
        self.compare(target, at)
    }

    /// Residuals of lengths and twists; refuses legs that have none.
    #[inline(always)]
    fn compare(&self, target: &Target<N>, at: &mut Measured<N>) -> Result<(), Fault> {
        self.refuse_short_legs(&at.placed.length)?;
        let mut corrections = [0.0; N];
        if let Some(nut) = &self.nut {
            nut.refuse_along_axis(&at.twist)?;
            corrections = nut.corrections(&at.twist);
        }
        for i in (0..N).step_by(2) {
            let length = pair(&at.placed.length, i) + pair(&corrections, i);
            let off = length - pair(&target.length, i);
            put(&mut at.residual, i, off * pair(&self.present, i));
        }
        Ok(())
    }

    fn measured(&self, target: &Target<N>, place: &Place) -> Result<Measured<N>, Fault> {
        let mut at = Measured::ZERO;
        self.measure(target, place, &mut at)?;
        Ok(at)
    }

    /// The twist of a machine that has any.
    #[inline]
    fn twist_of<'a>(&self, at: &'a Measured<N>) -> Option<&'a Twist<N>> {
        self.nut.is_some().then_some(&at.twist)
    }

    /// Rows of the residuals in the chart, column by column.
    #[inline(always)]
    fn columns(&self, at: &Measured<N>, place: &Place) -> [[f64; N]; 6] {
        self.charted_rows(&at.placed, self.twist_of(at), place)
    }

    #[inline(always)]
    fn factor(&self, at: &Measured<N>, place: &Place, qr: &mut Qr<N>) -> Result<(), Fault> {
        match qr.renew(&self.active, self.columns(at, place)) {
            true => Ok(()),
            false => Err(Cause::Singular.into()),
        }
    }

    /// Measures and factors where a stance stands.
    #[inline(always)]
    fn settle(&self, target: &Target<N>, stance: &mut Stance<N>) -> Result<(), Fault> {
        self.measure(target, &stance.place, &mut stance.at)?;
        self.factor(&stance.at, &stance.place, &mut stance.qr)
    }

    /// L of the ball of radius `rho` about a measured place.
    fn flat(&self, at: &Measured<N>, qr: &Qr<N>, rho: f64) -> Result<f64, Fault> {
        flatness(self, &at.placed, self.twist_of(at), qr, rho, None)
    }

    /// One certified ball if that reaches the target, certified tracking otherwise.
    #[inline]
    fn search(
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
        effort.spend()?;
        let mut ahead = Stance::new(self.taken_along(&start, motion.as_ref()));
        let h_whole = match self.settle(target, &mut ahead) {
            Ok(()) => {
                let first = self.first_step(&ahead.at, &ahead.qr, 0.0, target, motion.as_ref());
                if first.h <= CERTIFIED {
                    return self.near(target, &Ball { about: &ahead, first }, effort, end);
                }
                first.h
            }
            // Far anchors about the seed's platform are a machine that need not exist.
            Err(_) if self.moving => f64::INFINITY,
            Err(fault) => return Err(fault),
        };
        ahead.place = self.track(target, start, h_whole, effort)?;
        self.settle(target, &mut ahead)?;
        effort.spend()?;
        let first = self.first_step(&ahead.at, &ahead.qr, 0.0, target, None);
        if !(first.h <= CERTIFIED) {
            return Err(Fault::with_value(Cause::NotCertified, first.h));
        }
        self.near(target, &Ball { about: &ahead, first }, effort, end)
    }

    /// Newton's step from a measured place towards `target`, and how flat the ball is that
    /// it needs; the ball reaches at least twice `leftover` far.
    #[inline]
    fn first_step(
        &self,
        at: &Measured<N>,
        qr: &Qr<N>,
        leftover: f64,
        target: &Target<N>,
        motion: Option<&Motion<N>>,
    ) -> Step {
        let step = newton_step(qr, &at.residual);
        let length = norm(&step);
        let mut reach = length.max(leftover);
        let mut turned = 0.0;
        if let Some(motion) = motion {
            reach += bow(self, &at.placed, qr, motion);
            let margin = |i: usize| self.margin(&at.placed, i, target.joints[i] + self.offset[i]);
            turned = drift(self, &at.placed, qr, 2.0 * reach, motion, margin);
        }
        let flat = flatness(self, &at.placed, self.twist_of(at), qr, 2.0 * reach, motion)
            .unwrap_or(f64::INFINITY);
        Step { step, length, flat, h: flat * reach + turned }
    }

    /// Converges within the ball, in the chart about its middle.
    #[inline(always)]
    fn near(
        &self,
        target: &Target<N>,
        ball: &Ball<'_, N>,
        effort: &mut Effort,
        end: &mut End<N>,
    ) -> Result<Certificate, Fault> {
        let Ball { about, first } = ball;
        let mut walk = Walk::begun(first);
        self.measure_from(about, &walk.x, target, &mut end.at)?;
        if self.converge(target, about, &mut walk, effort, &mut end.at)? {
            end.place = self.moved(&about.place, &walk.x);
        } else {
            self.converge_anew(target, &about.place, &mut walk, effort, end)?;
        }
        self.confirm(target, ball, walk.covered + norm(&walk.x), &end.at)
    }

    /// Corrects until the residuals `at` the end of the walk are gone; false where that wants
    /// another factorisation.
    #[inline(always)]
    fn converge(
        &self,
        target: &Target<N>,
        about: &Stance<N>,
        walk: &mut Walk,
        effort: &mut Effort,
        at: &mut Measured<N>,
    ) -> Result<bool, Fault> {
        loop {
            let error =
                (walk.length * walk.contraction).min(about.qr.inverse_norm() * norm(&at.residual));
            if effort.is_converged(error, &at.residual) {
                return Ok(true);
            }
            if !walk.renewed {
                if walk.corrections == MAX_CORRECTIONS {
                    return Err(Fault::with_value(Cause::NotConverged, largest(&at.residual)));
                }
                walk.corrections += 1;
                effort.spend()?;
                if self.must_renew(walk, effort.tolerance) {
                    return Ok(false);
                }
            }
            walk.correct(newton_step(&about.qr, &at.residual));
            self.measure_from(about, &walk.x, target, at)?;
        }
    }

    /// The same with new factorisations, from the walk's end in the chart about `place`.
    #[inline(never)]
    fn converge_anew(
        &self,
        target: &Target<N>,
        place: &Place,
        walk: &mut Walk,
        effort: &mut Effort,
        end: &mut End<N>,
    ) -> Result<(), Fault> {
        let mut about = Stance::new(self.moved(place, &walk.x));
        loop {
            self.settle(target, &mut about)?;
            walk.renew();
            let converged = self.converge(target, &about, walk, effort, &mut end.at)?;
            about.place = self.moved(&about.place, &walk.x);
            if converged {
                end.place = about.place;
                return Ok(());
            }
        }
    }

    /// Whether a factorisation no longer serves after a step of this length.
    #[inline(always)]
    fn must_renew(&self, walk: &Walk, tolerance: f64) -> bool {
        let Walk { length, contraction, .. } = *walk;
        // The first correction tells how well the factorisation still serves.
        let known = contraction < 1.0;
        // With more legs than coordinates the old one would settle elsewhere.
        self.layout.is_redundant()
            || length > CHORD_STEP * self.radius
            || (known && length * contraction * contraction > CHORD_MARGIN * tolerance)
    }

    /// The certificate of a pose at most `distance` from the middle of the ball.
    #[inline]
    fn confirm(
        &self,
        target: &Target<N>,
        ball: &Ball<'_, N>,
        distance: f64,
        end: &Measured<N>,
    ) -> Result<Certificate, Fault> {
        let Ball { about, first } = ball;
        // The ball of the first step serves if it is as large.
        let flat = match distance <= 2.0 * first.length {
            true => first.flat,
            false => self.flat(&about.at, &about.qr, distance).unwrap_or(f64::INFINITY),
        };
        let reach = flat * distance;
        if !(reach < 1.0) {
            return Err(Fault::with_value(Cause::NotCertified, reach));
        }
        if self.moving {
            self.refuse_dead_points(&end.placed, &target.joints)?;
        }
        if !(first.flat * self.size * CERTAIN_AT_ALL < 1.0) {
            self.refuse_nearly_singular(&about.at, &about.qr)?;
        }
        Ok(Certificate::Ball(reach))
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
        target: &Target<N>,
        start: Place,
        h_whole: f64,
        effort: &mut Effort,
    ) -> Result<Place, Fault> {
        let from = self.joints_at(&start)?;
        let along = |t: f64| core::array::from_fn(|i| from[i] + t * (target.joints[i] - from[i]));
        let mut place = start;
        let (mut at, mut qr) = (Measured::ZERO, Qr::ZERO);
        let mut done = 0.0;
        let mut share = shrunk(1.0, h_whole);
        effort.sub_steps = 0;
        while effort.sub_steps < MAX_SUB_STEPS {
            effort.sub_steps += 1;
            let here = self.target(&along(done))?;
            self.measure(&here, &place, &mut at)?;
            self.factor(&at, &place, &mut qr)?;
            if self.moving {
                self.refuse_dead_points(&at.placed, &here.joints)?;
            }
            if effort.sub_steps == 1 {
                self.refuse_nearly_singular(&at, &qr)?;
            }
            let leftover = norm(&newton_step(&qr, &at.residual));
            let path = Path { along: &along, here: &here, target, done, leftover };
            let taken = self.sub_step(&path, &place, &qr, share, effort)?;
            place = taken.place;
            done += taken.share;
            if taken.arrives {
                return Ok(place);
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
            let between;
            let to = if arrives {
                path.target
            } else {
                between = self.target(&(path.along)(path.done + share))?;
                &between
            };
            let motion = self.motion(path.here, to);
            let ahead = self.taken_along(place, motion.as_ref());
            let at = self.measured(to, &ahead)?;
            effort.spend()?;
            let Step { step, h, .. } = self.first_step(&at, qr, path.leftover, to, motion.as_ref());
            share = share.min(rest);
            if h <= CERTIFIED {
                return Ok(SubStep { place: self.moved(&ahead, &step), share, arrives, h });
            }
            share = shrunk(share, h);
        }
        Err(Fault::with_value(Cause::PathStalled, path.done))
    }

    fn refuse_nearly_singular(&self, at: &Measured<N>, qr: &Qr<N>) -> Result<(), Fault> {
        if self.flat(at, qr, 0.0)? * self.size * CERTAIN_AT_ALL < 1.0 {
            return Ok(());
        }
        Err(Cause::NearlySingular.into())
    }

    /// Largest error of a joint that the residuals amount to: of a strut's length, of the
    /// place of a carriage, of the end of an arm along its circle.
    #[inline]
    fn off(&self, target: &Target<N>, at: &Measured<N>) -> f64 {
        if !self.moving {
            return largest(&at.residual);
        }
        let mut off = at.residual;
        for (i, value) in off.iter_mut().enumerate() {
            let margin = self.margin(&at.placed, i, target.joints[i] + self.offset[i]);
            *value /= margin.unwrap_or(1.0);
        }
        largest(&off)
    }

    /// The leg without which the others agree best with the seed, for joints that
    /// contradict each other; `None` where no leg stands out. (Residuals alone cannot tell:
    /// with one leg more than coordinates they have the same shape whichever joint is off.
    /// A joint that creeps away takes the seed along, until nothing tells it from the others.)
    fn contradicting(&self, target: &Target<N>, start: &Place) -> Option<u8> {
        let mut best = (f64::INFINITY, None);
        let mut second = f64::INFINITY;
        for leg in 0..self.count() {
            let Ok(apart) = self.disagreement_without(leg, target, start) else { continue };
            if apart < best.0 {
                second = best.0;
                best = (apart, u8::try_from(leg).ok());
            } else if apart < second {
                second = apart;
            }
        }
        best.1.filter(|_| best.0 * STANDS_OUT <= second)
    }

    /// How far the legs but one are from fitting the seed: the step there, and what it leaves.
    fn disagreement_without(
        &self,
        leg: usize,
        target: &Target<N>,
        start: &Place,
    ) -> Result<f64, Fault> {
        let mut at = self.measured(target, start)?;
        let mut columns = self.columns(&at, start);
        let without = |values: &mut [f64; N]| {
            for (i, value) in values.iter_mut().enumerate() {
                if i == leg {
                    *value = 0.0;
                }
            }
        };
        without(&mut at.residual);
        columns.iter_mut().for_each(without);
        let qr = Qr::new(&columns, &self.active).ok_or(Cause::Singular)?;
        let step = newton_step(&qr, &at.residual);
        let mut left = at.residual;
        for (column, x) in columns.iter().zip(step) {
            for (value, row) in left.iter_mut().zip(column) {
                *value += row * x;
            }
        }
        Ok(norm(&step) + norm(&left))
    }

    /// Newton's method with the exact Jacobian and no proof.
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
        let mut qr = Qr::ZERO;
        end.place = self.taken_along(&start, motion.as_ref());
        loop {
            self.measure(target, &end.place, &mut end.at)?;
            self.factor(&end.at, &end.place, &mut qr)?;
            let step = newton_step(&qr, &end.at.residual);
            let error = match self.layout.is_redundant() {
                false => qr.inverse_norm() * norm(&end.at.residual),
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

/// A share of the path that should meet the certificate, after one with `h` did not.
fn shrunk(share: f64, h: f64) -> f64 {
    share * (0.9 * CERTIFIED / h).clamp(0.02, 0.9)
}

#[inline(always)]
fn newton_step<const N: usize>(qr: &Qr<N>, residual: &[f64; N]) -> [f64; 6] {
    qr.solve(residual).map(|x| -x)
}

/// x + share · y.
#[inline(always)]
fn along(x: &[f64; 6], share: f64, y: &[f64; 6]) -> [f64; 6] {
    core::array::from_fn(|k| x[k] + share * y[k])
}

#[inline(always)]
fn norm<const M: usize>(v: &[f64; M]) -> f64 {
    sqrt(inner(v, v))
}

#[inline]
fn largest<const N: usize>(v: &[f64; N]) -> f64 {
    v.iter().fold(0.0, |m: f64, x| if x.abs() <= m { m } else { x.abs() })
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::certificate::leg_bow;
    use crate::certificate::tests::{CHARTS, at, lengths, machine, random, unit};
    use crate::leg::Leg;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    /// Residuals `share` of the way between two targets, at a point of the chart about a
    /// platform that is taken along.
    fn residuals(
        machine: &Mechanism<6>,
        step: &JointStep,
        share: f64,
        point: &[f64; 6],
    ) -> Option<[f64; 6]> {
        let target = step.target(machine, share);
        let shift = step.motion.shift * share;
        let place = Place { centre: step.place.centre + shift, ..step.place };
        let lengths = lengths(machine, &target.anchors, &at(machine, &place, point))?;
        Some(core::array::from_fn(|i| lengths[i] - target.length[i]))
    }

    /// A step of the joints from those of a place.
    struct JointStep {
        place: Place,
        from: [f64; 6],
        to: [f64; 6],
        motion: Motion<6>,
    }

    impl JointStep {
        fn target(&self, machine: &Mechanism<6>, share: f64) -> Target<6> {
            let joints =
                core::array::from_fn(|i| self.from[i] + share * (self.to[i] - self.from[i]));
            machine.target(&joints).unwrap()
        }
    }

    /// A step of the joints from those of the place.
    fn joint_step(rng: &mut Pcg64, machine: &Mechanism<6>, place: Place) -> Option<JointStep> {
        let from = machine.joints_at(&place).ok()?;
        // A common part, which the platform may follow, and one of each leg's own; random
        // machines are ill-conditioned as often as not, so steps of every size are tried.
        let size = libm::pow(10.0, random(rng, -3.0, 0.7));
        let (common, apart) = (random(rng, -5.0, 5.0) * size, size);
        let to = from.map(|q| q + common + random(rng, -apart, apart));
        let motion = machine.motion(&machine.target(&from).ok()?, &machine.target(&to).ok()?)?;
        Some(JointStep { place, from, to, motion })
    }

    /// ‖M J(X, t) − 1‖ in the chart, by differences of the residuals.
    fn departure(
        machine: &Mechanism<6>,
        step: &JointStep,
        qr: &Qr<6>,
        share: f64,
        point: &[f64; 6],
    ) -> Option<f64> {
        // Rounding 2e-13/1e-2 and bends of 1e-3·1e-4 stay below 1e-6 with ‖M‖ up to 10.
        const STEP: f64 = 1e-2;
        let mut sum = 0.0;
        for k in (0..6).filter(|k| machine.active[*k]) {
            let at = |by: f64| {
                let mut x = *point;
                x[k] += by;
                residuals(machine, step, share, &x)
            };
            let (a, b) = (at(-STEP)?, at(STEP)?);
            let column = qr.solve(&core::array::from_fn(|i| (b[i] - a[i]) / (2.0 * STEP)));
            for (j, value) in column.iter().enumerate().filter(|(j, _)| machine.active[*j]) {
                sum += (value - f64::from(u8::from(j == k))).powi(2);
            }
        }
        Some(sqrt(sum))
    }

    #[test]
    fn no_residual_of_a_moving_leg_bows_more_than_the_bound_says_and_some_nearly_as_much() {
        let mut rng = Pcg64::seed_from_u64(13);
        let (mut checked, mut largest) = ([0; 3], [0.0_f64; 3]);
        for _ in 0..8000 {
            let Some((machine, place)) = machine(&mut rng, b"XYZABC", false) else { continue };
            let Some(step) = joint_step(&mut rng, &machine, place) else { continue };
            let ahead = machine.taken_along(&place, Some(&step.motion));
            let placed = machine.placed(&step.target(&machine, 1.0).anchors, &ahead);
            let at = |share| residuals(&machine, &step, share, &[0.0; 6]).unwrap();
            let share = rng.random();
            let (start, middle, end) = (at(0.0), at(share), at(1.0));
            for i in 0..6 {
                let off = middle[i] - start[i] - share * (end[i] - start[i]);
                let bound = leg_bow(&placed, &step.motion, i);
                // 1e-11: some roundings of lengths of some thousands.
                assert!(off.abs() <= bound + 1e-11, "{off:e} {bound:e}");
                // What rounding is no longer seen in.
                if bound > 1e-6 {
                    let kind = match machine.legs[i] {
                        Leg::Strut => 0,
                        Leg::Slider(_) => 1,
                        Leg::Crank(_) => 2,
                    };
                    largest[kind] = largest[kind].max(off.abs() / bound);
                    checked[kind] += 1;
                }
            }
        }
        std::println!("struts, rods, cranks: {checked:?} legs, {largest:.2?} of bound");
        assert!(checked.iter().all(|n| *n > 2000), "{checked:?}");
        // A bound that is far too wide would be sound and useless.
        assert!(largest.iter().all(|l| *l > 0.3), "{largest:?}");
    }

    #[test]
    fn at_every_moment_of_a_certified_step_the_rows_stay_within_the_bound() {
        for coordinates in CHARTS {
            let mut rng = Pcg64::seed_from_u64(12);
            let (mut checked, mut turned, mut stepped) = (0, 0.0_f64, 0.0_f64);
            for n in 0..10_000 {
                let Some((machine, place)) = machine(&mut rng, coordinates, n % 4 == 0) else {
                    continue;
                };
                let Some(step) = joint_step(&mut rng, &machine, place) else { continue };
                let to = step.target(&machine, 1.0);
                let ahead = machine.taken_along(&place, Some(&step.motion));
                let Ok(there) = machine.measured(&to, &ahead) else { continue };
                // The search factors ahead, a sub-step where it starts.
                let (stand, share) = if rng.random() { (ahead, 1.0) } else { (place, 0.0) };
                let mut stance = Stance::new(stand);
                if machine.settle(&step.target(&machine, share), &mut stance).is_err() {
                    continue;
                }
                let qr = stance.qr;
                let first = machine.first_step(&there, &qr, 0.0, &to, Some(&step.motion));
                if !(first.h <= CERTIFIED) {
                    continue;
                }
                let reach = first.length + bow(&machine, &there.placed, &qr, &step.motion);
                let rho = 2.0 * reach;
                let margin = |i: usize| machine.margin(&there.placed, i, to.joints[i]);
                let drift = drift(&machine, &there.placed, &qr, rho, &step.motion, margin);
                for _ in 0..4 {
                    let share = rng.random();
                    let away = random(&mut rng, 0.0, rho);
                    let point = unit(&mut rng, &machine).map(|x| x * away);
                    let Some(departure) = departure(&machine, &step, &qr, share, &point) else {
                        panic!("the nut has no correction within a certified ball");
                    };
                    let bound = first.flat * rho + drift;
                    assert!(departure <= bound + 1e-6, "{departure} {bound}");
                    turned = turned.max(departure / bound);
                    let residuals = residuals(&machine, &step, share, &[0.0; 6]).unwrap();
                    let length = norm(&newton_step(&qr, &residuals));
                    assert!(length <= reach * (1.0 + 1e-9) + 1e-9, "{length} {reach}");
                    stepped = stepped.max(length / reach);
                    // Every rod is on its side.
                    let target = step.target(&machine, share);
                    let shift = step.motion.shift * share;
                    let centre = Place { centre: place.centre + shift, ..place };
                    let placed = machine.placed(&target.anchors, &at(&machine, &centre, &point));
                    for i in 0..6 {
                        let margin = machine.margin(&placed, i, target.joints[i]);
                        assert!(margin.is_none_or(|m| m > 0.0), "{margin:?}");
                    }
                    checked += 1;
                }
            }
            let name = core::str::from_utf8(coordinates).unwrap();
            std::println!("{name}: {checked} points, rows {turned:.2}, step {stepped:.2} of bound");
            assert!(checked > 1000, "{name}: {checked}");
            // Bounds that are far too wide would be sound and useless.
            assert!(turned > 0.1 && stepped > 0.5, "{name}: {turned} {stepped}");
        }
    }
}
