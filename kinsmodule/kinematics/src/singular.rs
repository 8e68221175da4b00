// SPDX-License-Identifier: GPL-2.0-or-later
//! Smallest singular value of an N × 6 matrix stored by columns.
//!
//! Householder reflections from both sides produce an upper bidiagonal matrix B with the same
//! singular values, to rounding of the largest one. The smallest eigenvalue of BᵀB is then computed with
//! Laguerre's method from 0: if all roots of a polynomial are real, its steps increase to the smallest
//! one and never pass it. BᵀB − x I is factored by the stationary quotient-difference recurrence,
//! which preserves the accuracy of small eigenvalues; its derivatives by x give the two sums that the
//! method needs. No pivot search: time is bounded.
//!
//! Sources: Golub & Van Loan, Matrix Computations, section 5.4.8 (bidiagonal form); Parlett,
//! Laguerre's method applied to the matrix eigenvalue problem, 1964; Fernando & Parlett, Accurate
//! singular values and differential qd algorithms, 1994.

use crate::lanes::{both, inner, pair, put};
use libm::sqrt;

/// Largest number of steps of Laguerre's method: near a simple root each step triples the digits; for a
/// root of multiplicity m it removes at least 0.6 of the error, so that 40 steps suffice.
const STEPS: usize = 40;

/// A step below this share of the value is rounding.
const SETTLED: f64 = 1e-14;

/// Room for rounding of products of columns, as a share of the sum of all squares: far above the
/// roundings of a factor of six columns (1e-14), far below any square that is asked for.
const ROOM: f64 = 1e-12;

/// Computes the smallest singular value of the active columns; infinite if none is active. The error is a
/// few roundings of the largest one.
pub(crate) fn smallest_singular_value<const N: usize>(
    columns: &[[f64; N]; 6],
    active: &[bool; 6],
) -> f64 {
    let mut front = [[0.0; N]; 6];
    let mut count = 0;
    for (column, _) in columns.iter().zip(active).filter(|(_, active)| **active) {
        if let Some(place) = front.get_mut(count) {
            *place = *column;
        }
        count += 1;
    }
    if count == 0 {
        return f64::INFINITY;
    }
    Bidiagonal::of(front, count.min(N).min(6)).smallest()
}

/// Returns whether the smallest singular value of the active columns is certainly above `least`, at a third
/// of the cost of the value: AᵀA − least² I then has a Cholesky factor, with an allowance for rounding.
pub(crate) fn is_surely_above<const N: usize>(
    columns: &[[f64; N]; 6],
    active: &[bool; 6],
    least: f64,
) -> bool {
    let mut gram = [[0.0; 6]; 6];
    let mut trace = 0.0;
    for i in (0..6).filter(|i| active[*i]) {
        for j in (0..=i).filter(|j| active[*j]) {
            gram[i][j] = inner(&columns[i], &columns[j]);
        }
        trace += gram[i][i];
    }
    let shift = least * least + ROOM * trace;
    for k in (0..6).filter(|k| active[*k]) {
        let pivot = gram[k][k] - shift;
        if !(pivot > 0.0) {
            return false;
        }
        for i in k + 1..6 {
            let share = gram[i][k] / pivot;
            for j in k + 1..=i {
                gram[i][j] -= share * gram[j][k];
            }
        }
    }
    true
}

/// Squares of the elements of an upper bidiagonal matrix.
struct Bidiagonal {
    count: usize,
    diagonal: [f64; 6],
    /// Right of the diagonal's elements; the last one is 0.
    above: [f64; 6],
}

impl Bidiagonal {
    /// Reduces the first `count` columns.
    fn of<const N: usize>(mut a: [[f64; N]; 6], count: usize) -> Self {
        let mut found = Self { count, diagonal: [0.0; 6], above: [0.0; 6] };
        for k in 0..6.min(N) {
            if k >= count {
                break;
            }
            let (done, rest) = a.split_at_mut(k + 1);
            let Some(column) = done.last_mut() else { break };
            let rest = rest.get_mut(..count - k - 1).unwrap_or_default();
            found.diagonal[k] = clear_column(column, rest, k);
            found.above[k] = clear_row(rest, k);
        }
        found
    }

    /// Computes the square root of the smallest eigenvalue of BᵀB.
    fn smallest(&self) -> f64 {
        let (mut x, count) = (0.0, self.count as f64);
        for _ in 0..STEPS {
            let Some([first, second]) = self.sums(x) else { break };
            let spread = (count - 1.0) * (count * second - first * first);
            let step = count / (first + sqrt(spread.max(0.0)));
            if !(step > SETTLED * x) {
                break;
            }
            x += step;
        }
        sqrt(x)
    }

    /// Computes the sums of 1/(λ − x) and of its square; `None` at or beyond the smallest λ.
    ///
    /// The pivots p of BᵀB − x I are q + s, with s' = e s/p − x for the next one.
    #[inline(always)]
    fn sums(&self, x: f64) -> Option<[f64; 2]> {
        let (mut s, mut slope, mut curvature) = (-x, -1.0, 0.0);
        let (mut first, mut second) = (0.0, 0.0);
        for (q, e) in self.diagonal.iter().zip(&self.above).take(self.count) {
            let pivot = q + s;
            if !(pivot > 0.0) {
                return None;
            }
            let over = 1.0 / pivot;
            let (ratio, factor) = (slope * over, e * q * over * over);
            first -= ratio;
            second += ratio * ratio - curvature * over;
            curvature = factor * (curvature - 2.0 * slope * ratio);
            slope = factor * slope - 1.0;
            s = e * s * over - x;
        }
        Some([first, second])
    }
}

/// Reflects the lanes of a column from `k` on into the first of them, and applies the reflection to the
/// columns after it; returns the square of the resulting element.
#[inline(always)]
fn clear_column<const N: usize>(column: &[f64; N], rest: &mut [[f64; N]], k: usize) -> f64 {
    let mut v = *column;
    for above in v.iter_mut().take(k) {
        *above = 0.0;
    }
    let square = inner(&v, &v);
    let length = sqrt(square);
    let Some(head) = v.get_mut(k) else { return 0.0 };
    let scale = square + head.abs() * length;
    *head += if *head < 0.0 { -length } else { length };
    if scale > 0.0 {
        for other in rest {
            let share = inner(&v, other) / scale;
            for i in (0..N).step_by(2) {
                put(other, i, pair(other, i) - both(share) * pair(&v, i));
            }
        }
    }
    square
}

/// Reflects lane `k` of columns into the first of them; returns the square of the resulting element.
#[inline(always)]
fn clear_row<const N: usize>(columns: &mut [[f64; N]], k: usize) -> f64 {
    let mut v = [0.0; 6];
    for (v, column) in v.iter_mut().zip(columns.iter()) {
        *v = column.get(k).copied().unwrap_or(0.0);
    }
    let square = inner(&v, &v);
    if columns.len() < 2 || !(square > 0.0) {
        return square;
    }
    let length = sqrt(square);
    let over = 1.0 / (square + v[0].abs() * length);
    v[0] += if v[0] < 0.0 { -length } else { length };
    for i in (0..N).step_by(2) {
        let mut along = both(0.0);
        for (v, column) in v.iter().zip(columns.iter()) {
            along += both(*v) * pair(column, i);
        }
        along *= both(over);
        for (v, column) in v.iter().zip(columns.iter_mut()) {
            put(column, i, pair(column, i) - both(*v) * along);
        }
    }
    square
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SMatrix;

    fn number(k: usize) -> f64 {
        libm::sin((k * k + 3 * k + 1) as f64 * 0.7)
    }

    fn check<const N: usize>(columns: &[[f64; N]; 6], expected: f64) {
        let found = smallest_singular_value(columns, &[true; 6]);
        // 1e-13: rounding of several reflections of numbers of size 1.
        assert!((found - expected).abs() < 1e-13, "{found} {expected}");
    }

    #[test]
    fn the_smallest_singular_value_is_that_of_an_independent_decomposition() {
        for case in 0..400 {
            let m =
                SMatrix::<f64, 8, 6>::from_fn(|i, k| number(97 * case + 13 * i + 7 * k + i * k));
            let columns = core::array::from_fn(|k| core::array::from_fn(|i| m[(i, k)]));
            check::<8>(&columns, m.singular_values().min());
            let m = m.fixed_rows::<6>(1).into_owned();
            let columns = core::array::from_fn(|k| core::array::from_fn(|i| m[(i, k)]));
            check::<6>(&columns, m.singular_values().min());
        }
    }

    #[test]
    fn what_is_surely_above_a_value_is_and_most_of_what_is_above_is_surely() {
        let mut sure = 0;
        for case in 0..400 {
            let columns: [[f64; 8]; 6] = core::array::from_fn(|k| {
                core::array::from_fn(|i| number(97 * case + 13 * i + 7 * k + i * k))
            });
            for active in [[true; 6], [true, false, true, true, false, true]] {
                let value = smallest_singular_value(&columns, &active);
                let is_above = |least| is_surely_above(&columns, &active, least);
                assert!(!is_above(value) && !is_above(1.01 * value) && !is_above(f64::NAN));
                sure += usize::from(is_above(0.99 * value));
            }
        }
        assert!(sure > 780, "{sure}");
        // With fewer lanes than columns the matrix is singular.
        assert!(!is_surely_above(&[[1.0; 4]; 6], &[true; 6], 0.0));
    }

    /// Creates Q D Pᵀ with two rotations of six dimensions.
    fn with_values(values: [f64; 6], case: usize) -> [[f64; 6]; 6] {
        let turn = |from: usize| {
            let mut q = SMatrix::<f64, 6, 6>::identity();
            for n in 0..3 {
                let v = SMatrix::<f64, 6, 1>::from_fn(|i, _| number(from + 31 * n + i)).normalize();
                q -= q * v * v.transpose() * 2.0;
            }
            q
        };
        let d = SMatrix::<f64, 6, 6>::from_diagonal(&values.into());
        let m = turn(7 * case) * d * turn(11 * case + 5).transpose();
        core::array::from_fn(|k| core::array::from_fn(|i| m[(i, k)]))
    }

    #[test]
    fn it_is_found_among_equal_close_and_vanishing_ones_and_never_beyond() {
        for case in 0..100 {
            for values in [
                [1.0; 6],
                [0.3, 0.3, 0.3, 0.3, 0.3, 2.0],
                [0.3, 0.3, 1.0, 1.0, 2.0, 2.0],
                [0.3, 0.3 + 1e-13, 1.0, 1.0, 1.0, 1.0],
                [0.3, 0.3 + 1e-9, 0.3 + 2e-9, 0.3 + 1e-5, 1.0, 3.0],
                [0.3, 0.301, 0.302, 1.0, 1.0, 3.0],
                [1e-9, 1.0, 1.0, 1.0, 1.0, 1.0],
                [1e-9, 1e-9, 1e-5, 1.0, 1.0, 1.0],
                [0.0, 0.3, 1.0, 1.0, 1.0, 1.0],
                [0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
                [0.0; 6],
            ] {
                check(&with_values(values, case), values[0]);
            }
        }
    }

    #[test]
    fn columns_that_are_not_active_do_not_count_and_dependent_ones_give_nothing() {
        let mut columns = [[0.0; 4]; 6];
        columns[0] = [3.0, 1.0, 4.0, 1.0];
        columns[1] = [3.0, 0.0, 4.0, 0.0];
        columns[4] = [0.0, 2.0, 0.0, 0.0];
        let active = [false, true, false, false, true, false];
        assert_eq!(smallest_singular_value(&columns, &active), 2.0);
        columns[4] = columns[1];
        assert!(smallest_singular_value(&columns, &active) < 1e-15);
        assert_eq!(smallest_singular_value(&columns, &[false; 6]), f64::INFINITY);
    }

    #[test]
    fn what_is_not_a_number_has_no_singular_value_above_0() {
        let mut columns = with_values([1.0; 6], 1);
        columns[3][2] = f64::NAN;
        assert!(!(smallest_singular_value(&columns, &[true; 6]) > 0.0));
    }
}
