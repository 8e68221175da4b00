// SPDX-License-Identifier: GPL-2.0-or-later
//! Values with their first two derivatives by one parameter, as intervals: exact derivatives of
//! expressions, at a point and enclosed over a range.
//!
//! Derivatives by the chain rule through every operation. Over one point all intervals are numbers but for
//! rounding, which each operation adds to their width.

use crate::proof::interval::{Interval, QUARTER_TURN};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A function's value, and its derivatives of first and second order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taylor {
    /// Value.
    pub value: Interval,
    /// First derivative.
    pub first: Interval,
    /// Second derivative.
    pub second: Interval,
}

impl Taylor {
    /// A number.
    pub const fn constant(x: f64) -> Self {
        Self::held(Interval::point(x))
    }

    /// Numbers that do not depend on the parameter.
    pub const fn held(value: Interval) -> Self {
        Self { value, first: Interval::ZERO, second: Interval::ZERO }
    }

    /// The parameter itself.
    pub const fn variable(value: Interval) -> Self {
        Self { value, first: Interval::point(1.0), second: Interval::ZERO }
    }

    /// The number that it is, where it does not change, to the nearest of `f64`.
    pub(super) fn as_constant(&self) -> Option<f64> {
        let is_held = self.first == Interval::ZERO && self.second == Interval::ZERO;
        (is_held && self.value.is_thin()).then(|| self.value.middle())
    }

    /// A function of it, given its value and derivatives.
    pub(super) fn composed(self, value: Interval, first: Interval, second: Interval) -> Self {
        Self {
            value,
            first: first * self.first,
            second: second * self.first.squared() + first * self.second,
        }
    }

    pub(super) fn inverse(self) -> Self {
        let over = self.value.inverse();
        let square = over.squared();
        self.composed(over, -square, square * over * 2.0)
    }

    pub(super) fn squared(self) -> Self {
        self.powi(2)
    }

    pub(super) fn powi(self, n: i32) -> Self {
        let x = self.value;
        let power = |n: i32| if n == 0 { Interval::point(1.0) } else { x.powi(n) };
        let (order, whole) = (f64::from(n), power(n));
        match n {
            0 => Self::constant(1.0),
            1 => self,
            _ => self.composed(whole, power(n - 1) * order, power(n - 2) * (order * (order - 1.0))),
        }
    }

    /// Its power of a number that is no integer.
    pub(super) fn powf(self, n: f64) -> Self {
        let power = |n: f64| match n > 0.0 {
            true => self.value.rising(|x| x.max(0.0).powf(n)),
            false => self.value.rising(|x| x.max(0.0).powf(-n)).inverse(),
        };
        self.composed(power(n), power(n - 1.0) * n, power(n - 2.0) * (n * (n - 1.0)))
    }

    pub(super) fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        let first = root.inverse() * 0.5;
        self.composed(root, first, first * self.value.inverse() * -0.5)
    }

    pub(super) fn exp(self) -> Self {
        let value = self.value.rising(f64::exp);
        self.composed(value, value, value)
    }

    pub(super) fn ln(self) -> Self {
        let over = self.value.inverse();
        self.composed(self.value.rising(|x| x.max(0.0).ln()), over, -over.squared())
    }

    pub(super) fn sin(self) -> Self {
        let (sin, cos) = (self.value.sin(), self.value.cos());
        self.composed(sin, cos, -sin)
    }

    pub(super) fn cos(self) -> Self {
        let (sin, cos) = (self.value.sin(), self.value.cos());
        self.composed(cos, -sin, -cos)
    }

    pub(super) fn sinh(self) -> Self {
        let sinh = self.value.rising(f64::sinh);
        self.composed(sinh, self.value.cosh(), sinh)
    }

    pub(super) fn cosh(self) -> Self {
        let cosh = self.value.cosh();
        self.composed(cosh, self.value.rising(f64::sinh), cosh)
    }

    pub(super) fn tanh(self) -> Self {
        let tanh = self.value.rising(f64::tanh);
        let first = Interval::point(1.0) - tanh.squared();
        self.composed(tanh, first, tanh * first * -2.0)
    }

    pub(super) fn asinh(self) -> Self {
        let over = (self.value.squared() + Interval::point(1.0)).sqrt().inverse();
        let second = -(self.value * over.powi(3));
        self.composed(self.value.rising(f64::asinh), over, second)
    }

    pub(super) fn atan(self) -> Self {
        let first = (self.value.squared() + Interval::point(1.0)).inverse();
        let second = self.value * first.squared() * -2.0;
        self.composed(self.value.rising(f64::atan), first, second)
    }

    pub(super) fn asin(self) -> Self {
        let over = (Interval::point(1.0) - self.value.squared()).sqrt().inverse();
        let value = self.value.rising(|x| x.clamp(-1.0, 1.0).asin());
        self.composed(value, over, self.value * over.powi(3))
    }

    pub(super) fn acos(self) -> Self {
        Self::held(QUARTER_TURN) - self.asin()
    }

    /// Angle of the direction (x, y) in radians, from −π to π in the middle of the range.
    ///
    /// Unbounded where the directions fill more than a half plane.
    pub(super) fn angle(y: Self, x: Self) -> Self {
        let (a, b) = (x.value.middle(), y.value.middle());
        let (c, s) = (Self::constant(a), Self::constant(b));
        let along = x * c + y * s;
        if !(along.value.low > 0.0) {
            let all = Interval::ALL;
            return Self { value: all, first: all, second: all };
        }
        ((y * c - x * s) / along).atan() + Self::held(Interval::of_function(b.atan2(a)))
    }
}

impl Add for Taylor {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            value: self.value + o.value,
            first: self.first + o.first,
            second: self.second + o.second,
        }
    }
}

impl Neg for Taylor {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, first: -self.first, second: -self.second }
    }
}

impl Sub for Taylor {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl Mul for Taylor {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self {
            value: self.value * o.value,
            first: self.first * o.value + self.value * o.first,
            second: self.second * o.value + self.first * o.first * 2.0 + self.value * o.second,
        }
    }
}

impl Mul<f64> for Taylor {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self * Self::constant(factor)
    }
}

impl Div for Taylor {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let quotient = self * o.inverse();
        Self { value: self.value / o.value, ..quotient }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function of one number that uses everything.
    fn taylor(t: Taylor) -> Taylor {
        let one = Taylor::constant(1.0);
        let waves = t.sin() * t.cos() + (t.squared() + one).sqrt().ln() / (one + t.exp());
        let powers = t.powi(3) * t.powf(0.7) + t.inverse() + t.powi(-2);
        let hyperbolic = t.sinh() * 0.1 + t.cosh() * 0.2 + t.tanh() + t.asinh();
        let half = t * 0.5;
        let arcs =
            half.asin() + half.acos() * 2.0 + t.atan() + Taylor::angle(t.sin(), t.cos() * 0.5);
        waves + powers - hyperbolic + arcs
    }

    fn plain(t: f64) -> f64 {
        let waves = t.sin() * t.cos() + (t * t + 1.0).sqrt().ln() / (1.0 + t.exp());
        let powers = t.powi(3) * t.powf(0.7) + 1.0 / t + 1.0 / (t * t);
        let hyperbolic = 0.1 * t.sinh() + 0.2 * t.cosh() + t.tanh() + t.asinh();
        let h = 0.5 * t;
        let arcs = h.asin() + 2.0 * h.acos() + t.atan() + t.sin().atan2(0.5 * t.cos());
        waves + powers - hyperbolic + arcs
    }

    #[test]
    fn derivatives_are_those_of_differences_and_hold_them_over_a_range() {
        const H: f64 = 1e-4;
        let t = 0.8;
        let at = taylor(Taylor::variable(Interval::point(t)));
        let first = (plain(t + H) - plain(t - H)) / (2.0 * H);
        let second = (plain(t + H) - 2.0 * plain(t) + plain(t - H)) / (H * H);
        assert!((at.value.middle() - plain(t)).abs() < 1e-14, "{at:?}");
        // Truncation H² times a derivative of some tens; rounding 1e-16/H².
        assert!((at.first.middle() - first).abs() < 1e-5, "{at:?} {first}");
        assert!((at.second.middle() - second).abs() < 1e-5, "{at:?} {second}");
        let wide = taylor(Taylor::variable(Interval::about(t, 0.01)));
        for n in -10..=10 {
            let at = taylor(Taylor::variable(Interval::point(t + 1e-3 * f64::from(n))));
            for (wide, at) in
                [(wide.value, at.value), (wide.first, at.first), (wide.second, at.second)]
            {
                assert!(wide.contains(at.middle()), "{wide:?} {at:?}");
            }
        }
        assert!(wide.second.magnitude() < 100.0, "{wide:?}");
    }
}
