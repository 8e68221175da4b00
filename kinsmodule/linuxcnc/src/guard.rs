// SPDX-License-Identifier: GPL-2.0-or-later
//! The part of the monitor that guards the motion: what it shows about the pose, and the
//! feed that it allows.
//!
//! The calculation is [`At::ahead_in_turn`]. Here is what is remembered from cycle to cycle.

use crate::pins::{GuardInputs, GuardOutputs, GuardPins, Pins};
use kinematics::{At, Fault, Machine, Motion, Outlook, Planner, Pose, Sight, Vector3};

/// How fast the feed scale rises, per second: a tenth of a second from nothing to all.
const RISE: f64 = 10.0;

/// Cycles until a feed scale acts on the poses: the planner reads it in the next one, and
/// shows in the one after that where that leads.
const LATENCY: f64 = 3.0;

/// Cycles in which all of what people read about the pose is shown anew.
const SHOWN_IN: u32 = 4;

/// What the guard looks at in a cycle.
pub struct Scene<'a> {
    pub pins: &'a Pins,
    pub machine: &'a Machine,
    /// Tool offset in effect.
    pub tool: &'a Vector3<f64>,
    /// Last good pose that forward found.
    pub pose: Option<Pose>,
    /// The pose commanded in this cycle; none outside of world mode.
    pub commanded: Option<Pose>,
    /// Servo period, seconds.
    pub period: f64,
}

/// What the guard remembers.
pub struct Guard {
    /// Commanded poses of the two cycles before, older first.
    before: [Option<Pose>; 2],
    /// What was seen ahead.
    sight: Sight,
    /// `.current-vel` of the cycle before.
    speed_before: f64,
    scale: f64,
    /// Why the feed is inhibited, until no move is left to be made.
    inhibited: Option<Fault>,
    inverse_time: i64,
    forward_time: i64,
    /// Which part of the shown values was shown last.
    part: u32,
}

impl Guard {
    pub const fn new() -> Self {
        Self {
            before: [None; 2],
            sight: Sight::NONE,
            speed_before: 0.0,
            scale: 1.0,
            inhibited: None,
            inverse_time: 0,
            forward_time: 0,
            part: 0,
        }
    }

    /// Nanoseconds that the first forward of a cycle took.
    pub fn timed_forward(&mut self, nanoseconds: i64) {
        self.forward_time = nanoseconds;
    }

    /// Nanoseconds that the inverse of the commanded pose took.
    pub fn timed_inverse(&mut self, nanoseconds: i64) {
        self.inverse_time = nanoseconds;
    }

    /// Without the machine's kinematics in force there is nothing to guard.
    pub fn idle(&mut self, pins: &Pins, period: f64) {
        self.forget();
        self.inhibited = None;
        pins.guard.shown.limit(None);
        self.answer(&pins.guard, 1.0, period);
    }

    /// One cycle. A fault is why the feed was inhibited just now.
    // A frame of its own: a cycle that freezes a geometry needs none of it.
    #[inline(never)]
    pub fn run(&mut self, scene: &Scene<'_>) -> Option<Fault> {
        let pins = &scene.pins.guard;
        let commanded = scene.commanded;
        let at = &mut scene.machine.nowhere();
        self.show_pose(scene, at);
        pins.shown.inverse_time.set(shown_time(self.inverse_time));
        pins.shown.forward_time.set(shown_time(self.forward_time));
        // What the planner went in this cycle is the mean of the speeds at its ends.
        let speed = pins.asked.current_vel.get();
        let mean = (speed + self.speed_before) / 2.0;
        let (soon, view) = self.looked((scene, at), commanded, mean);
        self.before = [self.before[1], commanded];
        self.speed_before = speed;
        let told = self.inhibited.is_some();
        self.allow(scene, view);
        pins.shown.limit(self.inhibited.or(soon));
        self.inhibited.filter(|_| !told)
    }

    /// What people read about the pose that forward found: of four parts one a cycle, in turn.
    fn show_pose(&mut self, scene: &Scene<'_>, at: &mut At<'_>) {
        let moved = scene.pose.map(|pose| at.move_to(&pose, scene.tool));
        let Some(Ok(())) = moved else { return scene.pins.assembly.set(0) };
        self.part = if self.part < SHOWN_IN - 1 { self.part + 1 } else { 0 };
        match self.part {
            0 => show_joints(scene, at),
            1 => show_cones(&scene.pins.guard, at),
            2 => show_nearest(&scene.pins.guard.shown, at),
            _ => scene.pins.guard.shown.conditioning.set(at.smallest_singular_value()),
        }
    }

    /// What is, or lies ahead, beyond a limit; and the outlook if the machine moves, with the
    /// speed that it is a multiple of. `told` is the speed that the planner tells.
    fn looked(
        &mut self,
        (scene, at): (&Scene<'_>, &mut At<'_>),
        commanded: Option<Pose>,
        told: f64,
    ) -> (Option<Fault>, Option<(Outlook, f64)>) {
        let Some(pose) = commanded.or(scene.pose) else { return (None, None) };
        let limits = scene.pins.guard.limits(scene.pins, scene.machine.layout());
        let Some(motion) = self.motion(scene, commanded) else {
            self.sight = Sight::NONE;
            return (at.here(scene.tool, &limits, &pose), None);
        };
        let asked = &scene.pins.guard.asked;
        // In its first and last cycles the way of the poses alone says how fast the machine is.
        let slow = !(told >= 0.5 * scene.pins.guard.floor() * requested(asked));
        let speed = if slow { motion.speed() } else { told };
        let planner = Planner {
            linear: asked.linear_acceleration.get(),
            angular: asked.angular_acceleration.get(),
            requested: requested(asked) / speed,
            latency: (LATENCY + f64::from(Sight::OLDEST)) * scene.period,
        };
        let view = at.ahead_in_turn(&mut self.sight, (scene.tool, &limits), &motion, &planner);
        (view.soon, Some((view, speed)))
    }

    fn motion(&self, scene: &Scene<'_>, commanded: Option<Pose>) -> Option<Motion> {
        let second = self.before[1]?;
        let first = self.before[0].unwrap_or(second);
        let poses = [&first, &second, &commanded?];
        let linear = scene.pins.guard.asked.linear_acceleration.get();
        Motion::of(scene.machine, poses, scene.period, linear)
    }

    /// Turns the outlook into a feed scale, or inhibits the feed: where the floor is too fast, and
    /// the machine may be so fast before an answer acts.
    fn allow(&mut self, scene: &Scene<'_>, view: Option<(Outlook, f64)>) {
        let pins = &scene.pins.guard;
        let requested = requested(&pins.asked);
        let mut wanted = 1.0;
        if requested == 0.0 {
            // No move is left to be made: aborted, or at its end.
            self.inhibited = None;
        } else if let Some((view, speed)) = view {
            wanted = view.allowed * speed / requested;
            let to_go = pins.asked.distance_to_go.get();
            let within = |time: f64| !(time * speed > to_go);
            let too_fast = wanted < pins.floor() && !(view.gathered < view.allowed);
            let why = view.because.filter(|(_, time)| too_fast && within(*time));
            self.inhibited = self.inhibited.or(why.map(|(fault, _)| fault));
        }
        self.answer(pins, wanted, scene.period);
    }

    /// Writes a feed scale within [floor, 1] that falls at once and rises slowly.
    fn answer(&mut self, pins: &GuardPins, wanted: f64, period: f64) {
        let floor = pins.floor();
        let risen = self.scale + RISE * period;
        let allowed = if self.inhibited.is_some() || !(wanted >= floor) { floor } else { wanted };
        self.scale = allowed.min(risen).max(floor).min(1.0);
        pins.shown.feed_scale.set(self.scale);
    }

    /// Whether nothing may move until the program is aborted.
    pub fn inhibits_feed(&self) -> bool {
        self.inhibited.is_some()
    }

    /// Nothing is known of the motion of a newly frozen machine.
    pub fn forget(&mut self) {
        self.before = [None; 2];
        self.sight = Sight::NONE;
    }
}

/// Speed that the program may ask for at most: the feed override comes on top of it.
fn requested(asked: &GuardInputs) -> f64 {
    asked.requested_vel.get() * asked.max_override.get().max(1.0)
}

fn shown_time(nanoseconds: i64) -> i32 {
    i32::try_from(nanoseconds).unwrap_or(i32::MAX)
}

fn show_joints(scene: &Scene<'_>, at: &At<'_>) {
    scene.pins.assembly.set(at.assembly().unwrap_or(0));
    let (pins, count) = (&scene.pins.guard, at.layout().joints());
    let [min, max, _] = scene.pins.joint_limits(count);
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

fn show_nearest(shown: &GuardOutputs, at: &At<'_>) {
    if let Some(nearest) = at.nearest() {
        shown.rod_distance.set(nearest.distance);
        for (pin, leg) in shown.rod_pair.iter().zip(nearest.pair) {
            pin.set(leg as i32);
        }
    }
}
