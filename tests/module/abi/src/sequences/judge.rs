// SPDX-License-Identifier: GPL-2.0-or-later
//! Requirements on each result of forward.

use super::system::{State, System};
use crate::module::{Joints, Pose};
use crate::truth::Followed;
use std::collections::BTreeMap;

/// Accuracy of poses found by Newton's method from the true one: share of the size, as README's WRONG_REL, and the
/// effect of 1e-13 of the size in joints near singular poses that do not count as an excuse (a thousandfold).
const SAME: f64 = 1e-8;

/// Share of the distance of the nearest singular pose within which a pose has no second one nearby.
const ALONE: f64 = 0.2;

/// Multiples of noise and lag within which a singular pose is near: the module has only measured joints
/// and the pose commanded a cycle before, each with such an error.
const NEAR: f64 = 4.0;

/// Share of the size within which a singular pose is near without noise: forward refuses if its ball
/// is below 1e-6 of the size, and bounds of all legs together extend this up to thirty times.
const LEAST: f64 = 1e-4;

/// Margin of a leg below which it may end.
const MARGIN: f64 = 1.0;

/// Margin of a leg below which forward may give it as the reason of a refusal: the joint of a crank at a
/// cosine of 0.2 turns by tens of degrees while noise and lag move the platform (2.4 observed).
const REFUSED_MARGIN: f64 = 3.0;

/// Share of the size over which a margin changes by at most 1: a cosine by 0.08 at an arm of an eighth.
const MARGIN_MOVES: f64 = 0.01;

/// Share of the size which is the least distance of a leg with margin 1 from its dead point, where the margin grows
/// with the root of the distance: a cosine of 0.08 at an arm of an eighth and a rod as long.
const DEAD_POINT: f64 = 2e-4;

/// Steps of the reference's own path, a tenth of the singular pose's distance each, beyond which the
/// module's 96 sub-steps may be insufficient.
const STEPS: f64 = 25.0;

/// Share of the size beyond which a path back is long: sub-steps cover a tenth of the distance to a singular pose
/// each, so 96 of them, or 120 iterations, may be insufficient. The longest that forward did not finish.
const LONG: f64 = 0.05;

/// Formats the numbers of a message, without trailing zeros.
pub fn brief(values: &[f64]) -> String {
    let end = values.iter().rposition(|v| *v != 0.0).map_or(0, |last| last + 1);
    let values: Vec<_> = values[..end].iter().map(|v| format!("{v:.6}")).collect();
    format!("[{}]", values.join(" "))
}

fn both(poses: &[[f64; 6]; 2]) -> String {
    brief(poses.as_flattened())
}

/// Share of the size: nearer to singular poses rounding may change the end of a long line of joints.
const FAR_DISTANCE: f64 = 1e-2;

/// Verdict on a call.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The machine's pose, or a necessary refusal.
    Right,
    /// A result that the available data allow, with the reason.
    Excused(&'static str),
    /// An error.
    Wrong(String),
}

/// Names of errors, for counting.
pub const WRONG_POSE: &str = "another pose";
/// See [`WRONG_POSE`].
pub const REFUSED: &str = "refused without need";

/// Largest difference between the machine and the data of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reach {
    /// Distance between the true and the commanded pose, plus a step: a length.
    pub gap: f64,
    /// Distance between the joints of the call and the true ones: a length.
    pub noise: f64,
    /// Whether the commanded pose is beyond a singular one that the lagging machine has not reached.
    pub is_passed: bool,
}

/// Positions of singular poses, near the last evaluated state.
struct Watch {
    at: [[f64; 6]; 2],
    distance: f64,
    curvature: f64,
    margin: f64,
}

/// Returns the least possible margin after the platform has moved by a share of the size.
fn margin_after(margin: f64, moved: f64) -> f64 {
    let by_dead_point = (margin * margin - moved / DEAD_POINT).max(0.0).sqrt();
    by_dead_point.min(margin - moved / MARGIN_MOVES)
}

/// Returns the share of the size over which a margin above 1 decreases by at most 1.
fn keeps_margin(margin: f64) -> f64 {
    ((2.0 * margin - 1.0) * DEAD_POINT).min(MARGIN_MOVES)
}

/// Returns whether a refusal is due to the bound of a single call's work.
fn is_bound(code: i32) -> bool {
    matches!(code, -34 | -35)
}

/// Returns whether a refusal comes from the search from a known pose.
fn is_of_search(code: i32) -> bool {
    matches!(code, -36..=-31)
}

/// Returns whether a refusal names a leg at its end.
fn names_leg(code: i32) -> bool {
    matches!(code, -28..=-26 | -24 | -23)
}

pub struct Judge {
    /// The machine.
    pub system: System,
    /// For the machine, and for the module's pose if it differs.
    watches: [Option<Watch>; 2],
    /// Last good pose that the module can have; none before the first one after homing.
    pub good: Option<State>,
    /// Pose accepted in the last call of feedback, of joints that were not the machine's.
    pub elsewhere: Option<State>,
    /// Whether the identity kinematics received distant joints, from which one call may not return.
    pub strayed: bool,
    /// Whether the commanded motion has passed a singular pose since the last right result.
    pub crossed: bool,
    /// Whether a refusal for that reason persists.
    pub held: bool,
    /// Verdicts by reason.
    pub counts: BTreeMap<&'static str, usize>,
}

impl Judge {
    /// Creates a judge without a known pose.
    pub fn new(system: System) -> Self {
        let counts = BTreeMap::new();
        Self {
            system,
            watches: [None, None],
            good: None,
            elsewhere: None,
            strayed: false,
            crossed: false,
            held: false,
            counts,
        }
    }

    /// Returns the distance of the nearest singular pose, its curvature, and the margin of the legs.
    pub fn watched(&mut self, state: &State) -> (f64, f64, f64) {
        for w in self.watches.iter().flatten() {
            let moved = self.system.distance(&w.at, &state.poses);
            let margin = margin_after(w.margin, moved / self.system.size());
            if moved <= 0.1 * w.distance && margin > 2.0 * MARGIN {
                return (w.distance - moved, w.curvature, margin);
            }
        }
        let look = self.system.look(state);
        let curvature = look.curvature.max(0.2 / self.system.size());
        let (at, distance, margin) = (state.poses, look.distance, look.margin);
        self.watches.rotate_right(1);
        self.watches[0] = Some(Watch { at, distance, curvature, margin });
        (distance, curvature, margin)
    }

    /// Returns the end of the straight line of joints: by one correction if it is short compared with the distance of
    /// the nearest singular pose.
    fn led(&mut self, from: &State, joints: &Joints) -> (Option<State>, Followed) {
        let (distance, _, margin) = self.watched(from);
        if margin > 2.0 * MARGIN
            && let most = (0.1 * distance).min(keeps_margin(margin) * self.system.size())
            && let Some(led) = self.system.near(from, joints, most)
        {
            let margin = margin - 1.0;
            let distance = 0.9 * distance / self.system.size();
            return (Some(led), Followed { distance, margin, length: 0.0, steps: 1.0 });
        }
        self.system.follow(from, joints)
    }

    fn is_near_singular(&mut self, state: &State, reach: Reach) -> Option<&'static str> {
        let (distance, curvature, margin) = self.watched(state);
        let size = self.system.size();
        let within = reach.gap + (2.0 * reach.noise / curvature).sqrt();
        if !(distance > NEAR * within + LEAST * size) {
            return Some("near a singular pose");
        }
        (!(margin > MARGIN)).then_some("near the end of a leg")
    }

    /// Returns whether forward refuses a leg near its end: balls and sub-steps end before it.
    fn is_near_end(&mut self, code: i32, state: &State) -> Option<&'static str> {
        let margin = self.system.look(state).margin;
        (names_leg(code) && !(margin > REFUSED_MARGIN)).then_some("near the end of a leg")
    }

    /// Judges a pose that was returned with code 0 for the joints of a call. `truth` is the machine except
    /// for noise.
    pub fn accepted(
        &mut self,
        truth: &State,
        joints: &Joints,
        world: &Pose,
        reach: Reach,
    ) -> Verdict {
        let poses = self.system.poses(world);
        let found = State { poses, joints: *joints };
        let apart = self.system.distance(&poses, &truth.poses);
        if !world.iter().all(|v| v.is_finite()) || !apart.is_finite() {
            return Verdict::Wrong(format!("{WRONG_POSE}: {world:?} is not finite"));
        }
        if !self.system.fits(&found) {
            return Verdict::Wrong(format!(
                "{WRONG_POSE}: {} does not fit {}",
                both(&poses),
                brief(joints)
            ));
        }
        let (distance, curvature, _) = self.watched(truth);
        let verdict = if apart <= ALONE * distance {
            Verdict::Right
        } else {
            let size = self.system.size();
            let (expected, _) = self.led(truth, joints);
            let is_same =
                |expected: &State| self.system.distance(&expected.poses, &poses) <= SAME * size;
            // The two poses near a singular one, which noise and lag make indistinguishable.
            let within = reach.gap + (2.0 * reach.noise / curvature).sqrt() + LEAST * size;
            if expected.as_ref().is_some_and(is_same) {
                Verdict::Right
            } else if self.is_near_singular(truth, reach).is_some()
                && apart <= 2.0 * distance + 2.0 * NEAR * within
            {
                Verdict::Excused("the other pose beside a singular one")
            } else {
                let share = apart / size;
                Verdict::Wrong(format!(
                    "{WRONG_POSE}: {poses:?}, {share:.1e} of the size from {:?}; a singular pose is {:.1e} away, reach {reach:?}",
                    truth.poses,
                    distance / size
                ))
            }
        };
        if verdict == Verdict::Right {
            (self.crossed, self.held, self.strayed) = (false, false, false);
        }
        if !matches!(verdict, Verdict::Wrong(_)) {
            self.good = Some(found);
        }
        verdict
    }

    /// Judges a refusal of joints that are the machine's except for noise. `commanded` is the pose in world
    /// mode.
    pub fn refused(
        &mut self,
        code: i32,
        truth: &State,
        joints: &Joints,
        reach: Reach,
        commanded: bool,
    ) -> Verdict {
        let near = self.is_near_singular(truth, reach).or_else(|| self.is_near_end(code, truth));
        // Also refused results of another branch, from which the next call starts.
        let is_passed = matches!(code, -41 | -42);
        if let Some(near) = near
            && !is_passed
        {
            return Verdict::Excused(near);
        }
        let from = self.good.unwrap_or_else(|| self.system.at_reference());
        let (led, path) = self.led(&from, joints);
        let size = self.system.size();
        let is_true = led.as_ref().is_some_and(|led| {
            let (distance, _, _) = self.watched(truth);
            let apart = self.system.distance(&led.poses, &truth.poses);
            apart <= ALONE * distance || {
                let (expected, _) = self.led(truth, joints);
                expected.is_some_and(|e| self.system.distance(&e.poses, &led.poses) <= SAME * size)
            }
        });
        let (_, curvature, _) = self.watched(truth);
        let within = LEAST + (2.0 * reach.noise / curvature).sqrt() / size;
        let least_margin = if names_leg(code) { REFUSED_MARGIN - 1.0 } else { MARGIN };
        let verdict = if let Some(near) = near {
            Verdict::Excused(near)
        } else if code == -41 && reach.is_passed {
            self.held = true;
            Verdict::Right
        } else if self.crossed && led.is_some() && !is_true {
            self.held |= is_passed;
            if is_passed { Verdict::Right } else { Verdict::Excused("beyond a singular pose") }
        } else if self.held && !commanded {
            Verdict::Right
        } else if self.held && is_of_search(code) {
            // The module follows the mirror image, which no pose of the machine leads to.
            Verdict::Excused("beyond a singular pose")
        } else if led.is_none() || !is_true {
            Verdict::Excused("no straight line of joints from the last pose")
        } else if is_bound(code) && (self.strayed || path.length > LONG * size) {
            Verdict::Excused("a long way back from far joints")
        } else if !(path.distance > NEAR * within)
            || !(path.margin > least_margin)
            || path.steps > STEPS
        {
            Verdict::Excused("a singular pose beside the line of joints")
        } else {
            Verdict::Wrong(format!(
                "{REFUSED}: code {code} for {} at {}, margin {:.3}; from {} {path:?}, reach {reach:?}",
                brief(joints),
                both(&truth.poses),
                self.system.look(truth).margin,
                both(&from.poses)
            ))
        };
        if near.is_some() {
            self.held |= is_passed;
        }
        if is_passed && let Some(led) = led {
            self.good = Some(led);
        }
        verdict
    }

    /// Judges joints that are not the machine's: the pose must fit them, by the path from the last good one.
    pub fn accepted_elsewhere(&mut self, joints: &Joints, world: &Pose) -> Verdict {
        let from = self.good.unwrap_or_else(|| self.system.at_reference());
        let found = State { poses: self.system.poses(world), joints: *joints };
        let (led, path) = self.led(&from, joints);
        let size = self.system.size();
        match led {
            _ if !self.system.fits(&found) => Verdict::Wrong(format!(
                "{WRONG_POSE}: {} does not fit {}",
                brief(world),
                brief(joints)
            )),
            Some(led) if self.system.distance(&led.poses, &found.poses) <= 100.0 * SAME * size => {
                (self.good, self.elsewhere) = (Some(found), Some(found));
                Verdict::Right
            }
            // Long lines near singular poses: any end that fits is correct.
            _ if !(path.distance > FAR_DISTANCE) || path.steps > STEPS => {
                (self.good, self.elsewhere) = (Some(found), Some(found));
                Verdict::Excused("far joints beside a singular pose")
            }
            _ => Verdict::Wrong(format!(
                "{WRONG_POSE}: {} for {}, which the line from {} leads to {:?} {path:?}",
                brief(world),
                brief(joints),
                both(&from.poses),
                led.map(|led| both(&led.poses))
            )),
        }
    }

    /// Records joints in other kinematics. Near the end of a leg the module keeps its last pose.
    pub fn seen(&mut self, truth: &State, joints: &Joints) {
        let Some(good) = self.good else { return };
        let (distance, _, margin) = self.watched(truth);
        if !(margin > REFUSED_MARGIN) {
            return;
        }
        if !self.crossed
            && self.system.distance(&good.poses, &truth.poses) <= ALONE * distance
            && let Some(now) = self.system.near(truth, joints, ALONE * distance)
        {
            self.good = Some(now);
            return;
        }
        if let (Some(led), path) = self.led(&good, joints)
            && path.margin > REFUSED_MARGIN - 1.0
        {
            self.good = Some(led);
            self.strayed |= path.length > LONG * self.system.size();
        }
    }

    /// Judges the first refusal after distant joints: LinuxCNC's call for feedback starts from their pose once.
    pub fn refused_after_far(
        &mut self,
        code: i32,
        far: &State,
        joints: &Joints,
    ) -> Option<Verdict> {
        if !is_bound(code) {
            return None;
        }
        let (_, path) = self.led(far, joints);
        let is_long = path.length > LONG * self.system.size();
        is_long.then_some(Verdict::Excused("a long way back from far joints"))
    }

    /// Records joints in other kinematics that are not the machine's.
    pub fn seen_elsewhere(&mut self, joints: &Joints) {
        let Some(good) = self.good.filter(|_| joints.iter().all(|q| q.is_finite())) else { return };
        if let (Some(led), path) = self.led(&good, joints) {
            self.good = Some(led);
            self.strayed |= path.length > LONG * self.system.size();
        }
    }

    pub fn count(&mut self, what: &'static str) {
        *self.counts.entry(what).or_default() += 1;
    }
}
