// SPDX-License-Identifier: GPL-2.0-or-later
//! A chain of certified balls along the straight line in joint space, for far seeds.

use super::converge::Step;
use super::residual::{Measured, newton_step, norm};
use super::solver::{Effort, MAX_SUB_STEPS};
use crate::certificate::CERTIFIED;
use crate::fault::{Cause, Fault};
use crate::mechanism::Mechanism;
use crate::placed::Place;
use crate::pseudo_inverse::PseudoInverse;
use crate::target::Target;

/// Trials for the length of one sub-step.
const MAX_TRIALS: u32 = 4;

/// Shortest sub-step, as a share of the joint path.
const SHORTEST_SUB_STEP: f64 = 1e-4;

/// What a Newton step may leave unconverged, as a share of 1/L of its ball: at h = 0.4,
/// 1 − √(1 − 2 h) − h (Newton-Kantorovich).
const UNCONVERGED: f64 = 0.16;

/// The straight line in joint space from the seed's joints to the target.
struct Path<'a, const N: usize, F: Fn(f64) -> [f64; N]> {
    /// Joints at a share of the path.
    along: &'a F,
    /// Where the sub-step starts.
    here: &'a Target<N>,
    target: &'a Target<N>,
    /// Share already covered.
    done: f64,
    /// Bound of the way from the middle of the ball back to the path, half of it at least.
    leftover: f64,
}

/// A certified step along the path.
struct SubStep {
    /// Where it leads.
    place: Place,
    /// Share of the path it covers.
    share: f64,
    /// Whether it leads to the end.
    arrives: bool,
    /// The step, from the middle of its ball.
    step: [f64; 6],
    /// L of that ball, and h = L η of the step.
    lipschitz: f64,
    h: f64,
}

/// The middle of the next ball, seen from where the last sub-step has led.
struct Ahead {
    /// The way there.
    by: [f64; 6],
    /// Bound of how far the path is from where the last sub-step has led.
    off: f64,
}

impl Ahead {
    /// The ball is about where the last sub-step has led.
    const NOT: Self = Self { by: [0.0; 6], off: 0.0 };

    fn is_ahead(&self) -> bool {
        self.by != [0.0; 6]
    }
}

impl<const N: usize> Mechanism<N> {
    /// Follows the straight joint path from the seed to `target` by certified
    /// sub-steps, one Newton step each, to within one ball of its end.
    ///
    /// The path's point that a sub-step starts from is off the pose P where the last one has led by what that left
    /// unconverged: at most 0.16/L of that step's ball. The next ball is about P, or of struts about the pose Y half a
    /// sub-step ahead of it, so that it reaches as far back as ahead and one sub-step covers both ways. Its radius is twice
    /// the Newton step back to the path, the one ahead, or half the distance of the path's point, whichever is the
    /// largest; so that point is in it, and is the one that it determines. Because h ≤ 0.4 holds for
    /// the step back to the path as well as for the one ahead, it holds for every point of the joint
    /// path between, and the path of the platform stays in that ball.
    pub(super) fn track(
        &self,
        target: &Target<N>,
        start: Place,
        h_whole: f64,
        effort: &mut Effort,
    ) -> Result<Place, Fault> {
        let from = self.joints_at(&start)?;
        let along = |t: f64| core::array::from_fn(|i| from[i] + t * (target.joints[i] - from[i]));
        let mut place = start;
        // In place over and over: what is handed on is copied.
        let (mut here, mut at) = (Target::of(from), Measured::ZERO);
        let (mut there, mut inverse) = (Measured::ZERO, PseudoInverse::ZERO);
        let mut done = 0.0;
        let mut share = shrunk(1.0, h_whole);
        let mut ahead = Ahead::NOT;
        // Where base anchors move, or legs are in excess, there is none to expect: the legs do not fit half-way. Nor
        // where one was not there: next to singular poses every second sub-step would go for it.
        let mut looks_ahead = !self.moving && !self.layout.is_redundant();
        effort.sub_steps = 0;
        while effort.sub_steps < MAX_SUB_STEPS {
            effort.sub_steps += 1;
            here.joints = along(done);
            self.aim(&mut here)?;
            let middle = self.moved(&place, &ahead.by);
            let taken = self
                .regular(&here, &middle, (&mut at, &mut inverse), effort.sub_steps == 1)
                .and_then(|()| {
                    let back = norm(&newton_step(&inverse, &at.residual));
                    let leftover = back.max((ahead.off + norm(&ahead.by)) / 2.0);
                    let path = Path { along: &along, here: &here, target, done, leftover };
                    self.sub_step(&path, &middle, (&inverse, &mut there), share, effort)
                });
            let taken = match taken {
                // What was expected ahead is not there. It cost what a solve does.
                Err(_) if ahead.is_ahead() => {
                    effort.spend()?;
                    ahead.by = [0.0; 6];
                    looks_ahead = false;
                    share /= 2.0;
                    continue;
                }
                taken => taken?,
            };
            place = taken.place;
            done += taken.share;
            if taken.arrives {
                return Ok(place);
            }
            // A ball about the middle reaches twice as far.
            let halves = if ahead.is_ahead() || !looks_ahead { 1.0 } else { 2.0 };
            share = taken.share * 0.95 * (halves * CERTIFIED / taken.h).min(4.0);
            let covered = if ahead.is_ahead() { taken.share / 2.0 } else { taken.share };
            let half = share.min(1.0 - done) / 2.0;
            let by = if looks_ahead { half / covered } else { 0.0 };
            ahead = Ahead { by: taken.step.map(|x| by * x), off: UNCONVERGED / taken.lipschitz };
        }
        Err(Fault::with_value(Cause::TooManySubSteps, f64::from(MAX_SUB_STEPS)))
    }

    /// Measures and factors the middle of a ball; refuses dead points, and to set out next to a singular pose.
    fn regular(
        &self,
        here: &Target<N>,
        place: &Place,
        (at, inverse): (&mut Measured<N>, &mut PseudoInverse<N>),
        is_first: bool,
    ) -> Result<(), Fault> {
        self.measure(here, place, at)?;
        self.factor(at, place, inverse)?;
        if self.moving {
            self.refuse_dead_points(&at.placed, &here.joints)?;
        }
        if is_first {
            self.refuse_nearly_singular(at, inverse)?;
        }
        Ok(())
    }

    /// Chooses the share of the path that one certified Newton step may cover.
    fn sub_step(
        &self,
        path: &Path<'_, N, impl Fn(f64) -> [f64; N]>,
        place: &Place,
        (inverse, at): (&PseudoInverse<N>, &mut Measured<N>),
        mut share: f64,
        effort: &mut Effort,
    ) -> Result<SubStep, Fault> {
        let mut between = Target::of(path.target.joints);
        for _ in 0..MAX_TRIALS {
            let rest = 1.0 - path.done;
            let arrives = share >= rest;
            if !(arrives || share >= SHORTEST_SUB_STEP) {
                break;
            }
            // The end is the target itself, not a sum of shares.
            let to = if arrives {
                path.target
            } else {
                between.joints = (path.along)(path.done + share);
                self.aim(&mut between)?;
                &between
            };
            let motion = self.motion(path.here, to);
            let ahead = self.taken_along(place, motion.as_ref());
            self.measure(to, &ahead, at)?;
            effort.spend()?;
            let Step { step, lipschitz, h, .. } =
                self.first_step(at, inverse, path.leftover, to, motion.as_ref());
            share = share.min(rest);
            if h <= CERTIFIED {
                let place = self.moved(&ahead, &step);
                return Ok(SubStep { place, share, arrives, step, lipschitz, h });
            }
            share = shrunk(share, h);
        }
        Err(Fault::with_value(Cause::PathStalled, path.done))
    }
}

/// A share of the path that should meet the certificate, after one with `h` did not.
fn shrunk(share: f64, h: f64) -> f64 {
    share * (0.9 * CERTIFIED / h).clamp(0.02, 0.9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_shrinks_by_what_it_was_too_long_and_neither_by_nothing_nor_to_nothing() {
        // 0.9 · 0.4/0.8 of it, to a rounding.
        assert!((shrunk(0.5, 0.8) - 0.225).abs() < f64::EPSILON);
        assert_eq!(shrunk(0.5, 0.4), 0.45);
        assert_eq!(shrunk(0.5, 0.1), 0.45);
        assert_eq!(shrunk(0.5, 1e9), 0.01);
        assert_eq!(shrunk(0.5, f64::INFINITY), 0.01);
    }
}
