// SPDX-License-Identifier: GPL-2.0-or-later
//! The creation and reading of pins: single ones, and those that end with a coordinate's letter. Outside real time
//! they are values of a parameter block.

use crate::hal::{Component, Direction, HalError, Name, Pin};
use crate::outside::{Table, TableValue};
use kinematics::{Fault, text};

/// Three pins `.x`, `.y`, `.z`.
pub(super) type Vector = [Pin<f64>; 3];

/// Six pins `.x` … `.c`.
pub(super) type Pose6 = [Pin<f64>; 6];

pub(super) const LETTERS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// Creates pins of one mechanism.
pub struct Maker {
    pub target: Target,
    pub place: Place,
}

/// Where pins are created.
#[derive(Clone, Copy)]
pub enum Target {
    Hal(Component),
    /// Inputs only.
    Table(&'static Table),
}

/// Where the values of pins come from.
pub trait Source {
    fn get<T: TableValue>(&self, pin: &Pin<T>) -> T;

    /// Reads a row of pins.
    fn row<const M: usize>(&self, pins: &[Pin<f64>; M]) -> [f64; M] {
        pins.each_ref().map(|pin| self.get(pin))
    }
}

/// The values of HAL's pins.
pub struct Live;

impl Source for Live {
    #[inline(always)]
    fn get<T: TableValue>(&self, pin: &Pin<T>) -> T {
        pin.get()
    }
}

/// Which mechanism of a module, and the numbers of its first leg and joint.
#[derive(Clone, Copy)]
pub struct Place {
    pub leg: u8,
    pub joint: u8,
    pub is_second: bool,
}

impl Place {
    /// The first or only mechanism.
    pub const FIRST: Self = Self { leg: 0, joint: 0, is_second: false };

    /// Returns a fault with its leg or joint numbered within the module.
    pub fn counted(&self, fault: &Fault) -> Fault {
        fault.counted_from(self.leg, self.joint)
    }
}

impl Maker {
    /// Returns the prefix of the mechanism's pin names; those of legs and joints have distinct numbers
    /// instead.
    pub(super) fn stem(&self) -> &'static str {
        if self.place.is_second { "pkmkins.second." } else { "pkmkins." }
    }

    /// Returns the name of a pin of leg `n` of the mechanism.
    pub(super) fn of_leg(&self, name: &str, n: usize, end: &str) -> Name {
        text!["pkmkins.", name, ".", n + usize::from(self.place.leg), end]
    }

    /// Returns the name of a pin of joint `n` of the mechanism.
    pub(super) fn of_joint(&self, name: &str, n: usize) -> Name {
        text!["pkmkins.", name, ".", n + usize::from(self.place.joint)]
    }

    /// Returns the default of leg `n` of LinuxCNC's own machine, which only a first mechanism replaces.
    pub(super) fn drop_in<'a, T>(&self, legs: &'a [T], n: usize) -> Option<&'a T> {
        if self.place.is_second { None } else { legs.get(n) }
    }

    pub fn one<T: TableValue>(
        &self,
        pin: &mut Pin<T>,
        direction: Direction,
        name: Name,
        value: T,
    ) -> Result<(), HalError> {
        match self.target {
            // SAFETY: only functions that create pins use a maker for HAL, on pins in HAL memory.
            Target::Hal(component) => unsafe { pin.create(component, direction, &name, value) },
            Target::Table(table) => {
                if direction == Direction::In {
                    table.add(pin, &name, value);
                }
                Ok(())
            }
        }
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
