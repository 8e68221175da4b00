// SPDX-License-Identifier: GPL-2.0-or-later
//! The part of the monitor that guards the motion: the pins it sets about the pose, and the
//! feed scale that it allows.
//!
//! [`At::ahead_in_turn`] does the calculation. This module keeps the state from cycle to cycle.

use crate::jog::{Jog, Led, NOTICE};
use crate::pins::{GuardInputs, GuardPins, Pins, Place};
use kinematics::{
    At, Corner, ExtraAxes, Fault, MAX_EXTRA, Machine, Motion, Outlook, Planner, Pose, Sight,
    Straight, Vector3, World,
};
use libm::sqrt;

/// Rate of rise of the feed scale, per second: a tenth of a second from 0 to 1.
const RISE: f64 = 10.0;

/// Cycles until a feed scale acts on the poses: the planner reads it in the next one, and its
/// poses show it in the one after that.
pub const LATENCY: f64 = 3.0;

/// The guard's inputs of one cycle.
pub struct Cycle<'a> {
    pub pins: &'a Pins,
    /// Which mechanism it is.
    pub place: Place,
    pub machine: &'a Machine,
    /// Tool offset in effect.
    pub tool: &'a Vector3<f64>,
    /// Last good pose that forward found.
    pub pose: Option<Pose>,
    /// The pose commanded in this cycle; none outside of world mode.
    pub commanded: Option<Pose>,
    /// NaN or infinite feedback: LinuxCNC's comparison with it detects no following error.
    pub lost: Option<Fault>,
    /// LinuxCNC's motion, if it differs from the machine's own.
    pub programmed: Option<Programmed>,
    /// Everything that LinuxCNC moves, if that is more than the machine's own motion.
    pub path: Option<Programmed>,
    /// Servo period, seconds.
    pub period: f64,
    /// The part of the pose's pins that is updated in this cycle.
    pub shows: Option<Shown>,
}

/// A part of the pins about the pose that only users read.
#[derive(Clone, Copy)]
pub enum Shown {
    Joints,
    Cones,
    Nearest,
    Conditioning,
}

/// LinuxCNC's motion in a cycle.
#[derive(Clone, Copy)]
pub struct Programmed {
    /// Speeds of X Y Z, of U V W and of A B C, per second.
    speeds: [f64; 3],
    /// Rates of LinuxCNC's axes, per second.
    pub axes: World,
    /// Speeds of the extra axes, per second.
    extra: [f64; MAX_EXTRA],
}

impl Programmed {
    /// Computes the motion between two poses a period apart.
    pub fn between(before: &World, now: &World, period: f64, extra: &ExtraAxes) -> Self {
        let mut axes = *now;
        axes.iter_mut().zip(before).for_each(|(now, before)| *now = (*now - before) / period);
        let [x, y, z, a, b, c, u, v, w] = axes;
        let norm = |[a, b, c]: [f64; 3]| sqrt(a * a + b * b + c * c);
        let mut speeds = [0.0; MAX_EXTRA];
        for (speed, place) in speeds.iter_mut().zip(extra.places()) {
            *speed = axes.get(place).map_or(0.0, |rate| rate.abs());
        }
        Self { speeds: [norm([x, y, z]), norm([u, v, w]), norm([a, b, c])], axes, extra: speeds }
    }

    /// Adds the motion of the second mechanism, in its own coordinates: LinuxCNC's U V W are its X Y Z.
    pub fn with_second(self, second: &Self) -> Self {
        let ([tip, slides, turns], [own_tip, _, own_turns]) = (self.speeds, second.speeds);
        let both = |one: f64, other: f64| sqrt(one * one + other * other);
        Self { speeds: [tip, both(slides, own_tip), both(turns, own_turns)], ..self }
    }

    /// Returns the speed as LinuxCNC defines it: of X Y Z, otherwise of U V W, otherwise of A B C.
    fn speed(&self) -> f64 {
        let [tip, slides, turns] = self.speeds;
        if tip > 0.0 {
            tip
        } else if slides > 0.0 {
            slides
        } else {
            turns
        }
    }

    /// Returns the least share of the speed by which LinuxCNC brakes per second: a move brakes as slowly as the axis
    /// that has to brake most.
    fn braking(&self, asked: &GuardInputs) -> f64 {
        let [tip, slides, turns] = self.speeds;
        let groups =
            [(&asked.linear_acceleration, tip.max(slides)), (&asked.angular_acceleration, turns)];
        let extra = asked.extra_acceleration.iter().zip(self.extra);
        let mut least = f64::INFINITY;
        for (limit, rate) in groups.into_iter().chain(extra) {
            let braking = if rate > 0.0 { limit.get() / rate } else { f64::INFINITY };
            // Treat NaN as no braking.
            if !(braking >= least) {
                least = braking;
            }
        }
        least
    }
}

pub struct Guard {
    /// Commanded poses of the two cycles before, older first.
    before: [Option<Pose>; 2],
    /// The result of looking ahead.
    sight: Sight,
    /// The present straight move, until another one begins.
    straight: Straight,
    /// `.current-vel` of the cycle before.
    speed_before: f64,
    scale: f64,
    /// Why the feed is inhibited, until no move remains.
    inhibited: Option<Fault>,
    jog: Jog,
    inverse_time: i64,
    forward_time: i64,
}

impl Guard {
    pub const fn new() -> Self {
        Self {
            before: [None; 2],
            sight: Sight::NONE,
            straight: Straight::NONE,
            speed_before: 0.0,
            scale: 1.0,
            inhibited: None,
            jog: Jog::new(),
            inverse_time: 0,
            forward_time: 0,
        }
    }

    /// Keeps the duration of the first forward of a cycle, in nanoseconds.
    pub fn timed_forward(&mut self, nanoseconds: i64) {
        self.forward_time = nanoseconds;
    }

    /// Keeps the duration of the inverse of the commanded pose, in nanoseconds.
    pub fn timed_inverse(&mut self, nanoseconds: i64) {
        self.inverse_time = nanoseconds;
    }

    /// Runs one cycle without the machine's kinematics in force: there is nothing to guard.
    pub fn idle(&mut self, pins: &Pins, period: f64) {
        self.forget();
        self.inhibited = None;
        pins.guard.shown.limit(None);
        self.jog.rest(&pins.jog);
        self.set_scale(&pins.guard, 1.0, period);
    }

    /// Runs one cycle. Returns why the feed is inhibited, or a jog is stopped, from this cycle on.
    pub fn run(&mut self, cycle: &Cycle<'_>) -> Option<Fault> {
        let pins = &cycle.pins.guard;
        let commanded = cycle.commanded;
        let at = &mut cycle.machine.nowhere();
        self.show_pose(cycle, at);
        pins.shown.inverse_time.set(shown_time(self.inverse_time));
        pins.shown.forward_time.set(shown_time(self.forward_time));
        // The mean speed of this cycle is the mean of the speeds at its ends.
        let speed = pins.asked.current_vel.get();
        let mean = (speed + self.speed_before) / 2.0;
        let was_inhibited = self.inhibited.is_some();
        let (soon, stopped) = if cycle.pins.jog.is_jogging() && commanded.is_some() {
            self.led(cycle, at)
        } else {
            self.jog.rest(&cycle.pins.jog);
            let (soon, view) = self.looked((cycle, at), commanded, mean);
            self.allow(cycle, view);
            (soon, None)
        };
        self.before = [self.before[1], commanded];
        self.speed_before = speed;
        pins.shown.limit(self.inhibited.or(soon).map(|fault| cycle.place.counted(&fault)));
        stopped.or(self.inhibited.filter(|_| !was_inhibited))
    }

    /// Shows a part of the pins about the pose that forward found.
    fn show_pose(&self, cycle: &Cycle<'_>, at: &mut At<'_>) {
        let Some(part) = cycle.shows else { return };
        let moved = cycle.pose.map(|pose| at.move_to(&pose, cycle.tool));
        let Some(Ok(())) = moved else { return cycle.pins.assembly.set(0) };
        match part {
            Shown::Joints => show_joints(cycle, at),
            Shown::Cones => show_cones(&cycle.pins.guard, at),
            Shown::Nearest => show_nearest(cycle, at),
            Shown::Conditioning => {
                cycle.pins.guard.shown.conditioning.set(at.smallest_singular_value());
            }
        }
    }

    /// Returns the limit violated now or ahead; and the outlook if the machine moves, with the
    /// speed that it is a multiple of. `reported` is the speed that the planner reports.
    fn looked(
        &mut self,
        (cycle, at): (&Cycle<'_>, &mut At<'_>),
        commanded: Option<Pose>,
        reported: f64,
    ) -> (Option<Fault>, Option<(Outlook, f64)>) {
        let Some(pose) = commanded.or(cycle.pose) else { return (None, None) };
        let limits = cycle.pins.guard.limits(cycle.pins, cycle.machine.layout());
        let Some(motion) = self.motion(cycle, commanded) else {
            (self.sight, self.straight) = (Sight::NONE, Straight::NONE);
            return (at.here(cycle.tool, &limits, &pose), None);
        };
        let asked = &cycle.pins.guard.asked;
        // In the first and last cycles of a motion only the poses show the actual speed.
        let slow = !(reported >= 0.5 * cycle.pins.guard.floor() * requested(asked));
        let path = cycle.path.as_ref().or(cycle.programmed.as_ref());
        let own = path.map_or(motion.speed(), Programmed::speed);
        let corner = if slow { None } else { self.corner(cycle, &pose, reported) };
        let motion = corner.map_or(motion, |corner| motion.beginning(&corner));
        let together = if slow { own } else { reported };
        let speed = corner.map_or(together, |corner| corner.speed);
        let planner = Planner {
            linear: asked.linear_acceleration.get(),
            angular: asked.angular_acceleration.get(),
            requested: requested(asked) / speed,
            latency: (LATENCY + f64::from(Sight::OLDEST)) * cycle.period,
            notice: None,
        };
        let planner = match path {
            Some(path) => motion.braked(path.braking(asked), &planner),
            None => planner,
        };
        let mut view = at.ahead_in_turn(&mut self.sight, (cycle.tool, &limits), &motion, &planner);
        if corner.is_some_and(|corner| corner.may_outrun(view.allowed * speed, LATENCY)) {
            // As slow as possible until the outlook is known; that is no reason to stop.
            (view.allowed, view.because) = (0.0, None);
        }
        (view.soon, Some((view, speed)))
    }

    /// Checks a cycle of a jog in world mode: returns the limit violated now or ahead, and why the jog is stopped.
    fn led(&mut self, cycle: &Cycle<'_>, at: &mut At<'_>) -> (Option<Fault>, Option<Fault>) {
        let guard = &cycle.pins.guard;
        let limits = guard.limits(cycle.pins, cycle.machine.layout());
        if let Some(lost) = cycle.lost {
            return (Some(lost), self.jog.stop(lost, &cycle.pins.jog));
        }
        let (Some(motion), Some(now)) = (self.motion(cycle, cycle.commanded), cycle.commanded)
        else {
            self.sight = Sight::NONE;
            self.jog.rest(&cycle.pins.jog);
            let here = cycle.commanded.and_then(|pose| at.here(cycle.tool, &limits, &pose));
            return (here, None);
        };
        let rates = self.rates(cycle, &now);
        let planner = Planner {
            linear: guard.asked.linear_acceleration.get(),
            angular: guard.asked.angular_acceleration.get(),
            requested: multiple(&rates, &cycle.pins.jog.fastest()),
            latency: (LATENCY + f64::from(Sight::OLDEST)) * cycle.period,
            notice: Some(NOTICE),
        };
        // In a jog every axis brakes independently.
        let planner = match &cycle.programmed {
            Some(programmed) => motion.braked(programmed.braking(&guard.asked), &planner),
            None => planner,
        };
        // Limits far enough ahead for a speed limit of the axes to act in time.
        let (latency, braking) = (planner.latency, motion.braking(&planner));
        let outlook = at.ahead_in_turn(&mut self.sight, (cycle.tool, &limits), &motion, &planner);
        let led = Led {
            outlook: &outlook,
            braking,
            latency,
            rates: &rates,
            period: cycle.period,
            floor: guard.floor(),
        };
        (outlook.soon, self.jog.follow(&led, &cycle.pins.jog))
    }

    /// Returns the two simultaneous moves when LinuxCNC rounds a corner; not those of U V W, and so none of a second
    /// mechanism, whose speed is not the one reported.
    fn corner(&mut self, cycle: &Cycle<'_>, now: &Pose, reported: f64) -> Option<Corner> {
        if cycle.place.is_second {
            return None;
        }
        let [x, y, z, a, b, c, u, v, w] = self.rates(cycle, now);
        let programmed = [x, y, z, a, b, c];
        let own = match cycle.programmed {
            Some(_) => self.own_rates(now, cycle.period),
            None => programmed,
        };
        let counts_other = u != 0.0 || v != 0.0 || w != 0.0;
        if counts_other { None } else { self.straight.corner([&programmed, &own], reported) }
    }

    /// Returns the rates of LinuxCNC's axes, per second.
    fn rates(&self, cycle: &Cycle<'_>, now: &Pose) -> World {
        if let Some(programmed) = &cycle.programmed {
            return programmed.axes;
        }
        let [x, y, z, a, b, c] = self.own_rates(now, cycle.period);
        [x, y, z, a, b, c, 0.0, 0.0, 0.0]
    }

    /// Returns the rates of the machine's pose, per second.
    fn own_rates(&self, now: &Pose, period: f64) -> [f64; 6] {
        let Some(before) = self.before[1] else { return [0.0; 6] };
        let (now, before) = (now.to_degrees(), before.to_degrees());
        core::array::from_fn(|k| (now[k] - before[k]) / period)
    }

    fn motion(&self, cycle: &Cycle<'_>, commanded: Option<Pose>) -> Option<Motion> {
        let second = self.before[1]?;
        let first = self.before[0].unwrap_or(second);
        let poses = [&first, &second, &commanded?];
        let linear = cycle.pins.guard.asked.linear_acceleration.get();
        Motion::of(cycle.machine, poses, cycle.period, linear)
    }

    /// Sets the feed scale from the outlook, or inhibits the feed if even the floor is too fast and
    /// the machine may reach that speed before the feed scale acts.
    fn allow(&mut self, cycle: &Cycle<'_>, view: Option<(Outlook, f64)>) {
        let pins = &cycle.pins.guard;
        let requested = requested(&pins.asked);
        let mut wanted = 1.0;
        if requested == 0.0 {
            // No move remains: aborted, or at its end.
            self.inhibited = None;
        } else if cycle.lost.is_some() {
            self.inhibited = cycle.lost;
        } else if let Some((view, speed)) = view {
            wanted = view.allowed * speed / requested;
            let to_go = pins.asked.distance_to_go.get();
            let within = |time: f64| !(time * speed > to_go);
            let too_fast = wanted < pins.floor() && !(view.gathered < view.allowed);
            let why = view.because.filter(|(_, time)| too_fast && within(*time));
            self.inhibited = self.inhibited.or(why.map(|(fault, _)| fault));
        }
        self.set_scale(pins, wanted, cycle.period);
    }

    /// Sets the feed scale within [floor, 1]; it falls at once and rises slowly.
    fn set_scale(&mut self, pins: &GuardPins, wanted: f64, period: f64) {
        let floor = pins.floor();
        let risen = self.scale + RISE * period;
        let allowed = if self.inhibited.is_some() || !(wanted >= floor) { floor } else { wanted };
        self.scale = allowed.min(risen).max(floor).min(1.0);
        pins.shown.feed_scale.set(self.scale);
    }

    /// Returns whether the feed stays inhibited until the program is aborted.
    pub fn inhibits_feed(&self) -> bool {
        self.inhibited.is_some()
    }

    pub fn stops_jogs(&self) -> bool {
        self.jog.is_stopped()
    }

    /// Resets the motion, as for a newly frozen machine.
    pub fn forget(&mut self) {
        self.before = [None; 2];
        (self.sight, self.straight) = (Sight::NONE, Straight::NONE);
    }
}

/// Returns the largest speed that the program may request, including the largest feed override.
fn requested(asked: &GuardInputs) -> f64 {
    asked.requested_vel.get() * asked.max_override.get().max(1.0)
}

/// Returns the largest multiple of the present rates that every axis allows.
fn multiple(rates: &World, fastest: &World) -> f64 {
    let each = rates.iter().zip(fastest).filter(|(rate, _)| **rate != 0.0);
    each.map(|(rate, fastest)| fastest / rate.abs()).fold(f64::INFINITY, f64::min)
}

fn shown_time(nanoseconds: i64) -> i32 {
    i32::try_from(nanoseconds).unwrap_or(i32::MAX)
}

fn show_joints(cycle: &Cycle<'_>, at: &At<'_>) {
    cycle.pins.assembly.set(at.assembly().unwrap_or(0));
    let (pins, count) = (&cycle.pins.guard, at.layout().joints());
    let [min, max, _] = cycle.pins.joint_limits(count);
    let ranges = at.joints().iter().zip(min.iter().zip(&max));
    for (pins, (joint, (min, max))) in pins.joints.iter().zip(ranges).take(count) {
        pins.margin.set((joint - min).min(max - joint));
    }
    let Ok(ratios) = at.speed_ratios() else { return };
    for (pins, ratio) in pins.joints.iter().zip(ratios).take(count) {
        pins.speed_ratio.set(ratio);
    }
}

fn show_cones(pins: &GuardPins, at: &At<'_>) {
    let cones = at.cones();
    let angles = cones.base.iter().zip(&cones.platform);
    for (pins, (base, platform)) in pins.legs.iter().zip(angles).take(at.layout().legs()) {
        pins.base_angle.set(*base);
        pins.platform_angle.set(*platform);
    }
}

fn show_nearest(cycle: &Cycle<'_>, at: &At<'_>) {
    if let Some(nearest) = at.nearest() {
        let (shown, first) = (&cycle.pins.guard.shown, i32::from(cycle.place.leg));
        shown.rod_distance.set(nearest.distance);
        for (pin, leg) in shown.rod_pair.iter().zip(nearest.pair) {
            pin.set(first + leg as i32);
        }
    }
}
