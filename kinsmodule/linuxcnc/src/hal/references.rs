// SPDX-License-Identifier: GPL-2.0-or-later
//! A HAL with references: a pin is a reference to 64 bits, which each type reads and writes
//! differently.
//!
//! LinuxCNC's header does this with inline functions, which a library cannot import. They are
//! repeated here, and `tests/module/c` compares them with the header's own.
//!
//! Integers have 32 bits: HAL nets a pin only with signals of its type, and those of other modules
//! have 32 as well until LinuxCNC changes all of them.

use super::PinValue;
use core::ffi::{c_char, c_int};

unsafe extern "C" {
    fn hal_pin_new_real(
        component: c_int,
        direction: c_int,
        pin: *mut *mut f64,
        value: f64,
        format: *const c_char,
        ...
    ) -> c_int;
    fn hal_pin_new_bool(
        component: c_int,
        direction: c_int,
        pin: *mut *mut bool,
        value: bool,
        format: *const c_char,
        ...
    ) -> c_int;
    fn hal_pin_new_ui32(
        component: c_int,
        direction: c_int,
        pin: *mut *mut u32,
        value: u32,
        format: *const c_char,
        ...
    ) -> c_int;
    fn hal_pin_new_si32(
        component: c_int,
        direction: c_int,
        pin: *mut *mut i32,
        value: i32,
        format: *const c_char,
        ...
    ) -> c_int;
}

/// Implements a type: the call that creates its pin, the part of the 64 bits that is read, and the value written.
macro_rules! pin_value {
    ($($type:ty => $call:ident, $part:ty => $read:expr, $whole:ty => $write:expr;)*) => {$(
        impl PinValue for $type {
            unsafe fn create(
                name: *const c_char,
                direction: c_int,
                pin: *mut *mut Self,
                component: c_int,
                value: Self,
            ) -> c_int {
                // SAFETY: passed on to the caller; "%s" takes one string.
                unsafe { $call(component, direction, pin, value, c"%s".as_ptr(), name) }
            }

            unsafe fn read(pin: *mut Self) -> Self {
                let read: fn($part) -> Self = $read;
                // SAFETY: passed on to the caller.
                read(unsafe { pin.cast::<$part>().read_volatile() })
            }

            unsafe fn write(pin: *mut Self, value: Self) {
                let whole: fn(Self) -> $whole = $write;
                // SAFETY: the caller guarantees the 64 bits of a pin.
                unsafe { pin.cast::<$whole>().write_volatile(whole(value)) }
            }
        }
    )*};
}

pin_value! {
    f64 => hal_pin_new_real, f64 => |value| value, f64 => |value| value;
    bool => hal_pin_new_bool, u8 => |byte| byte != 0, u64 => u64::from;
    u32 => hal_pin_new_ui32, u32 => |value| value, u64 => u64::from;
    i32 => hal_pin_new_si32, i32 => |value| value, i64 => i64::from;
}
