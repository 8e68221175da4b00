// SPDX-License-Identifier: GPL-2.0-or-later
//! What is watched at a pose beside the joints: how well the legs hold the platform, how far
//! they lean from where they stand at home, and how near they come to each other.

use crate::fault::Fault;
use crate::geometry::{Geometry, LegGeometry};
use crate::layout::{MAX_LEGS, PerLeg};
use crate::leg::LegKind;
use crate::machine::{Machine, Mechanism, Segment};
use crate::pose::Pose;
use libm::{atan2, sqrt};
use nalgebra::{Matrix3, Vector3};

/// Cosine of the angle between two columns that count as orthogonal: rounding makes as much.
const ORTHOGONAL: f64 = 1e-15;

/// Sweeps of Jacobi's method. Its error falls quadratically once the columns are nearly
/// orthogonal: six columns have the digits of f64 after six sweeps, and two are to spare.
const SWEEPS: usize = 8;

/// Squared sine of the angle below which two lines count as parallel: taking an end for the
/// nearest point then errs by less than the root of it, a ten thousandth of a leg.
const PARALLEL: f64 = 1e-8;

const DEGREES: f64 = 180.0 / core::f64::consts::PI;

/// What does not change about a frozen machine.
#[derive(Clone, Debug)]
pub struct Watch {
    /// Directions of the legs at the reference pose, base to platform.
    home: Option<AtHome>,
    /// Pairs of legs, lower number first, that share no anchor.
    apart: [[bool; MAX_LEGS]; MAX_LEGS],
}

/// Directions of the legs at the reference pose.
#[derive(Clone, Copy, Debug)]
struct AtHome {
    /// In base.
    base: [Vector3<f64>; MAX_LEGS],
    /// In the platform, which may be tilted there.
    platform: [Vector3<f64>; MAX_LEGS],
}

/// Angles by which the legs have left their direction at home, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cones {
    /// As the base joints see it.
    pub base: PerLeg,
    /// As the platform joints see it.
    pub platform: PerLeg,
}

/// Two legs, lower number first, and the distance of their centre lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Machine units.
    pub distance: f64,
    /// Numbers of the legs.
    pub pair: [usize; 2],
}

impl Watch {
    /// Of a machine and the geometry that it was frozen from.
    pub fn new(machine: &Machine, geometry: &Geometry) -> Self {
        let legs = geometry.legs();
        let apart = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let pair = legs.get(i).zip(legs.get(j));
                i < j && pair.is_some_and(|(one, other)| !share_anchor(one, other))
            })
        });
        Self { home: home_directions(machine, geometry), apart }
    }

    /// Angles of the legs' cones for an orientation of the platform; zeros where the
    /// machine has no reference pose.
    pub fn cones(&self, rotation: &Matrix3<f64>, legs: &[Segment; MAX_LEGS]) -> Cones {
        let mut cones = Cones { base: [0.0; MAX_LEGS], platform: [0.0; MAX_LEGS] };
        let Some(home) = &self.home else { return cones };
        let angles = cones.base.iter_mut().zip(&mut cones.platform);
        let homes = home.base.iter().zip(&home.platform);
        for ((leg, (in_base, in_platform)), (base, platform)) in legs.iter().zip(homes).zip(angles)
        {
            let now = leg.platform - leg.base;
            *base = angle(&now, in_base);
            *platform = angle(&rotation.tr_mul(&now), in_platform);
        }
        cones
    }

    /// Whether the distance of two legs counts, lower number first: they share no anchor.
    pub fn is_watched(&self, [i, j]: [usize; 2]) -> bool {
        self.apart.get(i).and_then(|row| row.get(j)).is_some_and(|apart| *apart)
    }

    /// The two legs that are nearest to each other, of those that share no anchor.
    pub fn nearest(&self, legs: &[Segment; MAX_LEGS]) -> Option<Nearest> {
        let mut nearest: Option<Nearest> = None;
        for (i, (one, apart)) in legs.iter().zip(&self.apart).enumerate() {
            for (j, (other, apart)) in legs.iter().zip(apart).enumerate() {
                if !apart {
                    continue;
                }
                let distance = one.distance(other);
                if !nearest.is_some_and(|n| n.distance <= distance) {
                    nearest = Some(Nearest { distance, pair: [i, j] });
                }
            }
        }
        nearest
    }
}

impl Segment {
    /// Smallest distance to another segment.
    pub fn distance(&self, other: &Self) -> f64 {
        self.gap(other).norm()
    }

    /// The shortest vector from another segment to this one.
    ///
    /// Between the lines' nearest points where both lie within the segments, else the best of
    /// the four ends.
    pub fn gap(&self, other: &Self) -> Vector3<f64> {
        let (d, e) = (self.platform - self.base, other.platform - other.base);
        let across = self.base - other.base;
        let (dd, de, ee) = (d.dot(&d), d.dot(&e), e.dot(&e));
        let determinant = dd * ee - de * de;
        let s = (de * e.dot(&across) - ee * d.dot(&across)) / determinant;
        let t = (dd * e.dot(&across) - de * d.dot(&across)) / determinant;
        let inside = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
        // (Nearly) parallel lines have their nearest points anywhere: an end is as near.
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

    /// The shortest vector from this segment to a point.
    fn gap_to(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let along = self.platform - self.base;
        let share = along.dot(&(point - self.base)) / along.norm_squared().max(f64::MIN_POSITIVE);
        point - (self.base + along * share.clamp(0.0, 1.0))
    }
}

/// Whether two legs meet at the platform, or at a base anchor that stands still.
fn share_anchor(one: &LegGeometry, other: &LegGeometry) -> bool {
    let stands = |leg: &LegGeometry| matches!(leg.kind, LegKind::Strut(_));
    one.platform == other.platform || (one.base == other.base && stands(one) && stands(other))
}

/// The reference pose is one without a tool, as that of the nut corrections.
fn home_directions(machine: &Machine, geometry: &Geometry) -> Option<AtHome> {
    let home = Pose::from_degrees(geometry.home?);
    let legs = machine.segments(&home, &Vector3::zeros()).ok()?;
    let base = legs.map(|leg| leg.platform - leg.base);
    let rotation = home.rotation();
    Some(AtHome { base, platform: base.map(|leg| rotation.tr_mul(&leg)) })
}

/// Angle between two vectors of any length, degrees; 0 where one has none.
fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    atan2(a.cross(b).norm(), a.dot(b)) * DEGREES
}

impl<const N: usize> Mechanism<N> {
    /// Smallest singular value of the legs' unit rows over the active coordinates.
    pub fn conditioning(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<f64, Fault> {
        let posed = self.posed(pose, tool)?;
        let joints = self.joints_of(&posed)?;
        let place = &posed.stand.place;
        let placed = self.placed(&self.moved_anchors(&joints)?, place);
        let columns = self.charted_rows(&placed, None, place);
        Ok(smallest_singular_value(columns, &self.active))
    }
}

/// Smallest singular value of the active columns, by one-sided Jacobi rotations: they make
/// the columns orthogonal, whose lengths then are the singular values.
fn smallest_singular_value<const N: usize>(mut columns: [[f64; N]; 6], active: &[bool; 6]) -> f64 {
    for (column, active) in columns.iter_mut().zip(active) {
        if !active {
            *column = [0.0; N];
        }
    }
    for _ in 0..SWEEPS {
        for j in 0..5 {
            for k in j + 1..6 {
                let (left, right) = orthogonal(&columns[j], &columns[k]);
                columns[j] = left;
                columns[k] = right;
            }
        }
    }
    let lengths = columns.iter().zip(active).filter(|(_, active)| **active);
    sqrt(lengths.map(|(column, _)| dot(column, column)).fold(f64::INFINITY, f64::min))
}

/// Two columns turned in their plane until they are orthogonal.
fn orthogonal<const N: usize>(a: &[f64; N], b: &[f64; N]) -> ([f64; N], [f64; N]) {
    let (along, aa, bb) = (dot(a, b), dot(a, a), dot(b, b));
    if along * along <= ORTHOGONAL * ORTHOGONAL * (aa * bb) {
        return (*a, *b);
    }
    let cotangent = (bb - aa) / (2.0 * along);
    let root = sqrt(1.0 + cotangent * cotangent);
    // The smaller of the two angles, as tangent.
    let t = if cotangent < 0.0 { 1.0 / (cotangent - root) } else { 1.0 / (cotangent + root) };
    let cosine = 1.0 / sqrt(1.0 + t * t);
    let sine = t * cosine;
    let (mut left, mut right) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        left[i] = cosine * a[i] - sine * b[i];
        right[i] = sine * a[i] + cosine * b[i];
    }
    (left, right)
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SMatrix;

    #[test]
    fn the_smallest_singular_value_is_that_of_an_independent_decomposition() {
        for case in 0..200 {
            let m = SMatrix::<f64, 8, 6>::from_fn(|i, k| {
                libm::sin((1 + case * 97 + 13 * i + 7 * k + i * k) as f64 * 0.7)
            });
            let columns: [[f64; 8]; 6] =
                core::array::from_fn(|k| core::array::from_fn(|i| m[(i, k)]));
            let expected = m.singular_values().min();
            let found = smallest_singular_value(columns, &[true; 6]);
            // 1e-13: some rotations' rounding of numbers of size 1.
            assert!((found - expected).abs() < 1e-13, "{found} {expected}");
        }
    }

    #[test]
    fn columns_that_are_not_active_do_not_count_and_dependent_ones_give_nothing() {
        let mut columns = [[0.0; 4]; 6];
        columns[0] = [3.0, 1.0, 4.0, 1.0];
        columns[1] = [3.0, 0.0, 4.0, 0.0];
        columns[4] = [0.0, 2.0, 0.0, 0.0];
        let active = [false, true, false, false, true, false];
        assert_eq!(smallest_singular_value(columns, &active), 2.0);
        columns[4] = columns[1];
        assert!(smallest_singular_value(columns, &active) < 1e-15);
    }

    /// The distance by stepping finely along both segments.
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
            // The search only visits points 1/400 of at most 3.5 apart.
            assert!(found <= expected + 1e-12 && found > expected - 0.01, "{found} {expected}");
            assert!((found - other.distance(&one)).abs() < 1e-12);
            // No end of one lies behind the plane through the other's nearest point.
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
            // Lines that pass each other within both, square and at 3 to 4.
            (segment([2.0, -5.0, 2.0], [2.0, 1.0, 2.0]), [0.0, 0.0, -2.0]),
            (segment([-2.0, -4.0, -7.0], [4.0, 4.0, -7.0]), [0.0, 0.0, 7.0]),
            // An end beside the middle of the other.
            (segment([1.0, 2.0, 0.0], [4.0, 6.0, 0.0]), [0.0, -2.0, 0.0]),
            (segment([0.5, -8.0, 1.0], [0.5, -3.0, 1.0]), [0.0, 3.0, -1.0]),
            // Two ends, 3 and 4 apart, before and behind.
            (segment([6.0, 4.0, 0.0], [9.0, 9.0, 5.0]), [-3.0, -4.0, 0.0]),
            (segment([-9.0, 9.0, 5.0], [-4.0, 4.0, 0.0]), [3.0, -4.0, 0.0]),
            // Parallel: beside each other, and one behind the other.
            (segment([-5.0, 1.0, 2.0], [7.0, 1.0, 2.0]), [0.0, -1.0, -2.0]),
            (segment([8.0, 0.0, 0.0], [5.0, 0.0, 0.0]), [-2.0, 0.0, 0.0]),
            // A point.
            (segment([2.0, 3.0, 4.0], [2.0, 3.0, 4.0]), [0.0, -3.0, -4.0]),
        ] {
            let turned = |leg: &Segment| Segment { base: leg.platform, platform: leg.base };
            for one in [along_x, turned(&along_x)] {
                for other in [other, turned(&other)] {
                    // Some roundings of numbers below 10.
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

    #[test]
    fn angles_of_directions_are_those_of_their_lengths_across_and_along() {
        // Degrees: 1e-13 are some roundings.
        let x = Vector3::new(2.0, 0.0, 0.0);
        for (direction, degrees) in
            [([3.0, 3.0, 0.0], 45.0), ([-1.0, 0.0, -1.0], 135.0), ([0.0, 0.0, 9.0], 90.0)]
        {
            assert!((angle(&x, &Vector3::from(direction)) - degrees).abs() < 1e-13);
        }
        assert_eq!(angle(&x, &Vector3::zeros()), 0.0);
    }
}
