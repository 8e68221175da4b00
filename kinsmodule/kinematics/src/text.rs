// SPDX-License-Identifier: GPL-2.0-or-later
//! Text for messages and names, formatted in the servo thread.
//!
//! `core::fmt` calls through pointers, so its stack cannot be bounded, and its number formatting keeps
//! panic paths. This module formats only whole numbers, numbers to six digits, and text, into a
//! buffer that truncates.

use core::str::from_utf8;

/// Significant digits of a number.
const DIGITS: usize = 6;

/// Powers of ten that scale every number between 1 and 10, each used once.
const POWERS: [(f64, i32); 9] = [
    (1e256, 256),
    (1e128, 128),
    (1e64, 64),
    (1e32, 32),
    (1e16, 16),
    (1e8, 8),
    (1e4, 4),
    (1e2, 2),
    (1e1, 1),
];

/// A part of a text.
#[derive(Clone, Copy, Debug)]
pub enum Piece<'a> {
    /// Copied unchanged.
    Text(&'a [u8]),
    /// A whole number.
    Whole(i64),
    /// A number, to six digits: `0.25`, `-1234.57`, `1e-9`.
    Number(f64),
}

impl<'a> From<&'a str> for Piece<'a> {
    fn from(text: &'a str) -> Self {
        Self::Text(text.as_bytes())
    }
}

impl<'a> From<&'a [u8]> for Piece<'a> {
    fn from(text: &'a [u8]) -> Self {
        Self::Text(text)
    }
}

impl From<usize> for Piece<'_> {
    fn from(number: usize) -> Self {
        Self::Whole(number as i64)
    }
}

impl From<u8> for Piece<'_> {
    fn from(number: u8) -> Self {
        Self::Whole(number.into())
    }
}

impl From<i32> for Piece<'_> {
    fn from(number: i32) -> Self {
        Self::Whole(number.into())
    }
}

impl From<f64> for Piece<'_> {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

/// Creates a [`Text`] from its parts: `text!["leg ", n, " of ", name]`.
#[macro_export]
macro_rules! text {
    ($($part:expr),* $(,)?) => {
        $crate::Text::of(&[$($crate::Piece::from($part)),*])
    };
}

/// Text of at most `LENGTH` − 1 bytes, truncated if longer. A zero byte follows it.
#[derive(Clone, Copy, Debug)]
pub struct Text<const LENGTH: usize> {
    bytes: [u8; LENGTH],
    used: usize,
}

impl<const LENGTH: usize> Text<LENGTH> {
    /// The empty text.
    pub const EMPTY: Self = Self { bytes: [0; LENGTH], used: 0 };

    /// Concatenates the parts.
    pub fn of(parts: &[Piece<'_>]) -> Self {
        let mut text = Self::EMPTY;
        for part in parts {
            text.push(*part);
        }
        text
    }

    /// Appends a part.
    pub fn push<'a>(&mut self, part: impl Into<Piece<'a>>) {
        match part.into() {
            Piece::Text(text) => self.append(text),
            Piece::Whole(number) => self.whole(number),
            Piece::Number(number) => self.number(number),
        }
    }

    /// Returns the text with its terminating zero, for C.
    pub fn as_bytes_with_zero(&self) -> &[u8; LENGTH] {
        &self.bytes
    }

    /// Returns the text without a truncated last character.
    pub fn as_str(&self) -> &str {
        let bytes = self.bytes.get(..self.used).unwrap_or_default();
        match from_utf8(bytes) {
            Ok(text) => text,
            Err(cut) => bytes
                .get(..cut.valid_up_to())
                .and_then(|whole| from_utf8(whole).ok())
                .unwrap_or_default(),
        }
    }

    // A call, not inlined: messages are rare, and inlining would lengthen the callers.
    fn append(&mut self, text: &[u8]) {
        for byte in text {
            self.byte(*byte);
        }
    }

    fn byte(&mut self, byte: u8) {
        if self.used + 1 < LENGTH
            && let Some(place) = self.bytes.get_mut(self.used)
        {
            *place = byte;
            self.used += 1;
        }
    }

    fn whole(&mut self, number: i64) {
        if number < 0 {
            self.byte(b'-');
        }
        // 2⁶⁴ has twenty digits.
        let mut digits = [0_u8; 20];
        let mut rest = number.unsigned_abs();
        for digit in digits.iter_mut().rev() {
            *digit = (rest % 10) as u8;
            rest /= 10;
        }
        let mut leading = digits.len() - 1;
        for digit in digits {
            if digit == 0 && leading > 0 {
                leading -= 1;
                continue;
            }
            leading = 0;
            self.byte(b'0' + digit);
        }
    }

    fn number(&mut self, number: f64) {
        if number.is_nan() {
            return self.append(b"NaN");
        }
        if number.is_sign_negative() {
            self.byte(b'-');
        }
        if number.is_infinite() {
            return self.append(b"infinite");
        }
        if number == 0.0 {
            return self.byte(b'0');
        }
        let (digits, exponent) = decimal(number.abs());
        match exponent {
            0..6 => self.places(&digits, exponent),
            -4..0 => {
                self.append(b"0.");
                for _ in exponent..-1 {
                    self.byte(b'0');
                }
                self.places(&digits, i32::MAX);
            }
            _ => {
                self.places(&digits, 0);
                self.byte(b'e');
                self.whole(exponent.into());
            }
        }
    }

    /// Appends digits without trailing zeros, with the decimal point after the digit numbered `point`.
    fn places(&mut self, digits: &[u8; DIGITS], point: i32) {
        let mut significant = DIGITS as i32;
        for digit in digits.iter().rev() {
            if *digit != 0 {
                break;
            }
            significant -= 1;
        }
        for (i, digit) in (0_i32..).zip(digits) {
            let whole = point != i32::MAX && i <= point;
            if i >= significant && !whole {
                break;
            }
            if point != i32::MAX && i == point + 1 {
                self.byte(b'.');
            }
            self.byte(b'0' + digit);
        }
    }
}

/// Computes the digits of a positive number, and the power of ten of the first one.
fn decimal(mut number: f64) -> ([u8; DIGITS], i32) {
    let mut exponent = 0;
    if number >= 10.0 {
        for (power, n) in POWERS {
            if number >= power {
                number /= power;
                exponent += n;
            }
        }
    } else {
        for (power, n) in POWERS {
            if number * power < 10.0 {
                number *= power;
                exponent -= n;
            }
        }
    }
    let mut rest = libm::round(number * 1e5) as u32;
    if rest >= 1_000_000 {
        rest /= 10;
        exponent += 1;
    }
    let mut digits = [0; DIGITS];
    for digit in digits.iter_mut().rev() {
        *digit = (rest % 10) as u8;
        rest /= 10;
    }
    (digits, exponent)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;
    use std::format;
    use std::string::{String, ToString};

    fn shown(part: impl Into<Piece<'static>>) -> String {
        Text::<64>::of(&[part.into()]).as_str().to_string()
    }

    #[test]
    fn whole_numbers_are_those_of_core() {
        for number in [0, 7, -7, 10, 409, 1_000_000, -85, i32::MAX, i32::MIN] {
            assert_eq!(shown(number), number.to_string());
        }
        assert_eq!(shown(Piece::Whole(i64::MIN)), i64::MIN.to_string());
    }

    #[test]
    fn numbers_are_written_to_six_digits() {
        for (number, text) in [
            (0.0, "0"),
            (-0.0, "-0"),
            (1.0, "1"),
            (288.0, "288"),
            (100_000.0, "100000"),
            (999_999.6, "1e6"),
            (-1234.5678, "-1234.57"),
            (0.25, "0.25"),
            (0.000_123_456_7, "0.000123457"),
            (0.000_1, "0.0001"),
            (0.000_099_999_96, "0.0001"),
            (1e-5, "1e-5"),
            (1.5e300, "1.5e300"),
            (f64::MAX, "1.79769e308"),
            (5e-324, "4.94066e-324"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "infinite"),
            (f64::NEG_INFINITY, "-infinite"),
        ] {
            assert_eq!(shown(number), text);
        }
    }

    #[test]
    fn every_number_is_read_back_to_half_of_its_sixth_digit() {
        let mut rng = Pcg64::seed_from_u64(21);
        for _ in 0..200_000 {
            let number = f64::from_bits(rng.random());
            if number.is_finite() {
                let read: f64 = shown(number).parse().unwrap();
                // Half a unit of 1.00000, and the rounding of at most nine factors.
                assert!((read - number).abs() <= 5.1e-6 * number.abs() || number.is_subnormal());
            }
        }
    }

    #[test]
    fn what_is_too_long_is_cut_between_characters_and_ends_with_a_zero() {
        let text: Text<6> = crate::text!["four", 12];
        assert_eq!(text.as_str(), "four1");
        assert_eq!(text.as_bytes_with_zero(), b"four1\0");
        let text: Text<6> = crate::text!["four", "±"];
        assert_eq!(text.as_str(), "four");
        assert_eq!(format!("{}", Text::<1>::of(&["x".into()]).as_str()), "");
    }
}
