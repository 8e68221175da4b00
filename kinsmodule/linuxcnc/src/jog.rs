// SPDX-License-Identifier: GPL-2.0-or-later
//! Jogs in world mode: LinuxCNC moves each axis separately there, and the feed scale has no effect.
//!
//! Two things have an effect: the largest speed of an axis, which LinuxCNC's task reads from a pin, outside of
//! real time, and the stop of all jogs, which the motion controller obeys in its next cycle. The first slows
//! a jog in time; the second ends one that was not slowed.

use crate::pins::{FAR, JogPins};
use kinematics::{Cause, Fault, Outlook, World};

/// Seconds until a speed limit of an axis acts: some cycles of LinuxCNC's task, on a busy computer.
pub const NOTICE: f64 = 0.05;

/// Cycles between updates of the pins while nothing is jogged.
const SHOWN_IN: u32 = 4;

/// Factor on a lowered speed limit, so that it is lowered less often: each change takes the task a cycle.
const STEP: f64 = 0.95;

/// The motion of a jog.
pub struct Led<'a> {
    pub outlook: &'a Outlook,
    /// Fraction of the present speed by which it brakes per second.
    pub braking: f64,
    /// Seconds until a response acts, as [`Outlook`] assumes.
    pub latency: f64,
    /// Rates of LinuxCNC's axes, per second.
    pub rates: &'a World,
    pub period: f64,
    /// Smallest fraction of its largest speed that an axis is slowed to.
    pub floor: f64,
}

/// The state of a jog, until it has ended for some cycles.
pub struct Jog {
    /// Fractions of the largest speed of each axis.
    shares: World,
    /// Seconds for which it has been faster than allowed.
    overdue: f64,
    is_stopped: bool,
    /// Cycles at rest since the pins were updated.
    unshown: u32,
}

impl Jog {
    pub const fn new() -> Self {
        Self { shares: [1.0; 9], overdue: 0.0, is_stopped: false, unshown: 0 }
    }

    /// Runs one cycle in which nothing is jogged, or a jogged axis stands.
    pub fn rest(&mut self, pins: &JogPins) {
        self.unshown += 1;
        if !(self.unshown >= SHOWN_IN || self.is_stopped || pins.is_jogging()) {
            return;
        }
        if pins.is_jogging() {
            self.overdue = 0.0;
        } else {
            *self = Self::new();
        }
        self.show(pins);
    }

    /// Runs one cycle of a jog. Returns why it is stopped from this cycle on.
    pub fn follow(&mut self, led: &Led<'_>, pins: &JogPins) -> Option<Fault> {
        let fastest = pins.fastest();
        let allowed = led.in_time();
        for ((share, rate), fastest) in self.shares.iter_mut().zip(led.rates).zip(fastest) {
            let wanted = allowed * rate.abs() / fastest;
            // An axis without a largest speed has no limit to lower. NaN lowers it to the floor.
            if *rate != 0.0 && !(fastest >= FAR) && !(wanted >= *share) {
                *share = (STEP * wanted).max(led.floor);
            }
        }
        match self.too_late(led) {
            Some(why) => self.stop(why, pins),
            None => {
                self.show(pins);
                None
            }
        }
    }

    /// Ends all jogs. Returns why, unless they were stopped already.
    pub fn stop(&mut self, why: Fault, pins: &JogPins) -> Option<Fault> {
        let was_stopped = core::mem::replace(&mut self.is_stopped, true);
        self.show(pins);
        (!was_stopped).then_some(why)
    }

    /// Returns why the jog is too fast to brake later: at once for a limit of the pose, and for joint speeds
    /// only some time after the speed limits of the axes were lowered.
    fn too_late(&mut self, led: &Led<'_>) -> Option<Fault> {
        let (fault, _) = led.outlook.because?;
        self.overdue = if led.outlook.allowed < 1.0 { self.overdue + led.period } else { 0.0 };
        let patience = if fault.cause == Cause::JointTooFast { 2.0 * NOTICE } else { 0.0 };
        (self.overdue > patience).then_some(fault)
    }

    fn show(&mut self, pins: &JogPins) {
        self.unshown = 0;
        pins.show(&self.shares, self.is_stopped);
    }

    pub fn is_stopped(&self) -> bool {
        self.is_stopped
    }
}

impl Led<'_> {
    /// Returns the largest speed, as a multiple of the present one, that allows for a response later by [`NOTICE`]:
    /// the distance traveled until then is not available for braking.
    fn in_time(&self) -> f64 {
        let Some((_, until)) = self.outlook.because else { return self.outlook.allowed };
        let missing = (until - self.latency).clamp(0.0, NOTICE);
        let square = self.outlook.allowed * self.outlook.allowed - 2.0 * self.braking * missing;
        libm::sqrt(square.max(0.0))
    }
}
