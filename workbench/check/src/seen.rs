// SPDX-License-Identifier: GPL-2.0-or-later
//! Poses sampled within the axis limits, and their evaluation.

use kinematics::{Fault, Limit, Limits, Margin, Nearest};
use machine::limits;
use machine::proof::axis_box::AxisBox;
use machine::proof::conditioning;
use machine::proof::reach::Reach;
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::collections::BTreeMap;

/// Number of poses sampled within the axis limits.
pub(super) const DRAWN: usize = 20_000;

/// Evaluation of poses sampled within the axis limits.
pub(super) struct Seen {
    /// Smallest and largest value of every joint, also of poses beyond limits.
    pub(super) joints: Vec<(f64, f64)>,
    /// Number of legal poses.
    pub(super) taken: usize,
    /// Number of poses that each limit refuses first.
    pub(super) refused: BTreeMap<Limit, usize>,
    /// The worst conditioning of a pose that satisfies all other limits.
    pub(super) worst: Option<(f64, [f64; 6])>,
    /// The nearest legs among legal poses, or among those in which nothing else keeps the legs
    /// apart.
    pub(super) nearest: Option<(Nearest, [f64; 6])>,
}

impl Seen {
    pub(super) fn of(config: &Mechanism, reach: &Reach, within: &AxisBox) -> Self {
        let mut rng = Pcg64::seed_from_u64(1);
        let joints = vec![(f64::INFINITY, f64::NEG_INFINITY); config.joints.len()];
        let mut seen =
            Self { joints, taken: 0, refused: BTreeMap::new(), worst: None, nearest: None };
        let of_legs = Limits { conditioning: 0.0, ..limits::beyond_axes(config) };
        let (mut drawn, mut at) = (vec![], reach.nowhere());
        for _ in 0..DRAWN {
            let drawn_pose = drawn_pose(config, within, &mut rng);
            let moved = drawn_pose.and_then(|pose| reach.move_to(&mut at, &pose).map(|()| pose));
            let pose = match moved {
                Ok(pose) => pose,
                Err(fault) => {
                    *seen.refused.entry(Margin::of_fault(&fault).limit).or_default() += 1;
                    continue;
                }
            };
            for (range, value) in seen.joints.iter_mut().zip(at.joints()) {
                *range = (range.0.min(*value), range.1.max(*value));
            }
            let kept = at.check(&of_legs);
            if let Err(margin) = &kept {
                *seen.refused.entry(margin.limit).or_default() += 1;
            }
            match kept {
                Ok(()) => {
                    let value = at.smallest_singular_value();
                    drawn.push((value, pose));
                    match value >= config.conditioning_limit {
                        true => seen.taken += 1,
                        false => *seen.refused.entry(Limit::Conditioning).or_default() += 1,
                    }
                    seen.add_nearest(at.nearest(), &pose);
                }
                Err(margin) if margin.limit == Limit::Clearance && config.clearance.is_none() => {
                    seen.add_nearest(at.nearest(), &pose);
                }
                Err(_) => {}
            }
        }
        if !config.chain.is_empty() {
            // Poses between the samples need not occur in a program.
            let least = drawn.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
            return Self { worst: least, ..seen };
        }
        seen.worst = conditioning::worst(within, drawn, |pose| {
            reach.move_to(&mut at, pose).ok()?;
            at.check(&of_legs).ok()?;
            Some(at.smallest_singular_value())
        });
        seen
    }

    fn add_nearest(&mut self, nearest: Option<Nearest>, pose: &[f64; 6]) {
        let Some(nearest) = nearest else { return };
        if self.nearest.is_none_or(|(least, _)| nearest.distance < least.distance) {
            self.nearest = Some((nearest, *pose));
        }
    }
}

/// Returns a random pose of the machine within the limits of the axes, and of those that carry something.
fn drawn_pose(config: &Mechanism, within: &AxisBox, rng: &mut Pcg64) -> Result<[f64; 6], Fault> {
    if config.chain.is_empty() {
        return Ok(within.at(std::array::from_fn(|_| rng.random())));
    }
    let mut between = |low: f64, high: f64| low + rng.random::<f64>() * (high - low);
    let pose = std::array::from_fn(|k| {
        let axis = &config.programmed[k];
        match axis.min.is_finite() && axis.max.is_finite() {
            true => between(axis.min, axis.max),
            false => config.start[k],
        }
    });
    let extra = std::array::from_fn(|n| {
        config.extra.get(n).map_or(0.0, |axis| {
            between(axis.joint.min.max(axis.axis.min), axis.joint.max.min(axis.axis.max))
        })
    });
    config.carried(&pose, &extra, &config.spindle)
}

/// Samples the share of legal poses in a box.
pub(super) fn taken(config: &Mechanism, reach: &Reach, within: &AxisBox) -> f64 {
    let mut rng = Pcg64::seed_from_u64(2);
    let mut is_legal =
        || drawn_pose(config, within, &mut rng).is_ok_and(|p| reach.check(&p).is_ok());
    let inside = (0..DRAWN).filter(|_| is_legal()).count();
    inside as f64 / DRAWN as f64
}
