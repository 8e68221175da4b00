// SPDX-License-Identifier: GPL-2.0-or-later
//! A chain of certified balls along the straight line in joint space, for far seeds.

use super::converge::Step;
use super::residual::{Measured, Target, newton_step, norm};
use super::solver::{Effort, MAX_SUB_STEPS};
use crate::certificate::CERTIFIED;
use crate::fault::{Cause, Fault};
use crate::mechanism::Mechanism;
use crate::placed::Place;
use crate::pseudo_inverse::PseudoInverse;

/// Trials for the length of one sub-step.
const MAX_TRIALS: u32 = 4;

/// Shortest sub-step, as a share of the joint path.
const SHORTEST_SUB_STEP: f64 = 1e-4;

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

impl<const N: usize> Mechanism<N> {
    /// Follows the straight joint path from the seed to `target` by certified
    /// sub-steps, one Newton step each, to within one ball of its end.
    ///
    /// A sub-step starts from a pose Y that is off the path by what the last one left
    /// unconverged: at most 0.16/L of that step's ball (Newton-Kantorovich with
    /// h ≤ 0.4), which is at most 0.26/L of the ball about Y. So the path's point is
    /// the one that the ball about Y determines. Because h ≤ 0.4 holds for the step back
    /// to the path as well as for the one ahead, it holds for every point of the joint
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
        let (mut at, mut inverse) = (Measured::ZERO, PseudoInverse::ZERO);
        let mut done = 0.0;
        let mut share = shrunk(1.0, h_whole);
        effort.sub_steps = 0;
        while effort.sub_steps < MAX_SUB_STEPS {
            effort.sub_steps += 1;
            let here = self.target(&along(done))?;
            self.measure(&here, &place, &mut at)?;
            self.factor(&at, &place, &mut inverse)?;
            if self.moving {
                self.refuse_dead_points(&at.placed, &here.joints)?;
            }
            if effort.sub_steps == 1 {
                self.refuse_nearly_singular(&at, &inverse)?;
            }
            let leftover = norm(&newton_step(&inverse, &at.residual));
            let path = Path { along: &along, here: &here, target, done, leftover };
            let taken = self.sub_step(&path, &place, &inverse, share, effort)?;
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
        inverse: &PseudoInverse<N>,
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
            let Step { step, h, .. } =
                self.first_step(&at, inverse, path.leftover, to, motion.as_ref());
            share = share.min(rest);
            if h <= CERTIFIED {
                return Ok(SubStep { place: self.moved(&ahead, &step), share, arrives, h });
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
