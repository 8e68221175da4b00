// SPDX-License-Identifier: GPL-2.0-or-later
//! The targets without libFuzzer: the kept inputs, and random changes of them, without guidance. They need no
//! additional build. `cargo xtask fuzz` reports crashes and endless loops with their input.

use crate::common::cases;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Longest input, the same as for libFuzzer in `run.sh`.
const LONGEST: usize = 600;

/// Returns the corpus of a target, sorted by name.
fn kept(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    let files = fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{} is empty", folder.display());
    files.iter().map(|file| fs::read(file).unwrap()).collect()
}

/// Returns one of them with up to eight changes.
fn changed(rng: &mut Pcg64, kept: &[Vec<u8>]) -> Vec<u8> {
    let mut input = kept[rng.random_range(0..kept.len())].clone();
    for _ in 0..rng.random_range(1..=8) {
        let place = rng.random_range(0..=input.len());
        let end = (place + rng.random_range(1..=9)).min(input.len());
        let fresh: Vec<u8> = (place..end.max(place + 1)).map(|_| rng.random()).collect();
        match rng.random_range(0..4) {
            0 | 1 => drop(input.splice(place..end, fresh)),
            2 => drop(input.splice(place..place, fresh)),
            _ => {
                let other = &kept[rng.random_range(0..kept.len())];
                let from = rng.random_range(0..=other.len());
                input.truncate(place);
                input.extend(&other[from..]);
            }
        }
    }
    input.truncate(LONGEST);
    input
}

/// Runs a target; reports the bytes of an input that panics.
fn survives(target: &str, run: fn(&[u8]), count: usize) {
    let kept = kept(target);
    let mut rng = Pcg64::seed_from_u64(1);
    let drawn = (0..cases(count)).map(|_| changed(&mut rng, &kept));
    for input in kept.iter().cloned().chain(drawn) {
        let outcome = catch_unwind(AssertUnwindSafe(|| run(&input)));
        assert!(outcome.is_ok(), "{target} does not survive {input:?}");
    }
}

#[test]
fn the_core_survives() {
    survives("core", crate::core::run, 100_000);
}

#[test]
fn layouts_survive() {
    survives("layouts", crate::layouts::run, 100_000);
}

#[test]
fn the_entry_points_survive() {
    survives("entry_points", crate::entry_points::run, 25_000);
}
