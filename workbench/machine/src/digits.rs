// SPDX-License-Identifier: GPL-2.0-or-later
//! Numbers in files and reports, without the digits of rounding errors. Results for programs (CSV and JSON) keep all
//! bits: they equal those of the core, the module and Python.

/// Significant digits to which a number is rounded first: decimals of 15 digits survive a conversion to `f64`, so the
/// others are those of rounding errors.
const KNOWN: usize = 15;

/// Most significant digits of a number that counts as rounded. A number with more is a result, and keeps all.
const SHORT: usize = 12;

/// Returns the short decimal number next to a value, such as 12 for 11.999999999999998 and 0 for -0, or else the value
/// itself.
pub fn plain(value: f64) -> f64 {
    let text = format!("{value:.0$e}", KNOWN - 1);
    let short = text.split('e').next().unwrap_or_default().trim_end_matches('0');
    let count = short.chars().filter(char::is_ascii_digit).count();
    if count > SHORT {
        return value;
    }
    text.parse().unwrap_or(value) + 0.0
}

/// Formats numbers with blanks between them, as in files of LinuxCNC.
pub fn list(numbers: &[f64]) -> String {
    numbers.iter().map(|number| plain(*number).to_string()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_errors_vanish_and_results_keep_their_bits() {
        let noisy = [0.1 + 0.2, 12.0 - f64::EPSILON * 8.0, 0.7 * 700.0 / 60.0 * 60.0, 1e-3 * 7.0];
        assert_eq!(noisy.map(plain), [0.3, 12.0, 490.0, 0.007]);
        let exact = [1.0 / 3.0, 700.123456789012, f64::INFINITY, -1e300, 5e-324];
        assert_eq!(exact.map(plain).map(f64::to_bits), exact.map(f64::to_bits));
        assert!(plain(f64::NAN).is_nan());
        assert_eq!(list(&[-0.0, 0.1 + 0.2, -3.0]), "0 0.3 -3");
    }
}
