// SPDX-License-Identifier: GPL-2.0-or-later
//! One vector per leg, stored as three arrays: loops over legs then use vector units.
//!
//! Comments refer to these processor effects by name:
//!
//! - **Registers.** A value whose address is passed to a function must be in memory, even if the
//!   call is not executed. Passing a copy leaves the value in registers.
//! - **Pairs.** A load that spans two earlier stores waits for both. Values written in pairs are read in
//!   the same pairs.
//! - **Overlap.** Long independent chains of operations run at the same time if they are in a separate
//!   loop without other work between them.
//! - **Known length.** A copy of known length compiles to a few moves; any other is a call.

use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

/// Loads lanes i and i + 1, i even. Two doubles fill the vector registers that every 64-bit
/// machine has; automatic vectorization packs them less well.
#[inline(always)]
pub(crate) fn pair<const N: usize>(lanes: &[f64; N], i: usize) -> f64x2 {
    f64x2::new([lanes[i], lanes[i + 1]])
}

/// Writes lanes i and i + 1.
#[inline(always)]
pub(crate) fn put<const N: usize>(lanes: &mut [f64; N], i: usize, values: f64x2) {
    [lanes[i], lanes[i + 1]] = values.to_array();
}

/// Returns the same number in both lanes.
#[inline(always)]
pub(crate) fn both(value: f64) -> f64x2 {
    f64x2::splat(value)
}

/// Returns the same vector in both lanes.
#[inline(always)]
pub(crate) fn wide(v: &Vector3<f64>) -> [f64x2; 3] {
    [both(v.x), both(v.y), both(v.z)]
}

#[inline(always)]
pub(crate) fn dot(a: &[f64x2; 3], b: &[f64x2; 3]) -> f64x2 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: &[f64x2; 3], b: &[f64x2; 3]) -> [f64x2; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Computes the scalar product over all lanes, in two interleaved sums.
#[inline(always)]
pub(crate) fn inner<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let [even, odd] = products(a, b);
    even + odd
}

/// Computes the sums of the products of even and odd lanes.
#[inline(always)]
fn products<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; 2] {
    let mut sums = pair(a, 0) * pair(b, 0);
    for i in (2..N).step_by(2) {
        sums += pair(a, i) * pair(b, i);
    }
    sums.to_array()
}

/// Computes the scalar products of two vectors with a third one.
#[inline(always)]
pub(crate) fn inners<const N: usize>(a: [&[f64; N]; 2], b: &[f64; N]) -> f64x2 {
    let [one, other] = a.map(|a| products(a, b));
    f64x2::new([one[0], other[0]]) + f64x2::new([one[1], other[1]])
}

/// Computes M v with the same matrix in both lanes.
#[inline(always)]
pub(crate) fn times(m: &Matrix3<f64>, v: &[f64x2; 3]) -> [f64x2; 3] {
    let row = |i| both(m[(i, 0)]) * v[0] + both(m[(i, 1)]) * v[1] + both(m[(i, 2)]) * v[2];
    [row(0), row(1), row(2)]
}

#[inline(always)]
pub(crate) fn sum(a: &[f64x2; 3], b: &[f64x2; 3]) -> [f64x2; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn difference(a: &[f64x2; 3], b: &[f64x2; 3]) -> [f64x2; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Swaps the two lanes.
#[inline(always)]
pub(crate) fn swapped(lanes: f64x2) -> f64x2 {
    let [one, other] = lanes.to_array();
    f64x2::new([other, one])
}

#[inline(always)]
pub(crate) fn scaled(v: &[f64x2; 3], by: f64x2) -> [f64x2; 3] {
    [v[0] * by, v[1] * by, v[2] * by]
}

/// Returns whether all lanes are within ±`limit`; false for NaN.
#[inline(always)]
pub(crate) fn are_within<const N: usize>(lanes: &[f64; N], limit: f64) -> bool {
    let mut within = pair(lanes, 0).abs().simd_le(both(limit));
    for i in (2..N).step_by(2) {
        within &= pair(lanes, i).abs().simd_le(both(limit));
    }
    within.all()
}

/// Returns the largest absolute value of the lanes; NaN if any is NaN.
#[inline(always)]
pub(crate) fn largest<const N: usize>(lanes: &[f64; N]) -> f64 {
    let mut most = f64x2::ZERO;
    for i in (0..N).step_by(2) {
        let lanes = pair(lanes, i).abs();
        let stays = lanes.simd_le(most) | most.simd_ne(most);
        most = stays.select(most, lanes);
    }
    let [even, odd] = most.to_array();
    // A NaN on either side makes the comparison false.
    if even <= odd {
        odd
    } else if odd <= even {
        even
    } else {
        even + odd
    }
}

/// Returns whether all lanes are above a limit; false for NaN.
#[inline(always)]
pub(crate) fn are_above<const N: usize>(lanes: &[f64; N], limit: f64) -> bool {
    let mut above = pair(lanes, 0).simd_gt(both(limit));
    for i in (2..N).step_by(2) {
        above &= pair(lanes, i).simd_gt(both(limit));
    }
    above.all()
}

/// Compares: all lanes above `least`, and the sums of even and of odd lanes at most `most`. Returns a
/// mask that is true if both its lanes are; false for NaN. With `least` >= 0, no single lane
/// exceeds `most` either.
#[inline(always)]
pub(crate) fn between<const N: usize>(lanes: &[f64; N], least: f64, most: f64) -> f64x2 {
    let mut sum = pair(lanes, 0);
    let mut above = sum.simd_gt(both(least));
    for i in (2..N).step_by(2) {
        above &= pair(lanes, i).simd_gt(both(least));
        sum += pair(lanes, i);
    }
    above & sum.simd_le(both(most))
}

/// N vectors, component by component.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(16))]
pub(crate) struct Lanes3<const N: usize> {
    pub x: [f64; N],
    pub y: [f64; N],
    pub z: [f64; N],
}

impl<const N: usize> Lanes3<N> {
    pub const ZERO: Self = Self { x: [0.0; N], y: [0.0; N], z: [0.0; N] };

    pub fn from_fn(f: impl Fn(usize) -> Vector3<f64>) -> Self {
        let mut lanes = Self::ZERO;
        for i in 0..N {
            lanes.set(i, f(i));
        }
        lanes
    }

    /// Loads the components of vectors i and i + 1, i even.
    #[inline(always)]
    pub fn pair(&self, i: usize) -> [f64x2; 3] {
        [pair(&self.x, i), pair(&self.y, i), pair(&self.z, i)]
    }

    #[inline(always)]
    pub fn put(&mut self, i: usize, [x, y, z]: [f64x2; 3]) {
        put(&mut self.x, i, x);
        put(&mut self.y, i, y);
        put(&mut self.z, i, z);
    }

    #[inline(always)]
    pub fn get(&self, i: usize) -> Vector3<f64> {
        Vector3::new(self.x[i], self.y[i], self.z[i])
    }

    pub fn set(&mut self, i: usize, v: Vector3<f64>) {
        self.x[i] = v.x;
        self.y[i] = v.y;
        self.z[i] = v.z;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_lane_is_found_in_any_place_and_nan_in_any() {
        for place in 0..6 {
            let mut lanes = [1.0, -2.0, 0.5, 3.0, -1.0, 0.0];
            lanes[place] = -7.0;
            assert_eq!(largest(&lanes), 7.0);
            lanes[place] = f64::NAN;
            assert!(largest(&lanes).is_nan());
        }
        assert_eq!(largest(&[0.0; 4]), 0.0);
    }

    #[test]
    fn each_lane_alone_decides_whether_all_are_within_or_above() {
        let lanes = [1.0, -2.0, 0.5, 1.5, -1.0, 0.0];
        assert!(are_within(&lanes, 2.0) && are_above(&lanes, -2.5));
        // A value equal to its limit is within it, but not above it.
        assert!(!are_within(&lanes, 1.75) && !are_above(&lanes, -2.0));
        let changed = |place: usize, value: f64| {
            let mut changed = lanes;
            changed[place] = value;
            changed
        };
        for place in 0..6 {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let lanes = changed(place, bad);
                assert!(!are_within(&lanes, 2.0), "{place}: {bad}");
                assert_eq!(are_above(&lanes, -2.5), bad == f64::INFINITY, "{place}: {bad}");
            }
            assert!(!are_within(&changed(place, 2.25), 2.0), "{place}");
            assert!(!are_within(&changed(place, -2.25), 2.0), "{place}");
            assert!(!are_above(&changed(place, -2.75), -2.5), "{place}");
        }
    }

    #[test]
    fn each_lane_alone_and_their_sums_decide_whether_all_are_between() {
        let lanes = [1.0, 2.0, 0.5, 1.5, 1.0, 3.0];
        // Sums of 2.5 and 6.5.
        let are_between = |lanes: &[f64; 6], least, most| between(lanes, least, most).all();
        assert!(are_between(&lanes, 0.25, 6.5) && !are_between(&lanes, 0.25, 6.25));
        assert!(!are_between(&lanes, 0.5, 6.5), "nothing is above itself");
        for place in 0..6 {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.25, 7.0] {
                let mut lanes = lanes;
                lanes[place] = bad;
                assert!(!are_between(&lanes, 0.25, 6.5), "{place}: {bad}");
            }
        }
    }

    #[test]
    fn two_scalar_products_are_those_of_one_each() {
        let rows: [[f64; 6]; 2] =
            [[1.0, -2.0, 0.5, 3.0, -1.0, 0.25], [2.0, 1.0, 4.0, -3.0, 0.5, 8.0]];
        let b = [3.0, 5.0, -7.0, 11.0, 13.0, -17.0];
        let expected = rows.map(|row| inner(&row, &b));
        assert_eq!(inners([&rows[0], &rows[1]], &b).to_array(), expected);
    }
}
