// SPDX-License-Identifier: GPL-2.0-or-later
//! The distance monitor of two mechanisms, which stops the machine before they collide.
//!
//! Both poses are extrapolated at their present speed, and brake together. If the distance falls below the
//! clearance before they could stop, the feed is inhibited. Each cycle checks the present pose, the last one and
//! one between.
//!
//! The extrapolation does not go beyond the end of the last queued move, which [`Between::note_queued`] finds, so
//! that poses farther ahead are not checked. Otherwise a move that ends just outside the clearance would be stopped.

use crate::guard;
use crate::hal::{Direction, HalError, Pin};
use crate::module::Module;
use crate::pins::{FAR, Maker};
use kinematics::{At, Body, Fault, Gap, Motion, Planner, Pose, World, text};

/// Number of poses before the last one, of which a cycle checks one.
const BETWEEN: u32 = 7;

/// Cycles until an inhibited feed acts on the poses, plus those until every pose has been checked.
const LATENCY: f64 = guard::LATENCY + BETWEEN as f64;

/// Bound of the planner's acceleration divided by the acceleration assumed for braking, which is 0.43 of it.
const FULL_BRAKING: f64 = 2.4;

/// Smallest relative decrease of the distance ahead: less is rounding.
const NEARER: f64 = 1e-9;

/// Largest distance of the end of the present motion from a queued end point that is the same point, as a share of
/// the machine's size and of a turn. Rounding in the direction of one cycle's motion gives a thousandth of it, and
/// the distance of the two mechanisms changes by no more than it.
const SAME_POINT: f64 = 1e-6;

/// Pins that only two mechanisms have, in HAL memory.
#[repr(C)]
pub struct BetweenPins {
    clearance: Pin<f64>,
    in_position: Pin<bool>,
    distance: Pin<f64>,
    pair: [Pin<i32>; 2],
}

impl BetweenPins {
    /// Creates them; `self` must be in memory from [`crate::hal::Component::allocate`].
    pub fn create(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::{In, Out};
        make.one(&mut self.clearance, In, text!["pkmkins.mechanism-clearance"], 0.0)?;
        make.one(&mut self.in_position, In, text!["pkmkins.in-position"], false)?;
        make.one(&mut self.distance, Out, text!["pkmkins.mechanism-distance"], FAR)?;
        for (pin, letter) in self.pair.iter_mut().zip(["a", "b"]) {
            make.one(pin, Out, text!["pkmkins.mechanism-pair-", letter], -1)?;
        }
        Ok(())
    }

    fn show(&self, gap: &Gap, first_leg: i32) {
        self.distance.set(gap.distance);
        for ((pin, body), first) in self.pair.iter().zip(gap.bodies).zip([0, first_leg]) {
            pin.set(match body {
                Body::Leg(n) => first + n as i32,
                Body::Platform => -1,
            });
        }
    }
}

/// The state kept from cycle to cycle.
pub struct Between {
    pins: &'static BetweenPins,
    /// Commanded poses of the two cycles before, older first, of both mechanisms.
    before: [[Option<Pose>; 2]; 2],
    /// The intermediate pose to check next.
    next: u32,
    /// Why the feed is inhibited, until no move remains.
    inhibited: Option<Fault>,
    /// The end poses of both after the only move in LinuxCNC's queue.
    end: Option<[World; 2]>,
}

struct Cycle<'a> {
    modules: [&'a Module; 2],
    motions: [Option<Motion>; 2],
    poses: [Pose; 2],
}

impl Between {
    pub fn new(pins: &'static BetweenPins) -> Self {
        Self { pins, before: [[None; 2]; 2], next: 1, inhibited: None, end: None }
    }

    /// Notes the end point of a move that LinuxCNC is about to queue.
    ///
    /// The motion certainly ends there only if the queue was empty before: behind other moves it may pass this point
    /// before it reaches another one. `motion.in-position` is on exactly while the queue is empty, but it is written once
    /// a cycle. That suffices, because the command handler queues at most one move a cycle, before or after the
    /// controller has run. If the pin is off, as when it is not connected, the end is unknown.
    ///
    /// An abort, a refusal or a jog does not discard the end point: no motion that [`Cycle::time_to_end`] could mistake
    /// for the move to it can follow these before another move is queued, and noted here.
    pub fn note_queued(&mut self, poses: [World; 2]) {
        self.end = self.pins.in_position.get().then_some(poses);
    }

    /// Returns whether the feed stays inhibited until the program is aborted.
    pub fn inhibits_feed(&self) -> bool {
        self.inhibited.is_some()
    }

    /// Runs one cycle, after both monitors. Returns the distance violation now or ahead, and whether the feed is
    /// inhibited for it from this cycle on.
    pub fn watch(&mut self, modules: [&Module; 2], seconds: f64) -> Option<(Fault, bool)> {
        let commanded = modules.map(Module::commanded);
        let before = core::mem::take(&mut self.before);
        for ((kept, old), now) in self.before.iter_mut().zip(&before).zip(&commanded) {
            *kept = [old[1], *now];
        }
        let pins = modules[0].pins;
        if pins.guard.asked.requested_vel.get() == 0.0 {
            self.inhibited = None;
        }
        let [Some(first), Some(second)] = modules.map(Module::last_pose) else { return None };
        let poses = [commanded[0].unwrap_or(first), commanded[1].unwrap_or(second)];
        let linear = pins.guard.asked.linear_acceleration.get();
        let mut motions = [None; 2];
        for (((motion, module), old), now) in
            motions.iter_mut().zip(modules).zip(&before).zip(&commanded)
        {
            *motion = motion_of(module, old, *now, (seconds, linear));
        }
        let found = self.looked(&Cycle { modules, motions, poses }, seconds);
        let is_new = found.is_some_and(|(_, is_new)| is_new);
        // Show the reason for the stop while it lasts.
        if is_new { found } else { self.inhibited.map(|fault| (fault, false)).or(found) }
    }

    fn looked(&mut self, cycle: &Cycle<'_>, seconds: f64) -> Option<(Fault, bool)> {
        let [one, other] = cycle.modules.map(Module::machine);
        let (mut one, mut other) = (one?.nowhere(), other?.nowhere());
        let both = &mut [&mut one, &mut other];
        let clearance = self.pins.clearance.get();
        let is_shown = cycle.modules[0].shows_distance();
        if clearance == 0.0 && !is_shown {
            return None;
        }
        // At this distance or more, any pose ahead that violates the clearance is nearer than this one.
        let far = clearance + 4.0 * NEARER * clearance.abs();
        let now = cycle.gap(both, 0.0, if is_shown { f64::INFINITY } else { far })?;
        let first_leg = cycle.modules[0].layout().legs();
        if is_shown {
            self.pins.show(&now, first_leg as i32);
        }
        if clearance == 0.0 {
            return None;
        }
        let near = |gap: &Gap| !(gap.distance >= clearance);
        let mut found = Some(now).filter(near);
        if let Some(horizon) = cycle.horizon(seconds, self.end.as_ref()) {
            self.next = if self.next < BETWEEN { self.next + 1 } else { 1 };
            let share = f64::from(self.next) / f64::from(BETWEEN + 1);
            for time in [share * horizon, horizon] {
                let ahead = cycle.gap(both, time, clearance);
                // A pose that cannot be reached is reported by the guard of its mechanism.
                let Some(ahead) = ahead.filter(near) else { continue };
                found = found.or(Some(ahead));
                if ahead.distance < now.distance * (1.0 - NEARER) {
                    let fault = ahead.fault(first_leg);
                    let is_new = self.inhibited.is_none();
                    self.inhibited = self.inhibited.or(Some(fault));
                    return Some((fault, is_new));
                }
            }
        }
        found.map(|gap| (gap.fault(first_leg), false))
    }
}

fn motion_of(
    module: &Module,
    before: &[Option<Pose>; 2],
    now: Option<Pose>,
    (seconds, linear): (f64, f64),
) -> Option<Motion> {
    let second = before[1]?;
    let poses = [&before[0].unwrap_or(second), &second, &now?];
    Motion::of(module.machine()?, poses, seconds, linear)
}

impl Cycle<'_> {
    /// Returns the nearest parts after a time at the present speed, see [`Gap::within`]; `None` if a pose cannot
    /// be reached.
    fn gap(&self, both: &mut [&mut At<'_>; 2], time: f64, most: f64) -> Option<Gap> {
        let mechanisms = both.iter_mut().zip(self.modules).zip(&self.motions).zip(&self.poses);
        for (((at, module), motion), pose) in mechanisms {
            let pose = motion.as_ref().map_or(*pose, |motion| motion.pose_after(time));
            at.move_to(&pose, &module.tool()).ok()?;
        }
        Some(Gap::within(both[0], both[1], most))
    }

    /// Returns the time at the present speed until both would stand, if the feed is inhibited now or `end` is the end
    /// of the queue; `None` if nothing moves, or the braking is unknown.
    fn horizon(&self, seconds: f64, end: Option<&[World; 2]>) -> Option<f64> {
        let asked = &self.modules[0].pins.guard.asked;
        let latency = LATENCY * seconds;
        let planner = Planner {
            linear: asked.linear_acceleration.get(),
            angular: asked.angular_acceleration.get(),
            requested: 1.0,
            latency,
            notice: None,
        };
        // Both brake along the common path, as slowly as the slower one.
        let braking = self.motions.iter().flatten().map(|motion| motion.braking(&planner));
        let braking =
            braking.fold(f64::INFINITY, |least, own| if own >= least { least } else { own });
        if !(braking > 0.0 && braking.is_finite()) {
            return None;
        }
        let stopped = latency + 0.5 / braking;
        // LinuxCNC may queue a move that goes straight on while the machine already brakes for the end. It is noted
        // in the cycle in which the planner first follows it. Until then the planner has kept its stopping distance,
        // with an acceleration that the queued move does not lower: it is halved for a blend from the
        // start. Until the inhibited feed acts, after a time t, the machine may accelerate with that acceleration
        // a. From the speed v it then stops at most 2 v t + a t^2 beyond the end.
        let late = guard::LATENCY * seconds;
        let beyond = late * (2.0 + FULL_BRAKING * braking * late);
        let ended = end.and_then(|end| self.time_to_end(end, stopped - beyond));
        Some(ended.map_or(stopped, |time| time + beyond))
    }

    /// Returns the time at the present speed until the end point of the only queued move, if it is less than `most`
    /// and the present motion leads there.
    ///
    /// The end of the motion is the pose straight ahead by `.distance-to-go`. It differs from `end` on an arc until
    /// its end is near, in a jog, in a reversed run, and with external offsets, which `end` does not include.
    fn time_to_end(&self, end: &[World; 2], most: f64) -> Option<f64> {
        let to_go = self.modules[0].pins.guard.asked.distance_to_go.get();
        let time = to_go / self.motions.iter().flatten().next()?.speed();
        if !(time < most) {
            return None;
        }
        for (((motion, pose), module), end) in
            self.motions.iter().zip(&self.poses).zip(self.modules).zip(end)
        {
            let pose = motion.as_ref().map_or(*pose, |motion| motion.pose_after(time));
            let size = module.machine()?.size();
            let scales = [size, size, size, 360.0, 360.0, 360.0];
            for ((value, end), scale) in pose.to_degrees().iter().zip(end).zip(scales) {
                if !((value - end).abs() <= SAME_POINT * scale) {
                    return None;
                }
            }
        }
        Some(time)
    }
}
