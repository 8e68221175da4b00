// SPDX-License-Identifier: GPL-2.0-or-later
//! Commanded state of the drives: base anchors of the legs, and their lengths without force.

use kinematics::{At, Fault, MAX_LEGS, Pose, Vector3};
use machine::read::mechanism::Mechanism;

/// One leg, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive {
    /// The moving base anchor in the machine frame.
    pub base: Vector3<f64>,
    /// Length without force; including the nut correction if the leg has a lead.
    pub length: f64,
}

/// All drives, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drives {
    /// State of the legs; entries beyond the last leg are undefined.
    pub legs: [Drive; MAX_LEGS],
    /// Joint values of the table axes X Y Z; 0 for axes that the table does not have.
    pub table: Vector3<f64>,
    /// The tool tip in the work, as commanded.
    pub tip: Vector3<f64>,
}

impl Drives {
    /// Computes the state that positions the tip at a pose, in machine units with the tool vector of the machine,
    /// see [`kinematics::Machine::inverse`]. `is_turning`: whether the struts' lengths are those of their
    /// joints, including the correction.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn at(
        config: &Mechanism,
        at: &mut At,
        pose: &Pose,
        tool: &Vector3<f64>,
        is_turning: bool,
    ) -> Result<Self, Fault> {
        at.move_to(pose, tool)?;
        let per_mm = config.units_per_mm;
        let corrections = at.corrections();
        let mut legs = [Drive::default(); MAX_LEGS];
        for ((leg, segment), correction) in legs.iter_mut().zip(at.segments()).zip(corrections) {
            let correction = if is_turning { correction } else { 0.0 };
            leg.base = segment.base / per_mm;
            leg.length = (segment.span().norm() + correction) / per_mm;
        }
        let mut table = Vector3::zeros();
        for (k, letter) in config.machine.layout().table().as_slice().iter().enumerate() {
            table[letter.index()] = at.joints()[config.legs() + k] / per_mm;
        }
        Ok(Self { legs, table, tip: (pose.position - tool) / per_mm })
    }

    /// Computes a weighted sum of drive states.
    fn sum(parts: [(&Self, f64); 4]) -> Self {
        let mut sum = Self::default();
        for (part, share) in parts {
            for (to, from) in sum.legs.iter_mut().zip(&part.legs) {
                to.base += from.base * share;
                to.length += from.length * share;
            }
            sum.table += part.table * share;
            sum.tip += part.tip * share;
        }
        sum
    }

    /// Interpolates between the middle two of four moments that are `period` seconds apart, with the rates:
    /// a cubic whose slopes at both ends are those of the chords of its neighbors.
    pub fn between(moments: [&Self; 4], share: f64, period: f64) -> [Self; 2] {
        let (s, s2, s3) = (share, share * share, share.powi(3));
        let place = [
            (-s3 + 2.0 * s2 - s) / 2.0,
            (3.0 * s3 - 5.0 * s2 + 2.0) / 2.0,
            (-3.0 * s3 + 4.0 * s2 + s) / 2.0,
            (s3 - s2) / 2.0,
        ];
        let rate = [
            (-3.0 * s2 + 4.0 * s - 1.0) / 2.0,
            (9.0 * s2 - 10.0 * s) / 2.0,
            (-9.0 * s2 + 8.0 * s + 1.0) / 2.0,
            (3.0 * s2 - 2.0 * s) / 2.0,
        ];
        let [a, b, c, d] = moments;
        let of = |w: [f64; 4], by: f64| {
            Self::sum([(a, w[0] * by), (b, w[1] * by), (c, w[2] * by), (d, w[3] * by)])
        };
        [of(place, 1.0), of(rate, 1.0 / period)]
    }
}
