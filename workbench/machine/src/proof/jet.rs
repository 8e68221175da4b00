// SPDX-License-Identifier: GPL-2.0-or-later
//! Derivatives of functions, by interval arithmetic: the only automatic differentiation of the host tools.
//!
//! A [`Jet`] has a function of N coordinates over a box: its value, all first and second derivatives, and for
//! order 3 the third derivatives ∂_k ∂_k ∂_j f, each as an interval that contains it for every point of the box.
//! Products and compositions need no others, and common terms of several third derivatives are computed once.
//! Over a single point all intervals are thin: only rounding in each operation widens them.

use crate::proof::interval::{Interval, QUARTER_TURN};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Derivatives up to the second or third in N coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet<const N: usize, const ORDER: usize> {
    /// Value.
    pub value: Interval,
    first: [Interval; N],
    /// Derivatives by two coordinates in either order.
    second: [[Interval; N]; N],
    /// Derivatives twice by the first coordinate and once by the second one; zeros for order 2.
    third: [[Interval; N]; N],
}

/// A function of one parameter with its first two derivatives.
pub type Taylor = Jet<1, 2>;

impl<const N: usize, const ORDER: usize> Jet<N, ORDER> {
    /// Returns a constant.
    pub const fn constant(x: f64) -> Self {
        Self::held(Interval::point(x))
    }

    /// Returns an interval that does not depend on the coordinates.
    pub const fn held(value: Interval) -> Self {
        let zeros = [[Interval::ZERO; N]; N];
        Self { value, first: [Interval::ZERO; N], second: zeros, third: zeros }
    }

    /// Returns the coordinate with this index.
    pub const fn variable(x: Interval, place: usize) -> Self {
        let mut jet = Self::held(x);
        jet.first[place] = Interval::point(1.0);
        jet
    }

    /// Returns a jet of unknown values.
    const fn unknown() -> Self {
        let all = [[Interval::ALL; N]; N];
        Self { value: Interval::ALL, first: [Interval::ALL; N], second: all, third: all }
    }

    /// Returns the same function of M coordinates, given the indices of its own among them, if any.
    pub fn among<const M: usize>(&self, places: [Option<usize>; N]) -> Jet<M, ORDER> {
        let mut jet = Jet::held(self.value);
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

    /// Returns ∂_k ∂_k ∂_j f.
    pub const fn third(&self, k: usize, j: usize) -> Interval {
        self.third[k][j]
    }

    /// Returns ∂_j f, for comparison with the core's Jacobian.
    #[cfg(test)]
    pub fn slope(&self, j: usize) -> Interval {
        self.first[j]
    }

    /// Creates a jet from its value and functions of the indices of derivatives; the
    /// first index of a third derivative is the one that counts twice.
    fn with<T: Fn(usize) -> Interval>(
        value: Interval,
        first: impl Fn(usize) -> Interval,
        second: impl Fn(usize, usize) -> Interval,
        third: impl Fn(usize) -> T,
    ) -> Self {
        let mut jet = Self::held(value);
        for k in 0..N {
            jet.first[k] = first(k);
            for j in 0..=k {
                jet.second[k][j] = second(k, j);
                jet.second[j][k] = jet.second[k][j];
            }
            if ORDER > 2 {
                let third = third(k);
                jet.third[k] = std::array::from_fn(third);
            }
        }
        jet
    }

    /// Combines all intervals with those of another jet.
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
                if ORDER > 2 {
                    self.third[k][j] = of(self.third[k][j], o.third[k][j]);
                }
            }
        }
    }

    /// Returns the sum with a multiple of another jet.
    #[inline]
    pub fn and(self, o: &Self, factor: f64) -> Self {
        self.beside(o, |x, y| x + y * factor)
    }

    /// Composes with an outer function, given its derivatives from order 0 to that of the jet.
    fn composed(&self, derivatives: &[Interval]) -> Self {
        let Self { first: f, second: ff, third: fff, .. } = self;
        let (d1, d2) = (derivatives[1], derivatives[2]);
        let product = |k: usize, j: usize| if k == j { f[k].squared() } else { f[k] * f[j] };
        Self::with(
            derivatives[0],
            |k| d1 * f[k],
            |k, j| d1 * ff[k][j] + d2 * product(k, j),
            |k| {
                let square = d2 * ff[k][k] + derivatives[3] * f[k].squared();
                let twice = d2 * (f[k] + f[k]);
                move |j| d1 * fff[k][j] + square * f[j] + twice * ff[k][j]
            },
        )
    }

    /// Computes a product by Leibniz's rule.
    fn product(&self, o: &Self) -> Self {
        let Self { value: a, first: f, second: ff, third: fff } = self;
        let Self { value: b, first: g, second: gg, third: ggg } = o;
        Self::with(
            *a * *b,
            |k| *a * g[k] + f[k] * *b,
            |k, j| {
                let mixed = if k == j { f[k] * (g[k] + g[k]) } else { f[k] * g[j] + f[j] * g[k] };
                *a * gg[k][j] + mixed + ff[k][j] * *b
            },
            |k| {
                let (two_f, two_g) = (f[k] + f[k], g[k] + g[k]);
                move |j| {
                    let ends = *a * ggg[k][j] + fff[k][j] * *b;
                    let once = f[j] * gg[k][k] + ff[k][k] * g[j];
                    ends + once + (two_f * gg[k][j] + ff[k][j] * two_g)
                }
            },
        )
    }

    /// Returns the square root; its derivatives are unbounded if the value may be 0 or less.
    pub fn sqrt(&self) -> Self {
        let (root, over) = (self.value.sqrt(), self.value.inverse());
        let first = root.inverse() * 0.5;
        let second = first * over * -0.5;
        let third = second * over * -1.5;
        self.composed(&[root, first, second, third])
    }

    /// Returns 1 / self; unbounded if the value may be 0.
    pub fn inverse(&self) -> Self {
        let over = self.value.inverse();
        let square = over.squared();
        let second = square * over * 2.0;
        let third = square.squared() * -6.0;
        self.composed(&[over, -square, second, third])
    }

    /// Returns the square.
    pub fn squared(&self) -> Self {
        let Self { value: x, first: f, second: ff, third: fff } = self;
        let twice = |x: Interval| x + x;
        Self::with(
            x.squared(),
            |k| *x * twice(f[k]),
            |k, j| twice(*x * ff[k][j] + if k == j { f[k].squared() } else { f[k] * f[j] }),
            |k| {
                let two_f = twice(f[k]);
                move |j| twice(*x * fff[k][j] + ff[k][k] * f[j] + two_f * ff[k][j])
            },
        )
    }

    /// Returns the sine of an angle in radians.
    pub fn sin(&self) -> Self {
        let (s, c) = (self.value.sin(), self.value.cos());
        self.composed(&[s, c, -s, -c])
    }

    /// Returns the cosine of an angle in radians.
    pub fn cos(&self) -> Self {
        let (s, c) = (self.value.sin(), self.value.cos());
        self.composed(&[c, -s, -c, s])
    }

    /// Returns the arc tangent in radians.
    pub fn atan(&self) -> Self {
        let square = self.value.squared();
        let first = (square + Interval::point(1.0)).inverse();
        let second = self.value * first.squared() * -2.0;
        let third = (square * 6.0 - Interval::point(2.0)) * first.squared() * first;
        self.composed(&[self.value.rising(f64::atan), first, second, third])
    }

    /// Returns the angle of the direction (x, y) in radians, from −π to π at the center of the box; unbounded if the
    /// directions span more than a half plane.
    pub fn angle(y: &Self, x: &Self) -> Self {
        // Tangent of the angle from the center direction.
        let (a, b) = (x.value.middle(), y.value.middle());
        let along = (*x * a).and(y, b);
        if !(along.value.low > 0.0) {
            return Self::unknown();
        }
        let tangent = (*y * a).and(x, -b) / along;
        tangent.atan() + Self::held(Interval::of_function(b.atan2(a)))
    }
}

/// Additional functions for curves.
impl Taylor {
    /// Creates a function from its value and derivatives.
    pub const fn new(value: Interval, first: Interval, second: Interval) -> Self {
        Self { value, first: [first], second: [[second]], third: [[Interval::ZERO]] }
    }

    /// Returns the first derivative.
    pub const fn first(&self) -> Interval {
        self.first[0]
    }

    /// Returns the second derivative.
    pub const fn second(&self) -> Interval {
        self.second[0][0]
    }

    /// Returns the value of a constant function, rounded to `f64`.
    pub fn as_constant(&self) -> Option<f64> {
        let is_held = self.first() == Interval::ZERO && self.second() == Interval::ZERO;
        (is_held && self.value.is_thin()).then(|| self.value.middle())
    }

    /// Returns the power with an integer exponent.
    pub fn powi(self, n: i32) -> Self {
        let x = self.value;
        let power = |n: i32| if n == 0 { Interval::point(1.0) } else { x.powi(n) };
        let (order, whole) = (f64::from(n), power(n));
        match n {
            0 => Self::constant(1.0),
            1 => self,
            _ => {
                let second = power(n - 2) * (order * (order - 1.0));
                self.composed(&[whole, power(n - 1) * order, second])
            }
        }
    }

    /// Returns the power with a non-integer exponent.
    pub fn powf(self, n: f64) -> Self {
        let power = |n: f64| match n > 0.0 {
            true => self.value.positive().rising(|x| x.powf(n)),
            false => self.value.positive().rising(|x| x.powf(-n)).inverse(),
        };
        self.composed(&[power(n), power(n - 1.0) * n, power(n - 2.0) * (n * (n - 1.0))])
    }

    /// Returns the exponential.
    pub fn exp(self) -> Self {
        let value = self.value.rising(f64::exp);
        self.composed(&[value, value, value])
    }

    /// Returns the natural logarithm.
    pub fn ln(self) -> Self {
        let over = self.value.inverse();
        self.composed(&[self.value.positive().rising(f64::ln), over, -over.squared()])
    }

    /// Returns the hyperbolic sine.
    pub fn sinh(self) -> Self {
        let sinh = self.value.rising(f64::sinh);
        self.composed(&[sinh, self.value.cosh(), sinh])
    }

    /// Returns the hyperbolic cosine.
    pub fn cosh(self) -> Self {
        let cosh = self.value.cosh();
        self.composed(&[cosh, self.value.rising(f64::sinh), cosh])
    }

    /// Returns the hyperbolic tangent.
    pub fn tanh(self) -> Self {
        let tanh = self.value.rising(f64::tanh);
        let first = Interval::point(1.0) - tanh.squared();
        self.composed(&[tanh, first, tanh * first * -2.0])
    }

    /// Returns the inverse hyperbolic sine.
    pub fn asinh(self) -> Self {
        let over = (self.value.squared() + Interval::point(1.0)).sqrt().inverse();
        let second = -(self.value * over.powi(3));
        self.composed(&[self.value.rising(f64::asinh), over, second])
    }

    /// Returns the arc sine in radians.
    pub fn asin(self) -> Self {
        let over = (Interval::point(1.0) - self.value.squared()).sqrt().inverse();
        let value = self.value.rising(|x| x.clamp(-1.0, 1.0).asin());
        self.composed(&[value, over, self.value * over.powi(3)])
    }

    /// Returns the arc cosine in radians.
    pub fn acos(self) -> Self {
        Self::held(QUARTER_TURN) - self.asin()
    }
}

impl<const N: usize, const ORDER: usize> Add for Jet<N, ORDER> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        self.beside(&o, |x, y| x + y)
    }
}

impl<const N: usize, const ORDER: usize> AddAssign<&Self> for Jet<N, ORDER> {
    #[inline]
    fn add_assign(&mut self, o: &Self) {
        self.change(o, |x, y| x + y);
    }
}

impl<const N: usize, const ORDER: usize> Neg for Jet<N, ORDER> {
    type Output = Self;
    fn neg(self) -> Self {
        self.beside(&self, |x, _| -x)
    }
}

impl<const N: usize, const ORDER: usize> Sub for Jet<N, ORDER> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        self.beside(&o, |x, y| x - y)
    }
}

impl<const N: usize, const ORDER: usize> Mul<f64> for Jet<N, ORDER> {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        self.beside(&self, |x, _| x * factor)
    }
}

impl<const N: usize, const ORDER: usize> Mul for Jet<N, ORDER> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        self.product(&o)
    }
}

impl<const N: usize, const ORDER: usize> Div for Jet<N, ORDER> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        Self { value: self.value / o.value, ..self.product(&o.inverse()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a function of two numbers that uses every operation of a jet.
    fn jets(x: Jet<2, 3>, y: Jet<2, 3>) -> Jet<2, 3> {
        let (s, c) = ((x * y).sin(), (x * y).cos());
        (s + Jet::constant(2.0)).sqrt() * (c + Jet::constant(3.0)).inverse()
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
            jets(Jet::variable(i(x), 0), Jet::variable(i(y), 1)).third(0, j)
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
        let x = Jet::<1, 3>::variable(Interval::new(-1.0, 1.0), 0);
        assert_eq!(x.inverse().third(0, 0).magnitude(), f64::INFINITY);
        assert_eq!(x.sqrt().third(0, 0).magnitude(), f64::INFINITY);
        assert_eq!(Jet::angle(&x, &x).third(0, 0).magnitude(), f64::INFINITY);
    }

    /// Returns a function of one number that uses every operation.
    fn taylor(t: Taylor) -> Taylor {
        let one = Taylor::constant(1.0);
        let waves = t.sin() * t.cos() + (t.squared() + one).sqrt().ln() / (one + t.exp());
        let powers = t.powi(3) * t.powf(0.7) + t.inverse() + t.powi(-2);
        let hyperbolic = t.sinh() * 0.1 + t.cosh() * 0.2 + t.tanh() + t.asinh();
        let half = t * 0.5;
        let arcs =
            half.asin() + half.acos() * 2.0 + t.atan() + Taylor::angle(&t.sin(), &(t.cos() * 0.5));
        waves + powers - hyperbolic + arcs
    }

    fn plain_of_one(t: f64) -> f64 {
        let waves = t.sin() * t.cos() + (t * t + 1.0).sqrt().ln() / (1.0 + t.exp());
        let powers = t.powi(3) * t.powf(0.7) + 1.0 / t + 1.0 / (t * t);
        let hyperbolic = 0.1 * t.sinh() + 0.2 * t.cosh() + t.tanh() + t.asinh();
        let h = 0.5 * t;
        let arcs = h.asin() + 2.0 * h.acos() + t.atan() + t.sin().atan2(0.5 * t.cos());
        waves + powers - hyperbolic + arcs
    }

    #[test]
    fn derivatives_by_one_parameter_are_those_of_differences_and_hold_them_over_a_range() {
        const H: f64 = 1e-4;
        let t = 0.8;
        let at = taylor(Taylor::variable(Interval::point(t), 0));
        let first = (plain_of_one(t + H) - plain_of_one(t - H)) / (2.0 * H);
        let second = (plain_of_one(t + H) - 2.0 * plain_of_one(t) + plain_of_one(t - H)) / (H * H);
        assert!((at.value.middle() - plain_of_one(t)).abs() < 1e-14, "{at:?}");
        // Truncation H² times a derivative of some tens; rounding 1e-16/H².
        assert!((at.first().middle() - first).abs() < 1e-5, "{at:?} {first}");
        assert!((at.second().middle() - second).abs() < 1e-5, "{at:?} {second}");
        let wide = taylor(Taylor::variable(Interval::about(t, 0.01), 0));
        for n in -10..=10 {
            let at = taylor(Taylor::variable(Interval::point(t + 1e-3 * f64::from(n)), 0));
            for (wide, at) in
                [(wide.value, at.value), (wide.first(), at.first()), (wide.second(), at.second())]
            {
                assert!(wide.contains(at.middle()), "{wide:?} {at:?}");
            }
        }
        assert!(wide.second().magnitude() < 100.0, "{wide:?}");
    }
}
