// SPDX-License-Identifier: GPL-2.0-or-later
//! How pins are made and read: single ones, and those with a coordinate's letter at the end.

use crate::hal::{Component, Direction, HalError, Name, Pin, PinValue};

/// Three pins `.x`, `.y`, `.z`.
pub(super) type Vector = [Pin<f64>; 3];

/// Six pins `.x` … `.c`.
pub(super) type Pose6 = [Pin<f64>; 6];

pub(super) const LETTERS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// Makes pins of one component.
pub(super) struct Maker(pub(super) Component);

impl Maker {
    pub(super) fn one<T: PinValue>(
        &self,
        pin: &mut Pin<T>,
        direction: Direction,
        name: Name,
        value: T,
    ) -> Result<(), HalError> {
        // SAFETY: only `Pins::create` uses a maker, on pins in HAL memory.
        unsafe { pin.create(self.0, direction, &name, value) }
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
