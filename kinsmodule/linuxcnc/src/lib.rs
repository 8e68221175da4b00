// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkmkins.so`: the crate `kinematics` behind LinuxCNC's kinematics interface.
//!
//! Rooms: [`abi`] is what LinuxCNC calls, [`hal`] what this module calls, [`load`] the
//! load parameters, [`pins`] the HAL pins, [`module`] the state between calls, [`calls`] which of them
//! a servo cycle has brought, [`crossing`] whether the commanded motion has passed a singular pose, [`tool`] how the tool offset follows its request, [`guard`] the watch
//! over the motion. All unsafe code of the project is here; each block names who guarantees what it needs.
//!
//! LinuxCNC calls `rtapi_app_main` and `rtapi_app_exit` with no servo thread running,
//! and everything else from that one thread.
#![no_std]

pub mod abi;
mod calls;
mod crossing;
mod guard;
mod hal;
mod load;
mod module;
mod pins;
mod start;
mod tool;

unsafe extern "C" {
    /// Nobody defines it: a module with a panic path that can be reached does not load.
    fn pkmkins_has_a_panic_path() -> !;
}

/// The language asks for one. No call to it is left in the built module, which `make prove`
/// checks and every load proves again.
#[cfg(not(test))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { pkmkins_has_a_panic_path() }
}
