// SPDX-License-Identifier: GPL-2.0-or-later
//! Interval arithmetic, rounded outward: every result contains all exact values of the operation, which intervals
//! with ends rounded to nearest would not.
//!
//! **Sums, products, quotients, roots** are off by at most half a unit in the last place (IEEE 754). An end x becomes
//! x ∓ |x| 2⁻⁵², which is at least one unit further out. Sums need nothing else: one below the normal numbers is
//! exact, and
//! so is 0. A product below them is off by a part of the smallest subnormal number, and is widened by that.
//!
//! **Functions** are those of the C library. The manual of glibc ("Known Maximum Errors in Math Functions") gives at
//! most 2 units in the last place for those used here, and Rust's `asinh` adds some operations; an end is
//! moved by `FUNCTION_UNITS`. An exact sum or product of two points stays a point.
//!
//! Constants of a formula are their `f64` values. An end that overflows to infinity on the
//! inner side becomes NaN, which means unknown; every comparison here and in the modules that use it treats it so.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::{Add, Div, Mul, Neg, Sub};
use wide::f64x2;

/// Largest error of a function of the C library, or one that Rust composes of them, in units in the last place.
const FUNCTION_UNITS: f64 = 8.0;

/// Roundings of the position of a crest or trough of a wave.
const CREST_UNITS: f64 = 8.0;

/// π/2, which `f64` represents slightly too small.
pub const QUARTER_TURN: Interval = Interval::new(FRAC_PI_2, FRAC_PI_2.next_up());

/// Relative width of a single number after some hundred roundings.
const THIN: f64 = 1e-12;

/// Returns a number below `x` by at least so many units in the last place; 0 for 0.
#[inline]
fn down(x: f64, units: f64) -> f64 {
    x - x.abs() * (units * f64::EPSILON)
}

/// Returns a number above `x` by at least so many units in the last place; 0 for 0.
#[inline]
fn up(x: f64, units: f64) -> f64 {
    x + x.abs() * (units * f64::EPSILON)
}

/// Returns whether a sum of two numbers is exact (Knuth's error of a sum): 2 · 0.5 − 1 is then exactly 0.
fn is_exact_sum(a: f64, b: f64) -> bool {
    let sum = a + b;
    let part = sum - a;
    (a - (sum - part)) + (b - part) == 0.0
}

/// Returns whether a product of two numbers is exact.
fn is_exact_product(a: f64, b: f64) -> bool {
    // Below this the error of a product may itself be rounded to 0.
    const LEAST: f64 = f64::MIN_POSITIVE / f64::EPSILON;
    let product = a * b;
    a == 0.0 || b == 0.0 || (product.abs() >= LEAST && a.mul_add(b, -product) == 0.0)
}

/// Numbers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// All numbers: an unknown value.
    pub const ALL: Self = Self::new(f64::NEG_INFINITY, f64::INFINITY);

    /// 0.
    pub const ZERO: Self = Self::point(0.0);

    /// Returns the interval of one number.
    pub const fn point(x: f64) -> Self {
        Self { low: x, high: x }
    }

    /// Returns the interval of two ordered numbers.
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// Widens ends that are off by this many units in the last place.
    #[inline]
    fn outward(low: f64, high: f64, units: f64) -> Self {
        Self::new(down(low, units), up(high, units))
    }

    /// Widens ends that are off by this many units, computed from nonzero numbers: below the normal numbers they are
    /// off by more, and 0 may be an underflow.
    fn outward_above_zero(low: f64, high: f64, units: f64) -> Self {
        let own = Self::outward(low, high, units);
        match low.abs() >= f64::MIN_POSITIVE && high.abs() >= f64::MIN_POSITIVE {
            true => own,
            false => Self::new(own.low - f64::MIN_POSITIVE, own.high + f64::MIN_POSITIVE),
        }
    }

    /// Encloses a value returned by a function of the C library.
    pub fn of_function(value: f64) -> Self {
        Self::outward(value, value, FUNCTION_UNITS)
    }

    /// Returns all numbers within `radius` of `middle`.
    pub fn about(middle: f64, radius: f64) -> Self {
        Self::outward(middle - radius, middle + radius, 1.0)
    }

    /// Returns whether it is a single number.
    pub fn is_point(self) -> bool {
        self.low == self.high
    }

    /// Returns whether it is a single number apart from rounding, or has an infinite or NaN end.
    pub fn is_thin(self) -> bool {
        !(self.high - self.low > THIN * self.magnitude())
    }

    /// Returns whether it contains a number.
    pub fn contains(self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// Returns the largest magnitude; infinite if unknown.
    pub fn magnitude(self) -> f64 {
        let magnitude = self.low.abs().max(self.high.abs());
        if self.low.is_nan() || self.high.is_nan() { f64::INFINITY } else { magnitude }
    }

    /// Returns the midpoint.
    pub fn middle(self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// Returns the squares: never negative, unlike `self * self`.
    pub fn squared(self) -> Self {
        self.powi(2)
    }

    /// Returns the powers of exponent `n`.
    #[inline]
    pub fn powi(self, n: i32) -> Self {
        if n < 0 {
            return self.powi(-n).inverse();
        }
        if n < 2 {
            return if n == 0 { Self::point(1.0) } else { self };
        }
        let (a, b) = match n {
            2 => (self.low * self.low, self.high * self.high),
            _ => (self.low.powi(n), self.high.powi(n)),
        };
        // At most this many roundings, for any order of the products.
        let units = f64::from(n);
        let is_even_about_zero = n % 2 == 0 && self.contains(0.0);
        let [low, high] = [if is_even_about_zero { 0.0 } else { a.min(b) }, a.max(b)];
        let own = match self.low == 0.0 || self.high == 0.0 || is_even_about_zero {
            // The larger end is 0 only for 0 itself.
            true if high >= f64::MIN_POSITIVE
                || low <= -f64::MIN_POSITIVE
                || self == Self::ZERO =>
            {
                Self::outward(low, high, units)
            }
            _ => Self::outward_above_zero(low, high, units),
        };
        if n % 2 == 0 { Self { low: own.low.max(0.0), ..own } } else { own }
    }

    /// Returns 1 / self; all numbers if self may be 0.
    pub fn inverse(self) -> Self {
        if self.low > 0.0 || self.high < 0.0 {
            Self::new((1.0 / self.high).next_down(), (1.0 / self.low).next_up())
        } else {
            Self::ALL
        }
    }

    /// Clamps at 0 from below; unknown ends stay unknown.
    pub fn positive(self) -> Self {
        let positive = |x: f64| if x < 0.0 { 0.0 } else { x };
        Self::new(positive(self.low), positive(self.high))
    }

    /// Returns the square roots of nonnegative numbers.
    pub fn sqrt(self) -> Self {
        let Self { low, high } = self.positive();
        Self::outward(low.sqrt(), high.sqrt(), 1.0)
    }

    /// Applies a monotonically increasing function of the C library.
    pub fn rising(self, of: impl Fn(f64) -> f64) -> Self {
        let (low, high) = (of(self.low), of(self.high));
        // 0 is exact for 0 itself.
        match (low == 0.0 && self.low == 0.0) || (high == 0.0 && self.high == 0.0) {
            true => Self::outward(low, high, FUNCTION_UNITS),
            false => Self::outward_above_zero(low, high, FUNCTION_UNITS),
        }
    }

    /// Returns the sines of angles in radians.
    pub fn sin(self) -> Self {
        self.wave(self.low.sin(), self.high.sin(), FRAC_PI_2)
    }

    /// Returns the cosines of angles in radians.
    pub fn cos(self) -> Self {
        self.wave(self.low.cos(), self.high.cos(), 0.0)
    }

    /// Encloses a wave with these values at the ends and a crest at an angle.
    fn wave(self, a: f64, b: f64, crest: f64) -> Self {
        let slack = CREST_UNITS * f64::EPSILON * (self.magnitude() + TAU);
        let holds = |angle: f64| {
            let next = angle + ((self.low - slack - angle) / TAU).ceil() * TAU;
            !(next > self.high + slack)
        };
        let Self { low, high } = Self::outward(a.min(b), a.max(b), FUNCTION_UNITS);
        let low = if holds(crest + PI) { -1.0 } else { low.max(-1.0) };
        let high = if holds(crest) { 1.0 } else { high.min(1.0) };
        Self::new(low, high)
    }

    /// Returns the product of two nonzero intervals, one of which may be infinite or NaN.
    #[cold]
    fn unbounded_product(self, o: Self) -> Self {
        let products = [self.low * o.low, self.low * o.high, self.high * o.low, self.high * o.high];
        if products.iter().any(|p| p.is_nan()) {
            return Self::ALL;
        }
        let [a, b, c, d] = products;
        let (low, high) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        Self::new(low.next_down(), high.next_up())
    }

    /// Widens the ends of a product of two finite intervals.
    #[inline]
    fn of_products(self, o: Self, low: f64, high: f64) -> Self {
        if self.is_point() && o.is_point() && is_exact_product(self.low, o.low) {
            return Self::point(low);
        }
        match low.abs() >= f64::MIN_POSITIVE && high.abs() >= f64::MIN_POSITIVE {
            true => Self::outward(low, high, 1.0),
            false => self.of_small_products(o, low, high),
        }
    }

    /// Widens the ends of a product if an end is 0 or below the normal numbers.
    fn of_small_products(self, o: Self, low: f64, high: f64) -> Self {
        // Ends that are 0 give exact products.
        let least = |i: Self| {
            let nonzero =
                [i.low.abs(), i.high.abs()].map(|x| if x == 0.0 { f64::INFINITY } else { x });
            nonzero[0].min(nonzero[1])
        };
        match least(self) * least(o) >= f64::MIN_POSITIVE {
            true => Self::outward(low, high, 1.0),
            false => Self::outward_above_zero(low, high, 1.0),
        }
    }

    /// Returns the hyperbolic cosines.
    pub fn cosh(self) -> Self {
        let (a, b) = (self.low.cosh(), self.high.cosh());
        let own = Self::outward(a.min(b), a.max(b), FUNCTION_UNITS);
        if self.contains(0.0) { Self { low: 1.0, ..own } } else { own }
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        // Most derivatives are 0, and a sum with 0 is exact.
        if o == Self::ZERO {
            return self;
        }
        if self == Self::ZERO {
            return o;
        }
        let (low, high) = (self.low + o.low, self.high + o.high);
        match self.is_point() && o.is_point() && is_exact_sum(self.low, o.low) {
            true => Self::point(low),
            false => Self::outward(low, high, 1.0),
        }
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
        if self == Self::ZERO || o == Self::ZERO {
            return Self::ZERO;
        }
        // The four products, two per vector.
        let ends = f64x2::new([self.low, self.high]);
        let (one, other) = (ends * f64x2::new([o.low, o.high]), ends * f64x2::new([o.high, o.low]));
        let [a, b] = (one + other).to_array();
        if (a + b).is_finite() {
            // One instruction each, unlike `f64::min`: no product is NaN.
            let ([a, b], [c, d]) = (one.fast_min(other).to_array(), one.fast_max(other).to_array());
            return self.of_products(o, if a < b { a } else { b }, if c > d { c } else { d });
        }
        self.unbounded_product(o)
    }
}

impl Mul<f64> for Interval {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        if self == Self::ZERO || factor == 0.0 {
            return Self::ZERO;
        }
        let o = Self::point(factor);
        match self.low.is_finite() && self.high.is_finite() && factor.is_finite() {
            true if factor < 0.0 => self.of_products(o, self.high * factor, self.low * factor),
            true => self.of_products(o, self.low * factor, self.high * factor),
            false => self.unbounded_product(o),
        }
    }
}

impl Div for Interval {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        if self == Self::ZERO && o.low != 0.0 && o.is_point() {
            return Self::ZERO;
        }
        // At a point the quotient is rounded once.
        match self.is_point() && o.is_point() && o.low != 0.0 {
            true => Self::new((self.low / o.low).next_down(), (self.low / o.low).next_up()),
            false => self * o.inverse(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

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
        assert!(is_about(Interval::new(-2.0, 3.0).powi(2), 0.0, 9.0));
        assert_eq!(Interval::new(-2.0, 3.0).powi(2).low, 0.0);
        assert!(is_about(Interval::new(-2.0, 3.0).powi(3), -8.0, 27.0));
        assert!(is_about(Interval::new(2.0, 4.0).powi(-1), 0.25, 0.5));
        assert_eq!(Interval::new(-2.0, 4.0).powi(-1), Interval::ALL);
        assert_eq!(Interval::new(-2.0, 4.0).powi(0), Interval::point(1.0));
        assert_eq!(Interval::ZERO.powi(2), Interval::ZERO);
    }

    /// Returns whether an interval contains both ends, and little more.
    fn is_about(found: Interval, low: f64, high: f64) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-14 * b.abs();
        found.low <= low && found.high >= high && near(found.low, low) && near(found.high, high)
    }

    /// Returns random numbers of all magnitudes, a third of them with few digits.
    fn drawn(rng: &mut Pcg64) -> f64 {
        let x: f64 = rng.random_range(-1.0..1.0);
        let x = if rng.random_bool(0.3) { (x * 64.0).round() / 64.0 } else { x };
        x * 2.0_f64.powi(rng.random_range(-40..40))
    }

    #[test]
    fn sums_products_quotients_and_roots_contain_the_exact_ones() {
        let mut rng = Pcg64::seed_from_u64(52);
        let mut rounded = 0;
        for _ in 0..100_000 {
            let (a, b) = (drawn(&mut rng), drawn(&mut rng));
            let (x, y) = (Interval::point(a), Interval::point(b));
            // Knuth's and Dekker's exact errors: result + error is the exact sum or product.
            let sum = a + b;
            let part = sum - a;
            let error = (a - (sum - part)) + (b - part);
            let product = a * b;
            let of_product = a.mul_add(b, -product);
            for (found, result, error) in
                [(x + y, sum, error), (x * y, product, of_product), (x * b, product, of_product)]
            {
                // Moved by at least one unit on the side of the error.
                assert!(error <= 0.0 || found.high > result, "{a} {b}: {found:?}");
                assert!(error >= 0.0 || found.low < result, "{a} {b}: {found:?}");
                assert!(found.contains(result));
                rounded += usize::from(error != 0.0);
            }
            if b != 0.0 {
                // a − b q is exact, and has the sign of b times that of the error of q.
                for q in [x / y, x * y.inverse()] {
                    assert!(q.low.mul_add(-b, a) * b.signum() >= 0.0, "{a} {b}: {q:?}");
                    assert!(q.high.mul_add(-b, a) * b.signum() <= 0.0, "{a} {b}: {q:?}");
                }
            }
            let root = Interval::point(a.abs()).sqrt();
            assert!(root.low.mul_add(-root.low, a.abs()) >= 0.0, "{a}: {root:?}");
            assert!(root.high.mul_add(-root.high, a.abs()) <= 0.0, "{a}: {root:?}");
        }
        // Exact results test nothing.
        assert!(rounded > 150_000, "{rounded}");
    }

    #[test]
    fn products_below_the_normal_numbers_are_not_0() {
        let tiny = Interval::point(1e-200);
        for product in [tiny * tiny, tiny * 1e-200, tiny.squared(), tiny.powi(3)] {
            assert!(product.high > 0.0 && product.low <= 0.0, "{product:?}");
        }
        assert!(Interval::point(-800.0).rising(f64::exp).high > 0.0);
        let about = Interval::new(-1e-200, 1e-200);
        assert!((about * about).low < 0.0 && about.squared().high > 0.0);
        // Without underflow 0 stays 0: most derivatives are 0.
        assert_eq!(Interval::ZERO * Interval::new(-3.0, 1e300), Interval::ZERO);
        assert_eq!((Interval::new(0.0, 2.0) * Interval::new(1.0, 3.0)).low, 0.0);
    }

    #[test]
    fn a_crest_within_rounding_of_an_end_counts() {
        // The nearest number below π/2 has a sine of 1 to all digits, and may represent one above.
        assert_eq!(Interval::new(1.0, FRAC_PI_2.next_down()).sin().high, 1.0);
        assert_eq!(Interval::new(PI.next_up(), 4.0).cos().low, -1.0);
        const { assert!(QUARTER_TURN.low < QUARTER_TURN.high) };
    }

    #[test]
    fn what_overflows_is_not_known() {
        let large = Interval::point(f64::MAX);
        for found in [large + large, large * large, large.squared()] {
            assert!(
                !(found.low.is_finite() && found.low > f64::MAX)
                    && found.magnitude() == f64::INFINITY
            );
            assert!(!found.middle().is_finite());
        }
    }
}
