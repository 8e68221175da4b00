// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkmkins.so`: the crate `kinematics` behind LinuxCNC's kinematics interface.
//!
//! Rooms: [`abi`] is what LinuxCNC calls, [`hal`] what this module calls, [`load`] the
//! load parameters, [`pins`] the HAL pins, [`module`] the state between calls, [`tool`] how
//! the tool offset follows its request. All unsafe code of the project is here; each block
//! names who guarantees what it needs.
//!
//! LinuxCNC calls `rtapi_app_main` and `rtapi_app_exit` with no servo thread running,
//! and everything else from that one thread.
#![no_std]

pub mod abi;
mod hal;
mod load;
mod module;
mod pins;
mod tool;

/// The core has no panic path; if one were ever reached, stopping the control is
/// safer than going on with an unknown state.
#[cfg(not(test))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: abort takes no argument and never returns.
    unsafe { libc::abort() }
}
