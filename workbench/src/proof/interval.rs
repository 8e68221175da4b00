// SPDX-License-Identifier: GPL-2.0-or-later
//! Arithmetic of intervals.
//!
//! Ends are rounded to nearest, not outwards; who proves with them keeps a margin above
//! rounding.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::{Add, Div, Mul, Neg, Sub};
use wide::f64x2;

/// Numbers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// All numbers: nothing is known.
    pub const ALL: Self = Self::new(f64::NEG_INFINITY, f64::INFINITY);

    /// 0.
    pub const ZERO: Self = Self::point(0.0);

    /// One number.
    pub const fn point(x: f64) -> Self {
        Self { low: x, high: x }
    }

    /// Of two numbers in order.
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// All numbers that are no farther than `radius` from `middle`.
    pub fn about(middle: f64, radius: f64) -> Self {
        Self::new(middle - radius, middle + radius)
    }

    /// Whether it is one number.
    pub fn is_point(self) -> bool {
        self.low == self.high
    }

    /// Whether a number is in it.
    pub fn contains(self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// Largest magnitude; infinite where it is not known.
    pub fn magnitude(self) -> f64 {
        let magnitude = self.low.abs().max(self.high.abs());
        if self.low.is_nan() || self.high.is_nan() { f64::INFINITY } else { magnitude }
    }

    /// The number in the middle.
    pub fn middle(self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// Products of equal numbers: never negative, unlike `self * self`.
    pub fn squared(self) -> Self {
        self.powi(2)
    }

    /// Products of `n` equal numbers.
    pub fn powi(self, n: i32) -> Self {
        if n < 0 {
            return self.powi(-n).inverse();
        }
        let (a, b) = (self.low.powi(n), self.high.powi(n));
        let low = if n > 0 && n % 2 == 0 && self.contains(0.0) { 0.0 } else { a.min(b) };
        Self::new(low, a.max(b))
    }

    /// 1 / self; everything where self may be 0.
    pub fn inverse(self) -> Self {
        if self.low > 0.0 || self.high < 0.0 {
            Self::new(1.0 / self.high, 1.0 / self.low)
        } else {
            Self::ALL
        }
    }

    /// What is below 0 counts as 0.
    pub fn sqrt(self) -> Self {
        self.rising(|x| x.max(0.0).sqrt())
    }

    /// A function that never falls.
    pub fn rising(self, of: impl Fn(f64) -> f64) -> Self {
        Self::new(of(self.low), of(self.high))
    }

    /// Sines of angles in radians.
    pub fn sin(self) -> Self {
        self.wave(self.low.sin(), self.high.sin(), FRAC_PI_2)
    }

    /// Cosines of angles in radians.
    pub fn cos(self) -> Self {
        self.wave(self.low.cos(), self.high.cos(), 0.0)
    }

    /// A wave with these values at the ends and a crest at an angle.
    fn wave(self, a: f64, b: f64, crest: f64) -> Self {
        let holds = |angle: f64| {
            let next = angle + ((self.low - angle) / TAU).ceil() * TAU;
            !(next > self.high)
        };
        let low = if holds(crest + PI) { -1.0 } else { a.min(b) };
        let high = if holds(crest) { 1.0 } else { a.max(b) };
        Self::new(low, high)
    }

    /// A product where one may be infinite or NaN: 0 by anything is 0.
    #[cold]
    fn unbounded_product(self, o: Self) -> Self {
        let is_zero = |i: Self| i.low == 0.0 && i.high == 0.0;
        if is_zero(self) || is_zero(o) {
            return Self::ZERO;
        }
        let products = [self.low * o.low, self.low * o.high, self.high * o.low, self.high * o.high];
        if products.iter().any(|p| p.is_nan()) {
            return Self::ALL;
        }
        let [a, b, c, d] = products;
        Self::new(a.min(b).min(c.min(d)), a.max(b).max(c.max(d)))
    }

    /// Hyperbolic cosines.
    pub fn cosh(self) -> Self {
        let (a, b) = (self.low.cosh(), self.high.cosh());
        Self::new(if self.contains(0.0) { 1.0 } else { a.min(b) }, a.max(b))
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.low + o.low, self.high + o.high)
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.high, -self.low)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        // The four products, two and two.
        let ends = f64x2::new([self.low, self.high]);
        let (one, other) = (ends * f64x2::new([o.low, o.high]), ends * f64x2::new([o.high, o.low]));
        let [a, b] = (one + other).to_array();
        if (a + b).is_finite() {
            // One instruction each, which `f64::min` is not: no product is NaN.
            let ([a, b], [c, d]) = (one.fast_min(other).to_array(), one.fast_max(other).to_array());
            return Self::new(if a < b { a } else { b }, if c > d { c } else { d });
        }
        self.unbounded_product(o)
    }
}

impl Mul<f64> for Interval {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        match self.low.is_finite() && self.high.is_finite() && factor.is_finite() {
            true if factor < 0.0 => Self::new(self.high * factor, self.low * factor),
            true => Self::new(self.low * factor, self.high * factor),
            false => self.unbounded_product(Self::point(factor)),
        }
    }
}

impl Div for Interval {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        // At a point the quotient is rounded once.
        match self.is_point() && o.is_point() && o.low != 0.0 {
            true => Self::point(self.low / o.low),
            false => self * o.inverse(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_over_a_crest_reaches_one() {
        assert_eq!(Interval::new(1.0, 2.0).sin().high, 1.0);
        assert_eq!(Interval::new(-2.0, -1.0).sin().low, -1.0);
        assert_eq!(Interval::new(4.0, 5.0).sin().low, -1.0);
        assert!(Interval::new(0.1, 0.2).sin().high < 0.2);
        assert_eq!(Interval::new(-0.1, 0.2).cos().high, 1.0);
        assert_eq!(Interval::new(0.0, 100.0).cos(), Interval::new(-1.0, 1.0));
        assert!(Interval::new(0.1, 0.2).cos().high < 0.996);
    }

    #[test]
    fn powers_keep_their_sign() {
        assert_eq!(Interval::new(-2.0, 3.0).powi(2), Interval::new(0.0, 9.0));
        assert_eq!(Interval::new(-2.0, 3.0).powi(3), Interval::new(-8.0, 27.0));
        assert_eq!(Interval::new(2.0, 4.0).powi(-1), Interval::new(0.25, 0.5));
        assert_eq!(Interval::new(-2.0, 4.0).powi(-1), Interval::ALL);
        assert_eq!(Interval::new(-2.0, 4.0).powi(0), Interval::point(1.0));
    }
}
