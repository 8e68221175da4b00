// SPDX-License-Identifier: GPL-2.0-or-later
//! Order of the legs around the base and around the platform: this shows anchors that belong to another
//! leg.

use crate::findings::Report;
use crate::wiring::at_key;
use kinematics::{At, Vector3};
use machine::read::diagnostic::Severity;
use machine::read::mechanism::Mechanism;

/// Distance of a joint from the center, as a share of the farthest one's, below which it has no direction; and
/// the least width of a ring of joints relative to its length: guides in a line have no order around anything.
const NARROW: f64 = 0.2;

/// Rise of a guide, as a share of its length, below which it counts as horizontal: 30 degrees.
const LEVEL: f64 = 0.5;

/// Tolerance for equal directions, degrees: two joints close together.
const SAME_DEG: f64 = 1e-6;

/// Reports the order of the legs seen from above.
pub(super) fn check(report: &mut Report, config: &Mechanism, at: &At) {
    let segments = &at.segments()[..config.legs()];
    let bases: Vec<_> = segments.iter().map(|leg| leg.base).collect();
    let platform: Vec<_> = segments.iter().map(|leg| leg.platform).collect();
    let Some(around) = around(&bases).filter(|_| !has_level_guides(config)) else {
        let text = "not judged: seen from above, the base joints surround no point; make sure that [LEG_0] is the \
                    leg that joint 0 drives, and so on";
        return report.fact("order of legs", text);
    };
    let order = sorted(&around);
    let names: Vec<String> =
        order.iter().map(|leg| (config.place.first_leg + leg).to_string()).collect();
    let text = format!(
        "{}, counter-clockwise seen from above, leg {} at {:.1} degrees from X: number joints and drives in the \
         same order",
        names.join(" "),
        names[0],
        around[order[0]]
    );
    report.fact("order of legs", text);
    let Some(of_platform) = self::around(&platform) else { return };
    if let Some([i, j]) = turned(&around, &of_platform) {
        let section = config.place.leg_section(j);
        let [i, j] = [i, j].map(|leg| config.place.first_leg + leg);
        let text = format!(
            "legs {i} and {j} follow each other around the base, and the other way around the platform: check \
             for swapped PLATFORM of two legs, unless the legs cross by design"
        );
        let key =
            if config.ini.first(&section, "PLATFORM").is_some() { "PLATFORM" } else { "BASE" };
        report.finding(Severity::Warning, at_key(&config.ini, &section, key, &text));
    }
}

/// Returns whether carriages run horizontally; then they are next to and behind each other, not around anything.
fn has_level_guides(config: &Mechanism) -> bool {
    let is_level = |guide: [f64; 3]| guide[2].abs() < LEVEL * Vector3::from(guide).norm();
    config.geometry.legs().iter().filter_map(|leg| leg.kind.guide()).any(is_level)
}

/// Returns the directions of points around a center, seen from above, degrees from 0 to 360.
fn around(points: &[Vector3<f64>]) -> Option<Vec<f64>> {
    let middle = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let arms: Vec<_> = points.iter().map(|point| (point - middle).xy()).collect();
    let farthest = arms.iter().map(|arm| arm.norm()).fold(0.0, f64::max);
    let is_around = points.len() > 2
        && farthest > 0.0
        && arms.iter().all(|arm| arm.norm() > NARROW * farthest)
        && widest_gap(&arms) < 180.0;
    is_around.then(|| arms.iter().map(|arm| direction(arm.x, arm.y)).collect())
}

fn direction(x: f64, y: f64) -> f64 {
    y.atan2(x).to_degrees().rem_euclid(360.0)
}

fn widest_gap(arms: &[nalgebra::Vector2<f64>]) -> f64 {
    let mut all: Vec<f64> = arms.iter().map(|arm| direction(arm.x, arm.y)).collect();
    all.sort_by(f64::total_cmp);
    let last = all[0] + 360.0 - all[all.len() - 1];
    all.windows(2).map(|pair| pair[1] - pair[0]).fold(last, f64::max)
}

/// Returns the legs in the order of their directions, starting with leg 0.
fn sorted(around: &[f64]) -> Vec<usize> {
    let from_first = |leg: usize| (around[leg] - around[0]).rem_euclid(360.0);
    let mut order: Vec<usize> = (0..around.len()).collect();
    order.sort_by(|a, b| from_first(*a).total_cmp(&from_first(*b)));
    order
}

/// Returns two legs that are neighbors around the base, and in the opposite order around the platform.
fn turned(base: &[f64], platform: &[f64]) -> Option<[usize; 2]> {
    let order = sorted(base);
    let steps = (0..order.len()).map(|k| {
        let pair = [order[k], order[(k + 1) % order.len()]];
        let step =
            |around: &[f64]| (around[pair[1]] - around[pair[0]] + 180.0).rem_euclid(360.0) - 180.0;
        (pair, step(base), step(platform))
    });
    steps
        .filter(|(_, base, platform)| base.abs() > SAME_DEG && platform.abs() > SAME_DEG)
        .find(|(_, base, platform)| base.signum() != platform.signum())
        .map(|(pair, ..)| pair)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swap_is_found_and_pairs_in_one_place_are_none() {
        let base = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0];
        assert_eq!(turned(&base, &[30.0, 30.0, 150.0, 150.0, 270.0, 270.0]), None);
        assert_eq!(turned(&base, &[350.0, 50.0, 110.0, 170.0, 230.0, 290.0]), None);
        assert_eq!(turned(&base, &[50.0, 350.0, 110.0, 170.0, 230.0, 290.0]), Some([0, 1]));
    }

    #[test]
    fn points_in_a_line_are_around_nothing() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        assert_eq!(around(&[at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0)]), None);
        let square = around(&[at(1.0, 1.0), at(-1.0, 1.0), at(-1.0, -1.0), at(1.0, -1.0)]);
        assert_eq!(square.unwrap(), [45.0, 135.0, 225.0, 315.0]);
    }
}
