// SPDX-License-Identifier: GPL-2.0-or-later
//! Bounds of third derivatives: Taylor coefficients with interval values.
//!
//! A [`Jet`] holds the coefficients of f(x + s e_k + t e_j) for s⁰ to s² and t⁰, t¹,
//! each as an interval that holds it for every x of a box. The coefficient of s²t is
//! ½ ∂_k ∂_k ∂_j f, also where j = k.

use crate::proof::interval::Interval;
use std::ops::{Add, Mul, Neg, Sub};

/// Taylor coefficients by powers of s (first index) and t (second one).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet(pub [[Interval; 2]; 3]);

impl Jet {
    /// A constant.
    pub const fn constant(x: f64) -> Self {
        Self::of(Interval::point(x))
    }

    const fn of(x: Interval) -> Self {
        let zero = Interval::point(0.0);
        Self([[x, zero], [zero, zero], [zero, zero]])
    }

    /// A coordinate in `x`; whether it is the one that s moves, and that t moves.
    pub fn variable(x: Interval, along_s: bool, along_t: bool) -> Self {
        let mut jet = Self::of(x);
        let one = Interval::point(1.0);
        if along_s {
            jet.0[1][0] = one;
        }
        if along_t {
            jet.0[0][1] = one;
        }
        jet
    }

    /// ½ ∂_k ∂_k ∂_j f.
    pub fn third(&self) -> Interval {
        self.0[2][1]
    }

    /// ∂_j f, for comparison with the core's Jacobian.
    #[cfg(test)]
    pub fn slope(&self) -> Interval {
        self.0[0][1]
    }

    /// The function of this value, given its derivatives of order 0 to 3 there.
    fn composed(self, [value, first, second, third]: [Interval; 4]) -> Self {
        let [[_, t], [s, st], [ss, sst]] = self.0;
        let square = s.squared();
        let half = second * 0.5;
        Self([
            [value, first * t],
            [first * s, first * st + second * (s * t)],
            [
                first * ss + half * square,
                first * sst + second * (ss * t + s * st) + third * 0.5 * (square * t),
            ],
        ])
    }

    /// Square root; unbounded where the value may be 0 or less.
    pub fn sqrt(self) -> Self {
        let x = self.0[0][0];
        if !(x.low > 0.0) {
            return self.composed([Interval::ALL; 4]);
        }
        let (root, over) = (x.sqrt(), x.inverse());
        let first = root.inverse() * 0.5;
        let second = first * over * -0.5;
        let third = second * over * -1.5;
        self.composed([root, first, second, third])
    }

    /// 1 / self; unbounded where the value may be 0.
    pub fn inverse(self) -> Self {
        let over = self.0[0][0].inverse();
        let square = over.squared();
        let second = square * over * 2.0;
        let third = square.squared() * -6.0;
        self.composed([over, -square, second, third])
    }

    /// Its square.
    pub fn squared(self) -> Self {
        let x = self.0[0][0];
        self.composed([x.squared(), x * 2.0, Interval::point(2.0), Interval::ZERO])
    }

    /// Sine and cosine of an angle in radians.
    pub fn sincos(self) -> (Self, Self) {
        let x = self.0[0][0];
        let s = x.sin();
        let c = (x + Interval::point(std::f64::consts::FRAC_PI_2)).sin();
        (self.composed([s, c, -s, -c]), self.composed([c, -s, -c, s]))
    }

    /// Angle of the direction (x, y), up to a constant; unbounded where the directions
    /// fill more than a half plane.
    pub fn angle(y: Self, x: Self) -> Self {
        // Tangent of the angle from the middle direction: the constant left out is its angle.
        let (a, b) = (x.0[0][0].middle(), y.0[0][0].middle());
        let along = x * a + y * b;
        if !(along.0[0][0].low > 0.0) {
            return x.composed([Interval::ALL; 4]);
        }
        let tangent = (y * a - x * b) * along.inverse();
        let z = tangent.0[0][0];
        let first = (z.squared() + Interval::point(1.0)).inverse();
        let square = first.squared();
        let second = z * square * -2.0;
        let third = (z.squared() * 6.0 - Interval::point(2.0)) * square * first;
        let value = Interval::new(z.low.atan(), z.high.atan());
        tangent.composed([value, first, second, third])
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let mut out = self;
        for (row, other) in out.0.iter_mut().zip(o.0) {
            for (x, y) in row.iter_mut().zip(other) {
                *x = *x + y;
            }
        }
        out
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.map(|row| row.map(|x| -x)))
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl Mul<f64> for Jet {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|row| row.map(|x| x * factor)))
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let ([[a, at], [a_s, ast], [ass, asst]], [[b, bt], [b_s, bst], [bss, bsst]]) =
            (self.0, o.0);
        Self([
            [a * b, a * bt + at * b],
            [a * b_s + a_s * b, a * bst + at * b_s + a_s * bt + ast * b],
            [
                a * bss + a_s * b_s + ass * b,
                a * bsst + at * bss + a_s * bst + ast * b_s + ass * bt + asst * b,
            ],
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function of two numbers that uses everything a jet can do.
    fn jets(x: Jet, y: Jet) -> Jet {
        let (s, c) = (x * y).sincos();
        (s + Jet::constant(2.0)).sqrt() * (c + Jet::constant(3.0)).inverse()
            + Jet::angle(y + s, x.squared() + Jet::constant(1.0))
    }

    fn plain(x: f64, y: f64) -> f64 {
        let (s, c) = (x * y).sin_cos();
        (s + 2.0).sqrt() / (c + 3.0) + (y + s).atan2(x * x + 1.0)
    }

    #[test]
    fn coefficients_are_those_of_differences_at_a_point_and_hold_them_over_a_box() {
        // Third differences: rounding 1e-15/h³ and curvature h² balance at 1e-5.
        const H: f64 = 2e-3;
        let (x, y) = (0.4, -0.7);
        let d = |p: f64, q: f64| plain(x + p * H, y + q * H);
        let xxy = (d(1., 1.) - 2. * d(0., 1.) + d(-1., 1.) - d(1., -1.) + 2. * d(0., -1.)
            - d(-1., -1.))
            / (2.0 * H * H * H);
        let xxx = (d(2., 0.) - 2. * d(1., 0.) + 2. * d(-1., 0.) - d(-2., 0.)) / (2.0 * H * H * H);
        let at = |w: f64, j: usize| {
            let i = |v: f64| Interval::new(v - w, v + w);
            jets(Jet::variable(i(x), true, j == 0), Jet::variable(i(y), false, j == 1)).third()
        };
        for (j, expected) in [(0, xxx / 2.0), (1, xxy / 2.0)] {
            let exact = at(0.0, j);
            assert!((exact.middle() - expected).abs() < 1e-4, "{exact:?} {expected}");
            let wide = at(0.05, j);
            assert!(wide.low < expected && expected < wide.high, "{wide:?} {expected}");
            assert!(wide.magnitude() < 10.0, "{wide:?}");
        }
    }

    #[test]
    fn what_may_divide_by_zero_is_unbounded() {
        let x = Jet::variable(Interval::new(-1.0, 1.0), true, true);
        assert_eq!(x.inverse().third().magnitude(), f64::INFINITY);
        assert_eq!(x.sqrt().third().magnitude(), f64::INFINITY);
        assert_eq!(Jet::angle(x, x).third().magnitude(), f64::INFINITY);
    }
}
