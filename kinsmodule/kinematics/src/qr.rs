// SPDX-License-Identifier: GPL-2.0-or-later
//! QR factorisation of an N × 6 matrix stored by columns (modified Gram-Schmidt).
//!
//! No pivot search and no index that depends on data: bounded, branch-free time.
//! Gram-Schmidt loses orthogonality by the condition number, which Newton's method
//! repairs at the next step. Square and tall matrices alike. The columns of Q are not
//! normalised, which keeps the square roots out of the chain that everything waits for.

use crate::lanes::{both, pair, put};
use wide::f64x2;

/// A column this much smaller than the largest one counts as dependent.
const DEPENDENT: f64 = 1e-10;

/// A = Q R with orthogonal columns of any length in Q, and 1 on the diagonal of R.
pub(crate) struct Qr<const N: usize> {
    q: [[f64; N]; 6],
    /// Inverse of R, column by column.
    r_inverse: [[f64; 6]; 6],
    /// Inverse squared lengths of the columns of Q; 0 for one that is not active.
    weight: [f64; 6],
    inverse_norm: f64,
}

impl<const N: usize> Qr<N> {
    /// To be filled by [`Self::renew`].
    pub const ZERO: Self =
        Self { q: [[0.0; N]; 6], r_inverse: [[0.0; 6]; 6], weight: [0.0; 6], inverse_norm: 0.0 };

    /// `None` if an active column depends on the ones before it. Columns that are not
    /// active must hold zeros; their unknowns are 0.
    pub fn new(columns: &[[f64; N]; 6], active: &[bool; 6]) -> Option<Self> {
        let mut qr = Self::ZERO;
        qr.renew(active, |q| *q = *columns).then_some(qr)
    }

    /// Factors the columns that `fill` writes; false where [`Self::new`] gives `None`.
    #[inline(always)]
    pub fn renew(&mut self, active: &[bool; 6], fill: impl FnOnce(&mut [[f64; N]; 6])) -> bool {
        fill(&mut self.q);
        self.factor(active)
    }

    #[inline]
    fn factor(&mut self, active: &[bool; 6]) -> bool {
        let mut r = [[0.0; 6]; 6];
        let mut squares = [0.0; 6];
        // Numbers of columns that the compiler knows let it unroll the loops within.
        squares[0] = self.orthogonalise::<0>(active, &mut r);
        squares[1] = self.orthogonalise::<1>(active, &mut r);
        squares[2] = self.orthogonalise::<2>(active, &mut r);
        squares[3] = self.orthogonalise::<3>(active, &mut r);
        squares[4] = self.orthogonalise::<4>(active, &mut r);
        squares[5] = self.orthogonalise::<5>(active, &mut r);
        invert(&r, &mut self.r_inverse);
        let mut sum = 0.0;
        for (column, weight) in self.r_inverse.iter().zip(&self.weight) {
            sum += dot(column, column) * weight;
        }
        self.inverse_norm = libm::sqrt(sum);
        is_regular(&squares, active)
    }

    /// Takes column K out of those after it; its squared length.
    #[inline(always)]
    fn orthogonalise<const K: usize>(&mut self, active: &[bool; 6], r: &mut [[f64; 6]; 6]) -> f64 {
        let column = self.q[K];
        let square = dot(&column, &column);
        let weight = if active[K] { 1.0 / square } else { 0.0 };
        self.weight[K] = weight;
        for j in K + 1..6 {
            let along = dot(&column, &self.q[j]) * weight;
            r[K][j] = along;
            for i in (0..N).step_by(2) {
                let rest = pair(&self.q[j], i) - both(along) * pair(&column, i);
                put(&mut self.q[j], i, rest);
            }
        }
        square
    }

    /// Least-squares solution x of A x = b.
    #[inline]
    pub fn solve(&self, b: &[f64; N]) -> [f64; 6] {
        let mut y = [0.0; 6];
        for k in 0..6 {
            y[k] = dot(&self.q[k], b) * self.weight[k];
        }
        let mut x = [0.0; 6];
        for i in (0..6).step_by(2) {
            let mut sum = f64x2::ZERO;
            // What lies below the diagonal is 0.
            for k in i..6 {
                sum += pair(&self.r_inverse[k], i) * both(y[k]);
            }
            put(&mut x, i, sum);
        }
        x
    }

    /// Frobenius norm of the (pseudo-)inverse of A.
    #[inline]
    pub fn inverse_norm(&self) -> f64 {
        self.inverse_norm
    }
}

/// Scalar product, in two interleaved sums.
#[inline(always)]
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut sums = f64x2::ZERO;
    for i in (0..N).step_by(2) {
        sums += pair(a, i) * pair(b, i);
    }
    let [even, odd] = sums.to_array();
    even + odd
}

/// Whether no active column was all but a combination of those before it.
#[inline(always)]
fn is_regular(squares: &[f64; 6], active: &[bool; 6]) -> bool {
    let mut largest = 0.0_f64;
    let mut regular = true;
    for (square, active) in squares.iter().zip(active) {
        largest = largest.max(*square);
        regular &= !active || *square > DEPENDENT * DEPENDENT * largest;
    }
    regular
}

/// Inverse, column by column, of an upper triangular matrix with 1 on its diagonal, given
/// above it row by row.
#[inline(always)]
fn invert(r: &[[f64; 6]; 6], inverse: &mut [[f64; 6]; 6]) {
    for j in 0..6 {
        let column = &mut inverse[j];
        column[j] = 1.0;
        for i in (0..j).rev() {
            let mut sum = r[i][j];
            for k in i + 1..j {
                sum += r[i][k] * column[k];
            }
            column[i] = -sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of a well-conditioned tall matrix without structure.
    fn tall() -> [[f64; 8]; 6] {
        core::array::from_fn(|k| {
            core::array::from_fn(|i| {
                libm::sin((3 * k + 7 * i + k * i) as f64) + f64::from(u8::from(i == k))
            })
        })
    }

    #[test]
    fn solve_returns_the_vector_that_made_the_right_side() {
        let a = tall();
        let x = [1.0, -2.0, 0.5, 3.0, -0.25, 4.0];
        let mut b = [0.0; 8];
        for i in 0..8 {
            for k in 0..6 {
                b[i] += a[k][i] * x[k];
            }
        }
        let got = Qr::new(&a, &[true; 6]).unwrap().solve(&b);
        for k in 0..6 {
            // 1e-12: a few hundred roundings times the condition number (below 100).
            assert!((got[k] - x[k]).abs() < 1e-12, "{got:?}");
        }
    }

    #[test]
    fn an_unknown_that_is_not_active_is_zero_and_the_others_are_those_without_it() {
        let mut a = tall();
        a[2] = [0.0; 8];
        let x = [1.0, -2.0, 0.0, 3.0, -0.25, 4.0];
        let mut b = [0.0; 8];
        for i in 0..8 {
            for k in 0..6 {
                b[i] += a[k][i] * x[k];
            }
        }
        let active = [true, true, false, true, true, true];
        let got = Qr::new(&a, &active).unwrap().solve(&b);
        for k in 0..6 {
            // As above.
            assert!((got[k] - x[k]).abs() < 1e-12, "{got:?}");
        }
    }

    #[test]
    fn a_dependent_column_is_refused() {
        let mut a = tall();
        a[5] = core::array::from_fn(|i| a[0][i] + a[1][i]);
        assert!(Qr::new(&a, &[true; 6]).is_none());
    }
}
