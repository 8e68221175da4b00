// SPDX-License-Identifier: GPL-2.0-or-later
//! A HAL with pointers: a pin is a pointer to a value of its own type.

use super::PinValue;
use core::ffi::{c_char, c_int};

unsafe extern "C" {
    fn hal_pin_float_new(
        name: *const c_char,
        direction: c_int,
        pin: *mut *mut f64,
        component: c_int,
    ) -> c_int;
    fn hal_pin_bit_new(
        name: *const c_char,
        direction: c_int,
        pin: *mut *mut bool,
        component: c_int,
    ) -> c_int;
    fn hal_pin_u32_new(
        name: *const c_char,
        direction: c_int,
        pin: *mut *mut u32,
        component: c_int,
    ) -> c_int;
    fn hal_pin_s32_new(
        name: *const c_char,
        direction: c_int,
        pin: *mut *mut i32,
        component: c_int,
    ) -> c_int;
}

macro_rules! pin_value {
    ($($type:ty => $call:ident;)*) => {$(
        impl PinValue for $type {
            unsafe fn create(
                name: *const c_char,
                direction: c_int,
                pin: *mut *mut Self,
                component: c_int,
                value: Self,
            ) -> c_int {
                // SAFETY: passed on to the caller.
                let code = unsafe { $call(name, direction, pin, component) };
                if code >= 0 {
                    // SAFETY: HAL has set the pointer to a valid value.
                    unsafe { Self::write(pin.read(), value) };
                }
                code
            }

            unsafe fn read(pin: *mut Self) -> Self {
                // SAFETY: passed on to the caller.
                unsafe { pin.read_volatile() }
            }

            unsafe fn write(pin: *mut Self, value: Self) {
                // SAFETY: passed on to the caller.
                unsafe { pin.write_volatile(value) }
            }
        }
    )*};
}

pin_value! {
    f64 => hal_pin_float_new;
    bool => hal_pin_bit_new;
    u32 => hal_pin_u32_new;
    i32 => hal_pin_s32_new;
}
