// SPDX-License-Identifier: GPL-2.0-or-later
//! The part of the monitor that guards the motion: what it shows about the pose, and the
//! feed that it allows.
//!
//! The calculation is [`Machine::ahead`] and [`Machine::at`]; here are its pins, and what is remembered from
//! cycle to cycle.

use crate::hal::{Direction, HalError, Pin};
use crate::pins::{Maker, Pins};
use kinematics::{
    At, CONDITIONING_LIMIT, Fault, Layout, Limits, MAX_JOINTS, MAX_LEGS, Machine, Motion, Outlook,
    Planner, Pose, Sight, Vector3, text,
};

/// Floor of the feed where the pin holds no share.
const FLOOR: f64 = 0.02;

/// How fast the feed scale rises, per second: a tenth of a second from nothing to all.
const RISE: f64 = 10.0;

/// Cycles until a feed scale acts on the poses: the planner reads it in the next one, and
/// shows in the one after that where that leads.
const LATENCY: f64 = 3.0;

/// Shown where no two legs can come near to each other.
const FAR: f64 = 1e99;

/// Pins of one joint.
#[repr(C)]
struct OfJoint {
    margin: Pin<f64>,
    speed_ratio: Pin<f64>,
}

/// Pins of one leg.
#[repr(C)]
struct OfLeg {
    base_angle: Pin<f64>,
    platform_angle: Pin<f64>,
    base_cone: Pin<f64>,
    platform_cone: Pin<f64>,
    /// About the joint's fixed axis, and across it.
    base_pyramid: [Pin<f64>; 2],
    platform_pyramid: [Pin<f64>; 2],
}

/// What the guard shows.
#[repr(C)]
struct Shown {
    conditioning: Pin<f64>,
    rod_distance: Pin<f64>,
    rod_pair: [Pin<i32>; 2],
    inverse_time: Pin<i32>,
    forward_time: Pin<i32>,
    feed_scale: Pin<f64>,
    limit_soon: Pin<bool>,
    limit_leg: Pin<i32>,
    limit_reason: Pin<i32>,
}

/// What the guard is given.
#[repr(C)]
struct Asked {
    conditioning_limit: Pin<f64>,
    rod_clearance: Pin<f64>,
    tilt_limit: Pin<f64>,
    feed_floor: Pin<f64>,
    max_override: Pin<f64>,
    linear_acceleration: Pin<f64>,
    angular_acceleration: Pin<f64>,
    requested_vel: Pin<f64>,
    current_vel: Pin<f64>,
    distance_to_go: Pin<f64>,
}

/// Pins of the guard; part of [`Pins`], in HAL memory.
#[repr(C)]
pub struct GuardPins {
    joints: [OfJoint; MAX_JOINTS],
    legs: [OfLeg; MAX_LEGS],
    shown: Shown,
    asked: Asked,
}

impl GuardPins {
    pub fn create(&mut self, make: &Maker, layout: &Layout) -> Result<(), HalError> {
        for (n, joint) in self.joints.iter_mut().enumerate().take(layout.joints()) {
            joint.create(make, n)?;
        }
        for (n, leg) in self.legs.iter_mut().enumerate().take(layout.legs()) {
            leg.create(make, n)?;
        }
        self.shown.create(make)?;
        self.asked.create(make)
    }

    fn limits(&self, pins: &Pins, layout: &Layout) -> Limits {
        let [min, max, speed] = pins.joint_limits(layout.joints());
        let mut limits = Limits {
            min,
            max,
            speed,
            tilt: self.asked.tilt_limit.get(),
            conditioning: self.asked.conditioning_limit.get(),
            clearance: self.asked.rod_clearance.get(),
            ..Limits::NONE
        };
        let cones = limits.base_cone.iter_mut().zip(&mut limits.platform_cone);
        let pyramids = limits.base_pyramid.iter_mut().zip(&mut limits.platform_pyramid);
        let legs = self.legs.iter().take(layout.legs());
        for ((leg, cone), pyramid) in legs.zip(cones).zip(pyramids) {
            *cone.0 = leg.base_cone.get();
            *cone.1 = leg.platform_cone.get();
            *pyramid.0 = leg.base_pyramid.each_ref().map(Pin::get);
            *pyramid.1 = leg.platform_pyramid.each_ref().map(Pin::get);
        }
        limits
    }

    /// Smallest feed scale, in (0, 1].
    fn floor(&self) -> f64 {
        let floor = self.asked.feed_floor.get();
        if floor > 0.0 && floor <= 1.0 { floor } else { FLOOR }
    }
}

impl OfJoint {
    fn create(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::Out;
        make.one(&mut self.margin, Out, text!["pkmkins.margin.", n], 0.0)?;
        make.one(&mut self.speed_ratio, Out, text!["pkmkins.speed-ratio.", n], 0.0)
    }
}

impl OfLeg {
    fn create(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::{In, Out};
        make.one(&mut self.base_angle, Out, text!["pkmkins.base-angle.", n], 0.0)?;
        make.one(&mut self.platform_angle, Out, text!["pkmkins.platform-angle.", n], 0.0)?;
        make.one(&mut self.base_cone, In, text!["pkmkins.base-cone.", n], 0.0)?;
        make.one(&mut self.platform_cone, In, text!["pkmkins.platform-cone.", n], 0.0)?;
        for (pins, end) in
            [(&mut self.base_pyramid, "base"), (&mut self.platform_pyramid, "platform")]
        {
            for (pin, way) in pins.iter_mut().zip([".about", ".across"]) {
                make.one(pin, In, text!["pkmkins.", end, "-pyramid.", n, way], 0.0)?;
            }
        }
        Ok(())
    }
}

impl Shown {
    fn create(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::Out;
        make.one(&mut self.conditioning, Out, text!["pkmkins.conditioning"], 0.0)?;
        make.one(&mut self.rod_distance, Out, text!["pkmkins.rod-distance"], FAR)?;
        for (pin, letter) in self.rod_pair.iter_mut().zip(["a", "b"]) {
            make.one(pin, Out, text!["pkmkins.rod-pair-", letter], -1)?;
        }
        make.one(&mut self.inverse_time, Out, text!["pkmkins.inverse-time"], 0)?;
        make.one(&mut self.forward_time, Out, text!["pkmkins.forward-time"], 0)?;
        make.one(&mut self.feed_scale, Out, text!["pkmkins.feed-scale"], 1.0)?;
        make.one(&mut self.limit_soon, Out, text!["pkmkins.limit-soon"], false)?;
        make.one(&mut self.limit_leg, Out, text!["pkmkins.limit-leg"], -1)?;
        make.one(&mut self.limit_reason, Out, text!["pkmkins.limit-reason"], 0)
    }

    fn limit(&self, soon: Option<Fault>) {
        self.limit_soon.set(soon.is_some());
        self.limit_leg.set(soon.and_then(|fault| fault.number()).map_or(-1, i32::from));
        self.limit_reason.set(soon.map_or(0, |fault| fault.cause.code()));
    }
}

impl Asked {
    fn create(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::In;
        let one = |pin: &mut Pin<f64>, name: &str, value: f64| {
            make.one(pin, In, text!["pkmkins.", name], value)
        };
        one(&mut self.conditioning_limit, "conditioning-limit", CONDITIONING_LIMIT)?;
        one(&mut self.rod_clearance, "rod-clearance", 0.0)?;
        one(&mut self.tilt_limit, "tilt-limit", 0.0)?;
        one(&mut self.feed_floor, "feed-floor", FLOOR)?;
        one(&mut self.max_override, "max-override", 1.0)?;
        one(&mut self.linear_acceleration, "linear-acceleration", FAR)?;
        one(&mut self.angular_acceleration, "angular-acceleration", FAR)?;
        one(&mut self.requested_vel, "requested-vel", 0.0)?;
        one(&mut self.current_vel, "current-vel", 0.0)?;
        one(&mut self.distance_to_go, "distance-to-go", FAR)
    }
}

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
        show_pose(scene);
        pins.shown.inverse_time.set(shown_time(self.inverse_time));
        pins.shown.forward_time.set(shown_time(self.forward_time));
        // What the planner went in this cycle is the mean of the speeds at its ends.
        let speed = pins.asked.current_vel.get();
        let mean = (speed + self.speed_before) / 2.0;
        let (soon, view) = self.looked(scene, commanded, mean);
        self.before = [self.before[1], commanded];
        self.speed_before = speed;
        let told = self.inhibited.is_some();
        self.allow(scene, view);
        pins.shown.limit(self.inhibited.or(soon));
        self.inhibited.filter(|_| !told)
    }

    /// What is, or lies ahead, beyond a limit; and the outlook if the machine moves, with the
    /// speed that it is a multiple of. `told` is the speed that the planner tells.
    fn looked(
        &mut self,
        scene: &Scene<'_>,
        commanded: Option<Pose>,
        told: f64,
    ) -> (Option<Fault>, Option<(Outlook, f64)>) {
        let Some(pose) = commanded.or(scene.pose) else { return (None, None) };
        let limits = scene.pins.guard.limits(scene.pins, scene.machine.layout());
        let Some(motion) = self.motion(scene, commanded) else {
            self.sight = Sight::NONE;
            return (scene.machine.here(scene.tool, &limits, &pose), None);
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
        let view =
            scene.machine.ahead_in_turn(&mut self.sight, scene.tool, &limits, &motion, &planner);
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
fn requested(asked: &Asked) -> f64 {
    asked.requested_vel.get() * asked.max_override.get().max(1.0)
}

fn shown_time(nanoseconds: i64) -> i32 {
    i32::try_from(nanoseconds).unwrap_or(i32::MAX)
}

/// What people read about the pose that forward found.
// A frame of its own: it ends before the look ahead begins.
#[inline(never)]
fn show_pose(scene: &Scene<'_>) {
    let at = scene.pose.map(|pose| scene.machine.at(&pose, scene.tool));
    let Some(Ok(at)) = &at else { return scene.pins.assembly.set(0) };
    scene.pins.assembly.set(at.assembly().unwrap_or(0));
    let _ = show_joints(scene, at);
    show_legs(&scene.pins.guard, at);
    scene.pins.guard.shown.conditioning.set(at.smallest_singular_value());
}

fn show_joints(scene: &Scene<'_>, at: &At<'_>) -> Result<(), Fault> {
    let (pins, count) = (&scene.pins.guard, at.layout().joints());
    let [min, max, _] = scene.pins.joint_limits(count);
    let ranges = at.joints().iter().zip(min.iter().zip(&max));
    for (pins, (joint, (min, max))) in pins.joints.iter().zip(ranges).take(count) {
        pins.margin.set((joint - min).min(max - joint));
    }
    let ratios = at.speed_ratios()?;
    for (pins, ratio) in pins.joints.iter().zip(ratios).take(count) {
        pins.speed_ratio.set(ratio);
    }
    Ok(())
}

fn show_legs(pins: &GuardPins, at: &At<'_>) {
    let cones = at.cones();
    let angles = cones.base.iter().zip(&cones.platform);
    for (pins, (base, platform)) in pins.legs.iter().zip(angles).take(at.layout().legs()) {
        pins.base_angle.set(*base);
        pins.platform_angle.set(*platform);
    }
    if let Some(nearest) = at.nearest() {
        pins.shown.rod_distance.set(nearest.distance);
        for (pin, leg) in pins.shown.rod_pair.iter().zip(nearest.pair) {
            pin.set(leg as i32);
        }
    }
}
