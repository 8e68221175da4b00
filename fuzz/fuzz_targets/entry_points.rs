// SPDX-License-Identifier: GPL-2.0-or-later
//! [`fuzz::entry_points`] for libFuzzer.
#![no_main]

/// What the module calls where it panics: nothing defines it in LinuxCNC, so that a module with a
/// panic path would not load. Under the sanitizer the compiler cannot show that there is none, and
/// a panic is what is looked for.
#[unsafe(no_mangle)]
pub extern "C" fn pkmkins_has_a_panic_path() -> ! {
    std::process::abort()
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz::entry_points::run(data));
