// SPDX-License-Identifier: GPL-2.0-or-later
//! The table of parameters, and the values of a block as those of pins.

use super::interface::{KINS_IN, KINS_MAX_PARAMS, KinsParamDesc};
use crate::hal::{Name, Pin, PinValue};
use crate::pins::Source;
use core::cell::Cell;
use core::ffi::c_int;
use core::ptr::null;

/// Prefix of the module's pins.
pub const PREFIX: &core::ffi::CStr = c"pkmkins";

/// A pin's value as a number of the table.
pub trait TableValue: PinValue {
    /// The draft's number of the type.
    const TYPE: c_int;

    fn to_number(self) -> f64;

    fn of_number(value: f64) -> Self;
}

macro_rules! table_values {
    ($($type:ty = $number:literal, $to:expr, $of:expr;)*) => {$(
        impl TableValue for $type {
            const TYPE: c_int = $number;

            fn to_number(self) -> f64 {
                let to: fn(Self) -> f64 = $to;
                to(self)
            }

            fn of_number(value: f64) -> Self {
                let of: fn(f64) -> Self = $of;
                of(value)
            }
        }
    )*};
}

table_values! {
    f64 = 0, |value| value, |value| value;
    bool = 1, |value| f64::from(u8::from(value)), |value| value != 0.0;
    i32 = 2, f64::from, |value| value as i32;
    u32 = 3, f64::from, |value| value as u32;
}

/// The parameters, and their names, which end with a zero.
pub struct Table {
    names: [Cell<Name>; KINS_MAX_PARAMS],
    parameters: [Cell<KinsParamDesc>; KINS_MAX_PARAMS],
    /// May exceed the number of places.
    wanted: Cell<usize>,
}

impl Table {
    pub const fn new() -> Self {
        const NONE: KinsParamDesc =
            KinsParamDesc { name: null(), kind: 0, direction: KINS_IN, tool: 0, default: 0.0 };
        Self {
            names: [const { Cell::new(Name::EMPTY) }; KINS_MAX_PARAMS],
            parameters: [const { Cell::new(NONE) }; KINS_MAX_PARAMS],
            wanted: Cell::new(0),
        }
    }

    /// Forgets all parameters.
    pub fn clear(&self) {
        self.wanted.set(0);
    }

    /// Adds an input, and makes the pin refer to it if it fits.
    pub fn add<T: TableValue>(&'static self, pin: &mut Pin<T>, name: &Name, value: T) {
        let wanted = self.wanted.get();
        self.wanted.set(wanted + 1);
        let (Some(place), Some(parameter)) = (self.names.get(wanted), self.parameters.get(wanted))
        else {
            return;
        };
        place.set(*name);
        // The draft puts the prefix and a dot before the name. The text of the cell stays where it is.
        // SAFETY: the table is static, and no name is changed once a caller has it.
        let text = unsafe { &*place.as_ptr() }.as_bytes_with_zero();
        let text = text.get(PREFIX.count_bytes() + 1..).unwrap_or_default();
        parameter.set(KinsParamDesc {
            name: text.as_ptr().cast(),
            kind: T::TYPE,
            direction: KINS_IN,
            tool: 0,
            default: value.to_number(),
        });
        pin.refer_to(wanted + 1);
    }

    /// Makes the parameter added last the tool's length.
    pub fn mark_tool(&self) {
        let last = self.wanted.get().checked_sub(1).and_then(|last| self.parameters.get(last));
        if let Some(last) = last {
            last.set(KinsParamDesc { tool: 1, ..last.get() });
        }
    }

    pub fn has_room_for(&self, more: usize) -> bool {
        self.wanted.get() + more <= KINS_MAX_PARAMS
    }

    /// Returns the first parameter and their number.
    pub fn parameters(&self) -> (*const KinsParamDesc, c_int) {
        (self.parameters.as_ptr().cast(), self.wanted.get() as c_int)
    }
}

/// The values of a block, as those of pins; 0 for a pin that is not in the table.
pub struct Values<'a>(pub &'a [f64; KINS_MAX_PARAMS]);

impl Source for Values<'_> {
    fn get<T: TableValue>(&self, pin: &Pin<T>) -> T {
        let value = pin.referred().checked_sub(1).and_then(|place| self.0.get(place));
        T::of_number(value.copied().unwrap_or(0.0))
    }
}
