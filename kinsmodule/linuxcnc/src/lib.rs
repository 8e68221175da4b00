// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkmkins.so`: the crate `kinematics` behind LinuxCNC's kinematics interface.
//!
//! | file | contents |
//! | --- | --- |
//! | [`abi`], [`hal`] | the functions that LinuxCNC calls; those that this module calls |
//! | [`component`], [`load`], [`pins`] | load and unload; the load parameters; the HAL pins |
//! | [`control`], [`between`] | one mechanism or two behind one pose and one row of joints; the distance between two |
//! | [`module`] | the state of a mechanism between calls, and its rules |
//! | [`calls`], [`crossing`] | the commanded pose of a cycle; whether the commanded motion has passed a singular pose |
//! | [`start`], [`tool`], [`guard`] | the start without a seed; the change of the tool offset; the feed scale |
//! | [`orient`] | the inverse of the tool frame |
//! | [`outside`] | the kinematics as functions of a parameter block, for callers outside real time |
//!
//! All unsafe code that runs on a machine is here; each block names who guarantees its preconditions.
//!
//! LinuxCNC calls `rtapi_app_main` and `rtapi_app_exit` with no servo thread running,
//! and everything else from that one thread. What [`outside`] has is called in other processes.
#![no_std]

pub mod abi;
mod between;
mod calls;
mod component;
mod control;
mod crossing;
mod guard;
mod hal;
mod jog;
mod load;
mod module;
mod orient;
mod outside;
mod pins;
mod start;
mod tool;

unsafe extern "C" {
    /// Undefined symbol: a module with a reachable panic path fails to load.
    fn pkmkins_has_a_panic_path() -> !;
}

/// Required by the language. No call to it remains in the built module, which `cargo xtask prove`
/// checks and every load proves again. (Clippy sees the module beside the host's programs, whose std has one.)
#[cfg_attr(not(clippy), panic_handler)]
#[cfg_attr(clippy, expect(dead_code))]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { pkmkins_has_a_panic_path() }
}
