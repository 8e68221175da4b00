// SPDX-License-Identifier: GPL-2.0-or-later
//! How well the legs hold the platform, as the module's pin `conditioning` shows it: at one pose,
//! and at the worst of a box of poses.

use crate::proof::axis_box::AxisBox;
use crate::proof::cell::Reach;
use crate::read::machine::MachineConfig;
use kinematics::{Fault, Pose};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Poses drawn in the search for the worst, and how often each of the best ten is bettered.
const DRAWN: usize = 20_000;
const BETTERED: usize = 400;

/// The value at a pose without a tool.
///
/// # Errors
/// As [`kinematics::Machine::inverse`].
pub fn at(config: &MachineConfig, pose: &[f64; 6]) -> Result<f64, Fault> {
    config.machine.conditioning(&Pose::from_degrees(*pose), &config.spindle)
}

/// What a search through a box of poses has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    /// Smallest conditioning found.
    pub value: f64,
    /// Where.
    pub pose: [f64; 6],
    /// Share of the poses drawn that the machine can take.
    pub taken: f64,
}

/// Searches for the worst pose that the machine can take: a random search, bettered from the
/// ten worst places; the same numbers in every run.
pub fn worst(config: &MachineConfig, reach: &Reach, within: &AxisBox) -> Option<Worst> {
    let mut rng = Pcg64::seed_from_u64(0);
    let value = |pose: &[f64; 6]| reach.check(pose).ok().and_then(|()| at(config, pose).ok());
    let mut found: Vec<(f64, [f64; 6])> = (0..DRAWN)
        .map(|_| within.at(std::array::from_fn(|_| rng.random())))
        .filter_map(|pose| value(&pose).map(|value| (value, pose)))
        .collect();
    let taken = found.len() as f64 / DRAWN as f64;
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(10);
    for (least, place) in &mut found {
        let mut reach = 0.1;
        for _ in 0..BETTERED {
            let step = |k: usize| (within.high[k] - within.low[k]) * reach;
            let near: [f64; 6] = std::array::from_fn(|k| {
                let moved = place[k] + step(k) * (2.0 * rng.random::<f64>() - 1.0);
                moved.clamp(within.low[k], within.high[k])
            });
            match value(&near).filter(|value| value < least) {
                Some(value) => (*least, *place) = (value, near),
                None => reach = f64::max(reach * 0.98, 1e-4),
            }
        }
    }
    let (value, pose) = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Worst { value, pose, taken })
}
