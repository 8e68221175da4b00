// SPDX-License-Identifier: GPL-2.0-or-later
//! The space that a machine occupies.

use crate::read::mechanism::Mechanism;
use kinematics::{At, LegGeometry, Vector3};

/// Returns the ends of the travel of the carriage that a leg stands on, in base; `None` for other kinds of legs.
/// An end is infinite if the joint has no limit there.
pub fn rail(config: &Mechanism, leg: usize) -> Option<[Vector3<f64>; 2]> {
    let LegGeometry { base, kind, .. } = config.geometry.legs()[leg];
    let direction = Vector3::from(kind.guide()?).normalize();
    let ends = [config.joints[leg].min, config.joints[leg].max];
    Some(ends.map(|value| Vector3::from(base) + direction * (value + config.offsets[leg])))
}

/// Returns the least and the largest X, Y and Z of a machine at a pose, in base: the control point, both ends of every
/// leg, the whole travel of carriages and the pivots of arms. Bodies about these points are not counted.
pub fn space(config: &Mechanism, at: &At) -> [Vector3<f64>; 2] {
    let legs = at.segments()[..config.legs()].iter().enumerate().flat_map(|(i, leg)| {
        let fixed = match rail(config, i) {
            Some(ends) if ends.iter().flatten().all(|x| x.is_finite()) => ends,
            Some(_) => [leg.base; 2],
            None => [Vector3::from(config.geometry.legs()[i].base); 2],
        };
        [leg.base, leg.platform].into_iter().chain(fixed)
    });
    legs.fold([at.full_pose().position; 2], |[low, high], point| {
        [low.inf(&point), high.sup(&point)]
    })
}
