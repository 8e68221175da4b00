// SPDX-License-Identifier: GPL-2.0-or-later
//! Pseudo-inverse of an N × 6 matrix stored by columns, from its QR factors (modified
//! Gram-Schmidt).
//!
//! No pivot search and no index that depends on data: bounded, branch-free time.
//! Gram-Schmidt loses orthogonality by the condition number, which Newton's method
//! repairs at the next step. Square and tall matrices alike. The columns of Q are not
//! normalised, which keeps the square roots out of the chain that everything waits for.
//! The inverse is solved for once: a servo step goes through it four times.

use crate::lanes::{both, inner, inners, pair, put};
use wide::f64x2;

/// A column this much smaller than the largest one counts as dependent.
const DEPENDENT: f64 = 1e-10;

/// (R⁻¹ D⁻¹) Qᵀ of A = Q R, with orthogonal columns of any length in Q, their squares in D
/// and 1 on the diagonal of R.
pub(crate) struct Qr<const N: usize> {
    /// Row by row.
    inverse: [[f64; N]; 6],
    inverse_norm: f64,
}

/// What factoring works on.
struct Work<const N: usize> {
    q: [[f64; N]; 6],
    /// R above its diagonal of 1, row by row.
    r: [[f64; 6]; 6],
    /// Squared lengths of the columns of Q.
    squares: [f64; 6],
    /// Their inverses; 0 for a column that is not active.
    weight: [f64; 6],
}

impl<const N: usize> Qr<N> {
    /// To be filled by [`Self::renew`].
    pub const ZERO: Self = Self { inverse: [[0.0; N]; 6], inverse_norm: 0.0 };

    /// `None` if an active column depends on the ones before it. Columns that are not
    /// active must hold zeros; their unknowns are 0.
    pub fn new(columns: &[[f64; N]; 6], active: &[bool; 6]) -> Option<Self> {
        let mut qr = Self::ZERO;
        qr.renew(active, *columns).then_some(qr)
    }

    /// Factors columns in place of what was; false where [`Self::new`] gives `None`.
    #[inline(always)]
    pub fn renew(&mut self, active: &[bool; 6], columns: [[f64; N]; 6]) -> bool {
        let mut work = Work { q: columns, r: [[0.0; 6]; 6], squares: [0.0; 6], weight: [0.0; 6] };
        // Numbers of columns that the compiler knows let it unroll the loops within.
        work.orthogonalise::<0>(active);
        work.orthogonalise::<1>(active);
        work.orthogonalise::<2>(active);
        work.orthogonalise::<3>(active);
        work.orthogonalise::<4>(active);
        work.orthogonalise::<5>(active);
        work.solve_back(&mut self.inverse);
        let squares = self.inverse.each_ref().map(|row| inner(row, row));
        self.inverse_norm = libm::sqrt(squares.iter().sum());
        is_regular(&work.squares, active)
    }

    /// Least-squares solution x of A x = b.
    #[inline(always)]
    pub fn solve(&self, b: &[f64; N]) -> [f64; 6] {
        let mut x = [0.0; 6];
        let [r0, r1, r2, r3, r4, r5] = &self.inverse;
        put(&mut x, 0, inners([r0, r1], b));
        put(&mut x, 2, inners([r2, r3], b));
        put(&mut x, 4, inners([r4, r5], b));
        x
    }

    /// Frobenius norm of the (pseudo-)inverse of A.
    #[inline]
    pub fn inverse_norm(&self) -> f64 {
        self.inverse_norm
    }
}

impl<const N: usize> Work<N> {
    /// Takes column K out of those after it.
    #[inline(always)]
    fn orthogonalise<const K: usize>(&mut self, active: &[bool; 6]) {
        let column = self.q[K];
        let square = inner(&column, &column);
        let weight = if active[K] { 1.0 / square } else { 0.0 };
        (self.squares[K], self.weight[K]) = (square, weight);
        for j in K + 1..6 {
            let along = inner(&column, &self.q[j]) * weight;
            self.r[K][j] = along;
            for i in (0..N).step_by(2) {
                let rest = pair(&self.q[j], i) - both(along) * pair(&column, i);
                put(&mut self.q[j], i, rest);
            }
        }
    }

    /// Solves R M = D⁻¹ Qᵀ from its last row upwards.
    #[inline(always)]
    fn solve_back(&self, inverse: &mut [[f64; N]; 6]) {
        for l in (0..N).step_by(2) {
            let mut rows: [f64x2; 6] =
                core::array::from_fn(|k| pair(&self.q[k], l) * both(self.weight[k]));
            for i in (0..5).rev() {
                for k in i + 1..6 {
                    rows[i] -= both(self.r[i][k]) * rows[k];
                }
            }
            for (row, values) in inverse.iter_mut().zip(rows) {
                put(row, l, values);
            }
        }
    }
}

/// Whether no active column was all but a combination of those before it.
#[inline(always)]
fn is_regular(squares: &[f64; 6], active: &[bool; 6]) -> bool {
    let mut largest = 0.0_f64;
    let mut regular = true;
    for (square, active) in squares.iter().zip(active) {
        largest = largest.max(*square);
        regular &= !active | (*square > DEPENDENT * DEPENDENT * largest);
    }
    regular
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

    #[test]
    fn a_column_depends_on_the_others_by_its_share_of_the_largest_at_any_scale() {
        for scale in [1e-6, 1.0, 1e6] {
            let is_regular = |share: f64| {
                let mut a = [[0.0; 6]; 6];
                for (k, column) in a.iter_mut().enumerate() {
                    column[k] = if k == 3 { share * scale } else { scale };
                }
                Qr::new(&a, &[true; 6]).is_some()
            };
            assert!(is_regular(1.1e-10) && !is_regular(0.9e-10), "{scale}");
        }
    }
}
