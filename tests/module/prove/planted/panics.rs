// SPDX-License-Identifier: GPL-2.0-or-later
//! The same contract as clean.c beside it; with `--cfg planted`, an index that may panic.
//! With `--cfg wide`, `--cfg aligned` its frame has 1000 values, aligned to 64.
#![no_std]

use core::mem::MaybeUninit;

unsafe extern "C" {
    fn print(text: *const u8);
    fn make_pin(name: *const u8);
    fn pkmkins_has_a_panic_path() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked if nothing panics.
    unsafe { pkmkins_has_a_panic_path() }
}

#[cfg_attr(aligned, repr(align(64)))]
struct Frame([f64; 1000]);

#[unsafe(no_mangle)]
pub extern "C" fn run(x: f64) -> f64 {
    // SAFETY: a text that ends with zero.
    unsafe { print(c"run".as_ptr().cast()) };
    if cfg!(wide) {
        core::hint::black_box(&MaybeUninit::<Frame>::uninit());
    }
    let values = [x, x + 1.0, x + 2.0];
    if cfg!(planted) { values[x as usize] } else { values.get(x as usize).copied().unwrap_or(x) }
}

#[unsafe(no_mangle)]
pub extern "C" fn start() -> i32 {
    // SAFETY: a text that ends with zero.
    unsafe { make_pin(c"early".as_ptr().cast()) };
    0
}
