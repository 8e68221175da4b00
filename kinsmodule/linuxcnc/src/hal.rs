// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC's HAL and RTAPI: the calls this module makes, and typed pins.
//!
//! Pins are created and accessed as the HAL that the module is built for requires: by [`pointers`], or by
//! [`references`]. Everything else is the same in both.

#[cfg(not(hal_references))]
mod pointers;
#[cfg(hal_references)]
mod references;

use core::cell::UnsafeCell;
use core::ffi::{CStr, c_char, c_int, c_long, c_void};
use kinematics::Text;

/// HAL_NAME_LEN of LinuxCNC 2.9, without the closing zero.
const NAME_LENGTH: usize = 47;

/// Longest message, with the closing zero.
const MESSAGE_LENGTH: usize = 400;

const RTAPI_MSG_ERR: c_int = 1;

#[repr(C)]
#[derive(Clone, Copy, PartialEq)]
pub enum Direction {
    In = 16,
    Out = 32,
}

unsafe extern "C" {
    fn hal_init(name: *const c_char) -> c_int;
    fn hal_exit(component: c_int) -> c_int;
    fn hal_ready(component: c_int) -> c_int;
    fn hal_malloc(size: c_long) -> *mut c_void;
    fn hal_export_funct(
        name: *const c_char,
        function: unsafe extern "C" fn(*mut c_void, c_long),
        argument: *mut c_void,
        uses_fp: c_int,
        reentrant: c_int,
        component: c_int,
    ) -> c_int;
    fn rtapi_get_time() -> core::ffi::c_longlong;
    fn rtapi_print_msg(level: c_int, format: *const c_char, ...);
}

/// The negative return code of a failed HAL call.
#[derive(Clone, Copy, Debug)]
pub struct HalError(pub c_int);

fn checked(code: c_int) -> Result<c_int, HalError> {
    if code < 0 { Err(HalError(code)) } else { Ok(code) }
}

/// A pin's name.
pub type Name = Text<{ NAME_LENGTH + 1 }>;

pub type Message = Text<MESSAGE_LENGTH>;

/// Shows an error to the operator: LinuxCNC forwards it to the user interface.
pub fn print_error(message: &Message) {
    // SAFETY: both strings end with a zero, and "%s" takes one string.
    unsafe { rtapi_print_msg(RTAPI_MSG_ERR, c"%s\n".as_ptr(), message.as_bytes_with_zero()) }
}

/// Returns nanoseconds since an arbitrary moment, from the clock that every version of LinuxCNC exports.
pub fn nanoseconds() -> i64 {
    // SAFETY: takes nothing and reads a clock.
    unsafe { rtapi_get_time() }
}

/// The component while it is being built.
#[derive(Clone, Copy)]
pub struct Component(c_int);

impl Component {
    pub fn new(name: &CStr) -> Result<Self, HalError> {
        // SAFETY: the name ends with a zero; LinuxCNC copies it.
        checked(unsafe { hal_init(name.as_ptr()) }).map(Self)
    }

    pub fn ready(self) -> Result<(), HalError> {
        // SAFETY: the id came from hal_init.
        checked(unsafe { hal_ready(self.0) }).map(|_| ())
    }

    pub fn exit(self) {
        // SAFETY: the id came from hal_init. Nothing can be done about a failure.
        let _ = unsafe { hal_exit(self.0) };
    }

    /// Allocates zeroed HAL memory for one `T`, which lives as long as LinuxCNC.
    pub fn allocate<T>(self) -> Result<*mut T, HalError> {
        // SAFETY: plain request for memory; null is checked below.
        let memory = unsafe { hal_malloc(size_of::<T>() as c_long) }.cast::<T>();
        if memory.is_null() {
            return Err(HalError(-libc::ENOMEM));
        }
        // SAFETY: hal_malloc returned at least size_of::<T>() bytes, aligned to 8.
        unsafe { memory.cast::<u8>().write_bytes(0, size_of::<T>()) };
        Ok(memory)
    }

    pub fn export(
        self,
        name: &CStr,
        function: unsafe extern "C" fn(*mut c_void, c_long),
    ) -> Result<(), HalError> {
        // SAFETY: the name ends with a zero; the function takes a null argument.
        let code = unsafe {
            hal_export_funct(name.as_ptr(), function, core::ptr::null_mut(), 1, 0, self.0)
        };
        checked(code).map(|_| ())
    }
}

/// A value type that HAL supports: how a pin of it is created, read and written. `build.rs` chooses one of two
/// implementations.
pub trait PinValue: Copy {
    /// Creates a pin with its first value.
    ///
    /// # Safety
    /// The name must end with a zero; `pin` must point to HAL memory that outlives the component.
    unsafe fn create(
        name: *const c_char,
        direction: c_int,
        pin: *mut *mut Self,
        component: c_int,
        value: Self,
    ) -> c_int;

    /// # Safety
    /// `pin` must be the pointer that HAL has stored in a pin of this type.
    unsafe fn read(pin: *mut Self) -> Self;

    /// # Safety
    /// As [`PinValue::read`].
    unsafe fn write(pin: *mut Self, value: Self);
}

/// A HAL pin. LinuxCNC changes the pointer when the pin is netted. So the pointer
/// must be in HAL memory, and is read anew at each access.
#[repr(transparent)]
pub struct Pin<T>(UnsafeCell<*mut T>);

impl<T: PinValue> Pin<T> {
    /// Creates the pin with its first value.
    ///
    /// # Safety
    /// `self` must be in memory from [`Component::allocate`].
    pub unsafe fn create(
        &self,
        component: Component,
        direction: Direction,
        name: &Name,
        value: T,
    ) -> Result<(), HalError> {
        // SAFETY: the name ends with a zero; the caller guarantees the memory.
        checked(unsafe {
            T::create(
                name.as_bytes_with_zero().as_ptr().cast(),
                direction as c_int,
                self.0.get(),
                component.0,
                value,
            )
        })
        .map(|_| ())
    }

    /// Makes this pin, which HAL does not have, refer to the `n`-th value of a parameter block, counted from 1.
    pub fn refer_to(&mut self, n: usize) {
        *self.0.get_mut() = core::ptr::without_provenance_mut(n);
    }

    /// Returns the number of the value that this pin refers to, which HAL does not have; 0: none.
    pub fn referred(&self) -> usize {
        // SAFETY: written before any other reference to the pin existed.
        unsafe { *self.0.get() }.addr()
    }

    /// Makes this alias, which has no HAL pin, refer to another pin. Call it before each use,
    /// because HAL changes the pointer of a pin that is netted.
    pub fn share(&self, other: &Self) {
        // SAFETY: both are in HAL memory, and only the thread that calls this uses this one.
        unsafe { self.0.get().write_volatile(other.0.get().read_volatile()) }
    }

    pub fn get(&self) -> T {
        // SAFETY: HAL keeps the pointer valid from creation on; volatile because other
        // threads write it.
        unsafe { T::read(self.0.get().read_volatile()) }
    }

    pub fn set(&self, value: T) {
        // SAFETY: as in `get`.
        unsafe { T::write(self.0.get().read_volatile(), value) }
    }
}
