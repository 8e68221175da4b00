// SPDX-License-Identifier: GPL-2.0-or-later
//! A chain of certified balls along the straight line in joint space, for far seeds.

use super::converge::{LEAST_SHARE, Step};
use super::residual::{Measured, newton_step, norm};
use super::solver::{Effort, MAX_SUB_STEPS};
use crate::fault::{Cause, Fault};
use crate::mechanism::Mechanism;
use crate::placed::Place;
use crate::pseudo_inverse::PseudoInverse;
use crate::target::Target;

/// Trials for the length of one sub-step.
const MAX_TRIALS: u32 = 4;

/// Shortest sub-step, as a share of the joint path.
const SHORTEST_SUB_STEP: f64 = 1e-4;

/// How much of a sub-step that was too long is tried next at most.
const MOST_TRIED: f64 = 0.95;

/// How many times as far as the last sub-step the next one goes: what is read from one step says little of far away.
const LEAST_GROWTH: f64 = 0.5;
const MOST_GROWTH: f64 = 4.0;

/// The straight line in joint space from the seed's joints to the target.
struct Path<'a, const N: usize, F: Fn(f64) -> [f64; N]> {
    /// Joints at a share of the path.
    along: &'a F,
    /// Where the sub-step starts.
    here: &'a Target<N>,
    target: &'a Target<N>,
    /// Share already covered.
    done: f64,
    /// Share at the middle of the ball where that is ahead, 0 where it is about where the last sub-step has led.
    middle: f64,
    /// Newton's step from the middle of the ball back to the path.
    back: f64,
    /// Bound of the way back, half of it at least.
    leftover: f64,
}

impl<const N: usize, F: Fn(f64) -> [f64; N]> Path<'_, N, F> {
    /// How many times as far beyond the middle a sub-step should go to have the h that is aimed at.
    fn times(&self, first: &Step) -> f64 {
        // What the ball reaches for because anchors move counts like the step itself. Its growth by the square of the
        // sub-step was tried in the plan: more calls are refused.
        let length = first.length + (first.reach - first.length.max(self.leftover));
        // From where the last sub-step has led the step begins with the way back.
        let back = if self.middle > 0.0 { 0.0 } else { self.back.min(0.9 * length) };
        (first.next_length() - back) / (length - back)
    }
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
    /// Bound of what it leaves unconverged.
    unconverged: f64,
    /// How many times as far the next one should go.
    times: f64,
}

/// The middle of the next ball, seen from where the last sub-step has led.
struct Ahead {
    /// The way there.
    by: [f64; 6],
    /// How much of the joint path that is.
    share: f64,
    /// Bound of how far the path is from where the last sub-step has led.
    off: f64,
}

impl Ahead {
    /// The ball is about where the last sub-step has led.
    const NOT: Self = Self { by: [0.0; 6], share: 0.0, off: 0.0 };

    fn is_ahead(&self) -> bool {
        self.share > 0.0
    }
}

impl<const N: usize> Mechanism<N> {
    /// Follows the straight joint path from the seed to `target` by certified
    /// sub-steps, one Newton step each, to within one ball of its end.
    ///
    /// The path's point that a sub-step starts from is off the pose P where the last one has led by what that left
    /// unconverged. The next ball is about P, or of struts about the pose Y half a sub-step ahead of it, so that it reaches
    /// as far back as ahead and one sub-step covers both ways. Its radius is twice the Newton step back to the path, the one
    /// ahead, or half the distance of the path's point, whichever is the largest; so that point is in it, and is the one
    /// that it determines. Because h ≤ 0.4 holds for the step back to the path as well as for the one ahead, it holds for
    /// every point of the joint path between, and the path of the platform stays in that ball.
    pub(super) fn track(
        &self,
        target: &Target<N>,
        start: Place,
        mut share: f64,
        effort: &mut Effort,
    ) -> Result<Place, Fault> {
        let from = self.joints_at(&start)?;
        let along = |t: f64| core::array::from_fn(|i| from[i] + t * (target.joints[i] - from[i]));
        let mut place = start;
        // In place over and over: what is handed on is copied.
        let (mut one, mut other) = (Target::of(from), Target::of(from));
        let (mut here, mut next) = (&mut one, &mut other);
        self.aim(here)?;
        let (mut at, mut there) = (Measured::ZERO, Measured::ZERO);
        let mut inverse = PseudoInverse::ZERO;
        let mut done = 0.0;
        let mut ahead = Ahead::NOT;
        // Where base anchors move, or legs are in excess, there is none to expect: the legs do not fit half-way. Nor
        // where one was not there: next to singular poses every second sub-step would go for it.
        let mut looks_ahead = !self.moving && !self.layout.is_redundant();
        effort.sub_steps = 0;
        while effort.sub_steps < MAX_SUB_STEPS {
            effort.sub_steps += 1;
            let middle = self.moved(&place, &ahead.by);
            let taken = self
                .regular(here, &middle, (&mut at, &mut inverse), effort.sub_steps == 1)
                .and_then(|()| {
                    let back = norm(&newton_step(&inverse, &at.residual));
                    let path = Path {
                        along: &along,
                        here,
                        target,
                        done,
                        middle: ahead.share,
                        back,
                        leftover: back.max((ahead.off + norm(&ahead.by)) / 2.0),
                    };
                    self.sub_step(&path, &middle, (&inverse, &mut there, next), share, effort)
                });
            let taken = match taken {
                // What was expected ahead is not there. It cost what a solve does.
                Err(_) if ahead.is_ahead() => {
                    effort.spend()?;
                    ahead = Ahead { off: ahead.off, ..Ahead::NOT };
                    looks_ahead = false;
                    share /= 2.0;
                    continue;
                }
                taken => taken?,
            };
            place = taken.place;
            if taken.arrives {
                return Ok(place);
            }
            done += taken.share;
            core::mem::swap(&mut here, &mut next);
            let beyond = taken.share - ahead.share;
            share = beyond * taken.times.clamp(LEAST_GROWTH, MOST_GROWTH);
            ahead = Ahead { off: taken.unconverged, ..Ahead::NOT };
            if looks_ahead {
                // As far back as ahead: twice as far in all.
                let half = share.min((1.0 - done) / 2.0);
                share *= 2.0;
                ahead.by = taken.step.map(|x| half / beyond * x);
                ahead.share = half;
            }
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

    /// Chooses the share of the path that one certified Newton step may cover; `between` becomes the path's point
    /// there, unless that is the end.
    fn sub_step(
        &self,
        path: &Path<'_, N, impl Fn(f64) -> [f64; N]>,
        place: &Place,
        (inverse, at, between): (&PseudoInverse<N>, &mut Measured<N>, &mut Target<N>),
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
            let to = if arrives {
                path.target
            } else {
                between.joints = (path.along)(path.done + share);
                self.aim(between)?;
                &*between
            };
            let motion = self.motion(path.here, to);
            let ahead = self.taken_along(place, motion.as_ref());
            self.measure(to, &ahead, at)?;
            effort.spend()?;
            let first = self.first_step(at, inverse, path.leftover, to, motion.as_ref());
            share = share.min(rest);
            let times = path.times(&first);
            if first.is_certified() {
                let place = self.moved(&ahead, &first.step);
                let unconverged = first.unconverged();
                return Ok(SubStep { place, share, arrives, step: first.step, unconverged, times });
            }
            share = path.middle + (share - path.middle) * times.clamp(LEAST_SHARE, MOST_TRIED);
        }
        Err(Fault::with_value(Cause::PathStalled, path.done))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sub_step_goes_on_from_the_middle_of_its_ball_or_after_the_way_back() {
        let target = Target::of([0.0; 4]);
        let times = |middle: f64, back: f64, length: f64, bowed: f64| {
            let along = |_| [0.0; 4];
            let path = Path {
                along: &along,
                here: &target,
                target: &target,
                done: 0.0,
                middle,
                back,
                leftover: back,
            };
            // L stays 0.1: 3.8 is aimed at.
            path.times(&Step {
                step: [0.0; 6],
                length,
                reach: length.max(back) + bowed,
                turned: 0.0,
                lipschitz: 0.1,
            })
        };
        // Some roundings of numbers below 10.
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-14, "{found}");
        near(times(0.0, 0.0, 2.0, 0.0), 1.9);
        // Anchors that bow make the reach twice as long.
        near(times(0.0, 0.0, 2.0, 2.0), 0.95);
        // Of 2, 1 leads back to the path; 2.8 are left of 3.8.
        near(times(0.0, 1.0, 2.0, 0.0), 2.8);
        // Ahead, the way back leads the other way.
        near(times(0.25, 1.0, 2.0, 0.0), 1.9);
        // A step that is shorter than the way back tells little: nine tenths of it count.
        near(times(0.0, 3.0, 2.0, 0.0), 10.0);
    }
}
