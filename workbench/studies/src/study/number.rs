// SPDX-License-Identifier: GPL-2.0-or-later
//! Numbers of a study with a limited range.

use serde::Deserialize;

/// A number outside its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{value}: expected {expected}")]
pub struct OutOfRange {
    value: f64,
    expected: &'static str,
}

/// Defines a finite number with a range, which is checked as a study is read.
macro_rules! limited {
    ($(#[$about:meta])* $name:ident, $expected:literal, $is_in:expr) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
        #[serde(try_from = "f64")]
        pub struct $name(pub f64);

        impl TryFrom<f64> for $name {
            type Error = OutOfRange;

            fn try_from(value: f64) -> Result<Self, OutOfRange> {
                let is_in: fn(f64) -> bool = $is_in;
                match is_in(value) && value.is_finite() {
                    true => Ok(Self(value)),
                    false => Err(OutOfRange { value, expected: $expected }),
                }
            }
        }
    };
}

limited!(
    /// A number above 0.
    Positive, "more than 0", |value| value > 0.0
);
limited!(
    /// A number of 0 or more.
    #[derive(Default)]
    NotNegative, "0 or more", |value| value >= 0.0
);
limited!(
    /// A damping ratio between 0 and 1.
    Ratio, "more than 0 and less than 1", |value| value > 0.0 && value < 1.0
);
limited!(
    /// A share of a whole, above 0.
    Share, "more than 0 and at most 1", |value| value > 0.0 && value <= 1.0
);
limited!(
    /// An angle from 0 to 180 degrees.
    Half, "an angle of 0 to 180 degrees", |value| (0.0..=180.0).contains(&value)
);
limited!(
    /// The angle of a helix to the tool axis.
    Helix, "at least 0 and less than 90 degrees", |value| (0.0..90.0).contains(&value)
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_its_range_and_names_it() {
        fn of<T: TryFrom<f64, Error = OutOfRange>>(value: f64) -> Option<String> {
            T::try_from(value).err().map(|error| error.to_string())
        }
        type Reader = fn(f64) -> Option<String>;
        for (read, good, bad, words) in [
            (of::<Positive> as Reader, [1e-9, 1e9], [0.0, -1.0], "more than 0"),
            (of::<NotNegative>, [0.0, 1e9], [-1e-9, f64::INFINITY], "0 or more"),
            (of::<Ratio>, [1e-9, 0.999], [0.0, 1.0], "more than 0 and less than 1"),
            (of::<Share>, [1e-9, 1.0], [0.0, 1.1], "more than 0 and at most 1"),
            (of::<Half>, [0.0, 180.0], [-1.0, 181.0], "an angle of 0 to 180 degrees"),
            (of::<Helix>, [0.0, 89.9], [-1.0, 90.0], "at least 0 and less than 90 degrees"),
        ] {
            assert_eq!(good.map(read), [None, None], "{words}");
            for value in bad.into_iter().chain([f64::NAN]) {
                assert_eq!(read(value), Some(format!("{value}: expected {words}")));
            }
        }
    }
}
