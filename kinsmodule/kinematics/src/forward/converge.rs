// SPDX-License-Identifier: GPL-2.0-or-later
//! One certified ball: its first step, and the convergence to the pose that it determines.

use super::residual::{Measured, Stance, Way, along, newton_step, norm};
use super::solver::{Certificate, Effort};
use crate::certificate::{
    CERTAIN_AT_ALL, CERTIFIED, Motion, chord_deviation, lipschitz_constant, row_change,
};
use crate::fault::{Cause, Fault};
use crate::lanes::largest;
use crate::mechanism::Mechanism;
use crate::placed::Place;
use crate::pseudo_inverse::PseudoInverse;
use crate::target::Target;
use libm::sqrt;

/// Largest L d at which a pose at distance d is the only one in its ball: 1 less an allowance for rounding. The computed
/// pseudo-inverse times the rows differs from the identity by less than 0.01 (the tests of `pseudo_inverse`, and
/// docs/develop/certificate-rounding.md).
const ALONE: f64 = 0.99;

/// Linear solves after the first one within a ball.
const MAX_CORRECTIONS: u32 = 8;

/// A step longer than this share of the radius makes the old factorization useless.
const CHORD_STEP: f64 = 1e-2;

/// Share of the tolerance that the next step may be expected to leave: beyond it, a new
/// factorization keeps a servo step to three solves.
const CHORD_MARGIN: f64 = 0.03;

/// Target for h of the next step in a chain: below the limit, because L grows from one step to the next.
const AIM: f64 = 0.95 * CERTIFIED;

/// Smallest share that is tried next of a step that was too long.
pub(super) const LEAST_SHARE: f64 = 0.02;
const MOST_SHARE: f64 = 0.9;

/// Steps turn the platform by Cayley's formula, which differs from the chart by at most r|ω|³/12: a twenty-fifth of the
/// convergence error of a step η, which is at least h η/2. With all arms r on average, ‖J⁻¹‖_F √Σs₃² ≥ 4.24/r², so
/// that h ≥ 4.24 η²/r² and |ω|²/(6h) ≤ 1/25. Per leg, s₂ makes it smaller still.
const CAYLEY: f64 = 1.04;

/// Result of a search.
pub(super) struct End<const N: usize> {
    pub(super) place: Place,
    pub(super) at: Measured<N>,
}

/// Iteration within a ball.
struct Walk {
    /// Current point in the present chart.
    x: [f64; 6],
    /// Distance covered in earlier charts.
    covered: f64,
    /// Length of the last step.
    length: f64,
    /// Its ratio to the step before.
    contraction: f64,
    corrections: u32,
    /// Whether the present factorization was made for the next step.
    renewed: bool,
}

impl Walk {
    #[inline(always)]
    fn begun(x: [f64; 6], length: f64) -> Self {
        Self { x, covered: 0.0, length, contraction: 1.0, corrections: 0, renewed: false }
    }

    #[inline(always)]
    fn go(&mut self, step: &[f64; 6]) {
        let length = norm(step);
        self.contraction = length / self.length;
        self.length = length;
        self.x = along(&self.x, 1.0, step);
        self.renewed = false;
    }

    /// Continues in a chart around the current point.
    fn renew(&mut self) {
        self.covered += norm(&self.x);
        self.x = [0.0; 6];
        self.renewed = true;
    }
}

/// A Newton step and its certificate.
pub(super) struct Step {
    pub(super) step: [f64; 6],
    pub(super) length: f64,
    /// Required extent of the ball; its radius is twice that.
    pub(super) reach: f64,
    /// Change of the rows over the step.
    pub(super) turned: f64,
    /// L of the ball; infinite if no bound is known.
    pub(super) lipschitz: f64,
}

impl Step {
    /// Returns h, which the certificate allows up to 1/2.
    #[inline(always)]
    pub(super) fn h(&self) -> f64 {
        self.lipschitz * self.reach + self.turned
    }

    /// Returns whether the certificate holds.
    #[inline(always)]
    pub(super) fn is_certified(&self) -> bool {
        self.h() <= CERTIFIED
    }

    /// Bounds the convergence error of the step: (1 − √(1 − 2h) − h)/L (Newton-Kantorovich), in a form without
    /// cancellation, plus the change of the rows.
    pub(super) fn unconverged(&self) -> f64 {
        let h = self.h();
        CAYLEY * self.reach * (h + self.turned) / (1.0 - h + sqrt(1.0 - 2.0 * h))
    }

    /// Estimates the extent of the next ball of a chain; 0 if no bound is known.
    pub(super) fn next_length(&self) -> f64 {
        if !(self.h() < f64::INFINITY) {
            return 0.0;
        }
        self.reach * AIM / self.h()
    }

    /// Returns the share to try of a step that is too long, in a chain of steps, from the extent of its ball.
    pub(super) fn share_to_try(&self) -> f64 {
        if !(self.reach > 0.0) {
            return LEAST_SHARE;
        }
        (self.next_length() / self.reach).clamp(LEAST_SHARE, MOST_SHARE)
    }
}

/// A factored pose with its certified Newton step.
pub(super) struct Ball<'a, const N: usize> {
    pub(super) about: &'a Stance<N>,
    pub(super) first: Step,
}

impl<const N: usize> Mechanism<N> {
    /// Computes Newton's step from a measured pose towards `target`, and the Lipschitz constant of
    /// the ball that it needs, which extends at least twice `leftover`.
    #[inline(always)]
    pub(super) fn first_step(
        &self,
        at: &Measured<N>,
        inverse: &PseudoInverse<N>,
        leftover: f64,
        target: &Target<N>,
        motion: Option<&Motion<N>>,
    ) -> Step {
        let step = newton_step(inverse, &at.residual);
        let length = norm(&step);
        let mut reach = length.max(leftover);
        let mut turned = 0.0;
        if let Some(motion) = motion {
            reach += chord_deviation(self, &at.placed, inverse, motion);
            let margin = |i: usize| self.margin(&at.placed, i, target.joints[i] + self.offset[i]);
            turned = row_change(self, &at.placed, inverse, 2.0 * reach, motion, margin);
        }
        let lipschitz = self.lipschitz_of_legs(at, inverse, 2.0 * reach, motion);
        Step { step, length, reach, turned, lipschitz }
    }

    /// Computes the Lipschitz constant leg by leg, infinite if no bound is known.
    #[inline(always)]
    pub(super) fn lipschitz_of_legs(
        &self,
        at: &Measured<N>,
        inverse: &PseudoInverse<N>,
        rho: f64,
        motion: Option<&Motion<N>>,
    ) -> f64 {
        lipschitz_constant(self, &at.placed, self.torsion_of(at), inverse, rho, motion)
            .unwrap_or(f64::INFINITY)
    }

    /// Converges within the ball, in the chart around its center.
    #[inline(always)]
    pub(super) fn near(
        &self,
        target: &Target<N>,
        ball: &Ball<'_, N>,
        effort: &mut Effort,
        end: &mut End<N>,
    ) -> Result<Certificate, Fault> {
        let Ball { about, first } = ball;
        let mut walk = Walk::begun(self.bent_step(about, &first.step), first.length);
        let mut way = self.measure_from(about, &walk.x, target, &mut end.at)?;
        if self.converge(target, about, &mut walk, effort, &mut way, &mut end.at)? {
            end.place = self.moved_by(&about.place, &walk.x, &way);
        } else {
            // By value, to stay in registers, see `lanes`.
            walk = self.converge_anew(target, &about.place, walk, effort, end)?;
        }
        self.confirm(target, ball, walk.covered + norm(&walk.x), &end.at)
    }

    /// Corrects until the residuals `at` the end of the walk are below the tolerance. Returns false if a new
    /// factorization is needed.
    #[inline(always)]
    fn converge(
        &self,
        target: &Target<N>,
        about: &Stance<N>,
        walk: &mut Walk,
        effort: &mut Effort,
        way: &mut Way,
        at: &mut Measured<N>,
    ) -> Result<bool, Fault> {
        loop {
            let error = (walk.length * walk.contraction)
                .min(about.inverse.inverse_norm() * norm(&at.residual));
            if effort.is_converged(error, &at.residual) {
                return Ok(true);
            }
            let step = if walk.renewed {
                newton_step(&about.inverse, &at.residual)
            } else {
                if walk.corrections == MAX_CORRECTIONS {
                    return Err(Fault::with_value(Cause::NotConverged, largest(&at.residual)));
                }
                walk.corrections += 1;
                effort.spend()?;
                if self.must_renew(walk, effort.tolerance) {
                    return Ok(false);
                }
                self.refined_step(about, (&walk.x, way), at)
            };
            walk.go(&step);
            *way = self.measure_from(about, &walk.x, target, at)?;
        }
    }

    /// Converges with new factorizations, starting from the walk's end in the chart around `place`.
    fn converge_anew(
        &self,
        target: &Target<N>,
        place: &Place,
        mut walk: Walk,
        effort: &mut Effort,
        end: &mut End<N>,
    ) -> Result<Walk, Fault> {
        let mut about = Stance::new(self.moved(place, &walk.x));
        loop {
            self.settle(target, &mut about)?;
            walk.renew();
            // If no correction is needed, the walk ends at the present point.
            let mut way = self.way(&about.place, &walk.x);
            let converged =
                self.converge(target, &about, &mut walk, effort, &mut way, &mut end.at)?;
            about.place = self.moved_by(&about.place, &walk.x, &way);
            if converged {
                end.place = about.place;
                return Ok(walk);
            }
        }
    }

    /// Returns whether the factorization is no longer usable after the last step.
    #[inline(always)]
    fn must_renew(&self, walk: &Walk, tolerance: f64) -> bool {
        let Walk { length, contraction, .. } = *walk;
        // The first correction shows how well the factorization still works.
        let known = contraction < 1.0;
        // With more legs than coordinates the old one would converge to a different pose.
        self.layout.is_redundant()
            || length > CHORD_STEP * self.radius
            || (known && length * contraction * contraction > CHORD_MARGIN * tolerance)
    }

    /// Certifies a pose at most `distance` from the center of the ball.
    fn confirm(
        &self,
        target: &Target<N>,
        ball: &Ball<'_, N>,
        distance: f64,
        end: &Measured<N>,
    ) -> Result<Certificate, Fault> {
        let Ball { about, first } = ball;
        // The ball of the first step can be used if it is as large.
        let lipschitz = match distance <= 2.0 * first.length {
            true => first.lipschitz,
            false => self.lipschitz_of_legs(&about.at, &about.inverse, distance, None),
        };
        let reach = lipschitz * distance;
        if !(reach < ALONE) {
            return Err(Fault::with_value(Cause::NotCertified, reach));
        }
        if self.moving {
            self.refuse_dead_points(&end.placed, &target.joints)?;
        }
        if !(first.lipschitz * self.size * CERTAIN_AT_ALL < 1.0) {
            self.refuse_nearly_singular(&about.at, &about.inverse)?;
        }
        Ok(Certificate::Ball(reach))
    }

    pub(super) fn refuse_nearly_singular(
        &self,
        at: &Measured<N>,
        inverse: &PseudoInverse<N>,
    ) -> Result<(), Fault> {
        let lipschitz =
            lipschitz_constant(self, &at.placed, self.torsion_of(at), inverse, 0.0, None)?;
        if lipschitz * self.size * CERTAIN_AT_ALL < 1.0 {
            return Ok(());
        }
        Err(Cause::NearlySingular.into())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::certificate::leg_chord_deviation;
    use crate::certificate::tests::{CHARTS, at, lengths, machine, random, unit};
    use crate::forward::residual::tests::{Trial, trial};
    use crate::leg::Leg;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    /// Computes the residuals at a share of the path between two targets, at a point of the chart around a
    /// platform that is shifted along.
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

    /// A step of the joints from those of a pose.
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

    fn joint_step(rng: &mut Pcg64, machine: &Mechanism<6>, place: Place) -> Option<JointStep> {
        let from = machine.joints_at(&place).ok()?;
        // A common part, which the platform can follow, and an individual one for each leg; random
        // machines are often ill-conditioned, so steps of every size are tested.
        let size = libm::pow(10.0, random(rng, -3.0, 0.7));
        let (common, apart) = (random(rng, -5.0, 5.0) * size, size);
        let to = from.map(|q| q + common + random(rng, -apart, apart));
        let motion = machine.motion(&machine.target(&from).ok()?, &machine.target(&to).ok()?)?;
        Some(JointStep { place, from, to, motion })
    }

    /// Computes ‖M J(X, t) − 1‖ in the chart, by differences of the residuals.
    fn departure(
        machine: &Mechanism<6>,
        step: &JointStep,
        inverse: &PseudoInverse<6>,
        share: f64,
        point: &[f64; 6],
    ) -> Option<f64> {
        // Rounding of 2e-13/1e-2 and curvature of 1e-3·1e-4 stay below 1e-6 with ‖M‖ up to 10.
        const STEP: f64 = 1e-2;
        let mut sum = 0.0;
        for k in (0..6).filter(|k| machine.active[*k]) {
            let at = |by: f64| {
                let mut x = *point;
                x[k] += by;
                residuals(machine, step, share, &x)
            };
            let (a, b) = (at(-STEP)?, at(STEP)?);
            let column = inverse.solve(&core::array::from_fn(|i| (b[i] - a[i]) / (2.0 * STEP)));
            for (j, value) in column.iter().enumerate().filter(|(j, _)| machine.active[*j]) {
                sum += (value - f64::from(u8::from(j == k))).powi(2);
            }
        }
        Some(sqrt(sum))
    }

    /// Returns limits that allow nine solves.
    fn effort() -> Effort {
        Effort { spent: 0, sub_steps: 1, limit: 9, tolerance: 1e-9, accepted: 1e-6 }
    }

    #[test]
    fn a_walk_adds_up_its_steps_chart_by_chart() {
        let mut walk = Walk::begun([2.0, 0.0, 0.0, 0.0, 0.0, 1.0], 10.0);
        walk.go(&[0.0, 3.0, 0.0, 0.0, 4.0, 0.0]);
        assert_eq!(walk.x, [2.0, 3.0, 0.0, 0.0, 4.0, 1.0]);
        assert_eq!((walk.length, walk.contraction, walk.renewed), (5.0, 0.5, false));
        walk.x = [0.0, 0.0, 3.0, 4.0, 0.0, 0.0];
        walk.renew();
        assert_eq!((walk.x, walk.covered, walk.renewed), ([0.0; 6], 5.0, true));
        walk.go(&[0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
        walk.renew();
        assert_eq!(walk.covered, 7.0);
    }

    #[test]
    fn a_factorisation_is_renewed_after_a_long_step_or_where_it_would_not_do_with_one_more() {
        let mut rng = Pcg64::seed_from_u64(16);
        let mut drawn = |coordinates| {
            let (machine, _) = machine(&mut rng, coordinates, false).expect("a machine");
            Mechanism { radius: 100.0, ..machine }
        };
        let hexapod = drawn(b"XYZABC");
        let walk = |length, contraction| Walk { length, contraction, ..Walk::begun([0.0; 6], 1.0) };
        // A hundredth of the radius.
        assert!(hexapod.must_renew(&walk(1.01, 1.0), 1.0));
        assert!(!hexapod.must_renew(&walk(0.99, 1.0), 1e-9));
        // Expected to remain: 0.9 · 0.5² = 0.225; allowed: 0.03 of the tolerance.
        assert!(hexapod.must_renew(&walk(0.9, 0.5), 7.4));
        assert!(!hexapod.must_renew(&walk(0.9, 0.5), 7.6));
        // Six legs for five coordinates: with the old rows it would converge to a different pose.
        assert!(drawn(b"XYZAB").must_renew(&walk(0.0, 1.0), 1.0));
    }

    #[test]
    fn a_first_step_is_certified_by_lipschitz_constant_chord_deviation_and_row_change_of_the_ball_that_it_needs()
     {
        let mut rng = Pcg64::seed_from_u64(18);
        let mut checked = 0;
        for _ in 0..60 {
            let Some((mut machine, place)) = machine(&mut rng, b"XYZABC", false) else { continue };
            machine.offset = [30.0, -40.0, 50.0, -60.0, 70.0, -80.0];
            let Some(step) = joint_step(&mut rng, &machine, place) else { continue };
            let to = step.target(&machine, 1.0);
            let mut about = Stance::new(machine.taken_along(&place, Some(&step.motion)));
            if machine.settle(&to, &mut about).is_err() {
                continue;
            }
            let Stance { at, inverse, .. } = &about;
            let alone = machine.first_step(at, inverse, 0.0, &to, None);
            let lipschitz =
                |rho, motion| lipschitz_constant(&machine, &at.placed, None, inverse, rho, motion);
            // The leftover may extend farther than the step itself.
            for leftover in [0.0, 0.5, 3.0].map(|share| share * alone.length) {
                let reach = leftover.max(alone.length);
                let step_of = |motion| machine.first_step(at, inverse, leftover, &to, motion);
                if let Ok(lipschitz) = lipschitz(2.0 * reach, None) {
                    assert_eq!(
                        (step_of(None).lipschitz, step_of(None).h()),
                        (lipschitz, lipschitz * reach)
                    );
                }
                let motion = Some(&step.motion);
                let reach = reach + chord_deviation(&machine, &at.placed, inverse, &step.motion);
                let margin =
                    |i: usize| machine.margin(&at.placed, i, to.joints[i] + machine.offset[i]);
                let turned =
                    row_change(&machine, &at.placed, inverse, 2.0 * reach, &step.motion, margin);
                if let Ok(lipschitz) = lipschitz(2.0 * reach, motion) {
                    assert_eq!(
                        (step_of(motion).lipschitz, step_of(motion).h()),
                        (lipschitz, lipschitz * reach + turned)
                    );
                    checked += u32::from(turned > 0.0 && turned.is_finite());
                }
            }
        }
        assert!(checked > 30, "{checked}");
    }

    #[test]
    fn a_platform_is_taken_along_by_the_mean_of_its_anchors_and_the_rest_is_travel() {
        let mut rng = Pcg64::seed_from_u64(19);
        for screws in [false, true] {
            let mut checked = 0;
            for _ in 0..20 {
                let Some((machine, place)) = machine(&mut rng, b"XYZABC", screws) else { continue };
                let Some(step) = joint_step(&mut rng, &machine, place) else { continue };
                let target = |joints| machine.target(joints).expect("a target");
                let [from, to] = [target(&step.from), target(&step.to)];
                let chord: [_; 6] =
                    core::array::from_fn(|i| to.anchors.get(i) - from.anchors.get(i));
                let mean = chord.iter().sum::<nalgebra::Vector3<f64>>() / 6.0;
                // With screws the platform is not shifted: their corrections would change along the path.
                let shift = if machine.nut.is_some() { mean * 0.0 } else { mean };
                let Motion { shift: found, travel, second, turn } = step.motion;
                // A few roundings of sums of six.
                assert!((found - shift).norm() <= 1e-14 * (1.0 + shift.norm()), "{found} {shift}");
                for i in 0..6 {
                    let of_leg = machine.legs[i].second_derivatives(step.to[i] - step.from[i]);
                    let expected = (chord[i] - shift).norm() + of_leg.anchor / 2.0;
                    assert!((travel[i] - expected).abs() <= 1e-14 * (1.0 + chord[i].norm()));
                    assert_eq!((second[i], turn[i]), (of_leg.anchor + of_leg.length, of_leg.turn));
                }
                let still = Mechanism { moving: false, ..machine };
                assert!(still.motion(&from, &to).is_none());
                checked += 1;
            }
            assert!(checked > 5, "{checked}");
        }
    }

    #[test]
    fn a_certificate_returns_the_distance_of_the_pose_from_the_middle_of_its_ball() {
        let mut rng = Pcg64::seed_from_u64(21);
        let mut checked = 0;
        for _ in 0..60 {
            let Some(Trial { machine, about, target, .. }) = trial(&mut rng, b"XYZABC", 0.5) else {
                continue;
            };
            let first = machine.first_step(&about.at, &about.inverse, 0.0, &target, None);
            if !first.is_certified() {
                continue;
            }
            let (lipschitz, ball) = (first.lipschitz, Ball { about: &about, first });
            let mut effort = effort();
            let mut end = End { place: about.place, at: Measured::ZERO };
            let Ok(Certificate::Ball(reach)) = machine.near(&target, &ball, &mut effort, &mut end)
            else {
                continue;
            };
            // Half a unit away, within the tolerance; the first ball is about twice as large.
            assert!((reach / lipschitz - 0.5).abs() < 1e-8, "{reach} {lipschitz}");
            checked += 1;
        }
        assert!(checked > 20, "{checked}");
    }

    #[test]
    fn a_walk_that_has_arrived_ends_where_the_legs_fit_in_every_chart() {
        for coordinates in CHARTS {
            let mut rng = Pcg64::seed_from_u64(23);
            let mut checked = 0;
            for _ in 0..200 {
                let Some(trial) = trial(&mut rng, coordinates, 0.5) else { continue };
                let Trial { machine, about, target, step } = trial;
                let mut effort = effort();
                // No correction is needed around the new center.
                let walk = Walk { contraction: 0.0, ..Walk::begun(step, 0.5) };
                let mut end = End { place: about.place, at: Measured::ZERO };
                let place = &about.place;
                if machine.converge_anew(&target, place, walk, &mut effort, &mut end).is_err() {
                    continue;
                }
                let there = machine.measured(&target, &end.place).expect("a place");
                // A few roundings of lengths of several thousand.
                assert!(largest(&there.residual) < 1e-9, "{:?}", there.residual);
                checked += 1;
            }
            assert!(checked > 20, "{checked}");
        }
    }

    #[test]
    fn a_step_returns_the_next_length_and_the_unconverged_rest() {
        let step = |length: f64, lipschitz: f64| Step {
            step: [0.0; 6],
            length,
            reach: length,
            turned: 0.0,
            lipschitz,
        };
        let near = |found: f64, expected: f64| {
            // A few roundings of numbers below 10.
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        };
        // L is unchanged: 0.38 over it. At most 1 − √0.2 − 0.4 of 1/L remains.
        let plain = step(2.0, 0.2);
        near(plain.next_length(), 1.9);
        near(plain.unconverged(), CAYLEY * (0.6 - sqrt(0.2)) / 0.2);
        near(plain.share_to_try(), 0.9);
        // Of the ball's extent of 8, 3.8 is the target, however small the step itself is.
        near(Step { reach: 8.0, ..step(2.0, 0.1) }.share_to_try(), 3.8 / 8.0);
        // The next step may use the extent beyond the step itself.
        near(Step { reach: 4.0, ..step(2.0, 0.1) }.next_length(), 3.8);
        let unknown = step(2.0, f64::INFINITY);
        assert_eq!((unknown.next_length(), unknown.share_to_try()), (0.0, LEAST_SHARE));
        assert_eq!(step(1e9, 1.0).share_to_try(), LEAST_SHARE);
    }

    #[test]
    fn a_place_is_certified_as_far_as_its_ball_is_flat() {
        let mut rng = Pcg64::seed_from_u64(17);
        let (machine, place) = machine(&mut rng, b"XYZABC", false).expect("a machine");
        let machine = Mechanism { moving: false, ..machine };
        let target = machine.target(&machine.joints_at(&place).expect("joints")).expect("a target");
        let mut about = Stance::new(place);
        machine.settle(&target, &mut about).expect("regular");
        let end = about.at;
        let step_of = |length, lipschitz| Step {
            step: [0.0; 6],
            length,
            reach: length,
            turned: 0.0,
            lipschitz,
        };
        let confirm = |lipschitz: f64, length: f64, distance: f64| {
            let first = step_of(length, lipschitz);
            machine.confirm(&target, &Ball { about: &about, first }, distance, &end)
        };
        // Within twice the first step its own bound applies, here of a ball of radius 2.
        assert_eq!(confirm(0.5, 1.0, 1.5), Ok(Certificate::Ball(0.75)));
        assert_eq!(confirm(0.5, 1.0, 2.0), Err(Fault::with_value(Cause::NotCertified, 1.0)));
        assert!(confirm(f64::NAN, 1.0, 1.0).is_err());
        // A hundredth of the theoretical bound is reserved for rounding.
        assert!(confirm(1.0, 1.0, 0.989).is_ok() && confirm(1.0, 1.0, 0.991).is_err());
        // Beyond that, the ball with this distance as radius is evaluated.
        let Stance { at, inverse, .. } = &about;
        let lipschitz = |rho| {
            lipschitz_constant(&machine, &at.placed, None, inverse, rho, None).expect("lipschitz")
        };
        let distance = 0.2 / lipschitz(0.0);
        let near = lipschitz(distance) * distance;
        assert_eq!(confirm(9.0, 0.4 * distance, distance), Ok(Certificate::Ball(near)));
        // If the first ball is too small, the pose's own Lipschitz constant is used, which gives
        // the same result for a machine scaled to be nearly singular.
        let singular =
            Mechanism { size: 1.01 / (CERTAIN_AT_ALL * lipschitz(0.0)), ..machine.clone() };
        let regular =
            Mechanism { size: 0.99 / (CERTAIN_AT_ALL * lipschitz(0.0)), ..machine.clone() };
        let reported = |machine: &Mechanism<6>| {
            let first = step_of(1.0, 2.0 * lipschitz(0.0));
            machine.confirm(&target, &Ball { about: &about, first }, 0.0, &end)
        };
        assert_eq!(reported(&regular), Ok(Certificate::Ball(0.0)));
        assert_eq!(reported(&singular), Err(Cause::NearlySingular.into()));
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
                let bound = leg_chord_deviation(&machine, &placed, &step.motion, i);
                // 1e-11: a few roundings of lengths of several thousand.
                assert!(off.abs() <= bound + 1e-11, "{off:e} {bound:e}");
                // Large enough not to be affected by rounding.
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
                // The search factors the pose ahead, a sub-step its start.
                let (stand, share) = if rng.random() { (ahead, 1.0) } else { (place, 0.0) };
                let mut stance = Stance::new(stand);
                if machine.settle(&step.target(&machine, share), &mut stance).is_err() {
                    continue;
                }
                let inverse = stance.inverse;
                let first = machine.first_step(&there, &inverse, 0.0, &to, Some(&step.motion));
                if !first.is_certified() {
                    continue;
                }
                let reach =
                    first.length + chord_deviation(&machine, &there.placed, &inverse, &step.motion);
                let rho = 2.0 * reach;
                let margin = |i: usize| machine.margin(&there.placed, i, to.joints[i]);
                let row_change =
                    row_change(&machine, &there.placed, &inverse, rho, &step.motion, margin);
                for _ in 0..4 {
                    let share = rng.random();
                    let away = random(&mut rng, 0.0, rho);
                    let point = unit(&mut rng, &machine).map(|x| x * away);
                    let Some(departure) = departure(&machine, &step, &inverse, share, &point)
                    else {
                        panic!("the nut has no correction within a certified ball");
                    };
                    let bound = first.lipschitz * away + row_change;
                    assert!(departure <= bound + 1e-6, "{departure} {bound}");
                    turned = turned.max(departure / bound);
                    let residuals = residuals(&machine, &step, share, &[0.0; 6]).unwrap();
                    let length = norm(&newton_step(&inverse, &residuals));
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
