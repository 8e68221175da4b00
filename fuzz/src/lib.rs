// SPDX-License-Identifier: GPL-2.0-or-later
//! The fuzz targets, and the conversion of a fuzzer's bytes to numbers.

pub mod core;
pub mod entry_points;
pub mod layouts;

#[path = "../../kinsmodule/kinematics/tests/common/mod.rs"]
mod common;
#[cfg(test)]
mod short;

/// Numbers that often cause errors.
const AWKWARD: [f64; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    1e300,
    1e-300,
    90.0,
    180.0,
];

/// Reads numbers from the bytes; zeros once they are used up.
pub struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    pub fn new(data: &'a [u8]) -> Self {
        Self(data)
    }

    /// Returns whether all bytes are used up.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    /// Returns a number below `limit`, which is at most 65536.
    pub fn below(&mut self, limit: usize) -> usize {
        usize::from(u16::from_le_bytes([self.byte(), self.byte()])) % limit
    }

    /// Returns a number from −1 to 1.
    fn share(&mut self) -> f64 {
        f64::from(i16::from_le_bytes([self.byte(), self.byte()])) / 32768.0
    }

    /// Returns an arbitrary number, an awkward one, or one that differs from `usual` by up to `spread`.
    pub fn number(&mut self, usual: f64, spread: f64) -> f64 {
        match self.byte() {
            0..=15 => f64::from_le_bytes(std::array::from_fn(|_| self.byte())),
            16..=31 => AWKWARD[self.below(AWKWARD.len())],
            32..=47 => usual,
            48..=79 => usual + 1e-3 * spread * self.share(),
            80..=159 => usual + spread * self.share(),
            160..=191 => usual + 1e3 * spread * self.share(),
            192..=223 => usual * self.share(),
            _ => spread * self.share(),
        }
    }
}
