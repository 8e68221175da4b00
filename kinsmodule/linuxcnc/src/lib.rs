// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkmkins.so`: the crate `kinematics` behind LinuxCNC's kinematics interface.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`abi`], [`hal`] | what LinuxCNC calls; what this module calls |
//! | [`component`], [`load`], [`pins`] | load and unload; the load parameters; the HAL pins |
//! | [`control`], [`between`] | one mechanism or two behind one pose and one row of joints; how near two come to each other |
//! | [`module`] | the state between calls of a mechanism, and the rules that go with it |
//! | [`calls`], [`crossing`] | the commanded pose of a cycle; whether the commanded motion has passed a singular pose |
//! | [`start`], [`tool`], [`guard`] | the start without a seed; the change of the tool offset; the feed that the motion ahead allows |
//!
//! All unsafe code that runs on a machine is here; each block names who guarantees what it needs.
//!
//! LinuxCNC calls `rtapi_app_main` and `rtapi_app_exit` with no servo thread running,
//! and everything else from that one thread.
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
mod pins;
mod start;
mod tool;

unsafe extern "C" {
    /// Nobody defines it: a module with a panic path that can be reached does not load.
    fn pkmkins_has_a_panic_path() -> !;
}

/// The language asks for one. No call to it is left in the built module, which `cargo xtask prove`
/// checks and every load proves again. (Clippy sees the module beside the host's programs, whose std has one.)
#[cfg_attr(not(clippy), panic_handler)]
#[cfg_attr(clippy, expect(dead_code))]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { pkmkins_has_a_panic_path() }
}
