// SPDX-License-Identifier: GPL-2.0-or-later
//! QR factorisation of an N × 6 matrix stored by columns (modified Gram-Schmidt).
//!
//! No pivot search and no index that depends on data: bounded, branch-free time.
//! Gram-Schmidt loses orthogonality by the condition number, which Newton's method
//! repairs at the next step. Square and tall matrices alike.

/// A column this much smaller than the largest one counts as dependent.
const DEPENDENT: f64 = 1e-10;

pub(crate) struct Qr<const N: usize> {
    q: [[f64; N]; 6],
    /// Inverse of the upper triangular factor.
    r_inverse: [[f64; 6]; 6],
    inverse_norm: f64,
}

impl<const N: usize> Qr<N> {
    /// `None` if an active column depends on the ones before it. Columns that are not
    /// active must hold zeros; their unknowns are 0.
    #[inline]
    pub fn new(columns: &[[f64; N]; 6], active: &[bool; 6]) -> Option<Self> {
        let mut q = *columns;
        let mut r = [[0.0; 6]; 6];
        let mut diagonal_inverse = [0.0; 6];
        let mut largest = 0.0_f64;
        for k in 0..6 {
            if !active[k] {
                continue;
            }
            let norm = libm::sqrt(dot(&q[k], &q[k]));
            largest = largest.max(norm);
            if !(norm > DEPENDENT * largest) {
                return None;
            }
            let inverse = 1.0 / norm;
            diagonal_inverse[k] = inverse;
            for value in &mut q[k] {
                *value *= inverse;
            }
            let unit = q[k];
            for j in k + 1..6 {
                let along = dot(&unit, &q[j]);
                r[k][j] = along;
                for i in 0..N {
                    q[j][i] -= along * unit[i];
                }
            }
        }
        let r_inverse = inverted(&r, &diagonal_inverse);
        let mut sum = 0.0;
        for row in &r_inverse {
            sum += dot(row, row);
        }
        Some(Self { q, r_inverse, inverse_norm: libm::sqrt(sum) })
    }

    /// Least-squares solution x of A x = b.
    #[inline]
    pub fn solve(&self, b: &[f64; N]) -> [f64; 6] {
        let mut y = [0.0; 6];
        for k in 0..6 {
            y[k] = dot(&self.q[k], b);
        }
        let mut x = [0.0; 6];
        for i in 0..6 {
            for k in i..6 {
                x[i] += self.r_inverse[i][k] * y[k];
            }
        }
        x
    }

    /// Frobenius norm of the (pseudo-)inverse of A.
    #[inline]
    pub fn inverse_norm(&self) -> f64 {
        self.inverse_norm
    }
}

/// Scalar product in two interleaved sums: half the latency of one.
#[inline]
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut sums = [0.0; 2];
    for i in 0..N {
        sums[i % 2] += a[i] * b[i];
    }
    sums[0] + sums[1]
}

/// Inverse of an upper triangular matrix, given above its diagonal, and the inverses of
/// the diagonal's elements.
#[inline]
fn inverted(r: &[[f64; 6]; 6], diagonal: &[f64; 6]) -> [[f64; 6]; 6] {
    let mut inverse = [[0.0; 6]; 6];
    for j in 0..6 {
        inverse[j][j] = diagonal[j];
        for i in (0..j).rev() {
            let mut sum = 0.0;
            for k in i + 1..=j {
                sum += r[i][k] * inverse[k][j];
            }
            inverse[i][j] = -sum * diagonal[i];
        }
    }
    inverse
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
