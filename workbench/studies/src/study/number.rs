// SPDX-License-Identifier: GPL-2.0-or-later
//! Numbers of a study with a limited range.

use serde::Deserialize;

/// A number that is 0 or less, or not finite.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("{0}: expected more than 0")]
pub struct NotPositive(f64);

/// A finite number above 0.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "f64")]
pub struct Positive(pub f64);

impl TryFrom<f64> for Positive {
    type Error = NotPositive;

    fn try_from(value: f64) -> Result<Self, NotPositive> {
        match value > 0.0 && value.is_finite() {
            true => Ok(Self(value)),
            false => Err(NotPositive(value)),
        }
    }
}

/// A number that is no damping ratio of an oscillation.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("{0}: expected more than 0 and less than 1")]
pub struct NoRatio(f64);

/// A damping ratio between 0 and 1.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "f64")]
pub struct Ratio(pub f64);

impl TryFrom<f64> for Ratio {
    type Error = NoRatio;

    fn try_from(value: f64) -> Result<Self, NoRatio> {
        if value > 0.0 && value < 1.0 { Ok(Self(value)) } else { Err(NoRatio(value)) }
    }
}
