// SPDX-License-Identifier: GPL-2.0-or-later
//! The pins of the guard: its limits and its results.

use super::Pins;
use super::jog::AXES;
use super::maker::Maker;
use crate::hal::{Direction, HalError, Pin};
use kinematics::{
    CONDITIONING_LIMIT, Fault, Layout, Limits, Load, MAX_EXTRA, MAX_JOINTS, MAX_LEGS, text,
};

/// Floor of the feed scale if the value of the pin is not in (0, 1].
const FLOOR: f64 = 0.02;

/// The distance shown if nothing can come near to each other, or none is known; as an input it means no
/// limit.
pub const FAR: f64 = 1e99;

/// The guard's outputs for one joint.
#[repr(C)]
pub struct GuardJointPins {
    pub margin: Pin<f64>,
    pub speed_ratio: Pin<f64>,
}

/// The guard's outputs and inputs for one leg.
#[repr(C)]
pub struct GuardLegPins {
    pub base_angle: Pin<f64>,
    pub platform_angle: Pin<f64>,
    base_cone: Pin<f64>,
    platform_cone: Pin<f64>,
    /// About the joint's fixed axis, and across it.
    base_pyramid: [Pin<f64>; 2],
    platform_pyramid: [Pin<f64>; 2],
}

#[repr(C)]
pub struct GuardOutputs {
    pub conditioning: Pin<f64>,
    pub rod_distance: Pin<f64>,
    pub rod_pair: [Pin<i32>; 2],
    pub inverse_time: Pin<i32>,
    pub forward_time: Pin<i32>,
    pub feed_scale: Pin<f64>,
    limit_soon: Pin<bool>,
    limit_leg: Pin<i32>,
    limit_reason: Pin<i32>,
}

#[repr(C)]
pub struct GuardInputs {
    conditioning_limit: Pin<f64>,
    rod_clearance: Pin<f64>,
    tilt_limit: Pin<f64>,
    feed_floor: Pin<f64>,
    pub max_override: Pin<f64>,
    pub linear_acceleration: Pin<f64>,
    pub angular_acceleration: Pin<f64>,
    /// Accelerations of the extra axes, in joint order; only as many pins as axes exist.
    pub extra_acceleration: [Pin<f64>; MAX_EXTRA],
    pub requested_vel: Pin<f64>,
    pub current_vel: Pin<f64>,
    pub distance_to_go: Pin<f64>,
}

/// Pins of the guard; part of [`Pins`], in HAL memory.
#[repr(C)]
pub struct GuardPins {
    pub joints: [GuardJointPins; MAX_JOINTS],
    pub legs: [GuardLegPins; MAX_LEGS],
    pub shown: GuardOutputs,
    pub asked: GuardInputs,
}

impl GuardPins {
    pub(super) fn create(&mut self, make: &Maker, load: &Load) -> Result<(), HalError> {
        let layout = &load.layout;
        for (n, joint) in self.joints.iter_mut().enumerate().take(layout.joints()) {
            joint.create(make, n)?;
        }
        for (n, leg) in self.legs.iter_mut().enumerate().take(layout.legs()) {
            leg.create(make, n)?;
        }
        self.shown.create(make)?;
        // A second mechanism uses those of the first.
        if make.place.is_second { Ok(()) } else { self.asked.create(make, load) }
    }

    /// Returns the limits of the machine, live.
    pub fn limits(&self, pins: &Pins, layout: &Layout) -> Limits {
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

    /// Returns the smallest feed scale, in (0, 1].
    pub fn floor(&self) -> f64 {
        let floor = self.asked.feed_floor.get();
        if floor > 0.0 && floor <= 1.0 { floor } else { FLOOR }
    }
}

impl GuardJointPins {
    fn create(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::Out;
        make.one(&mut self.margin, Out, make.of_joint("margin", n), 0.0)?;
        make.one(&mut self.speed_ratio, Out, make.of_joint("speed-ratio", n), 0.0)
    }
}

impl GuardLegPins {
    fn create(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::{In, Out};
        make.one(&mut self.base_angle, Out, make.of_leg("base-angle", n, ""), 0.0)?;
        make.one(&mut self.platform_angle, Out, make.of_leg("platform-angle", n, ""), 0.0)?;
        make.one(&mut self.base_cone, In, make.of_leg("base-cone", n, ""), 0.0)?;
        make.one(&mut self.platform_cone, In, make.of_leg("platform-cone", n, ""), 0.0)?;
        for (pins, name) in [
            (&mut self.base_pyramid, "base-pyramid"),
            (&mut self.platform_pyramid, "platform-pyramid"),
        ] {
            for (pin, way) in pins.iter_mut().zip([".about", ".across"]) {
                make.one(pin, In, make.of_leg(name, n, way), 0.0)?;
            }
        }
        Ok(())
    }
}

impl GuardOutputs {
    fn create(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::Out;
        make.one(&mut self.conditioning, Out, text![make.stem(), "conditioning"], 0.0)?;
        make.one(&mut self.rod_distance, Out, text![make.stem(), "rod-distance"], FAR)?;
        for (pin, letter) in self.rod_pair.iter_mut().zip(["a", "b"]) {
            make.one(pin, Out, text![make.stem(), "rod-pair-", letter], -1)?;
        }
        make.one(&mut self.inverse_time, Out, text![make.stem(), "inverse-time"], 0)?;
        make.one(&mut self.forward_time, Out, text![make.stem(), "forward-time"], 0)?;
        make.one(&mut self.feed_scale, Out, text![make.stem(), "feed-scale"], 1.0)?;
        make.one(&mut self.limit_soon, Out, text![make.stem(), "limit-soon"], false)?;
        make.one(&mut self.limit_leg, Out, text![make.stem(), "limit-leg"], -1)?;
        make.one(&mut self.limit_reason, Out, text![make.stem(), "limit-reason"], 0)
    }

    /// Shows the near limit of another mechanism, if this one has none.
    pub fn limit_of_either(&self, other: &Self) {
        if !self.limit_soon.get() && other.limit_soon.get() {
            self.limit_soon.set(true);
            self.limit_leg.set(other.limit_leg.get());
            self.limit_reason.set(other.limit_reason.get());
        }
    }

    /// Shows a near limit, if no other one is shown.
    pub fn limit_if_none(&self, fault: &Fault) {
        if !self.limit_soon.get() {
            self.limit(Some(*fault));
        }
    }

    /// Shows the near limit, if there is one.
    pub fn limit(&self, soon: Option<Fault>) {
        self.limit_soon.set(soon.is_some());
        self.limit_leg.set(soon.and_then(|fault| fault.number()).map_or(-1, i32::from));
        self.limit_reason.set(soon.map_or(0, |fault| fault.cause.code()));
    }
}

impl GuardInputs {
    fn all(&self) -> [&Pin<f64>; 10] {
        [
            &self.conditioning_limit,
            &self.rod_clearance,
            &self.tilt_limit,
            &self.feed_floor,
            &self.max_override,
            &self.linear_acceleration,
            &self.angular_acceleration,
            &self.requested_vel,
            &self.current_vel,
            &self.distance_to_go,
        ]
    }

    /// Uses the pins of the first mechanism.
    pub(super) fn share(&self, first: &Self) {
        let extra = self.extra_acceleration.iter().zip(&first.extra_acceleration);
        for (own, first) in self.all().into_iter().zip(first.all()).chain(extra) {
            own.share(first);
        }
    }

    fn create(&mut self, make: &Maker, load: &Load) -> Result<(), HalError> {
        use Direction::In;
        for (pin, place) in self.extra_acceleration.iter_mut().zip(load.extra.places()) {
            let axis = AXES.get(place).copied().unwrap_or_default();
            make.one(pin, In, text!["pkmkins.extra-acceleration.", axis], FAR)?;
        }
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
