// SPDX-License-Identifier: GPL-2.0-or-later
//! Bounds of third derivatives, by interval arithmetic.
//!
//! A [`Jet`] holds a function of N coordinates over a box: its value, all first and second derivatives, and of the
//! third ones ∂_k ∂_k ∂_j f, each as an interval that holds it for every point of the box. Products and
//! compositions need no others, and what several third derivatives have in common is computed once.

use crate::proof::interval::Interval;
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Derivatives up to the third in N coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet<const N: usize> {
    value: Interval,
    first: [Interval; N],
    /// By two coordinates in either order.
    second: [[Interval; N]; N],
    /// Twice by the first coordinate and once by the second one.
    third: [[Interval; N]; N],
}

impl<const N: usize> Jet<N> {
    /// A constant.
    pub const fn constant(x: f64) -> Self {
        Self::of(Interval::point(x))
    }

    const fn of(value: Interval) -> Self {
        let zeros = [[Interval::ZERO; N]; N];
        Self { value, first: [Interval::ZERO; N], second: zeros, third: zeros }
    }

    /// A number in `x`: the coordinate with this place, or a constant.
    pub const fn variable(x: Interval, place: Option<usize>) -> Self {
        let mut jet = Self::of(x);
        if let Some(k) = place {
            jet.first[k] = Interval::point(1.0);
        }
        jet
    }

    /// The same as a function of M coordinates: where among them its own are, if they are.
    pub fn among<const M: usize>(&self, places: [Option<usize>; N]) -> Jet<M> {
        let mut jet = Jet::of(self.value);
        let own = || places.iter().enumerate().filter_map(|(k, place)| Some((k, (*place)?)));
        for (k, p) in own() {
            jet.first[p] = self.first[k];
            for (j, q) in own() {
                jet.second[p][q] = self.second[k][j];
                jet.third[p][q] = self.third[k][j];
            }
        }
        jet
    }

    /// ∂_k ∂_k ∂_j f.
    pub const fn third(&self, k: usize, j: usize) -> Interval {
        self.third[k][j]
    }

    /// ∂_j f, for comparison with the core's Jacobian.
    #[cfg(test)]
    pub fn slope(&self, j: usize) -> Interval {
        self.first[j]
    }

    /// A jet with this value, and with derivatives that are functions of the numbers of their coordinates.
    fn with(
        value: Interval,
        first: impl Fn(usize) -> Interval,
        second: impl Fn(usize, usize) -> Interval,
        third: impl Fn(usize, usize) -> Interval,
    ) -> Self {
        let mut jet = Self::of(value);
        for k in 0..N {
            jet.first[k] = first(k);
            for j in 0..=k {
                jet.second[k][j] = second(k, j);
                jet.second[j][k] = jet.second[k][j];
            }
            for j in 0..N {
                jet.third[k][j] = third(k, j);
            }
        }
        jet
    }

    /// Every number of it changed, beside the same one of another jet.
    #[inline]
    fn beside(mut self, o: &Self, of: impl Fn(Interval, Interval) -> Interval) -> Self {
        self.change(o, of);
        self
    }

    #[inline]
    fn change(&mut self, o: &Self, of: impl Fn(Interval, Interval) -> Interval) {
        self.value = of(self.value, o.value);
        for k in 0..N {
            self.first[k] = of(self.first[k], o.first[k]);
            for j in 0..N {
                self.second[k][j] = of(self.second[k][j], o.second[k][j]);
                self.third[k][j] = of(self.third[k][j], o.third[k][j]);
            }
        }
    }

    /// This one, and as much of another.
    #[inline]
    pub fn and(self, o: &Self, factor: f64) -> Self {
        self.beside(o, |x, y| x + y * factor)
    }

    /// The function of this value, given its derivatives of order 0 to 3 there.
    fn composed(&self, [value, d1, d2, d3]: [Interval; 4]) -> Self {
        let Self { first: f, second: ff, third: fff, .. } = self;
        let twice = f.map(|f| d2 * (f + f));
        let squares: [Interval; N] = std::array::from_fn(|k| d2 * ff[k][k] + d3 * f[k].squared());
        let product = |k: usize, j: usize| if k == j { f[k].squared() } else { f[k] * f[j] };
        Self::with(
            value,
            |k| d1 * f[k],
            |k, j| d1 * ff[k][j] + d2 * product(k, j),
            |k, j| d1 * fff[k][j] + squares[k] * f[j] + twice[k] * ff[k][j],
        )
    }

    /// Leibniz's rule.
    fn product(&self, o: &Self) -> Self {
        let Self { value: a, first: f, second: ff, third: fff } = self;
        let Self { value: b, first: g, second: gg, third: ggg } = o;
        let (two_f, two_g) = (f.map(|x| x + x), g.map(|x| x + x));
        Self::with(
            *a * *b,
            |k| *a * g[k] + f[k] * *b,
            |k, j| {
                let mixed = if k == j { f[k] * two_g[k] } else { f[k] * g[j] + f[j] * g[k] };
                *a * gg[k][j] + mixed + ff[k][j] * *b
            },
            |k, j| {
                let ends = *a * ggg[k][j] + fff[k][j] * *b;
                let once = f[j] * gg[k][k] + ff[k][k] * g[j];
                ends + once + (two_f[k] * gg[k][j] + ff[k][j] * two_g[k])
            },
        )
    }

    /// Square root; unbounded where the value may be 0 or less.
    pub fn sqrt(&self) -> Self {
        let x = self.value;
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
    pub fn inverse(&self) -> Self {
        let over = self.value.inverse();
        let square = over.squared();
        let second = square * over * 2.0;
        let third = square.squared() * -6.0;
        self.composed([over, -square, second, third])
    }

    /// Its square.
    pub fn squared(&self) -> Self {
        let Self { value: x, first: f, second: ff, third: fff } = self;
        let two_f = f.map(|x| x + x);
        let twice = |x: Interval| x + x;
        Self::with(
            x.squared(),
            |k| *x * two_f[k],
            |k, j| twice(*x * ff[k][j] + if k == j { f[k].squared() } else { f[k] * f[j] }),
            |k, j| twice(*x * fff[k][j] + ff[k][k] * f[j] + two_f[k] * ff[k][j]),
        )
    }

    /// Sine and cosine of an angle in radians.
    pub fn sincos(&self) -> (Self, Self) {
        let (s, c) = (self.value.sin(), self.value.cos());
        (self.composed([s, c, -s, -c]), self.composed([c, -s, -c, s]))
    }

    /// Angle of the direction (x, y), up to a constant; unbounded where the directions
    /// fill more than a half plane.
    pub fn angle(y: &Self, x: &Self) -> Self {
        // Tangent of the angle from the middle direction: the constant left out is its angle.
        let (a, b) = (x.value.middle(), y.value.middle());
        let along = (*x * a).and(y, b);
        if !(along.value.low > 0.0) {
            return x.composed([Interval::ALL; 4]);
        }
        let tangent = &(*y * a).and(x, -b) * &along.inverse();
        let z = tangent.value;
        let first = (z.squared() + Interval::point(1.0)).inverse();
        let square = first.squared();
        let second = z * square * -2.0;
        let third = (z.squared() * 6.0 - Interval::point(2.0)) * square * first;
        let value = z.rising(f64::atan);
        tangent.composed([value, first, second, third])
    }
}

impl<const N: usize> Add for Jet<N> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        self.beside(&o, |x, y| x + y)
    }
}

impl<const N: usize> AddAssign<&Self> for Jet<N> {
    #[inline]
    fn add_assign(&mut self, o: &Self) {
        self.change(o, |x, y| x + y);
    }
}

impl<const N: usize> Neg for Jet<N> {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl<const N: usize> Sub for Jet<N> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        self.beside(&o, |x, y| x - y)
    }
}

impl<const N: usize> Mul<f64> for Jet<N> {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        self.beside(&self, |x, _| x * factor)
    }
}

impl<const N: usize> Mul for &Jet<N> {
    type Output = Jet<N>;
    fn mul(self, o: Self) -> Jet<N> {
        self.product(o)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function of two numbers that uses everything a jet can do.
    fn jets(x: Jet<2>, y: Jet<2>) -> Jet<2> {
        let (s, c) = (&x * &y).sincos();
        &(s + Jet::constant(2.0)).sqrt() * &(c + Jet::constant(3.0)).inverse()
            + Jet::angle(&(y + s), &(x.squared() + Jet::constant(1.0)))
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
            jets(Jet::variable(i(x), Some(0)), Jet::variable(i(y), Some(1))).third(0, j)
        };
        for (j, expected) in [(0, xxx), (1, xxy)] {
            let exact = at(0.0, j);
            assert!((exact.middle() - expected).abs() < 2e-4, "{exact:?} {expected}");
            let wide = at(0.05, j);
            assert!(wide.low < expected && expected < wide.high, "{wide:?} {expected}");
            assert!(wide.magnitude() < 20.0, "{wide:?}");
        }
    }

    #[test]
    fn what_may_divide_by_zero_is_unbounded() {
        let x = Jet::<1>::variable(Interval::new(-1.0, 1.0), Some(0));
        assert_eq!(x.inverse().third(0, 0).magnitude(), f64::INFINITY);
        assert_eq!(x.sqrt().third(0, 0).magnitude(), f64::INFINITY);
        assert_eq!(Jet::angle(&x, &x).third(0, 0).magnitude(), f64::INFINITY);
    }
}
