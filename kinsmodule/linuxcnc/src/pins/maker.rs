// SPDX-License-Identifier: GPL-2.0-or-later
//! How pins are made and read: single ones, and those with a coordinate's letter at the end.

use crate::hal::{Component, Direction, HalError, Name, Pin, PinValue};
use kinematics::{Fault, text};

/// Three pins `.x`, `.y`, `.z`.
pub(super) type Vector = [Pin<f64>; 3];

/// Six pins `.x` … `.c`.
pub(super) type Pose6 = [Pin<f64>; 6];

pub(super) const LETTERS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// Makes pins of one mechanism.
pub struct Maker {
    pub component: Component,
    pub place: Place,
}

/// Which mechanism of a module, and from which number on its legs and joints are counted.
#[derive(Clone, Copy)]
pub struct Place {
    pub leg: u8,
    pub joint: u8,
    pub is_second: bool,
}

impl Place {
    /// Of the first mechanism, or of the only one.
    pub const FIRST: Self = Self { leg: 0, joint: 0, is_second: false };

    /// A fault of the mechanism with the numbers that its legs and joints have in the module.
    pub fn counted(&self, fault: &Fault) -> Fault {
        fault.counted_from(self.leg, self.joint)
    }
}

impl Maker {
    /// The beginning of a name that belongs to the mechanism; those of legs and joints have numbers of
    /// their own instead.
    pub(super) fn stem(&self) -> &'static str {
        if self.place.is_second { "pkmkins.second." } else { "pkmkins." }
    }

    /// The name of a pin of leg `n` of the mechanism.
    pub(super) fn of_leg(&self, name: &str, n: usize, end: &str) -> Name {
        text!["pkmkins.", name, ".", n + usize::from(self.place.leg), end]
    }

    /// The name of a pin of joint `n` of the mechanism.
    pub(super) fn of_joint(&self, name: &str, n: usize) -> Name {
        text!["pkmkins.", name, ".", n + usize::from(self.place.joint)]
    }

    /// The default of leg `n` of LinuxCNC's own machine, which only a first mechanism stands in for.
    pub(super) fn drop_in<'a, T>(&self, legs: &'a [T], n: usize) -> Option<&'a T> {
        if self.place.is_second { None } else { legs.get(n) }
    }

    pub fn one<T: PinValue>(
        &self,
        pin: &mut Pin<T>,
        direction: Direction,
        name: Name,
        value: T,
    ) -> Result<(), HalError> {
        // SAFETY: only functions that make pins use a maker, on pins in HAL memory.
        unsafe { pin.create(self.component, direction, &name, value) }
    }

    pub(super) fn letters<const M: usize>(
        &self,
        pins: &mut [Pin<f64>; M],
        direction: Direction,
        stem: Name,
        values: [f64; M],
    ) -> Result<(), HalError> {
        for ((pin, letter), value) in pins.iter_mut().zip(LETTERS).zip(values) {
            let mut name = stem;
            name.push(letter);
            self.one(pin, direction, name, value)?;
        }
        Ok(())
    }
}

/// The values of a row of pins.
pub(super) fn read<const M: usize>(pins: &[Pin<f64>; M]) -> [f64; M] {
    pins.each_ref().map(Pin::get)
}
