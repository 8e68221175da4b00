// SPDX-License-Identifier: GPL-2.0-or-later
//! Conditioning as the module's pin `conditioning` publishes it: at one pose,
//! and at the worst pose of a box.

use crate::proof::axis_box::AxisBox;
use crate::read::mechanism::Mechanism;
use kinematics::{Fault, Pose};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Poses from which a search for the worst continues, and steps of each.
const WORST: usize = 10;
const BETTERED: usize = 400;

/// Returns the conditioning at a pose without a tool.
///
/// # Errors
/// As [`kinematics::Machine::inverse`].
pub fn at(config: &Mechanism, pose: &[f64; 6]) -> Result<f64, Fault> {
    let at = config.machine.at(&Pose::from_degrees(*pose), &config.spindle)?;
    Ok(at.smallest_singular_value())
}

/// Searches for the worst pose of a box, starting from the worst of random samples: random steps of
/// decreasing size; the same numbers in every run. `value` returns `None` for poses that do not count.
pub fn worst(
    within: &AxisBox,
    mut drawn: Vec<(f64, [f64; 6])>,
    mut value: impl FnMut(&[f64; 6]) -> Option<f64>,
) -> Option<(f64, [f64; 6])> {
    let mut rng = Pcg64::seed_from_u64(0);
    drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
    drawn.truncate(WORST);
    for (least, place) in &mut drawn {
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
    drawn.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
}
