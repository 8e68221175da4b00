// SPDX-License-Identifier: GPL-2.0-or-later
//! Chain of certified balls along the straight line in joint space, for far seeds.

use super::converge::{LEAST_SHARE, Step};
use super::residual::{Measured, newton_step, norm};
use super::solver::{Effort, MAX_SUB_STEPS};
use crate::fault::{Cause, Fault};
use crate::mechanism::Mechanism;
use crate::placed::Place;
use crate::pseudo_inverse::PseudoInverse;
use crate::target::Target;

/// Largest number of attempts at the length of one sub-step.
const MAX_TRIALS: u32 = 4;

/// Shortest sub-step, as a share of the joint path.
const SHORTEST_SUB_STEP: f64 = 1e-4;

/// Largest share that is tried next of a sub-step that was too long.
const MOST_TRIED: f64 = 0.95;

/// Least ratio of a sub-step to the last one: an extrapolation from one step is unreliable far away.
const LEAST_GROWTH: f64 = 0.5;
const MOST_GROWTH: f64 = 4.0;

/// The straight line in joint space from the seed's joints to the target.
struct Path<'a, const N: usize, F: Fn(f64) -> [f64; N]> {
    /// Joints at a share of the path.
    along: &'a F,
    /// Start of the sub-step.
    here: &'a Target<N>,
    target: &'a Target<N>,
    /// Share already covered.
    done: f64,
    /// Share at the center of the ball if that is ahead; 0 if it is at the end of the last sub-step.
    middle: f64,
    /// Newton's step from the center of the ball back to the path.
    back: f64,
    /// Half of the least extent of the next ball, see `first_step`; at least `back`.
    leftover: f64,
}

impl<const N: usize, F: Fn(f64) -> [f64; N]> Path<'_, N, F> {
    /// Returns the ratio by which a sub-step beyond the center should be extended to reach the target h.
    fn times(&self, first: &Step) -> f64 {
        // The extent due to moving anchors counts like the step itself. Letting it grow with the square of the
        // sub-step makes more calls fail.
        let length = first.length + (first.reach - first.length.max(self.leftover));
        // From the end of the last sub-step, the step begins with the way back.
        let back = if self.middle > 0.0 { 0.0 } else { self.back.min(0.9 * length) };
        (first.next_length() - back) / (length - back)
    }
}

/// A certified step along the path.
struct SubStep {
    /// Pose at its end.
    place: Place,
    /// Share of the path it covers.
    share: f64,
    /// Whether it reaches the end.
    arrives: bool,
    /// The step, from the center of its ball.
    step: [f64; 6],
    /// Bound of its convergence error.
    unconverged: f64,
    /// Ratio for the length of the next one.
    times: f64,
}

/// Center of the next ball, relative to the end of the last sub-step.
struct Ahead {
    /// Displacement to it.
    by: [f64; 6],
    /// Its share of the joint path.
    share: f64,
    /// Bound of the distance between the path and the end of the last sub-step.
    off: f64,
}

impl Ahead {
    /// The ball is centered at the end of the last sub-step.
    const NOT: Self = Self { by: [0.0; 6], share: 0.0, off: 0.0 };

    fn is_ahead(&self) -> bool {
        self.share > 0.0
    }
}

impl<const N: usize> Mechanism<N> {
    /// Follows the straight joint path from the seed to `target` in certified
    /// sub-steps, one Newton step each, until one ball covers the rest.
    ///
    /// A sub-step starts from a point of the path whose distance from the pose P at the end of the last sub-step is the
    /// convergence error of that sub-step. The next ball is around P, or for struts around the pose Y half a sub-step ahead,
    /// so that it extends equally far in both directions and one sub-step covers both. Its radius is twice the largest of
    /// the Newton step back to the path, the Newton step ahead, and half the distance of the path's point; so that point is
    /// in the ball and is the one that the ball determines. Because h ≤ 0.4 holds for both steps, it holds for
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
        // Reused buffers: passing them by value would copy.
        let (mut one, mut other) = (Target::of(from), Target::of(from));
        let (mut here, mut next) = (&mut one, &mut other);
        self.aim(here)?;
        let (mut at, mut there) = (Measured::ZERO, Measured::ZERO);
        let mut inverse = PseudoInverse::ZERO;
        let mut done = 0.0;
        let mut ahead = Ahead::NOT;
        // Disabled if base anchors move or legs are redundant, because the legs do not fit half-way; and after a
        // failure, because near singular poses every second sub-step would fail.
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
                // The prediction failed, at the cost of one solve.
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
                // Equally far in both directions: twice as far in all.
                let half = share.min((1.0 - done) / 2.0);
                share *= 2.0;
                ahead.by = taken.step.map(|x| half / beyond * x);
                ahead.share = half;
            }
        }
        Err(Fault::with_value(Cause::TooManySubSteps, f64::from(MAX_SUB_STEPS)))
    }

    /// Measures and factors the center of a ball; refuses dead points, and a start near a singular pose.
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

    /// Chooses the share of the path that one certified Newton step can cover; sets `between` to the path's point
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
            // L stays 0.1: the target is 3.8.
            path.times(&Step {
                step: [0.0; 6],
                length,
                reach: length.max(back) + bowed,
                turned: 0.0,
                lipschitz: 0.1,
            })
        };
        // A few roundings of numbers below 10.
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-14, "{found}");
        near(times(0.0, 0.0, 2.0, 0.0), 1.9);
        // Curved anchor paths double the extent.
        near(times(0.0, 0.0, 2.0, 2.0), 0.95);
        // Of 2, 1 leads back to the path; 2.8 of 3.8 is left.
        near(times(0.0, 1.0, 2.0, 0.0), 2.8);
        // Ahead, the step back has the opposite direction.
        near(times(0.25, 1.0, 2.0, 0.0), 1.9);
        // A step shorter than the step back is unreliable: nine tenths of it count.
        near(times(0.0, 3.0, 2.0, 0.0), 10.0);
    }
}
