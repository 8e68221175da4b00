// SPDX-License-Identifier: GPL-2.0-or-later
//! Zeros and minima of functions of one variable.

/// Steps after which an interval cannot shrink further: halvings of the widest range of numbers.
const MOST_STEPS: usize = 200;

/// Returns the point between `low` and `high` at which a continuous function is 0; `None` if both
/// ends have the same sign. Regula falsi with the Illinois rule, and bisection where that is slow.
pub(super) fn between(mut of: impl FnMut(f64) -> f64, mut low: f64, mut high: f64) -> Option<f64> {
    let (mut at_low, mut at_high) = (of(low), of(high));
    if at_low == 0.0 {
        return Some(low);
    }
    if at_high == 0.0 {
        return Some(high);
    }
    if !(at_low * at_high < 0.0) {
        return None;
    }
    for step in 0..MOST_STEPS {
        let width = high - low;
        let secant = low - at_low * width / (at_high - at_low);
        let is_inside = secant > low && secant < high;
        let place = if is_inside && step % 3 < 2 { secant } else { low + width / 2.0 };
        if place <= low || place >= high {
            break;
        }
        let value = of(place);
        if value == 0.0 {
            return Some(place);
        }
        if (value > 0.0) == (at_high > 0.0) {
            (high, at_high) = (place, value);
            at_low /= 2.0;
        } else {
            (low, at_low) = (place, value);
            at_high /= 2.0;
        }
        if high - low <= 2.0 * f64::EPSILON * (low.abs() + high.abs()) {
            break;
        }
    }
    Some(low + (high - low) / 2.0)
}

/// Share of an interval kept by a step of golden-section search.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Returns the minimum between `low` and `high` of a function with one minimum there, to within
/// `width`.
pub(super) fn least(
    mut of: impl FnMut(f64) -> f64,
    mut low: f64,
    mut high: f64,
    width: f64,
) -> f64 {
    let mut left = high - GOLDEN * (high - low);
    let mut right = low + GOLDEN * (high - low);
    let (mut at_left, mut at_right) = (of(left), of(right));
    for _ in 0..MOST_STEPS {
        if !(high - low > width) {
            break;
        }
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - GOLDEN * (high - low);
            at_left = of(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + GOLDEN * (high - low);
            at_right = of(right);
        }
    }
    low + (high - low) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_root_is_found_to_rounding_and_only_where_the_sign_changes() {
        let root = between(|x| x * x * x - 2.0, 0.0, 10.0).unwrap();
        assert!((root - 2.0_f64.cbrt()).abs() < 4.0 * f64::EPSILON, "{root}");
        assert_eq!(between(|x| x * x + 1.0, -1.0, 2.0), None);
        assert_eq!(between(|x| x, 0.0, 1.0), Some(0.0));
    }

    #[test]
    fn a_minimum_is_found_to_the_width_asked_for() {
        let place = least(|x| (x - 0.3) * (x - 0.3), -1.0, 2.0, 1e-6);
        assert!((place - 0.3).abs() < 1e-6, "{place}");
    }
}
