// SPDX-License-Identifier: GPL-2.0-or-later
//! The center line of a leg, and the distance between two of them.

use nalgebra::Vector3;

/// Squared sine of the angle below which two lines count as parallel: treating an end as the
/// nearest point then causes an error below its root, a ten thousandth of a leg.
const PARALLEL: f64 = 1e-8;

/// One leg at a pose, in base, machine units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Base anchor, as moved by carriage or arm.
    pub base: Vector3<f64>,
    /// Platform anchor.
    pub platform: Vector3<f64>,
}

impl Segment {
    /// Returns the vector from base to platform.
    pub fn span(&self) -> Vector3<f64> {
        self.platform - self.base
    }

    /// Computes the smallest distance to another segment.
    pub fn distance(&self, other: &Self) -> f64 {
        self.gap(other).norm()
    }

    /// Computes the shortest vector from another segment to this one.
    ///
    /// Between the lines' nearest points if both are within the segments, otherwise the shortest one at
    /// the four ends.
    pub fn gap(&self, other: &Self) -> Vector3<f64> {
        let (d, e) = (self.platform - self.base, other.platform - other.base);
        let across = self.base - other.base;
        let (dd, de, ee) = (d.dot(&d), d.dot(&e), e.dot(&e));
        let determinant = dd * ee - de * de;
        let s = (de * e.dot(&across) - ee * d.dot(&across)) / determinant;
        let t = (dd * e.dot(&across) - de * d.dot(&across)) / determinant;
        let inside = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
        // (Nearly) parallel lines are equally near everywhere: an end is as good.
        if inside && determinant > PARALLEL * dd * ee {
            return across + d * s - e * t;
        }
        let mut gap = other.gap_to(&self.base);
        for next in
            [other.gap_to(&self.platform), -self.gap_to(&other.base), -self.gap_to(&other.platform)]
        {
            if !(next.norm_squared() >= gap.norm_squared()) {
                gap = next;
            }
        }
        gap
    }

    /// Computes the shortest vector from this segment to a point.
    fn gap_to(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let along = self.platform - self.base;
        let share = along.dot(&(point - self.base)) / along.norm_squared().max(f64::MIN_POSITIVE);
        point - (self.base + along * share.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Finds the distance in small steps along both segments.
    fn by_search(one: &Segment, other: &Segment) -> f64 {
        let at = |s: &Segment, k: u32| s.base + (s.platform - s.base) * (f64::from(k) / 400.0);
        let mut least = f64::INFINITY;
        for j in 0..=400 {
            for k in 0..=400 {
                least = least.min((at(one, j) - at(other, k)).norm());
            }
        }
        least
    }

    #[test]
    fn the_distance_of_segments_is_that_of_a_search_along_both() {
        let number = |k: usize| libm::sin((k * k + 3) as f64);
        for case in 0..60 {
            let point = |k: usize| Vector3::from_fn(|axis, _| number(12 * case + 3 * k + axis));
            let one = Segment { base: point(0), platform: point(1) };
            let other = Segment { base: point(2), platform: point(3) };
            let (found, expected) = (one.distance(&other), by_search(&one, &other));
            // The search only visits points that are 1/400 of at most 3.5 apart.
            assert!(found <= expected + 1e-12 && found > expected - 0.01, "{found} {expected}");
            assert!((found - other.distance(&one)).abs() < 1e-12);
            // No end of either segment is behind the plane through the other's nearest point.
            let gap = one.gap(&other);
            let least = gap.dot(&one.base).min(gap.dot(&one.platform));
            let most = gap.dot(&other.base).max(gap.dot(&other.platform));
            assert!((least - most - found * found).abs() < 1e-12, "{least} {most} {found}");
        }
        let x = Vector3::x();
        let one = Segment { base: x * 0.0, platform: x };
        let parallel = Segment { base: x * 0.5 + Vector3::y(), platform: x * 3.0 + Vector3::y() };
        assert_eq!(one.distance(&parallel), 1.0);
        let ahead = Segment { base: x * 3.0, platform: x * 5.0 };
        assert_eq!(one.distance(&ahead), 2.0);
    }

    fn segment(base: [f64; 3], platform: [f64; 3]) -> Segment {
        Segment { base: base.into(), platform: platform.into() }
    }

    #[test]
    fn gaps_are_the_vectors_between_the_nearest_points_at_numbers_by_hand() {
        let along_x = segment([-1.0, 0.0, 0.0], [3.0, 0.0, 0.0]);
        for (other, gap) in [
            // Lines that cross within both segments, perpendicular, 3 and 4 from the ends.
            (segment([2.0, -5.0, 2.0], [2.0, 1.0, 2.0]), [0.0, 0.0, -2.0]),
            (segment([-2.0, -4.0, -7.0], [4.0, 4.0, -7.0]), [0.0, 0.0, 7.0]),
            // An end beside the middle of the other segment.
            (segment([1.0, 2.0, 0.0], [4.0, 6.0, 0.0]), [0.0, -2.0, 0.0]),
            (segment([0.5, -8.0, 1.0], [0.5, -3.0, 1.0]), [0.0, 3.0, -1.0]),
            // Two ends, offset by 3 and 4, on either side.
            (segment([6.0, 4.0, 0.0], [9.0, 9.0, 5.0]), [-3.0, -4.0, 0.0]),
            (segment([-9.0, 9.0, 5.0], [-4.0, 4.0, 0.0]), [3.0, -4.0, 0.0]),
            // Parallel: beside each other, and one after the other.
            (segment([-5.0, 1.0, 2.0], [7.0, 1.0, 2.0]), [0.0, -1.0, -2.0]),
            (segment([8.0, 0.0, 0.0], [5.0, 0.0, 0.0]), [-2.0, 0.0, 0.0]),
            // A point.
            (segment([2.0, 3.0, 4.0], [2.0, 3.0, 4.0]), [0.0, -3.0, -4.0]),
        ] {
            let turned = |leg: &Segment| Segment { base: leg.platform, platform: leg.base };
            for one in [along_x, turned(&along_x)] {
                for other in [other, turned(&other)] {
                    // A few roundings of numbers below 10.
                    let expected = Vector3::from(gap);
                    let off = (one.gap(&other) - expected).norm();
                    assert!(off < 1e-14, "{other:?}: {:?}", one.gap(&other));
                    let off = (other.gap(&one) + expected).norm();
                    assert!(off < 1e-14, "{other:?}: {:?}", other.gap(&one));
                    assert!((one.distance(&other) - expected.norm()).abs() < 1e-14);
                }
            }
        }
    }
}
