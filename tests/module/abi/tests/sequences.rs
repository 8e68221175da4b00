// SPDX-License-Identifier: GPL-2.0-or-later
//! Sequences of calls: for any behavior of LinuxCNC, forward returns the machine's pose, and refuses
//! only what the available data do not determine.

use abi_tests::random::{Random, cases};
use abi_tests::sequences::judge::{REFUSED, WRONG_POSE};
use abi_tests::sequences::run::Run;
use abi_tests::sequences::setups::{Setup, drop_ins, random_machine, shipped};
use std::collections::BTreeMap;

const CYCLES: usize = 2_000;

/// Number of failures that are printed completely.
const SHOWN: usize = 4;

#[derive(Default)]
struct Total {
    sequences: usize,
    cycles: usize,
    failed: usize,
    failures: Vec<String>,
    counts: BTreeMap<String, usize>,
    excused: usize,
}

impl Total {
    fn add(&mut self, setup: &Setup, seed: u64) {
        let outcome = Run::of(setup, seed, CYCLES);
        self.sequences += 1;
        self.cycles += outcome.cycles;
        self.failed += usize::from(!outcome.failures.is_empty());
        self.failures.extend(outcome.failures);
        self.excused += outcome.excused;
        for (what, count) in outcome.counts {
            *self.counts.entry(what).or_default() += count;
        }
    }

    /// Checks that nothing failed, and that a refusal or the other pose near a singular one was excused in at
    /// most this share of the cycles, plus one sequence: a machine that jams at a singular pose stays there
    /// until it is moved.
    fn end(self, what: &str, most_excused: f64) {
        let share = self.excused as f64 / self.cycles as f64;
        println!("{what}: {:.2} % excused", 100.0 * share);
        println!(
            "{what}: {} sequences, {} cycles, {} failed",
            self.sequences,
            self.cycles,
            self.failures.len()
        );
        for (what, count) in &self.counts {
            println!("    {count:8} {what}");
        }
        let wrong = self.failures.iter().filter(|f| f.contains(WRONG_POSE)).count();
        let refused = self.failures.iter().filter(|f| f.contains(REFUSED)).count();
        // The rarer kind first.
        let (refusals, others): (Vec<_>, Vec<_>) =
            self.failures.iter().partition(|failure| failure.contains(REFUSED));
        for failure in others.iter().take(SHOWN).chain(refusals.iter().take(SHOWN)) {
            println!("{failure}\n");
        }
        assert!(
            self.failures.is_empty(),
            "{what}: {} of {} sequences failed: {wrong} gave another pose, {refused} refused without need",
            self.failed,
            self.sequences
        );
        let most = most_excused * self.cycles as f64 + CYCLES as f64;
        assert!(
            self.excused as f64 <= most,
            "{what}: {} of {} cycles excused",
            self.excused,
            self.cycles
        );
    }
}

/// Runs sequences of machines in turn.
fn run_all(what: &str, setups: &[Setup], cycles: usize, seed: u64, most_excused: f64) {
    let mut total = Total::default();
    for n in chosen(cycles, seed) {
        total.add(&setups[n % setups.len()], seed + n as u64);
    }
    total.end(what, most_excused);
}

/// Returns the sequences of a test, or the one whose seed PKMKINS_SEQUENCE names.
fn chosen(cycles: usize, seed: u64) -> Vec<usize> {
    match std::env::var("PKMKINS_SEQUENCE") {
        Ok(text) => {
            let asked: u64 = text.parse().expect("PKMKINS_SEQUENCE is the seed of a sequence");
            asked
                .checked_sub(seed)
                .filter(|n| *n < 1_000_000)
                .map(|n| n as usize)
                .into_iter()
                .collect()
        }
        Err(_) => (0..cases(cycles / CYCLES)).collect(),
    }
}

#[test]
fn shipped_machines_answer_with_the_machines_pose_in_every_sequence() {
    run_all("shipped", &shipped(), 400_000, 510_000_000, 0.010);
}

#[test]
fn drop_ins_answer_with_the_machines_pose_in_every_sequence() {
    run_all("drop-ins", &drop_ins(), 300_000, 511_000_000, 0.022);
}

#[test]
fn random_machines_answer_with_the_machines_pose_in_every_sequence() {
    let mut total = Total::default();
    for n in chosen(300_000, 512_000_000) {
        let seed = 512_000_000 + n as u64;
        let setup = random_machine(&mut Random::new(seed), n % 3 == 2);
        total.add(&setup, seed);
    }
    total.end("random", 0.025);
}
