// SPDX-License-Identifier: GPL-2.0-or-later
//! Pins of jogs in world mode: the speeds at which LinuxCNC may jog its axes.

use super::FAR;
use super::maker::Maker;
use crate::hal::{Direction, HalError, Pin};
use kinematics::{Letter, Load, World, text};

/// LinuxCNC's axes, in the order of its pose.
pub(super) const AXES: [&str; 9] = ["x", "y", "z", "a", "b", "c", "u", "v", "w"];

/// Part of [`Pins`](super::Pins), in HAL memory.
#[repr(C)]
pub struct JogPins {
    jogging: Pin<bool>,
    pub stop: Pin<bool>,
    scale: Pin<f64>,
    fastest: [Pin<f64>; 9],
    velocity: [Pin<f64>; 9],
    /// Bit k: LinuxCNC's axis k has pins.
    made: u16,
}

impl JogPins {
    pub(super) fn create(&mut self, make: &Maker, load: &Load) -> Result<(), HalError> {
        use Direction::{In, Out};
        make.one(&mut self.jogging, In, text!["pkmkins.jogging"], false)?;
        make.one(&mut self.stop, Out, text!["pkmkins.jog-stop"], false)?;
        make.one(&mut self.scale, Out, text!["pkmkins.jog-scale"], 1.0)?;
        let moved = Letter::ALL.into_iter().filter(|letter| !load.layout.is_held(*letter));
        for k in moved.map(Letter::index).chain(load.extra.places()) {
            let (Some(axis), Some(fastest), Some(velocity)) =
                (AXES.get(k), self.fastest.get_mut(k), self.velocity.get_mut(k))
            else {
                continue;
            };
            make.one(fastest, In, text!["pkmkins.axis-max-velocity.", *axis], FAR)?;
            make.one(velocity, Out, text!["pkmkins.jog-velocity.", *axis], FAR)?;
            self.made |= 1 << k;
        }
        Ok(())
    }

    /// Uses the pins of the first mechanism: a second one has none here.
    pub(super) fn share(&self, first: &Self) {
        self.jogging.share(&first.jogging);
    }

    /// Returns whether LinuxCNC jogs.
    pub fn is_jogging(&self) -> bool {
        self.jogging.get()
    }

    /// Returns the largest speed of each axis; infinite if it has no pins.
    pub fn fastest(&self) -> World {
        let mut fastest = [f64::INFINITY; 9];
        for (k, (value, pin)) in fastest.iter_mut().zip(&self.fastest).enumerate() {
            if self.made & 1 << k != 0 {
                *value = pin.get();
            }
        }
        fastest
    }

    /// Shows the fractions of their largest speeds at which the axes may be jogged, and whether all jogs
    /// must end.
    pub fn show(&self, shares: &World, is_stopped: bool) {
        if self.made == 0 {
            return;
        }
        let mut least = 1.0_f64;
        let pins = self.fastest.iter().zip(&self.velocity);
        for (k, ((fastest, velocity), share)) in pins.zip(shares).enumerate() {
            if self.made & 1 << k != 0 {
                velocity.set(share * fastest.get());
                least = least.min(*share);
            }
        }
        self.scale.set(least);
        self.stop.set(is_stopped);
    }
}
