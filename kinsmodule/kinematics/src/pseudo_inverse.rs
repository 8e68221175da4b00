// SPDX-License-Identifier: GPL-2.0-or-later
//! Pseudo-inverse of an N × 6 matrix stored by columns, from its QR factors by triples of columns:
//! Gram-Schmidt with the translations T and the rotations U as one block each.
//!
//! U' = U − T S with S = (TᵀT)⁻¹ TᵀU is orthogonal to T, and the rows of the inverse are
//! H = (U'ᵀU')⁻¹ U'ᵀ for the rotations and (TᵀT)⁻¹ Tᵀ − S H for the translations. The 3 × 3 blocks are
//! inverted by cofactors: two divisions in sequence instead of six for column by column.
//!
//! Rounding grows with the third power of the condition number of each triple. If one is nearly
//! flat, the columns are factored one by one (modified Gram-Schmidt), with rounding
//! proportional to the square, which Newton's method corrects at the next step.
//!
//! No pivot search and no index that depends on data: bounded time. Square and tall matrices
//! alike. The inverse is computed once, because a servo step uses it four times.

use crate::lanes::{both, inner, inners, pair, put};
use wide::f64x2;

/// A column smaller than the largest one by this factor counts as dependent.
const DEPENDENT: f64 = 1e-10;

/// Three columns count as flat if their squared volume is below this share of that of perpendicular
/// columns: above it, rounding is about that of column by column (verified by the tests).
const FLAT: f64 = 0.03;

/// Pseudo-inverse of A.
pub(crate) struct PseudoInverse<const N: usize> {
    /// Row by row.
    inverse: [[f64; N]; 6],
    inverse_norm: f64,
}

/// Three columns, side by side.
type Triple<'a, const N: usize> = [&'a [f64; N]; 3];

/// (VᵀV)⁻¹ of three columns V.
struct Gram {
    /// Cofactors of VᵀV: 00, 11, 22, 01, 12, 20.
    cofactors: [f64; 6],
    /// 1 over its determinant; only what depends on it waits for the division.
    over: f64,
    /// Squared lengths of the columns.
    squares: [f64; 3],
    /// The determinant: the square of the volume that the columns span.
    volume: f64,
}

/// Working memory for factoring column by column.
struct Work<const N: usize> {
    q: [[f64; N]; 6],
    /// R above its unit diagonal, row by row.
    r: [[f64; 6]; 6],
    /// Squared lengths of the columns of Q.
    squares: [f64; 6],
    /// Their inverses; 0 for an inactive column.
    weight: [f64; 6],
}

impl<const N: usize> PseudoInverse<N> {
    /// Empty, to be filled.
    pub const ZERO: Self = Self { inverse: [[0.0; N]; 6], inverse_norm: 0.0 };

    /// Factors the columns; `None` if an active column depends on the ones before it. Inactive columns
    /// must contain zeros; their unknowns are 0.
    #[inline(always)]
    pub fn new(columns: &[[f64; N]; 6], active: &[bool; 6]) -> Option<Self> {
        let mut inverse = Self::ZERO;
        let regular = inverse.renew(active, *columns);
        regular.unwrap_or_else(|| inverse.renew_by_columns(active, columns)).then_some(inverse)
    }

    /// Factors columns in place; `Some(false)` where [`Self::new`] returns `None`. Returns `None` if
    /// three of them are flat: then nothing has changed, and [`Self::renew_by_columns`] must be used.
    #[inline(always)]
    pub fn renew(&mut self, active: &[bool; 6], columns: [[f64; N]; 6]) -> Option<bool> {
        let [a, b, c, d, e, f] = &columns;
        let (moves, turns) = ([a, b, c], [d, e, f]);
        // An inactive column counts as one of length 1, orthogonal to the others.
        let [i, j, k, l, m, n] = active.map(|active| if active { 0.0 } else { 1.0 });
        let of_moves = Gram::new(&moves, [i, j, k]);
        let shares = products(&moves, &turns).map(|column| of_moves.times(&column));
        let across: [_; 3] = core::array::from_fn(|j| across(turns[j], &moves, &shares[j]));
        let of_turns = Gram::new(&across.each_ref(), [l, m, n]);
        if !(of_moves.is_open() && of_turns.is_open()) {
            return None;
        }
        let [n0, n1, n2, t0, t1, t2] = &mut self.inverse;
        for i in (0..N).step_by(2) {
            let turning = of_turns.times_wide(&across.each_ref().map(|column| pair(column, i)));
            let moving = of_moves.times_wide(&moves.map(|column| pair(column, i)));
            let less = |k: usize| {
                moving[k]
                    - (both(shares[0][k]) * turning[0]
                        + both(shares[1][k]) * turning[1]
                        + both(shares[2][k]) * turning[2])
            };
            put(n0, i, less(0));
            put(n1, i, less(1));
            put(n2, i, less(2));
            put(t0, i, turning[0]);
            put(t1, i, turning[1]);
            put(t2, i, turning[2]);
        }
        self.measure();
        let ([a, b, c], [d, e, f]) = (of_moves.squares, of_turns.squares);
        Some(is_regular(&[a, b, c, d, e, f]))
    }

    /// Factors any columns in place.
    pub fn renew_by_columns(&mut self, active: &[bool; 6], columns: &[[f64; N]; 6]) -> bool {
        let mut work = Work { q: *columns, r: [[0.0; 6]; 6], squares: [0.0; 6], weight: [0.0; 6] };
        for k in 0..6 {
            work.orthogonalise(k, active);
        }
        work.solve_back(&mut self.inverse);
        self.measure();
        is_regular(&work.squares)
    }

    #[inline(always)]
    fn measure(&mut self) {
        let squares = self.inverse.each_ref().map(|row| inner(row, row));
        self.inverse_norm = libm::sqrt(squares.iter().sum());
    }

    /// Computes the least-squares solution x of A x = b.
    #[inline(always)]
    pub fn solve(&self, b: &[f64; N]) -> [f64; 6] {
        let mut x = [0.0; 6];
        let [r0, r1, r2, r3, r4, r5] = &self.inverse;
        put(&mut x, 0, inners([r0, r1], b));
        put(&mut x, 2, inners([r2, r3], b));
        put(&mut x, 4, inners([r4, r5], b));
        x
    }

    /// Returns the Frobenius norm of the (pseudo-)inverse of A.
    pub fn inverse_norm(&self) -> f64 {
        self.inverse_norm
    }
}

impl<const N: usize> Work<N> {
    /// Subtracts column k from those after it.
    fn orthogonalise(&mut self, k: usize, active: &[bool; 6]) {
        let column = self.q[k];
        let square = inner(&column, &column);
        // An inactive column leaves the others unchanged.
        let square = if active[k] { square } else { 1.0 };
        let weight = if active[k] { 1.0 / square } else { 0.0 };
        (self.squares[k], self.weight[k]) = (square, weight);
        for j in k + 1..6 {
            let along = inner(&column, &self.q[j]) * weight;
            self.r[k][j] = along;
            for i in (0..N).step_by(2) {
                let rest = pair(&self.q[j], i) - both(along) * pair(&column, i);
                put(&mut self.q[j], i, rest);
            }
        }
    }

    /// Solves R M = D⁻¹ Qᵀ from its last row upwards.
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

impl Gram {
    /// Computes the Gram matrix of columns that have `idle` added to their squares.
    #[inline(always)]
    fn new<const N: usize>([a, b, c]: &Triple<'_, N>, idle: [f64; 3]) -> Self {
        let [aa, ab] = inners([a, b], a).to_array();
        let [bb, bc] = inners([b, c], b).to_array();
        let [cc, ca] = inners([c, a], c).to_array();
        let (aa, bb, cc) = (aa + idle[0], bb + idle[1], cc + idle[2]);
        let cofactors = [
            bb * cc - bc * bc,
            cc * aa - ca * ca,
            aa * bb - ab * ab,
            ca * bc - ab * cc,
            ab * ca - bc * aa,
            bc * ab - ca * bb,
        ];
        let volume = aa * cofactors[0] + ab * cofactors[3] + ca * cofactors[5];
        Self { cofactors, over: 1.0 / volume, squares: [aa, bb, cc], volume }
    }

    /// Returns whether the columns are far from linearly dependent.
    #[inline(always)]
    fn is_open(&self) -> bool {
        let [a, b, c] = self.squares;
        self.volume > FLAT * (a * b * c)
    }

    #[inline(always)]
    fn times(&self, v: &[f64; 3]) -> [f64; 3] {
        let [aa, bb, cc, ab, bc, ca] = self.cofactors;
        let [x, y, z] = *v;
        [
            (aa * x + ab * y + ca * z) * self.over,
            (ab * x + bb * y + bc * z) * self.over,
            (ca * x + bc * y + cc * z) * self.over,
        ]
    }

    /// Multiplies two vectors at once.
    #[inline(always)]
    fn times_wide(&self, v: &[f64x2; 3]) -> [f64x2; 3] {
        let [aa, bb, cc, ab, bc, ca] = self.cofactors.map(both);
        let [x, y, z] = *v;
        let over = both(self.over);
        [
            (aa * x + ab * y + ca * z) * over,
            (ab * x + bb * y + bc * z) * over,
            (ca * x + bc * y + cc * z) * over,
        ]
    }
}

/// Computes Tᵀ U, column by column.
#[inline(always)]
fn products<const N: usize>([a, b, c]: &Triple<'_, N>, turns: &Triple<'_, N>) -> [[f64; 3]; 3] {
    let [d, e, f] = turns;
    let [ad, bd] = inners([a, b], d).to_array();
    let [ae, be] = inners([a, b], e).to_array();
    let [af, bf] = inners([a, b], f).to_array();
    let [cd, ce] = inners([d, e], c).to_array();
    let cf = inner(c, f);
    [[ad, bd, cd], [ae, be, ce], [af, bf, cf]]
}

/// Subtracts from a column its shares of three others.
#[inline(always)]
fn across<const N: usize>(
    column: &[f64; N],
    others: &Triple<'_, N>,
    shares: &[f64; 3],
) -> [f64; N] {
    let mut rest = [0.0; N];
    for i in (0..N).step_by(2) {
        let [a, b, c] = others.map(|other| pair(other, i));
        let along = both(shares[1]) * b + both(shares[2]) * c;
        put(&mut rest, i, (pair(column, i) - both(shares[0]) * a) - along);
    }
    rest
}

/// Returns whether no column is nearly dependent on those before it, by the squares of their remainders;
/// inactive columns count as 1 (the others are dimensionless, too).
#[inline(always)]
fn is_regular(squares: &[f64; 6]) -> bool {
    let (a, b, c) = (pair(squares, 0), pair(squares, 2), pair(squares, 4));
    let [even, odd] = a.fast_max(b).fast_max(c).to_array();
    let least =
        both(DEPENDENT * DEPENDENT) * f64x2::new([even, odd]).fast_max(f64x2::new([odd, even]));
    // Any NaN makes a comparison false.
    (a.simd_gt(least) & b.simd_gt(least) & c.simd_gt(least)).all()
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    /// Returns the columns of a well-conditioned tall matrix without structure.
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
        let got = PseudoInverse::new(&a, &[true; 6]).unwrap().solve(&b);
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
        let got = PseudoInverse::new(&a, &active).unwrap().solve(&b);
        for k in 0..6 {
            // As above.
            assert!((got[k] - x[k]).abs() < 1e-12, "{got:?}");
        }
    }

    /// Returns the largest element of M A − 1.
    fn off(a: &[[f64; 6]; 6], inverse: &PseudoInverse<6>) -> f64 {
        let mut most = 0.0_f64;
        for (k, column) in a.iter().enumerate() {
            for (j, value) in inverse.solve(column).iter().enumerate() {
                most = most.max((value - f64::from(u8::from(j == k))).abs());
            }
        }
        most
    }

    #[test]
    fn what_is_not_refused_is_an_inverse_or_too_large_for_any_certificate() {
        let mut rng = Pcg64::seed_from_u64(41);
        let mut draw = || rng.random::<f64>() * 2.0 - 1.0;
        let (mut refused, mut inverted, mut worst) = (0, 0, 0.0_f64);
        for n in 0..40_000 {
            // One column of each triple, or of only one, is nearly a combination of others; the columns take turns.
            let mut a: [[f64; 6]; 6] = core::array::from_fn(|_| core::array::from_fn(|_| draw()));
            let mut nearest = 1.0_f64;
            for (k, others) in [(n % 3, 1 + n / 9 % 2), (3 + n / 3 % 3, 1 + n / 18 % 5)] {
                let share =
                    libm::pow(10.0, 4.5 * (draw() - 1.0)) * f64::from(u8::from(n % 4 > k / 3));
                if share == 0.0 {
                    continue;
                }
                nearest = nearest.min(share);
                a[k] = a[k].map(|value| value * share);
                for other in
                    (1..=others).map(|other| if k < 3 { (k + other) % 3 } else { (k + other) % 6 })
                {
                    let weight = draw();
                    for i in 0..6 {
                        a[k][i] += weight * a[other][i];
                    }
                }
            }
            match PseudoInverse::new(&a, &[true; 6]) {
                // The margin of the certificates is a fifth: this takes a twentieth of it, column
                // by column half as much. Beyond 1e6 the pose is refused.
                Some(inverse) if inverse.inverse_norm() < 1.5e6 => {
                    worst = worst.max(off(&a, &inverse));
                    inverted += u32::from(nearest < 1e-4);
                }
                Some(_) => {}
                None => refused += 1,
            }
        }
        std::println!("refused {refused}, inverted {inverted}, off by {worst:.1e}");
        assert!(worst < 0.01 && inverted > 1_000, "{worst:e}, {inverted}");
    }

    #[test]
    fn three_columns_are_open_by_their_volume_at_all_lengths() {
        // Columns of lengths 4, 3 and 2, the last two at an angle with this squared sine.
        let is_open = |square: f64| {
            let (sine, cosine) = (libm::sqrt(square), libm::sqrt(1.0 - square));
            let columns =
                [[0.0, 0.0, 4.0, 0.0], [3.0, 0.0, 0.0, 0.0], [2.0 * cosine, 0.0, 0.0, 2.0 * sine]];
            Gram::new(&columns.each_ref(), [0.0; 3]).is_open()
        };
        assert!(is_open(1.0) && is_open(0.031));
        assert!(!is_open(0.029) && !is_open(0.0));
    }

    #[test]
    fn a_dependent_column_is_refused() {
        let mut a = tall();
        a[5] = core::array::from_fn(|i| a[0][i] + a[1][i]);
        assert!(PseudoInverse::new(&a, &[true; 6]).is_none());
    }

    #[test]
    fn a_column_depends_on_the_others_by_its_share_of_the_largest_at_any_scale() {
        for scale in [1e-6, 1.0, 1e6] {
            let is_regular = |share: f64| {
                let mut a = [[0.0; 6]; 6];
                for (k, column) in a.iter_mut().enumerate() {
                    column[k] = if k == 3 { share * scale } else { scale };
                }
                PseudoInverse::new(&a, &[true; 6]).is_some()
            };
            assert!(is_regular(1.1e-10) && !is_regular(0.9e-10), "{scale}");
        }
        // For every position of the largest and the smallest.
        for (largest, smallest) in (0..36).map(|k| (k / 6, k % 6)).filter(|(a, b)| a != b) {
            let is_regular = |share: f64| {
                let mut squares = [1e-4; 6];
                (squares[largest], squares[smallest]) = (1.0, share * share);
                super::is_regular(&squares)
            };
            assert!(is_regular(1.1e-10) && !is_regular(0.9e-10) && !is_regular(f64::NAN));
        }
    }
}
