// SPDX-License-Identifier: GPL-2.0-or-later
//! [`fuzz::entry_points`] for libFuzzer.
#![no_main]

/// Ends the run. The module calls it if it panics: LinuxCNC does not define it, so that a module with a
/// panic path would not load. Under the sanitizer the compiler cannot prove that there is none, and
/// the fuzzer searches for panics.
#[unsafe(no_mangle)]
pub extern "C" fn pkmkins_has_a_panic_path() -> ! {
    std::process::abort()
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz::entry_points::run(data));
