// SPDX-License-Identifier: GPL-2.0-or-later
//! [`fuzz::layouts`] for libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz::layouts::run(data));
